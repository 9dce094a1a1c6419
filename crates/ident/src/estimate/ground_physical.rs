//! A ground calibration moved to the nearest physical bodies and dissipative friction.

use crate::estimate::ground::GroundEstimate;
use crate::solve::project::{ProjectError, ProjectOptions, project};
use ff_model::ParamDecl;

/// Friction terms that dissipate, and so cannot be negative: ends of their names.
const DISSIPATIVE: [&str; 2] = ["viscous", "coulomb"];

impl GroundEstimate {
    /// Moves estimates that no body or friction has to the nearest physical values, in the metric of the information: directions
    /// that the data do not determine move first ([`project()`]). Returns the names of what ends at the boundary; empty, and nothing
    /// moved, for an estimate that is physical already. `decls`, `selected` and `start` are those of the estimate. Allocates.
    ///
    /// # Errors
    /// [`ProjectError`].
    pub fn make_physical(
        &mut self,
        decls: &[ParamDecl],
        selected: &[usize],
        start: &[f64],
    ) -> Result<Vec<String>, ProjectError> {
        let dissipates = |name: &str| DISSIPATIVE.iter().any(|t| name.ends_with(t));
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
        self.friction.iter_mut().flatten().zip(&self.fit.extra).for_each(|(f, e)| *f = e.value);
        Ok(near.at_boundary)
    }
}
