//! Many parameter sets at once, one per vector lane: `cargo run --release -p ffid --example 08_batch_in_lanes`.

use ffid::dynamics::motion::FnMotion;
use ffid::dynamics::sim::{Keep, Run, simulate_ensemble};
use ffid::dynamics::{Drive, SimOptions, State, simulate};
use ffid::mission::Leniency;
use ffid::model::Params;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let (model, hold) = (&system.model, system.pose());
    let motion = FnMotion::new(model.nj(), 20.0, |t, q, qd, qdd| {
        q.copy_from_slice(&hold);
        qd.fill(0.0);
        qdd.fill(0.0);
        let (sin, cos) = (0.71 * t).sin_cos();
        (q[1], qd[1], qdd[1]) = (q[1] + 0.2 * (1.0 - cos), 0.142 * sin, 0.10082 * cos);
    })?;

    // Stiffness of all hinges from 70 % to 130 %.
    let factor = |k: usize| 0.7 + 0.6 * k as f64 / 31.0;
    let stiffness = model.parameter_indices("panel_*.k[*]")?;
    let sets: Vec<Params<f64>> = (0..32)
        .map(|k| {
            let mut values = Params::<f64>::nominal(model).values().to_vec();
            stiffness.iter().for_each(|&i| values[i] *= factor(k));
            Params::from_values(model, values)
        })
        .collect();
    let start = State::zero(model);
    let runs: Vec<Run<'_>> = sets.iter().map(|params| Run { params, start: &start }).collect();
    let options = SimOptions { duration_s: 20.0, step_s: 5e-3, sample_s: 0.05 };

    let clock = Instant::now();
    let traces = simulate_ensemble(model, &runs, &motion, &options, Keep { passive: true, ..Keep::default() })?;
    let in_lanes = clock.elapsed();
    for (k, trace) in traces.iter().enumerate().step_by(6) {
        let (torque, tip) = (trace.tau.column(1).amax(), 1e3 * trace.eta.amax());
        println!(
            "stiffness {:3.0} %: peak torque {torque:7.3} N m, peak hinge angle {tip:6.2} mrad",
            100.0 * factor(k)
        );
    }
    let clock = Instant::now();
    for params in &sets {
        simulate(model, params, &start, &Drive::Prescribed(&motion), &options)?;
    }
    println!("{} runs: {in_lanes:.0?} in lanes, {:.0?} one after another", runs.len(), clock.elapsed());
    Ok(())
}
