//! A ground calibration moved to the nearest physical bodies and dissipative friction.

use super::GroundEstimate;
use crate::solve::project::{ProjectError, ProjectOptions, project};
use ff_model::ParamDecl;

/// Friction terms that dissipate, inertia: what cannot be negative, by the ends of their names.
const DISSIPATIVE: [&str; 4] = [".viscous", ".coulomb", ".inertia", ".load"];

/// A chi-square that one direction of the data exceeds in 5 % of the cases: below it they do not contradict what exists.
const PRESSED: f64 = 3.84;

impl GroundEstimate {
    /// Moves estimates that no body or friction has to the nearest physical values, in the metric of the information: directions
    /// that the data do not determine move first ([`project()`]). Returns the names of what ends at the boundary where the data press against it:
    /// where the projection costs a chi-square above 3.84. Most bodies of a fixed arm end there by directions that no log of it tells, at
    /// no cost: the nearest body that exists is always one on the boundary. Empty as well, and nothing moved, for an estimate that is physical already. `decls`, `selected` and `start` are those of the estimate. Allocates.
    ///
    /// # Errors
    /// [`ProjectError`].
    pub fn make_physical(
        &mut self,
        decls: &[ParamDecl],
        selected: &[usize],
        start: &[f64],
    ) -> Result<Vec<String>, ProjectError> {
        // Where friction falls from rest, or differs by direction, its parts may be negative while it dissipates.
        let beside = |name: &str| {
            let joint = name.rsplit_once('.').map_or(name, |n| n.0);
            let other = |n: &str| {
                n.strip_prefix(joint).is_some_and(|t| {
                    [".stribeck", ".asymmetry", ".quadratic", ".load"].iter().any(|o| t.starts_with(o))
                })
            };
            self.fit.extra.iter().any(|e| other(&e.name))
        };
        let alone: Vec<String> = self
            .fit
            .extra
            .iter()
            .filter(|e| {
                DISSIPATIVE.iter().any(|t| e.name.ends_with(t)) && (e.name.ends_with(".inertia") || !beside(&e.name))
            })
            .map(|e| e.name.clone())
            .collect();
        let dissipates = |name: &str| alone.iter().any(|a| a == name);
        let negative = self.fit.extra.iter().any(|e| dissipates(&e.name) && e.value < 0.0);
        if self.fit.unphysical.is_empty() && !negative {
            return Ok(Vec::new());
        }
        let near = project(&self.fit, decls, selected, start, dissipates, &ProjectOptions::default())?;
        self.fit.values = near.values;
        let m = selected.len();
        for (p, moved) in self.fit.parameters.iter_mut().zip(&near.unknowns[..m]) {
            p.value = moved.to;
        }
        for (p, moved) in self.fit.extra.iter_mut().zip(&near.unknowns[m..]) {
            p.value = moved.to;
        }
        self.take_terms();
        Ok(if near.chi2_increase > PRESSED { near.at_boundary } else { Vec::new() })
    }
}
