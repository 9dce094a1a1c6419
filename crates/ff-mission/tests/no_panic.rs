//! Whatever bytes arrive, the readers return: never a panic, a hang or an abort.
//!
//! `PROPTEST_CASES` raises the number of cases; six million mutations of the URDF and a million of the
//! mission files were run once. One in about 500,000 found a refusal without a reason (`urdf_tree.rs`, `empty_names`).

use crate::common::registry;
use ff_mission::urdf;
use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Mission};
use ff_testkit::fixtures::text;
use ff_testkit::mutate::{edits, mutate};
use proptest::prelude::*;

/// A result is a model, or at least one error that says something.
fn sane<V>(result: Result<V, ff_model::Problems>) {
    if let Err(p) = result {
        assert!(p.has_errors() && !p.to_string().is_empty());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.max(1000), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_urdf(e in edits(), several in any::<bool>()) {
        let good = if several { text("bad/several.urdf") } else { text("paper/robot.urdf") };
        sane(urdf::from_bytes(&mutate(good.as_bytes(), &e), &UrdfOptions::default()));
    }

    #[test]
    fn mutated_mjcf_and_sdf(e in edits(), mjcf in any::<bool>()) {
        let good = if mjcf { include_str!("../../../docs/examples/three-segment/robot.xml") } else { crate::sdf::SDF };
        sane(urdf::from_bytes(&mutate(good.as_bytes(), &e), &UrdfOptions::default()));
    }

    #[test]
    fn mutated_mission(e in edits(), which in 0..3usize) {
        let good = text(["paper/flex.toml", "paper/slosh.toml", "bad/several.toml"][which]);
        let toml = String::from_utf8_lossy(&mutate(good.as_bytes(), &e)).into_owned();
        sane(Mission::from_str(&toml, &text("paper/robot.urdf"), &registry(), &LoadOptions::default()));
    }

    #[test]
    fn any_bytes(b in prop::collection::vec(any::<u8>(), 0..400)) {
        sane(urdf::from_bytes(&b, &UrdfOptions::default()));
        let t = String::from_utf8_lossy(&b).into_owned();
        sane(Mission::from_str(&t, "", &registry(), &LoadOptions::default()));
    }
}

#[test]
#[ignore = "full tier: 3 s"]
fn large_broken_files_are_refused_with_a_short_list() {
    // Ten thousand joints that all name a link that does not exist; a quadratic search for near names would take minutes, and
    // the time limit of the test runner would end it.
    let mut s = String::from("<robot name='r'><link name='base'/>");
    for i in 0..9_000 {
        s += &format!(
            "<link name='link_number_{i}'/><joint name='j{i}' type='fixed'><parent link='lnik_number_{i}'/><child link='knil_number_{i}'/></joint>"
        );
    }
    s += "</robot>";
    assert!(urdf::from_str(&s, &UrdfOptions::default()).is_err());
    // A million unknown elements.
    let s = format!("<robot name='r'>{}</robot>", "<x/>".repeat(1_000_000));
    let p = urdf::from_str(&s, &UrdfOptions::default()).unwrap_err();
    assert!(p.0.len() < 2_000, "{}", p.0.len());
    assert!(Mission::from_str(&"a = 1\n".repeat(100_000), "", &registry(), &LoadOptions::default()).is_err());
}
