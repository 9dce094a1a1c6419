//! The way from the text of a mission to its model: sections, the robot, what hangs on it, what is estimated.

use super::appendage::{APPENDAGE, Draft, Kinds};
use super::changes::{CHANGES, Changes};
use super::client::{CLIENT, Client};
use super::declared::{Holds, Key, key, must};
use super::drive::{DRIVE, Drive};
use super::excite::{EXCITE, Excite};
use super::frames::Frames;
use super::input::{INPUTS, InputSpec};
use super::limits::{LIMITS, Limits};
use super::mounting::{hold, lift_all, mount, mount_client};
use super::reader::{Context, Table, error};
use super::robot::{ROBOT, RigidBody, Robot};
use super::settings::{ESTIMATE, Estimate, REPRODUCE, Reproduce, SENSORS, Sensors};
use super::uncertain::{UNCERTAIN, Uncertain};
use super::{FORMAT, LoadOptions, Loaded, Mission, select, values};
use crate::lines::LineIndex;
use crate::urdf;
use crate::urdf::UrdfOptions;
use ff_model::diagnostics::clip;
use ff_model::{Area, Model, Problem, Problems, Registry, Severity};
use nalgebra::Vector3;
use std::path::Path;
use toml::de::DeTable;

/// Keys of a mission file. Those of a section are declared beside what it is read to.
pub(super) const ROOT: &[Key] = &[
    key("format", Holds::WholeWithin { from: 1, to: FORMAT, unit: "" }, "version of the format of this file")
        .or_whole(1),
    must("robot", Holds::Table(ROBOT), "which robot, which base, gravity"),
    key("client", Holds::Tables(CLIENT), "what the end effector holds"),
    key("appendage", Holds::Appendages(APPENDAGE), "what hangs on the robot: panels, fuel, wheels"),
    key("input", Holds::TablesOf(INPUTS), "what acts in ffid simulate"),
    key("sensors", Holds::Table(SENSORS), "rate and noise of the sensors"),
    key("uncertain", Holds::Tables(UNCERTAIN), "what is not known exactly: masses, placements, parameters"),
    key("changes", Holds::Tables(CHANGES), "what changes from one record to the next: fuel that is burnt"),
    key(
        "drive",
        Holds::Tables(DRIVE),
        "friction, reflected inertia and gains where torques are read on the motor's side",
    ),
    key("limits", Holds::Table(LIMITS), "what planned motion must keep to"),
    key("estimate", Holds::Table(ESTIMATE), "what is identified, and from which start"),
    key("excite", Holds::Table(EXCITE), "the manoeuvre that is planned"),
    key("reproduce", Holds::Table(REPRODUCE), "the procedure of the paper, for cargo xtask reproduce"),
    key("parameters", Holds::Named, "values by full name that replace those from above, such as \"base.mass\" = 612.5"),
    key(
        "prior_means",
        Holds::Named,
        "values by full name that priors and deviations of [[uncertain]] are about, where those of parameters are estimates",
    ),
];
/// The whole way from text to model; `import` fetches the robot.
pub(super) fn load(
    text: &str,
    file: Option<&Path>,
    registry: &Registry,
    options: &LoadOptions,
    import: impl FnOnce(&Robot, &UrdfOptions) -> Result<(Model, Problems), Problems>,
) -> Result<Loaded, Problems> {
    let mut out = options.leniency.check();
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let (doc, syntax) = DeTable::parse_recoverable(text);
    let cx = Context::new(text);
    let folder = file.and_then(Path::parent);
    let loaded = if syntax.is_empty() {
        for (k, v) in doc.get_ref() {
            cx.finite(k.get_ref(), v);
        }
        let root = Table::root(&cx, &doc, ROOT);
        if is_readable(&root) {
            let mut imported = Problems::default();
            let kinds = Kinds { registry, folder };
            let loaded = read(&root, &kinds, options, import, &mut imported);
            out.extend(imported);
            loaded
        } else {
            None
        }
    } else {
        syntax.iter().take(100).for_each(|e| cx.push(syntax_problem(text, e)));
        None
    };
    let mut own = cx.take();
    if let Some(f) = file {
        // A problem inside a file that the mission names keeps the name of that file.
        own = own.in_file(f);
    }
    out.extend(own);
    options.leniency.settle(&mut out);
    urdf::summary::summarise(&mut out);
    let (mut loaded, warnings) = out.finish(loaded)?;
    loaded.warnings = warnings;
    Ok(loaded)
}

/// False for a file in a newer format, which is reported: nothing else in it can be judged.
fn is_readable(root: &Table<'_, '_>) -> bool {
    let Some(format) = root.newer_than("format", FORMAT) else { return true };
    root.fail("format", Problem::newer_format(Area::Config, "Config::Version", format, FORMAT));
    false
}

/// Reads all sections, imports the robot, mounts the appendages; goes on as far as there is something to
/// check.
fn read(
    root: &Table<'_, '_>,
    kinds: &Kinds<'_>,
    options: &LoadOptions,
    import: impl FnOnce(&Robot, &UrdfOptions) -> Result<(Model, Problems), Problems>,
    imported: &mut Problems,
) -> Option<Loaded> {
    root.whole("format");
    let robot_table = root.table("robot");
    let robot = robot_table.as_ref().and_then(Robot::read);
    let clients: Vec<(Table<'_, '_>, Option<Client>)> = root
        .tables("client")
        .into_iter()
        .map(|t| {
            let c = Client::read(&t);
            (t, c)
        })
        .collect();
    let mut drafts: Vec<Draft<'_, '_>> = root.tables("appendage").into_iter().map(|t| Draft::read(t, kinds)).collect();
    let inputs: Vec<(Table<'_, '_>, Option<InputSpec>)> = root
        .tables("input")
        .into_iter()
        .map(|t| {
            let i = InputSpec::read(&t);
            (t, i)
        })
        .collect();
    let sensors = root.table("sensors").map(|t| Sensors::read(&t)).unwrap_or_default();
    let uncertain: Vec<(Table<'_, '_>, Uncertain)> = root
        .tables("uncertain")
        .into_iter()
        .map(|t| {
            let u = Uncertain::read(&t);
            (t, u)
        })
        .collect();
    let changes: Vec<(Table<'_, '_>, Changes)> = root
        .tables("changes")
        .into_iter()
        .map(|t| {
            let c = Changes::read(&t);
            (t, c)
        })
        .collect();
    let drives: Vec<(Table<'_, '_>, Drive)> = root
        .tables("drive")
        .into_iter()
        .map(|t| {
            let d = Drive::read(&t);
            (t, d)
        })
        .collect();
    let limits = root.table("limits").map(|t| Limits::read(&t)).unwrap_or_default();
    let estimate_table = root.table("estimate");
    let estimate = estimate_table.as_ref().map(Estimate::read).unwrap_or_default();
    let excite_table = root.table("excite");
    let excite = excite_table.as_ref().map(Excite::read).unwrap_or_default();
    let reproduce_table = root.table("reproduce");
    let reproduce = reproduce_table.as_ref().map(Reproduce::read);
    let values_table = root.table("parameters");
    let parameters = values_table.as_ref().map(values::read).unwrap_or_default();
    let means_table = root.table("prior_means");
    let prior_means = means_table.as_ref().map(values::read).unwrap_or_default();
    root.finish();

    let (robot, robot_table) = (robot?, robot_table?);
    let urdf_options = UrdfOptions {
        base_link: robot.base_link.clone(),
        base_kind: robot.base,
        base_inertial: robot.base_inertial.as_ref().map(RigidBody::inertia),
        subtree: robot.subtree.clone(),
        lock: robot.lock.clone(),
        lock_at: robot.lock_at.clone(),
        lifted: drafts.iter().flat_map(|d| d.lift.iter().flatten().cloned()).collect(),
        leniency: options.leniency.clone(),
        ..UrdfOptions::default()
    };
    let mut model = match import(&robot, &urdf_options) {
        Ok((model, warnings)) => {
            imported.extend(warnings);
            model
        }
        Err(problems) => {
            // The importer knows these only as options; here they have a key and a line.
            for p in problems.0 {
                match p.area {
                    Area::Config => robot_table.fail(robot.key_of(&p), p),
                    _ => imported.push(p),
                }
            }
            return None;
        }
    };
    model = model.with_gravity(Vector3::from(robot.gravity_m_per_s2));
    model = lift_all(&mut drafts, model, kinds);
    let held: Vec<bool> = clients.iter().map(|(t, c)| hold(&mut model, c.as_ref(), &robot, t)).collect();
    let frames = Frames(&model.clone());
    let end_effector = robot.end_effector.as_ref().and_then(|n| frames.find(n, "end_effector", &robot_table));
    for r in &robot.rigid {
        if let Some(k) = frames.find(&r.link, "rigid", &robot_table) {
            let f = &frames.0.frames()[k];
            model.add_rigid(f.body, &r.body.inertia().to_parent(&f.placement));
        }
    }
    for ((t, c), _) in clients.iter().zip(&held).filter(|(_, held)| **held) {
        mount_client(&mut model, &frames, c.as_ref(), t);
    }
    // Mount all before asking whether all could be, so that each says what is wrong with it.
    let mounted: Vec<bool> = drafts.iter().map(|d| mount(&mut model, &frames, d)).collect();
    let complete = mounted.iter().chain(&held).all(|&m| m);
    if let (Some(t), true) = (&values_table, complete) {
        values::apply(&mut model, &parameters, t);
    }
    if let (Some(t), true) = (&means_table, complete) {
        values::check(&model, &prior_means, t);
    }
    let appendages = drafts.iter().filter_map(Draft::spec).collect();
    for (t, i) in inputs.iter().filter_map(|(t, i)| Some((t, i.as_ref()?))) {
        i.check(&frames, &model, complete, t);
    }
    let inputs = inputs.into_iter().filter_map(|(_, i)| i).collect();
    if complete {
        uncertain.iter().for_each(|(t, u)| u.check(&model, t));
        changes.iter().for_each(|(t, c)| c.check(&model, t));
        drives.iter().for_each(|(t, d)| d.check(&model, t));
    }
    let uncertain = uncertain.into_iter().map(|(_, u)| u).collect();
    let changes = changes.into_iter().map(|(_, c)| c).collect();
    let drives = drives.into_iter().map(|(_, d)| d).collect();
    let mut estimated = Vec::new();
    // With an appendage missing, patterns for its parameters would be reported as well.
    if let (Some(t), true) = (&estimate_table, complete) {
        estimated = select::indices(&estimate.parameters, &model, t);
        doubtful(&model, &estimated, imported, t);
    }
    let mut excited = estimated.clone();
    if let Some(t) = &excite_table {
        let own = excite.check(&model, complete, t);
        if !own.is_empty() {
            excited = own;
        }
    }
    if let (Some(r), Some(t)) = (&reproduce, &reproduce_table) {
        r.check(&model, t);
    }
    let clients = clients.into_iter().filter_map(|(_, c)| c).collect();
    let mission = Mission {
        robot,
        clients,
        appendages,
        inputs,
        sensors,
        uncertain,
        changes,
        drives,
        limits,
        estimate,
        excite,
        reproduce,
        parameters,
        prior_means,
    };
    Some(Loaded { mission, model, estimated, excited, end_effector, warnings: Problems::default() })
}

/// What is estimated starts from a body that can be: inertias that were let through because nothing follows from them are errors
/// there.
fn doubtful(model: &Model, estimated: &[usize], imported: &mut Problems, t: &Table<'_, '_>) {
    let bodies = (0..model.n_bodies()).filter(|b| estimated.iter().any(|i| (10 * b..10 * b + 10).contains(i)));
    for b in bodies {
        let Err(why) = model.inertia(b).check() else { continue };
        let mut of_urdf = false;
        let of_body = |p: &Problem| {
            let link = p.object.as_deref().and_then(|o| o.strip_prefix("link "));
            link.and_then(|l| model.frame(l)).is_some_and(|f| f.body == b)
        };
        let codes = ["Urdf::Triangle", "Urdf::InertiaNotPsd"];
        for p in imported.0.iter_mut().filter(|p| codes.contains(&p.code) && of_body(p)) {
            p.severity = Severity::Error;
            let what = p.message.split(urdf::build::TAKEN).next().unwrap_or_default();
            p.message = format!("{what}, and body {} is to be estimated from it", model.body_name(b));
            of_urdf = true;
        }
        // Else its numbers are those of `[parameters]`.
        if !of_urdf {
            let p = error("Config::Inertia", format!("body {} is to be estimated from {why}", model.body_name(b)));
            t.fail("parameters", p.hint("give it numbers that a body can have, or leave it out of parameters"));
        }
    }
}

/// A syntax error of the TOML text.
fn syntax_problem(text: &str, e: &toml::de::Error) -> Problem {
    let message = clip(e.message().lines().next().unwrap_or("not TOML"));
    let (code, hint) = if message.contains("duplicate key") {
        ("Config::DuplicateKey", "keep one of the two")
    } else if message.contains("recurs") {
        ("Config::TooDeep", "a mission file needs 4 levels; limit 80")
    } else {
        ("Config::Syntax", "mend the TOML; texts need quotes, numbers a decimal point")
    };
    let (line, column) = LineIndex::new(text).at(e.span().map_or(text.len(), |s| s.start));
    error(code, message).at(line, column).on("file").hint(hint)
}
