//! Is it one tree? Names, ends of joints, parents, cycles, roots.

use super::raw::RawRobot;
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::{Area, Problem, Problems};
use std::collections::{BinaryHeap, HashMap};

/// A checked tree over link and joint indices.
#[derive(Debug)]
pub(super) struct Tree {
    /// The one link without a parent.
    pub(super) root: usize,
    /// Joint that carries each link; `None` for the root.
    pub(super) carrier: Vec<Option<usize>>,
    /// Parent link of each joint.
    pub(super) parent: Vec<usize>,
    /// Child link of each joint.
    pub(super) child: Vec<usize>,
    /// Joints with parents before children, otherwise in the order of the file.
    pub(super) order: Vec<usize>,
}

fn err(code: &'static str, message: String) -> Problem {
    Problem::error(Area::Model, code, message)
}

/// Checks the graph; `None` when it is not a tree (problems say why).
pub(super) fn tree(r: &RawRobot, out: &mut Problems) -> Option<Tree> {
    let before = out.0.len();
    let links = unique("link", r.links.iter().map(|l| (l.name.as_str(), l.line)), out);
    unique("joint", r.joints.iter().map(|j| (j.name.as_str(), j.line)), out);

    let distinct = out.0.len() == before;
    let mut suggestions = 0;
    let mut end = |joint: &str, (link, line): &(String, usize)| match links.get(link.as_str()) {
        Some(&i) => Some(i),
        // A missing or empty attribute has been reported by the strict pass already.
        None if link.is_empty() => None,
        None => {
            let p = err("Urdf::UnknownLink", format!("names link '{}', which does not exist", clip(link)));
            let p = p.at_line(*line).on(format!("joint {joint}"));
            // Comparing every wrong name with every link would take minutes on a large broken file.
            suggestions += 1;
            let names = r.links.iter().map(|l| l.name.as_str()).take(if suggestions > 20 { 0 } else { usize::MAX });
            out.push(match nearest(link, names) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint(format!("links: {}", list(r.links.iter().map(|l| l.name.as_str()), 8))),
            });
            None
        }
    };
    let ends: Vec<_> = r.joints.iter().map(|j| (end(&j.name, &j.parent), end(&j.name, &j.child))).collect();

    let mut carrier: Vec<Option<usize>> = vec![None; r.links.len()];
    let mut extra: HashMap<usize, Vec<usize>> = HashMap::new();
    for (j, &(_, child)) in ends.iter().enumerate() {
        let Some(c) = child else { continue };
        match carrier[c] {
            None => carrier[c] = Some(j),
            Some(first) => extra.entry(c).or_insert_with(|| vec![first]).push(j),
        }
    }
    let mut extra: Vec<_> = extra.into_iter().collect();
    extra.sort_unstable();
    for (c, joints) in extra {
        let names = joints.iter().map(|&j| r.joints[j].name.as_str());
        let lines = joints.iter().map(|&j| r.joints[j].line.to_string()).collect::<Vec<_>>();
        out.push(
            err("Urdf::TwoParents", format!("is the child of joints {} (lines {})", list(names, 6), lines.join(", ")))
                .at_line(r.joints[joints[1]].line)
                .on(format!("link {}", r.links[c].name))
                .hint("a link hangs on one joint; closed loops are not supported"),
        );
    }
    cycles(r, &ends, &carrier, out);
    let roots: Vec<usize> = (0..r.links.len()).filter(|&i| carrier[i].is_none()).collect();
    // With an unknown or doubled name the links below look like roots: one mistake, one message.
    if roots.len() > 1 && distinct && ends.iter().all(|e| e.0.is_some() && e.1.is_some()) {
        let names = list(roots.iter().map(|&i| r.links[i].name.as_str()), 8);
        out.push(
            err("Urdf::MultipleRoots", format!("{} links have no parent: {names}; limit 1", roots.len()))
                .at_line(r.links[roots[1]].line)
                .on("robot")
                .hint("connect them with joints, or remove the unused"),
        );
    }
    if out.0.len() > before || roots.len() != 1 {
        return None;
    }
    let parent = ends.iter().map(|e| e.0).collect::<Option<Vec<_>>>()?;
    let child = ends.iter().map(|e| e.1).collect::<Option<Vec<_>>>()?;
    let order = order(&parent, &child, roots[0], r.links.len());
    Some(Tree { root: roots[0], carrier, parent, child, order })
}

/// Index of each name; a name given twice is reported with both lines.
fn unique<'r>(
    kind: &str,
    names: impl Iterator<Item = (&'r str, usize)>,
    out: &mut Problems,
) -> HashMap<&'r str, usize> {
    let mut seen: HashMap<&str, (usize, usize)> = HashMap::new();
    for (i, (name, line)) in names.enumerate() {
        if name.is_empty() {
            continue;
        }
        match seen.get(name) {
            None => {
                seen.insert(name, (i, line));
            }
            Some(&(_, first)) => out.push(
                err("Urdf::DuplicateName", format!("{kind} name used on lines {first} and {line}"))
                    .at_line(line)
                    .on(format!("{kind} {}", clip(name)))
                    .hint("rename one of them"),
            ),
        }
    }
    seen.into_iter().map(|(n, (i, _))| (n, i)).collect()
}

/// Walks up from every link, each link once; a walk that meets itself is a cycle.
fn cycles(r: &RawRobot, ends: &[(Option<usize>, Option<usize>)], carrier: &[Option<usize>], out: &mut Problems) {
    let mut visited = vec![0usize; carrier.len()];
    for start in 0..carrier.len() {
        let (mut at, mark) = (start, start + 1);
        loop {
            if visited[at] == mark {
                let mut path = vec![r.links[at].name.as_str()];
                let mut k = at;
                while let Some(p) = carrier[k].and_then(|j| ends[j].0) {
                    path.push(&r.links[p].name);
                    if p == at || path.len() > 20 {
                        break;
                    }
                    k = p;
                }
                let line = carrier[at].map_or(0, |j| r.joints[j].line);
                path.reverse();
                out.push(
                    err("Urdf::Cycle", format!("links form a cycle: {}", path.join(" -> ")))
                        .at_line(line)
                        .on(format!("link {}", r.links[at].name))
                        .hint("remove one of these joints"),
                );
                break;
            }
            if visited[at] != 0 {
                break;
            }
            visited[at] = mark;
            match carrier[at].and_then(|j| ends[j].0) {
                Some(p) => at = p,
                None => break,
            }
        }
    }
}

/// Joints sorted so that parents come first, ties in the order of the file.
fn order(parent: &[usize], child: &[usize], root: usize, links: usize) -> Vec<usize> {
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); links];
    for (j, &p) in parent.iter().enumerate() {
        below[p].push(j);
    }
    let mut ready: BinaryHeap<std::cmp::Reverse<usize>> = below[root].iter().map(|&j| std::cmp::Reverse(j)).collect();
    let mut out = Vec::with_capacity(parent.len());
    while let Some(std::cmp::Reverse(j)) = ready.pop() {
        out.push(j);
        ready.extend(below[child[j]].iter().map(|&k| std::cmp::Reverse(k)));
    }
    out
}
