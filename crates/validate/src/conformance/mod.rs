//! Does an appendage keep the laws that the trait leaves to its author?
//!
//! ```text
//! let report = crate::conformance::check_appendage(&my_appendage);
//! assert!(report.passed(), "{report}");
//! ```
//!
//! The suite draws [`SAMPLES`] states and parameter sets (deterministic, general values, no zeros) and asks for each
//! law one figure that must not exceed a limit. [`check_kind`] does so for a kind of a registry, and tries its factory
//! and a whole system with values that nobody should pass; `crate::systems` runs random systems of many kinds. It cannot know whether the energies are those of the device meant;
//! it knows that a device with these energies exists, and that the code computes its motion.
mod allocation;
mod declaration;
mod derived;
mod dissipation;
mod inertia;
mod kind;
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

/// The laws, by the name they have in a report.
pub mod law {
    /// Counts, names, units, bounds, ranges and nominal inertias of the declaration make sense.
    pub const DECLARATION: &str = "declaration is sane";
    /// `M`, `U`, `R` and `h` are finite in the ordinary range.
    pub const FINITE: &str = "results are finite";
    /// `M`, `U`, `R`, `h`, `terms`, `residual`, `jacobian` and `regressor` stay finite at rest, at tiny motion, at range ends, high rates and parameters scaled by
    /// 1e-6 and 1e6.
    pub const EXTREME: &str = "results are finite at extremes";
    /// `y^T M y >= 0`: no motion has negative kinetic energy.
    pub const SEMIDEFINITE: &str = "inertia is positive semidefinite";
    /// `M_ee` is positive definite: the own coordinates have an equation of motion.
    pub const OWN_BLOCK: &str = "own block is invertible";
    /// The mass of the host block does not depend on the coordinates. (That the block is `[[m 1, -[h]x], [[h]x, I]]`, and `M`
    /// symmetric, is what a [`ff_model::PortMatrix`] can hold.)
    pub const MASS: &str = "mass does not change with the coordinates";
    /// `(M_be)_lin = dh/d eta`: linear momentum is the rate of the first moment. It is the condition for the port
    /// equations to be Galilean, so it is required where [`ff_model::Appendage::galilean`] says so, and advice where it
    /// does not: linearised modes break it.
    pub const FIRST_MOMENT: &str = "coupling is the rate of the first moment";
    /// Duals and differences agree on the derivatives of `M`, `U` and `R`.
    pub const DERIVATIVES: &str = "energies differentiate consistently";
    /// `h` is what the energies imply.
    pub const BIAS: &str = "bias equals the derived bias";
    /// The derivatives of `h` are those of what the energies imply.
    pub const BIAS_DERIVATIVE: &str = "bias derivative equals the derived one";
    /// `terms` gives the `M` of `inertia` and the `h` of `bias`.
    pub const TERMS: &str = "terms equal inertia and bias";
    /// `residual` gives `M [A; nu'] + h`.
    pub const RESIDUAL: &str = "residual equals M a + h";
    /// `jacobian` is the derivative of `M [A; nu'] + h` with respect to the motion, by duals over `inertia` and `bias`.
    pub const JACOBIAN: &str = "jacobian equals the derived one";
    /// `regressor` is its derivative with respect to the parameters.
    pub const REGRESSOR: &str = "regressor equals the derived one";
    /// `w . V - nu . dR/dnu = d(T + U)/dt`, with damping on.
    pub const ENERGY: &str = "energy balances with damping on";
    /// `R(0) = 0`.
    pub const NO_DAMPING_AT_REST: &str = "no dissipation at rest";
    /// `nu . dR/dnu >= 0` and `R >= 0`.
    pub const DISSIPATES: &str = "damping dissipates";
    /// `dissipated_power` gives `nu . dR/dnu`.
    pub const POWER: &str = "dissipated power equals nu . dR/dnu";
    /// `R((a + b) / 2) <= (R(a) + R(b)) / 2`.
    pub const CONVEX: &str = "dissipation is convex";
    /// Every declared parameter changes `M`, `U`, `R` or `h`.
    pub const PARAMETERS: &str = "every parameter does something";
    /// `M` is linear in inertial parameters, with factors that no parameter changes; `U` and `R` do not contain them.
    pub const LINEAR: &str = "inertial parameters enter kinetic energy linearly";
    /// `w = d(M y)_b / dt` in axes that stand still.
    pub const MOMENTUM: &str = "momentum changes by the host's wrench alone";
    /// `M`, `U`, `R` and `h` have the same values over `f64` and over every dual number; they and `terms`, `residual`,
    /// `jacobian` and `regressor` have them in every lane of every instruction set that the machine has.
    pub const NUMBER_TYPES: &str = "number types agree";
    /// No method panics on zero, huge, tiny, infinite or undefined numbers.
    pub const NO_PANIC: &str = "no panic at any value";
    /// No method allocates.
    pub const NO_ALLOCATION: &str = "no method allocates";
    /// `M` and `h` are those of the twin of tree links.
    pub const TWIN: &str = "twin of tree links agrees";
    /// The registry has example tables of the kind, and its factory accepts them.
    pub const EXAMPLES: &str = "example tables are accepted";
    /// Every number of a table replaced by an odd one, every key left out: refused with problems, or a sane appendage.
    pub const TABLES: &str = "bad tables are refused with problems";
    /// A system with odd states or parameters moves by finite numbers or stops with an error.
    pub const SYSTEM: &str = "extreme values give finite motion or an error";
}

/// Checks an appendage against every law in [`law`]. A `&A` of any [`ff_model::Appendage`] will do.
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
    match a.tree_twin() {
        Some(bodies) => report.push(twin::twin(a, &bodies, few)),
        None => report.skip(law::TWIN, "the appendage has no twin"),
    }
    match meter {
        Some(meter) => report.push(allocation::allocation(a, &few[..4], meter)),
        None => report.skip(law::NO_ALLOCATION, "no counting allocator was given; see check_appendage_counting"),
    }
    report
}
