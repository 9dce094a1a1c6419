//! A robot as a drawing: for paper, and where there are no scripts.

use super::mesh::Mesh;
use super::node::{Form, Moves, Node, Pose, Role};
use super::scene::Scene;
use crate::page::escape;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;
use std::fmt::Write;

/// From where it is seen, world axes: the first camera of the page.
const EYE: [f64; 3] = [0.62, -0.66, 0.42];
/// Where the light is.
const LIGHT: [f64; 3] = [0.3, -0.5, 0.8];
/// Size of the drawing and the room around the robot (px).
const SIZE: (f64, f64) = (960.0, 520.0);
const EDGE: f64 = 40.0;
/// Width of a letter and height of a line of a name (px).
const LETTER: f64 = 9.0;
const LINE: f64 = 17.0;
/// Corners of a circle.
const ROUND: usize = 24;

/// A piece of a drawing, in axes of the view: to the right, up, towards the eye.
enum Piece {
    Face(Vec<Point3<f64>>, [f64; 3]),
    /// `true`: what is inside of a body, and seen through it.
    Ball(Point3<f64>, f64, [f64; 3], bool),
    Line([Point3<f64>; 2], [f64; 3]),
}

impl Piece {
    fn depth(&self) -> f64 {
        match self {
            Self::Face(c, _) => c.iter().map(|p| p.z).sum::<f64>() / c.len() as f64,
            Self::Ball(.., true) => f64::INFINITY,
            Self::Ball(p, ..) => p.z,
            // Before what it is drawn on.
            Self::Line([a, b], _) => a.z.max(b.z) + 0.05,
        }
    }
}

/// Colour of a role, red, green, blue of 0 to 1, as on the page.
fn colour(role: Role) -> [f64; 3] {
    match role {
        Role::Link | Role::Rod | Role::Inertia => [0.49, 0.545, 0.6],
        Role::Panel => [0.0, 0.447, 0.698],
        Role::Fuel => [0.902, 0.624, 0.0],
        Role::Joint => [0.8, 0.475, 0.655],
        Role::Gyro | Role::Mount => [0.2, 0.2, 0.2],
    }
}

fn isometry(p: &Pose) -> Isometry3<f64> {
    let [x, y, z, w] = p.r;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(p.p)), turn)
}

/// Poses of all nodes with joints at the pose of the scene and springs relaxed.
pub(super) fn placed(s: &Scene) -> Vec<Isometry3<f64>> {
    let mut out: Vec<Isometry3<f64>> = Vec::with_capacity(s.nodes.len());
    for n in &s.nodes {
        let coordinate = |by: usize, follows: &Option<[f64; 2]>| {
            let q = s.pose.iter().chain(&s.rest).nth(by).copied().unwrap_or(0.0);
            follows.map_or(q, |[multiplier, offset]| multiplier * q + offset)
        };
        let moved = match &n.moves {
            Some(Moves::Turn { axis, by, follows }) => {
                let turn = UnitQuaternion::from_scaled_axis(Vector3::from(*axis) * coordinate(*by, follows));
                Isometry3::from_parts(Translation3::identity(), turn)
            }
            Some(Moves::Slide { axis, by, follows }) => Isometry3::from_parts(
                Translation3::from(Vector3::from(*axis) * coordinate(*by, follows)),
                UnitQuaternion::identity(),
            ),
            // About the relaxed springs.
            Some(Moves::Sway { .. }) | None => Isometry3::identity(),
        };
        let own = isometry(&n.place) * moved;
        out.push(n.parent.map_or(own, |p| out[p] * own));
    }
    out
}

/// A shape that is hidden by a better one of the same node.
fn hidden(n: &Node, role: Role) -> bool {
    let has = |roles: &[Role]| n.shapes.iter().any(|s| roles.contains(&s.role));
    role == Role::Inertia && has(&[Role::Link, Role::Panel, Role::Fuel])
}

/// Faces of a box with these edges about its middle.
fn cuboid(size: &[f64; 3], middle: Vector3<f64>) -> Vec<Vec<Point3<f64>>> {
    let mut out = Vec::new();
    for k in 0..3 {
        for side in [-0.5, 0.5] {
            let corner = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                (p[k], p[(k + 1) % 3], p[(k + 2) % 3]) = (side, u, v);
                Point3::from(middle + Vector3::from_fn(|i, _| p[i] * size[i]))
            };
            let mut face = vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
            if side < 0.0 {
                face.reverse();
            }
            out.push(face);
        }
    }
    out
}

fn cylinder(radius: f64, length: f64) -> Vec<Vec<Point3<f64>>> {
    let at = |i: usize, z: f64| {
        let (sin, cos) = (TAU * i as f64 / ROUND as f64).sin_cos();
        Point3::new(radius * cos, radius * sin, z)
    };
    let (low, high) = (-0.5 * length, 0.5 * length);
    let side = |i: usize| vec![at(i, low), at(i + 1, low), at(i + 1, high), at(i, high)];
    let mut out: Vec<Vec<Point3<f64>>> = (0..ROUND).map(side).collect();
    out.push((0..ROUND).map(|i| at(i, high)).collect());
    out.push((0..ROUND).rev().map(|i| at(i, low)).collect());
    out
}

/// Axes of the view as rows: right, up, towards the eye.
fn view() -> [Vector3<f64>; 3] {
    let eye = Vector3::from(EYE).normalize();
    let right = Vector3::z().cross(&eye).normalize();
    [right, eye.cross(&right), eye]
}

fn pieces(s: &Scene, meshes: &[Mesh]) -> Vec<Piece> {
    let [right, up, eye] = view();
    let light = Vector3::from(LIGHT).normalize();
    let seen = |p: &Point3<f64>| Point3::new(right.dot(&p.coords), up.dot(&p.coords), eye.dot(&p.coords));
    let mut out = Vec::new();
    for (n, at) in s.nodes.iter().zip(placed(s)) {
        for shape in n.shapes.iter().filter(|d| !hidden(n, d.role)) {
            let (place, base) = (at * isometry(&shape.place), colour(shape.role));
            let faces = match &shape.form {
                Form::Box { size } => cuboid(size, Vector3::zeros()),
                Form::Cylinder { radius, length } => cylinder(*radius, *length),
                Form::Mesh { mesh, scale } => {
                    let Some((low, size)) = meshes.get(*mesh).map(Mesh::bounds) else { continue };
                    let scaled: [f64; 3] = std::array::from_fn(|k| size[k] * scale[k].abs());
                    cuboid(&scaled, Vector3::from_fn(|k, _| (low[k] + 0.5 * size[k]) * scale[k]))
                }
                Form::Sphere { radius } => {
                    let inside = shape.role == Role::Fuel;
                    out.push(Piece::Ball(seen(&(place * Point3::origin())), *radius, base, inside));
                    continue;
                }
                Form::Axes { size } => {
                    for (axis, colour) in [Vector3::x(), Vector3::y(), Vector3::z()].iter().zip(AXES) {
                        let ends = [Point3::origin(), Point3::from(axis * *size)];
                        out.push(Piece::Line(ends.map(|p| seen(&(place * p))), colour));
                    }
                    continue;
                }
            };
            for face in faces {
                let corners: Vec<Point3<f64>> = face.iter().map(|p| place * p).collect();
                let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[1]));
                if normal.dot(&eye) <= 0.0 {
                    continue;
                }
                let bright = 0.62 + 0.38 * normal.normalize().dot(&light).max(0.0);
                out.push(Piece::Face(corners.iter().map(seen).collect(), base.map(|c| (c * bright).min(1.0))));
            }
        }
    }
    out.sort_by(|a, b| a.depth().total_cmp(&b.depth()));
    out
}

/// Colours of x, y and z, safe for the colour blind.
const AXES: [[f64; 3]; 3] = [[0.835, 0.369, 0.0], [0.0, 0.62, 0.451], [0.337, 0.706, 0.914]];

/// Where nothing else is said, names of the base and of what is mounted.
fn named(s: &Scene) -> Vec<(usize, &str)> {
    let mounted = |n: &Node| n.shapes.iter().any(|d| d.role == Role::Mount);
    s.nodes.iter().enumerate().filter(|(i, n)| *i == 0 || mounted(n)).map(|(i, n)| (i, n.name.as_str())).collect()
}

/// Where the name of a node is written: at what hangs there, outermost, or at the node itself.
fn hung(s: &Scene, places: &[Isometry3<f64>], i: usize) -> Vector3<f64> {
    // The base has arm and appendages; only what is mounted has something of its own to be named by.
    let mut last = i;
    for (k, n) in s.nodes.iter().enumerate().skip(i + 1).filter(|_| i > 0) {
        if n.parent == Some(last) {
            last = k;
        }
    }
    let shape = s.nodes[last].shapes.first().filter(|_| last > i);
    let at = shape.map_or(places[last], |d| places[last] * isometry(&d.place));
    at.translation.vector
}

/// The first scene of a replay as SVG: orthographic, joints at its pose, springs relaxed; meshes as the boxes that hold them. Allocates.
pub(super) fn svg(s: &Scene, meshes: &[Mesh]) -> String {
    let all = pieces(s, meshes);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut hold = |p: &Point3<f64>, r: f64| {
        for k in 0..2 {
            low[k] = low[k].min(p[k] - r);
            high[k] = high[k].max(p[k] + r);
        }
    };
    for piece in &all {
        match piece {
            Piece::Face(c, _) => c.iter().for_each(|p| hold(p, 0.0)),
            Piece::Ball(p, r, ..) => hold(p, *r),
            Piece::Line(ends, _) => ends.iter().for_each(|p| hold(p, 0.0)),
        }
    }
    let size: [f64; 2] = std::array::from_fn(|k| (high[k] - low[k]).max(1e-6));
    let scale = ((SIZE.0 - 2.0 * EDGE) / size[0]).min((SIZE.1 - 2.0 * EDGE) / size[1]);
    let middle: [f64; 2] = std::array::from_fn(|k| if all.is_empty() { 0.0 } else { 0.5 * (low[k] + high[k]) });
    let at = |p: &Point3<f64>| (0.5 * SIZE.0 + scale * (p.x - middle[0]), 0.5 * SIZE.1 - scale * (p.y - middle[1]));
    let hex = |c: &[f64; 3]| c.iter().fold("#".to_owned(), |s, x| s + &format!("{:02x}", (255.0 * x).round() as u8));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{} drawn\" stroke-linejoin=\"round\">\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>",
        SIZE.0,
        SIZE.1,
        escape(&s.label)
    );
    // Writing to a text cannot fail.
    for piece in &all {
        let _ = match piece {
            Piece::Face(c, colour) => {
                let points: Vec<String> = c.iter().map(|p| format!("{:.1},{:.1}", at(p).0, at(p).1)).collect();
                let fill = hex(colour);
                write!(
                    out,
                    "<polygon points=\"{}\" fill=\"{fill}\" stroke=\"#333\" stroke-width=\"0.6\"/>",
                    points.join(" ")
                )
            }
            Piece::Ball(p, r, colour, inside) => write!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{:.1}\" fill=\"{}\"{} stroke=\"#333\" stroke-width=\"0.6\"/>",
                at(p).0,
                at(p).1,
                scale * r,
                hex(colour),
                if *inside { " fill-opacity=\"0.75\"" } else { "" }
            ),
            Piece::Line([a, b], colour) => write!(
                out,
                "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{}\" stroke-width=\"2.5\"/>",
                at(a).0,
                at(a).1,
                at(b).0,
                at(b).1,
                hex(colour)
            ),
        };
    }
    let [right, up, eye] = view();
    let places = placed(s);
    let mut written: Vec<(f64, f64, f64)> = Vec::new();
    for (i, name) in named(s) {
        let p = hung(s, &places, i);
        let (x, mut y) = at(&Point3::new(right.dot(&p), up.dot(&p), eye.dot(&p)));
        // Below what would be written upon.
        let long = LETTER * name.chars().count() as f64;
        while let Some(other) = written.iter().find(|o| x < o.0 + o.2 && o.0 < x + long && (y - o.1).abs() < LINE) {
            y = other.1 + LINE;
        }
        written.push((x, y, long));
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" font-family=\"DejaVu Sans, Verdana, sans-serif\" font-size=\"15\" fill=\"#111\" stroke=\"#fff\" \
             stroke-width=\"3\" paint-order=\"stroke\">{}</text>",
            x + 8.0,
            y - 8.0,
            escape(name)
        );
    }
    out.push_str("</svg>");
    out
}
