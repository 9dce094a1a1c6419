//! What a URDF says that links look like.

use super::mesh;
use super::mesh::Mesh;
use super::node::{Drawn, Form, Pose, Role};
use super::shapes::form;
use ff_mission::urdf::visual::{Look, LookKind, Surface, from_urdf};
use ff_model::{Model, Problems};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Most triangles in a page.
const TRIANGLES: usize = 40_000;
/// Most triangles of one mesh where there are very many.
const LEAST: usize = 200;

/// Most links named in a note.
const NAMED: usize = 4;

/// Surfaces of the bodies of a model. Empty for a robot that has none: then boxes from inertia are drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Appearance {
    bodies: Vec<(usize, Drawn)>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) notes: Vec<String>,
}

impl Appearance {
    /// From the URDF that `model` was read from: the `<visual>` elements of each link or, where a mesh of them cannot be read, its
    /// `<collision>` elements. STL, OBJ and COLLADA meshes are read, relative to the file or in a package (`package://`) in a folder above it. What
    /// cannot be read is named in the notes of the page, and the body is drawn as its box.
    ///
    /// # Errors
    /// Those of [`from_urdf`]; `Io::Read` for a file that cannot be read.
    pub fn of_urdf(path: &Path, model: &Model) -> Result<Self, Problems> {
        let text = ff_model::diagnostics::text_file(path, ff_mission::urdf::MAX_BYTES)?;
        let (looks, problems) = from_urdf(&text, model).map_err(|p| p.in_file(path))?;
        // Robots of many meshes have fewer triangles in each, so that no link is left without.
        let files = |kind| {
            let of = looks.iter().filter(|l| l.kind == kind).filter_map(|l| match &l.surface {
                Surface::Mesh { file, .. } => Some(file.as_str()),
                Surface::Solid(_) => None,
            });
            of.collect::<BTreeSet<_>>().len()
        };
        let meshes = files(LookKind::Visual).max(files(LookKind::Collision)).max(1);
        let most = (TRIANGLES / meshes).clamp(LEAST, mesh::TRIANGLES);
        let mut reader = Reader { path, out: Self::default(), read: BTreeMap::new(), triangles: 0, most };
        reader.out.notes.extend(problems.0.iter().map(|p| format!("A shape is not drawn: {p}")));
        let mut links: Vec<&str> = looks.iter().map(|l| l.link.as_str()).collect();
        links.dedup();
        let mut failed = Vec::new();
        for link in links {
            let of = |kind| looks.iter().filter(move |l| l.link == link && l.kind == kind).collect::<Vec<_>>();
            let shapes = match reader.all(&of(LookKind::Visual)) {
                Ok(shapes) if !shapes.is_empty() => Ok(shapes),
                visual => reader.all(&of(LookKind::Collision)).and_then(|c| if c.is_empty() { visual } else { Ok(c) }),
            };
            match shapes {
                Ok(shapes) => reader.out.bodies.extend(shapes),
                Err(why) => failed.push(format!("{link} ({why})")),
            }
        }
        if !failed.is_empty() {
            let more = failed.len().saturating_sub(NAMED);
            failed.truncate(NAMED);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let all = failed.join(", ") + &more;
            reader.out.notes.push(format!("Drawn as boxes of the same mass and inertia, without their meshes: {all}."));
        }
        let (given, kept) = reader.out.meshes.iter().fold((0, 0), |(g, k), m| (g + m.given, k + m.kept));
        if kept < given {
            reader.out.notes.push(format!("{kept} of {given} triangles of the meshes are drawn."));
        }
        Ok(reader.out)
    }
    /// Shapes of body `i`.
    pub(super) fn of_body(&self, i: usize) -> impl Iterator<Item = &Drawn> {
        self.bodies.iter().filter(move |(body, _)| *body == i).map(|(_, d)| d)
    }
}

struct Reader<'a> {
    path: &'a Path,
    out: Appearance,
    /// Meshes that several links share, by file.
    read: BTreeMap<PathBuf, usize>,
    triangles: usize,
    /// Most triangles of one mesh.
    most: usize,
}

impl Reader<'_> {
    /// Every shape, or why one cannot be read.
    fn all(&mut self, looks: &[&Look]) -> Result<Vec<(usize, Drawn)>, String> {
        looks
            .iter()
            .map(|l| {
                let form = match &l.surface {
                    Surface::Solid(shape) => form(shape),
                    Surface::Mesh { file, scale } => Form::Mesh { mesh: self.mesh(file)?, scale: *scale },
                };
                Ok((l.body, Drawn { role: Role::Link, place: Pose::from(&l.placement), form }))
            })
            .collect()
    }
    fn mesh(&mut self, file: &str) -> Result<usize, String> {
        let name = file.rsplit('/').next().unwrap_or(file);
        let path = find(self.path, file).ok_or_else(|| format!("{name} is not found"))?;
        if let Some(&index) = self.read.get(&path) {
            return Ok(index);
        }
        let mesh = Mesh::read(&path, self.most).map_err(|e| format!("{name}: {e}"))?;
        if self.triangles + mesh.kept > TRIANGLES {
            return Err(format!("{name}: {} triangles, limit {TRIANGLES} in all", self.triangles + mesh.kept));
        }
        self.triangles += mesh.kept;
        self.out.meshes.push(mesh);
        self.read.insert(path, self.out.meshes.len() - 1);
        Ok(self.out.meshes.len() - 1)
    }
}

/// Where a mesh of a URDF is: relative to it, or, in a package, in a folder of that name above it or in the package's own folder.
fn find(urdf: &Path, file: &str) -> Option<PathBuf> {
    let folder = urdf.parent().unwrap_or(Path::new(""));
    let folder = std::path::absolute(folder).ok()?;
    let Some(inside) = file.strip_prefix("package://") else {
        let path = folder.join(file.strip_prefix("file://").unwrap_or(file));
        return path.is_file().then_some(path);
    };
    let own = inside.split_once('/').map_or("", |(_, rest)| rest);
    folder.ancestors().flat_map(|a| [a.join(inside), a.join(own)]).find(|p| p.is_file())
}
