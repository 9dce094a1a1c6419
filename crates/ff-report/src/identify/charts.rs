//! Charts of a result that have no curves: intervals on one scale, correlations, where the variance comes from.

use crate::plot::{Figure, Heat, Interval, Intervals, Panel};
use ffid::workflow::identify::IdentificationResult;

/// Width of what was known before, where there is no prior: this part of the start.
const NO_PRIOR: f64 = 0.3;
/// Ends of the scale of intervals, in widths of what was known before.
const SCALE: f64 = 3.2;
/// Colour of what is true.
const TRUTH: usize = 1;
/// Most kinds of error with a colour of their own.
const KINDS: usize = 6;
/// Most unknowns in a matrix of correlations.
const CORRELATED: usize = 24;

/// Estimates, priors and, where it is known, the truth of all parameters on one scale: distances from what was known before, in its standard deviations. `None` without
/// any.
pub(super) fn intervals(r: &IdentificationResult) -> Option<Figure> {
    let mut without = false;
    let rows: Vec<(String, Vec<Interval>)> = r
        .parameters
        .iter()
        .filter_map(|p| {
            let prior = p.prior_mean.zip(p.prior_std).filter(|(_, s)| *s > 0.0);
            let (centre, width) = prior.unwrap_or((p.start, NO_PRIOR * p.start.abs()));
            let of = |x: f64| (x - centre) / width;
            if width <= 0.0 || !of(p.value).is_finite() {
                return None;
            }
            without |= prior.is_none();
            let mut all = Vec::new();
            if prior.is_some() {
                all.push(Interval { low: -1.96, high: 1.96, at: None, colour: 6, wide: true });
            }
            let (low, high) = p.interval95.map_or((of(p.value), of(p.value)), |(a, b)| (of(a), of(b)));
            all.push(Interval { low, high, at: Some(of(p.value)), colour: 0, wide: false });
            if let Some(truth) = p.truth.map(of).filter(|t| t.is_finite()) {
                all.push(Interval { low: truth, high: truth, at: Some(truth), colour: TRUTH, wide: false });
            }
            Some((p.name.clone(), all))
        })
        .collect();
    if rows.is_empty() {
        return None;
    }
    let note = if without { " Where there is no prior, 30 % of the start takes its place." } else { "" };
    // Only what is drawn.
    let mut legend = Vec::new();
    legend.extend(rows.iter().flat_map(|r| &r.1).any(|i| i.wide).then(|| ("prior, 95 %".into(), 6)));
    legend.push(("estimate with its 95 % interval".into(), 0));
    legend.extend(r.parameters.iter().any(|p| p.truth.is_some()).then(|| ("truth".into(), TRUTH)));
    let intervals = Intervals {
        x_label: "distance from what was known before, in its standard deviations".into(),
        x_range: Some((-SCALE, SCALE)),
        legend,
        marks: vec![0.0],
        rows,
        ..Intervals::default()
    };
    let caption = format!(
        "A short bar: the record tells much more than was known. Arrows point to what lies off the scale.{note}"
    );
    Some(Figure::new("What the record adds to what was known").intervals(intervals).caption(caption))
}

/// Correlations of the estimates; of the most correlated where there are many. `None` for fewer than two.
pub(super) fn correlations(r: &IdentificationResult) -> Option<Figure> {
    let c = &r.covariance;
    let asked = |name: &String| r.parameters.iter().any(|p| p.name == *name);
    let spread = |k: usize| c.rows.get(k).and_then(|row| row.get(k)).copied().filter(|v| *v > 0.0 && v.is_finite());
    let mut shown: Vec<usize> = (0..c.names.len()).filter(|&k| asked(&c.names[k]) && spread(k).is_some()).collect();
    let of = |i: usize, j: usize| match (spread(i), spread(j)) {
        (Some(a), Some(b)) => (c.rows[i][j] / (a * b).sqrt()).clamp(-1.0, 1.0),
        _ => 0.0,
    };
    let all = shown.len();
    if all > CORRELATED {
        let most = |i: usize| shown.iter().filter(|&&j| j != i).map(|&j| of(i, j).abs()).fold(0.0, f64::max);
        let mut ranked: Vec<(usize, f64)> = shown.iter().map(|&i| (i, most(i))).collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        shown = ranked.iter().take(CORRELATED).map(|r| r.0).collect();
        shown.sort_unstable();
    }
    if shown.len() < 2 {
        return None;
    }
    let heat = Heat {
        names: shown.iter().map(|&k| c.names[k].clone()).collect(),
        rows: shown.iter().map(|&i| shown.iter().map(|&j| of(i, j)).collect()).collect(),
    };
    let more =
        if all > shown.len() { format!(" The {} most correlated of {all}.", shown.len()) } else { String::new() };
    let caption = format!(
        "Estimates with a correlation near 1 or -1 can hardly be told apart: the record sees their sum or difference.{more}"
    );
    Some(Figure::new("Correlations of the estimates").heat(heat).caption(caption))
}

/// What was minimised at every linearisation that led to the estimates. `None` for fewer than two, as of linear fits.
pub(super) fn descent(r: &IdentificationResult) -> Option<Figure> {
    let steps = &r.descent;
    if steps.len() < 2 || steps.iter().any(|s| !(s.cost > 0.0 && s.cost.is_finite())) {
        return None;
    }
    let all = steps.iter().map(|s| s.residuals).max().unwrap_or(0);
    let numbered = || steps.iter().enumerate().map(|(i, s)| (i as f64, s));
    let of = |whole: bool| -> (Vec<f64>, Vec<f64>) {
        numbered().filter(|(_, s)| (s.residuals == all) == whole).map(|(i, s)| (i, s.cost)).unzip()
    };
    let ((i, cost), (thin_i, thin_cost)) = (of(true), of(false));
    let mut panel = Panel::log_y("linearisation", "cost per residual").curve("all data", &i, &cost);
    if !thin_i.is_empty() {
        panel = panel.curve("fewer data, on the way", &thin_i, &thin_cost);
    }
    let caption = "What the fit minimised (squared residuals over the noise, and priors), per residual: 1 is the noise of the sensors.";
    Some(Figure::new("How the fit came down").panel(panel).caption(caption))
}

/// Parts of the variance of every estimate. `None` where nothing is uncertain.
pub(super) fn budget(r: &IdentificationResult) -> Option<Figure> {
    let mut kinds: Vec<(&'static str, f64)> = Vec::new();
    for share in r.budget.iter().flat_map(|b| &b.errors).filter(|s| s.share >= 0.01) {
        match kinds.iter_mut().find(|k| k.0 == share.kind.words()) {
            Some(k) => k.1 += share.share,
            None => kinds.push((share.kind.words(), share.share)),
        }
    }
    if r.budget.is_empty() || kinds.is_empty() {
        return None;
    }
    // There are colours for so many; the least of more are one.
    kinds.sort_by(|a, b| b.1.total_cmp(&a.1));
    let few = kinds.len() <= KINDS;
    kinds.truncate(if few { KINDS } else { KINDS - 1 });
    let others = (!few).then_some(KINDS);
    let colour = |kind: &str| kinds.iter().position(|k| k.0 == kind).map(|k| k + 1).or(others);
    let row = |b: &ffid::workflow::identify::BudgetLine| {
        let mut parts = vec![(0, b.noise)];
        parts.extend((b.minima > 0.0).then_some((1 + KINDS, b.minima)));
        let mut of: Vec<(usize, f64)> = Vec::new();
        for (k, share) in b.errors.iter().filter_map(|s| Some((colour(s.kind.words())?, s.share))) {
            match of.iter_mut().find(|o| o.0 == k) {
                Some(o) => o.1 += share,
                None => of.push((k, share)),
            }
        }
        of.sort_by_key(|o| o.0);
        parts.extend(of);
        let mut from = 0.0;
        let bars = parts.into_iter().map(|(colour, share)| {
            let low = 100.0 * from;
            from += share;
            Interval { low, high: 100.0 * from, at: None, colour, wide: true }
        });
        (b.name.clone(), bars.collect())
    };
    let intervals = Intervals {
        x_label: "part of the variance (%)".into(),
        x_range: Some((0.0, 100.0)),
        legend: core::iter::once(("noise", 0))
            .chain(kinds.iter().enumerate().map(|(i, k)| (k.0, 1 + i)))
            .chain(others.map(|k| ("everything else", k)))
            .chain(r.budget.iter().any(|b| b.minima > 0.0).then_some(("other minima", 1 + KINDS)))
            .map(|(n, k)| (n.to_owned(), k))
            .collect(),
        rows: r.budget.iter().map(row).collect(),
        ..Intervals::default()
    };
    Some(Figure::new("Where the variance of each estimate comes from").intervals(intervals))
}
