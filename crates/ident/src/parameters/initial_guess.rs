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
