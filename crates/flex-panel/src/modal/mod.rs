//! A flexible structure by its modes: the hybrid-coordinate appendage.
//!
//! Rigid mass properties and the first few modes with the mount held are what a finite-element model of a solar array
//! hands over. With host twist `V` at the mount, modal coordinates `eta`, rates `nu`:
//!
//! ```text
//! T = V^T M V / 2 + V^T P nu + nu^T nu / 2        U = sum w_j^2 eta_j^2 / 2        R = sum zeta_j w_j nu_j^2
//! ```
//!
//! `M` is the inertia of the undeformed structure about the mount, `P` the 6 x n participation matrix,
//! `P_j = int [phi_j; r x phi_j] dm`, linear first, mount axes (P. Likins, *Dynamics and Control of Flexible Space
//! Vehicles*, JPL TR 32-1329, 1970: hybrid coordinates; the coupling of appendage modes to the rigid body that carries
//! them).
//!
//! **Normalisation.** Modes are scaled to a modal mass of 1 kg, so that `eta` is in metres, `P` in kg (translation) and
//! kg m (rotation), stiffness `k = w^2` in N/m and damping `d = 2 zeta w` in N s/m, all for that 1 kg. The effective
//! mass of a mode in direction `i` is `P_ij^2 / 1 kg`.
//!
//! **Linear.** The energies are exact to second order in the deflection at any host motion that is small beside the
//! modal frequencies: inertia is that of the undeformed structure, and stiffening by rotation is left out. Momentum and
//! energy of the model are conserved exactly all the same, because all forces follow from one kinetic energy.
mod config;
mod linear;
mod nastran;
mod residual;
mod table;

pub use config::from_toml;
pub use linear::{Linearised, linearise};
pub use nastran::read_f06;
pub use residual::{RESIDUAL_SLACK, Residual};
pub use table::{CSV_COLUMNS, read_csv};

use ff_model::CoordDecl;
use ff_model::diagnostics::Limit;
use ff_model::keys::check_damping;
use ff_model::port::MAX_COORDS;
use ff_model::scalar::PlainScalar;
use ff_model::spatial::vec3::{Moving, PackedInertia, V3};
use ff_model::{
    Appendage, Area, Decl, Inertia, ParamDecl, ParamGroup, PortAccel, PortDynamics, PortMatrix, PortState, PortVector,
    Problem, Problems, Scalar,
};
use nalgebra::{DMatrix, Vector6};
use std::f64::consts::TAU;

/// The `kind` of mission files for this appendage.
pub const MODAL_KIND: &str = "modal";

/// Highest frequency of a mode (Hz): no structure has one above, and its square must be a number.
pub const MAX_FREQUENCY_HZ: f64 = 1e6;

/// Most modes of one appendage: one coordinate each.
pub const MAX_MODES: usize = MAX_COORDS;

/// Names of the six directions of a participation factor, linear first.
pub const DIRECTIONS: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// One mode with the mount held, scaled to a modal mass of 1 kg.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency (Hz).
    pub frequency_hz: f64,
    /// Damping ratio (no unit).
    pub damping_ratio: f64,
    /// Participation factors: three of translation (kg), three of rotation about the mount (kg m), mount axes.
    pub participation: Vector6<f64>,
}

impl Mode {
    /// Stiffness `w^2` at a modal mass of 1 kg (N/m).
    pub fn stiffness(&self) -> f64 {
        (TAU * self.frequency_hz).powi(2)
    }
    /// Damping `2 zeta w` at a modal mass of 1 kg (N s/m).
    pub fn damping(&self) -> f64 {
        2.0 * self.damping_ratio * TAU * self.frequency_hz
    }
}

/// The hybrid-coordinate appendage (see the module docs).
///
/// Parameters, in order: ten inertial of the undeformed structure about the mount (`rigid.mass` ... `rigid.i_zz`), then
/// the modal masses `m[j]` (kg), which are 1 by normalisation, then `k[j]`
/// (N/m), then `d[j]` (N s/m), then per mode the six of `part[j].x` ... `part[j].rz` (kg, kg m). Coordinates:
/// `mode[j]` (m at a modal mass of 1 kg), unbounded.
///
/// The modal masses are parameters only so that the kinetic energy is linear in the parameters with nothing left over,
/// which is what [`ParamGroup::Inertial`] promises to those who differentiate it. Leave them out of an estimate: their
/// value is the scale of `eta`, which no data can tell.
///
/// The kinetic energy is positive for all motions exactly when the residual mass `M - P P^T` is positive
/// semidefinite ([`Residual`]): a condition that ties inertia and participation together, which no bounds of single
/// parameters can express. It is checked at the nominal values; after a fit, [`ModalAppendage::residual`] tells.
#[derive(Clone, Debug)]
pub struct ModalAppendage {
    decl: Decl,
    modes: usize,
}

impl ModalAppendage {
    /// An appendage from its undeformed inertia about the mount and its modes. Allocates.
    ///
    /// # Errors
    /// Every problem, all of [`Area::Config`]: `Config::Param` (no or too many modes, a frequency that is not above
    /// zero), `Config::NotPassive` (negative damping), `Config::Inertia` (ten numbers that no body has),
    /// `Config::ResidualMass` (the modes move more mass than there is), `Config::NotFinite`.
    pub fn new(rigid: Inertia<f64>, modes: &[Mode]) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        if check_rigid(&rigid, &mut problems) & check_modes(modes, &mut problems) {
            problems.0.extend(check_residual(&rigid, modes));
        }
        if problems.has_errors() {
            return Err(problems);
        }
        let n = modes.len();
        let mut params = ParamDecl::inertial("rigid", &rigid);
        params.extend(
            (0..n).map(|j| ParamDecl { bounds: (0.5, 2.0), ..ParamDecl::positive(format!("m[{j}]"), "kg", 1.0) }),
        );
        params.extend((0..n).map(|j| ParamDecl::positive(format!("k[{j}]"), "N/m", modes[j].stiffness())));
        params.extend((0..n).map(|j| ParamDecl::positive(format!("d[{j}]"), "N s/m", modes[j].damping())));
        for (j, mode) in modes.iter().enumerate() {
            for (i, name) in DIRECTIONS.iter().enumerate() {
                params.push(ParamDecl {
                    name: format!("part[{j}].{name}"),
                    unit: if i < 3 { "kg" } else { "kg m" },
                    nominal: mode.participation[i],
                    bounds: (f64::NEG_INFINITY, f64::INFINITY),
                    group: ParamGroup::Free,
                });
            }
        }
        let range = (f64::NEG_INFINITY, f64::INFINITY);
        let coords = (0..n).map(|j| CoordDecl::new(format!("mode[{j}]"), "m", range));
        // The inertia is that of the undeformed structure, whatever the modes move: see the module docs.
        Ok(Self { decl: Decl::new(MODAL_KIND, coords, params).not_galilean(), modes: n })
    }

    /// Number of modes `n`, which is also the number of coordinates.
    pub fn count(&self) -> usize {
        self.modes
    }
    /// Index of the modal mass `m[j]` in the parameter slice.
    pub fn modal_mass_index(&self, j: usize) -> usize {
        10 + j
    }
    /// Index of `k[j]` in the parameter slice.
    pub fn stiffness_index(&self, j: usize) -> usize {
        10 + self.modes + j
    }
    /// Index of `d[j]` in the parameter slice.
    pub fn damping_index(&self, j: usize) -> usize {
        10 + 2 * self.modes + j
    }
    /// Index of `part[j].x` in the parameter slice; the other five follow.
    pub fn participation_index(&self, j: usize) -> usize {
        10 + 3 * self.modes + 6 * j
    }
    /// Nominal values of all parameters, in the order of the declaration. Allocates.
    pub fn nominal(&self) -> Vec<f64> {
        self.decl.params.iter().map(|p| p.nominal).collect()
    }
    /// Residual mass `M - P P^T` at parameters `p`. Allocates.
    ///
    /// # Panics
    /// If `p` has the wrong length.
    pub fn residual(&self, p: &[f64]) -> Residual {
        assert_eq!(p.len(), self.decl.params.len(), "parameter vector length");
        let first = self.participation_index(0);
        Residual::new(&Inertia::from_params(p), &DMatrix::from_column_slice(6, self.modes, &p[first..]))
    }
}

/// Adds everything that is wrong with the rigid body to `problems`; true when it is sound. Allocates on trouble only.
pub(crate) fn check_rigid(rigid: &Inertia<f64>, problems: &mut Problems) -> bool {
    let Err(e) = rigid.check() else { return true };
    problems.push(crate::segment::inertia_problem(&e, str::to_owned));
    false
}

/// Adds everything that is wrong with the modes alone to `problems`; true when they are sound. Allocates.
pub(crate) fn check_modes(modes: &[Mode], problems: &mut Problems) -> bool {
    let mut own = Problems::default();
    let bad =
        |code, key: String, message: String, hint: &str| Problem::error(Area::Config, code, message).on(key).hint(hint);
    if modes.is_empty() || modes.len() > MAX_MODES {
        let why = format!("{} modes, outside the limits 1 to {MAX_MODES}", modes.len());
        let p = bad("Config::Param", "modes".into(), why, "keep those with the greatest effective mass (modes_used)");
        own.push(p.violating(modes.len() as f64, Limit::Within(1.0, MAX_MODES as f64), "modes"));
    }
    for (j, m) in modes.iter().enumerate() {
        let at = |key: &str| format!("modes[{j}].{key}");
        if !m.frequency_hz.is_finite() {
            let why = format!("{} Hz is not a finite number", m.frequency_hz);
            own.push(bad("Config::NotFinite", at("freq_hz"), why, "give a number above 0"));
        } else if m.frequency_hz <= 0.0 {
            let why = format!("{} Hz is not above the limit 0 Hz", m.frequency_hz);
            let hint = "modes of the structure with its mount held have no rigid-body motion; leave those out";
            let p = bad("Config::Param", at("freq_hz"), why, hint);
            own.push(p.violating(m.frequency_hz, Limit::Above(0.0), "Hz"));
        } else if m.frequency_hz > MAX_FREQUENCY_HZ {
            let why = format!("{} Hz is above the limit {MAX_FREQUENCY_HZ:e} Hz", m.frequency_hz);
            let hint = "modes far above those of interest belong to the residual mass; leave them out";
            let p = bad("Config::Param", at("freq_hz"), why, hint);
            own.push(p.violating(m.frequency_hz, Limit::AtMost(MAX_FREQUENCY_HZ), "Hz"));
        }
        if m.participation.iter().any(|x| !x.is_finite()) {
            let why = format!("{:?} holds a number that is not finite", m.participation.as_slice());
            own.push(bad("Config::NotFinite", at("participation"), why, "give six finite numbers"));
        }
    }
    for (j, m) in modes.iter().enumerate() {
        own.0.extend(check_damping(&format!("modes[{j}].damping_ratio"), m.damping_ratio));
    }
    let sound = !own.has_errors();
    problems.extend(own);
    sound
}

/// The residual mass of sound parts, if it is negative. Allocates.
fn check_residual(rigid: &Inertia<f64>, modes: &[Mode]) -> Option<Problem> {
    Residual::new(rigid, &DMatrix::from_fn(6, modes.len(), |i, j| modes[j].participation[i])).problem()
}

ff_model::shared!(ModalAppendage);

impl Appendage for ModalAppendage {
    fn decl(&self) -> &Decl {
        &self.decl
    }

    /// `[[M, P], [P^T, m]]`, independent of `eta`.
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], _eta: &[T], m: &mut PortMatrix<'_, T>) {
        m.set_host(&PackedInertia::from_params(p));
        for j in 0..self.modes {
            let (f, g) = self.part(p, j);
            m.set_coupling(j, &f, &g);
            m.set_sym(6 + j, 6 + j, p[self.modal_mass_index(j)]);
        }
    }

    /// `U = sum k eta^2 / 2` (J).
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let mut u = T::zero();
        for j in 0..self.modes {
            u += p[self.stiffness_index(j)] * eta[j] * eta[j];
        }
        u.scale(0.5)
    }

    /// `R = sum d nu^2 / 2` (W).
    #[inline(always)]
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let mut r = T::zero();
        for j in 0..self.modes {
            r += p[self.damping_index(j)] * nu[j] * nu[j];
        }
        r.scale(0.5)
    }
}

impl PortDynamics for ModalAppendage {
    /// `R` is quadratic.
    #[inline(always)]
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.rayleigh(p, nu).scale(2.0)
    }

    /// `h_b = V x* (M V + P nu)`, `h_e = k eta + d nu`: `M` and `P` are constant. `O(n)`.
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        let (mut f, mut n) = self.rigid(p, &s.moving(None), &self.carried(p, s.nu), s);
        self.pull(p, s, None, &mut f, &mut n, h);
    }

    /// `w = M A + P nu' + V x* (M V + P nu)`, own rows `P^T A + m nu' + k eta + d nu`. `O(n)`.
    #[inline(always)]
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        _: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        let (mut f, mut n) = self.rigid(p, &s.moving(Some(acc)), &self.carried(p, s.nu), s);
        self.pull(p, s, Some(acc), &mut f, &mut n, r);
    }

    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, _: &PortAccel<'_, T>, j: &mut [T]) {
        let (n, o) = (self.modes, T::zero());
        let dim = 6 + n;
        let j = &mut j[..(3 + 2 * n) * dim];
        j.fill(o);
        let (v, w) = (V3::from(&s.host.lin), V3::from(&s.host.ang));
        let (f, g) = self.carried(p, s.nu);
        let about = |k: usize, x: &V3<T>| match k {
            0 => V3::new(o, -x.z, x.y),
            1 => V3::new(x.z, o, -x.x),
            _ => V3::new(-x.y, x.x, o),
        };
        for (k, (sf, sn)) in PackedInertia::from_params(p).wrench_by_spin(&w, &v).into_iter().enumerate() {
            (sf + about(k, &f)).write_to(&mut j[k * dim..]);
            (sn + about(k, &g)).write_to(&mut j[k * dim + 3..]);
        }
        for i in 0..n {
            j[(3 + i) * dim + 6 + i] = p[self.stiffness_index(i)];
            let (f, g) = self.part(p, i);
            let column = &mut j[(3 + n + i) * dim..(4 + n + i) * dim];
            w.cross(&f).write_to(column);
            v.cross_add(&f, &w.cross(&g)).write_to(&mut column[3..]);
            column[6 + i] = p[self.damping_index(i)];
        }
    }

    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        let (dim, o) = (6 + self.modes, T::zero());
        let y = &mut y[..p.len() * dim];
        y.fill(o);
        for (k, (f, n)) in s.moving(Some(acc)).columns().into_iter().enumerate() {
            f.write_to(&mut y[k * dim..]);
            n.write_to(&mut y[k * dim + 3..]);
        }
        let (v, w) = (&s.host.lin, &s.host.ang);
        for j in 0..self.modes {
            let (nu, a) = (s.nu[j], acc.nu[j]);
            y[self.modal_mass_index(j) * dim + 6 + j] = a;
            y[self.stiffness_index(j) * dim + 6 + j] = s.eta[j];
            y[self.damping_index(j) * dim + 6 + j] = nu;
            // e_i nu' + V x* e_i nu on the host, A_i on the mode.
            let first = self.participation_index(j);
            let (wx, wy, wz) = (w.x * nu, w.y * nu, w.z * nu);
            let (vx, vy, vz) = (v.x * nu, v.y * nu, v.z * nu);
            let turned = [V3::new(a, wz, -wy), V3::new(-wz, a, wx), V3::new(wy, -wx, a)];
            let moved = [V3::new(o, vz, -vy), V3::new(-vz, o, vx), V3::new(vy, -vx, o)];
            for i in 0..3 {
                let column = &mut y[(first + i) * dim..(first + i + 1) * dim];
                turned[i].write_to(column);
                moved[i].write_to(&mut column[3..]);
                column[6 + j] = acc.host.lin[i];
                let column = &mut y[(first + 3 + i) * dim..(first + 4 + i) * dim];
                turned[i].write_to(&mut column[3..]);
                column[6 + j] = acc.host.ang[i];
            }
        }
    }
}

impl ModalAppendage {
    /// Participation of mode `j`: force and moment.
    #[inline(always)]
    fn part<T: Scalar>(&self, p: &[T], j: usize) -> (V3<T>, V3<T>) {
        let part = &p[self.participation_index(j)..][..6];
        (V3::from_slice(part), V3::from_slice(&part[3..]))
    }
    /// `P x`.
    #[inline(always)]
    fn carried<T: Scalar>(&self, p: &[T], x: &[T]) -> (V3<T>, V3<T>) {
        let mut sum = (V3::zero(), V3::zero());
        for j in 0..self.modes {
            let (f, n) = self.part(p, j);
            sum = (f.scale_add(x[j], &sum.0), n.scale_add(x[j], &sum.1));
        }
        sum
    }
    /// `M A + V x* (M V + q)`.
    #[inline(always)]
    fn rigid<T: Scalar>(&self, p: &[T], m: &Moving<T>, q: &(V3<T>, V3<T>), s: &PortState<'_, T>) -> (V3<T>, V3<T>) {
        let (f, n) = PackedInertia::from_params(p).wrench(&m.w, &m.al, &m.a, &m.field);
        // Not Galilean invariant, as the model is not: v enters by itself.
        (m.w.cross_add(&q.0, &f), V3::from(&s.host.lin).cross_add(&q.0, &m.w.cross_add(&q.1, &n)))
    }
    /// Adds `P nu'` to the wrench, and writes it and the own rows.
    #[inline(always)]
    fn pull<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: Option<&PortAccel<'_, T>>,
        f: &mut V3<T>,
        n: &mut V3<T>,
        r: &mut [T],
    ) {
        for j in 0..self.modes {
            let spring = p[self.damping_index(j)].mul_add(s.nu[j], p[self.stiffness_index(j)] * s.eta[j]);
            r[6 + j] = spring;
            if let Some(a) = acc {
                let (pf, pn) = self.part(p, j);
                let own = p[self.modal_mass_index(j)].mul_add(a.nu[j], spring);
                r[6 + j] = own + pf.dot(&V3::from(&a.host.lin)) + pn.dot(&V3::from(&a.host.ang));
                (*f, *n) = (pf.scale_add(a.nu[j], f), pn.scale_add(a.nu[j], n));
            }
        }
        f.write_to(r);
        n.write_to(&mut r[3..]);
    }
}
