//! Self-collision and keep-out zones: signed distance between solids on the bodies, by parry.
//!
//! The distance of two solids is `d = n . (p_2 - p_1)` with the closest points (deepest ones when they overlap, then `d
//! < 0`) and the unit normal from the first to the second. To first order only the motion of the two points along `n`
//! changes it, so with `J_l(p)` the velocity of the body point `p` per unit of joint rate `l`, `dd/dq_l = n .
//! (J_l(p_2) - J_l(p_1))`, exact wherever closest points are unique. Between parallel faces or axes they are not, and
//! the derivative is one of many.
//!
//! A capsule is its axis with a radius: distances between axes are closed formulas, and the iteration of Gilbert,
//! Johnson and Keerthi, which needs many steps on round shapes, meets polyhedra and cylinders only.

use super::base::direction;
use super::signal::Signal;
use super::{Channel, ConstraintError, Sense, Snapshot, check_limit};
use ff_model::tree::{Shape, Solid};
use ff_model::{JointKind, Model, Xform};
use nalgebra::{DMatrix, Matrix3, Rotation3, Unit, Vector3};
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::closest_points::closest_points_segment_segment_with_locations;
use parry3d_f64::query::contact;
use parry3d_f64::shape::{Ball, Cuboid, Cylinder, Segment, Shape as Convex};
use std::sync::Arc;

/// Excesses are relative to the clearance, or to this where it is smaller (m).
const SCALE: f64 = 0.05;
/// Farther than this, solids are as good as infinitely far (m).
const FAR: f64 = 1e6;

/// The distance of every watched pair of solids is at least the clearance (m).
#[derive(Clone)]
pub struct Clearance {
    model: Model,
    solids: Vec<Solid>,
    shapes: Vec<Core>,
    pairs: Vec<(usize, usize)>,
    channels: Vec<Channel>,
}

/// Which pairs of solids are watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairs<'a> {
    /// All on different bodies, unless one body carries the other by one joint: neighbours touch at the joint.
    Distant,
    /// Those on different bodies of which at least one is named here: keep-out zones.
    With(&'a [&'a str]),
}

impl Clearance {
    /// Watches `pairs` of `solids`, except those whose names are in `ignored`. Solids on the base are keep-out zones of the
    /// arm. Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`]: a clearance that is not positive, a solid on a body that does not exist or with a size that is
    /// not positive, no pair to watch.
    pub fn new(
        model: &Model,
        solids: &[Solid],
        pairs: Pairs<'_>,
        ignored: &[(&str, &str)],
        clearance: f64,
    ) -> Result<Self, ConstraintError> {
        check_limit("clearance", clearance, "m")?;
        for s in solids {
            if s.body >= model.n_bodies() {
                let known = (0..model.n_bodies()).map(|i| model.body_name(i)).collect::<Vec<_>>().join(", ");
                return Err(ConstraintError::Unknown {
                    kind: "body",
                    name: format!("{} of solid {}", s.body, s.name),
                    known,
                });
            }
            for size in s.shape.sizes() {
                check_limit(&format!("size of solid {}", s.name), size, "m")?;
            }
        }
        let adjacent = |a: usize, b: usize| {
            let parent = |i: usize| i.checked_sub(1).map(|i| model.bodies()[i].parent);
            parent(a) == Some(b) || parent(b) == Some(a)
        };
        let watched = |i: usize, j: usize| {
            let (a, b) = (&solids[i], &solids[j]);
            let named = |x: &str, y: &str| (a.name == x && b.name == y) || (a.name == y && b.name == x);
            a.body != b.body
                && !ignored.iter().any(|(x, y)| named(x, y))
                && match pairs {
                    Pairs::Distant => !adjacent(a.body, b.body),
                    Pairs::With(names) => names.contains(&a.name.as_str()) || names.contains(&b.name.as_str()),
                }
        };
        let all = (0..solids.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let pairs: Vec<(usize, usize)> = all.filter(|&(i, j)| watched(i, j)).collect();
        if pairs.is_empty() {
            return Err(ConstraintError::Count { what: "pairs of solids", got: 0, want: 1 });
        }
        let channels = pairs
            .iter()
            .map(|&(i, j)| Channel {
                sense: Sense::AtLeast,
                scale: clearance.max(SCALE),
                ..Channel::at_most("clearance", format!("{} - {}", solids[i].name, solids[j].name), "m", clearance)
            })
            .collect();
        Ok(Self {
            model: model.clone(),
            shapes: solids.iter().map(shape).collect(),
            solids: solids.to_vec(),
            pairs,
            channels,
        })
    }
    /// Poses of the bodies in the base, and the axis and kind of every joint.
    fn place(&self, q: &[f64]) -> Vec<Xform<f64>> {
        let mut poses = vec![Xform::identity(); self.model.n_bodies()];
        for (l, b) in self.model.bodies().iter().enumerate() {
            let (joint, axis, of) = (&b.joint, b.joint.axis, self.model.coordinate(l));
            let q = of.multiplier * q[of.index] + of.offset;
            let moved = match joint.kind {
                JointKind::Prismatic => Xform::new(Matrix3::identity(), axis * q),
                _ => {
                    let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), q);
                    Xform::new(turn.into_inner(), Vector3::zeros())
                }
            };
            poses[l + 1] = poses[b.parent] * joint.placement * moved;
        }
        poses
    }
    /// Distance of a pair, the normal, and the closest points in base axes. NaN where parry finds none.
    fn distance(&self, poses: &[Xform<f64>], (i, j): (usize, usize)) -> (f64, Vector3<f64>, [Vector3<f64>; 2]) {
        let at = |k: usize| pose(&(poses[self.solids[k].body] * self.solids[k].placement)) * self.shapes[k].turn;
        let (a, b) = (&self.shapes[i], &self.shapes[j]);
        if let (Some((s1, r1)), Some((s2, r2))) = (a.axis, b.axis) {
            let (s1, s2) = (s1.transformed(&at(i)), s2.transformed(&at(j)));
            let (l1, l2) = closest_points_segment_segment_with_locations(&Pose::identity(), &s1, &s2);
            let (p1, p2) = (vector(s1.point_at(&l1)), vector(s2.point_at(&l2)));
            let n = direction(&(p2 - p1));
            return ((p2 - p1).norm() - r1 - r2, n, [p1, p2]);
        }
        let margin = a.margin + b.margin;
        match contact(&at(i), &*a.core, &at(j), &*b.core, FAR) {
            Ok(Some(c)) => (c.dist - margin, vector(c.normal1), [vector(c.point1), vector(c.point2)]),
            _ => (f64::NAN, Vector3::zeros(), [Vector3::zeros(); 2]),
        }
    }
    /// Adds to `row` what moves with `body` at `point`: `sign n . J_l(point)`.
    fn pull(&self, poses: &[Xform<f64>], body: usize, point: &Vector3<f64>, force: &Vector3<f64>, row: &mut [f64]) {
        let mut i = body;
        while i > 0 {
            let b = &self.model.bodies()[i - 1];
            let axis = poses[i].rot * b.joint.axis;
            let of = self.model.coordinate(i - 1);
            row[of.index] += of.multiplier
                * match b.joint.kind {
                    JointKind::Prismatic => force.dot(&axis),
                    _ => force.dot(&axis.cross(&(point - poses[i].pos))),
                };
            i = b.parent;
        }
    }
}

impl std::fmt::Debug for Clearance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Clearance").field("solids", &self.solids).field("pairs", &self.pairs).finish_non_exhaustive()
    }
}

fn vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn pose(x: &Xform<f64>) -> Pose {
    let q = ff_model::spatial::so3::rot_to_quat(&x.rot);
    let p = x.pos;
    Pose::from_parts(Vector::new(p.x, p.y, p.z), Rotation::from_xyzw(q[1], q[2], q[3], q[0]))
}

/// A shape for parry.
#[derive(Clone)]
struct Core {
    /// What parry sees, and the radius around it.
    core: Arc<dyn Convex>,
    margin: f64,
    /// Pose in the frame of the solid: parry's cylinder stands along y, ours along z.
    turn: Pose,
    /// Axis and radius of capsules; spheres are capsules of length zero.
    axis: Option<(Segment, f64)>,
}

fn shape(s: &Solid) -> Core {
    let turn = Pose::identity();
    let axis = |half: f64| Segment::new(Vector::new(0.0, 0.0, -half), Vector::new(0.0, 0.0, half));
    match s.shape {
        Shape::Sphere { radius } => {
            Core { core: Arc::new(Ball::new(radius)), margin: 0.0, turn, axis: Some((axis(0.0), radius)) }
        }
        Shape::Box { size: [a, b, c] } => {
            let half = Vector::new(0.5 * a, 0.5 * b, 0.5 * c);
            Core { core: Arc::new(Cuboid::new(half)), margin: 0.0, turn, axis: None }
        }
        Shape::Capsule { radius, length } => {
            let line = axis(0.5 * length);
            Core { core: Arc::new(line), margin: radius, turn, axis: Some((line, radius)) }
        }
        Shape::Cylinder { radius, length } => {
            let turn = Pose::from_parts(Vector::ZERO, Rotation::from_rotation_x(std::f64::consts::FRAC_PI_2));
            Core { core: Arc::new(Cylinder::new(0.5 * length, radius)), margin: 0.0, turn, axis: None }
        }
    }
}

impl Signal for Clearance {
    type Work = ();
    fn channels(&self) -> &[Channel] {
        &self.channels
    }
    fn work(&self) {}
    fn drive(&self, _w: &mut (), s: [&[f64]; 3], u: &mut [f64], mut partials: Option<&mut DMatrix<f64>>) {
        let poses = self.place(s[0]);
        let mut row = vec![0.0; self.model.nj()];
        for (c, &(i, j)) in self.pairs.iter().enumerate() {
            let (d, n, [a, b]) = self.distance(&poses, (i, j));
            u[c] = d;
            if let Some(out) = partials.as_mut() {
                row.fill(0.0);
                self.pull(&poses, self.solids[i].body, &a, &-n, &mut row);
                self.pull(&poses, self.solids[j].body, &b, &n, &mut row);
                (0..out.ncols()).for_each(|k| out[(c, k)] = row.get(k).copied().unwrap_or(0.0));
            }
        }
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        let poses = self.place(at.q);
        self.pairs.iter().zip(out).for_each(|(&p, o)| *o = self.distance(&poses, p).0);
    }
}
