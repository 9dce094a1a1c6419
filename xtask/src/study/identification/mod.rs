//! Studies of what is identified: `recovery`, `convergence`, `coverage`, `combined`, `posterior`.
mod beam;
mod case;
pub mod combined;
pub mod convergence;
pub mod coverage;
pub mod posterior;
pub mod recovery;
mod shaken;

use case::Case;
use ff_least_squares::Settings;
use ff_records::Record;
use ident;
use ident::compose::{Accept, Pass, estimate_staged};
use ident::{OutputError, Request};

/// When a fit of these studies stops.
fn settings() -> Settings {
    Settings { max_iterations: 100, decrement_tolerance: 1e-10, cost_floor: 1e-13, ..Settings::default() }
}

/// Beginnings of a record that are fitted first, so that no mode slips a cycle (s).
const BEGINNINGS_S: [f64; 2] = [10.0, 20.0];

/// Output error over beginnings of the record, under a prior of 30 % around the start, then over the whole as requested. The
/// iterations are those of all.
fn fit(
    case: &Case,
    record: &Record,
    options: &ident::Options,
    request: &Request<'_>,
) -> anyhow::Result<ident::estimate::Estimate> {
    let cut: Vec<Record> = BEGINNINGS_S.iter().map(|s| record.window(0.0, *s)).collect::<Result<_, _>>()?;
    let mut parts: Vec<OutputError<'_>> =
        cut.iter().map(|r| OutputError::new(&case.model, r, options)).collect::<Result<_, _>>()?;
    let near = Request {
        centre: Some(request.start),
        prior_width: Some(request.prior_width.unwrap_or(0.3)),
        anchor: None,
        settings: Settings { max_iterations: 15, decrement_tolerance: 1e-4, ..request.settings.clone() },
        ..request.clone()
    };
    let mut coarse: Vec<Pass<'_, '_>> =
        parts.iter_mut().map(|e| Pass { request: near.clone(), estimator: e }).collect();
    let mut whole = OutputError::new(&case.model, record, options)?;
    let request = Request { centre: Some(request.start), ..request.clone() };
    let mut fine = Pass { request: request.clone(), estimator: &mut whole };
    // One start: whatever it leads to is the answer, and is judged by the study.
    let any = Accept { coarse: f64::INFINITY, fine: f64::INFINITY, agree: 1 };
    let staged = estimate_staged(&mut coarse, &mut fine, &[request.start.to_vec()], any)?;
    let mut e = staged.estimate;
    e.iterations += staged.trials.iter().map(|t| t.iterations).sum::<usize>();
    Ok(e)
}
