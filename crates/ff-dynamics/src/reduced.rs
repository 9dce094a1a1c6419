//! Base twist and passive states under a prescribed joint motion: the reduced system of identification.
//!
//! Position and attitude drop out (Galilean and rotational invariance in zero gravity), the arm comes from
//! [`Prescribed`], and what is left is `z = [V 6 | eta m | nu m]` with
//!
//! ```text
//! 0 = (I_base + I) A + I' V + h' + V x* ((I_base + I) V + h) + sum_ports X^* w      (6 rows)
//! 0 = M_eb A_h + M_ee nu' + h_e                                                     (m rows)
//! V_h = X^-1 (V + s),   A_h = X^-1 (A + s' + V x s)
//! ```
//!
//! per port frame `X, s` (`theory.md` 2; [`crate::prescribed`]). The result equals [`crate::hybrid_dynamics`].

use crate::ldl;
use crate::prescribed::{Carried, Prescribed};
use ff_model::{BaseKind, Force, Inertia, Model, ModelScalar, Motion, Params, PortMatrix, PortState};
use nalgebra::DMatrix;

/// Why the reduced system cannot be used or integrated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReducedError {
    /// The base is fixed or gravity acts.
    #[error("the reduced system needs a free-floating base and zero gravity; use the full dynamics")]
    NotFreeFloating,
    /// The mass matrix of base and passive coordinates is not positive definite.
    #[error("at t = {t} s: the mass matrix of base and passive coordinates is not positive definite")]
    Singular {
        /// Time (s).
        t: f64,
    },
    /// The state became NaN or infinite.
    #[error("at t = {t} s: the state is no longer finite (step {step} s); check stiffness, damping and step")]
    NotFinite {
        /// Time (s).
        t: f64,
        /// Integration step (s).
        step: f64,
    },
}

/// Samples of the reduced system.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Joint torques (N m), `N x n`.
    pub tau: DMatrix<f64>,
    /// Base twist, base frame, linear first, `N x 6`; columns 3..6 are the gyro (rad/s).
    pub twist: DMatrix<f64>,
    /// Base acceleration, `N x 6`.
    pub accel: DMatrix<f64>,
    /// Passive coordinates, `N x m`.
    pub eta: DMatrix<f64>,
    /// Passive rates, `N x m`.
    pub nu: DMatrix<f64>,
}

/// Buffers of the reduced equations over one scalar.
#[derive(Clone, Debug)]
pub(crate) struct ReducedWork<T: ModelScalar> {
    /// Per port: `M`, bias, host twist, and its wrench on the base in base coordinates.
    pub(crate) m: Vec<Vec<T>>,
    pub(crate) h: Vec<Vec<T>>,
    pub(crate) v: Vec<Motion<T>>,
    pub(crate) wrench: Vec<Force<T>>,
    /// Residual rows `[6 | m]`.
    pub(crate) res: Vec<T>,
}

impl<T: ModelScalar> ReducedWork<T> {
    pub(crate) fn new(model: &Model) -> Self {
        let z = T::zero();
        let ports = model.appendages();
        Self {
            m: ports.iter().map(|a| vec![z; (6 + a.dim()).pow(2)]).collect(),
            h: ports.iter().map(|a| vec![z; 6 + a.dim()]).collect(),
            v: vec![Motion::zero(); ports.len()],
            wrench: vec![Force::zero(); ports.len()],
            res: vec![z; 6 + model.np()],
        }
    }
    #[inline(always)]
    pub(crate) fn port_m(&self, k: usize, i: usize, j: usize) -> T {
        self.m[k][i * self.h[k].len() + j]
    }
    /// Column `j` of `M_be` of port `k`, in the mount frame.
    #[inline(always)]
    pub(crate) fn coupling(&self, k: usize, j: usize) -> Force<T> {
        let mut c = [T::zero(); 6];
        for (i, c) in c.iter_mut().enumerate() {
            *c = self.port_m(k, i, 6 + j);
        }
        Force::from_slice(&c)
    }
    /// The host block of port `k` as a rigid body in base coordinates.
    #[inline(always)]
    pub(crate) fn host_block(&self, k: usize, x: &ff_model::Xform<T>) -> Inertia<T> {
        Inertia::from_elements(|i, j| self.port_m(k, i, j)).to_parent(x)
    }
    /// Host twists, mass matrices and biases of all ports at `z`.
    pub(crate) fn ports(&mut self, model: &Model, params: &Params<T>, frames: &[Carried], z: &[T]) {
        let m = model.np();
        let base = Motion::from_slice(z);
        for (k, a) in model.appendages().iter().enumerate() {
            let f = &frames[k];
            self.v[k] = f.x.lift().motion_to_child(&(base + lift(&f.s)));
            let r = a.coord_offset..a.coord_offset + a.dim();
            let (eta, nu) = (&z[6 + r.start..6 + r.end], &z[6 + m + r.start..6 + m + r.end]);
            let port = T::port(&*a.appendage);
            let p = params.appendage(model, k);
            port.inertia(p, eta, &mut PortMatrix::new(a.dim(), &mut self.m[k]));
            port.bias(p, &PortState { host: self.v[k], eta, nu }, &mut self.h[k]);
        }
    }
    /// Residual rows of the module equations at accelerations `u = [A | nu']`; needs [`Self::ports`].
    pub(crate) fn residual(
        &mut self,
        model: &Model,
        params: &Params<T>,
        table: &Prescribed,
        node: usize,
        z: &[T],
        u: &[T],
    ) {
        let arm = &table.arm[node];
        let (v, a) = (Motion::from_slice(z), Motion::<T>::from_slice(u));
        let total = *params.body(0) + arm.inertia.lift();
        let mut base = total.mul_motion(&a)
            + arm.d_inertia.lift().mul_motion(&v)
            + lift_force(&arm.dh)
            + v.cross_force(&(total.mul_motion(&v) + lift_force(&arm.h)));
        let frames = table.frames_at(node);
        for (k, ap) in model.appendages().iter().enumerate() {
            let f = &frames[k];
            let x = f.x.lift();
            let host = x.motion_to_child(&(a + lift(&f.ds) + v.cross(&lift(&f.s))));
            let n = ap.dim();
            let acc = &u[6 + ap.coord_offset..6 + ap.coord_offset + n];
            let mut w = [T::zero(); 6];
            for (i, w) in w.iter_mut().enumerate() {
                let mut s = self.h[k][i];
                for j in 0..6 {
                    s += self.port_m(k, i, j) * host.get(j);
                }
                for j in 0..n {
                    s += self.port_m(k, i, 6 + j) * acc[j];
                }
                *w = s;
            }
            for i in 0..n {
                let mut e = self.h[k][6 + i] + host.dot(&self.coupling(k, i));
                for j in 0..n {
                    e += self.port_m(k, 6 + i, 6 + j) * acc[j];
                }
                self.res[6 + ap.coord_offset + i] = e;
            }
            self.wrench[k] = x.force_to_parent(&Force::from_slice(&w));
            base += self.wrench[k];
        }
        base.write_to(&mut self.res);
    }
}

/// Mass matrix over `[A | nu']` at the last [`ReducedWork::ports`], factorised in place of `l`.
pub(crate) fn factor_mass(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    node: usize,
    work: &ReducedWork<f64>,
    l: &mut [f64],
) -> bool {
    let n = 6 + model.np();
    let mut total = *params.body(0) + table.arm[node].inertia;
    l.fill(0.0);
    for (k, ap) in model.appendages().iter().enumerate() {
        let x = &table.frames_at(node)[k].x;
        total += work.host_block(k, x);
        for j in 0..ap.dim() {
            let row = 6 + ap.coord_offset + j;
            let c = x.force_to_parent(&work.coupling(k, j));
            for i in 0..6 {
                l[row * n + i] = c.get(i);
            }
            for i in 0..ap.dim() {
                l[row * n + 6 + ap.coord_offset + i] = work.port_m(k, 6 + j, 6 + i);
            }
        }
    }
    let b = total.to_matrix();
    for i in 0..6 {
        for j in 0..6 {
            l[i * n + j] = b[(i, j)];
        }
    }
    ldl::factor(l, n)
}

/// Torque of every joint at a sample, from the accelerations and the port wrenches of the last residual.
pub(crate) fn torques(
    model: &Model,
    table: &Prescribed,
    sample: usize,
    v: &Motion<f64>,
    a: &Motion<f64>,
    wrench: &[Force<f64>],
    tau: &mut [f64],
) {
    for (t, r) in tau.iter_mut().zip(table.rows_at(sample)) {
        let c = &r.carrier;
        let f = c.inertia.mul_motion(a)
            + c.d_inertia.mul_motion(v)
            + c.dh
            + v.cross_force(&(c.inertia.mul_motion(v) + c.h));
        *t = r.screw.dot(&f);
    }
    for (k, ap) in model.appendages().iter().enumerate() {
        for &j in &table.above[ap.host] {
            tau[j] += table.rows_at(sample)[j].screw.dot(&wrench[k]);
        }
    }
}

#[inline(always)]
pub(crate) fn lift<T: ModelScalar>(m: &Motion<f64>) -> Motion<T> {
    Motion::new(m.lin.map(T::from_f64), m.ang.map(T::from_f64))
}
#[inline(always)]
pub(crate) fn lift_force<T: ModelScalar>(f: &Force<f64>) -> Force<T> {
    Force::new(f.lin.map(T::from_f64), f.ang.map(T::from_f64))
}

/// Checks that the reduced system applies.
pub(crate) fn check(model: &Model) -> Result<(), ReducedError> {
    if model.base_kind() != BaseKind::Floating || model.gravity().norm() != 0.0 {
        return Err(ReducedError::NotFreeFloating);
    }
    Ok(())
}

/// The reduced system at one parameter set: accelerations at a node, with factorised mass matrix.
pub(crate) struct Reduced<'a> {
    pub(crate) model: &'a Model,
    pub(crate) params: &'a Params<f64>,
    pub(crate) table: &'a Prescribed,
    pub(crate) work: ReducedWork<f64>,
    pub(crate) mass: Vec<f64>,
    zero: Vec<f64>,
}

impl<'a> Reduced<'a> {
    pub(crate) fn new(model: &'a Model, params: &'a Params<f64>, table: &'a Prescribed) -> Self {
        let n = 6 + model.np();
        Self { model, params, table, work: ReducedWork::new(model), mass: vec![0.0; n * n], zero: vec![0.0; n] }
    }
    /// `u = [A | nu']` at state `z` and a node; the mass matrix stays factorised in `self.mass`.
    pub(crate) fn accelerations(&mut self, node: usize, z: &[f64], u: &mut [f64]) -> Result<(), ReducedError> {
        self.work.ports(self.model, self.params, self.table.frames_at(node), z);
        if !factor_mass(self.model, self.params, self.table, node, &self.work, &mut self.mass) {
            return Err(ReducedError::Singular { t: 0.5 * self.table.step * node as f64 });
        }
        let zero = std::mem::take(&mut self.zero);
        self.work.residual(self.model, self.params, self.table, node, z, &zero);
        self.zero = zero;
        for (u, r) in u.iter_mut().zip(&self.work.res) {
            *u = -r;
        }
        ldl::solve(&self.mass, u.len(), u);
        Ok(())
    }
}

/// Nodes (in half steps) and weights of the classical Runge-Kutta method.
pub(crate) const STAGE: [usize; 4] = [0, 1, 1, 2];
pub(crate) const WEIGHT: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// Integrates the reduced system from `z0 = [V 6 | eta m | nu m]` (classical RK4) and samples it.
///
/// Allocates the response and buffers once.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If `z0` has the wrong length.
pub fn simulate_reduced(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
) -> Result<Response, ReducedError> {
    check(model)?;
    let m = model.np();
    let nz = 6 + 2 * m;
    assert_eq!(z0.len(), nz, "initial state");
    let mut sys = Reduced::new(model, params, table);
    let mut out = Response::new(table.samples, model.nj(), m);
    let mut z = z0.to_vec();
    let mut zs = z.clone();
    let mut k = vec![0.0; nz];
    let mut sum = vec![0.0; nz];
    let mut u = vec![0.0; 6 + m];
    let mut tau = vec![0.0; model.nj()];
    for i in 0..table.samples {
        let node = i * 2 * table.substeps;
        sys.accelerations(node, &z, &mut u)?;
        sys.work.residual(model, params, table, node, &z, &u);
        torques(model, table, i, &Motion::from_slice(&z), &Motion::from_slice(&u), &sys.work.wrench, &mut tau);
        out.write(i, m, &z, &u, &tau);
        if !z.iter().all(|x| x.is_finite()) {
            return Err(ReducedError::NotFinite { t: i as f64 * table.sample_s, step: table.step });
        }
        if i + 1 == table.samples {
            break;
        }
        for s in 0..table.substeps {
            sum.fill(0.0);
            for stage in 0..4 {
                zs.copy_from_slice(&z);
                let c = 0.5 * table.step * STAGE[stage] as f64;
                if stage > 0 {
                    zs.iter_mut().zip(&k).for_each(|(x, k)| *x += c * k);
                }
                sys.accelerations(node + 2 * s + STAGE[stage], &zs, &mut u)?;
                rate(m, &zs, &u, &mut k);
                sum.iter_mut().zip(&k).for_each(|(x, k)| *x += WEIGHT[stage] * table.step * k);
            }
            z.iter_mut().zip(&sum).for_each(|(x, d)| *x += d);
        }
    }
    Ok(out)
}

/// `z' = [A | nu | nu']`.
#[inline(always)]
pub(crate) fn rate(m: usize, z: &[f64], u: &[f64], k: &mut [f64]) {
    k[..6].copy_from_slice(&u[..6]);
    k[6..6 + m].copy_from_slice(&z[6 + m..]);
    k[6 + m..].copy_from_slice(&u[6..]);
}

impl Response {
    pub(crate) fn new(samples: usize, nj: usize, m: usize) -> Self {
        let z = |c| DMatrix::zeros(samples, c);
        Self { tau: z(nj), twist: z(6), accel: z(6), eta: z(m), nu: z(m) }
    }
    pub(crate) fn write(&mut self, i: usize, m: usize, z: &[f64], u: &[f64], tau: &[f64]) {
        let fill = |d: &mut DMatrix<f64>, x: &[f64]| x.iter().enumerate().for_each(|(k, &v)| d[(i, k)] = v);
        fill(&mut self.tau, tau);
        fill(&mut self.twist, &z[..6]);
        fill(&mut self.accel, &u[..6]);
        fill(&mut self.eta, &z[6..6 + m]);
        fill(&mut self.nu, &z[6 + m..]);
    }
    /// Base rates (rad/s), `N x 3`.
    pub fn gyro(&self) -> DMatrix<f64> {
        self.twist.columns(3, 3).into_owned()
    }
}
