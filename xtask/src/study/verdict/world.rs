//! The robot of `fixtures/verdict`, what its sensors read, and the fit of `ffid identify`.

use crate::workspace;
use anyhow::Context;
use ff_mission::Leniency;
use ff_model::{Params, Problems};
use ff_records::file::{ReadOptions, joints_of, read};
use ff_records::{Record, RecordBuilder};
use ffid::open::{Opened, open};
use ffid::workflow::identify::{
    EXPLAINED, FitOptions, Identified, IdentifyError, LabelledRecord, Observer, Provenance, RecordChecks, RecordLine,
    Settings, axes, identify, identify_checked,
};
use ffid::workflow::preflight::Sensing;
use ident::Noise;
use nalgebra::{DMatrix, Rotation3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;
use std::path::Path;

/// The records of one minute.
pub(in crate::study) const RECORDS: [&str; 3] = ["m1", "m2", "m3"];

/// What sensors read; rows are samples.
#[derive(Clone)]
pub(in crate::study) struct Readings {
    pub(in crate::study) rate_hz: f64,
    pub(in crate::study) q: DMatrix<f64>,
    /// Of the joints, for friction; not given to the fit.
    pub(in crate::study) qd: DMatrix<f64>,
    pub(in crate::study) tau: DMatrix<f64>,
    pub(in crate::study) gyro: DMatrix<f64>,
}

impl Readings {
    /// The gyro is mounted with this rotation.
    pub(in crate::study) fn turn_gyro(&mut self, by: &Rotation3<f64>) {
        self.gyro = &self.gyro * DMatrix::from_fn(3, 3, |i, j| by[(j, i)]);
    }
}

/// How positions are read.
#[derive(Clone, Copy)]
pub(in crate::study) enum Encoder {
    /// With the white noise that the mission states.
    Noisy,
    /// In steps of a turn over two to this.
    Bits(i32),
}

/// Missions, and records without noise.
pub(in crate::study) struct World {
    /// What the records obey.
    pub(in crate::study) truth: Opened,
    /// The same with other first values of what is estimated.
    pub(in crate::study) start: Opened,
    encoder_rad: f64,
    settings: Settings,
}

impl World {
    /// With the mission `start` of `fixtures/verdict`.
    pub(in crate::study) fn new(start: &str) -> anyhow::Result<Self> {
        let folder = workspace::root()?.join("fixtures/verdict");
        let [truth, start] = ["truth.toml", start].map(|name| open(&folder.join(name), Leniency::default()));
        let (truth, start) = (truth?, start?);
        let sensors = &start.mission.as_ref().context("no mission")?.sensors;
        let of = Sensing::of(sensors);
        // As `ffid identify` without flags.
        let settings = Settings {
            loss: ident::Loss::Squares,
            method: None,
            noise: Noise { torque: of.torque_nm, gyro: of.gyro_rad_per_s },
            biases: true,
            initial_state: false,
            prior: None,
            start_offset: 0.0,
            seed: 0,
            max_iterations: 100,
            limit: EXPLAINED,
            adopt: Vec::new(),
            current_noise: 0.0,
            drives: Vec::new(),
            reflected_inertia: Vec::new(),
            held_errors: Vec::new(),
            low_pass_hz: None,
        };
        Ok(Self { encoder_rad: sensors.encoder.noise_std_rad, truth, start, settings })
    }
    /// One of [`RECORDS`], without noise.
    pub(in crate::study) fn clean(&self, record: &str) -> anyhow::Result<Readings> {
        self.read(&workspace::root()?.join(format!("fixtures/verdict/{record}.parquet")))
    }
    /// A record without noise.
    pub(in crate::study) fn read(&self, path: &Path) -> anyhow::Result<Readings> {
        let r = read(path, &joints_of(&self.truth.model), &ReadOptions::default())?.record;
        let qd = r.qd().with_context(|| format!("{}: no rates", path.display()))?.clone();
        Ok(Readings { rate_hz: r.rate_hz(), q: r.q().clone(), qd, tau: r.tau().clone(), gyro: r.gyro().clone() })
    }
    /// Adds the noise of the sensors.
    pub(in crate::study) fn noise(&self, r: &mut Readings, encoder: Encoder, rng: &mut ChaCha8Rng) {
        let add = |m: &mut DMatrix<f64>, sigma: f64, rng: &mut ChaCha8Rng| {
            m.iter_mut().for_each(|x| *x += sigma * Distribution::<f64>::sample(&StandardNormal, rng));
        };
        add(&mut r.tau, self.settings.noise.torque, rng);
        add(&mut r.gyro, self.settings.noise.gyro, rng);
        match encoder {
            Encoder::Noisy => add(&mut r.q, self.encoder_rad, rng),
            Encoder::Bits(bits) => {
                let step = core::f64::consts::TAU / 2f64.powi(bits);
                for mut column in r.q.column_iter_mut() {
                    // Where a step begins is chance: with the same steps in all worlds, all would read the same positions.
                    let phase = step * rng.random::<f64>();
                    column.iter_mut().for_each(|x| *x = ((*x + phase) / step).round() * step - phase);
                }
            }
        }
    }
    fn record(&self, r: &Readings, allow: &[&str]) -> Result<Record, Problems> {
        let b = RecordBuilder::new(self.truth.model.joint_names()).uniform(0.0, r.rate_hz);
        let b = allow.iter().fold(b, |b, code| b.allow(*code));
        Ok(b.q(r.q.clone()).tau(r.tau.clone()).gyro(r.gyro.clone()).build()?.0)
    }
    fn provenance(&self) -> Provenance {
        Provenance {
            program: "xtask study verdict".to_owned(),
            inputs: Vec::new(),
            record: RecordLine { samples: 0, rate_hz: 0.0, seconds: 0.0, t0: 0.0, rates: false },
            noise_torque_nm: self.settings.noise.torque,
            noise_gyro_rad_per_s: self.settings.noise.gyro,
            settings: BTreeMap::new(),
        }
    }
    /// What `ffid identify` makes of readings.
    pub(in crate::study) fn identify(&self, opened: &Opened, r: &Readings) -> Result<Identified, IdentifyError> {
        self.identify_all(opened, &mut [self.labelled("rec", r).map_err(IdentifyError::Refused)?])
    }
    /// A record as the fit takes it.
    pub(in crate::study) fn labelled(&self, label: &str, r: &Readings) -> Result<LabelledRecord, Problems> {
        Ok(LabelledRecord {
            label: label.to_owned(),
            record: self.record(r, &[])?,
            resampled: (false, false),
            continues: false,
            ago: 0,
        })
    }
    /// What `ffid identify` makes of several records, corrected clocks put into them.
    pub(in crate::study) fn identify_all(
        &self,
        opened: &Opened,
        records: &mut [LabelledRecord],
    ) -> Result<Identified, IdentifyError> {
        let axes = |records: &[LabelledRecord], s: &Settings| -> Result<(), IdentifyError> {
            let nominal = Params::nominal(&opened.model);
            for labelled in records {
                let turned = axes::mismatch(&opened.model, nominal.values(), &labelled.record, s)?;
                if turned.has_errors() {
                    return Err(IdentifyError::Refused(turned));
                }
            }
            Ok(())
        };
        let (options, checks, watch) = (FitOptions::default(), RecordChecks::default(), Observer::default());
        identify_checked(opened, records, &self.settings, &options, checks, &axes, &self.provenance(), &watch)
            .map(|(found, _, _)| found)
    }
    /// One fit, without checks of the record: for readings without noise, whose residuals are those of an error alone.
    pub(in crate::study) fn fit(&self, opened: &Opened, r: &Readings) -> Result<Identified, IdentifyError> {
        let record = self.record(r, &["Data::Stuck"]).map_err(IdentifyError::Refused)?;
        let records =
            [LabelledRecord { label: "rec".to_owned(), record, resampled: (false, false), continues: false, ago: 0 }];
        identify(opened, &records, &self.settings, &FitOptions::default(), self.provenance(), &Observer::default())
    }
}
