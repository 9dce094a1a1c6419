//! Corners of the formulas and of the declaration that no simulation visits.

use ff_model::DynAppendage;
use ff_testkit::assert_within;
use slosh_pendulum::SloshPendulum;
use slosh_pendulum::formulas::{damping_ratio, natural_frequency};

/// Settling acceleration alone is a gravity pendulum, `omega_n^2 = g / l`; with a spring both add.
#[test]
fn axial_acceleration_swings_the_pendulum_by_its_length() {
    let (m, l, k, axial) = (70.0, 0.6, 15.0, 0.24);
    let gravity = natural_frequency(m, l, 0.0, axial).unwrap();
    assert_within!((gravity * gravity - 0.4).abs(), 1e-15, "{gravity}");
    let both = natural_frequency(m, l, k, axial).unwrap();
    assert_within!((both * both - (0.4 + 15.0 / (70.0 * 0.36))).abs(), 1e-15, "{both}");
    assert_within!((damping_ratio(m, l, k, 3.0, axial).unwrap() - 3.0 / (2.0 * 70.0 * 0.36 * both)).abs(), 1e-15);
}

/// Neutral is not stable: without spring and settling there is no frequency, and none when the mass stands on its head.
#[test]
fn a_rest_position_that_is_not_stable_has_no_frequency() {
    assert_eq!(natural_frequency(70.0, 0.6, 0.0, 0.0), None);
    assert_eq!(natural_frequency(70.0, 0.6, 15.0, -0.6 * 15.0 / (70.0 * 0.36) - 1e-9), None);
    assert!(natural_frequency(70.0, 0.6, 15.0, -0.6 * 15.0 / (70.0 * 0.36) + 1e-9).is_some());
}

/// The suite compares an appendage with the twin it gives; without one it has nothing to compare.
#[test]
fn the_twin_is_handed_out() {
    let p = SloshPendulum::new(70.0, 0.6, [15.0, 17.0], [2.0, 3.0]).unwrap();
    assert_eq!(p.tree_twin().and_then(|t| t.tree_bodies(&p.nominal())), Some(p.twin_bodies()));
    let k: Vec<f64> = p.twin_bodies().iter().map(|b| b.stiffness).collect();
    assert_eq!(k, [15.0, 17.0]);
    // At other parameters it is that of the pendulum which has them.
    let other = SloshPendulum::new(43.0, 0.75, [11.0, 9.0], [1.3, 0.8]).unwrap();
    assert_eq!(p.tree_twin().and_then(|t| t.tree_bodies(&other.nominal())), Some(other.twin_bodies()));
}
