//! How derivatives of the state go through a step, block of columns by block.
//!
//! `dz' = [dal | dnu | dnu' | (dv)]` with `[da | dal | dnu'] = G dz + F` at each stage of the classical Runge-Kutta method,
//! `G = -M^-1 R_z` and `F = -M^-1 R_p` from `tangent.rs`. A block of eight columns goes through all four stages while it is
//! in the first cache, a number of `G` serving all of it.

use crate::attitude::{Attitude, AttitudeTrack, Turned};
use crate::reduced::{STAGE, WEIGHT};
use crate::sensitivity::{Sink, Wanted};
use crate::tangent::{Tangent, fma};
use ff_model::{LaneScalar, Model};

/// Columns of a block: as many as the widest lanes have.
pub(crate) const BLOCK: usize = 8;
/// Stages whose derivatives are at hand at once, at most: one per lane.
const STAGES: usize = 8;

/// The columns `dz`, and what carries them through a step.
pub(crate) struct Flow<L> {
    m: usize,
    /// Rows of the accelerations and of the state.
    n: usize,
    pub(crate) nz: usize,
    /// Wanted parameters, and columns in all.
    np: usize,
    count: usize,
    h: f64,
    /// `G` per stage, `n x nz`, column by column.
    gain: Vec<f64>,
    /// `F` per block and stage, `n x 8`.
    force: Vec<f64>,
    /// `[w 3 | eta | nu | (v 3)]` per block, `nz x 8`.
    dz: Vec<f64>,
    /// Derivatives of the attitude, `3 x width`, and how they go through the step.
    dtheta: Vec<f64>,
    pub(crate) turn: Option<Turned>,
    /// One block of columns, row by row: at the start of the step, at the stage, at its end, and accelerations.
    x0: Vec<L>,
    x: Vec<L>,
    sum: Vec<L>,
    y: Vec<L>,
}

impl<L: LaneScalar> Flow<L> {
    pub(crate) fn new(model: &Model, nz: usize, wanted: &Wanted, h: f64) -> Self {
        let (m, count) = (model.np(), wanted.len());
        let (n, blocks) = (6 + m, count.div_ceil(BLOCK));
        let mut dz = vec![0.0; nz * blocks * BLOCK];
        for (c, &i) in wanted.initial.iter().enumerate() {
            // The state of the record is `[v | w | eta | nu]`.
            let (row, c) = (if i < 3 { 3 + 2 * m + i } else { i - 3 }, wanted.params.len() + c);
            if row < nz {
                dz[(c / BLOCK * nz + row) * BLOCK + c % BLOCK] = 1.0;
            }
        }
        let z = |k: usize| vec![L::zero(); k * BLOCK / L::N];
        Self {
            m,
            n,
            nz,
            np: wanted.params.len(),
            count,
            h,
            gain: vec![0.0; STAGES * n * nz],
            force: vec![0.0; blocks * STAGES * n * BLOCK],
            dz,
            dtheta: vec![0.0; if wanted.attitude { 3 * blocks * BLOCK } else { 0 }],
            turn: None,
            x0: z(nz),
            x: z(nz),
            sum: z(nz),
            y: z(n),
        }
    }

    /// Turns lanes of stages into rows of parameters.
    #[inline(always)]
    pub(crate) fn take(&mut self, t: &Tangent<'_, L>) {
        let (n, nz) = (self.n, self.nz);
        // Both lie column by column, so that as many numbers as there are lanes are turned at once.
        let mut lane = [0.0; STAGES];
        for (k, gains) in t.gz[..n * nz].chunks(L::N).enumerate() {
            let mut x = [L::zero(); BLOCK];
            x[..gains.len()].copy_from_slice(gains);
            L::transpose(&mut x[..L::N]);
            for (stage, x) in x[..L::N].iter().enumerate() {
                let to = &mut self.gain[stage * n * nz + k * L::N..][..gains.len()];
                if gains.len() == L::N {
                    x.store(to);
                } else {
                    x.store(&mut lane);
                    to.copy_from_slice(&lane[..gains.len()]);
                }
            }
        }
        // A vector of stages per column becomes a vector of columns per stage; spare columns stay zero.
        let blocks = self.force.chunks_exact_mut(STAGES * n * BLOCK);
        for (force, columns) in blocks.zip(t.gp[..n * self.np].chunks(n * BLOCK)) {
            let count = columns.len() / n;
            for r in 0..n {
                let mut x = [L::zero(); BLOCK];
                for (x, column) in x.iter_mut().zip(columns.chunks_exact(n)).take(count) {
                    *x = column[r];
                }
                for (part, x) in x.chunks_exact_mut(L::N).enumerate() {
                    L::transpose(x);
                    for (stage, x) in x.iter().enumerate() {
                        x.store(&mut force[(stage * n + r) * BLOCK + part * L::N..]);
                    }
                }
            }
        }
    }

    /// Carries all columns through the step whose stages are lanes `lane..lane + 4`, with their states in `points`; hands the start
    /// of the step to `sink`. Without `advance` there is nothing but that start.
    #[inline(always)]
    pub(crate) fn step(&mut self, lane: usize, advance: bool, points: &[Vec<f64>; 8], sink: Option<&mut Sink<'_>>) {
        // Lanes are four or eight.
        if L::N == BLOCK {
            self.carry::<1>(lane, advance, points, sink);
        } else {
            self.carry::<2>(lane, advance, points, sink);
        }
    }

    /// [`Flow::step`] with `W` vectors per row of a block.
    #[inline(always)]
    fn carry<const W: usize>(
        &mut self,
        lane: usize,
        advance: bool,
        points: &[Vec<f64>; 8],
        mut sink: Option<&mut Sink<'_>>,
    ) {
        let (n, nz, m) = (self.n, self.nz, self.m);
        let at_speed = nz > 3 + 2 * m;
        let [x0, x, sum, y] = [&mut self.x0, &mut self.x, &mut self.sum, &mut self.y].map(|v| v.as_chunks_mut::<W>().0);
        let width = self.dz.len() / nz;
        let forces = self.force.chunks_exact(STAGES * n * BLOCK);
        for (block, (dz, forces)) in self.dz.chunks_exact_mut(nz * BLOCK).zip(forces).enumerate() {
            for (((x0, x), sum), row) in x0.iter_mut().zip(&mut *x).zip(&mut *sum).zip(dz.chunks_exact(BLOCK)) {
                for w in 0..W {
                    x0[w] = L::load(&row[w * L::N..]);
                }
                (*x, *sum) = (*x0, *x0);
            }
            let from = |w: usize| block * BLOCK + w * L::N;
            let mut theta = [[L::zero(); 3]; W];
            let turn = self.turn.as_ref().filter(|_| !self.dtheta.is_empty());
            if let Some(turn) = turn {
                for w in 0..W {
                    theta[w] = turn.carried(&self.dtheta, width, from(w));
                }
            }
            for stage in 0..4 {
                if let Some(turn) = turn {
                    for w in 0..W {
                        turn.add(&mut theta[w], stage, &[x[0][w], x[1][w], x[2][w]]);
                    }
                }
                let now = lane + stage;
                let first = if at_speed || (sink.is_some() && stage == 0) { 0 } else { 3 };
                let force = &forces[now * n * BLOCK..(now + 1) * n * BLOCK];
                accelerations(&self.gain[now * n * nz..(now + 1) * n * nz], n, first, x, force, y);
                if stage == 0
                    && let Some(sink) = &mut sink
                {
                    sink.take(block, x0, y);
                }
                if !advance {
                    break;
                }
                let by = (
                    L::splat(WEIGHT[stage] * self.h),
                    L::splat(if stage < 3 { 0.5 * self.h * STAGE[stage + 1] as f64 } else { 0.0 }),
                );
                if at_speed {
                    let v = speed(x, &points[now], &y[..3], m);
                    along(&v, &x0[3 + 2 * m..], &mut sum[3 + 2 * m..], &mut x[3 + 2 * m..], by);
                }
                along(&y[3..6], x0, sum, x, by);
                // Coordinates before their rates, which are overwritten next.
                let (coordinates, rates) = x.split_at_mut(3 + m);
                along(&rates[..m], &x0[3..], &mut sum[3..], &mut coordinates[3..], by);
                along(&y[6..], &x0[3 + m..], &mut sum[3 + m..], rates, by);
            }
            if !advance {
                continue;
            }
            for (x, row) in sum.iter().zip(dz.chunks_exact_mut(BLOCK)) {
                for w in 0..W {
                    x[w].store(&mut row[w * L::N..]);
                }
            }
            if turn.is_some() {
                for w in 0..W {
                    for i in 0..3 {
                        theta[w][i].store(&mut self.dtheta[i * width + from(w)..]);
                    }
                }
            }
        }
    }

    /// Writes the attitude and its derivatives at a sample.
    pub(crate) fn attitude_rows(&self, to: &mut Option<Attitude>, track: &AttitudeTrack, sample: usize) {
        if let Some(to) = to {
            to.write(sample, track, &self.dtheta, self.dtheta.len() / 3, self.count);
        }
    }
}

/// `y = F + G x` from row `from` on.
#[inline(always)]
fn accelerations<L: LaneScalar, const W: usize>(
    gain: &[f64],
    n: usize,
    from: usize,
    x: &[[L; W]],
    force: &[f64],
    y: &mut [[L; W]],
) {
    let mut r = from;
    while r < n {
        let left = (n - r).min(4);
        match left {
            4 => product::<L, 4, W>(gain, n, r, x, force, y),
            3 => product::<L, 3, W>(gain, n, r, x, force, y),
            2 => product::<L, 2, W>(gain, n, r, x, force, y),
            _ => product::<L, 1, W>(gain, n, r, x, force, y),
        }
        r += left;
    }
}

/// `R` rows of [`accelerations`]: they and the numbers of a column stay in registers.
#[inline(always)]
fn product<L: LaneScalar, const R: usize, const W: usize>(
    gain: &[f64],
    n: usize,
    from: usize,
    x: &[[L; W]],
    force: &[f64],
    y: &mut [[L; W]],
) {
    let mut s = [[L::zero(); W]; R];
    for (s, f) in s.iter_mut().zip(force[from * BLOCK..].chunks_exact(BLOCK)) {
        for w in 0..W {
            s[w] = L::load(&f[w * L::N..]);
        }
    }
    for (x, g) in x.iter().zip(gain.chunks_exact(n)) {
        let g = &g[from..from + R];
        for r in 0..R {
            let k = L::splat(g[r]);
            for w in 0..W {
                s[r][w] = fma(k, x[w], s[r][w]);
            }
        }
    }
    y[from..from + R].copy_from_slice(&s);
}

/// Takes rates `k` in: `sum += b k`, and `x = x0 + c k` for the next stage.
#[inline(always)]
fn along<L: LaneScalar, const W: usize>(
    k: &[[L; W]],
    x0: &[[L; W]],
    sum: &mut [[L; W]],
    x: &mut [[L; W]],
    (b, c): (L, L),
) {
    for (((k, x0), sum), x) in k.iter().zip(x0).zip(sum).zip(x) {
        for w in 0..W {
            sum[w] = fma(b, k[w], sum[w]);
            x[w] = fma(c, k[w], x0[w]);
        }
    }
}

/// Rates of the base velocity, `v' = a - w x v`, at a point with twist `z`.
#[inline(always)]
fn speed<L: LaneScalar, const W: usize>(x: &[[L; W]], z: &[f64], a: &[[L; W]], m: usize) -> [[L; W]; 3] {
    let (dw, dv) = (&x[..3], &x[3 + 2 * m..3 + 2 * m + 3]);
    let s = |i: usize| L::splat(z[i]);
    let mut out = [[L::zero(); W]; 3];
    for i in 0..3 {
        let (j, l) = ((i + 1) % 3, (i + 2) % 3);
        for w in 0..W {
            let turned = dw[j][w] * s(l) - dw[l][w] * s(j) + (s(3 + j) * dv[l][w] - s(3 + l) * dv[j][w]);
            out[i][w] = a[i][w] - turned;
        }
    }
    out
}
