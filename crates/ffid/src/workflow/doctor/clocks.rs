//! Clocks of torques and gyro against that of the encoders (rows D15 and D16), at the values of a quick fit.
//!
//! What is to be estimated is uncertain, and bends the offset; so it has to be clear.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::quick_fit::QuickFit;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Params, Problem};
use ff_records::clock::ClockEstimate;
use ident::checks::{estimate_clocks, longest_delay};
use ident::parameters::sizes;

/// Uncertainty of the values, relative to their size.
const UNCERTAIN: f64 = 0.1;
/// Samples, and standard deviations, that an offset or drift must exceed.
const SAMPLES: f64 = 1.0;
const SURE: f64 = 6.0;

pub(super) fn findings(case: &Case<'_>, fit: &QuickFit) -> Vec<Finding> {
    let (model, r) = (case.model, case.record);
    let params = Params::from_values(model, fit.values.clone());
    let all = sizes(&model.param_decls(), params.values());
    let uncertain: Vec<(usize, f64)> = case.estimated.iter().map(|&i| (i, UNCERTAIN * all[i])).collect();
    let found = match estimate_clocks(model, &params, r, &case.settings.noise, &uncertain, longest_delay(r)) {
        Ok(c) => c,
        Err(e) => {
            return vec![case.finding(Topic::Clocks, Judgement::Good, format!("not to be told from this record: {e}"))];
        }
    };
    vec![line(case, "tau", &found.torque), line(case, "gyro", &found.gyro)]
}

fn line(case: &Case<'_>, group: &str, e: &ClockEstimate) -> Finding {
    let dt = case.record.dt();
    let drift = e.skew * case.record.seconds();
    let drift_std = e.skew_deviation * case.record.seconds();
    let clear = |x: f64, std: f64| x.abs() > SAMPLES * dt && x.abs() > SURE * std;
    let ms = 1e3;
    let text = format!(
        "{group}: {:.3} +- {:.3} ms later than the positions, drifting by {:.3} +- {:.3} ms over the record",
        ms * e.offset,
        ms * e.offset_deviation,
        ms * drift,
        ms * drift_std
    );
    let late = clear(e.offset, e.offset_deviation);
    if !late && !clear(drift, drift_std) {
        return case.finding(Topic::Clocks, Judgement::Good, text).on(group).figures(e.offset, 0.0, "s");
    }
    let code = if late { "Data::ClockOffset" } else { "Data::ClockSkew" };
    let value = if late { e.offset } else { drift };
    let p = Problem::warning(Area::Data, code, text.clone())
        .on(group)
        .violating(value.abs(), Limit::AtMost(SAMPLES * dt), "s")
        .hint("ffid identify puts it right where nothing else explains the record; synchronise the recorder");
    case.finding(Topic::Clocks, Judgement::Suspicious, text).on(group).figures(value, 0.0, "s").raising(p)
}
