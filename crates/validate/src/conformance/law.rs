//! The laws, by the name they have in a report.

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
/// equations to be Galilean, so it is required where [`ff_model::Decl::galilean`] says so, and advice where it
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
