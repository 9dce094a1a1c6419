//! Several appendages as one value, to be mounted together.

use super::{Appendage, DynAppendage};
use crate::spatial::motion::Xform;
use std::sync::Arc;

/// Where an appendage of a set goes, and what it is called there.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Name in the model; prefix of its parameters and coordinates.
    pub name: String,
    /// The body that carries it; 0 is the base.
    pub host: usize,
    /// Pose of the mount frame in the host body frame.
    pub mount: Xform<f64>,
}

impl Place {
    /// A place on body `host`. Allocates for the name.
    pub fn new(name: impl Into<String>, host: usize, mount: Xform<f64>) -> Self {
        Self { name: name.into(), host, mount }
    }
}

/// A set of appendages in an order of its own, for [`Model::mount_set`](crate::tree::model::Model::mount_set).
///
/// * **Tuples** of up to eight appendages of any types: a system that is known when the program is written. Elements
///   keep their types until they are mounted.
/// * **`Vec<Box<dyn DynAppendage>>`**, and `Vec<Arc<dyn DynAppendage>>` as a registry builds them: a set that a file or a
///   user puts together at run time.
///
/// Both give the same [`Model`](crate::tree::model::Model): mounting hides the types, and calls through the object-safe twin were
/// measured to cost nothing (decision 0001). The algorithms compute the same bits
/// (`crates/ff-dynamics/tests/sets.rs`).
pub trait AppendageSet {
    /// The appendages in order, their types hidden. Allocates.
    fn into_shared(self) -> Vec<Arc<dyn DynAppendage>>;
}

impl AppendageSet for Vec<Arc<dyn DynAppendage>> {
    fn into_shared(self) -> Self {
        self
    }
}

impl AppendageSet for Vec<Box<dyn DynAppendage>> {
    fn into_shared(self) -> Vec<Arc<dyn DynAppendage>> {
        self.into_iter().map(Arc::from).collect()
    }
}

macro_rules! tuples {
    ($(($($a:ident: $i:tt),*))*) => {$(
        impl<$($a: Appendage),*> AppendageSet for ($($a,)*) {
            fn into_shared(self) -> Vec<Arc<dyn DynAppendage>> {
                vec![$(Arc::new(self.$i)),*]
            }
        }
    )*};
}
tuples! {
    (A: 0)
    (A: 0, B: 1)
    (A: 0, B: 1, C: 2)
    (A: 0, B: 1, C: 2, D: 3)
    (A: 0, B: 1, C: 2, D: 3, E: 4)
    (A: 0, B: 1, C: 2, D: 3, E: 4, F: 5)
    (A: 0, B: 1, C: 2, D: 3, E: 4, F: 5, G: 6)
    (A: 0, B: 1, C: 2, D: 3, E: 4, F: 5, G: 6, H: 7)
}

/// Writes `From<Kind> for Arc<dyn DynAppendage>`, what [`crate::tree::model::Model::mount`] takes, for a kind of appendage: stands once in the crate
/// of the kind. It compiles the kind's dynamics for every number type there, so that programs which say `kind.into()` need
/// not; `Arc::new(kind)` does the same and compiles them anew in each program.
#[macro_export]
macro_rules! shared {
    ($kind:ty) => {
        impl From<$kind> for std::sync::Arc<dyn $crate::DynAppendage> {
            // Inlined, it would be compiled where it is called.
            #[inline(never)]
            fn from(appendage: $kind) -> Self {
                std::sync::Arc::new(appendage)
            }
        }
    };
}
