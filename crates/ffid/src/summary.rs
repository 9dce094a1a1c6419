//! What a model is, as plain data: for `ffid check`, as text and as JSON.

use ff_model::{Model, ParamDecl};
use serde::Serialize;
use std::fmt;

/// A model at a glance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the robot.
    pub name: String,
    /// `floating` or `fixed`.
    pub base: &'static str,
    /// Mass of everything at nominal parameters (kg).
    pub total_mass_kg: f64,
    /// Degrees of freedom: base, joints, passive coordinates.
    pub dof: [usize; 3],
    /// Bodies, the base first.
    pub bodies: Vec<Body>,
    /// Joints in order.
    pub joints: Vec<Joint>,
    /// Appendages in order.
    pub appendages: Vec<Appendage>,
    /// All parameters in the order of the parameter vector.
    pub parameters: Vec<Parameter>,
}

/// A body of a [`Summary`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Body {
    /// Name of its link.
    pub name: String,
    /// Name of the parent body; none for the base.
    pub parent: Option<String>,
    /// Mass, merged links and rigid additions included (kg).
    pub mass_kg: f64,
    /// Centre of mass in the body frame (m); none without mass.
    pub com_m: Option<[f64; 3]>,
}

/// A joint of a [`Summary`]. Limits are absent where there is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// `revolute`, `continuous` or `prismatic`.
    pub kind: String,
    /// Unit axis in the joint frame.
    pub axis: [f64; 3],
    /// Lower position limit (rad or m).
    pub lower: Option<f64>,
    /// Upper position limit (rad or m).
    pub upper: Option<f64>,
    /// Greatest speed (rad/s or m/s).
    pub velocity: Option<f64>,
    /// Greatest torque or force (N m or N).
    pub effort: Option<f64>,
    /// What it follows; absent for a joint that moves by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub follows: Option<Follows>,
}

/// A joint that stands at `multiplier q(joint) + offset` ([`ff_model::Model::couple`]).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Follows {
    /// The joint that it follows, which moves by itself.
    pub joint: String,
    /// Motion per motion of that joint (1, rad/m, m/rad).
    pub multiplier: f64,
    /// Position where that joint is at zero (rad or m).
    pub offset: f64,
}

/// An appendage of a [`Summary`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Appendage {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: &'static str,
    /// Name of the body that carries it.
    pub host: String,
    /// Names of its coordinates.
    pub coordinates: Vec<String>,
}

/// A parameter of a [`Summary`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Full name, such as `panel_left.k[0]`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Nominal value.
    pub nominal: f64,
    /// True when the mission asks for an estimate of it.
    pub estimated: bool,
}

impl Summary {
    /// Summarises a model; `estimated` holds indices into its parameter vector.
    pub fn new(m: &Model, estimated: &[usize]) -> Self {
        // JSON has no infinity; an absent limit is no limit.
        let limit = |x: f64| x.is_finite().then_some(x);
        let body = |i: usize| Body {
            name: m.body_name(i).to_owned(),
            parent: (i > 0).then(|| m.body_name(m.bodies()[i - 1].parent).to_owned()),
            mass_kg: m.inertia(i).mass,
            com_m: m.inertia(i).com().map(Into::into),
        };
        let follows = |i: usize| {
            let c = m.coordinate(i);
            let driver = &m.own_body(c.index).joint.name;
            let own = *driver == m.bodies()[i].joint.name;
            (!own).then(|| Follows { joint: driver.clone(), multiplier: c.multiplier, offset: c.offset })
        };
        let joint = |(i, b): (usize, &ff_model::Body)| Joint {
            name: b.joint.name.clone(),
            kind: format!("{:?}", b.joint.kind).to_lowercase(),
            axis: b.joint.axis.into(),
            lower: limit(b.joint.limits.lower),
            upper: limit(b.joint.limits.upper),
            velocity: limit(b.joint.limits.velocity),
            effort: limit(b.joint.limits.effort),
            follows: follows(i),
        };
        let appendage = |a: &ff_model::tree::Mounted| Appendage {
            name: a.name.clone(),
            kind: a.decl().kind,
            host: m.body_name(a.host).to_owned(),
            coordinates: a.decl().coords.iter().map(|c| c.name.clone()).collect(),
        };
        let parameter = |(i, p): (usize, ParamDecl)| Parameter {
            name: p.name,
            unit: p.unit,
            nominal: p.nominal,
            estimated: estimated.binary_search(&i).is_ok(),
        };
        Self {
            name: m.name().to_owned(),
            base: if m.nb() == 6 { "floating" } else { "fixed" },
            total_mass_kg: m.total_mass(),
            dof: [m.nb(), m.nj(), m.np()],
            bodies: (0..m.n_bodies()).map(body).collect(),
            joints: m.bodies().iter().enumerate().map(joint).collect(),
            appendages: m.appendages().iter().map(appendage).collect(),
            parameters: m.param_decls().into_iter().enumerate().map(parameter).collect(),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [nb, nj, np] = self.dof;
        let width = |n: usize, w: usize| n.max(w);
        let w = self.bodies.iter().map(|b| b.name.chars().count()).fold(8, width);
        writeln!(f, "{}: {} base, {:.3} kg", self.name, self.base, self.total_mass_kg)?;
        writeln!(f, "degrees of freedom: {} (base {nb}, joints {nj}, passive {np})", nb + nj + np)?;
        writeln!(f, "\nbodies ({})", self.bodies.len())?;
        for b in &self.bodies {
            write!(f, "  {:w$} {:>12.3} kg", b.name, b.mass_kg)?;
            match b.com_m {
                Some([x, y, z]) => write!(f, "  centre of mass [{x:.4}, {y:.4}, {z:.4}] m")?,
                None => write!(f, "  massless")?,
            }
            match &b.parent {
                Some(p) => writeln!(f, "  on {p}")?,
                None => writeln!(f)?,
            }
        }
        writeln!(f, "\njoints ({})", self.joints.len())?;
        let w = self.joints.iter().map(|j| j.name.chars().count()).fold(8, width);
        for j in &self.joints {
            let [x, y, z] = j.axis;
            write!(f, "  {:w$} {:10} axis [{x:.3}, {y:.3}, {z:.3}]", j.name, j.kind)?;
            let unit = if j.kind == "prismatic" { "m" } else { "rad" };
            match (&j.follows, j.lower, j.upper) {
                (Some(Follows { joint, multiplier, offset }), ..) => {
                    writeln!(
                        f,
                        "  {multiplier} {joint} {} {} {unit}",
                        if *offset < 0.0 { '-' } else { '+' },
                        offset.abs()
                    )?;
                }
                (None, Some(lo), Some(up)) => writeln!(f, "  {lo} .. {up} {unit}")?,
                _ => writeln!(f, "  no limits")?,
            }
        }
        writeln!(f, "\nappendages ({})", self.appendages.len())?;
        for a in &self.appendages {
            writeln!(f, "  {} ({}) on {}: {}", a.name, a.kind, a.host, a.coordinates.join(", "))?;
        }
        let chosen = self.parameters.iter().filter(|p| p.estimated).count();
        writeln!(f, "\nparameters ({}, of which {chosen} to estimate, marked *)", self.parameters.len())?;
        let w = self.parameters.iter().map(|p| p.name.chars().count()).fold(8, width);
        for p in &self.parameters {
            let mark = if p.estimated { '*' } else { ' ' };
            writeln!(f, "{mark} {:w$} {:>14.6} {}", p.name, p.nominal, p.unit)?;
        }
        Ok(())
    }
}
