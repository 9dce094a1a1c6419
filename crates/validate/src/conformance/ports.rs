//! Everything an appendage computes at one state, over plain numbers or lanes.

use super::derived::matrix;
use super::sample::{Sample, lift};
use ff_model::port::{PortView, port_len};
use ff_model::scalar::LaneScalar;
use ff_model::{DynAppendage, Motion, PortAccel, PortMatrix, PortState, Scalar};

/// Results of every method, by the names of [`Ports::NAMES`].
pub(super) struct Ports<T>(pub(super) [Vec<T>; 9]);

impl<T: LaneScalar> Ports<T> {
    pub(super) const NAMES: [&'static str; 9] =
        ["M", "U", "R", "h", "M of terms", "h of terms", "residual", "jacobian", "regressor"];

    pub(super) fn of(a: &dyn DynAppendage, s: &Packed<T>) -> Self {
        let (n, np) = (s.eta.len(), s.p.len());
        let dim = 6 + n;
        let (port, tangent) = (T::port(a), T::tangent(a));
        let zeros = |len: usize| vec![T::zero(); len];
        let state = PortState { host: s.host, eta: &s.eta, nu: &s.nu };
        let acc = PortAccel { host: Motion::from_slice(&s.acc), nu: &s.acc[6..] };
        let (mut h, mut th, mut r) = (zeros(dim), zeros(dim), zeros(dim));
        // These two are handed whatever a buffer holds.
        let used = || vec![T::from_f64(-7.3e5); port_len(n)];
        let (mut tm, mut scratch) = (used(), used());
        port.bias(&s.p, &state, &mut h);
        port.terms(&s.p, &state, &mut PortMatrix::over(n, &mut tm), &mut th);
        port.residual(&s.p, &state, &acc, &mut PortMatrix::over(n, &mut scratch), &mut r);
        let (mut j, mut y) = (zeros(dim * (3 + 2 * n)), zeros(dim * np));
        tangent.jacobian(&s.p, &state, &acc, &mut j);
        tangent.regressor(&s.p, &state, &acc, &mut y);
        let tm = PortView::new(n, &tm).dense().as_slice().to_vec();
        let (u, loss) = (port.potential(&s.p, &s.eta), port.rayleigh(&s.p, &s.nu));
        Self([matrix(port, &s.p, &s.eta).concat(), vec![u], vec![loss], h, tm, th, r, j, y])
    }
}

/// A sample in every lane of a number.
pub(super) struct Packed<T: Scalar> {
    pub(super) p: Vec<T>,
    pub(super) host: Motion<T>,
    pub(super) eta: Vec<T>,
    pub(super) nu: Vec<T>,
    pub(super) acc: Vec<T>,
}

impl<T: LaneScalar> Packed<T> {
    /// Of `T::N` samples, the first in the first lane.
    pub(super) fn new(lanes: &[&Sample]) -> Self {
        let pack = |of: &dyn for<'a> Fn(&'a Sample) -> &'a [f64]| -> Vec<T> {
            let mut out: Vec<T> = lift(of(lanes[0]));
            for (l, s) in lanes.iter().enumerate().take(T::N) {
                out.iter_mut().zip(of(s)).for_each(|(x, &v)| x.set_lane(l, v));
            }
            out
        };
        let mut host = Motion::zero();
        for k in 0..6 {
            let mut x = T::zero();
            (0..T::N).for_each(|l| x.set_lane(l, lanes[l].host.get(k)));
            if k < 3 { host.lin[k] = x } else { host.ang[k - 3] = x }
        }
        Self { p: pack(&|s| &s.p), host, eta: pack(&|s| &s.eta), nu: pack(&|s| &s.nu), acc: pack(&|s| &s.acc) }
    }
}

/// What the entries of each result are measured by, for the state of one sample: the largest entry, of a derivative that
/// of its column.
///
/// A column of the Jacobian that is nothing but rounding is measured by the terms of the residual, which it is the
/// derivative of.
pub(super) fn scales(s: &Sample, want: &Ports<f64>) -> [Vec<f64>; 9] {
    let dim = 6 + s.n();
    let [m, .., h, _, _, _, _, _] = &want.0;
    let terms = (0..dim).map(|i| h[i].abs() + (0..dim).map(|j| (m[i * dim + j] * s.acc[j]).abs()).sum::<f64>());
    let terms = terms.fold(0.0, f64::max);
    std::array::from_fn(|part| {
        let x = &want.0[part];
        let (column, least) = match Ports::<f64>::NAMES[part] {
            "jacobian" => (dim, terms),
            "regressor" => (dim, 0.0),
            "residual" => (x.len(), terms),
            _ => (x.len(), 0.0),
        };
        x.chunks(column.max(1))
            .flat_map(|c| {
                let most = c.iter().fold(least, |k: f64, v| k.max(v.abs())).max(f64::MIN_POSITIVE);
                std::iter::repeat_n(most, c.len())
            })
            .collect()
    })
}
