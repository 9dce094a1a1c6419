//! Reading and checking the numbers of one sloshing mass.

use crate::particle::Values;
use ff_model::keys::{Keys, check_damping, check_positive, check_stiffness};
use ff_model::{Area, Problem, Problems};
use nalgebra::Vector3;

/// What the coordinates of a mass are: decides keys and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Axes {
    Swing,
    Shift,
}

/// Adds everything that is wrong with the numbers to `problems`; `path` stands before the keys. Allocates.
pub(crate) fn values(v: &Values, axes: Axes, path: &str, problems: &mut Problems) {
    let (k_key, d_key, positive, wanted) = match axes {
        Axes::Swing => {
            let keys = ("stiffness_nm_per_rad", "damping_nms_per_rad");
            (keys.0, keys.1, [("mass_kg", "kg", v.mass), ("length_m", "m", v.length)], 2..=2)
        }
        Axes::Shift => {
            let keys = ("stiffness_n_per_m", "damping_ns_per_m");
            (keys.0, keys.1, [("mass_kg", "kg", v.mass), ("travel_m", "m", v.travel)], 2..=3)
        }
    };
    for (key, unit, x) in positive {
        let hint = "leave the mass out where there is no sloshing fuel";
        problems.0.extend(check_positive(&format!("{path}{key}"), x, unit, hint));
    }
    let mut bad = |code, key: &str, message: String, hint: &str| {
        problems.push(Problem::error(Area::Config, code, message).on(format!("{path}{key}")).hint(hint));
    };
    if v.rest.iter().any(|x| !x.is_finite()) {
        let why = format!("{:?} m holds a number that is not finite", v.rest.as_slice());
        bad("Config::NotFinite", "rest_m", why, "give three finite numbers");
    }
    if !wanted.contains(&v.k.len()) {
        let why = format!("{} numbers, expected {} to {}", v.k.len(), wanted.start(), wanted.end());
        bad("Config::WrongLength", k_key, why, "give one number per axis");
    } else if v.d.len() != v.k.len() {
        let why = format!("{} numbers for {} springs", v.d.len(), v.k.len());
        bad("Config::WrongLength", d_key, why, "give one damper per spring");
    }
    for (i, &k) in v.k.iter().enumerate() {
        problems.0.extend(check_stiffness(&format!("{path}{k_key}[{i}]"), k));
    }
    for (i, &d) in v.d.iter().enumerate() {
        problems.0.extend(check_damping(&format!("{path}{d_key}[{i}]"), d));
    }
}

/// The keys of a mass on springs; `rest` names the key of its rest position.
pub(crate) fn read_springs(t: &mut Keys<'_, '_>, rest: &'static str) -> Option<Values> {
    let (mass, k, d) = (t.number("mass_kg"), t.list("stiffness_n_per_m"), t.list("damping_ns_per_m"));
    let travel = t.number("travel_m");
    let at = if t.has(rest) { t.numbers::<3>(rest) } else { Some([0.0; 3]) };
    let path = t.path_of("");
    // What could be read is checked even when something else is missing; substitutes are sound.
    let (kk, dd) = (k.clone(), d.clone());
    let substitute = || vec![0.0; kk.as_ref().or(dd.as_ref()).map_or(2, Vec::len)];
    let v = Values {
        mass: mass.unwrap_or(1.0),
        length: 0.0,
        rest: Vector3::from(at.unwrap_or_default()),
        k: k.clone().unwrap_or_else(substitute),
        d: d.clone().unwrap_or_else(substitute),
        travel: travel.unwrap_or(1.0),
    };
    values(&v, Axes::Shift, &path, t.problems());
    (mass.is_some() && k.is_some() && d.is_some() && travel.is_some() && at.is_some()).then_some(v)
}

/// The keys of a pendulum.
pub(crate) fn read_pendulum(t: &mut Keys<'_, '_>) -> Option<Values> {
    let (mass, length) = (t.number("mass_kg"), t.number("length_m"));
    let (k, d) = (t.numbers::<2>("stiffness_nm_per_rad"), t.numbers::<2>("damping_nms_per_rad"));
    let path = t.path_of("");
    let v = Values {
        mass: mass.unwrap_or(1.0),
        length: length.unwrap_or(1.0),
        rest: Vector3::zeros(),
        k: k.unwrap_or_default().to_vec(),
        d: d.unwrap_or_default().to_vec(),
        travel: 0.0,
    };
    values(&v, Axes::Swing, &path, t.problems());
    (mass.is_some() && length.is_some() && k.is_some() && d.is_some()).then_some(v)
}
