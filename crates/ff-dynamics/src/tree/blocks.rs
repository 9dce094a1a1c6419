//! The blocks of the paper's eq. (2), by name.

use nalgebra::DMatrix;

/// Blocks of the mass matrix `H` over `[base | joints | passive]` (paper eq. (2)).
///
/// The paper calls the joint-passive block `H_pp` in the text and leaves out the base-passive one; both are
/// here under consistent names. With a fixed base the base blocks have zero rows or columns.
#[derive(Clone, Debug, PartialEq)]
pub struct MassBlocks {
    /// Base, 6 x 6: the composite inertia of everything, not that of the base body alone.
    pub h_b: DMatrix<f64>,
    /// Base-joints, 6 x n.
    pub h_bm: DMatrix<f64>,
    /// Base-passive, 6 x m.
    pub h_bp: DMatrix<f64>,
    /// Joints, n x n.
    pub h_m: DMatrix<f64>,
    /// Joints-passive, n x m.
    pub h_mp: DMatrix<f64>,
    /// Passive, m x m.
    pub h_p: DMatrix<f64>,
}

impl MassBlocks {
    /// Cuts a mass matrix with `nb` base and `nj` joint rows into its blocks. Allocates.
    ///
    /// # Panics
    /// If `h` is not square or smaller than `nb + nj`.
    pub fn new(h: &DMatrix<f64>, nb: usize, nj: usize) -> Self {
        assert_eq!(h.nrows(), h.ncols(), "mass matrix must be square");
        let m = h.nrows() - nb - nj;
        let cut = |i: usize, j: usize, r: usize, c: usize| h.view((i, j), (r, c)).into_owned();
        Self {
            h_b: cut(0, 0, nb, nb),
            h_bm: cut(0, nb, nb, nj),
            h_bp: cut(0, nb + nj, nb, m),
            h_m: cut(nb, nb, nj, nj),
            h_mp: cut(nb, nb + nj, nj, m),
            h_p: cut(nb + nj, nb + nj, m, m),
        }
    }
}
