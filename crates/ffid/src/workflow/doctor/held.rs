//! Readings that are held until the next one, as what the user is told.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::sampling::{HELD, Sampled};
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem};

/// Warnings of readings that are held.
pub(super) fn findings(case: &Case<'_>) -> Vec<Finding> {
    let one = |on: &'static str, of: &Sampled| {
        let samples = of.held?;
        let rate = case.record.rate_hz();
        let text = format!(
            "{on}: every reading stands for {samples:.2} samples: a sensor of {:.4} Hz on a clock of {rate:.4} Hz, later by {:.3} ms on average",
            rate / samples,
            500.0 * (samples - 1.0) / rate
        );
        let p = Problem::warning(Area::Data, "Data::HeldReadings", text.clone())
            .on(on)
            .violating(samples, Limit::AtMost(HELD), "samples")
            .hint(
                "leave the cells of repeated readings empty (docs/records.md): a fit takes each repeat for a reading",
            );
        Some(case.finding(Topic::Sensors, Judgement::Suspicious, text).on(on).figures(samples, 1.0, "").raising(p))
    };
    [one("tau", &case.torque), one("gyro", &case.gyro)].into_iter().flatten().collect()
}
