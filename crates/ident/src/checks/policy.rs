//! Which checks of a record are made after a fit.

/// What becomes of torque and gyro clocks that disagree with the clock of the joint encoders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockPolicy {
    /// Compare them where the record determines the offset; correct offsets and drifts above half a sample.
    #[default]
    Correct,
    /// As [`ClockPolicy::Correct`], and refuse a record that does not determine the offset.
    Require,
    /// Use the time stamps as they are.
    Trust,
}

/// Checks of a record after a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordChecks {
    /// Clocks of the channels.
    pub clocks: ClockPolicy,
    /// External torques are declared: a change of momentum is a warning, not an error.
    pub external_torque: bool,
    /// Refuse records whose free decay does not determine modes; else the modes are left out of the result.
    pub require_modes: bool,
}
