//! Triangles of a mesh file, thinned and packed.

use super::collada;
use crate::packed::shorts;
use serde::Serialize;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

/// Largest file read (bytes).
const MAX_BYTES: u64 = 64 << 20;
/// Most triangles of one mesh; more are thinned.
pub(super) const TRIANGLES: usize = 3000;
/// Cells along the longest edge of the finest grid that thins; at most 255.
const CELLS: f64 = 128.0;
/// Steps along an edge of the box about a mesh.
const STEPS: f64 = 65_535.0;
/// Bytes of a binary STL before its triangles, and of each triangle.
const STL: (u64, u64) = (84, 50);

/// A mesh as the page reads it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Mesh {
    /// Lowest corner of the box about it, in its own unit.
    low: [f64; 3],
    /// Edges of that box.
    size: [f64; 3],
    /// Corners of the triangles, three numbers each: little-endian whole numbers of 16 bits in base64, 65535 per edge of the box.
    data: String,
    /// Triangles of the file.
    #[serde(skip)]
    pub(super) given: usize,
    /// Triangles kept.
    #[serde(skip)]
    pub(super) kept: usize,
}

/// Corners of a triangle (m, or the unit of its file).
pub(super) type Triangle = [[f64; 3]; 3];

impl Mesh {
    /// Reads an STL, binary or text, or the triangles and polygons of a Wavefront OBJ or of the scene of a COLLADA file; materials are not
    /// looked at.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub(super) fn read(path: &Path, most: usize) -> Result<Self, String> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if !["stl", "obj", "dae"].contains(&extension.as_str()) {
            return Err(format!("meshes of kind '{extension}' are not read, only STL, OBJ and COLLADA (dae)"));
        }
        let mut file = File::open(path).map_err(|e| e.to_string())?;
        let bytes = file.metadata().map_err(|e| e.to_string())?.len();
        if bytes > MAX_BYTES {
            return Err(format!("{bytes} bytes, limit {MAX_BYTES}"));
        }
        if extension == "obj" {
            return Self::of(wavefront(&mut BufReader::new(file))?, most);
        }
        if extension == "dae" {
            let mut text = String::new();
            file.read_to_string(&mut text).map_err(|e| e.to_string())?;
            return Self::of(collada::triangles(&text)?, most);
        }
        // A count that the file does not hold would be allocated before it is missed.
        let mut head = [0; STL.0 as usize];
        let whole = file.read_exact(&mut head).is_ok();
        let count = u64::from(u32::from_le_bytes([head[80], head[81], head[82], head[83]]));
        let text = head.starts_with(b"solid");
        let complete = whole && bytes >= STL.0 + STL.1 * count;
        if !text && !complete {
            return Err("the file ends before its last triangle".to_owned());
        }
        file.rewind().map_err(|e| e.to_string())?;
        let mesh = stl_io::read_stl(&mut BufReader::new(file)).map_err(|e| e.to_string())?;
        let corner = |i: usize| {
            let v = mesh.vertices[i];
            [f64::from(v[0]), f64::from(v[1]), f64::from(v[2])]
        };
        Self::of(mesh.faces.iter().map(|f| f.vertices.map(corner)).collect(), most)
    }

    /// Least corner and size of the box that holds it, in its own units.
    pub(super) fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        (self.low, self.size)
    }
    fn of(triangles: Vec<Triangle>, most: usize) -> Result<Self, String> {
        let corners = || triangles.iter().flatten();
        if corners().flatten().any(|x| !x.is_finite()) {
            return Err("a corner is not finite".to_owned());
        }
        let bound = |k: usize, start: f64, f: fn(f64, f64) -> f64| corners().map(|c| c[k]).fold(start, f);
        let low: [f64; 3] = std::array::from_fn(|k| bound(k, f64::INFINITY, f64::min));
        let size: [f64; 3] = std::array::from_fn(|k| bound(k, f64::NEG_INFINITY, f64::max) - low[k]);
        if triangles.is_empty() || size.iter().all(|x| *x <= 0.0) {
            return Err("there are no triangles in it".to_owned());
        }
        let given = triangles.len();
        let kept = thin(triangles, &low, &size, most);
        let step = |x: f64, k: usize| if size[k] > 0.0 { ((x - low[k]) / size[k] * STEPS).round() as u16 } else { 0 };
        let numbers = kept.iter().flatten().flat_map(|c| (0..3).map(|k| step(c[k], k)));
        Ok(Self { low, size, data: shorts(numbers), given, kept: kept.len() })
    }
}

/// Triangles of all objects of an OBJ, polygons cut into them. Lines and points have none.
fn wavefront(text: &mut impl BufRead) -> Result<Vec<Triangle>, String> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    // Files of materials are not opened: their names would lead anywhere.
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(text, &options, no_materials).map_err(|e| e.to_string())?;
    let mut out = Vec::new();
    for mesh in models.iter().map(|m| &m.mesh) {
        let corner = |i: &u32| -> Option<[f64; 3]> {
            let at = 3 * usize::try_from(*i).ok()?;
            let p = mesh.positions.get(at..at + 3)?;
            Some([f64::from(p[0]), f64::from(p[1]), f64::from(p[2])])
        };
        for t in mesh.indices.chunks_exact(3) {
            let corners: Option<Vec<[f64; 3]>> = t.iter().map(corner).collect();
            let corners = corners.ok_or("a face names a corner that there is not")?;
            out.push([corners[0], corners[1], corners[2]]);
        }
    }
    Ok(out)
}

/// Merges corners that share a cell of an ever coarser grid until there are at most `most` triangles (Rossignac and Borrel 1993, vertex
/// clustering).
fn thin(triangles: Vec<Triangle>, low: &[f64; 3], size: &[f64; 3], most: usize) -> Vec<Triangle> {
    let longest = size.iter().fold(0.0, |a: f64, b| a.max(*b));
    let mut cells = CELLS;
    let mut out = Vec::new();
    while triangles.len() > most && (out.is_empty() || out.len() > most) && cells >= 4.0 {
        // Cells are numbered as corners come to them; each keeps the sum of its corners and their number.
        let key = |c: &[f64; 3]| (0..3).fold(0, |key, k| key << 8 | ((c[k] - low[k]) / longest * cells) as u32);
        let mut numbers: HashMap<u32, usize> = HashMap::new();
        let mut sums: Vec<([f64; 3], f64)> = Vec::new();
        let mut number = |c: &[f64; 3]| {
            let next = sums.len();
            let i = *numbers.entry(key(c)).or_insert(next);
            if i == next {
                sums.push(([0.0; 3], 0.0));
            }
            (0..3).for_each(|k| sums[i].0[k] += c[k]);
            sums[i].1 += 1.0;
            i
        };
        let all: Vec<[usize; 3]> = triangles.iter().map(|t| t.each_ref().map(&mut number)).collect();
        let flat = |t: &&[usize; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        out = all.iter().filter(flat).map(|t| t.map(|i| sums[i].0.map(|x| x / sums[i].1))).collect();
        cells *= 0.75;
    }
    if triangles.len() > most { out } else { triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheet of `n x n` squares over 2 m x 1 m.
    fn sheet(n: usize) -> Vec<Triangle> {
        let at = |i: usize, j: usize| [2.0 * i as f64 / n as f64, j as f64 / n as f64, -0.5];
        let square = |i, j| [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]];
        (0..n).flat_map(|i| (0..n).flat_map(move |j| square(i, j))).collect()
    }

    fn binary(triangles: &[Triangle], count: u32) -> Vec<u8> {
        let mut out = vec![b' '; 80];
        out.extend(count.to_le_bytes());
        for t in triangles {
            out.extend(
                [0.0f32, 0.0, 1.0]
                    .iter()
                    .chain(t.iter().flatten().map(|x| *x as f32).collect::<Vec<_>>().iter())
                    .flat_map(|x| x.to_le_bytes()),
            );
            out.extend([0, 0]);
        }
        out
    }

    #[test]
    fn a_binary_stl_is_read_and_a_fine_one_thinned() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sheet.STL");
        std::fs::write(&path, binary(&sheet(3), 18)).unwrap();
        let m = Mesh::read(&path, TRIANGLES).unwrap();
        assert_eq!((m.given, m.kept, m.low, m.size), (18, 18, [0.0, 0.0, -0.5], [2.0, 1.0, 0.0]));
        let m = Mesh::of(sheet(100), TRIANGLES).unwrap();
        assert!(m.given == 20_000 && m.kept <= TRIANGLES && m.kept > 500, "{}", m.kept);
        // 18 bytes a triangle, 4 characters for 3 bytes.
        assert_eq!(m.data.len(), m.kept * 24);
    }

    #[test]
    fn polygons_of_an_obj_are_cut_into_triangles() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("roof.obj");
        let text = "mtllib /etc/hostname.mtl\no roof\nv 0.5 -1 0\nv 2.5 -1 0\nv 2.5 1 0.25\nv 0.5 1 0.25\nv 1.5 0 0.75\nusemtl tin\n\
                    f 1 2 3 4\nf -5 -4 -1\nl 1 2\n";
        std::fs::write(&path, text).unwrap();
        let m = Mesh::read(&path, TRIANGLES).unwrap();
        assert_eq!((m.given, m.kept, m.low, m.size), (3, 3, [0.5, -1.0, 0.0], [2.0, 2.0, 0.75]));
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nf 1 2 7\n").unwrap();
        assert!(Mesh::read(&path, TRIANGLES).is_err());
    }

    #[test]
    fn what_is_no_mesh_says_why() {
        let dir = tempfile::tempdir().unwrap();
        let why = |name: &str, bytes: &[u8]| {
            let path = dir.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            Mesh::read(&path, TRIANGLES).unwrap_err()
        };
        assert!(why("short.stl", &binary(&sheet(1), u32::MAX)).contains("ends before"));
        assert!(why("empty.stl", &binary(&[], 0)).contains("no triangles"));
        assert!(why("robot.ply", b"ply").contains("'ply'"));
        assert!(why("robot.dae", b"<COLLADA/>").contains("no triangles"));
        assert!(why("nan.stl", &binary(&[[[f64::NAN; 3]; 3]], 1)).contains("not finite"));
    }
}
