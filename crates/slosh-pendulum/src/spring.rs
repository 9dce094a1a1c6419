//! Place of a mass on springs along the axes of the mount.

use crate::point::{Coupling, Drive, Place, Push};
use ff_model::Scalar;
use ff_model::spatial::vec3::{M3, V3, array};

/// A mass that moves along `N` axes of the mount, from x on: `r = rest + sum eta_k e_k`.
#[derive(Clone, Copy)]
pub(crate) struct Shift<T, const N: usize> {
    r: V3<T>,
}

/// `e_k x v`.
#[inline(always)]
fn about<T: Scalar>(k: usize, v: &V3<T>) -> V3<T> {
    let o = T::zero();
    match k {
        0 => V3::new(o, -v.z, v.y),
        1 => V3::new(v.z, o, -v.x),
        _ => V3::new(-v.y, v.x, o),
    }
}

impl<T: Scalar, const N: usize> Shift<T, N> {
    /// `rest` and `eta` in m.
    #[inline(always)]
    pub(crate) fn new(rest: &[T], eta: &[T]) -> Self {
        Self { r: V3::from_slice(rest) + Self::along(&array(T::zero(), |k| eta[k])) }
    }
    /// `sum x_k e_k`.
    #[inline(always)]
    fn along(x: &[T; N]) -> V3<T> {
        let x = |k: usize| if k < N { x[k] } else { T::zero() };
        V3::new(x(0), x(1), x(2))
    }
}

impl<T: Scalar, const N: usize> Place<T, N, 4> for Shift<T, N> {
    #[inline(always)]
    fn r(&self) -> V3<T> {
        self.r
    }
    #[inline(always)]
    fn push(&self, f: V3<T>) -> Push<T, N> {
        Push { f, n: self.r.cross(&f), own: array(T::zero(), |k| f.get(k)) }
    }
    #[inline(always)]
    fn motion(&self, nu: &[T; N], acc: Option<&[T; N]>) -> (V3<T>, V3<T>) {
        (Self::along(nu), acc.map_or(V3::zero(), |a| Self::along(a)))
    }
    #[inline(always)]
    fn coupling(&self, m: T) -> Coupling<T, N> {
        let h = self.r.scaled(m);
        let unit = |k: usize| Self::along(&array(T::zero(), |i| if i == k { m } else { T::zero() }));
        (array((V3::zero(), V3::zero()), |k| (unit(k), -about(k, &h))), [m; N])
    }
    #[inline(always)]
    fn by_coordinate(&self, drive: &Drive<T, N>) -> [V3<T>; N] {
        let M3(columns) = drive.field();
        array(V3::zero(), |k| columns[k])
    }
    #[inline(always)]
    fn by_rate(&self, drive: &Drive<T, N>) -> [V3<T>; N] {
        let w = drive.w.scaled(T::from_f64(-2.0));
        array(V3::zero(), |k| about(k, &w))
    }
    #[inline(always)]
    fn shift(&self, f: &V3<T>, columns: &mut [Push<T, N>; N]) {
        for (k, c) in columns.iter_mut().enumerate() {
            c.n += about(k, f);
        }
    }
    /// A change of the rest position along `e_k` does what one of the coordinate does, but for the springs.
    #[inline(always)]
    fn by_parameter(&self, m: T, drive: &Drive<T, N>) -> [Push<T, N>; 4] {
        let (rate, lift) = self.motion(&drive.nu, drive.acc.as_ref().map(|a| &a.2));
        let a = drive.on(drive.carry(&self.r, &rate, &lift).0);
        let (f, M3(columns)) = (a.scaled(m), drive.field());
        let rest = |k: usize| {
            let mut c = self.push(columns[k].scaled(m));
            c.n += about(k, &f);
            c
        };
        [self.push(a), rest(0), rest(1), rest(2)]
    }
}
