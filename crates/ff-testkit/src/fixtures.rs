//! Files of `fixtures/`.

use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Model, Registry};
use std::path::{Path, PathBuf};

/// A file of `fixtures/`.
pub fn fixture(path: impl AsRef<Path>) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path)
}

/// Text of a file of `fixtures/`.
///
/// # Panics
/// If it cannot be read.
pub fn text(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(fixture(path)).unwrap()
}

/// A robot of `fixtures/`, on a base that floats.
///
/// # Panics
/// If it is refused, or with a warning.
pub fn robot(urdf: &str) -> Model {
    let (model, warnings) = ff_mission::urdf::from_file(&fixture(urdf), &UrdfOptions::default()).unwrap();
    assert!(warnings.0.is_empty(), "{warnings}");
    model
}

/// The kinds of appendage that the paper uses.
pub fn registry() -> Registry {
    let mut r = Registry::new();
    flex_panel::register(&mut r);
    slosh_pendulum::register(&mut r);
    r
}

/// A mission of `fixtures/paper`, such as `flex.toml`.
///
/// # Panics
/// If it is refused.
pub fn paper(file: &str) -> Loaded {
    Mission::load(&fixture("paper").join(file), &registry(), &LoadOptions::default()).unwrap()
}
