//! Plan the joint motion that tells most about the base: `cargo run --release -p ffid --example 04_plan`. Limits hold for all time.

use ffid::dynamics::motion::JointMotion;
use ffid::excitation::planning::InformationRequest;
use ffid::excitation::{End, SensorNoise, SqpOptions, plan_information};
use ffid::mission::Leniency;
use ffid::model::Params;
use ffid::workflow::preflight::{Sensing, joint_limits};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let mission = system.mission.as_ref().ok_or("no mission")?;
    let rigid = system.model.without_appendages();
    let sensing = Sensing::of(&mission.sensors);
    let request = InformationRequest {
        start: system.pose(),
        end: End::Free,
        limits: joint_limits(&rigid, &mission.limits),
        duration: 30.0,
        control_points: 6,
        seed: 1,
        starts: 1,
        noise: SensorNoise { torque: sensing.torque_nm, gyro: Some(sensing.gyro_rad_per_s), rate: sensing.rate_hz },
        options: SqpOptions::default(),
    };
    let base = rigid.parameter_indices("base.*")?;
    let plan = plan_information(&rigid, &Params::nominal(&rigid), &base, &request)?;
    println!(
        "{:.0} s, -log det {:.2}, median of random motions {:.2}",
        plan.motion.duration(),
        plan.information_cost,
        plan.random_information_cost
    );
    println!("limits hold for all time: {}", plan.limits.holds);
    for p in &plan.predictions {
        println!("  {:14} {:9.3} +- {:9.5} {}", p.name, p.value, p.planned, p.unit);
    }
    Ok(())
}
