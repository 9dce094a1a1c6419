//! Time of one simulation and one sensitivity run of the paper's flexible case.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
use ff_dynamics::*;
use ff_model::mission::{LoadOptions, Mission};
use ff_model::{Params, Registry};
fn main() {
    let mut r = Registry::new();
    flex_panel::register(&mut r);
    slosh_pendulum::register(&mut r);
    let l = Mission::load("fixtures/paper/flex.toml".as_ref(), &r, &LoadOptions::default()).unwrap();
    let m = &l.model;
    let p = Params::nominal(m);
    let hold = motion::Hold::new(vec![0.3, 0.8, -0.2, 0.9, 0.1, 0.4, 0.2], 1e3).unwrap();
    let wanted = Wanted { params: (0..10).chain(80..m.n_params()).collect(), initial: vec![] };
    let t0 = std::time::Instant::now();
    let t = Prescribed::new(m, &p, &hold, &Sampling { samples: 1001, sample_s: 0.01, substeps: 1 }, &[]);
    println!("table {:.2} us/stage", t0.elapsed().as_secs_f64() / 4000.0 * 1e6);
    let mut z = vec![0.01; 6 + 2 * m.np()];
    z[7] = 0.05;
    let t0 = std::time::Instant::now();
    for _ in 0..10 {
        std::hint::black_box(simulate_reduced(m, &p, &t, &z).unwrap());
    }
    println!("simulate {:.2} us/stage", t0.elapsed().as_secs_f64() / 40000.0 * 1e6);
    let t0 = std::time::Instant::now();
    std::hint::black_box(sensitivities(m, &p, &t, &z, &wanted).unwrap());
    println!("sensitivities of {}: {:.2} us/stage", wanted.len(), t0.elapsed().as_secs_f64() / 4000.0 * 1e6);
}
