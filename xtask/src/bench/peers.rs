//! The peers' programs: where they are, and which of their figures answers which of our functions.

use ffid::exit::Failure;
use std::io;
use std::path::{Path, PathBuf};

/// The built programs of `peers/run_peers.sh`, with the states and models they run on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peers {
    /// Pinocchio micro-benchmark: clang -O3 -march=native -DNDEBUG, the fastest of their builds.
    pub pin_bench: PathBuf,
    /// MuJoCo micro-benchmark.
    pub mj_bench: PathBuf,
    /// Pinocchio simulation.
    pub pin_sim: PathBuf,
    /// MuJoCo simulation.
    pub mj_sim: PathBuf,
    /// Pinocchio identification; none in work folders that were built without it.
    pub pin_id: Option<PathBuf>,
    /// What `run_peers.sh` wrote of whole tasks, where it has run them.
    pub recorded: PathBuf,
    /// Folder of the 1,000 states per model.
    pub states: PathBuf,
    /// Folder of the models.
    pub model: PathBuf,
}

impl Peers {
    /// Finds everything below `dir`: the folder of `run_peers.sh`, or the work folder it fills.
    ///
    /// # Errors
    /// [`Failure::Io`] naming what is missing and the command that makes it.
    pub fn find(dir: &Path) -> Result<Self, Failure> {
        let home = std::env::var_os("HOME").map(PathBuf::from);
        Self::find_in(dir, std::env::var_os("PEERS_WORK").map(PathBuf::from), home)
    }

    fn find_in(dir: &Path, work: Option<PathBuf>, home: Option<PathBuf>) -> Result<Self, Failure> {
        // The source folder first: it says itself where its work folder is.
        let script = dir.join("run_peers.sh");
        let (work, script) = if script.is_file() {
            let work = work.or_else(|| home.map(|h| h.join(".cache").join("ffid-peers")));
            let none = || io::Error::new(io::ErrorKind::NotFound, "set PEERS_WORK to the folder it was built in");
            (work.ok_or_else(|| Failure::io("find the programs of", &script, none()))?, script)
        } else {
            (dir.to_owned(), PathBuf::from("peers/run_peers.sh"))
        };
        let need = |path: PathBuf| {
            if path.exists() {
                return Ok(path);
            }
            let how = format!("not there; make it with `{} setup data build`", script.display());
            Err(Failure::io("use", &path, io::Error::new(io::ErrorKind::NotFound, how)))
        };
        let built = |name: &str| need(work.join("build").join(name));
        let found = Self {
            pin_bench: built("pin_clang_native")?,
            mj_bench: built("mj_bench")?,
            pin_sim: built("pin_sim_clang")?,
            mj_sim: built("mj_sim")?,
            pin_id: built("pin_id_clang").ok(),
            recorded: work.join("results").join("tasks.jsonl"),
            states: work.join("states"),
            model: work.join("model"),
        };
        for model in super::models::MODELS {
            need(found.states.join(format!("{model}.txt")))?;
            need(found.model.join(format!("{model}.mjcf.xml")))?;
        }
        Ok(found)
    }
}

/// Pinocchio's functions that answer ours; the fastest counts.
pub fn pinocchio(function: &str) -> &'static [&'static str] {
    match function {
        "rnea" => &["rnea"],
        "crba" | "mass_matrix" => &["crba LOCAL", "crba WORLD"],
        "fd" => &["aba LOCAL", "aba WORLD", "crba+cholesky+solve"],
        "hybrid" => &["hybrid: crba+nle+LLT(unknown block)+tau_arm"],
        "regressor" => &["computeJointTorqueRegressor"],
        "id_derivatives" => &["computeRNEADerivatives"],
        _ => &[],
    }
}

/// MuJoCo's function that answers ours, for information.
pub fn mujoco(function: &str) -> &'static [&'static str] {
    match function {
        "rnea" => &["kinematics+comPos+comVel+rne (ID)"],
        "crba" | "mass_matrix" => &["kinematics+comPos+makeM"],
        "fd" => &["mj_forward"],
        _ => &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn touch(path: &Path) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }

    fn fill(work: &Path) {
        for p in ["pin_clang_native", "mj_bench", "pin_sim_clang", "mj_sim"] {
            touch(&work.join("build").join(p));
        }
        for m in ["rigid", "flex", "slosh"] {
            touch(&work.join("states").join(format!("{m}.txt")));
            touch(&work.join("model").join(format!("{m}.mjcf.xml")));
        }
    }

    #[test]
    fn the_work_folder_may_be_given_itself_or_by_the_sources() {
        let dir = tempfile::tempdir().unwrap();
        let (work, sources) = (dir.path().join("work"), dir.path().join("peers"));
        fill(&work);
        touch(&sources.join("run_peers.sh"));
        let direct = Peers::find_in(&work, None, None).unwrap();
        assert_eq!(direct.pin_bench, work.join("build/pin_clang_native"));
        assert_eq!(Peers::find_in(&sources, Some(work.clone()), None).unwrap(), direct);
        // Without PEERS_WORK, where the script puts it.
        let home = dir.path().join("home");
        fill(&home.join(".cache/ffid-peers"));
        let at_home = Peers::find_in(&sources, None, Some(home.clone())).unwrap();
        assert_eq!(at_home.states, home.join(".cache/ffid-peers/states"));
    }

    #[test]
    fn a_missing_program_is_named_with_the_command_that_makes_it() {
        let dir = tempfile::tempdir().unwrap();
        fill(dir.path());
        fs::remove_file(dir.path().join("build/mj_sim")).unwrap();
        let e = anyhow::Error::new(Peers::find_in(dir.path(), None, None).unwrap_err());
        let text = format!("{e:#}");
        assert!(text.contains("mj_sim") && text.contains("run_peers.sh setup data build"), "{text}");
        assert_eq!(crate::exit::code_of(&e), 20);
    }
}
