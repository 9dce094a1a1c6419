//! Excitation trajectories: B-splines, limits that hold for all time, costs and an optimiser

pub mod manoeuvre;

pub use manoeuvre::{Extent, JointCommand, Manoeuvre, ManoeuvreError, ManoeuvreSpec, Move, Shape};
