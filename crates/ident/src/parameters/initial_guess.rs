//! Start values a given distance from known ones, for studies of convergence.

use ff_model::Inertia;
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Moves the selected parameters `offset` away (0.25 is 25 %), up or down by seeded coin tosses.
///
/// Positive and free parameters are multiplied by `1 +- offset`. A body stays a body: its mass and each of
/// its principal second moments are multiplied by `1 +- offset`, and its centre of mass is moved along each
/// principal axis by `offset` times the larger of its coordinate and its gyration radius (so that a zero
/// coordinate moves too). Bodies of which only a part is selected are scaled parameter by parameter.
///
/// # Panics
/// If lengths differ or `offset` is not in `0 .. 1`.
pub fn offset_start(decls: &[ParamDecl], values: &[f64], selected: &[usize], offset: f64, seed: u64) -> Vec<f64> {
    assert!((0.0..1.0).contains(&offset), "offset {offset} outside 0 .. 1");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    moved(decls, values, selected, move || if rng.random_range(0..2) == 0 { -offset } else { offset })
}

/// As [`offset_start`], but every quantity moves by its own amount, evenly drawn from `-width .. width`.
///
/// # Panics
/// If lengths differ or `width` is not in `0 .. 1`.
pub fn random_start(decls: &[ParamDecl], values: &[f64], selected: &[usize], width: f64, seed: u64) -> Vec<f64> {
    assert!((0.0..1.0).contains(&width), "width {width} outside 0 .. 1");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    moved(decls, values, selected, move || width * rng.random_range(-1.0..1.0))
}

/// Starts far from known values: positive parameters are multiplied by factors from 1/5 to 5, whole bodies (all ten parameters) by one
/// factor from 1/2 to 2 each, evenly drawn in their logarithms. Other parameters stay. Allocates.
///
/// # Panics
/// If lengths differ.
pub fn wide_start(decls: &[ParamDecl], values: &[f64], selected: &[usize], seed: u64) -> Vec<f64> {
    assert_eq!(decls.len(), values.len(), "one value per parameter");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut factor = move |most: f64| most.powf(rng.random_range(-1.0..1.0));
    let mut out = values.to_vec();
    let mut k = 0;
    while k < selected.len() {
        let i = selected[k];
        if whole_body(decls, selected, k) {
            let by = factor(2.0);
            out[i..i + 10].iter_mut().for_each(|p| *p *= by);
            k += 10;
            continue;
        }
        if decls[i].group == ParamGroup::Positive {
            out[i] *= factor(5.0);
        }
        k += 1;
    }
    out
}

/// Whether the ten parameters of a body are selected from place `k` on.
fn whole_body(decls: &[ParamDecl], selected: &[usize], k: usize) -> bool {
    let i = selected[k];
    matches!(decls[i].group, ParamGroup::Inertial(_))
        && selected.get(k + 9) == Some(&(i + 9))
        && decls[i + 9].group == decls[i].group
}

/// Moves every quantity by the relative amount that `toss` gives.
fn moved(decls: &[ParamDecl], values: &[f64], selected: &[usize], mut toss: impl FnMut() -> f64) -> Vec<f64> {
    assert_eq!(decls.len(), values.len(), "one value per parameter");
    let mut out = values.to_vec();
    let mut k = 0;
    while k < selected.len() {
        let i = selected[k];
        if !whole_body(decls, selected, k) {
            out[i] = values[i] * (1.0 + toss());
            k += 1;
            continue;
        }
        let b = Inertia::from_params(&values[i..i + 10]);
        let c = b.com().unwrap_or_default();
        let ic = b.about_com();
        // Second moments about the centre of mass and their axes.
        let second = Matrix3::from_diagonal_element(0.5 * ic.trace()) - ic;
        let eig = second.symmetric_eigen();
        let mass = b.mass * (1.0 + toss());
        let (mut moved, mut moments) = (c, eig.eigenvalues);
        for a in 0..3 {
            let axis: Vector3<f64> = eig.eigenvectors.column(a).into_owned();
            let radius = (eig.eigenvalues[a].max(0.0) / b.mass).sqrt();
            moved += axis * toss() * c.dot(&axis).abs().max(radius);
            moments[a] *= 1.0 + toss();
        }
        let second = eig.eigenvectors * Matrix3::from_diagonal(&moments) * eig.eigenvectors.transpose();
        let ic = Matrix3::from_diagonal_element(second.trace()) - second;
        out[i..i + 10].copy_from_slice(&Inertia::from_com(mass, &moved, &ic).to_params());
        k += 10;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

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
}
