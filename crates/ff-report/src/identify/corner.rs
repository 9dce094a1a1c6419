//! The corner plot of draws from the posterior.

use crate::plot::{Corner, Figure, typeset};
use ffid::workflow::identify::{IdentificationResult, SampledState};
use ident::sample::Draws;

/// Most quantities in it.
const MOST: usize = 6;

/// Draws of those parameters that differ most from the fit, in pairs, with the normal distribution of the fit; `None` for fewer than two
/// draws or parameters.
pub fn corner_figure(r: &IdentificationResult, d: &Draws) -> Option<(String, Figure)> {
    let s = r.sampled.as_ref()?;
    let by = |name: &str| s.parameters.iter().find(|l| l.name == name).map(|l| l.differs.unwrap_or(0.0));
    let mut shown: Vec<usize> = (0..d.names.len()).filter(|&k| by(&d.names[k]).is_some()).collect();
    shown.sort_by(|&a, &b| by(&d.names[b]).partial_cmp(&by(&d.names[a])).unwrap_or(core::cmp::Ordering::Equal));
    shown.truncate(MOST);
    shown.sort_unstable();
    let all = &r.covariance;
    let place = |k: usize| all.names.iter().position(|n| *n == d.names[k]);
    let at: Vec<usize> = shown.iter().filter_map(|&k| place(k)).collect();
    if shown.len() < 2 || at.len() < shown.len() || d.len() < 2 {
        return None;
    }
    let value = |k: &usize| r.parameters.iter().find(|p| p.name == d.names[*k]).map(|p| p.value);
    let corner = Corner {
        names: shown.iter().map(|&k| format!("{} ({})", d.names[k], typeset(&d.units[k]))).collect(),
        draws: shown.iter().map(|&k| d.of(k).concat()).collect(),
        centre: shown.iter().filter_map(value).collect(),
        covariance: at.iter().map(|&i| at.iter().map(|&j| all.rows[i][j]).collect()).collect(),
    };
    let which = if s.state == SampledState::Converged { "that differ most from the fit" } else { "that come first" };
    let caption = format!(
        "Blue: {} draws of the {} of {} parameters {which}. Orange: the normal distribution of the fit, and the \
         ellipses that hold 95 % of it.",
        d.len() * d.chains.len(),
        shown.len(),
        s.parameters.len()
    );
    let figure = Figure::new(format!("{}: draws from the posterior", r.robot)).caption(caption);
    Some(("corner".to_owned(), Figure { corner: Some(corner), ..figure }))
}
