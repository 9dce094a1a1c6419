//! The laws one by one: each function returns the worst figure over the samples, as [`Check`]s.

use super::derived::{bias as derived_bias, matrix};
use super::law;
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::appendage::MAX_PARAMS;
use ff_model::scalar::{D1, D2};
use ff_model::{Decl, Dual, DynAppendage, Inertia, MAX_COORDS, ModelScalar, Motion, ParamGroup, PortState, Scalar};
use nalgebra::{DMatrix, Vector3};
use std::cmp::Ordering;

/// A worst figure and where it occurred. NaN is worse than anything.
#[derive(Default)]
struct Worst(f64, String);

impl Worst {
    fn see(&mut self, figure: f64, place: impl FnOnce() -> String) {
        if figure > self.0 || (figure.is_nan() && !self.0.is_nan()) {
            *self = Self(figure, place());
        }
    }
    fn check(self, law: &'static str, limit: f64) -> Check {
        Check::new(law, self.0, limit, self.1)
    }
}

fn amax(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, v| m.max(v.abs()))
}
/// `|a - b|` over the larger of the two, zero for zero against zero.
fn relative(a: f64, b: f64, scale: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / scale }
}
fn bias<T: ModelScalar>(a: &dyn DynAppendage, p: &[T], host: Motion<T>, eta: &[T], nu: &[T]) -> Vec<T> {
    let mut h = vec![T::zero(); 6 + eta.len()];
    T::port(a).bias(p, &PortState { host, eta, nu }, &mut h);
    h
}

/// See [`law::DECLARATION`].
pub(super) fn declaration(d: &Decl) -> Check {
    let mut faults = Vec::new();
    let (n, np) = (d.coords.len(), d.params.len());
    if d.kind.is_empty() {
        faults.push("kind is empty".into());
    }
    if n > MAX_COORDS {
        faults.push(format!("{n} coordinates, at most {MAX_COORDS}"));
    }
    if np > MAX_PARAMS {
        faults.push(format!("{np} parameters, at most {MAX_PARAMS}"));
    }
    let names: Vec<&str> = d.coords.iter().map(|c| &*c.name).chain(d.params.iter().map(|p| &*p.name)).collect();
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() || names[..i].contains(name) {
            faults.push(format!("name '{name}' is empty or used twice"));
        }
    }
    for c in &d.coords {
        let (lo, hi) = c.range;
        if !matches!(c.unit, "rad" | "m") {
            faults.push(format!("{}: unit '{}' is neither rad nor m", c.name, c.unit));
        }
        // `partial_cmp` rather than `>=`, so that NaN is a fault too.
        if lo.partial_cmp(&hi) != Some(Ordering::Less) {
            faults.push(format!("{}: range {lo} to {hi} {} is empty", c.name, c.unit));
        }
    }
    for p in &d.params {
        let (lo, hi) = p.bounds;
        if !p.nominal.is_finite() || !(lo..=hi).contains(&p.nominal) {
            faults.push(format!("{}: nominal {} {} is outside {lo} to {hi}", p.name, p.nominal, p.unit));
        }
        if p.group == ParamGroup::Positive && (lo < 0.0 || lo.is_nan()) {
            faults.push(format!("{}: positive, but its lower bound is {lo} {}", p.name, p.unit));
        }
    }
    let mut i = 0;
    while i < np {
        let ParamGroup::Inertial(body) = &d.params[i].group else {
            i += 1;
            continue;
        };
        let ten = &d.params[i..np.min(i + 10)];
        if ten.len() < 10 || ten.iter().any(|p| p.group != d.params[i].group) {
            faults.push(format!("{body}: inertial parameters must come as ten in a row"));
        } else {
            let phi: Vec<f64> = ten.iter().map(|p| p.nominal).collect();
            if let Err(e) = Inertia::from_params(&phi).check() {
                faults.push(format!("{body}: {e}"));
            }
        }
        i += 10;
    }
    Check::faults(law::DECLARATION, &faults)
}

/// What is not finite at this sample, in values or in derivatives along the motion.
fn not_finite(a: &dyn DynAppendage, s: &Sample) -> Vec<&'static str> {
    let (p, nu) = (lift::<D1>(&s.p), lift::<D1>(&s.nu));
    let eta: Vec<D1> = s.eta.iter().zip(&s.nu).map(|(&x, &v)| Dual::new(x, v)).collect();
    let host = Motion::new(s.host.lin.map(D1::from_f64), s.host.ang.map(D1::from_f64));
    let d = D1::port(a);
    [
        ("inertia", matrix(d, &p, &eta).iter().flatten().all(Scalar::is_finite)),
        ("potential", d.potential(&p, &eta).is_finite()),
        ("rayleigh", d.rayleigh(&p, &nu).is_finite()),
        ("bias", bias(a, &p, host, &eta, &nu).iter().all(Scalar::is_finite)),
        ("bias in f64", bias(a, &s.p, s.host, &s.eta, &s.nu).iter().all(|x| x.is_finite())),
    ]
    .into_iter()
    .filter_map(|(name, fine)| (!fine).then_some(name))
    .collect()
}

fn finite_check(law: &'static str, a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let faults: Vec<String> = samples
        .iter()
        .flat_map(|s| not_finite(a, s).into_iter().map(move |x| format!("{x} at eta = {:?}, nu = {:?}", s.eta, s.nu)))
        .collect();
    Check::faults(law, &faults)
}
/// See [`law::FINITE`].
pub(super) fn finite(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    finite_check(law::FINITE, a, samples)
}
/// See [`law::EXTREME`].
pub(super) fn extreme(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    finite_check(law::EXTREME, a, samples)
}

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
pub(super) fn inertia(a: &dyn DynAppendage, samples: &[Sample]) -> [Check; 5] {
    let [mut sym, mut psd, mut own, mut host, mut moment] = std::array::from_fn(|_| Worst::default());
    for s in samples {
        let n = s.n();
        let place = || format!("at eta = {:?}", s.eta);
        let rows = matrix(f64::port(a), &s.p, &s.eta);
        let m = DMatrix::from_fn(6 + n, 6 + n, |i, j| rows[i][j]);
        let scale = m.amax().max(f64::MIN_POSITIVE);
        sym.see((&m - m.transpose()).amax() / scale, place);
        psd.see((-scaled_spectrum(&m).0).max(0.0), place);
        let (least, greatest) = scaled_spectrum(&m.view((6, 6), (n, n)).into_owned());
        own.see(if least > 0.0 { greatest / least } else { f64::INFINITY }, place);
        // First moment from the host block, and the block that a rigid body with it would have.
        let h = Vector3::new(m[(1, 5)], m[(2, 3)], m[(0, 4)]);
        let rot = m.fixed_view::<3, 3>(3, 3).into_owned();
        let rigid = Inertia { mass: m[(0, 0)], h, rot }.to_matrix();
        host.see((m.fixed_view::<6, 6>(0, 0) - rigid).amax() / scale, place);
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
    [
        sym.check(law::SYMMETRIC, 1e-13),
        psd.check(law::SEMIDEFINITE, 1e-10),
        own.check(law::OWN_BLOCK, 1e10),
        host.check(law::HOST_BLOCK, 1e-12),
        moment.check(law::FIRST_MOMENT, 1e-10).advice(),
    ]
}

/// Step of the differences as a part of a coordinate's range. Truncation falls with its eighth power, rounding grows
/// with its inverse: 1e-3 leaves 1e-13 to 1e-11 for smooth energies.
const STEP: f64 = 1e-3;
/// Weights of the eighth-order central difference.
const C1: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
fn difference(h: f64, f: impl Fn(f64) -> f64) -> f64 {
    C1.iter().enumerate().map(|(k, c)| c / h * (f(h * (k + 1) as f64) - f(-h * (k + 1) as f64))).sum()
}

/// See [`law::DERIVATIVES`]: along a random direction, one figure for each of the three energies.
pub(super) fn derivatives(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let mut worst = Worst::default();
    let f = f64::port(a);
    let d = D1::port(a);
    for s in samples {
        let (y, p) = (s.y(), lift::<D1>(&s.p));
        let shifted =
            |x: &[f64], t: f64| -> Vec<f64> { (0..s.n()).map(|i| x[i] + t * s.width[i] * s.deta[i]).collect() };
        let dual = |x: &[f64]| -> Vec<D1> { (0..s.n()).map(|i| Dual::new(x[i], s.width[i] * s.deta[i])).collect() };
        let quadratic = |m: &[Vec<f64>]| -> f64 {
            m.iter().zip(&y).map(|(row, y_i)| y_i * row.iter().zip(&y).map(|(m, y_j)| m * y_j).sum::<f64>()).sum()
        };
        let kinetic = |t: f64| quadratic(&matrix(f, &s.p, &shifted(&s.eta, t)));
        let slope: Vec<Vec<f64>> =
            matrix(d, &p, &dual(&s.eta)).iter().map(|r| r.iter().map(|x| x.eps[0]).collect()).collect();
        let (u, r) = (d.potential(&p, &dual(&s.eta)), d.rayleigh(&p, &dual(&s.nu)));
        for (name, value, slope, fd) in [
            ("M", kinetic(0.0), quadratic(&slope), difference(STEP, kinetic)),
            ("U", u.re, u.eps[0], difference(STEP, |t| f.potential(&s.p, &shifted(&s.eta, t)))),
            ("R", r.re, r.eps[0], difference(STEP, |t| f.rayleigh(&s.p, &shifted(&s.nu, t)))),
        ] {
            worst.see(relative(slope, fd, value.abs() + slope.abs() + fd.abs()), || name.into());
        }
    }
    worst.check(law::DERIVATIVES, 1e-8)
}

/// Largest difference of two biases, wrench and own rows each relative to their own largest entry.
fn bias_difference(have: &[f64], want: &[f64]) -> (f64, usize) {
    let mut out = (0.0, 0);
    for range in [0..6, 6..want.len()] {
        let scale = amax(&have[range.clone()]).max(amax(&want[range.clone()]));
        for i in range {
            let e = relative(have[i], want[i], scale);
            if e > out.0 || e.is_nan() {
                out = (e, i);
            }
        }
    }
    out
}

/// See [`law::BIAS`] and [`law::BIAS_DERIVATIVE`].
pub(super) fn bias_checks(a: &dyn DynAppendage, samples: &[Sample]) -> [Check; 2] {
    let (mut value, mut slope) = (Worst::default(), Worst::default());
    let row = |i: usize| if i < 6 { format!("wrench row {i}") } else { format!("own row {}", i - 6) };
    for s in samples {
        let want = derived_bias(D1::port(a), &s.p, s.host, &s.eta, &s.nu);
        let (e, i) = bias_difference(&bias(a, &s.p, s.host, &s.eta, &s.nu), &want);
        value.see(e, || row(i));
        let dual = |x: &[f64], dx: &[f64]| -> Vec<D1> { x.iter().zip(dx).map(|(&x, &d)| Dual::new(x, d)).collect() };
        let (p, eta, nu) = (dual(&s.p, &s.dp), dual(&s.eta, &s.deta), dual(&s.nu, &s.acc[6..]));
        let mut v = vec![0.0; 6];
        s.host.write_to(&mut v);
        let host = Motion::from_slice(&dual(&v, &s.acc));
        let pick = |h: Vec<D1>| -> Vec<f64> { h.iter().map(|x| x.eps[0]).collect() };
        let want = pick(derived_bias::<D1>(D2::port(a), &p, host, &eta, &nu));
        let (e, i) = bias_difference(&pick(bias(a, &p, host, &eta, &nu)), &want);
        slope.see(e, || row(i));
    }
    [value.check(law::BIAS, 1e-11), slope.check(law::BIAS_DERIVATIVE, 1e-11)]
}

/// See [`law::ENERGY`]: power of the host wrench and of the torques that force `nu'`, less the dampers' power,
/// against differences of the energy along the motion. Uses `f64` results alone, so a wrong derivative cannot hide.
pub(super) fn energy(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let mut worst = Worst::default();
    let f = f64::port(a);
    for s in samples {
        let n = s.n();
        let y = s.y();
        let total = |t: f64| {
            let eta: Vec<f64> = (0..n).map(|i| s.eta[i] + t * s.nu[i]).collect();
            let m = matrix(f, &s.p, &eta);
            let v = |i: usize| y[i] + t * s.acc[i];
            let twice: f64 = (0..6 + n).map(|i| v(i) * (0..6 + n).map(|j| m[i][j] * v(j)).sum::<f64>()).sum();
            0.5 * twice + f.potential(&s.p, &eta)
        };
        let reach = (0..n).map(|i| s.nu[i].abs() / s.width[i]).fold(0.1, f64::max);
        let rate = difference(STEP / reach, total);
        let m = matrix(f, &s.p, &s.eta);
        let mut force = bias(a, &s.p, s.host, &s.eta, &s.nu);
        for i in 0..6 + n {
            force[i] += (0..6 + n).map(|j| m[i][j] * s.acc[j]).sum::<f64>();
        }
        let power: f64 = force.iter().zip(&y).map(|(f, y)| f * y).sum();
        let loss = f.dissipated_power(&s.p, &s.nu);
        let scale: f64 = force.iter().zip(&y).map(|(f, y)| (f * y).abs()).sum::<f64>() + loss.abs();
        worst.see(relative(power - loss, rate, scale), || {
            format!("power {power:.6e} W, dampers {loss:.6e} W, energy rate {rate:.6e} W")
        });
    }
    worst.check(law::ENERGY, 1e-8)
}

/// Laws of the Rayleigh function.
pub(super) fn rayleigh(a: &dyn DynAppendage, samples: &[Sample]) -> [Check; 3] {
    let [mut rest, mut power, mut convex] = std::array::from_fn(|_| Worst::default());
    let f = f64::port(a);
    for (i, s) in samples.iter().enumerate() {
        let r = |nu: &[f64]| f.rayleigh(&s.p, nu);
        rest.see(r(&vec![0.0; s.n()]).abs(), || "W at nu = 0".into());
        let (here, loss) = (r(&s.nu), f.dissipated_power(&s.p, &s.nu));
        let scale = (here.abs() + loss.abs()).max(f64::MIN_POSITIVE);
        power.see((-here).max(-loss).max(0.0) / scale, || {
            format!("R = {here:.3e} W, power {loss:.3e} W at nu = {:?}", s.nu)
        });
        let other = &samples[(i + 1) % samples.len()].nu;
        let mid: Vec<f64> = s.nu.iter().zip(other).map(|(a, b)| 0.5 * (a + b)).collect();
        let (chord, middle) = (0.5 * (here + r(other)), r(&mid));
        let scale = chord.abs().max(middle.abs()).max(f64::MIN_POSITIVE);
        convex.see(((middle - chord) / scale).max(0.0), || format!("between nu = {:?} and {other:?}", s.nu));
    }
    [rest.check(law::NO_DAMPING_AT_REST, 0.0), power.check(law::DISSIPATES, 1e-12), convex.check(law::CONVEX, 1e-12)]
}

/// See [`law::PARAMETERS`].
pub(super) fn parameters(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let f = f64::port(a);
    let outputs = |s: &Sample, p: &[f64]| -> Vec<f64> {
        let mut out: Vec<f64> = matrix(f, p, &s.eta).concat();
        out.push(f.potential(p, &s.eta));
        out.push(f.rayleigh(p, &s.nu));
        out.extend(bias(a, p, s.host, &s.eta, &s.nu));
        out
    };
    let decl = a.declaration();
    let faults: Vec<String> = (0..decl.params.len())
        .filter(|&k| {
            samples.iter().take(4).all(|s| {
                let mut p = s.p.clone();
                p[k] = p[k] * 1.25 + 0.25;
                outputs(s, &p) == outputs(s, &s.p)
            })
        })
        .map(|k| format!("{} changes nothing", decl.params[k].name))
        .collect();
    Check::faults(law::PARAMETERS, &faults)
}
