//! Several appendages as one value, to be mounted together.

use super::shared::SharedAppendage;
use crate::spatial::motion::Xform;

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
/// * **Tuples** of up to eight elements, each a kind of appendage or a handle: a system that is known when the program is
///   written. Elements keep their types until they are mounted.
/// * **`Vec<SharedAppendage>`** as a registry builds them, and `Vec<Box<dyn DynAppendage>>`: a set that a file or a user
///   puts together at run time.
///
/// Both give the same [`Model`](crate::tree::model::Model): mounting hides the types, and calls through the trait object were
/// measured to cost nothing (decision 0001). The algorithms compute the same bits
/// (`crates/ff-dynamics/tests/sets.rs`).
pub trait AppendageSet {
    /// The appendages in order, their types hidden. Allocates.
    fn into_shared(self) -> Vec<SharedAppendage>;
}

impl<A: Into<SharedAppendage>> AppendageSet for Vec<A> {
    fn into_shared(self) -> Vec<SharedAppendage> {
        self.into_iter().map(Into::into).collect()
    }
}

macro_rules! tuples {
    ($(($($a:ident: $i:tt),*))*) => {$(
        impl<$($a: Into<SharedAppendage>),*> AppendageSet for ($($a,)*) {
            fn into_shared(self) -> Vec<SharedAppendage> {
                vec![$(self.$i.into()),*]
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
