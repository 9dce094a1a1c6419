//! How well an estimate foretells a record that played no part in it, against how well it can.
//!
//! A short calibration behind a narrow low pass tells its parameters from a few dozen independent samples, and misses another motion by more than
//! its own: that is what its deviations say, and speaks against no model. With the whitened triangle `[R z; 0 r]` of the other record, and
//! estimate `x` and covariance `P`,
//!
//! ```text
//! chi^2 = e^T (1 + R P R^T)^-1 e + r^2,     e = z - R x
//! ```
//!
//! is as many as the record has independent rows, if the model is right.
//!
//! Positions that passed a low pass `F` lack what it takes of the motion, `tau(q) - tau(F q)` of the torques. It is as much for all parts of a log, and in
//! the parameters, but where the motion is faster than that. Where `F` leaves most, it takes from `F q` again what it has taken from `q`: a part `a` of
//! `tau(F q) - tau(F F q)`, between zero and [`MOST`], is taken for that, as the residuals have it.

use super::calibration::Ground;
use super::currents;
use super::gains::Unit;
use super::joint_terms::{JointTerm, JointTorques};
use super::problem::Problem;
use super::smoothed::{filter, through};
use crate::solve::linear::LinearError;
use crate::uncertain::ErrorSource;
use ff_least_squares::merge;
use ff_linalg as linalg;
use ff_records::Record;
use nalgebra::{DMatrix, DVector};

/// Largest part `a`. What a filter with the gain `G` has taken is `1 / G` times what it takes once more: three times where it lets a third pass.
const MOST: f64 = 3.0;

/// What a calibration has found, as its result lists it.
#[derive(Clone, Copy, Debug)]
pub struct Calibrated<'a> {
    /// All parameters of the model.
    pub values: &'a [f64],
    /// Friction, reflected inertia and gains of the joints.
    pub joints: &'a JointTorques,
    /// Standard deviation of the residual of every joint (N m; A where its current was measured).
    pub sigma: &'a [f64],
    /// Unknowns, in the order of rows and columns of the covariance; what is not among them counts as exact.
    pub names: &'a [String],
    /// Their covariance.
    pub covariance: &'a DMatrix<f64>,
}

/// How well a record is foretold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foretold {
    /// The formula of the module: about `rows` for a right model.
    pub chi2: f64,
    /// Independent rows of the record, behind the low pass.
    pub rows: usize,
    /// The part `a` of what the low pass would take of the motion once more that it has taken before; zero without a low pass.
    pub taken: f64,
}

impl Ground<'_> {
    /// How well a calibration foretells the torques (currents) of a record that played no part in it, its own deviations allowed for. Parameters of
    /// which nothing is known beside their values count as exact. Allocates.
    ///
    /// # Errors
    /// [`LinearError`]; [`LinearError::Shape`] if none of the unknowns is a parameter of the model.
    pub fn foretold(&self, record: &Record, by: &Calibrated<'_>) -> Result<Foretold, LinearError> {
        let (model, nj) = (self.model, self.model.nj());
        let k = by.names.len();
        if by.covariance.shape() != (k, k) || by.joints.terms.len() != nj || by.sigma.len() != nj {
            let what = "a calibration has a covariance of its unknowns, and terms and a deviation of every joint";
            return Err(LinearError::Shape(what.into()));
        }
        let decls = model.param_decls();
        let place = |name: &str| by.names.iter().position(|n| n == name);
        let selected: Vec<usize> = (0..decls.len()).filter(|&p| place(&decls[p].name).is_some()).collect();
        let beside =
            |of: &Vec<(JointTerm, f64)>| of.iter().map(|t| t.0).filter(|t| !JointTerm::ALWAYS.contains(t)).collect();
        let ground = self.clone().terms(by.joints.terms.iter().map(beside).collect());
        let (record, taken) = &ground.restored(record, by)?;
        let groups = ground.checked(&[record], &selected, by.values)?;
        let of = currents(&[record], nj)?;
        let terms = ground.all_terms();
        let problem = Problem::new(&ground, &groups, of.clone(), (&selected, by.values), terms.clone());
        let joints = model.joint_names();
        let mut names: Vec<String> = selected.iter().map(|&p| decls[p].name.clone()).collect();
        names.extend(terms.iter().map(|&(j, t)| t.name(&joints[j])));
        let mut x: Vec<f64> = selected.iter().map(|&p| by.values[p]).collect();
        x.extend(terms.iter().map(|&(j, t)| by.joints.coefficient(j, t)));
        // Currents are linear about these gains (A/N m).
        let gain = |j: usize| by.joints.gains.get(j).copied().flatten().filter(|_| of[j]);
        let at = x.clone();
        let inverse: Vec<Option<f64>> = (0..nj).map(|j| gain(j).map(|k| 1.0 / k)).collect();
        for (j, k) in (0..nj).filter_map(|j| Some((j, gain(j)?))) {
            names.push(ErrorSource::DriveGain(j).name(&joints));
            x.push(k);
        }
        let n = x.len();
        let equations = problem.equations(&problem.triangles(&groups, by.values)?, (&at, &inverse), Unit::Torque)?;
        let whole = merge(n, &equations, by.sigma)?;
        let places: Vec<Option<usize>> = names.iter().map(|n| place(n)).collect();
        let known = DMatrix::from_fn(n, n, |i, j| match (places[i], places[j]) {
            (Some(a), Some(b)) => by.covariance[(a, b)],
            _ => 0.0,
        });
        let e = &whole.d - &whole.r * DVector::from_vec(x);
        let (spread, along) = linalg::symmetric_eigen(&(&whole.r * known * whole.r.transpose()))?;
        let of_noise: f64 = (0..n).map(|k| along.column(k).dot(&e).powi(2) / (1.0 + spread[k].max(0.0))).sum();
        Ok(Foretold { chi2: of_noise + whole.rest, rows: whole.rows, taken: *taken })
    }
    /// The record without the torques of what the low pass has taken of the motion, and the part `a` of the module.
    fn restored(&self, record: &Record, by: &Calibrated<'_>) -> Result<(Record, f64), LinearError> {
        // Motion that is none of the record's own has not passed it, and where ends are trimmed torques are those of other samples.
        let own = record.qd().is_some() && record.qdd().is_some() && self.trim_s == 0.0;
        let Some(hz) = self.low_pass_hz.filter(|_| own) else { return Ok((record.clone(), 0.0)) };
        let (at, tau) = self.unfiltered(record, by.values, by.joints)?;
        let slower = through(record, &filter(record, hz)?);
        let lost = &tau - self.unfiltered(&slower, by.values, by.joints)?.1;
        let whitened = |torques: DMatrix<f64>| {
            let mut r = self.counted(&at, torques);
            r.column_iter_mut().zip(by.sigma).for_each(|(mut c, s)| c.unscale_mut(*s));
            r
        };
        let (left, along) = (whitened(&at.measured - tau), whitened(lost.clone()));
        let square = along.norm_squared();
        let taken = if square > 0.0 { (along.dot(&left) / square).clamp(0.0, MOST) } else { 0.0 };
        Ok((record.clone().with_tau(record.tau() - lost * taken), taken))
    }
}
