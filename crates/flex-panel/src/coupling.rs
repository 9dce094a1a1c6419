//! Springs and dampers that couple hinges: full symmetric matrices `K` and `D`.
//!
//! A blanket, a harness or a tape hinge ties neighbouring hinges together, and a stiffness matrix condensed from a
//! finite-element model is full. Diagonal elements are the `k[i]`, `d[i]` of the hinges; every off-diagonal element that
//! is not zero becomes a parameter `k[i,j]`, `d[i,j]` with `i < j`. Zeros are structure, not parameters.
//!
//! **Bounds.** An estimator must not make the matrix indefinite. With `C = S K S` scaled to unit diagonal, least
//! eigenvalue `l`, and at most `m` couplings in a row, all matrices with
//!
//! ```text
//! k[i] >= (1 - l/2) k[i]_0        |k[i,j] - k[i,j]_0| <= l / (2 m) sqrt(k[i]_0 k[j]_0)
//! ```
//!
//! are positive semidefinite, because what is taken from `C` has a row sum, hence a norm, of at most `l/2 + m l/(2 m)`
//! (Gershgorin), and a diagonal that grows adds a semidefinite matrix. Hinges without a coupling keep `(0, inf)`.

use ff_model::diagnostics::Limit;
use ff_model::{Area, ParamDecl, ParamGroup, Problem, Problems};
use nalgebra::DMatrix;

/// How far the least eigenvalue of the scaled matrix may be below zero: rounding of a singular matrix.
const SLACK: f64 = 1e-12;

/// What a matrix stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Of {
    /// Prefix of the parameters.
    pub(crate) letter: &'static str,
    /// Unit of the elements.
    pub(crate) unit: &'static str,
    /// Key in the mission file.
    pub(crate) key: &'static str,
    /// What an indefinite one would do.
    pub(crate) law: &'static str,
}

/// Stiffness of the hinges.
pub(crate) const STIFFNESS: Of = Of {
    letter: "k",
    unit: "N m/rad",
    key: "stiffness_nm_per_rad",
    law: "some deflection would be pushed away from rest",
};
/// Damping of the hinges.
pub(crate) const DAMPING: Of =
    Of { letter: "d", unit: "N m s/rad", key: "damping_nms_per_rad", law: "some motion would be fed with energy" };

/// The couplings of one matrix: rows and columns with `i < j`, in the order of their parameters.
#[derive(Clone, Debug, Default)]
pub(crate) struct Coupling {
    pub(crate) pairs: Vec<(usize, usize)>,
}

impl Coupling {
    /// Couplings of `matrix`, whose declarations are pushed to `params` and whose diagonal gets its bounds there from
    /// index `diagonal` on. Allocates.
    pub(crate) fn declare(matrix: &DMatrix<f64>, of: Of, diagonal: usize, params: &mut Vec<ParamDecl>) -> Self {
        let n = matrix.nrows();
        let pairs: Vec<_> =
            (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).filter(|&(i, j)| matrix[(i, j)] != 0.0).collect();
        let count = |i: usize| pairs.iter().filter(|p| p.0 == i || p.1 == i).count();
        let most = (0..n).map(count).max().unwrap_or(0).max(1) as f64;
        let least = scaled_least(matrix).max(0.0);
        for i in (0..n).filter(|&i| count(i) > 0) {
            params[diagonal + i].bounds.0 = (1.0 - least / 2.0) * matrix[(i, i)];
        }
        for &(i, j) in &pairs {
            let reach = least / (2.0 * most) * (matrix[(i, i)] * matrix[(j, j)]).sqrt();
            let x = matrix[(i, j)];
            params.push(ParamDecl {
                name: format!("{}[{i},{j}]", of.letter),
                unit: of.unit,
                nominal: x,
                bounds: (x - reach, x + reach),
                group: ParamGroup::Free,
            });
        }
        Self { pairs }
    }
}

/// Least eigenvalue of the coupled part of a symmetric matrix, scaled to unit diagonal; 1 without couplings. The matrix
/// must be finite.
fn scaled_least(m: &DMatrix<f64>) -> f64 {
    let n = m.nrows();
    let coupled: Vec<usize> = (0..n).filter(|&i| (0..n).any(|j| j != i && m[(i, j)] != 0.0)).collect();
    if coupled.is_empty() {
        return 1.0;
    }
    let s: Vec<f64> = coupled.iter().map(|&i| 1.0 / m[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    DMatrix::from_fn(s.len(), s.len(), |i, j| s[i] * m[(coupled[i], coupled[j])] * s[j]).symmetric_eigenvalues().min()
}

/// Adds everything that is wrong with the matrix of `n` hinges to `problems`, at key `of.key`. Allocates.
pub(crate) fn check(matrix: &DMatrix<f64>, n: usize, of: Of, problems: &mut Problems) {
    let bad = |code, at: String, what: String, hint: &str| Problem::error(Area::Config, code, what).on(at).hint(hint);
    let (rows, columns) = matrix.shape();
    if (rows, columns) != (n, n) {
        let what = format!("{rows} x {columns} numbers for {n} segments, expected {n} x {n}");
        problems.push(bad("Config::WrongLength", of.key.into(), what, "give one row and one column per hinge"));
        return;
    }
    let mut sound = true;
    let mut scale = 0.0_f64;
    for i in 0..n {
        let at = format!("{}[{i}][{i}]", of.key);
        let own = matrix[(i, i)];
        for j in 0..n {
            if !matrix[(i, j)].is_finite() {
                let what = format!("{} {} is not a finite number", matrix[(i, j)], of.unit);
                problems.push(bad("Config::NotFinite", format!("{}[{i}][{j}]", of.key), what, "give a finite number"));
                sound = false;
            }
        }
        if own < 0.0 {
            let what = format!("{own} {} is below the limit 0 {}", of.unit, of.unit);
            let p = bad("Config::NotPassive", at, what, "give the magnitude; the restoring sign is built in");
            problems.push(p.violating(own, Limit::AtLeast(0.0), of.unit));
            sound = false;
        }
        scale = scale.max(own.abs());
    }
    for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let (a, b) = (matrix[(i, j)], matrix[(j, i)]);
        if sound && (a - b).abs() > 1e-9 * scale {
            let what = format!("{a} {} differs from {b} {} on the other side of the diagonal", of.unit, of.unit);
            problems.push(bad(
                "Config::NotSymmetric",
                format!("{}[{i}][{j}]", of.key),
                what,
                "give a symmetric matrix",
            ));
            sound = false;
        }
    }
    if !sound {
        return;
    }
    let least = scaled_least(matrix);
    if least < -SLACK {
        let what = format!(
            "is not positive semidefinite: least eigenvalue {least:.3e} after scaling to unit diagonal, limit 0: {}",
            of.law
        );
        let hint = "make off-diagonal elements smaller than the diagonal allows";
        let p = bad("Config::NotPassive", of.key.into(), what, hint);
        problems.push(p.violating(least, Limit::AtLeast(0.0), ""));
    }
}
