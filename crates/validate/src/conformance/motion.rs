//! The equations of motion: bias, momentum, energy, and the derivatives they rest on.

use super::derived::{bias as derived_bias, matrix};
use super::law;
use super::measure::{STEP, Worst, amax, bias, difference, relative};
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::scalar::ModelScalar;
use ff_model::scalar::{D1, D2};
use ff_model::{Dual, DynAppendage, Force, Motion, PortState};

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

/// Difference of a bias and the one that the energies imply, relative to the largest entry.
pub(crate) fn bias_against_derived(a: &dyn DynAppendage, p: &[f64], s: &PortState<'_, f64>) -> f64 {
    let want = derived_bias(D1::port(a), p, s.host, s.eta, s.nu);
    let have = bias(a, p, s.host, s.eta, s.nu);
    let scale = amax(&have).max(amax(&want));
    have.iter().zip(&want).fold(0.0, |worst: f64, (h, w)| {
        let e = relative(*h, *w, scale);
        if e.is_nan() { e } else { worst.max(e) }
    })
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

/// See [`law::MOMENTUM`]: the host's wrench against differences of the momentum along the motion, in axes that stand
/// still. Uses `f64` results alone, so a wrong derivative cannot hide.
pub(super) fn momentum(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let mut worst = Worst::default();
    let f = f64::port(a);
    for s in samples {
        let n = s.n();
        let y = s.y();
        let momentum = |t: f64| -> [f64; 6] {
            let eta: Vec<f64> = (0..n).map(|i| s.eta[i] + t * s.nu[i]).collect();
            let m = matrix(f, &s.p, &eta);
            std::array::from_fn(|i| (0..6 + n).map(|j| m[i][j] * (y[j] + t * s.acc[j])).sum())
        };
        let reach = (0..n).map(|i| s.nu[i].abs() / s.width[i]).fold(0.1, f64::max);
        let m = matrix(f, &s.p, &s.eta);
        let h = bias(a, &s.p, s.host, &s.eta, &s.nu);
        let carried = s.host.cross_force(&Force::from_slice(&momentum(0.0)));
        for half in [0, 3] {
            let (mut off, mut scale) = (0.0_f64, 0.0_f64);
            for i in half..half + 3 {
                let wrench = h[i] + (0..6 + n).map(|j| m[i][j] * s.acc[j]).sum::<f64>();
                let rate = difference(STEP / reach, |t| momentum(t)[i]) + carried.get(i);
                scale = scale.max(wrench.abs()).max(rate.abs()).max(carried.get(i).abs());
                // `max` would drop a NaN.
                off = if (wrench - rate).is_nan() { f64::NAN } else { off.max((wrench - rate).abs()) };
            }
            let what = if half == 0 { "force" } else { "moment about the mount" };
            worst.see(relative(off, 0.0, scale), || format!("{what} at eta = {:?}, nu = {:?}", s.eta, s.nu));
        }
    }
    worst.check(law::MOMENTUM, 1e-8)
}
