//! Readings of torques and gyro as weighted means over time, where only what is slow in them is to be compared.
//!
//! The weights are those of a root raised cosine (J. Proakis, M. Salehi, *Digital Communications*, 5th ed., section 9.2-3): a low pass whose shifts by one interval of the
//! averaged readings are orthogonal, so that noise which is white in the readings is white in their means. With the interval `T` and the roll-off
//! `b`, what is below `(1 - b) / 2T` passes whole, what is above `(1 + b) / 2T` not at all, and at `1 / 2T` half of the power passes.

use crate::record::Record;
use crate::time_base::ChannelGroup;
use crate::uniform::mean_interval;
use nalgebra::DMatrix;
use std::f64::consts::PI;
use std::sync::Arc;

/// Part of the band over which the gain falls, to both sides.
const ROLL_OFF: f64 = 0.5;
/// Intervals of the means to either side over which weights reach: what is left of them beyond is below 0.6 %.
const REACH: usize = 5;
/// Means that a record must come to.
const FEWEST: usize = 40;
/// Readings to either side beyond which no mean reaches.
const LONGEST: usize = 1 << 20;
/// Part of their interval by which times may be off even ones.
const EVEN: f64 = 1e-3;

/// How the readings of torques and gyro of a record were averaged ([`Record::averaged`]).
#[derive(Debug, PartialEq)]
pub struct Averaging {
    of: [Means; 2],
    torques: DMatrix<f64>,
    times: Option<Arc<[f64]>>,
}

/// Means of the readings of one group of channels.
#[derive(Debug, PartialEq)]
pub struct Means {
    half_hz: f64,
    spacing: f64,
    weights: Arc<[f64]>,
}

impl Means {
    /// Frequency of which half of the power passes (Hz).
    pub fn half_hz(&self) -> f64 {
        self.half_hz
    }
    /// Interval between what is averaged (s).
    pub fn spacing(&self) -> f64 {
        self.spacing
    }
    /// Odd in number, symmetric about the instant of a mean; their sum is one.
    pub fn weights(&self) -> &Arc<[f64]> {
        &self.weights
    }
    /// Standard deviation of a mean over that of a reading, for white noise.
    pub fn noise_gain(&self) -> f64 {
        self.weights.iter().map(|w| w * w).sum::<f64>().sqrt()
    }
    /// Of readings so far apart (s), how many from one mean to the next, and their weights.
    fn new(half_hz: f64, spacing: f64) -> Option<(Self, usize)> {
        let every = (0.5 / (half_hz * spacing)).round();
        if !every.is_finite() || every < 2.0 {
            return None;
        }
        let (half_hz, every) = (0.5 / (every * spacing), every as usize);
        let reach = REACH.checked_mul(every).filter(|reach| *reach < LONGEST)?;
        let at = |k: usize| root_raised_cosine((k as f64 - reach as f64) / every as f64);
        let raw: Vec<f64> = (0..=2 * reach).map(at).collect();
        let sum: f64 = raw.iter().sum();
        Some((Self { half_hz, spacing, weights: raw.into_iter().map(|w| w / sum).collect() }, every))
    }
}

impl Averaging {
    /// That of torques or base rates, the two groups that are averaged.
    pub fn of(&self, group: ChannelGroup) -> &Means {
        &self.of[usize::from(group != ChannelGroup::Torque)]
    }
    /// Torques that were averaged, N x n (N m or N), with their sample times (s) where these are not those of the uniform clock.
    pub fn torques(&self) -> (&DMatrix<f64>, Option<&[f64]>) {
        (&self.torques, self.times.as_deref())
    }
}

impl Record {
    /// The same record, of whose readings of torques and base rates only what is below some `half_hz` (Hz) is left, as means that many
    /// readings apart; positions stay as they are. `None` of channels that are not sampled evenly, or where hardly any readings
    /// would be saved or left. Allocates.
    pub fn averaged(&self, half_hz: f64) -> Option<Self> {
        if self.averaging.is_some() {
            return None;
        }
        let mut bases = self.bases.clone();
        let mut one = |group: ChannelGroup, readings: &DMatrix<f64>| {
            let (first, spacing) = match self.times(group) {
                Some(times) if times.len() > 1 => {
                    let (interval, off) = mean_interval(times);
                    (times[0], (off < EVEN).then_some(interval)?)
                }
                Some(_) => return None,
                None => (0.0, self.dt),
            };
            let (means, every) = Means::new(half_hz, spacing)?;
            let width = means.weights.len();
            let count = (readings.nrows() + 1).checked_sub(width)?.div_ceil(every);
            if count < FEWEST {
                return None;
            }
            let averages = DMatrix::from_fn(count, readings.ncols(), |i, c| {
                let own = &readings.column(c);
                means.weights.iter().enumerate().map(|(k, w)| w * own[i * every + k]).sum()
            });
            bases.set(group, (0..count).map(|i| first + (width / 2 + i * every) as f64 * spacing).collect());
            Some((averages, means))
        };
        let (tau, of_torques) = one(ChannelGroup::Torque, &self.tau)?;
        let (gyro, of_rates) = one(ChannelGroup::Gyro, &self.gyro)?;
        let times = self.bases.of(ChannelGroup::Torque).cloned();
        let averaging = Averaging { of: [of_torques, of_rates], torques: self.tau.clone(), times };
        Some(Self { tau, gyro, bases, averaging: Some(Arc::new(averaging)), ..self.clone() })
    }
    /// Standard deviation of a reading of torques or base rates over what the sensor has, for white noise: one of readings that were not averaged.
    pub fn noise_gain(&self, group: ChannelGroup) -> f64 {
        self.averaging().map_or(1.0, |a| a.of(group).noise_gain())
    }
    /// How its readings of torques and base rates were averaged; `None` for readings as they were taken.
    pub fn averaging(&self) -> Option<&Averaging> {
        self.averaging.as_deref()
    }
}

/// At a time in intervals of the means.
fn root_raised_cosine(t: f64) -> f64 {
    let b = ROLL_OFF;
    let slope = (4.0 * b * t).powi(2);
    if t == 0.0 {
        1.0 + b * (4.0 / PI - 1.0)
    } else if (slope - 1.0).abs() < 1e-9 {
        let (sin, cos) = (PI / (4.0 * b)).sin_cos();
        b / 2.0f64.sqrt() * ((1.0 + 2.0 / PI) * sin + (1.0 - 2.0 / PI) * cos)
    } else {
        ((PI * t * (1.0 - b)).sin() + 4.0 * b * t * (PI * t * (1.0 + b)).cos()) / (PI * t * (1.0 - slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::RecordBuilder;
    use std::f64::consts::TAU;

    /// 60 s at 50 Hz of one joint whose torque swings at a frequency (Hz).
    fn record(hz: f64) -> Record {
        let wave = |n: usize, hz: f64| {
            DMatrix::from_fn(3000, n, |i, c| (TAU * hz * 0.02 * i as f64 + 0.4 * c as f64 + 0.3).sin())
        };
        let built = RecordBuilder::new(["a"]).uniform(3.0, 50.0).q(wave(1, 0.11)).tau(wave(1, hz)).gyro(wave(3, 0.23));
        built.build().unwrap().0
    }

    #[test]
    fn what_is_slow_stays_and_what_is_fast_goes() {
        // 16 readings a mean, half of the power at 1.5625 Hz: all below 0.78 Hz, nothing above 2.34 Hz.
        let of = |hz: f64| record(hz).averaged(1.6).unwrap();
        let slow = of(0.61);
        let times = slow.times(ChannelGroup::Torque).unwrap();
        let means = slow.averaging().unwrap().of(ChannelGroup::Gyro);
        assert!((means.half_hz() - 1.5625).abs() < 1e-12 && means.spacing() == 0.02);
        assert!((times[1] - times[0] - 0.32).abs() < 1e-12 && times[0] == 1.6);
        for (i, t) in times.iter().enumerate() {
            assert!((slow.tau()[(i, 0)] - (TAU * 0.61 * t + 0.3).sin()).abs() < 0.01, "{t}");
            assert!((slow.gyro()[(i, 2)] - (TAU * 0.23 * t + 1.1).sin()).abs() < 0.01, "{t}");
        }
        assert!(of(3.7).tau().amax() < 0.01);
        let middle = (means.weights().len() / 2) as f64;
        let part = |(k, w): (usize, &f64)| w * (TAU * 1.5625 * 0.02 * (k as f64 - middle)).cos();
        let half: f64 = means.weights().iter().enumerate().map(part).sum();
        assert!((half - 0.5f64.sqrt()).abs() < 0.01, "{half}");
        assert_eq!((slow.q(), slow.samples()), (record(0.61).q(), 3000));
        assert_eq!(slow.averaging().unwrap().torques(), (record(0.61).tau(), None));
    }

    #[test]
    fn white_noise_stays_white() {
        let slow = record(0.5).averaged(2.2).unwrap();
        let means = slow.averaging().unwrap().of(ChannelGroup::Torque);
        let w = means.weights();
        let every = ((slow.times(ChannelGroup::Gyro).unwrap()[1] - slow.times(ChannelGroup::Gyro).unwrap()[0]) / 0.02)
            .round() as usize;
        let correlation = |lag: usize| -> f64 { w.iter().zip(&w[lag..]).map(|(a, b)| a * b).sum() };
        for k in 1..8 {
            assert!((correlation(k * every) / correlation(0)).abs() < 0.01, "{k}");
        }
        assert!((means.noise_gain().powi(2) - correlation(0)).abs() < 1e-15);
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn groups_with_times_of_their_own_are_averaged_where_these_are_even() {
        let all = record(0.61);
        let stamped = |jitter: f64| {
            let times: Vec<f64> =
                (0..5000).map(|i| 3.004 + 0.0119 * f64::from(i) + jitter * f64::from(i % 2)).collect();
            let tau = DMatrix::from_fn(5000, 1, |i, _| (TAU * 0.61 * (times[i] - 3.0) + 0.3).sin());
            let built = RecordBuilder::new(["a"]).uniform(3.0, 50.0).q(all.q().clone()).gyro(all.gyro().clone());
            built.tau(tau).times(ChannelGroup::Torque, times).build().unwrap().0
        };
        let slow = stamped(0.0).averaged(1.6).unwrap();
        let times = slow.times(ChannelGroup::Torque).unwrap();
        for (i, t) in times.iter().enumerate() {
            assert!((slow.tau()[(i, 0)] - (TAU * 0.61 * t + 0.3).sin()).abs() < 0.01, "{t}");
        }
        assert!(stamped(0.002).averaged(1.6).is_none());
    }

    #[test]
    fn hardly_any_means_are_none() {
        for hz in [20.0, 0.2, 0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
            assert!(record(0.5).averaged(hz).is_none(), "{hz}");
        }
        // Means are not averaged again.
        assert!(record(0.5).averaged(1.6).unwrap().averaged(0.5).is_none());
    }
}
