//! Maximum likelihood poles of a free decay, amplitudes eliminated (variable projection).
//!
//! For poles `p_k` the model `Y = Phi(p) A + noise` is linear in A (basis: real and imaginary part of `e^(p_k t)`
//! for each mode, and a constant). With Q an orthonormal basis of the columns of Phi, the residual is
//! `R = (1 - Q Q^T) Y`, and its derivative, up to a term that vanishes with the residual (L. Kaufman, BIT 15, 1975),
//! `-(1 - Q Q^T) dPhi A`. The information matrix of the poles built from it is the exact one with A unknown.

use ff_least_squares::{EvalError, LmError, Problem, Settings, minimise};
use ff_linalg as linalg;
use nalgebra::{Complex, DMatrix, Matrix4};

/// Start of the refinement.
pub(crate) struct Poles {
    /// Continuous poles with positive imaginary part (1/s).
    pub oscillating: Vec<Complex<f64>>,
    /// Sampling interval of the data (s).
    pub dt: f64,
}

/// Refined poles.
pub(crate) struct Refined {
    pub poles: Vec<Complex<f64>>,
    /// Complex amplitudes (modes x channels): `y = Re(a e^(p t))`.
    pub amplitudes: DMatrix<Complex<f64>>,
    /// Per pole and channel: covariance of (Re a, Im a, Re p, Im p), for unit noise; infinite on the diagonal when the
    /// record cannot tell the pole.
    pub covariance: Vec<Vec<Matrix4<f64>>>,
    /// Half the residual sum of squares.
    pub cost: f64,
    /// Unknowns in all: poles and amplitudes.
    pub parameters: usize,
}

struct Projection<'a> {
    data: &'a DMatrix<f64>,
    dt: f64,
    modes: usize,
}

/// Basis, orthonormal basis of its span, and amplitudes.
struct Linear {
    basis: DMatrix<f64>,
    q: DMatrix<f64>,
    a: DMatrix<f64>,
    residual: DMatrix<f64>,
}

impl Projection<'_> {
    fn poles<'x>(&self, x: &'x [f64]) -> impl Iterator<Item = Complex<f64>> + 'x {
        x.chunks_exact(2).map(|p| Complex::new(p[0], p[1]))
    }
    fn linear(&self, x: &[f64]) -> Result<Linear, EvalError> {
        let n = self.data.nrows();
        let mut basis = DMatrix::zeros(n, 2 * self.modes + 1);
        for (k, p) in self.poles(x).enumerate() {
            for i in 0..n {
                let e = (p * (i as f64 * self.dt)).exp();
                // Re(a e) = a.re e.re - a.im e.im.
                basis[(i, 2 * k)] = e.re;
                basis[(i, 2 * k + 1)] = -e.im;
            }
        }
        basis.column_mut(2 * self.modes).fill(1.0);
        linalg::check_finite("modal basis", &basis).map_err(|e| EvalError::Rejected(e.to_string()))?;
        let qr = basis.clone().qr();
        let (q, r) = (qr.q(), qr.r());
        let qty = q.tr_mul(self.data);
        let a = r.solve_upper_triangular(&qty).ok_or_else(|| EvalError::Rejected("modes coincide".into()))?;
        let residual = self.data - &q * qty;
        Ok(Linear { basis, q, a, residual })
    }
}

impl Projection<'_> {
    /// `dPhi A` with respect to real and imaginary part of pole k, amplitudes held.
    fn derivative(&self, l: &Linear, k: usize) -> [DMatrix<f64>; 2] {
        let (n, c) = self.data.shape();
        // d e^(p t) / d re = t e^(p t), d / d im = i t e^(p t): on (re, -im) the latter is (-im, -re).
        let mut d = [DMatrix::zeros(n, c), DMatrix::zeros(n, c)];
        for ch in 0..c {
            let (a, b) = (l.a[(2 * k, ch)], l.a[(2 * k + 1, ch)]);
            for i in 0..n {
                let t = i as f64 * self.dt;
                let (re, mim) = (l.basis[(i, 2 * k)], l.basis[(i, 2 * k + 1)]);
                d[0][(i, ch)] = t * (re * a + mim * b);
                d[1][(i, ch)] = t * (mim * a - re * b);
            }
        }
        d
    }
    /// Joint covariance of amplitude and pole, per mode and channel, from that of the poles (`poles`, 2M x 2M).
    ///
    /// The amplitudes are `Phi^+ y`, so that `da = Phi^+ dy - Phi^+ dPhi a dp`. The first part is noise inside the span
    /// of Phi, and `dp` comes from noise outside of it: they are independent.
    fn joint(&self, l: &Linear, poles: &DMatrix<f64>) -> Option<Vec<Vec<Matrix4<f64>>>> {
        let (m, c) = (self.modes, self.data.ncols());
        let r = l.q.tr_mul(&l.basis);
        let inverse = r.solve_upper_triangular(&DMatrix::identity(2 * m + 1, 2 * m + 1))?;
        let own = &inverse * inverse.transpose();
        // gain[ch]: d amplitudes / d poles, (2M + 1) x 2M.
        let mut gain = vec![DMatrix::zeros(2 * m + 1, 2 * m); c];
        for k in 0..m {
            for (part, d) in self.derivative(l, k).iter().enumerate() {
                let moved = -(&inverse * l.q.tr_mul(d));
                for (ch, g) in gain.iter_mut().enumerate() {
                    g.column_mut(2 * k + part).copy_from(&moved.column(ch));
                }
            }
        }
        let of = |k: usize, g: &DMatrix<f64>| {
            let g = g.rows(2 * k, 2);
            let cross = g * poles;
            let spread = own.view((2 * k, 2 * k), (2, 2)) + &cross * g.transpose();
            let mut out = Matrix4::zeros();
            out.view_mut((0, 0), (2, 2)).copy_from(&spread);
            out.view_mut((0, 2), (2, 2)).copy_from(&cross.columns(2 * k, 2));
            out.view_mut((2, 0), (2, 2)).copy_from(&cross.columns(2 * k, 2).transpose());
            out.view_mut((2, 2), (2, 2)).copy_from(&poles.view((2 * k, 2 * k), (2, 2)));
            out
        };
        Some((0..m).map(|k| gain.iter().map(|g| of(k, g)).collect()).collect())
    }
}

impl Problem for Projection<'_> {
    fn dim(&self) -> usize {
        2 * self.modes
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let l = self.linear(x)?;
        r.clear();
        r.extend_from_slice(l.residual.as_slice());
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let l = self.linear(x)?;
        let (n, c) = self.data.shape();
        r.clear();
        r.extend_from_slice(l.residual.as_slice());
        *j = DMatrix::zeros(n * c, x.len());
        for k in 0..self.modes {
            for (part, d) in self.derivative(&l, k).iter().enumerate() {
                let projected = &l.q * l.q.tr_mul(d) - d;
                j.column_mut(2 * k + part).copy_from_slice(projected.as_slice());
            }
        }
        Ok(())
    }
}

/// What each mode explains that the others cannot: the rise of the residual sum of squares without it.
pub(crate) fn contributions(data: &DMatrix<f64>, poles: &[Complex<f64>], dt: f64) -> Result<Vec<f64>, LmError> {
    let cost = |poles: Vec<f64>| {
        let l = Projection { data, dt, modes: poles.len() / 2 }.linear(&poles);
        l.map(|l| l.residual.norm_squared()).map_err(|e| LmError::Setup(e.to_string()))
    };
    let flat = |skip: usize| -> Vec<f64> {
        poles.iter().enumerate().filter(|(k, _)| *k != skip).flat_map(|(_, p)| [p.re, p.im]).collect()
    };
    let all = cost(flat(poles.len()))?;
    (0..poles.len()).map(|k| Ok(cost(flat(k))? - all)).collect()
}

/// Refines the poles on `data` (samples x channels, unit noise).
pub(crate) fn refine(data: &DMatrix<f64>, start: &Poles) -> Result<Refined, LmError> {
    let modes = start.oscillating.len();
    let x: Vec<f64> = start.oscillating.iter().flat_map(|p| [p.re, p.im]).collect();
    let mut problem = Projection { data, dt: start.dt, modes };
    // Kaufman's derivative has no second-order part; the first steps stay near the realisation, which is close.
    let set = Settings { initial_radius: 0.1, max_iterations: 50, ..Settings::default() };
    let s = minimise(&mut problem, &x, &set)?;
    let l = problem.linear(&s.x).map_err(|e| LmError::Setup(e.to_string()))?;
    let unknowns: Vec<ident::belief::Unknown> =
        s.x.iter().map(|_| ident::belief::Unknown { name: String::new(), unit: "1/s".into(), size: 1.0 }).collect();
    let u = ident::belief::analyse(&s.jacobian, &unknowns, 1e-12)?;
    let unknown = Matrix4::from_diagonal_element(f64::INFINITY);
    let mut covariance = problem.joint(&l, &u.covariance).unwrap_or_else(|| vec![vec![unknown; data.ncols()]; modes]);
    for (k, of) in covariance.iter_mut().enumerate() {
        // Without a finite deviation the pair is unresolved: say so by an infinite one.
        if u.deviation[2 * k].is_none() || u.deviation[2 * k + 1].is_none() {
            of.fill(unknown);
        }
    }
    Ok(Refined {
        covariance,
        poles: problem.poles(&s.x).collect(),
        amplitudes: DMatrix::from_fn(modes, data.ncols(), |k, j| Complex::new(l.a[(2 * k, j)], l.a[(2 * k + 1, j)])),
        cost: s.cost,
        parameters: s.x.len() + l.a.len(),
    })
}
