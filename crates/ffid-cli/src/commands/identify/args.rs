//! Arguments of `ffid identify`.

use crate::flags::choice::{Candidate, Clocks, LossFlag};
use crate::flags::fit::{FitFlags, MethodFlag, positive};
use crate::flags::record::RecordFlags;
use crate::output::Input;
use crate::result_folder;
use crate::results::Output;
use ff_model::{Area, Model, Params, Problem, Problems};
use ffid::open::{Opened, open};
use ffid::workflow::identify::{FitOptions, InputFile, LabelledRecord, TieSpec, read_kept};
use ident::sample::ChainSettings;
use std::path::PathBuf;

/// Longest file of ties (bytes).
const MAX_TIES: usize = 1 << 20;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid identify m.toml --record rec.csv                     into m-identified/
  ffid identify m.toml --record rec.csv --held-out 0.3      the last 30 % judge the model
  ffid identify m.toml --record a.csv --held-out b.csv --out result
  ffid identify m.toml --record exact.csv --torque-noise 0.1 --gyro-noise 1e-4
  ffid identify m.toml --records a.csv b.csv c.csv          one robot, biases of each record
  ffid identify m.toml --record rec.csv --reduce            where the record is silent, what it can tell
  ffid identify m.toml --record rec.csv --loss huber        a few samples are wrong
  ffid identify m.toml --record rec.csv --profile 'tank.*'  intervals from the likelihood itself
  ffid identify m.toml --record rec.csv --sample            draws from the posterior, a corner plot
  ffid identify m.toml --record new.csv --prior-from m-identified
  ffid identify m.toml --record rec.csv --compare           rigid, flexible, sloshing or both?
  ffid identify arm.toml --record log.csv --held-out 0.33   an arm on the ground, friction included
  ffid identify arm.toml --records empty.csv loaded.csv --without tool=empty.csv   a payload from two logs of one arm
  ffid identify m.toml --record rec.csv --adopt gyro-misalignment   estimate what would explain the record, too
  ffid identify m.toml --record rec.csv --ties ties.toml    one stiffness for all hinges, one filling level

A record has columns time[s], q.<joint>[rad], tau.<joint>[N m], gyro.x[rad/s], gyro.y[..], gyro.z[..]; dq., ddq., acc. and
att. are optional, units are converted (docs/records.md). The folder holds report.html, replay.html (3-D), result.json, identified.toml,
identified.urdf, residuals.csv and .parquet, draws.parquet, report.txt, figures and manifest.toml (docs/results.md). Parameters that the record cannot
tell end with exit code 13 and are named; a fit that found no solution ends with 14, a model that the record contradicts with 16. Ctrl-C
ends the fit and writes what there is (130).";

/// A payload and the record in which it was not mounted.
fn absent(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, file)) if !name.is_empty() && !file.is_empty() => Ok((name.to_owned(), PathBuf::from(file))),
        _ => Err("write NAME=FILE, such as tool=empty.csv".to_owned()),
    }
}

/// Arguments of `ffid identify`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) input: Input,
    /// The record: CSV, Parquet, or a bag of ROS 1 or ROS 2 (MCAP).
    #[arg(long, value_name = "FILE", required_unless_present = "records")]
    pub(crate) record: Option<PathBuf>,
    /// Several records of the robot, instead of --record: parameters are shared, biases and initial state are those of each.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "record")]
    pub(crate) records: Vec<PathBuf>,
    /// A payload that was not mounted in one of the records, NAME=FILE; may be given several times. For an arm on the ground: the arm is the
    /// same in all records, and the payload is told by what changes with it.
    #[arg(long, value_name = "NAME=FILE", value_parser = absent)]
    pub(crate) without: Vec<(String, PathBuf)>,
    /// Folder for the results; <mission>-identified in the working directory unless given.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Data that judge the model and are not fitted: a fraction (the end of the last record) or another record.
    #[arg(long, value_name = "FRACTION|FILE")]
    pub(crate) held_out: Option<String>,
    /// Mission that a simulated record was made with: report, replay and result.json show its values beside the estimates. They are not
    /// used.
    #[arg(long, value_name = "MISSION")]
    pub(crate) truth: Option<PathBuf>,
    /// How the record is predicted.
    #[arg(long, value_enum, default_value_t = MethodFlag::Auto)]
    pub(crate) method: MethodFlag,
    /// Relative standard deviation of a prior on every parameter, instead of estimate.prior_relative_std.
    #[arg(long, value_name = "RELATIVE", value_parser = positive, conflicts_with = "no_prior")]
    pub(crate) prior: Option<f64>,
    /// The data alone, whatever the mission says.
    #[arg(long)]
    pub(crate) no_prior: bool,
    /// Go on from an earlier identification, the folder that it wrote: its records are fitted as well, so that the order of records
    /// plays no part; where it keeps none, what it has learnt is the prior.
    #[arg(long, value_name = "DIR")]
    pub(crate) prior_from: Option<PathBuf>,
    /// Hold what the mission is not sure of at its values and widen the deviations by it (consider covariance), instead of estimating it.
    #[arg(long, conflicts_with = "sample")]
    pub(crate) consider: bool,
    /// Parameters that are functions of fewer unknowns: a file of [[tie]] tables (docs/results.md).
    #[arg(long, value_name = "FILE")]
    pub(crate) ties: Option<PathBuf>,
    /// What a residual costs: squares, or less than that for samples that are far off.
    #[arg(long, value_enum, default_value_t = LossFlag::Squares)]
    pub(crate) loss: LossFlag,
    /// Where the record is silent, estimate the parameters that it can tell, and hold the others where the mission has them.
    #[arg(long)]
    pub(crate) reduce: bool,
    /// Profile the likelihood of these parameters (names, `*` for any): intervals that assume no parabola. Many fits.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) profile: Vec<String>,
    /// Draw from the posterior, this many draws of each of four chains: intervals that assume no parabola, for all parameters at once.
    /// Ctrl-C ends it with what there is.
    #[arg(long, value_name = "DRAWS", num_args = 0..=1, default_missing_value = "400", value_parser = clap::value_parser!(u32).range(20..=100_000))]
    pub(crate) sample: Option<u32>,
    /// Fit from this many starts, drawn around the first, and say whether they agree.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) starts: u32,
    /// Fit models with and without panels and fuel as well, and say which to use; the last 30 % judge unless --held-out does.
    #[arg(long, value_name = "MODEL", value_enum, value_delimiter = ',', num_args = 0.., default_missing_value = "rigid,flexible,slosh,both")]
    pub(crate) compare: Vec<Candidate>,
    /// Estimate these errors beside the parameters, by the names that the list of what would explain a record gives (`*` for any):
    /// gyro-misalignment, torque-gain, encoder-offset.joint3, mass.wing.
    #[arg(long, value_name = "ERROR", value_delimiter = ',')]
    pub(crate) adopt: Vec<String>,
    /// What becomes of clocks of torques and gyro that disagree with that of the encoders.
    #[arg(long, value_enum, default_value_t = Clocks::Correct)]
    pub(crate) clocks: Clocks,
    /// Thrusters or other external torques acted during the record: do not refuse it for its momentum.
    #[arg(long)]
    pub(crate) external_torque: bool,
    /// The modes of the free decay must be told: refuse a record in which they cannot.
    #[arg(long)]
    pub(crate) modes: bool,
    /// Start at the values of the mission: leave out estimate.start_offset, which is for studies.
    #[arg(long)]
    pub(crate) no_start_offset: bool,
    /// Seed of the directions of estimate.start_offset, of other starts, and of draws.
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) fit: FitFlags,
    #[command(flatten)]
    pub(crate) reading: RecordFlags,
    #[command(flatten)]
    pub(crate) output: Output,
}

impl Args {
    /// How the posterior is drawn, if it is asked for.
    pub(crate) fn sampling(&self) -> Option<ChainSettings> {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        self.sample.map(|n| ChainSettings { draws: n as usize, threads, seed: self.seed, ..ChainSettings::default() })
    }
    /// The records that are fitted.
    pub(crate) fn paths(&self) -> Vec<PathBuf> {
        self.record.iter().chain(&self.records).cloned().collect()
    }
    /// What is true of the parameters of a simulated record, by name; nothing unless it was given.
    pub(crate) fn known_truth(&self, opened: &Opened) -> Result<Vec<(String, f64)>, Problems> {
        let Some(path) = &self.truth else { return Ok(Vec::new()) };
        let truth = open(path, self.input.leniency())?;
        let values = Params::nominal(&truth.model);
        let decls = truth.model.param_decls().into_iter().map(|d| d.name);
        let all: Vec<(String, f64)> = decls.zip(values.values().iter().copied()).collect();
        let asked = opened.model.param_decls();
        match opened.estimated.iter().map(|&i| &asked[i].name).find(|name| all.iter().all(|(n, _)| n != *name)) {
            None => Ok(all),
            Some(name) => {
                let p =
                    Problem::error(Area::Config, "Config::Truth", "it has no such parameter").on(name).in_file(path);
                Err(Problems(vec![p.hint("give the mission that the record was simulated with")]))
            }
        }
    }
    /// Options of the fit, and what an earlier identification leaves.
    pub(crate) fn options(&self, model: &Model) -> Result<(FitOptions, Earlier), Problems> {
        let mut options = FitOptions {
            reduce: self.reduce,
            more_starts: self.starts as usize - 1,
            consider: self.consider,
            ..FitOptions::default()
        };
        if let Some(path) = &self.ties {
            let text = ff_model::diagnostics::text_file(path, MAX_TIES)?;
            options.ties = TieSpec::read(&text).map_err(|p| p.in_file(path))?;
        }
        let mut earlier = Earlier::default();
        let Some(folder) = &self.prior_from else { return Ok((options, earlier)) };
        let result = result_folder::result(folder)?;
        earlier.inputs = result.provenance.inputs;
        let file = folder.join("result.json");
        if result.kept_records.is_empty() {
            let posterior = result.posterior.ok_or_else(|| {
                let p = Problem::error(Area::Data, "Data::NoPosterior", "the result holds no posterior").in_file(&file);
                Problems(vec![p.hint("identify again with this version")])
            })?;
            let what = "it keeps no records, so that what it has learnt counts as a parabola around its estimates, which is wrong where \
                        they were weak and later records lead elsewhere";
            let p = Problem::warning(Area::Data, "Data::NoRecords", what).in_file(&file);
            earlier.warnings.push(p.hint("give all records at once with --records"));
            options.posterior = Some(posterior);
            return Ok((options, earlier));
        }
        // What was let through then is let through.
        let allow: Vec<String> = result.warnings.iter().map(|w| w.code.clone()).collect();
        earlier.records = read_kept(folder, &result.kept_records, model, &allow)?;
        earlier.files = result.kept_records.iter().map(|k| folder.join(&k.file)).collect();
        options.learnt = result.posterior;
        Ok((options, earlier))
    }
}

/// What an earlier identification leaves to a later one.
#[derive(Default)]
pub(crate) struct Earlier {
    /// Files that it has read.
    pub(crate) inputs: Vec<InputFile>,
    /// Records that it keeps, and where.
    pub(crate) records: Vec<LabelledRecord>,
    pub(crate) files: Vec<PathBuf>,
    pub(crate) warnings: Problems,
}
