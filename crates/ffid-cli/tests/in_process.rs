//! [`ffid_cli::run`] in this process: the same text and exit code as the binary, nothing on the streams of the process, and as
//! often as wanted.

use crate::case::{slosh, trajectory};
use crate::common::{ffid, fixture};
use std::fs;

/// The command in this process: exit code, text for the standard output, text for the standard error.
fn library(args: &[&str]) -> (i32, String, String) {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let exit = ffid_cli::run(std::iter::once("ffid").chain(args.iter().copied()), &mut out, &mut err);
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (i32::from(exit.code()), text(out), text(err))
}

#[test]
fn commands_that_print_say_the_same_as_the_binary() {
    let dir = tempfile::tempdir().unwrap();
    let flex = fixture("paper/flex.toml").display().to_string();
    let missing = dir.path().join("none.toml").display().to_string();
    let cases: [(&[&str], i32); 8] = [
        (&["check", &flex], 0),
        (&["check", &flex, "--json"], 0),
        (&["modes", &flex], 0),
        (&["schema", "result"], 0),
        (&["check", &missing], 20),
        (&["check", &missing, "--json"], 20),
        (&["identify", &flex], 2),
        (&["excite", "--help"], 0),
    ];
    for (args, exit) in cases {
        let here = library(args);
        assert_eq!(here, ffid(dir.path(), args), "{args:?}");
        assert_eq!(here.0, exit, "{args:?}: {}", here.2);
        assert!(!here.1.is_empty() || !here.2.is_empty(), "{args:?}");
    }
}

#[test]
fn an_identification_runs_several_times_in_a_process_as_in_the_binary() {
    let c = slosh();
    c.write("a.csv", &trajectory(8.0, 0.2));
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let [mission, record, target] = ["m.toml", "rec.csv", "res"].map(|n| c.path(n).display().to_string());
    let args =
        ["identify", &mission, "--record", &record, "--out", &target, "--max-iterations", "2", "--clocks", "trust"];
    let result = || {
        let bytes = fs::read(c.path("res/result.json")).unwrap();
        fs::remove_dir_all(c.path("res")).unwrap();
        bytes
    };
    let (binary, written) = (c.run(&args), result());
    assert!(binary.1.contains("parameters (14)"), "{}\n{}", binary.1, binary.2);
    for _ in 0..2 {
        assert_eq!(library(&args), binary);
        assert_eq!(result(), written);
    }
    // The output folder exists: refused, with the same words.
    fs::create_dir(c.path("res")).unwrap();
    let refused = library(&args);
    assert_eq!(refused, c.run(&args));
    assert!(refused.0 != 0 && refused.2.contains("Io::Exists"), "{}", refused.2);
}
