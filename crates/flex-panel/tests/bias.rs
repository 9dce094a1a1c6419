//! The hand-written bias is the one that follows from the energies.

use crate::common::{State, chain, rel, rng, sym};
use ff_model::port::derived_bias;
use ff_model::scalar::Grad;
use ff_model::{Appendage, Motion, PortState, Scalar};
use nalgebra::Vector3;

#[test]
fn override_equals_the_derived_bias_over_a_thousand_states() {
    let mut r = rng(1);
    let mut worst = 0.0_f64;
    for n in [1, 2, 3, 4, 7, 16] {
        let c = chain(&mut r, n);
        let p = c.nominal();
        for _ in 0..1000 {
            let s = State::new(&mut r, n);
            let (mut h, mut d) = (vec![0.0; 6 + n], vec![0.0; 6 + n]);
            c.bias(&p, &s.port(), &mut h);
            derived_bias(&c, &p, &s.port(), &mut d);
            worst = worst.max(rel(&h, &d));
        }
    }
    println!("largest relative difference {worst:.2e}");
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn override_equals_the_derived_bias_in_every_derivative() {
    let mut r = rng(2);
    let n = 3;
    let c = chain(&mut r, n);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let s = State::new(&mut r, n);
        // Eight random directions through parameters and state at once.
        let mut lift = |x: f64| {
            let mut g = Grad::constant(x);
            for e in &mut g.eps {
                *e = sym(&mut r, 1.0);
            }
            g
        };
        let p: Vec<Grad> = c.nominal().into_iter().map(&mut lift).collect();
        let eta: Vec<Grad> = s.eta.iter().copied().map(&mut lift).collect();
        let nu: Vec<Grad> = s.nu.iter().copied().map(&mut lift).collect();
        let mut v = |a: &Vector3<f64>| Vector3::new(lift(a.x), lift(a.y), lift(a.z));
        let host = Motion::new(v(&s.host.lin), v(&s.host.ang));
        let port = PortState { host, eta: &eta, nu: &nu };
        let (mut h, mut d) = (vec![Grad::from_f64(0.0); 6 + n], vec![Grad::from_f64(0.0); 6 + n]);
        c.bias(&p, &port, &mut h);
        derived_bias(&c, &p, &port, &mut d);
        for k in 0..8 {
            let pick = |x: &[Grad]| x.iter().map(|g| g.eps[k]).collect::<Vec<_>>();
            worst = worst.max(rel(&pick(&h), &pick(&d)));
        }
    }
    println!("largest relative difference of a derivative {worst:.2e}");
    assert!(worst < 1e-12, "{worst:e}");
}
