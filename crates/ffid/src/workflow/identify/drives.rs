//! Channels on the motor's side of the gears (`[[drive]]` of a mission, currents in a record): terms and gains that are estimated beside the
//! parameters, and the record as a torque sensor behind the gears would have it.
//!
//! ```text
//! k_j i_j = tau_j + sum_t c_jt f_t(qd_j, qdd_j, tau_j)
//! ```
//!
//! They belong to the robot and are the same in all records. A term has a column that the motion of its joint gives
//! ([`ident::uncertain::ErrorSource::Joint`]); a gain divides the channel ([`ident::uncertain::ErrorSource::DriveGain`]).

use super::error::{IdentifyError, config};
use super::labelled_record::LabelledRecord;
use super::record_estimator::setup;
use super::settings::Settings;
use super::uncertain::{UncertainItems, UncertainKind};
use ff_mission::mission::{Drive, DriveTerm};
use ff_model::diagnostics::list;
use ff_model::{Area, JointKind, Model, Params, Problem, Problems};
use ff_records::Record;
use ident::estimate::{JointTerm, JointTorques, NearRest, RoughJoints, rough_joints, without_joints};
use ident::uncertain::ErrorSource;
use ident::{Noise, Options};
use std::borrow::Cow;

/// Deviation of a gain that is not known, relative to the first guess of it: the size that it is measured by.
const GAIN: f64 = 0.1;

/// What the channels of a record are: terms of every joint, joints whose current is read, and noise.
#[derive(Clone, Debug, Default)]
pub(in crate::workflow) struct Drives {
    terms: Vec<Vec<JointTerm>>,
    near_rest: Vec<Option<NearRest>>,
    currents: Vec<bool>,
    channel_noise: Vec<f64>,
    reflected_inertia: Vec<f64>,
}

/// A term of a mission as the library has it.
fn term(of: DriveTerm, drive: &Drive) -> Option<JointTerm> {
    Some(match of {
        DriveTerm::Viscous => JointTerm::Viscous,
        DriveTerm::Coulomb => JointTerm::Coulomb,
        DriveTerm::Offset => JointTerm::Offset,
        DriveTerm::Inertia => JointTerm::ReflectedInertia,
        DriveTerm::Asymmetry => JointTerm::Asymmetry,
        DriveTerm::Quadratic => JointTerm::Quadratic,
        DriveTerm::Stribeck => JointTerm::Stribeck { rate: drive.stribeck_rate_rad_per_s? },
        DriveTerm::Load => JointTerm::Load,
    })
}

/// What becomes of samples next to rest of a joint with this drive; nothing without dry friction.
fn near_rest(drive: &Drive) -> Option<NearRest> {
    let dry = drive.terms.iter().any(|t| t.is_dry());
    dry.then(|| drive.smooth_rad_per_s.map_or(NearRest::LeaveOut(drive.near_rest_rad_per_s), NearRest::Smooth))
}

/// Friction, reflected inertia and gains of a mission for a simulation, and what its joints do next to rest. Terms without a value are none. Allocates.
pub fn joint_torques(drives: &[Drive], joints: &[String]) -> (JointTorques, Vec<Option<NearRest>>) {
    let mut out = (JointTorques::default(), Vec::new());
    for joint in joints {
        let of = Drive::of(drives, joint);
        let terms = of
            .map_or_else(Vec::new, |d| d.values.iter().filter_map(|&(t, value)| Some((term(t, d)?, value))).collect());
        out.0.terms.push(terms);
        out.0.gains.push(of.and_then(|d| d.gain_nm_per_a));
        out.1.push(of.and_then(near_rest));
    }
    out
}

impl Drives {
    /// Of a record of a robot.
    pub(in crate::workflow) fn of(model: &Model, record: &Record, s: &Settings) -> Self {
        let joints = model.joint_names();
        let mut out = Self { currents: record.currents().to_vec(), ..Self::default() };
        for joint in &joints {
            let of = Drive::of(&s.drives, joint);
            // A bias of the channel is the same as a constant torque.
            let kept = |t: &DriveTerm| !(s.biases && *t == DriveTerm::Offset);
            let terms =
                of.map_or_else(Vec::new, |d| d.terms.iter().filter(|t| kept(t)).filter_map(|t| term(*t, d)).collect());
            out.terms.push(terms);
            out.near_rest.push(of.and_then(near_rest));
        }
        if out.currents.contains(&true) {
            let noise = |&current: &bool| if current { s.current_noise } else { s.noise.torque };
            out.channel_noise = out.currents.iter().map(noise).collect();
        }
        if !out.is_empty() {
            out.reflected_inertia.clone_from(&s.reflected_inertia);
        }
        if out.near_rest.iter().all(Option::is_none) {
            out.near_rest.clear();
        }
        out
    }
    /// Whether the channels read torques of the bodies and nothing else.
    pub(in crate::workflow) fn is_empty(&self) -> bool {
        !self.currents.contains(&true) && self.terms.iter().all(Vec::is_empty)
    }
    fn has_inertia(&self) -> bool {
        self.terms.iter().flatten().any(|t| *t == JointTerm::ReflectedInertia)
    }
    /// Puts noise of the channels, and what counts next to rest, into the options of an estimator.
    pub(in crate::workflow) fn widen(&self, o: &mut Options) {
        o.channel_noise.clone_from(&self.channel_noise);
        o.near_rest.clone_from(&self.near_rest);
        o.reflected_inertia.clone_from(&self.reflected_inertia);
    }
    /// Standard deviation of every torque channel in its unit; none for torques that are all alike.
    pub(in crate::workflow) fn channel_noise(&self) -> &[f64] {
        &self.channel_noise
    }
    fn rough(
        &self,
        model: &Model,
        values: &[f64],
        record: &Record,
        noise: &Noise,
    ) -> Result<RoughJoints, IdentifyError> {
        rough_joints(model, record, values, &self.terms, &self.near_rest, &workable(record, noise)).map_err(setup)
    }
}

/// Noise that a rough fit works with where none was given.
fn workable(record: &Record, noise: &Noise) -> Noise {
    let or = |given: f64, signal: &nalgebra::DMatrix<f64>| {
        let rms = signal.norm() / (signal.len().max(1) as f64).sqrt();
        if given > 0.0 && given.is_finite() { given } else { (1e-3 * rms).max(1e-12) }
    };
    Noise { torque: or(noise.torque, record.tau()), gyro: or(noise.gyro, record.gyro()) }
}

/// The settings of a fit of these records: noise of torques in N m also where currents are read, by the gains that the mission gives or the records
/// roughly tell.
///
/// # Errors
/// [`IdentifyError::Refused`] for records of currents whose noise is not given, of different joints, or by the rigid method.
pub(super) fn settled(model: &Model, records: &[LabelledRecord], s: &Settings) -> Result<Settings, IdentifyError> {
    let refused = |code, what: String, on: &str, hint: &str| {
        let p = Problem::error(Area::Config, code, what).on(on).hint(hint);
        Err(IdentifyError::Refused(Problems(vec![p])))
    };
    let Some(first) = records.iter().find(|r| !r.record.has_torques()) else {
        return match records.first() {
            Some(r) if Drives::of(model, &r.record, s).has_inertia() => {
                let reflected_inertia = starts(model, records, s)?.inertia();
                Ok(Settings { reflected_inertia, ..s.clone() })
            }
            _ => Ok(s.clone()),
        };
    };
    let of = |r: &LabelledRecord| -> Vec<bool> {
        (0..model.nj()).map(|j| r.record.currents().get(j).copied().unwrap_or(false)).collect()
    };
    let currents = of(first);
    if let Some(other) = records.iter().find(|r| of(r) != currents) {
        let what = format!("{} and {} have currents of different joints", first.label, other.label);
        return refused("Config::Records", what, "--records", "give torques or currents of a joint in all of them");
    }
    if s.method == Some(super::result::fit::Method::Rda) {
        let what = "the rigid method takes torques, and the record has currents of motors";
        return refused("Config::Method", what.into(), "--method", "leave --method out");
    }
    if !(s.current_noise > 0.0 && s.current_noise.is_finite()) {
        let what = format!("noise {} A, limit > 0 A: residuals of currents are weighed by it", s.current_noise);
        let hint = "give noise_std_a in [sensors.current], or --current-noise on the command line";
        return refused("Config::NoNoise", what, "[sensors.current] noise_std_a", hint);
    }
    let start = starts(model, records, s)?;
    let known: Vec<f64> = start.gains.iter().enumerate().filter(|k| currents[k.0]).map(|(_, k)| k.abs()).collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    // What is known of torques in N m, where no torque sensor says it.
    let torque =
        if currents.contains(&false) && s.noise.torque > 0.0 { s.noise.torque } else { mean * s.current_noise };
    let reflected_inertia = start.inertia();
    Ok(Settings { noise: Noise { torque, ..s.noise }, reflected_inertia, ..s.clone() })
}

/// Where a fit begins: gains of all joints, and every term with a size of it.
struct Starts {
    gains: Vec<f64>,
    terms: Vec<Vec<(JointTerm, f64, f64)>>,
}

impl Starts {
    /// Reflected inertia of every joint; none where no joint has that.
    fn inertia(&self) -> Vec<f64> {
        let of = |all: &Vec<(JointTerm, f64, f64)>| {
            all.iter().find(|t| t.0 == JointTerm::ReflectedInertia).map_or(0.0, |t| t.1.abs())
        };
        let all: Vec<f64> = self.terms.iter().map(of).collect();
        if all.iter().all(|i| *i == 0.0) { Vec::new() } else { all }
    }
}

/// First guesses of gains and terms: those of the mission, or what the record roughly tells at the values of the mission.
fn starts(model: &Model, records: &[LabelledRecord], s: &Settings) -> Result<Starts, IdentifyError> {
    let joints = model.joint_names();
    let n = joints.len();
    let Some(r) = records.iter().find(|r| !r.record.has_torques()).or(records.first()) else {
        return Ok(Starts { gains: vec![1.0; n], terms: vec![Vec::new(); n] });
    };
    let drives = Drives::of(model, &r.record, s);
    let rough = drives.rough(model, Params::nominal(model).values(), &r.record, &s.noise)?;
    let read = |j: usize| r.record.currents().get(j).copied().unwrap_or(false);
    let of = |j: usize| Drive::of(&s.drives, &joints[j]).and_then(|d| d.gain_nm_per_a).or(rough.joints.gains[j]);
    let silent: Vec<&str> = (0..n).filter(|&j| read(j) && of(j).is_none()).map(|j| joints[j].as_str()).collect();
    if !silent.is_empty() {
        let silent = list(silent.iter().copied(), 6);
        let what = format!("the currents of {silent} follow no torque, and their gains cannot be told");
        let p = Problem::error(Area::Data, "Data::Currents", what).on(&r.label);
        let hint = "move these joints, or give gain_nm_per_a in [[drive]]";
        return Err(IdentifyError::Refused(Problems(vec![p.hint(hint)])));
    }
    // A gain is divided by, so that no fit leads from one sign to the other.
    let turned = |j: &usize| {
        let given = Drive::of(&s.drives, &joints[*j]).and_then(|d| d.gain_nm_per_a).filter(|_| read(*j))?;
        let found = rough.joints.gains[*j].filter(|k| k * given < 0.0)?;
        Some((*j, given, found))
    };
    if let Some((j, given, found)) = (0..n).find_map(|j| turned(&j)) {
        let what = format!(
            "the mission has a gain of {given} N m/A, the record roughly {found:.3} N m/A: the current runs the other way"
        );
        let p = Problem::error(Area::Data, "Data::Currents", what).on(format!("current.{}", joints[j]));
        let hint = "turn the sign of gain_nm_per_a in [[drive]] for this joint, or of the column";
        return Err(IdentifyError::Refused(Problems(vec![p.hint(hint)])));
    }
    let term_of = |j: usize, (term, size): (&JointTerm, &f64)| {
        let drive = Drive::of(&s.drives, &joints[j]);
        let given = drive.and_then(|d| d.values.iter().find(|v| self::term(v.0, d) == Some(*term))).map(|v| v.1);
        let start = given.unwrap_or_else(|| rough.joints.coefficient(j, *term));
        (*term, start, size.max(start.abs()))
    };
    let terms_of = |j: usize| drives.terms[j].iter().zip(&rough.sizes[j]).map(|t| term_of(j, t)).collect();
    Ok(Starts { gains: (0..n).map(|j| of(j).unwrap_or(1.0)).collect(), terms: (0..n).map(terms_of).collect() })
}

impl UncertainItems {
    /// With the terms and gains of joints among what records share: those of which the mission knows something with a prior, the others without.
    pub(super) fn with_drives(
        mut self,
        model: &Model,
        records: &[LabelledRecord],
        s: &Settings,
    ) -> Result<Self, IdentifyError> {
        let Some(first) = records.first() else { return Ok(self) };
        let drives = Drives::of(model, &first.record, s);
        if drives.is_empty() {
            return Ok(self);
        }
        let Starts { gains, terms } = starts(model, records, s)?;
        let joints = model.joint_names();
        for (j, joint) in joints.iter().enumerate() {
            let of = Drive::of(&s.drives, joint);
            let slides = model.bodies()[j].joint.kind == JointKind::Prismatic;
            if drives.currents.get(j) == Some(&true) {
                let source = ErrorSource::DriveGain(j);
                let unit = if slides { "N/A" } else { source.unit() };
                let known = of.and_then(|d| d.gain_relative_std).map(|r| r * gains[j].abs());
                let size = GAIN * gains[j].abs();
                self.put(source, source.name(&joints), unit, (gains[j], known, size), UncertainKind::DriveGains);
            }
            for &(term, start, size) in &terms[j] {
                let source = ErrorSource::Joint(j, term);
                let given = of.is_some_and(|d| d.values.iter().any(|v| self::term(v.0, d) == Some(term)));
                let relative = of.and_then(|d| d.relative_std).filter(|_| given);
                let known = relative.map(|r| r * start.abs()).filter(|std| *std > 0.0);
                let at = (start, known, size);
                self.put(source, term.name(joint), term.unit(slides), at, UncertainKind::JointTerms);
            }
        }
        Ok(self)
    }
    fn put(
        &mut self,
        source: ErrorSource,
        name: String,
        unit: &'static str,
        (mean, known, size): (f64, Option<f64>, f64),
        kind: UncertainKind,
    ) {
        if !self.errors.contains(&source) {
            self.errors.push(source);
        }
        match known {
            Some(std) => self.share_about(name, unit, (mean, std), kind),
            None => {
                let nominal = if kind == UncertainKind::DriveGains { mean } else { 0.0 };
                self.beside_about(name, unit, (nominal, mean), size);
            }
        }
    }
}

/// A record behind the gears, settings of a fit of it, and the gains of its currents.
pub(in crate::workflow) type BehindGears<'r> = (Cow<'r, Record>, Settings, Vec<Option<f64>>);

/// A record with the torques of the bodies in its channels, as far as the values tell, for what compares amplitudes, signs and modes; and settings of a
/// fit of it. Gains of its currents, where it has some. Borrowed where the channels read these torques anyway.
pub(in crate::workflow) fn behind_gears<'r>(
    model: &Model,
    values: &[f64],
    record: &'r Record,
    s: &Settings,
) -> Result<BehindGears<'r>, IdentifyError> {
    let drives = Drives::of(model, record, s);
    if drives.is_empty() {
        return Ok((Cow::Borrowed(record), s.clone(), Vec::new()));
    }
    let RoughJoints { joints: found, predicted, .. } = drives.rough(model, values, record, &s.noise)?;
    let noise = workable(record, &s.noise);
    let mut torques = without_joints(model, record, &found, &drives.near_rest, &noise).map_err(setup)?;
    // A current that tells nothing of its torque speaks neither for the prediction nor against it.
    let silent = |j: &usize| drives.currents.get(*j) == Some(&true) && found.gains[*j].is_none();
    if (0..model.nj()).any(|j| silent(&j)) {
        let mut tau = torques.tau().clone();
        (0..model.nj()).filter(silent).for_each(|j| tau.set_column(j, &predicted.column(j)));
        torques = torques.with_torques(tau);
    }
    let of_currents: Vec<f64> = found.gains.iter().flatten().map(|k| k.abs() * s.current_noise).collect();
    let mean = of_currents.iter().sum::<f64>() / of_currents.len().max(1) as f64;
    let torque = if s.noise.torque > 0.0 { s.noise.torque } else { mean };
    let settings =
        Settings { drives: Vec::new(), reflected_inertia: Vec::new(), noise: Noise { torque, ..s.noise }, ..s.clone() };
    Ok((Cow::Owned(torques), settings, found.gains))
}

/// Refuses to predict currents whose gains are not among what was identified.
pub(super) fn gains_known(model: &Model, record: &Record, names: &[String]) -> Result<(), IdentifyError> {
    let joints = model.joint_names();
    let lacks = |j: &usize| {
        let of = ErrorSource::DriveGain(*j).name(&joints);
        record.currents().get(*j).copied().unwrap_or(false) && !names.contains(&of)
    };
    let lacking: Vec<&str> = (0..joints.len()).filter(lacks).map(|j| joints[j].as_str()).collect();
    if lacking.is_empty() {
        return Ok(());
    }
    let what = format!("currents of {} without the gains of their drives", list(lacking.iter().copied(), 6));
    let hint = "identify from a record of currents, which tells the gains, or give torques";
    Err(IdentifyError::Refused(config("Data::Currents", what, hint)))
}
