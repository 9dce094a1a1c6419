//! Joints that follow others, `<mimic>`: `q = multiplier q(other) + offset`.
//!
//! What follows a joint that moves has no coordinate of its own ([`ff_model::Model::couple`]); of a chain of followers each is referred
//! to the joint at its head. What follows a joint that stands still, is locked or has no share in it is held at its place. A joint that
//! follows a hinge of an appendage cannot be moved by it: it is held, with a warning.

use super::hold::{Held, nominal};
use super::options::UrdfOptions;
use super::raw::{RawJoint, RawMimic, RawRobot};
use ff_model::diagnostics::{clip, list, misspelling};
use ff_model::tree::JointLimits;
use ff_model::{Area, Problem, Problems};
use std::collections::HashMap;

/// Joints whose names are compared with one that does not exist.
const MOST_COMPARED: usize = 1000;

/// A joint that moves with another: `ratio q(head) + offset` (rad or m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Follower {
    /// The joint that moves by itself.
    pub(super) head: usize,
    pub(super) ratio: f64,
    pub(super) offset: f64,
}

/// What decides where a joint is.
#[derive(Clone, Copy, Debug)]
enum Place {
    At(f64),
    /// With a joint, itself for one that moves by itself.
    With(Follower),
    /// A hinge of an appendage, or a joint of another kind than one axis.
    Otherwise,
}

/// The joints of a file as far as they follow each other.
struct Followers<'a> {
    r: &'a RawRobot,
    named: &'a [bool],
    options: &'a UrdfOptions,
    index: HashMap<&'a str, usize>,
    /// Comparing every wrong name with every joint would take minutes on a large broken file: the same name is compared once.
    compared: HashMap<&'a str, Option<&'a str>>,
}

/// Decides on every joint with `<mimic>`: held at its place, or a follower. `mass` tells the links on which anything with mass hangs,
/// by joint; `named` the joints that the user locks.
pub(super) fn settle(
    r: &RawRobot,
    mass: impl Fn(usize) -> bool,
    named: &[bool],
    options: &UrdfOptions,
    held: &mut Held,
    out: &mut Problems,
) {
    let index = r.joints.iter().enumerate().map(|(k, j)| (j.name.as_str(), k)).collect();
    let mut all = Followers { r, named, options, index, compared: HashMap::new() };
    let mut places: Vec<Option<Place>> = vec![None; r.joints.len()];
    for k in (0..r.joints.len()).filter(|&k| r.joints[k].mimic.is_some()) {
        all.resolve(k, held, &mut places, out);
    }
    let mut heavy = vec![false; r.joints.len()];
    for (k, place) in places.iter().enumerate() {
        if let Some(Place::With(f)) = place {
            heavy[f.head] |= mass(k) || mass(f.head);
        }
    }
    for (k, place) in places.into_iter().enumerate() {
        let j = &r.joints[k];
        if j.mimic.is_none() || !j.moves() || options.lifted.contains(&j.name) {
            continue;
        }
        match place {
            Some(Place::At(q)) => held.at[k] = Some(q),
            // Of frames alone nothing tells how they stand: the one that they follow is held for that, and they with it.
            Some(Place::With(f)) if f.head != k && !heavy[f.head] => {
                held.at[k] = Some(f.ratio * nominal(&r.joints[f.head]) + f.offset);
            }
            Some(Place::With(f)) if f.head != k => held.follows[k] = Some(f),
            _ => {}
        }
    }
}

impl<'a> Followers<'a> {
    /// Decides on a joint and on all that it follows.
    fn resolve(&mut self, k: usize, held: &Held, places: &mut [Option<Place>], out: &mut Problems) {
        let (mut path, mut at) = (vec![k], k);
        let mut place = loop {
            if let Some(known) = places[at] {
                path.pop();
                break known;
            }
            match self.next(at, held, out) {
                Ok(next) => {
                    if let Some(from) = path.iter().position(|&p| p == next) {
                        // Said once, at the joint that comes first in the file.
                        out.0.extend(path[from..].iter().min().map(|&p| self.circle(p)));
                        break Place::With(Follower { head: at, ratio: 1.0, offset: 0.0 });
                    }
                    path.push(next);
                    at = next;
                }
                Err(place) => break place,
            }
        };
        // The last of the path is where it ends, or follows what is known.
        if let Some(&last) = path.last().filter(|_| places[at].is_none()) {
            places[last] = Some(place);
            path.pop();
        }
        for &p in path.iter().rev() {
            place = self.behind(p, place, out);
            places[p] = Some(place);
        }
    }
    /// The joint that a joint follows; what decides where it is if it follows none.
    fn next(&mut self, at: usize, held: &Held, out: &mut Problems) -> Result<usize, Place> {
        let j = &self.r.joints[at];
        let by_itself = Place::With(Follower { head: at, ratio: 1.0, offset: 0.0 });
        if !j.moves() {
            return Err(Place::At(0.0));
        }
        if self.options.lifted.contains(&j.name) {
            return Err(Place::Otherwise);
        }
        if let Some(&q) = self.options.lock_at.get(&j.name) {
            return Err(Place::At(q));
        }
        let alone = match held.at[at] {
            Some(q) => Place::At(q),
            None if super::physics::is_other_kind(&j.kind) => Place::Otherwise,
            None => by_itself,
        };
        let Some(m) = &j.mimic else { return Err(alone) };
        match self.index.get(m.joint.as_str()) {
            Some(&next) => Ok(next),
            None => {
                out.push(self.unknown(j, m));
                Err(alone)
            }
        }
    }
    /// What decides where a joint is that follows one of which this is known.
    fn behind(&self, k: usize, followed: Place, out: &mut Problems) -> Place {
        let j = &self.r.joints[k];
        let Some(RawMimic { line, joint, multiplier, offset }) = &j.mimic else { return followed };
        let other_kind = super::physics::is_other_kind(&j.kind);
        match followed {
            Place::At(q) => Place::At(multiplier * q + offset),
            Place::With(f) => {
                let (ratio, offset) = (multiplier * f.ratio, multiplier * f.offset + offset);
                // The user who locks the follower says himself that it may be left behind.
                if self.named[k] || ratio == 0.0 {
                    return Place::At(ratio * nominal(&self.r.joints[f.head]) + offset);
                }
                if other_kind {
                    return Place::Otherwise;
                }
                Place::With(Follower { head: f.head, ratio, offset })
            }
            Place::Otherwise => {
                let q =
                    multiplier * self.index.get(joint.as_str()).map_or(0.0, |&o| nominal(&self.r.joints[o])) + offset;
                if !self.named[k] && *multiplier != 0.0 {
                    let unit = if j.kind == "prismatic" { "m" } else { "rad" };
                    let what =
                        format!("follows {joint}, which is no driven joint of one axis, and is held at {q} {unit}");
                    let p = Problem::warning(Area::Model, "Urdf::Mimic", what).at_line(*line);
                    out.push(
                        p.on(format!("joint {}", j.name))
                            .hint(format!("exact while {joint} stands still; name it in lock of [robot] to confirm")),
                    );
                }
                Place::At(q)
            }
        }
    }
    fn circle(&self, k: usize) -> Problem {
        let j = &self.r.joints[k];
        let (line, name) = j.mimic.as_ref().map_or((j.line, ""), |m| (m.line, &m.joint));
        Problem::error(Area::Model, "Urdf::MimicCycle", format!("follows '{}', which follows it", clip(name)))
            .at_line(line)
            .on(format!("joint {}", j.name))
            .hint("let one joint of the circle move by itself: remove its <mimic>")
    }
    fn unknown(&mut self, j: &RawJoint, m: &'a RawMimic) -> Problem {
        let names = || self.r.joints.iter().map(|j| j.name.as_str());
        let near = *self
            .compared
            .entry(m.joint.as_str())
            .or_insert_with(|| misspelling(m.joint.as_str(), names().take(MOST_COMPARED)));
        let place = |p: Problem| p.at_line(m.line).on(format!("joint {}", j.name));
        if let Some(root) = self.options.subtree.as_ref().filter(|_| j.follows_outside) {
            let what =
                format!("follows '{}', which is not part of the subtree {root}; taken to move by itself", m.joint);
            return place(Problem::warning(Area::Model, "Urdf::UnknownJoint", what))
                .hint("take a subtree with both, or lock this one");
        }
        let what = format!("follows '{}', which does not exist", clip(&m.joint));
        match near {
            Some(n) => {
                place(Problem::error(Area::Model, "Urdf::UnknownJoint", what)).hint(format!("did you mean {n}?"))
            }
            // Nobody's misspelling: a joint of another file, such as one whose names got a prefix. This one moves by itself.
            None => place(Problem::warning(Area::Model, "Urdf::UnknownJoint", what + "; taken to move by itself"))
                .hint(format!("name the joint that it follows, or lock it; joints: {}", list(names(), 8))),
        }
    }
}

/// Narrows the limits of a joint to what leaves its followers within theirs. Positions of a follower that leave no range are a warning
/// and play no part. A follower has no drive: its effort is none.
pub(super) fn narrow(r: &RawRobot, held: &Held, head: usize, limits: &mut JointLimits, out: &mut Problems) {
    for (k, f) in held.follows.iter().enumerate().filter_map(|(k, f)| Some((k, (*f)?))).filter(|(_, f)| f.head == head)
    {
        let (j, own) = (&r.joints[k], super::convert::limits(&r.joints[k]));
        limits.velocity = limits.velocity.min(own.velocity / f.ratio.abs());
        let ends = [(own.lower - f.offset) / f.ratio, (own.upper - f.offset) / f.ratio];
        let (lower, upper) = (limits.lower.max(ends[0].min(ends[1])), limits.upper.min(ends[0].max(ends[1])));
        if (lower < upper && own.lower <= own.upper) || limits.lower >= limits.upper {
            (limits.lower, limits.upper) = (lower, upper);
            continue;
        }
        let unit = if j.kind == "prismatic" { "m" } else { "rad" };
        let what = format!(
            "limits {} to {} {unit} leave {}, which it follows with ratio {}, no range; taken as none",
            own.lower, own.upper, r.joints[head].name, f.ratio
        );
        let line = j.limit.map_or(j.line, |l| l.line);
        out.push(
            Problem::warning(Area::Model, "Urdf::BadLimits", what)
                .at_line(line)
                .on(format!("joint {}", j.name))
                .hint("give limits that its ratio and offset allow"),
        );
    }
}
