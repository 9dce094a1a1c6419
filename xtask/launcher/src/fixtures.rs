//! `cargo xtask fixtures`: the SHA-256 manifest of `fixtures/`.
//!
//! `fixtures/SHA256SUMS` has the format of `sha256sum`, one `hash  path` per file, sorted by path, with
//! `/` between folders; so `cd fixtures && sha256sum -c SHA256SUMS` verifies it without this project.

use crate::failure::Failure;
use crate::workspace;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

/// Name of the manifest in the fixtures folder.
pub const MANIFEST: &str = "SHA256SUMS";

/// Writes or verifies the manifest of this workspace.
///
/// # Errors
/// [`Failure::Differs`] (15) listing every difference, [`Failure::Io`] (20).
pub fn run(verify: bool) -> Result<(), Failure> {
    let dir = workspace::root()?.join("fixtures");
    let n = if verify { check(&dir)? } else { write(&dir)? };
    println!("fixtures: {n} files {}", if verify { "as recorded" } else { "hashed into fixtures/SHA256SUMS" });
    Ok(())
}

/// Writes the manifest of `dir`; returns the number of files.
///
/// # Errors
/// [`Failure::Io`].
pub fn write(dir: &Path) -> Result<usize, Failure> {
    let hashes = hash_tree(dir)?;
    let mut text = String::new();
    for (path, hash) in &hashes {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{hash}  {path}");
    }
    let (path, partial) = (dir.join(MANIFEST), dir.join(format!("{MANIFEST}.partial")));
    fs::write(&partial, text).and_then(|()| fs::rename(&partial, &path)).map_err(|e| Failure::io("write", &path, e))?;
    Ok(hashes.len())
}

/// Compares the files of `dir` with its manifest; returns the number of files.
///
/// # Errors
/// [`Failure::Differs`] naming every file changed, missing or unrecorded; [`Failure::Io`].
pub fn check(dir: &Path) -> Result<usize, Failure> {
    let path = dir.join(MANIFEST);
    let text = fs::read_to_string(&path).map_err(|e| Failure::io("read", &path, e))?;
    let recorded: BTreeMap<&str, &str> =
        text.lines().filter_map(|l| l.split_once("  ").map(|(hash, path)| (path, hash))).collect();
    let found = hash_tree(dir)?;
    let mut wrong = Vec::new();
    for (path, hash) in &found {
        match recorded.get(path.as_str()) {
            None => wrong.push(format!("  {path}: not in the manifest")),
            Some(h) if h != hash => wrong.push(format!("  {path}: changed, SHA-256 {hash}, recorded {h}")),
            Some(_) => {}
        }
    }
    wrong.extend(recorded.keys().filter(|p| !found.contains_key(**p)).map(|p| format!("  {p}: missing")));
    if wrong.is_empty() {
        return Ok(found.len());
    }
    Err(Failure::Differs(format!(
        "fixtures differ from {}:\n{}\nrestore them, or record a wanted change with `cargo xtask fixtures`",
        path.display(),
        wrong.join("\n")
    )))
}

/// Hash of every file below `dir` but the manifest, by path relative to `dir`.
fn hash_tree(dir: &Path) -> Result<BTreeMap<String, String>, Failure> {
    let mut out = BTreeMap::new();
    let mut todo = vec![(dir.to_owned(), String::new())];
    while let Some((folder, prefix)) = todo.pop() {
        let entries = fs::read_dir(&folder).map_err(|e| Failure::io("list", &folder, e))?;
        for entry in entries {
            let entry = entry.map_err(|e| Failure::io("list", &folder, e))?;
            let path = entry.path();
            let Ok(name) = entry.file_name().into_string() else {
                let e = io::Error::new(io::ErrorKind::InvalidData, "name is not UTF-8; rename it");
                return Err(Failure::io("record", &path, e));
            };
            let relative = format!("{prefix}{name}");
            if path.is_dir() {
                todo.push((path, relative + "/"));
            } else if relative != MANIFEST {
                let bytes = fs::read(&path).map_err(|e| Failure::io("read", &path, e))?;
                out.insert(relative, hex(&Sha256::digest(&bytes)));
            }
        }
    }
    Ok(out)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(64), |mut s, b| {
        let _ = write!(s, "{b:02x}");
        s
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("oracle")).unwrap();
        fs::write(dir.path().join("oracle/a.json"), "abc").unwrap();
        fs::write(dir.path().join("b.urdf"), "").unwrap();
        dir
    }

    #[test]
    fn manifest_is_what_sha256sum_writes() {
        let dir = folder();
        assert_eq!(write(dir.path()).unwrap(), 2);
        let text = fs::read_to_string(dir.path().join(MANIFEST)).unwrap();
        let expected = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  b.urdf\n\
                        ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  oracle/a.json\n";
        assert_eq!(text, expected);
        assert_eq!(check(dir.path()).unwrap(), 2);
    }

    /// Row R14: a fixture changed, removed or added is refused, and every difference is named.
    #[test]
    fn r14_every_difference_is_named() {
        let dir = folder();
        write(dir.path()).unwrap();
        fs::write(dir.path().join("oracle/a.json"), "abd").unwrap();
        fs::remove_file(dir.path().join("b.urdf")).unwrap();
        fs::write(dir.path().join("c.toml"), "").unwrap();
        let e = check(dir.path()).unwrap_err();
        assert_eq!(e.code(), 15);
        let text = e.to_string();
        for part in ["oracle/a.json: changed", "b.urdf: missing", "c.toml: not in the manifest"] {
            assert!(text.contains(part), "{text}");
        }
    }
}
