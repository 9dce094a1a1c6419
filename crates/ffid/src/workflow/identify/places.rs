//! Readings beside kinks of the joint motion that alone contradict the model.
//!
//! Where the acceleration of a joint bends twice within a few readings, encoders may show one bend, and torques that are quieter than that contradict whatever
//! model is right, at a few readings of thousands. With the squares of the residuals of all channels at an instant, each over the noise of
//! its channel or what is usual there,
//!
//! ```text
//! X_i = sum over channels c of (r_ic / s_c)^2
//! ```
//!
//! places are where `X_i` is above the number of channels by [`STANDS_OUT`]. If all of them are next to kinks, and few, the record is fitted once more without them;
//! where the rest of it is explained, that is the result, and says so. An error of the model that shows at such readings alone is not found.

use super::labelled_record::LabelledRecord;
use super::record_estimator::Twin;
use super::result::identification::IdentificationResult;
use super::result::provenance::Warning;
use super::signals::Signals;
use super::text;
use crate::workflow::differences::typical;
use ff_model::diagnostics::list;
use nalgebra::DVectorView;

/// Chi-squared of an instant above the number of channels from which it is no chance among tens of thousands.
const STANDS_OUT: f64 = 40.0;
/// Intervals between samples within which a reading is next to a kink, and those about a place that are left out with it.
const NEXT: f64 = 6.0;
const ABOUT: f64 = 1.5;
/// Largest part of the instants of a record.
const FEW: f64 = 0.01;
/// Instants that are listed.
const LISTED: usize = 4;

/// Stretches of time (s) of each record.
pub(super) struct Places(Vec<Vec<(f64, f64)>>);

impl Places {
    /// Those of these records; `None` where there are none, too many, or some that are next to no kink. Allocates.
    pub(super) fn of(records: &[LabelledRecord], signals: &[Signals], twins: &[Twin<'_>]) -> Option<Self> {
        let each = records.iter().zip(signals).zip(twins);
        let all =
            each.map(|((t, s), twin)| places(s, &twin.kink_times(), t.record.dt())).collect::<Option<Vec<_>>>()?;
        all.iter().any(|own| !own.is_empty()).then_some(Self(all))
    }
    /// The records without them. Allocates.
    pub(super) fn without(&self, records: &[LabelledRecord]) -> Vec<LabelledRecord> {
        let of = |(t, own): (&LabelledRecord, &Vec<(f64, f64)>)| LabelledRecord {
            record: t.record.clone().with_uncounted(own),
            ..t.clone()
        };
        records.iter().zip(&self.0).map(of).collect()
    }
    /// Says in a result what it leaves out.
    pub(super) fn say(&self, result: &mut IdentificationResult) {
        let middles: Vec<String> = self.0.iter().flatten().map(|(a, b)| format!("{:.2}", 0.5 * (a + b))).collect();
        let (places, are) = if middles.len() == 1 { ("place", "is") } else { ("places", "are") };
        let message = format!(
            "{} {places} beside kinks of the joint motion {are} left out (about {} s), where single readings contradict the model",
            middles.len(),
            list(middles.iter().map(String::as_str), LISTED)
        );
        text::qualify(result, Warning { code: "Data::Kinks".to_owned(), message });
    }
}

/// Stretches about the instants of a record that stand out.
fn places(s: &Signals, kinks: &[f64], dt: f64) -> Option<Vec<(f64, f64)>> {
    let over_usual = |c: usize| {
        let r: Vec<f64> = s.residual(c).into_iter().map(|r| r / s.sigma[c]).collect();
        // Those that do not count are zero.
        let counted: Vec<f64> = r.iter().copied().filter(|r| *r != 0.0).collect();
        let usual = typical(DVectorView::from_slice(&counted, counted.len()), 0).max(1.0);
        r.into_iter().map(|r| r / usual).collect()
    };
    let channels: Vec<Vec<f64>> = (0..s.names.len()).map(over_usual).collect();
    let mut out: Vec<(f64, f64)> = Vec::new();
    for (i, &t) in s.time.iter().enumerate() {
        let read = channels.iter().map(|r| r[i]).filter(|r| !r.is_nan());
        let (count, squares) = read.fold((0.0, 0.0), |(n, sum), r| (n + 1.0, sum + r * r));
        if squares <= count + STANDS_OUT {
            continue;
        }
        if !kinks.iter().any(|k| (k - t).abs() < NEXT * dt) {
            return None;
        }
        let (from, to) = (t - ABOUT * dt, t + ABOUT * dt);
        match out.last_mut().filter(|last| from <= last.1) {
            Some(last) => last.1 = to,
            None => out.push((from, to)),
        }
    }
    let left_out = s.time.iter().filter(|t| out.iter().any(|(a, b)| (*a..=*b).contains(t))).count();
    (left_out as f64 <= FEW * s.time.len() as f64).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Of three channels whose residuals are of unit deviation, and these at these instants in the second.
    fn signals(out: &[(usize, f64)]) -> Signals {
        let n = 2000;
        let wave = |i: usize, c: usize| {
            let x = (12.9898 * i as f64 + 78.233 * c as f64).sin() * 43_758.545_3;
            3.4 * (x - x.floor() - 0.5)
        };
        let mut measured = DMatrix::from_fn(n, 3, |i, c| 0.05 * wave(i, c));
        out.iter().for_each(|&(i, r)| measured[(i, 1)] += 0.05 * r);
        Signals {
            time: (0..n).map(|i| 0.02 * i as f64).collect(),
            names: ["tau.a", "tau.b", "tau.c"].map(String::from).to_vec(),
            units: vec!["N m"; 3],
            sigma: vec![0.05; 3],
            measured,
            predicted: DMatrix::zeros(n, 3),
        }
    }

    #[test]
    fn places_are_few_readings_beside_kinks() {
        let kinks = [7.01, 21.3];
        let of = |out: &[(usize, f64)]| places(&signals(out), &kinks, 0.02);
        assert_eq!(of(&[]), Some(Vec::new()));
        let found = of(&[(351, 22.0), (352, -14.0), (1065, 11.0)]).unwrap();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].0 - 6.99).abs() < 1e-9 && (found[0].1 - 7.07).abs() < 1e-9, "{found:?}");
        // One that is next to no kink is the model's, and so is what stands out all the time.
        assert_eq!(of(&[(351, 22.0), (700, 12.0)]), None);
        let many: Vec<(usize, f64)> = (346..357).chain(1060..1071).map(|i| (i, 15.0)).collect();
        assert_eq!(of(&many), None);
    }
}
