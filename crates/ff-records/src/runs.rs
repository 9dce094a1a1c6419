//! Runs of equal samples: what a dead or saturated sensor leaves.

use core::ops::Range;

/// Maximal runs of equal neighbours, in order; together they are the whole. Does not allocate.
pub(crate) fn runs(x: &[f64]) -> impl Iterator<Item = Range<usize>> + '_ {
    let mut start = 0;
    core::iter::from_fn(move || {
        let first = x.get(start)?;
        let end = x[start..].iter().position(|v| v != first).map_or(x.len(), |k| start + k);
        let run = start..end;
        start = end;
        Some(run)
    })
}

/// The longest of these runs, the first of equals; empty where there is nothing. Does not allocate.
pub(crate) fn longest(x: &[f64]) -> Range<usize> {
    // Noise repeats nothing, and is passed over without a branch per sample.
    if !repeats(x, 1) {
        return 0..x.len().min(1);
    }
    runs(x).fold(0..0, |best, run| if run.len() > best.len() { run } else { best })
}

/// Whether a sample equals the so many next ones.
pub(crate) fn repeats(x: &[f64], times: usize) -> bool {
    let places = x.len().saturating_sub(times);
    (0..places).step_by(CHUNK).any(|at| {
        let end = places.min(at + CHUNK);
        let mut all = [true; CHUNK];
        for m in 1..=times {
            all.iter_mut().zip(x[at..end].iter().zip(&x[at + m..])).for_each(|(s, (a, b))| *s &= a == b);
        }
        all[..end - at].contains(&true)
    })
}

/// Samples that are looked at together.
const CHUNK: usize = 256;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_the_whole_in_order() {
        let x = [0.3, 0.3, -1.0, 0.3, 0.7, 0.7, 0.7];
        assert_eq!(runs(&x).collect::<Vec<_>>(), [0..2, 2..3, 3..4, 4..7]);
        assert_eq!(runs(&[]).count(), 0);
        assert_eq!((longest(&x), longest(&x[2..4]), longest(&[])), (4..7, 0..1, 0..0));
    }

    #[test]
    fn a_repetition_is_found_wherever_it_is() {
        for len in [3, 255, 256, 257, 258, 259, 700] {
            for at in (0..len - 2).step_by(if len < 600 { 1 } else { 37 }) {
                let mut x: Vec<f64> = (0..len).map(|i| 0.37 * i as f64 + 1.1).collect();
                x[at + 1] = x[at];
                assert_eq!((repeats(&x, 1), repeats(&x, 2)), (true, false), "{at} of {len}");
                assert_eq!(longest(&x), at..at + 2);
                x[at + 2] = x[at];
                assert!(repeats(&x, 2), "{at} of {len}");
                assert_eq!(longest(&x), at..at + 3);
            }
        }
        assert!(!repeats(&[1.0, f64::NAN, f64::NAN], 1) && !repeats(&[2.5], 1));
    }
}
