//! Buffers of one appendage port.

use crate::work::link::Link;
use ff_model::port::{PortView, port_len};
use ff_model::scalar::ModelScalar;
use ff_model::spatial::vec3::{PackedInertia, Pose, RotationKind, V3, turn};
use ff_model::{Force, Motion, Xform};

/// Buffers of one appendage port.
#[derive(Clone, Debug)]
pub(crate) struct PortWork<T: ModelScalar> {
    /// Mount pose in the host body.
    pub(crate) mount: Xform<T>,
    /// Host twist in the mount frame.
    pub(crate) v: Motion<T>,
    /// The numbers of `M`: see [`PortMatrix`].
    pub(crate) m: Vec<T>,
    /// Bias, `6+n`.
    pub(crate) h: Vec<T>,
    /// Factorised `M_ee`, `n^2`: a buffer of the elimination.
    pub(crate) ee: Vec<T>,
    /// `M_ee^-1 M_eb`, `n x 6` row-major.
    pub(crate) gain: Vec<T>,
    /// `M_ee^-1 (tau_e - h_e)`, `n`.
    pub(crate) free: Vec<T>,
    /// Number of coordinates.
    pub(crate) n: usize,
    /// Mount pose as the fast passes hold it.
    pub(crate) pose: Pose<T>,
    /// Residual, `6+n`.
    pub(crate) r: Vec<T>,
    /// Columns of `M_be` carried to the base, force and moment.
    pub(crate) g: Vec<(V3<T>, V3<T>)>,
    /// Derivative columns of the port equations.
    pub(crate) d: Vec<T>,
}

impl<T: ModelScalar> PortWork<T> {
    pub(crate) fn new(a: &ff_model::tree::Mounted) -> Self {
        let n = a.dim();
        let z = |k: usize| vec![T::zero(); k];
        let dim = 6 + n;
        Self {
            mount: a.mount.lift(),
            v: Motion::zero(),
            m: z(port_len(n)),
            h: z(dim),
            ee: z(n * n),
            gain: z(6 * n),
            free: z(n),
            n,
            pose: Pose::constant(&a.mount),
            r: z(dim),
            g: vec![(V3::zero(), V3::zero()); n],
            d: z(dim * a.decl().params.len().max(6 + 2 * n)),
        }
    }
    /// The residual `r = h + M [A; 0]` at a host acceleration (componentwise, angular) and own rates held.
    #[inline(always)]
    pub(crate) fn rest(&mut self, a: &V3<T>, al: &V3<T>) {
        let b = self.mass().host();
        let f = al.cross_add(&b.h, &a.scale_add(b.m, &V3::from_slice(&self.h)));
        let n = b.h.cross_add(a, &b.i.mul_add(al, &V3::from_slice(&self.h[3..])));
        f.write_to(&mut self.r);
        n.write_to(&mut self.r[3..]);
        for k in 0..self.n {
            let (f, n) = self.mass().coupling(k);
            self.r[6 + k] = f.dot(a) + n.dot(al) + self.h[6 + k];
        }
    }
    /// Adds the host rows of the residual to the host's wrench.
    #[inline(always)]
    pub(crate) fn press(&self, host: &mut Link<T>) {
        let (f, n) = self.up(&V3::from_slice(&self.r), &V3::from_slice(&self.r[3..]));
        host.f += f;
        host.n += n;
    }
    /// A wrench in the mount frame, in the host's.
    #[inline(always)]
    pub(crate) fn up(&self, f: &V3<T>, n: &V3<T>) -> (V3<T>, V3<T>) {
        match self.pose.turn {
            RotationKind::None if !T::DERIVATIVES => self.pose.wrench_up::<{ turn::NONE }>(f, n),
            _ => self.pose.wrench_up::<{ turn::ANY }>(f, n),
        }
    }
    /// The host block as a body in the host frame.
    #[inline(always)]
    pub(crate) fn hung(&self) -> PackedInertia<T> {
        match self.pose.turn {
            RotationKind::None if !T::DERIVATIVES => self.pose.body_up::<{ turn::NONE }>(&self.mass().host()),
            _ => self.pose.body_up::<{ turn::ANY }>(&self.mass().host()),
        }
    }
    /// `M`.
    #[inline(always)]
    pub(crate) fn mass(&self) -> PortView<'_, T> {
        PortView::new(self.n, &self.m)
    }
    /// Column `k` of `M_be`: the wrench on the host per unit own acceleration, in the mount frame.
    pub(crate) fn coupling(&self, k: usize) -> Force<T> {
        let (f, n) = self.mass().coupling(k);
        Force::new(f.into(), n.into())
    }
    /// `M_bb A` for a host acceleration `A` in the mount frame.
    #[inline(always)]
    pub(crate) fn host_inertia(&self, a: &Motion<T>) -> Force<T> {
        let (f, n) = self.mass().host().momentum(&V3::from(&a.lin), &V3::from(&a.ang));
        Force::new(f.into(), n.into())
    }
}
