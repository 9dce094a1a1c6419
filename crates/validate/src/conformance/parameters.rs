//! Parameters: each does something, and inertial ones enter the kinetic energy linearly and nothing else.

use super::derived::matrix;
use super::law;
use super::measure::{Worst, amax, bias, relative};
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::scalar::D1;
use ff_model::scalar::ModelScalar;
use ff_model::{DynAppendage, Motion, ParamGroup, Scalar};

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

/// See [`law::LINEAR`]. `ff-dynamics` takes the port equations at unit parameters for their derivatives; here both are
/// computed, for each inertial parameter.
pub(super) fn linear(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let mut worst = Worst::default();
    let decl = a.declaration();
    let (f, d) = (f64::port(a), D1::port(a));
    for (k, param) in decl.params.iter().enumerate() {
        if !matches!(param.group, ParamGroup::Inertial(_)) {
            continue;
        }
        for s in samples {
            let mut unit = vec![0.0; decl.params.len()];
            unit[k] = 1.0;
            let p: Vec<D1> = s.p.iter().enumerate().map(|(i, &x)| D1::new(x, unit[i])).collect();
            let (eta, nu): (Vec<D1>, Vec<D1>) = (lift(&s.eta), lift(&s.nu));
            let host = Motion::new(s.host.lin.map(D1::from_f64), s.host.ang.map(D1::from_f64));
            let slope = |x: Vec<D1>| -> Vec<f64> { x.iter().map(|x| x.eps[0]).collect() };
            let pairs = [
                ("M", matrix(f, &unit, &s.eta).concat(), slope(matrix(d, &p, &eta).concat())),
                ("h", bias(a, &unit, s.host, &s.eta, &s.nu), slope(bias(a, &p, host, &eta, &nu))),
            ];
            for (what, unit, slope) in &pairs {
                let scale = amax(unit).max(amax(slope));
                for (u, v) in unit.iter().zip(slope) {
                    worst.see(relative(*u, *v, scale), || {
                        format!("{what} at {} = 1 and all others 0 is not its derivative", param.name)
                    });
                }
            }
            for (what, x) in [("potential", d.potential(&p, &eta)), ("rayleigh", d.rayleigh(&p, &nu))] {
                if x.eps[0] != 0.0 {
                    worst.see(1.0, || format!("{what} depends on {}", param.name));
                }
            }
        }
    }
    worst.check(law::LINEAR, 1e-11)
}
