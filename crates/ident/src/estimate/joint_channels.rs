//! Channels on the motor's side of the gears as the torques of the bodies: currents by their gains, friction and reflected inertia taken off.
//!
//! ```text
//! k_j i_j = tau_j + f_j(qd_j, qdd_j, tau_j)        tau_j = (k_j i_j - f_j) / (1 + l_j sgn(qd_j) sgn(tau_j))
//! ```
//!
//! with the terms `f_j` of [`JointTerm`] and the coefficient `l_j` of that in proportion to the load. What compares amplitudes, signs and units
//! of a record with a prediction knows torques behind the gear alone, and gets them from here.

use crate::estimate::estimator::Estimator;
use crate::estimate::ground::joint_terms::{JointTerm, JointTorques, NearRest};
use crate::estimate::output_error::OutputError;
use crate::estimate::output_options::Options;
use crate::estimate::sensor_errors::SensorErrors;
use crate::estimate::setup::{Noise, SetupError, check_noise};
use crate::motion::tables::Tables;
use crate::uncertain::source::ErrorSource;
use ff_model::Model;
use ff_records::Record;
use nalgebra::{DMatrix, DVector};

/// Relative standard deviation of a gain beyond which a current tells nothing of its torque.
const TOLD: f64 = 0.5;
/// Relative standard deviation of a gain beyond which reflected inertia, which looks much like the inertia of the bodies, is left to the gain.
const TELLING: f64 = 0.3;

/// The motion of the joints at the samples of the torques.
fn moving(
    model: &Model,
    record: &Record,
    terms: &[(usize, JointTerm)],
    near_rest: &[Option<NearRest>],
    noise: &Noise,
) -> Result<SensorErrors, SetupError> {
    let tables = Tables::new(model, record, 1, Some((noise, &[])), (false, false))?;
    let of = terms.iter().map(|&(j, term)| ErrorSource::Joint(j, term)).collect();
    Ok(SensorErrors::new(of, near_rest, record, tables.moving().0))
}

/// Terms and gains of joints, roughly, and the torques that they were told from.
#[derive(Clone, Debug)]
pub struct RoughJoints {
    /// Terms of every joint, and the gain of each current; none where nothing of its torque is seen in it.
    pub joints: JointTorques,
    /// For every term, the coefficient with which it is as large as the torque of the bodies (root mean squares): a size of it.
    pub sizes: Vec<Vec<f64>>,
    /// Torques of the bodies that the model predicts at the samples of the channels (N m, samples x joints).
    pub predicted: DMatrix<f64>,
}

/// Roughly, what the terms of the joints and the gains of their drives are, the robot having the parameters `values`: channel by channel by least
/// squares on the prediction of a robot that begins at rest, samples next to rest left out where a joint has dry friction.
/// `terms` has the terms of every joint (none for none). For starts and checks: errors of the parameters go into all of it. Allocates.
///
/// # Errors
/// [`SetupError`].
pub fn rough_joints(
    model: &Model,
    record: &Record,
    values: &[f64],
    terms: &[Vec<JointTerm>],
    near_rest: &[Option<NearRest>],
    noise: &Noise,
) -> Result<RoughJoints, SetupError> {
    check_noise(noise)?;
    let (n, tau) = (model.nj(), record.tau());
    let of_joint = |j: usize| terms.get(j).map_or(&[][..], Vec::as_slice);
    let all: Vec<(usize, JointTerm)> = (0..n).flat_map(|j| of_joint(j).iter().map(move |t| (j, *t))).collect();
    let at = moving(model, record, &all, near_rest, noise)?;
    let torques = record.clone().with_torques(tau.clone());
    let mut plain = OutputError::new(model, &torques, &Options { all_alike: true, ..Options::new(*noise) })?;
    let mut residuals = vec![0.0; plain.rows()];
    plain.residuals(values, &[], &mut residuals).map_err(|e| SetupError::JointMotion(e.to_string()))?;
    let stride = if plain.is_interleaved() { n + 3 } else { n };
    let predicted = DMatrix::from_fn(tau.nrows(), n, |i, j| tau[(i, j)] + noise.torque * residuals[stride * i + j]);
    let mut out = JointTorques { terms: Vec::with_capacity(n), gains: Vec::with_capacity(n) };
    let mut sizes = Vec::with_capacity(n);
    for j in 0..n {
        let near = near_rest.get(j).copied().flatten().filter(|_| of_joint(j).iter().any(|t| t.is_dry()));
        let used: Vec<usize> =
            (0..tau.nrows()).filter(|&i| near.is_none_or(|near| near.uses(at.rate(i, j).unwrap_or(0.0)))).collect();
        let current = record.currents().get(j).copied().unwrap_or(false);
        let fit = |terms: &[JointTerm]| -> Option<(DVector<f64>, f64)> {
            // The gain, the terms, and a bias unless that is one of them.
            let biased = !terms.contains(&JointTerm::Offset);
            let width = 1 + terms.len() + usize::from(biased);
            let a = DMatrix::from_fn(used.len(), width, |row, c| {
                let (i, x) = (used[row], predicted[(used[row], j)]);
                match c.checked_sub(1).map(|t| terms.get(t)) {
                    None => x,
                    Some(Some(term)) => at.factor(*term, i, j, x),
                    Some(None) => 1.0,
                }
            });
            let b = DVector::from_iterator(used.len(), used.iter().map(|&i| tau[(i, j)]));
            let scale: Vec<f64> = a.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
            let unit = DMatrix::from_fn(a.nrows(), width, |i, c| a[(i, c)] / scale[c]);
            let inverse = unit.tr_mul(&unit).try_inverse()?;
            let x = &inverse * unit.tr_mul(&b);
            let left = (&b - &unit * &x).norm_squared() / (used.len().saturating_sub(width)).max(1) as f64;
            let relative = (left * inverse[(0, 0)].max(0.0)).sqrt() / x[0].abs();
            let x = DVector::from_iterator(width, x.iter().zip(&scale).map(|(x, s)| x / s));
            x.iter().all(|x| x.is_finite()).then_some((x, relative))
        };
        let whole = of_joint(j).to_vec();
        let bare: Vec<JointTerm> = whole.iter().copied().filter(|t| *t != JointTerm::ReflectedInertia).collect();
        let told = fit(&whole).filter(|f| f.1 < TELLING || whole.len() == bare.len());
        let (terms, found) = if told.is_some() { (whole, told) } else { (bare.clone(), fit(&bare)) };
        let (x, relative) = found.unwrap_or_else(|| (DVector::zeros(1 + terms.len()), f64::INFINITY));
        let gain = Some(x[0].recip()).filter(|k| k.is_finite() && relative < TOLD);
        // Terms stand beside the torque, in N m.
        let per = if current { gain.unwrap_or(1.0) } else { 1.0 };
        let rms = |of: &dyn Fn(usize) -> f64| used.iter().map(|&i| of(i).powi(2)).sum::<f64>().sqrt();
        let torque = rms(&|i| predicted[(i, j)]);
        let size = |term: &JointTerm| torque / rms(&|i| at.factor(*term, i, j, predicted[(i, j)]));
        sizes.push(of_joint(j).iter().map(size).map(|s| if s.is_finite() && s > 0.0 { s } else { 1.0 }).collect());
        out.terms.push(terms.iter().enumerate().map(|(t, term)| (*term, x[1 + t] * per)).collect());
        out.gains.push(gain.filter(|_| current));
    }
    Ok(RoughJoints { joints: out, sizes, predicted })
}

/// The record with the torques of the bodies in place of what its channels read, the joints having these terms and gains (one N m/A for a
/// current without a gain). Allocates.
///
/// # Errors
/// [`SetupError`].
pub fn without_joints(
    model: &Model,
    record: &Record,
    joints: &JointTorques,
    near_rest: &[Option<NearRest>],
    noise: &Noise,
) -> Result<Record, SetupError> {
    let of = |j: usize| joints.terms.get(j).map_or(&[][..], Vec::as_slice);
    let all: Vec<(usize, JointTerm)> = (0..model.nj()).flat_map(|j| of(j).iter().map(move |t| (j, t.0))).collect();
    let at = moving(model, record, &all, near_rest, noise)?;
    let tau = DMatrix::from_fn(record.tau().nrows(), model.nj(), |i, j| {
        let current = record.currents().get(j).copied().unwrap_or(false);
        let gain = joints.gains.get(j).copied().flatten().filter(|_| current).unwrap_or(1.0);
        let beside: f64 =
            of(j).iter().filter(|t| t.0 != JointTerm::Load).map(|(term, x)| x * at.factor(*term, i, j, 0.0)).sum();
        let loaded = record.tau()[(i, j)] * gain - beside;
        // The factor of a unit of load is the sign of the rate.
        let load = joints.coefficient(j, JointTerm::Load);
        if load == 0.0 {
            loaded
        } else {
            loaded / (1.0 + load * at.factor(JointTerm::Load, i, j, 1.0) * loaded.signum())
        }
    });
    Ok(record.clone().with_torques(tau))
}
