//! Keys of mission files. Meanings in full are on the fields of [`ff_mission::mission`].

use super::Holds::{
    Appendages, Named, NotNegative, Number, Numbers, OneOf, Positive, Rows, Symmetric, Table, Tables, TablesOf, Text,
    Texts, Vector, Whole, Wholes,
};
use super::{Key, key, must};

pub(super) const ROOT: &[Key] = &[
    must("robot", Table(ROBOT), "which robot, which base, gravity"),
    key("client", Tables(CLIENT), "what the end effector holds"),
    key("appendage", Appendages(APPENDAGE), "what hangs on the robot: panels, fuel, wheels"),
    key("input", TablesOf(&[THRUSTER, WRENCH, PASSIVE_FORCE, GRAVITY_GRADIENT]), "what acts in ffid simulate"),
    key("sensors", Table(SENSORS), "rate and noise of the sensors"),
    key("limits", Table(LIMITS), "what planned motion must keep to"),
    key("estimate", Table(ESTIMATE), "what is identified, and from which start"),
    key("excite", Table(EXCITE), "the manoeuvre that is planned"),
    key("reproduce", Table(REPRODUCE), "the procedure of the paper, for cargo xtask reproduce"),
    key("parameters", Named, "values by full name that replace those from above, such as \"base.mass\" = 612.5"),
];

const ROBOT: &[Key] = &[
    must("urdf", Text, "path of the URDF, relative to the mission file"),
    key("base_link", Text, "link whose frame is the base frame; the root unless given"),
    key("end_effector", Text, "link whose motion is reported"),
    key("base", OneOf(&["floating", "fixed"]), "floating unless given"),
    key("gravity_m_per_s2", Vector(3), "gravity in world axes (m/s^2); zero unless given"),
    key("base_inertial", Table(BODY), "replaces the inertial of the base link"),
    key("rigid", Tables(RIGID), "rigid mass on a link"),
];

const BODY: &[Key] = &[
    must("mass_kg", Positive, "mass (kg)"),
    key("com_m", Vector(3), "centre of mass in the link frame (m)"),
    key("inertia_com_kgm2", Symmetric, "inertia about the centre of mass (kg m^2): xx, xy, xz, yy, yz, zz or rows"),
];

const RIGID: &[Key] = &[
    must("link", Text, "the link that carries the mass"),
    must("mass_kg", Positive, "mass (kg)"),
    key("com_m", Vector(3), "centre of mass in the link frame (m)"),
    key("inertia_com_kgm2", Symmetric, "inertia about the centre of mass (kg m^2): xx, xy, xz, yy, yz, zz or rows"),
];

const MOUNT: &[Key] = &[
    key("xyz_m", Vector(3), "origin of the mount frame in the link frame (m)"),
    key("rpy_rad", Vector(3), "roll, pitch, yaw as in URDF (rad)"),
    key("quat_wxyz", Vector(4), "unit quaternion, scalar first"),
    key("rotation", Rows, "rotation from mount to link coordinates, in rows"),
];

const CLIENT: &[Key] = &[
    must("name", Text, "name of its frame, prefix of its parameters"),
    key("host", Text, "link that holds it; robot.end_effector unless given"),
    key("mount", Table(MOUNT), "pose of the client frame in the link frame"),
    must("mass_kg", Positive, "mass (kg)"),
    key("com_m", Vector(3), "centre of mass in the client frame (m)"),
    key("inertia_com_kgm2", Symmetric, "inertia about the centre of mass (kg m^2): xx, xy, xz, yy, yz, zz or rows"),
];

const APPENDAGE: &[Key] = &[
    must("kind", Text, "what hangs there"),
    must("name", Text, "prefix of its parameters and coordinates"),
    key("host", Text, "link that carries it"),
    key("mount", Table(MOUNT), "pose of the mount frame in the link frame"),
    key("lift", Texts, "joints of the URDF that become its hinges, from the host outwards"),
];

const T_ON: Key = must("t_on_s", Number, "begin (s)");
const T_OFF: Key = must("t_off_s", Number, "end (s), later than t_on_s");
const T: Key = must("t_s", Number, "time (s), later than that of the sample before");

const THRUST: Key = must("force_n", NotNegative, "force (N)");
const THRUSTER: &[Key] = &[
    must("kind", OneOf(&["thruster"]), "a force along a direction that is fixed in a link"),
    must("host", Text, "link or client that is pushed"),
    must("point_m", Vector(3), "where it is pushed, in the frame of the link (m)"),
    must("direction", Vector(3), "where to, in the frame of the link, of any length"),
    key("force_n", NotNegative, "force at all times (N), unless pulse or sample is given"),
    key("pulse", Tables(&[T_ON, T_OFF, THRUST]), "on, then off"),
    key("sample", Tables(&[T, THRUST]), "linear in between, zero outside"),
];

const FORCE: Key = key("force_n", Vector(3), "force (N); zero unless given");
const MOMENT: Key = key("moment_nm", Vector(3), "moment about the origin of the link (N m); zero unless given");
const WRENCH: &[Key] = &[
    must("kind", OneOf(&["wrench"]), "a given force and moment on a link"),
    must("host", Text, "link or client; with world axes one that begins where its body does"),
    must("axes", OneOf(&["body", "world"]), "axes of force and moment; those of the world keep their direction"),
    FORCE,
    MOMENT,
    key("pulse", Tables(&[T_ON, T_OFF, FORCE, MOMENT]), "on, then off"),
    key("sample", Tables(&[T, FORCE, MOMENT]), "linear in between, zero outside"),
];

const TORQUE_NM: Key = key("torque_nm", Number, "torque on an angle (N m)");
const FORCE_N: Key = key("force_n", Number, "force on a length (N)");
const PASSIVE_FORCE: &[Key] = &[
    must("kind", OneOf(&["passive_force"]), "between an appendage and its host, such as the motor of a wheel"),
    must("coordinate", Text, "full name of a coordinate of an appendage, such as wheel.spin"),
    TORQUE_NM,
    FORCE_N,
    key("pulse", Tables(&[T_ON, T_OFF, TORQUE_NM, FORCE_N]), "on, then off"),
    key("sample", Tables(&[T, TORQUE_NM, FORCE_N]), "linear in between, zero outside"),
];

const GRAVITY_GRADIENT: &[Key] = &[
    must("kind", OneOf(&["gravity_gradient"]), "on everything, on a circular orbit"),
    key("mu_m3_per_s2", Positive, "gravitational parameter (m^3/s^2); the Earth's unless given"),
    must("radius_m", Positive, "distance from the centre of what is orbited (m)"),
    must("radial", Vector(3), "direction away from it at the start, in world axes, of any length"),
    must("normal", Vector(3), "normal of the orbit in world axes, of any length; perpendicular to radial"),
];

const SENSORS: &[Key] = &[
    key("rate_hz", Positive, "sample rate of all sensors (Hz); 100 unless given"),
    key("torque", Table(TORQUE), "joint torque sensors"),
    key("gyro", Table(GYRO), "base gyro"),
    key("encoder", Table(ENCODER), "joint encoders"),
];

const TORQUE: &[Key] = &[
    key("noise_std_nm", NotNegative, "standard deviation of white noise (N m)"),
    key("bias_nm", Number, "constant offset (N m)"),
    key("lsb_nm", NotNegative, "quantisation step (N m); 0 for none"),
];

const GYRO: &[Key] = &[
    key("noise_std_rad_per_s", NotNegative, "standard deviation of white noise (rad/s)"),
    key("bias_rad_per_s", Number, "constant offset (rad/s)"),
    key("lsb_rad_per_s", NotNegative, "quantisation step (rad/s); 0 for none"),
];

const ENCODER: &[Key] = &[
    key("noise_std_rad", NotNegative, "standard deviation of white noise (rad)"),
    key("bias_rad", Number, "constant offset (rad)"),
    key("bits", Whole, "steps per turn are 2^bits, 1 to 52"),
];

const LIMITS: &[Key] = &[
    key("velocity_rad_per_s", Positive, "greatest joint speed (rad/s)"),
    key("acceleration_rad_per_s2", Positive, "greatest joint acceleration (rad/s^2)"),
    key("jerk_rad_per_s3", Positive, "greatest joint jerk (rad/s^3)"),
    key("torque_nm", Positive, "greatest joint torque (N m)"),
    key("base_attitude_rad", Positive, "greatest turn of the base from its start (rad), below pi"),
    key("base_rate_rad_per_s", Positive, "greatest angular speed of the base (rad/s)"),
    key("end_effector_speed_m_per_s", Positive, "greatest speed of the end effector (m/s)"),
    key("passive_rad", Positive, "greatest deflection of passive angles (rad)"),
    key("passive_m", Positive, "greatest deflection of passive lengths (m)"),
    key("pointing", Tables(POINTING), "cones for axes of the base"),
    key("clearance_m", Positive, "least distance between collision shapes (m)"),
    key("keep_out", Tables(KEEP_OUT), "capsules that other bodies stay out of"),
];

const POINTING: &[Key] = &[
    must("name", Text, "what points"),
    must("axis", Vector(3), "axis in base axes"),
    must("target", Vector(3), "direction in world axes"),
    key("within_rad", Positive, "greatest angle between the two (rad)"),
    key("outside_rad", Positive, "least angle between the two (rad)"),
];

const KEEP_OUT: &[Key] = &[
    must("name", Text, "name"),
    must("host", Text, "link that carries it"),
    must("from_m", Vector(3), "centre of one end (m)"),
    must("to_m", Vector(3), "centre of the other end (m)"),
    must("radius_m", Positive, "radius (m)"),
];

const ESTIMATE: &[Key] = &[
    key("parameters", Texts, "names or patterns with *, such as base.* or panel_left.k[*]"),
    key("start_offset", Number, "relative offset of the start, for studies; above -1"),
    key("prior_relative_std", Positive, "relative standard deviation of a prior on the nominal values"),
];

const EXCITE: &[Key] = &[
    key("goal", OneOf(&["information", "modal", "quiet", "paper", "condition"]), "information unless given"),
    key("optimality", OneOf(&["d", "a", "e", "largest"]), "of an information plan; d unless given"),
    key("parameters", Texts, "names or patterns to plan for; those of [estimate] unless given"),
    key("duration_s", Positive, "given duration (s); 60 unless given"),
    key("duration_bounds_s", Vector(2), "free duration between two bounds (s)"),
    key("control_points", Whole, "free control points per joint; 10 unless given"),
    key("degree", Whole, "of the splines, 3 to 7; 5 unless given"),
    key("start_rad", Numbers, "joint positions at the start (rad or m)"),
    key("end", OneOf(&["free", "start"]), "where the plan ends; free unless given"),
    key("end_rad", Numbers, "joint positions at the end (rad or m)"),
    key("seed", Whole, "of all randomness; 1 unless given"),
    key("starts", Whole, "local searches; 4 unless given"),
    key("iterations", Whole, "of each search at most; 200 unless given"),
    key("modes_hz", Numbers, "natural frequencies that a modal plan drives (Hz)"),
    key("frequency_error", NotNegative, "relative error of the frequencies that is allowed for; below 1"),
    key("emphasis", NotNegative, "of quietness against information; 3 unless given"),
    key("joints", Texts, "joints that move in the paper's manoeuvre"),
    key("hold_s", NotNegative, "time that the joints hold after it (s); 60 unless given"),
    key("weak_relative_std", Positive, "from which a parameter counts as weakly identifiable; 0.1 unless given"),
];

const REPRODUCE: &[Key] = &[
    key("seed", Whole, "of every random number; 0 unless given"),
    key("trajectory_seeds", Wholes, "one excitation trajectory each"),
    key("hold_rad", Numbers, "joint positions held while the modes ring (rad)"),
    key("manoeuvre_joints", Texts, "joints that make them ring"),
    key("settle_s", NotNegative, "time after the manoeuvre that is not used (s)"),
    must("record_s", Positive, "length of the record of the free motion (s)"),
    must("identification_s", Positive, "length of the identification trajectory (s)"),
    must("reference_s", Positive, "length of the reference trajectory (s)"),
    key("control_points", Whole, "per joint; 10 unless given"),
];
