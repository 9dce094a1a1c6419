//! Where the two ways of free forward dynamics cross: `cargo run --release -p ff-dynamics --example crossover`.
//!
//! Times `by_mass_matrix` against `aba` on chains, by turns, least of many repetitions, and checks that they agree.

use ff_dynamics::tree::SingularInertia;
use ff_dynamics::tree::aba;
use ff_dynamics::tree::by_mass_matrix;
use ff_dynamics::{State, Work};
use ff_model::nalgebra::{Matrix3, Vector3};
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform};
use std::hint::black_box;
use std::time::Instant;

/// A chain like an arm: axes along y and z by turns, `branches` of them on one base.
fn chains(joints: usize, branches: usize) -> Model {
    let base = Inertia::from_com(600.0, &Vector3::new(0.9, 0.1, 0.6), &(Matrix3::identity() * 150.0));
    let diagonal = Matrix3::from_diagonal(&Vector3::new(0.4, 0.04, 0.37));
    let link = Inertia::from_com(8.6, &Vector3::new(0.01, 0.21, 0.02), &diagonal);
    let mut m = Model::new("chain", "base", base, BaseKind::Floating);
    for b in 0..branches {
        let mut parent = 0;
        for i in 0..joints / branches {
            let axis = if i % 2 == 0 { Vector3::y() } else { Vector3::z() };
            let rpy = Vector3::new(if i == 0 { 1.5 } else { 0.0 }, 0.0, 0.0);
            let joint = Joint {
                name: format!("j{b}_{i}"),
                kind: JointKind::Revolute,
                axis,
                placement: Xform::new(rot_of_rpy(&rpy), Vector3::new(0.0, 0.43, 0.1)),
                limits: JointLimits::default(),
            };
            parent = m.add_body(parent, format!("l{b}_{i}"), joint, link);
        }
    }
    m
}

type Way = fn(&Model, &Params<f64>, &State<f64>, &[f64], &mut Work<f64>, &mut [f64]) -> Result<(), SingularInertia>;

fn main() -> Result<(), SingularInertia> {
    const CALLS: u32 = 100;
    println!("joints  branches  mass matrix (ns)  aba (ns)  ratio  differ by");
    for branches in [1, 2] {
        for joints in [8, 12, 16, 20, 24, 28, 32, 36, 40, 48, 56, 64] {
            let m = chains(joints, branches);
            let p = Params::nominal(&m);
            let mut s = State::zero(&m);
            s.q.iter_mut().enumerate().for_each(|(i, q)| *q = 0.4 * (1.7 * i as f64).sin());
            s.v.iter_mut().enumerate().for_each(|(i, v)| *v = 0.3 * (0.9 * i as f64).cos());
            let tau: Vec<f64> = (0..m.nv()).map(|i| (i as f64).sin()).collect();
            let mut w = Work::new(&m);
            let ways: [Way; 2] = [by_mass_matrix, aba];
            let mut a = [vec![0.0; m.nv()], vec![0.0; m.nv()]];
            let mut best = [f64::INFINITY; 2];
            for _ in 0..400 {
                for (k, way) in ways.iter().enumerate() {
                    let start = Instant::now();
                    for _ in 0..CALLS {
                        way(&m, &p, black_box(&s), &tau, &mut w, &mut a[k])?;
                    }
                    best[k] = best[k].min(start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS));
                }
            }
            let size = a[1].iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let off = a[0].iter().zip(&a[1]).fold(0.0f64, |m, (x, y)| m.max((x - y).abs())) / size;
            let ratio = best[0] / best[1];
            println!("{joints:6}  {branches:8}  {:16.0}  {:8.0}  {ratio:5.2}  {off:.1e}", best[0], best[1]);
        }
    }
    Ok(())
}
