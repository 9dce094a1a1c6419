//! Joint motions: planned, or through samples.

use super::Refused;
use crate::commands::plan::{Given, load, of_samples, of_trajectory};
use excitation::TrajectoryFile;
use excitation::plan::LimitReport;
use excitation::trajectory::{Samples, named_joints, write_csv};
use ff_dynamics::motion::JointMotion;
use ff_model::Problems;
use ffid::open::Opened;
use std::path::Path;

/// A joint motion of a robot, checked.
pub struct Motion {
    /// The motion.
    pub motion: Box<dyn JointMotion>,
    /// That it keeps the limits of the joints for all time, where that can be proven.
    pub proven: Option<LimitReport>,
    /// What was put up with.
    pub warnings: Problems,
}

impl From<Given> for Motion {
    fn from(g: Given) -> Self {
        Self { motion: g.motion, proven: g.proven, warnings: g.warnings }
    }
}

impl Motion {
    /// From a file: `.csv`, else the JSON of `ffid excite`.
    ///
    /// # Errors
    /// Every problem of the file.
    pub fn load(path: &Path, opened: &Opened) -> Result<Self, Refused> {
        Ok(load(path, opened)?.into())
    }
    /// From a planned trajectory, as the JSON text of `ffid excite`.
    ///
    /// # Errors
    /// Every problem of the text.
    pub fn from_json(text: &str, opened: &Opened) -> Result<Self, Refused> {
        let file = TrajectoryFile::from_json(text)?.for_model(&opened.model)?;
        Ok(of_trajectory(file, opened, Path::new("trajectory"))?.into())
    }
    /// Through samples in the order of the joints: times (s), positions (rad or m) and, for all joints or none, rates and
    /// accelerations, one sample after another. The checks are those of a CSV file.
    ///
    /// # Errors
    /// Every problem of the samples.
    pub fn from_samples(
        times: &[f64],
        q: &[f64],
        qd: Option<&[f64]>,
        qdd: Option<&[f64]>,
        opened: &Opened,
    ) -> Result<Self, Refused> {
        let samples = Samples {
            joints: named_joints(&opened.model),
            times: times.to_vec(),
            q: q.to_vec(),
            qd: qd.map(<[f64]>::to_vec),
            qdd: qdd.map(<[f64]>::to_vec),
        };
        // Numbers are written in their shortest exact form, so that they come back as they are, checked.
        let (samples, warnings) = Samples::from_csv(&write_csv(&samples), &opened.model)?;
        Ok(of_samples(&samples, warnings, opened, Path::new("motion"))?.into())
    }
}
