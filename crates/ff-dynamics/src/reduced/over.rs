//! The record of the reduced system over any scalar.

use crate::reduced::coupled;
use crate::reduced::system::{Reduced, ReducedError, Response, Rk4, STAGE, check};
use crate::reduced::table::{ArmSource, ArmTable};
use ff_model::scalar::ModelScalar;
use ff_model::{Model, Params};

/// [`crate::simulate_reduced`] over any scalar, table included: with dual numbers the exact derivatives of the record with
/// respect to whatever carries them, inertial and kinematic parameters among them. It serves as a check of
/// [`crate::sensitivities`], which is far faster. Allocates the response and buffers.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If `z0` has the wrong length.
pub fn simulate_reduced_over<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    table: &ArmTable<T>,
    z0: &[T],
) -> Result<Response<T>, ReducedError> {
    if let Some(done) =
        coupled::over_tree(model, |tree| simulate_reduced_over(tree, params, table, z0), Response::folded)
    {
        return done;
    }
    check(model)?;
    let m = model.np();
    assert_eq!(z0.len(), 6 + 2 * m, "initial state");
    let layout = table.layout();
    let mut out = Response::new(layout.samples, model.nj(), m);
    let mut sys = Reduced::new(model, params, table);
    let mut rk = Rk4::new(model, z0);
    let last = (layout.samples - 1) * layout.substeps;
    for step in 0..=last {
        for stage in 0..4 {
            let t = 0.5 * layout.step * (2 * step + STAGE[stage]) as f64;
            rk.stage(&mut sys, step, stage).map_err(|_| ReducedError::Singular { t })?;
            if stage == 0 && step % layout.substeps == 0 {
                rk.sample(&sys, step / layout.substeps)?;
                out.write(step / layout.substeps, m, &rk.zs, &rk.u, &rk.tau);
                if step == last {
                    return Ok(out);
                }
            }
            rk.rate(layout.step, stage);
        }
        rk.finish();
    }
    Ok(out)
}
