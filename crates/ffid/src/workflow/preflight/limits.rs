//! Margins to every limit, and what they rest on.

use super::question::Question;
use excitation::Trajectory;
use excitation::constraint::Snapshot;
use excitation::plan::LimitError;
use excitation::plan::{LimitReport, Quantity, ROUNDING};
use excitation::{JointLimits, check_for_all_time, check_manoeuvre};
use ff_dynamics::Trace;
use ff_mission::mission::Limits;
use ff_model::{JointKind, Model};
use nalgebra::{DMatrix, Quaternion, Vector4};
use serde::Serialize;

/// How the bound is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Proof {
    /// For every instant: by control polygons, or in closed form.
    AllTime,
    /// At the samples of the record.
    Samples,
}

/// How far the trajectory stays from one limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimitMargin {
    /// What is limited, such as `speed limit`.
    pub what: String,
    /// Of what: the joint, frame or coordinate.
    pub item: String,
    /// SI unit.
    pub unit: String,
    /// Largest (or, for lower limits, least) value.
    pub bound: f64,
    /// The limit.
    pub limit: f64,
    /// Distance left; negative when the limit is broken.
    pub margin: f64,
    /// About when (s).
    pub time_s: f64,
    /// What it rests on.
    pub proof: Proof,
    /// True when the limit is kept.
    pub holds: bool,
}

impl LimitMargin {
    fn new(
        what: impl Into<String>,
        item: &str,
        unit: &str,
        [bound, limit, margin, time_s]: [f64; 4],
        proof: Proof,
    ) -> Self {
        let holds = margin >= -ROUNDING * limit.abs().max(1e-3);
        Self {
            what: what.into(),
            item: item.to_owned(),
            unit: unit.to_owned(),
            bound,
            limit,
            margin,
            time_s,
            proof,
            holds,
        }
    }
    /// Margin relative to its limit.
    pub fn relative(&self) -> f64 {
        self.margin / if self.limit.abs() > 1e-3 { self.limit.abs() } else { 1.0 }
    }
}

/// Limits of the joints: those of the URDF, tightened by the mission's. Allocates.
pub fn joint_limits(model: &Model, most: &Limits) -> Vec<JointLimits> {
    let inf = f64::INFINITY;
    let one = |b: &ff_model::Body| {
        let urdf = JointLimits::from_model(&b.joint.limits, most.acceleration_rad_per_s2.unwrap_or(inf));
        let velocity = urdf.velocity.min(most.velocity_rad_per_s.unwrap_or(inf));
        JointLimits { velocity, jerk: most.jerk_rad_per_s3, ..urdf }
    };
    model.own_bodies().map(one).collect()
}

/// Margins of a trajectory of a file to its joint limits, for all time.
///
/// # Errors
/// [`LimitError`].
pub fn prove(t: &Trajectory, limits: &[JointLimits]) -> Result<LimitReport, LimitError> {
    match t {
        Trajectory::Spline(m) => check_for_all_time(m, limits, REFINE),
        Trajectory::Manoeuvre(_, m) => check_manoeuvre(m, limits),
    }
}

/// Parts of each knot span for the proof: its polygons are then within a few per cent of the curve.
const REFINE: usize = 4;

fn unit(model: &Model, joint: usize, quantity: Quantity) -> String {
    let per = match quantity {
        Quantity::Lower | Quantity::Upper => "",
        Quantity::Velocity => "/s",
        Quantity::Acceleration => "/s^2",
        Quantity::Jerk => "/s^3",
    };
    let angle = model.own_body(joint).joint.kind != JointKind::Prismatic;
    format!("{}{per}", if angle { "rad" } else { "m" })
}

/// Margins of the joints: proven where there is a proof, else at the samples.
pub(super) fn of_joints(q: &Question<'_>, t: &Trace) -> Vec<LimitMargin> {
    let names = q.model.joint_names();
    if let Some(report) = q.proven {
        return report
            .margins
            .iter()
            .map(|m| {
                let numbers = [m.bound, m.limit, m.margin, m.time];
                let unit = unit(q.model, m.joint, m.quantity);
                LimitMargin::new(m.quantity.to_string(), &names[m.joint], &unit, numbers, Proof::AllTime)
            })
            .collect();
    }
    let mut out = Vec::new();
    for (j, l) in joint_limits(q.model, q.limits).iter().enumerate() {
        let mut most = |quantity: Quantity, limit: f64, of: &dyn Fn(usize) -> f64| {
            if !limit.is_finite() {
                return;
            }
            let at = (0..t.len()).max_by(|&a, &b| of(a).total_cmp(&of(b))).unwrap_or(0);
            let lower = quantity == Quantity::Lower;
            let (bound, limit) = if lower { (-of(at), -limit) } else { (of(at), limit) };
            let margin = if lower { bound - limit } else { limit - bound };
            let numbers = [bound, limit, margin, at as f64 * t.dt];
            let unit = unit(q.model, j, quantity);
            out.push(LimitMargin::new(quantity.to_string(), &names[j], &unit, numbers, Proof::Samples));
        };
        most(Quantity::Lower, -l.lower, &|i| -t.q[(i, j)]);
        most(Quantity::Upper, l.upper, &|i| t.q[(i, j)]);
        most(Quantity::Velocity, l.velocity, &|i| t.qd[(i, j)].abs());
        most(Quantity::Acceleration, l.acceleration, &|i| t.qdd[(i, j)].abs());
        // Slope between neighbouring samples: the largest mean jerk of a sample interval.
        let jerk = |i: usize| if i == 0 { 0.0 } else { (t.qdd[(i, j)] - t.qdd[(i - 1, j)]).abs() / t.dt };
        most(Quantity::Jerk, l.jerk.unwrap_or(f64::INFINITY), &jerk);
    }
    out
}

/// Margins to the limits of the whole system, at the samples of the simulation.
pub(super) fn of_system(q: &Question<'_>, t: &Trace) -> Vec<LimitMargin> {
    let mut out = Vec::new();
    let row = |m: &DMatrix<f64>, i: usize| -> Vec<f64> { m.row(i).iter().copied().collect() };
    let quat = |i: usize| Quaternion::new(t.att[(i, 0)], t.att[(i, 1)], t.att[(i, 2)], t.att[(i, 3)]);
    for c in q.constraints {
        let channels = c.channels();
        let mut values = vec![0.0; channels.len()];
        let mut worst: Vec<Option<(f64, f64)>> = vec![None; channels.len()];
        for i in 0..t.len() {
            let time = i as f64 * t.dt;
            let (joints, rates, tau, eta) = (row(&t.q, i), row(&t.qd, i), row(&t.tau, i), row(&t.eta, i));
            let att = quat(0).conjugate() * quat(i);
            values.fill(f64::NAN);
            c.measure(
                &Snapshot {
                    time,
                    q: &joints,
                    qd: &rates,
                    twist: std::array::from_fn(|k| t.twist[(i, k)]),
                    att: Vector4::new(att.w, att.i, att.j, att.k),
                    tau: &tau,
                    eta: &eta,
                },
                &mut values,
            );
            for ((w, v), channel) in worst.iter_mut().zip(&values).zip(channels) {
                if w.is_none_or(|(old, _)| channel.excess(*v) > channel.excess(old)) {
                    *w = Some((*v, time));
                }
            }
        }
        for (w, channel) in worst.iter().zip(channels) {
            let (bound, time) = w.unwrap_or((f64::NAN, 0.0));
            let numbers = [bound, channel.limit, -channel.excess(bound), time];
            out.push(LimitMargin::new(channel.name, &channel.item, channel.unit, numbers, Proof::Samples));
        }
    }
    out
}
