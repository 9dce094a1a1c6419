//! The way back through one point of the tangent equations ([`super::system`]).
//!
//! Given the gradient `g_k` of a scalar over `u_k` and `g_0` over `u`, the multipliers are `rho_k = -M^-1 g_k`; with the
//! second-order scalar `Psi = sum_k rho_k . DR[s_k, u_k, e_k]` (`DR` the directional derivative of `R`) and
//! `rho_0 = -M^-1 (g_0 + dPsi/du)` the gradient over anything else is that of `Psi + rho_0 . R`. The columns enter `Psi`
//! through the small matrix `sum_k rho_k [s_k; u_k]^T` alone, whatever their number.

use super::carried::{Base, Carry, CarryBack, at_frame, unit};
use super::element::{Element, Evaluated, Place};
use super::system::{Global, Outputs, Point, System, add, unit_wrench, v3};
use ff_dynamics::reduced::{Arm, Frame, JointRow, TorqueForm};
use ff_model::Scalar;
use ff_model::scalar::Grad;
use ff_model::spatial::vec3::{M3, PackedInertia, V3};
use nalgebra::{DMatrix, DVector};

/// Numbers of the arm and of a frame, and where the screw stands in a joint's row.
const ARM: usize = Arm::<f64>::LEN;
const FRAME: usize = Frame::<f64>::LEN;
const SCREW: usize = TorqueForm::<f64>::LEN;

impl System {
    /// The way back through one point: from gradients over the rates of state and columns, and over the outputs where
    /// there is a sample, to those over state, columns and numbers of the table, which are added.
    pub(super) fn pull(
        &self,
        p: &Point,
        numbers: &[f64],
        over: (&DVector<f64>, &DMatrix<f64>),
        sample: Option<&Outputs>,
        (over_z, over_s, over_numbers): (&mut DVector<f64>, &mut DMatrix<f64>, &mut [f64]),
    ) {
        let (m, n, kk) = (self.m, 6 + self.m, self.columns);
        let b = self.base_of(p.z.as_slice(), Some(p.u.as_slice()));
        let mut g = DMatrix::zeros(n, kk);
        let mut g0 = DVector::zeros(n);
        let split = |from: &[f64], g: &mut [f64], to: &mut [f64]| {
            for i in 0..3 {
                g[3 + i] += from[i];
            }
            for i in 0..m {
                g[6 + i] += from[3 + m + i];
                to[3 + m + i] += from[3 + i];
            }
        };
        split(over.0.as_slice(), g0.as_mut_slice(), over_z.as_mut_slice());
        for k in 0..kk {
            split(over.1.column(k).as_slice(), g.column_mut(k).as_mut_slice(), over_s.column_mut(k).as_mut_slice());
        }
        if self.speed() {
            let at = self.v_at();
            let y = v3(over.0.as_slice(), at);
            add(g0.as_mut_slice(), 0, &y);
            add(over_z.as_mut_slice(), 0, &-b.v.cross(&y));
            add(over_z.as_mut_slice(), at, &-y.cross(&b.w));
            for k in 0..kk {
                let y = v3(over.1.column(k).as_slice(), at);
                let (dw, dv) = (v3(p.s.column(k).as_slice(), 0), v3(p.s.column(k).as_slice(), at));
                add(g.column_mut(k).as_mut_slice(), 0, &y);
                add(over_s.column_mut(k).as_mut_slice(), 0, &-b.v.cross(&y));
                add(over_s.column_mut(k).as_mut_slice(), at, &-y.cross(&b.w));
                add(over_z.as_mut_slice(), at, &-y.cross(&dw));
                add(over_z.as_mut_slice(), 0, &-dv.cross(&y));
            }
        }
        // Weights of the wrench of every element in the joint torques: a twist about the base origin per column.
        let mut twists: Vec<DMatrix<f64>> = vec![DMatrix::zeros(6, kk); self.elements.len()];
        if let Some(o) = sample {
            self.pull_sample(p, numbers, o, &b, (&mut g, over_z, over_s, over_numbers), &mut twists);
        }
        let mut rho = p.mass.solve(&g);
        rho.neg_mut();
        over_s.gemm_tr(1.0, &p.rz, &rho, 1.0);

        // dPsi/du, part by part.
        let mut half = Vec::with_capacity(self.elements.len());
        for (k, column) in &self.base_wanted {
            let mut e = [0.0; 10];
            e[*k] = 1.0;
            let c = rho.column(*column);
            let (f, t) = PackedInertia::from_params(&e).momentum(&v3(c.as_slice(), 0), &v3(c.as_slice(), 3));
            add(g0.as_mut_slice(), 0, &f);
            add(g0.as_mut_slice(), 3, &t);
        }
        for ((e, part), twist) in self.elements.iter().zip(&p.parts).zip(&twists) {
            let (at, d) = (e.at(), 6 + e.n);
            let weights = DMatrix::from_fn(d, kk, |i, k| {
                let own = rho[(self.row(e, i), k)];
                if i < 6 { own + twist[(i, k)] } else { own }
            });
            let z = if e.moves() { &weights * self.motions(e, p).transpose() } else { DMatrix::zeros(d, at.len) };
            let on_params = DMatrix::from_fn(d, e.wanted.len(), |i, c| weights[(i, e.wanted[c].1)]);
            let w = at_frame(&part.frame, &b.w, &at, &z);
            let mut v = on_params.clone();
            for mut c in v.column_iter_mut() {
                let (lin, ang) = part.frame.screw(&V3::new(c[0], c[1], c[2]), &V3::new(c[3], c[4], c[5]));
                for i in 0..3 {
                    (c[i], c[3 + i]) = (lin.get(i), ang.get(i));
                }
            }
            let x = e.second(&part.x, &w, &v);
            let f = part.frame.pose.r.mul(&v3(&x, at.a));
            add(g0.as_mut_slice(), 0, &f);
            add(g0.as_mut_slice(), 3, &(part.frame.pose.r.mul(&v3(&x, at.al)) + part.frame.pose.p.cross(&f)));
            for i in 0..e.n {
                g0[6 + e.first + i] += x[at.acc + i];
            }
            half.push((z, on_params, x));
        }
        let rho0 = -p.mass.solve(&g0);
        for ((e, part), (z, on_params, x)) in self.elements.iter().zip(&p.parts).zip(half) {
            self.pull_element(e, part, &b, (&z, &on_params, x, &rho0), over_z, over_numbers);
        }
        self.pull_base(p, numbers, &b, (&rho, &rho0), over_z, over_numbers);
    }

    /// Outputs of a sample: gradients over accelerations and state, and the rows of the joints.
    fn pull_sample(
        &self,
        p: &Point,
        numbers: &[f64],
        o: &Outputs,
        b: &Base<f64>,
        (g, over_z, over_s, over_numbers): (&mut DMatrix<f64>, &mut DVector<f64>, &mut DMatrix<f64>, &mut [f64]),
        twists: &mut [DMatrix<f64>],
    ) {
        let kk = self.columns;
        let wrenches = self.carried_columns(p);
        for (j, of) in self.of.iter().enumerate() {
            let at = self.arm.row_at(j);
            let row = JointRow::from_slice(&numbers[at..]);
            let form = &row.form;
            let by_w = form.gw + form.q.mul(&b.w).scaled(2.0);
            let (mut da, mut dal, mut dw) = (V3::zero(), V3::zero(), V3::zero());
            for k in 0..kk {
                let c = of.multiplier * o.torque[(of.index, k)];
                add(g.column_mut(k).as_mut_slice(), 0, &form.ga.scaled(c));
                add(g.column_mut(k).as_mut_slice(), 3, &form.gb.scaled(c));
                add(over_s.column_mut(k).as_mut_slice(), 0, &by_w.scaled(c));
                let (s, d) = (p.s.column(k), p.du.column(k));
                da += v3(d.as_slice(), 0).scaled(c);
                dal += v3(d.as_slice(), 3).scaled(c);
                dw += v3(s.as_slice(), 0).scaled(c);
            }
            add(over_z.as_mut_slice(), 0, &form.q.mul(&dw).scaled(2.0));
            add(over_numbers, at, &da);
            add(over_numbers, at + 3, &dal);
            add(over_numbers, at + 6, &dw);
            // d/dQ of 2 w.Q dw, each off-diagonal element standing for two.
            let q = |a: usize, c: usize| b.w.get(a) * dw.get(c) + b.w.get(c) * dw.get(a);
            for (i, (a, c)) in [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)].into_iter().enumerate() {
                over_numbers[at + 9 + i] += if a == c { q(a, c) } else { 2.0 * q(a, c) };
            }
            for i in (0..self.elements.len()).filter(|&i| self.above[self.elements[i].host].contains(&j)) {
                for k in 0..kk {
                    let c = of.multiplier * o.torque[(of.index, k)];
                    add(twists[i].column_mut(k).as_mut_slice(), 0, &row.s.scaled(c));
                    add(twists[i].column_mut(k).as_mut_slice(), 3, &row.u.scaled(c));
                    let wrench = wrenches[i].column(k);
                    add(over_numbers, at + SCREW, &v3(wrench.as_slice(), 0).scaled(c));
                    add(over_numbers, at + SCREW + 3, &v3(wrench.as_slice(), 3).scaled(c));
                }
            }
        }
        for ((e, part), twist) in self.elements.iter().zip(&p.parts).zip(twists).filter(|((e, _), _)| e.host > 0) {
            if !e.moves() {
                continue;
            }
            let at = e.at();
            let over = part.frame.up_columns(&part.frame.over_base(&at, &b.w, &part.j));
            let back = over.rows(0, 6).tr_mul(twist);
            for c in 0..at.len {
                for k in 0..kk {
                    match self.global(e, c) {
                        Global::State(i) => over_s[(i, k)] += back[(c, k)],
                        Global::Rate(i) => g[(i, k)] += back[(c, k)],
                        Global::None => {}
                    }
                }
            }
        }
        for k in 0..kk {
            for i in 0..3 {
                over_s[(i, k)] += o.gyro[(i, k)];
            }
        }
        if let (Some(acc), Some(over)) = (&self.accelerometer, &o.accel) {
            let (r, turn) = (V3::from(&acc.mount.pos), M3::from(&acc.mount.rot));
            for k in 0..kk {
                let c = turn.mul(&v3(over.column(k).as_slice(), 0));
                let dw = v3(p.s.column(k).as_slice(), 0);
                add(g.column_mut(k).as_mut_slice(), 0, &c);
                add(g.column_mut(k).as_mut_slice(), 3, &r.cross(&c));
                // c . (dw x (w x r) + w x (dw x r)) over dw, and over w.
                let both = |w: &V3<f64>| r.cross(&c.cross(w)) + w.cross(&r).cross(&c);
                add(over_s.column_mut(k).as_mut_slice(), 0, &both(&b.w));
                add(over_z.as_mut_slice(), 0, &both(&dw));
            }
        }
    }

    /// What `Psi + rho_0 . R` of an element owes to the state and to its frame.
    fn pull_element(
        &self,
        e: &Element,
        part: &Evaluated,
        b: &Base<f64>,
        (z, on_params, mut x, rho0): (&DMatrix<f64>, &DMatrix<f64>, Vec<f64>, &DVector<f64>),
        over_z: &mut DVector<f64>,
        over_numbers: &mut [f64],
    ) {
        let (at, d) = (e.at(), 6 + e.n);
        let mut twist0 = [0.0; 6];
        if e.moves() {
            twist0.copy_from_slice(&rho0.as_slice()[..6]);
            let (lin, ang) = part.frame.screw(&v3(&twist0, 0), &v3(&twist0, 3));
            let mut weights = vec![0.0; d];
            lin.write_to(&mut weights);
            ang.write_to(&mut weights[3..]);
            for i in 0..e.n {
                weights[6 + i] = rho0[6 + e.first + i];
            }
            for c in 0..at.len {
                x[c] += (0..d).map(|i| weights[i] * part.j[(i, c)]).sum::<f64>();
            }
        }
        for c in at.eta..at.v {
            if let Global::State(g) = self.global(e, c) {
                over_z[g] += x[c];
            }
        }
        if self.speed() {
            add(over_z.as_mut_slice(), self.v_at(), &part.frame.pose.r.mul(&v3(&x, at.v)));
        }
        // Over the angular velocity of the base and, where it moves, the frame.
        let moving = matches!(e.place, Place::Moving(_));
        let count = 3 + if moving { FRAME } else { 0 };
        let mut seeds = Vec::with_capacity(count);
        let mut numbers = Vec::with_capacity(FRAME);
        let f = &part.frame;
        for v in [&f.pose.r.0[0], &f.pose.r.0[1], &f.pose.r.0[2], &f.pose.p, &f.dp, &f.ddp, &f.w, &f.dw] {
            numbers.extend([v.x, v.y, v.z]);
        }
        seeds.extend([b.w.x, b.w.y, b.w.z].map(Grad::constant));
        seeds.extend(numbers.iter().map(|&x| Grad::constant(x)));
        chunks(&mut seeds, count, |y| {
            let c = |v: &V3<f64>| V3::new(Grad::constant(v.x), Grad::constant(v.y), Grad::constant(v.z));
            let (w, f) = (V3::from_slice(y), Frame::from_slice(&y[3..]));
            let mut sum = Grad::constant(0.0);
            if e.moves() {
                for (i, q) in at_frame(&f, &w, &at, z).chunks_exact(at.len).enumerate() {
                    for (c, q) in q.iter().enumerate() {
                        sum += q.scale(part.j[(i, c)]);
                    }
                }
            }
            let mut weigh = |twist: &[f64], r: &[f64]| {
                let (lin, ang) = f.screw(&c(&v3(twist, 0)), &c(&v3(twist, 3)));
                sum += lin.dot(&c(&v3(r, 0))) + ang.dot(&c(&v3(r, 3)));
            };
            for k in 0..e.wanted.len() {
                weigh(on_params.column(k).as_slice(), part.rp.column(k).as_slice());
            }
            if e.moves() {
                weigh(&twist0, &part.r);
            }
            let [wh, v, a, al] = f.carried(&Base { w, v: c(&b.v), a: c(&b.a), al: c(&b.al) });
            for (i, y) in [(0, wh), (at.v, v), (at.a, a), (at.al, al)] {
                sum += y.dot(&c(&v3(&x, i)));
            }
            sum
        })
        .into_iter()
        .enumerate()
        .for_each(|(i, slope)| match (&e.place, i) {
            (_, 0..3) => over_z[i] += slope,
            (Place::Moving(site), _) => over_numbers[self.arm.frame_at(*site) + i - 3] += slope,
            _ => {}
        });
    }

    /// What `Psi + rho_0 . R` of base and arm owes to the angular velocity and to the arm.
    fn pull_base(
        &self,
        p: &Point,
        numbers: &[f64],
        b: &Base<f64>,
        (rho, rho0): (&DMatrix<f64>, &DVector<f64>),
        over_z: &mut DVector<f64>,
        over_numbers: &mut [f64],
    ) {
        // sum_k rho_k (dw, dal, da)_k^T.
        let part = |first: usize, m: &DMatrix<f64>| rho.rows(0, 6) * m.rows(first, 3).transpose();
        let by: [DMatrix<f64>; 3] = [part(0, &p.s), part(3, &p.du), part(0, &p.du)];
        let mut seeds: Vec<Grad> = [b.w.x, b.w.y, b.w.z].map(Grad::constant).to_vec();
        seeds.extend(numbers[..ARM].iter().map(|&x| Grad::constant(x)));
        let slopes = chunks(&mut seeds, 3 + ARM, |y| {
            let c = |v: &V3<f64>| V3::new(Grad::constant(v.x), Grad::constant(v.y), Grad::constant(v.z));
            let (w, arm) = (V3::from_slice(y), Arm::from_slice(&y[3..]));
            let mut t = arm.ten;
            t.add(&PackedInertia::from_params(&self.base.map(Grad::constant)));
            let mut sum = Grad::constant(0.0);
            let mut weigh = |x: &[f64], f: &V3<Grad>, n: &V3<Grad>| {
                sum += f.dot(&c(&v3(x, 0))) + n.dot(&c(&v3(x, 3)));
            };
            let (wh, jw) = (w.cross(&t.h) + arm.dh2, t.i.mul(&w));
            for k in 0..3 {
                let e = unit(k);
                let f = w.cross(&e.cross(&t.h)) + e.cross(&wh);
                let n = w.cross(&t.i.col(k)) + e.cross(&jw) + arm.c.mul(&e);
                weigh(by[0].column(k).as_slice(), &f, &n);
                weigh(by[1].column(k).as_slice(), &e.cross(&t.h), &t.i.col(k));
                weigh(by[2].column(k).as_slice(), &e.scaled(t.m), &t.h.cross(&e));
            }
            let (a, al) = (c(&b.a), c(&b.al));
            let f = a.scaled(t.m) + al.cross(&t.h) + w.cross(&wh) + arm.ddh;
            let n = t.i.mul(&al) + t.h.cross(&a) + w.cross(&jw) + arm.c.mul(&w) + arm.dl;
            weigh(&rho0.as_slice()[..6], &f, &n);
            let moving = Base { w, v: V3::zero(), a, al };
            for (k, column) in &self.base_wanted {
                let (f, n) = unit_wrench(*k, &moving);
                weigh(rho.column(*column).as_slice(), &f, &n);
            }
            sum
        });
        for (i, slope) in slopes.into_iter().enumerate() {
            if i < 3 {
                over_z[i] += slope;
            } else {
                over_numbers[i - 3] += slope;
            }
        }
    }
}

/// Gradient over the first `count` of `seeds`.
fn chunks(seeds: &mut [Grad], count: usize, f: impl Fn(&[Grad]) -> Grad) -> Vec<f64> {
    const CHUNK: usize = ff_model::scalar::DIRECTIONS;
    let mut out = Vec::with_capacity(count);
    for first in (0..count).step_by(CHUNK) {
        let n = CHUNK.min(count - first);
        for k in 0..n {
            seeds[first + k].eps[k] = 1.0;
        }
        let y = f(seeds);
        for k in 0..n {
            seeds[first + k].eps[k] = 0.0;
            out.push(y.eps[k]);
        }
    }
    out
}
