//! What a record carries beside motion, torques and base sensors: wrenches, wheels, thrusters, currents beside torques.

use nalgebra::DMatrix;

/// Channels by name, in SI units; samples are those of [`ChannelGroup::Carried`](crate::ChannelGroup::Carried).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carried {
    /// Names of the columns: `wrench.tool.fx`, `wheel.x`, `thruster.3`, `current.joint2`.
    pub names: Vec<String>,
    /// Their SI units.
    pub units: Vec<&'static str>,
    /// N x channels.
    pub values: DMatrix<f64>,
}

/// Components of a wrench as columns name them.
pub const WRENCH: [&str; 6] = ["fx", "fy", "fz", "tx", "ty", "tz"];

impl Carried {
    /// Frames of which all six components of a wrench are there, with their columns. Allocates.
    pub fn wrenches(&self) -> Vec<(String, [usize; 6])> {
        let column = |name: &str| self.names.iter().position(|n| n == name);
        let mut out = Vec::new();
        for name in &self.names {
            let Some(frame) = name.strip_prefix("wrench.").and_then(|n| n.strip_suffix(".fx")) else { continue };
            let all = WRENCH.map(|c| column(&format!("wrench.{frame}.{c}")));
            if let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = all {
                out.push((frame.to_owned(), [a, b, c, d, e, f]));
            }
        }
        out
    }
    /// With other values, one row per sample.
    pub(crate) fn with(&self, values: DMatrix<f64>) -> Self {
        Self { names: self.names.clone(), units: self.units.clone(), values }
    }
}
