//! Nothing wrong is timed: every function is held to the oracle and to the others first.

use crate::functions::{Function, Runner};
use crate::lanes::suffix;
use crate::models::Peer;
use crate::states::{Sample, Set};
use anyhow::{Context, ensure};
use ff_dynamics::{State, Work, bias, rnea};
use ff_model::Params;
use ff_model::scalar::{D1, LaneScalar};
use nalgebra::DVector;
use std::path::Path;

/// What `fixtures/oracle` (Pinocchio 4.1) holds of a state and is used here.
#[derive(serde::Deserialize)]
struct Known {
    #[serde(flatten)]
    sample: Sample,
    #[serde(rename = "M")]
    m: Vec<Vec<f64>>,
    rnea: Vec<f64>,
    aba: Vec<f64>,
}

#[derive(serde::Deserialize)]
struct Oracle {
    states: Vec<Known>,
}

/// Against the oracle, relative to the largest element.
const ORACLE: f64 = 1e-11;
/// Of the functions against each other.
const MUTUAL: f64 = 1e-10;
/// Of a lane against the plain computation, where only rounding may differ (fused multiply-add, order).
const LANE: f64 = 1e-10;

/// Largest difference relative to the largest expected element.
fn rel(got: &[f64], want: &[f64]) -> f64 {
    scaled(got, want, largest(want))
}

/// Largest difference relative to `scale`.
fn scaled(got: &[f64], want: &[f64], scale: f64) -> f64 {
    let worst = got.iter().zip(want).fold(0.0f64, |m, (g, w)| m.max((g - w).abs()));
    // A NaN is lost by `max`; a result that is not finite is infinitely wrong.
    if got.len() != want.len() || got.iter().any(|x| !x.is_finite()) { f64::INFINITY } else { worst / scale }
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0f64, |m, x| m.max(x.abs()))
}

fn limit(what: &str, error: f64, limit: f64) -> anyhow::Result<()> {
    ensure!(error <= limit, "{what}: {error:.1e} relative, limit {limit:.0e}; nothing is timed");
    Ok(())
}

/// RNEA, mass matrix and forward dynamics against the oracle, which knows no springs.
pub(crate) fn against_oracle(peer: &Peer, fixtures: &Path) -> anyhow::Result<()> {
    let path = fixtures.join("oracle").join(format!("{}.json", peer.name.text()));
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let oracle: Oracle = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
    let samples: Vec<Sample> = oracle.states.iter().map(|k| k.sample.clone()).collect();
    let mut r = Runner::<f64>::new(&peer.model, Set::new(&peer.model, &samples)?);
    let mut worst = [0.0f64; 3];
    let first = peer.model.nv() - peer.springs.len();
    for (i, known) in oracle.states.iter().enumerate() {
        // Force of springs and dampers on the left-hand side of the equations.
        let spring = |j: usize| {
            let ((k, d), at) = (peer.springs[j], known.sample.q.len() - peer.springs.len() + j);
            k * known.sample.q[at] + d * known.sample.v[first + j]
        };
        r.call(Function::Rnea, i)?;
        (0..peer.springs.len()).for_each(|j| r.out[first + j] -= spring(j));
        worst[0] = worst[0].max(rel(&r.out, &known.rnea));
        r.call(Function::MassMatrix, i)?;
        let lower: Vec<f64> = known.m.iter().enumerate().flat_map(|(i, row)| row[..=i].to_vec()).collect();
        let both = rel(r.matrix.as_slice(), &known.m.concat()).max(rel(&r.result(Function::Crba, i), &lower));
        worst[1] = worst[1].max(both);
        (0..peer.springs.len()).for_each(|j| r.set.tau[i][first + j] += spring(j));
        r.call(Function::Fd, i)?;
        worst[2] = worst[2].max(rel(&r.out, &known.aba));
    }
    for (what, e) in ["rnea", "crba", "fd"].iter().zip(worst) {
        limit(&format!("{} {what} against the oracle", peer.label()), e, ORACLE)?;
    }
    eprintln!("{}: oracle rnea {:.1e}, crba {:.1e}, fd {:.1e}", peer.label(), worst[0], worst[1], worst[2]);
    Ok(())
}

/// On every state that will be timed: `rnea(fd(tau)) = tau`, `H a + c = rnea(a)`, and the hybrid accelerations and
/// torques solve the full equations with nothing acting on base and passive coordinates.
pub(crate) fn mutual(name: &str, r: &mut Runner<'_, f64>) -> anyhow::Result<()> {
    let (nb, nj, nv) = (r.model.nb(), r.model.nj(), r.model.nv());
    let mut worst = [0.0f64; 3];
    let (mut back, mut c) = (vec![0.0; nv], vec![0.0; nv]);
    for i in 0..r.set.states.len() {
        r.call(Function::Fd, i)?;
        rnea(r.model, &r.params, &r.set.states[i], &r.out, &mut r.work, &mut back);
        worst[0] = worst[0].max(rel(&back, &r.set.tau[i]));
        r.call(Function::MassMatrix, i)?;
        bias(r.model, &r.params, &r.set.states[i], &mut r.work, &mut c);
        r.call(Function::Rnea, i)?;
        let sum = &r.matrix * DVector::from_column_slice(&r.set.a[i]) + DVector::from_column_slice(&c);
        worst[1] = worst[1].max(rel(sum.as_slice(), &r.out));
        r.call(Function::Hybrid, i)?;
        rnea(r.model, &r.params, &r.set.states[i], &r.out, &mut r.work, &mut back);
        let mut want = vec![0.0; nv];
        want[nb..nb + nj].copy_from_slice(&r.joint);
        // Without joints everything wanted is zero: the forces that cancel give the scale.
        worst[2] = worst[2].max(scaled(&back, &want, largest(&want).max(largest(&c))));
    }
    eprintln!("{name}: rnea(fd) {:.1e}, H a + c {:.1e}, hybrid {:.1e}", worst[0], worst[1], worst[2]);
    for (what, e) in ["rnea(fd(tau)) = tau", "H a + c = rnea(a)", "hybrid"].iter().zip(worst) {
        limit(&format!("{name} {what}"), e, MUTUAL)?;
    }
    Ok(())
}

/// The regressor times the parameters is the derivative of RNEA along them, found here by a dual number.
pub(crate) fn regressor(name: &str, r: &mut Runner<'_, f64>) -> anyhow::Result<()> {
    let values = r.params.values().to_vec();
    let dual = Params::from_values(r.model, values.iter().map(|&x| D1::new(x, x)).collect());
    let mut work = Work::<D1>::new(r.model);
    let mut tau = vec![D1::constant(0.0); r.model.nv()];
    let mut worst = 0.0f64;
    for i in (0..r.set.states.len()).step_by(7) {
        r.call(Function::Regressor, i)?;
        let got = &*r.y * DVector::from_column_slice(&values);
        let state: State<D1> = r.set.states[i].lift();
        let a: Vec<D1> = r.set.a[i].iter().map(|&x| D1::constant(x)).collect();
        rnea(r.model, &dual, &state, &a, &mut work, &mut tau);
        let want: Vec<f64> = tau.iter().map(|t| t.eps[0]).collect();
        worst = worst.max(rel(got.as_slice(), &want));
    }
    eprintln!("{name}: regressor against duals {worst:.1e}");
    limit(&format!("{name} regressor"), worst, MUTUAL)
}

/// Derivatives along a direction of configuration, rates and accelerations at once, against a dual number.
pub(crate) fn id_derivatives(name: &str, r: &mut Runner<'_, f64>) -> anyhow::Result<()> {
    let (nb, nv) = (r.model.nb(), r.model.nv());
    let dual = Params::from_values(r.model, r.params.values().iter().map(|&x| D1::constant(x)).collect());
    let mut work = Work::<D1>::new(r.model);
    let mut tau = vec![D1::constant(0.0); nv];
    let direction = |k: usize, s: f64| (s + 1.7 * k as f64).sin();
    let mut worst = 0.0f64;
    for i in (0..r.set.states.len()).step_by(7) {
        r.call(Function::IdDerivatives, i)?;
        // Position and attitude of the base play no part without gravity: their directions stay zero.
        let along = |s: f64, from: usize| DVector::from_fn(nv, |k, _| if k < from { 0.0 } else { direction(k, s) });
        let (dq, dv, da) = (along(0.3, nb), along(1.1, 0), along(2.3, 0));
        let got = &r.d.dq * &dq + &r.d.dv * &dv + &r.d.da * &da;
        let mut state: State<D1> = r.set.states[i].lift();
        let nj = r.model.nj();
        (0..nj).for_each(|k| state.q[k].eps[0] = dq[nb + k]);
        (0..r.model.np()).for_each(|k| state.eta[k].eps[0] = dq[nb + nj + k]);
        (0..nv).for_each(|k| state.v[k].eps[0] = dv[k]);
        let a: Vec<D1> = r.set.a[i].iter().enumerate().map(|(k, &x)| D1::new(x, da[k])).collect();
        rnea(r.model, &dual, &state, &a, &mut work, &mut tau);
        let want: Vec<f64> = tau.iter().map(|t| t.eps[0]).collect();
        worst = worst.max(rel(got.as_slice(), &want));
    }
    eprintln!("{name}: derivatives against duals {worst:.1e}");
    limit(&format!("{name} id_derivatives"), worst, MUTUAL)
}

/// Every lane of every function against the plain computation on the same state.
pub(crate) fn lanes<T: LaneScalar>(
    name: &str,
    plain: &mut Runner<'_, f64>,
    r: &mut Runner<'_, T>,
) -> anyhow::Result<()> {
    for f in Function::ALL {
        let mut worst = 0.0f64;
        for i in 0..r.set.states.len() {
            r.call(f, i)?;
            let got = r.result(f, i);
            for l in 0..T::N {
                plain.call(f, i * T::N + l)?;
                let want = plain.result(f, i * T::N + l);
                let got: Vec<f64> = got.iter().map(|x| x.lane(l)).collect();
                worst = worst.max(rel(&got, &want));
            }
        }
        eprintln!("{name}: {}{} against f64 {worst:.1e}", f.text(), suffix::<T>());
        limit(&format!("{name} {}{}", f.text(), suffix::<T>()), worst, LANE)?;
    }
    Ok(())
}
