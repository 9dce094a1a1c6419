//! The Rayleigh function.

use super::law;
use super::measure::{Worst, relative};
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::DynAppendage;
use ff_model::scalar::D1;
use ff_model::scalar::ModelScalar;

/// Laws of the Rayleigh function.
pub(super) fn rayleigh(a: &dyn DynAppendage, samples: &[Sample]) -> [Check; 4] {
    let [mut rest, mut power, mut same, mut convex] = std::array::from_fn(|_| Worst::default());
    let f = f64::port(a);
    for (i, s) in samples.iter().enumerate() {
        let r = |nu: &[f64]| f.rayleigh(&s.p, nu);
        rest.see(r(&vec![0.0; s.n()]).abs(), || "W at nu = 0".into());
        let (here, loss) = (r(&s.nu), f.dissipated_power(&s.p, &s.nu));
        let scale = (here.abs() + loss.abs()).max(f64::MIN_POSITIVE);
        power.see((-here).max(-loss).max(0.0) / scale, || {
            format!("R = {here:.3e} W, power {loss:.3e} W at nu = {:?}", s.nu)
        });
        let p: Vec<D1> = lift(&s.p);
        let nu: Vec<D1> = s.nu.iter().map(|&x| D1::new(x, x)).collect();
        same.see(relative(loss, D1::port(a).rayleigh(&p, &nu).eps[0], loss.abs()), || format!("at nu = {:?}", s.nu));
        let other = &samples[(i + 1) % samples.len()].nu;
        let mid: Vec<f64> = s.nu.iter().zip(other).map(|(a, b)| 0.5 * (a + b)).collect();
        let (chord, middle) = (0.5 * (here + r(other)), r(&mid));
        let scale = chord.abs().max(middle.abs()).max(f64::MIN_POSITIVE);
        convex.see(((middle - chord) / scale).max(0.0), || format!("between nu = {:?} and {other:?}", s.nu));
    }
    [
        rest.check(law::NO_DAMPING_AT_REST, 0.0),
        power.check(law::DISSIPATES, 1e-12),
        same.check(law::POWER, 1e-11),
        convex.check(law::CONVEX, 1e-12),
    ]
}
