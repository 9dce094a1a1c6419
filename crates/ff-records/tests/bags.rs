//! What tests of bags share: the writers of `fixtures/records` put the same motion into all of them.

use ff_records::file::JointColumn;
use std::path::PathBuf;

pub(crate) const T0: i64 = 1_700_000_000_123_456_789;

pub(crate) fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/records").join(name)
}
pub(crate) fn joints() -> Vec<JointColumn> {
    ["elbow", "shoulder"].map(|n| JointColumn { name: n.into(), slides: false }).to_vec()
}
pub(crate) fn value(i: usize, k: usize) -> f64 {
    (0.05 * i as f64 + 0.7 * k as f64).sin() / (1.0 + 0.3 * k as f64) + 0.01 * k as f64
}
pub(crate) fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
    let f = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(f.path(), bytes).unwrap();
    f
}
