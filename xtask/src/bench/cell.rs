//! One measured function of one model, beside the peers' figures.

use super::aggregate::Spread;
use super::build::Target;

/// One measured function.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// `rigid`, `flex` or `slosh`.
    pub model: String,
    /// Name with the suffix of its lanes: `rnea`, `rnea.x8`.
    pub function: String,
    /// `ports` or `tree`.
    pub form: String,
    /// For which processor we were compiled.
    pub target: Target,
    /// Ours (ns per state).
    pub ours: Spread,
    /// The best Pinocchio (ns), if measured.
    pub pinocchio: Option<Spread>,
    /// MuJoCo (ns), if measured.
    pub mujoco: Option<Spread>,
}

impl Cell {
    /// Function without lanes, and whether it had any.
    pub fn plain(&self) -> (&str, bool) {
        split_lanes(&self.function)
    }
    /// Ours over the best Pinocchio.
    pub fn ratio(&self) -> Option<f64> {
        self.pinocchio.map(|p| self.ours.median / p.median)
    }
}

/// `rnea.x8` into `("rnea", true)`; `rnea.x1` is one state, too.
pub fn split_lanes(function: &str) -> (&str, bool) {
    match function.rsplit_once(".x").map(|(plain, lanes)| (plain, lanes.parse::<u32>())) {
        Some((plain, Ok(lanes))) => (plain, lanes > 1),
        _ => (function, false),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_told_from_names() {
        assert_eq!(split_lanes("rnea.x8"), ("rnea", true));
        assert_eq!(split_lanes("rnea.x1"), ("rnea", false));
        assert_eq!(split_lanes("id_derivatives"), ("id_derivatives", false));
        assert_eq!(split_lanes("odd.xy"), ("odd.xy", false));
    }
}
