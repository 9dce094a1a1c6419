//! The survey of URDFs: counts, reasons, and which files are found.

use ff_model::Severity;
use std::fs;
use std::path::Path;
use xtask::corpus::survey;

#[test]
fn files_of_nested_folders_are_counted_with_the_reasons_of_those_that_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures");
    let inner = dir.path().join("robots/a");
    fs::create_dir_all(&inner).unwrap();
    for (from, to) in [
        ("paper/robot.urdf", "good.urdf"),
        ("bad/M11_negative_mass.urdf", "negative.urdf"),
        ("bad/M27_mimic_held.urdf", "mimic.urdf"),
        ("bad/M11_negative_mass.urdf", "no_robot.xml"),
    ] {
        fs::copy(fixtures.join(from), inner.join(to)).unwrap();
    }
    let found = survey(dir.path(), "three").unwrap();
    let names: Vec<_> = found.files.iter().map(|f| f.path.to_str().unwrap()).collect();
    assert_eq!(names, ["robots/a/good.urdf", "robots/a/mimic.urdf", "robots/a/negative.urdf"]);
    assert_eq!((found.accepted(), found.silent(), found.files[0].joints), (2, 1, Some(7)));
    let why = found.files[2].reason().unwrap();
    assert_eq!((why.code, why.severity, why.line), ("Urdf::NonPositiveMass", Severity::Error, Some(11)));
    assert!(found.files[1].reason().is_none());
    let [refused, warned] = found.tables().map(|t| t.to_string());
    assert!(refused.contains("negative.urdf") && !refused.contains("good.urdf"), "{refused}");
    assert!(warned.contains("Urdf::Mimic"), "{warned}");
    assert!(survey(&dir.path().join("nowhere"), "none").is_err());
}
