//! The pendulum: declaration, energies, and the bias by hand for speed.

use crate::KIND;
use crate::point;
use crate::slot::Slot;
use crate::swing::{SWING_LIMITS, Swing};
use ff_model::CoordDecl;
use ff_model::keys::{check_damping, check_positive, check_stiffness};
use ff_model::port::{TreeTwin, TwinBody};
use ff_model::scalar::PlainScalar;
use ff_model::{
    Appendage, Decl, Inertia, ParamDecl, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Problems, Scalar,
    Xform,
};
use nalgebra::Vector3;

const MASS: usize = 0;
const LENGTH: usize = 1;
const K: usize = 2;
const D: usize = 4;

/// A point mass on a massless universal joint with springs and dampers (see the crate docs).
///
/// Parameters, all positive: `mass` (kg), `length` (m), `k[0]`, `k[1]` (N m/rad), `d[0]`, `d[1]` (N m s/rad).
/// Coordinates `swing[0]`, `swing[1]` (rad), within [`SWING_LIMITS`].
///
/// Motion of the base alone does not determine all of them: in weightlessness and at small angles
/// `(l, k, d) -> (s l, s^2 k, s^2 d)` with the fulcrum moved so that the mass rests where it did leaves the wrench
/// on the host as it was. See [`crate::formulas::SpringMass`].
///
/// ```
/// use slosh_pendulum::SloshPendulum;
///
/// let fuel = SloshPendulum::new(100.0, 0.8, [20.0, 23.0], [5.0, 4.0])?;
/// assert_eq!(fuel.nominal(), [100.0, 0.8, 20.0, 23.0, 5.0, 4.0]);
/// let refused = SloshPendulum::new(100.0, -0.8, [20.0, 23.0], [5.0, -4.0]).unwrap_err();
/// assert!(refused.has("Config::Param") && refused.has("Config::NotPassive")); // both at once
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct SloshPendulum {
    decl: Decl,
}

impl SloshPendulum {
    /// A pendulum of mass `mass` (kg) and arm `length` (m), with springs `k` (N m/rad) and dampers `d`
    /// (N m s/rad) on the first and second swing angle. Allocates.
    ///
    /// # Errors
    /// Every problem, all of `Area::Config`: `Config::NotFinite`, `Config::Param` (mass or length not above
    /// zero), `Config::NotPassive` (negative stiffness or damping).
    pub fn new(mass: f64, length: f64, k: [f64; 2], d: [f64; 2]) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        check(mass, length, k, d, &mut problems);
        if problems.has_errors() {
            return Err(problems);
        }
        let mut params = vec![ParamDecl::positive("mass", "kg", mass), ParamDecl::positive("length", "m", length)];
        for i in 0..2 {
            params.push(ParamDecl::positive(format!("k[{i}]"), "N m/rad", k[i]));
        }
        for i in 0..2 {
            params.push(ParamDecl::positive(format!("d[{i}]"), "N m s/rad", d[i]));
        }
        let coords = (0..2).map(|i| CoordDecl::new(format!("swing[{i}]"), "rad", (-SWING_LIMITS[i], SWING_LIMITS[i])));
        Ok(Self { decl: Decl::new(KIND, coords, params) })
    }

    /// Nominal values `[mass, length, k_0, k_1, d_0, d_1]`. Does not allocate.
    pub fn nominal(&self) -> [f64; 6] {
        std::array::from_fn(|i| self.decl.params[i].nominal)
    }

    /// The pendulum as two ordinary tree links with external springs, at nominal parameters (see [`TwinBody`]).
    /// Allocates.
    pub fn twin_bodies(&self) -> Vec<TwinBody> {
        bodies(&self.nominal())
    }
}

impl TreeTwin for SloshPendulum {
    fn tree_bodies(&self, p: &[f64]) -> Option<Vec<TwinBody>> {
        Some(bodies(p))
    }
}

/// The tree links at parameters `[mass, length, k_0, k_1, d_0, d_1]`. Allocates.
fn bodies(p: &[f64]) -> Vec<TwinBody> {
    let link = |parent, axis, inertia, i: usize| TwinBody {
        parent,
        axis,
        placement: Xform::identity(),
        inertia,
        stiffness: p[K + i],
        damping: p[D + i],
        rest: 0.0,
    };
    vec![
        link(None, Vector3::x(), Inertia::zero(), 0),
        link(Some(0), Vector3::y(), Inertia::point(p[MASS], &Vector3::new(0.0, 0.0, -p[LENGTH])), 1),
    ]
}

/// Adds everything that is wrong with the numbers to `problems`. Allocates on trouble only.
pub(crate) fn check(mass: f64, length: f64, k: [f64; 2], d: [f64; 2], problems: &mut Problems) {
    for (key, unit, x) in [("mass_kg", "kg", mass), ("length_m", "m", length)] {
        let hint = "leave the slosh table out where there is no sloshing fuel";
        problems.0.extend(check_positive(key, x, unit, hint));
    }
    for i in 0..2 {
        let springs = [
            check_stiffness(&format!("stiffness_nm_per_rad[{i}]"), k[i]),
            check_damping(&format!("damping_nms_per_rad[{i}]"), d[i]),
        ];
        springs.into_iter().flatten().for_each(|p| problems.push(p));
    }
}

/// Where the numbers of the only mass are.
const SLOT: Slot = Slot { eta0: 0, p0: MASS, k0: K };

/// The mass in the mount frame.
#[inline(always)]
fn swing<T: Scalar>(p: &[T], eta: &[T]) -> Swing<T> {
    Swing::new(None, p[LENGTH], eta)
}

/// The slices of a port at their lengths, which the compiler then knows.
#[inline(always)]
fn sized<'a, T: Scalar>(p: &'a [T], s: &PortState<'a, T>) -> (&'a [T], PortState<'a, T>) {
    (&p[..6], PortState { host: s.host, eta: &s.eta[..2], nu: &s.nu[..2] })
}

ff_model::shared!(SloshPendulum);

impl Appendage for SloshPendulum {
    fn decl(&self) -> &Decl {
        &self.decl
    }

    /// `M = m J^T J` with `J = [1, -[r]x, dr/da, dr/db]` the 3 x 8 Jacobian of the mass.
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let m = &mut m.expect(2);
        let host = point::inertia(&swing(p, eta), &SLOT, p, m);
        m.set_host(&host);
    }

    /// `U = (k_0 a^2 + k_1 b^2) / 2` (J).
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (p[K] * eta[0] * eta[0] + p[K + 1] * eta[1] * eta[1]).scale(0.5)
    }

    /// `R = (d_0 a'^2 + d_1 b'^2) / 2` (W).
    #[inline(always)]
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[D] * nu[0] * nu[0] + p[D + 1] * nu[1] * nu[1]).scale(0.5)
    }
}

impl PortDynamics for SloshPendulum {
    const WRITES_ALL: bool = true;

    /// `R` is quadratic.
    #[inline(always)]
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.rayleigh(p, nu).scale(2.0)
    }

    /// Newton's law for the mass at zero `A` and `nu'`:
    /// `f = m (w x (v + w x r + 2 r') + r_aa a'^2 + 2 r_ab a' b' + r_bb b'^2)`; the wrench is `[f; r x f]`, the own rows
    /// `dr/da . f + k_0 a + d_0 a'` and likewise for `b`.
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        let ((p, s), h) = (sized(p, s), &mut h[..8]);
        let wrench = point::residual(&swing(p, s.eta), &SLOT, p, &s, None, h);
        point::press(&wrench, h);
    }
    /// Both from one evaluation of the angles.
    #[inline(always)]
    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        let ((p, s), h) = (sized(p, s), &mut h[..8]);
        let x = swing(p, s.eta);
        let m = &mut m.expect(2);
        let host = point::inertia(&x, &SLOT, p, m);
        m.set_host(&host);
        let wrench = point::residual(&x, &SLOT, p, &s, None, h);
        point::press(&wrench, h);
    }
    /// Newton's law for the mass.
    #[inline(always)]
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        _: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        let ((p, s), r) = (sized(p, s), &mut r[..8]);
        let wrench = point::residual(&swing(p, s.eta), &SLOT, p, &s, Some(acc), r);
        point::press(&wrench, r);
    }
    /// Derivatives of the acceleration of the mass, column by column.
    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        let ((p, s), j) = (sized(p, s), &mut j[..56]);
        let spin = point::jacobian(&swing(p, s.eta), &SLOT, p, &s, acc, j);
        point::press_each(&spin, 8, j);
    }
    /// Mass and length act through the acceleration of the mass, springs and dampers on their own row.
    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        let ((p, s), y) = (sized(p, s), &mut y[..48]);
        y.fill(T::zero());
        point::regressor(&swing(p, s.eta), &SLOT, p, &s, acc, y);
    }
    fn twin(&self) -> Option<&dyn TreeTwin> {
        Some(self)
    }
}
