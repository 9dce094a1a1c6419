//! What may be wrong with the joint motion of a record: unit, sign or columns of positions, and the unit of time.

use super::units::{ANGLE, DEGREES, TIME};
use ff_records::Record;
use nalgebra::DMatrix;

/// Sampling intervals (s) that a record may have.
const INTERVALS: std::ops::RangeInclusive<f64> = 1e-5..=0.5;
/// Factors that the positions of one joint are tried with.
const ONE: [f64; 3] = [DEGREES, 1.0 / DEGREES, 1e3];

/// What is wrong with the joint motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MotionError {
    /// Nothing.
    None,
    /// Positions of all joints that turn are this many times too large.
    Factor(f64),
    /// Those of one are.
    OneFactor(usize, f64),
    /// Times are: rates are too small by it, accelerations by its square.
    Time(f64),
    Reversed(usize),
    Swapped(usize, usize),
}

impl MotionError {
    /// Whether it is a unit.
    pub(super) fn is_unit(self) -> bool {
        matches!(self, Self::Factor(_) | Self::OneFactor(..) | Self::Time(_))
    }
    /// The record with that put right.
    pub(super) fn put_right(self, record: &Record, turns: &[bool]) -> Record {
        let mut q: DMatrix<f64> = record.q().clone();
        match self {
            Self::None => return record.clone(),
            Self::Time(f) => return record.clone().with_time_scaled(1.0 / f),
            Self::Factor(f) => {
                (0..q.ncols()).filter(|&j| turns[j]).for_each(|j| q.column_mut(j).scale_mut(1.0 / f));
            }
            Self::OneFactor(j, f) => q.column_mut(j).scale_mut(1.0 / f),
            Self::Reversed(j) => q.column_mut(j).neg_mut(),
            Self::Swapped(i, j) => q.swap_columns(i, j),
        }
        record.clone().with_positions(q)
    }
    /// All of them, or those that a fit is to be refused for, of a record with samples `dt` (s) apart.
    pub(super) fn all(turns: &[bool], dt: f64, thorough: bool) -> Vec<Self> {
        let mut out: Vec<Self> = ANGLE.iter().map(|u| Self::Factor(u.factor)).collect();
        out.extend(TIME.iter().filter(|u| INTERVALS.contains(&(dt / u.factor))).map(|u| Self::Time(u.factor)));
        if thorough {
            let n = turns.len();
            for j in 0..n {
                if turns[j] {
                    out.extend(ONE.map(|f| Self::OneFactor(j, f)));
                }
                out.push(Self::Reversed(j));
                out.extend((j + 1..n).filter(|&k| turns[j] == turns[k]).map(|k| Self::Swapped(j, k)));
            }
        }
        out
    }
}
