//! Numbers: finite where they should be, alike at every number type, and never a panic.

use super::derived::matrix;
use super::law;
use super::measure::{Worst, bias, relative};
use super::ports::{Packed, Ports, scales};
use super::report::Check;
use super::sample::{Sample, lift};
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch};
use ff_model::scalar::{D1, D2, Grad};
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::{Dual, DynAppendage, Motion, Scalar};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What is not finite at this sample, in values or in derivatives along the motion.
fn not_finite(a: &dyn DynAppendage, s: &Sample) -> Vec<&'static str> {
    let (p, nu) = (lift::<D1>(&s.p), lift::<D1>(&s.nu));
    let eta: Vec<D1> = s.eta.iter().zip(&s.nu).map(|(&x, &v)| Dual::new(x, v)).collect();
    let host = Motion::new(s.host.lin.map(D1::from_f64), s.host.ang.map(D1::from_f64));
    let d = D1::port(a);
    [
        ("inertia", matrix(d, &p, &eta).iter().flatten().all(Scalar::is_finite)),
        ("potential", d.potential(&p, &eta).is_finite()),
        ("rayleigh", d.rayleigh(&p, &nu).is_finite()),
        ("bias", bias(a, &p, host, &eta, &nu).iter().all(Scalar::is_finite)),
        ("bias in f64", bias(a, &s.p, s.host, &s.eta, &s.nu).iter().all(|x| x.is_finite())),
    ]
    .into_iter()
    .filter_map(|(name, fine)| (!fine).then_some(name))
    .collect()
}

fn not_finite_anywhere(a: &dyn DynAppendage, samples: &[Sample]) -> Vec<String> {
    samples
        .iter()
        .flat_map(|s| not_finite(a, s).into_iter().map(move |x| format!("{x} at eta = {:?}, nu = {:?}", s.eta, s.nu)))
        .collect()
}
/// See [`law::FINITE`].
pub(super) fn finite(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    Check::faults(law::FINITE, &not_finite_anywhere(a, samples))
}
/// See [`law::EXTREME`]. The methods that may be written for speed are asked as well.
pub(super) fn extreme(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    let mut faults = not_finite_anywhere(a, samples);
    for s in samples {
        let all = Ports::<f64>::of(a, &Packed::new(&[s]));
        for (name, x) in Ports::<f64>::NAMES.iter().zip(&all.0) {
            if x.iter().any(|x| !x.is_finite()) {
                faults.push(format!("{name} at eta = {:?}, nu = {:?}", s.eta, s.nu));
            }
        }
    }
    Check::faults(law::EXTREME, &faults)
}

/// `M`, `U`, `R`, `h` over one number type, values only.
fn values<T: ModelScalar>(a: &dyn DynAppendage, s: &Sample) -> Vec<f64> {
    let (p, eta, nu) = (lift::<T>(&s.p), lift::<T>(&s.eta), lift::<T>(&s.nu));
    let host = Motion::new(s.host.lin.map(T::from_f64), s.host.ang.map(T::from_f64));
    let port = T::port(a);
    let mut out = matrix(port, &p, &eta).concat();
    out.push(port.potential(&p, &eta));
    out.push(port.rayleigh(&p, &nu));
    out.extend(bias(a, &p, host, &eta, &nu));
    out.iter().map(Scalar::value).collect()
}

/// See [`law::NUMBER_TYPES`]. A number type added to [`ModelScalar`] gets a line in `types`, or among the instruction
/// sets of [`Isa`] when it is one of lanes.
pub(super) fn number_types(a: &dyn DynAppendage, samples: &[Sample]) -> Check {
    type Values = fn(&dyn DynAppendage, &Sample) -> Vec<f64>;
    let types: [(&str, Values); 3] = [("D1", values::<D1>), ("Grad", values::<Grad>), ("D2", values::<D2>)];
    let mut worst = Worst::default();
    for s in samples {
        let n = s.n();
        let block = (6 + n) * (6 + n);
        let want = values::<f64>(a, s);
        for (name, of) in types {
            let have = of(a, s);
            let parts =
                [("M", 0..block), ("U", block..block + 1), ("R", block + 1..block + 2), ("h", block + 2..have.len())];
            for (part, range) in parts {
                let scale = want[range.clone()].iter().fold(0.0_f64, |m, x| m.max(x.abs())).max(f64::MIN_POSITIVE);
                for i in range {
                    worst.see(relative(have[i], want[i], scale), || format!("{part} over {name} at eta = {:?}", s.eta));
                }
            }
        }
    }
    let rest = samples[0].all_at(a.declaration(), 1e-9);
    for isa in [Isa::Portable, Isa::V3, Isa::V4].into_iter().filter(|isa| isa.is_available()) {
        dispatch(isa, Lanes { a, samples, rest: &rest, worst: &mut worst });
    }
    worst.check(law::NUMBER_TYPES, 1e-12)
}

/// Why [`number_types`] leaves out instruction sets here.
pub(super) fn lacking() -> impl Iterator<Item = &'static str> {
    let sets = [
        (Isa::Portable, "not over portable lanes, which this build has no code for"),
        (Isa::V3, "not over the lanes of AVX2 (x86-64-v3), which this machine or build lacks"),
        (Isa::V4, "not over the lanes of AVX-512 (x86-64-v4), which this machine or build lacks"),
    ];
    sets.into_iter().filter(|(isa, _)| !isa.is_available()).map(|(_, why)| why)
}

/// Every method over lanes, one sample in each, against plain numbers.
struct Lanes<'a> {
    a: &'a dyn DynAppendage,
    samples: &'a [Sample],
    /// A state near zero. It takes the first lane of every second pass, in which the others are general: a branch on
    /// `value()`, which is that of the first lane, then goes the way that is wrong for them.
    rest: &'a Sample,
    worst: &'a mut Worst,
}

impl LaneTask for Lanes<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: LaneScalar>(self) {
        let plain = |s: &Sample| Ports::<f64>::of(self.a, &Packed::new(&[s]));
        for (pass, group) in self.samples.chunks_exact(L::N).enumerate() {
            let mut lanes: Vec<&Sample> = group.iter().collect();
            if pass % 2 == 1 {
                lanes[0] = self.rest;
            }
            let have = Ports::<L>::of(self.a, &Packed::new(&lanes));
            for (l, s) in lanes.iter().enumerate() {
                let want = plain(s);
                let scale = scales(s, &want);
                for part in 0..want.0.len() {
                    for (i, (x, y)) in have.0[part].iter().zip(&want.0[part]).enumerate() {
                        self.worst.see(relative(x.lane(l), *y, scale[part][i]), || {
                            let name = Ports::<f64>::NAMES[part];
                            format!("{name} over {} lanes, in lane {l} at eta = {:?}", L::N, s.eta)
                        });
                    }
                }
            }
        }
    }
}

/// What a caller may pass by mistake: nothing, too much, too little, and no number at all.
pub(crate) const ODD: [f64; 7] = [0.0, 1e300, -1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324];

/// See [`law::NO_PANIC`]: every parameter, coordinate, rate and twist component in turn takes each value of [`ODD`].
pub(super) fn no_panic(a: &dyn DynAppendage, sample: &Sample) -> Check {
    let decl = a.declaration();
    let mut faults = Vec::new();
    let mut attempt = |s: &Sample, what: &dyn Fn() -> String| {
        let run = AssertUnwindSafe(|| (drop(Ports::<f64>::of(a, &Packed::new(&[s]))), values::<D1>(a, s)));
        if catch_unwind(run).is_err() {
            faults.push(what());
        }
    };
    for x in ODD {
        for (k, d) in decl.params.iter().enumerate() {
            let mut s = sample.clone();
            s.p[k] = x;
            attempt(&s, &|| format!("panics at {} = {x:e}", d.name));
        }
        for (k, d) in decl.coords.iter().enumerate() {
            let mut s = sample.clone();
            s.eta[k] = x;
            attempt(&s, &|| format!("panics at {} = {x:e}", d.name));
            s = sample.clone();
            s.nu[k] = x;
            attempt(&s, &|| format!("panics at the rate {x:e} of {}", d.name));
        }
        for k in 0..6 {
            let mut s = sample.clone();
            s.host = Motion::from_slice(&std::array::from_fn::<f64, 6, _>(|i| if i == k { x } else { s.host.get(i) }));
            attempt(&s, &|| format!("panics at host twist component {k} = {x:e}"));
        }
    }
    Check::faults(law::NO_PANIC, &faults)
}
