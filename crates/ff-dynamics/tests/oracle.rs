//! Against Pinocchio 4.1 (`fixtures/oracle`, conventions inside each file), to 1e-11 relative.
#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::analysis::budget;
use ff_dynamics::tree::mass_matrix_lower;
use ff_dynamics::*;
use ff_model::*;
use nalgebra::{DMatrix, DVector, Vector4};
use serde::Deserialize;

#[derive(Deserialize)]
#[allow(non_snake_case)]
struct Sample {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    M: Vec<Vec<f64>>,
    nle: Vec<f64>,
    rnea: Vec<f64>,
    rnea_g: Vec<f64>,
    aba: Vec<f64>,
    hg: Vec<f64>,
    com: Vec<f64>,
    h_world: Vec<f64>,
    kinetic: f64,
    Y: Vec<Vec<f64>>,
    J_tool_local: Vec<Vec<f64>>,
    T_tool: Vec<Vec<f64>>,
}
#[derive(Deserialize)]
struct Oracle {
    states: Vec<Sample>,
    pi: Vec<f64>,
}

fn load(name: &str) -> Oracle {
    let path = format!("{}/../../fixtures/oracle/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn flat(m: &[Vec<f64>]) -> Vec<f64> {
    m.concat()
}
fn rows(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

/// `n_joints` of the oracle's joints are joints of ours; the rest are passive coordinates of ports.
fn state_of(m: &Model, s: &Sample) -> State<f64> {
    let mut st = State::zero(m);
    st.pos.copy_from_slice(&s.q[..3]);
    st.att = Vector4::new(s.q[6], s.q[3], s.q[4], s.q[5]);
    st.q.copy_from_slice(&s.q[7..7 + m.nj()]);
    st.eta.copy_from_slice(&s.q[7 + m.nj()..]);
    st.v.copy_from_slice(&s.v);
    st
}

/// Nominal parameters with every spring and damper taken out: the oracle knows none.
fn unsprung(m: &Model) -> Params<f64> {
    let mut v = Params::<f64>::nominal(m).values().to_vec();
    for (x, d) in v.iter_mut().zip(m.param_decls()) {
        if d.name.contains(".k[") || d.name.contains(".d[") {
            *x = 0.0;
        }
    }
    Params::from_values(m, v)
}

/// Worst relative difference per quantity over all states.
fn compare(m: &Model, o: &Oracle, gravity: &Model, p: &Params<f64>) -> Vec<(&'static str, f64)> {
    let mut w = Work::new(m);
    let nv = m.nv();
    let mut worst: Vec<(&'static str, f64)> = Vec::new();
    let mut note = |k: &'static str, e: f64| match worst.iter_mut().find(|x| x.0 == k) {
        Some(x) => x.1 = x.1.max(e),
        None => worst.push((k, e)),
    };
    assert_eq!(o.states.len(), 50);
    for s in &o.states {
        let st = state_of(m, s);
        let mut h = DMatrix::zeros(nv, nv);
        mass_matrix(m, p, &st, &mut w, &mut h);
        note("M", relative_error(&rows(&h), &flat(&s.M)));
        // Behind forward dynamics, which factorises in the same place.
        let mut a = vec![0.0; nv];
        forward_dynamics(m, p, &st, &s.tau, &mut w, &mut a).unwrap();
        let lower = mass_matrix_lower(m, p, &st, &mut w);
        assert!((0..nv).all(|i| (0..=i).all(|j| lower[(i, j)] == h[(i, j)])));
        let mut out = vec![0.0; nv];
        bias(m, p, &st, &mut w, &mut out);
        note("nle", relative_error(&out, &s.nle));
        rnea(m, p, &st, &s.a, &mut w, &mut out);
        note("rnea", relative_error(&out, &s.rnea));
        rnea(gravity, p, &st, &s.a, &mut w, &mut out);
        note("rnea_g", relative_error(&out, &s.rnea_g));
        forward_dynamics(m, p, &st, &s.tau, &mut w, &mut out).unwrap();
        note("aba", relative_error(&out, &s.aba));
        let b = budget(m, p, &st, &mut w);
        note("h_world", relative_error(b.momentum.to_vector().as_slice(), &s.h_world));
        let hg = [b.momentum.lin.as_slice(), b.angular_com.as_slice()].concat();
        note("hg", relative_error(&hg, &s.hg));
        note("com", relative_error(b.com.as_slice(), &s.com));
        note("kinetic", relative_error(&[b.kinetic], &[s.kinetic]));
        let tool = m.frame("tool").unwrap();
        let mut j = DMatrix::zeros(6, nv);
        frame_jacobian(m, &st, tool, &mut w, &mut j);
        note("J_tool", relative_error(&rows(&j), &flat(&s.J_tool_local)));
        let t = frame_pose(m, &st, tool, &mut w);
        let got: Vec<f64> = (0..3).flat_map(|i| [t.rot[(i, 0)], t.rot[(i, 1)], t.rot[(i, 2)], t.pos[i]]).collect();
        note("T_tool", relative_error(&got, &flat(&s.T_tool)));
        let mut y = Regressor::new(m);
        regressor(m, p, &st, &s.a, &mut w, &mut y);
        let nbodies = 10 * m.n_bodies();
        let want: Vec<f64> = s.Y.iter().flat_map(|r| r[..nbodies].to_vec()).collect();
        note("Y", relative_error(&rows(&y.columns(0, nbodies).into_owned()), &want));
        if m.np() == 0 {
            let tau = &*y * DVector::from_column_slice(p.values());
            note("Y pi", relative_error(tau.as_slice(), &s.rnea));
            note("pi", relative_error(p.values(), &o.pi));
        }
    }
    worst
}

fn check(name: &str, m: &Model) {
    let o = load(name);
    let g = m.clone().with_gravity(v3(0.0, 0.0, -9.81));
    let worst = compare(m, &o, &g, &unsprung(m));
    println!("{name}: {worst:?}");
    for (k, e) in worst {
        assert_within!(e, 1e-11, "{name} {k}: {e:e} relative");
    }
}

#[test]
fn rigid_tree_agrees_with_pinocchio() {
    check("rigid", &peers_tree("rigid"));
}
#[test]
fn panels_as_tree_links_agree_with_pinocchio() {
    check("flex", &peers_tree("flex"));
}
#[test]
fn pendulum_as_tree_links_agrees_with_pinocchio() {
    check("slosh", &peers_tree("slosh"));
}

/// The passive bodies of the oracle as appendages on the base.
fn ported(name: &str) -> Model {
    let at = |x: f64, z: f64| Xform::new(nalgebra::Matrix3::identity(), v3(x, 0.0, z));
    let parts = if name == "flex" {
        [(1.8, 1.0), (0.0, -1.0)]
            .map(|(x0, sg)| {
                let i = nalgebra::Matrix3::from_diagonal(&v3(15.0, 11.0, 15.0));
                let i = Inertia::from_com(33.0, &v3(sg, 0.0, 0.0), &i);
                let y = v3(0.0, 1.0, 0.0);
                let chain = vec![rigid_segment(i, v3(0.0, 0.0, 0.0), y), rigid_segment(i, v3(2.0 * sg, 0.0, 0.0), y)];
                (0, at(x0, 0.6), Part::Panel(flex_panel::PanelChain::new(chain).unwrap()))
            })
            .to_vec()
    } else {
        let p = slosh_pendulum::SloshPendulum::new(100.0, 0.8, [20.0; 2], [5.0; 2]).unwrap();
        vec![(0, at(0.9, 0.9), Part::Slosh(p))]
    };
    with_twins(&peers_arm(BaseKind::Floating), &parts).ports
}

#[test]
fn panels_through_their_ports_agree_with_pinocchio() {
    let m = ported("flex");
    check("flex", &m);
    // The regressor columns of the panel segments, which the port finds by differentiation.
    let p = unsprung(&m);
    for s in load("flex").states {
        let st = state_of(&m, &s);
        let mut y = Regressor::new(&m);
        regressor(&m, &p, &st, &s.a, &mut Work::new(&m), &mut y);
        for (wing, a) in m.appendages().iter().enumerate() {
            let got = rows(&y.columns(a.param_offset, 20).into_owned());
            let first = 80 + 20 * wing;
            let want: Vec<f64> = s.Y.iter().flat_map(|r| r[first..first + 20].to_vec()).collect();
            assert_within!(relative_error(&got, &want), 1e-11);
        }
    }
}
#[test]
fn pendulum_through_its_port_agrees_with_pinocchio() {
    check("slosh", &ported("slosh"));
}
