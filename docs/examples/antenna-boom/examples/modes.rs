//! Modes of the mission beside this crate: `cargo run --example modes`.

use ff_dynamics::{Boundary, modes};
use ff_mission::{LoadOptions, Mission};
use ff_model::{Params, Registry};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut registry = Registry::new();
    antenna_boom::register(&mut registry);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/mission.toml");
    let model = Mission::load(path.as_ref(), &registry, &LoadOptions::default())?.model;
    let q = vec![0.0; model.nj()];
    for m in modes(&model, &Params::nominal(&model), &q, &vec![0.0; model.np()], Boundary::JointsHeld)? {
        println!("{:.4} Hz, damping ratio {:.4}, shape {:.2?}", m.frequency_hz, m.damping_ratio, m.passive);
    }
    Ok(())
}
