//! What the true system makes of a motion: torques, base rates, modes, and the bias of a rigid fit.

use anyhow::Context;
use excitation::SensorNoise;
use excitation::objective::DrivenMode;
use excitation::system::driven_modes;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Boundary, Mode, Prescribed, Response, Sampling, Wanted, modes, reduced_torques, simulate_reduced};
use ff_least_squares::Settings;
use ff_model::{Inertia, Model, Params};
use ff_records::RecordBuilder;
use ident::estimate::attempt;
use ident::{Noise, Rda, Request};
use nalgebra::{DMatrix, DVector, Vector3};
use std::f64::consts::TAU;

/// Sample time of simulated records (s): the mission's 100 Hz.
pub(super) const SAMPLE_S: f64 = 0.01;

/// The flexible system along a motion, from rest.
pub(super) fn simulate(model: &Model, params: &Params<f64>, motion: &dyn JointMotion) -> anyhow::Result<Response> {
    let samples = (motion.duration() / SAMPLE_S).round() as usize + 1;
    let table = Prescribed::new(model, params, motion, &Sampling { samples, sample_s: SAMPLE_S, substeps: 1 }, &[]);
    let mut z0 = vec![0.0; 6 + 2 * model.np()];
    z0[6..6 + model.np()].copy_from_slice(&model.rest_position(params));
    Ok(simulate_reduced(model, params, &table, &z0)?)
}

/// Errors of mass, centre of mass and inertia of the base, relative to the mass, to the distance of the centre of mass and
/// to the norm of the inertia about it (panels frozen to the base).
pub(super) struct Bias {
    /// What the fit ends with.
    pub(super) fit: [f64; 3],
    /// Its first step from the truth: `(J^T J)^-1 J^T (tau - tau_rigid)`. Where the fit runs away this still tells how hard
    /// the panels push it.
    pub(super) linear: [f64; 3],
}

impl Bias {
    /// The larger ones of mass, centre of mass and inertia.
    pub(super) fn worst(&self) -> [f64; 2] {
        [self.fit, self.linear].map(|b| b.into_iter().fold(0.0, f64::max))
    }
}

/// The bias of a rigid fit (reduced dynamics algorithm) to the noise-free record of the flexible system.
pub(super) fn rigid_bias(
    model: &Model,
    params: &Params<f64>,
    motion: &dyn JointMotion,
    noise: SensorNoise,
) -> anyhow::Result<Bias> {
    let response = simulate(model, params, motion)?;
    let (samples, n) = (response.tau.nrows(), model.nj());
    let (mut q, mut qd, mut qdd) = (DMatrix::zeros(samples, n), DMatrix::zeros(samples, n), DMatrix::zeros(samples, n));
    let mut x = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    for i in 0..samples {
        let [a, b, c] = &mut x;
        motion.eval(SAMPLE_S * i as f64, a, b, c);
        for j in 0..n {
            (q[(i, j)], qd[(i, j)], qdd[(i, j)]) = (a[j], b[j], c[j]);
        }
    }
    let gyro = response.twist.columns(3, 3).into_owned();
    let rigid = model.frozen(params);
    let truth = Params::nominal(&rigid);
    let selected: Vec<usize> = (0..10).collect();
    let sampling = Sampling { samples, sample_s: SAMPLE_S, substeps: 1 };
    let table = Prescribed::new(&rigid, &truth, motion, &sampling, &[]);
    let wanted = Wanted { params: selected.clone(), ..Wanted::default() };
    let (tau, jacobian) = reduced_torques(&rigid, &truth, &table, &gyro, &wanted)?;
    let residual = DVector::from_fn(samples * n, |k, _| response.tau[(k / n, k % n)] - tau[(k / n, k % n)]);
    let normal = jacobian.tr_mul(&jacobian);
    let scale: Vec<f64> = normal.diagonal().iter().map(|x| 1.0 / x.sqrt()).collect();
    let scaled = DMatrix::from_fn(10, 10, |i, j| normal[(i, j)] * scale[i] * scale[j]);
    let right = jacobian.tr_mul(&residual).component_mul(&DVector::from_column_slice(&scale));
    let step = scaled.cholesky().context("the torques do not tell all ten parameters")?.solve(&right);
    let small = 1e-7;
    let moved: Vec<f64> = (0..10).map(|i| truth.values()[i] + small * step[i] * scale[i]).collect();
    let linear = errors(&Inertia::from_params(&moved), truth.body(0))?.map(|e| e / small);
    let record = RecordBuilder::new(model.joint_names()).uniform(0.0, 1.0 / SAMPLE_S).allow("Data::Stuck");
    let record = record.q(q).qd(qd).qdd(qdd).tau(response.tau).gyro(gyro).build()?.0;
    let decls = rigid.param_decls();
    let noise = Noise { torque: noise.torque, gyro: noise.gyro.unwrap_or(1.0) };
    let mut rda = Rda::new(&rigid, &record, &noise)?;
    let request = Request {
        settings: Settings { max_iterations: 100, ..Settings::default() },
        ..Request::new(&decls, &selected, truth.values())
    };
    let e = attempt(&request, &mut rda)?;
    Ok(Bias { fit: errors(&Inertia::from_params(&e.values[..10]), truth.body(0))?, linear })
}

fn errors(found: &Inertia<f64>, want: &Inertia<f64>) -> anyhow::Result<[f64; 3]> {
    let com = |b: &Inertia<f64>| b.com().context("a base without mass");
    let (c, c0) = (com(found)?, com(want)?);
    let (i, i0) = (found.about_com(), want.about_com());
    Ok([(found.mass / want.mass - 1.0).abs(), (c - c0).norm() / c0.norm(), (i - i0).norm() / i0.norm()])
}

/// The modes at the configuration where the motion begins, and what they do along it.
pub(super) struct Swing {
    shapes: Vec<Mode>,
    driven: Vec<DrivenMode>,
    /// Largest torque per unit of modal acceleration (N m s^2).
    load: Vec<f64>,
}

impl Swing {
    pub(super) fn new(model: &Model, params: &Params<f64>, q: &[f64], noise: SensorNoise) -> anyhow::Result<Self> {
        let rest = model.rest_position(params);
        let shapes = modes(model, params, q, &rest, Boundary::JointsHeld)?;
        let driven = driven_modes(model, params, q, &noise)?;
        // Torque of a unit modal acceleration with the joints held: the torques of the accelerations of shape and base.
        let mut load = Vec::new();
        let mut state = ff_dynamics::State::zero(model);
        state.q.copy_from_slice(q);
        state.eta.copy_from_slice(&rest);
        let mut h = DMatrix::zeros(model.nv(), model.nv());
        ff_dynamics::mass_matrix(model, params, &state, &mut ff_dynamics::Work::new(model), &mut h);
        for m in &shapes {
            let mut a = DVector::zeros(model.nv());
            a.rows_mut(0, 6).copy_from(&m.base);
            for (i, x) in m.passive.iter().enumerate() {
                a[6 + model.nj() + i] = *x;
            }
            load.push((&h * a).rows(6, model.nj()).amax());
        }
        Ok(Self { shapes, driven, load })
    }
    pub(super) fn driven(&self) -> &[DrivenMode] {
        &self.driven
    }
    /// The first mode of wings that bend to the same side: the base translates; and of those that bend to opposite
    /// sides: it turns.
    pub(super) fn symmetric(&self) -> Option<usize> {
        self.shapes.iter().position(|m| !turns(m))
    }
    pub(super) fn antisymmetric(&self) -> Option<usize> {
        self.shapes.iter().position(turns)
    }
    /// Modal coordinates and rates over a record.
    fn modal(&self, r: &Response, mode: usize) -> Option<Vec<(f64, f64)>> {
        let n = self.shapes.len();
        let basis = DMatrix::from_fn(n, n, |i, m| self.shapes[m].passive[i]).try_inverse()?;
        let row = basis.row(mode).into_owned();
        let at = |i: usize| ((&row * r.eta.row(i).transpose())[0], (&row * r.nu.row(i).transpose())[0]);
        Some((0..r.eta.nrows()).map(at).collect())
    }
    /// Largest amplitude of a mode over the record (unit of the largest coordinate), and the amplitude of its line in the
    /// spectrum over the record, `2/T |int x exp(-i w t) dt|`.
    pub(super) fn response(&self, r: &Response, mode: usize) -> Option<(f64, f64)> {
        let w = TAU * self.shapes[mode].frequency_hz;
        let x = self.modal(r, mode)?;
        let largest = x.iter().map(|(x, v)| x.hypot(v / w)).fold(0.0, f64::max);
        let (mut re, mut im) = (0.0, 0.0);
        for (i, (x, _)) in x.iter().enumerate() {
            let (sin, cos) = (w * SAMPLE_S * i as f64).sin_cos();
            re += x * cos;
            im -= x * sin;
        }
        Some((largest, 2.0 * re.hypot(im) / x.len() as f64))
    }
    /// Largest torque amplitude (N m) of a mode that swings with `amplitude`.
    pub(super) fn torque(&self, mode: usize, amplitude: f64) -> f64 {
        self.load[mode] * (TAU * self.shapes[mode].frequency_hz).powi(2) * amplitude
    }
}

/// A point of the base moves by its turn or by its translation: compared at an arm of one metre about the frame origin.
fn turns(m: &Mode) -> bool {
    let part = |i: usize| Vector3::new(m.base[i], m.base[i + 1], m.base[i + 2]);
    part(3).norm() > 0.3 * part(0).norm()
}

/// Power of joint accelerations in a band (Hz), all joints together, relative units: `sum_j int |A_j|^2 df`.
pub(super) fn band_power(motion: &dyn JointMotion, low: f64, high: f64) -> f64 {
    let (n, t) = (motion.dof(), motion.duration());
    let dt = 0.02;
    let samples = (t / dt).round() as usize;
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut all = Vec::with_capacity(samples + 1);
    for i in 0..=samples {
        motion.eval(t * i as f64 / samples as f64, &mut q, &mut qd, &mut qdd);
        all.push(qdd.clone());
    }
    let step = 0.25 / t;
    let lines = ((high - low) / step).ceil() as usize;
    let mut power = 0.0;
    for k in 0..lines {
        let w = TAU * (low + (k as f64 + 0.5) * step);
        let mut sums = vec![(0.0, 0.0); n];
        for (i, a) in all.iter().enumerate() {
            let (sin, cos) = (w * t * i as f64 / samples as f64).sin_cos();
            for (s, a) in sums.iter_mut().zip(a) {
                *s = (s.0 + a * cos, s.1 - a * sin);
            }
        }
        power += sums.iter().map(|(re, im)| re * re + im * im).sum::<f64>() * step;
    }
    power
}
