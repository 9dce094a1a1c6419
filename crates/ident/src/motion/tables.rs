//! The prescribed motion of a record, tabulated once and kept as long as nothing changes that the table depends on.

use crate::estimate::setup::{Noise, SetupError};
use crate::motion::joint_motion::{MotionNoise, motion_of};
use crate::motion::knot_spectrum::Stake;
use crate::motion::loose_ends::LooseEnds;
use crate::motion::torque_corners::corners_of;
use crate::motion::torque_sensitivity as knot_stake;
use core::ops::Range;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::reduced::{Disturbance, Disturbances, TableKey};
use ff_dynamics::{Prescribed, Sampling, Wanted};
use ff_model::{Kinematics, Model, Params};
use ff_records::Record;
use std::sync::Arc;

/// Samples of a record up to which its table is made once and kept (some 2 kB for each); that of a longer one is made span by span,
/// whenever it is gone through.
pub(crate) const KEPT: usize = 1 << 16;

/// Kinematic parameters and disturbances up to which a table is kept with its derivatives, each of which is as large as the table.
const KEPT_SLOPES: usize = 12;

/// What is not where or as large as the model says: joints and mounts, and what disturbs the motion.
#[derive(Clone, Debug)]
pub(crate) struct Displaced {
    pub(crate) kinematics: Kinematics<f64>,
    /// Of [`Tables::disturbances`].
    pub(crate) sizes: Vec<f64>,
}

impl Displaced {
    /// Nothing.
    pub(crate) fn none(model: &Model) -> Self {
        Self { kinematics: Kinematics::fixed(model), sizes: Vec::new() }
    }
}

/// A table, and which of its samples are meant.
pub(crate) struct Table<'a> {
    pub(crate) table: &'a Prescribed,
    pub(crate) samples: Range<usize>,
}

/// Joint motion of a record with its tables.
pub(crate) struct Tables {
    motion: Arc<dyn JointMotion>,
    /// What the motion is off by, where it was fitted.
    pub(crate) noise: Option<MotionNoise>,
    sampling: Sampling,
    /// What may disturb the motion; sizes are given with the displacements.
    pub(crate) disturbances: Vec<Disturbance>,
    kept: Option<Kept>,
    /// Whether any is kept.
    keeps: bool,
    /// That of the span at hand, whose memory the next one takes.
    passing: Option<Prescribed>,
}

struct Kept {
    key: TableKey,
    table: Prescribed,
}

impl Tables {
    /// With the noise of the sensors, and the reflected inertia of rotors and gears in the torques (none when empty). Without it, the knots of a fitted motion weigh all joints alike. `from_rest`: the simulation starts with
    /// the base at rest, so that joints whose fitted rates are zero within their noise must not move either. With `kinks`, the motion may have some.
    pub(crate) fn new(
        model: &Model,
        record: &Record,
        substeps: usize,
        noise: Option<(&Noise, &[f64])>,
        (from_rest, kinks): (bool, bool),
    ) -> Result<Self, SetupError> {
        let stake = || {
            let (n, reflected) = noise?;
            let corners = if kinks && record.has_torques() { corners_of(record, n.torque) } else { Vec::new() };
            Some(Stake { kinks, corners, ..knot_stake::stake(model, record, [n.torque, n.gyro], reflected)? })
        };
        let (motion, noise) = motion_of(model, record, stake, from_rest)?;
        let sampling = Sampling { samples: record.samples(), sample_s: record.dt(), substeps };
        let (motion, disturbances) = (motion.into(), Vec::new());
        Ok(Self { motion, noise, sampling, disturbances, kept: None, keeps: true, passing: None })
    }
    /// The same motion and disturbances, without a table.
    pub(crate) fn shared(&self) -> Self {
        let (motion, noise) = (Arc::clone(&self.motion), self.noise.clone());
        Self {
            motion,
            noise,
            sampling: self.sampling,
            disturbances: self.disturbances.clone(),
            kept: None,
            keeps: true,
            passing: None,
        }
    }
    /// Made span by span, and none kept: for what is gone through once.
    pub(crate) fn passing(self) -> Self {
        Self { keeps: false, kept: None, ..self }
    }
    /// Of the record with every `every`-th sample: the same motion, so many steps per sample.
    pub(crate) fn thinned(&self, every: usize, substeps: usize) -> Self {
        let Sampling { samples, sample_s, .. } = self.sampling;
        let sampling = Sampling { samples: samples.div_ceil(every), sample_s: sample_s * every as f64, substeps };
        Self { sampling, kept: None, ..self.shared() }
    }
    /// Of the first `samples` of the record: the same motion and steps.
    pub(crate) fn beginning(&self, samples: usize) -> Self {
        let sampling = Sampling { samples, ..self.sampling };
        Self { sampling, ..self.shared() }
    }
    /// The table of samples `span` for these parameters and displacements, with what the derivatives `wanted` need and one sample more
    /// unless they are the last: kept, or made for them.
    pub(crate) fn span(
        &mut self,
        model: &Model,
        params: &Params<f64>,
        displaced: &Displaced,
        wanted: &Wanted,
        span: Range<usize>,
    ) -> Table<'_> {
        let samples = self.sampling.samples;
        if !self.by_spans(wanted) {
            return Table { table: self.get(model, params, displaced, wanted), samples: span };
        }
        let own = span.start..(span.end + 1).min(samples);
        let before = self.passing.take();
        let table = self.make(before, model, params, displaced, wanted, own);
        Table { table: self.passing.insert(table), samples: 0..span.len() }
    }
    /// The table for these parameters and displacements of joints and mounts, with what the derivatives `wanted` need. Base
    /// and appendages play no part in it, so it is made anew only when its [`TableKey`] says so: a link's parameter, a
    /// placement, an offset or a mount has changed, or derivatives are wanted that it lacks.
    pub(crate) fn get(
        &mut self,
        model: &Model,
        params: &Params<f64>,
        displaced: &Displaced,
        wanted: &Wanted,
    ) -> &Prescribed {
        let key =
            TableKey::new(model, params, &displaced.kinematics, &self.sampling, wanted).disturbed(&displaced.sizes);
        if !self.kept.as_ref().is_some_and(|k| k.key.serves(&key)) {
            self.kept = None;
        }
        let kept = match self.kept.take() {
            Some(kept) => kept,
            None => Kept { key, table: self.make(None, model, params, displaced, wanted, 0..self.sampling.samples) },
        };
        &self.kept.insert(kept).table
    }
    /// Whether one table without derivatives serves all these places.
    pub(crate) fn serve_all(&self, model: &Model, places: &[(&Params<f64>, &Displaced)]) -> bool {
        let key = |(params, displaced): &(&Params<f64>, &Displaced)| {
            let Displaced { kinematics, sizes } = displaced;
            TableKey::new(model, params, kinematics, &self.sampling, &Wanted::default()).disturbed(sizes)
        };
        let mut keys = places.iter().map(key);
        keys.next().is_none_or(|first| keys.all(|other| other == first))
    }
    /// In the memory of the one `before`, if any.
    fn make(
        &self,
        before: Option<Prescribed>,
        model: &Model,
        params: &Params<f64>,
        displaced: &Displaced,
        wanted: &Wanted,
        span: Range<usize>,
    ) -> Prescribed {
        let Displaced { kinematics, sizes } = displaced;
        let disturbances = Disturbances::new(self.disturbances.clone(), sizes.clone());
        let by = (kinematics, &disturbances);
        let (motion, sampling) = (&*self.motion, &self.sampling);
        match before {
            Some(table) => table.followed_by(model, params, by, motion, (sampling, span), wanted),
            None => Prescribed::disturbed(model, params, by, motion, sampling, span, wanted),
        }
    }
    /// The motion, and where it is loose.
    pub(crate) fn moving(&self) -> (&dyn JointMotion, Option<&LooseEnds>) {
        (&*self.motion, self.noise.as_ref().map(|n| &n.ends))
    }
    /// The motion.
    pub(crate) fn motion(&self) -> Arc<dyn JointMotion> {
        Arc::clone(&self.motion)
    }
    /// Whether tables are made span by span.
    pub(crate) fn by_spans(&self, wanted: &Wanted) -> bool {
        !self.keeps || self.sampling.samples > KEPT || wanted.kinematics.len() + wanted.disturbances.len() > KEPT_SLOPES
    }
}
