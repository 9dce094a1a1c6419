//! A folder of results: written whole or not at all, with a manifest of what is in it.
//!
//! Everything is built in `<out>.partial-<pid>` beside the target, on the same file system. The manifest comes last; then
//! one rename makes the folder appear. An error removes the own partial folder and leaves what was there before. A folder
//! without `manifest.toml` is incomplete, whatever else is in it. What a run that was killed left behind, the next one into
//! the same folder removes.

use crate::exit::Failure;
use crate::files::atomic;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fs;
use std::fs::{File, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Name of the manifest.
pub const MANIFEST: &str = "manifest.toml";

/// What stands between the name of a folder and the process that builds it.
const PARTIAL: &str = ".partial-";
/// The same for a folder that is being removed.
const OLD: &str = ".old-";

fn hexadecimal(hash: &[u8]) -> String {
    hash.iter().fold(String::new(), |s, b| format!("{s}{b:02x}"))
}

/// A file of the manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// Path: relative in the folder for results, as given for inputs.
    pub file: String,
    /// Size (bytes).
    pub bytes: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
}

impl Entry {
    /// Hashes a file, called `name` in the manifest.
    ///
    /// # Errors
    /// [`Failure::Io`].
    pub fn of(path: &Path, name: impl Into<String>) -> Result<Self, Failure> {
        let fail = |e| Failure::io("read", path, e);
        let mut file = File::open(path).map_err(fail)?;
        let (mut hash, mut bytes) = (Sha256::new(), 0);
        let mut buffer = [0; 1 << 14];
        loop {
            let n = file.read(&mut buffer).map_err(fail)?;
            if n == 0 {
                break;
            }
            hash.update(&buffer[..n]);
            bytes += n as u64;
        }
        let sha256 = hexadecimal(&hash.finalize());
        Ok(Self { file: name.into(), bytes, sha256 })
    }
    /// Hashes numbers in memory (little-endian, one slice after another), called `name` in the manifest. Allocates.
    pub fn of_numbers(slices: &[&[f64]], name: impl Into<String>) -> Self {
        let (mut hash, mut bytes) = (Sha256::new(), 0);
        let mut buffer = Vec::with_capacity(8 << 10);
        for part in slices.iter().flat_map(|s| s.chunks(1 << 10)) {
            buffer.clear();
            part.iter().for_each(|x| buffer.extend(x.to_le_bytes()));
            hash.update(&buffer);
            bytes += buffer.len() as u64;
        }
        Self { file: name.into(), bytes, sha256: hexadecimal(&hash.finalize()) }
    }
}

/// What a manifest says besides the files.
#[derive(Clone, Debug, Serialize)]
pub struct About {
    /// Program and version.
    pub program: String,
    /// The command, such as `excite`.
    pub command: String,
    /// Seed of all randomness.
    pub seed: u64,
    /// Settings, by name.
    pub settings: std::collections::BTreeMap<String, String>,
    /// Units of the columns and keys that do not name theirs.
    pub units: String,
    /// Files the results come from.
    pub input: Vec<Entry>,
}

#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    about: &'a About,
    file: Vec<Entry>,
}

/// A folder that is being written.
#[derive(Debug)]
pub struct Folder {
    target: PathBuf,
    partial: PathBuf,
    lock: PathBuf,
    /// Held, not read: the lock goes with it.
    _held: File,
    replace: bool,
    left_behind: Vec<PathBuf>,
}

impl Folder {
    /// Prepares to write `target`: takes its lock and makes the partial folder, so that what cannot be written is known
    /// before anything is computed. What exists is refused unless `replace` is true.
    ///
    /// # Errors
    /// [`Failure::Exists`], [`Failure::Locked`], [`Failure::Io`].
    pub fn begin(target: &Path, replace: bool) -> Result<Self, Failure> {
        // "results/" and "results" are the same folder, but not the same name with something behind it.
        let target: &Path = &target.components().collect::<PathBuf>();
        if target.file_name().is_none() {
            let e = std::io::Error::new(std::io::ErrorKind::InvalidInput, "is no name of a new folder");
            return Err(Failure::io("create", target, e));
        }
        if fs::symlink_metadata(target).is_ok() && !replace {
            return Err(Failure::Exists { path: target.to_owned() });
        }
        let parent = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(parent).map_err(|e| Failure::io("create", parent, e))?;
        let lock = beside(target, ".lock");
        let held = Self::lock(&lock)?;
        let left_behind = remove_dead(parent, &beside(target, PARTIAL));
        remove_dead(parent, &beside(target, OLD));
        let partial = beside(target, &format!("{PARTIAL}{}", std::process::id()));
        let folder = Self { target: target.to_owned(), partial, lock, _held: held, replace, left_behind };
        fs::create_dir(&folder.partial).map_err(|e| Failure::io("create", target, e))?;
        Ok(folder)
    }
    fn lock(path: &Path) -> Result<File, Failure> {
        let mut file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(|e| Failure::io("create", path, e))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut by = String::new();
                // Who holds it is a courtesy.
                let _ = file.read_to_string(&mut by);
                return Err(Failure::Locked { path: path.to_owned(), by: by.trim().to_owned() });
            }
            Err(TryLockError::Error(e)) => return Err(Failure::io("lock", path, e)),
        }
        let write = |file: &mut File| {
            file.set_len(0)?;
            write!(file, "pid {}", std::process::id())?;
            file.sync_all()
        };
        write(&mut file).map_err(|e| Failure::io("write", path, e))?;
        Ok(file)
    }
    /// Partial folders of runs that were killed, which [`Folder::begin`] removed.
    pub fn left_behind(&self) -> &[PathBuf] {
        &self.left_behind
    }
    /// Where to put files; they move with the folder.
    pub fn path(&self) -> &Path {
        &self.partial
    }
    /// Writes one file.
    ///
    /// # Errors
    /// [`Failure::Io`].
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        atomic::write(&self.partial.join(name), bytes)
    }
    /// Hashes all files, writes the manifest and puts the folder in its place. A folder that is replaced is kept as
    /// `<out>.bak`, in place of an older one.
    ///
    /// # Errors
    /// [`Failure::Io`].
    pub fn finish(self, about: &About) -> Result<(), Failure> {
        let fail = |what: &'static str, path: &Path| {
            let path = path.to_owned();
            move |e| Failure::io(what, &path, e)
        };
        let mut names = Vec::new();
        for entry in fs::read_dir(&self.partial).map_err(fail("read", &self.partial))? {
            names.push(entry.map_err(fail("read", &self.partial))?.file_name());
        }
        names.sort();
        let file = names
            .iter()
            .map(|n| Entry::of(&self.partial.join(n), n.to_string_lossy()))
            .collect::<Result<Vec<_>, _>>()?;
        let text = toml::to_string(&Manifest { about, file })
            .map_err(|e| Failure::io("format", &self.target, std::io::Error::other(e)))?;
        self.write(MANIFEST, text.as_bytes())?;
        let mut oldest = None;
        if self.replace && fs::symlink_metadata(&self.target).is_ok() {
            let kept = beside(&self.target, ".bak");
            // Whole or gone: a folder is not removed at once, and whoever is killed meanwhile leaves the rest of it under a name of its own.
            let away = beside(&self.target, &format!("{OLD}{}", std::process::id()));
            match fs::rename(&kept, &away) {
                Ok(()) => oldest = Some(away),
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
                Err(e) => return Err(Failure::io("rename", &kept, e)),
            }
            fs::rename(&self.target, &kept).map_err(fail("rename", &self.target))?;
        }
        fs::rename(&self.partial, &self.target).map_err(fail("write", &self.target))?;
        let parent = self.target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        File::open(parent).and_then(|d| d.sync_all()).map_err(fail("sync", parent))?;
        let Some(old) = oldest else { return Ok(()) };
        let is_folder = fs::symlink_metadata(&old).is_ok_and(|m| m.is_dir());
        let gone = if is_folder { fs::remove_dir_all(&old) } else { fs::remove_file(&old) };
        gone.map_err(fail("remove", &old))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // After `finish` the partial folder is gone; on an error it goes now. Nothing can be said here if that fails.
        let _ = fs::remove_dir_all(&self.partial);
        let _ = fs::remove_file(&self.lock);
    }
}

/// A name beside that of the folder.
fn beside(target: &Path, suffix: &str) -> PathBuf {
    let mut name = target.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Removes the folders `<prefix><pid>` of `parent` whose process is dead, and says which.
///
/// Whoever holds the lock of the target is the only one who writes it. The process is looked for all the same: a lock may not
/// work on every file system, and what a living process writes is never removed. The own id is that of a dead process that had it
/// before.
fn remove_dead(parent: &Path, prefix: &Path) -> Vec<PathBuf> {
    let own = std::process::id();
    let dead = |path: &PathBuf| {
        let name = path.file_name().and_then(|n| n.to_str()).zip(prefix.file_name().and_then(|n| n.to_str()));
        let pid = name.and_then(|(n, p)| n.strip_prefix(p)?.parse::<u32>().ok());
        pid.is_some_and(|pid| pid == own || !Path::new(&format!("/proc/{pid}")).exists())
    };
    // A link, or a file of this name, is none of ours.
    let folder = |path: &PathBuf| fs::symlink_metadata(path).is_ok_and(|m| m.is_dir());
    let entries = fs::read_dir(parent).into_iter().flatten().filter_map(|e| Some(e.ok()?.path()));
    entries.filter(dead).filter(folder).filter(|path| fs::remove_dir_all(path).is_ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about() -> About {
        let settings = [("goal".to_owned(), "modal".to_owned())].into_iter().collect();
        About { program: "ffid".into(), command: "excite".into(), seed: 3, settings, units: "SI".into(), input: vec![] }
    }
    fn names(dir: &Path) -> Vec<String> {
        let mut all: Vec<String> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        all.sort();
        all
    }

    #[test]
    fn a_folder_appears_whole_with_its_manifest() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("new").join("out");
        let f = Folder::begin(&out, false).unwrap();
        f.write("a.txt", b"abc").unwrap();
        assert!(!out.exists());
        f.finish(&about()).unwrap();
        assert_eq!(names(out.parent().unwrap()), ["out"]);
        let manifest: toml::Table = toml::from_str(&fs::read_to_string(out.join(MANIFEST)).unwrap()).unwrap();
        let file = &manifest["file"].as_array().unwrap()[0];
        assert_eq!(file["file"].as_str(), Some("a.txt"));
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!((file["bytes"].as_integer(), file["sha256"].as_str()), (Some(3), Some(known)));
        assert_eq!((manifest["seed"].as_integer(), manifest["settings"]["goal"].as_str()), (Some(3), Some("modal")));
    }

    /// Row R08: what exists is refused, and kept as `.bak` when replaced.
    #[test]
    fn r08_existing_results_are_never_lost() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        for text in ["one", "two", "three"] {
            assert!(text == "one" || matches!(Folder::begin(&out, false), Err(Failure::Exists { .. })));
            let f = Folder::begin(&out, true).unwrap();
            f.write("a.txt", text.as_bytes()).unwrap();
            f.finish(&about()).unwrap();
        }
        assert_eq!(names(dir.path()), ["out", "out.bak"]);
        let read = |d: &str| fs::read_to_string(dir.path().join(d).join("a.txt")).unwrap();
        assert_eq!((read("out"), read("out.bak")), ("three".into(), "two".into()));
    }

    /// Row R07, and what an aborted run leaves: nothing.
    #[test]
    fn r07_one_writer_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let first = Folder::begin(&out, false).unwrap();
        first.write("a.txt", b"x").unwrap();
        let e = Folder::begin(&out, true).unwrap_err();
        assert!(matches!(&e, Failure::Locked { by, .. } if *by == format!("pid {}", std::process::id())), "{e}");
        assert_eq!(e.code(), 21);
        assert!(first.path().join("a.txt").exists());
        drop(first);
        assert!(names(dir.path()).is_empty());
        drop(Folder::begin(&out, false).unwrap());
    }

    /// Row R04: what a killed run left is removed, what a living process writes or somebody else put there is not.
    #[test]
    fn r04_partial_folders_of_dead_processes_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let make = |name: &str| {
            fs::create_dir_all(dir.path().join(name)).unwrap();
            fs::write(dir.path().join(name).join("a.txt"), b"x").unwrap();
        };
        // The process with the greatest id there can be is not there; the first one is.
        let kept = ["other.partial-4194999", "out.partial-1", "out.partial-4194999x", "out.partial-", "out2"];
        kept.iter().chain(&["out.partial-4194999", "out.partial-4194998"]).for_each(|n| make(n));
        fs::write(dir.path().join("out.partial-4194997"), b"a file").unwrap();
        // The rest of a folder that was being removed is nobody's result, and gone without a word.
        make("out.old-4194996");
        let f = Folder::begin(&dir.path().join("out/"), false).unwrap();
        let mut gone = f.left_behind().to_vec();
        gone.sort();
        assert_eq!(gone, ["out.partial-4194998", "out.partial-4194999"].map(|n| dir.path().join(n)));
        assert!(f.path().is_dir() && f.path().parent() == Some(dir.path()));
        drop(f);
        let mut want: Vec<&str> = kept.iter().copied().chain(["out.partial-4194997"]).collect();
        want.sort_unstable();
        assert_eq!(names(dir.path()), want);
        assert!(!out.exists());
    }
}
