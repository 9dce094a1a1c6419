//! The fill level, followed over a sequence of records while fuel is burnt between them.
//!
//! The tank is a cylinder; how much of its fuel sloshes follows from the fill (linear theory, `slosh_pendulum::geometry`), the rest sits
//! still in it. Between two records the thrusters have burnt an amount that nobody tells. Every record is short. Two estimates are kept:
//! each record by itself under the mission's prior, and the sequence, in which what the record before has told is the prior of the next
//! one, loosened by what may have been burnt. The fill is what base and sloshing mass have lost together.

use super::super::identify::{record, settings};
use super::super::system::System;
use super::SEED;
use anyhow::Context;
use ff_model::{Inertia, Params};
use ident::estimate::{Estimate, attempt};
use ident::parameters::{offset_start, select};
use ident::{Options, OutputError, Posterior, Priors, Request};
use nalgebra::{DMatrix, Vector3};
use serde::Serialize;
use slosh_pendulum::geometry::Tank;

/// Radius of the tank (m) and density of the fuel, hydrazine (kg/m^3).
const RADIUS_M: f64 = 0.45;
const DENSITY: f64 = 1010.0;
/// Fuel when the tank is full (kg).
const FULL_KG: f64 = 300.0;
/// Fill of each record.
const FILL: [f64; 7] = [0.95, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2];
/// Length of a record (s).
const RECORD_S: f64 = 12.0;
/// What may have been burnt between two records, as a standard deviation (kg).
const BURNT_KG: f64 = 40.0;

/// One record of the sequence. Fill levels are parts of a full tank, each estimate with its standard deviation.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Level {
    pub(crate) truth: f64,
    /// This record by itself.
    pub(crate) alone: (f64, f64),
    /// With what the records before have told.
    pub(crate) sequence: (f64, f64),
    /// Sloshing mass (kg): truth, and the estimate of the sequence.
    pub(crate) slosh_kg: (f64, f64, f64),
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Filling {
    pub(crate) record_s: f64,
    pub(crate) full_kg: f64,
    pub(crate) levels: Vec<Level>,
}

impl Filling {
    pub(super) fn run(s: &System) -> anyhow::Result<Self> {
        let model = s.model();
        let decls = model.param_decls();
        let selected = select(&decls, &["base.*", "tank.*"])?;
        let at = |name: &str| decls.iter().position(|d| d.name == name).with_context(|| name.to_owned());
        let (mass, slosh) = (at("base.mass")?, at("tank.mass")?);
        let dry = Inertia::from_params(&s.params.values()[..10]);
        let records = if s.quick { &FILL[..3] } else { &FILL[..] };
        let mut levels = Vec::new();
        let mut known: Option<(Posterior, Vec<f64>)> = None;
        for (k, fill) in (0u64..).zip(records) {
            let truth = filled(s, &dry, *fill, slosh)?;
            let motion = s.random(RECORD_S, (RECORD_S / 2.0) as usize, SEED + k)?;
            let trace = s.fly_for(&truth, &motion, RECORD_S)?;
            let seen = record(s, &trace, Some(SEED + k), 0)?;
            let options = Options { substeps: 1, ..Options::new(s.noise) };
            let mut estimator = OutputError::new(model, &seen, &options)?;
            // What the mission says, whatever has been burnt: half full, give or take.
            let nominal = filled(s, &dry, 0.5, slosh)?;
            let start = offset_start(&decls, nominal.values(), &selected, 0.1, SEED + k);
            let request = Request {
                prior_width: s.loaded.mission.estimate.prior_relative_std,
                settings: settings(),
                ..Request::new(&decls, &selected, &start)
            };
            let alone = attempt(&request, &mut estimator)?;
            let sequence = match &known {
                None => alone.clone(),
                Some((posterior, values)) => {
                    let loosened = loosen(s, posterior)?;
                    let priors = Priors::default().and(loosened.rows_for(&decls, &selected)?);
                    let request = Request { priors, settings: settings(), ..Request::new(&decls, &selected, values) };
                    attempt(&request, &mut estimator)?
                }
            };
            known = Some((Posterior::of(&sequence)?, sequence.values.clone()));
            let of = |e: &Estimate| fill_of(e, dry.mass, (mass, slosh), &selected);
            let slosh_std =
                column(&selected, slosh).map_or(f64::NAN, |c| sequence.uncertainty.covariance[(c, c)].sqrt());
            levels.push(Level {
                truth: *fill,
                alone: of(&alone),
                sequence: of(&sequence),
                slosh_kg: (truth.values()[slosh], sequence.values[slosh], slosh_std),
            });
        }
        Ok(Self { record_s: RECORD_S, full_kg: FULL_KG, levels })
    }
}

/// The satellite with its tank filled to a part: the sloshing mass, and the rest of the fuel as part of the base, at the fulcrum.
fn filled(s: &System, dry: &Inertia<f64>, fill: f64, slosh: usize) -> anyhow::Result<Params<f64>> {
    let fuel = fill * FULL_KG;
    let height = fuel / (DENSITY * core::f64::consts::PI * RADIUS_M * RADIUS_M);
    let tank = Tank::Cylinder { radius: RADIUS_M, fill: height }.model(DENSITY, 1)?;
    let moving = tank.modes.first().context("a mode of the tank")?.mass;
    let appendage = s.model().appendages().first().context("a tank")?;
    let fixed: Vector3<f64> = appendage.mount.pos;
    let base = *dry + Inertia::point(fuel - moving, &fixed);
    let mut values = s.params.values().to_vec();
    values[..10].copy_from_slice(&base.to_params());
    values[slosh] = moving;
    Ok(Params::from_values(s.model(), values))
}

/// What is still known after fuel has been burnt: masses by [`BURNT_KG`], moments by as much at the distance of the tank.
fn loosen(s: &System, p: &Posterior) -> anyhow::Result<Posterior> {
    let arm = s.model().appendages().first().map_or(1.0, |a| a.mount.pos.norm());
    let masses = p.loosen(&["base.mass", "tank.mass"], BURNT_KG)?;
    let moments = masses.loosen(&["base.h_*"], BURNT_KG * arm)?;
    Ok(moments.loosen(&["base.i_*"], BURNT_KG * arm * arm)?)
}

fn column(selected: &[usize], parameter: usize) -> Option<usize> {
    selected.iter().position(|&s| s == parameter)
}

/// Fill level and its deviation: what base and sloshing mass are more than the dry base, over the mass of a full tank.
fn fill_of(e: &Estimate, dry_kg: f64, (mass, slosh): (usize, usize), selected: &[usize]) -> (f64, f64) {
    let fuel = e.values[mass] - dry_kg + e.values[slosh];
    let covariance: &DMatrix<f64> = &e.uncertainty.covariance;
    let columns: Vec<usize> = [mass, slosh].iter().filter_map(|p| column(selected, *p)).collect();
    let variance: f64 = columns.iter().flat_map(|&i| columns.iter().map(move |&j| covariance[(i, j)])).sum();
    (fuel / FULL_KG, variance.max(0.0).sqrt() / FULL_KG)
}
