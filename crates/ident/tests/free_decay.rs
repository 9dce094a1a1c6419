//! Modes of the free decay in a record: panels and fuel ring while the joints stand still.

use ff_records::RecordBuilder;
use ident::checks::longest_rest;
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
