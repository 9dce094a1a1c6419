//! From the table of a mission file to a chain.

use crate::chain::PanelChain;
use crate::segment::Segment;
use ff_model::keys::{self, Keys};
use ff_model::{DynAppendage, Problems};
use nalgebra::Vector3;
use std::sync::Arc;

/// Builds a [`PanelChain`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// One key, `segments`: an array of tables from the host outwards, each with `mass_kg`, `com_m = [x, y, z]` and
/// `inertia_com_kgm2 = [xx, xy, xz, yy, yz, zz]` (centre of mass and inertia about it, segment frame),
/// `hinge_m = [x, y, z]` and `hinge_axis = [x, y, z]` (parent frame; any length but zero),
/// `stiffness_nm_per_rad`, `damping_nms_per_rad`, and optionally `rest_rad` (default 0).
///
/// # Errors
/// Every problem of the table: those of [`ff_model::keys::read`] and of [`PanelChain::new`]. `Problem::object`
/// holds the key, such as `segments[1].hinge_axis`.
pub fn from_toml(table: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let segments =
        keys::read(table, |t| t.each("segments", "one table per rigid segment, from the host outwards", segment))?;
    Ok(Arc::new(PanelChain::new(segments)?))
}

/// Segment number `i`; checked here already, so that its physical problems come beside the others.
fn segment(i: usize, t: &mut Keys<'_, '_>) -> Option<Segment> {
    let (mass, com, i_com) = (t.number("mass_kg"), t.numbers("com_m"), t.symmetric("inertia_com_kgm2"));
    let (hinge, axis) = (t.numbers("hinge_m"), t.numbers("hinge_axis"));
    let (k, d) = (t.number("stiffness_nm_per_rad"), t.number("damping_nms_per_rad"));
    let rest = t.number_or("rest_rad", 0.0);
    let v = |x: [f64; 3]| Vector3::from(x);
    let segment = Segment::new(mass?, v(com?), &i_com?, v(hinge?), v(axis?)).with_spring(k?, d?).with_rest(rest?);
    segment.check(i, t.problems());
    Some(segment)
}
