//! Files of a crate do not import each other in circles of more than two.
//!
//! What a file imports is read from its text: `use` declarations, paths from `crate`, `super` and `self`, and paths from a module that it
//! has imported or declares. A name that a folder's `mod.rs` only passes on counts for the file that defines it; tests do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Path of a module in its crate; empty for the root.
type Module = Vec<String>;

/// A module, and what is left of a path beyond it.
type Place = (Module, Vec<String>);

/// The files of one crate.
#[derive(Default)]
struct Files {
    /// `use` declarations, with whether they are public, and the text without them.
    all: BTreeMap<Module, (Vec<(bool, String)>, String)>,
    /// Whether a file is the face of a folder.
    faces: BTreeSet<Module>,
    /// Names that a module passes on, and from where.
    passed: BTreeMap<(Module, String), Place>,
}

/// `a::{b, c::{d, e as f}}` as `a::b`, `a::c::d`, `a::c::e`.
fn expanded(tree: &str) -> Vec<String> {
    let Some((head, rest)) = tree.split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().trim().to_owned()];
    };
    let inner = rest.rsplit_once('}').map_or(rest, |r| r.0);
    let (mut depth, mut parts) = (0, vec![String::new()]);
    for c in inner.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            parts.push(String::new());
        } else {
            parts.last_mut().unwrap().push(c);
        }
    }
    let parts = parts.iter().map(|p| p.trim()).filter(|p| !p.is_empty());
    parts.flat_map(|p| expanded(&format!("{}{p}", head.trim()))).collect()
}

/// Every `use` of a text, with whether it is public; and the text without them, comments and tests.
fn declarations(text: &str) -> (Vec<(bool, String)>, String) {
    let (mut found, mut rest) = (Vec::new(), String::new());
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let mut lines = text.lines().map(|l| l.split("//").next().unwrap().trim());
    while let Some(line) = lines.next() {
        let (public, after) = match line.strip_prefix("pub") {
            Some(r) => (true, r.strip_prefix('(').map_or(r, |r| r.split_once(')').map_or("", |x| x.1)).trim_start()),
            None => (false, line),
        };
        let Some(tree) = after.strip_prefix("use ") else {
            rest.push_str(line);
            rest.push('\n');
            continue;
        };
        let mut tree = tree.to_owned();
        while !tree.contains(';') {
            tree.push_str(lines.next().unwrap());
        }
        found.extend(expanded(tree.split(';').next().unwrap()).into_iter().map(|path| (public, path)));
    }
    (found, rest)
}

/// Paths in a text that begin with the word `first`: the words after it.
fn paths<'t>(text: &'t str, first: &'t str) -> impl Iterator<Item = Vec<String>> + 't {
    let word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(first).filter_map(move |(at, _)| {
        let before = text[..at].chars().next_back();
        let after = text[at + first.len()..].strip_prefix("::")?;
        let end = after.find(|c: char| !word(c) && c != ':').unwrap_or(after.len());
        let alone = !before.is_some_and(|c| word(c) || c == ':');
        alone.then(|| after[..end].split("::").filter(|s| !s.is_empty()).map(str::to_owned).collect())
    })
}

impl Files {
    fn read(&mut self, dir: &Path, module: &Module) {
        for entry in fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let face = ["mod", "lib", "main"].contains(&stem.as_str());
            let inner = if face { module.clone() } else { [module.as_slice(), std::slice::from_ref(&stem)].concat() };
            if path.is_dir() {
                self.read(&path, &inner);
            } else if path.extension().is_some_and(|e| e == "rs") && stem != "tests" {
                if face {
                    self.faces.insert(inner.clone());
                }
                self.all.insert(inner, declarations(&fs::read_to_string(&path).unwrap()));
            }
        }
    }
    /// Where a path leads that is written in `from`; `None` for other crates and names of the file itself.
    fn resolve(&self, from: &Module, path: &[String]) -> Option<Place> {
        let (mut at, mut rest) = (from.clone(), path);
        match rest.first()?.as_str() {
            "crate" => (at, rest) = (Vec::new(), &rest[1..]),
            "self" => rest = &rest[1..],
            "super" => {
                while rest.first().is_some_and(|s| s == "super") {
                    at.pop();
                    rest = &rest[1..];
                }
            }
            first => {
                self.all.get(&[at.as_slice(), &[first.to_owned()]].concat())?;
            }
        }
        while let Some(next) = rest.first().map(|s| [at.as_slice(), std::slice::from_ref(s)].concat()) {
            if !self.all.contains_key(&next) {
                break;
            }
            (at, rest) = (next, &rest[1..]);
        }
        Some((at, rest.to_vec()))
    }
    /// The file that defines what is passed on.
    fn defining(&self, mut place: Place) -> Place {
        for _ in 0..8 {
            let Some(name) = place.1.first() else { break };
            let Some((module, rest)) = self.passed.get(&(place.0.clone(), name.clone())) else { break };
            if *module == place.0 {
                break;
            }
            place = (module.clone(), [rest.as_slice(), &place.1[1..]].concat());
        }
        place
    }
    /// What each file imports.
    fn edges(&mut self) -> BTreeMap<Module, BTreeSet<Module>> {
        let split = |path: &str| path.split("::").map(str::to_owned).collect::<Vec<_>>();
        let mut passed = BTreeMap::new();
        for (from, (uses, _)) in &self.all {
            for (_, path) in uses.iter().filter(|u| u.0) {
                let Some((module, rest)) = self.resolve(from, &split(path)) else { continue };
                if let Some(name) = rest.first().or(module.last()) {
                    passed.insert((from.clone(), name.clone()), (module.clone(), rest.clone()));
                }
            }
        }
        self.passed = passed;
        let mut edges = BTreeMap::new();
        for (from, (uses, text)) in &self.all {
            let to: &mut BTreeSet<Module> = edges.entry(from.clone()).or_default();
            let mut modules = BTreeMap::new();
            for (public, path) in uses {
                let Some(place) = self.resolve(from, &split(path)).map(|p| self.defining(p)) else { continue };
                if place.1.is_empty() {
                    modules.extend(place.0.last().map(|name| (name.clone(), place.0.clone())));
                } else if !(*public && self.faces.contains(from)) {
                    to.insert(place.0);
                }
            }
            let children = self.all.keys().filter(|m| m.len() == from.len() + 1 && m.starts_with(from));
            if self.faces.contains(from) && !from.is_empty() {
                modules.extend(children.map(|m| (m.last().unwrap().clone(), m.clone())));
            }
            for (name, module) in &modules {
                let found = paths(text, name).filter(|p| !p.is_empty());
                to.extend(found.filter_map(|p| {
                    let inner = self.resolve(module, &[&["self".to_owned()], p.as_slice()].concat())?;
                    Some(self.defining(inner).0)
                }));
            }
            for first in ["crate", "super", "self"] {
                let found = paths(text, first).map(|p| [&[first.to_owned()], p.as_slice()].concat());
                let found = found.filter_map(|p| self.resolve(from, &p)).filter(|p| !p.1.is_empty());
                to.extend(found.map(|p| self.defining(p).0));
            }
            to.remove(from);
            to.retain(|m| self.all.contains_key(m));
        }
        edges
    }
}

/// Files that can reach each other.
fn circles(edges: &BTreeMap<Module, BTreeSet<Module>>) -> BTreeSet<BTreeSet<&Module>> {
    let reach = |from| {
        let (mut seen, mut todo) = (BTreeSet::new(), vec![from]);
        while let Some(at) = todo.pop() {
            todo.extend(edges[at].iter().filter(|&m| seen.insert(m)));
        }
        seen
    };
    let all: BTreeMap<&Module, BTreeSet<&Module>> = edges.keys().map(|m| (m, reach(m))).collect();
    let circle = |m: &Module| all[m].iter().copied().filter(|n| all[n].contains(m)).collect::<BTreeSet<_>>();
    edges.keys().map(circle).filter(|c| c.len() > 1).collect()
}

/// Circles of more than two files, in words.
fn long_circles(files: &mut Files) -> Vec<String> {
    let edges = files.edges();
    let names = |c: BTreeSet<&Module>| {
        let arrows = c.iter().flat_map(|&m| edges[m].iter().filter(|n| c.contains(n)).map(move |n| (m, n)));
        arrows.map(|(m, n)| format!("{} -> {}", m.join("/"), n.join("/"))).collect::<Vec<_>>().join("\n  ")
    };
    circles(&edges).into_iter().filter(|c| c.len() > 2).map(names).collect()
}

#[test]
fn no_circle_of_more_than_two_files() {
    let root = xtask::workspace::root().unwrap();
    let mut folders: Vec<_> = fs::read_dir(root.join("crates")).unwrap().map(|e| e.unwrap().path()).collect();
    folders.extend([root.join("xtask"), root.join("xtask/launcher")]);
    folders.sort();
    let mut found = Vec::new();
    for folder in folders.iter().filter(|f| f.join("src").is_dir()) {
        let mut files = Files::default();
        files.read(&folder.join("src"), &Vec::new());
        found.extend(long_circles(&mut files).into_iter().map(|c| format!("{}:\n  {c}", folder.display())));
    }
    assert!(found.is_empty(), "files in a circle:\n{}", found.join("\n"));
}

/// The reader sees a circle through names that a folder passes on.
#[test]
fn a_circle_is_found() {
    let mut files = Files::default();
    let module = |path: &str| path.split('/').filter(|s| !s.is_empty()).map(str::to_owned).collect::<Module>();
    for (path, text) in [
        ("", "mod shape;\nmod page;\n"),
        ("shape", "mod ball;\nmod edge;\npub use ball::{\n    Ball,\n    size,\n};\n"),
        ("shape/ball", "use super::edge;\npub fn size() { edge::length() } // crate::page::nothing\n"),
        ("shape/edge", "pub fn length() { crate::page::width() }\n"),
        ("page", "use crate::shape::{size as large, Ball};\n#[cfg(test)]\nmod tests {\n    use crate::nothing;\n}\n"),
    ] {
        files.all.insert(module(path), declarations(text));
    }
    files.faces.extend([module(""), module("shape")]);
    let found = long_circles(&mut files);
    assert_eq!(found, ["page -> shape/ball\n  shape/ball -> shape/edge\n  shape/edge -> page"]);
}
