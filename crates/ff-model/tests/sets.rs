//! Sets of appendages: tuples of every size, boxed ones, and what is refused.

use ff_model::payload::Payload;
use ff_model::port::{AppendageSet, Derived, Place, TreeTwin, TwinBody};
use ff_model::scalar::ModelScalar;
use ff_model::tree::JointLimits;
use ff_model::{
    Appendage, BaseKind, CoordDecl, Decl, DynAppendage, Inertia, Joint, JointKind, Model, Motion, ParamDecl,
    PortMatrix, PortState, Scalar, SharedAppendage, Xform,
};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

fn body(mass: f64) -> Inertia<f64> {
    let about_com = Matrix3::new(0.9, 0.06, -0.04, 0.06, 0.7, 0.05, -0.04, 0.05, 1.1);
    Inertia::from_com(mass, &Vector3::new(0.5, -0.2, 0.1), &about_com)
}

fn load(mass: f64) -> Payload {
    Payload::new(&body(mass)).unwrap()
}

fn model() -> Model {
    let mut m = Model::new("set", "hull", body(40.0), BaseKind::Floating);
    let joint = Joint {
        name: "elbow".into(),
        kind: JointKind::Revolute,
        axis: Vector3::new(0.2, -0.9, 0.4),
        placement: Xform::new(Matrix3::identity(), Vector3::new(0.7, 0.3, -0.4)),
        limits: JointLimits::default(),
    };
    m.add_body(0, "arm", joint, body(5.0));
    m
}

fn places(n: usize) -> Vec<Place> {
    let at = |i: usize| Xform::new(Matrix3::identity(), Vector3::new(0.3 + i as f64, -0.7, 0.2 * i as f64));
    (0..n).map(|i| Place::new(format!("load{i}"), i % 2, at(i))).collect()
}

fn masses(m: &Model) -> Vec<f64> {
    m.appendages().iter().map(|a| a.decl().params[0].nominal).collect()
}

#[test]
fn tuples_of_every_size_keep_their_order() {
    fn check(set: impl AppendageSet, n: usize) {
        let mut m = model();
        m.mount_set(&places(n), set).unwrap();
        assert_eq!(masses(&m), (1..=n).map(|i| i as f64).collect::<Vec<_>>());
        for (i, (a, p)) in m.appendages().iter().zip(places(n)).enumerate() {
            assert_eq!((&a.name, a.host, a.mount), (&p.name, p.host, p.mount));
            assert_eq!((a.coord_offset, a.param_offset), (0, 20 + 10 * i));
        }
        assert_eq!((m.appendages().len(), m.n_params()), (n, 20 + 10 * n));
    }
    let l = |i: u8| load(f64::from(i));
    check((l(1),), 1);
    check((l(1), l(2)), 2);
    check((l(1), l(2), l(3)), 3);
    check((l(1), l(2), l(3), l(4)), 4);
    check((l(1), l(2), l(3), l(4), l(5)), 5);
    check((l(1), l(2), l(3), l(4), l(5), l(6)), 6);
    check((l(1), l(2), l(3), l(4), l(5), l(6), l(7)), 7);
    check((l(1), l(2), l(3), l(4), l(5), l(6), l(7), l(8)), 8);
}

#[test]
fn boxed_and_shared_sets_are_mounted_as_tuples_are() {
    let (mut tuple, mut boxed, mut shared) = (model(), model(), model());
    tuple.mount_set(&places(2), (load(2.5), load(3.5))).unwrap();
    let set: Vec<Box<dyn DynAppendage>> = vec![Box::new(load(2.5)), Box::new(load(3.5))];
    boxed.mount_set(&places(2), set).unwrap();
    let set: Vec<Arc<dyn DynAppendage>> = vec![Arc::new(load(2.5)), Arc::new(load(3.5))];
    shared.mount_set(&places(2), set).unwrap();
    for m in [&boxed, &shared] {
        assert_eq!((m.param_decls(), m.n_params()), (tuple.param_decls(), tuple.n_params()));
    }
    assert_eq!(tuple.param_decls()[20].name, "load0.body.mass");
}

#[test]
fn everything_wrong_with_a_set_is_said_at_once_and_nothing_is_mounted() {
    let mut m = model();
    m.mount_set(&places(1), (load(1.5),)).unwrap();
    let before = m.param_decls();
    // `load0` is taken, the second name comes twice, the third host does not exist, a fourth place has no appendage.
    let mut wrong = places(4);
    wrong[2] = Place { host: 2, ..wrong[1].clone() };
    let says = m.mount_set(&wrong, (load(2.0), load(3.0), load(4.0))).unwrap_err().to_string();
    for text in
        ["4 places for 3 appendages", "called 'load0'", "called 'load1'", "body 2 does not exist, the last is 1"]
    {
        assert!(says.contains(text), "'{text}' is not in: {says}");
    }
    assert_eq!((m.param_decls(), m.n_params(), masses(&m)), (before, 30, vec![1.5]));
    // What was refused left no offset behind.
    m.mount("late", 1, Xform::identity(), load(6.0)).unwrap();
    assert_eq!(m.appendages()[1].param_offset, 30);
}

/// A point mass on an arm that turns about the z axis of its mount, `r = l (cos q, sin q, 0)`, against a spring and a
/// damper: energies and nothing else.
struct Swing(Decl);

impl Swing {
    fn new(mass: f64) -> Self {
        let params = [("mass", "kg", mass), ("k", "N m/rad", 7.0), ("d", "N m s/rad", 0.6), ("length", "m", 0.8)];
        let params = params.map(|(name, unit, x)| ParamDecl::positive(name, unit, x));
        Self(Decl::new("swing", [CoordDecl::new("q", "rad", (-1.5, 1.5))], params))
    }
}

impl Appendage for Swing {
    fn decl(&self) -> &Decl {
        &self.0
    }
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let ((s, c), l) = (eta[0].sin_cos(), p[3]);
        m.add_point(p[0], &Vector3::new(l * c, l * s, T::zero()), &[Vector3::new(-l * s, l * c, T::zero())]);
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (p[1] * eta[0] * eta[0]).scale(0.5)
    }
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[2] * nu[0] * nu[0]).scale(0.5)
    }
}

impl TreeTwin for Swing {
    fn tree_bodies(&self, p: &[f64]) -> Option<Vec<TwinBody>> {
        let inertia = Inertia::point(p[0], &Vector3::new(p[3], 0.0, 0.0));
        let (axis, placement) = (Vector3::z(), Xform::identity());
        Some(vec![TwinBody { parent: None, axis, placement, inertia, stiffness: p[1], damping: p[2], rest: 0.0 }])
    }
}

ff_model::derived!(Swing: TreeTwin);

#[test]
fn an_appendage_is_mounted_as_it_is_wrapped_or_as_a_handle() {
    let mut m = model();
    m.mount("kind", 1, Xform::identity(), Swing::new(2.0)).unwrap();
    m.mount("wrapped", 1, Xform::identity(), Derived::new(Swing::new(3.0))).unwrap();
    let handle: SharedAppendage = Swing::new(4.0).into();
    let places = ["handle", "load"].map(|name| Place::new(name, 0, Xform::identity()));
    m.mount_set(&places, (handle, load(5.0))).unwrap();
    assert_eq!(masses(&m), [2.0, 3.0, 4.0, 5.0]);
    let links = |k: usize| m.appendages()[k].appendage.tree_twin().and_then(|t| t.tree_bodies(&[2.5, 8.0, 0.7, 1.1]));
    let twin = links(0).unwrap();
    assert_eq!((twin[0].inertia.mass, twin[0].stiffness, twin[0].damping), (2.5, 8.0, 0.7));
    assert_eq!((links(1), links(2).unwrap()), (None, twin));
    assert!(m.appendages().iter().all(|a| a.decl().galilean));
    assert!(!Decl::new("linearised", [], []).not_galilean().galilean);
}

/// Newton's law for the mass, written out: `f = m (w x (v + w x r + 2 r') - r q'^2)`, wrench `[f; r x f]`, own row
/// `dr/dq . f + k q + d q'`.
#[test]
fn the_dynamics_follow_from_the_energies() {
    let a: SharedAppendage = Swing::new(2.0).into();
    let (p, q, rate) = ([2.0, 7.0, 0.6, 0.8], 0.31_f64, -0.83);
    let host = Motion::new(Vector3::new(0.4, -1.1, 0.9), Vector3::new(-0.7, 0.5, 1.2));
    let mut h = [f64::NAN; 7];
    f64::port(&*a).bias(&p, &PortState { host, eta: &[q], nu: &[rate] }, &mut h);
    let (r, across) = (Vector3::new(q.cos(), q.sin(), 0.0) * p[3], Vector3::new(-q.sin(), q.cos(), 0.0) * p[3]);
    let w = host.ang;
    let f = (w.cross(&(host.lin + w.cross(&r) + across * (2.0 * rate))) - r * (rate * rate)) * p[0];
    let n = r.cross(&f);
    let want = [f.x, f.y, f.z, n.x, n.y, n.z, across.dot(&f) + p[1] * q + p[2] * rate];
    for i in 0..7 {
        assert!((h[i] - want[i]).abs() < 1e-14, "row {i}: {} {}", h[i], want[i]);
    }
    assert!((f64::port(&*a).dissipated_power(&p, &[rate]) - p[2] * rate * rate).abs() < 1e-15);
}
