//! The hand-written bias is the one that follows from the energies.

use crate::common::{State, pendulum, rel, rng, sym};
use ff_model::port::derived_bias;
use ff_model::scalar::Grad;
use ff_model::{Appendage, Motion, PortState, Scalar};
use nalgebra::Vector3;

#[test]
fn override_equals_the_derived_bias_over_a_thousand_states() {
    let mut r = rng(1);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let c = pendulum(&mut r);
        let s = State::new(&mut r);
        let (mut h, mut d) = ([0.0; 8], [0.0; 8]);
        c.bias(&c.nominal(), &s.port(), &mut h);
        derived_bias(&c, &c.nominal(), &s.port(), &mut d);
        worst = worst.max(rel(&h, &d));
    }
    println!("largest relative difference {worst:.2e}");
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn override_equals_the_derived_bias_in_every_derivative() {
    let mut r = rng(2);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let c = pendulum(&mut r);
        let s = State::new(&mut r);
        // Eight random directions through parameters and state at once.
        let mut lift = |x: f64| {
            let mut g = Grad::constant(x);
            for e in &mut g.eps {
                *e = sym(&mut r, 1.0);
            }
            g
        };
        let p = c.nominal().map(&mut lift);
        let eta = s.eta.map(&mut lift);
        let nu = s.nu.map(&mut lift);
        let mut v = |a: &Vector3<f64>| Vector3::new(lift(a.x), lift(a.y), lift(a.z));
        let host = Motion::new(v(&s.host.lin), v(&s.host.ang));
        let port = PortState { host, eta: &eta, nu: &nu };
        let (mut h, mut d) = ([Grad::from_f64(0.0); 8], [Grad::from_f64(0.0); 8]);
        c.bias(&p, &port, &mut h);
        derived_bias(&c, &p, &port, &mut d);
        for k in 0..8 {
            worst = worst.max(rel(&h.map(|g| g.eps[k]), &d.map(|g| g.eps[k])));
        }
    }
    println!("largest relative difference of a derivative {worst:.2e}");
    assert!(worst < 1e-12, "{worst:e}");
}
