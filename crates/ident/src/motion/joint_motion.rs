//! Joint motion of a record as a smooth function of time, with consistent rates and accelerations.

use crate::estimate::setup::SetupError;
use crate::motion::bent::Bent;
use crate::motion::kink::{Column, FittedMotion, Kink, untold};
use crate::motion::knot_spectrum::{KnotError, SpectralFit, Stake, fit_at_stake};
use crate::motion::last_fits::remembered;
use crate::motion::loose_ends::LooseEnds;
use crate::motion::spline_fit::{
    FitError, JointSamples, SAMPLES_PER_KNOT, choose_knots, fit_with_kinks, movable, noise_of,
};
use crate::motion::stamped_motion::StampedHermite;
use ff_dynamics::motion::{HermiteTable, JointMotion};
use ff_model::Model;
use ff_records::Record;
use ff_records::time_base::ChannelGroup;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;

/// The joint motion of a record.
///
/// With rates and accelerations in the record (noise-free simulation, or a controller that logs its set
/// points), quintic Hermite interpolation through the samples, at times of their own or not; with positions, and rates where they agree with them, a
/// least-squares B-spline ([`spectral_motion`]). Allocates.
///
/// # Errors
/// [`SetupError`].
pub fn joint_motion(model: &Model, record: &Record) -> Result<Box<dyn JointMotion>, SetupError> {
    Ok(motion_of(model, record, || None, false)?.0)
}

/// [`joint_motion`] with what accelerations are worth, asked for only where knots are chosen by it; `None`: every joint alike.
/// `from_rest` as in [`motion_at_stake`]. With the noise that a fitted motion may hold.
pub(crate) fn motion_of(
    model: &Model,
    record: &Record,
    stake: impl FnOnce() -> Option<Stake>,
    from_rest: bool,
) -> Result<(Box<dyn JointMotion>, Option<MotionNoise>), SetupError> {
    let n = record.joints();
    if n != model.nj() {
        return Err(SetupError::Joints { got: n, want: model.nj() });
    }
    if let (Some(times), Some(qd), Some(qdd)) = (record.times(ChannelGroup::Motion), record.qd(), record.qdd()) {
        return Ok((Box::new(StampedHermite::new(times, record.q(), qd, qdd)), None));
    }
    if let Some(table) = logged(record)? {
        return Ok((Box::new(table), None));
    }
    if let Some(short) = short(record)? {
        return Ok((short, None));
    }
    let (fit, weights) = match stake() {
        Some(stake) => (motion_at_stake(record, &stake, from_rest)?, stake.weights),
        None => (spectral_motion(record)?, Vec::new()),
    };
    let (spacing, from_rest) = (fit.fit.spacing, fit.fit.from_rest);
    let worth = weights.iter().zip(&fit.noise).map(|(w, s)| (w * s).powi(2)).sum();
    let untold = untold(&fit.fit.motion, fit.planned, &weights, fit.dt);
    let ends = LooseEnds::new(&times(record), at_ends(&fit), from_rest, worth).with_untold(untold);
    let moved = moved(record, &fit);
    let tied = fit.tied.clone();
    // A plan has no part that its knots bend.
    let bent = || Bent::of(&fit.fit.motion, &fit.noise, spacing, (record.samples(), fit.dt));
    let bent = if fit.planned { None } else { bent() };
    let noise = MotionNoise {
        moved,
        tied,
        bent: bent.map(Arc::new),
        spacing,
        told_hz: told(&weights, &fit.noise),
        positions: fit.noise,
        steps: fit.steps,
        motion: Arc::new(fit.fit.motion.clone()),
        from_rest,
        ends,
    };
    Ok((Box::new(fit.fit.motion), Some(noise)))
}

/// See [`MotionNoise::told_hz`].
fn told(weights: &[f64], noise: &[f64]) -> Option<f64> {
    let worth = weights.iter().zip(noise).map(|(w, s)| w * s).reduce(f64::max)?;
    let hz = worth.recip().sqrt() / core::f64::consts::TAU;
    hz.is_finite().then_some(hz)
}

/// How far apart knots are next to the ends (s): a plan is as loose there as its first and last pieces are short, however far apart its other knots are.
fn at_ends(fit: &SpectralFit) -> f64 {
    let (spacing, end) = (fit.fit.spacing, fit.fit.motion.duration());
    if !fit.planned {
        return spacing;
    }
    let next = fit.fit.motion.kinks().map(|k| k.0.time.min(end - k.0.time)).fold(spacing, f64::min);
    next.max(SAMPLES_PER_KNOT * fit.dt)
}

/// See [`movable`]; none without kinks.
fn moved(record: &Record, fit: &SpectralFit) -> Vec<Kink> {
    let kinks: Vec<(Kink, f64)> = fit.fit.motion.kinks().collect();
    if kinks.is_empty() {
        return Vec::new();
    }
    let (times, q) = (times(record), rows(record.q()));
    let positions = JointSamples { dof: record.joints(), times: &times, q: &q, qd: None, rate_weight: 0.0 };
    let mut moved = movable(&positions, fit.fit.spacing, &kinks, fit.planned, &fit.noise, TOLD * fit.dt);
    moved.retain(|k| !fit.tied.iter().any(|t| t.0 == *k));
    moved
}

/// Part of the interval between samples to which the time of a kink must be told, for its error to be one to first order.
const TOLD: f64 = 0.25;

/// Noise that a spline through noisy positions holds.
#[derive(Clone)]
pub(crate) struct MotionNoise {
    /// Of the knots (s).
    spacing: f64,
    /// See [`MotionNoise::told_hz`].
    told_hz: Option<f64>,
    /// Standard deviations of the positions (rad or m).
    positions: Vec<f64>,
    /// Steps in which they are read (rad or m); 0 for none.
    steps: Vec<f64>,
    /// The motion that was fitted.
    motion: Arc<FittedMotion>,
    /// The motion was held at rest at the first sample: a spline that is free there begins with a rate of noise that lasts all the record.
    from_rest: bool,
    /// What errors of the times of kinks add, where positions tell these; and where torques do, with the deviation of the size.
    moved: Vec<Kink>,
    tied: Vec<(Kink, f64)>,
    /// What the spline bends of the motion.
    bent: Option<Arc<Bent>>,
    /// What it adds to the torques next to the ends.
    pub(crate) ends: LooseEnds,
}

impl MotionNoise {
    /// How far the knots of the motion are apart (s).
    pub(crate) fn spacing(&self) -> f64 {
        self.spacing
    }
    /// Frequency (Hz) at which noise of the positions, as acceleration of the joint where that is worth most, is as loud as that of the torques: `(2 pi f)^2 w q = 1`
    /// with the deviations `w` of the torques an acceleration is worth and the noise `q` of a position. `None` where torques were not asked.
    pub(crate) fn told_hz(&self) -> Option<f64> {
        self.told_hz
    }
    /// A spline on the knots of the motion, held at rest at the first sample where that is, through other readings of one joint, `dt` (s) apart: both let the
    /// same through. Allocates.
    pub(crate) fn alike(&self, values: &[f64], dt: f64) -> Result<FittedMotion, SetupError> {
        let times: Vec<f64> = (0..values.len()).map(|i| i as f64 * dt).collect();
        let samples = JointSamples { dof: 1, times: &times, q: values, qd: None, rate_weight: 0.0 };
        let fit = fit_with_kinks(&samples, self.spacing.max(SAMPLES_PER_KNOT * dt), &[], self.from_rest);
        fit.map(|fit| fit.motion).map_err(|e| SetupError::JointMotion(e.to_string()))
    }
    /// How many kinks the motion has.
    pub(crate) fn kinks(&self) -> usize {
        self.motion.kinks().count()
    }
    /// When they are (s), in no order. Allocates.
    pub(crate) fn kink_times(&self) -> Vec<f64> {
        self.motion.kinks().map(|k| k.0.time).collect()
    }
    /// Splines with the same knots through noise alone, at the sample times of the positions: what a fitted motion is off by, without
    /// what recorded rates add. Positions that are read in steps err by what the steps leave of the motion, shifted by a part of a step:
    /// where a joint is slow that is a saw, and no white noise. Sizes and times of kinks are off by what noise makes of them. Draws are those of a seed that belongs to their number. Allocates.
    pub(crate) fn draws(&self, record: &Record, count: usize) -> Result<Vec<Arc<dyn JointMotion>>, SetupError> {
        let (times, n) = (times(record), self.positions.len());
        let kinks: Vec<Kink> = self.motion.kinks().map(|k| k.0).collect();
        let one = |k: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(k as u64);
            let shift: Vec<f64> = self.steps.iter().map(|step| step * rng.random::<f64>()).collect();
            let mut q = vec![0.0; n * times.len()];
            for (t, q) in times.iter().zip(q.chunks_exact_mut(n)) {
                self.motion.derivative(*t, 0, q);
                for (j, q) in q.iter_mut().enumerate() {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    *q = self.reading_error(j, *q + shift[j], noise);
                }
            }
            let failed = |e: FitError| SetupError::JointMotion(e.to_string());
            let bent = self.bent.as_ref().map(|b| b.draw(&mut rng)).transpose().map_err(failed)?;
            // What a fit takes for another motion, and the other motion.
            let tied = self.mistimed(&mut rng).map_err(failed)?;
            let mut x = vec![0.0; n];
            for other in bent.iter().chain(&tied) {
                for (t, q) in times.iter().zip(q.chunks_exact_mut(n)) {
                    other.derivative(*t, 0, &mut x);
                    q.iter_mut().zip(&x).for_each(|(q, x)| *q -= x);
                }
            }
            let samples = JointSamples { dof: n, times: &times, q: &q, qd: None, rate_weight: 0.0 };
            let fit = |kinks: &[Kink]| fit_with_kinks(&samples, self.spacing, kinks, self.from_rest);
            // Times that are not told beside the others stay.
            let fit = fit(&[&kinks[..], &self.moved].concat()).or_else(|_| fit(&kinks));
            let fit = fit.map_err(failed)?.motion;
            let all: Vec<FittedMotion> = core::iter::once(fit).chain(bent).chain(tied).collect();
            Ok(Arc::new(Sum(all)) as Arc<dyn JointMotion>)
        };
        (0..count).map(one).collect()
    }
    /// What errors of the times add that torques tell; `None` for nothing.
    fn mistimed(&self, rng: &mut ChaCha8Rng) -> Result<Option<FittedMotion>, FitError> {
        if self.tied.is_empty() {
            return Ok(None);
        }
        let knots = self.motion.spline().knots();
        let of = |(k, size): &(Kink, f64)| {
            let normal: f64 = StandardNormal.sample(rng);
            (Column::new(knots, *k), size * normal)
        };
        let kinks = self.tied.iter().map(of).collect();
        let none = DMatrix::zeros(self.positions.len(), knots.count());
        Ok(Some(FittedMotion::new(knots.clone(), none, kinks, self.motion.ramp())?))
    }
    /// Error of a reading of joint `j` at position `q`, for normal `noise` of unit deviation: that of the steps, and noise of what they
    /// leave of the deviation of the positions.
    fn reading_error(&self, j: usize, q: f64, noise: f64) -> f64 {
        let (sigma, step) = (self.positions[j], self.steps[j]);
        if step == 0.0 {
            return sigma * noise;
        }
        let besides = (sigma * sigma - step * step / 12.0).max(0.0).sqrt() * noise;
        ((q + besides) / step).round() * step - q
    }
}

/// Motions of as many joints, one on the other.
struct Sum(Vec<FittedMotion>);

impl JointMotion for Sum {
    fn dof(&self) -> usize {
        self.0[0].dof()
    }
    fn duration(&self) -> f64 {
        self.0[0].duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let n = self.dof();
        self.0[0].eval(t, q, qd, qdd);
        let mut own = vec![0.0; if self.0.len() > 1 { 3 * n } else { 0 }];
        for other in &self.0[1..] {
            let (x, rest) = own.split_at_mut(n);
            let (v, a) = rest.split_at_mut(n);
            other.eval(t, x, v, a);
            for (to, from) in [(&mut *q, x), (&mut *qd, v), (&mut *qdd, a)] {
                to.iter_mut().zip(from.iter()).for_each(|(to, from)| *to += from);
            }
        }
    }
    fn breaks(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.0.iter().flat_map(JointMotion::breaks).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }
}

/// The motion of a record that has rates and accelerations.
fn logged(record: &Record) -> Result<Option<HermiteTable>, SetupError> {
    let (Some(qd), Some(qdd)) = (record.qd(), record.qdd()) else { return Ok(None) };
    let table = HermiteTable::new(record.joints(), record.dt(), &rows(record.q()), &rows(qd), &rows(qdd));
    table.map(Some).map_err(|e| SetupError::JointMotion(e.to_string()))
}

/// The motion of a record too short for a spectrum.
fn short(record: &Record) -> Result<Option<Box<dyn JointMotion>>, SetupError> {
    if record.q().nrows() >= 64 {
        return Ok(None);
    }
    let (times, q) = (times(record), rows(record.q()));
    let s = JointSamples { dof: record.joints(), times: &times, q: &q, qd: None, rate_weight: 0.0 };
    let fit = choose_knots(&s, None).map_err(|e| SetupError::JointMotion(e.to_string()))?;
    Ok(Some(Box::new(fit.motion)))
}

/// B-spline through the positions of a record, with knots judged by their accelerations, every joint alike, and with the reason for
/// them (`crate::motion::knot_spectrum`). Allocates.
///
/// # Errors
/// [`SetupError::JointMotion`]; at least 64 samples are needed.
pub fn spectral_motion(record: &Record) -> Result<SpectralFit, SetupError> {
    motion_at_stake(record, &Stake::alike(record.joints()), false)
}

/// [`spectral_motion`] with what accelerations are worth.
///
/// Recorded rates are used when a spline can follow both: rates that are late, filtered or scaled leave more than their noise, and
/// are then left out. With `from_rest`, rates at the first sample that are zero within their noise are held at zero
/// ([`fit_with_kinks`]). Allocates.
///
/// # Errors
/// As [`spectral_motion`].
pub fn motion_at_stake(record: &Record, stake: &Stake, from_rest: bool) -> Result<SpectralFit, SetupError> {
    let times = times(record);
    remembered((record, &times, stake, from_rest), || at_stake(record, &times, stake, from_rest))
}

/// See [`motion_at_stake`].
fn at_stake(record: &Record, times: &[f64], stake: &Stake, from_rest: bool) -> Result<SpectralFit, SetupError> {
    let failed = |e: KnotError| SetupError::JointMotion(e.to_string());
    let q = rows(record.q());
    let positions = JointSamples { dof: record.joints(), times, q: &q, qd: None, rate_weight: 0.0 };
    if let Some(qd) = record.qd() {
        let qd = rows(qd);
        let noise = |x: &[f64]| noise_of(&JointSamples { q: x, ..positions }).map_err(|e| failed(e.into()));
        let (of_q, of_qd) = (noise(&q)?, noise(&qd)?);
        let norm = |s: &[f64]| s.iter().map(|s| s * s).sum::<f64>().sqrt();
        let rate_weight = norm(&of_q) / norm(&of_qd);
        if rate_weight > 0.0 && rate_weight.is_finite() {
            let agree = |r: &[f64], s: &[f64]| r.iter().zip(s).all(|(r, s)| *r <= 1.5 * s);
            // Rates so much better than positions that these do not count leave the constant of the motion open.
            if let Ok(fit) = fit_at_stake(&JointSamples { qd: Some(&qd), rate_weight, ..positions }, None, stake)
                && agree(&fit.fit.rate_residual, &of_qd)
                && agree(&fit.fit.residual, &fit.noise)
            {
                return settled(fit, &JointSamples { qd: Some(&qd), rate_weight, ..positions }, from_rest);
            }
        }
    }
    settled(fit_at_stake(&positions, None, stake).map_err(failed)?, &positions, from_rest)
}

/// The fit, held at rest at the first sample if it may start there and is asked to.
fn settled(mut fit: SpectralFit, samples: &JointSamples<'_>, from_rest: bool) -> Result<SpectralFit, SetupError> {
    if from_rest && fit.fit.may_start_at_rest(&fit.noise) {
        let kinks: Vec<Kink> = fit.fit.motion.kinks().map(|k| k.0).collect();
        match fit_with_kinks(samples, fit.fit.spacing, &kinks, true) {
            Ok(held) => fit.fit = held,
            // A kink that is not told from a rate there.
            Err(FitError::Undetermined { .. }) if !kinks.is_empty() => {}
            Err(e) => return Err(SetupError::JointMotion(e.to_string())),
        }
    }
    Ok(fit)
}

fn times(record: &Record) -> Vec<f64> {
    if let Some(times) = record.times(ChannelGroup::Motion) {
        return times.to_vec();
    }
    (0..record.samples()).map(|i| i as f64 * record.dt()).collect()
}

/// Row-major copy: sample after sample.
fn rows(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::spline_fit::choose_knots;

    /// Of a joint at rest whose positions are read in steps of 1e-4 rad.
    fn stepped() -> MotionNoise {
        let times: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
        let step = 1e-4;
        let q = vec![0.3; times.len()];
        let s = JointSamples { dof: 1, times: &times, q: &q, qd: None, rate_weight: 0.0 };
        let fit = choose_knots(&s, Some(&[1e-9])).unwrap();
        MotionNoise {
            told_hz: None,
            spacing: 0.1,
            positions: vec![step / 12f64.sqrt()],
            steps: vec![step],
            motion: Arc::new(fit.motion),
            from_rest: false,
            moved: Vec::new(),
            tied: Vec::new(),
            bent: None,
            ends: LooseEnds::default(),
        }
    }

    #[test]
    fn errors_of_steps_are_those_of_the_motion() {
        // A joint that rests between two steps errs by a constant of at most half a step.
        let n = stepped();
        let errors: Vec<f64> = (0..9).map(|k| n.reading_error(0, 0.3 + 1e-5 * f64::from(k), 1.7)).collect();
        assert!(errors.iter().all(|e| e.abs() <= 0.5001e-4), "{errors:?}");
        assert!(errors.windows(2).any(|e| (e[0] - e[1]).abs() > 0.9e-5), "{errors:?}");
        // A slow one errs by a saw, whose mean square is that of the steps, and neighbours err alike.
        let saw: Vec<f64> = (0..5000).map(|i| n.reading_error(0, 0.3 + 2e-6 * f64::from(i), 0.0)).collect();
        let square = |x: &[f64]| x.iter().map(|e| e * e).sum::<f64>() / x.len() as f64;
        assert!((square(&saw) / (1e-8 / 12.0) - 1.0).abs() < 0.02);
        let alike = saw.windows(2).map(|e| e[0] * e[1]).sum::<f64>() / saw.len() as f64;
        assert!(alike > 0.8 * square(&saw), "{alike:e}");
        // Noise beyond the steps is normal.
        let wide = MotionNoise { positions: vec![1e-3], ..n };
        assert!((wide.reading_error(0, 0.3, 2.0) - 2e-3).abs() < 1e-4);
    }
}
