//! Correction of record clocks in rounds: estimate offset and skew with the parameters of a fit, correct the record, fit again.
//!
//! A fit to a record with a wrong clock bends the parameters, and the bent parameters hide part of the offset. Each round therefore
//! treats the fitted parameters as uncertain by [`BENT`] of their sizes, adds what it finds to the total of the earlier rounds and
//! corrects the **original** record by the total. The caller fits again between rounds.

use crate::checks::clock::{ClockError, estimate_clocks};
use crate::estimate::setup::Noise;
use crate::parameters::scale::sizes;
use ff_model::{Model, Params, Problems};
use ff_records::Record;
use ff_records::clock::{ClockEstimate, Clocks, correct_clocks};

/// Uncertainty of the fitted parameters beside the clocks, relative to their size.
const BENT: f64 = 0.1;
/// Offsets and skews below this many standard deviations count as zero.
const SURE: f64 = 3.0;
/// Largest offset looked for (s), and as a part of the record.
const LATEST: (f64, f64) = (0.25, 0.03);
/// Rounds at most.
const ROUNDS: usize = 4;
/// Part of a sample below which what a round still finds of a clock that is corrected needs no other: the tests of a fit see a gyro that is late by a
/// twentieth of one.
const SETTLED: f64 = 0.005;

/// Part of a sample from which a clock is corrected ([`correct_clocks`]).
const CORRECTED: f64 = 0.5;

/// Why a round ended.
#[derive(Debug, thiserror::Error)]
pub enum ClockCorrectionError {
    /// The first round does not determine the offset of a record, and the policy requires it.
    #[error("record {record}: {group}: {why}")]
    NotEstimable {
        /// Index of the record.
        record: usize,
        /// `torque` or `gyro`.
        group: &'static str,
        /// Why.
        why: String,
    },
    /// Too little of a corrected record is left.
    #[error("{0}")]
    Record(Problems),
}

/// Parameters of a fit, from which the channels are predicted.
#[derive(Clone, Copy, Debug)]
pub struct FittedModel<'a> {
    /// The model.
    pub model: &'a Model,
    /// Full parameter vector in each record: fuel may be burnt between them.
    pub values: &'a [Vec<f64>],
    /// Parameters that were fitted.
    pub selected: &'a [usize],
    /// Standard deviations of the sensors.
    pub noise: &'a Noise,
}

/// Clocks found for one record.
#[derive(Clone, Debug)]
pub struct CorrectedClocks {
    /// Index of the record.
    pub record: usize,
    /// Total over all rounds.
    pub clocks: Clocks,
    /// Whether offset or drift of torque and gyro exceed half a sample, and were corrected.
    pub corrected: (bool, bool),
    /// `Data::ClockOffset` and `Data::ClockSkew` (rows D15, D16), one for each correction.
    pub warnings: Problems,
}

/// Original records and the clocks found so far.
#[derive(Clone, Debug)]
pub struct ClockCorrection {
    originals: Vec<Record>,
    totals: Vec<Option<Clocks>>,
    rounds: usize,
}

impl ClockCorrection {
    /// Begins with records as they were recorded.
    pub fn new(originals: Vec<Record>) -> Self {
        let totals = vec![None; originals.len()];
        Self { originals, totals, rounds: 0 }
    }
    /// One round: compares the clocks of `records` (original or corrected by earlier rounds) with what `fitted` predicts from rest.
    /// Returns the records that changed, by index, for another fit; empty when nothing is left to correct, or after four
    /// rounds. Records whose offset is not determined are left as they are, unless `require` is set and this is the first
    /// round. Allocates.
    ///
    /// # Errors
    /// [`ClockCorrectionError`].
    ///
    /// # Panics
    /// If the number of records changed, or there is not one parameter vector for each.
    pub fn round(
        &mut self,
        fitted: &FittedModel<'_>,
        records: &[&Record],
        require: bool,
    ) -> Result<Vec<(usize, Record)>, ClockCorrectionError> {
        assert_eq!(records.len(), self.originals.len(), "the same records in every round");
        assert_eq!(records.len(), fitted.values.len(), "one parameter vector per record");
        if self.rounds == ROUNDS {
            return Ok(Vec::new());
        }
        let first = self.rounds == 0;
        self.rounds += 1;
        let FittedModel { model, values, selected, noise } = *fitted;
        let decls = model.param_decls();
        let mut changed = Vec::new();
        for (k, record) in records.iter().enumerate() {
            let all_sizes = sizes(&decls, &values[k]);
            let params = Params::from_values(model, values[k].clone());
            let uncertain: Vec<(usize, f64)> = selected.iter().map(|&i| (i, BENT * all_sizes[i])).collect();
            let mut found = match estimate_clocks(model, &params, record, noise, &uncertain, longest_delay(record)) {
                Ok(c) => c,
                Err(ClockError::NotEstimable { group, why }) if first && require => {
                    return Err(ClockCorrectionError::NotEstimable { record: k, group, why });
                }
                // Channels at times of their own are not compared.
                Err(e) if first && require && !record.is_uniform() => {
                    let (group, why) = ("clocks", e.to_string());
                    return Err(ClockCorrectionError::NotEstimable { record: k, group, why });
                }
                // Not determined, a record too short to compare, or a start too far off to predict: the fit reports on those.
                Err(_) => continue,
            };
            let dt = record.dt();
            for e in [&mut found.torque, &mut found.gyro] {
                drop_insignificant(e);
            }
            let seconds = record.seconds();
            let off = |e: &ClockEstimate, part: f64| e.offset.abs().max((e.skew * seconds).abs()) > part * dt;
            // A clock that was left as it is was now compared once more, by a better fit, and not what is left of it.
            let both = |t: &ClockEstimate, f: &ClockEstimate| if off(t, CORRECTED) { sum(t, f) } else { f.clone() };
            let total = match self.totals[k].take() {
                None => found.clone(),
                Some(t) => Clocks { torque: both(&t.torque, &found.torque), gyro: both(&t.gyro, &found.gyro) },
            };
            let more = |total: &ClockEstimate, found: &ClockEstimate| off(total, CORRECTED) && off(found, SETTLED);
            let unsettled = more(&total.torque, &found.torque) || more(&total.gyro, &found.gyro);
            let (corrected, mask, warnings) = correct_clocks(&self.originals[k], &total);
            if !warnings.0.is_empty() && unsettled {
                // Samples at the end for which there is no reading.
                let n = corrected.samples();
                let gone = |i: usize| mask.tau.row(i).iter().chain(mask.gyro.row(i).iter()).any(|w| *w == 0.0);
                let kept = (n / 2..n).find(|&i| gone(i)).unwrap_or(n);
                changed.push((k, corrected.window(0.0, kept as f64 * dt).map_err(ClockCorrectionError::Record)?));
            }
            self.totals[k] = Some(total);
        }
        Ok(changed)
    }
    /// What all rounds found, for the records whose clocks are determined. Allocates.
    pub fn found(&self) -> Vec<CorrectedClocks> {
        let one = |(record, total): (usize, &Option<Clocks>)| {
            let clocks = total.clone()?;
            let (_, _, warnings) = correct_clocks(&self.originals[record], &clocks);
            let (dt, seconds) = (self.originals[record].dt(), self.originals[record].seconds());
            let off = |e: &ClockEstimate| e.offset.abs().max((e.skew * seconds).abs()) > CORRECTED * dt;
            let corrected = (off(&clocks.torque), off(&clocks.gyro));
            Some(CorrectedClocks { record, clocks, corrected, warnings })
        };
        self.totals.iter().enumerate().filter_map(one).collect()
    }
}

/// The longest delay of torques or gyro that is looked for in a record (s).
pub fn longest_delay(record: &Record) -> f64 {
    LATEST.0.min(LATEST.1 * record.seconds())
}

/// Sets to zero what noise may have made.
fn drop_insignificant(e: &mut ClockEstimate) {
    if e.offset.abs() < SURE * e.offset_deviation {
        e.offset = 0.0;
    }
    if e.skew.abs() < SURE * e.skew_deviation {
        e.skew = 0.0;
    }
}

fn sum(a: &ClockEstimate, b: &ClockEstimate) -> ClockEstimate {
    ClockEstimate { offset: a.offset + b.offset, skew: a.skew + b.skew, ..b.clone() }
}
