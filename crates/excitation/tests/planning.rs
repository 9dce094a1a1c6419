//! Plans for the paper's robot: limits, predicted standard deviations, quietness, and their time.

#![allow(clippy::unwrap_used)] // helpers outside #[test] functions

mod common;

use common::paper;
use excitation::*;
use ff_model::Params;
use ff_model::mission::Loaded;
use std::time::Instant;

/// The base of the paper's robot: 60 s at the mission's 0.17 rad/s and 0.15 rad/s^2, ten control points.
fn request(loaded: &Loaded, starts: usize) -> InformationRequest {
    let limits = loaded
        .model
        .bodies()
        .iter()
        .map(|b| JointLimits { velocity: 0.17, ..JointLimits::from_model(&b.joint.limits, 0.15) });
    let start = loaded.mission.reproduce.as_ref().unwrap().hold_rad.clone();
    InformationRequest {
        end: End::Fixed(start.clone()),
        start,
        limits: limits.collect(),
        duration: 60.0,
        control_points: 10,
        seed: 1,
        starts,
        noise: SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 },
        options: SqpOptions::default(),
    }
}

fn print(what: &str, p: &Planned, seconds: f64) {
    eprintln!("{what}: {seconds:.2} s, {:?}, searches {:?}", p.status, p.searches);
    eprintln!(
        "  -log det: random {:.2}, planned {:.2}, band {:?}",
        p.random_information_cost, p.information_cost, p.band
    );
    for q in &p.predictions {
        eprintln!(
            "  {:14} {:9.3} {:7}  random {:.2e}  planned {:.2e}  ratio {:.2}",
            q.name,
            q.value,
            q.unit,
            q.random,
            q.planned,
            q.random / q.planned
        );
    }
}

#[test]
fn information() {
    let loaded = paper("flex.toml");
    let (model, params) = (&loaded.model, Params::nominal(&loaded.model));
    let all: Vec<usize> = (0..10).collect();
    let request = request(&loaded, 3);
    let clock = Instant::now();
    let p = plan_information(model, &params, &all, &request).unwrap();
    print("information", &p, clock.elapsed().as_secs_f64());
    let (low, high) = flexible_band(model, &params, &request.start, 0.2).unwrap().unwrap();
    for emphasis in [1.0, 10.0, 100.0] {
        let clock = Instant::now();
        let band = QuietBand { low, high, emphasis, weights: vec![1.0; 7] };
        let q = plan_quiet(model, &params, &all, &request, &band).unwrap();
        print("quiet", &q, clock.elapsed().as_secs_f64());
    }
}
