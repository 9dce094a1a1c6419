//! Random trees and states, the robots of the peers, and appendages as ports and as tree links.

use crate::random::{Random, body, body_within, rng, rotation, uniform, unit_vector, vector};
use ff_model::spatial::so3::{exp_so3, rot_of_rpy};
use ff_model::tree::JointLimits;
use ff_model::*;
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;

/// A vector from its components.
pub fn v3(a: f64, b: f64, c: f64) -> Vector3<f64> {
    Vector3::new(a, b, c)
}

/// A revolute joint without limits at `pos` (m), turned by `rpy` (rad).
pub fn revolute(name: &str, axis: Vector3<f64>, pos: Vector3<f64>, rpy: Vector3<f64>) -> Joint {
    Joint {
        name: name.into(),
        kind: JointKind::Revolute,
        axis,
        placement: Xform::new(rot_of_rpy(&rpy), pos),
        limits: JointLimits::default(),
    }
}

fn diag(a: f64, b: f64, c: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&v3(a, b, c))
}

/// Base and arm of `peers/src/make_models.py` (fixtures/peers-model), with the tool frame.
pub fn peers_arm(kind: BaseKind) -> Model {
    let l = 3.0 / 7.0;
    let base = Inertia::from_com(600.0, &v3(0.9, 0.0, 0.6), &diag(150.0, 150.0, 150.0));
    let mut m = Model::new("peers", "base", base, kind);
    let link = Inertia::from_com(60.0 / 7.0, &v3(0.0, l / 2.0, 0.0), &diag(0.4, 0.04, 0.4));
    let mut parent = 0;
    for i in 1..=7 {
        let axis = if i % 2 == 1 { v3(0.0, 1.0, 0.0) } else { v3(0.0, 0.0, 1.0) };
        let (pos, rpy) = if i == 1 {
            (v3(0.4, 0.0, 1.2), v3(std::f64::consts::FRAC_PI_2, 0.0, 0.0))
        } else {
            (v3(0.0, l, 0.0), v3(0.0, 0.0, 0.0))
        };
        parent = m.add_body(parent, format!("arm_l{i}"), revolute(&format!("arm_j{i}"), axis, pos, rpy), link);
    }
    m.add_frame("tool", parent, Xform::new(Matrix3::identity(), v3(0.0, l, 0.0)));
    m
}

/// The passive bodies of the peers' flexible or slosh model as ordinary tree links.
pub fn peers_tree(name: &str) -> Model {
    let mut m = peers_arm(BaseKind::Floating);
    let y = v3(0.0, 1.0, 0.0);
    let o = v3(0.0, 0.0, 0.0);
    match name {
        "flex" => {
            for (w, x0, sg) in [("a", 1.8, 1.0), ("b", 0.0, -1.0)] {
                let seg = Inertia::from_com(33.0, &v3(sg, 0.0, 0.0), &diag(15.0, 11.0, 15.0));
                let p = m.add_body(0, format!("{w}1"), revolute(&format!("p{w}1"), y, v3(x0, 0.0, 0.6), o), seg);
                m.add_body(p, format!("{w}2"), revolute(&format!("p{w}2"), y, v3(2.0 * sg, 0.0, 0.0), o), seg);
            }
        }
        "slosh" => {
            let fulcrum = v3(0.9, 0.0, 0.9);
            let p = m.add_body(0, "u", revolute("slosh_x", v3(1.0, 0.0, 0.0), fulcrum, o), Inertia::zero());
            let mass = Inertia::point(100.0, &v3(0.0, 0.0, -0.8));
            m.add_body(p, "mass", revolute("slosh_y", y, o, o), mass);
        }
        _ => {}
    }
    m
}

/// A random state: position within 1 m, any attitude, joints within 2.5, passive coordinates within `passive`, rates
/// within 1.
pub fn random_state(m: &Model, r: &mut Random, passive: f64) -> ff_dynamics::State<f64> {
    let mut s = ff_dynamics::State::zero(m);
    s.pos = vector(r, 1.0);
    s.att = exp_so3(&vector(r, 1.5));
    s.q.iter_mut().for_each(|x| *x = uniform(r, -2.5, 2.5));
    s.eta.iter_mut().for_each(|x| *x = uniform(r, -passive, passive));
    s.v.iter_mut().for_each(|x| *x = uniform(r, -1.0, 1.0));
    s
}

/// A random tree of `n` bodies on mixed joints with skewed axes.
pub fn random_tree(r: &mut Random, n: usize, kind: BaseKind) -> Model {
    let mut m = Model::new("random", "base", body(r, 40.0), kind);
    for i in 0..n {
        let parent = r.random_range(0..=i);
        let joint = Joint {
            name: format!("j{i}"),
            kind: match r.random_range(0..4) {
                0 => JointKind::Prismatic,
                1 => JointKind::Continuous,
                _ => JointKind::Revolute,
            },
            axis: unit_vector(r),
            placement: Xform::new(rotation(r), vector(r, 0.9)),
            limits: JointLimits::default(),
        };
        let b = body(r, 3.0);
        m.add_body(parent, format!("l{i}"), joint, b);
    }
    m
}

/// A random rigid tree of `joints` bodies on skewed axes; every fourth joint slides, every third body hangs from the one
/// before the last.
pub fn branched_arm(seed: u64, joints: usize, kind: BaseKind) -> Model {
    let mut r = rng(seed);
    let mut m = Model::new("tree", "base", body_within(&mut r, 60.0, 0.5), kind);
    for i in 0..joints {
        let parent = if i % 3 == 2 { i - 1 } else { i };
        let kind = if i % 4 == 3 { JointKind::Prismatic } else { JointKind::Revolute };
        let axis = unit_vector(&mut r);
        let placement = Xform::new(rotation(&mut r), vector(&mut r, 0.6));
        let joint = Joint { name: format!("j{i}"), kind, axis, placement, limits: JointLimits::default() };
        m.add_body(parent, format!("l{i}"), joint, body_within(&mut r, 6.0, 0.5));
    }
    m
}

/// Springs and dampers of twin joints: `(k, d, rest)` per passive coordinate.
pub type Springs = Vec<(f64, f64, f64)>;

/// A system with appendages as ports, and the same system with their twins as tree links.
pub struct Twins {
    /// With ports.
    pub ports: Model,
    /// With tree links.
    pub tree: Model,
    /// Of the tree links, in the order of the passive coordinates.
    pub springs: Springs,
}

/// Mounts `parts` (host, mount, appendage) on both forms of `arm`.
///
/// # Panics
/// If a host does not exist.
pub fn with_twins(arm: &Model, parts: &[(usize, Xform<f64>, Part)]) -> Twins {
    let (mut ports, mut tree) = (arm.clone(), arm.clone());
    let mut springs = Vec::new();
    for (k, (host, mount, part)) in parts.iter().enumerate() {
        let (appendage, bodies) = match part {
            Part::Panel(p) => (std::sync::Arc::<dyn DynAppendage>::from(p.clone()), p.twin_bodies()),
            Part::Slosh(s) => (s.clone().into(), s.twin_bodies()),
        };
        ports.mount(format!("a{k}"), *host, *mount, appendage).unwrap();
        let mut ids = Vec::new();
        for (i, b) in bodies.iter().enumerate() {
            let (parent, placement) = match b.parent {
                Some(p) => (ids[p], b.placement),
                None => (*host, *mount * b.placement),
            };
            let joint = Joint {
                name: format!("a{k}.{i}"),
                kind: JointKind::Continuous,
                axis: b.axis,
                placement,
                limits: JointLimits::default(),
            };
            ids.push(tree.add_body(parent, format!("a{k}.{i}"), joint, b.inertia));
            springs.push((b.stiffness, b.damping, b.rest));
        }
    }
    Twins { ports, tree, springs }
}

/// An appendage with a twin.
#[derive(Clone)]
pub enum Part {
    /// A panel.
    Panel(flex_panel::PanelChain),
    /// A pendulum.
    Slosh(slosh_pendulum::SloshPendulum),
}

/// A panel of up to four segments, or a pendulum.
pub fn random_part(r: &mut Random) -> Part {
    if r.random_range(0..3) == 0 {
        let (k, d) = ([uniform(r, 5.0, 30.0), uniform(r, 5.0, 30.0)], [uniform(r, 0.5, 6.0), uniform(r, 0.5, 6.0)]);
        Part::Slosh(slosh_pendulum::SloshPendulum::new(uniform(r, 5.0, 60.0), uniform(r, 0.3, 1.1), k, d).unwrap())
    } else {
        let n = r.random_range(1..=4);
        let segments = (0..n)
            .map(|_| {
                rigid_segment(body(r, 4.0), vector(r, 1.0), unit_vector(r))
                    .with_spring(uniform(r, 50.0, 300.0), uniform(r, 0.5, 4.0))
                    .with_rest(uniform(r, -0.2, 0.2))
            })
            .collect();
        Part::Panel(flex_panel::PanelChain::new(segments).unwrap())
    }
}

/// A random tree of up to eight bodies with one to three random appendages on random bodies.
pub fn random_twins(r: &mut Random) -> Twins {
    let n = r.random_range(0..=8);
    let arm = random_tree(r, n, BaseKind::Floating);
    let parts: Vec<_> = (0..r.random_range(1..=3))
        .map(|_| (r.random_range(0..=n), Xform::new(rotation(r), vector(r, 1.0)), random_part(r)))
        .collect();
    with_twins(&arm, &parts)
}

/// The tree state that equals a port state.
pub fn tree_state(t: &Twins, s: &ff_dynamics::State<f64>) -> ff_dynamics::State<f64> {
    let mut o = ff_dynamics::State::zero(&t.tree);
    o.pos = s.pos;
    o.att = s.att;
    o.q = [s.q.clone(), s.eta.clone()].concat();
    o.v.copy_from_slice(&s.v);
    o
}

/// A segment without spring, damper and rest angle.
pub fn rigid_segment(inertia: Inertia<f64>, hinge: Vector3<f64>, axis: Vector3<f64>) -> flex_panel::Segment {
    flex_panel::Segment { inertia, hinge, axis, stiffness: 0.0, damping: 0.0, rest: 0.0 }
}

/// The paper-size robot with two skewed two-segment wings on the base, one on a link, and slosh.
pub fn system() -> Model {
    let arm = peers_arm(BaseKind::Floating);
    let wing = |sg: f64, tilt: f64| {
        let i = Inertia::from_com(33.0, &v3(0.05, sg * 1.07, 0.03), &Matrix3::from_diagonal(&v3(15.0, 11.0, 15.0)));
        let s = |y: f64| rigid_segment(i, v3(0.0, sg * y, 0.0), v3(1.0, tilt, -0.5 * tilt)).with_spring(200.0, 2.0);
        Part::Panel(flex_panel::PanelChain::new(vec![s(0.3), s(2.15)]).unwrap())
    };
    let slosh = slosh_pendulum::SloshPendulum::new(100.0, 0.8, [20.0, 23.0], [5.0, 4.0]).unwrap();
    let at = |x, y, z| Xform::new(Matrix3::identity(), v3(x, y, z));
    let small = Inertia::from_com(1.5, &v3(0.1, 0.2, -0.05), &Matrix3::from_diagonal(&v3(0.05, 0.04, 0.06)));
    let boom = rigid_segment(small, v3(0.05, 0.02, 0.1), v3(0.3, -0.5, 0.8)).with_spring(12.0, 0.3);
    let boom = Part::Panel(flex_panel::PanelChain::new(vec![boom]).unwrap());
    let parts = [
        (0, at(0.9, 0.0, 0.6), wing(1.0, 0.1)),
        (0, at(0.9, 0.0, 0.6), wing(-1.0, 0.07)),
        (0, at(0.9, 0.1, 0.5), Part::Slosh(slosh)),
        (4, at(0.02, 0.1, 0.05), boom),
    ];
    with_twins(&arm, &parts).ports
}
