//! The kinetic-energy matrix.

use super::derived::matrix;
use super::law;
use super::measure::{Worst, amax, relative};
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::scalar::D1;
use ff_model::scalar::ModelScalar;
use ff_model::{Dual, DynAppendage};
use nalgebra::DMatrix;

/// Eigenvalues of a symmetric matrix scaled to unit diagonal, so that kilograms do not hide kg m^2; least, greatest.
/// Zero rows are left as they are. The matrix must be finite.
fn scaled_spectrum(m: &DMatrix<f64>) -> (f64, f64) {
    if m.is_empty() {
        return (1.0, 1.0);
    }
    let floor = 1e-12 * m.diagonal().amax();
    let s = m.diagonal().map(|d| if d > floor && d > 0.0 { d.sqrt() } else { floor.sqrt().max(f64::MIN_POSITIVE) });
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| 0.5 * (m[(i, j)] + m[(j, i)]) / (s[i] * s[j]));
    let e = scaled.symmetric_eigenvalues();
    (e.min(), e.max())
}

/// Laws of the inertia matrix.
pub(super) fn inertia(a: &dyn DynAppendage, samples: &[Sample]) -> [Check; 4] {
    let [mut psd, mut own, mut host, mut moment] = std::array::from_fn(|_| Worst::default());
    for s in samples {
        let n = s.n();
        let place = || format!("at eta = {:?}", s.eta);
        let rows = matrix(f64::port(a), &s.p, &s.eta);
        let m = DMatrix::from_fn(6 + n, 6 + n, |i, j| rows[i][j]);
        let scale = m.amax().max(f64::MIN_POSITIVE);
        psd.see((-scaled_spectrum(&m).0).max(0.0), place);
        let (least, greatest) = scaled_spectrum(&m.view((6, 6), (n, n)).into_owned());
        own.see(if least > 0.0 { greatest / least } else { f64::INFINITY }, place);
        for k in 0..n {
            let eta: Vec<D1> = (0..n).map(|i| Dual::new(s.eta[i], f64::from(u8::from(i == k)))).collect();
            let d = matrix(D1::port(a), &lift(&s.p), &eta);
            host.see(d[0][0].eps[0].abs() / scale, || format!("mass changes with coordinate {k}"));
            let rate = [d[1][5].eps[0], d[2][3].eps[0], d[0][4].eps[0]];
            let size = amax(&rate).max((0..3).fold(0.0, |x: f64, i| x.max(m[(i, 6 + k)].abs())));
            for i in 0..3 {
                moment.see(relative(m[(i, 6 + k)], rate[i], size), || format!("row {i}, coordinate {k}"));
            }
        }
    }
    let moment = moment.check(law::FIRST_MOMENT, 1e-10);
    [
        psd.check(law::SEMIDEFINITE, 1e-10),
        own.check(law::OWN_BLOCK, 1e10),
        host.check(law::MASS, 1e-12),
        if a.is_galilean() { moment } else { moment.advice() },
    ]
}
