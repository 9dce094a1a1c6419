//! Clocks that do not agree: offset and skew of the torque or gyro channels against the joint encoders.
//!
//! What the sensors should have read follows from the joint motion and a model, if only a rough one. With `p_j` that
//! prediction on the encoders' clock and `y_j` the reading on its own,
//!
//! ```text
//! y_j(t) = g_j p_j(t - a - s (t - T/2)) + b_j + noise
//! ```
//!
//! with one offset a (s, positive when the channels are late) and one skew s (1 = 10^6 ppm) per group of channels, and a gain
//! and a bias for each. A model that is a little off would do harm all the same: hinges 0.2 % too soft slow its oscillations by
//! 0.1 %, which is a skew of 1000 ppm. What is uncertain about it is therefore named, and fitted beside the clocks to first order
//! under its prior. The offset is first sought over whole samples
//! by cross-correlation, then everything is fitted by Gauss-Newton on the phase slope `dy = -g p' (da + (t - T/2) ds)`.
//!
//! Deviations are the larger of two: that of white noise (Cramer-Rao, times the misfit), and that which allows for a misfit that
//! is correlated in time, from the autocovariance of the scores with Bartlett weights (W. Newey, K. West, Econometrica
//! 55(3), 1987).

use crate::estimate::setup::{Noise, SetupError};
use crate::motion::tables::{Displaced, Tables};
use ff_dynamics::{Wanted, sensitivities};
use ff_linalg as linalg;
use ff_model::{Model, Params};
use ff_records::Record;
use ff_records::clock::{ClockEstimate, Clocks, interpolate};
use nalgebra::{DMatrix, DVector};

/// Why clocks could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum ClockError {
    /// `Data::ClockNotEstimable` (bad-inputs row D15): the record does not tell the offset to half a sample.
    #[error(
        "Data::ClockNotEstimable: {group}: {why}; move the joints faster while recording, or synchronise the clocks"
    )]
    NotEstimable {
        /// Which channels.
        group: &'static str,
        /// What was met.
        why: String,
    },
    /// Shapes that do not agree.
    #[error("{0}")]
    Shape(String),
    /// The joint motion could not be tabulated.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The prediction could not be computed.
    #[error("the model cannot predict this record: {0}")]
    Prediction(String),
    /// A number that is not finite.
    #[error(transparent)]
    Linalg(#[from] linalg::LinalgError),
}

impl ClockError {
    /// Process exit code of `bad-inputs.md`.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::NotEstimable { .. } => 13,
            Self::Shape(_) | Self::Setup(_) => 11,
            Self::Prediction(_) | Self::Linalg(_) => 14,
        }
    }
}

/// Compares the clocks of a record by what `model` with `params` predicts for it from rest. `max_offset` (s) is the
/// largest offset looked for. `uncertain` lists parameters of the model by index with their standard deviations; they have to be
/// near enough for the record to be linear in their errors. Allocates.
///
/// # Errors
/// [`ClockError`].
pub fn estimate_clocks(
    model: &Model,
    params: &Params<f64>,
    record: &Record,
    noise: &Noise,
    uncertain: &[(usize, f64)],
    max_offset: f64,
) -> Result<Clocks, ClockError> {
    record.check_uniform("the comparison of clocks").map_err(SetupError::from)?;
    let mut tables = Tables::new(model, record, 2, None, (false, false))?;
    let mut z0 = vec![0.0; 6];
    z0.extend(model.rest_position(params));
    z0.resize(6 + 2 * model.np(), 0.0);
    let wanted = Wanted { params: uncertain.iter().map(|u| u.0).collect(), ..Wanted::default() };
    let table = tables.get(model, params, &Displaced::none(model), &wanted);
    let (y, d) =
        sensitivities(model, params, table, &z0, &wanted).map_err(|e| ClockError::Prediction(e.to_string()))?;
    let (n, nj, dt) = (record.samples(), model.nj(), record.dt());
    let tau = y.tau.rows(0, n).into_owned();
    let gyro = y.twist.view((0, 3), (n, 3)).into_owned();
    // Per standard deviation of each parameter.
    let errors = |width: usize, of: &DMatrix<f64>| -> Vec<DMatrix<f64>> {
        let one = |(c, u): (usize, &(usize, f64))| DMatrix::from_fn(n, width, |i, j| of[(i * width + j, c)] * u.1);
        uncertain.iter().enumerate().map(one).collect()
    };
    let torque = Predicted { channels: &tau, errors: &errors(nj, &d.tau) };
    let rate = Predicted { channels: &gyro, errors: &errors(3, &d.gyro) };
    Ok(Clocks {
        torque: estimate_clock("torque", &torque, record.tau(), &vec![noise.torque; nj], dt, max_offset)?,
        gyro: estimate_clock("gyro", &rate, record.gyro(), &[noise.gyro; 3], dt, max_offset)?,
    })
}

/// What the sensors should have read, and how sure that is.
#[derive(Clone, Copy, Debug)]
pub struct Predicted<'a> {
    /// Samples x channels.
    pub channels: &'a DMatrix<f64>,
    /// How it changes, of the same shape, by one standard deviation of each thing that is uncertain about it.
    pub errors: &'a [DMatrix<f64>],
}

/// Standard deviation of a skew before it is measured: clocks of crystals agree to a few hundred ppm.
const SKEW: f64 = 3e-4;

/// Sample, channel, derivatives by offset, skew, gain, bias and errors of the prediction, and the residual.
type Row = (usize, usize, Vec<f64>, f64);

/// Compares `measured` with `predicted` (samples x channels each, `dt` apart, noise `sigma` per channel). Allocates.
///
/// # Errors
/// [`ClockError::NotEstimable`] when the offset is at the end of the range, or its deviation exceeds half a sample;
/// [`ClockError::Shape`], [`ClockError::Linalg`].
pub fn estimate_clock(
    group: &'static str,
    prediction: &Predicted<'_>,
    measured: &DMatrix<f64>,
    sigma: &[f64],
    dt: f64,
    max_offset: f64,
) -> Result<ClockEstimate, ClockError> {
    let (predicted, errors) = (prediction.channels, prediction.errors);
    let (n, c) = measured.shape();
    let lags = (max_offset / dt).ceil();
    if predicted.shape() != (n, c)
        || errors.iter().any(|e| e.shape() != (n, c))
        || sigma.len() != c
        || !(1.0..1e6).contains(&lags)
        || n < 8 * (lags as usize + 4)
    {
        let m = format!(
            "{n} x {c} readings of {} sigmas, {:?} predictions, offsets up to {max_offset} s",
            sigma.len(),
            predicted.shape()
        );
        return Err(ClockError::Shape(m));
    }
    for m in errors.iter().chain([predicted]) {
        linalg::check_finite("prediction", m)?;
    }
    linalg::check_finite("record", measured)?;
    let no = |why: String| ClockError::NotEstimable { group, why };
    let lags = lags as i64;
    // What a free gain and bias explain at each whole lag.
    let explained = |lag: i64| -> f64 {
        let (from, len) = (lags as usize, n - 2 * lags as usize);
        (0..c)
            .map(|j| {
                let y = measured.column(j).rows(from, len).into_owned();
                let p = predicted.column(j).rows((lags - lag) as usize, len).into_owned();
                let (ym, pm) = (y.mean(), p.mean());
                let (mut yp, mut pp) = (0.0, 0.0);
                for (a, b) in y.iter().zip(p.iter()) {
                    yp += (a - ym) * (b - pm);
                    pp += (b - pm) * (b - pm);
                }
                // A negative gain is a wrong sign, not a delay.
                if yp > 0.0 && pp > 0.0 { yp * yp / pp / (sigma[j] * sigma[j]) } else { 0.0 }
            })
            .sum()
    };
    let best = (-lags..=lags).map(|k| (explained(k), k)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0));
    if best.0 < 25.0 * c as f64 {
        return Err(no(format!(
            "prediction and reading have nothing in common ({:.1} of noise power explained)",
            best.0
        )));
    }
    if best.1.abs() == lags {
        return Err(no(format!("the best offset is at the end of the range, {max_offset} s")));
    }
    // Derivative of the prediction by five points.
    let slope = DMatrix::from_fn(n, c, |i, j| {
        let at = |k: i64| predicted[((i as i64 + k).clamp(0, n as i64 - 1) as usize, j)];
        (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * dt)
    });
    let mid = 0.5 * (n - 1) as f64 * dt;
    let width = 2 + 2 * c + errors.len();
    let column = |j: usize| [0, 1, 2 + 2 * j, 3 + 2 * j].into_iter().chain(2 + 2 * c..width);
    let mut x = DVector::zeros(width);
    x[0] = best.1 as f64 * dt;
    (0..c).for_each(|j| x[2 + 2 * j] = 1.0);
    let (margin, mut last) = (lags as usize + 4, None);
    for _ in 0..30 {
        let mut normal = DMatrix::<f64>::zeros(width, width);
        let mut rhs = DVector::<f64>::zeros(width);
        let mut rows: Vec<Row> = Vec::with_capacity((n - 2 * margin) * c);
        for i in margin..n - margin {
            let t = i as f64 * dt;
            let at = (t - x[0] - x[1] * (t - mid)) / dt;
            for j in 0..c {
                let (p, d) = (interpolate(predicted, j, at), interpolate(&slope, j, at));
                let (g, b) = (x[2 + 2 * j], x[3 + 2 * j]);
                let wrong: Vec<f64> = errors.iter().map(|e| interpolate(e, j, at)).collect();
                let off: f64 = wrong.iter().zip(x.rows(2 + 2 * c, errors.len()).iter()).map(|(e, x)| e * x).sum();
                let r = (measured[(i, j)] - g * p - b - off) / sigma[j];
                let mut row = vec![-g * d / sigma[j], -g * d * (t - mid) / sigma[j], p / sigma[j], 1.0 / sigma[j]];
                row.extend(wrong.iter().map(|e| e / sigma[j]));
                for (u, a) in row.iter().zip(column(j)) {
                    rhs[a] += u * r;
                    for (v, b) in row.iter().zip(column(j)) {
                        normal[(a, b)] += u * v;
                    }
                }
                rows.push((i, j, row, r));
            }
        }
        // A model that is off in frequency would pass for a clock that runs fast without this; it is as strong as the misfit.
        let spread = rows.iter().map(|r| r.3 * r.3).sum::<f64>() / rows.len() as f64;
        normal[(1, 1)] += spread.max(1.0) / (SKEW * SKEW);
        rhs[1] -= spread.max(1.0) * x[1] / (SKEW * SKEW);
        for k in 2 + 2 * c..width {
            normal[(k, k)] += 1.0;
            rhs[k] -= x[k];
        }
        // Scaled to a unit diagonal, so that a silent channel shows as a small pivot and gets no gain.
        let scale = DVector::from_fn(width, |k, _| if normal[(k, k)] > 0.0 { normal[(k, k)].sqrt() } else { 1.0 });
        let scaled = DMatrix::from_fn(width, width, |a, b| {
            normal[(a, b)] / (scale[a] * scale[b]) + if a == b { 1e-12 } else { 0.0 }
        });
        linalg::check_finite("clock equations", &scaled)?;
        let inverse = scaled.cholesky().ok_or_else(|| no("the channels do not move".into()))?.inverse();
        let inverse = DMatrix::from_fn(width, width, |a, b| inverse[(a, b)] / (scale[a] * scale[b]));
        let step = &inverse * rhs;
        x += &step;
        if x[0].abs() > max_offset + 2.0 * dt || !x[0].is_finite() {
            return Err(no(format!("the offset leaves the range of {max_offset} s")));
        }
        let settled = step[0].abs() < 1e-9 * dt && step[1].abs() < 1e-12;
        last = Some((inverse, rows));
        if settled {
            break;
        }
    }
    let Some((inverse, rows)) = last else { return Err(no("no step was taken".into())) };
    let freedom = (rows.len() as f64 - width as f64).max(1.0);
    let misfit = (rows.iter().map(|r| r.3 * r.3).sum::<f64>() / freedom).sqrt();
    // Scores of offset and skew per sample, all else eliminated.
    let mut scores = vec![[0.0; 2]; n];
    for (i, j, row, r) in &rows {
        for (k, s) in scores[*i].iter_mut().enumerate() {
            *s += column(*j).zip(row).map(|(a, u)| inverse[(k, a)] * u).sum::<f64>() * r;
        }
    }
    let reach = n / 20;
    let deviation = |k: usize| {
        let gamma = |l: usize| scores.iter().zip(&scores[l..]).map(|(a, b)| a[k] * b[k]).sum::<f64>();
        let weight = |l: usize| 1.0 - l as f64 / (reach + 1) as f64;
        let correlated = gamma(0) + 2.0 * (1..=reach).map(|l| weight(l) * gamma(l)).sum::<f64>();
        (inverse[(k, k)] * misfit.max(1.0).powi(2)).max(correlated).sqrt()
    };
    let out = ClockEstimate {
        offset: x[0],
        offset_deviation: deviation(0),
        skew: x[1],
        skew_deviation: deviation(1),
        gain: (0..c).map(|j| x[2 + 2 * j]).collect(),
        misfit,
    };
    if out.offset_deviation.is_finite() && out.offset_deviation <= 0.5 * dt {
        Ok(out)
    } else {
        Err(no(format!(
            "the offset is known to {:.4} s only, more than half a sample ({:.4} s)",
            out.offset_deviation,
            0.5 * dt
        )))
    }
}
