//! Why time does not go forward: rows twice, stamps with too few digits, a clock that was set back, rows out of order.

use super::data;
use crate::resample::usual_interval;
use ff_model::Problem;

/// Rows of a clock that was set back are in order; more than one step back in so many rows is disorder.
const ROWS_PER_STEP: usize = 50;
/// A clock that is set back by so much (s) may be that of local time, or one that begins anew at midnight.
const HOUR: f64 = 3600.0;
const DAY: f64 = 24.0 * HOUR;

/// Why time does not go forward.
#[derive(Clone, Copy, PartialEq)]
enum Cause {
    /// Rows repeat the one before.
    Repeated,
    /// Stamps repeat, readings do not.
    FewDigits,
    /// Rows are in the order of their sampling, and their clock was set back.
    SetBack,
    /// The last sample comes first.
    Reversed,
    /// Rows are not in order.
    Disordered,
}

/// The first rows whose time is not behind that of the row before (row D11), each with its place. `listed` are places and numbers of these
/// rows among `stamps` (s, from `origin`), `identical` how many rows repeat the one before.
pub(super) fn explain(
    stamps: &[f64],
    origin: f64,
    listed: &[(usize, usize)],
    identical: usize,
) -> Vec<(usize, Problem)> {
    if listed.is_empty() {
        return Vec::new();
    }
    let usual = usual_interval(stamps);
    let cause = cause(stamps, usual, identical);
    let one = |&(place, i): &(usize, usize)| {
        let (last, next) = (stamps[i - 1], stamps[i]);
        let back = last - next + usual.max(0.0);
        let mut what = format!("time goes from {} to {} s", last + origin, next + origin);
        if cause == Cause::SetBack {
            what += &format!(": the clock was set back by {back:.6} s, or another record begins");
        }
        let hint = match cause {
            Cause::Repeated => "--drop-repeated leaves out rows that repeat the one before",
            Cause::FewDigits => {
                "stamps repeat and readings do not: write the time with more digits, or one row per stamp"
            }
            Cause::SetBack if (back - HOUR).abs() < 2.0 => {
                "daylight saving time ended? write stamps in UTC, or cut the file here and give both parts, --record a.csv b.csv"
            }
            Cause::SetBack if (back - DAY).abs() < 2.0 => {
                "times of day begin anew at midnight: write dates, as 2024-03-05T10:20:30.123"
            }
            Cause::SetBack => "do not sort: cut the file here, and give both parts, --record a.csv b.csv",
            Cause::Reversed => "the last sample comes first: sort the rows by time",
            Cause::Disordered => "rows are out of order: sort them by time",
        };
        (place, data("Data::NonMonotone", what).on("time").hint(hint))
    };
    listed.iter().map(one).collect()
}

fn cause(stamps: &[f64], usual: f64, identical: usize) -> Cause {
    let falls: Vec<usize> = (1..stamps.len()).filter(|&i| stamps[i] < stamps[i - 1]).collect();
    let ties = stamps.windows(2).filter(|w| w[0] == w[1]).count();
    match falls.len() {
        0 if 2 * identical >= ties => Cause::Repeated,
        0 => Cause::FewDigits,
        n if 10 * n >= 9 * (stamps.len() - 1) => Cause::Reversed,
        n if (n - 1) * ROWS_PER_STEP <= stamps.len() && falls.iter().all(|&i| set_back(stamps, i, usual)) => {
            Cause::SetBack
        }
        _ => Cause::Disordered,
    }
}

/// Whether the clock was set back before sample `i`: it then takes as many rows to pass the stamp before as it was set back by, and one row
/// that came late takes one.
fn set_back(stamps: &[f64], i: usize, usual: f64) -> bool {
    let last = stamps[i - 1];
    let behind = stamps[i..].iter().take_while(|t| **t <= last + 0.25 * usual).count();
    behind as f64 >= (last - stamps[i]) / usual + 0.5 || i + behind == stamps.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(stamps: &[f64], identical: usize) -> Cause {
        cause(stamps, usual_interval(stamps), identical)
    }

    #[test]
    fn a_clock_that_was_set_back_is_no_disorder() {
        let even: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
        for back in [0.02, 0.5, 3.0, 3600.0] {
            let t: Vec<f64> = even.iter().enumerate().map(|(i, t)| t - if i < 200 { 0.0 } else { back }).collect();
            assert!(of(&t, 0) == Cause::SetBack, "{back}");
        }
        let twice = [even.clone(), even.clone()].concat();
        assert!(of(&twice, 0) == Cause::SetBack);
        let p = &explain(&twice, 0.0, &[(402, 400)], 0)[0];
        assert!(p.0 == 402 && p.1.message.contains("set back by 4.00"), "{}", p.1);
        let mut late = even.clone();
        late.swap(100, 101);
        assert!(of(&late, 0) == Cause::Disordered);
        late[100..200].rotate_left(50);
        assert!(of(&late, 0) == Cause::Disordered);
        let reversed: Vec<f64> = even.iter().rev().copied().collect();
        assert!(of(&reversed, 0) == Cause::Reversed);
        let coarse: Vec<f64> = even.iter().map(|t| (20.0 * t).floor() / 20.0).collect();
        assert!(of(&coarse, 0) == Cause::FewDigits && of(&coarse, 320) == Cause::Repeated);
    }
}
