//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-dynamics --test all reduced` runs those of `reduced.rs`. Allocations are counted in a program of
//! their own, `allocation.rs`, because the counter replaces the allocator.

mod common;

mod adaptive;
mod centroidal;
mod conservation;
mod derivatives;
mod ensemble;
mod inputs;
mod lanes;
mod motion;
mod oracle;
mod record;
mod reduced;
mod sets;
mod twins;
