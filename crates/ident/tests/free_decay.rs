//! Modes of the free decay in a record: panels and fuel ring while the joints stand still.

use crate::common::*;
use ff_model::Params;
use ff_records::RecordBuilder;
use ident::checks::{FreeDecayError, free_decay, longest_rest, resolved_decay};
use ident::parameters::select;
use nalgebra::DMatrix;

#[test]
fn the_longest_rest_of_all_joints_is_found() {
    // Two joints; the first rests from 40 to 119 and from 150 on, the second until 89 and from 160 on.
    let (n, dt) = (300, 0.01);
    let first = |i: usize| match i {
        0..40 => 0.02 * i as f64,
        40..120 => 0.8,
        120..150 => 0.8 + 0.03 * (i - 119) as f64,
        _ => 1.7,
    };
    let second = |i: usize| match i {
        0..90 => -0.3,
        90..160 => -0.3 + 0.01 * (i - 89) as f64,
        _ => 0.4,
    };
    let q = DMatrix::from_fn(n, 2, |i, j| if j == 0 { first(i) } else { second(i) });
    let moving = |c: usize| DMatrix::from_fn(n, c, |i, j| (0.1 * i as f64 + j as f64).sin());
    let record =
        RecordBuilder::new(["a", "b"]).uniform(0.0, 1.0 / dt).q(q).tau(moving(2)).gyro(moving(3)).build().unwrap().0;
    assert_eq!(longest_rest(&record), (159, 300));
}

/// At parameters that are far off, the slowest mode may be slower than the rest is long: what rings is read all the same.
#[test]
fn what_rings_is_read_whatever_the_model_makes_of_it() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 12.0, 8), 52.0));
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let sigma: Vec<f64> = vec![1e-4; l.model.nj()].into_iter().chain([1e-7; 3]).collect();
    let found = free_decay(&l.model, &truth, &record, &sigma).unwrap();
    let mut soft = truth.clone();
    let springs = select(&decls, &["panel_*.k[*]"]).unwrap();
    let owner = |i: usize| decls[i].name.split_once('.').unwrap().0.to_owned();
    let first = owner(springs[0]);
    springs.iter().filter(|&&i| owner(i) == first).for_each(|&i| soft[i] *= 1e-3);
    assert!(matches!(free_decay(&l.model, &soft, &record, &sigma), Err(FreeDecayError::TooShort { .. })));
    let all = resolved_decay(&l.model, &soft, &record, &sigma).unwrap();
    assert!(!all.fit.modes.is_empty());
    for m in all.fit.modes.iter().filter(|m| m.frequency_deviation < 1e-4 * m.frequency) {
        let near = found.fit.modes.iter().any(|o| (o.frequency / m.frequency - 1.0).abs() < 1e-3);
        assert!(near, "{} Hz", m.frequency);
    }
}
