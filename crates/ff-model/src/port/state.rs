//! Motion of an appendage and its host.

use crate::scalar::traits::Scalar;
use crate::spatial::motion::Motion;
use crate::spatial::vec3::{Moving, V3};

/// Motion of an appendage: host twist in the mount frame, own coordinates and rates.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use ff_model::{Motion, PortState};
///
/// let host = Motion::new(Vector3::new(0.2, 0.3, -0.1), Vector3::new(0.05, -0.4, 0.8));
/// let state = PortState { host, eta: &[0.1], nu: &[-0.7] };
/// assert_eq!(state.host.ang.z * state.nu[0], -0.8 * 0.7);
/// ```
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
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use ff_model::port::add_inertial;
/// use ff_model::port::port_len;
/// use ff_model::{Motion, PortAccel, PortMatrix};
///
/// // M [A; nu'] of a point mass of 2.5 kg on a slide along x.
/// let mut buffer = vec![0.0; port_len(1)];
/// let mut m = PortMatrix::new(1, &mut buffer);
/// m.add_point(2.5, &Vector3::new(0.3, -0.2, 0.4), &[Vector3::x()]);
/// let acc = PortAccel { host: Motion::new(Vector3::new(0.6, 0.1, -0.3), Vector3::zeros()), nu: &[0.2] };
/// let mut r = [0.0; 7];
/// add_inertial(&m, &acc, &mut r);
/// assert!((r[0] - 2.5 * (0.6 + 0.2)).abs() < 1e-15 && (r[6] - r[0]).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PortAccel<'a, T: Scalar> {
    /// Host acceleration at the mount origin, in mount axes: the componentwise derivative of [`PortState::host`].
    pub host: Motion<T>,
    /// Own accelerations.
    pub nu: &'a [T],
}

/// A `6+n` vector over (host twist, own rates): wrench first, then own rows.
///
/// ```
/// use ff_model::PortVector;
///
/// // The torque on the host and on the own coordinate that balance a bias.
/// fn balance(h: &PortVector<f64>) -> (f64, f64) {
///     (-h[5], -h[6])
/// }
/// assert_eq!(balance(&[0.3, -0.1, 0.2, 0.5, 0.4, -0.9, 0.7]), (0.9, -0.7));
/// ```
pub type PortVector<T> = [T];
