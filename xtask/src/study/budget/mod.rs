//! `cargo xtask study budget`: are deviations honest in a world that is not exactly as the mission says?
//!
//! The servicer of `fixtures/verdict`, whose records MuJoCo has computed, and `uncertain.toml`, its mission with what `ffid init` says is not
//! known. Parts for `--only`, or numbers of worlds:
//!
//! * `worlds`: every uncertain item is drawn from its deviation (of the wing's flat segments only what can exist on both sides,
//!   `errors.rs`), records carry noise, and are identified as by `ffid identify` without flags. How many of the 95 % intervals hold the
//!   truth, over base, stiffnesses, dampers and fuel; joint squared errors; how many worlds are contradicted; stated deviations over the
//!   marginalised Cramer-Rao ones.
//! * `shares`: one kind of error alone is drawn, or the noise alone. The scatter of the estimates against the share of their variance that the
//!   error budget gives that kind, over the estimates of which it is a tenth or more.

mod errors;

use super::covered::percent;
use super::figures::{Op, Study};
use super::options::Options;
use super::trials::{Number, Trial, Trials};
use super::verdict::world::{Encoder, RECORDS, Readings, World};
use anyhow::Context;
use ff_model::ParamDecl;
use ffid::exit::Exit;
use ffid::workflow::identify::{
    DeclaredUncertain, DeclaredUnknown, IdentificationResult, Identified, State, UncertainKind,
};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Worlds, and draws of one kind of error.
const WORLDS: u64 = 1000;
const DRAWS: u64 = 60;
/// Most that stated deviations may be of the marginalised Cramer-Rao ones.
const OVER_BOUND: f64 = 1.2;
/// Limits on the scatter over what the budget says, pooled over estimates.
const SCATTER: (f64, f64) = (0.75, 1.3);
/// Share from which an estimate counts for a kind.
const LEAST_SHARE: f64 = 0.1;

/// What the estimates belong to.
const GROUPS: [&str; 4] = ["base", "stiffness", "damping", "fuel"];

/// What came of a world.
#[derive(Serialize, Deserialize)]
struct Outcome {
    exit: u8,
    contradicted: bool,
    chi2_per_dof: Number,
    /// Group, and distance from the truth in stated deviations.
    off: Vec<(usize, Number)>,
    /// Joint squared error, and how many estimates it is of.
    nees: Number,
    /// Stated deviations, as `off`; none in files of earlier builds.
    #[serde(default)]
    std: Vec<Number>,
    named: String,
}

/// Estimates and budget of a world with one kind of error.
#[derive(Serialize, Deserialize)]
struct Scattered {
    values: Vec<Number>,
    /// Share of the kind, and standard deviation.
    shares: Vec<(Number, Number)>,
}

/// What all worlds share.
struct Setup {
    world: World,
    clean: Vec<Readings>,
    unknowns: Vec<DeclaredUnknown>,
    truth: Vec<ParamDecl>,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read; a world that cannot be made.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("budget", options.seed);
    let trials = Trials::open("budget", 2, options)?;
    let world = World::new("uncertain.toml")?;
    let clean = RECORDS.iter().map(|name| world.clean(name)).collect::<anyhow::Result<Vec<_>>>()?;
    let unknowns = DeclaredUncertain::of(&world.start).context("the mission is sure of everything")?.unknowns;
    let truth = world.truth.model.param_decls();
    let setup = Setup { world, clean, unknowns, truth };
    let count = |whole: u64, quick: u64| if options.quick { quick } else { whole };
    let listed = options.cases();
    let some = !listed.is_empty();
    if options.wants("worlds") || some {
        let numbers = if some { listed } else { (0..count(WORLDS, 6)).collect() };
        let all = trials.run("worlds", numbers.iter().copied(), |t| setup.drawn(t))?;
        worlds(&all, &numbers, options, &mut study);
        let bounds = trials.run("bounds", 0..RECORDS.len() as u64, |t| setup.bound(t))?;
        over_bounds(&all, &numbers, &bounds, options, &mut study);
    }
    if options.wants("shares") && !some {
        let mut kinds: Vec<Option<UncertainKind>> = setup.unknowns.iter().map(|u| Some(u.kind)).collect();
        kinds.push(None);
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let name = kind.map_or("noise", UncertainKind::words).replace(' ', "-");
            let draws = count(DRAWS, 2);
            let all = trials.run(&format!("shares-{name}"), 0..draws, |t| setup.alone(kind, t))?;
            if let Some(ratio) = scatter(&all).filter(|_| !options.quick) {
                study.limited(format!("shares.{name}.least"), "", ratio, Op::AtLeast, SCATTER.0);
                study.limited(format!("shares.{name}.most"), "", ratio, Op::AtMost, SCATTER.1);
            }
        }
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

/// Figures of the worlds.
fn worlds(all: &[Outcome], numbers: &[u64], options: &Options, study: &mut Study) {
    study.figure("worlds", "", all.len() as f64);
    study.figure("chi2_per_dof", "", all.iter().map(|o| o.chi2_per_dof.0).sum::<f64>() / all.len().max(1) as f64);
    study.contradicted(options.quick, "", all.iter().map(|o| (o.contradicted, o.exit)));
    for (g, group) in GROUPS.iter().enumerate() {
        let of: Vec<f64> = all.iter().flat_map(|o| &o.off).filter(|x| x.0 == g).map(|x| x.1.0).collect();
        study.covered(options.quick, group, &of);
    }
    let mut nees: Vec<f64> = all.iter().map(|o| o.nees.0).filter(|n| n.is_finite()).collect();
    nees.sort_by(f64::total_cmp);
    let n = all.first().map_or(1, |o| o.off.len()).max(1);
    if let (Some(median), Ok(expected)) = (nees.get(nees.len() / 2), ChiSquared::new(n as f64)) {
        study.figure("nees.median_over_expected", "", median / expected.inverse_cdf(0.5));
        let beyond = nees.iter().filter(|x| **x > expected.inverse_cdf(0.99)).count();
        study.figure("nees.beyond_99", "%", percent(beyond, nees.len()));
    }
    for (&k, o) in numbers.iter().zip(all).filter(|(_, o)| o.exit != Exit::Done.code()) {
        study.note(format!("world {k} ({}): exit {}, {}", RECORDS[k as usize % RECORDS.len()], o.exit, o.named));
    }
}

/// Stated deviations over the marginalised Cramer-Rao ones of the same motion: the largest of the medians that single parameters have over the
/// worlds, and a quantile of all.
fn over_bounds(all: &[Outcome], numbers: &[u64], bounds: &[Vec<Number>], options: &Options, study: &mut Study) {
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); bounds.first().map_or(0, Vec::len)];
    for (&k, o) in numbers.iter().zip(all) {
        let of = &bounds[k as usize % bounds.len()];
        ratios.iter_mut().zip(o.std.iter().zip(of)).for_each(|(all, (std, bound))| all.push(std.0 / bound.0));
    }
    let quantile = |x: &[f64], part: f64| {
        let mut x = x.to_vec();
        x.sort_by(f64::total_cmp);
        x.get(((x.len() - 1) as f64 * part).round() as usize).copied()
    };
    ratios.retain(|r| !r.is_empty());
    let medians = ratios.iter().filter_map(|r| quantile(r, 0.5));
    let Some(worst) = medians.reduce(f64::max) else { return };
    study.judged(options.quick, "deviations.over_cramer_rao", "", worst, (Op::AtMost, OVER_BOUND));
    if let Some(high) = quantile(&ratios.concat(), 0.95) {
        study.figure("deviations.over_cramer_rao_95", "", high);
    }
}

/// Stated deviations in the order of the parameters.
fn stated(r: &IdentificationResult) -> Vec<Number> {
    r.parameters.iter().map(|p| Number(p.std.unwrap_or(f64::NAN))).collect()
}

/// Variance of the estimates over what the budget says, pooled over those of which the kind is a tenth or more; none where there is none.
fn scatter(all: &[Scattered]) -> Option<f64> {
    let first = all.first()?;
    let (mut ratios, draws) = (Vec::new(), all.len() as f64);
    for (k, (share, std)) in first.shares.iter().enumerate().filter(|(_, s)| s.0.0 > LEAST_SHARE) {
        let values: Vec<f64> = all.iter().filter_map(|o| o.values.get(k)).map(|v| v.0).collect();
        let mean = values.iter().sum::<f64>() / draws;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (draws - 1.0);
        ratios.push(variance / (share.0 * std.0 * std.0));
    }
    (!ratios.is_empty() && draws > 1.0).then(|| ratios.iter().sum::<f64>() / ratios.len() as f64)
}

impl Setup {
    fn drawn(&self, t: Trial) -> anyhow::Result<Outcome> {
        let (mut readings, mut opened) = (self.record(t).clone(), self.world.start.clone());
        let mut rng = t.rng();
        errors::apply(&self.unknowns, &mut readings, &mut opened.model, &mut rng)?;
        self.world.noise(&mut readings, Encoder::Noisy, &mut rng);
        let found = match self.world.identify(&opened, &readings) {
            Ok(found) => found,
            Err(e) => return Ok(Outcome::refused(e.to_string())),
        };
        Ok(self.outcome(&found))
    }
    fn outcome(&self, found: &Identified) -> Outcome {
        let r = &found.result;
        let evidence = r.evidence.clone().unwrap_or_default();
        let off = r.parameters.iter().map(|p| {
            let std = p.std.unwrap_or(f64::NAN);
            (group(&p.name), Number((p.value - self.nominal(&p.name)) / std))
        });
        Outcome {
            exit: r.exit().code(),
            contradicted: evidence.state == State::Contradicted,
            chi2_per_dof: Number(r.chi2_per_dof),
            off: off.collect(),
            nees: Number(self.nees(r).unwrap_or(f64::NAN)),
            std: stated(r),
            named: evidence.named.first().map_or(evidence.reason, |n| n.name.clone()),
        }
    }
    /// Marginalised Cramer-Rao deviations of a motion: those of a fit to readings without noise, which ends at the truth.
    fn bound(&self, t: Trial) -> anyhow::Result<Vec<Number>> {
        Ok(stated(&self.world.fit(&self.world.start, self.record(t))?.result))
    }
    /// One kind of error, or the noise, about the truth.
    fn alone(&self, kind: Option<UncertainKind>, t: Trial) -> anyhow::Result<Scattered> {
        // One record for all, whose budget they share.
        let (mut readings, mut opened) = (self.clean[0].clone(), self.world.start.clone());
        let mut rng = t.rng();
        match kind {
            None => self.world.noise(&mut readings, Encoder::Noisy, &mut rng),
            Some(kind) => {
                let of: Vec<DeclaredUnknown> = self.unknowns.iter().filter(|u| u.kind == kind).cloned().collect();
                errors::apply(&of, &mut readings, &mut opened.model, &mut rng)?;
            }
        }
        let found = self.world.fit(&opened, &readings)?.result;
        let share = |name: &str| {
            let line = found.budget.iter().find(|b| b.name == name);
            line.map_or((0.0, f64::NAN), |b| {
                let of = |k: UncertainKind| b.errors.iter().find(|e| e.kind == k).map_or(0.0, |e| e.share);
                (kind.map_or(b.noise, of), b.std)
            })
        };
        let shares = found.parameters.iter().map(|p| share(&p.name)).map(|(s, std)| (Number(s), Number(std)));
        Ok(Scattered { shares: shares.collect(), values: found.parameters.iter().map(|p| Number(p.value)).collect() })
    }
    fn record(&self, t: Trial) -> &Readings {
        &self.clean[(t.number % RECORDS.len() as u64) as usize]
    }
    fn nominal(&self, name: &str) -> f64 {
        self.truth.iter().find(|d| d.name == name).map_or(f64::NAN, |d| d.nominal)
    }
    /// Squared distance from the truth in the covariance of the parameters.
    fn nees(&self, r: &IdentificationResult) -> Option<f64> {
        let at = |name: &str| r.covariance.names.iter().position(|n| n == name);
        let places: Vec<usize> = r.parameters.iter().map(|p| at(&p.name)).collect::<Option<_>>()?;
        let scale: Vec<f64> = r.parameters.iter().map(|p| p.std).collect::<Option<_>>()?;
        let n = places.len();
        let correlation =
            DMatrix::from_fn(n, n, |i, j| r.covariance.rows[places[i]][places[j]] / (scale[i] * scale[j]));
        let off = DVector::from_fn(n, |i, _| (r.parameters[i].value - self.nominal(&r.parameters[i].name)) / scale[i]);
        Some(off.dot(&correlation.cholesky()?.solve(&off)))
    }
}

impl Outcome {
    fn refused(why: String) -> Self {
        let nan = Number(f64::NAN);
        Self {
            exit: Exit::Numerical.code(),
            contradicted: false,
            chi2_per_dof: nan,
            off: Vec::new(),
            nees: nan,
            std: Vec::new(),
            named: why,
        }
    }
}

/// Index among [`GROUPS`] of a parameter.
fn group(name: &str) -> usize {
    match name {
        n if n.starts_with("base.") => 0,
        n if n.starts_with("tank.") => 3,
        n if n.contains(".k[") => 1,
        _ => 2,
    }
}
