//! Physical parameters and the unconstrained coordinates in which they are estimated.

use approx::assert_relative_eq;
use ff_model::Inertia;
use ff_model::{ParamDecl, ParamGroup};
use ff_testkit::scaled;
use ident::parameters::*;
use nalgebra::{DMatrix, Matrix3, Vector3};

fn decls() -> (Vec<ParamDecl>, Vec<f64>) {
    let i = Matrix3::new(1.9, 0.13, -0.21, 0.13, 2.3, 0.32, -0.21, 0.32, 2.7);
    let base = Inertia::from_com(3.7, &Vector3::new(0.4, -0.2, 0.9), &i);
    let mut d = ParamDecl::inertial("base", &base);
    d.push(ParamDecl { bounds: (2.0, 500.0), ..ParamDecl::positive("panel.k[0]", "N m/rad", 210.0) });
    d.push(ParamDecl {
        bounds: (-3.0, 4.0),
        group: ParamGroup::Free,
        ..ParamDecl::positive("tank.offset", "m", -0.31)
    });
    let v = d.iter().map(|p| p.nominal).collect();
    (d, v)
}

#[test]
fn there_and_back_and_every_point_is_a_body() {
    let (d, v) = decls();
    let t = Transform::new(&d, &(0..12).collect::<Vec<_>>(), &v).unwrap();
    let mut x = t.coordinates(&v).unwrap();
    let mut full = vec![0.0; 12];
    t.apply(&x, &mut full);
    for (a, b) in full.iter().zip(&v) {
        assert_relative_eq!(a, b, max_relative = scaled(1e-13));
    }
    // Any ten numbers: far away, still a body that can exist.
    for (k, x) in x.iter_mut().enumerate() {
        *x += 2.0 * (k as f64 * 1.9 + 0.3).sin();
    }
    t.apply(&x, &mut full);
    assert_eq!(Inertia::from_params(&full[..10]).check(), Ok(()));
    assert!(full[10] > 0.0);
}

#[test]
fn jacobian_matches_differences_and_chain_matches_the_product() {
    let (d, v) = decls();
    let sel: Vec<usize> = (0..12).collect();
    let t = Transform::new(&d, &sel, &v).unwrap();
    let x = t.coordinates(&v).unwrap();
    let j = t.jacobian(&x);
    let h = 1e-6;
    for k in 0..12 {
        let (mut a, mut b) = (x.clone(), x.clone());
        a[k] += h;
        b[k] -= h;
        let (pa, pb) = (t.physical(&a), t.physical(&b));
        for i in 0..12 {
            assert_relative_eq!(
                j[(i, k)],
                (pa[i] - pb[i]) / (2.0 * h),
                epsilon = scaled(1e-7),
                max_relative = scaled(1e-7)
            );
        }
    }
    let y = DMatrix::from_fn(5, 12, |i, k| ((7 * i + 3 * k + 1) as f64).sin());
    let mut z = y.clone();
    t.chain(&x, &mut z);
    assert_relative_eq!(z, &y * &j, epsilon = scaled(1e-11));
}

#[test]
fn the_logarithm_of_the_determinant_is_linear() {
    let (d, v) = decls();
    let t = Transform::new(&d, &(0..12).collect::<Vec<_>>(), &v).unwrap();
    let x = t.coordinates(&v).unwrap();
    let y: Vec<f64> = x.iter().enumerate().map(|(k, x)| x + 0.4 * (k as f64 * 1.7 + 0.2).sin()).collect();
    let of = |x: &[f64]| t.jacobian(x).determinant().abs().ln();
    let slope: f64 = t.log_volume_slope().iter().zip(y.iter().zip(&x)).map(|(s, (y, x))| s * (y - x)).sum();
    assert_relative_eq!(of(&y) - of(&x), slope, epsilon = scaled(1e-10), max_relative = scaled(1e-10));
    let straight = Transform::affine(&d, &(0..12).collect::<Vec<_>>(), &v).unwrap();
    assert_eq!(straight.log_volume_slope(), [0.0; 12]);
}

#[test]
fn bodies_on_the_boundary_are_named_with_their_shape() {
    let c = Vector3::new(0.4, -0.2, 0.9);
    for (moments, shape) in
        [([0.0, 0.0, 0.0], "a point mass"), ([0.0, 1.3, 1.3], "a thin rod"), ([1.1, 0.7, 1.8], "a flat plate")]
    {
        let b = Inertia::from_com(2.0, &c, &Matrix3::from_diagonal(&Vector3::from(moments)));
        let e = log_cholesky("boom", &b).unwrap_err();
        assert!(matches!(&e, TransformError::Boundary { shape: s, .. } if *s == shape), "{e}");
        assert!(e.to_string().contains("'boom'"));
    }
    let neg = Inertia::from_com(2.0, &c, &Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 3.0)));
    assert!(matches!(log_cholesky("boom", &neg), Err(TransformError::Inconsistent { .. })));
}

#[test]
fn part_of_a_body_is_allowed_and_said() {
    let (d, v) = decls();
    let t = Transform::new(&d, &[0, 2, 10, 11], &v).unwrap();
    assert_eq!(t.partial_bodies(), ["base"]);
    assert_eq!(t.coordinate_names()[..3], ["ln base.mass", "base.h_y / 0.7400000000000001", "ln panel.k[0]"]);
    assert_relative_eq!(t.bounds()[2].0, 2.0f64.ln());
    assert_relative_eq!(t.bounds()[3].1, 4.0 / 0.31);
    let mut zero = v;
    zero[10] = 0.0;
    let e = Transform::new(&d, &[10], &zero).unwrap_err();
    assert_eq!(
        e.to_string(),
        "parameter 'panel.k[0]' is 0 N m/rad, but its logarithm is estimated; start from a positive value"
    );
    zero[11] = f64::NAN;
    assert!(matches!(Transform::new(&d, &[11], &zero), Err(TransformError::NotFinite { .. })));
    assert!(Transform::new(&d, &[3, 3], &v_of(&d)).is_err() && Transform::new(&d, &[99], &v_of(&d)).is_err());
}

fn v_of(d: &[ParamDecl]) -> Vec<f64> {
    d.iter().map(|p| p.nominal).collect()
}
