//! From the table of a mission file to a tank.

use crate::check::{read_pendulum, read_springs};
use crate::geometry::{SloshMode, Tank, TankModel};
use crate::tank::{FixedFuel, SloshPart, SloshTank};
use ff_model::keys;
use ff_model::keys::Keys;
use ff_model::{Area, DynAppendage, Problem, Problems};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Builds a [`SloshTank`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// **By masses.** `modes`: an array of tables, each with `type = "pendulum"` and the keys of the kind `slosh_pendulum`,
/// or `type = "spring_mass"` and those of `slosh_spring_mass`; `at_m = [x, y, z]` is its fulcrum or rest position in the
/// mount frame (the origin unless given). `fixed = { mass_kg, com_m, inertia_com_kgm2 }` is the fuel that does not move,
/// both of the last optional.
///
/// **By geometry.** One of `cylinder` and `sphere`, each `{ radius_m, fill_m }`; the mount is the lowest point of the tank
/// on its axis, `+z` the direction of settling acceleration. `density_kg_per_m3`; `slosh_modes` (default 1);
/// `model = "pendulum"` (default) or `"spring_mass"`; `damping_ratio` of every mode; and what makes the fuel return:
///
/// * `settling_m_per_s2`: a steady axial acceleration, turned into springs of the frequency it gives. Not to be combined
///   with `robot.gravity_m_per_s2` or a thrust that is simulated, which would act twice.
/// * `diaphragm_n_per_m`: the lateral stiffness of a diaphragm, one number per mode.
///
/// `fixed_inertia_com_kgm2` is the inertia of what does not slosh about its centre of mass; a point unless given.
///
/// ```toml
/// [[appendage]]
/// kind = "slosh_tank"
/// name = "tank"
/// host = "base"
/// mount = { xyz_m = [0.9, 0.0, -0.3] }
/// cylinder = { radius_m = 0.45, fill_m = 0.6 }
/// density_kg_per_m3 = 1010.0
/// settling_m_per_s2 = 0.02
/// damping_ratio = 0.01
/// slosh_modes = 2
/// ```
///
/// # Errors
/// Every problem of the table: those of [`ff_model::keys::read`], [`Tank::model`] and [`SloshTank::new`];
/// `Config::Conflict` when the fuel is given in none or several of these ways.
pub fn from_toml(table: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let (fixed, parts) = keys::read(table, |t| {
        let given = ["modes", "cylinder", "sphere"].map(|k| t.has(k));
        match given.iter().filter(|&&g| g).count() {
            1 if given[0] => by_masses(t),
            1 => by_geometry(t, given[1]),
            n => {
                let what = format!("{n} of modes, cylinder and sphere are given, expected one");
                let p = Problem::error(Area::Config, "Config::Conflict", what).on("modes");
                t.accept_unknown();
                t.problems().push(p.hint("give the sloshing masses (modes) or the shape of the tank"));
                None
            }
        }
    })?;
    Ok(SloshTank::new(fixed, &parts)?.into())
}

type Contents = (Option<FixedFuel>, Vec<SloshPart>);

fn by_masses(t: &mut Keys<'_, '_>) -> Option<Contents> {
    let fixed = if t.has("fixed") { t.table("fixed", "a table", fixed).map(Some) } else { Some(None) };
    let parts = t.each("modes", "one table per sloshing mass", |_, t| part(t))?;
    Some((fixed?, parts))
}

fn fixed(t: &mut Keys<'_, '_>) -> Option<FixedFuel> {
    let mass = t.number("mass_kg");
    let com = if t.has("com_m") { t.numbers::<3>("com_m") } else { Some([0.0; 3]) };
    let inertia = inertia(t, "inertia_com_kgm2");
    Some(FixedFuel { mass: mass?, com: Vector3::from(com?), inertia_com: inertia? })
}

fn inertia(t: &mut Keys<'_, '_>, key: &'static str) -> Option<Matrix3<f64>> {
    if t.has(key) { t.symmetric(key) } else { Some(Matrix3::zeros()) }
}

fn part(t: &mut Keys<'_, '_>) -> Option<SloshPart> {
    let Some(kind) = t.choice("type", &["pendulum", "spring_mass"], None) else {
        t.accept_unknown();
        return None;
    };
    if kind == "pendulum" {
        let at = if t.has("at_m") { t.numbers::<3>("at_m") } else { Some([0.0; 3]) };
        let v = read_pendulum(t)?;
        let (k, d) = (<[f64; 2]>::try_from(v.k).ok()?, <[f64; 2]>::try_from(v.d).ok()?);
        Some(SloshPart::Pendulum { mass: v.mass, length: v.length, fulcrum: Vector3::from(at?), k, d })
    } else {
        let v = read_springs(t, "at_m")?;
        Some(SloshPart::SpringMass { mass: v.mass, rest: v.rest, k: v.k, d: v.d, travel: v.travel })
    }
}

fn by_geometry(t: &mut Keys<'_, '_>, cylinder: bool) -> Option<Contents> {
    let name = if cylinder { "cylinder" } else { "sphere" };
    let size = t.table(name, "a table with radius_m and fill_m", |t| {
        let (r, h) = (t.number("radius_m"), t.number("fill_m"));
        Some((r?, h?))
    });
    let (density, count, zeta) =
        (t.number("density_kg_per_m3"), t.number_or("slosh_modes", 1.0), t.number("damping_ratio"));
    let pendulum = t.choice("model", &["pendulum", "spring_mass"], Some("pendulum")).map(|m| m == "pendulum");
    let inertia = inertia(t, "fixed_inertia_com_kgm2");
    let spring = restoring(t);
    let zeta = zeta.filter(|&z| not_negative(t, "damping_ratio", z));
    let ((radius, fill), density, count) = (size?, density?, count?);
    if count.fract() != 0.0 || count < 0.0 {
        let p = Problem::error(Area::Config, "Config::Type", format!("is {count}, expected a whole number"));
        t.problems().push(p.on("slosh_modes").hint("give the number of modes"));
        return None;
    }
    let tank = if cylinder { Tank::Cylinder { radius, fill } } else { Tank::Sphere { radius, fill } };
    let model = match tank.model(density, count as usize) {
        Ok(m) => m,
        Err(problems) => {
            for mut p in problems.0 {
                // The two lengths stand in the table of the shape.
                if let Some(o) = p.object.take_if(|o| o.ends_with("_m")) {
                    p.object = Some(format!("{name}.{o}"));
                }
                t.problems().push(p);
            }
            return None;
        }
    };
    contents(t, &model, tank.radius(), &spring?, zeta?, pendulum?, inertia?)
}

/// What makes the fuel return to rest.
enum Restoring {
    Settling(f64),
    Diaphragm(Vec<f64>),
}

fn restoring(t: &mut Keys<'_, '_>) -> Option<Restoring> {
    match (t.has("settling_m_per_s2"), t.has("diaphragm_n_per_m")) {
        (true, false) => {
            let a = t.number("settling_m_per_s2")?;
            not_negative(t, "settling_m_per_s2", a).then_some(Restoring::Settling(a))
        }
        (false, true) => t.list("diaphragm_n_per_m").map(Restoring::Diaphragm),
        (both, _) => {
            let what = if both { "both are given" } else { "nothing makes the fuel return to rest" };
            let p = Problem::error(Area::Config, "Config::Conflict", what).on("settling_m_per_s2");
            t.problems().push(p.hint("give settling_m_per_s2 (0 for fuel that floats freely) or diaphragm_n_per_m"));
            None
        }
    }
}

fn not_negative(t: &mut Keys<'_, '_>, key: &str, x: f64) -> bool {
    // `check_damping` says "would feed energy" of both: a negative settling acceleration turns the pendulum over.
    let found = keys::check_damping(&t.path_of(key), x);
    let good = found.is_none();
    t.problems().0.extend(found);
    good
}

/// Springs and dampers for the modes of a tank.
fn contents(
    t: &mut Keys<'_, '_>,
    model: &TankModel,
    radius: f64,
    spring: &Restoring,
    zeta: f64,
    pendulum: bool,
    inertia: Matrix3<f64>,
) -> Option<Contents> {
    if let Restoring::Diaphragm(k) = spring
        && k.len() != model.modes.len()
    {
        let what = format!("{} numbers for {} modes", k.len(), model.modes.len());
        let p = Problem::error(Area::Config, "Config::WrongLength", what).on("diaphragm_n_per_m");
        t.problems().push(p.hint("give one stiffness per mode"));
        return None;
    }
    if let Restoring::Diaphragm(k) = spring {
        let bad: Vec<_> =
            (0..).zip(k).filter_map(|(i, &x)| keys::check_stiffness(&format!("diaphragm_n_per_m[{i}]"), x)).collect();
        if !bad.is_empty() {
            t.problems().0.extend(bad);
            return None;
        }
    }
    let parts = model.modes.iter().enumerate().map(|(i, m)| {
        let k = match spring {
            Restoring::Settling(a) => m.stiffness(*a),
            Restoring::Diaphragm(k) => k[i],
        };
        sloshing(m, k, zeta, radius, pendulum)
    });
    let com = Vector3::new(0.0, 0.0, model.fixed_height);
    Some((Some(FixedFuel { mass: model.fixed_mass, com, inertia_com: inertia }), parts.collect()))
}

/// One mode with lateral stiffness `k` (N/m) and damping ratio `zeta`: `d = 2 zeta sqrt(k m)`; times `L^2` about a
/// fulcrum.
fn sloshing(m: &SloshMode, k: f64, zeta: f64, radius: f64, pendulum: bool) -> SloshPart {
    let d = 2.0 * zeta * (k * m.mass).sqrt();
    if pendulum {
        let l2 = m.length * m.length;
        let fulcrum = Vector3::new(0.0, 0.0, m.fulcrum());
        SloshPart::Pendulum { mass: m.mass, length: m.length, fulcrum, k: [k * l2; 2], d: [d * l2; 2] }
    } else {
        let rest = Vector3::new(0.0, 0.0, m.height);
        SloshPart::SpringMass { mass: m.mass, rest, k: vec![k; 2], d: vec![d; 2], travel: radius }
    }
}
