//! Models shared by the integration tests.
// Every test file is its own crate and uses a part of this; helpers may unwrap like the tests they serve.
#![allow(dead_code, clippy::unwrap_used)]

use ff_model::spatial::so3::{exp_so3, quat_to_rot, rot_of_rpy};
use ff_model::*;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) fn v3(a: f64, b: f64, c: f64) -> Vector3<f64> {
    Vector3::new(a, b, c)
}

pub(crate) fn revolute(name: &str, axis: Vector3<f64>, pos: Vector3<f64>, rpy: Vector3<f64>) -> Joint {
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
pub(crate) fn peers_arm(kind: BaseKind) -> Model {
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
pub(crate) fn peers_tree(name: &str) -> Model {
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

pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub(crate) fn uni(r: &mut ChaCha8Rng, a: f64, b: f64) -> f64 {
    r.random_range(a..b)
}

pub(crate) fn rand_v3(r: &mut ChaCha8Rng, s: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| uni(r, -s, s))
}

pub(crate) fn rand_unit(r: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let v = rand_v3(r, 1.0);
        if v.norm() > 0.2 {
            return v.normalize();
        }
    }
}

pub(crate) fn rand_rot(r: &mut ChaCha8Rng) -> Matrix3<f64> {
    quat_to_rot(&exp_so3(&rand_v3(r, 1.7)))
}

/// A physically consistent body: random point masses, so that no symmetry is built in.
pub(crate) fn rand_inertia(r: &mut ChaCha8Rng, scale: f64) -> Inertia<f64> {
    let mut b = Inertia::zero();
    for _ in 0..6 {
        b += Inertia::point(scale * uni(r, 0.2, 1.0), &rand_v3(r, 0.8));
    }
    b
}

pub(crate) fn rand_state(m: &Model, r: &mut ChaCha8Rng, passive: f64) -> ff_dynamics::State<f64> {
    let mut s = ff_dynamics::State::zero(m);
    s.pos = rand_v3(r, 1.0);
    s.att = exp_so3(&rand_v3(r, 1.5));
    s.q.iter_mut().for_each(|x| *x = uni(r, -2.5, 2.5));
    s.eta.iter_mut().for_each(|x| *x = uni(r, -passive, passive));
    s.v.iter_mut().for_each(|x| *x = uni(r, -1.0, 1.0));
    s
}

/// A random tree of `n` bodies on mixed joints with skewed axes.
pub(crate) fn rand_tree(r: &mut ChaCha8Rng, n: usize, kind: BaseKind) -> Model {
    let mut m = Model::new("random", "base", rand_inertia(r, 40.0), kind);
    for i in 0..n {
        let parent = r.random_range(0..=i);
        let joint = Joint {
            name: format!("j{i}"),
            kind: match r.random_range(0..4) {
                0 => JointKind::Prismatic,
                1 => JointKind::Continuous,
                _ => JointKind::Revolute,
            },
            axis: rand_unit(r),
            placement: Xform::new(rand_rot(r), rand_v3(r, 0.9)),
            limits: JointLimits::default(),
        };
        let b = rand_inertia(r, 3.0);
        m.add_body(parent, format!("l{i}"), joint, b);
    }
    m
}

/// Springs and dampers of twin joints: `(k, d, rest)` per passive coordinate.
pub(crate) type Springs = Vec<(f64, f64, f64)>;

/// A system with appendages as ports, and the same system with their twins as tree links.
pub(crate) struct Twins {
    pub(crate) ports: Model,
    pub(crate) tree: Model,
    pub(crate) springs: Springs,
}

/// Mounts `parts` on both forms of `arm`.
pub(crate) fn with_twins(arm: &Model, parts: &[(usize, Xform<f64>, Part)]) -> Twins {
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

#[derive(Clone)]
pub(crate) enum Part {
    Panel(flex_panel::PanelChain),
    Slosh(slosh_pendulum::SloshPendulum),
}

pub(crate) fn rand_part(r: &mut ChaCha8Rng) -> Part {
    if r.random_range(0..3) == 0 {
        let (k, d) = ([uni(r, 5.0, 30.0), uni(r, 5.0, 30.0)], [uni(r, 0.5, 6.0), uni(r, 0.5, 6.0)]);
        Part::Slosh(slosh_pendulum::SloshPendulum::new(uni(r, 5.0, 60.0), uni(r, 0.3, 1.1), k, d).unwrap())
    } else {
        let n = r.random_range(1..=4);
        let segments = (0..n)
            .map(|_| {
                segment(rand_inertia(r, 4.0), rand_v3(r, 1.0), rand_unit(r))
                    .with_spring(uni(r, 50.0, 300.0), uni(r, 0.5, 4.0))
                    .with_rest(uni(r, -0.2, 0.2))
            })
            .collect();
        Part::Panel(flex_panel::PanelChain::new(segments).unwrap())
    }
}

/// A random tree with random appendages on random bodies.
pub(crate) fn rand_twins(r: &mut ChaCha8Rng) -> Twins {
    let n = r.random_range(0..=8);
    let arm = rand_tree(r, n, BaseKind::Floating);
    let parts: Vec<_> = (0..r.random_range(1..=3))
        .map(|_| (r.random_range(0..=n), Xform::new(rand_rot(r), rand_v3(r, 1.0)), rand_part(r)))
        .collect();
    with_twins(&arm, &parts)
}

/// The tree state that equals a port state.
pub(crate) fn tree_state(t: &Twins, s: &ff_dynamics::State<f64>) -> ff_dynamics::State<f64> {
    let mut o = ff_dynamics::State::zero(&t.tree);
    o.pos = s.pos;
    o.att = s.att;
    o.q = [s.q.clone(), s.eta.clone()].concat();
    o.v.copy_from_slice(&s.v);
    o
}

pub(crate) fn segment(inertia: Inertia<f64>, hinge: Vector3<f64>, axis: Vector3<f64>) -> flex_panel::Segment {
    flex_panel::Segment { inertia, hinge, axis, stiffness: 0.0, damping: 0.0, rest: 0.0 }
}

/// The paper-size robot with two skewed two-segment wings on the base, one on a link, and slosh.
pub(crate) fn system() -> Model {
    let arm = peers_arm(BaseKind::Floating);
    let wing = |sg: f64, tilt: f64| {
        let i = Inertia::from_com(33.0, &v3(0.05, sg * 1.07, 0.03), &Matrix3::from_diagonal(&v3(15.0, 11.0, 15.0)));
        let s = |y: f64| segment(i, v3(0.0, sg * y, 0.0), v3(1.0, tilt, -0.5 * tilt)).with_spring(200.0, 2.0);
        Part::Panel(flex_panel::PanelChain::new(vec![s(0.3), s(2.15)]).unwrap())
    };
    let slosh = slosh_pendulum::SloshPendulum::new(100.0, 0.8, [20.0, 23.0], [5.0, 4.0]).unwrap();
    let at = |x, y, z| Xform::new(Matrix3::identity(), v3(x, y, z));
    let small = Inertia::from_com(1.5, &v3(0.1, 0.2, -0.05), &Matrix3::from_diagonal(&v3(0.05, 0.04, 0.06)));
    let boom = segment(small, v3(0.05, 0.02, 0.1), v3(0.3, -0.5, 0.8)).with_spring(12.0, 0.3);
    let boom = Part::Panel(flex_panel::PanelChain::new(vec![boom]).unwrap());
    let parts = [
        (0, at(0.9, 0.0, 0.6), wing(1.0, 0.1)),
        (0, at(0.9, 0.0, 0.6), wing(-1.0, 0.07)),
        (0, at(0.9, 0.1, 0.5), Part::Slosh(slosh)),
        (4, at(0.02, 0.1, 0.05), boom),
    ];
    with_twins(&arm, &parts).ports
}

/// A smooth, general joint motion: every joint its own two sines.
pub(crate) struct Wave(pub(crate) usize);

impl ff_dynamics::motion::JointMotion for Wave {
    fn dof(&self) -> usize {
        self.0
    }
    fn duration(&self) -> f64 {
        1e3
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for j in 0..self.0 {
            let (a, w, f) = (0.12 + 0.03 * j as f64, 0.9 + 0.31 * j as f64, 0.4 * j as f64);
            let (b, v, g) = (0.05, 2.3 - 0.17 * j as f64, 1.0 - 0.3 * j as f64);
            q[j] = 0.3 * (j as f64 - 2.5) + a * (w * t + f).sin() + b * (v * t + g).sin();
            qd[j] = a * w * (w * t + f).cos() + b * v * (v * t + g).cos();
            qdd[j] = -a * w * w * (w * t + f).sin() - b * v * v * (v * t + g).sin();
        }
    }
}
