//! Where the samples of a record and their derivatives go.

use crate::linalg::rows::{BLOCK, RowTask, accumulate, by_rows, copy};
use crate::reduced::sensitivity::assemble::Gathered;
use crate::reduced::sensitivity::outputs::TorqueRows;
use crate::reduced::sensitivity::partials::Columns;
use crate::reduced::sensitivity::wanted::Wanted;
use crate::reduced::system::Response;
use crate::reduced::table::Prescribed;
use crate::sim::attitude::{Attitude, AttitudeTrack};
use core::ops::Range;
use ff_model::scalar::LaneScalar;
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// Where samples go.
pub(crate) struct Sink<'a, L> {
    model: &'a Model,
    pub(crate) response: Response,
    /// Joint torques of the present sample.
    pub(crate) tau: Vec<f64>,
    d_tau: Gathered<L>,
    d_gyro: Gathered<L>,
    accel: Option<Gathered<L>>,
    rows: TorqueRows<'a>,
    /// Sample of the table that is the first here, and the present one, counted from it.
    first: usize,
    sample: usize,
    pub(crate) track: Option<AttitudeTrack>,
    pub(crate) attitude: Option<Attitude>,
}

impl<'a, L: LaneScalar> Sink<'a, L> {
    pub(crate) fn new(
        model: &'a Model,
        params: &'a Params<f64>,
        table: &'a Prescribed,
        wanted: &Wanted,
        columns: &'a Columns,
        span: &Range<usize>,
    ) -> Self {
        let (n, p) = (span.len(), wanted.len());
        Self {
            model,
            response: Response::new(n, model.nj(), model.np()),
            tau: vec![0.0; model.nj()],
            d_tau: Gathered::new(model.nj(), n, p),
            d_gyro: Gathered::new(3, n, p),
            accel: wanted.accel.then(|| Gathered::new(6, n, p)),
            rows: TorqueRows::new(model, params, table, columns),
            first: span.start,
            sample: 0,
            track: None,
            attitude: wanted.attitude.then(|| Attitude::new(n, p)),
        }
    }

    /// Begins a sample with state `z` and accelerations `u`.
    #[inline(always)]
    pub(crate) fn begin(&mut self, sample: usize, (z, u): (&[f64], &[f64])) {
        self.sample = sample - self.first;
        // One call: it is inlined.
        for gathered in [Some(&mut self.d_tau), Some(&mut self.d_gyro), self.accel.as_mut()].into_iter().flatten() {
            gathered.begin(self.sample);
        }
        self.rows.evaluate(sample, z, u);
    }

    /// Torque and gyro derivatives of a block of columns at the present sample, from `dz` and `du`.
    #[inline(always)]
    pub(crate) fn take<const W: usize>(&mut self, block: usize, dz: &[[L; W]], du: &[[L; W]]) {
        let (rows, at) = (&self.rows, self.sample);
        by_rows::<W>(0..self.model.nj(), &mut Torques { rows, block, dz, du, to: self.d_tau.rows(block, at) });
        copy::<_, 3>(dz, self.d_gyro.rows(block, at));
        if let Some(to) = &mut self.accel {
            copy::<_, 6>(du, to.rows(block, at));
        }
    }

    #[inline(always)]
    pub(crate) fn done(self) -> Samples {
        let Self { d_tau, d_gyro, accel, response, attitude, .. } = self;
        Samples { response, tau: d_tau.done(), gyro: d_gyro.done(), accel: accel.map(Gathered::done), attitude }
    }
}

/// What has been gathered: the response, and the derivatives of torques, gyro, accelerations and attitude.
pub(crate) struct Samples {
    pub(crate) response: Response,
    pub(crate) tau: DMatrix<f64>,
    pub(crate) gyro: DMatrix<f64>,
    pub(crate) accel: Option<DMatrix<f64>>,
    pub(crate) attitude: Option<Attitude>,
}

/// Torques of a block of columns at a sample.
struct Torques<'a, L, const W: usize> {
    rows: &'a TorqueRows<'a>,
    block: usize,
    dz: &'a [[L; W]],
    du: &'a [[L; W]],
    to: &'a mut [[L; W]],
}

impl<L: LaneScalar, const W: usize> RowTask for Torques<'_, L, W> {
    #[inline(always)]
    fn rows<const R: usize>(&mut self, from: usize) {
        let TorqueRows { by_u, by_z, by_p, wide, carried, .. } = self.rows;
        let nj = self.to.len();
        let mut s = [[L::zero(); W]; R];
        let (mut du, mut dz) = (self.du, self.dz);
        if !carried {
            (du, dz) = (&du[..6], &dz[..3]);
        } else if self.block * BLOCK < *wide {
            for r in 0..R {
                let own = &by_p[(from + r) * wide + self.block * BLOCK..];
                for w in 0..W {
                    s[r][w] = L::load(&own[w * L::N..]);
                }
            }
        }
        accumulate(&mut s, L::splat, by_u, nj, from, du);
        accumulate(&mut s, L::splat, by_z, nj, from, dz);
        copy::<_, R>(&s, &mut self.to[from..]);
    }
}
