//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-dynamics --test all reduced` runs those of `reduced.rs`. `allocation.rs` counts allocations thread by
//! thread, so that the others do not disturb it.

mod common;

mod allocation;
#[cfg(feature = "batch")]
mod batch;
mod centroidal;
mod conservation;
mod coupled;
mod derivatives;
mod disturbances;
mod ensemble;
mod inputs;
mod kinematics;
mod lanes;
mod motion;
mod oracle;
mod record;
mod reduced;
mod sets;
mod twins;
