//! Row D21: is a sensor turned, or its sign reversed? Asked before the fit, of the prediction at the start.

use super::{Fit, IdentifyError, Settings};
use ff_model::{Area, Model, Problem, Problems};
use ff_records::Record;
use nalgebra::DMatrix;

/// A turned axis must explain this much more of the gyro than the axes as they are before it is reported.
const BETTER: f64 = 3.0;
/// Share of the signal left unexplained by the axes as they are, below which nothing is wrong.
const UNEXPLAINED: f64 = 0.5;
/// Correlation below which the sign of a torque is reversed.
const REVERSED: f64 = -0.5;
/// Signals must be this many times the noise to be judged.
const LOUD: f64 = 5.0;
const XYZ: [&str; 3] = ["x", "y", "z"];

/// Compares the gyro with every signed permutation of its axes, and the sign of every torque, against the prediction at
/// `values`. Warnings and errors; empty when all is well or cannot be judged.
///
/// # Errors
/// [`IdentifyError`] when the model cannot be evaluated.
pub fn mismatch(model: &Model, values: &[f64], record: &Record, s: &Settings) -> Result<Problems, IdentifyError> {
    let mut fit = Fit::new(model, record, s)?;
    let sigma = fit.sigmas(model);
    let e = fit.estimator();
    let mut r = vec![0.0; e.rows()];
    let zeros = vec![0.0; e.nuisance().len()];
    e.residuals(values, &zeros, &mut r).map_err(|e| IdentifyError::Model(e.to_string()))?;
    let k = sigma.len();
    let measured = centred(&record.responses().columns(0, k).into_owned());
    let predicted = {
        let m = record.responses();
        centred(&DMatrix::from_fn(record.samples(), k, |i, j| m[(i, j)] + sigma[j] * r[i * k + j]))
    };
    let mut out = Problems::default();
    let n = model.nj();
    for j in 0..n {
        let (a, b) = (measured.column(j), predicted.column(j));
        let scale = a.norm() * b.norm();
        let loud = b.norm() > LOUD * sigma[j] * (record.samples() as f64).sqrt();
        let c = if scale > 0.0 { a.dot(&b) / scale } else { 0.0 };
        if loud && c < REVERSED {
            let what = format!("correlation {c:.2} with the prediction, limit {REVERSED}: the sign is reversed");
            let p =
                Problem::error(Area::Data, "Data::AxisMismatch", what).on(format!("tau.{}", record.joint_names()[j]));
            out.push(p.hint("a torque is that of the motor on the joint, positive along its axis; change the sign"));
        }
    }
    if k == n + 3 {
        gyro(&measured.columns(n, 3).into_owned(), &predicted.columns(n, 3).into_owned(), sigma[n], &mut out);
    }
    Ok(out)
}

fn centred(m: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = m.clone();
    for mut c in out.column_iter_mut() {
        let mean = c.mean();
        c.add_scalar_mut(-mean);
    }
    out
}

fn gyro(measured: &DMatrix<f64>, predicted: &DMatrix<f64>, sigma: f64, out: &mut Problems) {
    let rows = measured.nrows() as f64;
    let total = measured.norm_squared();
    if total < (LOUD * sigma).powi(2) * 3.0 * rows {
        return;
    }
    let left = |axes: [usize; 3], signs: [f64; 3]| {
        (0..3).map(|i| (measured.column(i) - predicted.column(axes[i]) * signs[i]).norm_squared()).sum::<f64>()
    };
    let mut best = (f64::INFINITY, [0, 1, 2], [1.0; 3]);
    for axes in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for bits in 0..8u8 {
            let signs: [f64; 3] = std::array::from_fn(|i| if bits >> i & 1 == 1 { -1.0 } else { 1.0 });
            let l = left(axes, signs);
            if l < best.0 {
                best = (l, axes, signs);
            }
        }
    }
    let own = left([0, 1, 2], [1.0; 3]);
    if own > UNEXPLAINED * total && own > BETTER * best.0 {
        let named: Vec<String> =
            (0..3).map(|i| format!("{}{}", if best.2[i] < 0.0 { "-" } else { "+" }, XYZ[best.1[i]])).collect();
        let what = format!(
            "gyro.x, y, z measure {} of the base: that explains {:.0} times more of the signal",
            named.join(", "),
            (own / best.0.max(f64::MIN_POSITIVE)).min(1e6)
        );
        let p = Problem::error(Area::Data, "Data::AxisMismatch", what).on("gyro");
        out.push(p.hint("rename the columns, or turn their signs; rates are those of the base frame in its own axes"));
    }
}
