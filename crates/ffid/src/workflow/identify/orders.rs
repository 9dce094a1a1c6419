//! Springs of one appendage in another order.
//!
//! Two hinges in a row, the inner one soft and the outer one stiff or the other way round, ring with frequencies that are nearly the same, and a chain of
//! three explains its first mode in several ways. A fit that has ended with its springs in the wrong order leaves little, and no line of a mode:
//! a wing of three hinges ended at chi-squared per degree of freedom 1.0065 (1.0042 in the right order) with residuals that stand out at nothing but what tests of
//! errors find. So where the record contradicts a fit that comes near it, the springs of each appendage are exchanged.

use super::elsewhere::{STIFFER, of_a_try, stiffest};
use super::ends::{LOWER, NOWHERE, explains, given_back, is_spring, owner};
use super::observed_estimator::ObservedEstimator;
use super::valleys::ASIDE;
use ff_least_squares::Settings as Solver;
use ident::Request;
use ident::estimate::{Estimate, Estimator, attempt};
use ident::parameters::is_damping;

/// Springs of an appendage up to which all orders are tried; of more, neighbours are exchanged.
const ALL_ORDERS: usize = 3;
/// Ratio of two stiffnesses up to which their order makes no difference that could be a valley of its own.
const ALIKE: f64 = 1.2;
/// Factor on dampers in proportion to springs: what rings for long slips by periods.
const DAMPED: f64 = 3.0;
/// Linearisations of all data.
const LONGEST: usize = 40;
/// Ratio of all springs to those of the end up to which a try has come back to it.
const SAME_VALLEY: f64 = 1.5;
/// Orders that lead near the record and are gone on with over all data, the best first.
const ORDERS: usize = 3;

/// The end of a fit that has begun at this one with the springs of an appendage in another order, if that is lower; `None` where none is, or the
/// fit is far from the record, whatever the order. Allocates.
pub(super) fn lower(request: &Request<'_>, end: &Estimate, estimator: &mut ObservedEstimator<'_>) -> Option<Estimate> {
    let springs: Vec<usize> = request.selected.iter().copied().filter(|&i| is_spring(request, i)).collect();
    let starts = if explains(end, request.noise) { starts(request, end, &springs) } else { Vec::new() };
    if starts.is_empty() {
        return None;
    }
    let settings = of_a_try(request);
    let came_back = |e: &Estimate| springs.iter().all(|&i| (e.values[i] / end.values[i]).ln().abs() < SAME_VALLEY.ln());
    let led = |looked: &mut dyn Estimator| {
        let one = |start: &Vec<f64>| {
            let tried = Request {
                start,
                centre: Some(request.start),
                settings: settings.clone(),
                finer: ASIDE,
                ..request.clone()
            };
            attempt(&tried, &mut *looked).ok().filter(|e| e.chi2_per_dof < NOWHERE * request.noise && !came_back(e))
        };
        starts.iter().filter_map(one).collect::<Vec<_>>()
    };
    let thin = estimator.rough(&stiffest(request, &end.values, STIFFER)).map(|mut c| led(&mut *c.estimator));
    let mut ends = thin.unwrap_or_else(|| led(estimator));
    ends.sort_by(|a, b| a.objective.total_cmp(&b.objective));
    // Long steps over few samples leave more in one order than in another, and a try may still be on its way: all data choose.
    let settings = Solver { max_iterations: LONGEST.min(request.settings.max_iterations), ..request.settings.clone() };
    let on = |e: Estimate| {
        let (start, centre) = (&e.values[..], Some(request.start));
        let on = Request { start, centre, coarse: false, settings: settings.clone(), ..request.clone() };
        attempt(&on, &mut *estimator).ok().filter(|found| found.objective < end.objective - 2.0 * LOWER)
    };
    ends.into_iter().take(ORDERS).find_map(on)
}

/// The end of a fit with the springs of each appendage in other orders, and its dampers as the mission has them, then in proportion to the springs:
/// one in the wrong place may have vanished.
fn starts(request: &Request<'_>, end: &Estimate, springs: &[usize]) -> Vec<Vec<f64>> {
    let of = |i: usize| owner(&request.decls[i].name);
    let mut owners: Vec<Option<&str>> = springs.iter().map(|&i| of(i)).collect();
    owners.dedup();
    let mut out = Vec::new();
    for one in owners {
        let own: Vec<usize> = springs.iter().copied().filter(|&i| of(i) == one).collect();
        let dampers: Vec<usize> =
            request.selected.iter().copied().filter(|&i| of(i) == one && is_damping(&request.decls[i])).collect();
        let values: Vec<f64> = own.iter().map(|&i| end.values[i]).collect();
        let damping = dampers.iter().map(|&i| end.values[i]).sum::<f64>() / values.iter().sum::<f64>();
        for order in orders(own.len()) {
            let moved = |(k, &from): (usize, &usize)| (values[from] / values[k]).ln().abs() > ALIKE.ln();
            if !order.iter().enumerate().any(moved) {
                continue;
            }
            let mut start = given_back(request, end, |i| dampers.contains(&i));
            own.iter().zip(&order).for_each(|(&i, &from)| start[i] = values[from]);
            out.push(start.clone());
            // Those that are estimated beside the springs, one for each.
            if dampers.len() == own.len() {
                dampers.iter().zip(&order).for_each(|(&i, &from)| start[i] = DAMPED * damping * values[from]);
                out.push(start);
            }
        }
    }
    out
}

/// Orders of `n` things but the one that they have: all of up to [`ALL_ORDERS`], else exchanges of neighbours.
fn orders(n: usize) -> Vec<Vec<usize>> {
    let as_they_are: Vec<usize> = (0..n).collect();
    let swapped = |k: usize| {
        let mut order = as_they_are.clone();
        order.swap(k, k + 1);
        order
    };
    let mut out: Vec<Vec<usize>> = (1..n).map(|k| swapped(k - 1)).collect();
    if n == ALL_ORDERS {
        out.extend([vec![2, 1, 0], vec![1, 2, 0], vec![2, 0, 1]]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::identify::observed_estimator::Observer;
    use ff_least_squares::EvalError;
    use ff_model::ParamDecl;
    use nalgebra::DMatrix;

    /// What two springs in a row are read by: their product and sum, well, as two frequencies tell them, and their ratio, hardly.
    struct Row;
    const TRUTH: [f64; 2] = [310.0, 120.0];
    impl Row {
        fn read(k: &[f64]) -> [f64; 3] {
            [1e3 * (k[0] * k[1]).ln(), 1e3 * (k[0] + k[1]).ln(), 5.0 * (k[0] / k[1]).ln()]
        }
    }
    impl Estimator for Row {
        fn rows(&self) -> usize {
            3
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            let (here, there) = (Self::read(p), Self::read(&TRUTH));
            (0..3).for_each(|i| r[i] = here[i] - there[i]);
            Ok(())
        }
        fn jacobian(
            &mut self,
            p: &[f64],
            extra: &[f64],
            _: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            for k in 0..2 {
                let sign = if k == 0 { 1.0 } else { -1.0 };
                let of = [1e3 / p[k], 1e3 / (p[0] + p[1]), sign * 5.0 / p[k]];
                (0..3).for_each(|i| j[(i, k)] = of[i]);
            }
            self.residuals(p, extra, r)
        }
    }

    #[test]
    fn springs_in_the_wrong_order_are_exchanged() {
        let decls = ["wing.k[0]", "wing.k[1]"].map(|name| ParamDecl::positive(name, "N m/rad", 0.0));
        let start = [115.0, 320.0];
        let request = Request::new(&decls, &[0, 1], &start);
        let mut wrong = attempt(&request, &mut Row).unwrap();
        assert!(wrong.is_solution() && wrong.values[0] < wrong.values[1], "{:?}", wrong.values);
        // Of as many readings as a record has, it is near.
        assert!(!explains(&wrong, 1.0));
        let observer = Observer::default();
        let mut row = Row;
        let mut watched = ObservedEstimator::new(&mut row, &observer);
        assert!(lower(&request, &wrong, &mut watched).is_none(), "far from the record");
        wrong.chi2_per_dof = 1.01;
        let found = lower(&request, &wrong, &mut watched).unwrap();
        assert!((found.values[0] / TRUTH[0] - 1.0).abs() < 1e-3, "{:?}", found.values);
        let mut right = found;
        right.chi2_per_dof = 1.0;
        assert!(lower(&request, &right, &mut watched).is_none());
    }

    #[test]
    fn orders_are_all_but_one_and_neighbours_of_many() {
        assert_eq!(orders(1), Vec::<Vec<usize>>::new());
        assert_eq!(orders(2), [vec![1, 0]]);
        let mut three = orders(3);
        three.sort();
        three.dedup();
        assert!(three.len() == 5 && !three.contains(&vec![0, 1, 2]));
        assert_eq!(orders(5).len(), 4);
    }
}
