//! A flexible antenna boom: a slender beam clamped to its host, with a mass at its tip.
//!
//! The boom lies along the x axis of its mount. It bends in y and z with the shape of a cantilever under a tip force,
//! `phi(s) = (3 s^2 - s^3) / 2` with `s = x / L`, so that the two coordinates are the deflections of the tip (m):
//!
//! ```text
//! r(s) = [s L, phi(s) eta_0, phi(s) eta_1]                      position of the piece at s
//! T    = 1/2 integral |v + w x r + phi nu|^2 dm                 dm = m ds, and the tip mass at s = 1
//! U    = 1/2 (3 EI / L^3) (eta_0^2 + eta_1^2)                   EI phi'' squared, integrated
//! R    = 1/2 d (nu_0^2 + nu_1^2)
//! ```
//!
//! (L. Meirovitch, *Fundamentals of Vibrations*, McGraw-Hill 2001, sec. 9.6, assumed modes.) The modal mass is
//! `33/140 m + m_tip`. Shortening of the deflected boom is neglected: it is of second order in `eta / L`.

use ff_model::CoordDecl;
use ff_model::nalgebra::Vector3;
use ff_model::toml::Table;
use ff_model::{Appendage, Decl, DynAppendage, ParamDecl, PortMatrix, Problems, Registry, Scalar, keys};
use std::sync::Arc;

/// The `kind` of mission files.
pub const KIND: &str = "antenna_boom";
/// Key of the mission file, name and unit of the parameter, least value.
const PARAMS: [(&str, &str, &str, f64); 5] = [
    ("mass_kg", "mass", "kg", 1e-6),
    ("tip_mass_kg", "tip_mass", "kg", 0.0),
    ("length_m", "length", "m", 1e-3),
    ("bending_stiffness_nm2", "ei", "N m^2", 1e-9),
    ("damping_ns_per_m", "d", "N s/m", 0.0),
];
/// Nodes and weights of Gauss's rule on 0..1, exact to degree 7; the integrals of T have degree 6.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// The boom; parameters `mass`, `tip_mass`, `length`, `ei`, `d`, coordinates `tip_y`, `tip_z`.
pub struct Boom {
    decl: Decl,
}

impl Appendage for Boom {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let pieces = GAUSS.map(|(s, weight)| (s, p[0].scale(weight)));
        for (s, dm) in pieces.into_iter().chain([(1.0, p[1])]) {
            let phi = 0.5 * s * s * (3.0 - s);
            let r = Vector3::new(p[2].scale(s), eta[0].scale(phi), eta[1].scale(phi));
            m.add_point(dm, &r, &[Vector3::y(), Vector3::z()].map(|axis| axis.map(|x: f64| T::from_f64(phi * x))));
        }
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (p[3] / (p[2] * p[2] * p[2]) * (eta[0] * eta[0] + eta[1] * eta[1])).scale(1.5)
    }
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[4] * (nu[0] * nu[0] + nu[1] * nu[1])).scale(0.5)
    }
}

/// A boom from its table in a mission file.
///
/// # Errors
/// Every key that is missing, unknown, not a number, or below its limit.
pub fn from_toml(table: &Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let values = keys::read(table, |k| {
        let values = PARAMS.map(|(key, _, _, least)| k.number_within(key, least..=1e12));
        values.into_iter().collect::<Option<Vec<f64>>>()
    })?;
    let params = PARAMS.iter().zip(&values).map(|(&(_, name, unit, _), &x)| ParamDecl::positive(name, unit, x));
    let reach = 0.2 * values[2];
    let coords = ["tip_y", "tip_z"].map(|name| CoordDecl { name: name.into(), unit: "m", range: (-reach, reach) });
    Ok(Arc::new(Boom { decl: Decl { kind: KIND, coords: coords.into(), params: params.collect() } }))
}

/// Adds the boom to a registry, with the table that the conformance suite checks it with.
pub fn register(registry: &mut Registry) {
    registry.register(KIND, from_toml).example(KIND, include_str!("example.toml"));
}
