//! What a log hardly tells stays near where the mission has it.
//!
//! A joint that hardly leaves one pose has an offset that looks like gravity: least squares gives both any values, which cancel in this log
//! and in no other. With the scaled triangle `R diag(s) = U diag(w) V^T`, of rows whitened by what is left of each joint, the direction `v_k` has the
//! deviation `1 / w_k`, in sizes of its unknowns, and the mean under a prior of `b` = 2 sizes about the start `x0` is
//!
//! ```text
//! x - sum_k 1 / (1 + b^2 w_k^2) diag(s) v_k v_k^T diag(s)^-1 (x - x0)
//! ```
//!
//! What the log tells to a tenth of its size moves by a four-hundredth of its distance from the start. Deviations stay those of the data. The size
//! of what the log tells is what it says, where that is larger than the mission has it, and the moments of a body are as large as its mass and its
//! centre of mass make them: a tool of 2.8 kg that the mission takes for one of 1 kg.

use super::GroundEstimate;
use crate::estimate::outcome::{Estimated, RANK_TOLERANCE};
use crate::solve::linear::{LinearEstimate, unphysical};
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::{DMatrix, DVector};

/// Deviation of the prior, in sizes of the unknowns.
const WIDTH: f64 = 2.0;
/// Deviations that a value is from zero where the data tell its size.
const TOLD: f64 = 3.0;

impl GroundEstimate {
    /// Moves what the data tell worse than to its own size towards the start of the fit (for friction, what the robot's file says, or
    /// zero), and leaves deviations as they are. The triangle gets the rows of that prior, so that [`GroundEstimate::make_physical`], which comes
    /// after, keeps to it. `decls` and `selected` are those of the estimate. Allocates.
    ///
    /// # Errors
    /// [`LinalgError`].
    pub fn lean_on_start(&mut self, decls: &[ParamDecl], selected: &[usize]) -> Result<(), LinalgError> {
        let fit = &mut self.fit;
        let sizes = sizes(decls, selected, fit);
        let (n, m) = (sizes.len(), fit.equations.r.nrows());
        let mut scaled = fit.equations.r.clone();
        scaled.column_iter_mut().zip(&sizes).for_each(|(mut c, s)| c.scale_mut(*s));
        let svd = linalg::svd(&scaled)?;
        let all = fit.parameters.iter().chain(&fit.extra);
        let from = DVector::from_iterator(n, all.zip(&sizes).map(|(p, s)| (p.value - p.start) / s));
        let told = svd.rank(RANK_TOLERANCE);
        let (mut moved, mut rows) = (DVector::zeros(n), DMatrix::zeros(m + told, n));
        rows.rows_mut(0, m).copy_from(&fit.equations.r);
        for k in 0..told {
            let v = svd.v.column(k);
            moved.axpy(-v.dot(&from) / (1.0 + (WIDTH * svd.s[k]).powi(2)), &v, 1.0);
            let mut row = rows.row_mut(m + k);
            row.iter_mut().zip(v.iter().zip(&sizes)).for_each(|(to, (v, s))| *to = v / (WIDTH * s));
        }
        fit.equations.r = linalg::qr_r(&rows)?;
        let all = fit.parameters.iter_mut().chain(&mut fit.extra);
        all.zip(moved.iter().zip(&sizes)).for_each(|(p, (d, s))| p.value += d * s);
        selected.iter().zip(&fit.parameters).for_each(|(&i, p)| fit.values[i] = p.value);
        fit.unphysical = unphysical(decls, selected, &fit.values);
        let all = || fit.parameters.iter().chain(&fit.extra);
        let value = |name: &String| all().find(|p| p.name == *name).map_or(0.0, |p| p.value);
        for b in &mut fit.base {
            b.value = b.terms.iter().map(|(name, by)| by * value(name)).sum();
        }
        self.take_terms();
        Ok(())
    }
    /// Coefficients of joints and gains as the fit has them.
    pub(super) fn take_terms(&mut self) {
        let terms = self.joints.terms.iter_mut().flatten().map(|t| &mut t.1);
        terms.chain(self.joints.gains.iter_mut().flatten()).zip(&self.fit.extra).for_each(|(x, e)| *x = e.value);
    }
}

/// Sizes of the unknowns: those of the mission, or larger where the data tell so.
fn sizes(decls: &[ParamDecl], selected: &[usize], fit: &LinearEstimate) -> Vec<f64> {
    let told = |p: &Estimated| if p.std.is_some_and(|s| p.value.abs() > TOLD * s) { p.value.abs() } else { 0.0 };
    let both = fit.uncertainty.unknowns.iter().zip(fit.parameters.iter().chain(&fit.extra));
    let mut sizes: Vec<f64> = both.map(|(u, p)| u.size.max(told(p))).collect();
    // Where the ten numbers of its body begin, and which of them a parameter is: mass, first moments, moments of inertia.
    let place = |k: usize| {
        let group = &decls[selected[k]].group;
        let of_body = matches!(group, ParamGroup::Inertial(_));
        let first = decls.iter().position(|d| of_body && d.group == *group)?;
        Some((first, selected[k] - first))
    };
    let places: Vec<_> = (0..selected.len()).map(place).collect();
    for (k, of) in places.iter().enumerate() {
        let Some((body, 0)) = *of else { continue };
        let mass = told(&fit.parameters[k]);
        let own = |j: usize| places[j].filter(|p| p.0 == body).map(|p| p.1);
        let moment = (0..places.len()).filter(|&j| own(j).is_some_and(|n| (1..4).contains(&n)));
        let moment = moment.map(|j| told(&fit.parameters[j])).fold(0.0, f64::max);
        for j in 0..places.len() {
            let least = match own(j) {
                Some(1..4) => moment,
                Some(4..) if mass > 0.0 => moment * moment / mass,
                _ => 0.0,
            };
            sizes[j] = sizes[j].max(least);
        }
    }
    sizes
}
