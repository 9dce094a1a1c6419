//! Appendages that break one law each: what the conformance suite is tested with.
//!
//! Each is a right appendage with one mistake that authors make, some of them found in released software. The suite
//! must accept [`right`] and refuse every entry of [`known_wrong`] by the law that the entry names.
mod arm;
mod paddle;

use crate::conformance::law;
use arm::{Arm, ArmMistake};
use ff_model::DynAppendage;
use ff_model::port::Derived;
use paddle::{Paddle, PaddleMistake};

/// An appendage with a mistake.
pub struct KnownWrong {
    /// Short name.
    pub name: &'static str,
    /// The mistake in one sentence.
    pub mistake: &'static str,
    /// The law of [`law`] that must fail; others may fail with it.
    pub law: &'static str,
    /// The appendage itself.
    pub appendage: Box<dyn DynAppendage>,
}

/// The two appendages without a mistake, by name.
pub fn right() -> Vec<(&'static str, Box<dyn DynAppendage>)> {
    vec![("arm", Box::new(Arm::new(None))), ("paddle", Box::new(Derived::with_twin(Paddle::new(None))))]
}

/// Every known-wrong appendage. Allocates.
pub fn known_wrong() -> Vec<KnownWrong> {
    use ArmMistake as A;
    use PaddleMistake as P;
    let arm = |name, m: A, law, mistake| KnownWrong { name, mistake, law, appendage: Box::new(Arm::new(Some(m))) };
    let paddle = |name, m: P, law, mistake| {
        let appendage = Box::new(Derived::with_twin(Paddle::new(Some(m))));
        KnownWrong { name, mistake, law, appendage }
    };
    vec![
        arm(
            "damper-without-work",
            A::DamperWithoutWork,
            law::ENERGY,
            "the bias leaves the damper out, as a widely used simulator did for eight years",
        ),
        arm("damper-without-arm", A::DamperWithoutArm, law::ENERGY, "the damper force is not multiplied by its arm"),
        arm(
            "damper-counted-twice",
            A::DamperTwice,
            law::MOMENTUM,
            "the damper force acts on the host once more beside the mass, as in the paper's eq. (14)",
        ),
        arm("power-not-doubled", A::HalfThePower, law::POWER, "`dissipated_power` gives R, which is half of it"),
        arm("negative-damping", A::NegativeDamping, law::DISSIPATES, "one of two axes has negative damping"),
        arm("damper-with-bias", A::ConstantTorque, law::DISSIPATES, "R has a linear term: a constant force at rest"),
        arm("damper-weakening", A::NotConvex, law::CONVEX, "the damper weakens with speed"),
        arm("damper-at-rest", A::DampsAtRest, law::NO_DAMPING_AT_REST, "R is not zero at rest"),
        arm("spring-sign", A::SpringSign, law::ENERGY, "the bias has the spring with the paper's sign"),
        arm(
            "spring-circulating",
            A::Circulating,
            law::ENERGY,
            "springs across two coordinates of opposite sign, which no potential has",
        ),
        arm("coriolis-factor", A::HalfCoriolis, law::MOMENTUM, "w x r' in place of 2 w x r'"),
        arm("centripetal-sign", A::CentripetalSign, law::MOMENTUM, "the mass is pushed outwards by its own rotation"),
        arm(
            "host-torque-without-arm",
            A::TorqueWithoutArm,
            law::MOMENTUM,
            "the moment is about the hub, not the mount",
        ),
        arm("coupling-without-arm", A::CouplingWithoutArm, law::SEMIDEFINITE, "the same mistake in the inertia"),
        arm(
            "terms-not-cleared",
            A::NotCleared,
            law::TERMS,
            "`terms` leaves out a zero of the own block, which stays what the buffer held",
        ),
        arm("inertia-not-definite", A::NotDefinite, law::SEMIDEFINITE, "more coupling than the mass allows"),
        arm("no-own-inertia", A::NoOwnInertia, law::OWN_BLOCK, "a coordinate has no inertia of its own"),
        arm("mass-not-constant", A::MassGrows, law::MASS, "the mass grows with the angle"),
        arm("parameter-unused", A::UnusedParameter, law::PARAMETERS, "the stiffness is its nominal value always"),
        arm("derivative-dropped", A::DroppedDerivative, law::DERIVATIVES, "the angle goes through `value()`"),
        arm("types-disagree", A::TypesDisagree, law::NUMBER_TYPES, "a shortcut for numbers that carry derivatives"),
        arm(
            "branch-on-value",
            A::BranchOnValue,
            law::NUMBER_TYPES,
            "a branch on `value()`, which of lanes is the first one's, decides for all",
        ),
        arm("terms-without-damper", A::TermsWithoutDamper, law::TERMS, "`terms` leaves out a damper that `bias` has"),
        arm(
            "residual-of-classical-acceleration",
            A::ClassicalAcceleration,
            law::RESIDUAL,
            "`residual` adds w x v to an acceleration that is componentwise",
        ),
        arm(
            "jacobian-of-bias-alone",
            A::JacobianOfBias,
            law::JACOBIAN,
            "`jacobian` forgets that the inertia changes with the coordinates",
        ),
        arm(
            "regressor-column-forgotten",
            A::ColumnForgotten,
            law::REGRESSOR,
            "`regressor` leaves a damper's column zero",
        ),
        arm("bounds-swapped", A::SwappedBounds, law::DECLARATION, "a lower bound above the upper"),
        arm("name-twice", A::NameTwice, law::DECLARATION, "two parameters of one name"),
        arm("pole-in-range", A::PoleAtRangeEnd, law::EXTREME, "division by zero at the end of a range"),
        arm("undefined", A::Undefined, law::FINITE, "zero by zero"),
        arm("panics", A::Panics, law::NO_PANIC, "an assertion that coordinates are small"),
        arm("allocates", A::Allocates, law::NO_ALLOCATION, "a vector in the inertia"),
        paddle("twin-other-spring", P::TwinSpring, law::TWIN, "the twin has another stiffness"),
        paddle(
            "frozen-inertia",
            P::FrozenInertia,
            law::FIRST_MOMENT,
            "inertia linearised by hand at the rest angle, and the declaration says that it is Galilean",
        ),
        paddle("mass-squared", P::MassSquared, law::LINEAR, "an inertial parameter enters the kinetic energy squared"),
        paddle("scaled-by-length", P::ScaledByLength, law::LINEAR, "another parameter scales inertial ones"),
        paddle("spring-per-mass", P::SpringPerMass, law::LINEAR, "the potential contains an inertial parameter"),
    ]
}
