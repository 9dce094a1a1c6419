//! The port equations as an appendage writes them against the defaults of the trait and against differences.

use crate::assert_within;
use crate::isa::instruction_sets;
use crate::random::{Random, symmetric, vector};
use crate::tolerance::{largest, relative_error};
use ff_model::port::{PortModel, PortTangent, port_len};
use ff_model::scalar::lanes::{LaneScalar, LaneTask, dispatch};
use ff_model::{
    Appendage, Decl, DynAppendage, Motion, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Scalar,
};
use std::sync::Arc;

/// As a model holds it, with the dynamics that its crate compiled: `&a as &dyn DynAppendage` compiles them anew.
pub fn shared(a: &(impl Clone + Into<Arc<dyn DynAppendage>>)) -> Arc<dyn DynAppendage> {
    a.clone().into()
}

/// An appendage with nothing of its own but inertia, potential and bias; everything else is a default. As `dyn DynAppendage` it
/// would be compiled for every number type; [`check_ports`] wants plain numbers.
pub struct Plain<A>(
    /// The appendage.
    pub A,
);

impl<A: PortDynamics> Appendage for Plain<A> {
    fn decl(&self) -> &Decl {
        self.0.decl()
    }
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        Appendage::inertia(&self.0, p, eta, m);
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        Appendage::potential(&self.0, p, eta)
    }
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        Appendage::rayleigh(&self.0, p, nu)
    }
}

impl<A: PortDynamics> PortDynamics for Plain<A> {
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        PortDynamics::bias(&self.0, p, s, h);
    }
}

/// A motion of host and appendage with accelerations: twist, coordinates, rates, acceleration, own accelerations.
#[derive(Clone)]
struct Move {
    host: [Motion<f64>; 2],
    own: [Vec<f64>; 3],
}

impl Move {
    fn new(r: &mut Random, n: usize) -> Self {
        let mut own = |a: f64| (0..n).map(|_| symmetric(r, a)).collect::<Vec<_>>();
        let own = [own(1.1), own(2.0), own(3.0)];
        Self { host: [(); 2].map(|()| Motion::new(vector(r, 2.0), vector(r, 2.0))), own }
    }
}

/// Results: `M` and `h`, residual, jacobian, regressor.
type Results<T> = [Vec<T>; 4];

/// An appendage at one number type.
#[derive(Clone, Copy)]
struct Ports<'a, T: LaneScalar> {
    model: &'a dyn PortModel<T>,
    tangent: &'a dyn PortTangent<T>,
    coords: usize,
}

impl<'a, T: LaneScalar> Ports<'a, T> {
    fn of(a: &'a dyn DynAppendage) -> Self {
        Self { model: T::port(a), tangent: T::tangent(a), coords: a.declaration().coords.len() }
    }
}

/// With garbage in every buffer.
fn evaluate<T: LaneScalar>(a: Ports<'_, T>, p: &[T], moves: &[Move]) -> Results<T> {
    let n = a.coords;
    let dim = 6 + n;
    let pack = |of: &dyn Fn(&Move) -> f64| {
        let mut x = T::from_f64(0.0);
        (0..T::N).for_each(|l| x.set_lane(l, of(&moves[l])));
        x
    };
    let own: Vec<Vec<T>> = (0..3).map(|k| (0..n).map(|i| pack(&|m| m.own[k][i])).collect()).collect();
    let host = [0, 1].map(|k| {
        let mut x = Motion::<T>::zero();
        for i in 0..3 {
            x.lin[i] = pack(&|m| m.host[k].lin[i]);
            x.ang[i] = pack(&|m| m.host[k].ang[i]);
        }
        x
    });
    let (s, acc) = (PortState { host: host[0], eta: &own[0], nu: &own[1] }, PortAccel { host: host[1], nu: &own[2] });
    let garbage = |k: usize| vec![T::from_f64(f64::NAN); k];
    let (mut m, mut h, mut r) = (garbage(port_len(n)), garbage(dim), garbage(dim));
    let (mut j, mut y) = (garbage(dim * (3 + 2 * n)), garbage(dim * p.len()));
    a.model.terms(p, &s, &mut PortMatrix::over(n, &mut m), &mut h);
    m.extend(h);
    a.model.residual(p, &s, &acc, &mut PortMatrix::over(n, &mut garbage(port_len(n))), &mut r);
    a.tangent.jacobian(p, &s, &acc, &mut j);
    a.tangent.regressor(p, &s, &acc, &mut y);
    [m, r, j, y]
}

/// Greatest relative error of a column of length `dim`.
fn worst(x: &[f64], y: &[f64], dim: usize) -> f64 {
    let columns = x.chunks(dim).zip(y.chunks(dim));
    largest(&columns.map(|(x, y)| relative_error(x, y)).collect::<Vec<_>>())
}

struct Compare<'a> {
    own: &'a dyn DynAppendage,
    plain: Ports<'a, f64>,
    p: &'a [f64],
    moves: Vec<Move>,
}

impl LaneTask for Compare<'_> {
    type Output = [f64; 4];
    fn run<T: LaneScalar>(self) -> [f64; 4] {
        let p: Vec<T> = self.p.iter().map(|&x| T::from_f64(x)).collect();
        let found = evaluate::<T>(Ports::of(self.own), &p, &self.moves);
        let dim = 6 + self.own.declaration().coords.len();
        let mut w = [0.0_f64; 4];
        for l in 0..T::N {
            let want = evaluate(self.plain, self.p, &self.moves[l..]);
            for k in 0..4 {
                let lane: Vec<f64> = found[k].iter().map(|x| x.lane(l)).collect();
                let d = worst(&lane, &want[k], dim);
                w[k] = largest(&[w[k], d]);
            }
        }
        w
    }
}

/// Holds `terms`, `residual`, `jacobian` and `regressor` to the defaults over plain numbers and over every vector type
/// of the machine, and the derivatives to central differences of the default residual.
///
/// # Panics
/// Where they differ.
pub fn check_ports<A: PortDynamics + Clone + Into<Arc<dyn DynAppendage>>>(
    a: &A,
    p: &[f64],
    r: &mut Random,
    samples: usize,
) {
    let (own, plain) = (shared(a), Plain(a.clone()));
    let n = a.decl().coords.len();
    let plain = Ports { model: &plain, tangent: &plain, coords: n };
    let isas = instruction_sets();
    for _ in 0..samples {
        let moves: Vec<Move> = (0..8).map(|_| Move::new(r, n)).collect();
        let compare = || Compare { own: &*own, plain, p, moves: moves.clone() };
        let each = isas.iter().map(|&i| dispatch(i, compare())).chain([compare().run::<f64>()]);
        for (i, w) in each.enumerate() {
            for (what, w) in ["terms", "residual", "jacobian", "regressor"].iter().zip(w) {
                assert_within!(w, 1e-12, "{what}, number type {i}");
            }
        }
        differences(&*own, plain, p, &moves[0]);
    }
}

fn differences(own: &dyn DynAppendage, plain: Ports<'_, f64>, p: &[f64], at: &Move) {
    let n = at.own[0].len();
    let dim = 6 + n;
    let [_, _, j, y] = evaluate::<f64>(Ports::of(own), p, std::slice::from_ref(at));
    // Rounding of the residual leaves its mark on a difference, and small columns carry it, too.
    let near = |column: &[f64], step: &dyn Fn(f64) -> (Vec<f64>, Move), h: f64, what: &str| {
        let at = |h: f64| {
            let (p, m) = step(h);
            evaluate(plain, &p, &[m])[1].clone()
        };
        let (a, b) = (at(h), at(-h));
        let limit = 1e-7 * largest(column) + 1e-14 * largest(&a) / h;
        for (i, x) in column.iter().enumerate() {
            let difference = (a[i] - b[i]) / (2.0 * h);
            assert_within!((x - difference).abs(), limit, "{what}, row {i}: {x:e}, difference {difference:e}");
        }
    };
    for k in 0..3 + 2 * n {
        let step = |h: f64| {
            let mut m = at.clone();
            match k {
                0..3 => m.host[0].ang[k] += h,
                k if k < 3 + n => m.own[0][k - 3] += h,
                _ => m.own[1][k - 3 - n] += h,
            }
            (p.to_vec(), m)
        };
        near(&j[k * dim..(k + 1) * dim], &step, 1e-5, &format!("direction {k} of the jacobian"));
    }
    for k in 0..p.len() {
        let h = 1e-5 * (1.0 + p[k].abs());
        let step = |h: f64| {
            let mut p = p.to_vec();
            p[k] += h;
            (p, at.clone())
        };
        near(&y[k * dim..(k + 1) * dim], &step, h, &format!("parameter {k} of the regressor"));
    }
}
