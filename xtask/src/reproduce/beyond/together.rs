//! Panels and fuel at once: what a model costs that lacks one of them.

use super::super::identify::{Found, Row, extended, record, rigid};
use super::super::system::{Source, System};
use super::{SEED, furthest};
use ff_dynamics::motion::JointMotion;
use ff_model::{Model, Params};
use serde::Serialize;
use toml::{Table, Value};
use validate::{PathError, compare, frame_path};

/// A model fitted to the record of the satellite with both.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ModelFit {
    pub(crate) model: &'static str,
    pub(crate) unknowns: usize,
    pub(crate) chi2_per_dof: f64,
    pub(crate) converged: bool,
    /// Mass of the base with what the model has no part of its own for (kg): estimate, its stated deviation, truth.
    pub(crate) base_mass_kg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) base_mass_std_kg: Option<f64>,
    pub(crate) base_mass_truth_kg: f64,
    /// End effector against the true satellite, along the reference trajectory.
    pub(crate) path: PathError,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Together {
    pub(crate) seconds: f64,
    pub(crate) models: Vec<ModelFit>,
    /// Every estimate of the model with both.
    pub(crate) estimates: Vec<Row>,
    /// The furthest from the truth, in its stated deviations.
    pub(crate) furthest: (String, f64),
}

impl Together {
    pub(super) fn run(source: &Source, s: &System, motion: &dyn JointMotion) -> anyhow::Result<Self> {
        let trace = s.fly(motion)?;
        let seen = record(s, &trace, Some(SEED), 0)?;
        let (reference, options) = s.reference(SEED)?;
        let path = |m: &Model, p: &Params<f64>| frame_path(m, p, &reference, &s.end_effector, &options);
        let truth = path(s.model(), &s.params)?;
        let full = s.model().total_mass();
        let fit = |model: &'static str, m: &Model, nominal: &Params<f64>, found: &Found| -> anyhow::Result<ModelFit> {
            // Whatever the model has no part for rides on the base.
            let own = m.total_mass() - nominal.body(0).mass;
            let mass = found.report.rows().iter().find(|r| r.name == "base.mass");
            Ok(ModelFit {
                model,
                unknowns: found.estimate.parameters.len(),
                chi2_per_dof: found.estimate.chi2_per_dof,
                converged: found.estimate.is_solution(),
                base_mass_kg: found.params.body(0).mass,
                base_mass_std_kg: mass.and_then(|r| r.std),
                base_mass_truth_kg: full - own,
                path: compare(&path(m, &found.params)?, &truth)?,
            })
        };
        let without = |kind: &'static str| source.with(s.quick, move |m| drop_kind(m, kind));
        let (panels, fuel) = (without("slosh_pendulum")?, without("flex_panel")?);
        let alone = |s: &System| extended(s, &seen, Some(SEED), SEED);
        let stiff = rigid(s, &seen, Some(SEED), &s.rigid_params, SEED, "rigid")?;
        let (p, f) = rayon::join(|| alone(&panels), || alone(&fuel));
        let (p, f, both) = (p?, f?, alone(s)?);
        let models = vec![
            fit("rigid", &s.rigid, &s.rigid_params, &stiff)?,
            fit("panels alone", panels.model(), &panels.params, &p)?,
            fit("fuel alone", fuel.model(), &fuel.params, &f)?,
            fit("panels and fuel", s.model(), &s.params, &both)?,
        ];
        let estimates = both.report.rows().to_vec();
        Ok(Self { seconds: motion.duration(), models, furthest: furthest(&estimates), estimates })
    }
}

/// Leaves out the appendages of a kind, and what was to be estimated of them.
fn drop_kind(m: &mut Table, kind: &str) {
    let is = |t: &Value| t.get("kind").and_then(Value::as_str) == Some(kind);
    let Some(all) = m.get_mut("appendage").and_then(Value::as_array_mut) else { return };
    let gone: Vec<String> =
        all.iter().filter(|t| is(t)).filter_map(|t| Some(t.get("name")?.as_str()?.to_owned())).collect();
    all.retain(|t| !is(t));
    let patterns = m.get_mut("estimate").and_then(|e| e.get_mut("parameters")).and_then(Value::as_array_mut);
    // `panel_*.k[*]` is of `panel_left`: the part before the star has to begin the name.
    let of = |p: &str| {
        let stem = p.split(['.', '*']).next().unwrap_or_default();
        gone.iter().any(|n| n.starts_with(stem))
    };
    if let Some(patterns) = patterns {
        patterns.retain(|p| !p.as_str().is_some_and(of));
    }
}
