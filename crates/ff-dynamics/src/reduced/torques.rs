//! Joint torques of a rigid free-floating system with the base acceleration eliminated: the model of the RDA.

use crate::reduced::coupled;
use crate::reduced::sensitivity::outputs::TorqueRows;
use crate::reduced::sensitivity::partials::Columns;
use crate::reduced::sensitivity::stage::Tangent;
use crate::reduced::sensitivity::wanted::Wanted;
use crate::reduced::system::{Reduced, ReducedError, check};
use crate::reduced::table::Prescribed;
use core::ops::Range;
use ff_lanes::WIDEST;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch};
use ff_model::tree::Coordinates;
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// Joint torques of a rigid system for measured base rates, base acceleration eliminated: the reduced
/// dynamics of the RDA, with exact parameter derivatives.
///
/// `rates` is `N x 3`, the base angular velocity at the samples. Momentum conservation gives the base
/// acceleration, `A = -H_b^-1 (H_bm qdd + c_b)`, whatever the linear velocity (Galilean invariance), and
///
/// ```text
/// tau = H_m qdd + H_bm^T A + c_m = N^T Y phi,     d tau / d phi = N^T Y(A),     N^T = [-H_bm^T H_b^-1, 1].
/// ```
///
/// Rackl, Lampariello, Albu-Schaeffer 2013 (reference 2 of the paper); `docs/theory/rda.md`. Returns torques
/// (`N x n`) and their derivatives (`(N n) x P`, columns as in `wanted.params`, then `wanted.kinematics`). Allocates the results.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If the model has passive coordinates, `wanted.initial` is not empty, or a shape is wrong.
pub fn reduced_torques(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    rates: &DMatrix<f64>,
    wanted: &Wanted,
) -> Result<(DMatrix<f64>, DMatrix<f64>), ReducedError> {
    reduced_torques_span(model, params, table, 0..table.samples, rates, wanted)
}

/// [`reduced_torques`] of the samples `span` of the table, with base rates at these samples. Allocates the results.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// As [`reduced_torques`], and if the span ends beyond the table.
pub fn reduced_torques_span(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    span: Range<usize>,
    rates: &DMatrix<f64>,
    wanted: &Wanted,
) -> Result<(DMatrix<f64>, DMatrix<f64>), ReducedError> {
    let own = span.clone();
    let folded = |map: &Coordinates, (tau, d): (DMatrix<f64>, DMatrix<f64>)| {
        (coupled::columns(map, &tau), coupled::rows(map, &d))
    };
    if let Some(done) =
        coupled::over_tree(model, |tree| reduced_torques_span(tree, params, table, own, rates, wanted), folded)
    {
        return done;
    }
    check(model)?;
    assert_eq!(model.np(), 0, "reduced torques are those of a rigid model");
    assert!(wanted.initial.is_empty(), "there is no initial state to differentiate with respect to");
    assert!(span.end <= table.samples, "samples of a span");
    assert_eq!(rates.shape(), (span.len(), 3), "base rates");
    let (n, nj) = (span.len(), model.nj());
    let columns = Columns::new(model, table, wanted);
    let mut out = (DMatrix::zeros(n, nj), DMatrix::zeros(n * nj, columns.count));
    // States and accelerations at all samples, then derivatives for several samples at a time.
    let mut sys = Reduced::new(model, params, table);
    let mut points = vec![[0.0; 12]; n];
    let mut row = vec![0.0; nj];
    for (i, point) in points.iter_mut().enumerate() {
        let (z, u) = point.split_at_mut(6);
        (0..3).for_each(|k| z[3 + k] = rates[(i, k)]);
        let node = table.node_of(span.start + i);
        sys.accelerate(node, z, u)
            .map_err(|_| ReducedError::Singular { t: table.start_s() + 0.5 * table.step * node as f64 })?;
        sys.torques(span.start + i, z, u, &mut row);
        row.iter().enumerate().for_each(|(j, &t)| out.0[(i, j)] = t);
    }
    if columns.count > 0 {
        let d = out.1.as_mut_slice();
        let first = span.start;
        dispatch(Isa::detect(), Derivatives { model, params, table, columns: &columns, points: &points, first, d })?;
    }
    Ok(out)
}

struct Derivatives<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    table: &'a Prescribed,
    columns: &'a Columns,
    points: &'a [[f64; 12]],
    /// Sample of the table that the first point is.
    first: usize,
    d: &'a mut [f64],
}

impl LaneTask for Derivatives<'_> {
    type Output = Result<(), ReducedError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, params, table, columns, points, first: from, d } = self;
        let (n, nj, np) = (points.len(), model.nj(), columns.count);
        let lifted = params.lift::<L>(model);
        let mut tangent = Tangent::<L>::new(model, &lifted, table, columns);
        let mut torque = TorqueRows::new(model, params, table, columns);
        let mut solved = vec![L::zero(); 6 * np];
        let (mut z, mut u) = ([L::zero(); 6], [L::zero(); 6]);
        for first in (0..n).step_by(L::N) {
            // A group that is not full repeats its last sample.
            let at = |lane: usize| (first + lane).min(n - 1);
            let nodes: [usize; WIDEST] = core::array::from_fn(|lane| table.node_of(from + at(lane)));
            for k in 0..6 {
                for lane in 0..L::N {
                    z[k].set_lane(lane, points[at(lane)][k]);
                    u[k].set_lane(lane, points[at(lane)][6 + k]);
                }
            }
            if !tangent.evaluate(&nodes[..L::N], &z, &u) {
                return Err(ReducedError::Singular { t: table.start_s() + table.sample_s * (from + first) as f64 });
            }
            tangent.solve_params(0..np, &mut solved);
            for (lane, point) in points[first..].iter().take(L::N).enumerate() {
                let sample = first + lane;
                torque.evaluate(from + sample, &point[..6], &point[6..]);
                for j in 0..nj {
                    for c in 0..np {
                        let own = if torque.carried { torque.by_p[j * torque.wide + c] } else { 0.0 };
                        let by_u = torque.by_u.iter().skip(j).step_by(nj);
                        let through = by_u.zip(&solved[c * 6..]).map(|(t, x)| t * x.lane(lane)).sum::<f64>();
                        d[(c * n + sample) * nj + j] = own + through;
                    }
                }
            }
        }
        Ok(())
    }
}
