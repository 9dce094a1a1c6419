//! Rounds of clock correction and fit (rows D15 and D16), and their lines in the result.

use super::error::IdentifyError;
use super::findings::ClockLine;
use super::identified::Identified;
use super::labelled_record::LabelledRecord;
use super::result::parameter::Parameter;
use super::settings::Settings;
use ff_model::{Area, Model, Problem, Problems};
use ff_records::Record;
use ff_records::clock::ClockEstimate;
use ident::checks::{ClockCorrection, ClockCorrectionError, ClockPolicy, CorrectedClocks, FittedModel};
use ident::compose::is_called;

/// Another fit of corrected records.
pub(super) type Refit<'a> = &'a dyn Fn(&[LabelledRecord], &Settings) -> Result<Identified, IdentifyError>;

/// Chi-squared over that before the correction from which on clocks stay as they were: one that is right lowers it.
const WORSE: f64 = 1.001;

/// Corrects the clocks of `records` in place and fits again until nothing is left to correct. Lines of the result and warnings.
pub(super) fn set_clocks(
    model: &Model,
    records: &mut [LabelledRecord],
    s: &Settings,
    policy: ClockPolicy,
    mut found: Identified,
    fit: Refit<'_>,
) -> Result<(Identified, Vec<ClockLine>, Problems), IdentifyError> {
    let mut correction = ClockCorrection::new(records.iter().map(|r| r.record.clone()).collect());
    let mut said = (Vec::new(), Problems::default());
    loop {
        let values: Vec<Vec<f64>> = (0..records.len()).map(|k| found.values_in(records, k)).collect();
        let fitted = FittedModel { model, values: &values, selected: &found.selected, noise: &s.noise };
        let current: Vec<&Record> = records.iter().map(|r| &r.record).collect();
        let changed =
            correction.round(&fitted, &current, policy == ClockPolicy::Require).map_err(|e| refusal(e, records))?;
        let now = lines(records, &correction);
        if changed.is_empty() {
            let (found, lines) = with_the_rest(found, now.0, records, s, fit);
            return Ok((found, lines, now.1));
        }
        let before = records.to_vec();
        for (k, corrected) in changed {
            records[k].record = corrected;
        }
        correction.found().iter().for_each(|c| records[c.record].resampled = c.corrected);
        let again = match fit(records, s) {
            Ok(again) if !again.result.status.is_interrupted() => again,
            // The fit before it has ended, and is that of the records as they were.
            ended => {
                records.clone_from_slice(&before);
                return ended.map(|_| (found, said.0, said.1));
            }
        };
        if again.result.chi2_per_dof > WORSE * found.result.chi2_per_dof {
            // Clocks that were wrong were not what the comparison took for them: nothing is corrected that is not wrong.
            records.clone_from_slice(&before);
            if policy == ClockPolicy::Require {
                said.1.push(not_corrected(&now.1, &found, &again));
            }
            return Ok((found, said.0, said.1));
        }
        (found, said) = (again, now);
    }
}

/// With what is left of delays that were corrected among the unknowns, where the tests of errors still see it: they tell a delay better than the comparison of
/// clocks does, and what that leaves is no error of the model.
fn with_the_rest(
    found: Identified,
    mut lines: Vec<ClockLine>,
    records: &[LabelledRecord],
    s: &Settings,
    fit: Refit<'_>,
) -> (Identified, Vec<ClockLine>) {
    let is_seen = |error: &str| found.result.evidence.as_ref().is_some_and(|e| e.named.iter().any(|n| n.name == error));
    let groups = [("torque", records.iter().any(|r| r.resampled.0)), ("gyro", records.iter().any(|r| r.resampled.1))];
    let corrected = groups.into_iter().filter(|g| g.1).map(|g| format!("{}-clock", g.0));
    let left: Vec<String> = corrected.filter(|error| is_seen(error) && !s.adopt.contains(error)).collect();
    if left.is_empty() {
        return (found, lines);
    }
    let settings = Settings { adopt: [&s.adopt[..], &left[..]].concat(), ..s.clone() };
    let is_better = |again: &Identified| {
        !again.result.status.is_interrupted() && again.result.chi2_per_dof <= WORSE * found.result.chi2_per_dof
    };
    // The fit before it has ended, whatever becomes of this one.
    let Some(again) = fit(records, &settings).ok().filter(is_better) else { return (found, lines) };
    for line in lines.iter_mut().filter(|l| l.corrected) {
        let delay = format!("{}.delay", line.group);
        let label = [line.record.clone()];
        let of_record = |p: &&Parameter| is_called(&p.name, &delay, &label);
        if let Some(rest) = again.result.nuisance.iter().find(of_record) {
            line.offset_s += rest.value;
            line.offset_std_s = rest.std.unwrap_or(line.offset_std_s);
        }
    }
    (again, lines)
}

/// A correction that was taken back, where clocks were asked for.
fn not_corrected(warned: &Problems, before: &Identified, after: &Identified) -> Problem {
    let of: Vec<&str> = warned.0.iter().filter_map(|p| p.object.as_deref()).collect();
    let what = format!(
        "clocks of {} seemed wrong, but with them put right chi-squared per degree of freedom is {:.3} in place of {:.3}; they were left as recorded",
        ff_model::diagnostics::list(of.into_iter(), 4),
        after.result.chi2_per_dof,
        before.result.chi2_per_dof
    );
    let hint = "look for another error first: what else explains the record is in its verdict";
    Problem::warning(Area::Data, "Data::ClockNotCorrected", what).hint(hint)
}

/// Clocks of all records as they were found, and a warning for each that was corrected.
fn lines(records: &[LabelledRecord], correction: &ClockCorrection) -> (Vec<ClockLine>, Problems) {
    let mut problems = Problems::default();
    let mut lines = Vec::new();
    for c in correction.found() {
        let CorrectedClocks { record, clocks, corrected, mut warnings } = c;
        let label = &records[record].label;
        lines.push(line(label, "torque", &clocks.torque, corrected.0));
        lines.push(line(label, "gyro", &clocks.gyro, corrected.1));
        warnings
            .0
            .iter_mut()
            .for_each(|p| p.object = Some(format!("{} of {label}", p.object.as_deref().unwrap_or(""))));
        problems.extend(warnings);
    }
    (lines, problems)
}

fn line(record: &str, group: &str, e: &ClockEstimate, corrected: bool) -> ClockLine {
    ClockLine {
        record: record.to_owned(),
        group: group.to_owned(),
        offset_s: e.offset,
        offset_std_s: e.offset_deviation,
        skew_ppm: 1e6 * e.skew,
        skew_std_ppm: 1e6 * e.skew_deviation,
        corrected,
    }
}

fn refusal(e: ClockCorrectionError, records: &[LabelledRecord]) -> IdentifyError {
    match e {
        ClockCorrectionError::NotEstimable { record, group, why } => {
            let p = Problem::error(Area::Data, "Data::ClockNotEstimable", format!("{group}: {why}"));
            let hint = "move the joints faster while recording, or take the clocks as they are: --clocks trust";
            IdentifyError::IllPosed(Problems(vec![p.on(&records[record].label).hint(hint)]))
        }
        ClockCorrectionError::Record(p) => IdentifyError::Refused(p),
    }
}
