//! Identify base mass and panel stiffness from a noisy record: `cargo run --release -p ffid --example 05_identify`.

use ffid::dynamics::motion::FnMotion;
use ffid::dynamics::sim::Channel;
use ffid::dynamics::{Drive, SensorSuite, SimOptions, State, measure, simulate};
use ffid::ident::parameters::{offset_start, select};
use ffid::ident::{Noise, Options, OutputError, Request, estimate};
use ffid::mission::Leniency;
use ffid::model::Params;
use ffid::records::RecordBuilder;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let (model, hold) = (&system.model, system.pose());
    let truth = Params::<f64>::nominal(model);

    // All joints swing, each at its own frequency.
    let motion = FnMotion::new(model.nj(), 20.0, |t, q, qd, qdd| {
        for i in 0..hold.len() {
            let w = 0.5 + 0.17 * i as f64;
            let (sin, cos) = (w * t).sin_cos();
            (q[i], qd[i], qdd[i]) = (hold[i] + 0.1 * (1.0 - cos), 0.1 * w * sin, 0.1 * w * w * cos);
        }
    })?;
    let options = SimOptions { duration_s: 20.0, step_s: 5e-3, sample_s: 0.02 };
    let trace = simulate(model, &truth, &State::zero(model), &Drive::Prescribed(&motion), &options)?;
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    let white = |noise_std| Channel { noise_std, ..Channel::default() };
    let sensors = SensorSuite { torque: white(noise.torque), gyro: white(noise.gyro), encoder: Channel::encoder(20) };
    let read = measure(&trace, &sensors, 1);
    let record = RecordBuilder::new(model.joint_names()).uniform(0.0, 1.0 / read.dt);
    let (record, warnings) = record.q(read.q).tau(read.tau).gyro(read.gyro).build()?;
    print!("{warnings}");

    let decls = model.param_decls();
    let selected = select(&decls, &["base.mass", "panel_*.k[*]"])?;
    let start = offset_start(&decls, truth.values(), &selected, 0.2, 1);
    let mut output_error = OutputError::new(model, &record, &Options::new(noise))?;
    let e = estimate(&Request::new(&decls, &selected, &start), &mut output_error)?;
    println!("{:?} in {} steps, chi-squared per degree of freedom {:.3}", e.status, e.iterations, e.chi2_per_dof);
    println!("{:20} {:>9} {:>9} {:>9}   standard deviation", "", "truth", "start", "estimate");
    for (p, &i) in e.parameters.iter().zip(&selected) {
        let std = p.std.map_or("not identifiable".into(), |s| format!("{s:.4} {}", p.unit));
        println!("{:20} {:9.3} {:9.3} {:9.3}   {std}", p.name, truth.values()[i], p.start, p.value);
    }
    Ok(())
}
