//! What torque sensors and gyro tell about the base body, per sample, with the exact gradient.
//!
//! Of the regressor `Y` only the base rows depend on base parameters, so the RDA Jacobian
//! `N^T Y(A)`, `N^T = [-H_bm^T H_b^-1, 1]` (`theory.md` 1; [`ff_dynamics::reduced_torques`]) is
//!
//! ```text
//! d tau_j / d phi_k  = n_j . f_k,         f_k = E_k A + V x* E_k V,
//! d omega   / d phi_k = -[I^-1 E_k V]_ang,
//! ```
//!
//! `E_k` being the inertia of unit parameter `k` and `n_j`, `V`, `A` those of [`super`]. The torque rows are
//! those of measured base rates, as the RDA uses them; the gyro rows are those of the zero-momentum rate,
//! which the gyro measures independently of the torques.
//!
//! For a weighted sum `L` of the rows, with `P_j` the inertia that weights `j` add up to, the partial
//! derivatives with respect to `n_j`, `V` and `A` are
//!
//! ```text
//! dL/dn_j = P_j A + V x* P_j V,   dL/dA = sum_j P_j n_j,   dL/dV = -sum_j [n_j x* P_j V + P_j (V x n_j)],
//! ```
//!
//! and one adjoint sweep carries them to `(q, qd, qdd)`: about the cost of the rows themselves.

use super::sweep::Arm;
use super::{RigidBase, RigidError};
use crate::objective::information::SampleInformation;
use ff_dynamics::tree::body_regressor;
use ff_model::{Force, Inertia, Model, Motion, Params};
use nalgebra::{DMatrix, Vector3};

/// Standard deviations and rate of the sensors.
///
/// ```
/// use excitation::{RigidInformation, SensorNoise};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// // A sensor without noise would make every parameter certain: refused.
/// let noise = SensorNoise { torque: 0.0, gyro: Some(1.5e-4), rate: 100.0 };
/// assert!(RigidInformation::new(&robot, &Params::nominal(&robot), &[0, 1], noise).is_err());
/// assert!(RigidInformation::new(&robot, &Params::nominal(&robot), &[0, 1], SensorNoise { torque: 0.1, ..noise }).is_ok());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// Of one torque sample (N m).
    pub torque: f64,
    /// Of one gyro sample (rad/s); `None` when base rates are not to count as a measurement.
    pub gyro: Option<f64>,
    /// Samples per second (Hz).
    pub rate: f64,
}

impl SensorNoise {
    pub(crate) fn check(&self) -> Result<(), RigidError> {
        let gyro = self.gyro.unwrap_or(1.0);
        for (what, value) in
            [("noise of the torque sensors", self.torque), ("noise of the gyro", gyro), ("sample rate", self.rate)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(RigidError::Noise { what, value });
            }
        }
        Ok(())
    }
}

/// Rows of torque (one per joint) and gyro (three) over chosen parameters of the base body, each divided by
/// the standard deviation of the sensor and multiplied by the size of the parameter.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = vec![JointLimits { lower: -2.5, upper: 2.7, velocity: 0.17, acceleration: 0.15, jerk: None }; 7];
/// # let (start, end, duration) = (vec![0.3, -0.5, 0.2, 0.7, -0.1, 0.4, 0.6], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 4, limits, refine: 1 })?;
/// # let x = random_plan(&plan, 1, 0, 0.9)?;
/// use excitation::objective::Information;
/// use excitation::{Cost, RigidInformation, SensorNoise};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// // -log det of what a trajectory tells of mass and first moment of the base: smaller with better sensors.
/// let cost = |torque| {
///     let noise = SensorNoise { torque, gyro: None, rate: 100.0 };
///     let source = RigidInformation::new(&robot, &Params::nominal(&robot), &[0, 1, 2, 3], noise).unwrap();
///     let information = Information { source, samples: 61, rate: 100.0, delta: 1e-4 };
///     information.value_gradient(&plan, &x, &mut vec![0.0; plan.variables()])
/// };
/// assert!(cost(0.05) < cost(0.1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RigidInformation {
    robot: RigidBase,
    noise: SensorNoise,
    /// Which of the ten.
    chosen: Vec<usize>,
    /// Their sizes.
    sizes: Vec<f64>,
    /// All ten of the base body, appendages not included.
    base: [f64; 10],
    names: Vec<(String, &'static str)>,
}

impl RigidInformation {
    /// For the parameters `estimated` (indices into the parameter vector, base body only). Allocates.
    ///
    /// The size of a parameter is the mass `m`, `m l` or `m l^2` of the base, `l = sqrt(tr I / (2 m))` its radius
    /// of gyration about the frame origin: numbers of different units become comparable, and a first moment
    /// that happens to be zero has a size too.
    ///
    /// # Errors
    /// [`RigidError`].
    ///
    /// # Panics
    /// If `params` belongs to another model.
    pub fn new(
        model: &Model,
        params: &Params<f64>,
        estimated: &[usize],
        noise: SensorNoise,
    ) -> Result<Self, RigidError> {
        noise.check()?;
        let robot = RigidBase::new(model, params)?;
        let decls = model.param_decls();
        if let Some(&i) = estimated.iter().find(|&&i| i >= 10) {
            return Err(RigidError::NotBase { name: decls.get(i).map_or(i.to_string(), |d| d.name.clone()) });
        }
        let mut once = estimated.to_vec();
        once.sort_unstable();
        once.dedup();
        if once.is_empty() || once.len() != estimated.len() {
            return Err(RigidError::Selection);
        }
        let body = params.body(0);
        let usable = |x: f64| if x.is_finite() && x > 0.0 { x } else { 1.0 };
        let m = usable(body.mass.abs());
        let l = usable((body.rot.trace().abs() / (2.0 * m)).sqrt());
        let size = |k: usize| m * l.powi([0, 1, 1, 1, 2, 2, 2, 2, 2, 2][k]);
        Ok(Self {
            robot,
            noise,
            sizes: estimated.iter().map(|&k| size(k)).collect(),
            names: estimated.iter().map(|&k| (decls[k].name.clone(), decls[k].unit)).collect(),
            chosen: estimated.to_vec(),
            base: body.to_params(),
        })
    }
    /// The robot.
    pub fn robot(&self) -> &RigidBase {
        &self.robot
    }
    /// Sensor noise.
    pub fn noise(&self) -> &SensorNoise {
        &self.noise
    }
    /// Indices of the parameters, in the order of the columns.
    pub fn estimated(&self) -> &[usize] {
        &self.chosen
    }
    /// Size of each parameter, in its own unit.
    pub fn sizes(&self) -> &[f64] {
        &self.sizes
    }
    /// The ten parameters of the base body itself (without frozen appendages), whether estimated or not.
    pub fn base_parameters(&self) -> [f64; 10] {
        self.base
    }
    /// Full name and unit of each parameter.
    pub fn names(&self) -> &[(String, &'static str)] {
        &self.names
    }
    /// The inertia `sum_k weights_(row,k) size_k E_k / sigma`.
    fn weighted(&self, weights: &DMatrix<f64>, row: usize, sigma: f64) -> Inertia<f64> {
        let mut p = [0.0; 10];
        for (c, (k, size)) in self.chosen.iter().zip(&self.sizes).enumerate() {
            p[*k] = weights[(row, c)] * size / sigma;
        }
        Inertia::from_params(&p)
    }
}

/// `e_(3+r)`: picks a component of the base rate.
fn rate_axis(r: usize) -> Force<f64> {
    let mut e = Vector3::zeros();
    e[r] = 1.0;
    Force::new(Vector3::zeros(), e)
}

/// Rows are NaN where the composite inertia is not positive definite. Both methods allocate their buffers and
/// panic if a shape is wrong.
impl SampleInformation for RigidInformation {
    fn parameters(&self) -> usize {
        self.chosen.len()
    }
    fn rows(&self) -> usize {
        self.robot.model.nj() + if self.noise.gyro.is_some() { 3 } else { 0 }
    }
    fn rows_at(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut DMatrix<f64>) {
        assert_eq!(out.shape(), (self.rows(), self.parameters()), "shape of the block");
        let Some(arm) = Arm::new(&self.robot, q, qd, qdd) else {
            out.fill(f64::NAN);
            return;
        };
        let n = self.robot.model.nj();
        out.rows_mut(0, n).fill(0.0);
        let f = body_regressor(&arm.twist, &arm.accel);
        for (c, (&k, size)) in self.chosen.iter().zip(&self.sizes).enumerate() {
            for link in &arm.links {
                out[(link.of.index, c)] += link.of.multiplier * (link.basis.dot(&f[k]) * size / self.noise.torque);
            }
            if let Some(sigma) = self.noise.gyro {
                let mut unit = [0.0; 10];
                unit[k] = -size / sigma;
                let d = arm.solve(&Inertia::from_params(&unit).mul_motion(&arm.twist));
                for r in 0..3 {
                    out[(n + r, c)] = d.ang[r];
                }
            }
        }
    }
    fn contract(&self, [q, qd, qdd]: [&[f64]; 3], weights: &DMatrix<f64>, [gq, gqd, gqdd]: [&mut [f64]; 3]) {
        assert_eq!(weights.shape(), (self.rows(), self.parameters()), "shape of the weights");
        let Some(arm) = Arm::new(&self.robot, q, qd, qdd) else {
            gq.fill(f64::NAN);
            return;
        };
        let n = self.robot.model.nj();
        let (v, a) = (&arm.twist, &arm.accel);
        // Partial derivatives with respect to A, V and, brought to the base by I^-1, the n_j.
        let (mut over_a, mut over_v) = (Force::zero(), Force::zero());
        let mut over_n: Vec<Motion<f64>> = Vec::with_capacity(arm.links.len());
        for link in &arm.links {
            let p = self.weighted(weights, link.of.index, self.noise.torque / link.of.multiplier);
            let pv = p.mul_motion(v);
            over_n.push(arm.solve(&(p.mul_motion(a) + v.cross_force(&pv))));
            over_a += p.mul_motion(&link.basis);
            over_v = over_v - link.basis.cross_force(&pv) - p.mul_motion(&v.cross(&link.basis));
        }
        // The gyro part is -sum_r c_r . G_r V with c_r = I^-1 e_(3+r).
        let mut gyro = Vec::new();
        if let Some(sigma) = self.noise.gyro {
            for r in 0..3 {
                let g = self.weighted(weights, n + r, sigma);
                let c = arm.solve(&rate_axis(r));
                over_v -= g.mul_motion(&c);
                gyro.push((c, arm.solve(&g.mul_motion(v))));
            }
        }
        let to_a = arm.solve(&over_a);
        // A depends on V by -I^-1 I' V.
        let to_v = arm.solve(&(over_v - arm.d_inertia.mul_motion(&to_a)));
        for (l, link) in arm.links.iter().enumerate() {
            let (g, dg) = arm.displaced(link);
            let mut sum = -(to_v.dot(&g) + to_a.dot(&dg));
            for (j, (other, mu)) in arm.links.iter().zip(&over_n).enumerate() {
                // dn_j/dq_l = -I^-1 (dI/dq_l n_j + dF_j/dq_l); F_j turns with joint l when l carries j, and
                // changes by the part of the subtree that l moves when j carries l.
                sum -= link.turned(mu, &other.basis);
                if arm.carries(l, j) {
                    sum += link.screw.cross(mu).dot(&other.momentum);
                } else if arm.carries(j, l) {
                    sum -= link.turned(mu, &other.screw);
                }
            }
            for (c, w) in &gyro {
                sum += link.turned(c, w);
            }
            let (i, m) = (link.of.index, link.of.multiplier);
            gq[i] += m * sum;
            gqd[i] += m * (link.basis.dot(&over_v) - to_a.dot(&(g + arm.basis_rate(link))));
            gqdd[i] += m * link.basis.dot(&over_a);
        }
    }
}
