//! The optimiser: feasibility, honesty, and the 70-variable problem of the benchmark.

use crate::common::{Toy, ToyRegressor, spec};
use excitation::objective::{BaseMotion, Form, Information, Modal, Quiet, Target};
use excitation::plan::{PlanError, PlanLimit};
use excitation::solve::Status;
use excitation::solve::minimise;
use excitation::solve::multi_start;
use excitation::*;
use ff_testkit::assert_within;
use nalgebra::Vector6;

/// Seven joints, ten free quintic control points each: 70 variables, 322 rate rows, 140 position bounds.
fn benchmark() -> (SplinePlan, Information<ToyRegressor>) {
    let mut s = spec(7, 10);
    s.end = End::Fixed(s.start.clone());
    s.duration = Duration::Fixed(30.0);
    s.limits.iter_mut().for_each(|l| l.jerk = None);
    let plan = SplinePlan::new(s).unwrap();
    let source = ToyRegressor { n: 7, analytic: true };
    (plan, Information { source, samples: 100, rate: 10.0, delta: 1e-6 })
}

#[test]
fn seventy_variables() {
    let (plan, cost) = benchmark();
    assert_eq!(plan.variables(), 70);
    let m = multi_start(&cost, &plan, 7, 3, &SqpOptions::default()).unwrap();
    for o in m.all.iter().map(|o| o.as_ref().unwrap()) {
        eprintln!("{:?} {:.3} -> {:.4}, {} its, {} evals", o.status, o.start_cost, o.cost, o.iterations, o.evaluations);
        assert!(plan.violated(&o.x).is_none());
        assert!(check_for_all_time(&plan.motion(&o.x).unwrap(), &plan.spec().limits, 1).unwrap().holds);
        assert!(o.cost < o.start_cost - 5.0);
        assert_eq!(o.status, Status::Converged);
    }
    // A true local minimum: no feasible random direction leads down, beyond what the tolerance allows.
    let mut g = vec![0.0; 70];
    let value = cost.value_gradient(&plan, &m.best.x, &mut g);
    for stream in 0..200 {
        let other = random_plan(&plan, 99, stream, 0.5).unwrap();
        let slope: f64 = g.iter().zip(other.iter().zip(&m.best.x)).map(|(g, (a, b))| g * (a - b)).sum();
        assert!(slope > -1e-3 * (1.0 + value.abs()), "slope {slope} towards random plan {stream}");
    }
    eprintln!("3 starts, best {:.4}", m.best.cost);
    let again = multi_start(&cost, &plan, 7, 3, &SqpOptions::default()).unwrap();
    assert_eq!(again.best, m.best); // bit for bit
}

#[test]
fn limits_are_reached_and_the_gradient_is_blocked_there() {
    // A linear pull on the mode with one joint: the optimum is bang-bang, on the limits.
    let mut s = spec(1, 8);
    s.end = End::Fixed(s.start.clone());
    s.limits[0].jerk = None;
    let plan = SplinePlan::new(s).unwrap();
    let cost =
        Modal { targets: vec![Target { frequency: 0.11, weights: vec![1.0], importance: 1.0 }], form: Form::Log };
    let m = multi_start(&cost, &plan, 3, 4, &SqpOptions::default()).unwrap();
    assert_eq!(m.best.status, Status::Converged);
    let r = check_for_all_time(&plan.motion(&m.best.x).unwrap(), &plan.spec().limits, 1).unwrap();
    assert!(r.holds);
    assert_within!(r.worst().unwrap().margin, 1e-6, "{:?}", r.worst());
}

#[test]
fn free_duration_stays_feasible_and_pays() {
    let build = |duration| {
        let mut s = spec(3, 6);
        s.duration = duration;
        s.end = End::Free;
        SplinePlan::new(s).unwrap()
    };
    let cost = BaseMotion {
        response: Toy(3),
        directions: vec![Vector6::new(0.0, 0.0, 0.0, 0.36, 0.48, 0.8)],
        samples: 81,
        form: Form::Log,
    };
    let fixed = multi_start(&cost, &build(Duration::Fixed(12.0)), 9, 3, &SqpOptions::default()).unwrap();
    let plan = build(Duration::Free { min: 12.0, max: 25.0 });
    let free = multi_start(&cost, &plan, 9, 3, &SqpOptions::default()).unwrap();
    for o in free.all.iter().flatten() {
        eprintln!("free: {:?} {:.4} -> {:.4}, T = {:.3}", o.status, o.start_cost, o.cost, plan.duration(&o.x));
        assert!(plan.violated(&o.x).is_none());
        let r = check_for_all_time(&plan.motion(&o.x).unwrap(), &plan.spec().limits, 1).unwrap();
        assert!(r.holds, "{:?}", r.worst());
    }
    eprintln!("fixed {:?} {:.4}", fixed.best.status, fixed.best.cost);
    assert!(free.best.cost < fixed.best.cost);
}

#[test]
fn quiet_penalty_empties_the_band() {
    let mut s = spec(3, 14);
    s.end = End::Fixed(s.start.clone());
    s.duration = Duration::Fixed(60.0);
    let plan = SplinePlan::new(s).unwrap();
    let quiet = || Quiet { low: 0.1, high: 0.3, points: 49, weights: vec![1.0; 3] };
    let information =
        || Information { source: ToyRegressor { n: 3, analytic: true }, samples: 120, rate: 10.0, delta: 1e-6 };
    let energy = |x: &[f64]| quiet().value_gradient(&plan, x, &mut vec![0.0; x.len()]);
    let value = |x: &[f64]| information().value_gradient(&plan, x, &mut vec![0.0; x.len()]);
    let options = SqpOptions { iterations: 120, ..SqpOptions::default() };
    let start = random_plan(&plan, 4, 0, 0.8).unwrap();
    let loud = minimise(&information(), &plan, &start, &options).unwrap();
    let both = CostSum(vec![(1.0, Box::new(information())), (1e4, Box::new(quiet()))]);
    let calm = minimise(&both, &plan, &start, &options).unwrap();
    eprintln!(
        "band energy {:.3e} -> {:.3e}, information {:.2} -> {:.2}",
        energy(&loud.x),
        energy(&calm.x),
        value(&loud.x),
        value(&calm.x)
    );
    assert!(energy(&calm.x) < 0.05 * energy(&loud.x));
}

#[test]
fn bad_starts_are_refused() {
    let (plan, cost) = benchmark();
    let mut x = random_plan(&plan, 1, 0, 0.5).unwrap();
    x[13] += 4.0;
    let e = minimise(&cost, &plan, &x, &SqpOptions::default()).unwrap_err();
    assert!(matches!(e, PlanError::Infeasible { which: PlanLimit { joint: Some(1), .. } }), "{e}");
    assert!(matches!(minimise(&cost, &plan, &x[1..], &SqpOptions::default()), Err(PlanError::Argument { .. })));
    x[13] = f64::NAN;
    assert!(minimise(&cost, &plan, &x, &SqpOptions::default()).is_err());
    assert!(matches!(multi_start(&cost, &plan, 1, 0, &SqpOptions::default()), Err(PlanError::Argument { .. })));
    let one = SqpOptions { iterations: 1, ..SqpOptions::default() };
    let x = random_plan(&plan, 1, 0, 0.5).unwrap();
    assert_eq!(minimise(&cost, &plan, &x, &one).unwrap().status, Status::IterationLimit);
}
