//! Derivatives of measured channels on their way into matrices, a block of columns at a time.

use crate::reduced::sensitivity::propagate::BLOCK;
use ff_lanes::WIDEST;
use ff_model::scalar::LaneScalar;
use nalgebra::DMatrix;

/// Derivatives of some channels, column by column, each column's numbers of a sample side by side.
///
/// Some samples are gathered block by block, their numbers row by row as they come. Then they are turned and written together,
/// so that the memory of each column is visited once for all of them, in whole vectors.
pub(crate) struct Gathered<L> {
    width: usize,
    samples: usize,
    columns: usize,
    /// The first sample that is gathered, and the rows: by block, sample and channel, each of [`BLOCK`] columns.
    first: usize,
    group: Vec<L>,
    out: Vec<f64>,
}

impl<L: LaneScalar> Gathered<L> {
    /// Samples that are gathered: a multiple of the lanes.
    const SAMPLES: usize = WIDEST;
    /// Vectors in a row of a block.
    const PARTS: usize = BLOCK / L::N;

    pub(crate) fn new(width: usize, samples: usize, columns: usize) -> Self {
        let group = vec![L::zero(); width * Self::SAMPLES * columns.div_ceil(BLOCK) * Self::PARTS];
        Self { width, samples, columns, first: 0, group, out: vec![0.0; width * samples * columns] }
    }
    /// Samples up to this one are complete. They come in order.
    #[inline(always)]
    pub(crate) fn begin(&mut self, sample: usize) {
        if sample - self.first == Self::SAMPLES {
            self.flush(Self::SAMPLES);
            self.first = sample;
        }
    }
    /// The rows of a block at the sample that has begun.
    #[inline(always)]
    pub(crate) fn rows<const W: usize>(&mut self, block: usize, sample: usize) -> &mut [[L; W]] {
        let first = (block * Self::SAMPLES + sample - self.first) * self.width;
        &mut self.group.as_chunks_mut().0[first..first + self.width]
    }
    #[inline(always)]
    fn flush(&mut self, samples: usize) {
        let Self { width, columns, group, out, .. } = self;
        let (count, stride, first) = (samples * *width, *width * self.samples, *width * self.first);
        let whole = count - count % L::N;
        if count == 0 {
            return;
        }
        for (block, rows) in group.chunks_exact(*width * Self::SAMPLES * Self::PARTS).enumerate() {
            for part in 0..Self::PARTS {
                let c = block * BLOCK + part * L::N;
                let used = L::N.min(columns.saturating_sub(c));
                for at in (0..whole).step_by(L::N) {
                    let x = L::transpose(&rows[at * Self::PARTS + part..], Self::PARTS);
                    for i in 0..L::N {
                        if i < used {
                            x[i].store(&mut out[(c + i) * stride + first + at..]);
                        }
                    }
                }
                for at in whole..count {
                    for i in 0..used {
                        out[(c + i) * stride + first + at] = rows[at * Self::PARTS + part].lane(i);
                    }
                }
            }
        }
    }
    /// All of it, once the last sample is complete.
    #[inline(always)]
    pub(crate) fn done(mut self) -> DMatrix<f64> {
        self.flush(self.samples - self.first);
        let rows = self.width * self.samples;
        DMatrix::from_vec(rows, if rows > 0 { self.columns } else { 0 }, self.out)
    }
}
