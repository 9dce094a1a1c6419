//! Replays: `ffid show`, and `replay.html` of `ffid identify`.

use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::inputs::ExternalInput;
use ff_dynamics::{SimError, State, Trace};
use ff_model::{Area, Model, Params, Problem, Problems, Severity};
use ff_records::Record;
use ff_report::replay::{Appearance, Knowledge, Replay, Scene, Subject};
use ffid::open::Opened;
use ffid::sense::{at_rest, fly, fly_from};
use ffid::workflow::identify::{Identified, Parameter};
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

/// Name of the replay in the folder of an identification.
pub(crate) const FILE: &str = "replay.html";
/// Longest part of a record that is replayed (s).
const LONGEST_S: f64 = 120.0;

/// What the URDF of a file says that links look like. What cannot be read is a warning: a robot is drawn all the same.
pub(crate) fn appearance(opened: &Opened, file: &Path, problems: &mut Problems) -> Appearance {
    let urdf = match &opened.mission {
        Some(m) => file.parent().unwrap_or(Path::new("")).join(&m.robot.urdf),
        None => PathBuf::from(file),
    };
    // MuJoCo's and SDF's robots are drawn by their inertia.
    if !urdf.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf")) {
        return Appearance::default();
    }
    Appearance::of_urdf(&urdf, &opened.model).unwrap_or_else(|found| {
        soften(found, problems);
        Appearance::default()
    })
}

/// Adds errors of a picture as warnings.
fn soften(found: Problems, problems: &mut Problems) {
    problems.extend(Problems(found.0.into_iter().map(|p| Problem { severity: Severity::Warning, ..p }).collect()));
}

/// The motion of a robot from rest, base at the world's origin.
pub(crate) fn flown(
    opened: &Opened,
    params: &Params<f64>,
    motion: &dyn JointMotion,
    inputs: &[&dyn ExternalInput],
    rate_hz: f64,
    hold_s: f64,
) -> Result<Trace, Problems> {
    fly(&opened.model, params, motion, inputs, rate_hz, hold_s).map_err(|e| failed(opened.model.name(), &e))
}

fn failed(robot: &str, e: &SimError) -> Problems {
    let p = Problem::error(Area::Model, "Sim::Failed", e.to_string()).on(robot);
    Problems(vec![p.hint("excite less, or check the parameters")])
}

/// Names of what an identification finds of the initial state begin with this.
const INITIAL: &str = "initial.";

/// Where a record begins: at rest with springs relaxed, but for what the identification has found of base rates and passive coordinates.
/// The base's linear velocity moves no sensor and is none.
fn begun(model: &Model, params: &Params<f64>, motion: &dyn JointMotion, found: &[Parameter]) -> State<f64> {
    let mut state = at_rest(model, params, motion);
    let value = |name: String| found.iter().find(|p| p.name == format!("{INITIAL}{name}")).map_or(0.0, |p| p.value);
    // A fixed base has no rates.
    let base = state.v.len() - model.nj() - model.np();
    for (k, axis) in ["x", "y", "z"].iter().enumerate().filter(|_| base == 6) {
        state.v[3 + k] += value(format!("rate.{axis}"));
    }
    for (i, (name, _)) in model.passive_coords().iter().enumerate() {
        state.eta[i] += value(name.clone());
        state.v[base + model.nj() + i] += value(format!("d/dt {name}"));
    }
    state
}

/// The mission's robot with what is true of the parameters that were asked for. `None` unless that is known.
fn truth(model: &Model, mission: &Params<f64>, asked: &[Parameter]) -> Option<Params<f64>> {
    let decls = model.param_decls();
    let mut values = mission.values().to_vec();
    for p in asked {
        values[decls.iter().position(|d| d.name == p.name)?] = p.truth?;
    }
    (!asked.is_empty()).then(|| Params::from_values(model, values))
}

/// The replay of an identification: the identified robot, and the mission's, on the joint motion of the record. Problems are warnings:
/// the result does not hang on its picture.
pub(crate) fn identified(
    opened: &Opened,
    file: &Path,
    found: &Identified,
    record: &Record,
) -> (Option<String>, Problems) {
    let mut problems = Problems::default();
    let page = draw(opened, file, found, record, &mut problems);
    let html = page.map_err(|found| soften(found, &mut problems));
    (html.ok(), problems)
}

fn draw(
    opened: &Opened,
    file: &Path,
    found: &Identified,
    record: &Record,
    problems: &mut Problems,
) -> Result<String, Problems> {
    let (model, result) = (&opened.model, &found.result);
    let refused = |what: String| {
        let p = Problem::error(Area::Data, "Replay::NotDrawn", what).in_file(FILE);
        Problems(vec![p.hint("draw the robot by `ffid show`")])
    };
    let part = if record.seconds() > LONGEST_S { record.window(0.0, LONGEST_S)? } else { record.clone() };
    let motion = ident::motion::joint_motion(model, &part).map_err(|e| refused(e.to_string()))?;
    let (after, before) = (Params::from_values(model, found.values.clone()), Params::nominal(model));
    let traces = [&after, &before].map(|p| {
        let from = begun(model, p, &*motion, &result.nuisance);
        fly_from(model, p, &from, &*motion, &[], part.rate_hz(), 0.0).map_err(|e| failed(model.name(), &e))
    });
    let [after_trace, before_trace] = traces;
    let (after_trace, before_trace) = (after_trace?, before_trace?);
    // Where something was not told, its deviation has no bound, and neither has an ellipsoid.
    let told = result.parameters.iter().all(|p| p.std.is_some());
    let known = told.then(|| Knowledge::of(model, &result.covariance.names, &result.covariance.rows)).flatten();
    let priors: Vec<(String, f64)> =
        result.parameters.iter().filter_map(|p| Some((p.name.clone(), p.prior_std?.powi(2)))).collect();
    let names: Vec<String> = priors.iter().map(|p| p.0.clone()).collect();
    let rows = DMatrix::from_diagonal(&priors.iter().map(|p| p.1).collect::<Vec<_>>().into());
    let rows: Vec<Vec<f64>> = rows.row_iter().map(|r| r.iter().copied().collect()).collect();
    let prior = (priors.len() == result.parameters.len()).then(|| Knowledge::of(model, &names, &rows)).flatten();
    let appearance = appearance(opened, file, problems);
    // That of the modes in the report, so that both say the same frequencies.
    let pose = opened.pose();
    let scene = |label, params, trace, known| {
        Scene::new(&Subject { label, model, params, pose: &pose, trace: Some(trace), known, appearance: &appearance })
    };
    let mut scenes = vec![
        scene("identified", &after, &after_trace, known.as_ref()),
        scene("mission", &before, &before_trace, prior.as_ref()),
    ];
    if let Some(truth) = truth(model, &before, &result.parameters) {
        let from = begun(model, &truth, &*motion, &result.nuisance);
        let trace = fly_from(model, &truth, &from, &*motion, &[], part.rate_hz(), 0.0);
        scenes.push(scene("truth", &truth, &trace.map_err(|e| failed(model.name(), &e))?, None));
    }
    let mut replay = Replay::new(format!("Replay of {}", result.robot), scenes, appearance);
    let moving = result.nuisance.iter().any(|p| p.name.starts_with(INITIAL));
    let from =
        if moving { "from the base rates and passive coordinates with which the record begins" } else { "from rest" };
    replay.notes.push(format!(
        "All robots make the joint motion of the record, simulated {from}; without noise, biases or what acted from outside."
    ));
    if part.seconds() < record.seconds() {
        replay.notes.push(format!("The first {LONGEST_S} s of {:.1} s are shown.", record.seconds()));
    }
    if !told {
        replay.notes.push("Some parameters are not identifiable: the centre of mass has no covariance.".to_owned());
    }
    replay.render().map_err(|e| refused(e.to_string()))
}
