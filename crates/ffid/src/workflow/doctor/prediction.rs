//! What torques and gyro should have read at the values of the mission.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::quick_fit::output_error;
use crate::workflow::identify::{IdentifyError, RecordEstimator};
use ff_model::{Area, Params, Problem};
use ff_records::Record;
use ident::Estimator;
use nalgebra::DMatrix;

/// Torques and gyro of a record beside their prediction.
#[derive(Clone)]
pub(super) struct Prediction {
    /// Whitened residuals `(predicted - measured) / sigma`, sample after sample.
    pub(super) residuals: Vec<f64>,
    /// N x (n + 3), without means, which biases make.
    pub(super) measured: DMatrix<f64>,
    /// The same, predicted.
    pub(super) predicted: DMatrix<f64>,
    pub(super) sigma: Vec<f64>,
}

impl Prediction {
    /// From rest, along the joint motion of `record`, at the values of the mission.
    pub(super) fn new(case: &Case<'_>, record: &Record) -> Result<Self, IdentifyError> {
        Self::at(case, record, Params::nominal(case.model).values())
    }
    /// The same at other values.
    pub(super) fn at(case: &Case<'_>, record: &Record, values: &[f64]) -> Result<Self, IdentifyError> {
        let mut fit = RecordEstimator::new(case.model, record, &case.settings)?;
        let mut plain = fit.plain()?;
        let e: &mut dyn Estimator = match &mut plain {
            Some(of) => of,
            None => fit.estimator(),
        };
        let mut residuals = vec![0.0; e.rows()];
        let zeros = vec![0.0; e.nuisance().len()];
        e.residuals(values, &zeros, &mut residuals).map_err(|e| IdentifyError::Model(e.to_string()))?;
        if residuals.iter().any(|r| !r.is_finite()) {
            return Err(IdentifyError::Model("the prediction is not finite".to_owned()));
        }
        Ok(Self::of(case, record, residuals))
    }
    /// The same with long steps; `None` where the record cannot be predicted.
    pub(super) fn coarse(case: &Case<'_>, record: &Record) -> Option<Self> {
        Self::coarse_at(case, record, Params::nominal(case.model).values())
    }
    /// The same at other values.
    pub(super) fn coarse_at(case: &Case<'_>, record: &Record, values: &[f64]) -> Option<Self> {
        let mut e = output_error(case, record, case.settings.noise, (false, false))?;
        let mut residuals = vec![0.0; e.rows()];
        e.residuals(values, &[], &mut residuals).ok()?;
        residuals.iter().all(|r| r.is_finite()).then(|| Self::of(case, record, residuals))
    }
    /// From whitened residuals.
    pub(super) fn of(case: &Case<'_>, record: &Record, residuals: Vec<f64>) -> Self {
        let sigma = case.sigma();
        let (raw, k) = (record.responses(), sigma.len());
        let predicted = DMatrix::from_fn(record.samples(), k, |i, j| raw[(i, j)] + sigma[j] * residuals[i * k + j]);
        Self { residuals, measured: centred(raw), predicted: centred(predicted), sigma }
    }
}

fn centred(mut m: DMatrix<f64>) -> DMatrix<f64> {
    for mut c in m.column_iter_mut() {
        let mean = c.mean();
        c.add_scalar_mut(-mean);
    }
    m
}

/// The finding that a record cannot be predicted at all.
pub(super) fn failed(case: &Case<'_>, e: &str) -> Finding {
    let text = format!("torques and gyro cannot be predicted at the values of the mission: {e}");
    let p = Problem::warning(Area::Data, "Data::NotPredicted", text.clone()).on(case.label);
    let p = p.hint("check the units of the joint positions, and the mission with ffid check");
    case.finding(Topic::Prior, Judgement::Suspicious, text).raising(p)
}
