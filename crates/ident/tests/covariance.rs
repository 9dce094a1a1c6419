//! How well the data determine each parameter, and which combinations they do not determine at all.

use approx::assert_relative_eq;
use ff_testkit::scaled;
use ident::belief::*;
use nalgebra::DMatrix;

fn unknowns(n: usize) -> Vec<Unknown> {
    (0..n).map(|i| Unknown { name: format!("p{i}"), unit: "kg".into(), size: [600.0, 0.5, 20.0, 3.0][i] }).collect()
}
fn sensitivities() -> DMatrix<f64> {
    let scale = [0.02, 30.0, 0.4, 5.0];
    DMatrix::from_fn(40, 4, |i, k| scale[k] * ((0.31 * (k + 1) as f64) * i as f64 + 0.4).sin())
}

#[test]
fn covariance_is_the_inverse_information_matrix() {
    let j = sensitivities();
    let u = analyse(&j, &unknowns(4), 1e-9).unwrap();
    let reference = (j.transpose() * &j).try_inverse().unwrap();
    assert_relative_eq!(u.covariance, reference, max_relative = scaled(1e-9));
    assert_relative_eq!(u.deviation[2].unwrap(), reference[(2, 2)].sqrt(), max_relative = scaled(1e-10));
    assert!(u.full_rank() && u.null.is_empty() && u.condition > 1.0);
    assert_relative_eq!(u.correlations()[(1, 1)], 1.0, max_relative = scaled(1e-12));
    let strong = u.strong_correlations(0.0);
    assert!(strong.len() == 6 && strong[0].2.abs() >= strong[5].2.abs());
}

#[test]
fn null_directions_are_named_in_physical_units_and_touch_only_their_parameters() {
    let mut j = sensitivities();
    // Column 3 acts as -0.05 of column 0 per unit: raising p3 by 1 is undone by raising p0 by 0.05.
    let c = j.column(0) * -0.05;
    j.set_column(3, &c);
    let u = analyse(&j, &unknowns(4), 1e-9).unwrap();
    assert_eq!((u.rank, u.null.len()), (3, 1));
    assert_eq!(u.deviation.iter().map(Option::is_some).collect::<Vec<_>>(), [false, true, true, false]);
    // p0 - 0.05 p3 is what the data see of the two, and what they would see of p0 with p3 known.
    let three = j.columns(0, 3).into_owned();
    let alone = analyse(&three, &unknowns(3), 1e-9).unwrap().deviation[0].unwrap();
    assert_relative_eq!(u.combination(&[1.0, 0.0, 0.0, -0.05]).unwrap(), alone, max_relative = scaled(1e-6));
    assert_eq!(u.combination(&[1.0, 0.3, 0.0, 0.05]), None);
    let d = &u.null[0];
    let of = |n: &str| d.terms.iter().find(|t| t.0 == n).map_or(0.0, |t| t.1);
    assert!(d.terms[0].0 == "p3" && d.omitted == 1, "{d}");
    assert_relative_eq!(of("p3"), 3.0, max_relative = scaled(1e-6));
    assert!(d.to_string().starts_with("3.000e0 p3 (and 1"), "{d}");
}

#[test]
fn weak_directions_are_known_worse_than_their_own_size() {
    let mut j = sensitivities();
    j.column_mut(1).scale_mut(1e-3);
    let u = analyse(&j, &unknowns(4), 1e-9).unwrap();
    assert_eq!((u.rank, u.weak.len()), (4, 1));
    assert_eq!(u.weak[0].terms[0].0, "p1");
    assert!(u.deviation[1].unwrap() > 0.5);
}

#[test]
fn coordinates_and_physical_parameters_carry_the_same_information() {
    let p = DMatrix::from_fn(4, 4, |i, k| if i == k { 2.0 + i as f64 } else { 0.1 * (i as f64 - 1.7 * k as f64) });
    let j = sensitivities();
    assert_relative_eq!(physical_jacobian(&(&j * &p), &p).unwrap(), j, epsilon = scaled(1e-11));
    assert!(physical_jacobian(&j, &DMatrix::zeros(4, 4)).is_err());
    let mut bad = j.clone();
    bad[(3, 3)] = f64::NAN;
    assert!(analyse(&bad, &unknowns(4), 1e-9).is_err() && analyse(&j, &unknowns(3), 1e-9).is_err());
}

#[test]
fn a_second_place_adds_its_second_moment() {
    let j = sensitivities();
    let u = analyse(&j, &unknowns(4), 1e-9).unwrap();
    let step = [31.0, -0.07, 4.2, 1.3];
    let d = nalgebra::DVector::from_column_slice(&step);
    let wide = u.with_second_place(&step, 0.37, 1e-9).unwrap();
    assert_relative_eq!(wide.covariance, &u.covariance + 0.37 * &d * d.transpose(), max_relative = scaled(1e-9));
    assert_relative_eq!(wide.deviation[1].unwrap(), wide.covariance[(1, 1)].sqrt(), max_relative = scaled(1e-12));
    // What is not determined stays so, and a step along it changes nothing else.
    let mut j = sensitivities();
    j.column_mut(3).fill(0.0);
    let u = analyse(&j, &unknowns(4), 1e-9).unwrap();
    let wide = u.with_second_place(&[0.0, 0.0, 0.0, 2.7], 0.4, 1e-9).unwrap();
    assert!(wide.rank == 3 && wide.deviation[3].is_none());
    assert_relative_eq!(wide.deviation[0].unwrap(), u.deviation[0].unwrap(), max_relative = scaled(1e-9));
}
