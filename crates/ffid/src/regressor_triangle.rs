//! All rows of the regressor over many motions as one triangle: what is left of them for rank, base parameters and a linear fit.

use ff_dynamics::batch::{Algorithm, Motions, batch, position_width};
use ff_least_squares::qr_r;
use ff_linalg::LinalgError;
use ff_model::{Model, Params};
use nalgebra::DMatrix;
use std::thread::scope;

/// Rows of a block per column: enough that a fold goes in lanes.
const TALL: usize = 17;

/// The upper triangle `R` of `[Y tau] = Q R`, where `Y` are the rows of [`ff_dynamics::regressor`] over all motions and `tau` the
/// generalised forces (`rows x nv`, row by row), if given. `motions.given` are accelerations. The rows themselves are never held at once:
/// memory is that of a block per thread. The signs of the rows of `R` are not fixed.
///
/// # Errors
/// [`LinalgError::NotFinite`].
///
/// # Panics
/// If a table has the wrong length.
pub fn regressor_triangle(
    model: &Model,
    params: &Params<f64>,
    motions: &Motions<'_>,
    tau: Option<&[f64]>,
    threads: usize,
) -> Result<DMatrix<f64>, LinalgError> {
    let nv = model.nv();
    if let Some(tau) = tau {
        assert_eq!(tau.len(), motions.rows * nv, "forces");
    }
    let share = motions.rows.div_ceil(threads.max(1)).max(1);
    let parts: Vec<(usize, usize)> =
        (0..motions.rows).step_by(share).map(|first| (first, share.min(motions.rows - first))).collect();
    let triangles: Vec<Result<DMatrix<f64>, LinalgError>> = scope(|s| {
        let all: Vec<_> = parts
            .iter()
            .map(|&(first, rows)| s.spawn(move || part(model, params, motions, tau, first, rows)))
            .collect();
        all.into_iter()
            .map(|t| match t.join() {
                Ok(r) => r,
                Err(why) => std::panic::resume_unwind(why),
            })
            .collect()
    });
    let width = model.n_params() + usize::from(tau.is_some());
    let triangles: Vec<DMatrix<f64>> = triangles.into_iter().collect::<Result<_, _>>()?;
    let mut stacked = DMatrix::zeros(triangles.len().max(1) * width, width);
    for (k, r) in triangles.iter().enumerate() {
        stacked.view_mut((k * width, 0), (width, width)).copy_from(r);
    }
    if triangles.len() == 1 { Ok(stacked) } else { qr_r(&stacked) }
}

/// The triangle of some of the rows.
fn part(
    model: &Model,
    params: &Params<f64>,
    motions: &Motions<'_>,
    tau: Option<&[f64]>,
    first: usize,
    rows: usize,
) -> Result<DMatrix<f64>, LinalgError> {
    let (nv, p, wq) = (model.nv(), model.n_params(), position_width(model));
    let width = p + usize::from(tau.is_some());
    let most = (TALL * width).div_ceil(nv).min(rows);
    let mut y = vec![0.0; most * nv * p];
    // The triangle so far on top of the rows of a block.
    let mut block = DMatrix::zeros(width + most * nv, width);
    let mut done = 0;
    while done < rows {
        let n = most.min(rows - done);
        let (a, b) = (first + done, first + done + n);
        let some = Motions {
            rows: n,
            q: &motions.q[a * wq..b * wq],
            v: &motions.v[a * nv..b * nv],
            given: &motions.given[a * nv..b * nv],
        };
        let out = &mut y[..n * nv * p];
        // A regressor solves nothing, so that nothing can be singular.
        if batch(Algorithm::Regressor, model, params, &some, out).is_err() {
            return Err(LinalgError::NotFinite { what: "regressor", row: a, column: 0 });
        }
        block.view_mut((width, 0), (most * nv, width)).fill(0.0);
        for c in 0..p {
            let column = &mut block.as_mut_slice()[c * (width + most * nv) + width..][..n * nv];
            column.iter_mut().zip(out.iter().skip(c).step_by(p)).for_each(|(to, x)| *to = *x);
        }
        if let Some(tau) = tau {
            block.view_mut((width, p), (n * nv, 1)).copy_from_slice(&tau[a * nv..b * nv]);
        }
        let r = qr_r(&block)?;
        block.view_mut((0, 0), (width, width)).copy_from(&r);
        done += n;
    }
    Ok(block.view((0, 0), (width, width)).into_owned())
}
