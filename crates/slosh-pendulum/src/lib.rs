//! Fuel slosh as a pendulum: a point mass on a massless universal joint, an appendage for ff-model.
//!
//! The fulcrum is the mount origin. With swing angles `a` (about the mount x axis) and `b` (about the y axis
//! rotated with `a`) the mass sits at
//!
//! ```text
//! r = Rx(a) Ry(b) [0, 0, -l] = l [-sin b, sin a cos b, -cos a cos b]
//! U = (k_0 a^2 + k_1 b^2) / 2  (J)        R = (d_0 a'^2 + d_1 b'^2) / 2  (W)
//! ```
//!
//! At rest the mass hangs along `-z` of the mount, so that `+z` is the direction of settling acceleration.
//! Only the sloshing part of the fuel belongs here; the fixed part belongs to the host body.
//!
//! # What the paper prints, and what holds
//! The paper's eqs. (12) and (13), the lateral and axial force balance of the mass, contradict each other:
//! (13) has `-a'^2 cos a` together with `+a'' sin a`, while `d^2(cos a)/dt^2 = -a'' sin a - a'^2 cos a` gives
//! both the same sign in every convention. Both leave out the spring `k a / l` that Fig. 2 draws and eq. (16)
//! contains. With `T` the tension of the arm and `F = (c a' + k a) / l`, what holds is
//!
//! ```text
//! m x_l'' - m l a'^2 sin a + (m l a'' + F) cos a + T sin a = 0
//! m x_a'' + m l a'^2 cos a + (m l a'' + F) sin a - T cos a = 0
//! ```
//!
//! and `x''` is the acceleration of the fulcrum, not of the base origin. Eq. (14) counts the damper twice; the
//! correct small-angle wrench, with the couple that the paper omits, is [`formulas::small_angle_wrench`].
//! None of these is used to simulate: the motion follows from the energies.
//!
//! # The family
//! [`SloshSpringMass`] is a mass on springs along two or three axes. [`SloshTank`] holds several sloshing masses of both
//! sorts and the fuel that does not move; [`geometry`] gets them from the shape of a tank and its fill level.
//!
//! * [`SloshPendulum`]: the appendage; [`formulas`]: frequency, damping ratio, equivalences.
//! * [`from_toml`]: the factory of mission files; [`register`]: the entries of all kinds in a registry.
//! * [`SloshPendulum::twin_bodies`]: the same pendulum as ordinary tree links ([`ff_model::port::TwinBody`]), a free oracle
//!   for tests.

mod check;
mod config;
pub mod formulas;
pub mod geometry;
mod particle;
mod pendulum;
mod point;
mod potential;
mod slot;
mod spring;
mod spring_mass;
mod swing;
mod tank;
mod tank_config;

pub use config::from_toml;
pub use pendulum::SloshPendulum;
pub use spring_mass::{SPRING_MASS_KIND, SloshSpringMass, from_toml as spring_mass_from_toml};
pub use swing::SWING_LIMITS;
pub use tank::{FixedFuel, SloshPart, SloshTank, TANK_KIND};
pub use tank_config::from_toml as tank_from_toml;

/// The `kind` of mission files for this appendage.
pub const KIND: &str = "slosh_pendulum";

/// Adds the appendages of this crate to a registry: [`KIND`], [`SPRING_MASS_KIND`] and [`TANK_KIND`]. Allocates.
pub fn register(registry: &mut ff_model::Registry) {
    registry.register(KIND, from_toml).example(KIND, EXAMPLE);
    registry.register(SPRING_MASS_KIND, spring_mass_from_toml).example(SPRING_MASS_KIND, SPRING_MASS_EXAMPLE);
    registry.register(TANK_KIND, tank_from_toml).example(TANK_KIND, CYLINDER).example(TANK_KIND, SPHERE);
}

/// A tank as its table stands in a mission file.
const EXAMPLE: &str = "
mass_kg = 100.0
length_m = 0.8
stiffness_nm_per_rad = [20.0, 23.0]
damping_nms_per_rad = [5.0, 4.0]";

/// A mass on springs along three axes.
const SPRING_MASS_EXAMPLE: &str = "
mass_kg = 70.0
rest_m = [0.1, -0.2, -0.7]
stiffness_n_per_m = [31.0, 27.0, 45.0]
damping_ns_per_m = [3.1, 2.4, 4.2]
travel_m = 0.4";

/// Two modes of an upright cylinder under settling thrust.
const CYLINDER: &str = "
cylinder = { radius_m = 0.45, fill_m = 0.6 }
density_kg_per_m3 = 1010.0
settling_m_per_s2 = 0.02
damping_ratio = 0.01
slosh_modes = 2";

/// A sphere under settling thrust.
const SPHERE: &str = "
sphere = { radius_m = 0.3, fill_m = 0.25 }
density_kg_per_m3 = 1010.0
settling_m_per_s2 = 0.05
damping_ratio = 0.01";

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
