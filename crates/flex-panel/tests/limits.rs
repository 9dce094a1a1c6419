//! Corners of construction and declaration that no simulation visits.

use crate::common::{chain, rng};
use ff_model::DynAppendage;
use flex_panel::PanelChain;
use flex_panel::Segment;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// The suite compares an appendage with the twin it gives; without one it has nothing to compare.
#[test]
fn the_twin_is_handed_out() {
    let c = chain(&mut rng(31), 3);
    let twin = c.tree_twin().and_then(|t| t.tree_bodies(&c.nominal())).unwrap();
    assert_eq!(twin, c.twin_bodies());
    assert_eq!(twin.iter().map(|b| b.parent).collect::<Vec<_>>(), [None, Some(0), Some(1)]);
}

/// At other parameters than the nominal ones the twin is that of the chain which has them.
#[test]
fn the_twin_follows_the_parameters() {
    let (mut r, n) = (rng(32), 3);
    let (c, bodies) = (chain(&mut r, n), chain(&mut r, n));
    let other = PanelChain::new(
        (0..n)
            .map(|i| {
                let (s, o) = (c.segment(i).unwrap(), bodies.segment(i).unwrap());
                Segment { inertia: o.inertia, stiffness: o.stiffness, damping: o.damping, ..s }
            })
            .collect(),
    );
    let other = other.unwrap();
    assert_ne!(other.twin_bodies(), c.twin_bodies());
    // The same links; `other` has taken axes to unit length once more, which may change their last bit.
    let (got, want) = (c.tree_twin().unwrap().tree_bodies(&other.nominal()).unwrap(), other.twin_bodies());
    assert_eq!(got.len(), want.len());
    for (g, w) in got.into_iter().zip(want) {
        assert!((g.axis - w.axis).amax() < 1e-15, "{} {}", g.axis, w.axis);
        assert_eq!(ff_model::port::TwinBody { axis: w.axis, ..g }, w);
    }
    // A tree joint knows only its own spring.
    let (k, d) = c.stiffness_damping();
    let mut coupled = k.clone();
    (coupled[(0, 1)], coupled[(1, 0)]) = (0.1 * k[(0, 0)].min(k[(1, 1)]), 0.1 * k[(0, 0)].min(k[(1, 1)]));
    let coupled = c.with_coupling(&coupled, &d).unwrap();
    assert_eq!(coupled.tree_twin().unwrap().tree_bodies(&coupled.nominal()), None);
}

/// A panel folded flat back is relaxed at half a turn, which is within the range of its hinge.
#[test]
fn half_a_turn_is_a_rest_angle_and_more_is_not() {
    let i = Matrix3::new(3.1, 0.2, -0.3, 0.2, 2.4, 0.1, -0.3, 0.1, 3.7);
    let at = |rest: f64| {
        let (com, hinge, axis) =
            (Vector3::new(0.1, 1.0, -0.2), Vector3::new(0.4, 0.3, 0.2), Vector3::new(1.0, 0.3, 0.2));
        PanelChain::new(vec![Segment::new(20.0, com, &i, hinge, axis).with_spring(150.0, 2.0).with_rest(rest)])
    };
    for rest in [PI, -PI] {
        assert_eq!(at(rest).unwrap().segment(0).unwrap().rest, rest);
        assert!(at(rest * (1.0 + 1e-15)).unwrap_err().has("Config::Param"));
    }
}

/// Numbers that a mission file cannot hold reach a chain from code; the problem names the key all the same.
#[test]
fn numbers_that_are_not_finite_are_named_by_their_key() {
    let good = Segment::new(
        20.0,
        Vector3::new(0.1, 1.0, -0.2),
        &Matrix3::new(3.1, 0.2, -0.3, 0.2, 2.4, 0.1, -0.3, 0.1, 3.7),
        Vector3::new(0.4, 0.3, 0.2),
        Vector3::new(1.0, 0.3, 0.2),
    );
    type Spoil = fn(&mut Segment);
    let cases: [(Spoil, &str); 4] = [
        (|s| s.inertia.mass = f64::NAN, "segments[1].mass_kg"),
        (|s| s.inertia.h.y = f64::INFINITY, "segments[1].com_m"),
        (|s| s.inertia.rot[(2, 2)] = f64::NAN, "segments[1].inertia_com_kgm2"),
        (|s| s.rest = f64::NAN, "segments[1].rest_rad"),
    ];
    for (spoil, key) in cases {
        let mut bad = good.clone();
        spoil(&mut bad);
        let problems = PanelChain::new(vec![good.clone(), bad]).unwrap_err();
        assert_eq!(problems.0.len(), 1, "{problems}");
        assert_eq!((problems.0[0].code, problems.0[0].object.as_deref()), ("Config::NotFinite", Some(key)));
    }
}
