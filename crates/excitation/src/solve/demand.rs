//! Demands that no plan keeps together: what a search for a plan reports when there is none.

use std::fmt;

/// One of the demands that cannot be kept together.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// What is demanded.
    pub name: String,
    /// Of what: joint, body, frame, coordinate.
    pub item: String,
    /// The limit.
    pub limit: f64,
    /// A value with which a plan exists if everything else stays, if one was found.
    pub possible: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
}

/// Demands that contradict each other: leave out any one of them, and there is a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Conflict {
    /// The demands.
    pub demands: Vec<Demand>,
    /// One next step.
    pub next: String,
}

impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}: limit {} {}", self.name, self.item, self.limit, self.unit)?;
        match self.possible {
            Some(v) => write!(f, ", possible if all else stays {v:.4} {}", self.unit),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no plan keeps all of this: ")?;
        for (i, d) in self.demands.iter().enumerate() {
            if i > 0 {
                f.write_str("; ")?;
            }
            write!(f, "{d}")?;
        }
        write!(f, ". {}", self.next)
    }
}

impl std::error::Error for Conflict {}
