//! Joint torques beside those of rigid bodies: friction, reflected inertia, gains of drives.
//!
//! ```text
//! f_j = v qd + c sgn(qd) + o + I_a qdd + a |qd| + s qd |qd| + b exp(-|qd| / w) sgn(qd) + l |tau_j| sgn(qd)
//! ```
//!
//! with the torque `tau_j` that the rigid bodies need. All terms are linear in their coefficients, once the rate `w` of the Stribeck effect
//! is chosen (B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, *A survey of models, analysis tools and compensation methods for the
//! control of machines with friction*, Automatica 30(7), 1994; load: P. Hamon, M. Gautier, P. Garrec, *Dynamic identification of robots
//! with a dry friction model depending on load and velocity*, IROS 2010).

/// What becomes of samples of a joint close to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NearRest {
    /// The torque of the joint is not used while its rate is below this (rad/s or m/s); its motion still counts in the
    /// rows of the others. Beyond it the sign is exact.
    LeaveOut(f64),
    /// `sgn(qd)` is taken as `tanh(qd / width)`; nothing is left out. For friction that really is smooth at this rate.
    Smooth(f64),
}

impl NearRest {
    /// `sgn(qd)`.
    pub(crate) fn sign(self, rate: f64) -> f64 {
        match self {
            Self::Smooth(width) => (rate / width).tanh(),
            Self::LeaveOut(_) if rate == 0.0 => 0.0,
            Self::LeaveOut(_) => rate.signum(),
        }
    }
    /// Whether a torque at this rate is used where the joint has dry friction.
    pub(crate) fn uses(self, rate: f64) -> bool {
        match self {
            Self::LeaveOut(band) => rate.abs() > band,
            Self::Smooth(_) => true,
        }
    }
}

/// Which friction the joints have.
///
/// ```
/// use ident::Friction;
/// use ident::estimate::NearRest;
///
/// // Dry friction and a torque offset, samples slower than 20 mrad/s left out.
/// let friction = Friction { viscous: false, near_rest: NearRest::LeaveOut(0.02), ..Friction::ALL };
/// assert!(friction.coulomb && !friction.viscous && friction != Friction::NONE);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Torque in proportion to the rate.
    pub viscous: bool,
    /// Constant torque against the motion.
    pub coulomb: bool,
    /// Constant torque (of the sensor, or of a cable).
    pub offset: bool,
    /// Samples close to rest; without Coulomb friction none is treated differently.
    pub near_rest: NearRest,
}

impl Friction {
    /// Everything, samples below 0.01 rad/s left out.
    pub const ALL: Self = Self { viscous: true, coulomb: true, offset: true, near_rest: NearRest::LeaveOut(0.01) };
    /// None.
    pub const NONE: Self = Self { viscous: false, coulomb: false, offset: false, ..Self::ALL };
}

/// A term of the torque of a joint, linear in its coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointTerm {
    /// `qd`.
    Viscous,
    /// `sgn(qd)`.
    Coulomb,
    /// 1.
    Offset,
    /// `qdd`: inertia of rotor and gear about the axis of the joint, reflected to it.
    ReflectedInertia,
    /// `|qd|`: viscous friction that differs by direction; added to the viscous one forwards, subtracted from it backwards.
    Asymmetry,
    /// `qd |qd|`.
    Quadratic,
    /// `exp(-|qd| / rate) sgn(qd)`: friction that falls (or, with a negative coefficient, rises) from rest over this rate (rad/s or m/s).
    Stribeck {
        /// Rate (rad/s or m/s).
        rate: f64,
    },
    /// `|tau| sgn(qd)` with the torque of the rigid bodies: friction of a gear in proportion to its load.
    Load,
}

/// A joint in motion, as a term sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moving {
    pub(crate) qd: f64,
    pub(crate) qdd: f64,
    /// The sign of the rate.
    pub(crate) sign: f64,
    /// Torque of the bodies.
    pub(crate) load: f64,
}

impl JointTerm {
    /// Terms that are estimated without being asked for.
    pub(crate) const ALWAYS: [Self; 3] = [Self::Viscous, Self::Coulomb, Self::Offset];
    /// Whether it jumps with the direction of the motion.
    pub(crate) fn is_dry(self) -> bool {
        matches!(self, Self::Coulomb | Self::Stribeck { .. } | Self::Load)
    }
    /// What its coefficient is multiplied by.
    pub(crate) fn factor(self, at: Moving) -> f64 {
        let Moving { qd, qdd, sign, load } = at;
        match self {
            Self::Viscous => qd,
            Self::Coulomb => sign,
            Self::Offset => 1.0,
            Self::ReflectedInertia => qdd,
            Self::Asymmetry => qd.abs(),
            Self::Quadratic => qd * qd.abs(),
            Self::Stribeck { rate } => (-qd.abs() / rate).exp() * sign,
            Self::Load => load.abs() * sign,
        }
    }
    /// How that changes with rate and acceleration. What jumps, jumps where nothing is used.
    pub(crate) fn slopes(self, at: Moving) -> (f64, f64) {
        let Moving { qd, sign, .. } = at;
        match self {
            Self::Viscous => (1.0, 0.0),
            Self::ReflectedInertia => (0.0, 1.0),
            Self::Asymmetry => (sign, 0.0),
            Self::Quadratic => (2.0 * qd.abs(), 0.0),
            Self::Stribeck { rate } => (-(-qd.abs() / rate).exp() / rate, 0.0),
            Self::Coulomb | Self::Offset | Self::Load => (0.0, 0.0),
        }
    }
    /// Name of its coefficient, of the joint `joint`: `friction.<joint>.viscous`, `drive.<joint>.inertia`. Allocates.
    pub fn name(self, joint: &str) -> String {
        match self {
            Self::Viscous => format!("friction.{joint}.viscous"),
            Self::Coulomb => format!("friction.{joint}.coulomb"),
            Self::Offset => format!("friction.{joint}.offset"),
            Self::ReflectedInertia => format!("drive.{joint}.inertia"),
            Self::Asymmetry => format!("friction.{joint}.asymmetry"),
            Self::Quadratic => format!("friction.{joint}.quadratic"),
            Self::Stribeck { rate } => format!("friction.{joint}.stribeck@{rate}"),
            Self::Load => format!("friction.{joint}.load"),
        }
    }
    /// The term of a coefficient called so, of the joint `joint`.
    pub fn of_name(name: &str, joint: &str) -> Option<Self> {
        if name.strip_prefix("drive.").and_then(|n| n.strip_prefix(joint)) == Some(".inertia") {
            return Some(Self::ReflectedInertia);
        }
        let term = name.strip_prefix("friction.")?.strip_prefix(joint)?.strip_prefix('.')?;
        Some(match term {
            "viscous" => Self::Viscous,
            "coulomb" => Self::Coulomb,
            "offset" => Self::Offset,
            "asymmetry" => Self::Asymmetry,
            "quadratic" => Self::Quadratic,
            "load" => Self::Load,
            other => Self::Stribeck { rate: other.strip_prefix("stribeck@")?.parse().ok()? },
        })
    }
    /// SI unit of its coefficient, of a joint that turns, or slides.
    pub fn unit(self, slides: bool) -> &'static str {
        match (self, slides) {
            (Self::Viscous | Self::Asymmetry, false) => "N m s/rad",
            (Self::Viscous | Self::Asymmetry, true) => "N s/m",
            (Self::Coulomb | Self::Offset | Self::Stribeck { .. }, false) => "N m",
            (Self::Coulomb | Self::Offset | Self::Stribeck { .. }, true) => "N",
            (Self::ReflectedInertia, false) => "kg m^2",
            (Self::ReflectedInertia, true) => "kg",
            (Self::Quadratic, false) => "N m s^2/rad^2",
            (Self::Quadratic, true) => "N s^2/m^2",
            (Self::Load, _) => "1",
        }
    }
}

/// Torques of the joints beside those of rigid bodies, with their coefficients, and gains of drives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointTorques {
    /// Terms of every joint, with coefficients in SI units.
    pub terms: Vec<Vec<(JointTerm, f64)>>,
    /// Torque of a joint by the current of its motor (N m/A), where currents were measured.
    pub gains: Vec<Option<f64>>,
}

impl JointTorques {
    /// The coefficient of a term of a joint; zero where there is none.
    pub fn coefficient(&self, joint: usize, term: JointTerm) -> f64 {
        self.terms.get(joint).and_then(|t| t.iter().find(|t| t.0 == term)).map_or(0.0, |t| t.1)
    }
    /// What a channel on the motor's side of a joint reads: its torque `tau` of the bodies with all terms, over the gain of the drive where it is a
    /// current (A; else N m, or N), at this rate and acceleration. Without `near_rest` the sign of the rate is exact.
    ///
    /// ```
    /// use ident::estimate::{JointTerm, JointTorques};
    ///
    /// let terms = vec![vec![(JointTerm::Viscous, 0.3), (JointTerm::Coulomb, 0.8)]];
    /// let motor = JointTorques { terms, gains: vec![Some(0.25)] };
    /// // (2 - 0.3 * 0.5 - 0.8) N m over 0.25 N m/A.
    /// assert!((motor.reading(0, (-0.5, 0.1), 2.0, None) - 4.2).abs() < 1e-12);
    /// ```
    pub fn reading(&self, joint: usize, (qd, qdd): (f64, f64), tau: f64, near_rest: Option<NearRest>) -> f64 {
        let sign = near_rest.unwrap_or(NearRest::LeaveOut(0.0)).sign(qd);
        let beside = self.torque(joint, Moving { qd, qdd, sign, load: tau });
        (tau + beside) / self.gains.get(joint).copied().flatten().unwrap_or(1.0)
    }
    /// Torque of the terms of a joint.
    pub(crate) fn torque(&self, joint: usize, at: Moving) -> f64 {
        self.terms.get(joint).map_or(0.0, |all| all.iter().map(|(t, x)| x * t.factor(at)).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_terms() {
        let all = [
            JointTerm::Viscous,
            JointTerm::Coulomb,
            JointTerm::Offset,
            JointTerm::ReflectedInertia,
            JointTerm::Asymmetry,
            JointTerm::Quadratic,
            JointTerm::Stribeck { rate: 0.123_456_789 },
            JointTerm::Load,
        ];
        for term in all {
            assert_eq!(JointTerm::of_name(&term.name("a.b"), "a.b"), Some(term));
            assert_eq!(JointTerm::of_name(&term.name("a.b"), "b"), None);
        }
        let at = Moving { qd: -0.5, qdd: 2.0, sign: -1.0, load: -8.0 };
        let of = all.map(|t| t.factor(at));
        assert_eq!(of[..6], [-0.5, -1.0, 1.0, 2.0, 0.5, -0.25]);
        assert!((of[6] + (-0.5f64 / 0.123_456_789).exp()).abs() < 1e-15 && of[7] == -8.0);
    }
}
