//! The elements and attributes of URDF this importer reads, and the ones it knows and skips.

/// One element: its attributes, and the elements it may hold once or often.
pub(super) struct Element {
    pub(super) name: &'static str,
    pub(super) attributes: &'static [&'static str],
    pub(super) single: &'static [&'static str],
    pub(super) many: &'static [&'static str],
}

const fn leaf(name: &'static str, attributes: &'static [&'static str]) -> Element {
    Element { name, attributes, single: &[], many: &[] }
}

/// `material`, `transmission`, `gazebo` and `ros2_control` say nothing of inertia or kinematics: skipped whole.
pub(super) const ROBOT: Element = Element {
    name: "robot",
    attributes: &["name", "version"],
    single: &[],
    many: &["link", "joint", "material", "transmission", "gazebo", "ros2_control"],
};
/// `visual` and `collision` are skipped whole; their meshes are never opened.
pub(super) const LINK: Element =
    Element { name: "link", attributes: &["name"], single: &["inertial"], many: &["visual", "collision"] };
pub(super) const INERTIAL: Element =
    Element { name: "inertial", attributes: &[], single: &["origin", "mass", "inertia"], many: &[] };
pub(super) const ORIGIN: Element = leaf("origin", &["xyz", "rpy"]);
pub(super) const MASS: Element = leaf("mass", &["value"]);
/// The order of the attributes is the order of `RawInertial::inertia`.
pub(super) const INERTIA: Element = leaf("inertia", &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]);
pub(super) const JOINT: Element = Element {
    name: "joint",
    attributes: &["name", "type"],
    single: &["origin", "parent", "child", "axis", "limit", "dynamics", "calibration", "safety_controller", "mimic"],
    many: &[],
};
pub(super) const PARENT: Element = leaf("parent", &["link"]);
pub(super) const CHILD: Element = leaf("child", &["link"]);
pub(super) const AXIS: Element = leaf("axis", &["xyz"]);
pub(super) const LIMIT: Element =
    leaf("limit", &["lower", "upper", "velocity", "effort", "acceleration", "deceleration", "jerk"]);
pub(super) const DYNAMICS: Element = leaf("dynamics", &["damping", "friction"]);
pub(super) const MIMIC: Element = leaf("mimic", &["joint", "multiplier", "offset"]);
pub(super) const CALIBRATION: Element = leaf("calibration", &["rising", "falling"]);
pub(super) const SAFETY: Element =
    leaf("safety_controller", &["soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"]);

/// Elements that carry mass or build the tree: a file that has them where they are not read means something else than is read.
const DECISIVE: [&str; 12] =
    ["inertial", "origin", "mass", "inertia", "link", "joint", "parent", "child", "axis", "limit", "dynamics", "mimic"];

/// True for a known element whose place decides what the file means.
pub(super) fn is_decisive(name: &str) -> bool {
    DECISIVE.contains(&name)
}

/// Where a known element belongs, for one that stands in the wrong place.
pub(super) fn home_of(name: &str) -> Option<&'static str> {
    [&ROBOT, &LINK, &INERTIAL, &JOINT]
        .iter()
        .find(|e| e.single.contains(&name) || e.many.contains(&name))
        .map(|e| e.name)
}
