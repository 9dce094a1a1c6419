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
//! [[drive]]                   # Drive: friction and gains where torques are read on the motor's side
//! joints = ["joint*"]
//! terms = ["viscous", "coulomb"]
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
pub(crate) mod drive;
pub(crate) mod excite;
mod frames;
pub(crate) mod input;
pub(crate) mod lift;
pub(crate) mod limits;
mod load;
mod mounting;
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
pub use drive::{Drive, DriveTerm};
pub use excite::{Excite, ExciteDuration, ExciteEnd, GOALS, Goal, Optimality};
pub use input::{Course, Effort, InputSpec, PulseSpec, SampleSpec, Thrust, Wrench, WrenchAxes};
pub use limits::{KeepOut, Limits, PointingLimit};
pub use robot::{Rigid, RigidBody, Robot};
pub use settings::{Current, Encoder, Estimate, EstimateMethod, Gyro, Reproduce, Sensors, Torque};
pub use uncertain::{Uncertain, named_by};

use crate::leniency::Leniency;
use crate::urdf;
use ff_model::{Area, Model, Problem, Problems, Registry};
use load::load;
use reader::error;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Largest mission file read (bytes).
pub const MAX_BYTES: usize = 1 << 20;

/// Format of mission files that this version knows, as their key `format` gives it: all from 1 to this are read.
pub const FORMAT: u64 = 1;

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
    /// `[[drive]]`, in order: what torque channels on the motor's side read beside the torques of the bodies.
    pub drives: Vec<Drive>,
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
    /// `[prior_means]`: values by full name that deviations of `[[uncertain]]` and `prior_relative_std` are about, where those of
    /// `[parameters]` are estimates: what a record has told is not what was known before it. `ffid identify` writes those of the mission here.
    pub prior_means: BTreeMap<String, f64>,
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
