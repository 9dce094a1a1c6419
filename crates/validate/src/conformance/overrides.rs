//! Methods that an appendage may write itself, for speed, against what they are when it does not.
//!
//! The defaults are computed here once more from `inertia` and `bias` through the object-safe face of the appendage:
//! derivatives by duals over every parameter, without the shortcut of unit parameters that `ff-model` takes.

use super::law;
use super::measure::{Worst, relative};
use super::ports::{Packed, Ports, scales};
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::port::port_len;
use ff_model::scalar::ModelScalar;
use ff_model::scalar::{DIRECTIONS, Grad};
use ff_model::{DynAppendage, Motion, PortAccel, PortMatrix, PortState};

/// See [`law::TERMS`], [`law::RESIDUAL`], [`law::JACOBIAN`], [`law::REGRESSOR`].
pub(super) fn overrides(a: &dyn DynAppendage, samples: &[Sample]) -> [Check; 4] {
    let mut worst: [Worst; 4] = Default::default();
    let decl = a.declaration();
    for s in samples {
        let dim = 6 + s.n();
        let have = Ports::<f64>::of(a, &Packed::new(&[s]));
        let [m, _, _, h, ..] = &have.0;
        let residual = (0..dim).map(|i| h[i] + (0..dim).map(|j| m[i * dim + j] * s.acc[j]).sum::<f64>()).collect();
        let (jacobian, regressor) = derivatives(a, s);
        let (m, h) = (m.clone(), h.clone());
        let want = Ports([m.clone(), vec![0.0], vec![0.0], h.clone(), m, h, residual, jacobian, regressor]);
        let scale = scales(s, &want);
        for (law, part) in [(0, 4), (0, 5), (1, 6), (2, 7), (3, 8)] {
            for (i, (x, y)) in have.0[part].iter().zip(&want.0[part]).enumerate() {
                worst[law].see(relative(*x, *y, scale[part][i]), || {
                    let row = if i % dim < 6 {
                        format!("wrench row {}", i % dim)
                    } else {
                        format!("own row {}", i % dim - 6)
                    };
                    let column = |k: usize| match (part, k) {
                        (4, _) => "M, ".into(),
                        (7, 0..3) => format!("column of w_{}, ", ["x", "y", "z"][k]),
                        (7, _) if k - 3 < s.n() => format!("column of {}, ", decl.coords[k - 3].name),
                        (7, _) => format!("column of the rate of {}, ", decl.coords[k - 3 - s.n()].name),
                        (8, _) => format!("column of {}, ", decl.params[k].name),
                        _ => String::new(),
                    };
                    format!("{}{row}: {x:.6e} for {y:.6e}", column(i / dim))
                });
            }
        }
    }
    let laws = [law::TERMS, law::RESIDUAL, law::JACOBIAN, law::REGRESSOR];
    let mut laws = laws.into_iter();
    worst.map(|w| w.check(laws.next().unwrap_or_default(), 1e-11))
}

/// Derivatives of `M [A; nu'] + h` at fixed accelerations: columns for the host's angular velocity, coordinates and
/// rates, and for the parameters.
fn derivatives(a: &dyn DynAppendage, s: &Sample) -> (Vec<f64>, Vec<f64>) {
    let n = s.n();
    let dim = 6 + n;
    let motion = 3 + 2 * n;
    let mut out = Vec::new();
    let port = Grad::port(a);
    let acc: Vec<Grad> = lift(&s.acc);
    let acc = PortAccel { host: Motion::from_slice(&acc), nu: &acc[6..] };
    let mut v = vec![0.0; 6];
    s.host.write_to(&mut v);
    let all = motion + s.p.len();
    for first in (0..all).step_by(DIRECTIONS) {
        let seeded = |x: &[f64], at: usize| -> Vec<Grad> {
            let mut x: Vec<Grad> = lift(x);
            for (i, x) in x.iter_mut().enumerate() {
                if (first..first + DIRECTIONS).contains(&(at + i)) {
                    x.eps[at + i - first] = 1.0;
                }
            }
            x
        };
        let (mut host, turn) = (lift::<Grad>(&v), seeded(&v[3..], 0));
        host[3..].copy_from_slice(&turn);
        let (eta, nu, p) = (seeded(&s.eta, 3), seeded(&s.nu, 3 + n), seeded(&s.p, motion));
        let state = PortState { host: Motion::from_slice(&host), eta: &eta, nu: &nu };
        let (mut m, mut h) = (vec![Grad::constant(0.0); port_len(n)], vec![Grad::constant(0.0); dim]);
        let mut m = PortMatrix::new(n, &mut m);
        port.inertia(&p, &eta, &mut m);
        port.bias(&p, &state, &mut h);
        ff_model::port::add_inertial(&m, &acc, &mut h);
        for d in 0..DIRECTIONS.min(all - first) {
            out.extend(h.iter().map(|x| x.eps[d]));
        }
    }
    let regressor = out.split_off(motion * dim);
    (out, regressor)
}
