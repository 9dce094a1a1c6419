//! What flexibility does to a rigid identification.

use super::error::PreflightError;
use super::question::Question;
use super::samples::{noise, record};
use ff_dynamics::Trace;
use ff_linalg::least_squares;
use ff_model::Params;
use ident::Estimator;
use ident::Rda;
use ident::belief::{Unknown, analyse};
use ident::estimate::RANK_TOLERANCE;
use ident::parameters::sizes;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Bias of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BiasedParameter {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value of the rigid system: base and frozen appendages together.
    pub value: f64,
    /// Bias of the estimate; none when the rigid fit cannot tell the parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias: Option<f64>,
    /// Standard deviation that the rigid fit would report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Bias relative to the size of the parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_bias: Option<f64>,
}

/// What a rigid identification of the base would make of the flexible system's record.
///
/// Linearised: `bias = (J^T W J)^-1 J^T W (tau_flex - tau_rigid)` with the Jacobian of the reduced dynamics algorithm
/// at the parameters of the system with frozen appendages, `W` the inverse variances: the first Gauss-Newton step of the
/// fit from the best start there is. Noise adds to it. Biases that are large against the parameter are orders of
/// magnitude, not values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RigidBias {
    /// The ten parameters of the base.
    pub parameters: Vec<BiasedParameter>,
    /// Largest bias relative to the size of its parameter.
    pub worst_relative: f64,
    /// Root mean square of `tau_flex - tau_rigid` over noise, all torque channels.
    pub torque_rms_over_noise: f64,
}

pub(super) fn of(q: &Question<'_>, trace: &Trace) -> Result<RigidBias, PreflightError> {
    let rigid = q.model.frozen(q.params);
    let params = Params::nominal(&rigid);
    let decls = rigid.param_decls();
    let sizes = sizes(&decls, params.values());
    // The rigid fit of a long record needs no finer look than a million rows.
    let every = (trace.len() * rigid.nj() / 1_000_000).max(1);
    let record = record(q, trace, every)?;
    let mut fit = Rda::new(&rigid, &record, &noise(&q.sensing))?;
    let selected: Vec<usize> = (0..10).collect();
    let (mut r, mut j) = (vec![0.0; fit.rows()], DMatrix::zeros(fit.rows(), 10));
    fit.jacobian(params.values(), &[], &selected, &mut r, &mut j)?;
    let rms = (r.iter().map(|x| x * x).sum::<f64>() / r.len() as f64).sqrt();
    // Residuals are model minus measured: the step that makes them small is the bias.
    let measured = DVector::from_iterator(r.len(), r.iter().map(|x| -x));
    // Columns of comparable size, so that what is left out is judged in no unit.
    let mut scaled = j.clone();
    for (mut c, s) in scaled.column_iter_mut().zip(&sizes) {
        c.scale_mut(*s);
    }
    let step = least_squares(&scaled, &measured).ok();
    let unknowns: Vec<Unknown> = selected
        .iter()
        .map(|&i| Unknown { name: decls[i].name.clone(), unit: decls[i].unit.to_owned(), size: sizes[i] })
        .collect();
    j.scale_mut((every as f64).sqrt());
    let u = analyse(&j, &unknowns, RANK_TOLERANCE)?;
    let parameters: Vec<BiasedParameter> = (0..10)
        .map(|k| {
            let bias = step.as_ref().map(|s| s[k] * sizes[k]).filter(|_| u.deviation[k].is_some());
            BiasedParameter {
                name: unknowns[k].name.clone(),
                unit: unknowns[k].unit.clone(),
                value: params.values()[k],
                bias,
                std: u.deviation[k],
                relative_bias: bias.map(|b| b / sizes[k]),
            }
        })
        .collect();
    let worst = parameters.iter().filter_map(|p| p.relative_bias).map(f64::abs).fold(0.0, f64::max);
    Ok(RigidBias { parameters, worst_relative: worst, torque_rms_over_noise: rms })
}
