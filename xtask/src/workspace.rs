//! Where the workspace is.

use ffid::exit::Failure;
use std::path::{Path, PathBuf};

/// Root of the workspace: the folder above this package, or, outside cargo, above the current folder.
///
/// # Errors
/// [`Failure::Io`] when no folder upwards of the current one holds `Cargo.lock` and `xtask`.
pub fn root() -> Result<PathBuf, Failure> {
    // Set by `cargo run`; asked at run time, so that no path of the build machine is compiled in.
    if let Some(dir) = std::env::var_os("CARGO_MANIFEST_DIR")
        && let Some(parent) = Path::new(&dir).parent()
        && is_root(parent)
    {
        return Ok(parent.to_owned());
    }
    let here = std::env::current_dir().map_err(|e| Failure::io("find", Path::new("."), e))?;
    here.ancestors().find(|d| is_root(d)).map(Path::to_owned).ok_or_else(|| {
        let e = std::io::Error::new(std::io::ErrorKind::NotFound, "no workspace here or above; cd into the project");
        Failure::io("find the workspace from", &here, e)
    })
}

fn is_root(dir: &Path) -> bool {
    dir.join("Cargo.lock").is_file() && dir.join("xtask").join("Cargo.toml").is_file()
}
