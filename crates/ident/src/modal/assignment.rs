//! Optimal assignment: which row goes with which column, at the least total cost.

/// The assignment of rows to columns with the least sum of costs, where leaving a row and a column alone costs `alone`: a
/// pair dearer than that is never made. `cost[i][j]` must be finite. Returns the column of each row. Allocates.
///
/// Shortest augmenting paths with potentials (R. Jonker, A. Volgenant, Computing 38, 1987) on the square matrix of size
/// rows + columns whose dummy rows and columns stand for being left alone; `O(n^3)`.
pub(crate) fn assign(cost: &[Vec<f64>], columns: usize, alone: f64) -> Vec<Option<usize>> {
    let rows = cost.len();
    let n = rows + columns;
    // Half of `alone` for a row and for a column each; two dummies cost nothing.
    let at = |i: usize, j: usize| match (i < rows, j < columns) {
        (true, true) => cost[i][j],
        (false, false) => 0.0,
        _ => 0.5 * alone,
    };
    // Indices from 1; column 0 is the root of the search.
    let (mut u, mut v) = (vec![0.0; n + 1], vec![0.0; n + 1]);
    let (mut owner, mut way) = (vec![0usize; n + 1], vec![0usize; n + 1]);
    for i in 1..=n {
        owner[0] = i;
        let mut j0 = 0;
        let (mut least, mut used) = (vec![f64::INFINITY; n + 1], vec![false; n + 1]);
        loop {
            used[j0] = true;
            let i0 = owner[j0];
            let (mut delta, mut next) = (f64::INFINITY, 0);
            for j in 1..=n {
                if used[j] {
                    continue;
                }
                let reduced = at(i0 - 1, j - 1) - u[i0] - v[j];
                if reduced < least[j] {
                    (least[j], way[j]) = (reduced, j0);
                }
                if least[j] < delta {
                    (delta, next) = (least[j], j);
                }
            }
            for j in 0..=n {
                if used[j] {
                    u[owner[j]] += delta;
                    v[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            j0 = next;
            if owner[j0] == 0 {
                break;
            }
        }
        while j0 != 0 {
            let back = way[j0];
            owner[j0] = owner[back];
            j0 = back;
        }
    }
    let mut out = vec![None; rows];
    for j in 1..=columns {
        if (1..=rows).contains(&owner[j]) {
            out[owner[j] - 1] = Some(j - 1);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Least total cost over all assignments, by trying them.
    fn best(cost: &[Vec<f64>], taken: &mut Vec<bool>, alone: f64, row: usize) -> f64 {
        if row == cost.len() {
            return 0.5 * alone * taken.iter().filter(|t| !**t).count() as f64;
        }
        let mut least = 0.5 * alone + best(cost, taken, alone, row + 1);
        for j in 0..taken.len() {
            if !taken[j] {
                taken[j] = true;
                least = least.min(cost[row][j] + best(cost, taken, alone, row + 1));
                taken[j] = false;
            }
        }
        least
    }

    #[test]
    fn it_is_as_cheap_as_the_best_of_all() {
        for case in 0..60usize {
            let (rows, columns) = (1 + case % 5, 1 + (case / 5) % 4);
            let value = |i: usize, j: usize| 6.0 * ((case * 71 + i * 13 + j * 29) as f64 * 0.618).fract();
            let cost: Vec<Vec<f64>> = (0..rows).map(|i| (0..columns).map(|j| value(i, j)).collect()).collect();
            let found = assign(&cost, columns, 4.0);
            let pairs = found.iter().flatten().count();
            let total: f64 = found.iter().enumerate().filter_map(|(i, j)| j.map(|j| cost[i][j])).sum::<f64>()
                + 2.0 * (rows + columns - 2 * pairs) as f64;
            let least = best(&cost, &mut vec![false; columns], 4.0, 0);
            assert!((total - least).abs() < 1e-12, "case {case}: {total} instead of {least}");
            assert!(found.iter().enumerate().all(|(i, j)| j.is_none_or(|j| cost[i][j] <= 4.0)));
        }
    }

    #[test]
    fn no_columns_leave_every_row_alone() {
        assert_eq!(assign(&[vec![], vec![]], 0, 1.0), [None, None]);
        assert!(assign(&[], 3, 1.0).is_empty());
    }
}
