//! What moves slowly: parameters that are others from record to record (`[[changes]]`), biases that walk within one (`[sensors]`).
//!
//! Parameters of the list are those of the last record. In record k a parameter is
//!
//! ```text
//! p_k = p_last - sum_(j > k) step_j,      step_j ~ N(mean, std^2)
//! ```
//!
//! with a step for every record but the first ([`ident::compose::Changed`]). A bias that walks by s in a unit of time goes from value to value
//! linearly, changing during parts of length T by amounts of standard deviation `s sqrt(T)` ([`ident::uncertain::WalkPart`]). Between the
//! ends of a part it is off the line by `s sqrt(T / 6)`, smoothly; the sum of the squares of its correlations with N samples of noise `s_n` at the rate f,
//! `N T f (s^2 T / (6 s_n^2))^2`, is kept at 1, which a test of whiteness does not see and which widens the errors of a bias by a few per cent:
//!
//! ```text
//! T = (36 / (N f))^(1/3) (s_n / s)^(4/3)
//! ```
//!
//! Steps and changes of biases are unknowns with priors, like everything else that the mission is not sure of.

use super::error::{IdentifyError, config};
use super::labelled_record::LabelledRecord;
use super::settings::Settings;
use super::uncertain::{UncertainItems, UncertainKind, UncertainUnknown};
use ff_mission::mission::{Mission, named_by};
use ff_model::{Model, ParamDecl};
use ident::compose::Changed;
use ident::uncertain::{ErrorSource, WalkPart};
use ident::{Estimator, Posterior};
use std::collections::BTreeMap;

/// Most parts of a record between which a bias changes.
const MOST_PARTS: f64 = 180.0;
/// `36 * 1`, from the sum of squared correlations that a walk between the ends of its parts may leave.
const LEFT: f64 = 36.0;
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Unknowns that records bring.
#[derive(Clone, Debug, Default)]
pub(super) struct OverTime {
    /// For each record which one it is in the order of time; parts of one recording are the same.
    epochs: Vec<usize>,
    /// Label of each in this order.
    pub(super) labels: Vec<String>,
    /// Parameters that change, each with the size of a step, and its name.
    pub(super) changing: Vec<(usize, f64)>,
    pub(super) names: Vec<String>,
    /// Errors that each record has for itself.
    walks: Vec<Vec<ErrorSource>>,
    /// By the name of a step: what it adds to the changes of parameters in records.
    pub(super) combined: BTreeMap<String, Vec<(String, f64)>>,
}

impl OverTime {
    /// Walks of the biases of a record.
    pub(super) fn walks_of(&self, record: usize) -> &[ErrorSource] {
        self.walks.get(record).map_or(&[], Vec::as_slice)
    }
    /// Parameters that are others in this record than in the last, with the sizes of their steps.
    pub(super) fn changes_of(&self, record: usize) -> &[(usize, f64)] {
        let earlier = self.epochs.get(record).is_some_and(|&e| e + 1 < self.labels.len());
        if earlier { &self.changing } else { &[] }
    }
    /// Without walks of biases: for a method that has no columns of them.
    pub(super) fn no_walks(&mut self) {
        self.walks.clear();
    }
    /// An estimator of a record with the changes of its parameters among its unknowns.
    pub(super) fn changed<'a>(
        inner: Box<dyn Estimator + 'a>,
        decls: &[ParamDecl],
        changes: &[(usize, f64)],
    ) -> Box<dyn Estimator + 'a> {
        if changes.is_empty() { inner } else { Box::new(Changed::new(inner, decls, changes)) }
    }
}

/// Which record each is in the order of time, and the labels in this order: earlier identifications first, then as they were given. A part
/// behind a gap belongs to the record before it.
fn epochs(records: &[LabelledRecord]) -> (Vec<usize>, Vec<String>) {
    let mut order: Vec<usize> = (0..records.len()).collect();
    order.sort_by_key(|&k| core::cmp::Reverse(records[k].ago));
    let (mut of, mut labels) = (vec![0; records.len()], Vec::<String>::new());
    for (place, &k) in order.iter().enumerate() {
        let begins = place == 0 || !records[k].continues || records[order[place - 1]].ago != records[k].ago;
        if begins {
            labels.push(records[k].label.clone());
        }
        of[k] = labels.len() - 1;
    }
    (of, labels)
}

/// Length (s) of the parts between which a bias that walks by `walk` in a unit of time is a straight line; `noise` is that of a sample.
fn part(walk: f64, noise: f64, samples: usize, rate_hz: f64) -> f64 {
    (LEFT / (samples as f64 * rate_hz)).cbrt() * (noise / walk).powf(4.0 / 3.0)
}

/// A step as the mission declares it: parameter, mean, standard deviation. A later table replaces what an earlier one says.
pub(super) fn steps(mission: &Mission, decls: &[ParamDecl]) -> Vec<(usize, f64, f64)> {
    let mut out = Vec::new();
    for (i, d) in decls.iter().enumerate() {
        let of = mission.changes.iter().rev().find(|c| named_by(&c.parameters, &d.name));
        if let Some((c, std)) = of.and_then(|c| Some((c, c.std_of(d.nominal)?))) {
            out.push((i, c.step_mean, std));
        }
    }
    out
}

/// What earlier records have told of parameters, at the time of the next record.
pub(super) fn later(p: &Posterior, mission: &Mission, model: &Model) -> Result<Posterior, IdentifyError> {
    let (mut out, decls) = (p.clone(), model.param_decls());
    for (i, mean, std) in steps(mission, &decls) {
        let name = decls[i].name.as_str();
        let Some(k) = out.names.iter().position(|n| n == name) else { continue };
        out.mean[k] += mean;
        out = out.loosen(&[name], std).map_err(|e| IdentifyError::Model(e.to_string()))?;
    }
    Ok(out)
}

impl UncertainItems {
    /// With what these records bring: steps between them, and walks within them.
    pub(super) fn in_records(
        mut self,
        mission: Option<&Mission>,
        model: &Model,
        records: &[LabelledRecord],
        s: &Settings,
    ) -> Result<Self, IdentifyError> {
        let Some(mission) = mission else { return Ok(self) };
        let decls = model.param_decls();
        let (of, labels) = epochs(records);
        let steps = steps(mission, &decls);
        let several = records.len() > 1;
        if labels.len() > 1 {
            for &(i, mean, std) in &steps {
                let d = &decls[i];
                for (j, label) in labels.iter().enumerate().skip(1) {
                    let name = format!("{label}.step.{}", d.name);
                    let change = Changed::name(&d.name);
                    let before = (0..records.len()).filter(|&k| of[k] < j);
                    let made = before.map(|k| (format!("{}.{change}", records[k].label), -1.0)).collect();
                    self.over_time.combined.insert(name.clone(), made);
                    self.share_about(name, d.unit, (mean, std), UncertainKind::Changes);
                }
            }
            self.over_time.changing = steps.iter().map(|&(i, _, std)| (i, std)).collect();
            self.over_time.names = steps.iter().map(|s| decls[s.0].name.clone()).collect();
        }
        let joints = model.joint_names();
        let sensors = &mission.sensors;
        for labelled in records {
            let mut own = Vec::new();
            let r = &labelled.record;
            let walks = [
                (sensors.torque.bias_walk_nm_per_sqrt_s, s.noise.torque, r.tau().nrows(), "torque"),
                (sensors.gyro.bias_walk_rad_per_s_per_sqrt_s, s.noise.gyro, r.gyro().nrows(), "gyro"),
            ];
            for (walk, noise, samples, group) in walks {
                let Some(walk) = walk else { continue };
                let seconds = r.seconds();
                let wanted = part(walk, noise, samples, samples as f64 / seconds);
                let parts = (seconds / wanted).ceil().max(1.0);
                if parts > MOST_PARTS {
                    return Err(too_fast(group, walk, noise, wanted));
                }
                let every_ms = (1e3 * seconds / parts).ceil().max(1.0) as u32;
                let std = walk * (f64::from(every_ms) / 1e3).sqrt();
                for index in 0..parts as u32 {
                    let at = WalkPart { index, every_ms };
                    own.extend(match group {
                        "torque" => (0..model.nj()).map(|j| ErrorSource::TorqueWalk(j, at)).collect::<Vec<_>>(),
                        _ => (0..3).map(|i| ErrorSource::GyroWalk(i, at)).collect(),
                    });
                    for source in &own[own.len() - if group == "torque" { model.nj() } else { 3 }..] {
                        let name = source.name(&joints);
                        let name = if several { format!("{}.{name}", labelled.label) } else { name };
                        self.share_about(name, source.unit(), (0.0, std), UncertainKind::BiasWalks);
                    }
                }
            }
            self.over_time.walks.push(own);
        }
        (self.over_time.epochs, self.over_time.labels) = (of, labels);
        Ok(self)
    }
}

fn too_fast(group: &str, walk: f64, noise: f64, part: f64) -> IdentifyError {
    let (section, key, unit) = match group {
        "torque" => ("sensors.torque", "bias_walk_nm_per_sqrt_s", "N m/sqrt(s)"),
        _ => ("sensors.gyro", "bias_walk_rad_per_s_per_sqrt_s", "rad/s/sqrt(s)"),
    };
    let what = format!(
        "value {walk} {unit}: beside a noise of {noise} a bias that walks so fast is followed in steps of {part:.3} s, limit {MOST_PARTS} of them in a record"
    );
    let p = config("Config::Walk", what, "count what is faster as noise: a smaller walk, a larger noise");
    IdentifyError::Refused(ff_model::Problems(p.0.into_iter().map(|p| p.on(format!("{section}.{key}"))).collect()))
}

/// Names that stand for what a mission says to change, for lists before any record: a step of each parameter, a walk of each channel.
pub(super) fn declared(mission: &Mission, model: &Model) -> Vec<UncertainUnknown> {
    let decls = model.param_decls();
    let mut out: Vec<UncertainUnknown> = Vec::new();
    for (i, mean, std) in steps(mission, &decls) {
        let (name, unit) = (format!("step.{}", decls[i].name), decls[i].unit);
        out.push(UncertainUnknown { name, unit, mean, std, kind: UncertainKind::Changes });
    }
    let mut walk = |name: String, unit, std: Option<f64>| {
        let Some(std) = std else { return };
        out.push(UncertainUnknown { name, unit, mean: 0.0, std, kind: UncertainKind::BiasWalks });
    };
    for j in model.joint_names() {
        walk(format!("torque.walk.{j}"), "N m/sqrt(s)", mission.sensors.torque.bias_walk_nm_per_sqrt_s);
    }
    for a in AXES {
        walk(format!("gyro.walk.{a}"), "rad/s/sqrt(s)", mission.sensors.gyro.bias_walk_rad_per_s_per_sqrt_s);
    }
    out
}
