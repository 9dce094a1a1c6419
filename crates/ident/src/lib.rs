//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty

pub mod motion_fit;
