//! The documentation holds together: links lead somewhere, and the book lists every page.

// Helpers of an integration test are test code, which clippy does not see.

use std::fs;
use std::path::{Path, PathBuf};

/// Every Markdown file of the project's own prose.
fn pages(root: &Path) -> Vec<PathBuf> {
    let mut out: Vec<PathBuf> = fs::read_dir(root).unwrap().map(|e| e.unwrap().path()).collect();
    let mut todo = vec![root.join("docs")];
    while let Some(dir) = todo.pop() {
        for entry in fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { todo.push(path) } else { out.push(path) }
        }
    }
    out.push(root.join("fixtures/README.md"));
    out.retain(|p| p.extension().is_some_and(|e| e == "md"));
    out.sort();
    out
}

/// Targets of `[text](target)` outside formulas, without web addresses and anchors.
fn links(text: &str) -> Vec<String> {
    let prose: String = text.split('$').step_by(2).collect();
    prose
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split([')', '#']).next())
        .filter(|t| !t.is_empty() && !t.starts_with("http"))
        .map(str::to_owned)
        .collect()
}

#[test]
fn relative_links_lead_somewhere() {
    let root = xtask::workspace::root().unwrap();
    let mut broken = Vec::new();
    for page in pages(&root) {
        for target in links(&fs::read_to_string(&page).unwrap()) {
            if !page.parent().unwrap().join(&target).exists() {
                broken.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "broken links:\n{}", broken.join("\n"));
}

/// mdBook copies `docs` and nothing above it: a link out of it leads nowhere on a shelf of books.
#[test]
fn pages_of_the_book_link_to_what_is_in_it() {
    let docs = xtask::workspace::root().unwrap().join("docs");
    for page in pages(docs.parent().unwrap()).iter().filter(|p| p.starts_with(&docs)) {
        for target in links(&fs::read_to_string(page).unwrap()) {
            let at = page.parent().unwrap().join(&target);
            let inside = at.canonicalize().unwrap().starts_with(docs.canonicalize().unwrap());
            assert!(inside, "{}: {target} is not in the book; name it as code", page.display());
            // Pages README.md become index.html, but not in links to them.
            let readme = target.ends_with("/README.md") && !page.ends_with("SUMMARY.md");
            assert!(!readme, "{}: link to the folder of {target}", page.display());
        }
    }
}

/// The anchor of a heading, as GitHub and mdBook make it.
fn anchor(heading: &str) -> String {
    let plain = heading.trim().to_lowercase();
    let kept = plain.chars().filter(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | ' '));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn links_into_pages_lead_to_headings() {
    let root = xtask::workspace::root().unwrap();
    let mut broken = Vec::new();
    for page in pages(&root) {
        let text = fs::read_to_string(&page).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let Some((file, wanted)) = target.split_once('#') else { continue };
            if file.starts_with("http") || !(file.is_empty() || file.ends_with(".md")) {
                continue;
            }
            let file = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            // What is missing altogether is said elsewhere.
            let Ok(text) = fs::read_to_string(&file) else { continue };
            // Every second part is a block of code.
            let prose = text.split("```").step_by(2).flat_map(str::lines);
            let mut headings = prose.filter(|l| l.starts_with('#')).map(|l| anchor(l.trim_start_matches('#')));
            if headings.all(|h| h != wanted) {
                broken.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "no such headings:\n{}", broken.join("\n"));
}

#[test]
fn the_book_lists_every_page() {
    let docs = xtask::workspace::root().unwrap().join("docs");
    let listed = links(&fs::read_to_string(docs.join("SUMMARY.md")).unwrap());
    for page in pages(docs.parent().unwrap()) {
        let Ok(relative) = page.strip_prefix(&docs) else { continue };
        let name = relative.to_str().unwrap().replace('\\', "/");
        assert!(name == "SUMMARY.md" || listed.contains(&name), "docs/SUMMARY.md does not list {name}");
    }
}

/// An odd number of dollar signs turns the rest of a page into a formula.
#[test]
fn formulas_are_closed() {
    for page in pages(&xtask::workspace::root().unwrap()) {
        let text = fs::read_to_string(&page).unwrap();
        assert_eq!(text.matches("$$").count() % 2, 0, "{}: display formula left open", page.display());
        for paragraph in text.replace("$$", "").split("\n\n") {
            assert_eq!(paragraph.matches('$').count() % 2, 0, "{}: formula left open in: {paragraph}", page.display());
        }
    }
}

/// Scripts of others are those that `vendor.sh` fetched: nobody has edited them here.
#[test]
fn vendored_scripts_are_what_was_fetched() {
    use sha2::{Digest, Sha256};
    let folder = xtask::workspace::root().unwrap().join("crates/ff-report/assets/vendor");
    let sums = fs::read_to_string(folder.join("SHA256SUMS")).unwrap();
    assert_eq!(sums.lines().count(), 4);
    for line in sums.lines() {
        let (sum, name) = line.split_once("  ").unwrap();
        let own: String =
            Sha256::digest(fs::read(folder.join(name)).unwrap()).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(own, sum, "{name}; run vendor.sh again");
    }
}
