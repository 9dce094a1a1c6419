//! Search under constraints: active ones held to their limit and no further, conflicts named, interruption, threads, time.

#![allow(clippy::unwrap_used)] // helpers outside #[test] functions

mod common;

use common::paper;
use excitation::*;
use ff_model::Params;
use ff_model::mission::Loaded;
use nalgebra::{Vector3, Vector6};
use std::sync::Arc;
use std::time::Instant;

fn system(file: &str) -> (Loaded, Arc<HeldSystem>) {
    let loaded = paper(file);
    let system = HeldSystem::new(&loaded.model, &Params::nominal(&loaded.model)).unwrap();
    (loaded, Arc::new(system))
}

fn hold(loaded: &Loaded) -> Vec<f64> {
    loaded.mission.reproduce.as_ref().unwrap().hold_rad.clone()
}

fn plan(start: &[f64], end: End, duration: Duration, free: usize) -> SplinePlan {
    let limits = JointLimits { lower: -2.9, upper: 2.9, velocity: 0.17, acceleration: 0.15, jerk: None };
    SplinePlan::new(PlanSpec {
        start: start.to_vec(),
        end,
        duration,
        degree: 5,
        free,
        limits: vec![limits; start.len()],
        refine: 1,
    })
    .unwrap()
}

/// Shake the base about a general axis: works against every constraint.
fn shake(system: &HeldSystem) -> BaseMotion<RigidBase> {
    BaseMotion {
        response: RigidBase::new(system.model(), system.params()).unwrap(),
        directions: vec![Vector6::new(0.1, -0.2, 0.3, 0.7, 0.4, -0.5)],
        samples: 101,
        form: Form::Log,
    }
}

fn options(starts: usize, iterations: usize) -> SearchOptions {
    let sqp = SqpOptions { iterations, tolerance: 1e-5 };
    SearchOptions { seed: 5, starts, threads: 2, sqp, time_limit: None }
}

/// Searches without and with the constraint: without it is broken, with it held and active.
fn active(system: &Arc<HeldSystem>, plan: &SplinePlan, constraint: &dyn Constraint, within: f64) -> Found {
    let cost = shake(system);
    let list = [constraint];
    let bare = search(&Problem::new(&cost, plan), None, &options(2, 60), &Watch::default()).unwrap();
    let problem = Problem::new(&cost, plan).under(&list);
    let before = verify(&problem, Some(system), &bare.best.x).unwrap();
    assert!(!before.holds, "the constraint does not matter: {:?}", before.worst());
    let clock = Instant::now();
    let found = search(&problem, Some(system), &options(2, 60), &Watch::default()).unwrap();
    let seconds = clock.elapsed().as_secs_f64();
    let own: Vec<&ConstraintMargin> =
        found.verdict.margins.iter().filter(|m| matches!(m.basis, Basis::Samples(_))).collect();
    let tightest = own.iter().min_by(|a, b| a.relative.total_cmp(&b.relative)).unwrap();
    eprintln!(
        "{} of {}: cost {:.3} free, {:.3} held; broken before by {:.3}, now {:.5} of {} {} (margin {:.2e}, {:?}); {:?}, \
         {} iterations, {} rounds, {seconds:.1} s",
        tightest.name,
        tightest.item,
        bare.best.cost,
        found.best.cost,
        -before.worst().unwrap().relative,
        tightest.value,
        tightest.limit,
        tightest.unit,
        tightest.relative,
        tightest.basis,
        found.best.status,
        found.best.iterations,
        found.rounds
    );
    for o in &found.all {
        match o {
            Ok(o) => eprintln!(
                "   {:?} {:.4} -> {:.4}, {} its {} evals, excess {:.1e}",
                o.status, o.start_cost, o.cost, o.iterations, o.evaluations, o.excess
            ),
            Err(e) => eprintln!("   {e}"),
        }
    }
    assert!(found.verdict.holds && own.iter().all(|m| m.margin >= 0.0));
    assert!(tightest.relative < within, "not active: {tightest:?}");
    found
}

#[test]
fn torque_is_held() {
    let (loaded, system) = system("flex.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(25.0), 8);
    let limits = [3.0, 2.5, 2.0, 1.5, 1.0, 0.4, 0.2];
    active(&system, &plan, &JointTorque::new(&system, &hold(&loaded), &limits).unwrap(), 0.02);
}

#[test]
fn base_rate_is_held() {
    let (loaded, system) = system("slosh.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(25.0), 8);
    active(&system, &plan, &BaseRate::new(&system, &hold(&loaded), 0.012).unwrap(), 0.02);
}

#[test]
fn base_attitude_is_held() {
    let (loaded, system) = system("flex.toml");
    let q = hold(&loaded);
    let plan = plan(&q, End::Fixed(q.clone()), Duration::Free { min: 15.0, max: 30.0 }, 8);
    active(&system, &plan, &BaseAttitude::new(&system, &q, 0.03).unwrap(), 0.02);
}

#[test]
fn pointing_is_held() {
    let (loaded, system) = system("flex.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(25.0), 8);
    let (axis, target) = (Vector3::new(0.1, -0.9, 0.4), Vector3::new(0.12, -0.88, 0.43));
    active(
        &system,
        &plan,
        &Pointing::new(&system, &hold(&loaded), "antenna", &axis, &target, Cone::Within(0.07)).unwrap(),
        0.02,
    );
    let sun = Vector3::new(0.3, -0.8, 0.5);
    let angle = axis.angle(&sun) - 0.03;
    active(
        &system,
        &plan,
        &Pointing::new(&system, &hold(&loaded), "tracker", &axis, &sun, Cone::Outside(angle)).unwrap(),
        0.02,
    );
}

#[test]
fn frame_speed_is_held() {
    let (loaded, system) = system("flex.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(25.0), 8);
    let tool = loaded.mission.robot.end_effector.clone().unwrap();
    active(&system, &plan, &FrameSpeed::new(&system, &tool, 0.25).unwrap(), 0.02);
}

#[test]
fn deflection_and_slosh_are_held() {
    for (file, limit) in [("flex.toml", 0.004), ("slosh.toml", 0.05)] {
        let (loaded, system) = system(file);
        let q = hold(&loaded);
        let plan = plan(&q, End::Free, Duration::Fixed(25.0), 8);
        active(&system, &plan, &PassiveRange::all(&system, &q, "rad", limit).unwrap(), 0.05);
    }
}
