//! Motion of an appendage and its host.

use crate::scalar::traits::Scalar;
use crate::spatial::motion::Motion;
use crate::spatial::vec3::{Moving, V3};

/// Motion of an appendage: host twist in the mount frame, own coordinates and rates.
#[derive(Clone, Copy, Debug)]
pub struct PortState<'a, T: Scalar> {
    /// Host twist at the mount origin, in mount axes.
    pub host: Motion<T>,
    /// Own coordinates.
    pub eta: &'a [T],
    /// Own rates.
    pub nu: &'a [T],
}

impl<T: Scalar> PortState<'_, T> {
    /// Motion of the mount as the inner loops hold it, with the classical acceleration `A + w x v`; without
    /// accelerations (`A = 0`) for a bias.
    #[inline(always)]
    pub fn moving(&self, acc: Option<&PortAccel<'_, T>>) -> Moving<T> {
        let (v, w) = (V3::from(&self.host.lin), V3::from(&self.host.ang));
        match acc {
            Some(a) => Moving::new(w, V3::from(&a.host.ang), w.cross_add(&v, &V3::from(&a.host.lin))),
            None => Moving::new(w, V3::zero(), w.cross(&v)),
        }
    }
}

/// Accelerations at a port.
#[derive(Clone, Copy, Debug)]
pub struct PortAccel<'a, T: Scalar> {
    /// Host acceleration at the mount origin, in mount axes: the componentwise derivative of [`PortState::host`].
    pub host: Motion<T>,
    /// Own accelerations.
    pub nu: &'a [T],
}

/// A `6+n` vector over (host twist, own rates): wrench first, then own rows.
pub type PortVector<T> = [T];
