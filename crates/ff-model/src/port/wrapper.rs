//! The dynamics of an appendage from its energies.

use super::declaration::Decl;
use super::dynamics::PortDynamics;
use super::energies::Appendage;
use super::matrix::PortMatrix;
use super::twin::TreeTwin;
use crate::scalar::traits::Scalar;

/// An appendage with the equations of motion that follow from its energies: [`PortDynamics`] for every [`Appendage`].
///
/// Of a kind that implements [`PortDynamics`] itself, `Derived` has the energies alone: what the methods written by hand
/// are compared with.
#[derive(Clone, Debug)]
pub struct Derived<A> {
    appendage: A,
    twin: Option<fn(&A) -> &dyn TreeTwin>,
}

impl<A: Appendage> Derived<A> {
    /// The dynamics of `appendage`. Does not allocate.
    pub fn new(appendage: A) -> Self {
        Self { appendage, twin: None }
    }
    /// The dynamics of an appendage that can also be written as tree links. Does not allocate.
    pub fn with_twin(appendage: A) -> Self
    where
        A: TreeTwin,
    {
        fn face<A: TreeTwin>(a: &A) -> &dyn TreeTwin {
            a
        }
        Self { appendage, twin: Some(face) }
    }
    /// The appendage inside.
    pub fn appendage(&self) -> &A {
        &self.appendage
    }
}

impl<A: Appendage> Appendage for Derived<A> {
    fn decl(&self) -> &Decl {
        self.appendage.decl()
    }
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        self.appendage.inertia(p, eta, m);
    }
    #[inline(always)]
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        self.appendage.potential(p, eta)
    }
    #[inline(always)]
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.appendage.rayleigh(p, nu)
    }
}

impl<A: Appendage> PortDynamics for Derived<A> {
    fn twin(&self) -> Option<&dyn TreeTwin> {
        self.twin.map(|face| face(&self.appendage))
    }
}
