//! Quadratic subproblem of an iterate, with one elastic variable for all constraints.

use crate::solve::qp;
use crate::solve::qp::{Inequality, Minimum};
use crate::solve::sqp::state::{AIM, SearchState};
use nalgebra::{DMatrix, DVector};

/// The penalty grows up to this many times the size of the cost.
pub(crate) const PENALTY: f64 = 1e8;

/// A step of the subproblem.
pub(crate) struct Step {
    /// Step over scaled variables.
    pub(crate) d: DVector<f64>,
    /// Elastic variable: the violation that is left.
    pub(crate) s: f64,
    /// Multipliers of the constraints.
    pub(crate) z: Vec<f64>,
    /// Multipliers of the joint limits.
    pub(crate) joints: Vec<f64>,
}

/// A step with what it promises for the merit function.
pub(crate) struct Direction {
    pub(crate) step: Step,
    /// Predicted decrease of the merit function.
    pub(crate) predicted: f64,
    /// Bound of the slope of the merit function along the step; negative.
    pub(crate) slope: f64,
}

impl SearchState<'_, '_> {
    /// Solves the subproblem; `shift` replaces the rows by those of a second-order correction.
    pub(crate) fn subproblem(&self, linear: &[Inequality], shift: Option<&[f64]>) -> Option<Step> {
        let n = self.at.x.len();
        let indices: Vec<usize> = (0..self.at.c.len()).filter(|&i| self.differentiated[i]).collect();
        let elastic = usize::from(!indices.is_empty());
        let mut rows: Vec<Inequality> =
            linear.iter().map(|r| Inequality { columns: r.columns.clone(), bound: r.bound }).collect();
        let mut h = DMatrix::zeros(n + elastic, n + elastic);
        h.view_mut((0, 0), (n, n)).copy_from(&self.h);
        let mut g = self.at.g.as_slice().to_vec();
        if elastic == 1 {
            g.push(self.mu);
            rows.push(Inequality { columns: vec![(n, -1.0)], bound: 0.0 });
            for &i in &indices {
                let mut columns: Vec<(usize, f64)> =
                    self.at.j.row(i).iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(c, v)| (c, *v)).collect();
                columns.push((n, -1.0));
                rows.push(Inequality { columns, bound: -shift.map_or(self.at.c[i], |s| s[i]) - AIM });
            }
        }
        let Minimum { z: d, multipliers } = qp::solve(&h, &g, &rows).ok()?;
        let mut z = vec![0.0; self.at.c.len()];
        for (&i, m) in indices.iter().zip(&multipliers[linear.len() + elastic..]) {
            z[i] = m.max(0.0);
        }
        let s = if elastic == 1 { d[n].max(0.0) } else { 0.0 };
        let joints = multipliers[..linear.len()].to_vec();
        Some(Step { d: DVector::from_column_slice(&d[..n]), s, z, joints })
    }
    /// The next step; raises the penalty until it exceeds the multipliers and the step reduces a violation.
    pub(crate) fn direction(&mut self, rows: &[Inequality]) -> Option<Direction> {
        let v = Self::violation(&self.at.c);
        loop {
            let step = self.subproblem(rows, None)?;
            let most = PENALTY * (1.0 + self.at.f.abs());
            if self.with_cost && v > 0.0 && step.s > 0.5 * v && self.mu < most {
                self.mu *= 10.0;
                continue;
            }
            let sum: f64 = step.z.iter().sum();
            if self.with_cost && 1.5 * sum > self.mu {
                self.mu = 2.0 * sum;
            }
            let slope = self.at.g.dot(&step.d) - self.mu * (v - step.s);
            let predicted = -(slope + 0.5 * step.d.dot(&(&self.h * &step.d)));
            return Some(Direction { step, predicted, slope });
        }
    }
}
