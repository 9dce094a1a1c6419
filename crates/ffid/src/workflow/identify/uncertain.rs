//! What the mission is not sure of ([`ff_mission::mission::Uncertain`], `[sensors]`): unknowns with priors, estimated beside what is
//! asked for and marginalised.
//!
//! Errors of sensors and placements are parameters that all records share ([`ident::compose::SharedErrors`]). The ten numbers of an
//! uncertain body follow from its errors: with mass m, centre of mass c and inertia I_c about it, all of the mission,
//!
//! ```text
//! mass       the ten numbers in proportion (m, m c, I about the origin)
//! com_j      d(m c) = m e_j,   dI = m (2 c_j E - e_j c^T - c e_j^T)
//! inertia    dI = e_j e_k^T + e_k e_j^T (e_j e_j^T on the diagonal)
//! ```

use super::error::{IdentifyError, config};
use super::over_time::{OverTime, declared};
use crate::open::Opened;
use ff_mission::mission::{EstimateMethod, Mission, named_by};
use ff_model::tree::{DisplacementKind, Placed};
use ff_model::{BaseKind, Inertia, Model, ParamDecl, ParamGroup};
use ident::compose::Affine;
use ident::uncertain::ErrorSource;
use ident::{Options, Tie};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Deviations that the range of a declaration spans to either side.
const RANGE: f64 = 5.0;
const PAIRS: [(usize, usize, &str); 6] =
    [(0, 0, "xx"), (0, 1, "xy"), (1, 1, "yy"), (0, 2, "xz"), (1, 2, "yz"), (2, 2, "zz")];
const AXES: [&str; 3] = ["x", "y", "z"];

/// What kind of thing is uncertain: errors of one kind are weighed, measured or calibrated by the same means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UncertainKind {
    /// Masses of bodies.
    Masses,
    /// Their centres of mass.
    CentresOfMass,
    /// Their inertia.
    Inertias,
    /// Parameters of appendages.
    Parameters,
    /// Places and directions of mounts.
    Mounts,
    /// Places and axes of joints.
    Joints,
    /// Gains of torque sensors.
    TorqueGains,
    /// Scale of the gyro.
    GyroScale,
    /// Rotation of the gyro against the base.
    GyroAlignment,
    /// Zeros of the encoders.
    EncoderOffsets,
    /// Changes of parameters from record to record.
    Changes,
    /// Biases that walk within a record.
    BiasWalks,
    /// Friction and reflected inertia of joints.
    JointTerms,
    /// Gains of drives: torque by current.
    DriveGains,
}

impl UncertainKind {
    /// Whether it belongs to sensors or placements, and not to the parameters of the model.
    pub fn is_shared(self) -> bool {
        !matches!(
            self,
            Self::Masses | Self::CentresOfMass | Self::Inertias | Self::Parameters | Self::Changes | Self::BiasWalks
        )
    }
    /// Whether the rigid method has columns of it.
    fn is_of_parameters(self) -> bool {
        !self.is_shared() && self != Self::BiasWalks
    }
    /// The size of a small error of this kind, in words: what [`UncertainItems::small`] has as deviations.
    pub(in crate::workflow) fn small(self) -> &'static str {
        match self {
            Self::Masses
            | Self::Inertias
            | Self::Parameters
            | Self::TorqueGains
            | Self::GyroScale
            | Self::JointTerms
            | Self::DriveGains => "1 %",
            Self::CentresOfMass => "1 mm",
            Self::Mounts | Self::Joints => "1 mm (1 mrad)",
            Self::GyroAlignment | Self::EncoderOffsets => "1 mrad",
            Self::Changes | Self::BiasWalks => "one deviation",
        }
    }
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Masses => "masses",
            Self::CentresOfMass => "centres of mass",
            Self::Inertias => "inertias",
            Self::Parameters => "parameters held",
            Self::Mounts => "mounts",
            Self::Joints => "joint placements",
            Self::TorqueGains => "torque gains",
            Self::GyroScale => "gyro scale",
            Self::GyroAlignment => "gyro alignment",
            Self::EncoderOffsets => "encoder zeros",
            Self::Changes => "changes between records",
            Self::BiasWalks => "walks of biases",
            Self::JointTerms => "friction of joints",
            Self::DriveGains => "gains of drives",
        }
    }
}

/// An unknown that stands for something the mission is not sure of.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::workflow) struct UncertainUnknown {
    /// Its name: `error.l2.mass`, `tank.length`, `wing.mount.rx`, `torque.gain.j3`, `gyro.rotation.x`.
    pub(in crate::workflow) name: String,
    /// SI unit.
    pub(in crate::workflow) unit: &'static str,
    /// What the mission says: mean, and standard deviation.
    pub(in crate::workflow) mean: f64,
    /// See [`UncertainUnknown::mean`].
    pub(in crate::workflow) std: f64,
    /// What kind of thing it is.
    pub(in crate::workflow) kind: UncertainKind,
}

/// What a mission is not sure of, one line per unknown: for `ffid check`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DeclaredUncertain {
    /// The unknowns that are estimated beside what is asked for.
    pub unknowns: Vec<DeclaredUnknown>,
    /// Those among them that the method of the mission takes as exact: what moves slowly on the ground, sensors, placements and walks of
    /// biases with the rigid one.
    pub not_allowed_for: Vec<String>,
}

/// A line of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeclaredUnknown {
    /// Its name.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// What kind of thing it is.
    pub kind: UncertainKind,
    /// What the mission says: mean, and standard deviation.
    pub mean: f64,
    /// See [`DeclaredUnknown::mean`].
    pub std: f64,
}

impl DeclaredUncertain {
    /// Of a mission; `None` where it is sure of everything.
    pub fn of(opened: &Opened) -> Option<Self> {
        let line = |u: UncertainUnknown| DeclaredUnknown {
            name: u.name,
            unit: u.unit,
            kind: u.kind,
            mean: u.mean,
            std: u.std,
        };
        let moving = opened.mission.iter().flat_map(|m| declared(m, &opened.model));
        let unknowns: Vec<DeclaredUnknown> =
            UncertainItems::of(opened).unknowns.into_iter().chain(moving).map(line).collect();
        let rigid = opened.mission.as_ref().is_some_and(|m| m.estimate.method == Some(EstimateMethod::Rda));
        let ground = opened.model.base_kind() == BaseKind::Fixed;
        let moves = |k: UncertainKind| matches!(k, UncertainKind::Changes | UncertainKind::BiasWalks);
        let exact = |u: &&DeclaredUnknown| ground && moves(u.kind) || rigid && !u.kind.is_of_parameters();
        let not_allowed_for = unknowns.iter().filter(exact).map(|u| u.name.clone()).collect();
        (!unknowns.is_empty()).then_some(Self { unknowns, not_allowed_for })
    }
}

impl std::fmt::Display for DeclaredUncertain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (all, exact) = (self.unknowns.len(), self.not_allowed_for.len());
        match exact {
            0 => writeln!(f, "\nnot known exactly ({all}), allowed for by `ffid identify`")?,
            n => writeln!(f, "\nnot known exactly ({all}); the method of this mission takes {n} of them as exact")?,
        }
        let mut kinds: Vec<UncertainKind> = self.unknowns.iter().map(|u| u.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let of: Vec<&str> = self.unknowns.iter().filter(|u| u.kind == kind).map(|u| u.name.as_str()).collect();
            let some = ff_model::diagnostics::list(of.iter().copied(), 6);
            writeln!(f, "  {:23} {:>3}  {some}", kind.words(), of.len())?;
        }
        Ok(())
    }
}

/// Everything that a mission is not sure of.
#[derive(Clone, Debug, Default)]
pub struct UncertainItems {
    /// Its unknowns, in the order: parameters of the model, errors that records share, errors of bodies.
    pub(in crate::workflow) unknowns: Vec<UncertainUnknown>,
    /// Parameters of the model among them.
    pub(super) parameters: Vec<usize>,
    /// Estimated parameters of which something is known beforehand, with mean and deviation.
    pub(in crate::workflow) priors: Vec<(usize, f64, f64)>,
    pub(super) errors: Vec<ErrorSource>,
    pub(super) kinematics: Vec<String>,
    /// Errors that records share, as parameters behind those of the model.
    pub(in crate::workflow) shared: Vec<ParamDecl>,
    /// Names of those among them of which nothing is known, and that nobody asked for, friction and gains of joints; where a fit begins.
    pub(super) beside: Vec<(String, f64)>,
    bodies: Vec<BodyErrors>,
    /// Values that priors are about, by name, where they are not those of the model ([`Mission::prior_means`]).
    pub(super) means: BTreeMap<String, f64>,
    /// What records bring.
    pub(super) over_time: OverTime,
}

/// The ten numbers of some bodies as functions of errors.
#[derive(Clone, Debug)]
struct BodyErrors {
    unknowns: Vec<ParamDecl>,
    /// First of the ten numbers of each body, and what each error changes of them.
    first: Vec<usize>,
    /// Ten numbers of each that the errors are about, where they are not those of the model.
    about: Option<Vec<f64>>,
    slopes: Vec<Vec<(usize, [f64; 10])>>,
}

fn decl(name: String, unit: &'static str, std: f64) -> ParamDecl {
    ParamDecl { name, unit, nominal: 0.0, bounds: (-RANGE * std, RANGE * std), group: ParamGroup::Free }
}

impl UncertainItems {
    /// Errors of sensors and placements with these names, to be held.
    pub(super) fn held(model: &Model, names: &[String]) -> Self {
        let (joints, mut out) = (model.joint_names(), Self::default());
        for source in ErrorSource::all(model.nj()) {
            if names.contains(&source.name(&joints)) {
                out.errors.push(source);
            }
        }
        for source in names.iter().filter_map(|n| ErrorSource::of_joint(n, &joints)) {
            if !out.errors.contains(&source) {
                out.errors.push(source);
            }
        }
        let placed = names.iter().filter(|n| model.kinematic_index(n).is_some());
        out.kinematics = placed.cloned().collect();
        out
    }
    /// Of a mission; nothing where there is none.
    pub(in crate::workflow::identify) fn of(opened: &Opened) -> Self {
        let of = |m: &Mission| Self::of_mission(m, &opened.model, &opened.estimated);
        opened.mission.as_ref().map_or_else(Self::default, of)
    }
    /// What priors of a mission are about, alone.
    pub(super) fn means(opened: &Opened) -> Self {
        let means = opened.mission.as_ref().map_or_else(BTreeMap::new, |m| m.prior_means.clone());
        Self { means, ..Self::default() }
    }
    /// Of a mission where these parameters are estimated, about the values of the model; nothing where there is no mission, or it is sure of
    /// everything. Allocates.
    pub fn beside(opened: &Opened, estimated: &[usize]) -> Self {
        let of = |m: &Mission| {
            let about_model = Mission { prior_means: BTreeMap::new(), ..m.clone() };
            Self::of_mission(&about_model, &opened.model, estimated)
        };
        opened.mission.as_ref().map_or_else(Self::default, of)
    }
    /// Errors of 1 %, 1 mm or 1 mrad in everything that a mission holds fixed beside these parameters: masses and centres of mass, gains
    /// of sensors, placements; nothing where the mission says itself what it is not sure of. Allocates.
    pub fn small(opened: &Opened, estimated: &[usize]) -> Self {
        let Some(mission) = opened.mission.as_ref().filter(|_| Self::beside(opened, estimated).is_empty()) else {
            return Self::default();
        };
        let mut m = mission.clone();
        let all = || vec!["*".to_owned()];
        m.uncertain = vec![ff_mission::mission::Uncertain {
            bodies: all(),
            mass_relative_std: Some(0.01),
            com_std_m: Some(1e-3),
            mounts: all(),
            position_std_m: Some(1e-3),
            angle_std_rad: Some(1e-3),
            ..Default::default()
        }];
        let s = &mut m.sensors;
        (s.torque.gain_relative_std, s.torque.gain_common_relative_std) = (Some(0.01), Some(0.01));
        (s.gyro.scale_relative_std, s.gyro.misalignment_std_rad) = (Some(0.01), Some(1e-3));
        s.encoder.offset_std_rad = Some(1e-3);
        Self::of_mission(&m, &opened.model, estimated)
    }
    /// Of the sections of a mission for a model of it. Allocates.
    pub(in crate::workflow) fn of_mission(mission: &Mission, model: &Model, estimated: &[usize]) -> Self {
        let mut out = Self { means: mission.prior_means.clone(), ..Self::default() };
        let mut decls = model.param_decls();
        decls.iter_mut().for_each(|d| d.nominal = out.means.get(&d.name).copied().unwrap_or(d.nominal));
        out.parameters(mission, &decls, estimated);
        out.sensors(mission, model);
        out.placements(mission, model);
        out.bodies(mission, &decls, estimated);
        out
    }
    /// Whether everything that is not estimated is taken as exact.
    pub fn is_empty(&self) -> bool {
        self.unknowns.is_empty() && self.priors.is_empty()
    }
    /// What is known beforehand of estimated parameters, alone: nothing else is estimated beside them.
    pub(super) fn held_at_mission(&self) -> Self {
        Self { priors: self.priors.clone(), means: self.means.clone(), ..Self::default() }
    }
    /// Without errors of sensors and placements, and the names of those: for a method that has no columns of them.
    pub(super) fn of_parameters_alone(self) -> (Self, Vec<String>) {
        let (unknowns, left): (Vec<_>, Vec<_>) = self.unknowns.into_iter().partition(|u| u.kind.is_of_parameters());
        let names: Vec<String> = left.into_iter().map(|u| u.name).chain(self.beside.into_iter().map(|b| b.0)).collect();
        let Self { parameters, priors, bodies, means, mut shared, mut over_time, .. } = self;
        shared.retain(|d| !names.contains(&d.name));
        over_time.no_walks();
        (Self { unknowns, parameters, priors, bodies, means, shared, over_time, ..Self::default() }, names)
    }
    /// Whether there are errors that the rigid method has no columns of.
    pub(super) fn needs_output_error(&self) -> bool {
        let known = |d: &ParamDecl| self.unknowns.iter().any(|u| u.name == d.name && u.kind.is_of_parameters());
        !self.shared.iter().all(known)
    }
    /// Number of its unknowns.
    pub fn count(&self) -> usize {
        self.unknowns.len()
    }
    /// Parameters of the model that its unknowns change.
    pub(in crate::workflow) fn touched(&self) -> usize {
        self.parameters.len() + self.bodies.iter().map(|b| 10 * b.first.len()).sum::<usize>()
    }
    fn parameters(&mut self, mission: &Mission, decls: &[ParamDecl], estimated: &[usize]) {
        for u in &mission.uncertain {
            for (i, d) in decls.iter().enumerate().filter(|(_, d)| named_by(&u.parameters, &d.name)) {
                let known = self.parameters.contains(&i) || self.priors.iter().any(|p| p.0 == i);
                let std = u.std.or(u.relative_std.map(|r| r * d.nominal.abs())).filter(|s| *s > 0.0);
                let Some(std) = std.filter(|_| !known) else { continue };
                if estimated.contains(&i) {
                    self.priors.push((i, d.nominal, std));
                    continue;
                }
                self.parameters.push(i);
                let kind = UncertainKind::Parameters;
                self.unknowns.push(UncertainUnknown { name: d.name.clone(), unit: d.unit, mean: d.nominal, std, kind });
            }
        }
    }
    fn share(&mut self, name: String, unit: &'static str, std: f64, kind: UncertainKind) {
        self.share_about(name, unit, (0.0, std), kind);
    }
    /// A parameter behind those of the model with this mean and standard deviation.
    pub(super) fn share_about(
        &mut self,
        name: String,
        unit: &'static str,
        (mean, std): (f64, f64),
        kind: UncertainKind,
    ) {
        if self.shared.iter().any(|d| d.name == name) {
            return;
        }
        // Its size is that of the deviation, whatever the mean: the nominal value stays zero, and fits begin at the mean.
        let around = decl(name.clone(), unit, std);
        let bounds = (mean + around.bounds.0, mean + around.bounds.1);
        self.shared.push(ParamDecl { bounds, ..around });
        self.unknowns.push(UncertainUnknown { name, unit, mean, std, kind });
    }
    /// An error of this size that is to be estimated, of which nothing is known.
    pub(super) fn adopt(&mut self, name: String, unit: &'static str, size: f64) {
        if self.shared.iter().all(|d| d.name != name) {
            self.shared.push(decl(name, unit, size / RANGE));
        }
    }
    /// An error of this size that nobody asked for, of which nothing is known; fits begin at `start`. What is measured by its own value
    /// (`nominal` is not zero) keeps its sign, what is measured by its size need not.
    pub(super) fn beside_about(&mut self, name: String, unit: &'static str, (nominal, start): (f64, f64), size: f64) {
        // One that was adopted has been asked for.
        if self.shared.iter().all(|d| d.name != name) {
            self.shared.push(ParamDecl { nominal, ..decl(name.clone(), unit, size / RANGE) });
            self.beside.push((name, start));
        }
    }
    fn sensors(&mut self, mission: &Mission, model: &Model) {
        let (s, joints) = (&mission.sensors, model.joint_names());
        let mut of = |source: ErrorSource, std: Option<f64>, kind: UncertainKind| {
            let Some(std) = std else { return };
            self.errors.push(source);
            self.share(source.name(&joints), source.unit(), std, kind);
        };
        of(ErrorSource::TorqueGain(None), s.torque.gain_common_relative_std, UncertainKind::TorqueGains);
        for j in 0..model.nj() {
            of(ErrorSource::TorqueGain(Some(j)), s.torque.gain_relative_std, UncertainKind::TorqueGains);
        }
        for i in 0..3 {
            of(ErrorSource::GyroScale(Some(i)), s.gyro.scale_relative_std, UncertainKind::GyroScale);
        }
        for i in 0..3 {
            of(ErrorSource::GyroRotation(i), s.gyro.misalignment_std_rad, UncertainKind::GyroAlignment);
        }
    }
    fn placements(&mut self, mission: &Mission, model: &Model) {
        let (joints, mounts) = (model.bodies(), model.appendages());
        for p in model.kinematic_params() {
            let (owner, kind) = match p.of {
                Placed::Joint(j) => (&joints[j].joint.name, UncertainKind::Joints),
                Placed::Mount(k) => (&mounts[k].name, UncertainKind::Mounts),
            };
            let (std, kind) = match p.kind {
                DisplacementKind::Offset => (mission.sensors.encoder.offset_std_rad, UncertainKind::EncoderOffsets),
                of => {
                    let named = mission.uncertain.iter().filter(|u| named_by(&u.mounts, owner));
                    let std = |u: &ff_mission::mission::Uncertain| match of {
                        DisplacementKind::Shift => u.position_std_m,
                        _ => u.angle_std_rad,
                    };
                    (named.filter_map(std).next_back(), kind)
                }
            };
            if let Some(std) = std {
                self.kinematics.push(p.name.clone());
                self.share(p.name.clone(), p.unit, std, kind);
            }
        }
    }
    /// Bodies of which nothing is estimated. A later table replaces what an earlier one says of a body.
    fn bodies(&mut self, mission: &Mission, decls: &[ParamDecl], estimated: &[usize]) {
        let whole = |i: usize| {
            matches!(decls[i].group, ParamGroup::Inertial(_))
                && decls[i].unit == "kg"
                && i + 10 <= decls.len()
                && (i..i + 10).all(|k| !estimated.contains(&k))
                && decls[i].nominal > 0.0
        };
        let mut taken: Vec<usize> = Vec::new();
        for u in mission.uncertain.iter().rev() {
            let named = |i: &usize| decls[*i].name.strip_suffix(".mass").is_some_and(|n| named_by(&u.bodies, n));
            let of: Vec<usize> = (0..decls.len()).filter(|&i| whole(i) && !taken.contains(&i)).filter(named).collect();
            taken.extend(&of);
            let ten = |i: usize| -> [f64; 10] { core::array::from_fn(|k| decls[i + k].nominal) };
            let known = |i: &usize| (*i..i + 10).any(|k| self.means.contains_key(&decls[k].name));
            let about = of.iter().any(known).then(|| of.iter().flat_map(|&i| ten(i)).collect());
            let mut e = BodyErrors { unknowns: Vec::new(), first: of.clone(), about, slopes: Vec::new() };
            let mut kinds = Vec::new();
            let mut put = |name: String, unit: &'static str, std: f64, kind, slopes| {
                e.unknowns.push(decl(name, unit, std));
                e.slopes.push(slopes);
                kinds.push((std, kind));
            };
            if let (true, Some(std)) = (u.common && !of.is_empty(), u.mass_relative_std) {
                let all = of.iter().enumerate().map(|(b, &i)| (b, ten(i))).collect();
                let name = format!("error.{}.mass", u.bodies.join("+"));
                put(name, "1", std, UncertainKind::Masses, all);
            }
            for (b, &i) in of.iter().enumerate() {
                let name = decls[i].name.trim_end_matches(".mass");
                let body = Inertia::from_params(&ten(i));
                let (m, c, about) = (body.mass, body.com().unwrap_or_default(), body.about_com());
                if let (false, Some(std)) = (u.common, u.mass_relative_std) {
                    let slope = ten(i).map(|p| p / m);
                    put(format!("error.{name}.mass"), "kg", std * m, UncertainKind::Masses, vec![(b, slope)]);
                }
                for j in (0..3).filter(|_| u.com_std_m.is_some()) {
                    let (e_j, mut slope) = (Vector3::ith(j, 1.0), [0.0; 10]);
                    slope[1 + j] = m;
                    let turn = m * (2.0 * c[j] * Matrix3::identity() - e_j * c.transpose() - c * e_j.transpose());
                    PAIRS.iter().enumerate().for_each(|(k, &(a, b, _))| slope[4 + k] = turn[(a, b)]);
                    let name = format!("error.{name}.com_{}", AXES[j]);
                    put(name, "m", u.com_std_m.unwrap_or_default(), UncertainKind::CentresOfMass, vec![(b, slope)]);
                }
                for (k, &(p, q, pair)) in PAIRS.iter().enumerate().filter(|_| u.inertia_relative_std.is_some()) {
                    let mut slope = [0.0; 10];
                    slope[4 + k] = 1.0;
                    let std = u.inertia_relative_std.unwrap_or_default() * (about[(p, p)] * about[(q, q)]).sqrt();
                    if std > 0.0 {
                        let name = format!("error.{name}.i_{pair}");
                        put(name, "kg m^2", std, UncertainKind::Inertias, vec![(b, slope)]);
                    }
                }
            }
            let lines = e.unknowns.iter().zip(kinds).map(|(d, (std, kind))| UncertainUnknown {
                name: d.name.clone(),
                unit: d.unit,
                mean: 0.0,
                std,
                kind,
            });
            self.unknowns.extend(lines);
            if !e.unknowns.is_empty() {
                self.bodies.push(e);
            }
        }
    }
    /// The ten numbers of uncertain bodies as ties.
    pub(in crate::workflow) fn ties(&self, values: &[f64]) -> Result<Vec<Box<dyn Tie>>, IdentifyError> {
        let one = |e: &BodyErrors| -> Result<Box<dyn Tie>, IdentifyError> {
            let parameters: Vec<usize> = e.first.iter().flat_map(|&i| i..i + 10).collect();
            let offset = match &e.about {
                Some(about) => DVector::from_column_slice(about),
                None => DVector::from_iterator(parameters.len(), parameters.iter().map(|&i| values[i])),
            };
            let mut matrix = DMatrix::zeros(parameters.len(), e.unknowns.len());
            for (column, slopes) in e.slopes.iter().enumerate() {
                for (b, slope) in slopes {
                    slope.iter().enumerate().for_each(|(k, x)| matrix[(10 * b + k, column)] = *x);
                }
            }
            let tie = Affine::new(e.unknowns.clone(), parameters, offset, matrix);
            let refused =
                |e: ident::compose::TieError| config("Config::Uncertain", e.to_string(), "name each body once");
            Ok(Box::new(tie.map_err(|e| IdentifyError::Refused(refused(e)))?))
        };
        self.bodies.iter().map(one).collect()
    }
    /// Puts the errors that records share into the options of their estimators.
    pub(in crate::workflow) fn widen(&self, o: &mut Options) {
        for e in &self.errors {
            if !o.errors.contains(e) {
                o.errors.push(*e);
            }
        }
        for name in &self.kinematics {
            if !o.kinematics.contains(name) {
                o.kinematics.push(name.clone());
            }
        }
    }
    /// Names of the errors that records share.
    pub(in crate::workflow) fn shared_names(&self) -> Vec<String> {
        self.shared.iter().map(|d| d.name.clone()).collect()
    }
}
