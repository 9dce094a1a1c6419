//! What is left of an output when the program is killed, or the disk is full: rows R01 and R04, at length. They take minutes, and
//! the second has to mount a file system, which takes root: `cargo test --workspace --test all outputs -- --ignored --nocapture`.

use crate::case::{Case, slosh};
use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn start(c: &Case, out: &str) -> Child {
    let mut p = Command::new(assert_cmd::cargo::cargo_bin("ffid"));
    p.args(["identify", "m.toml", "--record", "rec.csv", "--out", out, "--force", "--quiet"]);
    p.current_dir(c.path("")).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// After every kill the folder (and the one that `--force` keeps) is complete, old or new, or absent.
#[test]
#[ignore = "full tier: minutes"]
fn r04_killed_at_200_random_moments() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "3"]);
    let begun = Instant::now();
    assert!(start(&c, "res").wait().unwrap().success());
    let whole = begun.elapsed();
    fs::remove_dir_all(c.path("res")).unwrap();
    let (mut killed, mut absent, mut partial, mut state) = (0, 0, 0, 0x2545_F491_4F6C_DD1D_u64);
    for _ in 0..200 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // The last tenth of a run is where it writes: every second moment is there.
        let share = (state >> 11) as f64 / (1u64 << 53) as f64;
        let at = if state >> 63 == 0 { 1.05 * share } else { 0.8 + 0.3 * share };
        let mut run = start(&c, "res");
        std::thread::sleep(Duration::from_secs_f64(at * whole.as_secs_f64()));
        let _ = run.kill();
        killed += u32::from(run.wait().unwrap().code().is_none());
        for name in ["res", "res.bak"] {
            if c.path(name).exists() {
                ffid::files::complete::check(&c.path(name), "identify").unwrap();
            }
        }
        absent += u32::from(!c.path("res").exists());
        let names = fs::read_dir(c.path("")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        partial = partial.max(names.filter(|n| n.contains("partial") || n.contains("old-")).count());
    }
    println!(
        "{killed} of 200 runs killed, {absent} left no folder, at most {partial} partial folders; a run takes {whole:?}"
    );
    assert!((60..200).contains(&killed), "{killed}");
    // Each run removes what the one before left: a folder that was not finished, or one that was not quite removed.
    assert!(partial <= 1, "{partial}");
    // What is left does not stand in the way.
    assert!(start(&c, "res").wait().unwrap().success());
    ffid::files::complete::check(&c.path("res"), "identify").unwrap();
}

/// A folder on a file system of its own, unmounted at the end.
struct Small(std::path::PathBuf);

impl Small {
    /// None where this process may not mount.
    fn try_new(c: &Case, size: &str) -> Option<Self> {
        let path = c.path("small");
        fs::create_dir_all(&path).unwrap();
        let how = format!("size={size}");
        let done = Command::new("mount").args(["-t", "tmpfs", "-o", &how, "tmpfs"]).arg(&path).status().unwrap();
        done.success().then_some(Self(path))
    }

    fn new(c: &Case, size: &str) -> Self {
        Self::try_new(c, size).unwrap()
    }
}

impl Drop for Small {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

#[test]
#[ignore = "full tier: mounts a file system"]
fn r01_a_disk_that_is_full_leaves_the_old_output_and_exit_code_20() {
    let c = slosh();
    if Small::try_new(&c, "16k").is_none() {
        println!("SKIPPED r01: this user may not mount a file system");
        return;
    }
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "3"]);
    for size in ["16k", "64k", "256k", "1m"] {
        let small = Small::new(&c, size);
        assert_eq!(start(&c, "small/res").wait().unwrap().code(), Some(20), "{size}");
        let left: Vec<_> = fs::read_dir(&small.0).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert!(left.is_empty(), "{size}: {left:?}");
    }
    // An old result stays as it is.
    let small = Small::new(&c, "32m");
    assert_eq!(start(&c, "small/res").wait().unwrap().code(), Some(0));
    let before = fs::read(small.0.join("res/result.json")).unwrap();
    // Fills the disk but for less than a result takes.
    let mut filler = vec![0u8; 32 << 20];
    while fs::write(small.0.join("filler"), &filler).is_err() {
        filler.truncate(filler.len() - (200 << 10));
    }
    assert_eq!(start(&c, "small/res").wait().unwrap().code(), Some(20));
    assert_eq!(fs::read(small.0.join("res/result.json")).unwrap(), before);
    ffid::files::complete::check(&small.0.join("res"), "identify").unwrap();
}
