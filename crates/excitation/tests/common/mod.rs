//! Plans and stand-in models shared by the tests.
#![allow(dead_code, clippy::unwrap_used)]

use excitation::*;
use nalgebra::DMatrix;

pub(crate) fn limits(n: usize) -> Vec<JointLimits> {
    (0..n)
        .map(|i| JointLimits {
            lower: -1.9 + 0.1 * i as f64,
            upper: 2.3 - 0.07 * i as f64,
            velocity: 0.17 + 0.02 * i as f64,
            acceleration: 0.15 + 0.01 * i as f64,
            jerk: (i % 2 == 1).then_some(0.4),
        })
        .collect()
}

pub(crate) fn spec(n: usize, free: usize) -> PlanSpec {
    PlanSpec {
        start: (0..n).map(|i| 0.2 + 0.1 * i as f64).collect(),
        end: End::Fixed((0..n).map(|i| 0.3 - 0.13 * i as f64).collect()),
        duration: Duration::Fixed(19.0),
        degree: 5,
        free,
        limits: limits(n),
        refine: 1,
    }
}

/// Base acceleration `a_r = sum_i cos(k_ri + q_i) qdd_i - sin(k_ri + q_i) qd_i^2`: momentum-like, made up.
pub(crate) struct Toy(pub(crate) usize);

fn phase(r: usize, i: usize) -> f64 {
    0.7 * r as f64 + 1.3 * i as f64 + 0.4
}

impl BaseResponse for Toy {
    fn dof(&self) -> usize {
        self.0
    }
    fn base_acceleration(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6]) {
        self.partials(q, qd, qdd, out, &mut BasePartials::new(self.0));
    }
    fn partials(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6], d: &mut BasePartials) {
        for r in 0..6 {
            out[r] = 0.0;
            for i in 0..self.0 {
                let (s, c) = (phase(r, i) + q[i]).sin_cos();
                out[r] += c * qdd[i] - s * qd[i] * qd[i];
                d.q[(r, i)] = -s * qdd[i] - c * qd[i] * qd[i];
                d.qd[(r, i)] = -2.0 * s * qd[i];
                d.qdd[(r, i)] = c;
            }
        }
    }
}

/// A 7-row, 12-parameter regressor-like source: `Y_rp = s_p (cos(phase + q_k) qdd_j + sin(phase + q_k) qd_j qd_k)`
/// with `j = (r + p) mod n`, `k = (r + 2 p + 1) mod n`. `analytic` chooses the gradient.
pub(crate) struct ToyRegressor {
    pub(crate) n: usize,
    pub(crate) analytic: bool,
}

impl SampleInformation for ToyRegressor {
    fn parameters(&self) -> usize {
        12
    }
    fn rows(&self) -> usize {
        self.n
    }
    fn rows_at(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut DMatrix<f64>) {
        for r in 0..self.n {
            for p in 0..12 {
                let (j, k) = ((r + p) % self.n, (r + 2 * p + 1) % self.n);
                let (s, c) = (phase(r, p) + q[k]).sin_cos();
                out[(r, p)] = 10.0 / (1.0 + p as f64) * (c * qdd[j] + s * qd[j] * qd[k]);
            }
        }
    }
    fn contract(&self, state: [&[f64]; 3], w: &DMatrix<f64>, gradient: [&mut [f64]; 3]) {
        if !self.analytic {
            return Numeric(self).contract(state, w, gradient);
        }
        let [q, qd, qdd] = state;
        let [gq, gqd, gqdd] = gradient;
        for r in 0..self.n {
            for p in 0..12 {
                let (j, k) = ((r + p) % self.n, (r + 2 * p + 1) % self.n);
                let (s, c) = (phase(r, p) + q[k]).sin_cos();
                let f = w[(r, p)] * 10.0 / (1.0 + p as f64);
                gq[k] += f * (-s * qdd[j] + c * qd[j] * qd[k]);
                gqd[j] += f * s * qd[k];
                gqd[k] += f * s * qd[j];
                gqdd[j] += f * c;
            }
        }
    }
}

/// The same source with its gradient by differences.
struct Numeric<'a>(&'a ToyRegressor);

impl SampleInformation for Numeric<'_> {
    fn parameters(&self) -> usize {
        self.0.parameters()
    }
    fn rows(&self) -> usize {
        self.0.rows()
    }
    fn rows_at(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut DMatrix<f64>) {
        self.0.rows_at(q, qd, qdd, out);
    }
    fn contract(&self, state: [&[f64]; 3], weights: &DMatrix<f64>, gradient: [&mut [f64]; 3]) {
        contract_by_differences(self.0, state, weights, gradient);
    }
}

/// [`SampleInformation::contract`] by central differences: what the exact ones are held to.
pub(crate) fn contract_by_differences(
    source: &dyn SampleInformation,
    state: [&[f64]; 3],
    weights: &DMatrix<f64>,
    gradient: [&mut [f64]; 3],
) {
    let mut at = state.map(<[f64]>::to_vec);
    let mut plus = DMatrix::zeros(source.rows(), source.parameters());
    let mut minus = plus.clone();
    for (k, out) in gradient.into_iter().enumerate() {
        for j in 0..out.len() {
            let x = at[k][j];
            // Cube root of machine precision balances truncation against rounding.
            let h = 6e-6 * (1.0 + x.abs());
            at[k][j] = x + h;
            source.rows_at(&at[0], &at[1], &at[2], &mut plus);
            at[k][j] = x - h;
            source.rows_at(&at[0], &at[1], &at[2], &mut minus);
            at[k][j] = x;
            out[j] += (plus.dot(weights) - minus.dot(weights)) / (2.0 * h);
        }
    }
}

/// A mission of `fixtures/paper`.
pub(crate) fn paper(file: &str) -> ff_mission::Loaded {
    let mut registry = ff_model::Registry::new();
    flex_panel::register(&mut registry);
    slosh_pendulum::register(&mut registry);
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/paper").join(file);
    ff_mission::Mission::load(&path, &registry, &ff_mission::LoadOptions::default()).unwrap()
}

/// `n` repeatable numbers in `-size..size`.
pub(crate) fn uniform(n: usize, size: f64, seed: u64) -> Vec<f64> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| size * (2.0 * rng.random::<f64>() - 1.0)).collect()
}

/// The base of the paper's robot: 60 s at the mission's 0.17 rad/s and 0.15 rad/s^2, ten control points.
pub(crate) fn request(loaded: &ff_mission::Loaded, starts: usize) -> InformationRequest {
    let limits = loaded
        .model
        .bodies()
        .iter()
        .map(|b| JointLimits { velocity: 0.17, ..JointLimits::from_model(&b.joint.limits, 0.15) });
    let start = loaded.mission.reproduce.as_ref().unwrap().hold_rad.clone();
    InformationRequest {
        end: End::Fixed(start.clone()),
        start,
        limits: limits.collect(),
        duration: 60.0,
        control_points: 10,
        seed: 1,
        starts,
        noise: SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 },
        options: SqpOptions::default(),
    }
}
