//! Limits that hold for all time, and rest at both ends.

use crate::common::{limits, spec};
use excitation::plan::{Extent, LimitError, PlanError, PlanLimit, Quantity, Shape};
use excitation::*;
use ff_dynamics::motion::JointMotion;
use ff_testkit::assert_within;

#[test]
fn no_sample_of_200_random_plans_breaks_a_limit() {
    let mut tightest = [0.0f64; 4];
    for (k, refine) in (0..200).zip([1, 3].into_iter().cycle()) {
        let mut s = spec(3, 4 + k % 9);
        s.refine = refine;
        s.degree = 4 + k % 3;
        if k % 4 == 0 {
            s.end = End::Free;
        }
        if k % 5 == 0 {
            s.duration = Duration::Free { min: 17.0, max: 60.0 };
        }
        let plan = SplinePlan::new(s).unwrap();
        let x = random_plan(&plan, 2024, k as u64, 1.0).unwrap();
        let m = plan.motion(&x).unwrap();
        assert!(check_for_all_time(&m, &limits(3), refine).unwrap().holds);
        let spans = m.knots().count() - m.knots().degree();
        let mut y = [[0.0; 3]; 4];
        for i in 0..=100 * spans {
            let t = m.duration() * i as f64 / (100 * spans) as f64;
            for (order, row) in y.iter_mut().enumerate() {
                m.derivative(t, order, row);
            }
            for (j, l) in limits(3).iter().enumerate() {
                assert!(y[0][j] >= l.lower - 1e-12 && y[0][j] <= l.upper + 1e-12);
                let caps = [1.0, l.velocity, l.acceleration, l.jerk.unwrap_or(f64::INFINITY)];
                for order in 1..4 {
                    let used = y[order][j].abs() / caps[order];
                    assert!(used <= 1.0 + 1e-12, "plan {k}, joint {j}, order {order}: {used}");
                    tightest[order] = tightest[order].max(used);
                }
            }
        }
    }
    // The test means nothing if no plan comes near its limits.
    eprintln!("largest use of velocity, acceleration, jerk limits: {:?}", &tightest[1..]);
    assert!(tightest[1] > 0.5 && tightest[2] > 0.5, "{tightest:?}");
}

#[test]
fn rest_to_rest_is_exact() {
    let plan = SplinePlan::new(spec(3, 6)).unwrap();
    let m = plan.motion(&random_plan(&plan, 5, 0, 0.5).unwrap()).unwrap();
    for (t, want) in [(0.0, [0.2, 0.1 + 0.2, 0.2 + 2.0 * 0.1]), (19.0, [0.3, 0.3 - 0.13, 0.3 - 2.0 * 0.13])] {
        let (mut q, mut qd, mut qdd) = ([0.0; 3], [1.0; 3], [1.0; 3]);
        m.eval(t, &mut q, &mut qd, &mut qdd);
        for j in 0..3 {
            assert_within!((q[j] - want[j]).abs(), 1e-15);
            assert_eq!((qd[j], qdd[j]), (0.0, 0.0));
        }
    }
}

#[test]
fn refinement_reduces_conservatism_and_reports_the_worst() {
    let plan = SplinePlan::new(spec(3, 9)).unwrap();
    let m = plan.motion(&random_plan(&plan, 8, 1, 1.0).unwrap()).unwrap();
    let at = |r| check_for_all_time(&m, &limits(3), r).unwrap();
    let (coarse, fine) = (at(1), at(8));
    for (a, b) in coarse.margins.iter().zip(&fine.margins) {
        assert_eq!((a.joint, a.quantity), (b.joint, b.quantity));
        assert!(b.margin >= a.margin - 1e-12);
    }
    let w = coarse.worst().unwrap();
    let mut y = [0.0; 3];
    m.derivative(w.time, if w.quantity == Quantity::Acceleration { 2 } else { 1 }, &mut y);
    assert!(y[w.joint].abs() <= w.bound + 1e-12);
    let mut tight = limits(3);
    tight[1].velocity = 0.02;
    let r = check_for_all_time(&m, &tight, 8).unwrap();
    assert!(!r.holds);
    let w = r.worst().unwrap();
    assert_eq!((w.joint, w.quantity), (1, Quantity::Velocity));
}

#[test]
fn manoeuvre_peaks_are_checked() {
    let c =
        JointCommand { joint: 1, shape: Shape::Single, extent: Extent::Angle(0.9), velocity: 0.17, acceleration: 0.15 };
    let spec =
        ManoeuvreSpec { start: vec![0.1, 0.2, 0.3], commands: vec![c], ramp: 0.5, lead: 0.0, hold: 10.0, grid: None };
    let m = Manoeuvre::new(&spec).unwrap();
    assert!(check_manoeuvre(&m, &limits(3)).unwrap().holds);
    let mut low = limits(3);
    low[1].upper = 1.0;
    let r = check_manoeuvre(&m, &low).unwrap();
    assert!(!r.holds);
    assert_eq!(r.worst().unwrap().quantity, Quantity::Upper);
}

#[test]
fn impossible_demands_are_named() {
    let broken = |f: fn(&mut PlanSpec)| {
        let mut s = spec(3, 6);
        f(&mut s);
        SplinePlan::new(s).unwrap_err()
    };
    let start = broken(|s| s.start[2] = 2.9);
    assert!(matches!(
        start,
        PlanError::Infeasible { which: PlanLimit { joint: Some(2), quantity: Quantity::Upper, .. } }
    ));
    assert!(start.to_string().starts_with("upper position limit 2.1"), "{start}");
    assert!(matches!(broken(|s| s.limits[0].velocity = -1.0), PlanError::Limits(LimitError::Limits { joint: 0, .. })));
    assert!(matches!(broken(|s| s.limits.truncate(2)), PlanError::Limits(LimitError::Count { got: 2, dof: 3 })));
    assert!(matches!(broken(|s| s.duration = Duration::Fixed(-1.0)), PlanError::Spline(_)));
    assert!(matches!(broken(|s| s.degree = 2), PlanError::Argument { what: "degree", .. }));
    assert!(matches!(broken(|s| s.free = 0), PlanError::Argument { what: "free control points", .. }));
    assert!(matches!(broken(|s| s.start[0] = f64::NAN), PlanError::Argument { what: "configuration", .. }));

    // The way is too long for the speed limit: found by the certificate of infeasibility.
    let mut s = spec(3, 6);
    s.end = End::Fixed(vec![0.3, 0.17, 2.1]);
    s.duration = Duration::Fixed(5.0);
    let plan = SplinePlan::new(s).unwrap();
    let e = random_plan(&plan, 1, 0, 0.5).unwrap_err();
    assert!(matches!(e, PlanError::Infeasible { which: PlanLimit { joint: Some(2), .. } }), "{e}");
}
