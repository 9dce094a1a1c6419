//! Closed formulas of the slosh pendulum: frequency, damping ratio, small-angle wrench, equivalent spring-mass.
//!
//! One plane: swing angle `alpha` (rad), lateral axis `x_l`, axial axis `x_a` along the settling acceleration; the
//! mass at `l (sin alpha, -cos alpha)` from the fulcrum. `swing[0]` of the appendage is such an angle with lateral
//! axis `y`; for `swing[1]` the lateral axis is `-x`. Nothing here allocates.

use std::f64::consts::TAU;

/// Natural frequency (rad/s) on a base in prescribed motion, the paper's eq. (16):
/// `omega_n = sqrt(x_a'' / l + k / (m l^2))`.
///
/// `m` (kg), `l` (m), `k` (N m/rad), `axial` the constant axial acceleration of the **fulcrum** (m/s^2, 0 in orbit
/// without thrust). The paper gives its unit as Hz; the formula yields rad/s. On a free base the frequency is
/// higher, because `m l^2` is to be replaced by `m l^2 - h_s^T H_b^-1 h_s`.
///
/// `None` if `m` or `l` is not above zero, anything is not finite, or the rest position is not stable
/// (`omega_n^2 <= 0`).
pub fn natural_frequency(m: f64, l: f64, k: f64, axial: f64) -> Option<f64> {
    let square = axial / l + k / (m * l * l);
    (m > 0.0 && l > 0.0 && square > 0.0 && square.is_finite()).then(|| square.sqrt())
}

/// [`natural_frequency`] in Hz: `omega_n / (2 pi)`.
pub fn natural_frequency_hz(m: f64, l: f64, k: f64, axial: f64) -> Option<f64> {
    natural_frequency(m, l, k, axial).map(|w| w / TAU)
}

/// Damping ratio `zeta = d / (2 m l^2 omega_n)` (no unit) for a damper `d` (N m s/rad); other arguments and `None`
/// as in [`natural_frequency`], and `None` for a `d` that is not finite.
pub fn damping_ratio(m: f64, l: f64, k: f64, d: f64, axial: f64) -> Option<f64> {
    let w = natural_frequency(m, l, k, axial)?;
    let zeta = d / (2.0 * m * l * l * w);
    zeta.is_finite().then_some(zeta)
}

/// What the pendulum exerts on the base at the fulcrum, in one plane and for small angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarWrench {
    /// Force along the lateral axis (N).
    pub lateral: f64,
    /// Force along the axial axis (N).
    pub axial: f64,
    /// Couple about the fulcrum, positive in the direction of growing `alpha` (N m).
    pub couple: f64,
}

/// Wrench of the pendulum on the base for small `alpha`, the paper's eqs. (14), (15) put right:
///
/// ```text
/// F_lat = -m (x_l'' + l alpha'')   ( = (d alpha' + k alpha) / l + m x_a'' alpha by the equation of motion)
/// F_ax  = -m x_a''                   C = k alpha + d alpha'
/// ```
///
/// Printed (14) adds the damper force to `+m (x_l'' + l alpha'')`: the damper is internal to the pendulum, its force
/// is already contained in the acceleration of the mass, and the sign is that of the force *on the mass*. The
/// couple is missing in the paper: without it the base would not feel the springs turn it.
///
/// `m` (kg), `l` (m), `k` (N m/rad), `d` (N m s/rad), `alpha`, its rate and acceleration (rad, s), `lateral` and
/// `axial` acceleration of the fulcrum (m/s^2). Neglects terms of second order in `alpha` and its rate.
pub fn small_angle_wrench(m: f64, l: f64, k: f64, d: f64, alpha: [f64; 3], lateral: f64, axial: f64) -> PlanarWrench {
    let [angle, rate, acceleration] = alpha;
    PlanarWrench { lateral: -m * (lateral + l * acceleration), axial: -m * axial, couple: k * angle + d * rate }
}

/// Angular acceleration of the pendulum for small `alpha` (rad/s^2), from
/// `m l^2 alpha'' + d alpha' + (k + m l x_a'') alpha = -m l x_l''`.
///
/// `alpha = [angle, rate]`; units as in [`small_angle_wrench`]. Infinite or NaN if `m` or `l` is zero.
pub fn small_angle_acceleration(m: f64, l: f64, k: f64, d: f64, alpha: [f64; 2], lateral: f64, axial: f64) -> f64 {
    -(m * l * lateral + d * alpha[1] + (k + m * l * axial) * alpha[0]) / (m * l * l)
}

/// The spring-mass-damper that a weightless pendulum equals at small angles.
///
/// It is also all that motion of the base can tell: mass, rest position, `omega_n` and `zeta`. Every arm length
/// `s l` with `s^2 k`, `s^2 d` and the fulcrum moved by `(1 - s) l` towards the mass's rest position gives the same
/// one. Length, stiffness and damping apart need a known fulcrum, large angles or known varying axial acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringMass {
    /// Moving mass (kg).
    pub mass: f64,
    /// Lateral stiffness `k / l^2` (N/m).
    pub stiffness: f64,
    /// Lateral damping `d / l^2` (N s/m).
    pub damping: f64,
}

impl SpringMass {
    /// The equivalent of a pendulum with `m` (kg), `l` (m), `k` (N m/rad), `d` (N m s/rad). Not finite if `l` is 0.
    pub fn of_pendulum(m: f64, l: f64, k: f64, d: f64) -> Self {
        Self { mass: m, stiffness: k / (l * l), damping: d / (l * l) }
    }
    /// Rotational stiffness (N m/rad) and damping (N m s/rad) of the equivalent pendulum of arm `l` (m).
    pub fn to_pendulum(&self, l: f64) -> (f64, f64) {
        (self.stiffness * l * l, self.damping * l * l)
    }
}
