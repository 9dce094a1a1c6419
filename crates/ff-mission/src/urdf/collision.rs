//! Solids on bodies, for collision: given, or the `<collision>` elements of a URDF.
//!
//! They have no part in the dynamics and are no part of [`Model`]: who wants them reads them beside it.
//! Boxes, spheres, cylinders and capsules are read, meshes refused.

use ff_model::Model;
use ff_model::Xform;
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::tree::{Shape, Solid};
use ff_model::{Area, Problem, Problems};
use nalgebra::Vector3;
use roxmltree::{Document, Node};

/// The `<collision>` elements of the URDF that `model` was read from. Links that the model does not have (lifted into an
/// appendage) are left out with a warning. Allocates.
///
/// # Errors
/// All problems at once: meshes, unknown or missing geometry, sizes that are not positive numbers.
pub fn from_urdf(text: &str, model: &Model) -> Result<(Vec<Solid>, Problems), Problems> {
    super::prescan::scan(text, super::MAX_LINKS)?;
    let mut out = Problems::default();
    let document = match Document::parse(text) {
        Ok(d) => d,
        Err(e) => {
            let p = Problem::error(Area::Model, "Urdf::Syntax", e.to_string()).at_line(e.pos().row as usize);
            return Err(Problems(vec![p]));
        }
    };
    let mut solids = Vec::new();
    for link in document.root_element().children().filter(|n| n.has_tag_name("link")) {
        let name = link.attribute("name").unwrap_or_default();
        let line = |n: &Node<'_, '_>| document.text_pos_at(n.range().start).row as usize;
        let elements: Vec<_> = link.children().filter(|n| n.has_tag_name("collision")).collect();
        if elements.is_empty() {
            continue;
        }
        let Some(frame) = model.frame(name) else {
            out.push(
                Problem::warning(Area::Model, "Urdf::CollisionLost", "its collision geometry is not used")
                    .at_line(line(&link))
                    .on(format!("link {name}"))
                    .hint("the model has no such link (was it lifted into an appendage?); give the solid on its host"),
            );
            continue;
        };
        for (k, e) in elements.iter().enumerate() {
            let problem = |n: &Node<'_, '_>, code, what: String, hint: &str| {
                Problem::error(Area::Model, code, what).at_line(line(n)).on(format!("link {name}")).hint(hint)
            };
            match (placement(e), geometry(e)) {
                (Ok(own), Ok(shape)) => {
                    let name = match (e.attribute("name"), k) {
                        (Some(own), _) => format!("{name}/{own}"),
                        (None, 0) => name.to_owned(),
                        (None, _) => format!("{name}#{k}"),
                    };
                    solids.push(Solid { name, body: frame.body, placement: frame.placement * own, shape });
                }
                (a, b) => {
                    for (n, code, what, hint) in [a.err(), b.err()].into_iter().flatten() {
                        out.push(problem(&n, code, what, hint));
                    }
                }
            }
        }
    }
    out.finish(Some(solids))
}

pub(super) type Bad<'a, 'i> = (Node<'a, 'i>, &'static str, String, &'static str);

/// The numbers of an attribute; all finite.
pub(super) fn numbers<'a, 'i, const N: usize>(n: Node<'a, 'i>, key: &str) -> Result<[f64; N], Bad<'a, 'i>> {
    let text = n.attribute(key).unwrap_or_default();
    let read: Option<Vec<f64>> =
        text.split_whitespace().map(|t| t.parse().ok().filter(|x: &f64| x.is_finite())).collect();
    read.and_then(|v| v.try_into().ok()).ok_or_else(|| {
        let what = format!("{key}=\"{text}\" of <{}> is not {N} finite number(s)", n.tag_name().name());
        (n, "Urdf::BadNumber", what, "write numbers in m and rad, separated by spaces, with a decimal point")
    })
}

/// The numbers of an attribute; all positive.
fn sizes<'a, 'i, const N: usize>(n: Node<'a, 'i>, key: &str) -> Result<[f64; N], Bad<'a, 'i>> {
    let v = numbers::<N>(n, key)?;
    match v.iter().find(|x| **x <= 0.0) {
        None => Ok(v),
        Some(x) => {
            let what = format!("{key} {x} m of <{}>, limit > 0 m", n.tag_name().name());
            Err((n, "Urdf::BadCollision", what, "give the size of the shape in m"))
        }
    }
}

pub(super) fn placement<'a, 'i>(e: &Node<'a, 'i>) -> Result<Xform<f64>, Bad<'a, 'i>> {
    let Some(o) = e.children().find(|n| n.has_tag_name("origin")) else { return Ok(Xform::identity()) };
    let vector = |key| if o.has_attribute(key) { numbers::<3>(o, key) } else { Ok([0.0; 3]) };
    Ok(Xform::new(rot_of_rpy(&Vector3::from(vector("rpy")?)), Vector3::from(vector("xyz")?)))
}

pub(super) fn geometry<'a, 'i>(e: &Node<'a, 'i>) -> Result<Shape, Bad<'a, 'i>> {
    const HINT: &str = "use <box>, <sphere>, <cylinder> or <capsule>";
    let shape = e
        .children()
        .find(|n| n.has_tag_name("geometry"))
        .and_then(|g| g.children().find(Node::is_element))
        .ok_or_else(|| (*e, "Urdf::BadCollision", "<collision> has no shape".to_owned(), HINT))?;
    let one = |key| sizes::<1>(shape, key).map(|v| v[0]);
    match shape.tag_name().name() {
        "sphere" => Ok(Shape::Sphere { radius: one("radius")? }),
        "box" => Ok(Shape::Box { size: sizes::<3>(shape, "size")? }),
        "cylinder" => Ok(Shape::Cylinder { radius: one("radius")?, length: one("length")? }),
        "capsule" => Ok(Shape::Capsule { radius: one("radius")?, length: one("length")? }),
        "mesh" => {
            let what = format!("collision mesh '{}'", shape.attribute("filename").unwrap_or_default());
            Err((shape, "Urdf::CollisionMesh", what, "meshes are not read: replace it by boxes, cylinders or capsules"))
        }
        other => Err((shape, "Urdf::BadCollision", format!("unknown shape <{other}>"), HINT)),
    }
}
