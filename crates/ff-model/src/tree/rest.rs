//! Rest position of an appendage, and the system with every appendage frozen there.

use crate::scalar::dual::Dual;
use crate::scalar::traits::{D1, D2, ModelScalar};
use crate::spatial::inertia::Inertia;
use crate::tree::model::{Model, Mounted};
use crate::tree::parameters::Params;
use nalgebra::{DMatrix, DVector};

/// Coordinates at which the springs of an appendage are relaxed, `dU/d eta = 0`, by Newton from zero with
/// exact derivatives. Coordinates without a spring stay at zero. Allocates.
pub fn rest(mounted: &Mounted, p: &[f64]) -> Vec<f64> {
    let n = mounted.dim();
    if n == 0 {
        // A payload; the decomposition below needs at least one row.
        return Vec::new();
    }
    let mut eta = DVector::<f64>::zeros(n);
    let port1 = D1::port(&*mounted.appendage);
    let port2 = D2::port(&*mounted.appendage);
    let p1: Vec<D1> = p.iter().map(|&x| D1::constant(x)).collect();
    let p2: Vec<D2> = p.iter().map(|&x| D2::constant(D1::constant(x))).collect();
    for _ in 0..50 {
        let gradient = DVector::from_fn(n, |i, _| {
            let e: Vec<D1> = (0..n).map(|k| D1::new(eta[k], f64::from(u8::from(k == i)))).collect();
            port1.potential(&p1, &e).eps[0]
        });
        let hessian = DMatrix::from_fn(n, n, |i, j| {
            let unit = |k: usize, l: usize| f64::from(u8::from(k == l));
            let e: Vec<D2> = (0..n).map(|k| Dual::new(D1::new(eta[k], unit(k, i)), D1::new(unit(k, j), 0.0))).collect();
            port2.potential(&p2, &e).eps[0].eps[0]
        });
        // Least squares: a coordinate without a spring has a zero row and is left where it is.
        let Some(svd) = hessian.try_svd(true, true, 1e-15, 1000) else { break };
        let Ok(step) = svd.solve(&gradient, 1e-12 * svd.singular_values.max().max(f64::MIN_POSITIVE)) else { break };
        eta -= &step;
        if step.amax() <= 1e-15 * (1.0 + eta.amax()) {
            break;
        }
    }
    eta.as_slice().to_vec()
}

impl Model {
    /// The rigid system that this one is when its appendages are frozen at rest: their inertia is added to
    /// their hosts. This is what a rigid identification would ideally find. Allocates.
    #[must_use]
    pub fn frozen(&self, params: &Params<f64>) -> Self {
        let mut m = self.without_appendages();
        for (k, a) in self.appendages().iter().enumerate() {
            let p = params.appendage(self, k);
            let port = f64::port(&*a.appendage).dense_inertia(p, &rest(a, p));
            let b = Inertia::from_elements(|i, j| port[(i, j)]);
            m.add_rigid(a.host, &b.to_parent(&a.mount));
        }
        m
    }
    /// Rest positions of all passive coordinates ([`rest`]). Allocates.
    pub fn rest_position(&self, params: &Params<f64>) -> Vec<f64> {
        self.appendages().iter().enumerate().flat_map(|(k, a)| rest(a, params.appendage(self, k))).collect()
    }
}
