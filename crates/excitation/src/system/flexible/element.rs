//! One appendage, or one link whose parameters are wanted: its equations, first and second derivatives.
//!
//! At the frame of the element, with the motion `x = [w | eta | nu | v | a | al | nu']` (angular velocity, own coordinates
//! and rates, velocity, classical and angular acceleration of the frame, own accelerations), the residual is
//! `r = M(eta) [a - w x v; al; nu'] + h(w, v, eta, nu)`, `6+n` rows. Second derivatives come from nested duals through
//! the same equations; those along accelerations are `dM/d eta`. Pairs whose second derivative is identically zero (a
//! stiffness and an angular velocity) are found once, at three general points, and left out: equations of motion are
//! analytic, so that what is zero there is zero everywhere.

use ff_dynamics::reduced::Frame;
use ff_model::port::{PortView, port_len};
use ff_model::scalar::{D1, D2, LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{M3, PackedInertia, V3};
use ff_model::tree::Mounted;
use ff_model::{Model, Motion, Params, PortAccel, PortMatrix, PortState};
use nalgebra::DMatrix;

/// What it is.
#[derive(Clone, Debug)]
enum Kind {
    Port(Mounted),
    /// A link: its mass is part of the arm, its parameters only make columns.
    Link,
}

/// An element and where it is.
#[derive(Clone, Debug)]
pub(super) struct Element {
    kind: Kind,
    pub(super) host: usize,
    /// Frame at rest in the base, or index among the moving ones.
    pub(super) place: Place,
    /// Own coordinates, and where they begin.
    pub(super) n: usize,
    pub(super) first: usize,
    params: Vec<f64>,
    /// Own parameters that are wanted, with their columns.
    pub(super) wanted: Vec<(usize, usize)>,
    /// Whether the velocity of the frame plays a part.
    pub(super) speed: bool,
    /// What can be other than zero.
    pattern: Pattern,
}

/// Second derivatives that are not identically zero.
#[derive(Clone, Debug, Default)]
struct Pattern {
    /// Entries `b <= a` of `x`.
    pairs: Vec<(usize, Vec<usize>)>,
    /// Wanted parameters by place in the list, and entries of `x`.
    params: Vec<(usize, Vec<usize>)>,
    /// Coordinates and wanted parameters that the mass matrix depends on.
    mass: Vec<usize>,
    mass_params: Vec<usize>,
}

#[derive(Clone, Debug)]
pub(super) enum Place {
    Base(Box<Frame<f64>>),
    Moving(usize),
}

/// Offsets within `x`.
#[derive(Clone, Copy, Debug)]
pub(super) struct At {
    pub(super) eta: usize,
    pub(super) nu: usize,
    pub(super) v: usize,
    pub(super) a: usize,
    pub(super) al: usize,
    pub(super) acc: usize,
    pub(super) len: usize,
}

impl At {
    pub(super) fn new(n: usize) -> Self {
        let (eta, nu, v) = (3, 3 + n, 3 + 2 * n);
        Self { eta, nu, v, a: v + 3, al: v + 6, acc: v + 9, len: v + 9 + n }
    }
}

/// An element at one point.
#[derive(Clone, Debug)]
pub(super) struct Evaluated {
    pub(super) frame: Frame<f64>,
    pub(super) x: Vec<f64>,
    /// `r`, `dr/dx` and `dr/dp` of the wanted parameters, at the frame.
    pub(super) r: Vec<f64>,
    pub(super) j: DMatrix<f64>,
    pub(super) rp: DMatrix<f64>,
}

impl Element {
    pub(super) fn port(model: &Model, params: &Params<f64>, k: usize, place: Place) -> Self {
        let a = model.appendages()[k].clone();
        let speed = !a.decl().galilean;
        Self {
            host: a.host,
            place,
            n: a.dim(),
            first: a.coord_offset,
            params: params.appendage(model, k).to_vec(),
            wanted: Vec::new(),
            speed,
            pattern: Pattern::default(),
            kind: Kind::Port(a),
        }
    }
    pub(super) fn link(params: &Params<f64>, body: usize, place: Place) -> Self {
        let params = params.body(body).to_params().to_vec();
        let pattern = Pattern::default();
        Self { kind: Kind::Link, host: body, place, n: 0, first: 0, params, wanted: Vec::new(), speed: false, pattern }
    }
    /// Whether it has a part in the equations of motion of its own.
    pub(super) fn moves(&self) -> bool {
        matches!(self.kind, Kind::Port(_))
    }
    pub(super) fn at(&self) -> At {
        At::new(self.n)
    }
    fn dim(&self) -> usize {
        6 + self.n
    }
    fn residual<T: ModelScalar>(&self, p: &[T], x: &[T], scratch: &mut [T], r: &mut [T]) {
        let at = self.at();
        let v3 = |i: usize| V3::from_slice(&x[i..i + 3]);
        let (w, v, a, al) = (v3(0), v3(at.v), v3(at.a), v3(at.al));
        match &self.kind {
            Kind::Port(m) => {
                let lin = a - w.cross(&v);
                let host = Motion { lin: v.into(), ang: w.into() };
                let s = PortState { host, eta: &x[at.eta..at.nu], nu: &x[at.nu..at.v] };
                let acc = PortAccel { host: Motion { lin: lin.into(), ang: al.into() }, nu: &x[at.acc..] };
                T::port(&*m.appendage).residual(p, &s, &acc, &mut PortMatrix::over(self.n, scratch), r);
            }
            Kind::Link => {
                let (f, n) = PackedInertia::from_params(p).wrench(&w, &al, &a, &M3::field(&w, &al));
                f.write_to(r);
                n.write_to(&mut r[3..]);
            }
        }
    }
    /// The residual, of which only second derivatives are read: `M` depends on coordinates and parameters alone, so that
    /// the accelerations play no part where neither direction is a coordinate.
    fn curved(&self, p: &[D2], x: &[D2], flat: bool, scratch: &mut [D2], r: &mut [D2]) {
        let at = self.at();
        match &self.kind {
            Kind::Port(m) if flat && !self.speed => {
                let v3 = |i: usize| V3::from_slice(&x[i..i + 3]);
                let host = Motion { lin: v3(at.v).into(), ang: v3(0).into() };
                let s = PortState { host, eta: &x[at.eta..at.nu], nu: &x[at.nu..at.v] };
                D2::port(&*m.appendage).bias(p, &s, r);
            }
            _ => self.residual(p, x, scratch, r),
        }
    }
    /// The mass matrix, in `buffer`.
    fn inertia<'a, T: ModelScalar>(&self, p: &[T], eta: &[T], buffer: &'a mut [T]) -> PortView<'a, T> {
        let mut m = PortMatrix::new(self.n, buffer);
        match &self.kind {
            Kind::Port(port) => T::port(&*port.appendage).inertia(p, eta, &mut m),
            Kind::Link => m.set_host(&PackedInertia::from_params(p)),
        }
        PortView::new(self.n, buffer)
    }
    /// Mass matrix and residual without accelerations.
    pub(super) fn free(&self, x: &[f64]) -> (DMatrix<f64>, Vec<f64>) {
        let at = self.at();
        let (mut m, mut r) = (vec![0.0; port_len(self.n)], vec![0.0; self.dim()]);
        self.residual(&self.params, x, &mut m, &mut r);
        (self.inertia(&self.params, &x[at.eta..at.nu], &mut m).dense(), r)
    }
    /// Residual and first derivatives at `x`.
    pub(super) fn evaluate(&self, frame: Frame<f64>, x: Vec<f64>) -> Evaluated {
        let (d, at, n) = (self.dim(), self.at(), self.n);
        let (mut m, mut r) = (vec![0.0; port_len(n)], vec![0.0; d]);
        self.residual(&self.params, &x, &mut m, &mut r);
        let mut j = DMatrix::zeros(d, at.len);
        let mut rp = DMatrix::zeros(d, self.wanted.len());
        let mass = self.inertia(&self.params, &x[at.eta..at.nu], &mut m);
        for row in 0..d {
            for c in 0..d {
                j[(row, at.a + c)] = mass.get(row, c);
            }
        }
        match &self.kind {
            Kind::Port(port) => {
                let v3 = |i: usize| V3::from_slice(&x[i..i + 3]);
                let (w, v, a, al) = (v3(0), v3(at.v), v3(at.a), v3(at.al));
                let host = Motion { lin: v.into(), ang: w.into() };
                let s = PortState { host, eta: &x[at.eta..at.nu], nu: &x[at.nu..at.v] };
                let lin = (a - w.cross(&v)).into();
                let acc = PortAccel { host: Motion { lin, ang: al.into() }, nu: &x[at.acc..] };
                let tangent = f64::tangent(&*port.appendage);
                let mut columns = vec![0.0; d * (3 + 2 * n).max(self.params.len())];
                if !self.speed {
                    tangent.jacobian(&self.params, &s, &acc, &mut columns);
                    j.as_mut_slice()[..d * (3 + 2 * n)].copy_from_slice(&columns[..d * (3 + 2 * n)]);
                }
                if !self.wanted.is_empty() {
                    tangent.regressor(&self.params, &s, &acc, &mut columns);
                    for (c, (own, _)) in self.wanted.iter().enumerate() {
                        rp.column_mut(c).copy_from_slice(&columns[own * d..(own + 1) * d]);
                    }
                }
            }
            Kind::Link => {
                for (c, (own, _)) in self.wanted.iter().enumerate() {
                    let mut p = [0.0; 10];
                    p[*own] = 1.0;
                    self.residual(&p, &x, &mut m, &mut r);
                    rp.column_mut(c).copy_from_slice(&r);
                }
                self.residual(&self.params, &x, &mut m, &mut r);
            }
        }
        if self.speed {
            let p: Vec<D1> = self.params.iter().map(|&p| D1::constant(p)).collect();
            let mut y: Vec<D1> = x.iter().map(|&x| D1::constant(x)).collect();
            let z = D1::constant(0.0);
            let (mut scratch, mut out) = (vec![z; port_len(n)], vec![z; d]);
            for c in 0..at.a {
                y[c].eps[0] = 1.0;
                self.residual(&p, &y, &mut scratch, &mut out);
                y[c].eps[0] = 0.0;
                j.column_mut(c).iter_mut().zip(&out).for_each(|(o, r)| *o = r.eps[0]);
            }
        }
        Evaluated { frame, x, r, j, rp }
    }
    /// Finds out what is identically zero; to be called once all wanted parameters are known.
    pub(super) fn probe(&mut self) {
        let at = self.at();
        let last = if self.speed { at.a } else { at.v };
        self.pattern = Pattern {
            pairs: (0..if self.moves() { last } else { 0 }).map(|a| (a, (0..=a).collect())).collect(),
            params: (0..self.wanted.len()).map(|k| (k, (0..last).collect())).collect(),
            mass: (0..if self.moves() { self.n } else { 0 }).collect(),
            mass_params: (0..self.wanted.len()).collect(),
        };
        let mut met = Pattern::default();
        for round in 0..3 {
            let x: Vec<f64> = (0..at.len).map(|i| (1.7 * i as f64 + 2.3 * f64::from(round) + 0.4).sin()).collect();
            let general = |h: &[f64]| h.iter().any(|x| *x != 0.0);
            self.each(
                &x,
                |a, b, h| {
                    if general(h) {
                        note(&mut met.pairs, a, b)
                    }
                },
                |k, b, h| {
                    if general(h) {
                        note(&mut met.params, k, b)
                    }
                },
                |l, dm| {
                    if general(dm) && !met.mass.contains(&l) {
                        met.mass.push(l)
                    }
                },
                |k, dm| {
                    if general(dm) && !met.mass_params.contains(&k) {
                        met.mass_params.push(k)
                    }
                },
            );
        }
        self.pattern = met;
    }
    /// Hands out `d^2r / dx_a dx_b`, `d^2r / dp_k dx_b`, `dM / d eta_l` and `dM / dp_k` (row-major), whatever is not
    /// identically zero.
    fn each(
        &self,
        x: &[f64],
        mut pair: impl FnMut(usize, usize, &[f64]),
        mut param: impl FnMut(usize, usize, &[f64]),
        mut mass: impl FnMut(usize, &[f64]),
        mut mass_param: impl FnMut(usize, &[f64]),
    ) {
        let (d, at) = (self.dim(), self.at());
        let lift = |x: f64| D2::constant(D1::constant(x));
        let mut p: Vec<D2> = self.params.iter().map(|&p| lift(p)).collect();
        let mut y: Vec<D2> = x.iter().map(|&x| lift(x)).collect();
        let (mut scratch, mut r, mut h) = (vec![lift(0.0); port_len(self.n)], vec![lift(0.0); d], vec![0.0; d]);
        let curls = |i: usize| (at.eta..at.nu).contains(&i);
        for (a, others) in &self.pattern.pairs {
            y[*a].eps[0].re = 1.0;
            for &b in others {
                y[b].re.eps[0] = 1.0;
                self.curved(&p, &y, !curls(*a) && !curls(b), &mut scratch, &mut r);
                y[b].re.eps[0] = 0.0;
                h.iter_mut().zip(&r).for_each(|(h, r)| *h = r.eps[0].eps[0]);
                pair(*a, b, &h);
            }
            y[*a].eps[0].re = 0.0;
        }
        for (k, others) in &self.pattern.params {
            let own = self.wanted[*k].0;
            p[own].eps[0].re = 1.0;
            for &b in others {
                y[b].re.eps[0] = 1.0;
                self.curved(&p, &y, !curls(b), &mut scratch, &mut r);
                y[b].re.eps[0] = 0.0;
                h.iter_mut().zip(&r).for_each(|(h, r)| *h = r.eps[0].eps[0]);
                param(*k, b, &h);
            }
            p[own].eps[0].re = 0.0;
        }
        // Along accelerations: dM.
        let mut p: Vec<D1> = self.params.iter().map(|&p| D1::constant(p)).collect();
        let mut eta: Vec<D1> = x[at.eta..at.nu].iter().map(|&x| D1::constant(x)).collect();
        let (mut m, mut dm) = (vec![D1::constant(0.0); port_len(self.n)], vec![0.0; d * d]);
        let pull = |dm: &mut [f64], m: PortView<'_, D1>| {
            dm.iter_mut().enumerate().for_each(|(i, x)| *x = m.get(i / d, i % d).eps[0]);
        };
        for &l in &self.pattern.mass {
            eta[l].eps[0] = 1.0;
            pull(&mut dm, self.inertia(&p, &eta, &mut m));
            eta[l].eps[0] = 0.0;
            mass(l, &dm);
        }
        for &k in &self.pattern.mass_params {
            let own = self.wanted[k].0;
            p[own].eps[0] = 1.0;
            pull(&mut dm, self.inertia(&p, &eta, &mut m));
            p[own].eps[0] = 0.0;
            mass_param(k, &dm);
        }
    }
    /// Gradient over `x` of `sum_ij w_ij dr_i/dx_j + sum_p v_p . dr/dp` with fixed weights `w`, `(6+n) x len`
    /// row-major, and `v`, one column per wanted parameter.
    pub(super) fn second(&self, x: &[f64], w: &[f64], v: &DMatrix<f64>) -> Vec<f64> {
        let (d, at) = (self.dim(), self.at());
        let out = std::cell::RefCell::new(vec![0.0; at.len]);
        let row = |i: usize, c: usize| w[i * at.len + c];
        let weighed = |c: usize, h: &[f64]| h.iter().enumerate().map(|(i, h)| row(i, c) * h).sum::<f64>();
        self.each(
            x,
            |a, b, h| {
                let mut out = out.borrow_mut();
                out[a] += weighed(b, h);
                if a != b {
                    out[b] += weighed(a, h);
                }
            },
            |k, b, h| out.borrow_mut()[b] += v.column(k).iter().zip(h).map(|(v, h)| v * h).sum::<f64>(),
            |l, dm| {
                let mut out = out.borrow_mut();
                for i in 0..d {
                    for c in 0..d {
                        out[at.eta + l] += row(i, at.a + c) * dm[i * d + c];
                        out[at.a + c] += row(i, at.eta + l) * dm[i * d + c];
                    }
                }
            },
            |k, dm| {
                let mut out = out.borrow_mut();
                for i in 0..d {
                    for c in 0..d {
                        out[at.a + c] += v[(i, k)] * dm[i * d + c];
                    }
                }
            },
        );
        out.into_inner()
    }
}

fn note(to: &mut Vec<(usize, Vec<usize>)>, a: usize, b: usize) {
    match to.iter_mut().find(|(x, _)| *x == a) {
        Some((_, others)) if others.contains(&b) => {}
        Some((_, others)) => others.push(b),
        None => to.push((a, vec![b])),
    }
}
