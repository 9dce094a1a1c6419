//! The text of a first mission file.

use super::guess::{Guess, Panel, shown};
use ff_mission::mission::FORMAT;
use std::collections::BTreeMap;
use std::fmt;
use std::fmt::Write;

/// Column where comments behind keys begin.
const COMMENTS: usize = 38;

/// What the user told beside the URDF.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// The base is bolted to the ground, under gravity.
    pub fixed: bool,
    /// Sample rate of all sensors (Hz).
    pub rate_hz: Option<f64>,
    /// Standard deviation of the torque sensors (N m).
    pub torque_noise: Option<f64>,
    /// Standard deviation of the gyro (rad/s).
    pub gyro_noise: Option<f64>,
    /// Stiffness of all hinges whose panel is evident (N m/rad).
    pub stiffness: Option<f64>,
    /// Damping of the same hinges (N m s/rad).
    pub damping: Option<f64>,
    /// Stiffness of single hinges, by joint (N m/rad).
    pub stiffness_of: BTreeMap<String, f64>,
    /// Damping of single hinges, by joint (N m s/rad).
    pub damping_of: BTreeMap<String, f64>,
    /// Fuel in the base, as a pendulum.
    pub tank: Option<Tank>,
}

/// A pendulum of fuel, as far as it is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tank {
    /// Where it hangs, in the frame of the base link (m).
    pub at: [f64; 3],
    /// Mass that moves (kg).
    pub mass: f64,
    /// Length (m).
    pub length: f64,
    /// Stiffness about both axes (N m/rad).
    pub stiffness: f64,
    /// Damping about both axes (N m s/rad).
    pub damping: f64,
}

/// What stands in the comment when nothing is known.
const SOME_TANK: Tank = Tank { at: [0.0; 3], mass: 100.0, length: 0.8, stiffness: 20.0, damping: 5.0 };

impl Known {
    fn hinges(&self, p: &Panel, all: Option<f64>, of: &BTreeMap<String, f64>) -> Option<Vec<f64>> {
        p.joints.iter().map(|j| of.get(j).copied().or(all.filter(|_| p.evident))).collect()
    }
    /// Stiffness and damping of every hinge of a panel, as told or else as the description of the robot gives them; `None` unless
    /// all are known. Such a panel is active in the mission,
    /// the others are commented out and their hinges remain joints. Allocates.
    pub fn springs(&self, p: &Panel) -> Option<(Vec<f64>, Vec<f64>)> {
        let (k, d) = (&self.stiffness_of, &self.damping_of);
        let stiffness = self.hinges(p, self.stiffness, k).or_else(|| p.stiffness.clone())?;
        Some((stiffness, self.hinges(p, self.damping, d).or_else(|| p.damping.clone())?))
    }
}

/// The mission file of a guess; `urdf` is the path that it names. Allocates.
///
/// It loads as it is: what could not be guessed is commented out.
pub fn mission(guess: &Guess, urdf: &str, known: &Known) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write(&mut out, guess, urdf, known);
    out
}

fn write(out: &mut String, g: &Guess, urdf: &str, known: &Known) -> fmt::Result {
    writeln!(
        out,
        "# Written by `ffid init`. Lines with `guess` follow from the shape of the tree: check them. What the URDF"
    )?;
    writeln!(
        out,
        "# does not tell is commented out, with its unit; fill it in and remove the `#`. Then `ffid check`."
    )?;
    writeln!(out)?;
    line(out, &format!("format = {FORMAT}"), "version of the format of this file")?;
    writeln!(out, "\n[robot]")?;
    line(out, &format!("urdf = {}", quoted(urdf)), "relative to this file")?;
    line(out, &format!("base_link = {}", quoted(&g.base)), "guess: the root of the tree")?;
    if known.fixed {
        line(out, "base = \"fixed\"", "bolted to the ground")?;
        line(out, "gravity_m_per_s2 = [0.0, 0.0, -9.80665]", "in axes of the base link: turn it if that is tilted")?;
    } else {
        line(out, "base = \"floating\"", "in orbit; \"fixed\" with gravity_m_per_s2 for an arm on the ground")?;
    }
    match &g.end_effector {
        Some(e) => line(out, &format!("end_effector = {}", quoted(e)), "guess: the end of the arm")?,
        None => line(out, "# end_effector = \"<link>\"", "no driven joint found: which link works?")?,
    }
    if !g.arm.is_empty() {
        writeln!(out, "# The arm (guess): {}.", names(&g.arm))?;
    }
    if !g.lock.is_empty() {
        let list: Vec<String> = g.lock.iter().map(|j| quoted(j)).collect();
        writeln!(
            out,
            "# Held where they are (guess), so not in the record: hands, wheels, joints that carry nothing."
        )?;
        writeln!(out, "lock = [{}]", list.join(", "))?;
    }
    if !g.others.is_empty() {
        writeln!(out, "# Driven as well (guess): {}.", names(&g.others))?;
    }
    if !known.fixed {
        writeln!(
            out,
            "\n# [robot.base_inertial]               # replaces the <inertial> of the base link, after fuel was burnt"
        )?;
        writeln!(out, "# mass_kg = 600.0")?;
        writeln!(out, "# com_m = [0.0, 0.0, 0.0]             # centre of mass in the link frame (m)")?;
        writeln!(
            out,
            "# inertia_com_kgm2 = [150.0, 0.0, 0.0, 150.0, 0.0, 150.0]  # xx, xy, xz, yy, yz, zz about it (kg m^2)"
        )?;
    }
    for p in &g.panels {
        panel(out, p, known)?;
    }
    if !known.fixed {
        tank(out, g, known.tank)?;
    }
    sensors(out, known)?;
    writeln!(out, "\n[limits]                              # for `ffid excite`, beside the limits of the URDF")?;
    writeln!(out, "# velocity_rad_per_s = 0.17")?;
    line(out, &format!("acceleration_rad_per_s2 = {:?}", g.acceleration), "guess: raise it for larger torques")?;
    writeln!(out, "# torque_nm = 100.0")?;
    writeln!(out, "\n[estimate]                            # names or patterns; `ffid check` lists all parameters")?;
    let mut patterns: Vec<String> =
        if known.fixed { g.arm_links.iter().map(|l| format!("{l}.*")).collect() } else { vec!["base.*".to_owned()] };
    for p in g.panels.iter().filter(|p| known.springs(p).is_some()) {
        patterns.extend([format!("{}.k[*]", p.name), format!("{}.d[*]", p.name)]);
    }
    if known.tank.is_some() && !known.fixed {
        patterns.push("tank.*".to_owned());
    }
    let list: Vec<String> = patterns.iter().map(|p| quoted(p)).collect();
    writeln!(out, "parameters = [{}]", list.join(", "))?;
    if !known.fixed {
        line(
            out,
            "method = \"output_error\"",
            "explains torques and gyro; \"rda\" is linear and explains torques alone",
        )?;
    }
    line(out, "# prior_relative_std = 0.3", "if you vouch for the values above to this relative error")
}

fn panel(out: &mut String, p: &Panel, known: &Known) -> fmt::Result {
    let springs = known.springs(p);
    let mark = if springs.is_some() { "" } else { "# " };
    writeln!(out, "\n# A panel (guess: {}): its joints become hinges on springs and leave the tree.", p.why)?;
    if springs.is_none() {
        writeln!(out, "# Until stiffness and damping are given its joints count as driven ones.")?;
    }
    writeln!(out, "{mark}[[appendage]]")?;
    writeln!(out, "{mark}kind = \"flex_panel\"")?;
    writeln!(out, "{mark}name = {}", quoted(&p.name))?;
    let joints: Vec<String> = p.joints.iter().map(|j| quoted(j)).collect();
    line(out, &format!("{mark}lift = [{}]", joints.join(", ")), "from the base outwards")?;
    let numbers = |x: Option<&Vec<f64>>, example: f64| {
        let all = x.cloned().unwrap_or_else(|| vec![example; p.joints.len()]);
        all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", ")
    };
    let (k, d) = (springs.as_ref().map(|s| &s.0), springs.as_ref().map(|s| &s.1));
    let unknown = if springs.is_some() { "" } else { "; not in the URDF" };
    line(out, &format!("{mark}stiffness_nm_per_rad = [{}]", numbers(k, 200.0)), &format!("one per hinge{unknown}"))?;
    line(out, &format!("{mark}damping_nms_per_rad = [{}]", numbers(d, 2.0)), &format!("one per hinge{unknown}"))
}

fn tank(out: &mut String, g: &Guess, known: Option<Tank>) -> fmt::Result {
    let (mark, t) = match known {
        Some(t) => ("", t),
        None => ("# ", SOME_TANK),
    };
    let [x, y, z] = t.at;
    writeln!(out, "\n# Fuel that sloshes: a pendulum; `slosh_spring_mass` and `slosh_tank` are other kinds.")?;
    writeln!(out, "{mark}[[appendage]]")?;
    writeln!(out, "{mark}kind = \"slosh_pendulum\"")?;
    writeln!(out, "{mark}name = \"tank\"")?;
    line(out, &format!("{mark}host = {}", quoted(&g.base)), "the link that holds the tank")?;
    line(
        out,
        &format!("{mark}mount = {{ xyz_m = [{x:?}, {y:?}, {z:?}] }}"),
        "where it hangs, in the frame of that link (m); at rest it points along -z",
    )?;
    line(out, &format!("{mark}mass_kg = {:?}", t.mass), "of the fuel that moves")?;
    line(out, &format!("{mark}length_m = {:?}", t.length), "of the pendulum")?;
    let two = |x: f64| format!("[{x:?}, {x:?}]");
    line(out, &format!("{mark}stiffness_nm_per_rad = {}", two(t.stiffness)), "about x and y of the mount")?;
    line(out, &format!("{mark}damping_nms_per_rad = {}", two(t.damping)), "about x and y of the mount")
}

fn sensors(out: &mut String, known: &Known) -> fmt::Result {
    let mut number = |head: &str, key: &str, x: Option<f64>, example: f64, of: &str| {
        out.push_str(head);
        match x {
            Some(x) => line(out, &format!("{key} = {x:?}"), of),
            None => line(out, &format!("# {key} = {example:?}"), &format!("{of}; not in the URDF")),
        }
    };
    let rate = "sample rate of all sensors (Hz); 100 unless given";
    number("\n[sensors]\n", "rate_hz", known.rate_hz, 100.0, rate)?;
    let white = "standard deviation of white noise";
    number(
        "\n[sensors.torque]\n",
        "noise_std_nm",
        known.torque_noise,
        0.1,
        &format!("{white} (N m); `ffid identify` needs it"),
    )?;
    if known.fixed {
        return Ok(());
    }
    line(out, "gain_relative_std = 0.01", "standard deviation of the gain of each sensor")?;
    line(out, "gain_common_relative_std = 0.01", "and of that of all of them together")?;
    let mut number = |head: &str, key: &str, x: Option<f64>, example: f64, of: &str| {
        out.push_str(head);
        match x {
            Some(x) => line(out, &format!("{key} = {x:?}"), of),
            None => line(out, &format!("# {key} = {example:?}"), &format!("{of}; not in the URDF")),
        }
    };
    let of = format!("{white} (rad/s); `ffid identify` needs it");
    number("\n[sensors.gyro]\n", "noise_std_rad_per_s", known.gyro_noise, 1.5e-4, &of)?;
    line(out, "scale_relative_std = 0.003", "standard deviation of the scale of each axis")?;
    line(out, "misalignment_std_rad = 0.01", "of its rotation against the base link, about every axis (rad)")?;
    out.push_str("\n[sensors.encoder]\n");
    line(out, "# bits = 20", "steps per turn are 2^bits (a whole number); not in the URDF")?;
    line(out, "offset_std_rad = 0.002", "standard deviation of the zero of each joint (rad)")?;
    uncertain(out)
}

/// What no drawing is right about to the last digit; where the values come from is in docs/uncertain.md.
fn uncertain(out: &mut String) -> fmt::Result {
    writeln!(
        out,
        "\n# What is not known exactly, as one standard deviation: every deviation of an estimate allows for it. Typical of parts"
    )?;
    writeln!(out, "# that were designed and weighed; put in what your reports say (docs/uncertain.md).")?;
    writeln!(out, "[[uncertain]]")?;
    line(out, "bodies = [\"*\"]", "all that are not estimated")?;
    line(out, "mass_relative_std = 0.02", "of the mass")?;
    line(out, "com_std_m = 0.005", "of every coordinate of the centre of mass (m)")?;
    line(out, "inertia_relative_std = 0.05", "of the inertia about it")?;
    writeln!(out, "\n[[uncertain]]")?;
    line(out, "mounts = [\"*\"]", "appendages and joints: where they are mounted")?;
    line(out, "position_std_m = 0.003", "of every coordinate of their place (m)")?;
    line(out, "angle_std_rad = 0.002", "of their rotation about every axis (rad)")
}

/// A key with its comment.
fn line(out: &mut String, key: &str, comment: &str) -> fmt::Result {
    writeln!(out, "{key:<width$}# {comment}", width = COMMENTS.max(key.chars().count() + 1))
}

fn names(all: &[String]) -> String {
    all.iter().map(|n| shown(n)).collect::<Vec<_>>().join(", ")
}

/// A basic string of TOML.
fn quoted(s: &str) -> String {
    let mut out = String::from("\"");
    for c in s.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", c as u32);
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_is_quoted_so_that_toml_gives_it_back() {
        for name in ["plain", "a \"b\" \\ c", "line\nend\ttab", "ä\u{7f}\u{1}"] {
            let table: toml::Table = format!("x = {}", quoted(name)).parse().unwrap();
            assert_eq!(table["x"].as_str(), Some(name));
        }
    }
}
