//! The port equations that chain, modal appendage and payload write themselves equal the defaults.
use crate::common::ports::check_ports;
use crate::common::{chain, rng, segment, symmetric, vector};
use ff_model::Inertia;
use ff_model::payload::Payload;
use flex_panel::PanelChain;
use flex_panel::modal::{ModalAppendage, Mode};
use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};
use rand::RngExt;

#[test]
fn chains_equal_the_defaults_over_lanes_and_differences() {
    let mut r = rng(61);
    for n in [1, 2, 3, 4, 7] {
        for _ in 0..5 {
            let c = chain(&mut r, n);
            check_ports(&c, &c.nominal(), &mut r, 3);
        }
    }
}

/// Axes along coordinate axes take other paths than skewed ones.
#[test]
fn chains_on_every_kind_of_axis_equal_the_defaults() {
    let mut r = rng(62);
    let skew = Vector3::new(0.4, -0.8, 0.3);
    let axes = [Vector3::x(), -Vector3::y(), Vector3::z(), skew, -Vector3::x(), Vector3::y(), -Vector3::z()];
    for first in 0..axes.len() {
        for n in 2..4 {
            let segments = (0..n).map(|i| {
                let mut s = segment(&mut r);
                s.axis = axes[(first + i) % axes.len()];
                s
            });
            let c = PanelChain::new(segments.collect()).unwrap();
            check_ports(&c, &c.nominal(), &mut r, 3);
        }
    }
}

#[test]
fn chains_with_full_matrices_equal_the_defaults() {
    let mut r = rng(63);
    for n in [2, 3, 5] {
        let k = DMatrix::from_fn(n, n, |i, j| if i == j { 150.0 + 9.0 * i as f64 } else { 7.0 - (i + j) as f64 });
        let d = DMatrix::from_fn(n, n, |i, j| if i == j { 2.0 + 0.3 * i as f64 } else { 0.1 * (i + j) as f64 });
        let c = chain(&mut r, n).with_coupling(&k, &d).unwrap();
        check_ports(&c, &c.nominal(), &mut r, 5);
    }
}

#[test]
fn modal_appendages_equal_the_defaults() {
    let mut r = rng(64);
    for n in [1, 2, 5] {
        let i_com = Matrix3::new(160.0, 5.0, -7.0, 5.0, 210.0, 9.0, -7.0, 9.0, 190.0);
        let rigid = Inertia::from_com(250.0, &vector(&mut r, 0.4), &i_com);
        let modes: Vec<Mode> = (0..n)
            .map(|_| Mode {
                frequency_hz: r.random_range(0.05..1.5),
                damping_ratio: r.random_range(0.001..0.05),
                participation: Vector6::from_fn(|_, _| symmetric(&mut r, 1.0)),
            })
            .collect();
        let m = ModalAppendage::new(rigid, &modes).unwrap();
        check_ports(&m, &m.nominal(), &mut r, 10);
    }
}

#[test]
fn payloads_equal_the_defaults() {
    let mut r = rng(65);
    let i_com = Matrix3::new(40.0, 1.0, -0.5, 1.0, 35.0, 0.7, -0.5, 0.7, 38.0);
    let body = Inertia::from_com(180.0, &Vector3::new(0.02, 0.5, -0.03), &i_com);
    check_ports(&Payload::new(&body).unwrap(), &body.to_params(), &mut r, 20);
}
