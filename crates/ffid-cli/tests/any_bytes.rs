//! Every reader that the fuzz targets run (`fuzz/readers.rs`), on seeds changed at random and on the findings of the fuzzer.
//!
//! `PROPTEST_CASES` raises the number of cases. `fuzz/run.sh` searches with coverage instead of chance.

#[allow(unreachable_pub)] // of a file that the fuzz targets share
#[path = "../../../fuzz/readers.rs"]
mod readers;

use ff_testkit::mutate::{edits, mutate};
use proptest::prelude::*;
use std::fs;
use std::path::PathBuf;

type Target = (&'static str, fn(&[u8]));

const TARGETS: [Target; 6] = [
    ("urdf", readers::urdf),
    ("mission", readers::mission),
    ("csv", readers::csv),
    ("binary", readers::binary),
    ("result", readers::result),
    ("trajectory", readers::trajectory),
];

/// Seeds of a target, by name: those of `fuzz/seeds`, and the fixtures that `fuzz/run.sh` takes as well.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut folders = vec![root.join("fuzz/seeds").join(target)];
    folders.extend(match target {
        "urdf" => vec![root.join("fixtures/paper")],
        "mission" => ["paper", "kinds"].map(|f| root.join("fixtures").join(f)).to_vec(),
        "binary" => vec![root.join("fixtures/records")],
        _ => Vec::new(),
    });
    let kind = |p: &PathBuf| match (target, p.extension().and_then(|e| e.to_str())) {
        ("urdf", e) => e == Some("urdf"),
        ("mission", e) => e == Some("toml"),
        ("binary", e) => matches!(e, Some("parquet" | "mcap" | "bag")),
        _ => true,
    };
    let mut files: Vec<PathBuf> = folders
        .iter()
        .filter_map(|f| fs::read_dir(f).ok())
        .flat_map(|d| d.filter_map(|e| e.ok().map(|e| e.path())))
        .filter(kind)
        .collect();
    files.sort();
    files.iter().map(|f| fs::read(f).unwrap()).collect()
}

#[test]
fn every_target_has_seeds_and_takes_them() {
    for (name, target) in TARGETS {
        let seeds = seeds(name);
        assert!(!seeds.is_empty(), "{name}");
        seeds.iter().for_each(|s| target(s));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.max(300), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn changed_at_random(e in edits(), which in 0..6usize, seed in any::<prop::sample::Index>()) {
        let (name, target) = TARGETS[which];
        let seeds = seeds(name);
        target(&mutate(&seeds[seed.index(seeds.len())], &e));
    }
}
