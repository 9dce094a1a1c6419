//! Mission files: one TOML file that names the robot, what hangs on it, its sensors, and what to estimate.
//!
//! ```toml
//! format = 1                  # version of the format, FORMAT; 1 unless given
//!
//! [robot]                     # Robot
//! urdf = "robot.urdf"
//! end_effector = "tool"
//!
//! [[client]]                  # Client: what the end effector holds
//! name = "client"
//! mass_kg = 320.0
//!
//! [[appendage]]               # AppendageSpec; further keys belong to the kind
//! kind = "slosh_pendulum"
//! name = "tank"
//! host = "base"
//! mount = { xyz_m = [0.9, 0.0, 0.6] }
//!
//! [[input]]                   # InputSpec: what acts from outside in `ffid simulate`
//! kind = "thruster"
//! host = "base"
//! point_m = [-0.4, 0.3, 0.2]
//! direction = [0.8, 0.1, -0.3]
//! pulse = [{ t_on_s = 1.3, t_off_s = 4.1, force_n = 6.5 }]
//!
//! [sensors]                   # Sensors
//! rate_hz = 100.0
//! [sensors.gyro]
//! noise_std_rad_per_s = 1.5e-4
//!
//! [limits]                    # Limits
//! velocity_rad_per_s = 0.17
//!
//! [estimate]                  # Estimate
//! parameters = ["base.*", "tank.*"]
//!
//! [excite]                    # Excite
//! goal = "information"
//! duration_s = 60.0
//!
//! [parameters]                # Mission::parameters: values that replace those from above
//! "base.mass" = 612.5
//! ```
//!
//! A key that ends with `_file` names a file; a relative path starts at the folder of the mission file, for the keys
//! of every kind of appendage.
//!
//! Every key carries its unit and is documented on the field of the struct it fills. Unknown keys, NaN and
//! infinity are errors; all problems are listed with file, line and column. Reasons go into comments.
pub(crate) mod appendage;
pub(crate) mod changes;
pub(crate) mod client;
pub(crate) mod declared;
pub(crate) mod excite;
pub(crate) mod input;
pub(crate) mod lift;
pub(crate) mod limits;
pub(crate) mod reader;
pub(crate) mod robot;
pub mod schema;
pub(crate) mod select;
pub(crate) mod settings;
pub(crate) mod uncertain;
pub(crate) mod values;

pub use appendage::{AppendageSpec, Mount};
pub use changes::Changes;
pub use client::Client;
pub use excite::{Excite, ExciteDuration, ExciteEnd, GOALS, Goal, Optimality};
pub use input::{Course, Effort, InputSpec, PulseSpec, SampleSpec, Thrust, Wrench, WrenchAxes};
pub use limits::{KeepOut, Limits, PointingLimit};
pub use robot::{Rigid, RigidBody, Robot};
pub use settings::{Encoder, Estimate, EstimateMethod, Gyro, Reproduce, Sensors, Torque};
pub use uncertain::{Uncertain, named_by};

use crate::leniency::Leniency;
use crate::lines::LineIndex;
use crate::urdf;
use crate::urdf::UrdfOptions;
use appendage::{APPENDAGE, Draft, Kinds};
use changes::CHANGES;
use client::CLIENT;
use declared::{Holds, Key, key, must};
use excite::EXCITE;
use ff_model::Model;
use ff_model::Registry;
use ff_model::diagnostics::{Limit, clip, list, nearest};
use ff_model::{Area, Problem, Problems, Severity};
use input::INPUTS;
use limits::LIMITS;
use nalgebra::Vector3;
use reader::{Context, Table, error};
use robot::ROBOT;
use serde::Serialize;
use settings::{ESTIMATE, REPRODUCE, SENSORS};
use std::collections::BTreeMap;
use std::path::Path;
use toml::de::DeTable;
use uncertain::UNCERTAIN;

/// Largest mission file read (bytes).
pub const MAX_BYTES: usize = 1 << 20;

/// Format of mission files that this version knows, as their key `format` gives it: all from 1 to this are read.
pub const FORMAT: u64 = 1;

/// Keys of a mission file. Those of a section are declared beside what it is read to.
const ROOT: &[Key] = &[
    key("format", Holds::WholeWithin { from: 1, to: FORMAT, unit: "" }, "version of the format of this file")
        .or_whole(1),
    must("robot", Holds::Table(ROBOT), "which robot, which base, gravity"),
    key("client", Holds::Tables(CLIENT), "what the end effector holds"),
    key("appendage", Holds::Appendages(APPENDAGE), "what hangs on the robot: panels, fuel, wheels"),
    key("input", Holds::TablesOf(INPUTS), "what acts in ffid simulate"),
    key("sensors", Holds::Table(SENSORS), "rate and noise of the sensors"),
    key("uncertain", Holds::Tables(UNCERTAIN), "what is not known exactly: masses, placements, parameters"),
    key("changes", Holds::Tables(CHANGES), "what changes from one record to the next: fuel that is burnt"),
    key("limits", Holds::Table(LIMITS), "what planned motion must keep to"),
    key("estimate", Holds::Table(ESTIMATE), "what is identified, and from which start"),
    key("excite", Holds::Table(EXCITE), "the manoeuvre that is planned"),
    key("reproduce", Holds::Table(REPRODUCE), "the procedure of the paper, for cargo xtask reproduce"),
    key("parameters", Holds::Named, "values by full name that replace those from above, such as \"base.mass\" = 612.5"),
];

/// A mission file as read.
///
/// ```
/// use ff_mission::{LoadOptions, Mission};
/// use ff_model::Registry;
/// # let urdf = r#"<robot name="probe">
/// #   <link name="hull"><inertial><mass value="50"/><inertia ixx="9" iyy="8" izz="7" ixy="0.1" ixz="0.2" iyz="0.3"/></inertial></link>
/// #   <link name="arm"><inertial><mass value="4"/><inertia ixx="0.3" iyy="0.2" izz="0.3" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="hull"/><child link="arm"/><axis xyz="0.6 0 0.8"/></joint>
/// # </robot>"#;
///
/// let mission = r#"
/// [robot]
/// urdf = "probe.urdf"
/// base = "floating"
/// [estimate]
/// parameters = ["base.*"]
/// [parameters]
/// "base.mass" = 51.5
/// "#;
///
/// let loaded = Mission::from_str(mission, urdf, &Registry::new(), &LoadOptions::default())?;
/// assert_eq!(loaded.mission.estimate.parameters, ["base.*"]);
/// assert_eq!(loaded.mission.parameters["base.mass"], 51.5);
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mission {
    /// `[robot]`.
    pub robot: Robot,
    /// `[[client]]`, in order.
    pub clients: Vec<Client>,
    /// `[[appendage]]`, in order.
    pub appendages: Vec<AppendageSpec>,
    /// `[[input]]`, in order: what `ffid simulate` lets act on the robot.
    pub inputs: Vec<InputSpec>,
    /// `[sensors]`.
    pub sensors: Sensors,
    /// `[[uncertain]]`, in order: what is not known exactly.
    pub uncertain: Vec<Uncertain>,
    /// `[[changes]]`, in order: what changes from one record to the next.
    pub changes: Vec<Changes>,
    /// `[limits]`.
    pub limits: Limits,
    /// `[estimate]`.
    pub estimate: Estimate,
    /// `[excite]`.
    pub excite: Excite,
    /// `[reproduce]`, when there is one.
    pub reproduce: Option<Reproduce>,
    /// `[parameters]`: nominal values by full name, such as `"panel_left.k[0]" = 198.7`, in place of those that URDF,
    /// `[robot]` and `[[appendage]]` give. `ffid identify` writes its estimates here; every number is taken as it is, to
    /// the last bit.
    pub parameters: BTreeMap<String, f64>,
}

/// A mission and the model it describes.
///
/// ```
/// use ff_mission::{LoadOptions, Mission};
/// use ff_model::Registry;
/// # let urdf = r#"<robot name="probe">
/// #   <link name="hull"><inertial><mass value="50"/><inertia ixx="9" iyy="8" izz="7" ixy="0.1" ixz="0.2" iyz="0.3"/></inertial></link>
/// #   <link name="arm"><inertial><mass value="4"/><inertia ixx="0.3" iyy="0.2" izz="0.3" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="hull"/><child link="arm"/><axis xyz="0.6 0 0.8"/></joint>
/// # </robot>"#;
///
/// let mission = r#"
/// [robot]
/// urdf = "probe.urdf"
/// base = "floating"
/// [estimate]
/// parameters = ["base.*"]
/// [parameters]
/// "base.mass" = 51.5
/// "#;
///
/// let loaded = Mission::from_str(mission, urdf, &Registry::new(), &LoadOptions::default())?;
/// assert_eq!((loaded.model.nv(), loaded.model.total_mass()), (7, 51.5 + 4.0));
/// assert_eq!(loaded.estimated.len(), 10); // base.mass to base.i_zz
/// assert!(loaded.warnings.0.is_empty());
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The file.
    pub mission: Mission,
    /// Robot, appendages and gravity.
    pub model: Model,
    /// Indices of the parameters of `[estimate]` in the parameter vector, ascending.
    pub estimated: Vec<usize>,
    /// Indices of the parameters of `[excite]`, ascending; those of `[estimate]` when that section names none.
    pub excited: Vec<usize>,
    /// Body and pose are those of this frame of the model; `None` when the mission names no end effector.
    pub end_effector: Option<usize>,
    /// Warnings of mission file and URDF, to be recorded with every result.
    pub warnings: Problems,
}

/// How to load a mission.
///
/// ```
/// use ff_mission::{LoadOptions, Mission};
/// use ff_model::Registry;
/// # let urdf = r#"<robot name="probe">
/// #   <link name="hull"><inertial><mass value="50"/><inertia ixx="9" iyy="8" izz="7" ixy="0.1" ixz="0.2" iyz="0.3"/></inertial></link>
/// #   <link name="arm"><inertial><mass value="4"/><inertia ixx="0.3" iyy="0.2" izz="0.3" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="hull"/><child link="arm"/><axis xyz="0.6 0 0.8"/></joint>
/// # </robot>"#;
///
/// let mission = r#"
/// [robot]
/// urdf = "probe.urdf"
/// base = "floating"
/// [estimate]
/// parameters = ["base.*"]
/// [parameters]
/// "base.mass" = 51.5
/// "#;
/// use ff_mission::Leniency;
///
/// // Moments of inertia that no body has: an error, unless its code is allowed.
/// let (thin, mission) = (urdf.replace("ixx=\"9\"", "ixx=\"19\""), mission.replace("\"base.mass\" = 51.5", ""));
/// let allow = LoadOptions { leniency: Leniency { allow: vec!["triangle".into()], strict: false } };
/// assert!(Mission::from_str(&mission, &thin, &Registry::new(), &LoadOptions::default()).unwrap_err().has("Urdf::Triangle"));
/// let warnings = Mission::from_str(&mission, &thin, &Registry::new(), &allow)?.warnings;
/// assert!(warnings.has("Urdf::Triangle"));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Named errors to allow, and whether warnings refuse.
    pub leniency: Leniency,
}

impl Mission {
    /// Loads a mission file and the URDF it names.
    ///
    /// # Errors
    /// All problems of both files: area `Config` for the mission, `Model` for the URDF, `Io` when a file
    /// cannot be read.
    pub fn load(path: &Path, registry: &Registry, options: &LoadOptions) -> Result<Loaded, Problems> {
        let one = |p: Problem| Problems(vec![p]);
        let bytes = ff_model::diagnostics::read_bytes(path, MAX_BYTES, Area::Config, "Config::TooLarge")?;
        let text = std::str::from_utf8(&bytes).map_err(|e| {
            let at = e.valid_up_to();
            let line = 1 + bytes.iter().take(at).filter(|&&b| b == b'\n').count();
            one(error("Config::NotUtf8", format!("byte {at} is not UTF-8"))
                .in_file(path)
                .at_line(line)
                .hint("save the file as UTF-8"))
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        load(text, Some(path), registry, options, |robot, o| {
            let name = robot.urdf.to_string_lossy();
            // A URL-like path is for the URDF reader to refuse, not to be joined to a folder.
            let file = if name.contains("://") { robot.urdf.clone() } else { folder.join(&robot.urdf) };
            urdf::read_file(&file, o)
        })
    }

    /// Loads a mission from a text, with the text of the URDF at hand; `robot.urdf` is not opened.
    ///
    /// # Errors
    /// All problems of both texts.
    pub fn from_str(
        text: &str,
        urdf_text: &str,
        registry: &Registry,
        options: &LoadOptions,
    ) -> Result<Loaded, Problems> {
        load(text, None, registry, options, |_, o| urdf::read_str(urdf_text, o))
    }
}

/// The whole way from text to model; `import` fetches the robot.
fn load(
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
    let limits = root.table("limits").map(|t| Limits::read(&t)).unwrap_or_default();
    let estimate_table = root.table("estimate");
    let estimate = estimate_table.as_ref().map(Estimate::read).unwrap_or_default();
    let excite_table = root.table("excite");
    let excite = excite_table.as_ref().map(Excite::read).unwrap_or_default();
    let reproduce_table = root.table("reproduce");
    let reproduce = reproduce_table.as_ref().map(Reproduce::read);
    let values_table = root.table("parameters");
    let parameters = values_table.as_ref().map(values::read).unwrap_or_default();
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
    let appendages = drafts.iter().filter_map(Draft::spec).collect();
    for (t, i) in inputs.iter().filter_map(|(t, i)| Some((t, i.as_ref()?))) {
        i.check(&frames, &model, complete, t);
    }
    let inputs = inputs.into_iter().filter_map(|(_, i)| i).collect();
    if complete {
        uncertain.iter().for_each(|(t, u)| u.check(&model, t));
        changes.iter().for_each(|(t, c)| c.check(&model, t));
    }
    let uncertain = uncertain.into_iter().map(|(_, u)| u).collect();
    let changes = changes.into_iter().map(|(_, c)| c).collect();
    let mut estimated = Vec::new();
    // With an appendage missing, patterns for its parameters would be reported as well.
    if let (Some(t), true) = (&estimate_table, complete) {
        estimated = select::indices(&estimate.parameters, &model, t);
        doubtful(&model, &estimated, imported);
    }
    let mut excited = estimated.clone();
    if let Some(t) = &excite_table {
        let own = excite.check(&model, complete, t);
        if !own.is_empty() {
            excited = own;
        }
    }
    if let (Some(r), Some(t)) = (&reproduce, &reproduce_table) {
        check_reproduce(r, &model, t);
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
        limits,
        estimate,
        excite,
        reproduce,
        parameters,
    };
    Some(Loaded { mission, model, estimated, excited, end_effector, warnings: Problems::default() })
}

/// What is estimated starts from a body that can be: inertias that were let through because nothing follows from them are errors
/// there.
fn doubtful(model: &Model, estimated: &[usize], imported: &mut Problems) {
    let bodies = (0..model.n_bodies()).filter(|b| estimated.iter().any(|i| (10 * b..10 * b + 10).contains(i)));
    for b in bodies.filter(|&b| model.inertia(b).check().is_err()) {
        let of_body = |p: &Problem| {
            let link = p.object.as_deref().and_then(|o| o.strip_prefix("link "));
            link.and_then(|l| model.frame(l)).is_some_and(|f| f.body == b)
        };
        let codes = ["Urdf::Triangle", "Urdf::InertiaNotPsd"];
        for p in imported.0.iter_mut().filter(|p| codes.contains(&p.code) && of_body(p)) {
            p.severity = Severity::Error;
            let what = p.message.split(urdf::build::TAKEN).next().unwrap_or_default();
            p.message = format!("{what}, and body {} is to be estimated from it", model.body_name(b));
        }
    }
}

/// Makes the appendages that are lifted out of the tree, and the tree without them.
fn lift_all(drafts: &mut [Draft<'_, '_>], tree: Model, kinds: &Kinds<'_>) -> Model {
    let mut lifted: Vec<usize> = Vec::new();
    for d in drafts.iter_mut().filter(|d| d.lift.is_some()) {
        let Some(bodies) = d.lift(&tree, kinds) else { continue };
        if let Some(&b) = bodies.iter().find(|b| lifted.contains(b)) {
            let name = &tree.bodies()[b - 1].joint.name;
            let p = error("Config::Conflict", format!("joint {name} is lifted by another appendage as well"));
            d.table.fail("lift", p.hint("name it once"));
            d.appendage = None;
        }
        lifted.extend(bodies);
    }
    if lifted.is_empty() { tree } else { lift::without(&tree, &lifted).0 }
}

/// Gives a client its frame; false when it could not, with the problems recorded at its table.
fn hold(model: &mut Model, client: Option<&Client>, robot: &Robot, t: &Table<'_, '_>) -> bool {
    let Some(c) = client else { return false };
    if model.frame(&c.name).is_some() || c.name == "base" {
        let p = error("Config::DuplicateName", format!("'{}' is the name of a link as well", c.name));
        t.fail("name", p.hint("rename the client"));
        return false;
    }
    let Some(host) = c.host.as_ref().or(robot.end_effector.as_ref()) else {
        let p = error("Config::MissingKey", "no link holds the client: neither host nor robot.end_effector is given");
        t.fail("host", p.hint("add host = ..., or end_effector = ... in [robot]"));
        return false;
    };
    let Some(k) = Frames(model).find(host, "host", t) else { return false };
    let (body, pose) = (model.frames()[k].body, model.frames()[k].placement * c.mount.to_xform());
    model.add_frame(c.name.as_str(), body, pose);
    true
}

/// Mounts the body of a client on its frame.
fn mount_client(model: &mut Model, frames: &Frames<'_>, client: Option<&Client>, t: &Table<'_, '_>) {
    let Some((c, f)) = client.and_then(|c| Some((c, frames.0.frame(&c.name)?))) else { return };
    let Some(payload) = c.payload(t) else { return };
    if let Err(problems) = model.mount(c.name.as_str(), f.body, f.placement, payload) {
        problems.0.into_iter().for_each(|p| t.fail("name", p));
    }
}

/// Frames of the robot without appendages, looked up by name.
struct Frames<'m>(&'m Model);

impl Frames<'_> {
    /// Index of a frame; an unknown name is reported at `key` of `t`.
    fn find(&self, name: &str, key: &str, t: &Table<'_, '_>) -> Option<usize> {
        let found = self.0.frames().iter().position(|f| f.name == name);
        if found.is_none() {
            let names = || self.0.frames().iter().map(|f| f.name.as_str());
            let p = error("Config::UnknownFrame", format!("the robot has no link '{}'", clip(name)));
            t.fail(
                key,
                match nearest(name, names()) {
                    Some(n) => p.hint(format!("did you mean {n}?")),
                    None => p.hint(format!("links: {}", list(names(), 12))),
                },
            );
        }
        found
    }
}

/// Mounts one appendage; false when it could not be, with the problems recorded at its table.
fn mount(model: &mut Model, frames: &Frames<'_>, d: &Draft<'_, '_>) -> bool {
    let t = &d.table;
    if d.host.is_some() && d.host == d.name {
        let p = error("Config::UnknownFrame", "an appendage cannot hang on itself");
        t.fail("host", p.hint("name a link of the URDF as host"));
        return false;
    }
    // Parameters of bodies are called `base.mass` and `<link>.mass`.
    let taken = |n: &&String| *n == "base" || (0..model.n_bodies()).any(|i| model.body_name(i) == *n);
    if let Some(n) = d.name.as_ref().filter(taken) {
        let p = error("Config::DuplicateName", format!("'{n}' is the name of a body as well"));
        t.fail("name", p.hint("rename the appendage"));
        return false;
    }
    let frame = d.host.as_ref().and_then(|h| frames.find(h, "host", t)).map(|k| &frames.0.frames()[k]);
    let (Some(f), Some(spec), Some(a)) = (frame, d.spec(), &d.appendage) else { return false };
    let pose = f.placement * spec.mount.to_xform();
    match model.mount(spec.name.as_str(), f.body, pose, a.clone()) {
        Ok(()) => true,
        Err(problems) => {
            for p in problems.0 {
                let prefix = format!("{}.", spec.name);
                let key = p.object.as_deref().and_then(|o| o.strip_prefix(&prefix)).unwrap_or("name").to_owned();
                t.fail_at(t.place(&key), p);
            }
            false
        }
    }
}

/// What of `[reproduce]` can be checked against the robot.
fn check_reproduce(r: &Reproduce, model: &Model, t: &Table<'_, '_>) {
    if !r.hold_rad.is_empty() && r.hold_rad.len() != model.nj() {
        let what = format!("{} positions for {} joints", r.hold_rad.len(), model.nj());
        t.fail("hold_rad", error("Config::WrongLength", what).hint("give one position per joint"));
    } else {
        for (b, &q) in model.bodies().iter().zip(&r.hold_rad) {
            let l = &b.joint.limits;
            if !(l.lower..=l.upper).contains(&q) {
                let what = format!("joint {}: {q} rad, limit {} .. {} rad", b.joint.name, l.lower, l.upper);
                let p = error("Config::OutOfRange", what).violating(q, Limit::Within(l.lower, l.upper), "rad");
                t.fail("hold_rad", p.hint("give a position within the joint limits"));
            }
        }
    }
    let names = model.joint_names();
    for j in r.manoeuvre_joints.iter().filter(|j| !names.contains(j)) {
        let p = error("Config::UnknownJoint", format!("the robot has no moving joint '{}'", clip(j)));
        t.fail(
            "manoeuvre_joints",
            match nearest(j, names.iter().map(String::as_str)) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint(format!("joints: {}", list(names.iter().map(String::as_str), 12))),
            },
        );
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
