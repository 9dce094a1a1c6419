//! Constraints: exact Jacobians, rows above every sample, and the held system against the dynamics crate.

use crate::common::paper;
use excitation::constraint::Cone;
use excitation::constraint::Wanted;
use excitation::constraint::{
    BaseAttitude, BaseRate, Clearance, ConstraintError, FrameSpeed, HeldSystem, JointTorque, Pairs, PassiveRange,
    Pointing, Snapshot,
};
use excitation::system::rigid::RigidError;
use excitation::*;
use ff_mission::Loaded;
use ff_model::tree::Shape;
use ff_model::tree::Solid;
use ff_model::{Params, Xform};
use ff_testkit::assert_within;
use ff_testkit::random::{rng, symmetric};
use nalgebra::{DMatrix, DVector, Vector3};
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
    let all: Vec<f64> = loaded.mission.reproduce.as_ref().unwrap().hold_rad.iter().map(|q| q + 0.11).collect();
    loaded.model.coordinates().map_or(all.clone(), |c| c.own().iter().map(|&i| all[i]).collect())
}

/// Solids on the base, the elbow and the hand; sizes and places general.
fn solids(loaded: &Loaded) -> Vec<Solid> {
    let turn = ff_model::spatial::so3::rot_of_rpy(&Vector3::new(0.3, -0.4, 0.7));
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

/// Directions along which a Jacobian is compared with differences.
const DIRECTIONS: usize = 8;

#[test]
fn jacobians_match_differences() {
    let mut chance = rng(31);
    for (file, coupled) in [("flex.toml", false), ("slosh.toml", false), ("flex.toml", true)] {
        let (mut loaded, mut system) = system(file);
        if coupled {
            loaded.model.couple(3, 5, -0.7, 0.2).unwrap();
            loaded.model.couple(6, 3, 1.4, -0.1).unwrap();
            system = Arc::new(HeldSystem::new(&loaded.model, &Params::nominal(&loaded.model)).unwrap());
        }
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
            // Along general directions, each of which asks every column.
            for _ in 0..DIRECTIONS {
                let along: Vec<f64> = x.iter().map(|_| symmetric(&mut chance, 1.0)).collect();
                let at = |d: f64| {
                    let y: Vec<f64> = x.iter().zip(&along).map(|(x, a)| x + d * a).collect();
                    rows_of(&*c, &plan, &y)
                };
                let h = if name == "clearance" { 2e-4 } else { 3e-5 };
                let (p, m, pp, mm) = (at(h), at(-h), at(2.0 * h), at(-2.0 * h));
                let slope = &j * DVector::from_column_slice(&along);
                for r in (0..rows.len()).filter(|r| wanted[*r]) {
                    let numeric = (8.0 * (p[r] - m[r]) - (pp[r] - mm[r])) / (12.0 * h);
                    worst = worst.max((numeric - slope[r]).abs() / sizes[r].max(1e-3));
                }
            }
            eprintln!("{file} {name}: {} rows, worst error {worst:.2e}", rows.len());
            assert_within!(worst, 1e-6, "{file}, {name}: {worst:.2e}");
            assert!(sizes.iter().zip(&wanted).all(|(s, w)| *w || *s == 0.0), "{file}, {name}: a row nobody wanted");
            // Nothing moves at the start, whatever the variables.
            let moving = sizes.iter().zip(&wanted).filter(|(s, w)| **w && **s > 0.0).count();
            assert!(moving > rows.len() / 8, "{file}, {name}: {moving} of {} rows with derivatives", rows.len());
        }
    }
}

/// Rows of a plan against the full simulation at the same instants: without appendages the same numbers, with them
/// the linear response of appendages that swing by some degrees.
#[test]
fn rows_are_those_of_the_simulation() {
    for (file, bare, part) in [
        ("flex.toml", true, 1.0),
        ("flex.toml", false, 1.0),
        ("flex.toml", false, 0.05),
        ("slosh.toml", false, 1.0),
        ("slosh.toml", false, 0.05),
    ] {
        let loaded = paper(file);
        let model = if bare { loaded.model.without_appendages() } else { loaded.model.clone() };
        let system = Arc::new(HeldSystem::new(&model, &Params::nominal(&model)).unwrap());
        let q = hold(&loaded);
        let plan = plan(&q, Duration::Fixed(24.0));
        // A part of a random plan: the arm moves by radians, or by a tenth of one.
        let x: Vec<f64> = random_plan(&plan, 17, 3, 0.9)
            .unwrap()
            .iter()
            .enumerate()
            .map(|(k, x)| q[k / plan.per_joint()] + part * (x - q[k / plan.per_joint()]))
            .collect();
        let motion = plan.motion(&x).unwrap();
        let hand = model.body_name(model.n_bodies() - 1).to_owned();
        let (axis, target) = (Vector3::new(0.2, -0.9, 0.4), Vector3::new(-0.1, 0.7, 0.6));
        let mut list: Vec<Box<dyn Constraint>> = vec![
            Box::new(JointTorque::new(&system, &q, &[1.0; 7]).unwrap()),
            Box::new(BaseRate::new(&system, &q, 1.0).unwrap()),
            Box::new(BaseAttitude::new(&system, &q, 1.0).unwrap()),
            Box::new(Pointing::new(&system, &q, "antenna", &axis, &target, Cone::Within(1.0)).unwrap()),
            Box::new(FrameSpeed::new(&system, &hand, 1.0).unwrap()),
        ];
        if !bare {
            list.push(Box::new(PassiveRange::all(&system, &q, "rad", 1.0).unwrap()));
        }
        for c in &list {
            let count = c.samples(&plan);
            let rows = rows_of(&**c, &plan, &x);
            let sample_s = 24.0 / (count - 1) as f64;
            let options = ff_dynamics::SimOptions { duration_s: 24.0, step_s: 0.01, sample_s };
            let mut start = ff_dynamics::State::zero(&model);
            start.q.copy_from_slice(&q);
            start.eta.copy_from_slice(system.rest());
            let drive = ff_dynamics::Drive::Prescribed(&motion);
            let trace = ff_dynamics::simulate(&model, system.params(), &start, &drive, &options).unwrap();
            let channels = c.channels().len();
            let (mut error, mut size) = (vec![0.0f64; channels], vec![0.0f64; channels]);
            let mut out = vec![0.0; channels];
            for i in 0..count {
                let s = trace.state(&model, i);
                let tau: Vec<f64> = trace.tau.row(i).iter().copied().collect();
                let twist = s.base_twist().to_vector();
                let at = Snapshot {
                    time: i as f64 * sample_s,
                    q: &s.q,
                    qd: s.qd(),
                    twist: std::array::from_fn(|k| twist[k]),
                    att: s.att,
                    tau: &tau,
                    eta: &s.eta,
                };
                c.measure(&at, &mut out);
                for k in 0..channels {
                    // Limits are 1, so a row is the value less 1.
                    error[k] = error[k].max((rows[k * count + i] + 1.0 - out[k]).abs());
                    size[k] = size[k].max(out[k].abs());
                }
            }
            let worst = error.iter().zip(&size).map(|(e, s)| e / s).fold(0.0, f64::max);
            eprintln!(
                "{file}, bare {bare}, {part} of the way, {}: largest error {worst:.2e} of the largest value",
                c.channels()[0].name
            );
            let name = c.channels()[0].name;
            let history = matches!(name, "base attitude excursion" | "pointing angle");
            let allowed = match (bare, part < 0.1) {
                // The trapezoidal rule of the attitude; everything else is computed from the same numbers.
                (true, _) if history => 2e-3,
                (true, _) => 1e-9,
                // Measured: 0.1 to 0.3 %; 2 % of deflections that are small themselves; the appendages' part in the
                // speed of the hand is left out.
                (false, true) if name == "deflection" => 0.03,
                (false, true) if name == "frame speed" => 0.12,
                (false, true) => 5e-3,
                // Measured: up to 52 % with panels, whose phase drifts when the arm moves by radians, 19 % with fuel.
                (false, false) => 0.6,
            };
            assert!(worst < allowed, "{file}, {name}: {worst:.2e}, {size:?}");
        }
    }
}

#[test]
fn senseless_constraints_are_refused_by_name() {
    let (loaded, system) = system("flex.toml");
    let q = hold(&loaded);
    let count = |what, got, want| ConstraintError::Count { what, got, want };
    let torque = |limits: &[f64]| JointTorque::new(&system, &q, limits).unwrap_err();
    assert_eq!(torque(&[1.0; 6]), count("joint torque", 6, 7));
    match torque(&[1.0, 1.0, -2.0, 1.0, 1.0, 1.0, 1.0]) {
        ConstraintError::Limit { what, value: -2.0, unit: "N m" } => assert!(what.contains("joint3"), "{what}"),
        e => panic!("{e}"),
    }
    let rate = BaseRate::new(&system, &q, f64::NAN).unwrap_err();
    assert!(matches!(&rate, ConstraintError::Limit { value, unit: "rad/s", .. } if value.is_nan()), "{rate}");
    assert_eq!(BaseRate::new(&system, &q[1..], 0.1).unwrap_err(), count("joint positions", 6, 7));
    match FrameSpeed::new(&system, "hnad", 0.1).unwrap_err() {
        ConstraintError::Unknown { kind: "frame", name, known } => assert!(name == "hnad" && !known.is_empty()),
        e => panic!("{e}"),
    }
    let zero = Pointing::new(&system, &q, "a", &Vector3::zeros(), &Vector3::x(), Cone::Within(0.1)).unwrap_err();
    assert!(matches!(zero, ConstraintError::Direction { .. }), "{zero}");
    let few = PassiveRange::new(&system, &q, &[0.1; 3]).unwrap_err();
    assert_eq!(few, count("passive coordinates", 3, 4));
    let mut far = solids(&loaded);
    far[1].body = 99;
    let solid = |s: &[Solid], gap| Clearance::new(&loaded.model, s, Pairs::Distant, &[], gap).unwrap_err();
    match solid(&far, 0.1) {
        ConstraintError::Unknown { name, .. } => assert!(name.contains("99") && name.contains("bus"), "{name}"),
        e => panic!("{e}"),
    }
    assert_eq!(solid(&solids(&loaded)[..1], 0.1), count("pairs of solids", 0, 1));
    let gap = solid(&solids(&loaded), -0.1);
    assert!(matches!(gap, ConstraintError::Limit { value: -0.1, unit: "m", .. }), "{gap}");
    let fixed = loaded.model.clone().with_base_kind(ff_model::BaseKind::Fixed);
    let params = Params::nominal(&fixed);
    assert_eq!(HeldSystem::new(&fixed, &params).map(|_| ()).unwrap_err(), RigidError::NotFreeFloating);
}
