//! Search under constraints: active ones held to their limit and no further, conflicts named, interruption, threads, time.

use crate::common::paper;
use excitation::constraint::Cone;
use excitation::constraint::{
    BaseAttitude, BaseRate, Clearance, FrameSpeed, HeldSystem, JointTorque, Pairs, PassiveRange, Pointing,
};
use excitation::objective::{BaseMotion, Form};
use excitation::plan::PlanError;
use excitation::solve::Problem;
use excitation::solve::Status;
use excitation::solve::{Basis, ConstraintMargin};
use excitation::solve::{Conflict, verify};
use excitation::system::rigid::RigidBase;
use excitation::*;
use ff_mission::Loaded;
use ff_model::tree::Shape;
use ff_model::tree::Solid;
use ff_model::{Params, Xform};
use nalgebra::{Vector3, Vector6};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

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
    let bare = search(&Problem::new(&cost, plan), None, &options(1, 40), &Observer::default()).unwrap();
    let problem = Problem::new(&cost, plan).under(&list);
    let before = verify(&problem, Some(system), &bare.best.x).unwrap();
    assert!(!before.holds, "the constraint does not matter: {:?}", before.worst());
    let found = search(&problem, Some(system), &options(1, 60), &Observer::default()).unwrap();
    let own: Vec<&ConstraintMargin> =
        found.verdict.margins.iter().filter(|m| matches!(m.basis, Basis::Samples(_))).collect();
    let tightest = own.iter().min_by(|a, b| a.relative.total_cmp(&b.relative)).unwrap();
    eprintln!(
        "{} of {}: cost {:.3} free, {:.3} held; broken before by {:.3}, now {:.5} of {} {} (margin {:.2e}, {:?}); {:?}, \
         {} iterations, {} rounds",
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
#[ignore = "full tier: 3 s"]
fn torque_is_held() {
    let (loaded, system) = system("flex.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(20.0), 6);
    let limits = [3.0, 2.5, 2.0, 1.5, 1.0, 0.4, 0.2];
    active(&system, &plan, &JointTorque::new(&system, &hold(&loaded), &limits).unwrap(), 0.02);
}

#[test]
fn base_rate_is_held() {
    let (loaded, system) = system("slosh.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(20.0), 6);
    active(&system, &plan, &BaseRate::new(&system, &hold(&loaded), 0.012).unwrap(), 0.02);
}

#[test]
fn base_attitude_is_held() {
    let (loaded, system) = system("flex.toml");
    let q = hold(&loaded);
    let plan = plan(&q, End::Fixed(q.clone()), Duration::Free { min: 15.0, max: 25.0 }, 6);
    active(&system, &plan, &BaseAttitude::new(&system, &q, 0.03).unwrap(), 0.02);
}

#[test]
#[ignore = "full tier: 3 s"]
fn pointing_is_held() {
    let (loaded, system) = system("flex.toml");
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(20.0), 6);
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
    let plan = plan(&hold(&loaded), End::Free, Duration::Fixed(20.0), 6);
    let tool = loaded.mission.robot.end_effector.clone().unwrap();
    active(&system, &plan, &FrameSpeed::new(&system, &tool, 0.25).unwrap(), 0.02);
}

#[test]
fn clearance_is_held() {
    let (loaded, system) = system("slosh.toml");
    let q = hold(&loaded);
    let mut end = q.clone();
    end[0] += 1.3;
    let plan = plan(&q, End::Fixed(end), Duration::Fixed(20.0), 6);
    // A ball in the way of the hand: where it comes along when there is none.
    let cost = shake(&system);
    let bare = search(&Problem::new(&cost, &plan), None, &options(1, 40), &Observer::default()).unwrap();
    let motion = plan.motion(&bare.best.x).unwrap();
    let tool = loaded.model.frame(loaded.mission.robot.end_effector.as_ref().unwrap()).unwrap();
    let mut state = ff_dynamics::State::zero(&loaded.model);
    motion.derivative(9.0, 0, &mut state.q);
    let at = ff_dynamics::frame_pose(&loaded.model, &state, tool, &mut ff_dynamics::Work::new(&loaded.model));
    let ball = Solid {
        name: "ball".into(),
        body: 0,
        placement: Xform::new(at.rot, at.pos + Vector3::new(0.03, 0.02, 0.25)),
        shape: Shape::Sphere { radius: 0.2 },
    };
    let shape = Shape::Capsule { radius: 0.05, length: 0.2 };
    let hand = Solid { name: "hand".into(), body: tool.body, placement: tool.placement, shape };
    let keep_out = Clearance::new(&loaded.model, &[ball, hand], Pairs::With(&["ball"]), &[], 0.04).unwrap();
    active(&system, &plan, &keep_out, 0.1);
}

#[test]
#[ignore = "full tier: 4 s"]
fn deflection_and_slosh_are_held() {
    for (file, limit) in [("flex.toml", 0.004), ("slosh.toml", 0.05)] {
        let (loaded, system) = system(file);
        let q = hold(&loaded);
        let plan = plan(&q, End::Free, Duration::Fixed(20.0), 6);
        active(&system, &plan, &PassiveRange::all(&system, &q, "rad", limit).unwrap(), 0.05);
    }
}

/// Two demands that each can be kept, but not together, and the same demands apart.
fn conflict(system: &Arc<HeldSystem>, plan: &SplinePlan, constraints: &[&dyn Constraint]) -> Conflict {
    let cost = shake(system);
    let problem = Problem::new(&cost, plan).under(constraints);
    let e = search(&problem, Some(system), &options(2, 10), &Observer::default()).unwrap_err();
    eprintln!("{e}");
    assert!(e.is_ill_posed());
    match e {
        PlanError::Conflict(c) => *c,
        other => panic!("{other}"),
    }
}

fn named(c: &Conflict) -> Vec<(&str, &str)> {
    let mut out: Vec<_> = c.demands.iter().map(|d| (d.name.as_str(), d.item.as_str())).collect();
    out.sort_unstable();
    out
}

#[test]
fn a_way_too_long_for_the_speed_limit_is_named_with_the_time_it_needs() {
    let (loaded, system) = system("flex.toml");
    let q = hold(&loaded);
    let mut end = q.clone();
    end[2] += 1.9;
    let plan = plan(&q, End::Fixed(end), Duration::Free { min: 5.0, max: 9.0 }, 8);
    let c = conflict(&system, &plan, &[]);
    assert_eq!(named(&c), [("duration", "the plan"), ("joint speed", "joint3")]);
    // 1.9 rad at 0.17 rad/s is 11.2 s, and a spline that starts and ends at rest needs somewhat longer.
    let needed = c.demands.iter().find(|d| d.unit == "s").unwrap().possible.unwrap();
    assert!(needed > 11.2 && needed < 20.0, "{needed}");
    // The next step names the duration that would do.
    assert!(c.next.contains(&format!("{needed:.4}")), "{}", c.next);
}

#[test]
#[ignore = "full tier: 7 s"]
fn demands_that_conflict_are_named() {
    let (loaded, system) = system("slosh.toml");
    let q = hold(&loaded);
    let mut end = q.clone();
    end[0] += 1.2;
    end[1] += 0.7;
    // The base turns by conserved momentum when the arm moves: an excursion that small needs the arm at home.
    let slow = plan(&q, End::Fixed(end.clone()), Duration::Fixed(20.0), 6);
    let attitude = BaseAttitude::new(&system, &q, 0.004).unwrap();
    let rate = BaseRate::new(&system, &q, 0.5).unwrap();
    let torque = JointTorque::new(&system, &q, &[50.0; 7]).unwrap();
    let c = conflict(&system, &slow, &[&rate, &attitude, &torque]);
    // More speed of some joints would help too: they may turn the base back.
    assert!(named(&c)[0] == ("base attitude excursion", "base") && named(&c)[1..].iter().all(|d| d.0 == "joint speed"));
    let possible = c.demands.iter().find(|d| d.unit == "rad").unwrap().possible.unwrap();
    assert!(possible > 0.004 && possible < 0.3, "{possible}");
    // What it says is possible is possible.
    let loose = BaseAttitude::new(&system, &q, 1.3 * possible).unwrap();
    let cost = shake(&system);
    let problem = Problem::new(&cost, &slow).under(&[&rate, &loose, &torque]);
    let found = search(&problem, Some(&system), &options(1, 5), &Observer::default());
    assert!(found.is_ok(), "{}", found.unwrap_err());

    // The move takes work, and no joint may do any to speak of.
    let weak = JointTorque::new(&system, &q, &[0.002; 7]).unwrap();
    let wide = BaseAttitude::new(&system, &q, 2.0).unwrap();
    let short = plan(&q, slow.spec().end.clone(), Duration::Fixed(20.0), 3);
    let c = conflict(&system, &short, &[&weak, &wide]);
    assert!(named(&c).iter().any(|d| d.0 == "joint torque") && !named(&c).iter().any(|d| d.1 == "base"), "{c}");
}

#[test]
fn a_cone_that_is_left_at_the_start_is_named() {
    let (loaded, system) = system("flex.toml");
    let q = hold(&loaded);
    let plan = plan(&q, End::Free, Duration::Fixed(25.0), 6);
    let axis = Vector3::new(0.1, -0.9, 0.4);
    // Within 0.05 rad of where it points at the start, and at least 0.02 rad away from that.
    let near = Pointing::new(&system, &q, "antenna", &axis, &axis, Cone::Within(0.05)).unwrap();
    let far = Pointing::new(&system, &q, "tracker", &axis, &axis, Cone::Outside(0.02)).unwrap();
    let c = conflict(&system, &plan, &[&near, &far]);
    // At the start the axis is where it is: the second cone alone cannot be kept.
    assert_eq!(named(&c), [("pointing angle", "tracker")], "{c}");
}

#[test]
fn interruption_keeps_the_best_feasible_plan_and_threads_do_not_matter() {
    let (loaded, system) = system("slosh.toml");
    let q = hold(&loaded);
    let plan = plan(&q, End::Free, Duration::Fixed(20.0), 6);
    let rate = BaseRate::new(&system, &q, 0.012).unwrap();
    let cost = shake(&system);
    let list: [&dyn Constraint; 1] = [&rate];
    let problem = Problem::new(&cost, &plan).under(&list);
    let few = |threads| SearchOptions { threads, ..options(3, 12) };
    let one = search(&problem, Some(&system), &few(1), &Observer::default()).unwrap();
    let two = search(&problem, Some(&system), &few(2), &Observer::default()).unwrap();
    assert_eq!((&one.best, &one.all, &one.verdict), (&two.best, &two.all, &two.verdict)); // bit for bit

    // By the callback, after some iterations; by a flag, at once; by time.
    let (calls, seen) = (AtomicUsize::new(0), std::sync::Mutex::new(Vec::new()));
    let progress = |p: &Progress| {
        seen.lock().unwrap().push(*p);
        calls.fetch_add(1, Ordering::Relaxed) < 7
    };
    let observer = Observer { progress: Some(&progress), ..Observer::default() };
    let cut = search(&problem, Some(&system), &few(1), &observer).unwrap();
    assert_eq!(cut.best.status, Status::Interrupted);
    assert!(cut.verdict.holds, "{:?}", cut.verdict.worst());
    assert!(cut.best.cost >= one.best.cost);
    let seen = seen.lock().unwrap();
    // The best of what was feasible when it was seen.
    let feasible = seen.iter().filter(|p| p.start == 0 && p.excess <= 0.0 && p.cost.is_finite());
    assert_eq!(cut.all[0].as_ref().unwrap().cost, feasible.map(|p| p.cost).fold(f64::INFINITY, f64::min));
    assert!(seen[0].start == 0 && seen[0].iteration == 0 && seen[5].iteration == 5);

    let stop = AtomicBool::new(true);
    let observer = Observer { stop: Some(&stop), ..Observer::default() };
    let cut = search(&problem, Some(&system), &few(2), &observer).unwrap();
    assert!(cut.best.status == Status::Interrupted && cut.best.iterations == 0 && cut.verdict.holds);

    let soon = SearchOptions { time_limit: Some(std::time::Duration::from_millis(150)), ..options(2, 100_000) };
    let cut = search(&problem, Some(&system), &soon, &Observer::default()).unwrap();
    assert!(cut.best.status == Status::TimeLimit && cut.verdict.holds);
}

/// Eq. (9): seven joints, ten control points each, free duration, the paper's limits.
#[test]
#[ignore = "full tier: 3 s"]
fn seven_joints_ten_points_free_duration() {
    let (loaded, system) = system("flex.toml");
    let q = hold(&loaded);
    let plan = plan(&q, End::Fixed(q.clone()), Duration::Free { min: 20.0, max: 60.0 }, 10);
    assert_eq!(plan.variables(), 71);
    let cost = shake(&system);
    let efforts = [20.0; 7];
    let list: [&dyn Constraint; 3] = [
        &JointTorque::new(&system, &q, &efforts).unwrap(),
        &BaseAttitude::new(&system, &q, 0.1).unwrap(),
        &PassiveRange::all(&system, &q, "rad", 0.05).unwrap(),
    ];
    let bare = search(&Problem::new(&cost, &plan), None, &options(2, 100), &Observer::default()).unwrap();
    let problem = Problem::new(&cost, &plan).under(&list);
    let found = search(&problem, Some(&system), &options(2, 30), &Observer::default()).unwrap();
    eprintln!("two starts: {} rounds", found.rounds);
    eprintln!(
        "  {:.4} {:?} {} its; {:.4} {:?}",
        bare.best.cost, bare.best.status, bare.best.iterations, found.best.cost, found.best.status
    );
    eprintln!("  tightest {:?}", found.verdict.worst());
    assert!(found.verdict.holds);
    // Work instead of time: iterations and evaluations of both searches.
    for o in bare.all.iter().flatten() {
        assert!(o.iterations <= 100 && o.evaluations < 10 * o.iterations, "{} in {}", o.evaluations, o.iterations);
    }
}
