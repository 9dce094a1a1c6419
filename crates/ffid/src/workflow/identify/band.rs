//! Records whose joints move as their encoders do not tell, compared where they do.
//!
//! Joints that a controller moves under friction accelerate in ways that no plan has, and torques after the gear show it, many times above their noise.
//! Positions do not: with `s_j` (N m s^2/rad over the noise of the torques) what an acceleration of joint j is worth, and `q_j` the noise of its encoder, what
//! a position tells of the acceleration at frequency f is as loud as the torques' noise where
//!
//! ```text
//! (2 pi f)^2 s_j q_j = 1,
//! ```
//!
//! and louder above ([`ident::OutputError::told_hz`]). There the torques say how the joint moves, and nothing of the model. Where tests contradict a
//! fit, most of what is left over is above that frequency, and no error of the world accounts for it, the record is fitted once more with torques and
//! base rates averaged over so much time that only what is slower is left of them ([`ff_records::Record::averaged`]). Where that is explained, or would be with an error
//! that is named, it is the result, and says so. An error of the model that shows above that frequency alone is not found.

use super::drives::Drives;
use super::evidence::{Evidence, NamedError, State};
use super::explain::{MOST, Tests};
use super::findings::Whiteness;
use super::labelled_record::LabelledRecord;
use super::noise_floor::NoiseFloor;
use super::number::num;
use super::record_estimator::Twin;
use super::result::identification::IdentificationResult;
use super::result::provenance::Warning;
use super::settings::Settings;
use super::signals::Signals;
use super::text;
use ff_model::Model;
use ff_records::{ChannelGroup, Record};
use nalgebra::DMatrix;

/// Part of what is left over that must be above the frequency.
const ABOVE: f64 = 0.5;
/// Deviations of a sum of squares by which it is no chance.
const SEEN: f64 = 6.0;

/// The records with averaged readings.
pub(super) struct Band {
    pub(super) records: Vec<LabelledRecord>,
    /// Frequency of which half of the power is left (Hz).
    hz: f64,
}

impl Band {
    /// Where what is left over of these residuals is above what positions tell of the motion; `None` where it is not, or readings cannot be averaged. Allocates.
    pub(super) fn of(
        (model, settings): (&Model, &Settings),
        records: &[LabelledRecord],
        signals: &[Signals],
        twins: &[Twin<'_>],
        (tests, floor, whiteness): (&Tests, &NoiseFloor, &[Whiteness]),
    ) -> Option<Self> {
        if tests.explained.is_some_and(|part| part > MOST) {
            return None;
        }
        let hz = told_hz(model, settings, records, twins)?;
        if !(peaks_above(whiteness, hz) || is_above(records, signals, hz, (tests, floor))?) {
            return None;
        }
        let one = |t: &LabelledRecord| Some(LabelledRecord { record: t.record.averaged(hz)?, ..t.clone() });
        let records = records.iter().map(one).collect::<Option<Vec<_>>>()?;
        let hz = records.first()?.record.averaging()?.of(ChannelGroup::Torque).half_hz();
        Some(Self { records, hz })
    }
    /// Says in a result what was compared.
    pub(super) fn say(&self, result: &mut IdentificationResult) {
        let hz = num(self.hz);
        let message = format!(
            "torques and base rates are compared below {hz} Hz alone: above it encoders tell accelerations of the joints less exactly than torques do, and what torques show \
             there of their motion no model explains"
        );
        if let Some(evidence) = &mut result.evidence {
            evidence.below_hz = Some(self.hz);
        }
        text::qualify(result, Warning { code: "Fit::Band".to_owned(), message });
    }
}

/// Whether an error is named that is seen, and nothing is left over with it. One that is not seen, and lowers chi-squared all the same, has led to another valley.
pub(super) fn is_named(result: &IdentificationResult) -> bool {
    let named =
        |e: &Evidence| e.with_first == Some(State::Explained) && e.named.first().is_some_and(NamedError::is_seen);
    result.evidence.as_ref().is_some_and(named)
}

/// Up to which frequency (Hz) positions of all records tell how the joints move; `None` where that is not known, or readings are no averages of what is predicted.
fn told_hz(model: &Model, settings: &Settings, records: &[LabelledRecord], twins: &[Twin<'_>]) -> Option<f64> {
    // Friction is known where a reading was taken, and not on the average about it.
    let driven = |t: &LabelledRecord| t.record.is_fixed_base() || !Drives::of(model, &t.record, settings).is_empty();
    if records.iter().any(driven) {
        return None;
    }
    let told = twins.iter().map(Twin::told_hz).collect::<Option<Vec<_>>>()?;
    told.into_iter().reduce(f64::min)
}

/// Whether channels stand out of the noise, and all of them that do so somewhere most above this frequency (Hz).
fn peaks_above(whiteness: &[Whiteness], hz: f64) -> bool {
    let mut peaks = whiteness.iter().filter(|w| w.excess == Some(true)).filter_map(|w| w.peak_hz).peekable();
    peaks.peek().is_some() && peaks.all(|peak| peak > hz)
}

/// Whether there is more in the squared residuals than noise, and most of it above this frequency (Hz). `None` for readings that cannot be averaged.
fn is_above(
    records: &[LabelledRecord],
    signals: &[Signals],
    hz: f64,
    (tests, floor): (&Tests, &NoiseFloor),
) -> Option<bool> {
    let (mut all, mut below, mut readings) = (0.0, 0.0, 0.0);
    for (t, s) in records.iter().zip(signals) {
        let [whole, averaged] = squares(t, s, hz)?;
        (all, readings) = (all + whole.0, readings + whole.1);
        below += averaged.0 - averaged.1 * floor.sensors;
    }
    let noise = floor.sensors + tests.motion_noise;
    let over = all - readings * noise;
    // All noise of the encoders counts as if it were above.
    Some(over > SEEN * noise * (2.0 * readings).sqrt() && over - below > ABOVE * over)
}

/// Squared residuals of a record over their noise, with how many there are, and the same of their averages.
fn squares(t: &LabelledRecord, s: &Signals, hz: f64) -> Option<[(f64, f64); 2]> {
    let (joints, rows) = (t.record.joints(), [t.record.tau().nrows(), t.record.gyro().nrows()]);
    if s.names.len() != joints + 3 {
        return None;
    }
    let of = |first: usize, count: usize, rows: usize| {
        let columns = (first..first + count).map(|c| s.readings(c).0.into_iter().map(move |r| r / s.sigma[c]));
        let all: Vec<f64> = columns.flatten().collect();
        (all.len() == rows * count).then(|| DMatrix::from_vec(rows, count, all))
    };
    let whitened = t.record.clone().with_torques(of(0, joints, rows[0])?).with_gyro(of(joints, 3, rows[1])?);
    let averaged = whitened.averaged(hz)?;
    let sum = |r: &Record| {
        let all = [(r.tau(), ChannelGroup::Torque), (r.gyro(), ChannelGroup::Gyro)];
        let squares: f64 = all.iter().map(|&(m, group)| m.norm_squared() / r.noise_gain(group).powi(2)).sum();
        (squares, all.iter().map(|(m, _)| m.len() as f64).sum::<f64>())
    };
    Some([sum(&whitened), sum(&averaged)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_records::RecordBuilder;

    /// Residuals that swing at a frequency (Hz) with this amplitude, in deviations, beside noise.
    fn signals(hz: f64, amplitude: f64) -> (LabelledRecord, Signals) {
        let n = 3000;
        let noise = |i: usize, c: usize| {
            let x = (12.9898 * i as f64 + 78.233 * c as f64).sin() * 43_758.545_3;
            12.0f64.sqrt() * (x - x.floor() - 0.5)
        };
        let swing = |i: usize| amplitude * (std::f64::consts::TAU * hz * 0.02 * i as f64).sin();
        let wave = |n: usize, columns| DMatrix::from_fn(n, columns, |i, c| (0.013 * i as f64 + c as f64).sin());
        let built = RecordBuilder::new(["a"]).uniform(0.0, 50.0).q(wave(n, 1)).tau(wave(n, 1)).gyro(wave(n, 3)).build();
        let record = built.unwrap().0;
        let sigma = vec![0.05, 1e-4, 1e-4, 1e-4];
        let measured = DMatrix::from_fn(n, 4, |i, c| sigma[c] * (noise(i, c) + if c == 0 { swing(i) } else { 0.0 }));
        let signals = Signals {
            time: (0..n).map(|i| 0.02 * i as f64).collect(),
            names: record.response_names(),
            units: vec!["N m", "rad/s", "rad/s", "rad/s"],
            sigma,
            measured,
            predicted: DMatrix::zeros(n, 4),
        };
        (LabelledRecord { label: "a".into(), record, resampled: (false, false), continues: false, ago: 0 }, signals)
    }

    #[test]
    fn what_is_left_over_is_told_apart_by_frequency() {
        let excess = |hz: f64| {
            let (t, s) = signals(hz, 3.0);
            squares(&t, &s, 1.6).unwrap().map(|(sum, count)| sum - count)
        };
        // Nine halves a reading, of which there are 3000; averages miss ends of 1.6 s each.
        let ([all, below], [same, none]) = (excess(0.5), excess(6.0));
        assert!(
            (all / 13_500.0 - 1.0).abs() < 0.05 && (below / all / (1.0 - 3.2 / 60.0) - 1.0).abs() < 0.05,
            "{all} {below}"
        );
        assert!((same / all - 1.0).abs() < 0.05 && none.abs() < 0.02 * all, "{same} {none}");
    }
}
