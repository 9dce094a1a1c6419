//! The handle under which models and registries hold appendages, and how a kind becomes one.

use super::energies::Appendage;
use super::erased::DynAppendage;
use super::wrapper::Derived;
use std::sync::Arc;

/// An appendage as models and registries hold it: the type is hidden, copies share one value.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ff_model::payload::Payload;
/// use ff_model::{Inertia, SharedAppendage};
///
/// let block = Inertia::from_com(3.2, &Vector3::new(0.4, -0.1, 0.2), &Matrix3::from_diagonal_element(0.3));
/// let payload: SharedAppendage = Payload::new(&block)?.into();
/// let twice = payload.clone(); // the same appendage, for two mounts
/// assert_eq!((twice.declaration().kind, twice.declaration().params.len()), ("payload", 10));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type SharedAppendage = Arc<dyn DynAppendage>;

impl<A: Appendage> From<Derived<A>> for SharedAppendage {
    fn from(appendage: Derived<A>) -> Self {
        Arc::new(appendage)
    }
}

/// Writes `From<Kind> for SharedAppendage` for a kind of [`Appendage`](crate::Appendage) whose dynamics follow from its
/// energies ([`Derived`](crate::port::Derived)), so that [`Model::mount`](crate::Model::mount) takes the kind as it is. Stands
/// once in the crate of the kind, whose dynamics are compiled there for every number type.
///
/// `derived!(Kind: TreeTwin)` is for a kind that implements [`TreeTwin`](crate::port::TreeTwin), too.
#[macro_export]
macro_rules! derived {
    ($kind:ty) => {
        $crate::derived!(@ $kind, new);
    };
    ($kind:ident: TreeTwin) => {
        $crate::derived!(@ $kind, with_twin);
    };
    (@ $kind:ty, $new:ident) => {
        impl From<$kind> for $crate::SharedAppendage {
            // Inlined, it would be compiled where it is called.
            #[inline(never)]
            fn from(appendage: $kind) -> Self {
                $crate::port::Derived::$new(appendage).into()
            }
        }
    };
}

/// Writes `From<Kind> for SharedAppendage` for a kind that implements [`PortDynamics`](crate::PortDynamics) itself; for
/// the others see [`derived!`](crate::derived). Stands once in the crate of the kind. It compiles the kind's dynamics for
/// every number type there, so that programs which mount one need not; `Arc::new(kind)` does the same and compiles them
/// anew in each program.
#[macro_export]
macro_rules! shared {
    ($kind:ty) => {
        impl From<$kind> for $crate::SharedAppendage {
            // Inlined, it would be compiled where it is called.
            #[inline(never)]
            fn from(appendage: $kind) -> Self {
                std::sync::Arc::new(appendage)
            }
        }
    };
}
