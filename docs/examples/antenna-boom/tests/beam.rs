//! The boom against the theory of beams.

use ff_model::nalgebra::Vector3;
use ff_model::port::PortModel;
use ff_model::{DynAppendage, Force, Motion, PortState, Registry};
use std::f64::consts::TAU;
use std::sync::Arc;

const MASS: f64 = 8.4;
const LENGTH: f64 = 5.5;
const EI: f64 = 1900.0;

fn boom(tip_mass: f64) -> Arc<dyn DynAppendage> {
    let mut registry = Registry::new();
    antenna_boom::register(&mut registry);
    let table = format!(
        "mass_kg = {MASS}\ntip_mass_kg = {tip_mass:?}\nlength_m = {LENGTH}\nbending_stiffness_nm2 = {EI:?}\n\
         damping_ns_per_m = 0.3"
    );
    registry.build(antenna_boom::KIND, &table).unwrap()
}

fn parameters(a: &dyn DynAppendage) -> Vec<f64> {
    a.declaration().params.iter().map(|p| p.nominal).collect()
}

fn matrix(a: &dyn DynAppendage, eta: &[f64; 2]) -> [[f64; 8]; 8] {
    let m = PortModel::<f64>::dense_inertia(a, &parameters(a), eta);
    std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
}

/// Modal mass 33/140 of the beam, and a frequency 1.5 % above the exact 3.5160 sqrt(EI / m L^3) of a cantilever without
/// tip mass (Meirovitch 2001, table 8.1): assumed modes can only stiffen.
#[test]
fn modal_mass_and_frequency_are_those_of_a_cantilever() {
    for tip in [0.0, 2.6] {
        let m = matrix(&*boom(tip), &[0.13, -0.21]);
        let want = 33.0 / 140.0 * MASS + tip;
        for k in [6, 7] {
            assert!((m[k][k] - want).abs() < 1e-13 * want, "{} {want}", m[k][k]);
        }
        assert_eq!(m[6][7], 0.0);
    }
    let m = matrix(&*boom(0.0), &[0.1, 0.2]);
    let stiffness = 3.0 * EI / LENGTH.powi(3);
    let exact = 3.516_015 * (EI / (MASS * LENGTH.powi(3))).sqrt();
    let ratio = (stiffness / m[6][6]).sqrt() / exact;
    println!("{:.4} Hz, {ratio:.4} of the exact beam", exact * ratio / TAU);
    assert!((1.0..1.016).contains(&ratio), "{ratio}");
}

/// Rigid motion: the undeflected boom is a rod of mass m with a point mass at its end; both couple with
/// `integral s phi dm = 11/40 m L` about the root and `3/8 m` in translation.
#[test]
fn the_host_block_is_a_rod_and_couplings_are_the_integrals() {
    let tip = 2.6;
    let m = matrix(&*boom(tip), &[0.0, 0.0]);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
    close(m[0][0], MASS + tip);
    close(m[1][5], (0.5 * MASS + tip) * LENGTH);
    close(m[4][4], (MASS / 3.0 + tip) * LENGTH * LENGTH);
    close(m[1][6], 0.375 * MASS + tip);
    close(m[5][6], (0.275 * MASS + tip) * LENGTH);
    close(-m[4][7], (0.275 * MASS + tip) * LENGTH);
}

/// A force F at the tip deflects it by F L^3 / 3 EI. A host that accelerates steadily along y loads the boom as a
/// force `-m[1][6] A` at its tip would.
#[test]
fn a_static_load_deflects_the_tip() {
    let a = boom(2.6);
    let (p, m) = (parameters(&*a), matrix(&*boom(2.6), &[0.0, 0.0]));
    let acceleration = 0.07;
    let deflection = -m[1][6] * acceleration * LENGTH.powi(3) / (3.0 * EI);
    let mut h = [0.0; 8];
    let s = PortState { host: Motion::zero(), eta: &[deflection, 0.0], nu: &[0.0, 0.0] };
    PortModel::<f64>::bias(&*a, &p, &s, &mut h);
    let residual = m[6][1] * acceleration + h[6];
    assert!(residual.abs() < 1e-12 * h[6].abs(), "{residual}");
    // The host feels no spring of a boom at rest: it is an inner force until the boom accelerates.
    assert_eq!(Force::from_slice(&h).lin, Vector3::zeros());
}
