//! Tables of motions give what the algorithms give motion by motion.

#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::analysis::budget;
use ff_dynamics::batch::{Algorithm, Motions, batch, position_width};
use ff_dynamics::tree::{Derivatives, rnea_derivatives};
use ff_dynamics::*;
use ff_model::*;
use nalgebra::DMatrix;

/// No multiple of the lanes of any machine.
const ROWS: usize = 13;

struct Tables {
    states: Vec<State<f64>>,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
}

fn tables(m: &Model, seed: u64) -> Tables {
    let mut r = rng(seed);
    let mut states: Vec<State<f64>> = (0..ROWS).map(|_| random_state(m, &mut r, 0.5)).collect();
    if m.base_kind() == BaseKind::Fixed {
        // A base that is bolted down stands where the world does, and has no place in a table.
        states.iter_mut().for_each(|s| (s.pos, s.att) = (State::zero(m).pos, State::zero(m).att));
    }
    let mut q = Vec::new();
    for s in &states {
        if m.base_kind() == BaseKind::Floating {
            q.extend(s.pos.iter().chain(s.att.iter()));
        }
        q.extend(s.q.iter().chain(&s.eta));
    }
    let v = states.iter().flat_map(|s| s.v.clone()).collect();
    let a = (0..ROWS * m.nv()).map(|_| uniform(&mut r, -2.0, 2.0)).collect();
    Tables { states, q, v, a }
}

/// Matrix rows one after another.
fn by_rows(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

/// One motion, by the algorithm itself.
fn alone(algorithm: Algorithm, m: &Model, s: &State<f64>, given: &[f64]) -> Vec<f64> {
    let (p, mut w, nv) = (Params::nominal(m), Work::new(m), m.nv());
    let (mut x, mut h) = (vec![0.0; nv], DMatrix::zeros(nv, nv));
    match algorithm {
        Algorithm::Rnea => rnea(m, &p, s, given, &mut w, &mut x),
        Algorithm::ForwardDynamics => forward_dynamics(m, &p, s, given, &mut w, &mut x).unwrap(),
        Algorithm::HybridDynamics => {
            let mut tau = vec![0.0; m.nj()];
            hybrid_dynamics(m, &p, s, given, &mut w, &mut x, &mut tau).unwrap();
            x.extend(tau);
        }
        Algorithm::MassMatrix => {
            mass_matrix(m, &p, s, &mut w, &mut h);
            x = by_rows(&h);
        }
        Algorithm::Regressor => {
            let mut y = Regressor::new(m);
            regressor(m, &p, s, given, &mut w, &mut y);
            x = by_rows(&y);
        }
        Algorithm::Derivatives => {
            let mut d = Derivatives::new(m);
            rnea_derivatives(m, &p, s, given, &mut w, &mut d);
            x = [&d.dq, &d.dv, &d.da].into_iter().flat_map(by_rows).collect();
        }
        Algorithm::Momentum => {
            let b = budget(m, &p, s, &mut w);
            let vectors = [b.momentum.lin, b.momentum.ang, b.angular_com, b.com];
            x = vectors.iter().flat_map(|v| v.iter().copied()).chain([b.kinetic, b.potential]).collect();
        }
        Algorithm::FramePose(k) => {
            let pose = frame_pose(m, s, &m.frames()[k], &mut w);
            let mut t = DMatrix::identity(4, 4);
            t.view_mut((0, 0), (3, 3)).copy_from(&pose.rot);
            t.view_mut((0, 3), (3, 1)).copy_from(&pose.pos);
            x = by_rows(&t);
        }
        Algorithm::FrameJacobian(k) => {
            let mut j = DMatrix::zeros(6, nv);
            frame_jacobian(m, s, &m.frames()[k], &mut w, &mut j);
            x = by_rows(&j);
        }
    }
    x
}

#[test]
fn every_row_is_what_the_algorithm_gives_alone() {
    let arm = peers_arm(BaseKind::Fixed).with_gravity(vector(&mut rng(4), 9.8));
    for (seed, m) in [(1, random_twins(&mut rng(7)).ports), (2, system()), (3, arm)] {
        let t = tables(&m, seed);
        let last = m.frames().len().checked_sub(1);
        let frames = last.into_iter().flat_map(|k| [Algorithm::FramePose(k), Algorithm::FrameJacobian(k)]);
        let plain = [
            Algorithm::Rnea,
            Algorithm::MassMatrix,
            Algorithm::ForwardDynamics,
            Algorithm::HybridDynamics,
            Algorithm::Regressor,
            Algorithm::Derivatives,
            Algorithm::Momentum,
        ];
        assert_eq!(t.q.len(), ROWS * position_width(&m));
        for algorithm in plain.into_iter().chain(frames) {
            let (given, width) = (algorithm.given_width(&m), algorithm.result_width(&m));
            let v: &[f64] = if algorithm.needs_velocities() { &t.v } else { &[] };
            let motions = Motions { rows: ROWS, q: &t.q, v, given: &t.a[..ROWS * given] };
            // What was in a result before must not show.
            let mut out = vec![7.3; ROWS * width];
            batch(algorithm, &m, &Params::nominal(&m), &motions, &mut out).unwrap();
            for (i, (row, s)) in out.chunks(width).zip(&t.states).enumerate() {
                let expected = alone(algorithm, &m, s, &t.a[i * given..(i + 1) * given]);
                let scale = expected.iter().fold(1e-9_f64, |x, y| x.max(y.abs()));
                let worst = row.iter().zip(&expected).fold(0.0_f64, |w, (x, y)| w.max((x - y).abs() / scale));
                assert_within!(worst, 1e-10, "{algorithm:?} of {}, row {i}: {worst:e}", m.name());
            }
        }
    }
}

#[test]
fn a_singular_mass_matrix_is_reported_with_its_rows() {
    let m = system();
    let t = tables(&m, 5);
    // Without inertia nothing can be accelerated.
    let p = Params::from_values(&m, vec![0.0; m.n_params()]);
    let motions = Motions { rows: ROWS, q: &t.q, v: &t.v, given: &t.a };
    let mut out = vec![0.0; ROWS * m.nv()];
    let e = batch(Algorithm::ForwardDynamics, &m, &p, &motions, &mut out).unwrap_err();
    assert!(e.first == 0 && e.last < ROWS && !e.source.at.is_empty(), "{e}");
}
