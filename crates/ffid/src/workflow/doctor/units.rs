//! Units that numbers may be in while the header of the record names another: by which factor a reading is then off.

/// Degrees per radian.
pub(super) const DEGREES: f64 = 180.0 / std::f64::consts::PI;
/// Milliradians per degree.
const MILLIRADIANS: f64 = 1000.0 / DEGREES;
/// How far a factor may be from that of a unit, as a ratio: masses that are wrong threefold.
const NEAR: f64 = 3.0;
/// Ratios of torques on the motor's side of a gear to those of the joint.
const GEARS: std::ops::Range<f64> = 1.0 / 300.0..1.0 / 25.0;

/// Numbers that are `factor` times too large, because they are in `is`.
#[derive(Debug, PartialEq)]
pub(super) struct Unit {
    pub(super) factor: f64,
    pub(super) is: &'static str,
    /// What to write in the header; empty for a unit that no header has.
    pub(super) write: &'static str,
}

const fn unit(factor: f64, is: &'static str, write: &'static str) -> Unit {
    Unit { factor, is, write }
}

/// Torques.
pub(super) const TORQUE: [Unit; 5] = [
    unit(1e3, "mN m, labelled as N m", "[mN m]"),
    unit(100.0, "N cm, labelled as N m", "[N cm]"),
    unit(8.8507, "lbf in (factor 8.85) or kgf cm (10.20), labelled as N m", ""),
    unit(1.0 / 9.80665, "kgf m, labelled as N m", ""),
    unit(1e-3, "kN m, labelled as N m", "[kN m]"),
];
/// The torque of one joint among others that are right.
pub(super) const ONE_TORQUE: [Unit; 2] =
    [unit(1e3, "mN m, labelled as N m", "[mN m]"), unit(1e-3, "kN m, labelled as N m", "[kN m]")];
/// Angular rates.
pub(super) const RATE: [Unit; 6] = [
    unit(1e3, "mrad/s, labelled as rad/s", "[mrad/s]"),
    unit(DEGREES, "deg/s, labelled as rad/s", "[deg/s]"),
    unit(MILLIRADIANS, "mrad/s, labelled as deg/s", "[mrad/s]"),
    unit(1.0 / MILLIRADIANS, "deg/s, labelled as mrad/s", "[deg/s]"),
    unit(1.0 / DEGREES, "rad/s, labelled as deg/s", "[rad/s]"),
    unit(1e-3, "rad/s, labelled as mrad/s", "[rad/s]"),
];
/// Angles.
pub(super) const ANGLE: [Unit; 6] = [
    unit(DEGREES, "in degrees", "[deg]"),
    unit(1.0 / DEGREES, "in radians, labelled as degrees", "[rad]"),
    unit(1e3, "in mrad, labelled as rad", "[mrad]"),
    unit(1e-3, "in rad, labelled as mrad", "[rad]"),
    unit(MILLIRADIANS, "in mrad, labelled as degrees", "[mrad]"),
    unit(1.0 / MILLIRADIANS, "in degrees, labelled as mrad", "[deg]"),
];
/// Times: recorded over true. What a thousand times takes seconds to has another unit in the header, one or two steps away.
pub(super) const TIME: [Unit; 6] = [
    unit(1e-3, "1000 times too short: s, labelled as ms (or ms as us, us as ns)", "time[s], or what it is,"),
    unit(1e3, "1000 times too long: ms, labelled as s (or us as ms, ns as us)", "time[ms], or what it is,"),
    unit(1e-6, "1e6 times too short: s, labelled as us (or ms as ns)", "time[s], or what it is,"),
    unit(1e6, "1e6 times too long: us, labelled as s (or ns as ms)", "time[us], or what it is,"),
    unit(1.0 / 60.0, "60 times too short: minutes, labelled as s", "time[min]"),
    unit(60.0, "60 times too long: s, labelled as minutes", "time[s]"),
];

/// The unit whose factor `ratio` is nearest to, within a factor of three.
pub(super) fn nearest(ratio: f64, known: &[Unit]) -> Option<&Unit> {
    let off = |u: &&Unit| (ratio / u.factor).ln().abs();
    known.iter().min_by(|a, b| off(a).total_cmp(&off(b))).filter(|u| off(u) < NEAR.ln())
}

/// The unit of this factor.
pub(super) fn of_factor(factor: f64, known: &[Unit]) -> Option<&Unit> {
    known.iter().find(|u| (u.factor / factor).ln().abs() < 1e-9)
}

/// Whether a torque that is `ratio` times its prediction may be that of the motor before a gear.
pub(super) fn on_motor_side(ratio: f64) -> bool {
    GEARS.contains(&ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_those_within_a_factor_of_three() {
        let factor = |ratio, known| nearest(ratio, known).map(|u: &Unit| u.factor);
        assert_eq!([2.9, 0.35, 310.0, 340.0].map(|r| factor(r, &ONE_TORQUE)), [None, None, None, Some(1e3)]);
        assert_eq!([2.9, 7.1, 0.09].map(|r| factor(r, &TORQUE)), [None, Some(8.8507), Some(1.0 / 9.80665)]);
        assert_eq!(
            [5.0, 20.0, 41.0, 0.011, 0.0021].map(|r| factor(r, &RATE)),
            [None, Some(MILLIRADIANS), Some(DEGREES), Some(1.0 / DEGREES), Some(1e-3)]
        );
        assert!(on_motor_side(1.0 / 157.0) && on_motor_side(1.0 / 50.0) && !on_motor_side(0.1));
    }
}
