//! From the motion of the base to that of a frame on it or on the arm, and back with wrenches and derivatives.

use super::arm::{Frame, unit};
use super::element::At;
use ff_model::spatial::vec3::V3;
use nalgebra::DMatrix;

/// Motion of the base, angular velocity as a variable.
#[derive(Clone, Copy, Debug)]
pub(super) struct Base<T> {
    pub(super) w: V3<T>,
    pub(super) v: V3<T>,
    pub(super) a: V3<T>,
    pub(super) al: V3<T>,
}

impl<T: ff_model::Scalar> Frame<T> {
    /// A vector of the base in the frame.
    fn down(&self, v: &V3<T>) -> V3<T> {
        self.r.tr_mul(v)
    }
    /// Angular velocity, velocity, classical and angular acceleration of the frame, in its axes.
    pub(super) fn carried(&self, b: &Base<T>) -> [V3<T>; 4] {
        let two = T::from_f64(2.0);
        let wp = b.w.cross(&self.p);
        let a = b.a + b.al.cross(&self.p) + b.w.cross(&wp) + b.w.cross(&self.dp).scaled(two) + self.ddp;
        let al = b.al + b.w.cross(&self.w) + self.dw;
        [self.down(&(b.w + self.w)), self.down(&(b.v + wp + self.dp)), self.down(&a), self.down(&al)]
    }
    /// The same for a small change of the motion of the base, which turns with `w`.
    fn varied(&self, w: &V3<T>, d: &Base<T>) -> [V3<T>; 4] {
        let two = T::from_f64(2.0);
        let turned = d.w.cross(&self.p);
        let a = d.a
            + d.al.cross(&self.p)
            + d.w.cross(&w.cross(&self.p))
            + w.cross(&turned)
            + d.w.cross(&self.dp).scaled(two);
        let al = d.al + d.w.cross(&self.w);
        [self.down(&d.w), self.down(&(d.v + turned)), self.down(&a), self.down(&al)]
    }
    /// A twist about the base origin, in the frame: what a wrench of the frame is weighted with.
    pub(super) fn screw(&self, lin: &V3<T>, ang: &V3<T>) -> (V3<T>, V3<T>) {
        (self.down(&(*lin + ang.cross(&self.p))), self.down(ang))
    }
}

impl Frame<f64> {
    /// A wrench of the frame about the base origin.
    pub(super) fn up(&self, f: &V3<f64>, n: &V3<f64>) -> (V3<f64>, V3<f64>) {
        let f = self.r.mul(f);
        (f, self.r.mul(n) + self.p.cross(&f))
    }
    /// Rows of the base and own rows from columns of an element.
    pub(super) fn up_columns(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = m.clone();
        for mut c in out.column_iter_mut() {
            let (f, n) = self.up(&V3::new(c[0], c[1], c[2]), &V3::new(c[3], c[4], c[5]));
            for i in 0..3 {
                (c[i], c[3 + i]) = (f.get(i), n.get(i));
            }
        }
        out
    }
    /// Columns over the motion of the base from columns over that of the frame.
    pub(super) fn over_base(&self, at: &At, w: &V3<f64>, j: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = j.clone();
        let z = V3::zero();
        for k in 0..3 {
            let e = unit(k);
            let zero = Base { w: z, v: z, a: z, al: z };
            for (first, d) in [
                (0, Base { w: e, ..zero }),
                (at.v, Base { v: e, ..zero }),
                (at.a, Base { a: e, ..zero }),
                (at.al, Base { al: e, ..zero }),
            ] {
                let parts = self.varied(w, &d);
                let mut column = out.column_mut(first + k);
                column.fill(0.0);
                for (to, v) in [0, at.v, at.a, at.al].into_iter().zip(parts) {
                    for i in 0..3 {
                        column.axpy(v.get(i), &j.column(to + i), 1.0);
                    }
                }
            }
        }
        out
    }
}

/// Weights of `dr/dx` at the frame, row-major, from weights `z` of the same derivatives between base rows and motions of
/// the base: `W = A Z B^T`.
pub(super) fn at_frame<T: ff_model::Scalar>(f: &Frame<T>, w: &V3<T>, at: &At, z: &DMatrix<f64>) -> Vec<T> {
    let (d, len) = z.shape();
    let t = T::from_f64;
    let mut q = vec![T::zero(); d * len];
    for c in 0..len {
        let v = |i: usize| V3::new(t(z[(i, c)]), t(z[(i + 1, c)]), t(z[(i + 2, c)]));
        let (lin, ang) = f.screw(&v(0), &v(3));
        for i in 0..3 {
            q[i * len + c] = lin.get(i);
            q[(3 + i) * len + c] = ang.get(i);
        }
        for i in 6..d {
            q[i * len + c] = t(z[(i, c)]);
        }
    }
    for row in q.chunks_exact_mut(len) {
        let v = |i: usize| V3::from_slice(&row[i..i + 3]);
        let parts = f.varied(w, &Base { w: v(0), v: v(at.v), a: v(at.a), al: v(at.al) });
        for (to, p) in [0, at.v, at.a, at.al].into_iter().zip(parts) {
            p.write_to(&mut row[to..]);
        }
    }
    q
}
