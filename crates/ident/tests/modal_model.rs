//! Modes of the model as the sensors see them, and how they depend on the parameters.

use ff_dynamics::Boundary;
use ff_dynamics::modes;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::Params;
use ff_model::Registry;
use ff_testkit::assert_within;
use ident::modal::*;
use nalgebra::{Complex, DVector};

pub(crate) fn load(name: &str) -> Loaded {
    let mut r = Registry::new();
    flex_panel::register(&mut r);
    slosh_pendulum::register(&mut r);
    let path = format!("{}/../../fixtures/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Mission::load(path.as_ref(), &r, &LoadOptions::default()).unwrap()
}

/// The paper's systems, made general: unequal hinges, dampers and panels.
fn uneven(l: &Loaded) -> Params<f64> {
    let decls = l.model.param_decls();
    let mut v = Params::<f64>::nominal(&l.model).values().to_vec();
    for (i, d) in decls.iter().enumerate() {
        if d.name.contains(".k[") || d.name.contains(".d[") || d.name.contains("stiff") || d.name.contains("damp") {
            v[i] *= 0.7 + 0.13 * (i % 5) as f64;
        }
    }
    Params::from_values(&l.model, v)
}

#[test]
fn poles_are_those_of_the_dynamics_for_every_boundary() {
    for (name, q) in [("flex", [1.57, 1.4, 0.1, -2.6, 0.2, 2.4, -0.3]), ("slosh", [0.3, 0.8, 0.1, 0.7, -0.2, 0.5, 0.4])]
    {
        let l = load(name);
        let p = uneven(&l);
        let eta = l.model.rest_position(&p);
        for boundary in [Boundary::BaseHeld, Boundary::JointsHeld, Boundary::JointsFree] {
            let known = modes(&l.model, &p, &q, &eta, boundary).unwrap();
            let mine = ModalModel::new(&l.model, &p, &HeldPose { q: &q, eta: &eta, boundary }).unwrap();
            assert_eq!(known.len(), mine.modes().len() + mine.overdamped());
            for (a, b) in known.iter().zip(mine.modes()) {
                assert_within!((a.frequency_hz / b.frequency() - 1.0).abs(), 1e-9, "{name} {boundary:?} {a:?} {b:?}");
                assert_within!((a.damping_ratio / b.damping() - 1.0).abs(), 1e-7);
            }
        }
    }
}

#[test]
fn derivatives_of_the_poles_are_those_of_difference_quotients() {
    for (name, q) in [("flex", [1.57, 1.4, 0.1, -2.6, 0.2, 2.4, -0.3]), ("slosh", [0.3, 0.8, 0.1, 0.7, -0.2, 0.5, 0.4])]
    {
        let l = load(name);
        let p = uneven(&l);
        let eta = l.model.rest_position(&p);
        let n = l.model.n_params();
        // Base, an arm link, and everything of the appendages.
        let selected: Vec<usize> = (0..10).chain(33..37).chain(10 * l.model.n_bodies()..n).collect();
        for boundary in [Boundary::JointsHeld, Boundary::BaseHeld] {
            let pose = HeldPose { q: &q, eta: &eta, boundary };
            let at = |v: Vec<f64>| ModalModel::new(&l.model, &Params::from_values(&l.model, v), &pose).unwrap();
            let here = at(p.values().to_vec());
            let ModeDerivatives { poles: d, channels } = here.channel_derivatives(&l.model, &p, &pose, &selected);
            assert_eq!(d, here.derivatives(&l.model, &p, &pose, &selected));
            for (c, &i) in selected.iter().enumerate() {
                let h = 1e-5 * p.values()[i].abs().max(0.1);
                let moved = |s: f64| {
                    let mut v = p.values().to_vec();
                    v[i] += s * h;
                    at(v)
                };
                let (up, down) = (moved(1.0), moved(-1.0));
                for k in 0..here.modes().len() {
                    let quotient = (up.modes()[k].pole - down.modes()[k].pole) / (2.0 * h);
                    // Channels up to a complex multiple: compare what is left across them, at a phase made equal.
                    let m = DVector::from_column_slice(&here.modes()[k].channels);
                    let aligned = |o: &ModalModel| {
                        let x = DVector::from_column_slice(&o.modes()[k].channels);
                        let y = m.dotc(&m) / m.dotc(&x);
                        x * y
                    };
                    let slope = (aligned(&up) - aligned(&down)) / Complex::from(2.0 * h);
                    let exact = channels[k].as_ref().unwrap().column(c).into_owned();
                    let exact = &exact - &m * (m.dotc(&exact) / m.dotc(&m));
                    let size = m.norm() / p.values()[i].abs().max(0.1);
                    // On a held base nothing is felt at the arm.
                    let felt = boundary != Boundary::BaseHeld;
                    assert_eq!(m.norm() > 0.0, felt);
                    assert!(
                        !felt || (slope - exact).norm() < 1e-5 * size,
                        "{name} {boundary:?} mode {k} parameter {i}: channels"
                    );
                    let scale = here.modes()[k].pole.norm() / p.values()[i].abs().max(0.1);
                    assert_within!(
                        (quotient - d[(k, c)]).norm(),
                        2e-6 * scale,
                        "{name} {boundary:?} mode {k} parameter {i}: {quotient} {}",
                        d[(k, c)]
                    );
                }
            }
        }
    }
}

#[test]
fn a_double_pole_splits_along_its_parameters() {
    // Base held, equal springs about both axes: 0.0890 Hz twice. Each axis follows its own spring.
    let l = load("slosh");
    let p = Params::<f64>::nominal(&l.model);
    let eta = l.model.rest_position(&p);
    let q = [0.3, 0.8, 0.1, 0.7, -0.2, 0.5, 0.4];
    let pose = HeldPose { q: &q, eta: &eta, boundary: Boundary::BaseHeld };
    let m = ModalModel::new(&l.model, &p, &pose).unwrap();
    assert!(m.modes().iter().all(|m| (m.frequency() - 0.0890).abs() < 5e-5));
    let decls = l.model.param_decls();
    let k: Vec<usize> = (0..decls.len()).filter(|&i| decls[i].name.starts_with("tank.k[")).collect();
    assert_eq!(k.len(), 2, "{:?}", decls.iter().map(|d| &d.name).collect::<Vec<_>>());
    let d = m.derivatives(&l.model, &p, &pose, &k);
    // |l|^2 = k/J: d ln|l| / d ln k = 1/2, whatever the damping.
    let relative = |i: usize, c: usize| {
        let l0 = m.modes()[i].pole;
        (l0.conj() * d[(i, c)]).re / l0.norm_sqr() * p.values()[k[c]]
    };
    for i in 0..2 {
        let (a, b) = (relative(i, 0), relative(i, 1));
        assert!((a.max(b) - 0.5).abs() < 1e-9 && a.min(b).abs() < 1e-9, "{a} {b}");
    }
    assert!((relative(0, 0) - relative(1, 0)).abs() > 0.4, "both rows follow the same spring");
}

#[test]
fn a_pose_of_the_wrong_length_is_refused() {
    let l = load("slosh");
    let p = Params::<f64>::nominal(&l.model);
    let e = ModalModel::new(&l.model, &p, &HeldPose { q: &[0.1], eta: &[0.0, 0.0], boundary: Boundary::JointsHeld });
    assert!(matches!(e, Err(ModalModelError::Length { what: "joint pose", got: 1, want: 7 })));
}
