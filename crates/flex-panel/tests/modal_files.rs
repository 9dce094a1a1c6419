//! Modes from tables and files, and what is said when they are wrong.
use ff_mission::{LoadOptions, Mission};
use ff_model::{Decl, Problems, Registry};
use flex_panel::modal;
use flex_panel::modal::{linearise, read_csv, read_f06};
use flex_panel::{PanelChain, Segment};
use nalgebra::{Matrix3, Vector3};
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/modal")).join(name)
}
fn text(name: &str) -> String {
    std::fs::read_to_string(fixture(name)).unwrap()
}

const GOOD: &str = r#"
mass_kg = 63.0
com_m = [0.03, 2.4, 0.05]
inertia_com_kgm2 = [100.3, 3.0, -0.02, 20.6, -1.8, 101.6]

[[modes]]
freq_hz = 0.11
damping_ratio = 0.006
participation = [-0.99, -0.03, 6.6, 21.1, -0.05, 3.2]

[[modes]]
freq_hz = 0.67
damping_ratio = 0.017
participation = [-0.78, 0.25, 2.7, 1.59, 0.47, 1.68]
"#;

fn refusal(text: &str) -> Problems {
    match modal::from_toml(&text.parse().unwrap()) {
        Ok(_) => panic!("accepted"),
        Err(e) => e,
    }
}

/// The good table with one piece replaced must be refused with this code, naming this object and these words.
#[track_caller]
fn refused(from: &str, to: &str, code: &str, object: &str, words: &[&str]) {
    assert!(GOOD.contains(from), "{from}");
    let e = refusal(&GOOD.replacen(from, to, 1));
    let p = e.0.iter().find(|p| p.code == code).unwrap_or_else(|| panic!("no {code} in {e}"));
    assert_eq!(p.object.as_deref(), Some(object), "{p}");
    assert!(p.hint.is_some(), "{p}");
    assert_eq!(e.0.len(), 1, "one mistake, one problem: {e}");
    for w in words {
        assert!(p.to_string().contains(w), "'{w}' not in: {p}");
    }
}

/// The parameters of a declaration whose names start so.
fn nominal(d: &Decl, prefix: &str) -> Vec<f64> {
    d.params.iter().filter(|p| p.name.starts_with(prefix)).map(|p| p.nominal).collect()
}

#[test]
fn a_table_in_the_mission_file_is_read() {
    let a = modal::from_toml(&GOOD.parse().unwrap()).unwrap();
    let d = a.declaration();
    assert_eq!((d.kind, d.coords.len(), d.params.len()), ("modal", 2, 28));
    assert_eq!(nominal(d, "part[1]."), [-0.78, 0.25, 2.7, 1.59, 0.47, 1.68]);
    let w = 0.67 * std::f64::consts::TAU;
    assert!((nominal(d, "k[1]")[0] - w * w).abs() < 1e-12 && (nominal(d, "d[1]")[0] - 2.0 * 0.017 * w).abs() < 1e-14);
    assert_eq!(nominal(d, "rigid.mass"), [63.0]);
    assert_eq!(nominal(d, "rigid.h_y"), [63.0 * 2.4]);
    let mut registry = Registry::new();
    flex_panel::register(&mut registry);
    assert!(registry.get("modal").is_some());
}

#[test]
fn wrong_tables_are_refused_by_name() {
    refused("freq_hz = 0.67", "freq_hz = 0.0", "Config::Param", "modes[1].freq_hz", &["0 Hz", "rigid-body"]);
    refused("freq_hz = 0.67", "freq_hz = -1", "Config::Param", "modes[1].freq_hz", &["-1 Hz"]);
    refused("freq_hz = 0.67", "freq_hz = nan", "Config::NotFinite", "modes[1].freq_hz", &["NaN Hz"]);
    refused("0.017", "-0.017", "Config::NotPassive", "modes[1].damping_ratio", &["-0.017", "energy"]);
    refused("6.6,", "16.6,", "Config::ResidualMass", "modes[0].participation", &["% more mass", "translation along z"]);
    refused("6.6,", "inf,", "Config::NotFinite", "modes[0].participation[2]", &["inf"]);
    refused(", 3.2]", "]", "Config::Type", "modes[0].participation", &["array of 5", "six numbers"]);
    refused("mass_kg = 63.0", "mass_kg = -63.0", "Config::Inertia", "mass_kg", &["-63 kg"]);
    refused("20.6", "220.6", "Config::Inertia", "inertia_com_kgm2", &["triangle"]);
    refused("damping_ratio = 0.006\n", "", "Config::MissingKey", "modes[0].damping_ratio", &["missing"]);
    refused("mass_kg = 63.0", "mass_kg = 63.0\nmodes_file = 'x.csv'", "Config::Conflict", "modes", &["both"]);
    let none = GOOD.split("[[modes]]").next().unwrap();
    assert!(refusal(none).has("Config::Conflict"));
    let seventeen = none.to_owned()
        + &"[[modes]]\nfreq_hz = 0.2\ndamping_ratio = 0.1\nparticipation = [0.1,0.1,0.1,0.1,0.1,0.2]\n".repeat(17);
    assert!(refusal(&seventeen).to_string().contains("17 modes, outside the limits 1 to 16"));
    let with_file = |name: &str, more: &str| refusal(&format!("{none}modes_file = '{name}'\n{more}"));
    assert!(with_file("wing.op2", "").has("Config::BadChoice"));
    assert!(with_file(fixture("none.csv").to_str().unwrap(), "").has("Io::Read"));
    let f06 = fixture("wing.f06");
    assert!(with_file(f06.to_str().unwrap(), "").has("Config::MissingKey"), "f06 has no damping");
    let e = with_file(f06.to_str().unwrap(), "damping_ratio = 0.01\nmodes_used = [2, 3, 2, 1.5]");
    let objects: Vec<_> = e.0.iter().filter_map(|p| p.object.as_deref()).collect();
    assert_eq!(objects, ["modes_used[1]", "modes_used[2]", "modes_used[3]"], "{e}");
    assert!(e.to_string().contains("modes of the file: 1, 2"), "{e}");
}

#[test]
fn both_files_hold_the_modes_of_the_panel_chain() {
    let v = |x: [f64; 3]| Vector3::from(x);
    let i = |d: [f64; 6]| Matrix3::new(d[0], d[1], d[2], d[1], d[3], d[4], d[2], d[4], d[5]);
    let chain = PanelChain::new(vec![
        Segment::new(
            33.0,
            v([0.05, 1.1, -0.02]),
            &i([15.2, 0.1, -0.2, 11.1, 0.3, 15.9]),
            v([0.02, 0.31, 0.04]),
            v([0.98, 0.1, 0.15]),
        )
        .with_spring(200.0, 2.0),
        Segment::new(
            30.0,
            v([-0.03, 1.05, 0.03]),
            &i([12.4, 0.2, 0.1, 9.3, -0.1, 13.0]),
            v([0.0, 2.2, 0.01]),
            v([0.95, -0.2, 0.1]),
        )
        .with_spring(180.0, 1.8),
    ])
    .unwrap();
    let lin = linearise(&*crate::common::ports::shared(&chain), &chain.nominal(), &[0.0; 2]).unwrap().appendage;
    let want = ff_model::Appendage::decl(&lin);
    let csv = read_csv(&text("wing.csv"), Path::new("wing.csv")).unwrap();
    let f06 = read_f06(&text("wing.f06"), 0.006, Path::new("wing.f06")).unwrap();
    for (modes, digits) in [(&csv, 2e-9), (&f06, 1e-6)] {
        assert_eq!(modes.keys().copied().collect::<Vec<_>>(), [1, 2]);
        for (j, m) in modes.values().enumerate() {
            let k = nominal(want, &format!("k[{j}]"))[0];
            assert!((m.stiffness() / k - 1.0).abs() < 2.0 * digits, "{} {k}", m.stiffness());
            let part = nominal(want, &format!("part[{j}]."));
            let scale = part.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            // A shape has no sign of its own.
            let sign = (part[2] * m.participation[2]).signum();
            for (i, &p) in part.iter().enumerate() {
                assert!(
                    (sign * m.participation[i] - p).abs() < digits * scale,
                    "mode {j}: {:?} {part:?}",
                    m.participation
                );
            }
        }
    }
    assert_eq!((csv[&1].damping_ratio, csv[&2].damping_ratio, f06[&2].damping_ratio), (0.006, 0.017, 0.006));
}

#[test]
fn a_mission_file_reads_the_print_beside_it() {
    let mut registry = Registry::new();
    flex_panel::register(&mut registry);
    let loaded = Mission::load(&fixture("wing.toml"), &registry, &LoadOptions::default()).unwrap();
    assert_eq!((loaded.model.np(), loaded.estimated.len()), (2, 14));
    // The file keeps the path as it was written.
    assert_eq!(loaded.mission.appendages[0].settings["modes_file"].as_str(), Some("wing.f06"));
    // A problem in the print has the place in the print, one in the mission the place in the mission.
    let dir = std::env::temp_dir().join(format!("flex-panel-modal-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let mission = text("wing.toml").replace("../paper", fixture("../paper").to_str().unwrap());
    std::fs::write(dir.join("wing.toml"), mission.replace("63.0", "-63.0")).unwrap();
    std::fs::write(dir.join("wing.f06"), text("wing.f06").replace("6.606035E+00", "6.6O6035E+00")).unwrap();
    let e = Mission::load(&dir.join("wing.toml"), &registry, &LoadOptions::default()).unwrap_err();
    std::fs::remove_dir_all(&dir).unwrap();
    let place = |code: &str| {
        let p = e.0.iter().find(|p| p.code == code).unwrap_or_else(|| panic!("no {code} in {e}"));
        (p.file.as_ref().unwrap().file_name().unwrap().to_str().unwrap().to_owned(), p.line.unwrap())
    };
    assert_eq!(place("Data::BadNumber"), ("wing.f06".into(), 37), "{e}");
    assert_eq!(place("Config::Inertia"), ("wing.toml".into(), 12), "{e}");
    assert!(e.to_string().contains("'6.6O6035E+00' is not a number"), "{e}");
}

#[test]
fn broken_prints_are_refused_with_their_line() {
    let file = Path::new("w.f06");
    let good = text("wing.f06");
    let check = |bad: &str, code: &str, line: usize, says: &str| {
        let e = read_f06(bad, 0.01, file).unwrap_err();
        assert_eq!((e.0.len(), e.0[0].code, e.0[0].line), (1, code, Some(line)), "{e}");
        assert!(e.to_string().contains(says) && e.0[0].hint.is_some(), "{says}: {e}");
    };
    let factors = "MODAL PARTICIPATION FACTORS";
    check(&good.replace(factors, "MODAL SOMETHING"), "Data::Missing", 1, "MEFFMASS(PARTFAC)=YES");
    assert_eq!(read_f06("", 0.01, file).unwrap_err().0.len(), 2, "both tables are missing");
    check(&good.replacen("      -5.219299E-01     ", "      ", 1), "Data::Columns", 38, "7 columns");
    check(&good.replacen("1.798925E+00", "NaN", 1), "Data::BadNumber", 38, "NaN is not a finite number");
    check(
        &good.replacen("        2  6.680699E-01      -5.2", "        2  6.690699E-01      -5.2", 1),
        "Data::Inconsistent",
        38,
        "0.6690699 Hz",
    );
    check(&good.replacen("2.250000E+00", "0.000000E+00", 1), "Data::Inconsistent", 10, "limit > 0");
    let other = good.replacen("        2  6.680699E-01      -5.2", "        3  6.680699E-01      -5.2", 1);
    let e = read_f06(&other, 0.01, file).unwrap_err();
    let lines: Vec<_> = e.0.iter().map(|p| (p.code, p.line)).collect();
    assert_eq!(lines, [("Data::Missing", Some(10)), ("Data::Missing", Some(38))], "{e}");
    // A second subcase.
    let twice = good.clone() + &good.replace("6.606035E+00", "6.706035E+00");
    check(&twice, "Data::Duplicate", 37 + good.lines().count(), "one subcase");
    // The same table printed once more is no contradiction.
    assert_eq!(read_f06(&(good.clone() + &good), 0.01, file).unwrap(), read_f06(&good, 0.01, file).unwrap());
}

#[test]
fn broken_tables_are_refused_with_their_line() {
    let file = Path::new("w.csv");
    let good = text("wing.csv");
    let check = |bad: &str, code: &str, line: usize, says: &str| {
        let e = read_csv(bad, file).unwrap_err();
        assert_eq!((e.0.len(), e.0[0].code, e.0[0].line), (1, code, Some(line)), "{e}");
        assert!(e.to_string().contains(says) && e.0[0].hint.is_some(), "{says}: {e}");
    };
    check(&good.replace("px_kg", "px"), "Data::Columns", 2, "mode,freq_hz,damping_ratio,px_kg");
    check("# nothing\n", "Data::Missing", 1, "holds no table");
    check(&good.lines().take(2).collect::<Vec<_>>().join("\n"), "Data::Missing", 1, "no modes");
    check(&good.replace("2,6.68", "1,6.68"), "Data::Duplicate", 4, "mode 1 is given twice");
    check(&good.replace("2,6.68", "2.5,6.68"), "Data::BadNumber", 4, "'2.5' is not a mode number");
    check(&good.replace("0.017,", "0,017,"), "Data::Columns", 4, "10 columns, expected 9");
    check(&good.replace("0.017,", "inf,"), "Data::BadNumber", 4, "column damping_ratio: inf is not a finite number");
    check(&good.replace("0.017,", ","), "Data::BadNumber", 4, "'' is not a number");
}
