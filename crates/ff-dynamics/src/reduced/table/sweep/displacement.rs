//! What a rigid displacement of a subtree does to its sums, rows and frames, to first order and in closed form.
//!
//! A kinematic parameter displaces what its joint or mount carries by a twist that is fixed in the parent: rotation `a` and shift `l` about the
//! parent's origin, parent axes. With the parent's motion `R, p, w` relative to the base, a point at `r` of what is displaced moves, in
//! base coordinates, by
//!
//! ```text
//! dr = th x r + v,                       th = R a,                  v = R l + p x th,
//! dr. = th. x r + th x r. + v.,          th. = w x th,              th.. = w. x th + w x th.,
//! dr.. = th.. x r + 2 th. x r. + th x r.. + v..
//! ```
//!
//! and the sums of [`crate::reduced::table`] over the points, with `S = int r r^T dm` and `K = int r r.^T dm`, by
//!
//! ```text
//! dh   = th x h + m v,                   dh.  = th. x h + th x h. + m v.,
//! dh.. = th.. x h + 2 th. x h. + th x h.. + m v..,
//! dS   = [th]S + v h^T + transposed,
//! dK   = [th]K + v h.^T + S[th.]^T + K[th]^T + h v.^T,
//! dL.  = th x L. + v x h.. + J th.. + 2 (tr(K) th. - K^T th.) + h x v..
//! ```
//!
//! (the first term of the last line by the Jacobi identity). The screw `(s, u)` of a joint that is carried along changes by
//! `du = th x u`, `ds = th x s + v x u`; rows are bilinear in sums and screw. Against dual numbers through the whole arm: `slopes.rs`.

use super::{Sums, Sweep};
use crate::reduced::table::numbers::{FORM, Frame, ROW};
use crate::work::link::lift;
use ff_model::Scalar;
use ff_model::spatial::vec3::{M3, Pose, S3, V3};

/// A twist of what hangs on a body, per unit of a parameter: fixed in the body, about its origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twist {
    /// The body that it is fixed in, 0 for the base.
    pub(crate) body: usize,
    pub(crate) angular: [f64; 3],
    pub(crate) linear: [f64; 3],
}

/// A twist in base coordinates with two rates: `th`, `v` and their derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Displacement<T> {
    th: [V3<T>; 3],
    v: [V3<T>; 3],
}

impl<T: Scalar> Sweep<T> {
    /// A twist as the base sees it, once all bodies have been moved.
    #[inline(always)]
    pub(crate) fn displacement(&self, by: &Twist) -> Displacement<T> {
        let (m, two) = (&self.moved[by.body], T::from_f64(2.0));
        let (th, l) = (m.r.mul(&lift(&by.angular)), m.r.mul(&lift(&by.linear)));
        let (dth, dl) = (m.w.cross(&th), m.w.cross(&l));
        let (ddth, ddl) = (m.dw.cross_add(&th, &m.w.cross(&dth)), m.dw.cross_add(&l, &m.w.cross(&dl)));
        let v = m.p.cross_add(&th, &l);
        let dv = m.dp.cross_add(&th, &m.p.cross_add(&dth, &dl));
        let ddv = m.ddp.cross_add(&th, &m.dp.scaled(two).cross_add(&dth, &m.p.cross_add(&ddth, &ddl)));
        Displacement { th: [th, dth, ddth], v: [v, dv, ddv] }
    }
    /// Derivative of the sums of body `i` and all that it carries where it is displaced, once everything has been added. That of
    /// the arm's numbers is [`Sums::arm`] of it.
    #[inline(always)]
    pub(crate) fn sums_slope(&self, i: usize, by: &Displacement<T>) -> Sums<T> {
        self.sums[i].displaced(by)
    }
    /// Derivative of the row of the joint that carries body `i`, where that body is displaced, by its own joint or by one below.
    #[inline(always)]
    pub(crate) fn row_slope_within(&self, i: usize, by: &Displacement<T>) -> [T; ROW] {
        let (s, u) = self.screw(i);
        let ([th, ..], [v, ..]) = (&by.th, &by.v);
        let (ds, du) = (th.cross_add(&s, &v.cross(&u)), th.cross(&u));
        let mut row = self.sums[i].row(&ds, &du);
        let of_sums = self.sums[i].displaced(by).row(&s, &u);
        row[..FORM].iter_mut().zip(&of_sums).for_each(|(r, &x)| *r += x);
        row
    }
    /// Derivative of the row of the joint that carries body `i`, where something above changes its sums by `change` and leaves the joint
    /// where it is.
    #[inline(always)]
    pub(crate) fn row_slope_below(&self, i: usize, change: &Sums<T>) -> [T; ROW] {
        let (s, u) = self.screw(i);
        let mut row = change.row(&s, &u);
        row[FORM..].iter_mut().for_each(|x| *x = T::zero());
        row
    }
    /// Derivative of a frame that is displaced.
    #[inline(always)]
    pub(crate) fn frame_slope(&self, host: usize, mount: &Pose<T>, by: &Displacement<T>) -> Frame<T> {
        let at = self.moved[host].frame(mount);
        let ([th, dth, ddth], [v, dv, ddv]) = (&by.th, &by.v);
        let twice = dth.scaled(T::from_f64(2.0));
        let mut pose = at.pose;
        pose.r = M3([th.cross(&at.pose.r.0[0]), th.cross(&at.pose.r.0[1]), th.cross(&at.pose.r.0[2])]);
        pose.p = th.cross_add(&at.pose.p, v);
        Frame {
            pose,
            moving: true,
            dp: dth.cross_add(&at.pose.p, &th.cross_add(&at.dp, dv)),
            ddp: ddth.cross_add(&at.pose.p, &twice.cross_add(&at.dp, &th.cross_add(&at.ddp, ddv))),
            w: th.cross_add(&at.w, dth),
            dw: dth.cross_add(&at.w, &th.cross_add(&at.dw, ddth)),
        }
    }
}

impl<T: Scalar> Sums<T> {
    /// Derivative of the sums of what is displaced.
    #[inline(always)]
    fn displaced(&self, by: &Displacement<T>) -> Self {
        let (h, dh, ddh, k) = (&self.h, &self.dh, &self.ddh, &self.k.0);
        let ([th, dth, ddth], [v, dv, ddv]) = (&by.th, &by.v);
        let two = T::from_f64(2.0);
        let twice = dth.scaled(two);
        let s = [self.rr.col(0), self.rr.col(1), self.rr.col(2)];
        // Columns of [th]S + v h^T, to which its transpose comes.
        let half = [
            v.scale_add(h.x, &th.cross(&s[0])),
            v.scale_add(h.y, &th.cross(&s[1])),
            v.scale_add(h.z, &th.cross(&s[2])),
        ];
        let rr = S3 {
            xx: half[0].x.scale(2.0),
            xy: half[0].y + half[1].x,
            yy: half[1].y.scale(2.0),
            xz: half[0].z + half[2].x,
            yz: half[1].z + half[2].y,
            zz: half[2].z.scale(2.0),
        };
        // Rows of S[th.]^T + K[th]^T: what row i of S and of K, vectors int r_i r dm and int r_i r. dm, becomes.
        let e = [
            dth.cross_add(&s[0], &th.cross(&V3::new(k[0].x, k[1].x, k[2].x))),
            dth.cross_add(&s[1], &th.cross(&V3::new(k[0].y, k[1].y, k[2].y))),
            dth.cross_add(&s[2], &th.cross(&V3::new(k[0].z, k[1].z, k[2].z))),
        ];
        let of_k = M3([
            th.cross_add(&k[0], &v.scale_add(dh.x, &h.scale_add(dv.x, &V3::new(e[0].x, e[1].x, e[2].x)))),
            th.cross_add(&k[1], &v.scale_add(dh.y, &h.scale_add(dv.y, &V3::new(e[0].y, e[1].y, e[2].y)))),
            th.cross_add(&k[2], &v.scale_add(dh.z, &h.scale_add(dv.z, &V3::new(e[0].z, e[1].z, e[2].z)))),
        ]);
        let trace = k[0].x + k[1].y + k[2].z;
        let coriolis = twice.scaled(trace) - self.k.tr_mul(&twice);
        let dl = v.cross_add(ddh, &h.cross_add(ddv, &(self.inertia(ddth) + coriolis)));
        Self {
            m: T::zero(),
            h: v.scale_add(self.m, &th.cross(h)),
            dh: dv.scale_add(self.m, &dth.cross_add(h, &th.cross(dh))),
            ddh: ddv.scale_add(self.m, &ddth.cross_add(h, &twice.cross_add(dh, &th.cross(ddh)))),
            rr,
            k: of_k,
            dl: th.cross_add(&self.dl, &dl),
        }
    }
}
