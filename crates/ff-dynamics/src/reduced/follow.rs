//! What becomes of a trajectory while it is integrated.

/// What becomes of a trajectory while it is integrated.
pub(crate) trait Follow<T> {
    /// State and accelerations of every stage.
    fn stage(&mut self, z: &[T], u: &[T]);
    /// State, accelerations and joint torques at every sample.
    fn sample(&mut self, i: usize, z: &[T], u: &[T], tau: &[T]);
}
