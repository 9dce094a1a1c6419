//! What the paper leaves open: each choice with the values that are tried.

use toml::{Table, Value};

/// A quarter turn (rad).
const SIDE: f64 = core::f64::consts::FRAC_PI_2;

/// A change of a mission.
type Change = Box<dyn Fn(&mut Table) + Send + Sync>;

/// A choice.
pub(super) struct Choice {
    pub(super) what: &'static str,
    /// The case it belongs to: `flex`, `slosh`.
    pub(super) case: &'static str,
    pub(super) settings: Vec<Setting>,
}

/// A value of a choice.
pub(super) struct Setting {
    pub(super) label: String,
    pub(super) change: Change,
    /// The motion has to be planned anew: it begins elsewhere.
    pub(super) replan: bool,
}

impl Setting {
    fn new(label: impl Into<String>, change: impl Fn(&mut Table) + Send + Sync + 'static) -> Self {
        Self { label: label.into(), change: Box::new(change), replan: false }
    }
    fn replanned(self) -> Self {
        Self { replan: true, ..self }
    }
}

/// Every choice of both cases. What the missions of `fixtures/paper` choose is not among the settings.
pub(super) fn all() -> Vec<Choice> {
    let noise = |case: &'static str| Choice {
        what: "noise of all sensors",
        case,
        settings: [0.1, 10.0].map(|f| Setting::new(format!("x {f}"), move |m: &mut Table| scale_noise(m, f))).into(),
    };
    let posture = |case: &'static str, poses: [(&'static str, [f64; 7]); 2]| Choice {
        what: "posture of the arm",
        case,
        settings: poses
            .map(|(label, pose)| Setting::new(label, move |m: &mut Table| set_pose(m, &pose)).replanned())
            .into(),
    };
    vec![
        Choice {
            what: "length of a panel",
            case: "flex",
            settings: [1.8, 2.5]
                .map(|l| Setting::new(format!("{l} m"), move |m: &mut Table| stretch(m, l / 2.15)))
                .into(),
        },
        Choice {
            what: "first hinge from the base's centre of mass",
            case: "flex",
            settings: [0.6, 1.0].map(|d| Setting::new(format!("{d} m"), move |m: &mut Table| spread(m, d))).into(),
        },
        Choice {
            what: "moment of a panel about its hinge axis",
            case: "flex",
            settings: vec![Setting::new("11 kg m\u{b2}", turn_panels)],
        },
        posture(
            "flex",
            [
                ("stretched sideways", [SIDE, 0.8, 0.0, 0.8, 0.0, 0.5, 0.0]),
                ("forward", [0.0, 0.8, 0.0, 0.8, 0.0, 0.5, 0.0]),
            ],
        ),
        noise("flex"),
        Choice {
            what: "fulcrum of the tank in the base",
            case: "slosh",
            settings: [
                ("ahead, 0.25 m", [1.15, 0.0, 0.6]),
                ("below, 0.4 m", [0.9, 0.0, 0.2]),
                ("aside, 0.4 m", [0.9, 0.4, 0.6]),
            ]
            .map(|(label, at)| Setting::new(label, move |m: &mut Table| mount_tank(m, at)))
            .into(),
        },
        Choice {
            what: "direction in which the fuel settles",
            case: "slosh",
            settings: vec![
                Setting::new("-x", |m| settle(m, [0.0, SIDE, 0.0])),
                Setting::new("-y", |m| settle(m, [-SIDE, 0.0, 0.0])),
            ],
        },
        posture("slosh", [("folded", [SIDE, 1.4, 0.0, -2.6, 0.0, 2.4, 0.0]), ("straight up", [0.0; 7])]),
        noise("slosh"),
    ]
}

fn numbers(x: &[f64]) -> Value {
    Value::Array(x.iter().map(|v| Value::Float(*v)).collect())
}

/// Tables of the appendages of a kind.
fn appendages<'t>(m: &'t mut Table, kind: &'static str) -> impl Iterator<Item = &'t mut Table> {
    let all = m.get_mut("appendage").and_then(Value::as_array_mut).into_iter().flatten();
    all.filter_map(Value::as_table_mut).filter(move |t| t.get("kind").and_then(Value::as_str) == Some(kind))
}

fn segments(m: &mut Table) -> impl Iterator<Item = &mut Table> {
    let all = appendages(m, "flex_panel").filter_map(|t| t.get_mut("segments").and_then(Value::as_array_mut));
    all.flatten().filter_map(Value::as_table_mut)
}

/// Applies `f` to every number of a list of them.
fn each(t: &mut Table, key: &str, f: impl Fn(usize, f64) -> f64) {
    let Some(list) = t.get_mut(key).and_then(Value::as_array_mut) else { return };
    for (i, v) in list.iter_mut().enumerate() {
        if let Some(x) = v.as_float().or_else(|| v.as_integer().map(|x| x as f64)) {
            *v = Value::Float(f(i, x));
        }
    }
}

/// Panels longer by a factor, their centre of mass half way as before.
fn stretch(m: &mut Table, by: f64) {
    for s in segments(m) {
        each(s, "com_m", |_, x| by * x);
        each(s, "hinge_m", |_, x| by * x);
    }
}

/// First hinges at this distance on both sides (m).
fn spread(m: &mut Table, distance: f64) {
    for t in appendages(m, "flex_panel") {
        if let Some(mount) = t.get_mut("mount").and_then(Value::as_table_mut) {
            each(mount, "xyz_m", |i, x| if i == 1 { distance.copysign(x) } else { x });
        }
    }
}

/// Moments of inertia of Table I taken about other axes: the 11 kg m^2 about the hinges, along x.
fn turn_panels(m: &mut Table) {
    for s in segments(m) {
        let Some(list) = s.get_mut("inertia_com_kgm2").and_then(Value::as_array_mut) else { continue };
        // xx xy xz yy yz zz.
        if list.len() == 6 {
            list.swap(0, 3);
        }
    }
}

fn mount_tank(m: &mut Table, at: [f64; 3]) {
    for t in appendages(m, "slosh_pendulum") {
        if let Some(mount) = t.get_mut("mount").and_then(Value::as_table_mut) {
            mount.insert("xyz_m".into(), numbers(&at));
        }
    }
}

/// Turns the mount of the tank: its mass hangs towards -z of the mount.
fn settle(m: &mut Table, rpy: [f64; 3]) {
    for t in appendages(m, "slosh_pendulum") {
        if let Some(mount) = t.get_mut("mount").and_then(Value::as_table_mut) {
            mount.insert("rpy_rad".into(), numbers(&rpy));
        }
    }
}

fn set_pose(m: &mut Table, pose: &[f64]) {
    if let Some(r) = m.get_mut("reproduce").and_then(Value::as_table_mut) {
        r.insert("hold_rad".into(), numbers(pose));
    }
}

/// Noise of torques and gyro times a factor, and steps of the encoders as near to it as whole bits are.
fn scale_noise(m: &mut Table, by: f64) {
    let Some(sensors) = m.get_mut("sensors").and_then(Value::as_table_mut) else { return };
    for (section, key) in [("torque", "noise_std_nm"), ("gyro", "noise_std_rad_per_s")] {
        if let Some(x) = sensors.get_mut(section).and_then(|t| t.get_mut(key)) {
            *x = Value::Float(by * x.as_float().unwrap_or(0.0));
        }
    }
    if let Some(bits) = sensors.get_mut("encoder").and_then(|t| t.get_mut("bits")) {
        let now = bits.as_integer().unwrap_or(20) as f64;
        *bits = Value::Integer((now - by.log2()).round() as i64);
    }
}
