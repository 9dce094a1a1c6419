//! From the table of a mission file to a chain.

use crate::chain::PanelChain;
use crate::coupling;
use crate::coupling::{DAMPING, STIFFNESS};
use crate::segment::Segment;
use ff_model::keys;
use ff_model::keys::Keys;
use ff_model::{Area, DynAppendage, Problem, Problems};
use nalgebra::{DMatrix, Vector3};
use std::sync::Arc;

/// Builds a [`PanelChain`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// Key `segments`: an array of tables from the host outwards, each with `mass_kg`, `com_m = [x, y, z]` and
/// `inertia_com_kgm2 = [xx, xy, xz, yy, yz, zz]` (centre of mass and inertia about it, segment frame),
/// `hinge_m = [x, y, z]` and `hinge_axis = [x, y, z]` (parent frame; any length but zero),
/// `stiffness_nm_per_rad`, `damping_nms_per_rad`, and optionally `rest_rad` (default 0).
///
/// Hinges that are coupled have `stiffness_nm_per_rad` or `damping_nms_per_rad`, or both, beside `segments` instead: a
/// symmetric positive semidefinite matrix in rows. The segments then have none of their own.
///
/// ```toml
/// stiffness_nm_per_rad = [[200.0, -60.0], [-60.0, 180.0]]
/// ```
///
/// # Errors
/// Every problem of the table: those of [`ff_model::keys::read`] and of [`PanelChain::new`]. `Problem::object`
/// holds the key, such as `segments[1].hinge_axis`.
pub fn from_toml(table: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let (segments, k, d) = keys::read(table, |t| {
        let k = if t.has(STIFFNESS.key) { Some(matrix(t, STIFFNESS)) } else { None };
        let d = if t.has(DAMPING.key) { Some(matrix(t, DAMPING)) } else { None };
        let own = [k.is_none(), d.is_none()];
        let what = "one table per rigid segment, from the host outwards";
        let segments = t.each("segments", what, |i, t| segment(i, own, t))?;
        for (m, of) in [(&k, STIFFNESS), (&d, DAMPING)] {
            if let Some(Some(m)) = m {
                coupling::check(m, segments.len(), of, t.problems());
            }
        }
        // Given, but not readable as a matrix: that has been said.
        let readable = |m: Option<Option<DMatrix<f64>>>| m.map_or(Some(None), |m| m.map(Some));
        Some((segments, readable(k)?, readable(d)?))
    })?;
    let chain = PanelChain::new(segments)?;
    if k.is_none() && d.is_none() {
        return Ok(chain.into());
    }
    let (own_k, own_d) = chain.stiffness_damping();
    Ok(chain.with_coupling(&k.unwrap_or(own_k), &d.unwrap_or(own_d))?.into())
}

/// A matrix in rows of equal length.
fn matrix(t: &mut Keys<'_, '_>, of: coupling::Of) -> Option<DMatrix<f64>> {
    let rows = t.matrix(of.key)?;
    let n = rows.len();
    if let Some(i) = rows.iter().position(|r| r.len() != n) {
        let what = format!("{} numbers in a row of a matrix with {n} rows", rows[i].len());
        let p = Problem::error(Area::Config, "Config::WrongLength", what).on(t.path_of(&format!("{}[{i}]", of.key)));
        t.problems().push(p.hint("give a square matrix in rows"));
        return None;
    }
    Some(DMatrix::from_fn(n, n, |i, j| rows[i][j]))
}

/// Segment number `i`, with a spring and a damper of its `own` or without; checked here already, so that its physical problems come beside the others.
fn segment(i: usize, own: [bool; 2], t: &mut Keys<'_, '_>) -> Option<Segment> {
    let (mass, com, i_com) = (t.number("mass_kg"), t.numbers("com_m"), t.symmetric("inertia_com_kgm2"));
    let (hinge, axis) = (t.numbers("hinge_m"), t.numbers("hinge_axis"));
    let k = if own[0] { t.number(STIFFNESS.key) } else { Some(0.0) };
    let d = if own[1] { t.number(DAMPING.key) } else { Some(0.0) };
    let rest = t.number_or("rest_rad", 0.0);
    let v = |x: [f64; 3]| Vector3::from(x);
    let segment = Segment::new(mass?, v(com?), &i_com?, v(hinge?), v(axis?)).with_spring(k?, d?).with_rest(rest?);
    segment.check(i, t.problems());
    Some(segment)
}
