//! Independent draws next to a posterior: randomise, then optimise.
//!
//! Posteriors of oscillators are bent: along what is known least, stiffness of several hinges at once, frequencies that are known to a ten
//! thousandth must stay, and chains have to feel their way. In terms of what the data read they are nearly straight. With all rows `r` (data
//! and priors) and an orthonormal basis `Q` of the span of their derivatives at the fit, in coordinates `z` in which these derivatives are `Q`,
//!
//! ```text
//! Q^T (r(z) - r(0)) = y,   y ~ N(0, 1)     =>     q(z) = |det Q^T J(z)| exp(-1/2 |Q^T (r(z) - r(0))|^2)
//! ```
//!
//! A draw is a standard normal `y` and the solution of as many equations as there are unknowns (J. Bardsley, A. Solonen, H. Haario, M. Laine,
//! *Randomize-then-optimize*, SIAM J. Sci. Comput. 36(4), 2014). For residuals that are straight `q` is the posterior itself; what it
//! is off is weighed ([`super::importance`]). Solutions that are not physical have no weight.

use super::chains::SampleError;
use super::density::{Frame, Linear, PosteriorDensity};
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use ff_least_squares::EvalError;
use nalgebra::{DMatrix, DVector, Dyn, LU};

/// Largest distance from a solution, in deviations.
const CLOSE: f64 = 1e-3;
/// Steps that a solution may take.
const STEPS: usize = 40;
/// Part of the distance that a step must leave at most for the derivatives to be kept.
const KEEPS: f64 = 0.3;
/// Lengths of a step that are tried, each half as long as the one before.
const HALVINGS: i32 = 10;
/// Parts of the way at which a solution is begun: the first that can be evaluated.
const BEGIN: [f64; 4] = [1.0, 0.5, 0.25, 0.0];
/// Most numbers of a matrix of derivatives.
const NUMBERS: usize = 20_000_000;

/// What all draws have in common.
pub(super) struct Basis {
    pub(super) frame: Frame,
    /// `Q^T`.
    across: DMatrix<f64>,
    /// `Q^T r(0)`.
    origin: DVector<f64>,
}

impl Basis {
    /// At a fit, over the rows of an estimator; none where they are too many, or do not span as many directions as there are unknowns.
    ///
    /// # Errors
    /// [`SampleError`].
    pub(super) fn new<E: Estimator + ?Sized>(
        request: &Request<'_>,
        at: &Estimate,
        rows: Box<E>,
    ) -> Result<Option<Self>, SampleError> {
        let frame = Frame::straight(request, at)?;
        let (count, n) = (rows.rows() + request.priors.len(), frame.dim());
        if count * n > NUMBERS || count < n {
            return Ok(None);
        }
        let zero = vec![0.0; n];
        let failed = |e: EvalError| SampleError::Density(e.to_string().into());
        let mut density = PosteriorDensity::new(request, &frame, rows)?;
        let Linear { rows: r, jacobian, map } = density.linearised(&zero).map_err(failed)?;
        drop(density);
        let qr = (jacobian * map).qr();
        let Some(inverse) = qr.r().try_inverse() else { return Ok(None) };
        let across = qr.q().transpose();
        let origin = &across * r;
        Ok(Some(Self { frame: frame.turned(&inverse), across, origin }))
    }
    /// The draw that `y` leads to, with its `-1/2 |Q^T (r - r(0))|^2`; none where no solution was found.
    ///
    /// # Errors
    /// What no other point could repair.
    pub(super) fn solve<E: Estimator + ?Sized>(
        &self,
        density: &mut PosteriorDensity<'_, E>,
        y: &DVector<f64>,
    ) -> Result<Option<(Vec<f64>, f64)>, SampleError> {
        // Here as below, what is refused has no weight.
        told(self.solved(density, y)).map(Option::flatten)
    }
    /// `ln |det Q^T J|` at a draw; none where it is not regular.
    ///
    /// # Errors
    /// What no other point could repair.
    pub(super) fn log_volume<E: Estimator + ?Sized>(
        &self,
        density: &mut PosteriorDensity<'_, E>,
        z: &[f64],
    ) -> Result<Option<f64>, SampleError> {
        let slope = told(self.slope(density, z))?;
        let volume = slope.map(|s| s.u().diagonal().iter().map(|x| x.abs().ln()).sum::<f64>());
        Ok(volume.filter(|v| v.is_finite()))
    }
    fn solved<E: Estimator + ?Sized>(
        &self,
        density: &mut PosteriorDensity<'_, E>,
        y: &DVector<f64>,
    ) -> Result<Option<(Vec<f64>, f64)>, EvalError> {
        let off_at = |z: &DVector<f64>, density: &mut PosteriorDensity<'_, E>| {
            density.rows(z.as_slice()).map(|r| &self.across * r - &self.origin - y)
        };
        let begun = BEGIN.iter().find_map(|part| match off_at(&(y * *part), density) {
            Err(EvalError::Rejected(_)) => None,
            other => Some(other.map(|off| (y * *part, off))),
        });
        let Some(begun) = begun else { return Ok(None) };
        let (mut z, mut off) = begun?;
        // Derivatives are those at the fit, or of an earlier step, for as long as they lead on.
        let mut slope: Option<LU<f64, Dyn, Dyn>> = None;
        let mut fresh = false;
        for _ in 0..STEPS {
            if off.norm() < CLOSE {
                return Ok(Some((z.as_slice().to_vec(), -0.5 * (off + y).norm_squared())));
            }
            let Some(step) = slope.as_ref().map_or_else(|| Some(off.clone()), |s| s.solve(&off)) else {
                return Ok(None);
            };
            let mut next = None;
            for k in 0..if fresh { HALVINGS } else { 1 } {
                let part = 0.5_f64.powi(k);
                let there = &z - part * &step;
                match off_at(&there, density) {
                    Ok(left) if left.norm() < (1.0 - 0.1 * part) * off.norm() => next = Some((there, left)),
                    Ok(_) | Err(EvalError::Rejected(_)) => continue,
                    Err(e) => return Err(e),
                }
                break;
            }
            let bad = next.as_ref().is_none_or(|(_, left)| left.norm() > KEEPS * off.norm());
            match next {
                Some(next) => (z, off) = next,
                None if fresh => return Ok(None),
                None => {}
            }
            fresh = bad;
            if bad {
                slope = Some(self.slope(density, z.as_slice())?);
            }
        }
        Ok(None)
    }
    /// `Q^T J` at a point.
    fn slope<E: Estimator + ?Sized>(
        &self,
        density: &mut PosteriorDensity<'_, E>,
        z: &[f64],
    ) -> Result<LU<f64, Dyn, Dyn>, EvalError> {
        let Linear { jacobian, map, .. } = density.linearised(z)?;
        Ok(((&self.across * jacobian) * map).lu())
    }
}

/// None for what was refused.
fn told<T>(of: Result<T, EvalError>) -> Result<Option<T>, SampleError> {
    match of {
        Ok(value) => Ok(Some(value)),
        Err(EvalError::Rejected(_)) => Ok(None),
        Err(EvalError::Fatal(e)) => Err(SampleError::Density(e)),
    }
}
