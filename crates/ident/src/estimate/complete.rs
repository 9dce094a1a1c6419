//! The complete form: a rigid system with measured base acceleration, linear in its parameters.
//!
//! With the base acceleration measured the equations of motion need no elimination,
//!
//! ```text
//! [0; tau] = Y(q, qd, qdd, omega, omega', a) phi        (6 + n rows per sample),
//! ```
//!
//! where `a` is the specific force at the base origin. Position, attitude, velocity and gravity play no part: the equations
//! hold in any frame that moves with a constant velocity, and an accelerometer does not feel gravity either. What is known of
//! `phi` goes to the right side. Rackl, Lampariello, Albu-Schaeffer 2013 compare this form with the reduced one
//! ([`crate::estimate::rda`]), which needs no accelerometer and is the more accurate: here the errors of acceleration enter the
//! matrix, which least squares takes as exact, and bias the estimate towards zero. Its use is a start for the reduced form.
//!
//! Rates of the base come from a spline through the gyro, which gives the angular acceleration as well
//! (`docs/theory/linear-estimators.md`).

use crate::estimate::setup::SetupError;
use crate::motion::joint_motion::joint_motion;
use crate::motion::spline_fit::{JointSamples, MotionFit, choose_knots};
use crate::solve::linear;
use crate::solve::linear::{LinearError, LinearEstimate, Task, Weights};
use crate::solve::regressor_rows::{Equations, Kind};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Accelerometer;
use ff_linalg as linalg;
use ff_model::{BaseKind, Model, Xform};
use ff_records::Record;
use nalgebra::{DMatrix, Vector3};

const NAME: &str = "the complete form";

/// What the estimator assumes.
///
/// ```
/// use ff_dynamics::sim::Accelerometer;
/// use ff_model::Xform;
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ident::CompleteOptions;
///
/// // An accelerometer beside the base origin; half a second left out at both ends.
/// let mount = Xform::new(Matrix3::identity(), Vector3::new(0.3, -0.1, 0.2));
/// let options = CompleteOptions { accelerometer: Accelerometer { mount }, trim_s: 0.5, ..CompleteOptions::default() };
/// assert_eq!(options.accelerometer.mount.pos.y, -0.1);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CompleteOptions {
    /// Where the accelerometer is, in the base frame.
    pub accelerometer: Accelerometer,
    /// Standard deviations of the equations: force on the base (N), moment on the base (N m), torque of each joint.
    /// [`Weights::FromResiduals`] suits, because the errors of the base rows come from accelerations, not from a
    /// sensor of force.
    pub weights: Weights,
    /// Seconds left out at both ends, where a spline knows least of its derivatives.
    pub trim_s: f64,
}

impl Default for CompleteOptions {
    /// Accelerometer at the base origin, weights from residuals in two steps, nothing left out.
    fn default() -> Self {
        let accelerometer = Accelerometer { mount: Xform::identity() };
        Self { accelerometer, weights: Weights::FromResiduals(2), trim_s: 0.0 }
    }
}

/// The estimator.
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::{Complete, CompleteOptions};
///
/// // This record has no accelerometer: refused, with the estimator that does without.
/// let refused = Complete::new(&robot, &record, &CompleteOptions::default()).unwrap_err();
/// assert!(refused.to_string().contains("accelerometer"), "{refused}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Complete {
    model: Model,
    q: DMatrix<f64>,
    v: DMatrix<f64>,
    a: DMatrix<f64>,
    measured: DMatrix<f64>,
    weights: Weights,
}

impl Complete {
    /// For a rigid, floating model and a record with accelerometer. Allocates.
    ///
    /// # Errors
    /// [`LinearError::Base`], [`LinearError::Channel`], [`LinearError::Setup`], [`LinearError::Option`].
    pub fn new(model: &Model, record: &Record, options: &CompleteOptions) -> Result<Self, LinearError> {
        if model.base_kind() != BaseKind::Floating {
            let hint = "use the ground calibration for a fixed base";
            return Err(LinearError::Base { estimator: NAME, needed: "floating", hint });
        }
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()).into());
        }
        let Some(acc) = record.acc() else {
            let hint = "use the reduced form (RDA), which does without";
            return Err(LinearError::Channel { estimator: NAME, channel: "base accelerometer", hint });
        };
        let kept = trimmed(record, options.trim_s)?;
        let (q, qd, qdd) = motion_at(&*joint_motion(model, record)?, record, kept.clone());
        let (w, al, _) = motion_at(&base_rates(record)?.motion, record, kept.clone());
        let (n, nj, first) = (kept.len(), model.nj(), kept.start);
        let mut v = DMatrix::zeros(n, 6 + nj);
        let mut a = DMatrix::zeros(n, 6 + nj);
        let mut measured = DMatrix::zeros(n, 6 + nj);
        v.columns_mut(3, 3).copy_from(&w);
        v.columns_mut(6, nj).copy_from(&qd);
        a.columns_mut(3, 3).copy_from(&al);
        a.columns_mut(6, nj).copy_from(&qdd);
        measured.columns_mut(6, nj).copy_from(&record.tau().rows(first, n));
        let mount = &options.accelerometer.mount;
        for i in 0..n {
            let row = |m: &DMatrix<f64>, i: usize| Vector3::new(m[(i, 0)], m[(i, 1)], m[(i, 2)]);
            let (w, al) = (row(&w, i), row(&al, i));
            let at_origin = mount.rot * row(acc, first + i) - al.cross(&mount.pos) - w.cross(&w.cross(&mount.pos));
            (0..3).for_each(|k| a[(i, k)] = at_origin[k]);
        }
        // The accelerometer already contains gravity.
        let model = model.clone().with_gravity(Vector3::zeros());
        Ok(Self { model, q, v, a, measured, weights: options.weights.clone() })
    }
    /// From instants instead of a record: motion and generalised forces need not follow each other in time. `q` is N x n,
    /// `v` (base twist, joint rates), `a` (its componentwise rate) and `forces` (wrench on the base, joint torques) are
    /// N x (6 + n); weights as in [`CompleteOptions::weights`]. Gravity of the model plays no part: add it to `a`.
    ///
    /// # Errors
    /// [`LinearError::Base`], [`LinearError::Setup`], [`LinearError::Shape`], [`LinearError::Linalg`] for non-finite numbers.
    pub fn of_instants(
        model: &Model,
        q: DMatrix<f64>,
        v: DMatrix<f64>,
        a: DMatrix<f64>,
        forces: DMatrix<f64>,
        weights: Weights,
    ) -> Result<Self, LinearError> {
        if model.base_kind() != BaseKind::Floating {
            let hint = "use the ground calibration for a fixed base";
            return Err(LinearError::Base { estimator: NAME, needed: "floating", hint });
        }
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()).into());
        }
        let (n, nv) = (q.nrows(), model.nv());
        for (what, m, width) in [("q", &q, model.nj()), ("v", &v, nv), ("a", &a, nv), ("forces", &forces, nv)] {
            if m.shape() != (n, width) || n == 0 {
                let (rows, columns) = m.shape();
                return Err(LinearError::Shape(format!(
                    "{what} is {rows} x {columns}, must be {n} x {width}, n above 0"
                )));
            }
            linalg::check_finite(what, m)?;
        }
        let model = model.clone().with_gravity(Vector3::zeros());
        Ok(Self { model, q, v, a, measured: forces, weights })
    }
    /// Estimates the parameters `selected` (ascending indices of [`Model::param_decls`]); the others keep their value in
    /// `start`, and so does what the data cannot tell. Allocates; memory does not grow with the record beyond its motion.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn estimate(&self, selected: &[usize], start: &[f64]) -> Result<LinearEstimate, LinearError> {
        let decls = self.model.param_decls();
        linear::check(&decls, selected, start)?;
        let mut kinds = vec![
            Kind { name: "force on the base".into(), dofs: vec![0, 1, 2] },
            Kind { name: "moment on the base".into(), dofs: vec![3, 4, 5] },
        ];
        let joints = self.model.joint_names();
        kinds.extend(joints.iter().enumerate().map(|(j, n)| Kind { name: format!("torque {n}"), dofs: vec![6 + j] }));
        let equations = Equations {
            model: &self.model,
            q: self.q.clone(),
            v: self.v.clone(),
            a: self.a.clone(),
            measured: self.measured.clone(),
            selected,
            values: start,
            absent: &[],
            extra: vec![],
            keep: None,
            kinds,
        };
        let task = Task { decls: &decls, selected, start, extra: vec![], weights: &self.weights, priors: &[] };
        linear::solve(&task, &equations.triangles()?)
    }
}

/// Samples that are left when `trim_s` seconds are cut off at both ends.
pub(crate) fn trimmed(record: &Record, trim_s: f64) -> Result<core::ops::Range<usize>, LinearError> {
    record.check_uniform("linear least squares").map_err(SetupError::from)?;
    let wrong = |needed| LinearError::Option { what: "time left out at the ends (s)".into(), value: trim_s, needed };
    if !(trim_s.is_finite() && trim_s >= 0.0) {
        return Err(wrong("zero or positive"));
    }
    let cut = (trim_s / record.dt()).round() as usize;
    if 2 * cut + 2 > record.samples() {
        return Err(wrong("less than half of the record"));
    }
    Ok(cut..record.samples() - cut)
}

/// Positions, rates and accelerations at the samples of a range, each rows x channels.
pub(crate) fn motion_at(
    motion: &dyn JointMotion,
    record: &Record,
    range: core::ops::Range<usize>,
) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
    let n = motion.dof();
    let z = DMatrix::zeros(range.len(), n);
    let (mut q, mut qd, mut qdd) = (z.clone(), z.clone(), z);
    let (mut x, mut y, mut z) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (row, i) in range.enumerate() {
        motion.eval(record.time(i), &mut x, &mut y, &mut z);
        for k in 0..n {
            (q[(row, k)], qd[(row, k)], qdd[(row, k)]) = (x[k], y[k], z[k]);
        }
    }
    (q, qd, qdd)
}

/// Spline through the gyro with the coarsest knots that reach its noise.
fn base_rates(record: &Record) -> Result<MotionFit, LinearError> {
    let times: Vec<f64> = (0..record.samples()).map(|i| record.time(i)).collect();
    let rows = record.gyro().transpose();
    let samples = JointSamples { dof: 3, times: &times, q: rows.as_slice(), qd: None, rate_weight: 0.0 };
    Ok(choose_knots(&samples, None).map_err(|e| SetupError::JointMotion(format!("base rates: {e}")))?)
}
