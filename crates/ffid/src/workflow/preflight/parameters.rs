//! Predicted standard deviations, from the Jacobian of the fit that will be made.

use super::{MOST_NUMBERS, PreflightError, Question, noise, record};
use excitation::system::prediction::{DERIVED, about_com};
use ff_dynamics::Trace;
use ff_model::{Dual, Model};
use ident::Estimator;
use ident::Uncertainty;
use ident::belief::{Unknown, analyse};
use ident::estimate::RANK_TOLERANCE;
use ident::parameters::scale;
use ident::{Options, OutputError};
use nalgebra::DMatrix;
use serde::Serialize;

/// What a record will say about a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Told {
    /// Its relative standard deviation is at most the threshold.
    Well,
    /// Its relative standard deviation is above the threshold.
    Weakly,
    /// It has a part in a combination on which the record is silent.
    NotAtAll,
}

/// The prediction for one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Predicted {
    /// Full name, such as `base.mass`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value at which it is predicted.
    pub value: f64,
    /// Standard deviation, in the unit; none when the record is silent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Standard deviation relative to the size of the parameter: its value, or for moments and products of inertia of
    /// a body its mass and radius of gyration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_std: Option<f64>,
    /// The verdict.
    pub told: Told,
}

pub(super) struct Seen {
    pub(super) every: usize,
    pub(super) parameters: Vec<Predicted>,
    pub(super) derived: Vec<Predicted>,
    pub(super) nuisance: Vec<Predicted>,
    pub(super) uncertainty: Uncertainty,
}

pub(super) fn predict(q: &Question<'_>, trace: &Trace, substeps: usize) -> Result<Seen, PreflightError> {
    let (model, n) = (q.model, q.selected.len());
    let columns = n + 6 + model.nj() + 2 * model.np();
    let every = (trace.len() * (model.nj() + 3) * columns).div_ceil(MOST_NUMBERS).max(1);
    let record = record(q, trace, every)?;
    let options = Options {
        substeps: substeps * every,
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        ..Options::new(noise(&q.sensing))
    };
    let mut fit = OutputError::new(model, &record, &options)?;
    let beside = fit.nuisance();
    let mut r = vec![0.0; fit.rows()];
    let mut j = DMatrix::zeros(fit.rows(), n + beside.len());
    let zeros = vec![0.0; beside.len()];
    fit.jacobian(q.params.values(), &zeros, q.selected, &mut r, &mut j)?;
    // A sample that stands for `every` of them carries that many times the information.
    j.scale_mut((every as f64).sqrt());
    let decls = model.param_decls();
    let sizes = scale::sizes(&decls, q.params.values());
    let mut unknowns: Vec<Unknown> = q
        .selected
        .iter()
        .map(|&i| Unknown { name: decls[i].name.clone(), unit: decls[i].unit.to_owned(), size: sizes[i] })
        .collect();
    unknowns.extend(beside);
    let u = analyse(&j, &unknowns, RANK_TOLERANCE)?;
    let one = |k: usize, value: f64| {
        let (unknown, std) = (&u.unknowns[k], u.deviation[k]);
        predicted(unknown.name.clone(), unknown.unit.clone(), value, std, unknown.size, q.weak)
    };
    Ok(Seen {
        every,
        parameters: q.selected.iter().enumerate().map(|(k, &i)| one(k, q.params.values()[i])).collect(),
        derived: derived(model, q, &u),
        nuisance: (n..unknowns.len()).map(|k| one(k, 0.0)).collect(),
        uncertainty: u,
    })
}

fn predicted(name: String, unit: String, value: f64, std: Option<f64>, size: f64, weak: f64) -> Predicted {
    let relative_std = std.map(|s| s / size);
    let told = match relative_std {
        None => Told::NotAtAll,
        Some(r) if r > weak => Told::Weakly,
        Some(_) => Told::Well,
    };
    Predicted { name, unit, value, std, relative_std, told }
}

/// Centre of mass and inertia about it of every body whose ten parameters are estimated: the covariance carried through
/// their derivatives. The centre of mass may be determined where the inertia is not.
fn derived(model: &Model, q: &Question<'_>, u: &Uncertainty) -> Vec<Predicted> {
    let mut out = Vec::new();
    for body in 0..model.n_bodies() {
        let at: Vec<usize> =
            (10 * body..10 * body + 10).filter_map(|i| q.selected.iter().position(|&s| s == i)).collect();
        if at.len() < 10 {
            continue;
        }
        let values = &q.params.values()[10 * body..10 * body + 10];
        let phi: Vec<Dual<f64, 10>> = values.iter().enumerate().map(|(k, &x)| Dual::variable(x, k)).collect();
        let mass = values[0];
        let radius = ((values[4] + values[6] + values[9]).abs() / (2.0 * mass.abs())).sqrt();
        let prefix = if body == 0 { "base" } else { model.body_name(body) };
        for ((name, unit), y) in DERIVED.iter().zip(about_com(&phi)) {
            let mut gradient = vec![0.0; u.unknowns.len()];
            at.iter().zip(&y.eps).for_each(|(&k, &g)| gradient[k] = g);
            let std = u.combination(&gradient);
            // A product of inertia or an offset may be zero; the body's own length and inertia have a size.
            let size = if *unit == "m" { radius } else { mass * radius * radius };
            out.push(predicted(format!("{prefix}.{name}"), (*unit).to_owned(), y.re, std, size, q.weak));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_decides_what_is_weak() {
        let p = |std| predicted("x".into(), "kg".into(), 600.0, std, 600.0, 0.1).told;
        assert_eq!([p(Some(59.0)), p(Some(61.0)), p(None)], [Told::Well, Told::Weakly, Told::NotAtAll]);
    }
}
