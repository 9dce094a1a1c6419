//! How derivatives of the state go through a step, block of columns by block.
//!
//! `dz' = [dal | dnu | dnu' | (dv)]` with `[da | dal | dnu'] = G dz + F` at each stage of the classical Runge-Kutta method,
//! `G = -M^-1 R_z` and `F = -M^-1 R_p` from `tangent.rs`. A block of eight columns goes through all four stages while it is
//! in the first cache, a number of `G` serving all of it.

use crate::linalg::rows::{BLOCK, RowTask, accumulate, by_rows, copy, fma};
use crate::reduced::sensitivity::carried::Carried;
use crate::reduced::sensitivity::sink::Sink;
use crate::reduced::sensitivity::stage::Tangent;
use crate::reduced::sensitivity::wanted::Wanted;
use crate::reduced::system::{STAGE, WEIGHT};
use crate::sim::attitude::{Attitude, AttitudeTrack, Turned};
use ff_lanes::{Kernel, WIDEST};
use ff_model::Model;
use ff_model::scalar::LaneScalar;

/// Stages whose derivatives are at hand at once, at most: one per lane.
const STAGES: usize = WIDEST;

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
    /// `G` per stage, `n x nz`, column by column; stages are `stride` apart, a multiple of the lanes.
    gain: Vec<f64>,
    stride: usize,
    /// `F` per block and stage, `n x 8`.
    force: Vec<L>,
    /// `[w 3 | eta | nu | (v 3)]` per block, `nz x 8`.
    dz: Vec<L>,
    /// Derivatives of the attitude, `3 x width`, and how they go through the step.
    dtheta: Vec<f64>,
    pub(crate) turn: Option<Turned>,
    /// One block of columns, row by row: at the stage, at the end of the step so far, and accelerations.
    x: Vec<L>,
    sum: Vec<L>,
    y: Vec<L>,
    /// The solved columns of the state, or a block of those of parameters, stages in lanes.
    solved: Vec<L>,
}

impl<L: LaneScalar> Flow<L> {
    pub(crate) fn new(model: &Model, nz: usize, wanted: &Wanted, h: f64, carried: &Carried) -> Self {
        let (m, count) = (model.np(), wanted.len());
        let (n, blocks) = (6 + m, count.div_ceil(BLOCK));
        assert_eq!(carried.dz.len(), nz * blocks * BLOCK, "columns that were carried");
        let stride = (n * nz).next_multiple_of(L::N);
        let z = |k: usize| vec![L::zero(); k * BLOCK / L::N];
        let dz = carried.dz.chunks_exact(L::N).map(L::load).collect();
        Self {
            m,
            n,
            nz,
            np: wanted.forced(),
            count,
            h,
            gain: vec![0.0; STAGES * stride],
            stride,
            force: z(blocks * STAGES * n),
            dz,
            dtheta: carried.dtheta.clone(),
            turn: None,
            x: z(nz),
            sum: z(nz),
            y: z(n),
            solved: vec![L::zero(); stride.max(n * BLOCK)],
        }
    }

    /// The columns as they are, for the next part of the record.
    pub(crate) fn hand_over(&self, dz: &mut [f64], dtheta: &mut [f64]) {
        dz.chunks_exact_mut(L::N).zip(&self.dz).for_each(|(to, x)| x.store(to));
        dtheta.copy_from_slice(&self.dtheta);
    }

    /// Solves for all columns, and turns lanes of stages into rows of parameters. Not inlined, as [`Flow::step`]: in one
    /// function with everything else, the compiler runs out of registers for where things are (a quarter of the time).
    #[inline(never)]
    pub(crate) fn take(&mut self, tangent: &Tangent<'_, L>) {
        L::enter(Take { flow: self, tangent });
    }

    /// [`Flow::take`] where it is compiled for its instructions.
    #[inline(always)]
    fn solve(&mut self, t: &Tangent<'_, L>) {
        let (n, nz) = (self.n, self.nz);
        // Column by column, so that as many numbers as there are lanes are turned at once.
        t.solve_states(&mut self.solved);
        for k in (0..n * nz).step_by(L::N) {
            let stages = L::transpose(&self.solved[k..], 1);
            for stage in 0..L::N {
                stages[stage].store(&mut self.gain[stage * self.stride + k..]);
            }
        }
        // A vector of stages per column becomes a vector of columns per stage.
        let (np, parts) = (self.np, BLOCK / L::N);
        for (block, force) in self.force.chunks_exact_mut(STAGES * n * parts).take(np.div_ceil(BLOCK)).enumerate() {
            let columns = block * BLOCK..((block + 1) * BLOCK).min(np);
            if columns.len() < BLOCK {
                self.solved[columns.len() * n..].fill(L::zero());
            }
            t.solve_params(columns, &mut self.solved);
            for part in 0..parts {
                for r in 0..n {
                    let stages = L::transpose(&self.solved[part * L::N * n + r..], n);
                    for stage in 0..L::N {
                        force[(stage * n + r) * parts + part] = stages[stage];
                    }
                }
            }
        }
    }

    /// Carries all columns through the step whose stages are lanes `lane..lane + 4`, with their states in `points`; hands the start
    /// of the step to `sink`. Without `advance` there is nothing but that start.
    #[inline(never)]
    pub(crate) fn step(
        &mut self,
        lane: usize,
        advance: bool,
        points: &[Vec<f64>; WIDEST],
        sink: Option<&mut Sink<'_, L>>,
    ) {
        L::enter(Step { flow: self, lane, advance, points, sink });
    }

    /// [`Flow::step`] with `W` vectors per row of a block.
    #[inline(always)]
    fn carry<const W: usize>(
        &mut self,
        lane: usize,
        advance: bool,
        points: &[Vec<f64>; WIDEST],
        mut sink: Option<&mut Sink<'_, L>>,
    ) {
        let (n, nz, m) = (self.n, self.nz, self.m);
        let at_speed = nz > 3 + 2 * m;
        let [dz, x, sum, y] = [&mut self.dz, &mut self.x, &mut self.sum, &mut self.y].map(|v| v.as_chunks_mut::<W>().0);
        let width = dz.len() / nz * BLOCK;
        let forces = self.force.as_chunks::<W>().0.chunks_exact(STAGES * n);
        for (block, (x0, forces)) in dz.chunks_exact_mut(nz).zip(forces).enumerate() {
            let from = |w: usize| block * BLOCK + w * L::N;
            let mut theta = [[L::zero(); 3]; W];
            let turn = self.turn.as_ref().filter(|_| !self.dtheta.is_empty());
            if let Some(turn) = turn {
                for w in 0..W {
                    theta[w] = turn.carried(&self.dtheta, width, from(w));
                }
            }
            for stage in 0..4 {
                let z = if stage == 0 { &*x0 } else { &*x };
                if let Some(turn) = turn {
                    for w in 0..W {
                        turn.add(&mut theta[w], stage, &[z[0][w], z[1][w], z[2][w]]);
                    }
                }
                let now = lane + stage;
                let first = if at_speed || (sink.is_some() && stage == 0) { 0 } else { 3 };
                let gain = &self.gain[now * self.stride..][..n * nz];
                let force = &forces[now * n..(now + 1) * n];
                by_rows::<W>(first..n, &mut Accelerations { gain, force, z, y });
                if stage == 0
                    && let Some(sink) = &mut sink
                {
                    sink.take(block, z, y);
                }
                if !advance {
                    break;
                }
                let by = (
                    L::splat(WEIGHT[stage] * self.h),
                    L::splat(if stage < 3 { 0.5 * self.h * STAGE[stage + 1] as f64 } else { 0.0 }),
                );
                let mut v = [[L::zero(); W]; 3];
                if at_speed {
                    v = speed(z, &points[now], &y[..3], m);
                }
                let (z_head, z_rates) = x0.split_at_mut(3 + m);
                let (x_head, x_rates) = x.split_at_mut(3 + m);
                let (sum_head, sum_rates) = sum.split_at_mut(3 + m);
                // Coordinates before their rates, which are overwritten next.
                let rates = if stage == 0 { &z_rates[..m] } else { &x_rates[..m] };
                along(stage, by, rates, &mut z_head[3..], &mut sum_head[3..], &mut x_head[3..]);
                along(stage, by, &y[3..6], z_head, sum_head, x_head);
                along(stage, by, &y[6..], z_rates, sum_rates, x_rates);
                if at_speed {
                    along(stage, by, &v, &mut z_rates[m..], &mut sum_rates[m..], &mut x_rates[m..]);
                }
            }
            if turn.is_some() && advance {
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

/// `y = F + G z` for a block of columns.
struct Accelerations<'a, L, const W: usize> {
    gain: &'a [f64],
    force: &'a [[L; W]],
    z: &'a [[L; W]],
    y: &'a mut [[L; W]],
}

impl<L: LaneScalar, const W: usize> RowTask for Accelerations<'_, L, W> {
    #[inline(always)]
    fn rows<const R: usize>(&mut self, from: usize) {
        let mut s = [[L::zero(); W]; R];
        copy::<_, R>(&self.force[from..], &mut s);
        accumulate(&mut s, L::splat, self.gain, self.y.len(), from, self.z);
        copy::<_, R>(&s, &mut self.y[from..]);
    }
}

/// Takes the rates `k` of a stage in, weighted with `b` for the end of the step and with `c` for the next stage. What is summed
/// up becomes `x0` in the last stage.
#[inline(always)]
fn along<L: LaneScalar, const W: usize>(
    stage: usize,
    (b, c): (L, L),
    k: &[[L; W]],
    x0: &mut [[L; W]],
    sum: &mut [[L; W]],
    x: &mut [[L; W]],
) {
    let rows = k.iter().zip(x0).zip(sum).zip(x);
    match stage {
        0 => {
            for (((k, x0), sum), x) in rows {
                for w in 0..W {
                    sum[w] = fma(b, k[w], x0[w]);
                    x[w] = fma(c, k[w], x0[w]);
                }
            }
        }
        3 => {
            for (((k, x0), sum), _) in rows {
                for w in 0..W {
                    x0[w] = fma(b, k[w], sum[w]);
                }
            }
        }
        _ => {
            for (((k, x0), sum), x) in rows {
                for w in 0..W {
                    sum[w] = fma(b, k[w], sum[w]);
                    x[w] = fma(c, k[w], x0[w]);
                }
            }
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

/// [`Flow::take`].
struct Take<'a, 'b, L: LaneScalar> {
    flow: &'a mut Flow<L>,
    tangent: &'a Tangent<'b, L>,
}

impl<L: LaneScalar> Kernel for Take<'_, '_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.flow.solve(self.tangent);
    }
}

/// [`Flow::step`].
struct Step<'a, 'b, L: LaneScalar> {
    flow: &'a mut Flow<L>,
    lane: usize,
    advance: bool,
    points: &'a [Vec<f64>; WIDEST],
    sink: Option<&'a mut Sink<'b, L>>,
}

impl<L: LaneScalar> Kernel for Step<'_, '_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { flow, lane, advance, points, sink } = self;
        // Lanes are four or eight.
        if L::N == BLOCK {
            flow.carry::<1>(lane, advance, points, sink);
        } else {
            flow.carry::<2>(lane, advance, points, sink);
        }
    }
}
