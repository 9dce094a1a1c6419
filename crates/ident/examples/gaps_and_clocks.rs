//! A record with lost samples, a clipped sensor and a late gyro: `cargo run --release -p ff-ident --example gaps_and_clocks`.
//!
//! Time stamps show what was lost; the builder fills gaps so that samples stay evenly spaced, and a mask takes the filled ones out of
//! the sums. The clocks of torques and gyro are compared with that of the encoders by what a rough model predicts, and put
//! right where they are off by more than half a sample.

use excitation::plan::{Extent, Shape};
use excitation::{JointCommand, Manoeuvre, ManoeuvreSpec};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::{Drive, SensorSuite, SimOptions, State, measure, simulate};
use ff_mission::{LoadOptions, Mission};
use ff_model::{Params, Registry};
use ff_records::Mask;
use ff_records::RecordBuilder;
use ff_records::clock::correct_clocks;
use ident::checks::estimate_clocks;
use ident::compose::Masked;
use ident::parameters::select;
use ident::{Noise, Options, OutputError, Request, estimate};
use nalgebra::DMatrix;
use std::error::Error;

const DT: f64 = 0.01;
const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };
/// How late the gyro is, in samples.
const LATE: usize = 2;

fn main() -> Result<(), Box<dyn Error>> {
    let mut registry = Registry::new();
    slosh_pendulum::register(&mut registry);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/slosh.toml");
    let loaded = Mission::load(file.as_ref(), &registry, &LoadOptions::default())?;
    let model = &loaded.model;
    let truth = Params::<f64>::nominal(model);

    // The robot moves two joints there and back; torques are clipped at 5 N m.
    let start = loaded.mission.reproduce.as_ref().map_or_else(|| vec![0.2; model.nj()], |r| r.hold_rad.clone());
    let command = |joint, frequency| JointCommand {
        joint,
        shape: Shape::Doublet,
        extent: Extent::HalfPeriod { frequency, negative: joint == 1 },
        velocity: 0.17,
        acceleration: 0.15,
    };
    let commands = vec![command(0, 0.105), command(1, 0.109)];
    let motion = Manoeuvre::new(&ManoeuvreSpec { start, commands, ramp: 0.1, lead: 1.0, hold: 30.0, grid: Some(DT) })?;
    let options = SimOptions { duration_s: motion.duration(), step_s: 1e-3, sample_s: DT };
    let trace = simulate(model, &truth, &State::zero(model), &Drive::Prescribed(&motion), &options)?;
    let white = |noise_std| Channel { noise_std, ..Channel::default() };
    let sensors = SensorSuite { torque: white(NOISE.torque), gyro: white(NOISE.gyro), encoder: Channel::encoder(20) };
    let read = measure(&trace, &sensors, 1);
    let clipped = read.tau.map(|t| t.clamp(-5.0, 5.0));
    let late = DMatrix::from_fn(read.gyro.nrows(), 3, |i, j| read.gyro[(i.saturating_sub(LATE), j)]);

    // Twelve samples never arrived.
    let kept: Vec<usize> = (0..read.q.nrows()).filter(|i| !(700..712).contains(i)).collect();
    let stamps: Vec<f64> = kept.iter().map(|&i| i as f64 * DT).collect();
    let rows = |m: &DMatrix<f64>| m.select_rows(&kept);
    let (record, warnings) = RecordBuilder::new(model.joint_names())
        .stamps(stamps.clone())
        .resample(true)
        .allow("Data::Stuck")
        .allow("Data::Saturated")
        .q(rows(&read.q))
        .tau(rows(&clipped))
        .gyro(rows(&late))
        .build()?;
    println!("{warnings}");

    let decls = model.param_decls();
    let selected = select(&decls, &["base.*", "tank.*"])?;
    // What is uncertain about the model is fitted beside the clocks, within 10 %.
    let uncertain: Vec<(usize, f64)> = select(&decls, &["base.mass", "tank.*"])?
        .into_iter()
        .map(|i| (i, 0.1 * truth.values()[i].abs().max(1e-3)))
        .collect();
    let clocks = estimate_clocks(model, &truth, &record, &NOISE, &uncertain, 0.1)?;
    println!("gyro late by {:.4} +- {:.4} s", clocks.gyro.offset, clocks.gyro.offset_deviation);
    let (record, edges, warnings) = correct_clocks(&record, &clocks);
    println!("{warnings}");

    let gaps = Mask::of_gaps(&stamps, record.dt(), record.samples(), record.joints());
    let mask = gaps.and(&Mask::of_saturation(&record)).and(&edges);
    println!("{:.1} % of the readings do not count", 100.0 * mask.lost());
    let output_error = OutputError::new(model, &record, &Options::new(NOISE))?;
    let mut masked = Masked::new(output_error, &mask).ok_or("one weight per reading")?;
    let request = Request { prior_width: Some(0.3), ..Request::new(&decls, &selected, truth.values()) };
    let e = estimate(&request, &mut masked)?;
    println!("{:?}, chi-squared per degree of freedom {:.3}", e.status, e.chi2_per_dof);
    for p in e.parameters.iter().filter(|p| !p.name.contains("i_")) {
        println!("{:16} {:10.4} +- {:.4} {}", p.name, p.value, p.std.unwrap_or(f64::NAN), p.unit);
    }
    Ok(())
}
