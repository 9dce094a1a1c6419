//! Simulate an arm that moves and a base that reacts: `cargo run --release -p ffid --example 02_simulate`.

use ffid::dynamics::motion::FnMotion;
use ffid::dynamics::{Drive, SimOptions, State, simulate};
use ffid::mission::Leniency;
use ffid::model::Params;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let (model, hold) = (&system.model, system.pose());
    let params = Params::<f64>::nominal(model);
    let joint = model.joint("joint2").ok_or("no joint2")?;

    // joint2 leaves its pose by 0.6 rad and comes back, twice in 17.7 s. Its second harmonic is near the mode in which base and
    // panels turn (0.229 Hz), and it starts and stops without a jump of the acceleration.
    let rate = std::f64::consts::TAU * 0.113;
    let motion = FnMotion::new(model.nj(), 2.0 / 0.113, |t, q, qd, qdd| {
        q.copy_from_slice(&hold);
        qd.fill(0.0);
        qdd.fill(0.0);
        let (s, c) = (rate * t).sin_cos();
        q[joint] -= 0.3 * (1.0 - c - 0.5 * s * s);
        qd[joint] = -0.3 * rate * s * (1.0 - c);
        qdd[joint] = -0.3 * rate * rate * (c - 1.0 + 2.0 * s * s);
    })?;
    let options = SimOptions { duration_s: 40.0, step_s: 5e-3, sample_s: 0.05 };
    let mut start = State::zero(model);
    start.eta = model.rest_position(&params);
    let trace = simulate(model, &params, &start, &Drive::Prescribed(&motion), &options)?;

    println!("peak torque of joint2      {:10.3} N m", trace.tau.column(joint).amax());
    println!("peak base rate             {:10.3e} rad/s", trace.gyro().amax());
    let travel = trace.pos.row(trace.len() - 1) - trace.pos.row(0);
    println!("base displacement          {:10.4} m", travel.norm());
    for (i, (name, coordinate)) in model.passive_coords().iter().enumerate() {
        println!("peak {name:22}{:10.3e} {}", trace.eta.column(i).amax(), coordinate.unit);
    }
    let momentum = |i: usize| trace.budget(model, &params, i).momentum.lin.norm();
    let largest = (0..trace.len()).map(momentum).fold(0.0, f64::max);
    println!("linear momentum, at most   {largest:10.1e} kg m/s (0 but for errors of integration)");
    Ok(())
}
