//! Deterministic states and parameter sets: general values, physically consistent, within declared ranges.

use ff_model::{Decl, Inertia, Motion, ParamGroup, Scalar};
use nalgebra::{Matrix4, Vector3};

/// Parameters and motion of an appendage.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub(super) p: Vec<f64>,
    pub(super) host: Motion<f64>,
    pub(super) eta: Vec<f64>,
    pub(super) nu: Vec<f64>,
    /// Accelerations `[A; nu']`, also used as a direction.
    pub(super) acc: Vec<f64>,
    /// Directions for derivatives of the bias: parameters, coordinates.
    pub(super) dp: Vec<f64>,
    pub(super) deta: Vec<f64>,
    /// Width of the coordinate ranges, cut to 2 where unbounded.
    pub(super) width: Vec<f64>,
}

impl Sample {
    pub(super) fn n(&self) -> usize {
        self.eta.len()
    }
    /// `y = [V; nu]`.
    pub(super) fn y(&self) -> Vec<f64> {
        let mut y = vec![0.0; 6 + self.n()];
        self.host.write_to(&mut y);
        y[6..].copy_from_slice(&self.nu);
        y
    }
    /// The same at the ends of the ranges, at high rates, with parameters scaled by 1e-6 or 1e6.
    pub(super) fn extreme(&self, decl: &Decl, i: usize) -> Self {
        let mut s = self.clone();
        let k = if i.is_multiple_of(2) { 1e6 } else { 1e-6 };
        for (x, d) in s.p.iter_mut().zip(&decl.params) {
            if d.group != ParamGroup::Free {
                *x = (*x * k).clamp(d.bounds.0, d.bounds.1);
            }
        }
        for (j, c) in decl.coords.iter().enumerate() {
            let end = if (i >> (1 + j % 3)) & 1 == 0 { c.range.0 } else { c.range.1 };
            s.eta[j] = if end.is_finite() { end } else { 1e3 * end.signum() };
            s.nu[j] *= 1e3;
        }
        s.host = s.host.scaled(1e4);
        s
    }
    /// The same with every coordinate, rate and twist component at `x` as far as the ranges allow: zero and tiny
    /// states are where square roots and quotients fail.
    pub(super) fn all_at(&self, decl: &Decl, x: f64) -> Self {
        let mut s = self.clone();
        for (e, c) in s.eta.iter_mut().zip(&decl.coords) {
            *e = x.clamp(c.range.0, c.range.1);
        }
        s.nu.fill(x);
        s.host = Motion::new(Vector3::repeat(x), Vector3::repeat(x));
        s
    }
}

/// Lifts constants into a number type with derivatives.
pub(super) fn lift<T: Scalar>(x: &[f64]) -> Vec<T> {
    x.iter().map(|&x| T::from_f64(x)).collect()
}

/// SplitMix64 (Steele, Lea, Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014): the suite must
/// draw the same numbers on every machine and in every release, and needs no more than this.
pub(crate) struct Source(u64);

impl Source {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }
    /// Uniform in `[0, 1)`.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// Uniform in `[-a, a)`.
    pub(crate) fn sym(&mut self, a: f64) -> f64 {
        a * (2.0 * self.unit() - 1.0)
    }
    pub(crate) fn vec3(&mut self, a: f64) -> Vector3<f64> {
        Vector3::new(self.sym(a), self.sym(a), self.sym(a))
    }

    /// Sample number `i`; the first has nominal parameters.
    pub(super) fn sample(&mut self, decl: &Decl, i: usize) -> Sample {
        let n = decl.coords.len();
        let mut s = Sample {
            p: if i == 0 { decl.params.iter().map(|p| p.nominal).collect() } else { self.parameters(decl) },
            host: Motion::new(self.vec3(2.0), self.vec3(1.5)),
            eta: Vec::with_capacity(n),
            nu: (0..n).map(|_| self.sym(1.5)).collect(),
            acc: (0..6 + n).map(|_| self.sym(2.0)).collect(),
            dp: decl.params.iter().map(|p| self.sym(1.0) * (0.1 + p.nominal.abs())).collect(),
            deta: (0..n).map(|_| self.sym(1.0)).collect(),
            width: Vec::with_capacity(n),
        };
        for c in &decl.coords {
            // Differences step up to 0.4 % of the width beyond the state: stay 5 % off the ends.
            let (lo, hi) = match (c.range.0.is_finite(), c.range.1.is_finite()) {
                (true, true) => c.range,
                (true, false) => (c.range.0, c.range.0 + 2.0),
                (false, true) => (c.range.1 - 2.0, c.range.1),
                (false, false) => (-1.0, 1.0),
            };
            let (mid, half) = ((lo + hi) / 2.0, (hi - lo) / 2.0);
            s.eta.push(mid + self.sym(0.9 * half));
            s.width.push(2.0 * half);
        }
        s
    }

    /// Parameters within bounds, inertial ones a physically consistent body.
    pub(crate) fn parameters(&mut self, decl: &Decl) -> Vec<f64> {
        let mut p = Vec::with_capacity(decl.params.len());
        while p.len() < decl.params.len() {
            let d = &decl.params[p.len()];
            match d.group {
                ParamGroup::Inertial(_) => {
                    // Congruence G P G^T keeps the pseudo-inertia positive semidefinite.
                    let at = p.len();
                    let phi: Vec<f64> = decl.params[at..at + 10].iter().map(|d| d.nominal).collect();
                    let g = Matrix4::identity() + Matrix4::from_fn(|_, _| self.sym(0.15));
                    let pseudo = g * Inertia::from_params(&phi).pseudo() * g.transpose();
                    p.extend(Inertia::from_pseudo(&pseudo).to_params());
                }
                ParamGroup::Positive => p.push(positive(d.nominal, 0.5 + self.unit()).clamp(d.bounds.0, d.bounds.1)),
                ParamGroup::Free => p.push((d.nominal + self.sym(0.5)).clamp(d.bounds.0, d.bounds.1)),
            }
        }
        p
    }
}

/// `x k`, or `k` itself for a parameter that is zero (a damper left out), so that its effect shows.
fn positive(x: f64, k: f64) -> f64 {
    if x == 0.0 { k } else { x * k }
}
