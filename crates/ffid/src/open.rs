//! From a file to a model that the dynamics can be trusted with: reading, then what only physics can judge.

use crate::inputs::{Declared, declare};
use ff_dynamics::analysis::conditioning;
use ff_dynamics::state::dof_names;
use ff_dynamics::{State, Work, mass_matrix};
use ff_mission::Leniency;
use ff_mission::urdf;
use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Mission};
use ff_model::{Area, BaseKind, Model, Params, Problem, Problems, Severity};
use nalgebra::DMatrix;
use std::path::Path;

/// Greatest condition number of the mass matrix, scaled to unit diagonal. At 1e12 accelerations keep four digits.
pub const MAX_CONDITION: f64 = 1e12;

/// Most degrees of freedom for which dense questions (condition, modes) are answered: their time is cubic.
pub const MAX_DENSE: usize = 500;

/// A mission with its model, or the model of a URDF alone.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The system.
    pub model: Model,
    /// The mission file; none for a URDF alone.
    pub mission: Option<Mission>,
    /// Indices of the parameters to estimate, ascending.
    pub estimated: Vec<usize>,
    /// Indices of the parameters to plan for, ascending.
    pub excited: Vec<usize>,
    /// Index of the frame of the end effector, if the mission names one.
    pub end_effector: Option<usize>,
    /// What acts from outside in a simulation (`[[input]]`). The planning and the identification of this crate take robots that
    /// float freely, and do not ask for it; the commands refuse a mission that has any.
    pub inputs: Vec<Declared>,
    /// Everything that was let through, to be recorded with every result.
    pub warnings: Problems,
}

impl Opened {
    /// Joint positions the mission holds while modes ring (`reproduce.hold_rad`), if it says.
    pub fn hold(&self) -> Option<&[f64]> {
        self.mission.as_ref()?.reproduce.as_ref().map(|r| r.hold_rad.as_slice()).filter(|h| !h.is_empty())
    }
    /// The pose to look at: the hold pose, or else [`nominal_pose`].
    pub fn pose(&self) -> Vec<f64> {
        self.hold().map_or_else(|| nominal_pose(&self.model), <[f64]>::to_vec)
    }
}

/// All joints at zero, or at the limit next to it. Allocates.
pub fn nominal_pose(model: &Model) -> Vec<f64> {
    model.own_bodies().map(|b| 0.0_f64.max(b.joint.limits.lower).min(b.joint.limits.upper)).collect()
}

/// Opens a mission file with every kind of appendage of this workspace, or a robot (`.urdf`, `.xml` of MuJoCo, `.sdf`) alone.
///
/// # Errors
/// Every problem of the files; `Model::NearSingular` when the mass matrix is (near) singular at the nominal or
/// the hold pose, appendages at rest.
pub fn open(file: &Path, leniency: Leniency) -> Result<Opened, Problems> {
    let name = file.to_string_lossy().to_lowercase();
    let mut opened = if [".urdf", ".xacro", ".xml", ".mjcf", ".sdf"].iter().any(|end| name.ends_with(end)) {
        let unknown = leniency.check();
        if unknown.has_errors() {
            return Err(unknown);
        }
        let (model, warnings) = alone(file, &leniency)?;
        let (estimated, excited, inputs) = (Vec::new(), Vec::new(), Vec::new());
        Opened { model, mission: None, estimated, excited, end_effector: None, inputs, warnings }
    } else {
        let l = Mission::load(file, &crate::default_registry(), &LoadOptions { leniency: leniency.clone() })?;
        Opened {
            model: l.model,
            mission: Some(l.mission),
            estimated: l.estimated,
            excited: l.excited,
            end_effector: l.end_effector,
            inputs: Vec::new(),
            warnings: l.warnings,
        }
    };
    let mut problems = std::mem::take(&mut opened.warnings);
    let poses = [("the nominal pose", Some(nominal_pose(&opened.model))), ("hold_rad", opened.hold().map(Into::into))];
    let poses = poses.into_iter().filter_map(|(name, q)| Some((name, q?)));
    // What is singular everywhere would be said once per pose.
    problems
        .0
        .extend(poses.map(|(name, q)| near_singular(&opened.model, name, &q)).find_map(|p| p.map(|p| p.in_file(file))));
    match declare(opened.mission.as_ref().map_or(&[], |m| &m.inputs), &opened.model) {
        Ok(inputs) => opened.inputs = inputs,
        Err(p) => problems.extend(p.in_file(file)),
    }
    leniency.settle(&mut problems);
    let (mut opened, warnings) = problems.finish(Some(opened))?;
    opened.warnings = warnings;
    Ok(opened)
}

/// A robot without a mission, which says whether it floats: it does, unless its base has no mass to float with, such as a link that
/// stands for the world.
fn alone(file: &Path, leniency: &Leniency) -> Result<(Model, Problems), Problems> {
    let read = |base_kind| {
        let options = UrdfOptions { base_kind, leniency: leniency.clone(), ..UrdfOptions::default() };
        urdf::from_file(file, &options)
    };
    let floating = read(BaseKind::Floating);
    let Err(p) = &floating else { return floating };
    let mut errors = p.0.iter().filter(|p| p.severity == Severity::Error).peekable();
    let Some(first) = errors.peek().copied().cloned() else { return floating };
    // Of a base alone: links that move and have no mass are no errors.
    if leniency.strict || !errors.all(|p| matches!(p.code, "Urdf::NoInertial" | "Urdf::MasslessBase")) {
        return floating;
    }
    let Ok((model, mut warnings)) = read(BaseKind::Fixed) else { return floating };
    let what = "has no mass to float with: taken as bolted to the ground";
    let at =
        Problem::warning(Area::Model, "Urdf::FixedBase", what).hint("set base = \"fixed\" in [robot] of a mission");
    warnings.push(Problem { file: first.file, line: first.line, object: first.object, ..at });
    Ok((model, warnings))
}

/// Why accelerations at joint positions `q` cannot be trusted (M40), if so. Allocates.
///
/// # Panics
/// If `q` has the wrong length.
pub fn near_singular(model: &Model, pose: &str, q: &[f64]) -> Option<Problem> {
    let n = model.nv();
    if n > MAX_DENSE {
        let what = format!("{n} degrees of freedom, limit {MAX_DENSE} for the condition of the mass matrix");
        let p = Problem::warning(Area::Model, "Model::NotChecked", what).on(model.name());
        return Some(p.hint("make sure yourself that no joint moves without inertia"));
    }
    let params = Params::nominal(model);
    let mut state = State::<f64>::zero(model);
    state.q.copy_from_slice(q);
    state.eta.copy_from_slice(&model.rest_position(&params));
    let mut h = DMatrix::zeros(n, n);
    mass_matrix(model, &params, &state, &mut Work::new(model), &mut h);
    let c = conditioning(&h);
    if c.number <= MAX_CONDITION {
        return None;
    }
    let names = dof_names(model);
    let named: Vec<&str> = c.weakest.iter().take(6).map(|&(i, _)| names[i].as_str()).collect();
    let shares: Vec<String> = c.weakest.iter().take(6).map(|&(i, x)| format!("{x:+.2} {}", names[i])).collect();
    let what = format!(
        "condition number {:.1e} of the mass matrix (unit diagonal) at {pose}, limit {MAX_CONDITION:.0e}; \
         weakest along {}",
        c.number,
        shares.join(" ")
    );
    let hint = "look for joints on one line with a massless link between them, or a point mass on its own axis";
    Some(Problem::error(Area::Model, "Model::NearSingular", what).on(named.join(", ")).hint(hint))
}
