//! The kinetic-energy matrix of an appendage, as the numbers that can differ in it.

use super::state::PortAccel;
use crate::scalar::traits::Scalar;
use crate::spatial::inertia::Inertia;
use crate::spatial::vec3::{PackedInertia, S3, V3};
use nalgebra::{DMatrix, Vector3};

/// Where the coupling columns begin, and numbers in each.
const COUPLING: usize = 10;
const COLUMN: usize = 6;

/// How many numbers the matrix of an appendage with `n` coordinates consists of: `10 + 6 n + n (n + 1) / 2`.
#[must_use]
pub const fn port_len(n: usize) -> usize {
    COUPLING + COLUMN * n + n * (n + 1) / 2
}

/// The symmetric kinetic-energy matrix of an appendage, `(6+n) x (6+n)` over (host twist, own rates), to be written:
///
/// ```text
///     [ m 1   -[h]x   F ]
/// M = [ [h]x    I     N ]
///     [ F^T    N^T    E ]
/// ```
///
/// It is held as what can differ in it: the host block as the ten inertial parameters of a rigid body (see
/// [`Appendage::inertia`](super::Appendage::inertia) for why it is one), the coupling columns `[F; N]`, the lower triangle of `E`. A matrix
/// that is not symmetric, or has another host block, cannot be written; and for two coordinates there are 25 numbers to write and to
/// read in place of 64, which is a tenth of the time of inverse dynamics in lanes.
///
/// ```
/// use ff_model::PortMatrix;
/// use ff_model::nalgebra::Vector3;
/// use ff_model::port::port_len;
///
/// // A point mass of 2.5 kg that slides along its one coordinate.
/// let mut buffer = vec![0.0; port_len(1)];
/// let mut m = PortMatrix::new(1, &mut buffer);
/// m.add_point(2.5, &Vector3::new(0.3, -0.2, 0.4), &[Vector3::new(0.6, 0.0, 0.8)]);
/// let m = m.view().dense();
/// assert_eq!((m[(0, 0)], m[(2, 6)]), (2.5, 2.0)); // its mass; force on the host along z per unit acceleration
/// assert!((m[(6, 6)] - 2.5_f64).abs() < 1e-15);
/// ```
#[derive(Debug)]
pub struct PortMatrix<'a, T> {
    n: usize,
    a: &'a mut [T],
}

impl<'a, T: Scalar> PortMatrix<'a, T> {
    /// A view of the first [`port_len`] numbers of `buffer`, cleared to zero.
    ///
    /// # Panics
    /// If `buffer` is too short.
    #[inline(always)]
    pub fn new(n: usize, buffer: &'a mut [T]) -> Self {
        let mut m = Self::over(n, buffer);
        m.clear();
        m
    }
    /// The same view of whatever the buffer holds: for [`PortDynamics::terms`](super::PortDynamics::terms), which sets every number, and as the
    /// scratch of [`PortDynamics::residual`](super::PortDynamics::residual).
    ///
    /// # Panics
    /// If `buffer` is too short.
    #[inline(always)]
    pub fn over(n: usize, buffer: &'a mut [T]) -> Self {
        Self { n, a: &mut buffer[..port_len(n)] }
    }
    /// Sets every number to zero.
    #[inline(always)]
    pub fn clear(&mut self) {
        for x in self.a.iter_mut() {
            *x = T::zero();
        }
    }
    /// The same matrix for a caller who knows its size: writing elements of the view is free of checks. (Of a view behind a
    /// reference the compiler must think that every element written could have changed its size.)
    ///
    /// # Panics
    /// If the matrix is not that of `n` coordinates.
    #[inline(always)]
    #[must_use]
    pub fn expect(&mut self, n: usize) -> PortMatrix<'_, T> {
        assert!(self.n == n && self.a.len() == port_len(n));
        PortMatrix { n, a: &mut self.a[..port_len(n)] }
    }
    /// Number of rows, `6 + n`.
    #[must_use]
    pub fn dim(&self) -> usize {
        6 + self.n
    }
    /// To be read.
    #[inline(always)]
    #[must_use]
    pub fn view(&self) -> PortView<'_, T> {
        PortView { n: self.n, a: self.a }
    }
    /// Sets the host block to a body's spatial inertia.
    #[inline(always)]
    pub fn set_host(&mut self, b: &PackedInertia<T>) {
        let (h, i) = (b.h, b.i);
        self.a[..COUPLING].copy_from_slice(&[b.m, h.x, h.y, h.z, i.xx, i.xy, i.yy, i.xz, i.yz, i.zz]);
    }
    /// Adds a body's spatial inertia to the host block.
    #[inline(always)]
    pub fn add_host(&mut self, b: &Inertia<T>) {
        let mut sum = self.view().host();
        sum.add(&PackedInertia::from(b));
        self.set_host(&sum);
    }
    /// Sets the coupling column of own coordinate `k`: force and moment on the host per unit own acceleration.
    ///
    /// # Panics
    /// If there is no such coordinate.
    #[inline(always)]
    pub fn set_coupling(&mut self, k: usize, f: &V3<T>, n: &V3<T>) {
        let to = &mut self.a[COUPLING + COLUMN * k..COUPLING + COLUMN * (k + 1)];
        to.copy_from_slice(&[f.x, f.y, f.z, n.x, n.y, n.z]);
    }
    /// Sets elements `(i, j)` and `(j, i)`, one of which belongs to an own coordinate: rows 0 to 5 are those of the host, whose block
    /// [`PortMatrix::set_host`] writes.
    ///
    /// # Panics
    /// If both are rows of the host, or one is out of range.
    #[inline(always)]
    pub fn set_sym(&mut self, i: usize, j: usize, x: T) {
        self.a[place(self.n, i, j)] = x;
    }
    /// Adds a point mass at `r(eta)` (mount frame): `m J^T J` with `J = [1, -[r]x, dr/d eta_0, ..]`, which is its
    /// kinetic energy `m |v + w x r + sum dr/d eta_k nu_k|^2 / 2`. `dr` holds one vector per coordinate.
    ///
    /// With point masses at the nodes of a quadrature rule this serves bodies that deform, too.
    ///
    /// # Panics
    /// If `dr` is longer than the number of coordinates.
    #[inline]
    pub fn add_point(&mut self, mass: T, r: &Vector3<T>, dr: &[Vector3<T>]) {
        self.add_host(&Inertia::point(mass, r));
        let r = V3::from(r);
        for (k, d) in dr.iter().enumerate() {
            let f = V3::from(d).scaled(mass);
            let (sf, sn) = self.view().coupling(k);
            self.set_coupling(k, &(sf + f), &r.cross_add(&f, &sn));
            for (j, e) in dr[..=k].iter().enumerate() {
                let at = place(self.n, 6 + k, 6 + j);
                self.a[at] += V3::from(e).dot(&f);
            }
        }
    }
}

/// The kinetic-energy matrix of an appendage, to be read: see [`PortMatrix`].
#[derive(Clone, Copy, Debug)]
pub struct PortView<'a, T> {
    n: usize,
    a: &'a [T],
}

impl<'a, T: Scalar> PortView<'a, T> {
    /// Of the first [`port_len`] numbers of `buffer`.
    ///
    /// # Panics
    /// If `buffer` is too short.
    #[inline(always)]
    pub fn new(n: usize, buffer: &'a [T]) -> Self {
        Self { n, a: &buffer[..port_len(n)] }
    }
    /// The host block as a rigid body in the mount frame: what it costs to move the appendage with its own rates zero.
    #[inline(always)]
    pub fn host(&self) -> PackedInertia<T> {
        PackedInertia::from_params(self.a)
    }
    /// Coupling column of own coordinate `k`: force and moment on the host per unit own acceleration, mount frame.
    ///
    /// # Panics
    /// If there is no such coordinate.
    #[inline(always)]
    pub fn coupling(&self, k: usize) -> (V3<T>, V3<T>) {
        let c = &self.a[COUPLING + COLUMN * k..COUPLING + COLUMN * (k + 1)];
        (V3::from_slice(c), V3::from_slice(&c[3..]))
    }
    /// Element `(i, j)` of the own block `E`.
    ///
    /// # Panics
    /// If out of range.
    #[inline(always)]
    pub fn own(&self, i: usize, j: usize) -> T {
        self.a[own(self.n, i.max(j), i.min(j))]
    }
    /// Element `(i, j)` of the whole matrix.
    ///
    /// # Panics
    /// If out of range.
    pub fn get(&self, i: usize, j: usize) -> T {
        let (row, column) = (i.max(j), i.min(j));
        if row >= 6 {
            return self.a[place(self.n, row, column)];
        }
        let PackedInertia { m, h, i: S3 { xx, xy, yy, xz, yz, zz } } = self.host();
        match (row, column) {
            (0..3, _) if row == column => m,
            (3, 1) => -h.z,
            (3, 2) => h.y,
            (4, 0) => h.z,
            (4, 2) => -h.x,
            (5, 0) => -h.y,
            (5, 1) => h.x,
            (3, 3) => xx,
            (4, 3) => xy,
            (4, 4) => yy,
            (5, 3) => xz,
            (5, 4) => yz,
            (5, 5) => zz,
            _ => T::zero(),
        }
    }
    /// The whole matrix, to be looked at. Allocates.
    pub fn dense(&self) -> DMatrix<T> {
        DMatrix::from_fn(6 + self.n, 6 + self.n, |i, j| self.get(i, j))
    }
}

/// Where element `(i, j)` is held, of which one belongs to an own coordinate.
#[inline(always)]
fn place(n: usize, i: usize, j: usize) -> usize {
    let (row, column) = (i.max(j), i.min(j));
    assert!(6 <= row && row < 6 + n, "not an own coordinate");
    if column < 6 { COUPLING + COLUMN * (row - 6) + column } else { own(n, row - 6, column - 6) }
}

/// Where element `(i, j)` of the own block is held, `j <= i`.
#[inline(always)]
fn own(n: usize, i: usize, j: usize) -> usize {
    COUPLING + COLUMN * n + i * (i + 1) / 2 + j
}

/// `r += M [A; nu']`: what turns a bias into a residual. Does not allocate.
///
/// # Panics
/// If `r` or the accelerations have another size than `M`.
#[inline(always)]
pub fn add_inertial<T: Scalar>(m: &PortMatrix<'_, T>, acc: &PortAccel<'_, T>, r: &mut [T]) {
    let (m, r) = (m.view(), &mut r[..6 + m.n]);
    assert_eq!(acc.nu.len(), m.n, "own accelerations");
    let (a, al, b) = (V3::from(&acc.host.lin), V3::from(&acc.host.ang), m.host());
    let mut f = al.cross_add(&b.h, &a.scale_add(b.m, &V3::from_slice(r)));
    let mut n = b.h.cross_add(&a, &b.i.mul_add(&al, &V3::from_slice(&r[3..])));
    for (k, &x) in acc.nu.iter().enumerate() {
        let (cf, cn) = m.coupling(k);
        let mut own = cf.dot(&a) + cn.dot(&al) + r[6 + k];
        for (l, &y) in acc.nu.iter().enumerate() {
            own = m.own(k, l).mul_add(y, own);
        }
        (f, n, r[6 + k]) = (cf.scale_add(x, &f), cn.scale_add(x, &n), own);
    }
    f.write_to(r);
    n.write_to(&mut r[3..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the Jacobian written out: `m J^T J`, twice, since contributions add.
    #[test]
    fn a_point_mass_is_its_jacobian_squared() {
        let (mass, r) = (2.3, Vector3::new(0.4, -0.7, 1.1));
        let dr = [Vector3::new(0.2, 0.9, -0.3), Vector3::new(-0.6, 0.1, 0.8), Vector3::new(0.5, 0.4, 0.7)];
        let mut buffer = [7.7; port_len(3)];
        let mut m = PortMatrix::new(3, &mut buffer);
        m.add_point(mass, &r, &dr);
        m.add_point(mass, &r, &dr);
        let mut j = nalgebra::SMatrix::<f64, 3, 9>::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-r.cross_matrix());
        for k in 0..3 {
            j.set_column(6 + k, &dr[k]);
        }
        let want = j.transpose() * j * (2.0 * mass);
        let have = m.view().dense();
        for a in 0..9 {
            for b in 0..9 {
                assert!((have[(a, b)] - want[(a, b)]).abs() < 1e-14, "({a}, {b}): {} {}", have[(a, b)], want[(a, b)]);
            }
        }
    }

    #[test]
    fn what_is_written_is_read_and_multiplied() {
        let b = PackedInertia {
            m: 3.1,
            h: V3::new(0.4, -1.2, 0.7),
            i: S3 { xx: 5.1, xy: 0.3, yy: 6.2, xz: -0.8, yz: 0.45, zz: 7.3 },
        };
        let mut buffer = [f64::NAN; port_len(2)];
        let mut m = PortMatrix::over(2, &mut buffer);
        m.set_host(&b);
        m.set_coupling(0, &V3::new(0.11, 0.12, 0.13), &V3::new(0.14, 0.15, 0.16));
        for j in 0..6 {
            m.set_sym(j, 7, 0.25 + 0.0625 * j as f64);
        }
        m.set_sym(6, 6, 1.7);
        m.set_sym(6, 7, 0.33);
        m.set_sym(7, 7, 1.9);
        let dense = m.view().dense();
        assert_eq!(dense, dense.transpose());
        let body = Inertia::from_elements(|i, j| dense[(i, j)]);
        assert_eq!(dense.fixed_view::<6, 6>(0, 0), body.to_matrix());
        assert_eq!(PackedInertia::from(&body), b);
        assert_eq!((dense[(0, 6)], dense[(5, 6)], dense[(7, 4)], dense[(7, 6)]), (0.11, 0.16, 0.5, 0.33));
        assert_eq!((m.view().own(0, 1), m.view().coupling(1).1.z), (0.33, 0.5625));
        let y = [0.3, -0.9, 1.4, 0.6, 0.8, -0.5, 1.1, -0.7];
        let want = &dense * nalgebra::DVector::from_row_slice(&y);
        let acc = PortAccel { host: crate::spatial::motion::Motion::from_slice(&y), nu: &y[6..] };
        let mut r = [0.25; 8];
        add_inertial(&m, &acc, &mut r);
        for i in 0..8 {
            assert!((r[i] - 0.25 - want[i]).abs() < 1e-14, "{i}: {} {}", r[i], want[i]);
        }
    }

    #[test]
    #[should_panic(expected = "not an own coordinate")]
    fn the_host_block_is_not_written_element_by_element() {
        PortMatrix::new(2, &mut [0.0; port_len(2)]).set_sym(1, 3, 0.7);
    }
}
