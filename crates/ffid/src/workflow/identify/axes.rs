//! Axis mismatch (row D21) as problems: is a sensor turned, or its sign reversed? [`ident::checks::axis_mismatches`].

use super::drives::behind_gears;
use super::error::IdentifyError;
use super::record_estimator::{RecordEstimator, setup};
use super::settings::Settings;
use ff_model::{Area, Model, Problem, Problems};
use ff_records::Record;
use ident::checks::{AxisMismatch, REVERSED, axis_mismatches};

const XYZ: [&str; 3] = ["x", "y", "z"];

/// Compares the gyro with every signed permutation of its axes, and the sign of every torque, with the prediction at
/// `values`. One error for each mismatch; empty when there is none or it cannot be judged.
///
/// # Errors
/// [`IdentifyError`] when the model cannot be evaluated.
pub fn mismatch(model: &Model, values: &[f64], record: &Record, s: &Settings) -> Result<Problems, IdentifyError> {
    // Axes and signs are told from magnitudes.
    let even = record.bridged().map_err(ident::SetupError::from).map_err(setup)?;
    let (record, s, gains) = behind_gears(model, values, &even, s)?;
    let (record, s) = (&*record, &s);
    let mut fit = RecordEstimator::new(model, record, s)?;
    let sigma = fit.sigmas(model);
    let e = fit.estimator();
    let mut r = vec![0.0; e.rows()];
    let zeros = vec![0.0; e.nuisance().len()];
    e.residuals(values, &zeros, &mut r).map_err(|e| IdentifyError::Model(e.to_string()))?;
    // The gain of a drive has the sign that the record asks for.
    let told = |m: &AxisMismatch| match *m {
        AxisMismatch::Torque { joint, .. } => gains.get(joint).copied().flatten().is_none(),
        AxisMismatch::Gyro { .. } => true,
    };
    let all = axis_mismatches(record, &r, &sigma);
    Ok(Problems(all.iter().filter(|m| told(m)).map(|m| problem(m, record)).collect()))
}

/// A mismatch as an error.
pub(crate) fn problem(m: &AxisMismatch, record: &Record) -> Problem {
    match *m {
        AxisMismatch::Torque { joint, correlation } => {
            let what =
                format!("correlation {correlation:.2} with the prediction, limit {REVERSED}: the sign is reversed");
            Problem::error(Area::Data, "Data::AxisMismatch", what)
                .on(format!("tau.{}", record.joint_names()[joint]))
                .hint("a torque is that of the motor on the joint, positive along its axis; change the sign")
        }
        AxisMismatch::Gyro { axes, signs, improvement } => {
            let named: Vec<String> =
                (0..3).map(|i| format!("{}{}", if signs[i] < 0.0 { "-" } else { "+" }, XYZ[axes[i]])).collect();
            let mut what = format!("gyro.x, y, z measure {} of the base", named.join(", "));
            // An order that was tried, and not seen in the prediction, has none.
            if improvement > 1.0 {
                what += &format!(": that explains {improvement:.0} times more of the signal");
            }
            Problem::error(Area::Data, "Data::AxisMismatch", what)
                .on("gyro")
                .hint("rename the columns, or turn their signs; rates are those of the base frame in its own axes")
        }
    }
}
