//! Sensors with biases, and torques that come late: what is lost when they are not among the unknowns.

use super::super::identify::settings;
use super::super::system::System;
use super::SEED;
use crate::delayed::delayed;
use ff_dynamics::measure;
use ff_dynamics::motion::JointMotion;
use ff_model::ParamDecl;
use ff_records::{Record, RecordBuilder};
use ident::estimate::{Estimate, attempt};
use ident::parameters::offset_start;
use ident::{Options, OutputError, Request};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Sampling of the simulation that torques are taken late from (s).
const FINE_S: f64 = 1e-3;
/// Delay of the torques, in fine samples.
const DELAY: usize = 3;
/// Biases are drawn from `-B .. B` (N m, rad/s).
const TORQUE_BIAS: f64 = 0.3;
const GYRO_BIAS: f64 = 5e-4;

/// A fit with biases and delay among the unknowns, or without.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SensorFit {
    pub(crate) with: bool,
    pub(crate) chi2_per_dof: f64,
    pub(crate) converged: bool,
    /// The estimate furthest from the truth, in its stated deviations.
    pub(crate) furthest: (String, f64),
    /// Part of the estimates that are within 1.96 of their stated deviations of the truth.
    pub(crate) covered: f64,
}

/// A bias or the delay: truth, estimate, its deviation.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Unknown {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) truth: f64,
    pub(crate) value: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) std: Option<f64>,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Sensors {
    pub(crate) fits: Vec<SensorFit>,
    pub(crate) unknowns: Vec<Unknown>,
}

impl Sensors {
    pub(super) fn run(s: &System, motion: &dyn JointMotion) -> anyhow::Result<Self> {
        let (record, errors) = recorded(s, motion)?;
        let decls = s.model().param_decls();
        let fits = [false, true].map(|with| fit(s, &record, &decls, with));
        let [plain, told] = fits;
        let (plain, told) = (plain?, told?);
        let unknowns = told.nuisance.iter().filter_map(|u| {
            let truth = errors.iter().find(|e| e.0 == u.name)?.1;
            Some(Unknown { name: u.name.clone(), unit: u.unit.clone(), truth, value: u.value, std: u.std })
        });
        let unknowns = unknowns.collect();
        Ok(Self { fits: vec![line(s, &decls, &plain, false), line(s, &decls, &told, true)], unknowns })
    }
}

/// The record, and what is wrong with it by name.
fn recorded(s: &System, motion: &dyn JointMotion) -> anyhow::Result<(Record, Vec<(String, f64)>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let joints = s.model().joint_names();
    let torque: Vec<f64> = joints.iter().map(|_| TORQUE_BIAS * rng.random_range(-1.0..1.0)).collect();
    let gyro: Vec<f64> = (0..3).map(|_| GYRO_BIAS * rng.random_range(-1.0..1.0)).collect();
    let fine = s.fly_sampled(motion, FINE_S)?;
    let sampled = delayed(&fine, (s.sample_s() / FINE_S).round() as usize, DELAY);
    let mut r = measure(&sampled, &s.sensors, SEED);
    r.tau.column_iter_mut().zip(&torque).for_each(|(mut c, b)| c.add_scalar_mut(*b));
    r.gyro.column_iter_mut().zip(&gyro).for_each(|(mut c, b)| c.add_scalar_mut(*b));
    let b = RecordBuilder::new(joints.clone()).uniform(0.0, 1.0 / sampled.dt).allow("Data::Stuck");
    let record = b.q(r.q).tau(r.tau).gyro(r.gyro).build()?.0;
    let mut errors: Vec<(String, f64)> =
        joints.iter().zip(torque).map(|(j, b)| (format!("torque.bias.{j}"), b)).collect();
    errors.extend(["x", "y", "z"].iter().zip(gyro).map(|(a, b)| (format!("gyro.bias.{a}"), b)));
    errors.push(("torque.delay".into(), DELAY as f64 * FINE_S));
    Ok((record, errors))
}

fn fit(s: &System, record: &Record, decls: &[ParamDecl], with: bool) -> anyhow::Result<Estimate> {
    let e = &s.loaded.mission.estimate;
    let selected = s.estimated(decls)?;
    let start = offset_start(decls, s.params.values(), &selected, e.start_offset, SEED);
    let nuisance = Options { substeps: 1, ..Options::new(s.noise) };
    let nuisance = Options { gyro_bias: with, torque_bias: with, torque_delay: with, ..nuisance };
    let mut estimator = OutputError::new(s.model(), record, &nuisance)?;
    let request =
        Request { prior_width: e.prior_relative_std, settings: settings(), ..Request::new(decls, &selected, &start) };
    Ok(attempt(&request, &mut estimator)?)
}

fn line(s: &System, decls: &[ParamDecl], e: &Estimate, with: bool) -> SensorFit {
    let truth = |name: &str| decls.iter().position(|d| d.name == name).map_or(f64::NAN, |i| s.params.values()[i]);
    let far = e.parameters.iter().filter_map(|p| Some((p.name.clone(), (p.value - truth(&p.name)).abs() / p.std?)));
    let far: Vec<(String, f64)> = far.collect();
    let covered = far.iter().filter(|f| f.1 <= 1.96).count() as f64 / far.len().max(1) as f64;
    let furthest = far.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
    SensorFit { with, chi2_per_dof: e.chi2_per_dof, converged: e.status.is_converged(), furthest, covered }
}
