//! Free flight under a prescribed joint motion, step by step: the reduced system with position and attitude beside it.
//!
//! What [`mod@crate::sim::simulate::simulate`] and [`mod@crate::sim::ensemble`] run when the base floats freely, nothing acts from outside and
//! the joints follow a motion: twist and passive states do not depend on position and attitude then, and the arm is a
//! table ([`crate::reduced::table`]), filled for a block of samples at a time so that it stays in the cache. Position and
//! attitude follow from the base twists at the stages, by the formulas of [`crate::sim::integrate::Rkmk4`].

use crate::reduced::system::{Buffers, Reduced, Rk4, STAGE, WEIGHT};
use crate::reduced::table::{Prescribed, Sampling};
use crate::tree::aba::SingularInertia;
use ff_lanes::Kernel;
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::so3::{Quat, dexp_inv_body, exp_so3, quat_mul, quat_normalize, quat_to_rot};
use ff_model::spatial::vec3::V3;
use ff_model::{BaseKind, Model, Params};
use nalgebra::Vector3;

/// Steps of a block: enough that its setup does not count, few enough that its tables stay in the cache.
const BLOCK: usize = 64;

/// Whether a model without external inputs flies freely, every joint moving by itself.
pub(crate) fn applies(model: &Model) -> bool {
    model.base_kind() == BaseKind::Floating && model.gravity().norm() == 0.0 && model.coordinates().is_none()
}

/// Samples per block, and a table for so many.
pub(crate) fn table(model: &Model, sample_s: f64, substeps: usize, samples: usize) -> (usize, Prescribed) {
    let per_block = (BLOCK / substeps).clamp(1, samples.max(2) - 1);
    let sampling = Sampling { samples: per_block + 1, sample_s, substeps };
    (per_block, Prescribed::empty(model, &sampling, &[]))
}

/// A stretch of the samples that one table covers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// Its first sample.
    pub(crate) first: usize,
    /// Sample intervals.
    pub(crate) intervals: usize,
    /// Whether the sample at its end is the last; it belongs to the next span otherwise.
    pub(crate) last: bool,
}

/// The spans of a flight of so many samples.
pub(crate) fn spans(samples: usize, per_block: usize) -> impl Iterator<Item = Span> {
    // A single sample is a span without intervals.
    (0..(samples - 1).max(1)).step_by(per_block).map(move |first| {
        let intervals = per_block.min(samples - 1 - first);
        Span { first, intervals, last: first + intervals + 1 == samples }
    })
}

/// One moment of a flight.
pub(crate) struct Moment<'s, T> {
    pub(crate) pos: &'s Vector3<T>,
    pub(crate) att: &'s Quat<T>,
    /// `[V | eta | nu]`.
    pub(crate) z: &'s [T],
}

/// What is known at a sample beside the state.
pub(crate) struct Reading<'s, T> {
    /// `[a | al | nu']`.
    pub(crate) u: &'s [T],
    /// Joint torques.
    pub(crate) tau: &'s [T],
    /// `[q | qd | qdd]`.
    pub(crate) joints: &'s [f64],
    /// Energy dissipated, and work of the joint torques, since the start.
    pub(crate) energy: &'s [T; 2],
}

/// What becomes of the samples.
pub(crate) trait Sink<T> {
    /// Why a flight ends early.
    type Error;
    /// Sample `i`.
    fn sample(&mut self, i: usize, at: &Moment<'_, T>, now: &Reading<'_, T>);
    /// The state at the end of the interval that begins with sample `i`.
    fn check(&mut self, i: usize, at: &Moment<'_, T>) -> Result<(), Self::Error>;
    /// A mass matrix is not positive definite at state `z`, `node` half steps after sample `i`.
    fn singular(&mut self, i: usize, node: usize, z: &[T], source: SingularInertia) -> Self::Error;
}

/// A flight under way.
#[derive(Clone, Debug)]
pub(crate) struct Flight<T: ModelScalar> {
    pub(crate) pos: Vector3<T>,
    pub(crate) att: Quat<T>,
    pub(crate) rk: Rk4<T>,
    /// Energies: integrated, and rates weighted over the step under way.
    energy: [T; 2],
    sum: [T; 2],
    /// Rates of position and rotation vector at the stages.
    dpos: [Vector3<T>; 4],
    drot: [Vector3<T>; 4],
    buffers: Option<Buffers<T>>,
}

impl<T: LaneScalar> Flight<T> {
    pub(crate) fn new(model: &Model, pos: Vector3<T>, att: Quat<T>, z0: &[T]) -> Self {
        let (z, v) = ([T::zero(); 2], [Vector3::zeros(); 4]);
        Self { pos, att, rk: Rk4::new(model, z0), energy: z, sum: z, dpos: v, drot: v, buffers: None }
    }

    /// Flies through a span that `table` covers. Energies are integrated where the table has powers.
    ///
    /// # Errors
    /// Those of the sink.
    #[inline(always)]
    pub(crate) fn block<S: Sink<T>>(
        &mut self,
        model: &Model,
        params: &Params<T>,
        table: &Prescribed,
        span: Span,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        let buffers = self.buffers.take().unwrap_or_else(|| Buffers::new(model, table));
        let mut sys = Reduced::reuse(buffers, model, params, table);
        let done = T::enter(Block { flight: self, sys: &mut sys, span, sink });
        self.buffers = Some(sys.into_buffers());
        done
    }

    #[inline(always)]
    fn stage(&mut self, stage: usize, h: f64) {
        let c = T::from_f64(0.5 * h * STAGE[stage] as f64);
        let (mut u, mut att) = (Vector3::zeros(), self.att);
        if stage > 0 {
            let k = &self.drot[stage - 1];
            u = Vector3::new(k.x * c, k.y * c, k.z * c);
            att = quat_mul(&att, &exp_so3(&u));
        }
        let (v, w) = (V3::from_slice(&self.rk.zs), V3::from_slice(&self.rk.zs[3..]));
        self.dpos[stage] = ff_model::spatial::vec3::M3::from(&quat_to_rot(&att)).mul(&v).into();
        self.drot[stage] = dexp_inv_body(&u, &w.into());
    }

    #[inline(always)]
    fn finish(&mut self, h: f64) {
        let (mut p, mut u) = (V3::from(&self.pos), V3::zero());
        for s in 0..4 {
            let weight = T::from_f64(WEIGHT[s] * h);
            p = V3::from(&self.dpos[s]).scale_add(weight, &p);
            u = V3::from(&self.drot[s]).scale_add(weight, &u);
        }
        self.pos = p.into();
        self.att = quat_normalize(&quat_mul(&self.att, &exp_so3(&u.into())));
    }
}

struct Block<'a, 'b, T: LaneScalar, S> {
    flight: &'a mut Flight<T>,
    sys: &'a mut Reduced<'b, T>,
    span: Span,
    sink: &'a mut S,
}

impl<T: LaneScalar, S: Sink<T>> Kernel for Block<'_, '_, T, S> {
    type Output = Result<(), S::Error>;
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { flight, sys, span: Span { first, intervals, last }, sink } = self;
        let table = sys.table;
        let (h, per) = (table.step, table.substeps);
        let steps = intervals * per;
        for step in 0..=steps {
            if step == steps && !last {
                return Ok(());
            }
            for stage in 0..4 {
                let node = 2 * step + STAGE[stage];
                if let Err(at) = flight.rk.stage(sys, step, stage) {
                    return Err(sink.singular(
                        first,
                        node,
                        &flight.rk.zs,
                        crate::tree::forward::singular(sys.model, at),
                    ));
                }
                if stage == 0 && step % per == 0 {
                    let i = step / per;
                    sys.torques(i, &flight.rk.zs, &flight.rk.u, &mut flight.rk.tau);
                    let at = Moment { pos: &flight.pos, att: &flight.att, z: &flight.rk.zs };
                    let (u, tau, energy) = (&flight.rk.u, &flight.rk.tau, &flight.energy);
                    sink.sample(first + i, &at, &Reading { u, tau, joints: table.joints(i), energy });
                    if step == steps {
                        return Ok(());
                    }
                }
                flight.stage(stage, h);
                if table.has_power() {
                    let weight = T::from_f64(WEIGHT[stage] * h);
                    let rate =
                        [sys.dissipated_power(&flight.rk.zs), sys.joint_power(node, &flight.rk.zs, &flight.rk.u)];
                    for (s, &r) in flight.sum.iter_mut().zip(&rate) {
                        *s = if stage == 0 { weight * r } else { crate::linalg::rows::fma(weight, r, *s) };
                    }
                }
                flight.rk.rate(h, stage);
            }
            flight.rk.finish();
            flight.finish(h);
            for (e, &s) in flight.energy.iter_mut().zip(&flight.sum) {
                *e += s;
            }
            if (step + 1) % per == 0 {
                let at = Moment { pos: &flight.pos, att: &flight.att, z: &flight.rk.z };
                sink.check(first + step / per, &at)?;
            }
        }
        Ok(())
    }
}
