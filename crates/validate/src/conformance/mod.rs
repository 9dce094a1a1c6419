//! Does an appendage keep the laws that the trait leaves to its author?
//!
//! ```text
//! let report = validate::conformance::check_appendage(&my_appendage);
//! assert!(report.passed(), "{report}");
//! ```
//!
//! The suite draws [`SAMPLES`] states and parameter sets (deterministic, general values, no zeros) and asks for each
//! law one figure that must not exceed a limit. [`check_kind`] does so for a kind of a registry, and tries its factory
//! and a whole system with values that nobody should pass; `validate::systems` runs random systems of many kinds. It cannot know whether the energies are those of the device meant;
//! it knows that a device with these energies exists, and that the code computes its motion.
mod allocation;
mod declaration;
mod derived;
mod dissipation;
mod inertia;
mod kind;
pub mod law;
mod measure;
mod motion;
mod numbers;
mod overrides;
mod parameters;
mod ports;
mod report;
mod sample;
mod twin;

pub use allocation::AllocationMeter;
pub use kind::check_kind;
pub(crate) use motion::bias_against_derived;
pub use report::{Check, ConformanceReport, NotConforming, Skipped};
pub(crate) use sample::Source;

use ff_model::DynAppendage;
use sample::Sample;

/// States and parameter sets drawn by [`check_appendage`].
pub const SAMPLES: usize = 1000;
/// How many of them the laws see that need second derivatives or a pass per parameter.
const COSTLY: usize = 64;

/// Checks an appendage against every law in [`law`]. A `&A` of any
/// [`ff_model::PortDynamics`] will do, such as `&Derived::new(appendage)` of an [`ff_model::Appendage`].
///
/// Deterministic; takes milliseconds for a few coordinates; allocates. Never panics on wrong numbers: a declaration
/// that is not sane ends the suite after its first entry, and results that are not finite fail their law.
pub fn check_appendage(a: &dyn DynAppendage) -> ConformanceReport {
    check(a, None)
}

/// [`check_appendage`] with [`law::NO_ALLOCATION`], which needs a counting allocator.
pub fn check_appendage_counting(a: &dyn DynAppendage, meter: AllocationMeter) -> ConformanceReport {
    check(a, Some(meter))
}

fn check(a: &dyn DynAppendage, meter: Option<AllocationMeter>) -> ConformanceReport {
    let decl = a.declaration();
    let mut report = ConformanceReport::new(decl.kind);
    report.push(declaration::declaration(decl));
    if !report.passed() {
        return report;
    }
    let mut source = Source::new(0x5eed);
    let samples: Vec<Sample> = (0..SAMPLES).map(|i| source.sample(decl, i)).collect();
    let few = &samples[..COSTLY];
    report.push(numbers::finite(a, &samples));
    if !report.passed() {
        return report;
    }
    let mut extremes: Vec<Sample> = samples.iter().take(16).enumerate().map(|(i, s)| s.extreme(decl, i)).collect();
    extremes.extend([0.0, 1e-160, 5e-324].map(|x| samples[0].all_at(decl, x)));
    report.push(numbers::extreme(a, &extremes));
    report.push(numbers::no_panic(a, &samples[1]));
    report.push(numbers::number_types(a, few));
    for why in numbers::lacking() {
        report.skip(law::NUMBER_TYPES, why);
    }
    for check in inertia::inertia(a, &samples) {
        report.push(check);
    }
    report.push(motion::derivatives(a, few));
    for check in motion::bias_checks(a, few) {
        report.push(check);
    }
    for check in overrides::overrides(a, few) {
        report.push(check);
    }
    report.push(motion::momentum(a, &samples));
    report.push(motion::energy(a, &samples));
    for check in dissipation::rayleigh(a, &samples) {
        report.push(check);
    }
    report.push(parameters::parameters(a, &samples));
    report.push(parameters::linear(a, &few[..8]));
    let nominal: Vec<f64> = decl.params.iter().map(|p| p.nominal).collect();
    match a.tree_twin().and_then(|t| t.tree_bodies(&nominal)) {
        Some(bodies) => report.push(twin::twin(a, &bodies, few)),
        None => report.skip(law::TWIN, "the appendage has no twin"),
    }
    match meter {
        Some(meter) => report.push(allocation::allocation(a, &few[..4], meter)),
        None => report.skip(law::NO_ALLOCATION, "no counting allocator was given; see check_appendage_counting"),
    }
    report
}
