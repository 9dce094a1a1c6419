//! Frequencies in measured signals: power spectra, peaks, and modes of free decay, each with its uncertainty.
//!
//! | module | contents |
//! |---|---|
//! | [`psd`], [`psd_confidence`] | power spectral density by Welch's method, and its confidence interval |
//! | [`peaks`] | natural frequencies as peaks of spectra, with their resolution |
//! | [`decimate`] | decimation with an anti-alias filter |
//! | [`era`] | the eigensystem realisation algorithm |
//! | [`modal`] | modes of free decay: frequency, damping, shape, with standard deviations |
//! | [`chi_square`] | tails of the chi-squared distribution |
//!
//! No type of faer, realfft or rustfft appears in a public signature.

pub mod chi_square;
pub mod decimate;
pub mod era;
pub mod modal;
pub mod peaks;
pub mod psd;
pub mod psd_confidence;

pub use decimate::Decimator;
pub use modal::{ModalFit, ModalSettings, fit_modes};
pub use peaks::{Peak, Peaks, find_peaks};
pub use psd::{Psd, Welch};

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
