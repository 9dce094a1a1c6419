//! Flexible solar panels as chains of rigid segments on sprung, damped hinges: an appendage for ff-model.
//!
//! A panel hangs from one host body. Segment 0 turns on the host, segment `i` on segment `i - 1`. Hinge `i`
//! sits at `hinge[i]` in the frame of its parent and turns about the unit vector `axis[i]` by the angle
//! `eta[i]`; the segment frame is the hinge frame, parallel to the parent's frame at `eta[i] = 0`. Springs
//! and dampers are linear:
//!
//! ```text
//! U = sum k_i (eta_i - rest_i)^2 / 2   (J)        R = sum d_i nu_i^2 / 2   (W)
//! ```
//!
//! or `x^T K x / 2` and `nu^T D nu / 2` with full matrices ([`PanelChain::with_coupling`]),
//! so that `+k (eta - rest) + d nu` stands on the left of the hinge equation. The paper's eqs. (1), (4)
//! print both with the opposite sign, which diverges.
//!
//! A structure that is known by its modes instead is a [`modal::ModalAppendage`], kind [`modal::MODAL_KIND`].
//!
//! * [`Segment`]: one rigid segment with its hinge; [`PanelChain`]: the appendage.
//! * [`from_toml`]: the factory of mission files; [`register`]: the entries in a registry, kind [`KIND`].
//! * [`PanelChain::twin_bodies`]: the same chain as ordinary tree links ([`ff_model::port::TwinBody`]), a free oracle for
//!   tests.

mod chain;
mod config;
mod coupling;
mod dynamics;
pub mod modal;
mod segment;
mod tangent;

pub use chain::{MAX_SEGMENTS, PanelBuilder, PanelChain};
pub use config::from_toml;
pub use segment::Segment;

/// The `kind` of mission files for this appendage.
pub const KIND: &str = "flex_panel";

/// Adds the appendages of this crate to a registry: [`KIND`] and [`modal::MODAL_KIND`]. Allocates.
pub fn register(registry: &mut ff_model::Registry) {
    registry.register(KIND, from_toml).example(KIND, ONE_SEGMENT).example(KIND, THREE_SEGMENTS);
    registry.register(modal::MODAL_KIND, modal::from_toml).example(modal::MODAL_KIND, MODAL_EXAMPLE);
}

/// A wing of one segment, as its table stands in a mission file.
const ONE_SEGMENT: &str = "
segments = [
    { mass_kg = 33.0, com_m = [0.06, 1.07, -0.04], inertia_com_kgm2 = [15.0, 0.7, -0.4, 11.0, 0.5, 16.0], \
hinge_m = [0.1, 0.3, -0.2], hinge_axis = [1.0, 0.1, -0.2], stiffness_nm_per_rad = 200.0, damping_nms_per_rad = 2.0 },
]";

/// A wing of three unequal segments on skewed hinges, one of them not flat when relaxed.
const THREE_SEGMENTS: &str = "
segments = [
    { mass_kg = 31.0, com_m = [0.06, 1.07, -0.04], inertia_com_kgm2 = [15.0, 0.7, -0.4, 11.0, 0.5, 16.0], \
hinge_m = [0.1, 0.3, -0.2], hinge_axis = [1.0, 0.1, -0.2], stiffness_nm_per_rad = 220.0, damping_nms_per_rad = 2.1 },
    { mass_kg = 24.0, com_m = [-0.03, 0.94, 0.05], inertia_com_kgm2 = [9.0, -0.3, 0.2, 7.0, 0.4, 10.0], \
hinge_m = [0.05, 2.1, 0.07], hinge_axis = [0.9, -0.2, 0.1], stiffness_nm_per_rad = 140.0, damping_nms_per_rad = 1.3, \
rest_rad = 0.15 },
    { mass_kg = 11.0, com_m = [0.02, 0.61, 0.03], inertia_com_kgm2 = [4.0, 0.2, -0.1, 2.5, -0.3, 4.5], \
hinge_m = [-0.04, 1.9, 0.06], hinge_axis = [1.1, 0.3, 0.2], stiffness_nm_per_rad = 60.0, damping_nms_per_rad = 0.7 },
]";

/// An array known by three modes, which leave most of its mass to the residual.
const MODAL_EXAMPLE: &str = "
mass_kg = 63.0
com_m = [0.03, 2.4, 0.05]
inertia_com_kgm2 = [100.0, 3.0, -0.4, 31.0, -1.8, 102.0]
modes = [
    { freq_hz = 0.21, damping_ratio = 0.006, participation = [0.3, -0.2, 2.1, 3.2, 0.4, -0.3] },
    { freq_hz = 0.47, damping_ratio = 0.004, participation = [1.4, 0.3, -0.4, -0.5, 0.2, -2.6] },
    { freq_hz = 1.15, damping_ratio = 0.009, participation = [0.2, 0.5, 0.7, 0.6, 1.3, 0.4] },
]";

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
