//! Deviations of a fit with several minima between which its record does not choose.
//!
//! With minima `x_i` of cost `c_i` (twice the negative logarithm of the posterior) and covariances `C_i` there, the posterior is near
//! `sum_i w_i N(x_i, C_i)` with `w_i` in proportion to `exp(-c_i/2) sqrt(det C_i)` (Laplace; Gelman et al., *Bayesian Data Analysis*, 3rd ed.,
//! section 13.3). The estimate is the lowest of them, `x_0`; its second moment about that is `sum_i w_i (C_i + d_i d_i^T)` with
//! `d_i = x_i - x_0`, and takes the place of the covariance.

use ident::belief::{Uncertainty, analyse};
use ident::estimate::{Estimate, RANK_TOLERANCE};
use nalgebra::{DMatrix, DVector};

/// Factor by which the volume of a minimum counts at most: damping that vanishes bounds a minimum on one side.
const VOLUME: f64 = 10.0;

/// Widens the deviations of `best` so that they cover `others`, and gives back what they were; nothing happens where those have other unknowns.
pub(super) fn cover(best: &mut Estimate, others: &[Estimate]) -> Option<Uncertainty> {
    if others.iter().any(|o| !of_the_same(best, o)) {
        return None;
    }
    let alone = best.uncertainty.clone();
    let volume = log_volume(&best.uncertainty);
    let mut sum = 1.0;
    let mut moment = best.uncertainty.covariance.clone();
    for o in others {
        let larger = (log_volume(&o.uncertainty) - volume).clamp(-VOLUME.ln(), VOLUME.ln());
        let weight = (0.5 * (best.objective - o.objective) + larger).exp();
        moment += about(best, o) * weight;
        sum += weight;
    }
    moment /= sum;
    widen(best, moment);
    Some(alone)
}

/// The second moment about an estimate of its own density and that of another end, whose cost without what holds it there is higher by `excess`; it counts for
/// [`VOLUME`], since that of a spring that has run away says nothing. `None` where that has other unknowns.
pub(super) fn beside(e: &Estimate, other: &Estimate, excess: f64) -> Option<DMatrix<f64>> {
    let weight = VOLUME * (-0.5 * excess).exp();
    of_the_same(e, other).then(|| (&e.uncertainty.covariance + about(e, other) * weight) / (1.0 + weight))
}

/// Whether two ends are of the same unknowns.
fn of_the_same(one: &Estimate, other: &Estimate) -> bool {
    one.uncertainty.unknowns.len() == other.uncertainty.unknowns.len()
}

/// The second moment of the density of another end about an estimate.
fn about(e: &Estimate, other: &Estimate) -> DMatrix<f64> {
    let at = |e: &Estimate| -> Vec<f64> { e.parameters.iter().chain(&e.nuisance).map(|p| p.value).collect() };
    let d = DVector::from_vec(at(other)) - DVector::from_vec(at(e));
    &other.uncertainty.covariance + &d * d.transpose()
}

/// Logarithm of the root of the determinant of the covariance, where the data determine everything.
fn log_volume(u: &Uncertainty) -> f64 {
    let of_sizes: f64 = u.unknowns.iter().map(|k| k.size.abs().max(f64::MIN_POSITIVE).ln()).sum();
    of_sizes - u.singular_values.iter().take(u.rank).map(|s| s.ln()).sum::<f64>()
}

/// Puts a covariance in place of that of an estimate, and its deviations beside all unknowns.
pub(super) fn widen(e: &mut Estimate, covariance: DMatrix<f64>) {
    replace(&mut e.uncertainty, covariance);
    let all = e.parameters.iter_mut().chain(&mut e.nuisance);
    all.zip(&e.uncertainty.deviation).for_each(|(p, std)| p.std = *std);
}

/// Puts a covariance in place of another. Where everything is determined, singular values and directions are those of it, too.
fn replace(u: &mut Uncertainty, covariance: DMatrix<f64>) {
    let n = covariance.nrows();
    let std: Vec<f64> = covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
    if u.full_rank() {
        let unit = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (std[i] * std[j]));
        // Rows J with J^T J the inverse of the covariance.
        let inverse = unit.cholesky().and_then(|c| c.l().solve_lower_triangular(&DMatrix::identity(n, n)));
        let rows = inverse.map(|l| DMatrix::from_fn(n, n, |i, j| l[(i, j)] / std[j]));
        if let Some(Ok(new)) = rows.map(|j| analyse(&j, &u.unknowns, RANK_TOLERANCE))
            && new.full_rank()
        {
            *u = new;
            return;
        }
    }
    for (d, s) in u.deviation.iter_mut().zip(std) {
        *d = d.map(|_| s);
    }
    u.covariance = covariance;
}

#[cfg(test)]
mod tests {
    use super::*;
    use ident::belief::Unknown;

    #[test]
    fn a_covariance_comes_back_from_its_rows() {
        let unknowns: Vec<Unknown> = [("a", 3.0), ("b", 0.02), ("c", 70.0)]
            .map(|(n, size)| Unknown { name: n.into(), unit: "kg".into(), size })
            .to_vec();
        let j = DMatrix::from_fn(9, 3, |i, k| ((0.7 * (k + 1) as f64) * i as f64 + 0.3).sin() / unknowns[k].size);
        let mut u = analyse(&j, &unknowns, 1e-9).unwrap();
        let before = u.clone();
        let d = DVector::from_column_slice(&[2.0, -0.01, 5.0]);
        let wide = &u.covariance + &d * d.transpose() * 0.4;
        replace(&mut u, wide.clone());
        assert!((&u.covariance - &wide).abs().max() < 1e-9 * wide.abs().max());
        for k in 0..3 {
            assert!((u.deviation[k].unwrap() - wide[(k, k)].sqrt()).abs() < 1e-9 * unknowns[k].size);
            assert!(u.deviation[k] > before.deviation[k]);
        }
        assert!(log_volume(&u) > log_volume(&before));
        let half_log_det = 0.5 * wide.determinant().ln();
        assert!((log_volume(&u) - half_log_det).abs() < 1e-6, "{} {half_log_det}", log_volume(&u));
    }
}
