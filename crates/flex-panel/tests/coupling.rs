//! Full stiffness and damping matrices: laws, forces, bounds, and what is said when they are wrong.
use crate::common::{State, chain, rel, rng, sym};
use ff_model::port::{PortModel, derived_bias};
use ff_model::{Appendage, Motion, PortState, Problems};
use flex_panel::{PanelChain, from_toml};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use validate::check_appendage;

/// Positive definite with condition a few.
fn definite(r: &mut rand_chacha::ChaCha8Rng, n: usize, size: f64) -> DMatrix<f64> {
    let b = DMatrix::from_fn(n, n, |_, _| sym(r, 0.8));
    (b.transpose() * &b + DMatrix::identity(n, n) * 0.6) * size
}

fn coupled(r: &mut rand_chacha::ChaCha8Rng, n: usize) -> PanelChain {
    let (k, d) = (definite(r, n, 150.0), definite(r, n, 2.0));
    chain(r, n).with_coupling(&k, &d).unwrap()
}

#[test]
fn coupled_chains_keep_every_law() {
    let mut r = rng(41);
    for n in [2, 3, 6] {
        let c = coupled(&mut r, n);
        let report = check_appendage(&*crate::common::ports::shared(&c));
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{n} segments: {report}");
        assert_eq!(c.decl().params.len(), 12 * n + n * (n - 1));
    }
}

#[test]
fn override_equals_the_derived_bias_with_couplings() {
    let mut r = rng(42);
    let mut worst = 0.0_f64;
    for n in [2, 5] {
        let c = coupled(&mut r, n);
        for _ in 0..500 {
            let s = State::new(&mut r, n);
            let (mut h, mut d) = (vec![0.0; 6 + n], vec![0.0; 6 + n]);
            Appendage::bias(&c, &c.nominal(), &s.port(), &mut h);
            derived_bias(&c, &c.nominal(), &s.port(), &mut d);
            worst = worst.max(rel(&h, &d));
        }
    }
    println!("largest relative difference {worst:.2e}");
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn hinge_torques_are_those_of_the_matrices() {
    let mut r = rng(43);
    let n = 4;
    let base = chain(&mut r, n);
    let (k, d) = (definite(&mut r, n, 150.0), definite(&mut r, n, 2.0));
    let c = base.clone().with_coupling(&k, &d).unwrap();
    assert_eq!(c.stiffness_damping(), (k.clone(), d.clone()));
    let rest = DVector::from_fn(n, |i, _| c.segment(i).unwrap().rest);
    let (x, v) = (DVector::from_fn(n, |_, _| sym(&mut r, 0.5)), DVector::from_fn(n, |_, _| sym(&mut r, 0.5)));
    let eta = &x + &rest;
    let own = |c: &PanelChain| {
        let mut h = vec![0.0; 6 + n];
        let s = PortState { host: Motion::zero(), eta: eta.as_slice(), nu: v.as_slice() };
        PortModel::bias(c, &c.nominal(), &s, &mut h);
        DVector::from_column_slice(&h[6..])
    };
    let (k0, d0) = base.stiffness_damping();
    // The velocity products are the same in both.
    let difference = own(&c) - own(&base) - ((k - k0) * &x + (d - d0) * &v);
    assert!(difference.amax() < 1e-11, "{difference}");
}

#[test]
fn zeros_are_no_parameters_and_names_count_rows_first() {
    let mut r = rng(44);
    let k = DMatrix::from_row_slice(3, 3, &[200.0, -60.0, 0.0, -60.0, 180.0, 25.0, 0.0, 25.0, 90.0]);
    let d = DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 1.5, 0.7]));
    let c = chain(&mut r, 3).with_coupling(&k, &d).unwrap();
    let p = &c.decl().params;
    let names: Vec<_> = p[30..].iter().map(|p| (p.name.as_str(), p.nominal)).collect();
    let want = [
        ("k[0]", 200.0),
        ("k[1]", 180.0),
        ("k[2]", 90.0),
        ("d[0]", 2.0),
        ("d[1]", 1.5),
        ("d[2]", 0.7),
        ("k[0,1]", -60.0),
        ("k[1,2]", 25.0),
    ];
    assert_eq!(names, want);
    assert_eq!(p[33].bounds, (0.0, f64::INFINITY), "a damper without coupling keeps its bounds");
    assert!(p[30].bounds.0 > 0.0 && p[30].bounds.0 < 200.0 && p[36].bounds.0 < -60.0 && p[36].bounds.1 > -60.0);
}

#[test]
fn every_corner_of_the_bounds_is_semidefinite() {
    let mut r = rng(45);
    let mut tightest = f64::INFINITY;
    for n in [2, 3, 5] {
        for _ in 0..100 {
            let c = coupled(&mut r, n);
            let p = &c.decl().params;
            for _ in 0..50 {
                let mut end = |i: usize| {
                    let (lo, hi) = p[i].bounds;
                    if r.random_range(0..2) == 0 {
                        lo
                    } else if hi.is_finite() {
                        hi
                    } else {
                        lo * 1.5
                    }
                };
                let mut k = DMatrix::from_fn(n, n, |i, j| if i == j { end(10 * n + i) } else { 0.0 });
                let mut l = 12 * n;
                for i in 0..n {
                    for j in i + 1..n {
                        k[(i, j)] = end(l);
                        k[(j, i)] = k[(i, j)];
                        l += 1;
                    }
                }
                tightest = tightest.min(k.symmetric_eigenvalues().min() / k.amax());
            }
        }
    }
    println!("least eigenvalue over largest element, at corners: {tightest:.2e}");
    assert!(tightest > -1e-14, "{tightest:e}");
}

const TWO: &str = r#"
stiffness_nm_per_rad = [[200.0, -60.0], [-60.0, 180.0]]
damping_nms_per_rad = [[2.0, 0.3], [0.3, 1.5]]
segments = [
    { mass_kg = 33, com_m = [0.1, 1.1, -0.02], inertia_com_kgm2 = [15.0, 0.1, -0.2, 11.0, 0.3, 15.0], hinge_m = [0.9, 0.3, 0.6], hinge_axis = [2.0, 0.1, 0.0] },
    { mass_kg = 30, com_m = [0.0, 1.0, 0.1], inertia_com_kgm2 = [12.0, 0.0, 0.0, 9.0, 0.0, 13.0], hinge_m = [0.0, 2.15, 0.0], hinge_axis = [1.0, 0.1, 0.0], rest_rad = 0.05 },
]
"#;

#[track_caller]
fn refused(from: &str, to: &str, code: &str, object: &str, says: &str) -> Problems {
    assert!(TWO.contains(from), "{from}");
    let Err(e) = from_toml(&TWO.replace(from, to).parse().unwrap()) else { panic!("accepted") };
    let p = e.0.iter().find(|p| p.code == code).unwrap_or_else(|| panic!("no {code} in {e}"));
    assert_eq!((p.object.as_deref(), p.hint.is_some()), (Some(object), true), "{p}");
    assert!(p.to_string().contains(says), "{says}: {p}");
    e
}

#[test]
fn mission_files_give_matrices_in_rows() {
    let a = from_toml(&TWO.parse().unwrap()).unwrap();
    let p = &a.declaration().params;
    assert_eq!((p[20].nominal, p[21].nominal, p[22].nominal, p[23].nominal), (200.0, 180.0, 2.0, 1.5));
    assert_eq!(p[24..].iter().map(|p| (&*p.name, p.nominal)).collect::<Vec<_>>(), [("k[0,1]", -60.0), ("d[0,1]", 0.3)]);
    // One of the two alone; the segments keep the other.
    let mixed = TWO
        .replace("damping_nms_per_rad = [[2.0, 0.3], [0.3, 1.5]]\n", "")
        .replace("hinge_axis", "damping_nms_per_rad = 0.4, hinge_axis");
    let a = from_toml(&mixed.parse().unwrap()).unwrap();
    assert_eq!((a.declaration().params.len(), a.declaration().params[23].nominal), (25, 0.4));
}

#[test]
fn wrong_matrices_are_refused_by_name() {
    refused("-60.0", "-190.0", "Config::NotPassive", "stiffness_nm_per_rad", "pushed away from rest");
    refused("0.3], [0.3", "1.9], [1.9", "Config::NotPassive", "damping_nms_per_rad", "fed with energy");
    refused(
        "[-60.0, 180.0]",
        "[-61.0, 180.0]",
        "Config::NotSymmetric",
        "stiffness_nm_per_rad[1][0]",
        "-61 N m/rad differs from -60",
    );
    refused("180.0]]", "-180.0]]", "Config::NotPassive", "stiffness_nm_per_rad[1][1]", "-180 N m/rad");
    refused("[2.0, 0.3]", "[2.0]", "Config::WrongLength", "damping_nms_per_rad[0]", "1 numbers in a row");
    refused(
        "[[2.0, 0.3], [0.3, 1.5]]",
        "[[2.0]]",
        "Config::WrongLength",
        "damping_nms_per_rad",
        "1 x 1 numbers for 2 segments",
    );
    refused("[[2.0, 0.3], [0.3, 1.5]]", "2.0", "Config::Type", "damping_nms_per_rad", "array of rows");
    refused("[0.3, 1.5]", "[0.3, nan]", "Config::NotFinite", "damping_nms_per_rad[1][1]", "NaN");
    // Both a matrix and springs of the segments: which one counts?
    let at = "segments[0].stiffness_nm_per_rad";
    refused("hinge_m = [0.9", "stiffness_nm_per_rad = 3.0, hinge_m = [0.9", "Config::UnknownKey", at, "unknown key");
    let k = DMatrix::from_element(16, 16, 1.0) + DMatrix::identity(16, 16) * 16.0;
    let e = chain(&mut rng(46), 16).with_coupling(&k, &k).unwrap_err();
    assert!(e.has("Config::TooManyParameters") && e.to_string().contains("limit 256"), "{e}");
    let bad = DMatrix::from_element(2, 2, f64::INFINITY);
    assert!(chain(&mut rng(47), 2).with_coupling(&bad, &bad).unwrap_err().has("Config::NotFinite"));
}

/// Bounds of a coupling are shares of the stiffness it couples: twice the matrix has twice the bounds.
#[test]
fn bounds_of_couplings_grow_with_the_matrix() {
    let mut r = rng(47);
    let n = 3;
    let (k, d) = (definite(&mut r, n, 150.0), definite(&mut r, n, 2.0));
    let base = chain(&mut r, n);
    let bounds = |scale: f64| -> Vec<(f64, f64)> {
        let c = base.clone().with_coupling(&(&k * scale), &(&d * scale)).unwrap();
        c.decl().params[12 * n..].iter().map(|p| p.bounds).collect()
    };
    let (one, many) = (bounds(1.0), bounds(7.0));
    assert_eq!(one.len(), n * (n - 1));
    for (a, b) in one.iter().zip(&many) {
        assert!(a.1 > a.0);
        assert!((7.0 * a.0 - b.0).abs() < 1e-9 * b.0.abs(), "{a:?} {b:?}");
        assert!((7.0 * a.1 - b.1).abs() < 1e-9 * b.1.abs(), "{a:?} {b:?}");
    }
}
