//! Gradients, limits between the knots, and times.

use super::truth::Swing;
use super::{CONTROL_POINTS, FREE, RECORD_S, SEARCH_STEP_S, Setup, fisher_request, modal_cost, quiet_cost};
use crate::study::figures::{Op, Study};
use anyhow::Context;
use excitation::objective::{BaseMotion, FisherCost, Form, Optimality};
use excitation::plan_fisher;
use excitation::planning::{FisherRequest, base_quantities};
use excitation::solve::minimise;
use excitation::system::rigid::RigidBase;
use excitation::{Cost, Criterion, Duration, JointLimits, PlanSpec, SplinePlan, random_plan};
use ff_dynamics::motion::JointMotion;
use nalgebra::Vector6;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

/// Eq. (10), corrected: the component of the base's angular acceleration along the hinges.
fn eq_10(s: &Setup) -> anyhow::Result<BaseMotion<RigidBase>> {
    Ok(BaseMotion {
        response: RigidBase::new(s.model(), &s.params)?,
        directions: vec![Vector6::new(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)],
        samples: 121,
        form: Form::Log,
    })
}

/// Every goal's gradient against fourth-order central differences along random directions, duration included.
pub(super) fn gradients(s: &Setup, study: &mut Study) -> anyhow::Result<()> {
    let plan = s.plan(FREE, CONTROL_POINTS)?;
    let x = random_plan(&plan, s.seed, 900, 0.8)?;
    let swing = Swing::new(s.model(), &s.params, &s.start, s.noise)?;
    let modal = modal_cost(s, &swing, &[(0, 1.0, 0.02), (1, 0.5, 0.04)])?;
    let condition = Optimality { information: s.rigid_cost()?, criterion: Criterion::Condition { power: 8.0 } };
    let flexible = s.information(if s.quick { 0.3 } else { SEARCH_STEP_S })?;
    let quantities = base_quantities(&flexible).context("all ten parameters of the base")?;
    let fisher = |criterion| FisherCost { information: flexible.clone(), criterion };
    let (quiet, eq_10) = (quiet_cost(s, &plan)?, eq_10(s)?);
    let d = fisher(Criterion::D);
    let largest = fisher(Criterion::Largest { quantities, power: super::POWER });
    let goals: [(&str, &dyn Cost, u64); 6] = [
        ("a_base_motion", &eq_10, 8),
        ("b_modal", &modal, 8),
        ("c_information_d", &d, 2),
        ("c_information_largest", &largest, 2),
        ("d_quiet", &quiet, 8),
        ("e_condition", &condition, 8),
    ];
    for (name, cost, directions) in goals {
        let error = error(cost, &plan, &x, directions, s.seed);
        study.limited(format!("gradient.{name}"), "", error, Op::AtMost, 1e-6);
    }
    Ok(())
}

/// Largest error of a directional derivative, relative to the norm of the gradient (scaled as the direction is).
fn error(cost: &dyn Cost, plan: &SplinePlan, x: &[f64], directions: u64, seed: u64) -> f64 {
    let n = plan.variables();
    let (mut g, mut scrap) = (vec![0.0; n], vec![0.0; n]);
    let value = cost.value_gradient(plan, x, &mut g);
    let mut worst = if value.is_finite() { 0.0 } else { f64::INFINITY };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let size = |i: usize| if Some(i) == plan.duration_index() { 10.0 } else { 1.0 };
    for _ in 0..directions {
        let d: Vec<f64> = (0..n).map(|i| size(i) * (2.0 * rng.random::<f64>() - 1.0)).collect();
        let mut at = |h: f64| {
            let y: Vec<f64> = x.iter().zip(&d).map(|(x, d)| x + h * d).collect();
            cost.value_gradient(plan, &y, &mut scrap)
        };
        let h = 1e-3;
        let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        let exact: f64 = g.iter().zip(&d).map(|(g, d)| g * d).sum();
        let scale = (0..n).map(|i| (g[i] * size(i)).powi(2)).sum::<f64>().sqrt();
        worst = f64::max(worst, (exact - slope).abs() / scale);
    }
    worst
}

/// Random plans sampled a hundred times per knot span.
pub(super) fn violations(s: &Setup, study: &mut Study) -> anyhow::Result<()> {
    let count = if s.quick { 20 } else { 200 };
    let (mut samples, mut violated, mut closest) = (0_usize, 0_usize, 0.0_f64);
    for i in 0..count {
        // Every other plan with a limit on the jerk, too; free durations in between.
        let limits = s.limits.iter().map(|l| JointLimits { jerk: (i % 2 == 1).then_some(0.3), ..*l }).collect();
        let plan = SplinePlan::new(PlanSpec {
            limits,
            duration: if i % 3 == 2 { FREE } else { Duration::Fixed(RECORD_S) },
            ..s.plan(Duration::Fixed(RECORD_S), CONTROL_POINTS)?.spec().clone()
        })?;
        let motion = plan.motion(&random_plan(&plan, s.seed, 1000 + i, 1.0)?)?;
        let n = motion.dof();
        let spans = plan.unit_knots().count() - plan.unit_knots().degree();
        let (knots, control) = motion.derivative_control(3)?;
        let jerk = ff_dynamics::motion::bspline::BSplineMotion::new(knots, control)?;
        let (mut q, mut qd, mut qdd, mut qddd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut scrap = [vec![0.0; n], vec![0.0; n]];
        for k in 0..=100 * spans {
            let t = motion.duration() * k as f64 / (100 * spans) as f64;
            motion.eval(t, &mut q, &mut qd, &mut qdd);
            let [a, b] = &mut scrap;
            jerk.eval(t, &mut qddd, a, b);
            for (j, l) in plan.spec().limits.iter().enumerate() {
                let range = 0.5 * (l.upper - l.lower);
                let ratios = [
                    (q[j] - 0.5 * (l.upper + l.lower)).abs() / range,
                    qd[j].abs() / l.velocity,
                    qdd[j].abs() / l.acceleration,
                    l.jerk.map_or(0.0, |most| qddd[j].abs() / most),
                ];
                for r in ratios {
                    samples += 1;
                    violated += usize::from(r.is_nan() || r > 1.0 + 1e-12);
                    closest = closest.max(r);
                }
            }
        }
    }
    study.figure("limits.plans", "", count as f64);
    study.figure("limits.samples", "", samples as f64);
    study.figure("limits.largest_use", "%", 100.0 * closest);
    study.limited("limits.violations", "", violated as f64, Op::AtMost, 0.0);
    Ok(())
}

/// Eq. (9) for every goal: seven joints, ten control points each, free duration.
pub(super) fn times(s: &Setup, study: &mut Study) -> anyhow::Result<()> {
    let plan = s.plan(FREE, CONTROL_POINTS)?;
    let swing = Swing::new(s.model(), &s.params, &s.start, s.noise)?;
    let (eq_10, modal, quiet) =
        (eq_10(s)?, modal_cost(s, &swing, &[(0, 1.0, 0.02), (1, 1.0, 0.04)])?, quiet_cost(s, &plan)?);
    let goals: [(&str, &dyn Cost); 3] = [("a", &eq_10), ("b", &modal), ("d", &quiet)];
    let options = s.options(200);
    for (name, cost) in goals {
        let clock = Instant::now();
        let o = minimise(cost, &plan, &random_plan(&plan, s.seed, 1, 0.5)?, &options)?;
        study.judged(s.quick, format!("seconds.{name}"), "s", clock.elapsed().as_secs_f64(), (Op::AtMost, 30.0));
        study.note(format!(
            "goal ({name}), free duration: {:?} after {} iterations, {:.1} s long",
            o.status,
            o.iterations,
            plan.duration(&o.x)
        ));
    }
    let information = s.information(SEARCH_STEP_S)?;
    let quantities = base_quantities(&information).context("all ten parameters of the base")?;
    let criterion = Criterion::Largest { quantities, power: super::POWER };
    let request = FisherRequest { duration: FREE, refined: 1, starts: 2, ..fisher_request(s, RECORD_S) };
    let clock = Instant::now();
    let p = plan_fisher(s.model(), &s.params, &information, &criterion, s.noise, &request)?;
    study.judged(s.quick, "seconds.c", "s", clock.elapsed().as_secs_f64(), (Op::AtMost, 180.0));
    study.note(format!(
        "goal (c), free duration: {:?} after {} iterations, {:.1} s long",
        p.outcome.status,
        p.outcome.iterations,
        p.plan.duration(&p.x)
    ));
    Ok(())
}
