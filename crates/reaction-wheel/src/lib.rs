//! A reaction wheel: an axisymmetric rotor on a host, spinning about a fixed axis, an appendage for ff-model.
//!
//! The rotor's centre of mass is the mount origin. With spin axis `a`, spin inertia `J` and transverse inertia `J_t` about
//! the centre of mass, angle `eta` and speed `nu` relative to the host (P. Hughes, *Spacecraft Attitude Dynamics*, Wiley
//! 1986, chapter 6: gyrostats; the equations follow here from one kinetic energy)
//!
//! ```text
//! T = m |v|^2 / 2 + J_t |w - a (a.w)|^2 / 2 + J (a.w + nu)^2 / 2
//! M_bb = [[m 1, 0], [0, J_t 1 + (J - J_t) a a^T]]     M_be = [0; J a]     M_ee = J     U = 0
//! R = d nu^2 / 2 + c (sqrt(nu^2 + s^2) - s)                  h_b = V x* (M_bb V + M_be nu)      h_e = dR/d nu
//! ```
//!
//! Since the rotor is a body of revolution nothing depends on its angle. It carries the momentum `J (a.w + nu)` along its
//! axis; `V x* M_be nu` is its gyroscopic torque. Friction is viscous (`d`) and dry (`c`, rounded below the speed `s`, so
//! that the torque is smooth: `c nu / sqrt(nu^2 + s^2)`).
//!
//! **Motor.** The torque of the motor acts between host and rotor: it is the force on the wheel's coordinate, one of the
//! passive rows of `tau` in `ff_dynamics::forward_dynamics`, and the host feels its reaction through the port. Speed is the
//! rate of the coordinate, set in the state where a simulation starts.
//!
//! **What data can tell.** `m`, the position and `J_t` belong to the host body as well: of these only sums with its ten
//! parameters can be estimated. `J` shows when the wheel's speed changes or when a spinning wheel is turned.

use ff_model::CoordDecl;
use ff_model::diagnostics::Limit;
use ff_model::keys;
use ff_model::keys::{check_damping, check_positive};
use ff_model::scalar::PlainScalar;
use ff_model::spatial::small::dot;
use ff_model::spatial::vec3::{PackedInertia, S3, V3};
use ff_model::{
    Appendage, Area, Decl, ParamDecl, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Problem, Problems,
    Scalar, SharedAppendage,
};
use nalgebra::Vector3;

/// The `kind` of mission files for this appendage.
pub const KIND: &str = "reaction_wheel";

/// Speed below which dry friction is rounded, unless another is given (rad/s).
pub const ROUNDING: f64 = 0.1;

const MASS: usize = 0;
const SPIN: usize = 1;
const TRANSVERSE: usize = 2;
const VISCOUS: usize = 3;
const DRY: usize = 4;

/// Adds this appendage to a registry under [`KIND`]. Allocates.
pub fn register(registry: &mut ff_model::Registry) {
    registry.register(KIND, from_toml).example(KIND, EXAMPLE);
}

/// A wheel on a skewed axis with dry friction, as its table stands in a mission file.
const EXAMPLE: &str = "
axis = [0.2, 1.0, 0.9]
mass_kg = 8.5
inertia_spin_kgm2 = 0.11
inertia_transverse_kgm2 = 0.06
viscous_nms_per_rad = 2e-3";

/// Nominal values of a wheel.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use reaction_wheel::{ROUNDING, ReactionWheel, Wheel};
///
/// let axis = Vector3::new(0.2, 1.0, 0.9);
/// let wheel = Wheel { axis, mass: 8.5, spin: 0.11, transverse: 0.06, viscous: 2e-3, dry: 4e-3, rounding: ROUNDING };
/// assert_eq!(ReactionWheel::new(&wheel)?.nominal(), [8.5, 0.11, 0.06, 2e-3, 4e-3]);
/// // A rotor flatter than a disc does not exist.
/// assert!(ReactionWheel::new(&Wheel { transverse: 0.05, ..wheel }).unwrap_err().has("Config::Inertia"));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheel {
    /// Spin axis in the mount frame; any length but zero.
    pub axis: Vector3<f64>,
    /// Mass of the rotor (kg).
    pub mass: f64,
    /// Inertia of the rotor about the spin axis (kg m^2).
    pub spin: f64,
    /// Inertia of the rotor about any axis through its centre of mass that is perpendicular to the spin axis (kg m^2); at
    /// least half of `spin`, as for a disc.
    pub transverse: f64,
    /// Viscous friction `d` (N m s/rad).
    pub viscous: f64,
    /// Dry friction `c` (N m).
    pub dry: f64,
    /// Speed `s` below which dry friction is rounded (rad/s).
    pub rounding: f64,
}

/// A reaction wheel (see the crate docs).
///
/// Parameters, all positive: `mass` (kg), `i_spin`, `i_transverse` (kg m^2), `d` (N m s/rad), `c` (N m). One coordinate,
/// `spin` (rad), unbounded.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use reaction_wheel::{ROUNDING, ReactionWheel, Wheel, axial_momentum};
///
/// let axis = Vector3::new(0.6, 0.0, 0.8);
/// let wheel = Wheel { axis, mass: 8.5, spin: 0.11, transverse: 0.06, viscous: 2e-3, dry: 4e-3, rounding: ROUNDING };
/// let wheel = ReactionWheel::new(&wheel)?;
/// // 0.11 kg m^2 at 300 rad/s on a host that turns by 0.5 rad/s about the axis.
/// let momentum = axial_momentum(&wheel, &wheel.nominal(), &Vector3::new(0.3, 0.7, 0.4), 300.0);
/// assert!((momentum - 0.11 * 300.5).abs() < 1e-12);
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct ReactionWheel {
    decl: Decl,
    axis: Vector3<f64>,
    rounding: f64,
}

impl ReactionWheel {
    /// A wheel from its nominal values. Allocates.
    ///
    /// # Errors
    /// Every problem, all of [`Area::Config`]: `Config::NotFinite`, `Config::Param` (mass, inertia or rounding speed not
    /// above zero), `Config::Inertia` (transverse inertia below half of that about the spin axis), `Config::NotPassive`
    /// (negative friction), `Config::Axis` (zero axis).
    pub fn new(w: &Wheel) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        check(w, &mut problems);
        if problems.has_errors() {
            return Err(problems);
        }
        let params = vec![
            ParamDecl::positive("mass", "kg", w.mass),
            ParamDecl::positive("i_spin", "kg m^2", w.spin),
            ParamDecl::positive("i_transverse", "kg m^2", w.transverse),
            ParamDecl::positive("d", "N m s/rad", w.viscous),
            ParamDecl::positive("c", "N m", w.dry),
        ];
        let coords = [CoordDecl::new("spin", "rad", (f64::NEG_INFINITY, f64::INFINITY))];
        let axis = (w.axis / w.axis.amax()).normalize();
        Ok(Self { decl: Decl::new(KIND, coords, params), axis, rounding: w.rounding })
    }
    /// Unit spin axis in the mount frame.
    pub fn axis(&self) -> &Vector3<f64> {
        &self.axis
    }
    /// Nominal values `[mass, i_spin, i_transverse, d, c]`. Does not allocate.
    pub fn nominal(&self) -> [f64; 5] {
        std::array::from_fn(|i| self.decl.params[i].nominal)
    }
    /// Unit spin axis.
    #[inline(always)]
    fn along<T: Scalar>(&self) -> V3<T> {
        V3::new(T::from_f64(self.axis.x), T::from_f64(self.axis.y), T::from_f64(self.axis.z))
    }
    /// `nu / sqrt(nu^2 + s^2)`.
    #[inline(always)]
    fn dry<T: Scalar>(&self, nu: T) -> T {
        nu / nu.mul_add(nu, T::from_f64(self.rounding * self.rounding)).sqrt()
    }
    /// `dR/d nu` (N m).
    #[inline(always)]
    fn friction<T: Scalar>(&self, p: &[T], nu: T) -> T {
        p[DRY].mul_add(self.dry(nu), p[VISCOUS] * nu)
    }
}

/// Adds everything that is wrong with the numbers to `problems`. Allocates on trouble only.
fn check(w: &Wheel, problems: &mut Problems) {
    let mut sound = true;
    for (key, unit, x) in [
        ("mass_kg", "kg", w.mass),
        ("inertia_spin_kgm2", "kg m^2", w.spin),
        ("inertia_transverse_kgm2", "kg m^2", w.transverse),
        ("rounding_rad_per_s", "rad/s", w.rounding),
    ] {
        let problem = check_positive(key, x, unit, "give a number above 0");
        sound &= problem.is_none();
        problems.0.extend(problem);
    }
    // J = 2 J_t for a disc without thickness; no body of revolution has more.
    if sound && w.transverse < 0.5 * w.spin * (1.0 - 1e-9) {
        let what = format!(
            "{} kg m^2 is below the limit {} kg m^2, half of the inertia about the spin axis",
            w.transverse,
            0.5 * w.spin
        );
        let p = Problem::error(Area::Config, "Config::Inertia", what).on("inertia_transverse_kgm2");
        let p = p.violating(w.transverse, Limit::AtLeast(0.5 * w.spin), "kg m^2");
        problems.push(p.hint("are the two inertias interchanged?"));
    }
    let mut bad = |code, key: &str, what: String, hint: &str| {
        problems.push(Problem::error(Area::Config, code, what).on(key).hint(hint));
    };
    if w.axis.iter().any(|x| !x.is_finite()) {
        let what = format!("{:?} holds a number that is not finite", w.axis.as_slice());
        bad("Config::NotFinite", "axis", what, "give a direction such as [0.0, 0.0, 1.0]");
    } else if !(1e-9..=1e9).contains(&w.axis.amax()) {
        let what = format!("{:?} gives no direction", w.axis.as_slice());
        bad("Config::Axis", "axis", what, "give a direction such as [0.0, 0.0, 1.0]; any length will do");
    }
    problems.0.extend(check_damping("viscous_nms_per_rad", w.viscous));
    problems.0.extend(check_damping("dry_nm", w.dry));
}

/// Builds a [`ReactionWheel`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// Keys: `axis = [x, y, z]`, `mass_kg`, `inertia_spin_kgm2`, `inertia_transverse_kgm2`, and optionally
/// `viscous_nms_per_rad` and `dry_nm` (0 unless given) and `rounding_rad_per_s` ([`ROUNDING`] unless given).
///
/// ```toml
/// [[appendage]]
/// kind = "reaction_wheel"
/// name = "wheel_x"
/// host = "base"
/// mount = { xyz_m = [0.9, 0.0, 0.4] }
/// axis = [1.0, 0.0, 0.0]
/// mass_kg = 8.5
/// inertia_spin_kgm2 = 0.11
/// inertia_transverse_kgm2 = 0.06
/// viscous_nms_per_rad = 2e-5
/// ```
///
/// # Errors
/// Every problem of the table: those of [`ff_model::keys::read`] and of [`ReactionWheel::new`].
pub fn from_toml(table: &toml::Table) -> Result<SharedAppendage, Problems> {
    let wheel = keys::read(table, |t| {
        let (axis, mass) = (t.numbers::<3>("axis"), t.number("mass_kg"));
        let (spin, transverse) = (t.number("inertia_spin_kgm2"), t.number("inertia_transverse_kgm2"));
        let (viscous, dry) = (t.number_or("viscous_nms_per_rad", 0.0), t.number_or("dry_nm", 0.0));
        let rounding = t.number_or("rounding_rad_per_s", ROUNDING);
        // What could be read is checked even when something else is missing; substitutes are sound.
        let known = |x: Option<f64>, other: Option<f64>| x.or(other).unwrap_or(1.0);
        let w = Wheel {
            axis: axis.map_or(Vector3::z(), Vector3::from),
            mass: known(mass, None),
            spin: known(spin, transverse),
            transverse: known(transverse, spin),
            viscous: viscous.unwrap_or(0.0),
            dry: dry.unwrap_or(0.0),
            rounding: known(rounding, None),
        };
        check(&w, t.problems());
        let all = [mass, spin, transverse, viscous, dry, rounding];
        (axis.is_some() && all.iter().all(Option::is_some)).then_some(w)
    })?;
    Ok(ReactionWheel::new(&wheel)?.into())
}

ff_model::shared!(ReactionWheel);

impl Appendage for ReactionWheel {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], _eta: &[T], m: &mut PortMatrix<'_, T>) {
        let mut m = m.expect(1);
        let (a, more, t) = (self.along(), p[SPIN] - p[TRANSVERSE], p[TRANSVERSE]);
        let b = a.scaled(more);
        let (xx, yy, zz) = (b.x.mul_add(a.x, t), b.y.mul_add(a.y, t), b.z.mul_add(a.z, t));
        let i = S3 { xx, xy: b.x * a.y, yy, xz: b.x * a.z, yz: b.y * a.z, zz };
        m.set_host(&PackedInertia { m: p[MASS], h: V3::zero(), i });
        m.set_coupling(0, &V3::zero(), &a.scaled(p[SPIN]));
        m.set_sym(6, 6, p[SPIN]);
    }
    /// `R = d nu^2 / 2 + c (sqrt(nu^2 + s^2) - s)` (W), the bracket as `nu^2 / (sqrt(nu^2 + s^2) + s)`: exactly zero at
    /// rest and without cancellation near it.
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let square = nu[0] * nu[0];
        let s = T::from_f64(self.rounding);
        (p[VISCOUS] * square).scale(0.5) + p[DRY] * (square / ((square + s * s).sqrt() + s))
    }
}

impl PortDynamics for ReactionWheel {
    const WRITES_ALL: bool = true;
    /// The friction times the rate.
    #[inline(always)]
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.friction(p, nu[0]) * nu[0]
    }
    /// `h_b = V x* (M_bb V + [0; J a nu])`, `h_e = d nu + c nu / sqrt(nu^2 + s^2)`.
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        let (v, w, a) = (V3::from(&s.host.lin), V3::from(&s.host.ang), self.along());
        // w x J_t w is zero.
        let along = (p[SPIN] - p[TRANSVERSE]).mul_add(a.dot(&w), p[SPIN] * s.nu[0]);
        let h = &mut h[..7];
        w.cross(&v).scaled(p[MASS]).write_to(h);
        w.cross(&a).scaled(along).write_to(&mut h[3..]);
        h[6] = self.friction(p, s.nu[0]);
    }
    /// `f = m a`, `n = I al + J nu' a + w x (I w + J nu a)`, own row `J (a.al + nu') + dR/d nu`.
    #[inline(always)]
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        _: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        let x = Spun::new(self, s, acc);
        let (j, t) = (p[SPIN], p[TRANSVERSE]);
        let (along, across) = ((j - t).mul_add(x.a_al, j * acc.nu[0]), (j - t).mul_add(x.a_w, j * s.nu[0]));
        let r = &mut r[..7];
        x.lin.scaled(p[MASS]).write_to(r);
        x.wxa.scale_add(across, &x.a.scale_add(along, &x.al.scaled(t))).write_to(&mut r[3..]);
        r[6] = j.mul_add(x.a_al + acc.nu[0], self.friction(p, s.nu[0]));
    }
    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        let x = Spun::new(self, s, acc);
        let (spin, more, nu, o) = (p[SPIN], p[SPIN] - p[TRANSVERSE], s.nu[0], T::zero());
        let (f, a) = (V3::from(&s.host.lin).scaled(p[MASS]), &x.a);
        let b = a.scaled(Scalar::mul_add(more, x.a_w, spin * nu));
        let turned = x.wxa.scaled(more);
        // e_i x m v, and e_i x b + a_i (J - J_t) w x a.
        let n = [
            turned.scale_add(a.x, &V3::new(o, -b.z, b.y)),
            turned.scale_add(a.y, &V3::new(b.z, o, -b.x)),
            turned.scale_add(a.z, &V3::new(-b.y, b.x, o)),
        ];
        let f = [V3::new(o, -f.z, f.y), V3::new(f.z, o, -f.x), V3::new(-f.y, f.x, o)];
        let j = &mut j[..35];
        for i in 0..3 {
            f[i].write_to(&mut j[7 * i..]);
            n[i].write_to(&mut j[7 * i + 3..]);
            j[7 * i + 6] = o;
        }
        j[21..31].fill(o);
        x.wxa.scaled(spin).write_to(&mut j[31..]);
        // d/d nu of nu / sqrt(nu^2 + s^2) is s^2 / (nu^2 + s^2)^(3/2).
        let round = T::from_f64(self.rounding * self.rounding);
        let square = Scalar::mul_add(nu, nu, round);
        j[34] = p[VISCOUS] + p[DRY] * round / (square * Scalar::sqrt(square));
    }
    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, _: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        let x = Spun::new(self, s, acc);
        let (nu, al) = (s.nu[0], x.a_al + acc.nu[0]);
        let y = &mut y[..35];
        y.fill(T::zero());
        x.lin.write_to(y);
        x.wxa.scale_add(x.a_w + nu, &x.a.scaled(al)).write_to(&mut y[10..]);
        y[13] = al;
        x.wxa.scale_add(-x.a_w, &x.a.scale_add(-x.a_al, &x.al)).write_to(&mut y[17..]);
        y[27] = nu;
        y[34] = self.dry(nu);
    }
}

/// Motion of the host as the rotor feels it.
struct Spun<T> {
    /// Classical acceleration of the mount, `A + w x v`.
    lin: V3<T>,
    al: V3<T>,
    a: V3<T>,
    /// `w x a`, `a . w`, `a . al`.
    wxa: V3<T>,
    a_w: T,
    a_al: T,
}

impl<T: Scalar> Spun<T> {
    #[inline(always)]
    fn new(wheel: &ReactionWheel, s: &PortState<'_, T>, acc: &PortAccel<'_, T>) -> Self {
        let (v, w, a) = (V3::from(&s.host.lin), V3::from(&s.host.ang), wheel.along::<T>());
        let al = V3::from(&acc.host.ang);
        let lin = w.cross_add(&v, &V3::from(&acc.host.lin));
        Self { lin, wxa: w.cross(&a), a_w: a.dot(&w), a_al: a.dot(&al), al, a }
    }
}

/// Angular momentum of the rotor along its axis (kg m^2/s), `J (a.w + nu)`, at parameters `p`, host angular velocity
/// `w` (rad/s, mount axes) and speed `nu` (rad/s) relative to the host. Does not allocate.
///
/// # Panics
/// If `p` is shorter than two.
pub fn axial_momentum<T: Scalar>(wheel: &ReactionWheel, p: &[T], w: &Vector3<T>, nu: T) -> T {
    p[SPIN] * (dot(&wheel.axis.map(T::from_f64), w) + nu)
}

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
