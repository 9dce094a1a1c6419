//! Does an appendage keep the laws that the trait leaves to its author?
//!
//! ```text
//! let report = validate::check_appendage(&my_appendage);
//! assert!(report.passed(), "{report}");
//! ```
//!
//! The suite draws [`SAMPLES`] states and parameter sets (deterministic, general values, no zeros) and asks for each
//! law one figure that must not exceed a limit. It cannot know whether the energies are those of the device meant;
//! it knows that a device with these energies exists, and that the code computes its motion.

mod derived;
mod laws;
mod report;
mod sample;

pub use report::{Check, ConformanceReport, NotConforming};

use ff_model::DynAppendage;
use sample::{Sample, Source};

/// States and parameter sets drawn by [`check_appendage`].
pub const SAMPLES: usize = 64;

/// The laws, by the name they have in a report.
pub mod law {
    /// Counts, names, units, bounds, ranges and nominal inertias of the declaration make sense.
    pub const DECLARATION: &str = "declaration is sane";
    /// `M`, `U`, `R` and `h` are finite in the ordinary range.
    pub const FINITE: &str = "results are finite";
    /// `M`, `U`, `R` and `h` stay finite at range ends, high rates and parameters scaled by 1e-6 and 1e6.
    pub const EXTREME: &str = "results are finite at extremes";
    /// `M = M^T`.
    pub const SYMMETRIC: &str = "inertia is symmetric";
    /// `y^T M y >= 0`: no motion has negative kinetic energy.
    pub const SEMIDEFINITE: &str = "inertia is positive semidefinite";
    /// `M_ee` is positive definite: the own coordinates have an equation of motion.
    pub const OWN_BLOCK: &str = "own block is invertible";
    /// `M_bb = [[m 1, -[h]x], [[h]x, I]]`, `m` independent of the coordinates.
    pub const HOST_BLOCK: &str = "host block is that of a rigid body";
    /// `(M_be)_lin = dh/d eta`: linear momentum is the rate of the first moment. Linearised modes break it.
    pub const FIRST_MOMENT: &str = "coupling is the rate of the first moment";
    /// Duals and differences agree on the derivatives of `M`, `U` and `R`.
    pub const DERIVATIVES: &str = "energies differentiate consistently";
    /// `h` is what the energies imply.
    pub const BIAS: &str = "bias equals the derived bias";
    /// The derivatives of `h` are those of what the energies imply.
    pub const BIAS_DERIVATIVE: &str = "bias derivative equals the derived one";
    /// `w . V - nu . dR/dnu = d(T + U)/dt`, with damping on.
    pub const ENERGY: &str = "energy balances with damping on";
    /// `R(0) = 0`.
    pub const NO_DAMPING_AT_REST: &str = "no dissipation at rest";
    /// `nu . dR/dnu >= 0` and `R >= 0`.
    pub const DISSIPATES: &str = "damping dissipates";
    /// `R((a + b) / 2) <= (R(a) + R(b)) / 2`.
    pub const CONVEX: &str = "dissipation is convex";
    /// Every declared parameter changes `M`, `U`, `R` or `h`.
    pub const PARAMETERS: &str = "every parameter does something";
}

/// Checks an appendage against every law in [`law`]. A `&A` of any [`ff_model::Appendage`] will do.
///
/// Deterministic; takes milliseconds for a few coordinates; allocates. Never panics on wrong numbers: a declaration
/// that is not sane ends the suite after its first entry, and results that are not finite fail their law.
pub fn check_appendage(a: &dyn DynAppendage) -> ConformanceReport {
    let decl = a.declaration();
    let mut report = ConformanceReport::new(decl.kind);
    report.push(laws::declaration(decl));
    if !report.passed() {
        return report;
    }
    let mut source = Source::new(0x5eed);
    let samples: Vec<Sample> = (0..SAMPLES).map(|i| source.sample(decl, i)).collect();
    report.push(laws::finite(a, &samples));
    if !report.passed() {
        return report;
    }
    let extremes: Vec<Sample> = samples.iter().take(16).enumerate().map(|(i, s)| s.extreme(decl, i)).collect();
    report.push(laws::extreme(a, &extremes));
    for check in laws::inertia(a, &samples) {
        report.push(check);
    }
    report.push(laws::derivatives(a, &samples));
    for check in laws::bias_checks(a, &samples) {
        report.push(check);
    }
    report.push(laws::energy(a, &samples));
    for check in laws::rayleigh(a, &samples) {
        report.push(check);
    }
    report.push(laws::parameters(a, &samples));
    report
}
