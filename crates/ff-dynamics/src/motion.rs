//! Prescribed joint motion.
/// A prescribed joint motion.
pub trait JointMotion: Send + Sync {
    /// Number of joints.
    fn dof(&self) -> usize;
    /// Length (s).
    fn duration(&self) -> f64;
    /// Position, rate and acceleration at `t`.
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]);
}
