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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_the_whole_in_order() {
        let x = [0.3, 0.3, -1.0, 0.3, 0.7, 0.7, 0.7];
        assert_eq!(runs(&x).collect::<Vec<_>>(), [0..2, 2..3, 3..4, 4..7]);
        assert_eq!(runs(&[]).count(), 0);
    }
}
