//! Any appendage at small deflections as a modal one.

use super::{MAX_MODES, ModalAppendage, Mode};
use ff_model::scalar::ModelScalar;
use ff_model::scalar::{D1, D2};
use ff_model::{Area, Dual, DynAppendage, Inertia, Motion, PortState, Problem, Problems};
use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector6};
use std::f64::consts::TAU;

/// What [`linearise`] makes of an appendage.
#[derive(Clone, Debug)]
pub struct Linearised {
    /// The modal appendage, modes in ascending frequency.
    pub appendage: ModalAppendage,
    /// Mode shapes, column by column: `eta - eta_0 = shapes * modal`, so that `shapes^T M_ee shapes = 1`.
    pub shapes: DMatrix<f64>,
    /// Largest coupling of two modes by damping, `|D_ij| / sqrt(D_ii D_jj)`, which a modal appendage leaves out; zero
    /// when damping is proportional.
    pub damping_coupling: f64,
}

/// The modes of an appendage with its host held, about the coordinates `eta` where its springs are relaxed.
///
/// `K x = w^2 M_ee x`, `P = M_be X`, `2 zeta w = x^T D x`, with `K = d^2U/d eta^2` and `D = d^2R/d nu^2` exact. What it
/// leaves out is of second order in deflection and rates, and what [`Linearised::damping_coupling`] reports. Allocates.
///
/// # Errors
/// `Config::Param` if a mode has no stiffness or there are no or too many coordinates, `Config::NotInvertible` if the own
/// block of the inertia is not positive definite; and what [`ModalAppendage::new`] finds.
///
/// # Panics
/// If `p` or `eta` has the wrong length.
pub fn linearise(a: &dyn DynAppendage, p: &[f64], eta: &[f64]) -> Result<Linearised, Problems> {
    let n = eta.len();
    let one = |code, what: String, hint: &str| {
        Err(Problems(vec![Problem::error(Area::Config, code, what).on(a.declaration().kind).hint(hint)]))
    };
    if n == 0 || n > MAX_MODES {
        let what = format!("{n} coordinates, outside the limits 1 to {MAX_MODES}");
        return one("Config::Param", what, "linearise what has coordinates of its own");
    }
    let m = f64::port(a).dense_inertia(p, eta);
    let (k, d) = stiffness_damping(a, p, eta);
    let hint = "every coordinate needs inertia";
    let Some(cholesky) = m.view((6, 6), (n, n)).into_owned().cholesky() else {
        return one("Config::NotInvertible", "own block of the inertia is not positive definite".into(), hint);
    };
    let Some(li) = cholesky.l().try_inverse() else {
        return one("Config::NotInvertible", "own block of the inertia is not positive definite".into(), hint);
    };
    let standard = &li * k * li.transpose();
    let eigen = SymmetricEigen::new((&standard + standard.transpose()) * 0.5);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
    let columns: Vec<DVector<f64>> = order.iter().map(|&j| li.transpose() * eigen.eigenvectors.column(j)).collect();
    let shapes = DMatrix::from_columns(&columns);
    let part = m.view((0, 6), (6, n)) * &shapes;
    let damping = shapes.transpose() * d * &shapes;
    let mut modes = Vec::with_capacity(n);
    for (j, &e) in order.iter().enumerate() {
        let square = eigen.eigenvalues[e];
        if square <= 0.0 {
            let what = format!("mode {j} has stiffness {square} N/m at a modal mass of 1 kg, limit > 0 N/m");
            return one("Config::Param", what, "a coordinate without a spring is no vibration");
        }
        let w = square.sqrt();
        let damping_ratio = (damping[(j, j)] / (2.0 * w)).max(0.0);
        let participation = Vector6::from_fn(|i, _| part[(i, j)]);
        modes.push(Mode { frequency_hz: w / TAU, damping_ratio, participation });
    }
    let coupling = (0..n)
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|(i, j)| {
            let scale = (damping[(i, i)] * damping[(j, j)]).sqrt();
            if damping[(i, j)] == 0.0 { 0.0 } else { damping[(i, j)].abs() / scale }
        })
        .fold(0.0, f64::max);
    let rigid = Inertia::from_elements(|i, j| m[(i, j)]);
    Ok(Linearised { appendage: ModalAppendage::new(rigid, &modes)?, shapes, damping_coupling: coupling })
}

/// `K` by second derivatives of the potential, `D` by derivatives of the bias along the rates, both at rest.
fn stiffness_damping(a: &dyn DynAppendage, p: &[f64], eta: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = eta.len();
    let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
    let p2: Vec<D2> = p.iter().map(|&x| D2::constant(D1::constant(x))).collect();
    let k = DMatrix::from_fn(n, n, |i, j| {
        let e: Vec<D2> = (0..n).map(|l| Dual::new(D1::new(eta[l], unit(l, i)), D1::new(unit(l, j), 0.0))).collect();
        D2::port(a).potential(&p2, &e).eps[0].eps[0]
    });
    let p1: Vec<D1> = p.iter().map(|&x| D1::constant(x)).collect();
    let e: Vec<D1> = eta.iter().map(|&x| D1::constant(x)).collect();
    let mut d = DMatrix::zeros(n, n);
    for j in 0..n {
        let nu: Vec<D1> = (0..n).map(|l| D1::new(0.0, unit(l, j))).collect();
        let mut h = vec![D1::constant(0.0); 6 + n];
        D1::port(a).bias(&p1, &PortState { host: Motion::zero(), eta: &e, nu: &nu }, &mut h);
        for i in 0..n {
            d[(i, j)] = h[6 + i].eps[0];
        }
    }
    (k, d)
}
