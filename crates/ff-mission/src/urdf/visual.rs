//! What links look like: the `<visual>` and `<collision>` elements of a URDF, for those who draw a robot.
//!
//! Looks have no part in the dynamics. What cannot be read is therefore a warning, and the link is drawn without it.

use super::collision::{geometry, numbers, placement};
use ff_model::tree::Shape;
use ff_model::{Area, Model, Problem, Problems, Xform};
use roxmltree::{Document, Node};

/// Which element a look comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LookKind {
    /// `<visual>`.
    Visual,
    /// `<collision>`.
    Collision,
}

/// Surface of a look.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// A box, ball, cylinder or capsule.
    Solid(Shape),
    /// A mesh in a file that is not opened here.
    Mesh {
        /// `filename` as it stands, such as `package://robot/meshes/link0.stl`.
        file: String,
        /// Factors along the axes of the mesh; 1 unless given.
        scale: [f64; 3],
    },
}

/// A surface on a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Name of the link.
    pub link: String,
    /// The body that carries it, 0 for the base.
    pub body: usize,
    /// The element it comes from.
    pub kind: LookKind,
    /// Pose in the body frame (m).
    pub placement: Xform<f64>,
    /// Its surface.
    pub surface: Surface,
}

/// The looks of the URDF that `model` was read from, in the order of the file. Links that the model does not have (lifted into an
/// appendage) are left out. Allocates.
///
/// # Errors
/// Text that is no URDF: [`Problems`] of the scan, and `Urdf::Syntax`. Elements that cannot be read are warnings
/// (`Urdf::BadNumber`, `Urdf::BadCollision`).
pub fn from_urdf(text: &str, model: &Model) -> Result<(Vec<Look>, Problems), Problems> {
    super::prescan::scan(text, super::MAX_LINKS)?;
    let document = Document::parse(text).map_err(|e| {
        let p = Problem::error(Area::Model, "Urdf::Syntax", e.to_string()).at_line(e.pos().row as usize);
        Problems(vec![p.hint("check the XML at this line")])
    })?;
    let (mut looks, mut problems) = (Vec::new(), Problems::default());
    for link in document.root_element().children().filter(|n| n.has_tag_name("link")) {
        let name = link.attribute("name").unwrap_or_default();
        let Some(frame) = model.frame(name) else { continue };
        for e in link.children() {
            let kind = match e.tag_name().name() {
                "visual" => LookKind::Visual,
                "collision" => LookKind::Collision,
                _ => continue,
            };
            let read = placement(&e).and_then(|own| Ok((own, surface(&e)?)));
            match read {
                Ok((own, surface)) => looks.push(Look {
                    link: name.to_owned(),
                    body: frame.body,
                    kind,
                    placement: frame.placement * own,
                    surface,
                }),
                Err((n, code, what, hint)) => {
                    let line = document.text_pos_at(n.range().start).row as usize;
                    let p = Problem::warning(Area::Model, code, what).at_line(line).on(format!("link {name}"));
                    problems.push(p.hint(hint));
                }
            }
        }
    }
    Ok((looks, problems))
}

fn surface<'a, 'i>(e: &Node<'a, 'i>) -> Result<Surface, super::collision::Bad<'a, 'i>> {
    let mesh = e.descendants().find(|n| n.has_tag_name("mesh"));
    let Some(mesh) = mesh else { return geometry(e).map(Surface::Solid) };
    let scale = if mesh.has_attribute("scale") { numbers::<3>(mesh, "scale")? } else { [1.0; 3] };
    Ok(Surface::Mesh { file: mesh.attribute("filename").unwrap_or_default().to_owned(), scale })
}
