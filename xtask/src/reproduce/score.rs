//! The four columns of a table: two identified models against reference and truth.

use super::experiment::Experiment;
use super::identify::{Noise, Report, extended, record, rigid};
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
}

/// Identifies and compares, without noise or with the sensors of the mission.
pub(super) fn columns(x: &Experiment, noise: Noise, bar: &ProgressBar) -> anyhow::Result<(Columns, Vec<Report>)> {
    let say = |what: &str| bar.set_message(format!("{}: {what}", x.name));
    let path = |m: &Model, p: &Params<f64>| -> anyhow::Result<FramePath> {
        Ok(frame_path(m, p, &x.reference, &x.end_effector, &x.reference_options)?)
    };
    say("reference model");
    let quiet = record(x, &x.rigid_trace, noise, 1)?;
    let (reference, reference_report) = rigid(x, &quiet, noise, &x.rigid_params)?;
    say("rigid identification");
    let seen = record(x, &x.trace, noise, 2)?;
    let (rigid_id, rigid_report) = rigid(x, &seen, noise, &x.rigid_params)?;
    say("identification with passive states");
    let (extended_id, extended_report) = extended(x, &seen, noise)?;
    say("end-effector errors");
    let model = &x.loaded.model;
    let reference = path(&x.rigid, &reference)?;
    let truth = path(model, &x.params)?;
    let (a, b) = (path(&x.rigid, &rigid_id)?, path(model, &extended_id)?);
    let columns = Columns {
        rigid_id: compare(&a, &reference)?,
        extended_id: compare(&b, &reference)?,
        rigid_id_vs_truth: compare(&a, &truth)?,
        extended_id_vs_truth: compare(&b, &truth)?,
    };
    Ok((columns, vec![reference_report, rigid_report, extended_report]))
}
