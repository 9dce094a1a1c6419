//! Triangles of a COLLADA scene (ISO/PAS 17506; versions 1.4 and 1.5).
//!
//! Geometries stand where the nodes of the visual scene place them, in metres. `up_axis` turns nothing: robot descriptions are drawn as
//! RViz draws them, which takes the axes of the file for those of the link.

use super::mesh::Triangle;
use nalgebra::{Matrix4, Point3, Rotation3, Translation3, Unit, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;
use std::str::FromStr;

/// Most elements and text nodes of a file, most triangles of a scene, deepest nest of nodes.
const NODES: u32 = 1_000_000;
const TRIANGLES: usize = 4_000_000;
const DEPTH: usize = 64;

/// Reads the triangles of the scene of a file, polygons cut into them; lines have none.
///
/// # Errors
/// What cannot be read, and where.
pub(super) fn triangles(text: &str) -> Result<Vec<Triangle>, String> {
    let options = ParsingOptions { nodes_limit: NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|e| e.to_string())?;
    let root = document.root_element();
    let ids = document.descendants().filter_map(|n| Some((n.attribute("id")?, n))).collect();
    let unit = child(root, "asset").and_then(|a| child(a, "unit")).and_then(|u| u.attribute("meter"));
    let unit: f64 = unit.map_or(Ok(1.0), parse)?;
    let mut reader = Reader { ids, out: Vec::new() };
    let from = Matrix4::new_scaling(unit);
    let named = child(root, "scene").and_then(|s| child(s, "instance_visual_scene"));
    let scene = match named {
        Some(s) => Some(reader.target(s, "url")?),
        None => root.descendants().find(|n| n.has_tag_name_of("visual_scene")),
    };
    match scene {
        Some(s) => children(s, "node").try_for_each(|n| reader.node(n, &from, 0))?,
        // A library without a scene: what it holds, where it is.
        None => {
            root.descendants().filter(|n| n.has_tag_name_of("geometry")).try_for_each(|g| reader.geometry(g, &from))?
        }
    }
    Ok(reader.out)
}

/// Elements by their name in whatever namespace the file declares.
trait Named {
    fn has_tag_name_of(&self, name: &str) -> bool;
}

impl Named for Node<'_, '_> {
    fn has_tag_name_of(&self, name: &str) -> bool {
        self.is_element() && self.tag_name().name() == name
    }
}

fn children<'a, 'i>(of: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    of.children().filter(move |n| n.has_tag_name_of(name))
}

fn child<'a, 'i>(of: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(of, name).next()
}

fn parse<T: FromStr>(word: &str) -> Result<T, String> {
    word.trim().parse().map_err(|_| format!("'{}' is no number", word.trim()))
}

fn numbers<T: FromStr>(of: Node<'_, '_>) -> Result<Vec<T>, String> {
    of.text().unwrap_or_default().split_whitespace().map(parse).collect()
}

fn attribute<T: FromStr>(of: Node<'_, '_>, name: &str, without: T) -> Result<T, String> {
    of.attribute(name).map_or(Ok(without), parse)
}

/// The motion that an element of a node says; `None` for one that says none.
fn transform(of: Node<'_, '_>) -> Result<Option<Matrix4<f64>>, String> {
    let kind = of.tag_name().name();
    let n = match kind {
        "matrix" => 16,
        "rotate" => 4,
        "translate" | "scale" => 3,
        "lookat" | "skew" => return Err(format!("a <{kind}>, which is not read")),
        _ => return Ok(None),
    };
    let x: Vec<f64> = numbers(of)?;
    if x.len() != n {
        return Err(format!("a <{kind}> of {} numbers, {n} needed", x.len()));
    }
    Ok(Some(match kind {
        "matrix" => Matrix4::from_row_slice(&x),
        "translate" => Translation3::new(x[0], x[1], x[2]).to_homogeneous(),
        "scale" => Matrix4::new_nonuniform_scaling(&Vector3::new(x[0], x[1], x[2])),
        _ => match Unit::try_new(Vector3::new(x[0], x[1], x[2]), 1e-12) {
            Some(axis) => Rotation3::from_axis_angle(&axis, x[3].to_radians()).to_homogeneous(),
            None => Matrix4::identity(),
        },
    }))
}

struct Reader<'a, 'i> {
    ids: HashMap<&'a str, Node<'a, 'i>>,
    out: Vec<Triangle>,
}

impl<'a, 'i> Reader<'a, 'i> {
    /// The element that an attribute such as `url="#base"` names.
    fn target(&self, of: Node<'a, 'i>, attribute: &str) -> Result<Node<'a, 'i>, String> {
        let url = of.attribute(attribute).unwrap_or_default();
        let found = url.strip_prefix('#').and_then(|id| self.ids.get(id));
        found.copied().ok_or_else(|| format!("<{}> names '{url}', which is not in the file", of.tag_name().name()))
    }

    /// A node with what hangs from it.
    fn node(&mut self, n: Node<'a, 'i>, above: &Matrix4<f64>, depth: usize) -> Result<(), String> {
        if depth > DEPTH {
            return Err(format!("nodes are nested deeper than {DEPTH}"));
        }
        let mut at = *above;
        for c in n.children().filter(Node::is_element) {
            if let Some(own) = transform(c)? {
                at *= own;
            }
        }
        for c in n.children().filter(Node::is_element) {
            match c.tag_name().name() {
                "node" => self.node(c, &at, depth + 1)?,
                "instance_node" => self.node(self.target(c, "url")?, &at, depth + 1)?,
                "instance_geometry" => self.geometry(self.target(c, "url")?, &at)?,
                "instance_controller" => return Err("a skinned mesh, which is not read".to_owned()),
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(&mut self, g: Node<'a, 'i>, at: &Matrix4<f64>) -> Result<(), String> {
        let Some(mesh) = child(g, "mesh") else { return Ok(()) };
        for p in mesh.children().filter(Node::is_element) {
            let kind = p.tag_name().name();
            if !["triangles", "polylist", "polygons", "trifans", "tristrips"].contains(&kind) {
                continue;
            }
            let inputs = || children(p, "input");
            let offset = |i: Node<'_, '_>| attribute::<usize>(i, "offset", 0);
            let stride = inputs().map(offset).try_fold(0, |most, o| o.map(|o| most.max(o)))? + 1;
            let Some(vertex) = inputs().find(|i| i.attribute("semantic") == Some("VERTEX")) else { continue };
            let (corners, first) = (self.corners(vertex)?, offset(vertex)?);
            let corners: Vec<[f64; 3]> = corners.iter().map(|c| at.transform_point(&Point3::from(*c)).into()).collect();
            let corner = |index: &[usize]| -> Result<[f64; 3], String> {
                let i = index.get(first).ok_or("a face has too few indices")?;
                corners.get(*i).copied().ok_or_else(|| format!("a face names corner {i} of {}", corners.len()))
            };
            let sizes: Vec<usize> = child(p, "vcount").map_or(Ok(Vec::new()), numbers)?;
            for list in children(p, "p") {
                let indices: Vec<usize> = numbers(list)?;
                let all: Vec<[f64; 3]> = indices.chunks(stride).map(corner).collect::<Result<_, _>>()?;
                match kind {
                    "triangles" => self.out.extend(all.chunks_exact(3).map(|t| [t[0], t[1], t[2]])),
                    // Every other triangle runs the other way; both sides are drawn alike.
                    "tristrips" => self.out.extend(all.windows(3).map(|t| [t[0], t[1], t[2]])),
                    "polylist" => {
                        let mut rest = all.as_slice();
                        for &n in &sizes {
                            let (polygon, after) =
                                rest.split_at_checked(n).ok_or("a <polylist> has fewer corners than it says")?;
                            self.fan(polygon);
                            rest = after;
                        }
                    }
                    _ => self.fan(&all),
                }
                if self.out.len() > TRIANGLES {
                    return Err(format!("more than {TRIANGLES} triangles"));
                }
            }
        }
        Ok(())
    }

    fn fan(&mut self, corners: &[[f64; 3]]) {
        self.out.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
    }

    /// Positions of the vertices that an input names.
    fn corners(&self, vertex: Node<'a, 'i>) -> Result<Vec<[f64; 3]>, String> {
        let vertices = self.target(vertex, "source")?;
        let position = children(vertices, "input").find(|i| i.attribute("semantic") == Some("POSITION"));
        let source = self.target(position.ok_or("vertices have no positions")?, "source")?;
        let array = child(source, "float_array").ok_or("positions are no <float_array>")?;
        let accessor = child(source, "technique_common").and_then(|t| child(t, "accessor"));
        let (stride, offset) = match accessor {
            Some(a) => (attribute::<usize>(a, "stride", 1)?, attribute::<usize>(a, "offset", 0)?),
            None => (3, 0),
        };
        if stride < 3 {
            return Err(format!("positions of {stride} numbers, 3 needed"));
        }
        let x: Vec<f64> = numbers(array)?;
        Ok(x.get(offset..)
            .unwrap_or_default()
            .chunks(stride)
            .filter(|c| c.len() >= 3)
            .map(|c| [c[0], c[1], c[2]])
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::triangles;

    fn scene(body: &str, nodes: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\
             <asset><unit name=\"centimetre\" meter=\"0.01\"/><up_axis>Y_UP</up_axis></asset>\
             <library_geometries><geometry id=\"g\"><mesh><source id=\"s\"><float_array id=\"a\" count=\"16\">\
             7 7 7 7  10 20 30 9  40 20 30 9  40 50 30 9  10 50 30 9</float_array><technique_common>\
             <accessor source=\"#a\" count=\"4\" stride=\"4\" offset=\"4\"/></technique_common></source>\
             <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices>{body}</mesh></geometry></library_geometries>\
             <library_nodes><node id=\"shared\"><instance_geometry url=\"#g\"/></node></library_nodes>\
             <library_visual_scenes><visual_scene id=\"scene\">{nodes}</visual_scene></library_visual_scenes>\
             <scene><instance_visual_scene url=\"#scene\"/></scene></COLLADA>"
        )
    }

    const INPUTS: &str = "<input semantic=\"NORMAL\" source=\"#n\" offset=\"0\"/><input semantic=\"VERTEX\" source=\"#v\" offset=\"1\"/>";

    /// A square in centimetres, turned, scaled and moved by nested nodes; the expected corners are by hand.
    #[test]
    fn faces_stand_where_the_nodes_of_the_scene_place_them() {
        let nodes = "<node><translate>100 0 0</translate><rotate>0 0 2 90</rotate><node><scale>1 1 -2</scale>\
                     <instance_node url=\"#shared\"/></node></node>";
        // z is turned to -2 z; (x, y) to (-y, x), then 1 m along x.
        let (a, b, c, d) = ([0.8, 0.1, -0.6], [0.8, 0.4, -0.6], [0.5, 0.4, -0.6], [0.5, 0.1, -0.6]);
        for body in [
            format!("<polylist count=\"1\">{INPUTS}<vcount>4</vcount><p>0 0 0 1 0 2 0 3</p></polylist>"),
            format!("<polygons count=\"1\">{INPUTS}<p>0 0 0 1 0 2 0 3</p></polygons>"),
            format!(
                "<triangles count=\"2\">{INPUTS}<p>0 0 0 1 0 2 0 0 0 2 0 3</p></triangles><lines count=\"1\"><p>0 1</p></lines>"
            ),
        ] {
            let found = triangles(&scene(&body, nodes)).unwrap();
            let far = found
                .iter()
                .flatten()
                .zip([a, b, c, a, c, d])
                .flat_map(|(x, y)| (0..3).map(move |k| (x[k] - y[k]).abs()));
            assert!(found.len() == 2 && far.fold(0.0, f64::max) < 1e-12, "{found:?}");
        }
        let strip = format!("<tristrips count=\"1\">{INPUTS}<p>0 0 0 1 0 3 0 2</p></tristrips>");
        assert_eq!(triangles(&scene(&strip, nodes)).unwrap().len(), 2);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let why = |body: &str, nodes: &str| triangles(&scene(body, nodes)).unwrap_err();
        let whole = "<node><instance_geometry url=\"#g\"/></node>";
        let face = |p: &str| format!("<triangles count=\"1\">{INPUTS}<p>{p}</p></triangles>");
        assert!(why(&face("0 0 0 1 0 4"), whole).contains("corner 4 of 4"));
        assert!(why(&face("0 0 0 -1 0 2"), whole).contains("'-1'"));
        assert!(why(&face("0 0 0 1 0"), whole).contains("too few"));
        assert!(why("", "<node><instance_geometry url=\"#gone\"/></node>").contains("#gone"));
        assert!(why("", "<node><matrix>1 0 0</matrix></node>").contains("16 needed"));
        assert!(why("", "<node><skew>1</skew></node>").contains("<skew>"));
        // A node that holds itself.
        let text = scene("", "<node id=\"n\"><instance_node url=\"#n\"/></node>");
        assert!(triangles(&text).unwrap_err().contains("deeper than 64"));
        assert!(triangles("<COLLADA").is_err());
    }
}
