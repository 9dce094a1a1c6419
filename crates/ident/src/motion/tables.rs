//! The prescribed motion of a record, tabulated once and kept as long as nothing changes that the table depends on.

use crate::estimate::setup::{Noise, SetupError};
use crate::motion::joint_motion::motion_of;
use crate::motion::torque_sensitivity as knot_stake;
use core::ops::Range;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::reduced::TableKey;
use ff_dynamics::{Prescribed, Sampling, Wanted};
use ff_model::{Kinematics, Model, Params};
use ff_records::Record;
use std::borrow::Cow;
use std::sync::Arc;

/// Samples of a record up to which its table is made once and kept (some 2 kB for each); that of a longer one is made span by span,
/// whenever it is gone through.
pub(crate) const KEPT: usize = 1 << 16;

/// A table, and which of its samples are meant.
pub(crate) struct Table<'a> {
    pub(crate) table: Cow<'a, Prescribed>,
    pub(crate) samples: Range<usize>,
}

/// Joint motion of a record with its tables.
pub(crate) struct Tables {
    motion: Arc<dyn JointMotion>,
    sampling: Sampling,
    kept: Option<Kept>,
}

struct Kept {
    key: TableKey,
    table: Prescribed,
}

impl Tables {
    /// Without the noise of the torques, the knots of a fitted motion weigh all joints alike. `from_rest`: the simulation starts with
    /// the base at rest, so that joints whose fitted rates are zero within their noise must not move either.
    pub(crate) fn new(
        model: &Model,
        record: &Record,
        substeps: usize,
        noise: Option<&Noise>,
        from_rest: bool,
    ) -> Result<Self, SetupError> {
        let stake = || knot_stake::stake(model, record, noise?.torque);
        let motion = motion_of(model, record, stake, from_rest)?;
        let sampling = Sampling { samples: record.samples(), sample_s: record.dt(), substeps };
        Ok(Self { motion: motion.into(), sampling, kept: None })
    }
    /// Of the record with every `every`-th sample: the same motion, one step per sample.
    pub(crate) fn thinned(&self, every: usize) -> Self {
        let Sampling { samples, sample_s, .. } = self.sampling;
        let sampling = Sampling { samples: samples.div_ceil(every), sample_s: sample_s * every as f64, substeps: 1 };
        Self { motion: Arc::clone(&self.motion), sampling, kept: None }
    }
    /// Of the first `samples` of the record: the same motion and steps.
    pub(crate) fn beginning(&self, samples: usize) -> Self {
        let sampling = Sampling { samples, ..self.sampling };
        Self { motion: Arc::clone(&self.motion), sampling, kept: None }
    }
    /// The table of samples `span` for these parameters and displacements, with what the derivatives `wanted` need and one sample more
    /// unless they are the last: kept, or made for them.
    pub(crate) fn span(
        &mut self,
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        wanted: &Wanted,
        span: Range<usize>,
    ) -> Table<'_> {
        let samples = self.sampling.samples;
        if samples <= KEPT {
            return Table { table: Cow::Borrowed(self.get(model, params, kinematics, wanted)), samples: span };
        }
        let own = span.start..(span.end + 1).min(samples);
        let (motion, sampling) = (&self.motion, &self.sampling);
        let table = Prescribed::span_with_kinematics(model, params, kinematics, motion, sampling, own, wanted);
        Table { table: Cow::Owned(table), samples: 0..span.len() }
    }
    /// The table for these parameters and displacements of joints and mounts, with what the derivatives `wanted` need. Base
    /// and appendages play no part in it, so it is made anew only when its [`TableKey`] says so: a link's parameter, a
    /// placement, an offset or a mount has changed, or derivatives are wanted that it lacks.
    pub(crate) fn get(
        &mut self,
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        wanted: &Wanted,
    ) -> &Prescribed {
        let (motion, sampling) = (&self.motion, &self.sampling);
        let key = TableKey::new(model, params, kinematics, sampling, wanted);
        if !self.kept.as_ref().is_some_and(|k| k.key.serves(&key)) {
            self.kept = None;
        }
        let make = || {
            let table = Prescribed::with_kinematics(model, params, kinematics, motion, sampling, wanted);
            Kept { key, table }
        };
        &self.kept.get_or_insert_with(make).table
    }
}
