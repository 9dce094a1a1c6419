//! How the tables of a prescribed motion are filled: several instants at a time, one per lane.
//!
//! From the base outwards every link gets its pose and its rates relative to the base, from the tips inwards the moments
//! of what it carries are summed; the sums of all links are the arm's 28 numbers, those of a subtree its joint's row.

use super::disturbance::{Disturbance, Disturbances, Disturbed};
use super::instants::{Instants, scatter};
use super::numbers::{ARM, FORM, FRAME, ROW};
use super::pool::Pool;
use super::prescribed::{Prescribed, Site};
use super::sampling::Sampling;
use super::slopes::Slopes;
use super::sweep::Sweep;
use crate::motion::joint::JointMotion;
use crate::reduced::coupled::{ChangeOfTree, OfTree};
use crate::reduced::sensitivity::wanted::Wanted;
use core::ops::Range;
use ff_lanes::Kernel;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch};
use ff_model::spatial::vec3::Pose;
use ff_model::{Kinematics, Model, Params};
use std::sync::Arc;

impl Prescribed {
    /// Tabulates `motion` for the arm parameters in `params` (links only; base and appendages play no part).
    ///
    /// `links` are bodies whose inertial parameters will be differentiated (`crate::reduced::sensitivity::driver`). Allocates.
    ///
    /// # Panics
    /// If the motion has another number of joints than the model, or there are no samples or substeps.
    pub fn new(
        model: &Model,
        params: &Params<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        links: &[usize],
    ) -> Self {
        Self::span(model, params, motion, sampling, 0..sampling.samples, links)
    }

    /// The part of [`Prescribed::new`] for the samples `span`, bit for bit: what a long record is integrated over piece by piece
    /// ([`crate::reduced::sensitivity::sensitivities_span`]). Neighbouring parts share a sample. Allocates as many numbers as the
    /// part has.
    ///
    /// # Panics
    /// As [`Prescribed::new`], and if the span is empty or ends beyond the samples.
    pub fn span(
        model: &Model,
        params: &Params<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        span: Range<usize>,
        links: &[usize],
    ) -> Self {
        Self::span_in(&mut Pool::default(), model, params, motion, sampling, span, links)
    }

    /// [`Prescribed::span`] in memory that is at hand.
    fn span_in(
        pool: &mut Pool,
        model: &Model,
        params: &Params<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        span: Range<usize>,
        links: &[usize],
    ) -> Self {
        if let Some(map) = model.coordinates() {
            let motion = OfTree { map, motion };
            return Self::span_in(pool, &model.spanning(), params, &motion, sampling, span, links);
        }
        assert!(span.end <= sampling.samples, "samples of a span");
        let mut t = Self::empty_in(pool, model, &Sampling { samples: span.len(), ..*sampling }, links);
        t.first = span.start;
        dispatch(Isa::detect(), Fill { table: &mut t, model, params, motion });
        t
    }

    /// As [`Prescribed::new`], with joints and mounts displaced by `kinematics`, and with what the derivatives `wanted` need:
    /// tracked links and the derivatives of the tables with respect to kinematic parameters. Allocates, per kinematic
    /// parameter of a joint as much as the table itself.
    ///
    /// # Panics
    /// As [`Prescribed::new`], and if `kinematics` belong to another model or a wanted kinematic parameter does not exist.
    pub fn with_kinematics(
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        wanted: &Wanted,
    ) -> Self {
        Self::span_with_kinematics(model, params, kinematics, motion, sampling, 0..sampling.samples, wanted)
    }

    /// The part of [`Prescribed::with_kinematics`] for the samples `span`, as [`Prescribed::span`].
    ///
    /// # Panics
    /// As [`Prescribed::with_kinematics`] and [`Prescribed::span`].
    pub fn span_with_kinematics(
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        span: Range<usize>,
        wanted: &Wanted,
    ) -> Self {
        Self::disturbed(model, params, (kinematics, &Disturbances::default()), motion, sampling, span, wanted)
    }

    /// [`Prescribed::span_with_kinematics`] of a motion that is disturbed, with the derivatives with respect to the sizes of the
    /// disturbances that are `wanted`. A wrench on the base is no part of the power of the joints.
    ///
    /// # Panics
    /// As [`Prescribed::span_with_kinematics`], and if a wanted disturbance does not exist or has another number of joints.
    pub fn disturbed(
        model: &Model,
        params: &Params<f64>,
        by: (&Kinematics<f64>, &Disturbances),
        motion: &dyn JointMotion,
        sampling: &Sampling,
        span: Range<usize>,
        wanted: &Wanted,
    ) -> Self {
        Self::disturbed_in(Pool::default(), model, params, by, motion, (sampling, span), wanted)
    }

    /// [`Prescribed::disturbed`] in the memory of this table, which need not be of the same record. Allocates where that is too small.
    ///
    /// # Panics
    /// As [`Prescribed::disturbed`].
    #[must_use]
    pub fn followed_by(
        self,
        model: &Model,
        params: &Params<f64>,
        by: (&Kinematics<f64>, &Disturbances),
        motion: &dyn JointMotion,
        (sampling, span): (&Sampling, Range<usize>),
        wanted: &Wanted,
    ) -> Self {
        Self::disturbed_in(self.into_pool(), model, params, by, motion, (sampling, span), wanted)
    }

    fn disturbed_in(
        mut pool: Pool,
        model: &Model,
        params: &Params<f64>,
        (kinematics, disturbances): (&Kinematics<f64>, &Disturbances),
        motion: &dyn JointMotion,
        (sampling, span): (&Sampling, Range<usize>),
        wanted: &Wanted,
    ) -> Self {
        if let Some(map) = model.coordinates() {
            let motion = OfTree { map, motion };
            let of_tree = |d: &Disturbance| match d {
                Disturbance::Motion(d) => {
                    Disturbance::Motion(Arc::new(ChangeOfTree { map: map.clone(), motion: d.clone() }))
                }
                Disturbance::Wrench(_) => d.clone(),
            };
            let all = disturbances.all().iter().map(of_tree).collect();
            let by = Disturbances::new(all, disturbances.sizes().to_vec());
            let place = (sampling, span);
            return Self::disturbed_in(pool, &model.spanning(), params, (kinematics, &by), &motion, place, wanted);
        }
        let motion = Disturbed { motion, by: disturbances };
        let links = wanted.links(model);
        let placed = model.displaced(kinematics);
        let mut t = Self::span_in(&mut pool, &placed, params, &motion, sampling, span.clone(), &links);
        let first = t.first_node();
        disturbances.push(&mut t.arm, |node| sampling.time_of(first + node));
        let place = (sampling, span);
        t.slopes = Slopes::new(&mut pool, place.clone(), model, params, kinematics, &motion, &wanted.kinematics);
        t.slopes.disturb(place, model, params, kinematics, &motion, &wanted.disturbances);
        t
    }
}

/// Fills the tables once.
struct Fill<'a> {
    table: &'a mut Prescribed,
    model: &'a Model,
    params: &'a Params<f64>,
    motion: &'a dyn JointMotion,
}

impl LaneTask for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: LaneScalar>(self) {
        let Self { table, model, params, motion } = self;
        Filler::<L>::new(model, params).fill(table, motion, 0.0);
    }
}

/// What fills tables, with its buffers.
pub(crate) struct Filler<L: LaneScalar> {
    sweep: Sweep<L>,
    instants: Instants<L>,
}

impl<L: LaneScalar> Filler<L> {
    /// For the arm parameters in `params`.
    pub(crate) fn new(model: &Model, params: &Params<f64>) -> Self {
        let nj = model.nj();
        Self { sweep: Sweep::new(model, &params.lift(model)), instants: Instants::new(nj) }
    }

    /// Fills `table` for a record that begins at time `start` (s) of the motion. Does not allocate.
    ///
    /// # Panics
    /// If the motion has another number of joints than the model.
    #[inline(always)]
    pub(crate) fn fill(&mut self, table: &mut Prescribed, motion: &dyn JointMotion, start: f64) {
        assert_eq!(motion.dof(), self.sweep.joints(), "joint motion");
        L::enter(Filling { filler: self, table, motion, start });
    }
}

struct Filling<'a, L: LaneScalar> {
    filler: &'a mut Filler<L>,
    table: &'a mut Prescribed,
    motion: &'a dyn JointMotion,
    start: f64,
}

impl<L: LaneScalar> Kernel for Filling<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { filler, table, motion, start } = self;
        let Filler { sweep, instants } = filler;
        let nj = sweep.joints();
        // Nodes of samples, which want joint rows, then the nodes between them.
        let per = 2 * table.substeps;
        let between = (table.samples - 1) * (per - 1);
        let from = table.first_node();
        let (mut first, mut rows) = (0, true);
        loop {
            let total = if rows { table.samples } else { between };
            if first >= total {
                if !rows {
                    break;
                }
                (first, rows) = (0, false);
                continue;
            }
            let time = |node: usize| start + 0.5 * table.step * (from + node) as f64;
            let keep = |i: usize, joint: &[f64]| table.joints[3 * nj * i..3 * nj * (i + 1)].copy_from_slice(joint);
            let (nodes, count) = instants.read(motion, (rows, per), first..total, time, keep);
            let [q, qd, qdd] = &instants.moving;
            sweep.outwards(q, qd, qdd);
            let with_power = !table.power.is_empty();
            let mut power = [L::zero(); FORM];
            for i in (1..=nj).rev() {
                sweep.inwards(i);
                if !(rows || with_power) {
                    continue;
                }
                let row = sweep.row(i);
                let qd = qd[i - 1];
                for (p, &x) in power.iter_mut().zip(&row) {
                    *p = crate::linalg::rows::fma(x, qd, *p);
                }
                if rows {
                    scatter(&row, &nodes[..count], |n| (n / per * nj + i - 1) * ROW, &mut table.rows);
                }
            }
            if with_power {
                scatter(&power, &nodes[..count], |n| n * FORM, &mut table.power);
            }
            scatter(&sweep.arm().numbers(), &nodes[..count], |n| n * ARM, &mut table.arm);
            for site in &table.sites {
                if let Site::Body(host, x, column) = site {
                    let frame = sweep.frame(*host, &Pose::constant(x));
                    let at = |n: usize| (n * table.moving + column) * FRAME;
                    scatter(&frame.numbers(), &nodes[..count], at, &mut table.frames);
                }
            }
            first += count;
        }
    }
}
