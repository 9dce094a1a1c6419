//! A tank: several sloshing masses and the fuel that does not move.

use crate::check;
use crate::check::Axes;
use crate::particle::{Particle, Path, Values};
use crate::point::{Wrench, press, press_each};
use ff_model::diagnostics::Limit;
use ff_model::port::MAX_COORDS;
use ff_model::scalar::PlainScalar;
use ff_model::spatial::InertiaError;
use ff_model::spatial::vec3::{M3, PackedInertia, S3, V3};
use ff_model::{
    Appendage, Area, Decl, Inertia, ParamDecl, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Problem,
    Problems, Scalar,
};
use nalgebra::{Matrix3, Vector3};

/// The `kind` of mission files for this appendage.
pub const TANK_KIND: &str = "slosh_tank";

/// One sloshing mass of a tank, mount frame.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use slosh_pendulum::{SloshPart, SloshTank};
///
/// let fulcrum = Vector3::new(0.1, -0.2, 0.6);
/// let swinging = SloshPart::Pendulum { mass: 80.0, length: 0.7, fulcrum, k: [19.0, 22.0], d: [4.0, 3.0] };
/// let rest = Vector3::new(0.1, -0.2, 0.9);
/// let sliding = SloshPart::SpringMass { mass: 12.0, rest, k: vec![30.0, 27.0, 45.0], d: vec![3.1, 2.4, 4.2], travel: 0.4 };
/// let tank = SloshTank::new(None, &[swinging, sliding])?;
/// assert_eq!(ff_model::Appendage::decl(&tank).coords.len(), 2 + 3);
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum SloshPart {
    /// As [`crate::pendulum::SloshPendulum`], with its fulcrum at `fulcrum`; hangs along `-z`.
    Pendulum {
        /// Mass (kg).
        mass: f64,
        /// Arm length (m).
        length: f64,
        /// Fulcrum (m).
        fulcrum: Vector3<f64>,
        /// Stiffness of both swings (N m/rad).
        k: [f64; 2],
        /// Damping of both swings (N m s/rad).
        d: [f64; 2],
    },
    /// As [`crate::spring_mass::SloshSpringMass`]: two axes (x, y) or three.
    SpringMass {
        /// Mass (kg).
        mass: f64,
        /// Rest position (m).
        rest: Vector3<f64>,
        /// Stiffness along each axis (N/m).
        k: Vec<f64>,
        /// Damping along each axis (N s/m).
        d: Vec<f64>,
        /// Greatest displacement (m).
        travel: f64,
    },
}

impl SloshPart {
    fn values(&self) -> (Values, Axes, Path) {
        match self {
            Self::Pendulum { mass, length, fulcrum, k, d } => {
                let (k, d) = (k.to_vec(), d.to_vec());
                let v = Values { mass: *mass, length: *length, rest: *fulcrum, k, d, travel: 0.0 };
                (v, Axes::Swing, Path::Pendulum(*fulcrum))
            }
            Self::SpringMass { mass, rest, k, d, travel } => {
                let v = Values { mass: *mass, length: 0.0, rest: *rest, k: k.clone(), d: d.clone(), travel: *travel };
                (v, Axes::Shift, Path::Springs(k.len()))
            }
        }
    }
}

/// Fuel that moves with the tank, mount frame.
///
/// Its mass is one parameter, `fixed.mass`: where it is and how it is spread are geometry. Data cannot tell it from the
/// host body anyway (the paper's eq. (18)): only their sum can be estimated.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use slosh_pendulum::{FixedFuel, SloshPart, SloshTank};
///
/// let fixed = FixedFuel { mass: 210.0, com: Vector3::new(0.1, -0.2, 0.3), inertia_com: Matrix3::zeros() }; // liquid: no inertia
/// # let rest = Vector3::new(0.1, -0.2, 0.9);
/// # let sliding = SloshPart::SpringMass { mass: 12.0, rest, k: vec![30.0, 27.0], d: vec![3.1, 2.4], travel: 0.4 };
/// let tank = SloshTank::new(Some(fixed), &[sliding])?;
/// assert_eq!((ff_model::Appendage::decl(&tank).params[0].name.as_str(), tank.nominal()[0]), ("fixed.mass", 210.0));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FixedFuel {
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass (m).
    pub com: Vector3<f64>,
    /// Inertia about the centre of mass (kg m^2); zero for a point, as of a liquid that does not turn with its tank.
    pub inertia_com: Matrix3<f64>,
}

/// Several sloshing masses in one tank, and its fixed fuel.
///
/// Parameters, in order: `fixed.mass` (kg) if there is fixed fuel, then for each mass those of its sort, named
/// `mode[i].mass`, `mode[i].length`, `mode[i].k[0]`, ... Coordinates `mode[i].swing[0]` (rad) or `mode[i].shift[0]` (m).
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use slosh_pendulum::{SloshPart, SloshTank};
///
/// let mode = |mass, k: f64, d: f64| SloshPart::SpringMass {
///     mass,
///     rest: Vector3::new(0.1, -0.2, 0.7),
///     k: vec![k, 1.1 * k],
///     d: vec![d, 0.9 * d],
///     travel: 0.4,
/// };
/// let tank = SloshTank::new(None, &[mode(64.0, 31.0, 0.8), mode(9.0, 11.0, 0.2)])?;
/// let names: Vec<&str> = ff_model::Appendage::decl(&tank).coords.iter().map(|c| c.name.as_str()).collect();
/// assert_eq!(names, ["mode[0].shift[0]", "mode[0].shift[1]", "mode[1].shift[0]", "mode[1].shift[1]"]);
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct SloshTank {
    decl: Decl,
    /// Inertia of one kilogram of the fixed fuel about the mount.
    fixed: Option<Inertia<f64>>,
    masses: Vec<Particle>,
}

impl SloshTank {
    /// A tank from its parts. Allocates.
    ///
    /// # Errors
    /// Every problem, all of [`Area::Config`]: those of each mass (objects `modes[i].mass_kg`, ...), `Config::Inertia` of
    /// the fixed fuel (`fixed.mass_kg`, ...), `Config::Param` (no masses, or more than 16 coordinates).
    pub fn new(fixed: Option<FixedFuel>, parts: &[SloshPart]) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        if parts.is_empty() {
            let p = Problem::error(Area::Config, "Config::Param", "no sloshing mass").on("modes");
            problems.push(p.hint("fuel that does not slosh belongs to the host body ([[robot.rigid]])"));
        }
        let all: Vec<_> = parts.iter().map(SloshPart::values).collect();
        for (i, (v, axes, _)) in all.iter().enumerate() {
            check::values(v, *axes, &format!("modes[{i}]."), &mut problems);
        }
        let (mut coords, mut params) = (Vec::new(), Vec::new());
        let fixed = fixed.and_then(|f| {
            let body = Inertia::from_com(f.mass, &f.com, &f.inertia_com);
            if let Err(e) = body.check() {
                problems.push(fixed_problem(&e));
                return None;
            }
            params.push(ParamDecl::positive("fixed.mass", "kg", f.mass));
            Some(Inertia::from_com(1.0, &f.com, &(f.inertia_com / f.mass)))
        });
        let n: usize = all.iter().map(|(v, ..)| v.k.len()).sum();
        if n > MAX_COORDS {
            let p = Problem::error(Area::Config, "Config::Param", format!("{n} coordinates, limit {MAX_COORDS}"));
            let p = p.violating(n as f64, Limit::AtMost(MAX_COORDS as f64), "coordinates");
            problems.push(p.on("modes").hint("keep the masses with the lowest frequencies"));
        }
        if problems.has_errors() {
            return Err(problems);
        }
        let masses = all
            .into_iter()
            .enumerate()
            .map(|(i, (v, _, path))| Particle::declare(path, &v, &format!("mode[{i}]."), &mut coords, &mut params))
            .collect();
        Ok(Self { decl: Decl::new(TANK_KIND, coords, params), fixed, masses })
    }
    /// Nominal values of all parameters, in the order of the declaration. Allocates.
    pub fn nominal(&self) -> Vec<f64> {
        self.decl.params.iter().map(|p| p.nominal).collect()
    }
    /// Fixed fuel about the mount: `p[0]` times one kilogram of it.
    #[inline(always)]
    fn fixed<T: Scalar>(&self, p: &[T]) -> Option<PackedInertia<T>> {
        let f = self.kilogram::<T>()?;
        let (h, i, m) = (f.h.scaled(p[0]), f.i, p[0]);
        let i = S3 { xx: i.xx * m, xy: i.xy * m, yy: i.yy * m, xz: i.xz * m, yz: i.yz * m, zz: i.zz * m };
        Some(PackedInertia { m, h, i })
    }
    /// One kilogram of fixed fuel about the mount.
    #[inline(always)]
    fn kilogram<T: Scalar>(&self) -> Option<PackedInertia<T>> {
        let f = self.fixed.as_ref()?;
        let (h, r) = (&f.h.data.0[0], &f.rot.data.0);
        let t = T::from_f64;
        let i = S3 { xx: t(r[0][0]), xy: t(r[1][0]), yy: t(r[1][1]), xz: t(r[2][0]), yz: t(r[2][1]), zz: t(r[2][2]) };
        Some(PackedInertia { m: T::one(), h: V3::new(t(h[0]), t(h[1]), t(h[2])), i })
    }
    /// `V x* (M V) + M A` of fixed fuel.
    #[inline(always)]
    fn still<T: Scalar>(body: &PackedInertia<T>, s: &PortState<'_, T>, acc: Option<&PortAccel<'_, T>>) -> Wrench<T> {
        let w = V3::from(&s.host.ang);
        let (lin, al) = acc.map_or((V3::zero(), V3::zero()), |a| (V3::from(&a.host.lin), V3::from(&a.host.ang)));
        body.wrench(&w, &al, &w.cross_add(&V3::from(&s.host.lin), &lin), &M3::field(&w, &al))
    }
    /// Residual, or bias without accelerations.
    #[inline(always)]
    fn push<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, acc: Option<&PortAccel<'_, T>>, r: &mut [T]) {
        // No closure: it would not be compiled for the instructions of its caller.
        let (mut f, mut n) = (V3::zero(), V3::zero());
        if let Some(b) = self.fixed(p) {
            (f, n) = Self::still(&b, s, acc);
        }
        for mass in &self.masses {
            let (mf, mn) = mass.residual(p, s, acc, r);
            (f, n) = (f + mf, n + mn);
        }
        press(&(f, n), r);
    }
}

fn fixed_problem(e: &InertiaError) -> Problem {
    let (code, key) = match e {
        InertiaError::NotFinite { .. } => ("Config::NotFinite", "fixed"),
        InertiaError::NonPositiveMass { .. } => ("Config::Inertia", "fixed.mass_kg"),
        _ => ("Config::Inertia", "fixed.inertia_com_kgm2"),
    };
    let hint = "give a mass above 0 kg and the inertia about its centre of mass, or leave the fixed fuel out";
    Problem::error(Area::Config, code, e.to_string()).on(key).hint(hint)
}

ff_model::shared!(SloshTank);

impl Appendage for SloshTank {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let mut host = self.fixed(p).unwrap_or_else(PackedInertia::zero);
        for mass in &self.masses {
            host.add(&mass.inertia(p, eta, m));
        }
        m.set_host(&host);
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        self.masses.iter().fold(T::zero(), |u, m| u + m.potential(p, eta))
    }
    #[inline(always)]
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.masses.iter().fold(T::zero(), |r, m| r + m.rayleigh(p, nu))
    }
}

impl PortDynamics for SloshTank {
    const WRITES_ALL: bool = true;
    /// `R` is quadratic.
    #[inline(always)]
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.rayleigh(p, nu).scale(2.0)
    }
    /// Newton's law mass by mass, and `V x* (I V)` of the fixed fuel.
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        self.push(p, s, None, h);
    }
    /// Both from one place of every mass.
    #[inline(always)]
    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        let mut host = self.fixed(p).unwrap_or_else(PackedInertia::zero);
        let (mut f, mut n) = match &self.fixed {
            Some(_) => Self::still(&host, s, None),
            None => (V3::zero(), V3::zero()),
        };
        for mass in &self.masses {
            let (body, (mf, mn)) = mass.terms(p, s, m, h);
            host.add(&body);
            (f, n) = (f + mf, n + mn);
        }
        m.set_host(&host);
        press(&(f, n), h);
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
        self.push(p, s, Some(acc), r);
    }
    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        let n = s.eta.len();
        let j = &mut j[..(3 + 2 * n) * (6 + n)];
        j.fill(T::zero());
        let mut spin = match self.fixed(p) {
            Some(b) => b.wrench_by_spin(&V3::from(&s.host.ang), &V3::from(&s.host.lin)),
            None => [(V3::zero(), V3::zero()); 3],
        };
        for mass in &self.masses {
            for (sum, (f, n)) in spin.iter_mut().zip(mass.jacobian(p, s, acc, j)) {
                *sum = (sum.0 + f, sum.1 + n);
            }
        }
        press_each(&spin, 6 + n, j);
    }
    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        y.fill(T::zero());
        if let Some(b) = self.kilogram() {
            press(&Self::still(&b, s, Some(acc)), y);
        }
        for mass in &self.masses {
            mass.regressor(p, s, acc, y);
        }
    }
}
