//! Constraints: exact Jacobians, rows above every sample, and the held system against the dynamics crate.

#![allow(clippy::unwrap_used)] // helpers outside #[test] functions

mod common;

use common::paper;
use excitation::*;
use ff_model::mission::Loaded;
use ff_model::urdf::collision::{Shape, Solid};
use ff_model::{Params, Xform};
use nalgebra::{DMatrix, Vector3};
use std::sync::Arc;

fn system(file: &str) -> (Loaded, Arc<HeldSystem>) {
    let loaded = paper(file);
    let system = HeldSystem::new(&loaded.model, &Params::nominal(&loaded.model)).unwrap();
    (loaded, Arc::new(system))
}

fn plan(start: &[f64], duration: Duration) -> SplinePlan {
    let limits = JointLimits { lower: -2.9, upper: 2.9, velocity: 0.3, acceleration: 0.25, jerk: None };
    SplinePlan::new(PlanSpec {
        start: start.to_vec(),
        end: End::Free,
        duration,
        degree: 5,
        free: 6,
        limits: vec![limits; start.len()],
        refine: 1,
    })
    .unwrap()
}

fn hold(loaded: &Loaded) -> Vec<f64> {
    loaded.mission.reproduce.as_ref().unwrap().hold_rad.iter().map(|q| q + 0.11).collect()
}

/// Solids on the base, the elbow and the hand; sizes and places general.
fn solids(loaded: &Loaded) -> Vec<Solid> {
    let turn = ff_model::so3::rot_of_rpy(&Vector3::new(0.3, -0.4, 0.7));
    let solid = |name: &str, body, at: [f64; 3], shape| Solid {
        name: name.into(),
        body,
        placement: Xform::new(turn, Vector3::from(at)),
        shape,
    };
    let last = loaded.model.n_bodies() - 1;
    vec![
        solid("tank", 0, [0.4, 0.6, 1.9], Shape::Capsule { radius: 0.12, length: 0.5 }),
        solid("bus", 0, [0.9, -0.2, 0.3], Shape::Sphere { radius: 0.31 }),
        solid("elbow", 3, [0.05, 0.02, 0.1], Shape::Capsule { radius: 0.07, length: 0.23 }),
        solid("hand", last, [0.01, 0.03, 0.2], Shape::Capsule { radius: 0.05, length: 0.17 }),
        solid("wrist", last - 1, [0.02, 0.05, 0.1], Shape::Box { size: [0.12, 0.17, 0.09] }),
        solid("finger", last, [0.06, 0.03, 0.3], Shape::Sphere { radius: 0.04 }),
    ]
}

fn all(loaded: &Loaded, system: &Arc<HeldSystem>, q: &[f64]) -> Vec<Box<dyn Constraint>> {
    let (axis, target) = (Vector3::new(0.2, -0.9, 0.4), Vector3::new(-0.1, 0.7, 0.6));
    let n = loaded.model.nj();
    let efforts: Vec<f64> = (0..n).map(|i| 2.0 + 0.3 * i as f64).collect();
    let hand = loaded.model.body_name(loaded.model.n_bodies() - 1).to_owned();
    vec![
        Box::new(JointTorque::new(system, q, &efforts).unwrap()),
        Box::new(BaseRate::new(system, q, 0.02).unwrap()),
        Box::new(BaseAttitude::new(system, q, 0.1).unwrap()),
        Box::new(Pointing::new(system, q, "antenna", &axis, &target, Cone::Within(0.6)).unwrap()),
        Box::new(Pointing::new(system, q, "tracker", &axis, &target, Cone::Outside(0.3)).unwrap()),
        Box::new(FrameSpeed::new(system, &hand, 0.3).unwrap()),
        Box::new(PassiveRange::all(system, q, "rad", 0.01).unwrap()),
        Box::new(Clearance::new(&loaded.model, &solids(loaded), Pairs::Distant, &[], 0.05).unwrap()),
    ]
}

fn rows_of(c: &dyn Constraint, plan: &SplinePlan, x: &[f64]) -> Vec<f64> {
    let mut rows = vec![0.0; c.channels().len() * c.samples(plan)];
    c.evaluate(plan, x, &mut rows, None);
    rows
}

#[test]
fn jacobians_match_differences() {
    for file in ["flex.toml", "slosh.toml"] {
        let (loaded, system) = system(file);
        let q = hold(&loaded);
        let plan = plan(&q, Duration::Free { min: 14.0, max: 40.0 });
        let x = random_plan(&plan, 17, 3, 0.9).unwrap();
        for c in all(&loaded, &system, &q) {
            let name = c.channels()[0].name;
            let rows = rows_of(&*c, &plan, &x);
            let mut j = DMatrix::zeros(rows.len(), plan.variables());
            let mut again = rows.clone();
            let wanted: Vec<bool> = (0..rows.len()).map(|i| i % 7 == 4).collect();
            c.evaluate(&plan, &x, &mut again, Some(Wanted { rows: &wanted, jacobian: &mut j }));
            assert_eq!(rows, again, "{name}");
            let mut worst = 0.0f64;
            // The numbers differ from window to window by orders of magnitude: compare within a row.
            let sizes: Vec<f64> = j.row_iter().map(|r| r.norm()).collect();
            for v in 0..plan.variables() {
                let at = |d: f64| {
                    let mut y = x.clone();
                    y[v] += d;
                    rows_of(&*c, &plan, &y)
                };
                let h = if name == "clearance" { 2e-4 } else { 3e-5 };
                let (p, m, pp, mm) = (at(h), at(-h), at(2.0 * h), at(-2.0 * h));
                for r in (0..rows.len()).filter(|r| wanted[*r]) {
                    let numeric = (8.0 * (p[r] - m[r]) - (pp[r] - mm[r])) / (12.0 * h);
                    let error = (numeric - j[(r, v)]).abs() / sizes[r].max(1e-3);
                    worst = worst.max(error);
                }
            }
            eprintln!("{file} {name}: {} rows, worst error {worst:.2e}", rows.len());
            assert!(worst < 1e-6, "{file}, {name}: {worst:.2e}");
            assert!(sizes.iter().zip(&wanted).all(|(s, w)| *w || *s == 0.0), "{file}, {name}: a row nobody wanted");
            // Nothing moves at the start, whatever the variables.
            let moving = sizes.iter().zip(&wanted).filter(|(s, w)| **w && **s > 0.0).count();
            assert!(moving > rows.len() / 8, "{file}, {name}: {moving} of {} rows with derivatives", rows.len());
        }
    }
}
