//! No method of an appendage may allocate.

use super::law;
use super::measure::Worst;
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::port::port_len;
use ff_model::scalar::lanes::Four;
use ff_model::scalar::{D1, D2, Grad};
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::{DynAppendage, Motion, PortAccel, PortMatrix, PortState};

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
        over::<Four>("lanes", a, s, meter, &mut worst);
        tangent::<f64>("f64", a, s, meter, &mut worst);
        tangent::<Four>("lanes", a, s, meter, &mut worst);
    }
    worst.check(law::NO_ALLOCATION, 0.0)
}

fn over<T: ModelScalar>(name: &str, a: &dyn DynAppendage, s: &Sample, meter: AllocationMeter, worst: &mut Worst) {
    let (p, eta, nu) = (lift::<T>(&s.p), lift::<T>(&s.eta), lift::<T>(&s.nu));
    let host = Motion::new(s.host.lin.map(T::from_f64), s.host.ang.map(T::from_f64));
    let dim = 6 + eta.len();
    let (mut m, mut h) = (vec![T::zero(); port_len(eta.len())], vec![T::zero(); dim]);
    let acc = lift::<T>(&s.acc);
    let acc = PortAccel { host: Motion::from_slice(&acc), nu: &acc[6..] };
    let state = PortState { host, eta: &eta, nu: &nu };
    let port = T::port(a);
    let counts = [
        ("inertia", meter(&mut || port.inertia(&p, &eta, &mut PortMatrix::new(eta.len(), &mut m)))),
        ("potential", meter(&mut || _ = std::hint::black_box(port.potential(&p, &eta)))),
        ("rayleigh", meter(&mut || _ = std::hint::black_box(port.rayleigh(&p, &nu)))),
        ("bias", meter(&mut || port.bias(&p, &state, &mut h))),
        ("terms", meter(&mut || port.terms(&p, &state, &mut PortMatrix::over(eta.len(), &mut m), &mut h))),
        ("residual", meter(&mut || port.residual(&p, &state, &acc, &mut PortMatrix::over(eta.len(), &mut m), &mut h))),
    ];
    for (method, count) in counts {
        worst.see(count as f64, || format!("{method} over {name} allocates {count} times in one call"));
    }
}

/// The derivatives of the port equations.
fn tangent<T: LaneScalar>(name: &str, a: &dyn DynAppendage, s: &Sample, meter: AllocationMeter, worst: &mut Worst) {
    let (p, eta, nu, acc) = (lift::<T>(&s.p), lift::<T>(&s.eta), lift::<T>(&s.nu), lift::<T>(&s.acc));
    let host = Motion::new(s.host.lin.map(T::from_f64), s.host.ang.map(T::from_f64));
    let state = PortState { host, eta: &eta, nu: &nu };
    let acc = PortAccel { host: Motion::from_slice(&acc), nu: &acc[6..] };
    let dim = 6 + eta.len();
    let mut out = vec![T::zero(); dim * p.len().max(3 + 2 * eta.len())];
    let tangent = T::tangent(a);
    let counts = [
        ("jacobian", meter(&mut || tangent.jacobian(&p, &state, &acc, &mut out[..dim * (3 + 2 * eta.len())]))),
        ("regressor", meter(&mut || tangent.regressor(&p, &state, &acc, &mut out[..dim * p.len()]))),
    ];
    for (method, count) in counts {
        worst.see(count as f64, || format!("{method} over {name} allocates {count} times in one call"));
    }
}
