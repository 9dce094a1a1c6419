//! A measured record: joint motion, joint torques, base gyro.
//!
//! All channels are sampled on one uniform clock, or groups of them at times of their own ([`ChannelGroup`]): the uniform clock is then
//! the grid that a model is integrated on.
//!
//! A [`Record`] can only be made by [`RecordBuilder`](crate::builder::RecordBuilder), which is the one
//! door where non-finite numbers, broken clocks and ragged columns stop; whoever holds one may rely on every
//! number being finite and every length being right. Matrices are N x channels, so that one channel is one
//! contiguous column.

use crate::averaged::Averaging;
use crate::carried::Carried;
use crate::resample::{TimeBaseError, on_grid};
use crate::time_base::{ChannelGroup, TimeBases};
use core::ops::Range;
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;
use std::sync::Arc;

/// N uniform samples, and channels sampled on them or at times of their own. Rows are samples, columns are channels.
///
/// ```
/// use ff_records::{Record, RecordBuilder};
/// use nalgebra::DMatrix;
///
/// # let wave = |channels, k: f64| DMatrix::from_fn(400, channels, |i, j| (k * i as f64 + 0.7 * j as f64).sin());
/// # let builder = RecordBuilder::new(["shoulder", "elbow"]).uniform(12.0, 100.0).q(wave(2, 0.010)).tau(wave(2, 0.023));
/// # let (record, _) = builder.gyro(wave(3, 0.017)).build()?;
/// let swing: Record = record.window(1.0, 2.5)?; // s after its first sample
/// assert_eq!((swing.joint_names().len(), swing.rate_hz()), (2, 100.0));
/// assert_eq!(swing.tau()[(0, 1)], record.tau()[(100, 1)]);
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, PartialEq)]
pub struct Record {
    pub(crate) t0: f64,
    pub(crate) dt: f64,
    pub(crate) joint_names: Vec<String>,
    pub(crate) q: DMatrix<f64>,
    pub(crate) qd: Option<DMatrix<f64>>,
    pub(crate) qdd: Option<DMatrix<f64>>,
    pub(crate) tau: DMatrix<f64>,
    pub(crate) gyro: DMatrix<f64>,
    pub(crate) acc: Option<DMatrix<f64>>,
    pub(crate) att: Option<DMatrix<f64>>,
    pub(crate) currents: Vec<bool>,
    pub(crate) carried: Option<Carried>,
    pub(crate) fixed_base: bool,
    pub(crate) bases: TimeBases,
    /// Samples of the grid, where they are not those of the joint motion.
    pub(crate) grid: Option<usize>,
    /// Stretches of time (s, on the clock of the recorder) in which readings do not count.
    pub(crate) uncounted: Vec<(f64, f64)>,
    /// How torques and base rates were averaged.
    pub(crate) averaging: Option<Arc<Averaging>>,
}

/// Values of a group at its times (s) brought to instants that are an interval (s) apart, so many of them.
pub(crate) type ToGrid<'f> =
    dyn Fn(ChannelGroup, &[f64], &DMatrix<f64>, f64, usize) -> Result<DMatrix<f64>, TimeBaseError> + 'f;

impl core::fmt::Debug for Record {
    /// The head of the record; the samples would fill pages.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Record")
            .field("t0", &self.t0)
            .field("dt", &self.dt)
            .field("samples", &self.samples())
            .field("joint_names", &self.joint_names)
            .finish_non_exhaustive()
    }
}

impl Record {
    /// Time of the first sample on the recorder's clock (s).
    pub fn t0(&self) -> f64 {
        self.t0
    }
    /// Sampling interval of the uniform clock (s).
    pub fn dt(&self) -> f64 {
        self.dt
    }
    /// Sampling rate `1/dt` (Hz).
    pub fn rate_hz(&self) -> f64 {
        1.0 / self.dt
    }
    /// Number of samples N of the uniform clock.
    pub fn samples(&self) -> usize {
        self.grid.unwrap_or(self.q.nrows())
    }
    /// Sample times of a group since the first sample of the uniform clock (s), ascending; `None` where it is sampled on that clock.
    /// The channels of the group have as many rows.
    pub fn times(&self, group: ChannelGroup) -> Option<&[f64]> {
        self.bases.of(group).map(|t| &**t)
    }
    /// Whether all channels are sampled on the uniform clock.
    pub fn is_uniform(&self) -> bool {
        self.bases.first().is_none()
    }
    /// Whether `what` can be done with the record, which needs all channels on the uniform clock.
    ///
    /// # Errors
    /// [`TimeBaseError::NotUniform`] naming the first group with sample times of its own.
    pub fn check_uniform(&self, what: &'static str) -> Result<(), TimeBaseError> {
        self.bases.first().map_or(Ok(()), |group| Err(TimeBaseError::NotUniform { group, what }))
    }
    /// All channels on the uniform clock: those sampled at times of their own by the polynomials of degree five through the six nearest
    /// samples, in error by at most `h^6 max|f^(6)| / 205` where samples are no further than `h` apart
    /// (`docs/theory/output-operator.md`). Noise of interpolated samples is no longer white. Attitudes are normalised. Allocates.
    ///
    /// # Errors
    /// [`TimeBaseError`] naming the channels: fewer than six samples, more than four usual intervals without one, or the clock
    /// goes on where they were not sampled.
    pub fn resampled(&self) -> Result<Self, TimeBaseError> {
        self.on_clock(&on_grid)
    }
    /// All channels on the uniform clock, each group by `grid` from its times and values, interval and samples.
    pub(crate) fn on_clock(&self, grid: &ToGrid<'_>) -> Result<Self, TimeBaseError> {
        let n = self.samples();
        let one = |group, m: &DMatrix<f64>| match self.times(group) {
            Some(times) => grid(group, times, m, self.dt, n),
            None => Ok(m.clone()),
        };
        let some = |group, m: &Option<DMatrix<f64>>| m.as_ref().map(|m| one(group, m)).transpose();
        let mut att = some(ChannelGroup::Attitude, &self.att)?;
        if self.times(ChannelGroup::Attitude).is_some() {
            for mut row in att.iter_mut().flat_map(|m| m.row_iter_mut()) {
                let norm = row.norm();
                row.unscale_mut(norm);
            }
        }
        Ok(Self {
            q: one(ChannelGroup::Motion, &self.q)?,
            qd: some(ChannelGroup::Motion, &self.qd)?,
            qdd: some(ChannelGroup::Motion, &self.qdd)?,
            tau: one(ChannelGroup::Torque, &self.tau)?,
            gyro: one(ChannelGroup::Gyro, &self.gyro)?,
            acc: some(ChannelGroup::Accelerometer, &self.acc)?,
            att,
            carried: match &self.carried {
                Some(c) => Some(c.with(one(ChannelGroup::Carried, &c.values)?)),
                None => None,
            },
            currents: self.currents.clone(),
            bases: TimeBases::default(),
            grid: None,
            uncounted: self.uncounted.clone(),
            averaging: self.averaging.clone(),
            joint_names: self.joint_names.clone(),
            ..*self
        })
    }
    /// `N dt` (s): the time the samples stand for, whose inverse is the frequency resolution.
    pub fn seconds(&self) -> f64 {
        self.samples() as f64 * self.dt
    }
    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.joint_names.len()
    }
    /// Time of sample `i` since the first one (s).
    pub fn time(&self, i: usize) -> f64 {
        i as f64 * self.dt
    }
    /// Names of the joints, in the order of the columns.
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }
    /// Joint positions, N x n (rad or m).
    pub fn q(&self) -> &DMatrix<f64> {
        &self.q
    }
    /// Joint rates, N x n (rad/s or m/s), when recorded.
    pub fn qd(&self) -> Option<&DMatrix<f64>> {
        self.qd.as_ref()
    }
    /// Joint accelerations, N x n (rad/s^2 or m/s^2), when recorded.
    pub fn qdd(&self) -> Option<&DMatrix<f64>> {
        self.qdd.as_ref()
    }
    /// Joint torques after the gear, N x n (N m or N); currents of the motors (A) of the joints in [`Record::currents`].
    pub fn tau(&self) -> &DMatrix<f64> {
        &self.tau
    }
    /// Base angular velocity in base axes, N x 3 (rad/s).
    pub fn gyro(&self) -> &DMatrix<f64> {
        &self.gyro
    }
    /// Base specific force in base axes, N x 3 (m/s^2), when recorded.
    pub fn acc(&self) -> Option<&DMatrix<f64>> {
        self.acc.as_ref()
    }
    /// Base attitude as unit quaternions `[w, x, y, z]`, N x 4, sign-continuous, when recorded.
    pub fn att(&self) -> Option<&DMatrix<f64>> {
        self.att.as_ref()
    }
    /// Joints whose motor current (A) stands in [`Record::tau`] in place of a torque, `true` for each; empty where there is none.
    pub fn currents(&self) -> &[bool] {
        &self.currents
    }
    /// Whether the torque of every joint was measured, and no current in place of it.
    pub fn has_torques(&self) -> bool {
        !self.currents.contains(&true)
    }
    /// What the record carries beside: wrenches, wheels, thrusters.
    pub fn carried(&self) -> Option<&Carried> {
        self.carried.as_ref()
    }
    /// True when the base was bolted to the ground; [`Record::gyro`] is then zero unless it was recorded.
    pub fn is_fixed_base(&self) -> bool {
        self.fixed_base
    }
    /// The torque and gyro channels in one matrix, N x (n + 3): what spectra and modal fits look at. Allocates.
    ///
    /// # Panics
    /// If the channels are not sampled on one clock; see [`Record::resampled`].
    pub fn responses(&self) -> DMatrix<f64> {
        assert!(self.is_uniform(), "torque and gyro on one uniform clock");
        let n = self.joints();
        let mut out = DMatrix::zeros(self.samples(), n + 3);
        out.columns_mut(0, n).copy_from(&self.tau);
        out.columns_mut(n, 3).copy_from(&self.gyro);
        out
    }
    /// Names of the columns of [`Record::responses`]: `tau.<joint>` (`current.<joint>` of a joint in [`Record::currents`]), then `gyro.x`, `gyro.y`, `gyro.z`. Allocates.
    pub fn response_names(&self) -> Vec<String> {
        let current = |k: usize| self.currents.get(k).copied().unwrap_or(false);
        let of = |(k, j): (usize, &String)| format!("{}.{j}", if current(k) { "current" } else { "tau" });
        let tau = self.joint_names.iter().enumerate().map(of);
        tau.chain(["gyro.x", "gyro.y", "gyro.z"].map(String::from)).collect()
    }
    /// Samples with `from <= time < to`, times in seconds since the first sample of this record. Allocates.
    ///
    /// # Errors
    /// `Data::Window` when fewer than two samples lie inside.
    pub fn window(&self, from: f64, to: f64) -> Result<Self, Problems> {
        // A hair of a sample, so that a bound computed as k * dt means sample k.
        let index = |t: f64| ((t / self.dt - 1e-6).ceil().max(0.0) as usize).min(self.samples());
        let (a, b) = if from.is_finite() && to > from { (index(from), index(to)) } else { (0, 0) };
        if b < a + 2 {
            let p = Problem::error(
                Area::Data,
                "Data::Window",
                format!("window {from} .. {to} s holds fewer than two of the samples at 0 .. {} s", self.seconds()),
            );
            return Err(Problems(vec![p.hint("choose a window inside the record")]));
        }
        if !self.is_uniform() {
            return self.cut(a, b);
        }
        Ok(Self { t0: self.t0 + self.time(a), ..self.mapped(|m| m.rows(a, b - a).into_owned()) })
    }
    /// The samples `rows` of every channel, on the same clock. Allocates.
    ///
    /// # Panics
    /// If `rows` ends behind the last sample, or channels have sample times of their own ([`Record::window`] cuts those).
    #[must_use]
    pub fn rows(&self, rows: Range<usize>) -> Self {
        assert!(self.is_uniform(), "all channels on one uniform clock");
        let part = |m: &DMatrix<f64>| m.rows(rows.start, rows.len()).into_owned();
        Self { t0: self.t0 + self.time(rows.start), ..self.mapped(part) }
    }
    /// The same record, of which readings of torques and base rates within these stretches of time (s since its first sample, both ends included) do not count
    /// in a fit. They stay where they are. Allocates.
    #[must_use]
    pub fn with_uncounted(mut self, stretches: &[(f64, f64)]) -> Self {
        self.uncounted.extend(stretches.iter().map(|(from, to)| (self.t0 + from, self.t0 + to)));
        self
    }
    /// Whether a reading at this time (s since the first sample) counts ([`Record::with_uncounted`]).
    pub fn counts(&self, t: f64) -> bool {
        !self.uncounted.iter().any(|(from, to)| (*from..=*to).contains(&(self.t0 + t)))
    }
    /// The same record with other torques, N x n (N m or N).
    ///
    /// # Panics
    /// If the shape differs or a number is not finite.
    #[must_use]
    pub fn with_tau(mut self, tau: DMatrix<f64>) -> Self {
        self.tau = like(&self.tau, tau);
        self
    }
    /// The same record with torques, N x n (N m or N), in every channel of the joints, those of currents among them.
    ///
    /// # Panics
    /// If the shape differs or a number is not finite.
    #[must_use]
    pub fn with_torques(mut self, tau: DMatrix<f64>) -> Self {
        self.currents.clear();
        self.with_tau(tau)
    }
    /// The same record with other gyro readings, N x 3 (rad/s).
    ///
    /// # Panics
    /// If the shape differs or a number is not finite.
    #[must_use]
    pub fn with_gyro(mut self, gyro: DMatrix<f64>) -> Self {
        self.gyro = like(&self.gyro, gyro);
        self
    }
    /// The same record with other joint positions, N x n (rad or m), without rates and accelerations.
    ///
    /// # Panics
    /// If the shape differs or a number is not finite.
    #[must_use]
    pub fn with_positions(mut self, q: DMatrix<f64>) -> Self {
        (self.qd, self.qdd) = (None, None);
        self.q = like(&self.q, q);
        self
    }
    /// The same record with another joint motion: positions, rates and accelerations, N x n each.
    ///
    /// # Panics
    /// If a shape differs or a number is not finite.
    #[must_use]
    pub fn with_motion(mut self, q: DMatrix<f64>, qd: DMatrix<f64>, qdd: DMatrix<f64>) -> Self {
        (self.qd, self.qdd) = (Some(like(&self.q, qd)), Some(like(&self.q, qdd)));
        self.q = like(&self.q, q);
        self
    }
    /// The same record with every time, first sample and interval alike, multiplied by `factor`: rates are divided by it, accelerations by
    /// its square.
    ///
    /// # Panics
    /// If `factor` is not a finite number above zero, or channels have sample times of their own ([`Record::is_uniform`]).
    #[must_use]
    pub fn with_time_scaled(mut self, factor: f64) -> Self {
        assert!(factor.is_finite() && factor > 0.0, "a finite factor above zero");
        assert!(self.is_uniform(), "all channels on one uniform clock");
        (self.t0, self.dt) = (self.t0 * factor, self.dt * factor);
        self.qd = self.qd.map(|m| m / factor);
        self.qdd = self.qdd.map(|m| m / factor.powi(2));
        self
    }
    /// Every channel through `f`, which takes samples to samples; clock and names as they are.
    /// [`Record::window`] of a record whose groups have times of their own: from sample `a` of the grid to before sample `b`, or what
    /// joint motion there is between them, where it has times of its own.
    fn cut(&self, a: usize, b: usize) -> Result<Self, Problems> {
        self.between(self.time(a), self.time(b - 1), a..b)
    }
    /// What is sampled from `start` to `end` (s); of channels on the grid, its samples `grid`, unless the joint motion has times of its own.
    pub(crate) fn between(&self, mut start: f64, mut end: f64, grid: Range<usize>) -> Result<Self, Problems> {
        // A hair, for times that were computed.
        let hair = 1e-6 * self.dt;
        let inside = |times: &[f64], from: f64, to: f64| {
            times.partition_point(|t| *t < from - hair)..times.partition_point(|t| *t <= to + hair)
        };
        if let Some(times) = self.times(ChannelGroup::Motion) {
            let rows = inside(times, start, end);
            if rows.len() < 2 {
                return Err(self.too_few(ChannelGroup::Motion, rows.len()));
            }
            (start, end) = (times[rows.start], times[rows.end - 1]);
        }
        let intervals = ((end - start) / self.dt).round().max(1.0);
        // The grid ends with the joint motion.
        let stamped = self.times(ChannelGroup::Motion).is_some();
        let dt = if stamped { (end - start) / intervals } else { self.dt };
        let mut bases = TimeBases::default();
        let mut pick =
            |group: ChannelGroup, of: &[Option<&DMatrix<f64>>]| -> Result<Vec<Option<DMatrix<f64>>>, Problems> {
                // Channels on the grid have times of their own where the joint motion does, which may begin between two samples of it.
                let on_grid = || of[0].filter(|_| stamped).map(|m| (0..m.nrows()).map(|i| self.time(i)).collect());
                let times: Option<Vec<f64>> = self.times(group).map(<[f64]>::to_vec).or_else(on_grid);
                let rows: Range<usize> = match &times {
                    Some(times) => inside(times, start, end),
                    None => grid.clone(),
                };
                if rows.len() < 2 && of[0].is_some() {
                    return Err(self.too_few(group, rows.len()));
                }
                if let Some(times) = times {
                    bases.set(group, times[rows.clone()].iter().map(|t| (t - start).clamp(0.0, end - start)).collect());
                }
                Ok(of.iter().map(|m| m.map(|m| m.rows(rows.start, rows.len()).into_owned())).collect())
            };
        let mut motion = pick(ChannelGroup::Motion, &[Some(&self.q), self.qd.as_ref(), self.qdd.as_ref()])?;
        let (qdd, qd) = (motion.pop().flatten(), motion.pop().flatten());
        let mut single = |group, m| pick(group, &[m]).map(|mut all| all.pop().flatten());
        let tau = single(ChannelGroup::Torque, Some(&self.tau))?;
        let gyro = single(ChannelGroup::Gyro, Some(&self.gyro))?;
        let acc = single(ChannelGroup::Accelerometer, self.acc.as_ref())?;
        let att = single(ChannelGroup::Attitude, self.att.as_ref())?;
        let carried = single(ChannelGroup::Carried, self.carried.as_ref().map(|c| &c.values))?;
        let carried = self.carried.as_ref().zip(carried).map(|(c, values)| c.with(values));
        Ok(Self {
            t0: self.t0 + start,
            dt,
            joint_names: self.joint_names.clone(),
            q: motion.pop().flatten().unwrap_or_default(),
            qd,
            qdd,
            tau: tau.unwrap_or_default(),
            gyro: gyro.unwrap_or_default(),
            acc,
            att,
            currents: self.currents.clone(),
            carried,
            fixed_base: self.fixed_base,
            bases,
            grid: stamped.then_some(intervals as usize + 1),
            uncounted: self.uncounted.clone(),
            averaging: self.averaging.clone(),
        })
    }
    fn too_few(&self, group: ChannelGroup, got: usize) -> Problems {
        let what = format!("the window holds {got} samples of the {}, at least 2 are needed", group.name());
        let p = Problem::error(Area::Data, "Data::Window", what);
        Problems(vec![p.on(group.name()).hint("choose a longer window")])
    }
    /// Every channel through `f`, which takes samples to samples; clock and names as they are. Of a record on one clock.
    pub(crate) fn mapped(&self, f: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        let of = |m: &Option<DMatrix<f64>>| m.as_ref().map(&f);
        Self {
            t0: self.t0,
            dt: self.dt,
            joint_names: self.joint_names.clone(),
            q: f(&self.q),
            qd: of(&self.qd),
            qdd: of(&self.qdd),
            tau: f(&self.tau),
            gyro: f(&self.gyro),
            acc: of(&self.acc),
            att: of(&self.att),
            currents: self.currents.clone(),
            carried: self.carried.as_ref().map(|c| c.with(f(&c.values))),
            fixed_base: self.fixed_base,
            bases: self.bases.clone(),
            grid: self.grid,
            uncounted: self.uncounted.clone(),
            averaging: self.averaging.clone(),
        }
    }
    /// Checks that the joints are those of a model, in its order (bad-inputs row D37).
    ///
    /// # Errors
    /// `Data::NameMismatch` with what is missing, extra, or out of order.
    pub fn check_joints(&self, model: &[String]) -> Result<(), Problems> {
        if self.joint_names == model {
            return Ok(());
        }
        let only =
            |a: &[String], b: &[String]| -> Vec<String> { a.iter().filter(|x| !b.contains(x)).cloned().collect() };
        let (missing, extra) = (only(model, &self.joint_names), only(&self.joint_names, model));
        let message = if missing.is_empty() && extra.is_empty() {
            format!("joints are in another order: record {:?}, model {model:?}", self.joint_names)
        } else {
            format!("joints differ from the model: missing {missing:?}, not in the model {extra:?}")
        };
        let p = Problem::error(Area::Data, "Data::NameMismatch", message);
        Err(Problems(vec![p.hint("use the record of this robot, or rename its columns")]))
    }
}

/// `new`, if it may stand for `old`.
fn like(old: &DMatrix<f64>, new: DMatrix<f64>) -> DMatrix<f64> {
    assert_eq!(new.shape(), old.shape(), "a channel keeps its samples");
    assert!(new.iter().all(|x| x.is_finite()), "a record holds finite numbers only");
    new
}
