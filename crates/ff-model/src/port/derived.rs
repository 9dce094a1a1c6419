//! Derivatives of the port equations that follow from inertia and bias, for appendages that do not write their own.

use super::{Appendage, MAX_COORDS, MAX_PARAMS, MAX_PORT, ParamGroup, PortAccel, PortMatrix, PortState, port_len};
use crate::scalar::dual::Dual;
use crate::scalar::traits::LaneScalar;
use crate::spatial::motion::Motion;

/// Directions per pass.
const N: usize = 8;

/// Runs `$f` with stack buffers for a small appendage where that is enough: clearing buffers for the
/// greatest one would cost more than the equations.
macro_rules! sized {
    ($n:expr, $np:expr, $f:ident($($arg:expr),*)) => {
        match ($n, $np) {
            (0..=3, 0..=36) => $f::<A, 3, { port_len(3) }, 36>($($arg),*),
            _ => $f::<A, MAX_COORDS, { port_len(MAX_COORDS) }, MAX_PARAMS>($($arg),*),
        }
    };
}

type D = Dual<f64, N>;

/// A derivative at plain numbers: parameters, state, accelerations, columns out.
type Plain<A> = fn(&A, &[f64], &PortState<'_, f64>, &PortAccel<'_, f64>, &mut [f64]);

/// The derivatives of the port equations with respect to the motion that follow from inertia and bias: the default of
/// [`Appendage::jacobian`], for an override that writes some cases only, and for tests of one.
///
/// With `r = M(p, eta) [A; nu'] + h(p, V, eta, nu)` at fixed `A`, `nu'` the columns, of length `6+n` each, are
/// `dr/dw` (three, `w` the angular velocity of the host), `dr/d eta` and `dr/d nu` (`n` each), in mount axes, wrench rows
/// first. Exact: forward duals over [`Appendage::inertia`] and [`Appendage::bias`] (A. Griewank, A. Walther, *Evaluating
/// Derivatives*, SIAM 2008, section 3.1), never over an override of `terms` or `residual`. Lanes are computed one by one.
/// Does not allocate.
///
/// # Panics
/// If `out` is shorter than `(6+n) (3+2n)`, or the appendage declares more than [`MAX_COORDS`] coordinates or
/// [`MAX_PARAMS`] parameters.
pub fn derived_jacobian<A: Appendage + ?Sized, T: LaneScalar>(
    a: &A,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    out: &mut [T],
) {
    by_lane(a, p, s, acc, out, |a, p, s, acc, out| sized!(s.eta.len(), p.len(), jacobian_in(a, p, s, acc, out)));
}

/// The derivatives of the port equations with respect to the parameters that follow from inertia and bias: the default
/// of [`Appendage::regressor`], for an override that writes some columns only, and for tests of one.
///
/// One column `dr/dp_k` of length `6+n` per parameter, `r = M [A; nu'] + h`, in mount axes, wrench rows first. Columns of
/// inertial parameters are the port equations at unit parameters, in which they are linear
/// (`docs/decisions/0005-sensitivities.md`), by [`Appendage::residual`]; the others come from forward duals over
/// [`Appendage::inertia`] and [`Appendage::bias`]. Lanes are computed one by one. Does not allocate.
///
/// # Panics
/// If `out` is shorter than `6+n` times the number of parameters, or the appendage declares more than [`MAX_COORDS`]
/// coordinates or [`MAX_PARAMS`] parameters.
pub fn derived_regressor<A: Appendage + ?Sized, T: LaneScalar>(
    a: &A,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    out: &mut [T],
) {
    by_lane(a, p, s, acc, out, |a, p, s, acc, out| sized!(s.eta.len(), p.len(), regressor_in(a, p, s, acc, out)));
}

/// Runs `plain` once for each lane: an appendage that does not write its own derivatives has them at the
/// speed of plain numbers.
fn by_lane<A: Appendage + ?Sized, T: LaneScalar>(
    a: &A,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    out: &mut [T],
    plain: Plain<A>,
) {
    let (n, np) = (s.eta.len(), p.len());
    let count = (6 + n) * np.max(3 + 2 * n).min(out.len() / (6 + n));
    let mut params = [0.0; MAX_PARAMS];
    let (mut eta, mut nu, mut an) = ([0.0; MAX_COORDS], [0.0; MAX_COORDS], [0.0; MAX_COORDS]);
    let mut columns = [0.0; MAX_PORT * MAX_PARAMS];
    for lane in 0..T::N {
        let pick = |to: &mut [f64], from: &[T]| to.iter_mut().zip(from).for_each(|(t, f)| *t = f.lane(lane));
        pick(&mut params, p);
        pick(&mut eta, s.eta);
        pick(&mut nu, s.nu);
        pick(&mut an, acc.nu);
        let motion = |m: &Motion<T>| Motion::new(m.lin.map(|x| x.lane(lane)), m.ang.map(|x| x.lane(lane)));
        let state = PortState { host: motion(&s.host), eta: &eta[..n], nu: &nu[..n] };
        let accel = PortAccel { host: motion(&acc.host), nu: &an[..n] };
        plain(a, &params[..np], &state, &accel, &mut columns[..count]);
        for (t, &x) in out.iter_mut().zip(&columns[..count]) {
            t.set_lane(lane, x);
        }
    }
}

fn jacobian_in<A: Appendage + ?Sized, const C: usize, const M: usize, const P: usize>(
    a: &A,
    p: &[f64],
    s: &PortState<'_, f64>,
    acc: &PortAccel<'_, f64>,
    out: &mut [f64],
) {
    let n = s.eta.len();
    let dim = 6 + n;
    let zero = D::constant(0.0);
    let mut pd = [zero; P];
    for (d, &x) in pd.iter_mut().zip(p) {
        *d = Dual::constant(x);
    }
    let (mut eta, mut nu, mut an) = ([zero; C], [zero; C], [zero; C]);
    for i in 0..n {
        an[i] = Dual::constant(acc.nu[i]);
    }
    let host = lift(&acc.host);
    let (mut m, mut r) = ([zero; M], [zero; MAX_PORT]);
    let total = 3 + 2 * n;
    let mut first = 0;
    while first < total {
        // Direction `d` of this pass is direction `first + d` of all.
        let seed = |x: f64, dir: usize| {
            let mut d = D::constant(x);
            if (first..first + N).contains(&dir) {
                d.eps[dir - first] = 1.0;
            }
            d
        };
        let mut v = lift(&s.host);
        for i in 0..3 {
            v.ang[i] = seed(s.host.ang[i], i);
        }
        for i in 0..n {
            eta[i] = seed(s.eta[i], 3 + i);
            nu[i] = seed(s.nu[i], 3 + n + i);
        }
        let state = PortState { host: v, eta: &eta[..n], nu: &nu[..n] };
        let accel = PortAccel { host, nu: &an[..n] };
        residual(a, &pd[..p.len()], &state, &accel, &mut PortMatrix::new(n, &mut m), &mut r[..dim]);
        for d in 0..N.min(total - first) {
            for i in 0..dim {
                out[(first + d) * dim + i] = r[i].eps[d];
            }
        }
        first += N;
    }
}

fn regressor_in<A: Appendage + ?Sized, const C: usize, const M: usize, const P: usize>(
    a: &A,
    p: &[f64],
    s: &PortState<'_, f64>,
    acc: &PortAccel<'_, f64>,
    out: &mut [f64],
) {
    let n = s.eta.len();
    let dim = 6 + n;
    let params = &a.decl().params;
    let inertial = |k: usize| matches!(params[k].group, ParamGroup::Inertial(_));
    // The energies are linear in inertial parameters: their columns are the equations at unit parameters.
    let mut unit = [0.0; P];
    let mut m = [0.0; M];
    for k in (0..p.len()).filter(|&k| inertial(k)) {
        unit[k] = 1.0;
        let col = &mut out[k * dim..(k + 1) * dim];
        a.residual(&unit[..p.len()], s, acc, &mut PortMatrix::over(n, &mut m), col);
        unit[k] = 0.0;
    }
    if (0..p.len()).all(inertial) {
        return;
    }
    let zero = D::constant(0.0);
    let mut pd = [zero; P];
    for (d, &x) in pd.iter_mut().zip(p) {
        *d = Dual::constant(x);
    }
    let (mut eta, mut nu, mut an) = ([zero; C], [zero; C], [zero; C]);
    for i in 0..n {
        (eta[i], nu[i], an[i]) = (Dual::constant(s.eta[i]), Dual::constant(s.nu[i]), Dual::constant(acc.nu[i]));
    }
    let state = PortState { host: lift(&s.host), eta: &eta[..n], nu: &nu[..n] };
    let accel = PortAccel { host: lift(&acc.host), nu: &an[..n] };
    let (mut md, mut r) = ([zero; M], [zero; MAX_PORT]);
    let mut next = 0;
    while next < p.len() {
        let mut pass = [0; N];
        let mut count = 0;
        while next < p.len() && count < N {
            if !inertial(next) {
                pd[next].eps[count] = 1.0;
                pass[count] = next;
                count += 1;
            }
            next += 1;
        }
        residual(a, &pd[..p.len()], &state, &accel, &mut PortMatrix::new(n, &mut md), &mut r[..dim]);
        for (d, &k) in pass[..count].iter().enumerate() {
            for i in 0..dim {
                out[k * dim + i] = r[i].eps[d];
            }
            pd[k].eps[d] = 0.0;
        }
    }
}

/// The residual over duals, from energies and bias: see [`Scalar::DERIVATIVES`](crate::scalar::traits::Scalar::DERIVATIVES).
fn residual<A: Appendage + ?Sized>(
    a: &A,
    p: &[D],
    s: &PortState<'_, D>,
    acc: &PortAccel<'_, D>,
    m: &mut PortMatrix<'_, D>,
    r: &mut [D],
) {
    a.inertia(p, s.eta, m);
    a.bias(p, s, r);
    super::add_inertial(m, acc, r);
}

fn lift(m: &Motion<f64>) -> Motion<D> {
    let mut l = Motion::zero();
    for i in 0..3 {
        l.lin[i] = Dual::constant(m.lin[i]);
        l.ang[i] = Dual::constant(m.ang[i]);
    }
    l
}
