//! The last fits of joint motions that were looked at for kinks.
//!
//! An identification makes an estimator of the same record a dozen times: in other steps, with errors among the unknowns, for the doctor. Each asks for the
//! same motion, and looking for its kinks takes up to eight seconds for 100 s of seven joints. A fit is a function of its input, of which a digest of 128
//! bits is kept; what is remembered changes no result.

use super::knot_spectrum::{SpectralFit, Stake};
use ff_records::Record;
use std::collections::VecDeque;
use std::collections::hash_map::DefaultHasher;
use std::hash::Hasher;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Fits that are kept, and numbers of positions beyond which one is not.
const KEPT: usize = 4;
const LARGEST: usize = 1 << 21;

/// Digest of what a fit is made of.
type Key = [u64; 2];

static LAST: Mutex<VecDeque<(Key, SpectralFit)>> = Mutex::new(VecDeque::new());

fn last() -> MutexGuard<'static, VecDeque<(Key, SpectralFit)>> {
    LAST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The fit that `of` makes, or the one that it has made of the same; `times` are those of the positions. Allocates a copy.
///
/// # Errors
/// Those of `of`.
pub(super) fn remembered<E>(
    (record, times, stake, from_rest): (&Record, &[f64], &Stake, bool),
    of: impl FnOnce() -> Result<SpectralFit, E>,
) -> Result<SpectralFit, E> {
    if !stake.kinks || record.q().len() > LARGEST {
        return of();
    }
    let digest = |salt: u64| {
        let mut hasher = DefaultHasher::new();
        let rates = record.qd().map_or(&[][..], |qd| qd.as_slice());
        let corners: Vec<f64> = stake.corners.iter().flat_map(|c| [c.time, c.order as f64]).collect();
        for numbers in [times, record.q().as_slice(), rates, &stake.weights, &stake.rates, &[stake.free], &corners] {
            hasher.write_usize(numbers.len());
            numbers.iter().for_each(|x| hasher.write_u64(x.to_bits()));
        }
        hasher.write_u64(salt + u64::from(from_rest));
        hasher.finish()
    };
    let key = [digest(0), digest(2)];
    let known = last().iter().find(|(of, _)| *of == key).map(|(_, fit)| fit.clone());
    if let Some(known) = known {
        return Ok(known);
    }
    let fit = of()?;
    let mut last = last();
    last.truncate(KEPT - 1);
    last.push_front((key, fit.clone()));
    Ok(fit)
}

#[cfg(test)]
mod tests {
    use super::super::knot_spectrum::{KnotError, fit_at_stake};
    use super::super::spline_fit::JointSamples;
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn a_fit_is_made_once_of_the_same_and_anew_of_anything_else() {
        let record = |lift: f64| {
            let q = DMatrix::from_fn(240, 1, |i, _| (0.06 * i as f64).sin() + lift * (0.17 * i as f64).cos());
            let tau = DMatrix::from_fn(240, 1, |i, _| (0.11 * i as f64).cos());
            let gyro = DMatrix::from_fn(240, 3, |i, k| 1e-2 * (0.07 * (i + k) as f64).sin());
            ff_records::RecordBuilder::new(["a"]).uniform(0.0, 50.0).q(q).tau(tau).gyro(gyro).build().unwrap().0
        };
        let times: Vec<f64> = (0..240).map(|i| 0.02 * f64::from(i)).collect();
        let stake = Stake { kinks: true, ..Stake::alike(1) };
        let mut made = 0;
        let mut fit = |record: &Record, stake: &Stake, from_rest: bool| {
            let of = || {
                made += 1;
                let q = record.q().as_slice();
                fit_at_stake(&JointSamples { dof: 1, times: &times, q, qd: None, rate_weight: 0.0 }, None, stake)
            };
            let fit: Result<SpectralFit, KnotError> = remembered((record, &times, stake, from_rest), of);
            (fit.unwrap().noise[0], made)
        };
        let (a, b) = (record(0.1), record(0.1 + 1e-12));
        let first = fit(&a, &stake, false);
        assert_eq!(fit(&a.clone(), &stake, false), first);
        assert_eq!(fit(&a, &stake, true).1, first.1 + 1);
        assert_eq!(fit(&b, &stake, false).1, first.1 + 2);
        let other = Stake { weights: vec![2.0], ..stake.clone() };
        assert_eq!(fit(&a, &other, false).1, first.1 + 3);
        // Without a search for kinks there is nothing to save.
        let plain = Stake { kinks: false, ..stake.clone() };
        assert_eq!(fit(&a, &plain, false).1, first.1 + 4);
        assert_eq!(fit(&a, &plain, false).1, first.1 + 5);
    }
}
