//! Where the workspace is.

use crate::failure::Failure;
use std::path::{Path, PathBuf};

/// Root of the workspace: a folder above this package, or, outside cargo, the current folder or one above it.
///
/// # Errors
/// [`Failure::Io`] when no folder upwards of the current one holds `Cargo.lock` and `xtask`.
pub fn root() -> Result<PathBuf, Failure> {
    // Set by `cargo run`; asked at run time, so that no path of the build machine is compiled in.
    let package = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    if let Some(root) = package.as_deref().and_then(above) {
        return Ok(root);
    }
    let here = std::env::current_dir().map_err(|e| Failure::io("find", Path::new("."), e))?;
    above(&here).ok_or_else(|| {
        let e = std::io::Error::new(std::io::ErrorKind::NotFound, "no workspace here or above; cd into the project");
        Failure::io("find the workspace from", &here, e)
    })
}

fn above(dir: &Path) -> Option<PathBuf> {
    let is_root = |d: &&Path| d.join("Cargo.lock").is_file() && d.join("xtask").join("Cargo.toml").is_file();
    dir.ancestors().find(is_root).map(Path::to_owned)
}
