//! Which joints of a tree are the arm, and which are hinges of panels.

use ff_model::tree::JointImpedance;
use ff_model::{Body, JointKind, Model};
use serde::Serialize;

/// Parts of names of what swings rather than being driven.
const SWINGING: [&str; 9] = ["panel", "solar", "wing", "array", "flex", "boom", "antenna", "hinge", "sail"];

/// Parts of names of hands, which an arm carries.
const GRASPING: [&str; 7] = ["finger", "thumb", "gripper", "hand_", "knuckle", "jaw", "palm"];

/// Parts of names of what rolls.
const ROLLING: [&str; 3] = ["wheel", "caster", "castor"];

/// Longest chain on the base that is taken for a panel without any evidence (joints): arms have more.
const SHORT: usize = 3;

/// Longest branch behind a fork that is taken for a finger of a hand (joints).
const FINGER: usize = 2;

/// What a tree looks like.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Guess {
    /// The base link: the root of the URDF.
    pub base: String,
    /// Joints of the arm, from the base outwards: the longest chain of driven joints. Empty when no joint is driven.
    pub arm: Vec<String>,
    /// Links that the joints of the arm carry, in the same order.
    pub arm_links: Vec<String>,
    /// Frame at the end of the arm.
    pub end_effector: Option<String>,
    /// Chains that hang on the base and look like panels.
    pub panels: Vec<Panel>,
    /// Joints that the mission holds: fingers, wheels, what hangs on the end of the arm; and what the import holds anyway.
    pub lock: Vec<String>,
    /// All other joints.
    pub others: Vec<String>,
    /// Acceleration limit to begin with (rad/s^2 or m/s^2): half a second to the speed limit of the slowest joint, at most 0.5.
    pub acceleration: f64,
}

/// A chain of hinges on the base.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Panel {
    /// A name for it, fit to be that of an appendage and of no body.
    pub name: String,
    /// Its joints, from the base outwards.
    pub joints: Vec<String>,
    /// Why it is taken for a panel.
    pub why: String,
    /// False when only its shortness speaks for a panel.
    pub evident: bool,
    /// Stiffness of its hinges (N m/rad), where the description of the robot gives that of each.
    pub stiffness: Option<Vec<f64>>,
    /// Damping of its hinges (N m s/rad), where the description gives that of each.
    pub damping: Option<Vec<f64>>,
}

impl Guess {
    /// Looks at a model as [`urdf`](ff_mission::urdf) imports it, without appendages. Allocates.
    pub fn of(model: &Model) -> Self {
        let tree = Tree::new(model);
        let arm = tree.arm();
        let end_effector = arm.last().map(|&b| {
            // Of the frames that are fixed to the last body, the one farthest along the file: flange before tool.
            let of_hand = |name: &str| contains(name, &GRASPING) && name != model.body_name(b);
            let last = model.frames().iter().rfind(|f| f.body == b && !of_hand(&f.name));
            last.map_or_else(|| model.body_name(b).to_owned(), |f| f.name.clone())
        });
        let mut panels: Vec<Panel> = Vec::new();
        for chain in tree.chains().filter(|c| !c.iter().any(|b| arm.contains(b) || tree.named(*b, &ROLLING))) {
            let why = tree.evidence(&chain);
            if !tree.liftable(&chain) || (why.is_none() && chain.len() > SHORT) {
                continue;
            }
            let evident = why.is_some();
            let why = why.unwrap_or_else(|| "a short chain on the base that is not the arm".to_owned());
            let joints = chain.iter().map(|&b| tree.joint(b).to_owned()).collect();
            let name = free_name(model, model.body_name(chain[0]), &panels);
            let given = |of: fn(&JointImpedance) -> f64| {
                let all = chain.iter().map(|&b| of(&tree.body(b).impedance));
                all.map(|x| (x > 0.0).then_some(x)).collect::<Option<Vec<f64>>>()
            };
            let (stiffness, damping) = (given(|i| i.stiffness), given(|i| i.viscous));
            panels.push(Panel { name, joints, why, evident, stiffness, damping });
        }
        let name = |b: &usize| tree.joint(*b).to_owned();
        let panel = |b: &usize| panels.iter().any(|p| p.joints.iter().any(|j| j == tree.joint(*b)));
        // A follower goes with the joint that it follows.
        let rest: Vec<usize> =
            (1..model.n_bodies()).filter(|b| !arm.contains(b) && !panel(b) && tree.moves_by_itself(*b)).collect();
        let carried = |b: usize| arm.last().is_some_and(|tip| tree.path(b).contains(tip));
        let (lock, others): (Vec<usize>, Vec<usize>) =
            rest.into_iter().partition(|&b| carried(b) || tree.named(b, &GRASPING) || tree.named(b, &ROLLING));
        let speeds = arm.iter().chain(&others).map(|&b| tree.body(b).joint.limits.velocity);
        let slowest = speeds.filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
        Self {
            base: model.body_name(0).to_owned(),
            arm: arm.iter().filter(|b| tree.moves_by_itself(**b)).map(name).collect(),
            arm_links: arm.iter().map(|&b| model.body_name(b).to_owned()).collect(),
            end_effector,
            lock: lock.iter().map(name).collect(),
            others: others.iter().map(name).collect(),
            // Two digits: a guess.
            acceleration: (100.0 * (2.0 * slowest).min(0.5)).ceil() / 100.0,
            panels,
        }
    }
    /// The same with joints that the import holds (of [`moving_joints`](ff_mission::urdf::moving_joints) those that the model lacks):
    /// named in the mission, they are no assumption of the reader any more.
    #[must_use]
    pub fn holding(mut self, held: impl IntoIterator<Item = String>) -> Self {
        self.lock.splice(0..0, held);
        self
    }
}

/// A model with the children of its bodies. Bodies count from 1, the base is 0.
struct Tree<'m> {
    model: &'m Model,
    children: Vec<Vec<usize>>,
    /// Longest chain from the joint of a body outwards (joints).
    depth: Vec<usize>,
}

impl<'m> Tree<'m> {
    fn new(model: &'m Model) -> Self {
        let n = model.n_bodies();
        let (mut children, mut depth) = (vec![Vec::new(); n], vec![1; n]);
        for b in 1..n {
            children[model.bodies()[b - 1].parent].push(b);
        }
        for b in (1..n).rev() {
            // Parents come before children, so the depth of `b` is final here.
            let parent = model.bodies()[b - 1].parent;
            depth[parent] = depth[parent].max(depth[b] + 1);
        }
        Self { model, children, depth }
    }
    fn body(&self, b: usize) -> &'m Body {
        &self.model.bodies()[b - 1]
    }
    /// True for a joint that follows no other.
    fn moves_by_itself(&self, b: usize) -> bool {
        self.model.joint(self.joint(b)).is_some()
    }
    fn joint(&self, b: usize) -> &'m str {
        &self.body(b).joint.name
    }
    /// Bodies from the base to `tip`.
    fn path(&self, tip: usize) -> Vec<usize> {
        let mut out = vec![tip];
        let mut b = self.body(tip).parent;
        while b > 0 {
            out.push(b);
            b = self.body(b).parent;
        }
        out.reverse();
        out
    }
    /// True for a joint that has, or whose link has, one of the words in its name.
    fn named(&self, b: usize, words: &[&str]) -> bool {
        contains(&self.body(b).joint.name, words) || contains(&self.body(b).name, words)
    }
    /// Why a joint looks as if nothing drove it.
    fn passive(&self, b: usize) -> Option<String> {
        let body = self.body(b);
        if body.impedance.stiffness > 0.0 {
            return Some(format!("{} is on a spring", shown(&body.joint.name)));
        }
        if body.joint.limits.effort == 0.0 {
            return Some(format!("the effort limit of {} is 0", shown(&body.joint.name)));
        }
        let name = [&body.joint.name, &body.name].into_iter().find(|n| contains(n, &SWINGING))?;
        Some(format!("the name of {}", shown(name)))
    }
    /// The longest chain of driven joints; of equally long ones the one that reaches farthest.
    fn arm(&self) -> Vec<usize> {
        let mut best: (usize, f64, Vec<usize>) = (0, 0.0, Vec::new());
        for tip in (1..self.model.n_bodies()).filter(|&b| self.children[b].is_empty()) {
            let mut path = self.path(tip);
            if let Some(i) = path.iter().position(|&b| self.passive(b).is_some() || self.named(b, &GRASPING)) {
                path.truncate(i);
            }
            let reach: f64 = path.iter().map(|&b| self.body(b).joint.placement.pos.norm()).sum();
            if (path.len(), reach) > (best.0, best.1) {
                best = (path.len(), reach, path);
            }
        }
        let mut arm = best.2;
        // The fingers of a hand are not the arm that carries it.
        let fork = |b: &usize| self.children[*b].len() > 1;
        if let Some(k) = arm.iter().position(|b| fork(b) && self.children[*b].iter().all(|&c| self.depth[c] <= FINGER))
        {
            arm.truncate(k + 1);
        }
        arm
    }
    /// Chains without branches that hang on the base.
    fn chains(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        self.children[0].iter().filter_map(|&first| {
            let mut chain = vec![first];
            while let Some(&last) = chain.last() {
                match self.children[last][..] {
                    [] => return Some(chain),
                    [next] => chain.push(next),
                    _ => return None,
                }
            }
            None
        })
    }
    fn evidence(&self, chain: &[usize]) -> Option<String> {
        chain.iter().find_map(|&b| self.passive(b))
    }
    /// Whether `lift` takes it: hinges only, every segment with mass.
    fn liftable(&self, chain: &[usize]) -> bool {
        chain.iter().map(|&b| self.body(b)).all(|b| b.joint.kind != JointKind::Prismatic && b.inertia.com().is_some())
    }
}

fn contains(name: &str, words: &[&str]) -> bool {
    let name = name.to_lowercase();
    words.iter().any(|w| name.contains(w))
}

/// A name on one line, whatever characters it holds.
pub(super) fn shown(name: &str) -> String {
    ff_model::diagnostics::clip(&name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>())
}

/// A name that an appendage may have, made of that of a link.
fn free_name(model: &Model, link: &str, others: &[Panel]) -> String {
    let plain: String = link.chars().take(60).map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    let taken = |n: &str| {
        n == "base" || (0..model.n_bodies()).any(|b| model.body_name(b) == n) || others.iter().any(|p| p.name == n)
    };
    // Parameters of a link that stays are called by its name, so an appendage takes another.
    let base = plain.trim_end_matches("_link").trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches('_');
    let base = if base.is_empty() { "panel" } else { base };
    let mut name = base.to_owned();
    let mut k = 1;
    while taken(&name) {
        k += 1;
        name = format!("{base}_{k}");
    }
    name
}
