//! How it moves: dynamics of free-floating robots with passive appendages, modes, integrators and sensor models

pub mod bspline;
pub mod motion;
