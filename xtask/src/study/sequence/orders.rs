//! Records in orders of their own.
//!
//! Five records of the servicer of `fixtures/verdict`, from 12 s, which hardly shows the fuel, to a minute, are identified one after another
//! as by `ffid identify --prior-from`: each result keeps its records in a folder, and the next fit reads them from there. Each trial takes them
//! in an order of its own and compares the last result with that of all five at once.

use crate::study::figures::{Op, Study};
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use crate::study::verdict::world::{Encoder, RECORDS, World};
use anyhow::Context;
use ffid::files::folder::{About, Folder};
use ffid::workflow::identify::{IdentificationResult, LabelledRecord, keep, read_kept};
use nalgebra::DMatrix;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Orders that are tried.
const ORDERS: u64 = 10;
/// Lengths of the records (s).
const SECONDS: [f64; 5] = [12.0, 20.0, 30.0, 45.0, 60.0];
/// Most that a mean may differ from that of the joint fit, in deviations, and an element of the covariance, relative to the deviations.
const MEANS: f64 = 0.3;
const COVARIANCES: f64 = 0.15;

/// An order, and how far its end is from the joint fit.
#[derive(Serialize, Deserialize)]
struct Outcome {
    order: Vec<usize>,
    mean: Number,
    covariance: Number,
    /// Largest distance of the first step's estimates from the joint ones, in the deviations of the first step.
    first: Number,
}

/// Runs the part.
pub(super) fn run(world: &World, trials: &Trials, options: &Options, study: &mut Study) -> anyhow::Result<()> {
    let records = records(world, options.seed)?;
    let joint = world.identify_all(&world.start, &mut records.clone())?.result;
    let count = if options.quick { 2 } else { ORDERS };
    let outcomes = trials.run("orders", 0..count, |t| order(world, &records, &joint, t))?;
    let most = |of: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(of).fold(0.0, f64::max);
    study.figure("orders", "", outcomes.len() as f64);
    study.limited("orders.means", "deviations", most(&|o| o.mean.0), Op::AtMost, MEANS);
    study.limited("orders.covariances", "", most(&|o| o.covariance.0), Op::AtMost, COVARIANCES);
    study.figure("orders.first_steps", "deviations", most(&|o| o.first.0));
    Ok(())
}

/// The records, with noise of their own.
fn records(world: &World, seed: u64) -> anyhow::Result<Vec<LabelledRecord>> {
    let mut out = Vec::new();
    for (number, seconds) in (0..).zip(SECONDS) {
        let mut r = world.clean(RECORDS[number as usize % RECORDS.len()])?;
        world.noise(&mut r, Encoder::Noisy, &mut Trial { seed, number: ORDERS + number }.rng());
        let samples = ((seconds * r.rate_hz).round() as usize + 1).min(r.q.nrows());
        let first = |m: &DMatrix<f64>| m.rows(0, samples).into_owned();
        (r.q, r.qd, r.tau, r.gyro) = (first(&r.q), first(&r.qd), first(&r.tau), first(&r.gyro));
        out.push(world.labelled(&format!("r{number}"), &r)?);
    }
    Ok(out)
}

/// What a manifest says of a step.
fn about(seed: u64) -> About {
    About {
        program: "xtask study sequence".to_owned(),
        command: "identify".to_owned(),
        seed,
        settings: BTreeMap::new(),
        units: String::new(),
        input: Vec::new(),
    }
}

/// One order, to its end.
fn order(world: &World, records: &[LabelledRecord], joint: &IdentificationResult, t: Trial) -> anyhow::Result<Outcome> {
    let (model, folder) = (&world.start.model, tempfile::tempdir()?);
    let mut order: Vec<usize> = (0..records.len()).collect();
    order.shuffle(&mut t.rng());
    let (mut kept, mut at, mut first) = (Vec::new(), folder.path().join("none"), None);
    let mut last = None;
    for (step, &k) in order.iter().enumerate() {
        let mut of = vec![records[k].clone()];
        of.extend(read_kept(&at, &kept, model, &[])?);
        let found = world.identify_all(&world.start, &mut of)?.result;
        let next = folder.path().join(step.to_string());
        let out = Folder::begin(&next, false)?;
        kept = keep(&out, model, &of)?;
        out.finish(&about(t.seed))?;
        at = next;
        first.get_or_insert_with(|| far(&found, joint, |a, _| a).0);
        last = Some(found);
    }
    let (mean, covariance) = far(&last.context("no records")?, joint, |_, b| b);
    let first = Number(first.unwrap_or(f64::NAN));
    Ok(Outcome { order, mean: Number(mean), covariance: Number(covariance), first })
}

/// Largest differences between the means of two results, in the deviations that `by` chooses, and between their covariances, over the
/// deviations of the second.
fn far(a: &IdentificationResult, b: &IdentificationResult, by: fn(f64, f64) -> f64) -> (f64, f64) {
    let at = |r: &IdentificationResult, name: &str| r.covariance.names.iter().position(|n| n == name);
    let (mut mean, mut covariance) = (0.0_f64, 0.0_f64);
    for (k, p) in b.parameters.iter().enumerate() {
        let Some(q) = a.parameters.iter().find(|q| q.name == p.name) else { return (f64::INFINITY, f64::INFINITY) };
        let (Some(here), Some(there)) = (q.std, p.std) else { return (f64::INFINITY, f64::INFINITY) };
        mean = mean.max((q.value - p.value).abs() / by(here, there));
        for other in &b.parameters[..=k] {
            let element = |r: &IdentificationResult| Some(r.covariance.rows[at(r, &p.name)?][at(r, &other.name)?]);
            let difference = element(a).zip(element(b)).map_or(f64::INFINITY, |(x, y)| (x - y).abs());
            covariance = covariance.max(difference / (there * other.std.unwrap_or(f64::NAN)));
        }
    }
    (mean, covariance)
}
