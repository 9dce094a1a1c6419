//! `ARCHITECTURE.md` states the dependency graph; here it is held against what cargo says.

// Helpers of an integration test are test code, which clippy does not see.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Workspace members and those of them each depends on, for its users.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// The table under "Dependencies": every name in backquotes, the first of a row being the crate.
fn stated() -> Graph {
    let page = std::fs::read_to_string(xtask::workspace::root().unwrap().join("ARCHITECTURE.md")).unwrap();
    let section = page.split("\n## Dependencies\n").nth(1).unwrap().split("\n## ").next().unwrap();
    let rows = section.lines().filter(|l| l.starts_with("| `"));
    rows.map(|row| {
        let mut names = row.split('`').skip(1).step_by(2).map(str::to_owned);
        (names.next().unwrap(), names.collect())
    })
    .collect()
}

fn actual() -> Graph {
    let out = Command::new(xtask::process::cargo())
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(xtask::workspace::root().unwrap())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let all: Value = serde_json::from_slice(&out.stdout).unwrap();
    let packages = all["packages"].as_array().unwrap();
    let name = |v: &Value| v["name"].as_str().unwrap().to_owned();
    let members: BTreeSet<String> = packages.iter().map(name).collect();
    let normal = |p: &Value| -> BTreeSet<String> {
        let own = p["dependencies"].as_array().unwrap().iter().filter(|d| d["kind"].is_null());
        own.map(name).filter(|n| members.contains(n)).collect()
    };
    packages.iter().map(|p| (name(p), normal(p))).collect()
}

#[test]
fn the_stated_graph_is_the_real_one() {
    assert_eq!(stated(), actual(), "left: ARCHITECTURE.md, right: cargo metadata");
}

/// No crate reaches sideways: the layers of the page, from the bottom.
#[test]
fn dependencies_go_down_the_layers() {
    let page = std::fs::read_to_string(xtask::workspace::root().unwrap().join("ARCHITECTURE.md")).unwrap();
    let graph = actual();
    let layer: BTreeMap<&str, u32> = page
        .lines()
        .filter_map(|l| Some((l.strip_prefix(' ')?.split_once(' ')?.0.parse().ok()?, l)))
        .flat_map(|(n, l): (u32, &str)| l.split_whitespace().map(move |w| (w, n)))
        .filter(|(w, _)| graph.contains_key(*w))
        .collect();
    assert_eq!(layer.len(), graph.len(), "every crate has a layer: {layer:?}");
    for (from, to) in graph.iter().flat_map(|(f, all)| all.iter().map(move |t| (f, t))) {
        assert!(layer[to.as_str()] < layer[from.as_str()], "{from} depends on {to}, which is not below it");
    }
}

/// Dev-dependencies among members carry no version, so that `cargo publish` drops them and meets no cycle.
#[test]
fn dev_dependencies_on_members_are_by_path_alone() {
    let root = xtask::workspace::root().unwrap();
    let members: Vec<String> = actual().into_keys().collect();
    for name in
        members.iter().filter(|n| !["xtask", "xtask-launcher", "ff-bench", "antenna-boom"].contains(&n.as_str()))
    {
        // The folder has the name of the library.
        let folder = root.join("crates").join(name);
        let folder = if folder.is_dir() { folder } else { root.join("crates").join(name.trim_start_matches("ff-")) };
        let text = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let dev = text.split("[dev-dependencies]").nth(1).unwrap_or_default();
        for line in dev.lines().take_while(|l| !l.starts_with('[')) {
            let key = line.split(['.', ' ', '=']).next().unwrap_or_default();
            let member = members.iter().any(|m| m == key || m.strip_prefix("ff-") == Some(key));
            let good = !member || (line.contains("path") && !line.contains("version"));
            assert!(good, "crates/{name}/Cargo.toml: `{line}` must give a path and no version");
        }
    }
}

/// Packages that are compiled for `arguments` with their features, apart from what runs while compiling.
fn packages_with_features(arguments: &[&str]) -> BTreeSet<String> {
    let out = Command::new(xtask::process::cargo())
        .args(["tree", "--locked", "--offline", "--prefix", "none", "--format", "{p} with features {f}"])
        .args(arguments)
        .current_dir(xtask::workspace::root().unwrap())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).unwrap();
    text.lines().map(|l| l.trim_end_matches(" (*)").to_owned()).collect()
}

/// Of a package that `cargo xtask` wants with other features than the tests of the workspace, two builds are made, and of everything
/// that depends on it: one missing feature of `libc` compiled every crate from `ff-dynamics` upwards a second time.
#[test]
fn tasks_and_tests_share_one_build() {
    let tests = packages_with_features(&["--workspace", "--edges", "normal,dev,no-proc-macro"]);
    let tasks = packages_with_features(&["--package", "xtask", "--edges", "normal,no-proc-macro"]);
    let other: Vec<_> = tasks.difference(&tests).collect();
    assert!(other.is_empty(), "switch on in xtask/Cargo.toml what the tests switch on of {other:#?}");
}

/// The Python package is a workspace of its own, and its wheel is built from a lock file as it stands.
#[test]
fn the_lock_file_of_the_python_package_knows_all_dependencies() {
    let root = xtask::workspace::root().unwrap();
    let lock = std::fs::read_to_string(root.join("crates/ffid-py/Cargo.lock")).unwrap();
    let locked: BTreeMap<&str, Vec<&str>> = lock
        .split("[[package]]")
        .skip(1)
        .map(|block| {
            let mut quoted = block.split('"').skip(1).step_by(2);
            let name = quoted.next().unwrap();
            let dependencies = block.split("dependencies = [").nth(1).unwrap_or_default();
            let names = dependencies.split('"').skip(1).step_by(2).map(|d| d.split(' ').next().unwrap());
            (name, names.collect())
        })
        .collect();
    let out = Command::new(xtask::process::cargo())
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(&root)
        .output()
        .unwrap();
    let all: Value = serde_json::from_slice(&out.stdout).unwrap();
    let mut missing = Vec::new();
    for package in all["packages"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        let Some(known) = locked.get(name) else { continue };
        let needed = package["dependencies"].as_array().unwrap().iter();
        let needed = needed.filter(|d| d["kind"].is_null() && d["optional"] == false);
        missing.extend(
            needed
                .map(|d| d["name"].as_str().unwrap())
                .filter(|d| !known.contains(d))
                .map(|d| format!("{name} -> {d}")),
        );
    }
    assert!(
        locked.contains_key("ffid-cli") && missing.is_empty(),
        "{missing:?}; run `cargo update --workspace` in crates/ffid-py"
    );
}
