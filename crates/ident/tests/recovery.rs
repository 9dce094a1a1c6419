//! Noise-free data, starting 25 % off: every identifiable combination comes back.

use crate::common::estimate;
use crate::common::*;
use ff_least_squares::Settings;
use ff_model::Params;
use ff_testkit::assert_within;
use ident::belief::{Unknown, analyse};
use ident::estimate::RANK_TOLERANCE;
use ident::parameters::offset_start;
use ident::*;
use nalgebra::DMatrix;

const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };

/// Fits the patterns of a mission from 25 % off; every combination that the sensors would determine to 10 % or
/// better must come back to 1e-6 of the size of its parameters.
fn recover(mission: &str, patterns: &[&str], seed: u64) {
    let l = paper(mission);
    let motion = planned(&l, 40.0, 10);
    let record = exact(&l, &run(&l, &motion, 40.0));
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = ident::parameters::select(&decls, patterns).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.25, seed);
    let mut oe = OutputError::new(&l.model, &record, &Options { substeps: 1, ..Options::new(NOISE) }).unwrap();
    let request = Request {
        anchor: Some(10.0),
        settings: Settings { max_iterations: 60, cost_floor: 1e-13, ..Settings::default() },
        ..Request::new(&decls, &selected, &start)
    };
    let e = estimate(&request, &mut oe).unwrap();
    let errors: Vec<f64> =
        e.parameters.iter().map(|p| p.value - truth[decls.iter().position(|d| d.name == p.name).unwrap()]).collect();
    let (known, worst) = e.data_only.worst_combination(&errors, 0.1);
    println!(
        "{mission}: {:?} after {} steps; {known} of {} combinations to 10 % or better, worst error {worst:.1e}",
        e.status,
        e.iterations,
        selected.len()
    );
    assert!(known >= selected.len() - 3, "only {known} combinations are determined");
    assert_within!(worst, 1e-6, "{worst:e}");
    assert!(e.parameters.iter().all(|p| (p.start - p.value).abs() > 1e-3 * p.start.abs().min(1.0)), "nothing moved");
}

#[test]
fn base_and_hinges_of_the_flexible_case() {
    recover("flex.toml", &["base.*", "panel_*.k[*]", "panel_*.d[*]"], 5);
}

#[test]
fn base_and_fuel_of_the_slosh_case() {
    recover("slosh.toml", &["base.*", "tank.*"], 6);
}

#[test]
fn of_all_58_parameters_46_directions_are_seen_and_the_twelve_others_lie_at_the_hinges() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 40.0, 10), 40.0));
    let decls = l.model.param_decls();
    let values = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = ident::parameters::select(&decls, &["base.*", "panel_*"]).unwrap();
    assert_eq!(selected.len(), 58);
    let mut oe = OutputError::new(&l.model, &record, &Options { substeps: 1, ..Options::new(NOISE) }).unwrap();
    let (mut r, mut j) = (vec![0.0; oe.rows()], DMatrix::zeros(oe.rows(), 58));
    oe.jacobian(&values, &[], &selected, &mut r, &mut j).unwrap();
    // The truth explains its own record: what is left is the integrator's difference at ten times the step.
    assert!(r.iter().all(|x| x.abs() < 1e-5), "{:e}", r.iter().fold(0.0f64, |m, x| m.max(x.abs())));
    let sizes = ident::parameters::sizes(&decls, &values);
    let unknowns: Vec<Unknown> = selected
        .iter()
        .map(|&i| Unknown { name: decls[i].name.clone(), unit: decls[i].unit.into(), size: sizes[i] })
        .collect();
    let u = analyse(&j, &unknowns, RANK_TOLERANCE).unwrap();
    println!("rank {} of 58, condition {:.1e}", u.rank, u.condition);
    assert_eq!(u.rank, 46);
    assert_eq!(u.null.len(), 12);
    // Stiffness and damping have no part in what cannot be told.
    for (p, d) in u.unknowns.iter().zip(&u.deviation) {
        if p.name.contains(".k[") || p.name.contains(".d[") {
            assert!(d.is_some(), "{} has a part in a null direction", p.name);
        }
    }
}

#[test]
fn base_and_payload_of_a_rigid_system() {
    // 20 parameters: the base, and the last link, whose change makes every table anew (rank 20, theory.md 4).
    let l = paper("slosh.toml");
    let truth = Params::<f64>::nominal(&l.model);
    let rigid = ff_mission::Loaded { model: l.model.frozen(&truth), ..l };
    let record = exact(&rigid, &run(&rigid, &planned(&rigid, 40.0, 10), 40.0));
    let decls = rigid.model.param_decls();
    let truth = Params::<f64>::nominal(&rigid.model).values().to_vec();
    let selected: Vec<usize> = (0..10).chain(70..80).collect();
    let start = offset_start(&decls, &truth, &selected, 0.25, 8);
    let mut rda = Rda::new(&rigid.model, &record, &NOISE).unwrap();
    let request = Request {
        settings: Settings { cost_floor: 1e-16, ..Settings::default() },
        ..Request::new(&decls, &selected, &start)
    };
    let e = estimate(&request, &mut rda).unwrap();
    let worst = e
        .parameters
        .iter()
        .zip(&selected)
        .fold(0.0f64, |m, (p, &i)| m.max((p.value - truth[i]).abs() / ident::parameters::sizes(&decls, &truth)[i]));
    println!("{:?} after {} steps, rank {}, worst {worst:.1e}", e.status, e.iterations, e.data_only.rank);
    assert_eq!(e.data_only.rank, 20);
    assert_within!(worst, 1e-8, "{worst:e}");
}
