//! Fuel slosh as a mass on springs and dampers.

use crate::check;
use crate::check::Axes;
use crate::particle::{Particle, Path, Values};
use crate::point::{press, press_each};
use ff_model::scalar::PlainScalar;
use ff_model::{
    Appendage, Decl, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Problems, Scalar, SharedAppendage,
    keys,
};
use nalgebra::Vector3;

/// The `kind` of mission files for this appendage.
pub const SPRING_MASS_KIND: &str = "slosh_spring_mass";

/// A point mass on springs and dampers along two (x, y) or three (x, y, z) axes of the mount, around a rest position.
///
/// ```text
/// r = rest + sum eta_i e_i      U = sum k_i eta_i^2 / 2  (J)      R = sum d_i nu_i^2 / 2  (W)
/// ```
///
/// Parameters, in order: `mass` (kg), `rest_x`, `rest_y`, `rest_z` (m, mount frame), `k[i]` (N/m), `d[i]` (N s/m).
/// Coordinates `shift[i]` (m). With `k / l^2`, `d / l^2` it is the small-angle equal of a pendulum of arm `l`
/// ([`crate::formulas::SpringMass`]), and mass, rest position, stiffness and damping are exactly what motion of the base
/// can tell of one: unlike those of a pendulum all its parameters are identifiable.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use slosh_pendulum::SloshSpringMass;
///
/// // Springs along two axes of the tank.
/// let fuel = SloshSpringMass::new(70.0, Vector3::new(0.1, -0.2, -0.7), &[31.0, 27.0], &[3.1, 2.4], 0.4)?;
/// let coords = &ff_model::Appendage::decl(&fuel).coords;
/// assert_eq!((coords.len(), coords[1].unit), (2, "m"));
/// assert_eq!(fuel.nominal()[4..6], [31.0, 27.0]);
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct SloshSpringMass {
    decl: Decl,
    mass: Particle,
}

impl SloshSpringMass {
    /// A mass (kg) resting at `rest` (m, mount frame) on springs `k` (N/m) and dampers `d` (N s/m), one for each of two
    /// or three axes, that stays within `travel` (m) of its rest position. Allocates.
    ///
    /// # Errors
    /// Every problem, all of [`ff_model::Area::Config`]: `Config::NotFinite`, `Config::Param` (mass or travel not above
    /// zero), `Config::NotPassive` (negative stiffness or damping), `Config::WrongLength` (neither two nor three axes, or
    /// not as many dampers as springs).
    pub fn new(mass: f64, rest: Vector3<f64>, k: &[f64], d: &[f64], travel: f64) -> Result<Self, Problems> {
        let values = Values { mass, length: 0.0, rest, k: k.to_vec(), d: d.to_vec(), travel };
        let mut problems = Problems::default();
        check::values(&values, Axes::Shift, "", &mut problems);
        if problems.has_errors() {
            return Err(problems);
        }
        let (mut coords, mut params) = (Vec::new(), Vec::new());
        let mass = Particle::declare(Path::Springs(k.len()), &values, "", &mut coords, &mut params);
        Ok(Self { decl: Decl::new(SPRING_MASS_KIND, coords, params), mass })
    }
    /// Nominal values of all parameters, in the order of the declaration. Allocates.
    pub fn nominal(&self) -> Vec<f64> {
        self.decl.params.iter().map(|p| p.nominal).collect()
    }
}

/// Builds a [`SloshSpringMass`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// Keys: `mass_kg`, `stiffness_n_per_m` and `damping_ns_per_m` (two or three numbers each, axes x, y, z of the mount),
/// `travel_m` (greatest displacement for which the model is meant), and optionally `rest_m = [x, y, z]` (the mount origin
/// unless given).
///
/// ```toml
/// [[appendage]]
/// kind = "slosh_spring_mass"
/// name = "tank"
/// host = "base"
/// mount = { xyz_m = [0.9, 0.0, -0.2] }
/// mass_kg = 100.0
/// stiffness_n_per_m = [31.25, 31.25]
/// damping_ns_per_m = [7.8, 7.8]
/// travel_m = 0.4
/// ```
///
/// # Errors
/// Every problem of the table: those of [`ff_model::keys::read`] and of [`SloshSpringMass::new`].
pub fn from_toml(table: &toml::Table) -> Result<SharedAppendage, Problems> {
    let v = keys::read(table, |t| check::read_springs(t, "rest_m"))?;
    Ok(SloshSpringMass::new(v.mass, v.rest, &v.k, &v.d, v.travel)?.into())
}

ff_model::shared!(SloshSpringMass);

impl Appendage for SloshSpringMass {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let host = self.mass.inertia(p, eta, m);
        m.set_host(&host);
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        self.mass.potential(p, eta)
    }
    #[inline(always)]
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.mass.rayleigh(p, nu)
    }
}

impl PortDynamics for SloshSpringMass {
    const WRITES_ALL: bool = true;
    /// `R` is quadratic.
    #[inline(always)]
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.rayleigh(p, nu).scale(2.0)
    }
    /// Newton's law for the mass, `A` and `nu'` zero, in its acceleration relative to the mount.
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        let wrench = self.mass.residual(p, s, None, h);
        press(&wrench, h);
    }
    #[inline(always)]
    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        let (host, wrench) = self.mass.terms(p, s, m, h);
        m.set_host(&host);
        press(&wrench, h);
    }
    #[inline(always)]
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        _: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        let wrench = self.mass.residual(p, s, Some(acc), r);
        press(&wrench, r);
    }
    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        let spin = self.mass.jacobian(p, s, acc, j);
        press_each(&spin, 6 + s.eta.len(), j);
    }
    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        y.fill(T::zero());
        self.mass.regressor(p, s, acc, y);
    }
}
