//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ffid-cli --test all check` runs those of `check.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod any_bytes;
mod band;
mod case;
mod check;
mod common;
mod common_gain;
mod convert;
mod doctor;
mod doubts;
mod evidence;
mod exact_world;
mod exchange;
mod excite;
mod formats;
mod identify;
mod in_process;
mod init;
mod inputs;
mod interruption;
mod json_schema;
mod kinds;
mod logs;
mod motor_side;
mod noise_figures;
mod outputs;
mod paper_robot;
mod payload_pair;
mod preflight;
mod prior_means;
mod questions;
mod sampling;
mod schema;
mod show;
mod suspects;
mod three_segment;
mod uncertain;
