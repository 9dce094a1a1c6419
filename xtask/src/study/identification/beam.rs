//! A wing that is a beam, and the three hinges that a mission makes of it.
//!
//! The robot of `fixtures/verdict` with another wing: a cantilevered beam of length `L` and bending stiffness `EI`, of twelve segments in the
//! world and of three in the mission. A chain of `n` segments of length `h = L / n` has springs of `EI / h` between them and `2 EI / h` at
//! the root, where half a segment bends; dampers in proportion. Along the motions of a slow arm little but the first mode of the
//! beam rings, so that three hinges explain the records, along a flat valley: three springs for one mode.

use crate::workspace;
use ff_dynamics::measure;
use ff_dynamics::motion::JointMotion;
use ff_mission::{LoadOptions, Mission};
use ff_model::{Model, Params};
use ff_records::{Record, RecordBuilder};
use ffid::sense::{fly, suite};
use flex_panel::{PanelChain, Segment};
use ident::Noise;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Length, width and thickness (m), mass (kg), bending stiffness (N m^2), and damping over stiffness (s).
const LENGTH: f64 = 3.1;
const WIDTH: f64 = 1.1;
const THICKNESS: f64 = 0.05;
const MASS: f64 = 18.9;
const BENDING: f64 = 220.0;
const DAMPING: f64 = 0.005;
/// Segments in the world and in the mission.
const WORLD: usize = 12;
const MISSION: usize = 3;
/// The two records: motion (s), and rest after it in which the wing rings.
const RECORDS: [(f64, f64); 2] = [(72.0, 18.0), (56.0, 14.0)];

/// The mission's model, and records of the world.
pub(super) struct Beam {
    pub(super) model: Model,
    pub(super) noise: Noise,
    pub(super) records: Vec<Record>,
}

impl Beam {
    /// Simulates the world; sensors have the noise of the mission.
    ///
    /// # Errors
    /// Of the mission, the plans and the simulations.
    pub(super) fn new(sample_s: f64, seed: u64) -> anyhow::Result<Self> {
        let file = workspace::root()?.join("fixtures/verdict/truth.toml");
        let loaded = Mission::load(&file, &ffid::default_registry(), &LoadOptions::default())?;
        let sensors = suite(&loaded.mission.sensors);
        let noise = Noise { torque: sensors.torque.sigma(), gyro: sensors.gyro.sigma() };
        let [world, model] = [WORLD, MISSION].map(|n| winged(&loaded.model, n));
        let (world, model) = (world?, model?);
        let hold = loaded.mission.excite.start_rad.clone();
        let truth = Params::nominal(&world);
        let mut records = Vec::new();
        for (k, (duration, hold_s)) in RECORDS.into_iter().enumerate() {
            let seed = seed.wrapping_add(k as u64);
            let motion = Tones::draw(&hold, duration, seed);
            let trace = fly(&world, &truth, &motion, &[], 1.0 / sample_s, hold_s)?;
            let read = measure(&trace, &sensors, seed);
            let b = RecordBuilder::new(world.joint_names()).uniform(0.0, 1.0 / sample_s).allow("Data::Stuck");
            let b = b.q(trace.q.clone()).qd(trace.qd.clone()).qdd(trace.qdd.clone()).tau(read.tau).gyro(read.gyro);
            records.push(b.build()?.0);
        }
        Ok(Self { model, noise, records })
    }
}

/// The model with its wing made of so many segments.
fn winged(model: &Model, segments: usize) -> anyhow::Result<Model> {
    let mut out = model.without_appendages();
    for a in model.appendages() {
        let appendage = if a.name == "wing" { wing(segments)?.into() } else { a.appendage.clone() };
        out.mount(a.name.clone(), a.host, a.mount, appendage)?;
    }
    Ok(out)
}

/// The beam as so many segments.
fn wing(segments: usize) -> anyhow::Result<PanelChain> {
    let (h, mass) = (LENGTH / segments as f64, MASS / segments as f64);
    let plate = |a: f64, b: f64| mass * (a * a + b * b) / 12.0;
    let inertia = Matrix3::from_diagonal(&Vector3::new(plate(h, THICKNESS), plate(WIDTH, THICKNESS), plate(h, WIDTH)));
    let one = |k: usize| {
        let (hinge, stiffness) = match k {
            0 => (Vector3::new(0.03, 0.05, -0.02), 2.0 * BENDING / h),
            _ => (Vector3::new(0.0, h, 0.0), BENDING / h),
        };
        let com = Vector3::new(0.0, 0.5 * h, 0.0);
        Segment::new(mass, com, &inertia, hinge, Vector3::new(0.96, 0.0, 0.28))
            .with_spring(stiffness, DAMPING * stiffness)
    };
    Ok(PanelChain::new((0..segments).map(one).collect())?)
}

/// Sines of the joints under a window that rises and falls smoothly: `q = hold + w(t) sum a sin(2 pi f t + p)`.
struct Tones {
    hold: Vec<f64>,
    duration: f64,
    /// Per joint: amplitude (rad), angular frequency (rad/s), phase (rad).
    tones: Vec<Vec<[f64; 3]>>,
}

/// Sines per joint, their frequencies (Hz), and the joint rate (rad/s) that all of a joint may reach together.
const SINES: usize = 4;
const BAND: (f64, f64) = (0.03, 0.55);
const RATE: f64 = 0.3;

impl Tones {
    fn draw(hold: &[f64], duration: f64, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut sine = || {
            let w = TAU * BAND.0 * (BAND.1 / BAND.0).powf(rng.random::<f64>());
            [RATE / (SINES as f64 * w), w, TAU * rng.random::<f64>()]
        };
        let tones = hold.iter().map(|_| (0..SINES).map(|_| sine()).collect()).collect();
        Self { hold: hold.to_vec(), duration, tones }
    }
}

impl JointMotion for Tones {
    fn dof(&self) -> usize {
        self.hold.len()
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        // sin^4: three continuous derivatives at either end.
        let u = 0.5 * TAU / self.duration;
        let (s, c) = (u * t.clamp(0.0, self.duration)).sin_cos();
        let w = [s.powi(4), 4.0 * u * s.powi(3) * c, 4.0 * u * u * s * s * (3.0 * c * c - s * s)];
        for (j, tones) in self.tones.iter().enumerate() {
            let mut f = [0.0; 3];
            for [a, w, p] in tones {
                let (s, c) = (w * t + p).sin_cos();
                (f[0], f[1], f[2]) = (f[0] + a * s, f[1] + a * w * c, f[2] - a * w * w * s);
            }
            q[j] = self.hold[j] + w[0] * f[0];
            qd[j] = w[1] * f[0] + w[0] * f[1];
            qdd[j] = w[2] * f[0] + 2.0 * w[1] * f[1] + w[0] * f[2];
        }
    }
}
