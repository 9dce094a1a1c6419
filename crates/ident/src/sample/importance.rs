//! Draws from a density next to the one that is wanted, made draws from that one by their weights.
//!
//! A draw of `q` stands for `w = p / q` draws of `p`. Whether weights can be trusted is told by the shape `k` of the generalised Pareto
//! distribution that their largest follow: below 0.7 their mean converges fast enough (A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, *Pareto
//! smoothed importance sampling*, JMLR 25, 2024). The shape is that of J. Zhang, M. Stephens (Technometrics 51(3), 2009), drawn
//! towards a half as the former do.

/// Largest shape of the tail of weights that are trusted.
pub const PARETO_K_MOST: f64 = 0.7;
/// Fewest weights in a tail that a shape is told from.
const TAIL_LEAST: usize = 5;
/// Weights that a prior of a half on the shape counts for.
const SHAPE_PRIOR: f64 = 10.0;

/// Weights of draws, relative to the largest.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// One for each draw, not negative.
    pub values: Vec<f64>,
    /// Shape of their tail; none where there is none: too few of them, or all alike.
    pub pareto_k: Option<f64>,
}

impl Weights {
    /// Of logarithms of weights, minus infinity for none; the largest are replaced by the quantiles of the tail that is fitted to them. All
    /// zero where there is no weight. Allocates.
    pub fn new(logarithms: &[f64]) -> Self {
        let top = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut values: Vec<f64> =
            logarithms.iter().map(|l| if top.is_finite() { (l - top).exp() } else { 0.0 }).collect();
        let n = values.len();
        let tail = (n as f64 / 5.0).min(3.0 * (n as f64).sqrt()).ceil() as usize;
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let first = n - tail.min(n);
        if tail < TAIL_LEAST || first == 0 {
            return Self { values, pareto_k: None };
        }
        let cut = values[order[first - 1]];
        let above: Vec<f64> = order[first..].iter().map(|&i| values[i] - cut).collect();
        let Some((k, sigma)) = pareto(&above) else { return Self { values, pareto_k: None } };
        for (i, &at) in order[first..].iter().enumerate() {
            let part = (i as f64 + 0.5) / tail as f64;
            values[at] = (cut + pareto_quantile(part, k, sigma)).min(1.0);
        }
        Self { values, pareto_k: Some(k) }
    }
    /// Number of draws that as many independent ones with equal weights would be worth: `(sum w)^2 / sum w^2`.
    pub fn effective(&self) -> f64 {
        let (sum, squares) = self.values.iter().fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
        if squares > 0.0 { sum * sum / squares } else { 0.0 }
    }
}

/// Which draws stand for `p`, in their order, as many as there are weights: each as often as its weight says, to the next whole number
/// (systematic resampling from the middle of the first interval). None where there is no weight.
pub fn resampled(weights: &[f64]) -> Vec<usize> {
    let (n, sum) = (weights.len(), weights.iter().sum::<f64>());
    if sum.is_nan() || sum <= 0.0 {
        return Vec::new();
    }
    let mut out = Vec::with_capacity(n);
    let mut so_far = 0.0;
    for (i, w) in weights.iter().enumerate() {
        so_far += w / sum * n as f64;
        while out.len() < n && out.len() as f64 + 0.5 <= so_far {
            out.push(i);
        }
    }
    // Rounding of the sum may leave the last one out.
    let last = weights.iter().rposition(|w| *w > 0.0).unwrap_or(0);
    out.resize(n, last);
    out
}

/// Shape and scale of a generalised Pareto distribution, from values above its start in ascending order; none where they do not differ.
///
/// With `F(x) = 1 - (1 - b x)^(-1/k)` and `k(b) = mean ln(1 - b x)`, `b` is the mean over its profile likelihood, over a grid of values
/// that the largest and the first quarter of the data set the size of (Zhang and Stephens, equations 4 to 9; the sign of `k` is that of Vehtari et al.).
fn pareto(x: &[f64]) -> Option<(f64, f64)> {
    let (n, &most) = (x.len(), x.last()?);
    let quarter = x[((n as f64 / 4.0 + 0.5) as usize).max(1) - 1];
    if most <= f64::EPSILON || quarter <= 0.0 {
        return None;
    }
    let grid = 30 + (n as f64).sqrt() as usize;
    let shape = |b: f64| x.iter().map(|x| (-b * x).ln_1p()).sum::<f64>() / n as f64;
    let place = |i: usize| 1.0 / most + (1.0 - (grid as f64 / (i as f64 + 0.5)).sqrt()) / (3.0 * quarter);
    let likelihood = |b: f64| {
        let k = shape(b);
        (b, n as f64 * ((-b / k).ln() - k - 1.0))
    };
    let all: Vec<(f64, f64)> = (0..grid).map(|i| likelihood(place(i))).filter(|(_, l)| l.is_finite()).collect();
    let best = all.iter().map(|a| a.1).fold(f64::NEG_INFINITY, f64::max);
    let (sum, total) = all.iter().fold((0.0, 0.0), |(s, t), (b, l)| (s + b * (l - best).exp(), t + (l - best).exp()));
    let b = sum / total;
    let k = shape(b);
    let sigma = -k / b;
    let k = (n as f64 * k + 0.5 * SHAPE_PRIOR) / (n as f64 + SHAPE_PRIOR);
    (k.is_finite() && sigma.is_finite()).then_some((k, sigma))
}

fn pareto_quantile(part: f64, k: f64, sigma: f64) -> f64 {
    let l = -(-part).ln_1p();
    if k.abs() < 1e-12 { sigma * l } else { sigma * (k * l).exp_m1() / k }
}
