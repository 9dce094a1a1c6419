//! `cargo xtask bench --instructions`: how many instructions a call takes, by callgrind.
//!
//! A count shows a regression on a machine whose clock is shared or throttled. Each function runs `N` and `2 N` times;
//! the difference over `N` is one call, because start-up cancels. Counts are kept in `crates/ff-bench/instructions.json`.

use super::build;
use super::options::Args;
use crate::table::Table;
use ffid::exit::Failure;
use ffid::files::atomic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

/// What is kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// Compiler the counts were taken with; another one gives other counts.
    pub rustc: String,
    /// Instructions per state, or sample of a record, by `model.function.form.isa`.
    pub instructions: BTreeMap<String, f64>,
}

/// A count may exceed the kept one by this factor.
const TOLERANCE: f64 = 1.03;
/// Calls whose cost is the difference; a whole number of rounds over the 64 states, whatever the lanes.
const CALLS: u64 = 256;

/// What is counted: model, form, function, lanes, instruction set.
const COUNTED: [(&str, &str, &str, u32, &str); 19] = [
    ("rigid", "ports", "rnea", 1, "portable"),
    ("flex", "ports", "rnea", 1, "portable"),
    ("flex", "ports", "crba", 1, "portable"),
    ("flex", "ports", "fd", 1, "portable"),
    ("flex", "ports", "hybrid", 1, "portable"),
    ("flex", "ports", "regressor", 1, "portable"),
    ("flex", "tree", "rnea", 1, "portable"),
    ("flex", "tree", "fd", 1, "portable"),
    ("slosh", "ports", "rnea", 1, "portable"),
    ("slosh", "ports", "fd", 1, "portable"),
    ("slosh", "ports", "hybrid", 1, "portable"),
    ("slosh", "ports", "regressor", 1, "portable"),
    ("flex", "ports", "id_derivatives", 1, "portable"),
    // Lanes: valgrind 3.19 knows no AVX-512.
    ("flex", "ports", "rnea", 4, "v3"),
    ("flex", "ports", "crba", 4, "v3"),
    ("flex", "ports", "fd", 4, "v3"),
    ("flex", "ports", "hybrid", 4, "v3"),
    ("flex", "ports", "regressor", 4, "v3"),
    ("flex", "ports", "id_derivatives", 4, "v3"),
];

/// Sensitivities of the 58 parameters of `flex`, per sample and step of 10 ms, in lanes as above.
const SENSITIVITIES: &str = "flex.sensitivities58.x4.ports.v3";

/// Counts, compares, and keeps if asked to.
///
/// # Errors
/// [`Failure::Tolerance`] when a count is above its kept one by more than 3 %, [`Failure::Io`] without valgrind.
pub fn run(root: &Path, args: &Args) -> anyhow::Result<()> {
    let valgrind = find_valgrind()?;
    let program = build::ff_bench(root, build::Target::Portable)?;
    let path = root.join("crates/ff-bench/instructions.json");
    let kept = read(&path)?;
    let mut now = Kept { rustc: rustc(root)?, ..Kept::default() };
    // `command` is what runs so many calls; each is of `states`.
    let mut count = |name: String, states: u32, command: &dyn Fn(u64) -> String| -> Result<(), Failure> {
        if !name.contains(&args.only) {
            return Ok(());
        }
        let taken = |n: u64| collected(&valgrind, &program, &command(n).split(' ').collect::<Vec<_>>());
        let (once, twice) = (taken(CALLS)?, taken(2 * CALLS)?);
        let per_state = (twice as f64 - once as f64) / (CALLS * u64::from(states)) as f64;
        eprintln!("{name}: {per_state:.1}");
        now.instructions.insert(name, (10.0 * per_state).round() / 10.0);
        Ok(())
    };
    for (model, form, function, lanes, isa) in COUNTED {
        let suffix = if lanes == 1 { String::new() } else { format!(".x{lanes}") };
        count(format!("{model}.{function}{suffix}.{form}.{isa}"), lanes, &|calls| {
            let what = format!("--model {model} --form {form} --function {function}");
            format!("count {what} --lanes {lanes} --isa {isa} --calls {calls}")
        })?;
    }
    // A call is a sample of the record, and a step.
    count(SENSITIVITIES.into(), 1, &|samples| format!("sensitivities --once v3 --seconds {}", 0.01 * samples as f64))?;
    println!("{}", table(&kept, &now));
    if args.keep {
        let mut all = kept.instructions;
        all.extend(now.instructions);
        let mut bytes = serde_json::to_vec_pretty(&Kept { rustc: now.rustc, instructions: all })?;
        bytes.push(b'\n');
        return Ok(atomic::write(&path, &bytes)?);
    }
    let above = above(&kept, &now);
    if above.is_empty() {
        return Ok(());
    }
    let advice = "make it cheaper again, or keep the new count with `cargo xtask bench --instructions --keep`";
    Err(Failure::Tolerance(format!("more instructions than kept: {}; {advice}", above.join(", "))).into())
}

/// Counts above what is kept, in words.
fn above(kept: &Kept, now: &Kept) -> Vec<String> {
    let worse = |(name, &n): (&String, &f64)| {
        let &k = kept.instructions.get(name)?;
        (n > TOLERANCE * k).then(|| format!("{name} {n:.0} instead of {k:.0} ({:+.1} %)", 100.0 * (n / k - 1.0)))
    };
    now.instructions.iter().filter_map(worse).collect()
}

fn table(kept: &Kept, now: &Kept) -> Table {
    let mut t = Table::new("Instructions per state or sample (callgrind)", &["", "now", "kept", "change"]);
    for (name, n) in &now.instructions {
        let (k, change) = match kept.instructions.get(name) {
            Some(k) => (format!("{k:.0}"), format!("{:+.1} %", 100.0 * (n / k - 1.0))),
            None => ("-".into(), "new".into()),
        };
        t.row([name.clone(), format!("{n:.0}"), k, change]);
    }
    if !kept.rustc.is_empty() && kept.rustc != now.rustc {
        t.note(format!("Kept with {}, now {}: part of a change may be the compiler's.", kept.rustc, now.rustc));
    }
    t
}

fn read(path: &Path) -> Result<Kept, Failure> {
    match std::fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(|e| Failure::io("read", path, e.into())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Kept::default()),
        Err(e) => Err(Failure::io("read", path, e)),
    }
}

fn find_valgrind() -> Result<String, Failure> {
    let found = Command::new("valgrind").arg("--version").stdout(Stdio::null()).status().is_ok_and(|s| s.success());
    if found {
        return Ok("valgrind".into());
    }
    let how = "not on the path; install it, for instance with `apt-get install valgrind`";
    Err(Failure::io("start", Path::new("valgrind"), std::io::Error::new(std::io::ErrorKind::NotFound, how)))
}

fn rustc(root: &Path) -> Result<String, Failure> {
    let program = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let out = Command::new(&program)
        .arg("--version")
        .current_dir(root)
        .output()
        .map_err(|e| Failure::io("start", Path::new(&program), e))?;
    Ok(String::from_utf8_lossy(&out.stdout).trim().to_owned())
}

/// Instructions of one run of `program`.
fn collected(valgrind: &str, program: &Path, args: &[&str]) -> Result<u64, Failure> {
    let own = ["--tool=callgrind", "--callgrind-out-file=/dev/null"];
    let out = Command::new(valgrind)
        .args(own)
        .arg(program)
        .args(args)
        .output()
        .map_err(|e| Failure::io("start", Path::new(valgrind), e))?;
    let said = String::from_utf8_lossy(&out.stderr);
    if !out.status.success() {
        eprint!("{said}");
        let command = format!("{valgrind} {} {} {}", own.join(" "), program.display(), args.join(" "));
        return Err(Failure::Child { command, status: out.status.to_string(), code: out.status.code() });
    }
    total(&said).ok_or_else(|| Failure::Numerical(format!("callgrind printed no `Collected` line, but: {said}")))
}

/// The number after `Collected :`.
fn total(said: &str) -> Option<u64> {
    let line = said.lines().find(|l| l.contains("Collected"))?;
    line.rsplit(':').next()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(rustc: &str, n: &[(&str, f64)]) -> Kept {
        let instructions = n.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
        Kept { rustc: rustc.into(), instructions }
    }

    #[test]
    fn callgrinds_total_is_read() {
        let said = "==7== Callgrind, a call-graph\n==7== Events    : Ir\n==7== Collected : 8123456\n==7==\n";
        assert_eq!(total(said), Some(8_123_456));
        assert_eq!(total("valgrind: no such file"), None);
    }

    #[test]
    fn only_more_than_three_percent_above_is_a_failure() {
        let kept = counts("rustc 1.95", &[("flex.rnea", 5000.0), ("flex.fd", 9000.0)]);
        let now = counts("rustc 1.96", &[("flex.rnea", 5149.0), ("flex.fd", 7000.0), ("flex.new", 1.0)]);
        assert!(above(&kept, &now).is_empty());
        let text = table(&kept, &now).to_string();
        assert!(text.contains("+3.0 %") && text.contains("new") && text.contains("compiler"), "{text}");
        let worse = above(&kept, &counts("", &[("flex.rnea", 5151.0)]));
        assert_eq!(worse, ["flex.rnea 5151 instead of 5000 (+3.0 %)"]);
    }
}
