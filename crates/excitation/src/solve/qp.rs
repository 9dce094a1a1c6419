//! Convex quadratic programs by Clarabel: the subproblem of the optimiser and the search for feasible points.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::DMatrix;

/// `sum_c a_c z_c <= b`.
pub(crate) struct Inequality {
    pub(crate) columns: Vec<(usize, f64)>,
    pub(crate) bound: f64,
}

/// Why there is no solution.
pub(crate) enum QpFailure {
    /// Primal infeasible; the row with the greatest multiplier in the certificate.
    Infeasible(usize),
    /// The solver gave up.
    Solver,
}

/// A minimum with its multipliers, one per row.
pub(crate) struct Minimum {
    pub(crate) z: Vec<f64>,
    pub(crate) multipliers: Vec<f64>,
}

/// `min 1/2 z'Hz + g'z` under `rows`. `h` must be positive semidefinite.
pub(crate) fn solve(h: &DMatrix<f64>, g: &[f64], rows: &[Inequality]) -> Result<Minimum, QpFailure> {
    let n = g.len();
    let finite = h.iter().chain(g).all(|x| x.is_finite())
        && rows.iter().all(|r| r.bound.is_finite() && r.columns.iter().all(|c| c.1.is_finite()));
    if !finite {
        return Err(QpFailure::Solver);
    }
    let (mut pr, mut pc, mut pv) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..n {
        for i in (0..=j).filter(|&i| h[(i, j)] != 0.0) {
            pr.push(i);
            pc.push(j);
            pv.push(h[(i, j)]);
        }
    }
    let (mut ar, mut ac, mut av) = (Vec::new(), Vec::new(), Vec::new());
    for (i, row) in rows.iter().enumerate() {
        for (c, v) in &row.columns {
            ar.push(i);
            ac.push(*c);
            av.push(*v);
        }
    }
    let p = CscMatrix::new_from_triplets(n, n, pr, pc, pv);
    let a = CscMatrix::new_from_triplets(rows.len(), n, ar, ac, av);
    let b: Vec<f64> = rows.iter().map(|r| r.bound).collect();
    let cones = [NonnegativeConeT(rows.len())];
    // One thread: repeatable bit for bit.
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .max_threads(1)
        .tol_feas(1e-10)
        .build()
        .map_err(|_| QpFailure::Solver)?;
    let mut solver = DefaultSolver::new(&p, g, &a, &b, &cones, settings).map_err(|_| QpFailure::Solver)?;
    solver.solve();
    let s = &solver.solution;
    match s.status {
        SolverStatus::Solved | SolverStatus::AlmostSolved if s.x.iter().all(|x| x.is_finite()) => {
            Ok(Minimum { z: s.x.clone(), multipliers: s.z.clone() })
        }
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
            let worst = (0..s.z.len()).max_by(|i, j| s.z[*i].total_cmp(&s.z[*j])).unwrap_or(0);
            Err(QpFailure::Infeasible(worst))
        }
        _ => Err(QpFailure::Solver),
    }
}
