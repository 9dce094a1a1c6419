//! Draws from the posterior in a result.

use ident::sample::{ChainSettings, Draws, ESS_LEAST, PARETO_K_MOST, R_HAT_MOST, Trajectories, Way, hdi, quantile};
use serde::{Deserialize, Serialize};

/// What became of the draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SampledState {
    /// Intervals can be trusted.
    Converged,
    /// Chains disagree, or are too short: there are no intervals.
    NotConverged,
    /// Ended from outside before they had converged.
    Interrupted,
    /// There is nothing to draw from.
    NotDrawn,
}

/// What draws from the posterior say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sampled {
    /// Whether its intervals can be trusted.
    pub state: SampledState,
    /// Why, in one line.
    pub reason: String,
    /// How it was drawn.
    pub sampler: String,
    /// Number of chains.
    pub chains: usize,
    /// Draws of each of them.
    pub draws: usize,
    /// Draws before them that tuned the steps.
    pub warm_up: usize,
    /// Seed of all randomness.
    pub seed: u64,
    /// Evaluations of residuals and their derivatives.
    pub evaluations: usize,
    /// Predictions of all rows that draws over fewer of them were weighed with; absent, as the two below, where chains went over all rows.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub predictions: Option<usize>,
    /// Shape of the tail of these weights, which are trusted below 0.7.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub pareto_k: Option<f64>,
    /// Number of draws with equal weights that they are worth.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub effective_weights: Option<f64>,
    /// Trajectories that met the edge of what is physical, or lost their energy; draws for which no solution was found.
    pub divergences: usize,
    /// The largest R-hat.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub r_hat: Option<f64>,
    /// The least effective sample size of the bulk.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ess_bulk: Option<f64>,
    /// The least effective sample size of the tails.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ess_tail: Option<f64>,
    /// The file of all draws.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub file: Option<String>,
    /// The parameters asked for.
    pub parameters: Vec<SampledLine>,
    /// What was drawn beside them: what the mission is not sure of, biases, initial state.
    pub beside: Vec<SampledLine>,
}

/// What draws say of one unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampledLine {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Rank-normalised split R-hat.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub r_hat: Option<f64>,
    /// Effective sample size of the bulk.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ess_bulk: Option<f64>,
    /// Effective sample size of the tails.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ess_tail: Option<f64>,
    /// Mean of the draws; absent, as all below, where chains have not converged.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mean: Option<f64>,
    /// Their standard deviation.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std: Option<f64>,
    /// Their median.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub median: Option<f64>,
    /// Their 2.5 % and 97.5 % quantiles.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub interval95: Option<(f64, f64)>,
    /// The shortest interval that holds 95 % of them.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub hdi95: Option<(f64, f64)>,
    /// Largest distance of an end of `interval95` from that of the fit, in its standard deviations.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub differs: Option<f64>,
}

impl Sampled {
    /// Name of the file of draws.
    pub const FILE: &str = "draws.parquet";
    /// Distance of the ends of intervals, in standard deviations of the fit, from which it is said that the fit's are not those of the
    /// posterior: four times the error of a 2.5 % quantile from 400 independent draws.
    pub const DIFFERS: f64 = 0.5;
    const SAMPLER: &str = "No-U-Turn sampler (nuts-rs 0.19), coordinates whitened by the fit";

    /// Where there is nothing to draw from.
    pub(in crate::workflow::identify) fn none(reason: String, s: &ChainSettings) -> Self {
        Self {
            state: SampledState::NotDrawn,
            reason,
            sampler: Self::SAMPLER.into(),
            chains: 0,
            draws: 0,
            warm_up: s.warm_up,
            seed: s.seed,
            evaluations: 0,
            predictions: None,
            pareto_k: None,
            effective_weights: None,
            divergences: 0,
            r_hat: None,
            ess_bulk: None,
            ess_tail: None,
            file: None,
            parameters: Vec::new(),
            beside: Vec::new(),
        }
    }
    /// Of draws; `of_fit` are value and standard deviation of each unknown at the fit, `asked` says which were asked for.
    pub(in crate::workflow::identify) fn of(
        d: &Draws,
        s: &ChainSettings,
        of_fit: &[(f64, Option<f64>)],
        asked: impl Fn(usize) -> bool,
    ) -> Self {
        let finite = |x: f64| Some(x).filter(|x| x.is_finite());
        let told: Vec<_> = (0..d.names.len()).map(|k| d.diagnosis(k)).collect();
        let worst = |of: fn(&ident::sample::Diagnosis) -> f64, greater: bool| {
            let all = || told.iter().map(of);
            if told.is_empty() || all().any(f64::is_nan) {
                None
            } else if greater {
                all().reduce(f64::max)
            } else {
                all().reduce(f64::min)
            }
        };
        let (r_hat, bulk, tail) =
            (worst(|t| t.r_hat, true), worst(|t| t.ess_bulk, false), worst(|t| t.ess_tail, false));
        let good = d.converged();
        let short = d.len() < s.draws;
        let figures = match (r_hat, bulk.zip(tail)) {
            (Some(r), Some((b, t))) => {
                format!("the largest R-hat is {r:.4}, the least effective sizes are {b:.0} (bulk) and {t:.0} (tails)")
            }
            _ => "there are too few draws, or chains that do not move".to_owned(),
        };
        let figures = match d.weighed.and_then(|w| w.pareto_k).filter(|_| !d.trusted()) {
            Some(k) => format!(
                "{figures}, the shape of the tail of the weights is {k:.2} (limit {PARETO_K_MOST}), {} draws have no solution",
                d.divergences
            ),
            None => figures,
        };
        let slowest = (0..told.len()).max_by(|&a, &b| told[a].r_hat.total_cmp(&told[b].r_hat)).map(|k| &d.names[k]);
        let slowest = slowest.map_or_else(String::new, |name| format!("; the slowest is {name}"));
        let limits = format!("limits are {R_HAT_MOST} and {ESS_LEAST:.0}{slowest}");
        let (state, reason) = match (good, short) {
            (true, _) => (SampledState::Converged, figures),
            (false, true) => (SampledState::Interrupted, format!("interrupted: {figures}; {limits}")),
            (false, false) => (SampledState::NotConverged, format!("{figures}; {limits}")),
        };
        let line = |k: usize| {
            let mut l = SampledLine {
                name: d.names[k].clone(),
                unit: d.units[k].clone(),
                r_hat: finite(told[k].r_hat),
                ess_bulk: finite(told[k].ess_bulk),
                ess_tail: finite(told[k].ess_tail),
                mean: None,
                std: None,
                median: None,
                interval95: None,
                hdi95: None,
                differs: None,
            };
            if good {
                let all = d.sorted(k);
                let n = all.len() as f64;
                let mean = all.iter().sum::<f64>() / n;
                let ends = (quantile(&all, 0.025), quantile(&all, 0.975));
                l.mean = Some(mean);
                l.std = Some((all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt());
                l.median = Some(quantile(&all, 0.5));
                l.interval95 = Some(ends);
                l.hdi95 = Some(hdi(&all, 0.95));
                l.differs = of_fit[k].1.filter(|s| *s > 0.0).map(|s| {
                    let value = of_fit[k].0;
                    let apart = |end: f64, sign: f64| (end - (value + sign * 1.96 * s)).abs() / s;
                    apart(ends.0, -1.0).max(apart(ends.1, 1.0))
                });
            }
            l
        };
        let (asked, beside): (Vec<usize>, Vec<usize>) = (0..d.names.len()).partition(|&k| asked(k));
        Self {
            state,
            reason,
            sampler: match (d.way, d.trajectories) {
                (Way::Solved, _) => "randomise, then optimise; weighed by all rows".into(),
                (way, t) => format!(
                    "{}, trajectories {}{}",
                    Self::SAMPLER,
                    if t == Trajectories::Short { "of one step" } else { "until they turn" },
                    if way == Way::FewerRows { ", over fewer rows, weighed by all" } else { "" }
                ),
            },
            chains: d.chains.len(),
            draws: d.len(),
            warm_up: if d.way == Way::Solved { 0 } else { s.warm_up },
            evaluations: d.evaluations,
            predictions: d.weighed.map(|_| d.predictions),
            pareto_k: d.weighed.and_then(|w| w.pareto_k),
            effective_weights: d.weighed.map(|w| w.effective),
            divergences: d.divergences,
            r_hat,
            ess_bulk: bulk,
            ess_tail: tail,
            file: (!d.is_empty()).then(|| Self::FILE.into()),
            parameters: asked.into_iter().map(line).collect(),
            beside: beside.into_iter().map(line).collect(),
            ..Self::none(String::new(), s)
        }
    }
    /// Parameters whose intervals are not those of the fit, the worst first.
    pub fn differing(&self) -> Vec<&SampledLine> {
        let by = |l: &SampledLine| l.differs.unwrap_or(0.0);
        let mut out: Vec<&SampledLine> = self.parameters.iter().filter(|l| by(l) > Self::DIFFERS).collect();
        out.sort_by(|a, b| by(b).total_cmp(&by(a)));
        out
    }
}
