//! Several rounds of one figure into median and spread.

/// Figures of one function over the rounds, in the unit of the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Median over the rounds of the medians within a round.
    pub median: f64,
    /// Smallest value of any repetition.
    pub min: f64,
    /// Largest value of any repetition.
    pub max: f64,
}

impl Spread {
    /// From `(median, min, max)` of each round; `None` without rounds.
    pub fn of(rounds: &[(f64, f64, f64)]) -> Option<Self> {
        let mut medians: Vec<f64> = rounds.iter().map(|r| r.0).collect();
        medians.sort_by(f64::total_cmp);
        let n = medians.len();
        // The mean of the middle two for an even number.
        let median = if n == 0 { return None } else { 0.5 * (medians[(n - 1) / 2] + medians[n / 2]) };
        let min = rounds.iter().fold(f64::INFINITY, |m, r| m.min(r.1));
        let max = rounds.iter().fold(f64::NEG_INFINITY, |m, r| m.max(r.2));
        Some(Self { median, min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_disturbed_round_does_not_move_the_median() {
        let s = Spread::of(&[(838.0, 832.0, 851.0), (2100.0, 840.0, 5200.0), (842.0, 835.0, 860.0)]).unwrap();
        assert_eq!(s, Spread { median: 842.0, min: 832.0, max: 5200.0 });
        assert_eq!(Spread::of(&[(3.0, 2.0, 9.0), (5.0, 4.0, 6.0)]).unwrap().median, 4.0);
        assert!(Spread::of(&[]).is_none());
    }
}
