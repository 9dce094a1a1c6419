//! 300 of the random systems of `cargo xtask conformance --systems`, which runs 10,000.

use ff_model::{DynAppendage, Registry};
use ff_testkit::assert_within;
use rayon::prelude::*;
use std::sync::Arc;
use validate::known_wrong::{known_wrong, right};
use validate::systems::{SystemFigures, random_system};

fn shipped() -> Vec<Arc<dyn DynAppendage>> {
    let mut r = Registry::new();
    flex_panel::register(&mut r);
    slosh_pendulum::register(&mut r);
    let tables: Vec<(String, &str)> =
        r.kinds().flat_map(|k| r.examples(k).iter().map(move |e| (k.to_owned(), *e))).collect();
    tables.iter().map(|(kind, table)| r.build(kind, table).unwrap()).collect()
}

fn run(parts: &[Arc<dyn DynAppendage>], count: u64, seconds: f64) -> Vec<SystemFigures> {
    (0..count).into_par_iter().map(|seed| random_system(parts, seed, seconds).unwrap()).collect()
}

fn worst(all: &[SystemFigures], f: impl Fn(&SystemFigures) -> f64) -> f64 {
    all.iter().map(f).fold(0.0, |a, b| if b.is_nan() { b } else { a.max(b) })
}

#[test]
fn mixed_systems_keep_momentum_and_balance_energy() {
    let all = run(&shipped(), 300, 10.0);
    let (p, e, b) = (worst(&all, |s| s.momentum), worst(&all, |s| s.energy), worst(&all, |s| s.bias));
    let steps: usize = all.iter().map(|s| s.steps).sum();
    let whole = all.iter().filter(|s| s.seconds == 10.0).count();
    let damped = all.iter().filter(|s| s.dissipated > 0.01).count();
    println!("momentum {p:.1e}, energy {e:.1e}, bias {b:.1e}; {steps} steps, {whole} whole, {damped} well damped");
    assert_within!(p, 1e-11, "momentum {p:e}");
    assert_within!(e, 1e-10, "energy {e:e}");
    assert_within!(b, 1e-12, "bias {b:e}");
    assert!(whole >= 280, "{whole} systems stayed within the ranges of their appendages");
    assert!(damped >= 150, "damping hardly matters: {damped}");
    // Several kinds in one system, and hosts other than the base.
    assert!(all.iter().any(|s| s.kinds.contains(&"flex_panel".into()) && s.kinds.contains(&"slosh_pendulum".into())));
    assert!(all.iter().any(|s| s.bodies == 1) && all.iter().any(|s| s.bodies == 7));
}

#[test]
fn a_seed_gives_the_same_bits_again() {
    let parts = shipped();
    assert_eq!(random_system(&parts, 17, 1.0).unwrap(), random_system(&parts, 17, 1.0).unwrap());
    assert_ne!(random_system(&parts, 17, 1.0).unwrap(), random_system(&parts, 18, 1.0).unwrap());
}

/// The figures can fail: what breaks momentum or energy at one port breaks them in a system.
#[test]
fn wrong_appendages_show_in_systems() {
    let right: Vec<Arc<dyn DynAppendage>> = right().into_iter().map(|(_, a)| Arc::from(a)).collect();
    let fine = run(&right, 10, 2.0);
    assert!(worst(&fine, |s| s.momentum) < 1e-11 && worst(&fine, |s| s.energy) < 1e-10);
    for w in known_wrong() {
        let parts: [Arc<dyn DynAppendage>; 1] = [Arc::from(w.appendage)];
        let all = match w.name {
            "damper-without-work" | "spring-circulating" | "host-torque-without-arm" | "coriolis-factor" => {
                run(&parts, 10, 2.0)
            }
            _ => continue,
        };
        let (p, e, b) = (worst(&all, |s| s.momentum), worst(&all, |s| s.energy), worst(&all, |s| s.bias));
        println!("{}: momentum {p:.1e}, energy {e:.1e}, bias {b:.1e}", w.name);
        assert!(e > 1e-6 && b > 1e-6, "{}: energy {e:e}, bias {b:e}", w.name);
        let breaks_momentum = matches!(w.name, "host-torque-without-arm" | "coriolis-factor");
        assert_eq!(p > 1e-6, breaks_momentum, "{}: momentum {p:e}", w.name);
    }
}
