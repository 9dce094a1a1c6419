//! Base twist and passive states under a prescribed joint motion: the reduced system of identification.
//!
//! Position and attitude drop out (Galilean and rotational invariance in zero gravity), the arm comes from
//! [`Prescribed`], and what is left is `z = [V 6 | eta m | nu m]`. The unknowns are `u = [a | al | nu']` with the
//! classical acceleration `a = v' + w x v` of the base origin, and
//!
//! ```text
//! 0 = m a + al x h + w x (w x h + 2 h.) + h..   + sum_ports f
//! 0 = J al + h x a + w x J w + C w + L.         + sum_ports n
//! 0 = M_eb A_h + M_ee nu' + h_e
//! ```
//!
//! with base body and arm in `m`, `h`, `J` ([`crate::reduced::table`]); an appendage moves with its mount,
//! `A_h = R^T (a + al x p + w x (w x p) + 2 w x p. + p..)`. Appendages are eliminated one by one
//! (`condense.rs`). The result equals [`crate::tree::forward::hybrid_dynamics`] (`theory.md` 2; `docs/theory/derivatives.md`).

use crate::reduced::coupled;
use crate::reduced::follow::Follow;
use crate::reduced::table::{Arm, ArmSource, Frame, Prescribed, Site, products};
use crate::tree::condense;
use crate::work::port_work::PortWork;
use core::ops::Range;
use ff_lanes::{Kernel, WIDEST};
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{M3, PackedInertia, V3};
use ff_model::tree::Coordinates;
use ff_model::{BaseKind, Model, Motion, Params, PortMatrix, PortState, Scalar};
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
///
/// ```
/// # use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
/// # let params = Params::nominal(&robot);
/// # let sampling = ff_dynamics::Sampling { samples: 51, sample_s: 0.02, substeps: 2 };
/// # let table = ff_dynamics::Prescribed::new(&robot, &params, &motion, &sampling, &[]);
/// # let rest = vec![0.0; 6 + 2 * robot.np()];
/// use ff_dynamics::{Response, simulate_reduced};
///
/// let response: Response = simulate_reduced(&robot, &params, &table, &rest)?;
/// assert_eq!((response.tau.shape(), response.eta.shape()), ((51, robot.nj()), (51, robot.np())));
/// let gyro = response.twist.columns(3, 3).row(50).norm(); // rad/s
/// assert!(gyro > 1e-4 && gyro < 0.2, "{gyro}");
/// # Ok::<(), ff_dynamics::reduced::ReducedError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Response<T: Scalar = f64> {
    /// Joint torques (N m), `N x n`.
    pub tau: DMatrix<T>,
    /// Base twist, base frame, linear first, `N x 6`; columns 3..6 are the gyro (rad/s).
    pub twist: DMatrix<T>,
    /// Base acceleration, `N x 6`.
    pub accel: DMatrix<T>,
    /// Passive coordinates, `N x m`.
    pub eta: DMatrix<T>,
    /// Passive rates, `N x m`.
    pub nu: DMatrix<T>,
}

/// The reduced system at one parameter set, or one per lane.
#[derive(Clone, Debug)]
pub(crate) struct Reduced<'a, T: ModelScalar, S = Prescribed> {
    pub(crate) model: &'a Model,
    pub(crate) params: &'a Params<T>,
    pub(crate) source: &'a S,
    /// Steps, samples and sites of the source.
    pub(crate) table: &'a Prescribed,
    ports: Vec<PortWork<T>>,
    frames: Vec<Frame<T>>,
}

/// Buffers of a [`Reduced`], to be used again with another table.
#[derive(Clone, Debug)]
pub(crate) struct Buffers<T: ModelScalar> {
    ports: Vec<PortWork<T>>,
    frames: Vec<Frame<T>>,
}

impl<T: ModelScalar> Buffers<T> {
    pub(crate) fn new(model: &Model, source: &impl ArmSource<T>) -> Self {
        let ports = model.appendages();
        let frames = (0..ports.len()).map(|site| source.at_rest(site)).collect();
        Self { ports: ports.iter().map(PortWork::new).collect(), frames }
    }
}

impl<'a, T: ModelScalar, S: ArmSource<T>> Reduced<'a, T, S> {
    pub(crate) fn new(model: &'a Model, params: &'a Params<T>, source: &'a S) -> Self {
        Self::reuse(Buffers::new(model, source), model, params, source)
    }
    /// With the buffers of an earlier one of the same model; does not allocate.
    pub(crate) fn reuse(b: Buffers<T>, model: &'a Model, params: &'a Params<T>, source: &'a S) -> Self {
        Self { model, params, source, table: source.layout(), ports: b.ports, frames: b.frames }
    }
    /// Its buffers.
    pub(crate) fn into_buffers(self) -> Buffers<T> {
        Buffers { ports: self.ports, frames: self.frames }
    }

    /// `u = [a | al | nu']` at state `z` and a node.
    ///
    /// # Errors
    /// The appendage whose mass matrix is not positive definite, or `None` for the base.
    #[inline(always)]
    pub(crate) fn accelerate(&mut self, node: usize, z: &[T], u: &mut [T]) -> Result<(), Option<usize>> {
        let (model, table) = (self.model, self.table);
        let m = model.np();
        let z = &z[..6 + 2 * m];
        let u = &mut u[..6 + m];
        let arm: Arm<T> = self.source.arm(node);
        let (v, w) = (V3::from_slice(z), V3::from_slice(&z[3..]));
        let (mut c, mut f, mut n) = at_zero_acceleration(&PackedInertia::from(self.params.body(0)), &arm, &w);
        let still = V3::zero();
        let field = M3::field(&w, &still);
        for (k, (ap, p)) in model.appendages().iter().zip(&mut self.ports).enumerate() {
            if let Site::Body(_, _, column) = table.sites[k] {
                self.frames[k] = self.source.frame(column, node);
            }
            let frame = &self.frames[k];
            let at = frame.carried(&w, &still, &still, &field);
            let v = frame.velocity(&v, &w);
            // Ports take the componentwise derivative of the twist.
            let a = at.a - at.w.cross(&v);
            let own = ap.coord_offset..ap.coord_offset + p.n;
            let (eta, nu) = (&z[6 + own.start..6 + own.end], &z[6 + m + own.start..6 + m + own.end]);
            let s = PortState { host: Motion { lin: v.into(), ang: at.w.into() }, eta, nu };
            let mut mass = PortMatrix::over(p.n, &mut p.m);
            T::port(&*ap.appendage).terms(self.params.appendage(model, k), &s, &mut mass, &mut p.h);
            p.rest(&a, &at.al);
            let (pf, pn) = frame.up(&V3::from_slice(&p.r), &V3::from_slice(&p.r[3..]));
            f += pf;
            n += pn;
            c.add(&hung(frame, p));
            for j in 0..p.n {
                let (pf, pn) = p.mass().coupling(j);
                p.g[j] = frame.up(&pf, &pn);
            }
        }
        let (a, al) = condense::base_acceleration(&mut self.ports, &c, &f, &n)?;
        a.write_to(u);
        al.write_to(&mut u[3..]);
        for (ap, p) in model.appendages().iter().zip(&self.ports) {
            p.respond(Some((&a, &al)), &mut u[6 + ap.coord_offset..]);
        }
        Ok(())
    }

    /// Joint torques at a sample, after [`Reduced::accelerate`] at its node.
    #[inline(always)]
    pub(crate) fn torques(&self, sample: usize, z: &[T], u: &[T], tau: &mut [T]) {
        let (w, a, al) = (V3::from_slice(&z[3..]), V3::from_slice(u), V3::from_slice(&u[3..]));
        let ww = products(&w);
        for (j, t) in tau.iter_mut().enumerate() {
            *t = self.source.row(sample, j).form.value(&a, &al, &w, &ww);
        }
        for k in 0..self.ports.len() {
            let host = self.model.appendages()[k].host;
            if host > 0 {
                let (f, n) = self.wrench(k, z, u);
                let (f, n) = self.frames[k].up(&f, &n);
                for &j in &self.table.above[host] {
                    tau[j] += self.source.row(sample, j).of(&f, &n);
                }
            }
        }
    }

    /// Power that the dampers take out at rates `nu` (W).
    #[inline(always)]
    pub(crate) fn dissipated_power(&self, z: &[T]) -> T {
        let nu = &z[6 + self.model.np()..];
        let mut power = T::zero();
        for (k, ap) in self.model.appendages().iter().enumerate() {
            let own = &nu[ap.coord_offset..ap.coord_offset + ap.dim()];
            power += T::port(&*ap.appendage).dissipated_power(self.params.appendage(self.model, k), own);
        }
        power
    }

    /// Wrench on the mount of port `k` in its axes, after [`Reduced::accelerate`].
    #[inline(always)]
    fn wrench(&self, k: usize, z: &[T], u: &[T]) -> (V3<T>, V3<T>) {
        let (ap, p, frame) = (&self.model.appendages()[k], &self.ports[k], &self.frames[k]);
        let (v, w) = (V3::from_slice(z), V3::from_slice(&z[3..]));
        let (a, al) = (V3::from_slice(u), V3::from_slice(&u[3..]));
        let at = frame.carried(&w, &al, &a, &M3::field(&w, &al));
        let lin = at.a - at.w.cross(&frame.velocity(&v, &w));
        let m = p.mass();
        let (f, n) = m.host().momentum(&lin, &at.al);
        let (mut f, mut n) = (f + V3::from_slice(&p.h), n + V3::from_slice(&p.h[3..]));
        for (k, &x) in u[6 + ap.coord_offset..][..p.n].iter().enumerate() {
            let (pf, pn) = m.coupling(k);
            (f, n) = (pf.scale_add(x, &f), pn.scale_add(x, &n));
        }
        (f, n)
    }
}

impl<T: ModelScalar> Reduced<'_, T> {
    /// Power of the joint torques, `sum_j tau_j qd_j`, after [`Reduced::accelerate`] at this node.
    #[inline(always)]
    pub(crate) fn joint_power(&self, node: usize, z: &[T], u: &[T]) -> T {
        let (w, a, al) = (V3::from_slice(&z[3..]), V3::from_slice(u), V3::from_slice(&u[3..]));
        let mut power = self.table.power::<T>(node).value(&a, &al, &w, &products(&w));
        for k in 0..self.ports.len() {
            let frame = &self.frames[k];
            if frame.moving {
                let (f, n) = self.wrench(k, z, u);
                power += f.dot(&frame.down(&frame.dp)) + n.dot(&frame.down(&frame.w));
            }
        }
        power
    }
}

/// Base body and arm together, and the wrench they ask for at angular velocity `w` without acceleration.
#[inline(always)]
pub(crate) fn at_zero_acceleration<T: ModelScalar>(
    base: &PackedInertia<T>,
    arm: &Arm<T>,
    w: &V3<T>,
) -> (PackedInertia<T>, V3<T>, V3<T>) {
    let mut c = arm.ten;
    c.add(base);
    let f = w.cross_add(&w.cross_add(&c.h, &arm.dh2), &arm.ddh);
    let n = w.cross_add(&c.i.mul(w), &arm.c.mul_add(w, &arm.dl));
    (c, f, n)
}

/// The host block of a port as a body in base coordinates.
#[inline(always)]
pub(crate) fn hung<T: ModelScalar>(frame: &Frame<T>, p: &PortWork<T>) -> PackedInertia<T> {
    use ff_model::spatial::vec3::{RotationKind, turn};
    match frame.pose.turn {
        RotationKind::None => frame.pose.body_up::<{ turn::NONE }>(&p.mass().host()),
        _ => frame.pose.body_up::<{ turn::ANY }>(&p.mass().host()),
    }
}

/// Checks that the reduced system applies.
pub(crate) fn check(model: &Model) -> Result<(), ReducedError> {
    if model.base_kind() != BaseKind::Floating || model.gravity().norm() != 0.0 {
        return Err(ReducedError::NotFreeFloating);
    }
    Ok(())
}

/// Nodes of the stages of the classical Runge-Kutta method, in half steps. Each stage starts from the rates of the one before.
pub const STAGE: [usize; 4] = [0, 1, 1, 2];
/// Weights of its stages in the step.
pub const WEIGHT: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// Classical RK4 over samples of the table, which are counted from the first of them. The state at the end. With a place
/// for what fails in each lane, the others go on where the state of one is no longer finite.
#[inline(always)]
pub(crate) fn integrate<T: LaneScalar, S: ArmSource<T>>(
    sys: &mut Reduced<'_, T, S>,
    z0: &[T],
    span: Range<usize>,
    lost: Option<&mut Lost>,
    follow: impl Follow<T>,
) -> Result<Vec<T>, ReducedError> {
    T::enter(Integrate { sys, z0, span, lost, follow })
}

/// What failed in each lane.
pub(crate) type Lost = [Option<ReducedError>; WIDEST];

struct Integrate<'a, 'b, T: LaneScalar, S, F> {
    sys: &'a mut Reduced<'b, T, S>,
    z0: &'a [T],
    span: Range<usize>,
    lost: Option<&'a mut Lost>,
    follow: F,
}

impl<T: LaneScalar, S: ArmSource<T>, F: Follow<T>> Kernel for Integrate<'_, '_, T, S, F> {
    type Output = Result<Vec<T>, ReducedError>;
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { sys, z0, span, mut lost, mut follow } = self;
        let table = sys.table;
        let mut rk = Rk4::new(sys.model, z0);
        let last = (table.samples - 1) * table.substeps;
        // One call of `stage`: it is inlined, once per instruction set.
        for step in span.start * table.substeps..(span.end * table.substeps).min(last + 1) {
            if let Some(lost) = lost.as_ref().filter(|lost| lost.iter().any(Option::is_some)) {
                rk.rest(lost);
            }
            for stage in 0..4 {
                let t = table.start_s() + 0.5 * table.step * (2 * step + STAGE[stage]) as f64;
                let sample = stage == 0 && step % table.substeps == 0;
                loop {
                    let done = rk.stage(sys, step, stage).map_err(|_| rk.failure(t, table.step));
                    let done = done.and_then(|()| if sample { rk.sample(sys, step / table.substeps) } else { Ok(()) });
                    let Err(e) = done else { break };
                    if !lost.as_mut().is_some_and(|lost| rk.goes_on(lost, &e)) {
                        return Err(e);
                    }
                }
                follow.stage(&rk.zs, &rk.u);
                if sample {
                    follow.sample(step / table.substeps - span.start, &rk.zs, &rk.u, &rk.tau);
                    if step == last {
                        break;
                    }
                }
                rk.rate(table.step, stage);
            }
            if step < last {
                rk.finish();
            }
        }
        Ok(rk.z)
    }
}

/// One step of the classical Runge-Kutta method at a time, with its buffers.
#[derive(Clone, Debug)]
pub(crate) struct Rk4<T> {
    m: usize,
    /// State at the beginning of the step.
    pub(crate) z: Vec<T>,
    /// State and accelerations of the present stage, joint torques of the present sample.
    pub(crate) zs: Vec<T>,
    pub(crate) u: Vec<T>,
    pub(crate) tau: Vec<T>,
    k: Vec<T>,
    sum: Vec<T>,
}

impl<T: ModelScalar> Rk4<T> {
    pub(crate) fn new(model: &Model, z0: &[T]) -> Self {
        let (m, o) = (model.np(), T::zero());
        let z = z0.to_vec();
        let (zs, k, sum) = (z.clone(), z.clone(), z.clone());
        Self { m, z, zs, u: vec![o; 6 + m], tau: vec![o; model.nj()], k, sum }
    }
    /// Evaluates a stage of a step. Errors as [`Reduced::accelerate`].
    #[inline(always)]
    pub(crate) fn stage<S: ArmSource<T>>(
        &mut self,
        sys: &mut Reduced<'_, T, S>,
        step: usize,
        stage: usize,
    ) -> Result<(), Option<usize>> {
        let node = 2 * step + STAGE[stage];
        let h = sys.table.step;
        let c = T::from_f64(0.5 * h * STAGE[stage] as f64);
        for ((s, &z), &k) in self.zs.iter_mut().zip(&self.z).zip(&self.k) {
            *s = if stage == 0 { z } else { c.mul_add(k, z) };
        }
        sys.accelerate(node, &self.zs, &mut self.u)
    }
    /// Why a stage cannot be evaluated.
    #[cold]
    fn failure(&self, t: f64, step: f64) -> ReducedError {
        let finite = self.zs.iter().all(|x| x.is_finite());
        if finite { ReducedError::Singular { t } } else { ReducedError::NotFinite { t, step } }
    }
    /// Keeps lanes that are lost at rest.
    #[cold]
    #[inline(never)]
    fn rest(&mut self, lost: &Lost)
    where
        T: LaneScalar,
    {
        for lane in (0..T::N).filter(|&lane| lost[lane].is_some()) {
            self.z.iter_mut().for_each(|x| x.set_lane(lane, 0.0));
        }
    }
    /// Puts lanes whose state is no longer finite at rest, and says whether that leaves any.
    #[cold]
    #[inline(never)]
    fn goes_on(&mut self, lost: &mut Lost, why: &ReducedError) -> bool
    where
        T: LaneScalar,
    {
        let mut some = false;
        for (lane, lost) in lost[..T::N].iter_mut().enumerate() {
            if self.zs.iter().any(|x| !x.lane(lane).is_finite()) {
                lost.get_or_insert_with(|| why.clone());
                let all = [&mut self.z, &mut self.zs, &mut self.k, &mut self.sum];
                all.into_iter().flatten().for_each(|x| x.set_lane(lane, 0.0));
                some = true;
            }
        }
        some && lost[..T::N].iter().any(Option::is_none)
    }
    /// Joint torques at a sample, and whether the state is finite there; after its stage 0.
    #[inline(always)]
    pub(crate) fn sample<S: ArmSource<T>>(
        &mut self,
        sys: &Reduced<'_, T, S>,
        sample: usize,
    ) -> Result<(), ReducedError> {
        sys.torques(sample, &self.zs, &self.u, &mut self.tau);
        if self.zs.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(ReducedError::NotFinite {
            t: sys.table.start_s() + sample as f64 * sys.table.sample_s,
            step: sys.table.step,
        })
    }
    /// Takes the rates of the present stage in.
    #[inline(always)]
    pub(crate) fn rate(&mut self, h: f64, stage: usize) {
        let (m, weight) = (self.m, T::from_f64(WEIGHT[stage] * h));
        let (v, w) = (V3::from_slice(&self.zs), V3::from_slice(&self.zs[3..]));
        let mut lin = [T::zero(); 3];
        (V3::from_slice(&self.u) - w.cross(&v)).write_to(&mut lin);
        // `z' = [a - w x v | al | nu | nu']`.
        let (k, sum) = (&mut self.k[..6 + 2 * m], &mut self.sum[..6 + 2 * m]);
        let parts = [(0, &lin[..]), (3, &self.u[3..6]), (6, &self.zs[6 + m..6 + 2 * m]), (6 + m, &self.u[6..6 + m])];
        for (at, x) in parts {
            let places = k[at..at + x.len()].iter_mut().zip(&mut sum[at..at + x.len()]);
            // Rates and their sums in one loop: of a copy alone the compiler makes a call.
            for ((k, s), &x) in places.zip(x) {
                *k = x;
                *s = if stage == 0 { weight * x } else { weight.mul_add(x, *s) };
            }
        }
    }
    /// Ends the step.
    #[inline(always)]
    pub(crate) fn finish(&mut self) {
        self.z.iter_mut().zip(&self.sum).for_each(|(z, &d)| *z += d);
    }
}

impl<T: Scalar> Response<T> {
    pub(crate) fn new(samples: usize, nj: usize, m: usize) -> Self {
        let z = |c| DMatrix::zeros(samples, c);
        Self { tau: z(nj), twist: z(6), accel: z(6), eta: z(m), nu: z(m) }
    }
    /// With the torques of the coordinates in place of those of the joints of the tree.
    pub(crate) fn folded(map: &Coordinates, r: Self) -> Self {
        Self { tau: coupled::columns(map, &r.tau), ..r }
    }
    pub(crate) fn write(&mut self, i: usize, m: usize, z: &[T], u: &[T], tau: &[T]) {
        let fill = |d: &mut DMatrix<T>, x: &[T]| x.iter().enumerate().for_each(|(k, &v)| d[(i, k)] = v);
        fill(&mut self.tau, tau);
        fill(&mut self.twist, &z[..6]);
        let (v, w) = (V3::from_slice(z), V3::from_slice(&z[3..]));
        let mut accel = [u[0], u[1], u[2], u[3], u[4], u[5]];
        (V3::from_slice(u) - w.cross(&v)).write_to(&mut accel);
        fill(&mut self.accel, &accel);
        fill(&mut self.eta, &z[6..6 + m]);
        fill(&mut self.nu, &z[6 + m..]);
    }
    /// Base rates (rad/s), `N x 3`.
    pub fn gyro(&self) -> DMatrix<T> {
        self.twist.columns(3, 3).into_owned()
    }
}
