//! How a fit steps and when it stops.

/// How the trust region measures a step.
///
/// ```
/// # use ff_least_squares::{EvalError, Problem};
/// # /// `y = 3 exp(-0.7 t)` at four times, fitted by `x0 exp(-x1 t)`.
/// # struct Decay;
/// # impl Problem for Decay {
/// #     fn dim(&self) -> usize { 2 }
/// #     fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
/// #         *r = [0.3, 0.9, 1.7, 2.6].map(|t: f64| x[0] * (-x[1] * t).exp() - 3.0 * (-0.7 * t).exp()).to_vec();
/// #         Ok(())
/// #     }
/// #     fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut nalgebra::DMatrix<f64>) -> Result<(), EvalError> {
/// #         let e = [0.3, 0.9, 1.7, 2.6].map(|t: f64| (t, (-x[1] * t).exp()));
/// #         *j = nalgebra::DMatrix::from_fn(4, 2, |i, k| if k == 0 { e[i].1 } else { -x[0] * e[i].0 * e[i].1 });
/// #         self.residuals(x, r)
/// #     }
/// # }
/// use ff_least_squares::{Scale, Settings, minimise};
///
/// // Both ways of measuring a step lead to the same minimum.
/// let settings = |scale| Settings { scale, ..Settings::default() };
/// let [columns, unit] = [Scale::Columns, Scale::Unit].map(|s| minimise(&mut Decay, &[2.0, 0.5], &settings(s)).unwrap().x);
/// assert!((columns[0] - unit[0]).abs() < 1e-8 && (columns[1] - unit[1]).abs() < 1e-8);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By the largest column norms so far (More): independent of the units of the unknowns.
    Columns,
    /// By the unknowns themselves, `D = 1`: for coordinates whose length means something. Directions that the
    /// data hardly see then wait until the others have settled, instead of being moved the most.
    Unit,
}

/// When to stop. The defaults suit whitened residuals.
///
/// ```
/// # use ff_least_squares::{EvalError, Problem};
/// # /// `y = 3 exp(-0.7 t)` at four times, fitted by `x0 exp(-x1 t)`.
/// # struct Decay;
/// # impl Problem for Decay {
/// #     fn dim(&self) -> usize { 2 }
/// #     fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
/// #         *r = [0.3, 0.9, 1.7, 2.6].map(|t: f64| x[0] * (-x[1] * t).exp() - 3.0 * (-0.7 * t).exp()).to_vec();
/// #         Ok(())
/// #     }
/// #     fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut nalgebra::DMatrix<f64>) -> Result<(), EvalError> {
/// #         let e = [0.3, 0.9, 1.7, 2.6].map(|t: f64| (t, (-x[1] * t).exp()));
/// #         *j = nalgebra::DMatrix::from_fn(4, 2, |i, k| if k == 0 { e[i].1 } else { -x[0] * e[i].0 * e[i].1 });
/// #         self.residuals(x, r)
/// #     }
/// # }
/// use ff_least_squares::{Settings, Status, minimise};
///
/// // The rate is 0.7; a bound below it is met, and the status says which unknown stopped there.
/// let settings = Settings { bounds: vec![(0.0, 9.0), (0.1, 0.6)], ..Settings::default() };
/// let solution = minimise(&mut Decay, &[2.0, 0.5], &settings)?;
/// assert!(matches!(solution.status, Status::AtBound { ref at, .. } if *at == [1]), "{:?}", solution.status);
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Converged when an undamped Gauss-Newton step promises a relative reduction of the cost below this.
    /// With N residuals the parameters are then within about `sqrt(tol N)` of their standard deviations.
    pub decrement_tolerance: f64,
    /// Converged when an undamped Gauss-Newton step promises to reduce `|r|^2` by less than this, times `|r|^2` per residual where that
    /// is below one (residuals smaller than the noise they were divided by). The unknowns are then within about the square root of it
    /// of their standard deviations: 1e-4 is a hundredth of a deviation. 0 leaves the end to the other tests.
    pub gain_tolerance: f64,
    /// Converged when an accepted, undamped step is shorter than this relative to the point (scaled norms).
    pub step_tolerance: f64,
    /// Converged when the cost falls below this (problems with zero residual).
    pub cost_floor: f64,
    /// Most linearisations.
    pub max_iterations: usize,
    /// How unknowns are measured in the trust region.
    pub scale: Scale,
    /// First trust radius: with [`Scale::Columns`] relative to `|D x|` (absolute for `x = 0`), else absolute.
    pub initial_radius: f64,
    /// Largest trust radius, in the same measure; infinite unless set.
    pub max_radius: f64,
    /// Follow curved valleys: correct every step by the second derivative of the residuals along it (geodesic
    /// acceleration), found with one more evaluation. Pays where a Jacobian costs much more than residuals.
    pub acceleration: bool,
    /// After an undamped step that kept its promise, go on with the same linearisation (the chord method) for as long as it
    /// does; bring one that did not keep its promise to a fifth to where its parabola is lowest. Pays where a Jacobian costs
    /// much more than residuals; what is called converged is so by a linearisation of its own.
    pub chord: bool,
    /// Lower and upper bound of each unknown; empty for none. Infinite entries are free.
    pub bounds: Vec<(f64, f64)>,
    /// Singular values of `R D^-1` below this times the largest count as zero.
    pub rank_tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            decrement_tolerance: 1e-12,
            gain_tolerance: 0.0,
            step_tolerance: 1e-10,
            cost_floor: 0.0,
            max_iterations: 100,
            scale: Scale::Columns,
            initial_radius: 1.0,
            max_radius: f64::INFINITY,
            acceleration: false,
            chord: false,
            bounds: Vec::new(),
            rank_tolerance: 1e-13,
        }
    }
}
