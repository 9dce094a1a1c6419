//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-ident --test all coarse` runs those of `coarse.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod common;

mod around;
mod clock;
mod coarse;
mod compare;
mod complete;
mod continuation;
mod covariance;
mod elastic_joints;
mod free_decay;
mod ground;
mod identifiability;
mod initial_guess;
mod joint_motion;
mod kinks;
mod knot_spectrum;
mod masked;
mod modal_estimate;
mod modal_model;
mod modal_paper;
mod motion_fit;
mod motor_side;
mod multi_start;
mod nist_strd;
mod output_error;
mod posterior;
mod profile;
mod project;
mod record_checks;
mod recovery;
mod row_streams;
mod sampling;
mod scores;

mod several_records;
mod shared_errors;
mod tie_map;
mod ties;
mod time_bases;
mod transform;
mod zero_phase;
