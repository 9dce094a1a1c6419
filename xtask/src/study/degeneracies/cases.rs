//! The twenty.

use super::Case;
use super::robots::{Sines, UnknownFulcrum, axis, body, chain, flat, joint, place};
use crate::workspace;
use anyhow::Context;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Prescribed, Regressor, Sampling, State, Wanted, Work, regressor, sensitivities};
use ff_mission::{LoadOptions, Mission};
use ff_model::payload::Payload;
use ff_model::{BaseKind, Inertia, JointKind, Model, Params, Xform};
use flex_panel::{PanelChain, Segment};
use ident::Uncertainty;
use ident::belief::identifiability;
use ident::belief::{Unknown, analyse};
use ident::parameters::{scale, selection};
use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

use BaseKind::{Fixed, Floating};
use JointKind::{Prismatic, Revolute};

/// Standard deviations that whiten records (N m, rad/s).
const NOISE: (f64, f64) = (0.1, 1.5e-4);
/// Relative singular value below which a direction of a record is null.
const TOLERANCE: f64 = 1e-9;

pub(super) fn all(seed: u64) -> anyhow::Result<Vec<Case>> {
    let mut out = Vec::new();
    let mut add = |case: anyhow::Result<Case>| -> anyhow::Result<()> {
        out.push(case?);
        Ok(())
    };
    let general = |n: usize| (0..n).map(|k| (Revolute, axis(k))).collect::<Vec<_>>();
    // Three per revolute joint, whatever the axes.
    for (name, n) in [("one joint", 1), ("two joints", 2), ("three joints", 3), ("seven joints", 7)] {
        add(structure(name, &chain(Floating, &general(n)), &["*"], 3 * n, None, seed))?;
    }
    add(structure("massless axis (universal joint)", &universal(), &["*"], 6, None, seed))?;
    let parallel = [(Revolute, axis(2)), (Revolute, axis(2)), (Revolute, axis(2))];
    add(structure("parallel axes, floating base", &chain(Floating, &parallel), &["*"], 9, None, seed))?;
    // A body on a slide keeps its attitude: its inertia may as well be the other's.
    let slide = [(Prismatic, axis(1))];
    add(structure("a slide", &chain(Floating, &slide), &["*"], 6, None, seed))?;
    let mixed = [(Revolute, axis(0)), (Prismatic, axis(3))];
    add(structure("a hinge and a slide", &chain(Floating, &mixed), &["*"], 9, None, seed))?;
    // Planar arms on the ground. Of every link the torques know the moment about its axis and, but for the first link without
    // gravity across the axis, two first moments; the base knows nothing.
    for (name, n, upright, rank) in [
        ("parallel axes on the ground, level, 2", 2, false, 4),
        ("parallel axes on the ground, upright, 2", 2, true, 6),
        ("parallel axes on the ground, level, 3", 3, false, 7),
        ("parallel axes on the ground, upright, 3", 3, true, 9),
    ] {
        let z = Vector3::z();
        let gravity = if upright { Vector3::new(-3.1, 9.2, 0.0) } else { -9.81 * z };
        let m = chain(Fixed, &vec![(Revolute, z); n]).with_gravity(gravity);
        add(structure(name, &m, &["*"], 10 * (n + 1) - rank, None, seed))?;
    }
    for (k, name) in ["turning about x only", "turning about y only", "turning about z only"].into_iter().enumerate() {
        add(one_axis(name, k))?;
    }
    add(symmetric())?;
    add(fulcrum())?;
    let mut held = chain(Floating, &general(2));
    mount_payload(&mut held, 0)?;
    add(structure("fixed fuel in the base", &held, &["base.*", "client.*"], 10, Some(&["base.*", "client.*"]), seed))?;
    let mut held = chain(Floating, &general(2));
    mount_payload(&mut held, 2)?;
    let both = ["link2.*", "client.*"];
    add(structure("payload and the link that holds it", &held, &both, 10, Some(&both), seed))?;
    let file = workspace::root()?.join("fixtures/paper/flex.toml");
    let loaded = Mission::load(&file, &ffid::default_registry(), &LoadOptions::default())?;
    let mut case =
        structure("wings of the paper, 58 parameters", &loaded.model, &["base.*", "panel_*"], 12, None, seed)?;
    let decls = loaded.model.param_decls();
    let springs = selection::select(&decls, &["panel_*.k[*]", "panel_*.d[*]"])?;
    case.untouched = springs.iter().map(|&i| decls[i].name.clone()).collect();
    add(Ok(case))?;
    Ok(out)
}

/// What no motion can tell of the parameters that the patterns select.
fn structure(
    name: &'static str,
    model: &Model,
    patterns: &[&str],
    expected: usize,
    touched: Option<&[&str]>,
    seed: u64,
) -> anyhow::Result<Case> {
    let decls = model.param_decls();
    let params = Params::nominal(model);
    let selected = selection::select(&decls, patterns)?;
    let found = identifiability::structural(model, &params, &selected)?;
    let touched = touched.map(|p| selection::select(&decls, p)).transpose()?;
    let touched = touched.map(|t| t.iter().map(|&i| decls[i].name.clone()).collect());
    let proof = fresh(model, &params, &selected, seed);
    Ok(Case { name, expected, touched, untouched: vec![], found, proof })
}

/// The regressor at motions of its own.
fn fresh(model: &Model, params: &Params<f64>, selected: &[usize], seed: u64) -> DMatrix<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(40_000));
    let nv = model.nv();
    let (mut work, mut y) = (Work::new(model), Regressor::new(model));
    let rest = model.rest_position(params);
    let mut out = DMatrix::zeros(20 * nv, selected.len());
    for k in 0..20 {
        let mut random = |x: f64| x * rng.random_range(-1.0..1.0);
        let mut s = State::zero(model);
        s.q.iter_mut().for_each(|q| *q = random(2.0));
        s.eta.iter_mut().zip(&rest).for_each(|(e, r)| *e = r + random(0.4));
        s.v.iter_mut().for_each(|v| *v = random(1.5));
        let a: Vec<f64> = (0..nv).map(|_| random(2.0)).collect();
        regressor(model, params, &s, &a, &mut work, &mut y);
        for (c, &i) in selected.iter().enumerate() {
            out.view_mut((k * nv, c), (nv, 1)).copy_from(&y.column(i));
        }
    }
    out
}

/// Two joints with nothing between them, as of a slosh pendulum.
fn universal() -> Model {
    let mut m = Model::new("robot", "base", body(9), Floating);
    m.add_body(0, "cross", joint("joint1", Revolute, Vector3::x(), place(0)), Inertia::zero());
    m.add_body(1, "bob", joint("joint2", Revolute, Vector3::y(), Vector3::zeros()), body(1));
    m
}

fn mount_payload(model: &mut Model, host: usize) -> anyhow::Result<()> {
    let payload = Payload::new(&body(4)).context("payload")?;
    model.mount("client", host, Xform::new(Matrix3::identity(), place(3)), payload.into())?;
    Ok(())
}

/// Which rows of a record are analysed.
#[derive(Clone, Copy, PartialEq)]
enum Rows {
    All,
    Gyro,
}

/// What a record tells.
fn record(
    model: &Model,
    motion: &dyn JointMotion,
    z0: &[f64],
    patterns: &[&str],
    rows: Rows,
) -> anyhow::Result<(Uncertainty, DMatrix<f64>)> {
    let params = Params::nominal(model);
    let decls = model.param_decls();
    let selected = selection::select(&decls, patterns)?;
    let sizes = scale::sizes(&decls, params.values());
    let sampling = Sampling { samples: 800, sample_s: 0.02, substeps: 2 };
    let wanted = Wanted { params: selected.clone(), ..Wanted::default() };
    let table = Prescribed::new(model, &params, motion, &sampling, &wanted.links(model));
    let (_, d) = sensitivities(model, &params, &table, z0, &wanted)?;
    let torques = if rows == Rows::All { d.tau.nrows() } else { 0 };
    let mut j = DMatrix::zeros(torques + d.gyro.nrows(), selected.len());
    j.rows_mut(0, torques).copy_from(&(d.tau.rows(0, torques) / NOISE.0));
    j.rows_mut(torques, d.gyro.nrows()).copy_from(&(d.gyro / NOISE.1));
    let unknowns = Unknown::of_parameters(&decls, &selected, &sizes);
    Ok((analyse(&j, &unknowns, TOLERANCE)?, j))
}

/// A planar robot turns about one axis: of the inertia of its base about the two others nothing can be seen, but products with
/// the axis can, because they would make it tumble.
fn one_axis(name: &'static str, axis: usize) -> anyhow::Result<Case> {
    let mut e = Vector3::zeros();
    e[axis] = 1.0;
    let mut at = place(1);
    at[axis] = 0.0;
    let mut m = Model::new("robot", "base", flat(9, axis), Floating);
    m.add_body(0, "link1", joint("joint1", Revolute, e, at), flat(1, axis));
    let z0 = vec![0.0; 6];
    let motion = Sines { joints: 1, amplitude: 0.6, seconds: 16.0 };
    let (found, proof) = record(&m, &motion, &z0, &["base.*"], Rows::All)?;
    let touched = match axis {
        0 => ["base.i_yy", "base.i_yz", "base.i_zz"],
        1 => ["base.i_xx", "base.i_xz", "base.i_zz"],
        _ => ["base.i_xx", "base.i_xy", "base.i_yy"],
    };
    Ok(Case { name, expected: 3, touched: Some(touched.map(String::from).to_vec()), untouched: vec![], found, proof })
}

/// Two equal wings, bent alike, let go: the base moves up and down and does not turn. A gyro sees a spring that is unlike its
/// twin, but nothing of both together. All masses lie on the line on which the wings push, and the wings have no product of
/// inertia: with one, bending would pitch the base in second order.
fn symmetric() -> anyhow::Result<Case> {
    let x = 0.4;
    let about = Matrix3::new(135.0, 0.0, 4.0, 0.0, 99.0, 0.0, 4.0, 0.0, 117.0);
    let wing = Matrix3::from_diagonal(&Vector3::new(15.0, 11.0, 13.0));
    let base = Inertia::from_com(400.0, &Vector3::new(x, 0.0, 0.3), &about);
    let mut m = Model::new("robot", "base", base, Floating);
    let link = Inertia::from_com(12.0, &Vector3::zeros(), &wing);
    m.add_body(0, "link1", joint("joint1", Revolute, Vector3::y(), Vector3::new(x, 0.0, 0.7)), link);
    for (name, side) in [("left", 1.0), ("right", -1.0)] {
        let segment = |k: usize| {
            let hinge = Vector3::new(0.0, if k == 0 { 0.0 } else { 2.1 * side }, 0.0);
            let com = Vector3::new(0.0, 1.05 * side, 0.0);
            let mut s = Segment::new(33.0, com, &wing, hinge, Vector3::x());
            (s.stiffness, s.damping) = (180.0 + 30.0 * k as f64, 2.0 + 0.5 * k as f64);
            s
        };
        let panel = PanelChain::new(vec![segment(0), segment(1)])?;
        let at = Xform::new(Matrix3::identity(), Vector3::new(x, 0.5 * side, 0.3));
        m.mount(format!("panel_{name}"), 0, at, panel.into())?;
    }
    // Joint held where it is; wing tips up by the same.
    let motion = Sines { joints: 1, amplitude: 0.0, seconds: 16.0 };
    let mut z0 = vec![0.0; 6 + 8];
    z0[6..10].copy_from_slice(&[0.05, 0.03, -0.05, -0.03]);
    let patterns = ["panel_*.k[*]", "panel_*.d[*]"];
    let (found, proof) = record(&m, &motion, &z0, &patterns, Rows::Gyro)?;
    let touched = found.unknowns.iter().map(|u| u.name.clone()).collect();
    Ok(Case { name: "symmetric mode, gyro only", expected: 4, touched: Some(touched), untouched: vec![], found, proof })
}

/// See [`UnknownFulcrum`].
fn fulcrum() -> anyhow::Result<Case> {
    let mut m = chain(Floating, &[(Revolute, axis(0)), (Revolute, axis(1))]);
    m.mount("tank", 0, Xform::new(Matrix3::identity(), place(2)), Arc::new(UnknownFulcrum::new()))?;
    let motion = Sines { joints: 2, amplitude: 0.5, seconds: 16.0 };
    let (found, proof) = record(&m, &motion, &[0.0; 10], &["tank.*"], Rows::All)?;
    let touched = ["length", "k[0]", "k[1]", "d[0]", "d[1]"].map(|n| format!("tank.{n}")).to_vec();
    Ok(Case { name: "fulcrum unknown", expected: 1, touched: Some(touched), untouched: vec![], found, proof })
}
