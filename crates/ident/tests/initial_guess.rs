//! Start values a given distance from known ones, for studies of convergence.

use ff_model::Inertia;
use ff_model::ParamDecl;
use ff_testkit::assert_within;
use ident::parameters::*;
use nalgebra::{Matrix3, Vector3};

#[test]
fn a_moved_body_is_still_a_body_and_every_parameter_moved() {
    let i = Matrix3::new(15.0, 0.4, -0.3, 0.4, 11.0, 0.2, -0.3, 0.2, 14.0);
    let b = Inertia::from_com(33.0, &Vector3::new(0.02, 1.07, 0.0), &i);
    let mut decls = ParamDecl::inertial("panel", &b);
    decls.push(ParamDecl::positive("k[0]", "N m/rad", 200.0));
    let values: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
    for seed in 0..20 {
        let out = offset_start(&decls, &values, &(0..11).collect::<Vec<_>>(), 0.25, seed);
        let moved = Inertia::from_params(&out);
        assert_eq!(moved.check(), Ok(()));
        assert_within!(((out[0] / 33.0 - 1.0).abs() - 0.25).abs(), 1e-12);
        assert_within!(((out[10] / 200.0 - 1.0).abs() - 0.25).abs(), 1e-12);
        assert!(out.iter().zip(&values).all(|(a, b)| a != b));
        let drawn = random_start(&decls, &values, &(0..11).collect::<Vec<_>>(), 0.7, seed);
        assert_eq!(Inertia::from_params(&drawn).check(), Ok(()));
        assert!([0, 10].iter().all(|&i| (drawn[i] / values[i] - 1.0).abs() < 0.7));
        assert!(drawn.iter().zip(&out).all(|(a, b)| a != b));
    }
}

#[test]
fn a_wide_start_is_physical_and_within_its_factors() {
    let i = Matrix3::new(15.0, 0.4, -0.3, 0.4, 11.0, 0.2, -0.3, 0.2, 14.0);
    let b = Inertia::from_com(33.0, &Vector3::new(0.02, 1.07, 0.0), &i);
    let mut decls = ParamDecl::inertial("panel", &b);
    decls.push(ParamDecl::positive("k[0]", "N m/rad", 200.0));
    let values: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
    let factors: Vec<(f64, f64)> = (0..40)
        .map(|seed| {
            let out = wide_start(&decls, &values, &(0..11).collect::<Vec<_>>(), seed);
            assert_eq!(Inertia::from_params(&out).check(), Ok(()));
            (out[0] / 33.0, out[10] / 200.0)
        })
        .collect();
    assert!(factors.iter().all(|(m, k)| (0.5..2.0).contains(m) && (0.2..5.0).contains(k)), "{factors:?}");
    assert!(factors.iter().any(|f| f.1 > 2.5) && factors.iter().any(|f| f.1 < 0.4), "{factors:?}");
    // A part of a body is not moved: nothing would keep it physical.
    assert_eq!(wide_start(&decls, &values, &[0], 3), values);
}
