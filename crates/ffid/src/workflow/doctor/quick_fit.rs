//! A fit of few steps over a thinned record, under a prior about the values of the mission: how near those can come to the record.
//!
//! A design office has masses a tenth wrong, inertias and springs a quarter. That hides a reversed sign of a light joint, which the same
//! values, adapted, bring out. What is asked for is the shape of the signals, to a twentieth: with the noise of the sensors a gyro that sees
//! five hundred times its noise would let a fit creep along narrow valleys.

use super::case::{Case, Scales};
use crate::workflow::amplitude::{PART, amplitude, loudness};
use crate::workflow::identify::ringing::{Ringing, tuned};
use crate::workflow::identify::sigmas;
use ff_least_squares::Settings as Solver;
use ff_model::Params;
use ff_records::Record;
use ident::estimate::attempt;
use ident::{Estimated, Noise, Options, OutputError, Request};

/// Samples of the thinned record, at least, and its longest interval (s).
const SAMPLES: usize = 400;
const INTERVAL: f64 = 0.15;
/// Steps of the integration per period of the fastest mode.
const STEPS: f64 = 7.0;
/// Relative standard deviation of the prior.
const WIDTH: f64 = 0.3;
/// Linearisations, and promised relative reduction at which it ends before.
const ITERATIONS: usize = 30;
const SHOWN: f64 = 0.01;

/// Misfit of a quick fit that follows a record.
pub(super) const FOLLOWS: f64 = 2.0;

/// What a quick fit comes to.
pub(super) struct QuickFit {
    /// Mean of the squared residuals over those of a twentieth of the signals, or of the noise where that is more.
    pub(super) misfit: f64,
    /// Mean square of the signals over the same: what a fit that explains nothing leaves.
    pub(super) loudness: f64,
    /// Full parameter vector.
    pub(super) values: Vec<f64>,
    pub(super) parameters: Vec<Estimated>,
}

impl QuickFit {
    /// The largest ratio of a mass or moment of inertia to that of the mission, or its inverse, as a logarithm. A base of free inertia follows
    /// a gyro in any unit.
    pub(super) fn strays(&self) -> f64 {
        let inertial = |e: &&Estimated| [".mass", ".i_xx", ".i_yy", ".i_zz"].iter().any(|end| e.name.ends_with(end));
        let off = |e: &Estimated| (e.value / e.start).max(f64::MIN_POSITIVE).ln().abs();
        self.parameters.iter().filter(inertial).map(off).fold(0.0, f64::max)
    }
}

/// A record with so few samples that many fits of it take little time, seven or more for each period of the fastest mode.
pub(super) fn thinned(case: &Case<'_>, record: &Record) -> Option<Record> {
    let longest = INTERVAL.min(1.0 / (STEPS * case.fastest_hz.max(1e-3)));
    let every = (record.samples() / SAMPLES).min((longest / record.dt()) as usize).max(1);
    record.thinned(every).ok()
}

/// The prediction of torques and gyro with these standard deviations.
pub(super) fn output_error<'a>(
    case: &Case<'a>,
    record: &'a Record,
    noise: Noise,
    (biases, initial_state): (bool, bool),
) -> Option<OutputError<'a>> {
    let substeps = (STEPS * case.fastest_hz * record.dt()).ceil().max(1.0) as usize;
    let (gyro_bias, torque_bias) = (biases, biases);
    // A prediction is told from residuals, and shapes are compared to a twentieth: every reading counts alike.
    let options = Options { substeps, gyro_bias, torque_bias, initial_state, all_alike: true, ..Options::new(noise) };
    OutputError::new(case.model, record, &options).ok()
}

/// Starts at which an appendage rings as the record does while the joints stand still.
pub(super) fn tuned_starts(case: &Case<'_>) -> Vec<Vec<f64>> {
    let (decls, nominal) = (case.model.param_decls(), Params::nominal(case.model));
    let expand = |values: &[f64]| Some(values.to_vec());
    let (model, noise, records) = (case.model, &case.settings.noise, vec![case.record]);
    let request = Request::new(&decls, case.estimated, nominal.values());
    tuned(&Ringing { model, noise, records, expand: &expand }, &request)
}

/// A twentieth of the signals of a record, or the noise of its sensors, stated or measured, where that is more; `scales` are the factors by
/// which the channels were too large before they were put right.
fn tolerance(case: &Case<'_>, record: &Record, scales: &Scales) -> Noise {
    let Noise { torque, gyro } = case.settings.noise;
    let of_torque =
        case.level.torque.iter().zip(&scales.torque).map(|(noise, scale)| noise / scale).fold(torque, f64::max);
    let of_gyro = case.level.gyro.iter().map(|noise| noise / scales.gyro).fold(gyro, f64::max);
    Noise { torque: of_torque.max(PART * amplitude(record.tau())), gyro: of_gyro.max(PART * amplitude(record.gyro())) }
}

/// From `start` under the prior about the values of the mission, what is estimated, and biases; with the state at the first sample when
/// `initial_state`. `None` where the record cannot be predicted.
pub(super) fn quick_fit(
    case: &Case<'_>,
    record: &Record,
    scales: &Scales,
    start: &[f64],
    initial_state: bool,
) -> Option<QuickFit> {
    let noise = tolerance(case, record, scales);
    let mut fit = output_error(case, record, noise, (true, initial_state))?;
    let (decls, nominal) = (case.model.param_decls(), Params::nominal(case.model));
    let request = Request {
        prior_width: (!case.estimated.is_empty()).then_some(WIDTH),
        coarse: false,
        centre: Some(nominal.values()),
        settings: Solver { max_iterations: ITERATIONS, decrement_tolerance: SHOWN, ..Solver::default() },
        ..Request::new(&decls, case.estimated, start)
    };
    let mut found = attempt(&request, &mut fit).ok()?;
    // What is told of a fit is how far it is from the mission.
    found.parameters.iter_mut().zip(case.estimated).for_each(|(e, &i)| e.start = nominal.values()[i]);
    found.chi2_per_dof.is_finite().then_some(QuickFit {
        misfit: found.chi2_per_dof,
        loudness: loudness(record, &sigmas(case.model, &noise)),
        values: found.values,
        parameters: found.parameters,
    })
}
