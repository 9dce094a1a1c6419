//! `cargo xtask study verdict`: does `ffid identify` contradict a model that is wrong, and only such a one?
//!
//! The servicer of `fixtures/verdict`, whose records MuJoCo has computed. A world is one of them with noise, and with errors of the
//! sensors in its readings or errors of the model in the mission; it is identified from `start.toml` as by `ffid identify` without flags.
//! Parts for `--only`:
//!
//! * `exact`: nothing is wrong, one minute; how often the model is contradicted all the same. `bits`: encoders of 16 bits in place of
//!   white noise. `long`: the record of `--long`, an hour (left out without it: 35 MB that `fixtures/verdict/generate.py` makes).
//! * `size-36`, `size-900`: one error of each of the kinds of `faults`, in turn, or two of them (`pairs`), each so large that the square of
//!   it over its deviation with all else free is that number. The deviations are those of the worlds' noise, that of the encoders
//!   included, which a planned motion with corners carries into the prediction: a gyro that drifts is known to a tenth there of what gyro and torques alone would tell.
//!
//! The sizes come from fits without noise (part `clean`, the deviations of all errors with nothing wrong; parts `reference-36` and `reference-900`,
//! each kind at that size, tried again until it is met to 5 %): there chi-squared falls by that square, over the square of what noise of the encoders multiplies the error's deviation by (part `noisy`: deviations
//! in worlds with noise and nothing wrong). An error whose score test falls by as much as that of the
//! true one, to a correlation above [`ident::uncertain::ALIKE`], is of its class: the record cannot choose. These fits tell as well how far an
//! error moves the estimates, which no residual shows.

mod faults;
pub(super) mod world;

use super::figures::{Op, Study};
use super::options::Options;
use super::trials::{Number, Trial, Trials};
use crate::table::sig;
use anyhow::Context;
use faults::{KINDS, Kind};
use ff_model::Problems;
use ffid::exit::Exit;
use ffid::open::Opened;
use ffid::workflow::identify::{Identified, IdentifyError, NamedError, State};
use ident::uncertain::{ALIKE, MATTERS};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use world::{Encoder, RECORDS, Readings, World};

/// Arguments of `study verdict`.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub(super) options: Options,
    /// A long record without noise, such as the hour of fixtures/verdict/generate.py
    #[arg(long, value_name = "FILE")]
    long: Option<PathBuf>,
}

/// Worlds: exact, exact with encoders of few bits, exact and long; worlds with one error per kind, and with two.
const EXACT: u64 = 300;
const BITS: u64 = 30;
const LONG: u64 = 30;
const PER_KIND: u64 = 8;
const PAIRS: u64 = 22;
/// Squares of errors over their deviations.
const SIZES: [u32; 2] = [36, 900];
/// Relative distance of the square of a reference from what is wanted at which its size is found, and fits that look for it.
const MET: f64 = 0.05;
/// See [`MET`].
const LOOKS: usize = 5;
/// Encoder of part `bits`.
const ENCODER_BITS: i32 = 16;
/// Most exact worlds that may be contradicted (%).
const FALSE_ALARMS: f64 = 3.0;
/// Least worlds with the true cause among the first two that are named (%).
const NAMED: f64 = 90.0;

/// What came of a world.
#[derive(Serialize, Deserialize)]
struct Outcome {
    /// Exit code of the command.
    exit: u8,
    state: State,
    chi2_per_dof: Number,
    reason: String,
    /// Channels with coloured residuals.
    coloured: Vec<String>,
    /// Clocks that were corrected.
    corrected: bool,
    /// Errors that are named, most important first.
    named: Vec<Suspect>,
    /// Independent tests that all errors together are worth.
    #[serde(default)]
    independent: Option<f64>,
}

/// An error that is named.
#[derive(Serialize, Deserialize)]
struct Suspect {
    name: String,
    alike: Vec<String>,
    drop: Number,
    p: Number,
    moves_by: Number,
}

impl Outcome {
    fn of(found: Result<Identified, IdentifyError>) -> Self {
        match found {
            Ok(found) => {
                let r = &found.result;
                let evidence = r.evidence.clone().unwrap_or_default();
                Self {
                    exit: r.exit().code(),
                    state: evidence.state,
                    chi2_per_dof: Number(r.chi2_per_dof),
                    reason: evidence.reason,
                    coloured: r.whiteness.iter().filter(|w| !w.white).map(|w| w.channel.clone()).collect(),
                    corrected: r.clocks.iter().any(|c| c.corrected),
                    named: evidence.named.iter().map(Suspect::of).collect(),
                    independent: evidence.independent,
                }
            }
            Err(e) => Self {
                exit: refusal(&e).code(),
                state: State::NotTested,
                chi2_per_dof: Number(f64::NAN),
                reason: e.to_string(),
                coloured: Vec::new(),
                corrected: false,
                named: Vec::new(),
                independent: None,
            },
        }
    }
    fn contradicted(&self) -> bool {
        self.state == State::Contradicted
    }
    /// Whether an error of the class is one of the first two, or alike to one of them.
    fn names(&self, class: &[String]) -> bool {
        self.named.iter().take(2).any(|n| class.contains(&n.name) || n.alike.iter().any(|a| class.contains(a)))
    }
    /// In a line.
    fn words(&self) -> String {
        let first = |n: &Suspect| format!("{} ({}, moves {})", n.name, sig(n.drop.0, 3), sig(n.moves_by.0, 2));
        let named: Vec<String> = self.named.iter().take(3).map(first).collect();
        format!(
            "{}, exit {}, chi-squared {}{}{}; named: {}",
            self.state,
            self.exit,
            sig(self.chi2_per_dof.0, 4),
            if self.coloured.is_empty() { String::new() } else { format!(", coloured: {}", self.coloured.join(" ")) },
            if self.corrected { ", clocks corrected" } else { "" },
            if named.is_empty() { "nothing".to_owned() } else { named.join(", ") }
        )
    }
}

/// The exit code of a fit that gave nothing.
fn refusal(e: &IdentifyError) -> Exit {
    let first = |p: &Problems| Exit::of(p);
    match e {
        IdentifyError::Refused(p) => first(p),
        IdentifyError::IllPosed(_) => Exit::IllPosed,
        _ => Exit::Numerical,
    }
}

impl Suspect {
    fn of(e: &NamedError) -> Self {
        let (name, alike) = (e.name.clone(), e.alike.clone());
        Self { name, alike, drop: Number(e.drop), p: Number(e.p), moves_by: Number(e.moves_by) }
    }
}

/// A kind of error on a record without noise.
#[derive(Clone, Serialize, Deserialize)]
struct Reference {
    /// Its size there.
    size: f64,
    /// The square of it over its deviation.
    squared: f64,
    /// Errors that the record cannot tell from it, the true cause first.
    class: Vec<String>,
    /// How far the estimates are off, in their deviations.
    moved: Vec<f64>,
}

impl Reference {
    /// The size for another square that is near its own.
    fn size_for(&self, squared: u32) -> f64 {
        self.size * (f64::from(squared) / self.squared).sqrt()
    }
    /// Estimates that such an error moves by more than half a deviation.
    fn moves(&self, squared: u32) -> usize {
        let scale = (f64::from(squared) / self.squared).sqrt();
        self.moved.iter().filter(|m| m.abs() * scale > MATTERS).count()
    }
}

/// Deviations of the components of errors, by the name of the error.
type Deviations = Vec<(String, Vec<f64>)>;

/// What all worlds share.
struct Setup {
    world: World,
    clean: Vec<Readings>,
    quick: bool,
    /// Of the square that is being tried, record by record.
    references: Vec<Reference>,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read; fits without noise that give nothing.
pub fn run(args: &Args) -> anyhow::Result<Study> {
    let options = &args.options;
    let mut study = Study::new("verdict", options.seed);
    let trials = Trials::open("verdict", 4, options)?;
    let world = World::new("start.toml")?;
    let clean = RECORDS.iter().map(|name| world.clean(name)).collect::<anyhow::Result<Vec<_>>>()?;
    let mut setup = Setup { world, clean, quick: options.quick, references: Vec::new() };
    let count = |whole: u64, quick: u64| if options.quick { quick } else { whole };
    if options.wants("exact") {
        let of = |t: Trial| setup.exact(setup.record_of(t.number), Encoder::Noisy, t);
        exact("exact", trials.run("exact", 0..count(EXACT, 12), of)?, options, &mut study);
    }
    if options.wants("bits") && !options.quick {
        let of = |t: Trial| setup.exact(setup.record_of(t.number), Encoder::Bits(ENCODER_BITS), t);
        exact("bits", trials.run("bits", 0..BITS, of)?, options, &mut study);
    }
    if options.wants("long") {
        match &args.long {
            Some(path) => {
                let hour = setup.world.read(path)?;
                let of = |t: Trial| setup.exact(&hour, Encoder::Noisy, t);
                exact("long", trials.run("long", 0..count(LONG, 1), of)?, options, &mut study);
            }
            None => study.note("part long: skipped, no --long FILE"),
        }
    }
    let sizes: Vec<u32> =
        SIZES.into_iter().filter(|s| !options.quick || *s == 900).filter(|s| options.wants(&part(*s))).collect();
    let deviations = if sizes.is_empty() { [Vec::new(), Vec::new()] } else { setup.deviations(&trials)? };
    for squared in sizes {
        setup.references = setup.refer_all(squared, &deviations, &trials)?;
        faulty(&setup, squared, &trials, options, &mut study)?;
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

/// Figures of worlds in which nothing is wrong.
fn exact(part: &str, all: Vec<Outcome>, options: &Options, study: &mut Study) {
    let percent = |of: &dyn Fn(&Outcome) -> bool| share(all.iter().map(of));
    study.figure(format!("{part}.worlds"), "", all.len() as f64);
    let chi2 = all.iter().map(|o| o.chi2_per_dof.0).sum::<f64>() / all.len().max(1) as f64;
    study.figure(format!("{part}.chi2_per_dof"), "", chi2);
    let contradicted = percent(&Outcome::contradicted);
    study.judged(options.quick, format!("{part}.contradicted"), "%", contradicted, (Op::AtMost, FALSE_ALARMS));
    study.figure(format!("{part}.coloured"), "%", percent(&|o| !o.coloured.is_empty()));
    let independent: Vec<f64> = all.iter().filter_map(|o| o.independent).collect();
    study.figure(
        format!("{part}.independent_tests"),
        "",
        independent.iter().sum::<f64>() / independent.len().max(1) as f64,
    );
    study.figure(format!("{part}.error_named"), "%", percent(&|o| !o.named.is_empty()));
    study.figure(format!("{part}.other_exit"), "%", percent(&|o| o.exit != Exit::Done.code() && !o.contradicted()));
    for (k, o) in all.iter().enumerate().filter(|(_, o)| o.exit != Exit::Done.code()) {
        study.note(format!("{part} {k} ({}): {}", RECORDS[k % RECORDS.len()], o.words()));
    }
}

/// How many are true (%).
fn share(all: impl Iterator<Item = bool>) -> f64 {
    let (mut yes, mut count) = (0.0, 0.0);
    for one in all {
        yes += f64::from(u8::from(one));
        count += 1.0;
    }
    100.0 * yes / count
}

/// The part of worlds with errors of this size; a number alone would be a case for `--only`.
fn part(squared: u32) -> String {
    format!("size-{squared}")
}

/// A world with errors: the outcome, and the kinds with their records.
struct Judged {
    outcome: Outcome,
    causes: Vec<(usize, Vec<String>)>,
    record: usize,
}

fn faulty(setup: &Setup, squared: u32, trials: &Trials, options: &Options, study: &mut Study) -> anyhow::Result<()> {
    let kinds = KINDS.len() as u64;
    let singles = kinds * if setup.quick { 2 } else { PER_KIND };
    let one = |t: Trial| setup.wrong(&[(t.number % kinds) as usize], setup.place_of(t.number / kinds), squared, t);
    let two = |t: Trial| setup.wrong(&pair(t), setup.place_of(t.number), squared, t);
    let judged = |number: u64, outcome: Outcome, of: Vec<usize>, record: usize| -> anyhow::Result<Judged> {
        let class =
            |k: usize| Ok((k, setup.reference(record, k).with_context(|| format!("trial {number}"))?.class.clone()));
        let causes = of.into_iter().map(class).collect::<anyhow::Result<_>>()?;
        Ok(Judged { outcome, causes, record })
    };
    let mut all = Vec::new();
    for (number, o) in (0..).zip(trials.run(&part(squared), 0..singles, one)?) {
        all.push(judged(number, o, vec![(number % kinds) as usize], setup.place_of(number / kinds))?);
    }
    let mut pairs = Vec::new();
    if !setup.quick {
        for (number, o) in (0..).zip(trials.run(&format!("pairs-{squared}"), 0..PAIRS, two)?) {
            let of = pair(Trial { seed: options.seed, number });
            pairs.push(judged(number, o, of.to_vec(), setup.place_of(number))?);
        }
    }
    for (k, kind) in KINDS.iter().enumerate() {
        let of: Vec<&Judged> = all.iter().filter(|j| j.causes[0].0 == k).collect();
        table(study, &format!("{}.{squared}", kind.name), &of);
        let moved: Vec<String> = RECORDS
            .iter()
            .enumerate()
            .filter_map(|(record, name)| Some(format!("{name} {}", setup.reference(record, k).ok()?.moves(squared))))
            .collect();
        study.note(format!(
            "{}.{squared}: estimates that it moves by more than half a deviation: {}",
            kind.name,
            moved.join(", ")
        ));
    }
    if !pairs.is_empty() {
        table(study, &format!("pairs.{squared}"), &pairs.iter().collect::<Vec<_>>());
    }
    all.extend(pairs);
    let contradicted = share(all.iter().map(|j| j.outcome.contradicted()));
    let least = if squared < 900 { 95.0 } else { 100.0 };
    study.figure(format!("all.{squared}.worlds"), "", all.len() as f64);
    study.figure(format!("all.{squared}.contradicted"), "%", contradicted);
    // What moves no estimate is named, but does not count against the model.
    let moves =
        |j: &&Judged| j.causes.iter().any(|c| setup.reference(j.record, c.0).is_ok_and(|r| r.moves(squared) > 0));
    let moving = share(all.iter().filter(moves).map(|j| j.outcome.contradicted()));
    study.judged(options.quick, format!("all.{squared}.contradicted_of_moving"), "%", moving, (Op::AtLeast, least));
    let named = share(all.iter().flat_map(|j| j.causes.iter().map(|c| j.outcome.names(&c.1))));
    study.judged(options.quick, format!("all.{squared}.named"), "%", named, (Op::AtLeast, NAMED));
    let other = |j: &Judged| !j.outcome.contradicted() && j.outcome.exit != Exit::Done.code();
    study.figure(format!("all.{squared}.other_exit"), "%", share(all.iter().map(other)));
    for j in all.iter().filter(|j| !j.outcome.contradicted() || j.causes.iter().any(|c| !j.outcome.names(&c.1))) {
        let causes: Vec<&str> = j.causes.iter().map(|c| KINDS[c.0].name).collect();
        study.note(format!("{squared}, {} ({}): {}", causes.join(" and "), RECORDS[j.record], j.outcome.words()));
    }
    Ok(())
}

/// Figures of one kind.
fn table(study: &mut Study, name: &str, of: &[&Judged]) {
    study.figure(format!("{name}.contradicted"), "%", share(of.iter().map(|j| j.outcome.contradicted())));
    let named = of.iter().flat_map(|j| j.causes.iter().map(|c| j.outcome.names(&c.1)));
    study.figure(format!("{name}.named"), "%", share(named));
}

/// Two kinds, drawn.
fn pair(t: Trial) -> [usize; 2] {
    let mut rng = t.rng();
    let first = rng.random_range(0..KINDS.len());
    [first, (first + rng.random_range(1..KINDS.len())) % KINDS.len()]
}

impl Setup {
    /// Records in turn.
    fn place_of(&self, number: u64) -> usize {
        if self.quick { 0 } else { (number % RECORDS.len() as u64) as usize }
    }
    fn record_of(&self, number: u64) -> &Readings {
        &self.clean[(number % RECORDS.len() as u64) as usize]
    }
    /// A world in which nothing is wrong.
    fn exact(&self, clean: &Readings, encoder: Encoder, t: Trial) -> anyhow::Result<Outcome> {
        let mut readings = clean.clone();
        self.world.noise(&mut readings, encoder, &mut t.rng());
        Ok(Outcome::of(self.world.identify(&self.world.start, &readings)))
    }
    /// A world with errors of these kinds.
    fn wrong(&self, kinds: &[usize], record: usize, squared: u32, t: Trial) -> anyhow::Result<Outcome> {
        let (mut readings, mut opened) = (self.clean[record].clone(), self.world.start.clone());
        let mut rng = t.rng();
        for &k in kinds {
            let sign = if rng.random::<bool>() || KINDS[k].is_positive() { 1.0 } else { -1.0 };
            let size = sign * self.reference(record, k)?.size_for(squared);
            KINDS[k].apply(size, &mut readings, &mut opened.model).with_context(|| KINDS[k].name)?;
        }
        self.world.noise(&mut readings, Encoder::Noisy, &mut rng);
        Ok(Outcome::of(self.world.identify(&opened, &readings)))
    }
    fn reference(&self, record: usize, kind: usize) -> anyhow::Result<&Reference> {
        self.references.get(record * KINDS.len() + kind).context("a record without references")
    }
    /// Deviations of all errors on every record, with nothing wrong: without noise, and with it.
    fn deviations(&self, trials: &Trials) -> anyhow::Result<[Vec<Deviations>; 2]> {
        let records = if self.quick { 1 } else { RECORDS.len() as u64 };
        let of = |readings: &Readings| {
            let found = self.world.fit(&self.world.truth, readings)?;
            let of = |e: &NamedError| (e.name.clone(), e.size.iter().map(|s| s.std).collect::<Vec<f64>>());
            Ok(found.tried.iter().map(of).collect())
        };
        let clean = trials.run("clean", 0..records, |t| of(&self.clean[t.number as usize]))?;
        let noisy = trials.run("noisy", 0..records, |t| {
            let mut readings = self.clean[t.number as usize].clone();
            self.world.noise(&mut readings, Encoder::Noisy, &mut t.rng());
            of(&readings)
        })?;
        Ok([clean, noisy])
    }
    /// A world of each kind without noise, on every record, in which it has this square.
    fn refer_all(
        &self,
        squared: u32,
        [clean, noisy]: &[Vec<Deviations>; 2],
        trials: &Trials,
    ) -> anyhow::Result<Vec<Reference>> {
        let (records, kinds) = (clean.len() as u64, KINDS.len() as u64);
        trials.run(&format!("reference-{squared}"), 0..records * kinds, |t| {
            let (record, kind) = ((t.number / kinds) as usize, &KINDS[(t.number % kinds) as usize]);
            let of = |all: &[Deviations]| -> anyhow::Result<f64> {
                let found = all[record].iter().find(|d| d.0 == kind.cause);
                let found = found.with_context(|| format!("{} was not tested on {}", kind.cause, RECORDS[record]))?;
                Ok(kind.deviation(&found.1))
            };
            let (clean, noisy) = (of(clean)?, of(noisy)?);
            let share = (clean / noisy).min(1.0);
            let mut at = self.refer(kind, f64::from(squared).sqrt() * noisy, (record, share))?;
            for _ in 1..LOOKS {
                if (at.squared / f64::from(squared) - 1.0).abs() < MET {
                    break;
                }
                at = self.refer(kind, at.size_for(squared), (record, share))?;
            }
            Ok(at)
        })
    }
    /// A world with this error and without noise; the share of its deviation with noise of the encoders that it has without.
    fn refer(&self, kind: &Kind, size: f64, (record, share): (usize, f64)) -> anyhow::Result<Reference> {
        let (mut readings, mut opened): (Readings, Opened) = (self.clean[record].clone(), self.world.truth.clone());
        kind.apply(size, &mut readings, &mut opened.model).with_context(|| kind.name)?;
        let found = self.world.fit(&opened, &readings)?;
        let own = found.tried.iter().find(|e| e.name == kind.cause);
        let own = own.with_context(|| format!("{} was not tested on {}", kind.cause, RECORDS[record]))?;
        let mut class = vec![own.name.clone()];
        let alike = found.tried.iter().filter(|e| e.name != own.name && e.drop > ALIKE * ALIKE * own.drop);
        class.extend(alike.map(|e| e.name.clone()));
        let decls = self.world.truth.model.param_decls();
        let moved = found.result.parameters.iter().filter_map(|p| {
            let truth = decls.iter().find(|d| d.name == p.name)?.nominal;
            Some((p.value - truth) / p.std?)
        });
        Ok(Reference { size, squared: own.drop * share * share, class, moved: moved.collect() })
    }
}
