//! What `docs/command.md`, `docs/reproduction.md` and the README quote is what the commands print.

use std::fs;
use std::process::Command;

/// Commands that answer within a second, each with the first line of its quotation.
const QUOTED: [(&[&str], &str); 4] = [
    (&["check", "fixtures/paper/flex.toml"], "paper: floating base, 792.000 kg"),
    (&["check", "fixtures/bad/several.toml"], "fixtures/bad/several.toml:3:1: error"),
    (&["modes", "fixtures/paper/slosh.toml"], "modes (2), joints held"),
    (&["selfcheck", "fixtures/paper/slosh.toml"], "paper: 8 s, joints by 0.3"),
];

/// The quotation that begins with `first`, without the lines that stand for others.
fn quotation<'t>(page: &'t str, first: &str) -> Vec<&'t str> {
    let block = page.split("```text\n").skip(1).find(|b| b.starts_with(first));
    let block = block.unwrap_or_else(|| panic!("the page quotes nothing that begins with '{first}'"));
    block.split("```").next().unwrap().lines().filter(|l| !["", "..."].contains(&l.trim())).collect()
}

/// Numbers of the last printed digit may differ between machines; rounding errors (below 1e-6), and what is divided by one (above 1e6),
/// are not compared.
fn same(quoted: &str, printed: &str) -> bool {
    let words = |l: &str| l.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let (q, p) = (words(quoted), words(printed));
    q.len() == p.len()
        && q.iter().zip(&p).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(x), Ok(y)) => {
                (x - y).abs() <= 1e-2 * x.abs().max(y.abs())
                    || x.abs().max(y.abs()) < 1e-6
                    || x.abs().min(y.abs()) > 1e6
            }
            _ => a == b,
        })
}

#[test]
fn quotations_of_commands_are_what_they_print() {
    let root = xtask::workspace::root().unwrap();
    let page = fs::read_to_string(root.join("docs/command.md")).unwrap();
    for (args, first) in QUOTED {
        let full: Vec<String> = args
            .iter()
            .map(|a| if a.starts_with("fixtures/") { root.join(a).display().to_string() } else { (*a).to_owned() })
            .collect();
        let (mut out, mut err) = (Vec::new(), Vec::new());
        ffid_cli::run(std::iter::once("ffid".to_owned()).chain(full), &mut out, &mut err);
        let text = String::from_utf8_lossy(&out).into_owned() + &String::from_utf8_lossy(&err);
        let text = text.replace(&format!("{}/", root.display()), "");
        in_order(&quotation(&page, first), &text);
    }
}

/// The lines stand in what was printed, one after the other.
fn in_order(lines: &[&str], text: &str) {
    let mut printed = text.lines();
    for line in lines {
        assert!(printed.any(|p| same(line, p)), "not printed, or not in this order:\n{line}\nbut\n{text}");
    }
}

/// Rows of tables II and III as `docs/reproduction.md` has them: names written out, without the paper's numbers, which the noisy rows lack.
fn rows<'t>(lines: impl Iterator<Item = &'t str>) -> Vec<String> {
    let row = |line: &str| {
        let words: Vec<&str> = line.split(['|', ' ']).filter(|w| !w.is_empty()).collect();
        let at = words.iter().position(|w| ["mean", "max"].contains(w))?;
        let what = words.get(at + 1)?.replace("position", "pos");
        let known = ["pos", "rpy", "angle"].contains(&what.as_str()) && words.len() >= at + 8;
        known.then(|| format!("{} {what} {}", words[at], words[words.len() - 5..].join(" ")))
    };
    lines.filter_map(row).collect()
}

#[test]
#[ignore = "full tier: 180 s"]
fn quotations_of_the_reproduction_are_what_it_prints() {
    let root = xtask::workspace::root().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_xtask")).arg("reproduce").arg("--out").arg(dir.path()).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8_lossy(&out.stdout);
    in_order(&quotation(&fs::read_to_string(root.join("README.md")).unwrap(), "Table II: "), &text);
    let page = fs::read_to_string(root.join("docs/reproduction.md")).unwrap();
    let (quoted, printed) = (rows(page.lines()), rows(text.lines()));
    assert_eq!(printed.len(), 24, "{text}");
    for line in &printed {
        let same = quoted.iter().any(|q| same(q, line));
        assert!(same, "docs/reproduction.md has no row\n{line}\nbut\n{}", quoted.join("\n"));
    }
}
