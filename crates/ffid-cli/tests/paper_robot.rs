//! Missions and motions of the paper's flexible robot, two mirrored wings of two hinges each.

use crate::common::fixture;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// The mission `name` in `dir` with these hinge stiffnesses (left wing, then right; N m/rad), without start offset, as `edit` leaves it.
pub(crate) fn mission(dir: &Path, name: &str, stiffness: [f64; 4], edit: impl Fn(String) -> String) {
    fs::copy(fixture("paper").join("robot.urdf"), dir.join("robot.urdf")).unwrap();
    let text = fs::read_to_string(fixture("paper").join("flex.toml")).unwrap();
    let text = text.split("[reproduce]").next().unwrap();
    let mut parts = text.split("stiffness_nm_per_rad = 200.0");
    let mut out = parts.next().unwrap().to_owned();
    for (part, k) in parts.zip(stiffness) {
        let _ = write!(out, "stiffness_nm_per_rad = {k}{part}");
    }
    fs::write(dir.join(name), edit(out.replace("start_offset = 0.25", ""))).unwrap();
}

/// A trajectory file: a sine of every joint about the mission's pose, up to 0.16 rad, at rest at both ends.
pub(crate) fn sines(dir: &Path, name: &str, seconds: f64, hz: [f64; 7], phase: [f64; 7]) {
    let hold = [std::f64::consts::FRAC_PI_2, 1.4, 0.0, -2.6, 0.0, 2.4, 0.0];
    let mut out = "time[s]".to_owned();
    (1..=7).for_each(|j| write!(out, ",q.joint{j}[rad]").unwrap());
    let smooth = |u: f64| u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    for i in 0..=(50.0 * seconds) as usize {
        let t = i as f64 * 0.02;
        let part = smooth((t / 4.0).min(1.0)) * smooth(((seconds - t) / 4.0).min(1.0));
        write!(out, "\n{t:.3}").unwrap();
        for ((q, f), phase) in hold.iter().zip(hz).zip(phase) {
            let amplitude = 0.16 * (0.2 / f).min(1.0);
            write!(out, ",{:.9}", q + part * amplitude * (TAU * f * t + phase).sin()).unwrap();
        }
    }
    fs::write(dir.join(name), out + "\n").unwrap();
}
