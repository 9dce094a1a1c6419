//! From tank and fill level to sloshing masses: upright circular cylinder and sphere.
//!
//! Lateral sloshing under an axial acceleration `a` that holds the liquid at the bottom (high Bond number: surface
//! tension is left out). A mode is a mass `m_n` at height `z_n` above the bottom that swings at `omega_n^2 = a / L_n`,
//! `L_n` being the length of the equivalent pendulum, whose fulcrum is at `z_n + L_n`.
//!
//! **Cylinder** of radius `R`, liquid depth `h`, `xi_n` the zeros of `J_1'` (1.8412, 5.3314, ...):
//!
//! ```text
//! L_n = R / (xi_n tanh(xi_n h/R))       m_n / m = 2 R tanh(xi_n h/R) / (h xi_n (xi_n^2 - 1))
//! z_n = h - (2 R / xi_n) tanh(xi_n h / (2 R))
//! ```
//!
//! These are the mechanical model of N. Abramson (ed.), *The Dynamic Behavior of Liquids in Moving Containers*, NASA
//! SP-106, 1966, chapter 6, and F. Dodge, *The New "Dynamic Behavior of Liquids in Moving Containers"*, Southwest Research
//! Institute, 2000, chapter 3; derived in `docs/theory/slosh.md` section 5, and held by a test to the numerical solution.
//!
//! **Sphere**: no closed form; the modes are computed from linear potential flow (module `potential`).

use crate::potential;
use crate::potential::WallPoint;
use ff_model::{Area, Problem, Problems};
use std::f64::consts::{PI, TAU};

/// Zeros of `J_1'`: the lateral modes of a circular cylinder.
pub const XI: [f64; 5] = [
    1.841_183_781_340_659_3,
    5.331_442_773_525_032_6,
    8.536_316_366_346_286,
    11.706_004_902_592_064,
    14.863_588_633_909_033,
];

/// Most modes asked of one tank: later ones carry less than a hundredth of the liquid.
pub const MAX_TANK_MODES: usize = XI.len();

/// An axisymmetric tank whose axis is the `z` axis, filled from its lowest point up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tank {
    /// Upright circular cylinder with a flat bottom.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Depth of the liquid (m).
        fill: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius (m).
        radius: f64,
        /// Depth of the liquid above the lowest point (m), below the diameter.
        fill: f64,
    },
}

/// One lateral slosh mode: a mass that moves in both lateral directions alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SloshMode {
    /// Slosh mass (kg).
    pub mass: f64,
    /// Rest position of the mass above the lowest point of the tank (m). May be below it: a shallow liquid's pressure on
    /// a flat bottom has a moment that only a lever outside the tank can give.
    pub height: f64,
    /// Length of the equivalent pendulum, `a / omega^2` (m).
    pub length: f64,
}

impl SloshMode {
    /// Natural frequency (rad/s) under the axial acceleration `a` (m/s^2): `sqrt(a / L)`. NaN for a negative one.
    pub fn omega(&self, a: f64) -> f64 {
        (a / self.length).sqrt()
    }
    /// Lateral stiffness (N/m) that gives the same frequency to a mass on springs: `m a / L`.
    pub fn stiffness(&self, a: f64) -> f64 {
        self.mass * a / self.length
    }
    /// Height of the fulcrum of the equivalent pendulum above the lowest point of the tank (m).
    pub fn fulcrum(&self) -> f64 {
        self.height + self.length
    }
}

/// Liquid of a tank split into slosh modes and the rest, which moves with the tank.
#[derive(Clone, Debug, PartialEq)]
pub struct TankModel {
    /// Modes in ascending frequency.
    pub modes: Vec<SloshMode>,
    /// Mass that does not slosh (kg).
    pub fixed_mass: f64,
    /// Its height above the lowest point of the tank (m): the centre of mass of all the liquid stays where it is.
    pub fixed_height: f64,
}

impl Tank {
    /// Volume of the liquid (m^3): `pi R^2 h`, `pi h^2 (R - h/3)`.
    pub fn volume(&self) -> f64 {
        match *self {
            Self::Cylinder { radius, fill } => PI * radius * radius * fill,
            Self::Sphere { radius, fill } => PI * fill * fill * (radius - fill / 3.0),
        }
    }
    /// Height of the centre of mass of the liquid above the lowest point (m): `h/2`, `h (8R - 3h) / (4 (3R - h))`.
    pub fn centre(&self) -> f64 {
        match *self {
            Self::Cylinder { fill, .. } => fill / 2.0,
            Self::Sphere { radius, fill } => fill * (8.0 * radius - 3.0 * fill) / (4.0 * (3.0 * radius - fill)),
        }
    }
    /// Radius of the tank (m).
    pub fn radius(&self) -> f64 {
        match *self {
            Self::Cylinder { radius, .. } | Self::Sphere { radius, .. } => radius,
        }
    }

    /// The first `count` lateral modes of a liquid of `density` (kg/m^3), and what is left. Allocates; takes
    /// milliseconds for a sphere.
    ///
    /// # Errors
    /// Every problem, all of [`Area::Config`], objects `radius_m`, `fill_m`, `density_kg_per_m3`, `slosh_modes`:
    /// `Config::NotFinite`, `Config::Param` (not above zero, a sphere filled beyond 0.95 of its diameter or less than
    /// 0.05, a cylinder beyond 20 radii, more than [`MAX_TANK_MODES`]).
    pub fn model(&self, density: f64, count: usize) -> Result<TankModel, Problems> {
        self.check(density, count)?;
        let modes = match *self {
            Self::Cylinder { radius, fill } => {
                XI[..count].iter().map(|&xi| cylinder(radius, fill, density, xi)).collect()
            }
            Self::Sphere { radius, fill } => sphere(radius, fill, density, count)?,
        };
        let total = density * self.volume();
        let sloshing: f64 = modes.iter().map(|m| m.mass).sum();
        let moment: f64 = modes.iter().map(|m| m.mass * m.height).sum();
        let fixed_mass = total - sloshing;
        Ok(TankModel { modes, fixed_mass, fixed_height: (total * self.centre() - moment) / fixed_mass })
    }

    fn check(&self, density: f64, count: usize) -> Result<(), Problems> {
        let mut problems = Problems::default();
        let mut bad = |code, key: &str, what: String, hint: &str| {
            problems.push(Problem::error(Area::Config, code, what).on(key).hint(hint));
        };
        let (Self::Cylinder { radius, fill } | Self::Sphere { radius, fill }) = *self;
        let numbers = [("radius_m", "m", radius), ("fill_m", "m", fill), ("density_kg_per_m3", "kg/m^3", density)];
        for (key, unit, x) in numbers {
            if !x.is_finite() {
                bad("Config::NotFinite", key, format!("{x} {unit} is not a finite number"), "give a number above 0");
            } else if x <= 0.0 {
                let what = format!("{x} {unit} is not above the limit 0 {unit}");
                bad("Config::Param", key, what, "leave the tank out where there is no liquid");
            }
        }
        if numbers.iter().all(|n| n.2.is_finite() && n.2 > 0.0) {
            let (low, high) = match self {
                Self::Cylinder { .. } => (0.02 * radius, 20.0 * radius),
                Self::Sphere { .. } => (0.1 * radius, 1.9 * radius),
            };
            if !(low..=high).contains(&fill) {
                let what = format!("{fill} m is outside the limits {low} .. {high} m for a radius of {radius} m");
                let hint = "a liquid as shallow does not slosh linearly; a full tank does not slosh: make it rigid";
                bad("Config::Param", "fill_m", what, hint);
            }
        }
        if count == 0 || count > MAX_TANK_MODES {
            let what = format!("{count} modes, outside the limits 1 to {MAX_TANK_MODES}");
            bad("Config::Param", "slosh_modes", what, "the first mode carries nearly all of the sloshing mass");
        }
        if problems.has_errors() { Err(problems) } else { Ok(()) }
    }
}

/// Mode of a cylinder by the closed formulas of the module.
fn cylinder(radius: f64, fill: f64, density: f64, xi: f64) -> SloshMode {
    let t = (xi * fill / radius).tanh();
    SloshMode {
        mass: TAU * density * radius.powi(3) * t / (xi * (xi * xi - 1.0)),
        height: fill - 2.0 * radius / xi * (xi * fill / (2.0 * radius)).tanh(),
        length: radius / (xi * t),
    }
}

/// Modes of a sphere from potential flow.
fn sphere(radius: f64, fill: f64, density: f64, count: usize) -> Result<Vec<SloshMode>, Problems> {
    let top = (1.0 - fill / radius).acos();
    let wall: Vec<WallPoint> = potential::gauss(96)
        .into_iter()
        .map(|(x, w)| {
            let (s, c) = (top * x).sin_cos();
            let length = radius * top * w;
            WallPoint { rho: radius * s, z: radius * (1.0 - c), n_rho: s * length, n_z: -c * length }
        })
        .collect();
    let surface = (fill * (2.0 * radius - fill)).sqrt();
    let modes = potential::modes(&wall, surface, fill, count).ok_or_else(|| {
        let p = Problem::error(Area::Config, "Config::Param", "the modes of this tank could not be computed");
        Problems(vec![p.on("fill_m").hint("ask for fewer slosh_modes")])
    })?;
    Ok(modes
        .into_iter()
        .map(|m| SloshMode { mass: density * m.volume, height: m.height, length: 1.0 / m.lambda })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wall of a cylinder for the numerical solution: bottom, then side.
    fn cylinder_wall(radius: f64, fill: f64) -> Vec<WallPoint> {
        let rule = potential::gauss(64);
        let bottom = rule.iter().map(|(x, w)| WallPoint { rho: radius * x, z: 0.0, n_rho: 0.0, n_z: -radius * w });
        let side = rule.iter().map(|(x, w)| WallPoint { rho: radius, z: fill * x, n_rho: fill * w, n_z: 0.0 });
        bottom.chain(side).collect()
    }

    /// `J_1'` by its power series.
    fn bessel_slope(x: f64) -> f64 {
        let (mut term, mut sum) = (0.5, 0.0);
        for k in 0..60 {
            sum += f64::from(2 * k + 1) * term;
            term *= -(x * x / 4.0) / f64::from((k + 1) * (k + 2));
        }
        sum
    }

    #[test]
    fn xi_are_the_zeros_of_the_slope_of_j1() {
        for xi in XI {
            assert!(bessel_slope(xi).abs() < 1e-9, "{xi}: {}", bessel_slope(xi));
            assert!(bessel_slope(xi - 1e-3) * bessel_slope(xi + 1e-3) < 0.0);
        }
    }

    #[test]
    fn closed_formulas_of_the_cylinder_are_those_of_potential_flow() {
        // The second mode of a deep liquid dies within a fraction of the depth, hard for polynomials about the middle.
        let mut worst = [0.0_f64; 2];
        for (radius, fill) in [(0.7, 0.45), (0.7, 0.7), (1.3, 2.2)] {
            let numeric = potential::modes(&cylinder_wall(radius, fill), radius, fill, 2).unwrap();
            for ((n, xi), worst) in numeric.iter().zip(XI).zip(&mut worst) {
                let c = cylinder(radius, fill, 1.0, xi);
                let e = [n.lambda * c.length - 1.0, n.volume / c.mass - 1.0, (n.height - c.height) / fill];
                *worst = e.iter().fold(*worst, |w, x| w.max(x.abs()));
            }
        }
        println!("frequency, mass, height: largest relative difference {:.1e}, second mode {:.1e}", worst[0], worst[1]);
        assert!(worst[0] < 1e-12 && worst[1] < 1e-5, "{worst:?}");
    }

    #[test]
    fn known_numbers_of_the_cylinder() {
        // Half as deep as wide: h = R. tanh(1.8412) = 0.95089: omega^2 R/g = 1.7507, m_1/m = 0.4320.
        let t = Tank::Cylinder { radius: 0.5, fill: 0.5 };
        let m = t.model(800.0, 1).unwrap();
        let total = 800.0 * t.volume();
        assert!((0.5 / m.modes[0].length - 1.7507).abs() < 2e-4, "{}", 0.5 / m.modes[0].length);
        assert!((m.modes[0].mass / total - 0.4320).abs() < 2e-4, "{}", m.modes[0].mass / total);
        assert!((m.modes[0].mass + m.fixed_mass - total).abs() < 1e-12 * total);
        let first = m.modes[0].mass * m.modes[0].height + m.fixed_mass * m.fixed_height;
        assert!((first - total * 0.25).abs() < 1e-12 * total);
        // A shallow liquid sloshes as a whole: 2 / (xi^2 - 1) of it in each mode, which adds up to one.
        let shallow = Tank::Cylinder { radius: 1.0, fill: 0.02 }.model(1.0, 5).unwrap();
        let volume = Tank::Cylinder { radius: 1.0, fill: 0.02 }.volume();
        assert!((shallow.modes[0].mass / volume - 2.0 / (XI[0] * XI[0] - 1.0)).abs() < 1e-3);
        assert!(shallow.fixed_mass / volume > 0.0 && shallow.fixed_mass / volume < 0.05);
    }

    #[test]
    fn a_sphere_swings_about_its_centre() {
        // Pressure acts through the centre, so the fulcrum is there: z_n + L_n = R, whatever the fill.
        for fill in [0.2, 0.5, 0.9, 1.0, 1.3, 1.7] {
            let t = Tank::Sphere { radius: 1.0, fill };
            let m = t.model(1.0, 2).unwrap();
            for mode in &m.modes {
                assert!((mode.fulcrum() - 1.0).abs() < 2e-3, "fill {fill}: {mode:?}");
            }
            let part = m.modes[0].mass / t.volume();
            println!("fill {fill}: omega^2 R/g = {:.5}, m_1/m = {part:.4}", 1.0 / m.modes[0].length);
            assert!(part > 0.05 && part < 1.0 && m.fixed_mass > 0.0);
        }
    }

    #[test]
    fn a_half_full_sphere_has_the_published_frequency() {
        // omega^2 R/g = 1.5602 for the first lateral mode: P. McIver, J. Fluid Mech. 201 (1989) 243-257.
        let m = Tank::Sphere { radius: 0.6, fill: 0.6 }.model(1000.0, 1).unwrap();
        let have = 0.6 / m.modes[0].length;
        println!("{have:.6}");
        assert!((have - 1.5602).abs() < 1e-4, "{have}");
        // A puddle swings like a marble in the bowl.
        let puddle = Tank::Sphere { radius: 1.0, fill: 0.1 }.model(1.0, 1).unwrap();
        assert!((1.0 / puddle.modes[0].length - 1.0).abs() < 0.1);
        assert!(puddle.modes[0].mass / Tank::Sphere { radius: 1.0, fill: 0.1 }.volume() > 0.9);
    }

    #[test]
    fn impossible_tanks_are_refused_by_name() {
        let refused = |t: Tank, density: f64, n: usize, key: &str| {
            let e = t.model(density, n).unwrap_err();
            assert_eq!((e.0.len(), e.0[0].object.as_deref(), e.0[0].hint.is_some()), (1, Some(key), true), "{e}");
        };
        let c = |radius, fill| Tank::Cylinder { radius, fill };
        refused(c(-0.5, 0.4), 1.0, 1, "radius_m");
        refused(c(0.5, f64::NAN), 1.0, 1, "fill_m");
        refused(c(0.5, 11.0), 1.0, 1, "fill_m");
        refused(c(0.5, 0.4), 0.0, 1, "density_kg_per_m3");
        refused(c(0.5, 0.4), 1.0, 6, "slosh_modes");
        refused(Tank::Sphere { radius: 0.5, fill: 1.1 }, 1.0, 1, "fill_m");
    }
}
