//! `ffid simulate` against records of a robot of our own that MuJoCo simulated (`fixtures/verdict`).

use crate::common::{ffid, fixture};
use std::fs;
use std::path::Path;

/// Names and rows of a CSV file of numbers.
fn table(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut file = csv::Reader::from_path(path).unwrap();
    let names = file.headers().unwrap().iter().map(str::to_owned).collect();
    let rows = file.records().map(|r| r.unwrap().iter().map(|x| x.parse().unwrap()).collect()).collect();
    (names, rows)
}

#[test]
fn torques_and_rates_are_those_of_mujoco() {
    let (dir, here) = (tempfile::tempdir().unwrap(), fixture("verdict"));
    let mission = here.join("truth.toml");
    for name in ["m1", "m2", "m3"] {
        let path = |suffix: &str| dir.path().join(format!("{name}{suffix}.csv"));
        let record = here.join(format!("{name}.parquet"));
        let run = |args: &[&str]| {
            let (code, out, err) = ffid(dir.path(), args);
            assert_eq!(code, 0, "{args:?}\n{out}\n{err}");
        };
        run(&["convert", record.to_str().unwrap(), path("").to_str().unwrap()]);
        // The joint motion alone, in the words of a trajectory.
        let text = fs::read_to_string(path("")).unwrap();
        let (head, rows) = text.split_once('\n').unwrap();
        let columns = head.split(',').position(|c| c.starts_with("tau.")).unwrap();
        let motion = |l: &str| l.split(',').take(columns).collect::<Vec<_>>().join(",");
        let mut lines = vec![motion(head).replace(",ddq.", ",qdd.").replace(",dq.", ",qd.")];
        lines.extend(rows.lines().map(motion));
        fs::write(path("-motion"), lines.join("\n") + "\n").unwrap();
        let (motion, own) = (path("-motion"), path("-own"));
        let [motion, out] = [&motion, &own].map(|p| p.to_str().unwrap());
        run(&["simulate", mission.to_str().unwrap(), "--trajectory", motion, "--out", out, "--noise-free", "--quiet"]);
        let ((names, theirs), (own_names, ours)) = (table(&path("")), table(&own));
        assert_eq!(ours.len(), theirs.len());
        let readings = || names.iter().enumerate().filter(|(_, n)| n.starts_with("tau.") || n.starts_with("gyro."));
        assert_eq!(readings().count(), 8);
        for (i, reading) in readings() {
            let j = own_names.iter().position(|n| n == reading).unwrap();
            let greatest = theirs.iter().fold(0.0_f64, |m, r| m.max(r[i].abs()));
            let off = theirs.iter().zip(&ours).fold(0.0_f64, |m, (a, b)| m.max((a[i] - b[j]).abs()));
            assert!(off < 1e-6 * greatest, "{name}, {reading}: {off:e} of {greatest:e}");
        }
    }
}
