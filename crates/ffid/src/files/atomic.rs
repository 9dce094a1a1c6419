//! Writing a file whole or not at all.
//!
//! The temporary file sits beside its target, because a rename is atomic only within one file system. On
//! any error the temporary file is removed and an older target stays as it was.

use crate::exit::Failure;
use std::fs;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Replaces `path` by `bytes`, creating its folder if need be: write, sync, rename, sync the folder.
///
/// # Errors
/// [`Failure::Io`] naming the file and what was tried.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    stream(path, |f| f.write_all(bytes))
}

/// The same for what is too long to be held: `fill` writes it to a temporary file.
///
/// # Errors
/// [`Failure::Io`] naming the file and what was tried; an error of `fill` leaves an older file as it was.
pub fn stream(path: &Path, fill: impl FnOnce(&mut File) -> std::io::Result<()>) -> Result<(), Failure> {
    let dir = folder_of(path);
    fs::create_dir_all(dir).map_err(|e| Failure::io("create", dir, e))?;
    let temp = temp_beside(path);
    let outcome = File::create(&temp)
        .and_then(|mut f| fill(&mut f).and_then(|()| f.sync_all()))
        .and_then(|()| fs::rename(&temp, path))
        .map_err(|e| Failure::io("write", path, e))
        // A rename survives power loss only once the folder is on disk too.
        .and_then(|()| File::open(dir).and_then(|d| d.sync_all()).map_err(|e| Failure::io("sync", dir, e)));
    if outcome.is_err() {
        // Best effort: the first error is the one to report.
        let _ = fs::remove_file(&temp);
    }
    outcome
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn temp_beside(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    folder_of(path).join(format!(".{name}.partial-{}", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_whole_files_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new folder").join("ä.txt");
        write(&path, b"one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    /// Row R01: a target that cannot be written keeps its old content and leaves no temporary file.
    #[test]
    fn r01_failure_keeps_the_old_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out");
        fs::create_dir_all(path.join("occupied")).unwrap(); // a folder cannot be replaced by a file
        let e = write(&path, b"x").unwrap_err();
        assert!(e.to_string().contains("out"), "{e}");
        assert!(path.join("occupied").is_dir());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
