//! Dense factorisations: the one bridge between nalgebra (which everything here speaks) and faer (which factorises).
//!
//! Why a bridge: nalgebra's `svd()` does not return on NaN, its `cholesky()` accepts `+Inf`, and its
//! `col_piv_qr()` pivots on the largest element instead of the largest column norm, so that it cannot
//! reveal rank; faer's least squares answers a rank-deficient problem with coefficients of size 1e13.
//! Every function below therefore checks its input for non-finite numbers *before* it factorises, and
//! decides rank explicitly. All functions allocate their results. faer runs sequentially (no `rayon`
//! feature), so that results repeat bit for bit on one machine.
//!
//! [`fourier`] is the same bridge to rustfft.
//!
//! A crate of its own, because faer and rustfft are generic code: what uses them compiles them anew, for minutes (decision 0010).

mod factor;
pub mod fourier;

pub use factor::{
    ColPivQr, ComplexEigen, Elimination, LinalgError, Svd, check_finite, check_finite_slice, col_piv_qr,
    default_rank_tolerance, eliminate, general_eigen, gram, least_squares, qr_r, rank_of, singular_values, svd,
    symmetric_eigen, tr_mul,
};

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
