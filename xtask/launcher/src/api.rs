//! `cargo xtask api`: the public names of every crate, one file each in `docs/api`.
//!
//! What rustdoc lists is what a user can name: items by path, re-exports, and below each item its fields, variants, inherent methods and,
//! of a trait, what it demands and provides. Read from the pages that the stable `cargo doc` writes, because rustdoc's JSON needs a
//! nightly compiler. The files are kept under version control, so that a change of the public interface shows in review;
//! `--check` fails when they differ. Signatures are not compared.

use crate::failure::Failure;
use crate::{process, workspace};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Writes the lists, or with `check` compares them.
///
/// # Errors
/// [`Failure::Differs`] (15) with every name that was added or removed, [`Failure::Child`] of `cargo doc`, [`Failure::Io`].
pub fn run(check: bool) -> Result<(), Failure> {
    let root = workspace::root()?;
    process::run(&root, &process::cargo(), &["doc", "--workspace", "--no-deps", "--locked"])?;
    let docs = target(&root).join("doc");
    let folder = root.join("docs").join("api");
    fs::create_dir_all(&folder).map_err(|e| Failure::io("create", &folder, e))?;
    let (mut different, mut sum, mut files) = (Vec::new(), 0, BTreeSet::new());
    for name in libraries(&root.join("crates"))? {
        let names = public_names(&docs.join(name.replace('-', "_")))?;
        let file = folder.join(format!("{name}.txt"));
        println!("{name}: {} public names", names.len());
        sum += names.len();
        files.insert(format!("{name}.txt"));
        if check {
            let recorded = fs::read_to_string(&file).map_err(|e| Failure::io("read", &file, e))?;
            let recorded: BTreeSet<String> = recorded.lines().map(str::to_owned).collect();
            different.extend(recorded.difference(&names).map(|n| format!("  {name}: removed {n}")));
            different.extend(names.difference(&recorded).map(|n| format!("  {name}: added {n}")));
        } else {
            let text: String = names.iter().map(|n| format!("{n}\n")).collect();
            fs::write(&file, text).map_err(|e| Failure::io("write", &file, e))?;
        }
    }
    // Lists of crates that are gone.
    for entry in fs::read_dir(&folder).map_err(|e| Failure::io("list", &folder, e))? {
        let entry = entry.map_err(|e| Failure::io("list", &folder, e))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !files.contains(&name) {
            if check {
                different.push(format!("  {name}: no such crate"));
            } else {
                fs::remove_file(entry.path()).map_err(|e| Failure::io("remove", &entry.path(), e))?;
            }
        }
    }
    println!("{} crates, {sum} public names", files.len());
    if different.is_empty() {
        return Ok(());
    }
    Err(Failure::Differs(format!(
        "public names differ from docs/api:\n{}\nrecord a wanted change with `cargo xtask api`",
        different.join("\n")
    )))
}

fn target(root: &Path) -> std::path::PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), Into::into)
}

/// Published library crates below a folder, by name.
fn libraries(crates: &Path) -> Result<Vec<String>, Failure> {
    let mut out = Vec::new();
    for entry in fs::read_dir(crates).map_err(|e| Failure::io("list", crates, e))? {
        let dir = entry.map_err(|e| Failure::io("list", crates, e))?.path();
        let manifest = dir.join("Cargo.toml");
        if !dir.join("src/lib.rs").is_file() || !manifest.is_file() {
            continue;
        }
        let text = fs::read_to_string(&manifest).map_err(|e| Failure::io("read", &manifest, e))?;
        if !text.lines().any(|l| l.replace(' ', "") == "publish=false") {
            out.extend(dir.file_name().map(|n| n.to_string_lossy().into_owned()));
        }
    }
    out.sort();
    Ok(out)
}

/// Names in the documentation of one crate: `struct motion::Spline`, `struct motion::Spline field knots`.
fn public_names(docs: &Path) -> Result<BTreeSet<String>, Failure> {
    let read = |path: &Path| fs::read_to_string(path).map_err(|e| Failure::io("read", path, e));
    let mut out = BTreeSet::new();
    for (kind, name, href) in items(&read(&docs.join("all.html"))?) {
        let item = format!("{kind} {name}");
        for member in members(&read(&docs.join(&href))?) {
            out.insert(format!("{item} {member}"));
        }
        out.insert(item);
    }
    // Modules and what they re-export.
    let mut todo = vec![(docs.to_owned(), String::new())];
    while let Some((dir, path)) = todo.pop() {
        let page = dir.join("index.html");
        if page.is_file() {
            let prefix = if path.is_empty() { String::new() } else { format!("{path}::") };
            out.extend(ids(&read(&page)?, "reexport.").into_iter().map(|n| format!("use {prefix}{n}")));
            if !path.is_empty() {
                out.insert(format!("mod {path}"));
            }
            for entry in fs::read_dir(&dir).map_err(|e| Failure::io("list", &dir, e))? {
                let below = entry.map_err(|e| Failure::io("list", &dir, e))?.path();
                if below.is_dir() {
                    let name = below.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    todo.push((below, format!("{prefix}{name}")));
                }
            }
        }
    }
    Ok(out)
}

/// Kind, path and page of every item on `all.html`.
fn items(page: &str) -> Vec<(String, String, String)> {
    let list = page.split("<h1>List of all items").nth(1).unwrap_or(page);
    let entry = |rest: &str| {
        let (href, rest) = rest.split_once('"')?;
        let (_, rest) = rest.split_once('>')?;
        let (name, _) = rest.split_once("</a>")?;
        let (kind, _) = href.rsplit('/').next()?.split_once('.')?;
        href.ends_with(".html").then(|| (kind.to_owned(), name.to_owned(), href.to_owned()))
    };
    list.split("<li><a href=\"").skip(1).filter_map(entry).collect()
}

/// What belongs to an item, from its page: not what traits that it implements give it.
fn members(page: &str) -> BTreeSet<String> {
    let end = [
        "id=\"trait-implementations\"",
        "id=\"deref-methods",
        "id=\"synthetic-implementations\"",
        "id=\"foreign-impls\"",
        "id=\"implementors\"",
    ];
    // The side bar names members, too, but by href.
    let own = end.iter().filter_map(|e| page.find(e)).min().map_or(page, |k| &page[..k]);
    let mut out = BTreeSet::new();
    for (id, what) in [
        ("structfield.", "field"),
        ("variant.", "variant"),
        ("tymethod.", "demands"),
        ("method.", "method"),
        ("associatedconstant.", "constant"),
        ("associatedtype.", "type"),
    ] {
        out.extend(ids(own, id).into_iter().map(|n| format!("{what} {n}")));
    }
    out
}

/// Anchors of a page that begin with `prefix`, without it. Rustdoc numbers methods of the same name in several `impl` blocks (`new-1`).
fn ids(page: &str, prefix: &str) -> BTreeSet<String> {
    let start = format!("id=\"{prefix}");
    let name = |rest: &str| rest.split('"').next().map(|n| n.split('-').next().unwrap_or(n).to_owned());
    page.split(start.as_str()).skip(1).filter_map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(dir: &Path, name: &str, text: &str) {
        let path = dir.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn names_are_read_from_the_pages() {
        let dir = tempfile::tempdir().unwrap();
        let d = dir.path();
        page(
            d,
            "all.html",
            "<nav><li><a href=\"#structs\">Structs</a></li></nav><h1>List of all items</h1><ul class=\"all-items\">\
             <li><a href=\"motion/struct.Spline.html\">motion::Spline</a></li><li><a href=\"trait.Cost.html\">Cost</a></li></ul>",
        );
        page(d, "index.html", "<dt id=\"reexport.Spline\"><code>pub use motion::<a>Spline</a></code></dt>");
        page(d, "motion/index.html", "");
        page(
            d,
            "motion/struct.Spline.html",
            "<a href=\"#method.clone\">clone</a><span id=\"structfield.knots\"></span><section id=\"method.new\"></section>\
             <section id=\"method.new-1\"></section><h2 id=\"trait-implementations\"></h2><section id=\"method.clone\"></section>",
        );
        page(
            d,
            "trait.Cost.html",
            "<section id=\"tymethod.value\"></section><section id=\"method.slope\"></section><h2 id=\"implementors\"></h2>\
             <section id=\"method.other\"></section>",
        );
        let want = [
            "mod motion",
            "struct motion::Spline",
            "struct motion::Spline field knots",
            "struct motion::Spline method new",
            "trait Cost",
            "trait Cost demands value",
            "trait Cost method slope",
            "use Spline",
        ];
        assert_eq!(public_names(d).unwrap().into_iter().collect::<Vec<_>>(), want);
    }

    #[test]
    fn unpublished_crates_have_no_list() {
        let dir = tempfile::tempdir().unwrap();
        for (name, manifest) in [("a", "[package]"), ("b", "[package]\npublish = false")] {
            page(dir.path(), &format!("{name}/Cargo.toml"), manifest);
            page(dir.path(), &format!("{name}/src/lib.rs"), "");
        }
        page(dir.path(), "c/Cargo.toml", "[package]");
        assert_eq!(libraries(dir.path()).unwrap(), ["a"]);
    }
}
