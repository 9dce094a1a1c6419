//! What a mission is not sure of, drawn from what it says and put into a world: errors of sensors into the readings, of bodies and placements
//! into the mission that the readings are identified with.

use crate::study::verdict::world::Readings;
use anyhow::{Context, bail};
use ff_model::{Inertia, Kinematics, Model};
use ffid::workflow::identify::{DeclaredUnknown, UncertainKind};
use nalgebra::{Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;

/// Draws of a body before a world is given up: an inertia that no body has is drawn again.
const TRIES: usize = 1000;

/// Draws every one of `unknowns` and puts it in.
///
/// # Errors
/// An unknown that this study does not know how to put in; a body that no draw gives.
pub(super) fn apply(
    unknowns: &[DeclaredUnknown],
    to: &mut Readings,
    model: &mut Model,
    rng: &mut ChaCha8Rng,
) -> anyhow::Result<()> {
    let joints = model.joint_names();
    let column = |name: &str| joints.iter().position(|j| j == name).with_context(|| format!("no joint {name}"));
    let axis = |name: &str| ["x", "y", "z"].iter().position(|a| *a == name).with_context(|| format!("no axis {name}"));
    let mut turn = Vector3::zeros();
    let mut placed = vec![0.0; model.n_kinematic_params()];
    let mut bodies: BTreeMap<&str, Vec<&DeclaredUnknown>> = BTreeMap::new();
    for u in unknowns {
        let parts: Vec<&str> = u.name.split('.').collect();
        let z: f64 = StandardNormal.sample(rng);
        let e = u.std * z;
        match u.kind {
            UncertainKind::TorqueGains => match parts[2..] {
                [] => to.tau *= 1.0 + e,
                [joint, ..] => to.tau.column_mut(column(joint)?).scale_mut(1.0 + e),
            },
            UncertainKind::GyroScale => to.gyro.column_mut(axis(parts[2])?).scale_mut(1.0 + e),
            UncertainKind::GyroAlignment => turn[axis(parts[2])?] = e,
            UncertainKind::EncoderOffsets => to.q.column_mut(column(parts[0])?).add_scalar_mut(e),
            UncertainKind::Mounts | UncertainKind::Joints => {
                placed[model.kinematic_index(&u.name).with_context(|| format!("no placement {}", u.name))?] = e;
            }
            UncertainKind::Parameters => {
                let decls = model.param_decls();
                let at = decls.iter().position(|d| d.name == u.name);
                let at = at.with_context(|| format!("no parameter {}", u.name))?;
                model.set_nominal(&[(at, decls[at].nominal + e)])?;
            }
            UncertainKind::Changes | UncertainKind::BiasWalks => {
                bail!("{}: the worlds of this study have one record", u.name)
            }
            UncertainKind::JointTerms | UncertainKind::DriveGains => {
                bail!("{}: the worlds of this study read torques behind the gears", u.name)
            }
            UncertainKind::Masses | UncertainKind::CentresOfMass | UncertainKind::Inertias => {
                let of = u.name.strip_prefix("error.").and_then(|n| n.rsplit_once('.'));
                bodies.entry(of.with_context(|| u.name.clone())?.0).or_default().push(u);
            }
        }
    }
    to.turn_gyro(&Rotation3::from_scaled_axis(turn));
    for (body, errors) in bodies {
        reweigh(body, &errors, model, rng)?;
    }
    *model = model.displaced(&Kinematics::from_values(model, placed));
    Ok(())
}

/// Draws mass, centre of mass and inertia of one body, until they and their opposites are those of some body: of the flat segments of a wing,
/// which lie next to the edge of what can exist, those that are bodies alone would be drawn with means of their own, up to half a deviation,
/// where the mission says that its errors have none.
fn reweigh(body: &str, errors: &[&DeclaredUnknown], model: &mut Model, rng: &mut ChaCha8Rng) -> anyhow::Result<()> {
    let decls = model.param_decls();
    let first = decls.iter().position(|d| d.name == format!("{body}.mass"));
    let first = first.with_context(|| format!("no body {body}"))?;
    let before: [f64; 10] = std::array::from_fn(|k| decls[first + k].nominal);
    for _ in 0..TRIES {
        let drawn: Vec<f64> =
            errors.iter().map(|u| u.std * Distribution::<f64>::sample(&StandardNormal, rng)).collect();
        let opposite: Vec<f64> = drawn.iter().map(|e| -e).collect();
        let (Some(ten), Some(_)) = (moved(&before, errors, &drawn)?, moved(&before, errors, &opposite)?) else {
            continue;
        };
        let values: Vec<(usize, f64)> = ten.iter().enumerate().map(|(k, &x)| (first + k, x)).collect();
        if model.set_nominal(&values).is_ok() {
            return Ok(());
        }
    }
    bail!("{body}: no draw of {TRIES} is a body; its deviations are too wide")
}

/// A body with errors; none where no body is like this.
fn moved(ten: &[f64; 10], errors: &[&DeclaredUnknown], by: &[f64]) -> anyhow::Result<Option<[f64; 10]>> {
    let before = Inertia::from_params(ten);
    let (mut mass, mut c) = (ten[0], before.com().context("a body has no mass")?);
    let mut i = before.about_com();
    let place = |a: char| "xyz".find(a).unwrap_or(0);
    for (u, e) in errors.iter().zip(by) {
        match u.name.rsplit_once('.').map_or("", |n| n.1).split_once('_') {
            None => {
                mass += e;
                // A heavier body of the same shape.
                i *= (ten[0] + e) / ten[0];
            }
            Some(("com", a)) => c[place(a.chars().next().unwrap_or('x'))] += e,
            Some(("i", ab)) => {
                let mut ab = ab.chars().map(place);
                let (a, b) = (ab.next().unwrap_or(0), ab.next().unwrap_or(0));
                i[(a, b)] += e;
                if a != b {
                    i[(b, a)] += e;
                }
            }
            Some(_) => bail!("{} is no error of a body", u.name),
        }
    }
    let moved = Inertia::from_com(mass, &c, &i);
    Ok((mass > 0.0 && moved.pseudo().cholesky().is_some()).then(|| moved.to_params()))
}
