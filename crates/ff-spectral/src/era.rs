//! Eigensystem realisation of a free decay, and its stabilisation diagram.
//!
//! All channels (torques and gyro, in units of their noise) fill one block Hankel matrix `H_ij = y_(i+j)` of the
//! decay `y_i = sum_k c_k b_k z_k^i`, with singular value decomposition `H = U S V^T`. Cut at order n,
//!
//! ```text
//! A = U_up^+ U_low,   C = first block row of U,   b = first column of S V^T,        A psi_k = z_k psi_k
//! shape of mode k:  c_k = C psi_k,   amplitude:  b_k = (Psi^-1 b)_k,   pole:  p_k = ln z_k / dt
//! ```
//!
//! J.-N. Juang, R. Pappa, *An eigensystem realization algorithm for modal parameter identification and model
//! reduction*, J. Guidance 8(5), 1985, eqs. (15) to (22), with the free decay as its pulse response. An order too low
//! merges modes, one too high describes noise. A mode is a pole that stays where it is when the order
//! rises: [`Stabilisation`] holds the poles of every order and how each compares with the order before.
//!
//! The consistent-mode indicator is EMAC x MPC (R. Pappa, K. Elliott, A. Schenk, J. Guidance 16(5), 1993): does
//! the mode found at the end of the Hankel matrix equal the one at its beginning, carried forward by `z^N`; and
//! do its channels move in phase. Strongly damped or closely spaced modes are complex, with an MPC below 1, without
//! being wrong.

use core::f64::consts::{FRAC_PI_4, TAU};
use ff_linalg as linalg;
use ff_linalg::{LinalgError, Svd};
use nalgebra::{Complex, DMatrix, DVector};

/// Relative singular value below which there is nothing but rounding.
const ROUNDING: f64 = 1e-9;

/// A realised pole.
#[derive(Clone, Debug, PartialEq)]
pub struct EraPole {
    /// Continuous pole (1/s); those of oscillations come in conjugate pairs, of which both are listed.
    pub pole: Complex<f64>,
    /// Complex amplitude per channel at the first sample, in units of noise: a conjugate pair contributes `Re(a z^i)`.
    pub shape: Vec<Complex<f64>>,
    /// Consistent-mode indicator, 0 to 1.
    pub consistency: f64,
}

impl EraPole {
    /// `|p| / 2 pi` (Hz).
    pub fn frequency(&self) -> f64 {
        self.pole.norm() / TAU
    }
    /// `-Re p / |p|`.
    pub fn damping(&self) -> f64 {
        -self.pole.re / self.pole.norm()
    }
}

/// The Hankel matrix of a decay, decomposed once for all orders.
pub(crate) struct Era {
    svd: Svd,
    channels: usize,
    blocks: usize,
    columns: usize,
    dt: f64,
}

impl Era {
    /// Of `data` (samples x channels), `dt` apart. Half the record along each side has the least variance; the number
    /// of rows is capped for the sake of time.
    pub(crate) fn new(data: &DMatrix<f64>, dt: f64) -> Result<Self, LinalgError> {
        let (rows, c) = data.shape();
        let blocks = (rows / 2).min((1500 / c).max(16));
        let columns = rows - blocks + 1;
        let hankel = DMatrix::from_fn(blocks * c, columns, |r, k| data[(r / c + k, r % c)]);
        Ok(Self { svd: linalg::svd(&hankel)?, channels: c, blocks, columns, dt })
    }
    /// Singular values, descending.
    pub(crate) fn singular_values(&self) -> &[f64] {
        self.svd.s.as_slice()
    }
    /// Largest singular value of unstructured unit noise; the Hankel structure raises it by some 10 to 30 %.
    pub(crate) fn noise_edge(&self) -> f64 {
        ((self.blocks * self.channels) as f64).sqrt() + (self.columns as f64).sqrt()
    }
    /// Highest order that can be realised: neither more than the shift leaves equations for, nor into rounding.
    pub(crate) fn highest_order(&self) -> usize {
        let s = self.singular_values();
        let real = s.iter().take_while(|&&x| x > ROUNDING * s[0]).count();
        real.min((self.blocks - 1) * self.channels).min(self.columns.saturating_sub(1))
    }
    /// All poles of the realisation of order `k`.
    pub(crate) fn realise(&self, k: usize) -> Result<Vec<EraPole>, LinalgError> {
        let (u, c) = (&self.svd.u, self.channels);
        let m = u.nrows() - c;
        let upper = u.view((0, 0), (m, k)).into_owned();
        let lower = u.view((c, 0), (m, k)).into_owned();
        // Columns of U are orthonormal, so this small system is close to the identity and well conditioned.
        let g = linalg::gram(&upper)?;
        let singular = || LinalgError::RankDeficient { rank: k - 1, columns: k, dependent: vec![] };
        let a = g.lu().solve(&upper.tr_mul(&lower)).ok_or_else(singular)?;
        let (values, vectors) = linalg::general_eigen(&a)?;
        let s_v = |col: usize| DVector::from_fn(k, |i, _| Complex::from(self.svd.s[i] * self.svd.v[(col, i)]));
        let lu = vectors.clone().lu();
        // A defective matrix has no amplitudes; its poles still stand.
        let none = || DVector::from_element(k, Complex::new(0.0, 0.0));
        let first = lu.solve(&s_v(0)).unwrap_or_else(none);
        let last = lu.solve(&s_v(self.columns - 1)).unwrap_or_else(none);
        let along = |row: usize, i: usize| -> Vec<Complex<f64>> {
            (0..c).map(|j| (0..k).map(|l| vectors[(l, i)] * u[(row + j, l)]).sum()).collect()
        };
        let mut out = Vec::with_capacity(k);
        for (i, z) in values.iter().enumerate() {
            if z.norm() <= 1e-6 {
                continue;
            }
            let (start, end) = (along(0, i), along((self.blocks - 1) * c, i));
            let carried = z.powi(self.blocks as i32 - 1);
            let weight: f64 = start.iter().map(|x| x.norm_sqr()).sum();
            let output: f64 =
                start.iter().zip(&end).map(|(s, e)| agreement(s * carried, *e) * s.norm_sqr()).sum::<f64>() / weight;
            let input = agreement(first[i] * z.powi(self.columns as i32 - 1), last[i]);
            let shape: Vec<Complex<f64>> = start.iter().map(|s| s * first[i] * 2.0).collect();
            let consistency = output * input * phase_collinearity(&start);
            out.push(EraPole {
                pole: z.ln() / self.dt,
                shape,
                consistency: if consistency.is_finite() { consistency } else { 0.0 },
            });
        }
        Ok(out)
    }
}

/// EMAC of one number: ratio of moduli, times one minus the angle between them over 45 degrees (0 beyond).
fn agreement(predicted: Complex<f64>, found: Complex<f64>) -> f64 {
    let (p, f) = (predicted.norm(), found.norm());
    if p <= 0.0 || f <= 0.0 {
        return 0.0;
    }
    let angle = (found * predicted.conj()).arg().abs();
    (p / f).min(f / p) * (1.0 - angle / FRAC_PI_4).max(0.0)
}

/// Modal phase collinearity: 1 when all components lie on one line through 0 in the complex plane, 0 when they fill it
/// evenly. `((l1 - l2) / (l1 + l2))^2` with `l` the eigenvalues of the 2 x 2 scatter of real and imaginary parts.
pub fn phase_collinearity(shape: &[Complex<f64>]) -> f64 {
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for s in shape {
        xx += s.re * s.re;
        yy += s.im * s.im;
        xy += s.re * s.im;
    }
    let sum = xx + yy;
    if sum > 0.0 { ((xx - yy).powi(2) + 4.0 * xy * xy) / (sum * sum) } else { 0.0 }
}

/// Modal assurance criterion of two complex shapes, `|a^H b|^2 / (|a|^2 |b|^2)`: 1 for the same shape up to a complex
/// factor, 0 for orthogonal ones (R. Allemang, D. Brown, Proc. 1st IMAC, 1982). 0 when one of them is zero.
pub fn mac(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    let dot: Complex<f64> = a.iter().zip(b).map(|(x, y)| x.conj() * y).sum();
    let square = |v: &[Complex<f64>]| v.iter().map(|x| x.norm_sqr()).sum::<f64>();
    let scale = square(a) * square(b);
    if scale > 0.0 { dot.norm_sqr() / scale } else { 0.0 }
}

/// Part of the square of `a` that lies in the span of `basis`: MAC for one vector. Two modes that a record hardly keeps
/// apart share a plane, in which each shape may turn from one order to the next.
pub(crate) fn subspace_mac(a: &[Complex<f64>], basis: &[&[Complex<f64>]]) -> f64 {
    let norm = |v: &[Complex<f64>]| v.iter().map(|x| x.norm_sqr()).sum::<f64>();
    let mut own: Vec<Vec<Complex<f64>>> = Vec::new();
    for b in basis {
        let (mut v, before) = (b.to_vec(), norm(b));
        for q in &own {
            let along: Complex<f64> = q.iter().zip(&v).map(|(x, y)| x.conj() * y).sum();
            v.iter_mut().zip(q).for_each(|(x, y)| *x -= along * y);
        }
        let left = norm(&v);
        if left > 1e-6 * before && left > 0.0 {
            let s = left.sqrt();
            own.push(v.iter().map(|x| x / s).collect());
        }
    }
    let inside: f64 =
        own.iter().map(|q| q.iter().zip(a).map(|(x, y)| x.conj() * y).sum::<Complex<f64>>().norm_sqr()).sum();
    let all = norm(a);
    if all > 0.0 { inside / all } else { 0.0 }
}

/// How far a pole may move from one order to the next and still count as the same.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Tolerance {
    /// Relative change of frequency, on top of a third of the resolution `1/T`.
    pub frequency: f64,
    /// Change of damping ratio, on top of `2 / (w T)`.
    pub damping: f64,
    /// Least modal assurance (with the span of the poles near it).
    pub mac: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self { frequency: 0.02, damping: 0.02, mac: 0.8 }
    }
}

/// One pole of a stabilisation diagram.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DiagramPole {
    /// Undamped frequency (Hz).
    pub frequency: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Consistent-mode indicator.
    pub consistency: f64,
    /// The order before has a pole at this frequency;
    pub stable_frequency: bool,
    /// of this damping as well;
    pub stable_damping: bool,
    /// and of this shape.
    pub stable_shape: bool,
}

impl DiagramPole {
    /// Stable in frequency, damping and shape.
    pub fn stable(&self) -> bool {
        self.stable_frequency && self.stable_damping && self.stable_shape
    }
}

/// Poles of one order.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DiagramOrder {
    /// Order of the realisation.
    pub order: usize,
    /// Its oscillating poles in the band, by frequency.
    pub poles: Vec<DiagramPole>,
}

/// The stabilisation diagram: frequency against order, with marks for what stays.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Stabilisation {
    /// Orders, ascending by one from 1.
    pub orders: Vec<DiagramOrder>,
    /// What counts as the same pole.
    pub tolerance: Tolerance,
    /// Order chosen: of those from the number of singular values above the noise to three more, the lowest with the
    /// most poles that stay through two higher orders.
    pub chosen: usize,
}

impl Stabilisation {
    /// Points for a plot, `(frequency (Hz), order, stable)`. Allocates.
    pub fn points(&self) -> Vec<(f64, usize, bool)> {
        self.orders.iter().flat_map(|o| o.poles.iter().map(|p| (p.frequency, o.order, p.stable()))).collect()
    }
}

/// Poles of all orders, and what stays among them.
pub(crate) struct Sweep {
    /// Oscillating poles in the band, per order from 1.
    poles: Vec<Vec<EraPole>>,
    tolerance: Tolerance,
    seconds: f64,
}

impl Sweep {
    /// Realises orders 1 to `highest`; `is_mode` selects the poles of interest among those with `Im p > 0`.
    pub(crate) fn new(
        era: &Era,
        highest: usize,
        seconds: f64,
        tolerance: Tolerance,
        is_mode: impl Fn(&EraPole) -> bool,
    ) -> Result<Self, LinalgError> {
        let poles = (1..=highest.min(era.highest_order())).map(|k| {
            let mut p = era.realise(k)?;
            p.retain(|p| p.pole.im > 0.0 && is_mode(p));
            p.sort_by(|a, b| a.frequency().total_cmp(&b.frequency()));
            Ok(p)
        });
        Ok(Self { poles: poles.collect::<Result<_, LinalgError>>()?, tolerance, seconds })
    }
    /// Highest order realised.
    pub(crate) fn highest(&self) -> usize {
        self.poles.len()
    }
    /// Whether `p` has a counterpart in frequency, damping and shape among `others`.
    fn compare(&self, p: &EraPole, others: &[EraPole]) -> [bool; 3] {
        let t = &self.tolerance;
        let near = t.frequency * p.frequency() + 1.0 / (3.0 * self.seconds);
        let by_frequency: Vec<&EraPole> =
            others.iter().filter(|q| (q.frequency() - p.frequency()).abs() <= near).collect();
        let slack = t.damping + 2.0 / (p.pole.norm() * self.seconds);
        let damping = by_frequency.iter().any(|q| (q.damping() - p.damping()).abs() <= slack);
        let span: Vec<&[Complex<f64>]> = by_frequency.iter().map(|q| q.shape.as_slice()).collect();
        let shape = subspace_mac(&p.shape, &span) >= t.mac;
        [!by_frequency.is_empty(), damping, shape]
    }
    /// Poles of this order that stay through the two orders above it (those that exist: beyond the last one
    /// there is only rounding).
    pub(crate) fn lasting(&self, order: usize) -> Vec<EraPole> {
        let higher = |k: usize| self.poles.get(k - 1);
        let lasts = |p: &&EraPole| {
            (order + 1..=order + 2).all(|k| higher(k).is_none_or(|o| self.compare(p, o).iter().all(|s| *s)))
        };
        higher(order).map_or_else(Vec::new, |o| o.iter().filter(lasts).cloned().collect())
    }
    /// Number of poles of this order.
    pub(crate) fn count(&self, order: usize) -> usize {
        self.poles.get(order - 1).map_or(0, Vec::len)
    }
    /// The order from `lowest` to `lowest + 3` with the most lasting poles.
    pub(crate) fn choose(&self, lowest: usize) -> usize {
        let last = (lowest + 3).min(self.highest()).max(lowest);
        let mut best = (lowest, self.lasting(lowest).len());
        for k in lowest + 1..=last {
            let n = self.lasting(k).len();
            if n > best.1 {
                best = (k, n);
            }
        }
        best.0
    }
    /// For a plot.
    pub(crate) fn diagram(&self, chosen: usize) -> Stabilisation {
        let orders = self.poles.iter().enumerate().map(|(i, poles)| {
            let before: &[EraPole] = if i > 0 { &self.poles[i - 1] } else { &[] };
            let poles = poles.iter().map(|p| {
                let [stable_frequency, stable_damping, stable_shape] = self.compare(p, before);
                DiagramPole {
                    frequency: p.frequency(),
                    damping: p.damping(),
                    consistency: p.consistency,
                    stable_frequency,
                    stable_damping: stable_frequency && stable_damping,
                    stable_shape: stable_frequency && stable_shape,
                }
            });
            DiagramOrder { order: i + 1, poles: poles.collect() }
        });
        Stabilisation { orders: orders.collect(), tolerance: self.tolerance, chosen }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Decay = (DMatrix<f64>, [Complex<f64>; 2], [[Complex<f64>; 3]; 2]);
    /// Two modes and an offset on three channels, exactly: order 5.
    fn decay() -> Decay {
        let poles = [Complex::new(-0.02, 0.71), Complex::new(-0.11, 2.3)];
        let c = Complex::new;
        let shapes = [[c(3.0, 0.2), c(-1.1, 0.4), c(0.7, -0.9)], [c(0.4, 1.3), c(2.0, 0.1), c(-0.6, 0.5)]];
        let y = DMatrix::from_fn(120, 3, |i, j| {
            let t = 0.25 * i as f64;
            let osc: f64 = (0..2).map(|k| (shapes[k][j] * (poles[k] * t).exp()).re).sum();
            osc + 0.8 - 0.5 * j as f64
        });
        (y, poles, shapes)
    }

    #[test]
    fn an_exact_decay_is_realised_with_its_poles_and_complex_shapes() {
        let (y, poles, shapes) = decay();
        let era = Era::new(&y, 0.25).unwrap();
        assert_eq!(era.highest_order(), 5);
        let found = era.realise(5).unwrap();
        for (p, s) in poles.iter().zip(&shapes) {
            let m = found.iter().find(|m| (m.pole - p).norm() < 1e-9).expect("pole");
            for (a, b) in m.shape.iter().zip(s) {
                assert!((a - b).norm() < 1e-8, "{a} {b}");
            }
            // Consistent in time; the shapes are complex, which is all that lowers the indicator.
            assert!((m.consistency - phase_collinearity(s)).abs() < 1e-6, "{}", m.consistency);
        }
    }

    #[test]
    fn mac_knows_shapes_up_to_a_complex_factor_and_spans() {
        let (_, _, [a, b]) = decay();
        let turned: Vec<_> = a.iter().map(|x| x * Complex::new(-0.3, 1.9)).collect();
        assert!((mac(&a, &turned) - 1.0).abs() < 1e-14);
        let m = mac(&a, &b);
        assert!(m > 1e-3 && m < 0.9, "{m}");
        assert!((subspace_mac(&a, &[&b]) - m).abs() < 1e-14);
        let mixed: Vec<_> = a.iter().zip(&b).map(|(x, y)| x * 0.4 + y * Complex::new(0.2, -0.7)).collect();
        assert!((subspace_mac(&mixed, &[&a, &b]) - 1.0).abs() < 1e-13 && mac(&mixed, &a) < 0.99);
        let line: Vec<_> = [1.0, -2.0, 0.3].iter().map(|x| Complex::new(0.6, -0.8) * *x).collect();
        assert!((phase_collinearity(&line) - 1.0).abs() < 1e-14 && phase_collinearity(&a) < 0.99);
    }

    #[test]
    fn true_poles_are_stable_and_split_noise_is_not() {
        let (mut y, poles, _) = decay();
        // A fixed irregular sequence stands for noise.
        for i in 0..120 {
            for j in 0..3 {
                y[(i, j)] += 0.03 * (((i * 37 + j * 101) as f64).powi(2) * 0.618).sin();
            }
        }
        let era = Era::new(&y, 0.25).unwrap();
        let sweep = Sweep::new(&era, 14, 30.0, Tolerance::default(), |p| p.damping() < 0.5).unwrap();
        let chosen = sweep.choose(5);
        let d = sweep.diagram(chosen);
        assert_eq!(d.orders.len(), 14);
        let lasting = sweep.lasting(chosen);
        for p in poles {
            assert!(lasting.iter().any(|l| (l.pole - p).norm() < 0.02), "{lasting:?}");
        }
        let stable = |f: f64| d.points().iter().filter(|(x, o, s)| *o > 5 && *s && (x - f).abs() < 0.01).count();
        assert!(stable(poles[0].norm() / TAU) >= 8 && stable(poles[1].norm() / TAU) >= 8, "{:?}", d.points());
        assert!(d.points().iter().any(|(_, o, s)| *o > 8 && !s), "noise poles must not all be stable");
    }
}
