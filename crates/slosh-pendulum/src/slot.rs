//! Place of one sloshing mass among the coordinates and parameters of its appendage.

/// Where a particle's numbers are.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    /// First own coordinate.
    pub(crate) eta0: usize,
    /// First own parameter, the mass.
    pub(crate) p0: usize,
    /// Parameter `k[0]`; the other springs and the dampers follow.
    pub(crate) k0: usize,
}
