//! No method of an appendage may allocate.

use super::law;
use super::measure::Worst;
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::scalar::{D1, D2, Grad};
use ff_model::{DynAppendage, ModelScalar, Motion, PortMatrix, PortState};

/// Runs what it is given and says how many allocations that made.
///
/// Counting takes a global allocator, which a library must not choose for its users; so the caller brings it. With the
/// crate `allocation-counter` in a test: `|f| allocation_counter::measure(f).count_total`.
pub type AllocationMeter = fn(&mut dyn FnMut()) -> u64;

/// See [`law::NO_ALLOCATION`].
pub(super) fn allocation(a: &dyn DynAppendage, samples: &[Sample], meter: AllocationMeter) -> Check {
    let mut worst = Worst::default();
    for s in samples {
        over::<f64>("f64", a, s, meter, &mut worst);
        over::<D1>("D1", a, s, meter, &mut worst);
        over::<Grad>("Grad", a, s, meter, &mut worst);
        over::<D2>("D2", a, s, meter, &mut worst);
    }
    worst.check(law::NO_ALLOCATION, 0.0)
}

fn over<T: ModelScalar>(name: &str, a: &dyn DynAppendage, s: &Sample, meter: AllocationMeter, worst: &mut Worst) {
    let (p, eta, nu) = (lift::<T>(&s.p), lift::<T>(&s.eta), lift::<T>(&s.nu));
    let host = Motion::new(s.host.lin.map(T::from_f64), s.host.ang.map(T::from_f64));
    let dim = 6 + eta.len();
    let (mut m, mut h) = (vec![T::zero(); dim * dim], vec![T::zero(); dim]);
    let port = T::port(a);
    let counts = [
        ("inertia", meter(&mut || port.inertia(&p, &eta, &mut PortMatrix::new(eta.len(), &mut m)))),
        ("potential", meter(&mut || _ = std::hint::black_box(port.potential(&p, &eta)))),
        ("rayleigh", meter(&mut || _ = std::hint::black_box(port.rayleigh(&p, &nu)))),
        ("bias", meter(&mut || port.bias(&p, &PortState { host, eta: &eta, nu: &nu }, &mut h))),
    ];
    for (method, count) in counts {
        worst.see(count as f64, || format!("{method} over {name} allocates {count} times in one call"));
    }
}
