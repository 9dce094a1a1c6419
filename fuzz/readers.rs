//! Every reader of a file, given any bytes: what the fuzz targets run, and what `crates/ffid-cli/tests/any_bytes.rs` runs with seeds and
//! mutations on a stable compiler. A reader returns; and when it refuses, it says why.

use excitation::TrajectoryFile;
use excitation::trajectory::Samples;
use ff_mission::urdf;
use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Mission};
use ff_model::{Model, Problems};
use ff_records::file::{JointColumn, ReadOptions, read, read_from};
use ffid::workflow::identify::IdentificationResult;
use std::io::Write;
use std::path::PathBuf;
use std::sync::OnceLock;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|a| a.join("fixtures").join(name))
        .find(|p| p.exists())
        .unwrap_or_else(|| panic!("no fixtures/{name} above {}", env!("CARGO_MANIFEST_DIR")))
}

fn robot() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| {
        let l = Mission::load(&fixture("paper/slosh.toml"), &ffid::default_registry(), &LoadOptions::default());
        l.unwrap_or_else(|p| panic!("{p}")).model
    })
}

/// A refusal has a reason.
fn sane<T>(result: Result<T, Problems>) {
    if let Err(p) = result {
        assert!(p.has_errors() && p.0.iter().all(|p| !p.message.is_empty() && !p.code.is_empty()), "{p}");
    }
}

/// Seeds are small; what is larger only slows the search down.
const LARGEST: usize = 1 << 18;

/// A robot.
pub fn urdf(data: &[u8]) {
    sane(urdf::from_bytes(data, &UrdfOptions::default()));
}

/// A mission of the paper's robot.
pub fn mission(data: &[u8]) {
    static ROBOT: OnceLock<String> = OnceLock::new();
    let robot =
        ROBOT.get_or_init(|| std::fs::read_to_string(fixture("paper/robot.urdf")).unwrap_or_else(|e| panic!("{e}")));
    if let Ok(text) = std::str::from_utf8(data) {
        sane(Mission::from_str(text, robot, &ffid::default_registry(), &LoadOptions::default()));
    }
}

fn joints() -> Vec<JointColumn> {
    ["a", "b"].map(|n| JointColumn { name: n.into(), slides: n == "b" }).to_vec()
}

/// A record as CSV, for two joints `a` and `b` (sliding) and with whatever joints it names.
pub fn csv(data: &[u8]) {
    if data.len() < LARGEST {
        sane(read_from(data, &joints(), &ReadOptions::default()));
        let lenient = ReadOptions { drop_gaps: true, drop_repeated: true, resample: true, ..ReadOptions::default() };
        sane(read_from(data, &joints(), &lenient));
    }
}

/// A record as Parquet or as a bag of ROS 1 or ROS 2, told by its first bytes.
pub fn binary(data: &[u8]) {
    if data.len() < LARGEST {
        let mut file = tempfile::NamedTempFile::new().unwrap_or_else(|e| panic!("{e}"));
        file.write_all(data).unwrap_or_else(|e| panic!("{e}"));
        sane(read(file.path(), &joints(), &ReadOptions::default()));
    }
}

/// The numbers of a result folder; what is read is written and read back as the same.
pub fn result(data: &[u8]) {
    if let Ok(r) = IdentificationResult::from_json(data) {
        let Ok(text) = r.to_json() else { return };
        let again =
            IdentificationResult::from_json(&text).unwrap_or_else(|e| panic!("what was written is refused: {e}"));
        assert_eq!(again.to_json().ok().as_deref(), Some(&text[..]));
    }
}

/// A trajectory as JSON or CSV.
pub fn trajectory(data: &[u8]) {
    if let Ok(text) = std::str::from_utf8(data)
        && data.len() < LARGEST
    {
        sane(TrajectoryFile::from_json(text).and_then(|t| t.for_model(robot())));
        sane(Samples::from_csv(text, robot()));
    }
}
