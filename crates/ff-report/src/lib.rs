//! Figures and pages: plots as SVG and PNG, reports of identifications and of plans as HTML.
//!
//! | module | contents |
//! |---|---|
//! | [`plot`] | figures of curves, bands and markers |
//! | [`page`] | pages as data, rendered to one HTML file |
//! | [`identify`] | figures and page of an identification |
//! | [`preflight`] | figures and page of a verdict on a trajectory |
//! | [`replay`] | robots in motion: a 3-D view in one file |

pub mod identify;
mod packed;
pub mod page;
pub mod plot;
pub mod preflight;
pub mod replay;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
