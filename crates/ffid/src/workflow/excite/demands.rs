//! `[limits]` as constraints of the whole system.

use super::error::ExciteError;
use crate::exit::Exit;
use crate::open::Opened;
use excitation::Constraint;
use excitation::constraint::{
    BaseAttitude, BaseRate, Clearance, Cone, ConstraintError, FrameSpeed, HeldSystem, JointTorque, Pairs, PassiveRange,
    Pointing,
};
use ff_mission::mission::{KeepOut, Limits};
use ff_mission::urdf::collision;
use ff_model::diagnostics::nearest;
use ff_model::tree::{Shape, Solid};
use ff_model::{Model, Params, Problems, Xform};
use nalgebra::{Rotation3, Vector3};
use std::path::Path;
use std::sync::Arc;

/// Largest URDF read for its collision shapes (bytes).
const MAX_URDF: usize = 16 << 20;

/// What planned motion must keep to beside the limits of the joints.
#[derive(Default)]
pub struct Demands {
    /// The system that constraints are computed from; none without constraints.
    pub system: Option<Arc<HeldSystem>>,
    /// The constraints.
    pub all: Vec<Box<dyn Constraint>>,
}

impl Demands {
    /// The constraints by reference, as searches and verdicts take them. Allocates.
    pub fn list(&self) -> Vec<&dyn Constraint> {
        self.all.iter().map(AsRef::as_ref).collect()
    }
}

/// The constraints of `[limits]` for a motion that starts at `start`; `file` is the mission file. Allocates.
///
/// # Errors
/// [`ExciteError`] for limits that do not fit the robot, and problems of its collision shapes.
pub fn demands(opened: &Opened, limits: &Limits, start: &[f64], file: &Path) -> Result<Demands, Problems> {
    let asked = [
        limits.torque_nm,
        limits.base_attitude_rad,
        limits.base_rate_rad_per_s,
        limits.end_effector_speed_m_per_s,
        limits.passive_rad,
        limits.passive_m,
        limits.clearance_m,
    ];
    if asked.iter().all(Option::is_none) && limits.pointing.is_empty() {
        return Ok(Demands::default());
    }
    let model = &opened.model;
    let system = HeldSystem::new(model, &Params::nominal(model)).map_err(|e| wrong(&e, "limits"))?;
    let system = Arc::new(system);
    let mut all: Vec<Box<dyn Constraint>> = Vec::new();
    let mut add = |made: Result<Box<dyn Constraint>, ConstraintError>, key: &str| -> Result<(), ExciteError> {
        all.push(made.map_err(|e| wrong(&e, key))?);
        Ok(())
    };
    fn boxed<C: Constraint + 'static>(c: C) -> Box<dyn Constraint> {
        Box::new(c)
    }
    if let Some(l) = limits.torque_nm {
        add(JointTorque::new(&system, start, &vec![l; model.nj()]).map(boxed), "limits.torque_nm")?;
    }
    if let Some(l) = limits.base_attitude_rad {
        add(BaseAttitude::new(&system, start, l).map(boxed), "limits.base_attitude_rad")?;
    }
    if let Some(l) = limits.base_rate_rad_per_s {
        add(BaseRate::new(&system, start, l).map(boxed), "limits.base_rate_rad_per_s")?;
    }
    if let Some(l) = limits.end_effector_speed_m_per_s {
        let key = "limits.end_effector_speed_m_per_s";
        let Some(frame) = opened.end_effector else {
            let hint = "add end_effector = ... to [robot]";
            return Err(ExciteError::new(
                Exit::Config,
                "Config::MissingKey",
                "the mission names no end effector",
                hint,
            )
            .on(key)
            .into());
        };
        add(FrameSpeed::new(&system, &model.frames()[frame].name, l).map(boxed), key)?;
    }
    for (limit, unit, key) in
        [(limits.passive_rad, "rad", "limits.passive_rad"), (limits.passive_m, "m", "limits.passive_m")]
    {
        let Some(l) = limit else { continue };
        if !model.passive_coords().iter().any(|(_, c)| c.unit == unit) {
            let what = format!("no passive coordinate is measured in {unit}");
            return Err(ExciteError::new(Exit::Config, "Config::Excite", what, "remove the key").on(key).into());
        }
        add(PassiveRange::all(&system, start, unit, l).map(boxed), key)?;
    }
    for p in &limits.pointing {
        let cone = match (p.within_rad, p.outside_rad) {
            (Some(a), _) => Cone::Within(a),
            (None, a) => Cone::Outside(a.unwrap_or_default()),
        };
        let (axis, target) = (Vector3::from(p.axis), Vector3::from(p.target));
        add(Pointing::new(&system, start, &p.name, &axis, &target, cone).map(boxed), "limits.pointing")?;
    }
    if let Some(l) = limits.clearance_m {
        for c in clearances(opened, limits, l, file)? {
            add(Ok(boxed(c)), "limits.clearance_m")?;
        }
    }
    Ok(Demands { system: Some(system), all })
}

fn wrong(e: &dyn std::fmt::Display, key: &str) -> ExciteError {
    ExciteError::new(Exit::Config, "Config::Limits", e.to_string(), "correct [limits]").on(key)
}

/// Distances between collision shapes of the URDF, and between them and keep-out capsules.
fn clearances(opened: &Opened, limits: &Limits, least: f64, file: &Path) -> Result<Vec<Clearance>, Problems> {
    let model = &opened.model;
    let key = "limits.clearance_m";
    let urdf = opened.mission.as_ref().map(|m| m.robot.urdf.clone()).unwrap_or_default();
    let path = file.parent().unwrap_or(Path::new("")).join(urdf);
    let text = ff_model::diagnostics::text_file(&path, MAX_URDF)?;
    let (mut solids, _) = collision::from_urdf(&text, model).map_err(|p| p.in_file(&path))?;
    if solids.is_empty() {
        let hint = "give the links <collision> elements: boxes, spheres, cylinders or capsules";
        return Err(ExciteError::new(Exit::Config, "Config::Limits", "the URDF has no collision shapes", hint)
            .on(key)
            .into());
    }
    let zones = limits.keep_out.iter().map(|k| capsule(model, k)).collect::<Result<Vec<_>, _>>()?;
    let mut out = Vec::new();
    match Clearance::new(model, &solids, Pairs::Distant, &[], least) {
        Ok(c) => out.push(c),
        // Shapes on neighbours only have no pair to watch; with zones that is fine.
        Err(ConstraintError::Count { .. }) if !zones.is_empty() => {}
        Err(e) => return Err(wrong(&e, key).into()),
    }
    if !zones.is_empty() {
        let names: Vec<&str> = limits.keep_out.iter().map(|k| k.name.as_str()).collect();
        solids.extend(zones);
        // Zones may overlap one another.
        let ignored: Vec<(&str, &str)> = names.iter().flat_map(|a| names.iter().map(move |b| (*a, *b))).collect();
        out.push(
            Clearance::new(model, &solids, Pairs::With(&names), &ignored, least)
                .map_err(|e| wrong(&e, "limits.keep_out"))?,
        );
    }
    Ok(out)
}

/// A keep-out capsule as a solid on its link.
fn capsule(model: &Model, k: &KeepOut) -> Result<Solid, ExciteError> {
    let Some(frame) = model.frame(&k.host) else {
        let names = || model.frames().iter().map(|f| f.name.as_str());
        let hint = match nearest(&k.host, names()) {
            Some(n) => format!("did you mean {n}?"),
            None => format!("links: {}", ff_model::diagnostics::list(names(), 12)),
        };
        let what = format!("the robot has no link '{}'", ff_model::diagnostics::clip(&k.host));
        return Err(ExciteError::new(Exit::Config, "Config::UnknownFrame", what, hint)
            .on(format!("limits.keep_out, {}", k.name)));
    };
    let (a, b) = (Vector3::from(k.from_m), Vector3::from(k.to_m));
    let along = b - a;
    let length = along.norm();
    // A capsule of no length is a ball; its shape has a direction all the same.
    let turn = Rotation3::rotation_between(&Vector3::z(), &along).unwrap_or_else(|| {
        Rotation3::from_axis_angle(&Vector3::x_axis(), if along.z < 0.0 { std::f64::consts::PI } else { 0.0 })
    });
    let own = Xform::new(turn.into_inner(), 0.5 * (a + b));
    let shape =
        if length > 0.0 { Shape::Capsule { radius: k.radius_m, length } } else { Shape::Sphere { radius: k.radius_m } };
    Ok(Solid { name: k.name.clone(), body: frame.body, placement: frame.placement * own, shape })
}
