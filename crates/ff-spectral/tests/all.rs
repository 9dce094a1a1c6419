//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-spectral --test all psd_scipy` runs those of `psd_scipy.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod psd_scipy;
