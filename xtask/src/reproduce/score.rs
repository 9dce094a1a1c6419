//! The columns of Tables II and III: two identified models against reference and truth.

use super::experiment::Experiment;
use super::identify::{Found, Noise, extended, record, rigid};
use super::system::System;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{SimOptions, Trace};
use ff_model::{Model, Params};
use indicatif::ProgressBar;
use serde::Serialize;
use validate::{FramePath, PathError, compare, frame_path};

/// End-effector errors of one run.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Columns {
    /// Rigid identification of the flexible record, against the reference model (paper: Rigid ID).
    pub(super) rigid_id: PathError,
    /// Identification with passive states, against the reference model (paper: Flex. ID, Slosh. ID).
    pub(super) extended_id: PathError,
    /// The same two against the true system.
    pub(super) rigid_id_vs_truth: PathError,
    /// See above.
    pub(super) extended_id_vs_truth: PathError,
    /// The true system against the reference model: the least that a perfect extended model can have in the paper's measure.
    pub(super) floor: PathError,
}

/// What one run is made of: the rigid and the extended record, and along what models are compared.
pub(super) struct Flown<'a> {
    pub(super) rigid: &'a Trace,
    pub(super) extended: &'a Trace,
    pub(super) reference: &'a dyn JointMotion,
    pub(super) options: &'a SimOptions,
}

/// The identifications of one run: reference model, rigid and extended.
pub(super) struct Fits {
    pub(super) reference: Found,
    pub(super) rigid: Found,
    pub(super) extended: Found,
}

/// Identifies and compares, without noise or with the sensors of the mission; starts are off in directions of seed `start`.
pub(super) fn columns(
    s: &System,
    flown: &Flown<'_>,
    noise: Noise,
    start: u64,
    bar: &ProgressBar,
) -> anyhow::Result<(Columns, Fits)> {
    let say = |what: &str| bar.set_message(format!("{}: {what}", s.name));
    let path = |m: &Model, p: &Params<f64>| -> anyhow::Result<FramePath> {
        Ok(frame_path(m, p, flown.reference, &s.end_effector, flown.options)?)
    };
    say("reference model");
    let quiet = record(s, flown.rigid, noise, 1)?;
    let reference = rigid(s, &quiet, noise, &s.rigid_params, start, "reference")?;
    say("rigid identification");
    let seen = record(s, flown.extended, noise, 2)?;
    let rigid = rigid(s, &seen, noise, &s.rigid_params, start, "rigid")?;
    say("identification with passive states");
    let extended = extended(s, &seen, noise, start)?;
    say("end-effector errors");
    let reference_path = path(&s.rigid, &reference.params)?;
    let truth = path(s.model(), &s.params)?;
    let (a, b) = (path(&s.rigid, &rigid.params)?, path(s.model(), &extended.params)?);
    let columns = Columns {
        rigid_id: compare(&a, &reference_path)?,
        extended_id: compare(&b, &reference_path)?,
        rigid_id_vs_truth: compare(&a, &truth)?,
        extended_id_vs_truth: compare(&b, &truth)?,
        floor: compare(&truth, &reference_path)?,
    };
    Ok((columns, Fits { reference, rigid, extended }))
}

/// [`columns`] of an experiment as it was flown. A noisy fit that does not converge is an error: its limits would mean nothing.
pub(super) fn of(x: &Experiment, noise: Noise, bar: &ProgressBar) -> anyhow::Result<(Columns, Fits)> {
    let flown =
        Flown { rigid: &x.rigid_trace, extended: &x.trace, reference: &x.reference, options: &x.reference_options };
    let out = columns(&x.system, &flown, noise, x.system.seed(), bar)?;
    if noise.is_some() {
        out.1.extended.report.ended()?;
    }
    Ok(out)
}
