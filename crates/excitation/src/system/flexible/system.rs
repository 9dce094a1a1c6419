//! The reduced system and its tangent columns at one point: accelerations, their derivatives, outputs.
//!
//! With `0 = R(z, u, p)`, `u = [a | al | nu']` and columns `s_k = dz/dp_k` (`docs/theory/reduced.md`)
//!
//! ```text
//! M u_k + T_k = 0,   T_k = R_z s_k + R_p,k,   M = R_u.
//! ```

use super::carried::{Base, Carry, CarryBack, unit};
use super::element::{Element, Evaluated, Place};
use ff_dynamics::reduced::{Arm, ArmModel, Frame, JointRow};
use ff_dynamics::sim::Accelerometer;
use ff_model::Scalar;
use ff_model::scalar::Grad;
use ff_model::spatial::vec3::{M3, PackedInertia, V3};
use ff_model::tree::JointCoordinate;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The system, and which columns are carried.
#[derive(Clone, Debug)]
pub(super) struct System {
    pub(super) arm: ArmModel<f64>,
    /// The same with derivatives, for the way back.
    pub(crate) arm_grad: ArmModel<Grad>,
    /// Number of joints that move by themselves, and of every joint of the tree the coordinate that moves it.
    pub(super) joints: usize,
    pub(super) of: Vec<JointCoordinate>,
    /// Joints of the tree between each body and the base.
    pub(crate) above: Vec<Vec<usize>>,
    pub(super) elements: Vec<Element>,
    pub(super) base: [f64; 10],
    /// Wanted parameters of the base with their columns.
    pub(super) base_wanted: Vec<(usize, usize)>,
    /// Passive coordinates.
    pub(super) m: usize,
    /// State `[w 3 | eta | nu]`, and `v 3` if an appendage feels it.
    pub(super) nz: usize,
    pub(super) columns: usize,
    pub(super) accelerometer: Option<Accelerometer>,
}

/// One evaluation and all that the way back needs of it.
pub(super) struct Point {
    pub(super) z: DVector<f64>,
    pub(super) s: DMatrix<f64>,
    pub(super) u: DVector<f64>,
    pub(super) du: DMatrix<f64>,
    pub(super) mass: Cholesky<f64, Dyn>,
    pub(super) rz: DMatrix<f64>,
    pub(super) parts: Vec<Evaluated>,
}

/// One matrix per kind of sensor, channels x columns: derivatives of the outputs of one sample, or gradients over them.
pub(super) struct Outputs {
    pub(super) torque: DMatrix<f64>,
    pub(super) gyro: DMatrix<f64>,
    pub(super) accel: Option<DMatrix<f64>>,
}

pub(super) fn v3(x: &[f64], i: usize) -> V3<f64> {
    V3::from_slice(&x[i..i + 3])
}

pub(super) fn add(to: &mut [f64], i: usize, v: &V3<f64>) {
    to[i] += v.x;
    to[i + 1] += v.y;
    to[i + 2] += v.z;
}

impl System {
    /// Positions, rates and accelerations of all joints of the tree.
    pub(super) fn of_tree(&self, [q, qd, qdd]: [&[f64]; 3]) -> [Vec<f64>; 3] {
        let of =
            |x: &[f64], offset: f64| self.of.iter().map(|c| c.multiplier * x[c.index] + offset * c.offset).collect();
        [of(q, 1.0), of(qd, 0.0), of(qdd, 0.0)]
    }
    pub(super) fn speed(&self) -> bool {
        self.nz > 3 + 2 * self.m
    }
    pub(super) fn v_at(&self) -> usize {
        3 + 2 * self.m
    }
    pub(super) fn base_of(&self, z: &[f64], u: Option<&[f64]>) -> Base<f64> {
        let zero = V3::zero();
        Base {
            w: v3(z, 0),
            v: if self.speed() { v3(z, self.v_at()) } else { zero },
            a: u.map_or(zero, |u| v3(u, 0)),
            al: u.map_or(zero, |u| v3(u, 3)),
        }
    }
    fn frame(&self, e: &Element, numbers: &[f64]) -> Frame<f64> {
        match &e.place {
            Place::Base(f) => **f,
            Place::Moving(i) => Frame::from_slice(&numbers[self.arm.frame_at(*i)..]),
        }
    }
    fn state_of(&self, e: &Element, frame: &Frame<f64>, z: &[f64], u: Option<&[f64]>) -> Vec<f64> {
        let at = e.at();
        let [w, v, a, al] = frame.carried(&self.base_of(z, u));
        let mut x = vec![0.0; at.len];
        w.write_to(&mut x);
        if e.speed {
            v.write_to(&mut x[at.v..]);
        }
        a.write_to(&mut x[at.a..]);
        al.write_to(&mut x[at.al..]);
        x[at.eta..at.nu].copy_from_slice(&z[3 + e.first..][..e.n]);
        x[at.nu..at.v].copy_from_slice(&z[3 + self.m + e.first..][..e.n]);
        if let Some(u) = u {
            x[at.acc..].copy_from_slice(&u[6 + e.first..][..e.n]);
        }
        x
    }
    /// Index in `[w | eta | nu | v]` and then `[a | al | nu']` of entry `c` of an element's motion.
    pub(super) fn global(&self, e: &Element, c: usize) -> Global {
        let at = e.at();
        match c {
            c if c < 3 => Global::State(c),
            c if c < at.nu => Global::State(3 + e.first + c - at.eta),
            c if c < at.v => Global::State(3 + self.m + e.first + c - at.nu),
            c if c < at.a => {
                if self.speed() {
                    Global::State(self.v_at() + c - at.v)
                } else {
                    Global::None
                }
            }
            c if c < at.acc => Global::Rate(c - at.a),
            c => Global::Rate(6 + e.first + c - at.acc),
        }
    }
    /// Rows of the equations of motion from rows of an element.
    pub(super) fn row(&self, e: &Element, r: usize) -> usize {
        if r < 6 { r } else { 6 + e.first + r - 6 }
    }

    /// Accelerations and their derivatives; `None` where the mass matrix is not positive definite.
    pub(super) fn point(&self, numbers: &[f64], z: DVector<f64>, s: DMatrix<f64>) -> Option<Point> {
        let n = 6 + self.m;
        let arm = Arm::from_slice(numbers);
        let mut rigid = arm.ten;
        rigid.add(&PackedInertia::from_params(&self.base));
        let zs = z.as_slice();
        let b = self.base_of(zs, None);
        let mut mass = DMatrix::zeros(n, n);
        for k in 0..3 {
            let (e, o) = (unit(k), V3::zero());
            for (c, (f, t)) in [(k, rigid.momentum(&e, &o)), (3 + k, rigid.momentum(&o, &e))] {
                for i in 0..3 {
                    mass[(i, c)] = f.get(i);
                    mass[(3 + i, c)] = t.get(i);
                }
            }
        }
        let mut rhs = vec![0.0; n];
        let h = &rigid.h;
        add(&mut rhs, 0, &(b.w.cross(&(b.w.cross(h) + arm.dh2)) + arm.ddh));
        add(&mut rhs, 3, &(b.w.cross(&rigid.i.mul(&b.w)) + arm.c.mul(&b.w) + arm.dl));
        for e in self.elements.iter().filter(|e| e.moves()) {
            let (frame, at) = (self.frame(e, numbers), e.at());
            let (m, r) = e.free(&self.state_of(e, &frame, zs, None));
            let d = 6 + e.n;
            let mut j = DMatrix::zeros(d, at.len);
            for i in 0..d {
                for c in 0..d {
                    j[(i, at.a + c)] = m[(i, c)];
                }
            }
            let j = frame.up_columns(&frame.over_base(&at, &b.w, &j));
            let r = frame.up_columns(&DMatrix::from_vec(d, 1, r));
            for i in 0..d {
                rhs[self.row(e, i)] += r[i];
                for c in 0..d {
                    mass[(self.row(e, i), self.row(e, c))] += j[(i, at.a + c)];
                }
            }
        }
        let mass = mass.cholesky()?;
        let u = -mass.solve(&DVector::from_vec(rhs));
        let b = self.base_of(zs, Some(u.as_slice()));
        let mut rz = DMatrix::zeros(n, self.nz);
        let mut t = DMatrix::zeros(n, self.columns);
        let (wh, jw) = (b.w.cross(h) + arm.dh2, rigid.i.mul(&b.w));
        for k in 0..3 {
            let e = unit(k);
            let f = b.w.cross(&e.cross(h)) + e.cross(&wh);
            let m = b.w.cross(&rigid.i.mul(&e)) + e.cross(&jw) + arm.c.mul(&e);
            for i in 0..3 {
                rz[(i, k)] = f.get(i);
                rz[(3 + i, k)] = m.get(i);
            }
        }
        for (k, column) in &self.base_wanted {
            let (f, m) = unit_wrench(*k, &b);
            for i in 0..3 {
                t[(i, *column)] = f.get(i);
                t[(3 + i, *column)] = m.get(i);
            }
        }
        let mut parts = Vec::with_capacity(self.elements.len());
        for e in &self.elements {
            let frame = self.frame(e, numbers);
            let part = e.evaluate(frame, self.state_of(e, &frame, zs, Some(u.as_slice())));
            let rows = frame.up_columns(&part.rp);
            for (c, (_, column)) in e.wanted.iter().enumerate() {
                for i in 0..6 + e.n {
                    t[(self.row(e, i), *column)] += rows[(i, c)];
                }
            }
            if e.moves() {
                let at = e.at();
                let j = frame.up_columns(&frame.over_base(&at, &b.w, &part.j));
                for c in 0..at.a {
                    if let Global::State(g) = self.global(e, c) {
                        for i in 0..6 + e.n {
                            rz[(self.row(e, i), g)] += j[(i, c)];
                        }
                    }
                }
            }
            parts.push(part);
        }
        t.gemm(1.0, &rz, &s, 1.0);
        let mut du = t;
        mass.solve_mut(&mut du);
        du.neg_mut();
        Some(Point { z, s, u, du, mass, rz, parts })
    }

    /// Rates of state and columns.
    pub(super) fn rates(&self, p: &Point) -> (DVector<f64>, DMatrix<f64>) {
        let m = self.m;
        let (mut z, mut s) = (DVector::zeros(self.nz), DMatrix::zeros(self.nz, self.columns));
        let copy = |from: &[f64], u: &[f64], to: &mut [f64]| {
            to[..3].copy_from_slice(&u[3..6]);
            to[3..3 + m].copy_from_slice(&from[3 + m..3 + 2 * m]);
            to[3 + m..3 + 2 * m].copy_from_slice(&u[6..]);
        };
        copy(p.z.as_slice(), p.u.as_slice(), z.as_mut_slice());
        let b = self.base_of(p.z.as_slice(), Some(p.u.as_slice()));
        for k in 0..self.columns {
            copy(p.s.column(k).as_slice(), p.du.column(k).as_slice(), s.column_mut(k).as_mut_slice());
        }
        if self.speed() {
            let at = self.v_at();
            (b.a - b.w.cross(&b.v)).write_to(&mut z.as_mut_slice()[at..]);
            for k in 0..self.columns {
                let (sk, dk) = (p.s.column(k), p.du.column(k));
                let (dw, dv, da) = (v3(sk.as_slice(), 0), v3(sk.as_slice(), at), v3(dk.as_slice(), 0));
                (da - dw.cross(&b.v) - b.w.cross(&dv)).write_to(&mut s.column_mut(k).as_mut_slice()[at..]);
            }
        }
        (z, s)
    }

    /// Derivatives of torques, gyro and accelerometer at a point.
    pub(super) fn outputs(&self, p: &Point, numbers: &[f64]) -> Outputs {
        let mut torque = DMatrix::zeros(self.joints, self.columns);
        let b = self.base_of(p.z.as_slice(), Some(p.u.as_slice()));
        let felt = self.carried_columns(p);
        for (j, of) in self.of.iter().enumerate() {
            let row = JointRow::from_slice(&numbers[self.arm.row_at(j)..]);
            let form = &row.form;
            let by_w = form.gw + form.q.mul(&b.w).scaled(2.0);
            for k in 0..self.columns {
                let (s, d) = (p.s.column(k), p.du.column(k));
                let (dw, da, dal) = (v3(s.as_slice(), 0), v3(d.as_slice(), 0), v3(d.as_slice(), 3));
                torque[(of.index, k)] += of.multiplier * (form.ga.dot(&da) + form.gb.dot(&dal) + by_w.dot(&dw));
            }
            let carried = self.elements.iter().zip(&felt).filter(|(e, _)| self.above[e.host].contains(&j));
            for wrench in carried.map(|c| c.1) {
                for k in 0..self.columns {
                    let c = wrench.column(k);
                    let felt = row.s.dot(&v3(c.as_slice(), 0)) + row.u.dot(&v3(c.as_slice(), 3));
                    torque[(of.index, k)] += of.multiplier * felt;
                }
            }
        }
        let gyro = p.s.rows(0, 3).into_owned();
        let accel = self.accelerometer.map(|acc| {
            let mut out = DMatrix::zeros(3, self.columns);
            let r = V3::from(&acc.mount.pos);
            let turn = M3::from(&acc.mount.rot);
            for k in 0..self.columns {
                let (s, d) = (p.s.column(k), p.du.column(k));
                let (dw, da, dal) = (v3(s.as_slice(), 0), v3(d.as_slice(), 0), v3(d.as_slice(), 3));
                let y = da + dal.cross(&r) + dw.cross(&b.w.cross(&r)) + b.w.cross(&dw.cross(&r));
                turn.tr_mul(&y).write_to(out.column_mut(k).as_mut_slice());
            }
            out
        });
        Outputs { torque, gyro, accel }
    }
    /// Change of every element's wrench about the base origin along every column, `6 x columns`; empty for those on the
    /// base, which no joint feels.
    pub(super) fn carried_columns(&self, p: &Point) -> Vec<DMatrix<f64>> {
        let one = |(e, part): (&Element, &Evaluated)| {
            if e.host == 0 {
                return DMatrix::zeros(6, 0);
            }
            let mut out = DMatrix::zeros(6, self.columns);
            if e.moves() {
                let g = part.frame.up_columns(&part.frame.over_base(&e.at(), &v3(p.z.as_slice(), 0), &part.j));
                out.gemm(1.0, &g.rows(0, 6).into_owned(), &self.motions(e, p), 0.0);
            }
            let rows = part.frame.up_columns(&part.rp);
            for (c, (_, column)) in e.wanted.iter().enumerate() {
                for i in 0..6 {
                    out[(i, *column)] += rows[(i, c)];
                }
            }
            out
        };
        self.elements.iter().zip(&p.parts).map(one).collect()
    }
    /// Columns `[w | eta | nu | v | a | al | nu']` of an element, over the motion of the base.
    pub(super) fn motions(&self, e: &Element, p: &Point) -> DMatrix<f64> {
        DMatrix::from_fn(e.at().len, self.columns, |c, k| match self.global(e, c) {
            Global::State(g) => p.s[(g, k)],
            Global::Rate(g) => p.du[(g, k)],
            Global::None => 0.0,
        })
    }
}

pub(super) enum Global {
    State(usize),
    Rate(usize),
    None,
}

/// Wrench of unit parameter `k` of the base body.
pub(super) fn unit_wrench<T: Scalar>(k: usize, b: &Base<T>) -> (V3<T>, V3<T>) {
    let mut e = [T::zero(); 10];
    e[k] = T::one();
    PackedInertia::from_params(&e).wrench(&b.w, &b.al, &b.a, &M3::field(&b.w, &b.al))
}
