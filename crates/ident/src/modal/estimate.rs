//! Stiffness, damping (and whatever else is chosen) from measured frequencies and damping ratios.
//!
//! Weighted least squares over the matched modes, with the inertias given or under a prior:
//!
//! ```text
//! min over p:  sum_k  e_k^T C_k^-1 e_k,     e_k = [f_k(p) - f_k, zeta_k(p) - zeta_k],   C_k its covariance from the fit
//! df = Re(conj(l) dl) / (2 pi |l|),      dzeta = Im(l) (Re(l) dIm(l) - Im(l) dRe(l)) / |l|^3
//! ```
//!
//! with the exact derivatives of the poles of [`crate::modal::model`]. Frequencies do not tell left from right: wings that
//! swap their hinges have the same ones. Unless told not to, the fit compares shapes as well: with b the measured and m
//! the predicted complex amplitudes of all channels, each over its deviation, the residual is what of b is not along m,
//!
//! ```text
//! r = P b,   P = 1 - m m^H / m^H m,       dr = -(P dm (m^H b) + m (dm^H P b)) / m^H m
//! ```
//!
//! which does not depend on scale and phase of m (G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10(2), 1973). Modes are matched to the model
//! ([`crate::modal::matching`]), the parameters fitted, and modes matched again with the better model, until the matching
//! stands. What four frequencies cannot tell is named by [`crate::belief::covariance`], as for any other estimator.
//!
//! [`convert_modes`] takes modes measured with the base held to those with the base free, or back: both are modes of the same
//! springs and dampers, `det(l^2 H_p + l D + K) = 0` and `det(l^2 (H_p - H_bp^T H_b^-1 H_bp) + l D + K) = 0`.

use crate::belief::covariance::Uncertainty;
use crate::estimate::estimation::attempt;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::{Estimate, EstimateError};
use crate::estimate::request::Request;
use crate::modal::assignment::assign;
use crate::modal::matching::{MatchSettings, ModeMatch, Pair, Unseen, match_modes};
use crate::modal::model::{HeldPose, ModalModel, ModalModelError, ModeDerivatives, ModelMode};
use core::f64::consts::TAU;
use ff_dynamics::Boundary;
use ff_least_squares::{EvalError, Settings};
use ff_model::{Model, ParamDecl, Params};
use ff_spectral::ModalFit;
use ff_spectral::era::mac;
use ff_spectral::modal::Mode;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, RowVector2, Vector2};

/// Why there is no estimate from modes.
#[derive(Debug, thiserror::Error)]
pub enum ModalEstimateError {
    /// None of the measured modes is one of the model's.
    #[error(
        "none of the {measured} measured modes matches one of the {model} modes of the model; check pose and parameters"
    )]
    NothingMatched {
        /// Measured modes.
        measured: usize,
        /// Modes of the model.
        model: usize,
    },
    /// The model has no modes at this pose.
    #[error(transparent)]
    Model(#[from] ModalModelError),
    /// The fit failed.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
}

impl ModalEstimateError {
    /// Process exit code of `bad-inputs.md`: 13 (ill-posed), 11 or 14.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::NothingMatched { .. } => 13,
            Self::Model(e) => e.exit_code(),
            Self::Estimate(_) => 14,
        }
    }
}

/// What to estimate from modes.
#[derive(Clone, Debug)]
pub struct ModalRequest<'a> {
    /// The model.
    pub model: &'a Model,
    /// Where the joints were held, and whether the base was.
    pub pose: HeldPose<'a>,
    /// Declarations of all parameters.
    pub decls: &'a [ParamDecl],
    /// Indices of the parameters to estimate.
    pub selected: &'a [usize],
    /// Full parameter vector to start from.
    pub start: &'a [f64],
    /// Noise deviation of each channel of the fit.
    pub sigma: &'a [f64],
    /// How modes are matched.
    pub matching: MatchSettings,
    /// Relative width of a prior on everything selected; `None` for the modes alone.
    pub prior_width: Option<f64>,
    /// Deviations added to those of the fit: relative, of a frequency, and absolute, of a damping ratio. They stand for what
    /// the linear model leaves out, and keep modes of a noise-free record from having infinite weight.
    pub floor: (f64, f64),
    /// Compare shapes too, with this deviation, relative to the length of the whitened shape, added to that of the fit.
    pub shapes: Option<f64>,
}

impl<'a> ModalRequest<'a> {
    /// Modes up to `f_max` (Hz) at the pose given, with their shapes to 1 %; no prior.
    pub fn new(
        model: &'a Model,
        pose: HeldPose<'a>,
        (decls, selected, start): (&'a [ParamDecl], &'a [usize], &'a [f64]),
        sigma: &'a [f64],
        f_max: f64,
    ) -> Self {
        let matching = MatchSettings::up_to(f_max);
        Self {
            model,
            pose,
            decls,
            selected,
            start,
            sigma,
            matching,
            prior_width: None,
            floor: (1e-5, 1e-5),
            shapes: Some(0.01),
        }
    }
}

/// The result of [`estimate_modal`].
#[derive(Clone, Debug)]
pub struct ModalEstimate {
    /// Values with covariance, rank and null directions. Few modes leave valleys along which a fit creeps: look at its
    /// [`Estimate::status`] before its values.
    pub estimate: Estimate,
    /// Which mode is which, by the estimated model.
    pub matching: ModeMatch,
    /// Rounds of matching and fitting.
    pub rounds: usize,
}

/// Rounds after which a matching that keeps changing is taken as it is.
const ROUNDS: usize = 8;

/// Estimates `request.selected` from the modes of `fit`. Allocates.
///
/// # Errors
/// [`ModalEstimateError`].
pub fn estimate_modal(request: &ModalRequest<'_>, fit: &ModalFit) -> Result<ModalEstimate, ModalEstimateError> {
    let mut values = request.start.to_vec();
    let at = |values: &[f64]| {
        let params = Params::from_values(request.model, values.to_vec());
        ModalModel::new(request.model, &params, &request.pose)
    };
    let of = |model: &ModalModel| match_modes(fit, model.modes(), request.sigma, &request.matching);
    let mut model = at(&values)?;
    let mut matching = of(&model);
    let mut rounds = 0;
    loop {
        rounds += 1;
        let usable = |p: &&Pair| {
            let m = &fit.modes[p.measured];
            (m.frequency_deviation + m.damping_deviation).is_finite()
        };
        let pairs: Vec<Pair> = matching.pairs.iter().filter(usable).copied().collect();
        if pairs.is_empty() {
            return Err(ModalEstimateError::NothingMatched { measured: fit.modes.len(), model: model.modes().len() });
        }
        // Each round starts anew: a wrong matching must not leave its traces.
        let merged =
            matching.unseen.iter().filter_map(|u| if let Unseen::Merged { with } = u.1 { Some(with) } else { None });
        let found = fit_pairs(request, fit, &pairs, &merged.collect::<Vec<_>>())?;
        values.copy_from_slice(&found.values);
        model = at(&values)?;
        let next = of(&model);
        let key = |m: &ModeMatch| m.pairs.iter().map(|p| (p.measured, p.model)).collect::<Vec<_>>();
        let settled = key(&next) == key(&matching);
        matching = next;
        if settled || rounds == ROUNDS {
            return Ok(ModalEstimate { estimate: found, matching, rounds });
        }
    }
}

/// Fits the parameters to these pairs. A mode that stands for a pair of the model, of which it is the sum (`merged`), lies anywhere
/// between the two, and has the shape of neither.
fn fit_pairs(
    request: &ModalRequest<'_>,
    fit: &ModalFit,
    pairs: &[Pair],
    merged: &[usize],
) -> Result<Estimate, ModalEstimateError> {
    let observed = pairs.iter().map(|p| {
        let m = &fit.modes[p.measured];
        // The plane of two unresolved modes is known, the shape of each is not.
        let alone = !merged.contains(&p.model);
        let apart = alone && !fit.unresolved.iter().any(|u| u.f1 == m.frequency || u.f2 == m.frequency);
        let blur = if alone { 0.0 } else { fit.df };
        let shape = request.shapes.filter(|_| apart).map(|floor| weighted_shape(m, request.sigma, floor));
        let unit: Vec<Complex<f64>> = m.shape().iter().zip(request.sigma).map(|(a, s)| a / *s).collect();
        Observed {
            value: [m.frequency, m.damping],
            white: whitening(m, request.floor, blur),
            model: p.model,
            whitened: apart.then_some(unit),
            shape,
        }
    });
    let observed: Vec<Observed> = observed.collect();
    let rows = observed.iter().map(Observed::rows).sum::<usize>().max(request.selected.len());
    let mut modes = Modes { request, observed, rows };
    let fit = Request {
        prior_width: request.prior_width,
        // Fewer modes than parameters leave directions open: they stay where they are.
        anchor: if request.prior_width.is_none() { Some(10.0) } else { None },
        settings: Settings { max_iterations: 100, cost_floor: 1e-14, gain_tolerance: 1e-6, ..Settings::default() },
        ..Request::new(request.decls, request.selected, request.start)
    };
    Ok(attempt(&fit, &mut modes)?)
}

/// Weight of each channel, and the measured shape times it.
fn weighted_shape(m: &Mode, sigma: &[f64], floor: f64) -> (Vec<f64>, DVector<Complex<f64>>) {
    let shape = m.shape();
    let length = shape.iter().zip(sigma).map(|(a, s)| a.norm_sqr() / (s * s)).sum::<f64>().sqrt();
    let weight = m.amplitude_deviation.iter().zip(sigma).map(|(d, s)| 1.0 / d.hypot(floor * length * s));
    let weight: Vec<f64> = weight.map(|w| if w.is_finite() { w } else { 0.0 }).collect();
    let b = DVector::from_iterator(shape.len(), shape.iter().zip(&weight).map(|(a, w)| a * *w));
    (weight, b)
}

/// `W` with `W^T W = C^-1`, the frequency uncertain by `blur` (Hz) more and the width of the line by as much.
fn whitening(m: &Mode, floor: (f64, f64), blur: f64) -> Matrix2<f64> {
    let a = m.frequency_deviation.hypot(floor.0 * m.frequency).hypot(blur).powi(2);
    let b = m.damping_deviation.hypot(floor.1).hypot(blur / m.frequency).powi(2);
    // Cholesky of [[a, c], [c, b]], inverted; the floor keeps it positive.
    let l = a.sqrt();
    let c = m.covariance / l;
    let d = (b - c * c).max(1e-12 * b).sqrt();
    Matrix2::new(1.0 / l, 0.0, -c / (l * d), 1.0 / d)
}

/// One measured mode.
struct Observed {
    value: [f64; 2],
    white: Matrix2<f64>,
    /// Which of the model's modes by frequency it was matched to. Poles repel each other, so that their order is what
    /// stays along a path of parameters when shapes say nothing.
    model: usize,
    /// Shape in units of noise, by which the mode is followed; none for one of an unresolved pair.
    whitened: Option<Vec<Complex<f64>>>,
    /// Weights and weighted amplitudes of its channels.
    shape: Option<(Vec<f64>, DVector<Complex<f64>>)>,
}

impl Observed {
    fn rows(&self) -> usize {
        2 + self.shape.as_ref().map_or(0, |s| 2 * s.1.len())
    }
}

/// Matched modes as an estimator. Rows that are left over, when there are more parameters than data, are zero.
struct Modes<'a> {
    request: &'a ModalRequest<'a>,
    observed: Vec<Observed>,
    rows: usize,
}

impl Modes<'_> {
    fn at(&self, full: &[f64]) -> Result<(Params<f64>, ModalModel, Vec<usize>), EvalError> {
        let (model, set) = (self.request.model, &self.request.matching);
        let params = Params::from_values(model, full.to_vec());
        let reject = |e: ModalModelError| EvalError::Rejected(e.to_string());
        let m = ModalModel::new(model, &params, &self.request.pose).map_err(reject)?;
        let units: Vec<Vec<Complex<f64>>> = m
            .modes()
            .iter()
            .map(|k| k.channels.iter().zip(self.request.sigma).map(|(a, s)| a / *s).collect())
            .collect();
        let cost = |o: &Observed, j: usize| {
            let x = (m.modes()[j].frequency() / o.value[0]).ln().abs().min(2.0) / set.frequency_spread;
            match &o.whitened {
                Some(w) => 0.5 * x * x + set.shape_weight * (1.0 - mac(w, &units[j])),
                None => 0.1 * x + f64::from(u8::from(j != o.model)),
            }
        };
        let costs: Vec<Vec<f64>> =
            self.observed.iter().map(|o| (0..m.modes().len()).map(|j| cost(o, j)).collect()).collect();
        let found: Option<Vec<usize>> = assign(&costs, m.modes().len(), 1e6).into_iter().collect();
        let found = found.ok_or_else(|| EvalError::Rejected("a measured mode is overdamped here".into()))?;
        Ok((params, m, found))
    }
    fn fill(&self, m: &ModalModel, found: &[usize], r: &mut [f64]) {
        r.fill(0.0);
        let mut row = 0;
        for (o, &k) in self.observed.iter().zip(found) {
            let mode = &m.modes()[k];
            let e = o.white * Vector2::new(mode.frequency() - o.value[0], mode.damping() - o.value[1]);
            (r[row], r[row + 1]) = (e[0], e[1]);
            if let Some((weight, b)) = &o.shape {
                let p = Projected::new(mode, weight, b);
                put(&p.left, |i, x| r[row + 2 + i] = x);
            }
            row += o.rows();
        }
    }
}

/// Real and imaginary parts, one after the other.
fn put(v: &DVector<Complex<f64>>, mut to: impl FnMut(usize, f64)) {
    for (i, x) in v.iter().enumerate() {
        to(2 * i, x.re);
        to(2 * i + 1, x.im);
    }
}

/// The part of a measured shape that is not along the predicted one.
struct Projected {
    m: DVector<Complex<f64>>,
    square: f64,
    along: Complex<f64>,
    left: DVector<Complex<f64>>,
}

impl Projected {
    fn new(mode: &ModelMode, weight: &[f64], b: &DVector<Complex<f64>>) -> Self {
        let m = DVector::from_iterator(b.len(), mode.channels.iter().zip(weight).map(|(x, w)| x * *w));
        // Where the sensors feel no mode at all (a held base), shapes are not compared.
        let felt = m.norm_squared() > 0.0;
        let square = if felt { m.norm_squared() } else { 1.0 };
        let along = m.dotc(b) / square;
        let left = if felt { b - &m * along } else { DVector::zeros(b.len()) };
        Self { m, square, along, left }
    }
    fn derivative(&self, dm: &DVector<Complex<f64>>) -> DVector<Complex<f64>> {
        let across = dm - &self.m * (self.m.dotc(dm) / self.square);
        -(across * self.along + &self.m * (dm.dotc(&self.left) / self.square))
    }
}

/// Changes of frequency and damping ratio for a change `d` of the pole `l`.
fn changes(l: Complex<f64>, d: Complex<f64>) -> [f64; 2] {
    let w = l.norm();
    [(l.conj() * d).re / (TAU * w), l.im * (l.re * d.im - l.im * d.re) / w.powi(3)]
}

impl Estimator for Modes<'_> {
    fn rows(&self) -> usize {
        self.rows
    }
    fn residuals(&mut self, full: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let (_, m, found) = self.at(full)?;
        self.fill(&m, &found, r);
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        _: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let (params, m, found) = self.at(full)?;
        self.fill(&m, &found, r);
        j.fill(0.0);
        let ModeDerivatives { poles: d, channels } =
            m.channel_derivatives(self.request.model, &params, &self.request.pose, selected);
        let mut row = 0;
        for (o, &k) in self.observed.iter().zip(&found) {
            let mode = &m.modes()[k];
            for c in 0..selected.len() {
                let e = o.white * Vector2::from(changes(mode.pole, d[(k, c)]));
                (j[(row, c)], j[(row + 1, c)]) = (e[0], e[1]);
            }
            if let (Some((weight, b)), Some(slope)) = (&o.shape, &channels[k]) {
                let p = Projected::new(mode, weight, b);
                for c in 0..selected.len() {
                    let dm = DVector::from_fn(b.len(), |i, _| slope[(i, c)] * weight[i]);
                    let dr = p.derivative(&dm);
                    put(&dr, |i, x| j[(row + 2 + i, c)] = x);
                }
            }
            row += o.rows();
        }
        Ok(())
    }
}

/// A mode under other boundary conditions.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Converted {
    /// Frequency before (Hz), from the estimated model.
    pub from: f64,
    /// Frequency after (Hz).
    pub frequency: f64,
    /// Its standard deviation (Hz), from that of the estimated parameters; none when they cannot tell it.
    pub frequency_deviation: Option<f64>,
    /// Damping ratio before.
    pub from_damping: f64,
    /// Damping ratio after.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_deviation: Option<f64>,
}

/// Modes of `values` with the boundary of `pose`, and what they become with the boundary `to`: the same springs,
/// dampers and inertias, exactly for the damped problem. Modes correspond by their passive shapes. `known` is the
/// uncertainty of the parameters `selected`, for the deviations. By the frequencies `to`, ascending. Allocates.
///
/// # Errors
/// [`ModalModelError`].
///
/// # Panics
/// If `values` are not those of the model, or `selected` and `known` differ.
pub fn convert_modes(
    model: &Model,
    values: &[f64],
    pose: &HeldPose<'_>,
    to: Boundary,
    (selected, known): (&[usize], Option<&Uncertainty>),
) -> Result<Vec<Converted>, ModalModelError> {
    let params = Params::from_values(model, values.to_vec());
    let after = HeldPose { boundary: to, ..*pose };
    let (a, b) = (ModalModel::new(model, &params, pose)?, ModalModel::new(model, &params, &after)?);
    let cost: Vec<Vec<f64>> = b
        .modes()
        .iter()
        .map(|x| {
            let far = |y: &ModelMode| (y.frequency() / x.frequency()).ln().abs().min(2.0);
            a.modes().iter().map(|y| 1.0 - mac(&x.shape, &y.shape) + 0.05 * far(y)).collect()
        })
        .collect();
    let pairs = assign(&cost, a.modes().len(), 1e3);
    let d = b.derivatives(model, &params, &after, selected);
    let out = b.modes().iter().enumerate().filter_map(|(i, m)| {
        let from = &a.modes()[pairs[i]?];
        let rows: Vec<RowVector2<f64>> =
            (0..selected.len()).map(|c| RowVector2::from(changes(m.pole, d[(i, c)]))).collect();
        let deviation =
            |which: usize| known.and_then(|u| u.combination(&rows.iter().map(|r| r[which]).collect::<Vec<f64>>()));
        Some(Converted {
            from: from.frequency(),
            frequency: m.frequency(),
            frequency_deviation: deviation(0),
            from_damping: from.damping(),
            damping: m.damping(),
            damping_deviation: deviation(1),
        })
    });
    Ok(out.collect())
}
