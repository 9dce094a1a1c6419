//! A mode that the mission lacks as a part of the model: a modal appendage on the base, whose frequency, damping and participation are
//! estimated beside all else.
//!
//! The search ([`super::extra_mode`]) is linear at the end of a fit that is bent by what it lacks, and sees frequencies with the base
//! free. With momentum coefficients N of the search and the inertia M of the robot about the base's origin,
//!
//! ```text
//! g = N^T M^-1 N      mu = g / (1 + g)      omega^2 = omega_free^2 (1 - mu)      N_mounted = N sqrt(1 - mu)
//! ```
//!
//! are where the fit starts. The appendage is given a rigid sphere about the base's origin that holds more than its modes move, and
//! the base starts without it: together they are the base as it was, whose static mass the mode is part of.

use super::evidence::{ErrorSize, NamedError};
use super::fitted::Ended;
use super::number::num;
use super::unknowns::Unknowns;
use crate::open::Opened;
use core::f64::consts::TAU;
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::{Inertia, Model, Params, Xform};
use flex_panel::modal::{DIRECTIONS, ModalAppendage, Mode};
use ident::Uncertainty;
use ident::estimate::Estimate;
use ident::uncertain::PointMass;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Vector3, Vector6};
use std::collections::BTreeMap;

/// Name of the appendage.
const NAME: &str = "extra_mode";
/// Deviations by which the mass has to be known for its place to have a meaning, and by which it may differ between two directions.
const KNOWN: f64 = 3.0;
/// By how much, of chi-squared and of its fall, the momenta of a point mass may explain less.
const POINT: (f64, f64) = (22.0, 0.02);
/// Arm of the pendulum that stands for it (m): in weightlessness any will do.
const ARM: f64 = 0.3;

/// A robot with the mode.
pub(super) struct Mounted {
    pub(super) opened: Opened,
    /// Parameters of the base that start elsewhere: what the sphere takes of them.
    taken: BTreeMap<String, f64>,
    modes: usize,
}

impl Mounted {
    /// With these modes, the base held. `None` where the base is too light for them.
    pub(super) fn with(opened: &Opened, modes: &[Mode]) -> Option<Self> {
        let sum = |from: usize| -> f64 {
            modes.iter().map(|m| m.participation.fixed_rows::<3>(from).norm_squared()).sum::<f64>()
        };
        let (mass, moment) = ((2.0 * sum(0)).max(1e-9), (2.0 * sum(3)).max(1e-9));
        let sphere = Inertia::from_com(mass, &Vector3::zeros(), &(Matrix3::identity() * moment));
        let appendage = ModalAppendage::new(sphere, modes).ok()?;
        let mut opened = opened.clone();
        opened.model.mount(NAME, 0, Xform::identity(), appendage).ok()?;
        let prefix = |kind: &str| format!("{NAME}.{kind}[");
        let own = ["k", "d", "part"].map(prefix);
        let decls = opened.model.param_decls();
        let asked = decls.iter().enumerate().filter(|(_, d)| own.iter().any(|p| d.name.starts_with(p.as_str())));
        opened.estimated.extend(asked.map(|(i, _)| i));
        let taken = [("mass", mass), ("i_xx", moment), ("i_yy", moment), ("i_zz", moment)];
        let taken = taken.into_iter().map(|(n, x)| (format!("base.{n}"), x)).collect();
        Some(Self { opened, taken, modes: modes.len() })
    }
    /// The modes as a fit has found them.
    pub(super) fn modes_at(&self, e: &Estimate) -> Option<Vec<Mode>> {
        let of = |name: String| e.parameters.iter().find(|p| p.name == name).map(|p| p.value);
        let mode = |j: usize| {
            let omega = of(format!("{NAME}.k[{j}]"))?.sqrt();
            let damping_ratio = of(format!("{NAME}.d[{j}]"))? / (2.0 * omega);
            let part: Option<Vec<f64>> = DIRECTIONS.iter().map(|i| of(format!("{NAME}.part[{j}].{i}"))).collect();
            Some(Mode { frequency_hz: omega / TAU, damping_ratio, participation: Vector6::from_vec(part?) })
        };
        (0..self.modes).map(mode).collect()
    }
    /// Where unknowns of a fit with it begin: those of the fit without at `values`, less what the sphere takes of them.
    pub(super) fn start(&self, values: &BTreeMap<String, f64>, unknowns: &Unknowns) -> Vec<f64> {
        let mut start = unknowns.at(values);
        start.iter_mut().zip(&unknowns.decls).for_each(|(x, d)| *x -= self.takes(&d.name));
        start
    }
    /// What the sphere takes of a parameter.
    pub(super) fn takes(&self, name: &str) -> f64 {
        self.taken.get(name).copied().unwrap_or(0.0)
    }
    /// Numbers that were adjusted for it: frequency, damping and participation of each mode.
    pub(super) fn freedom(&self) -> usize {
        (2 + DIRECTIONS.len()) * self.modes
    }
    /// Puts what a fit has found in place of what the search had; `false` where it does not determine it.
    pub(super) fn describe(&self, e: &Estimate, line: &mut NamedError) -> bool {
        let Some(found) = Found::new(self.modes, e) else { return false };
        line.size = found.sizes();
        let point = found.point(line.drop);
        if let Some(p) = &point {
            let of = |name: &str, unit: &str, (value, std): (f64, f64)| ErrorSize {
                name: name.into(),
                unit: unit.into(),
                value,
                std,
            };
            line.size.push(of("mass", "kg", p.mass));
            ["x", "y", "z"].iter().zip(p.position).for_each(|(n, at)| line.size.push(of(n, "m", at)));
        }
        line.text = found.words(point.as_ref());
        let base = self.opened.model.body_name(0);
        line.mission = point.as_ref().and_then(|p| found.pendulum(base, p)).unwrap_or_else(|| found.modal(base));
        true
    }
}

/// Modes of these momentum coefficients (columns), frequency (Hz) and damping ratio, as a record shows them, with the base held.
pub(super) fn base_held(end: &Ended<'_>, momenta: &DMatrix<f64>, hz: f64, damping: f64) -> Option<Vec<Mode>> {
    let whole = inertia(end)?.try_inverse()?;
    let mode = |k: usize| {
        let n = Vector6::from_column_slice(momenta.column(k).as_slice());
        let g = n.dot(&(whole * n));
        let left = 1.0 / (1.0 + g);
        let frequency_hz = hz * left.sqrt();
        // d = 2 zeta omega_free (1 - mu) of a unit modal mass.
        let damping_ratio = (damping * left.sqrt()).min(0.9);
        Mode { frequency_hz, damping_ratio, participation: n * left.sqrt() }
    };
    Some((0..momenta.ncols()).map(mode).collect())
}

/// Inertia of the whole robot about its base's origin, linear before angular, at the pose and the values where a fit has ended.
fn inertia(end: &Ended<'_>) -> Option<Matrix6<f64>> {
    let model: &Model = end.model;
    let params = Params::from_values(model, end.values.to_vec());
    let mut state = State::zero(model);
    state.eta = model.rest_position(&params);
    let pose = end.records.first()?.record.q();
    state.q.iter_mut().zip(pose.row(0).iter()).for_each(|(q, x)| *q = *x);
    let mut h = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, &params, &state, &mut Work::new(model), &mut h);
    Some(h.fixed_view::<6, 6>(0, 0).into_owned())
}

/// Modes as a fit has found them, by frequency.
struct Found {
    /// Frequency (Hz) and damping ratio with the base held, with standard deviations.
    hz: Vec<(f64, f64)>,
    damping: Vec<(f64, f64)>,
    /// Momentum coefficients, and their covariance column below column.
    momenta: DMatrix<f64>,
    covariance: DMatrix<f64>,
}

impl Found {
    fn new(modes: usize, e: &Estimate) -> Option<Self> {
        let u: &Uncertainty = &e.uncertainty;
        let of = |name: String| -> Option<(usize, f64, f64)> {
            let at = u.unknowns.iter().position(|x| x.name == name)?;
            let p = e.parameters.iter().find(|p| p.name == name)?;
            Some((at, p.value, p.std?))
        };
        let mut all = Vec::new();
        for j in 0..modes {
            let ((_, k, of_k), (_, d, of_d)) = (of(format!("{NAME}.k[{j}]"))?, of(format!("{NAME}.d[{j}]"))?);
            let (omega, relative) = (k.sqrt(), of_k / (2.0 * k));
            let ratio = d / (2.0 * omega);
            let hz = (omega / TAU, omega / TAU * relative);
            let damping = (ratio, (of_d / (2.0 * omega)).hypot(ratio * relative));
            let part: Option<Vec<_>> =
                DIRECTIONS.iter().map(|i| of(format!("{NAME}.part[{j}].{i}")).map(|p| (p.0, p.1))).collect();
            all.push((hz, damping, part?));
        }
        all.sort_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let parts: Vec<(usize, f64)> = all.iter().flat_map(|m| m.2.iter().copied()).collect();
        let momenta = DMatrix::from_iterator(DIRECTIONS.len(), modes, parts.iter().map(|p| p.1));
        let n = parts.len();
        let covariance = DMatrix::from_fn(n, n, |a, b| u.covariance[(parts[a].0, parts[b].0)]);
        Some(Self {
            hz: all.iter().map(|m| m.0).collect(),
            damping: all.iter().map(|m| m.1).collect(),
            momenta,
            covariance,
        })
    }
    /// Sum of squares of momentum coefficients over forces (0) or moments (3): effective mass and inertia, with standard deviation.
    fn effective(&self, from: usize) -> (f64, f64) {
        let x = self.momenta.as_slice();
        let of = |i: usize| if (from..from + 3).contains(&(i % 6)) { x[i] } else { 0.0 };
        let gradient = DVector::from_fn(x.len(), |i, _| 2.0 * of(i));
        let value = (0..x.len()).map(|i| of(i).powi(2)).sum();
        (value, (gradient.transpose() * &self.covariance * &gradient)[0].max(0.0).sqrt())
    }
    fn sizes(&self) -> Vec<ErrorSize> {
        let of = |name: String, unit: &str, (value, std): (f64, f64)| ErrorSize { name, unit: unit.into(), value, std };
        let mut out = Vec::new();
        for (j, (hz, damping)) in self.hz.iter().zip(&self.damping).enumerate() {
            let behind = if j == 0 { String::new() } else { format!("[{j}]") };
            out.push(of(format!("frequency{behind}"), "Hz", *hz));
            out.push(of(format!("damping_ratio{behind}"), "1", *damping));
        }
        out.push(of("effective_mass".into(), "kg", self.effective(0)));
        out.push(of("effective_inertia".into(), "kg m^2", self.effective(3)));
        out
    }
    /// The point mass that moves, if it is one.
    fn point(&self, drop: f64) -> Option<PointMass> {
        let found = PointMass::nearest(&self.momenta, &self.covariance)?;
        let known = found.mass.0 > KNOWN * found.mass.1;
        let fits = found.misfit < POINT.0.max(POINT.1 * drop);
        (known && fits && found.is_fuel(KNOWN)).then_some(found)
    }
    fn words(&self, point: Option<&PointMass>) -> String {
        let with = |(value, std): (f64, f64)| format!("{} +- {}", num(value), num(std));
        let percent = |(value, std): (f64, f64)| format!("{} +- {} %", num(100.0 * value), num(100.0 * std));
        let all = |of: &[(f64, f64)], one: &dyn Fn((f64, f64)) -> String| {
            of.iter().map(|x| one(*x)).collect::<Vec<_>>().join(" and ")
        };
        let (hz, damping) = (all(&self.hz, &with), all(&self.damping, &percent));
        let seen = format!("{hz} Hz, damping {damping}, the base held");
        if let Some(p) = point {
            let axis = p.axis().unwrap_or_else(Vector3::zeros);
            let [x, y, z] = p.position.map(with);
            return format!(
                "a mass of {} kg that the mission lacks, free to move like fuel ({seen}) across ({:.2}, {:.2}, {:.2}), at rest at ({x}, {y}, \
                 {z}) m from the base's origin",
                with(p.mass),
                axis.x,
                axis.y,
                axis.z,
            );
        }
        let kind = match self.hz.len() {
            1 => "along one direction, as an appendage on a hinge or a spring",
            _ => "along two directions, as fuel",
        };
        format!(
            "a mode at {seen}, that the mission lacks ({kind}; effective mass {} kg, inertia about the base's origin {} kg m^2)",
            with(self.effective(0)),
            with(self.effective(3)),
        )
    }
    /// A pendulum that moves as the mass does: its first angle turns about the mount's x and moves the mass along y, the second about y along x.
    fn pendulum(&self, base: &str, p: &PointMass) -> Option<String> {
        let column = |k: usize| Vector3::from_column_slice(p.directions.column(k).as_slice());
        let y = column(0).try_normalize(0.0)?;
        let z = column(1).cross(&y).try_normalize(0.0)?;
        let x = y.cross(&z);
        let at = Vector3::from(p.position.map(|p| p.0)) + ARM * z;
        let rot = Matrix3::from_columns(&[x, y, z]);
        let rpy =
            [rot[(2, 1)].atan2(rot[(2, 2)]), (-rot[(2, 0)]).clamp(-1.0, 1.0).asin(), rot[(1, 0)].atan2(rot[(0, 0)])];
        let mass = p.mass.0;
        let spring = |j: usize| mass * ARM * ARM * (TAU * self.hz[j].0).powi(2);
        let damper = |j: usize| mass * ARM * ARM * 2.0 * self.damping[j].0 * TAU * self.hz[j].0;
        Some(format!(
            "[[appendage]]\nkind = \"slosh_pendulum\"\nname = \"{NAME}\"\nhost = \"{base}\"\nmount = {{ xyz_m = {}, rpy_rad = {} }}\nmass_kg = {}\n\
             length_m = {ARM:?}\nstiffness_nm_per_rad = {}\ndamping_nms_per_rad = {}\n",
            list(at.iter()),
            list(rpy.iter()),
            digits(mass),
            list([spring(0), spring(1)].iter()),
            list([damper(0), damper(1)].iter()),
        ))
    }
    /// The modes themselves, on a body that holds more than they move.
    fn modal(&self, base: &str) -> String {
        let more = 1.0 + self.hz.len() as f64;
        let (mass, moment) = (more * self.effective(0).0, more * self.effective(3).0);
        let mut out = format!(
            "# Of its mass and inertia only what its modes move is told by the record: take them off the base, or put in what is known.\n\
             [[appendage]]\nkind = \"modal\"\nname = \"{NAME}\"\nhost = \"{base}\"\nmass_kg = {}\ncom_m = [0.0, 0.0, 0.0]\ninertia_com_kgm2 = {}\n\
             modes = [\n",
            digits(mass.max(1e-9)),
            list([moment, 0.0, 0.0, moment, 0.0, moment].iter()),
        );
        for (j, (hz, damping)) in self.hz.iter().zip(&self.damping).enumerate() {
            let part = list(self.momenta.column(j).iter());
            let (hz, damping) = (digits(hz.0), digits(damping.0));
            out += &format!("    {{ freq_hz = {hz}, damping_ratio = {damping}, participation = {part} }},\n");
        }
        out + "]\n"
    }
}

/// A number of TOML with six digits.
fn digits(x: f64) -> String {
    format!("{x:.5e}").parse::<f64>().map_or_else(|_| "0.0".to_owned(), |x| format!("{x:?}"))
}

fn list<'x>(all: impl Iterator<Item = &'x f64>) -> String {
    format!("[{}]", all.map(|x| digits(*x)).collect::<Vec<_>>().join(", "))
}
