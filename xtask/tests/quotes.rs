//! What `docs/command.md` quotes is what the command prints.

use std::fs;

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
    let block = block.unwrap_or_else(|| panic!("docs/command.md quotes nothing that begins with '{first}'"));
    block.split("```").next().unwrap().lines().filter(|l| !["", "..."].contains(&l.trim())).collect()
}

/// Numbers of the last printed digit may differ between machines; rounding errors (below 1e-6) are not compared.
fn same(quoted: &str, printed: &str) -> bool {
    let words = |l: &str| l.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let (q, p) = (words(quoted), words(printed));
    q.len() == p.len()
        && q.iter().zip(&p).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(x), Ok(y)) => (x - y).abs() <= 2e-3 * x.abs().max(y.abs()) || x.abs().max(y.abs()) < 1e-6,
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
        let mut printed = text.lines();
        for line in quotation(&page, first) {
            assert!(
                printed.any(|p| same(line, p)),
                "{args:?} does not print, or not in this order:\n{line}\nbut\n{text}"
            );
        }
    }
}
