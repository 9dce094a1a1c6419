//! The door for data: everything a record must satisfy before anything is computed from it.
//!
//! All problems are collected and returned together (`Area::Data`, exit code 12); rows refer to
//! `bad-inputs.md`. Nothing is repaired in silence: resampling has to be asked for, and is reported.

use crate::carried::Carried;
use crate::checks as record_checks;
use crate::record::Record;
use crate::runs::longest;
use crate::stamps;
use crate::time_base::{ChannelGroup, TimeBases};
use crate::time_checks;
use crate::time_checks::Grid;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem, Problems, Severity};
use nalgebra::DMatrix;

/// Largest deviation from the uniform clock, as a fraction of the sampling interval, before samples have to
/// be resampled (row D14).
const JITTER: f64 = 0.1;
/// Most problems of one kind listed one by one.
const LISTED: usize = 5;

#[derive(Clone, Debug)]
enum Clock {
    Uniform {
        t0: f64,
        dt: f64,
    },
    Stamps(Vec<f64>),
    /// Times of the joint motion, which are kept.
    Motion(Vec<f64>),
}

/// Collects columns, then checks them all. Matrices are N x channels.
///
/// ```
/// use nalgebra::DMatrix;
/// use ff_records::RecordBuilder;
/// let wave = |n: usize, k: f64| DMatrix::from_fn(400, n, |i, j| (k * i as f64 + 0.7 * j as f64).sin());
/// let (record, warnings) = RecordBuilder::new(["shoulder", "elbow"])
///     .uniform(0.0, 100.0)
///     .q(wave(2, 0.010))
///     .tau(wave(2, 0.023))
///     .gyro(wave(3, 0.017))
///     .build()?;
/// assert_eq!((record.samples(), record.joints(), warnings.0.len()), (400, 2, 0));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct RecordBuilder {
    joint_names: Vec<String>,
    clock: Option<Clock>,
    q: Option<DMatrix<f64>>,
    qd: Option<DMatrix<f64>>,
    qdd: Option<DMatrix<f64>>,
    tau: Option<DMatrix<f64>>,
    gyro: Option<DMatrix<f64>>,
    acc: Option<DMatrix<f64>>,
    att: Option<DMatrix<f64>>,
    currents: Vec<bool>,
    carried: Option<Carried>,
    times: [Option<Vec<f64>>; 6],
    grid_hz: Option<f64>,
    fixed_base: bool,
    need: usize,
    resample: bool,
    keep_spikes: bool,
    long_gaps: bool,
    allow: Vec<String>,
}

impl RecordBuilder {
    /// A record of the named joints.
    pub fn new<S: Into<String>>(joints: impl IntoIterator<Item = S>) -> Self {
        Self {
            joint_names: joints.into_iter().map(Into::into).collect(),
            clock: None,
            q: None,
            qd: None,
            qdd: None,
            tau: None,
            gyro: None,
            acc: None,
            att: None,
            currents: Vec::new(),
            carried: None,
            times: Default::default(),
            grid_hz: None,
            fixed_base: false,
            need: 2,
            resample: false,
            keep_spikes: false,
            long_gaps: false,
            allow: Vec::new(),
        }
    }
    /// A uniform clock: first time (s) and rate (Hz).
    #[must_use]
    pub fn uniform(mut self, t0: f64, rate_hz: f64) -> Self {
        self.clock = Some(Clock::Uniform { t0, dt: 1.0 / rate_hz });
        self
    }
    /// A time stamp per sample (s). Where they are not even to a tenth of an interval, because samples were lost or came late, every
    /// group gets them as times of its own ([`Self::times`]), which warnings `Data::Gap` and `Data::Jitter` say with numbers; unless the
    /// joint positions follow an even clock better, so that the stamps are noisy themselves, or [`Self::resample`] asks for the former.
    #[must_use]
    pub fn stamps(mut self, t: Vec<f64>) -> Self {
        self.clock = Some(Clock::Stamps(t));
        self
    }
    /// Times of the samples of a group of channels (s), on the same clock as the others: another rate, jitter, lost samples. The
    /// channels of the group have one row per time; nothing is resampled. Times must be finite, strictly increasing and within the
    /// joint motion; gaps are named.
    ///
    /// Where the joint motion has times of its own, there is no other clock: every group needs its times, and the grid that
    /// a model is integrated on runs from the first of the joint motion to the last ([`Self::grid`]).
    #[must_use]
    pub fn times(mut self, group: ChannelGroup, t: Vec<f64>) -> Self {
        self.times[group as usize] = Some(t);
        self
    }
    /// About how dense the grid of a joint motion with times of its own is (Hz): a whole number of intervals spans it. Its median
    /// interval unless given. Predictions are interpolated between instants of the grid (`docs/theory/output-operator.md`): ten
    /// per period of the fastest mode leave 3e-4 of it, twenty 5e-6.
    #[must_use]
    pub fn grid(mut self, rate_hz: f64) -> Self {
        self.grid_hz = Some(rate_hz);
        self
    }
    /// Joint positions, N x n (rad or m). Required.
    #[must_use]
    pub fn q(mut self, m: DMatrix<f64>) -> Self {
        self.q = Some(m);
        self
    }
    /// Joint rates, N x n.
    #[must_use]
    pub fn qd(mut self, m: DMatrix<f64>) -> Self {
        self.qd = Some(m);
        self
    }
    /// Joint accelerations, N x n.
    #[must_use]
    pub fn qdd(mut self, m: DMatrix<f64>) -> Self {
        self.qdd = Some(m);
        self
    }
    /// Joint torques, N x n (N m or N). Required.
    #[must_use]
    pub fn tau(mut self, m: DMatrix<f64>) -> Self {
        self.tau = Some(m);
        self
    }
    /// The base was bolted to the ground: it does not turn, and no gyro is asked for.
    #[must_use]
    pub fn fixed_base(mut self) -> Self {
        self.fixed_base = true;
        self
    }
    /// Base angular velocity in base axes, N x 3 (rad/s). Required, unless the base is fixed.
    #[must_use]
    pub fn gyro(mut self, m: DMatrix<f64>) -> Self {
        self.gyro = Some(m);
        self
    }
    /// Base specific force in base axes, N x 3 (m/s^2).
    #[must_use]
    pub fn acc(mut self, m: DMatrix<f64>) -> Self {
        self.acc = Some(m);
        self
    }
    /// Base attitude quaternions `[w, x, y, z]`, N x 4.
    #[must_use]
    pub fn att(mut self, m: DMatrix<f64>) -> Self {
        self.att = Some(m);
        self
    }
    /// Joints whose column of [`Self::tau`] is the current of their motor (A), one flag per joint; all are torques unless given.
    #[must_use]
    pub fn currents(mut self, of: Vec<bool>) -> Self {
        self.currents = of;
        self
    }
    /// What the record carries beside.
    #[must_use]
    pub fn carried(mut self, c: Carried) -> Self {
        self.carried = Some(c);
        self
    }
    /// Fewest samples accepted; twice the number of parameters to be estimated is the least that makes
    /// sense (row D02). Two unless set.
    #[must_use]
    pub fn need_samples(mut self, n: usize) -> Self {
        self.need = n.max(2);
        self
    }
    /// Allows linear interpolation of jittered or missing samples onto the uniform clock; reported as a warning.
    #[must_use]
    pub fn resample(mut self, yes: bool) -> Self {
        self.resample = yes;
        self
    }
    /// Keeps single samples that jump out and back, which are otherwise left out where they are at most 1 % of a channel (row D19); they
    /// are reported all the same.
    #[must_use]
    pub fn keep_spikes(mut self, yes: bool) -> Self {
        self.keep_spikes = yes;
        self
    }
    /// Lets gaps of the joint motion through that are too long to interpolate, with a warning: for those who cut the record there
    /// ([`Record::split`]).
    #[must_use]
    pub fn long_gaps(mut self, yes: bool) -> Self {
        self.long_gaps = yes;
        self
    }
    /// Turns errors with this code (such as `Data::Stuck`) into warnings; they are still reported.
    #[must_use]
    pub fn allow(mut self, code: impl Into<String>) -> Self {
        self.allow.push(code.into());
        self
    }

    /// Checks everything; returns the record and warnings, or every problem found.
    ///
    /// # Errors
    /// Codes: `Data::NoSamples` (D01), `TooShort` (D02), `NotFinite` (D03), `Missing`, `Shape`, `NonMonotone`
    /// (D11), `TimeScale` (D12), `Gap` (D13), `Jitter` (D14), `Saturated` (D17), `Stuck` (D18), `Quaternion` (D22),
    /// `LooksLikeDegrees` (D09), `Clock` (a clock beside times of the joint motion), `Outside` (times beyond the joint motion). Warnings
    /// besides: `Spikes` (D19).
    pub fn build(self) -> Result<(Record, Problems), Problems> {
        let allow = self.allow.clone();
        let mut bad = Problems::default();
        let record = self.check(&mut bad);
        for p in &mut bad.0 {
            if allow.iter().any(|a| a == p.code) {
                p.severity = Severity::Warning;
            }
        }
        // A record that could not be made stays refused, whatever was allowed.
        if record.is_none() && !bad.has_errors() {
            bad.push(error("Data::Unusable", "an allowed problem leaves no usable record".into()));
        }
        bad.finish(record)
    }

    fn check(self, bad: &mut Problems) -> Option<Record> {
        let n = self.joint_names.len();
        for (i, name) in self.joint_names.iter().enumerate() {
            if self.joint_names[..i].contains(name) {
                bad.push(error("Data::DuplicateName", "two joints have this name".into()).on(name));
            }
        }
        // The rate of a base that is bolted down is known.
        let still = self.gyro.is_none() && self.fixed_base;
        let mut times = self.times;
        let gyro = if still {
            // A rate that is not measured is zero whenever joint positions were read.
            times[ChannelGroup::Gyro as usize] = times[ChannelGroup::Motion as usize].clone();
            self.q.as_ref().map(|q| DMatrix::zeros(q.nrows(), 3))
        } else {
            self.gyro
        };
        let given = match self.clock {
            Some(Clock::Stamps(t)) if !self.resample => {
                let judged = stamps::judge(t, self.q.as_ref(), bad);
                if let stamps::Judged::Own(t) = &judged {
                    let has = [true, true, true, self.acc.is_some(), self.att.is_some(), self.carried.is_some()];
                    for group in
                        ChannelGroup::ALL.into_iter().filter(|g| *g != ChannelGroup::Motion && has[*g as usize])
                    {
                        times[group as usize].get_or_insert_with(|| t.clone());
                    }
                }
                Some(match judged {
                    stamps::Judged::Own(t) => Clock::Motion(t),
                    stamps::Judged::Even { t0, dt } => Clock::Uniform { t0, dt },
                    stamps::Judged::Checked(t) => Clock::Stamps(t),
                })
            }
            other => other,
        };
        if let Some(Clock::Motion(t)) = &given {
            times[ChannelGroup::Motion as usize] = Some(t.clone());
        }
        let clock = match (&times[ChannelGroup::Motion as usize], given) {
            (Some(_), Some(Clock::Motion(t))) => Some(Clock::Motion(t)),
            (Some(_), Some(_)) => {
                let what = "a clock was given, and times of the joint motion beside it".into();
                bad.push(
                    error("Data::Clock", what).on("time").hint("give the times of every group, and no other clock"),
                );
                return None;
            }
            (Some(t), None) => Some(Clock::Motion(t.clone())),
            (None, clock) => clock,
        };
        let (Some(q), Some(tau), Some(gyro), Some(clock)) = (self.q, self.tau, gyro, clock) else {
            bad.push(
                error("Data::Missing", "joint positions, torques, gyro and a clock are required".into())
                    .hint("give all four"),
            );
            return None;
        };
        let rows = q.nrows();
        if rows == 0 {
            bad.push(error("Data::NoSamples", "the record is empty".into()).hint("check that recording had started"));
            return None;
        }
        if rows < self.need {
            let short = Limit::AtLeast(self.need as f64);
            let p = Problem::out_of_range(Area::Data, "Data::TooShort", rows as f64, short, "samples");
            bad.push(p.hint("record longer, or estimate fewer parameters"));
        }
        let mut columns = vec![("q", q, n), ("tau", tau, n), ("gyro", gyro, 3)];
        for (name, m, width) in [("qd", self.qd, n), ("qdd", self.qdd, n), ("acc", self.acc, 3), ("att", self.att, 4)] {
            columns.extend(m.map(|m| (name, m, width)));
        }
        if !(self.currents.is_empty() || self.currents.len() == n) {
            bad.push(error("Data::Shape", format!("{} flags of currents for {n} joints", self.currents.len())));
        }
        let (mut carried_names, mut carried_units) = (Vec::new(), Vec::new());
        if let Some(c) = self.carried {
            columns.push(("carried", c.values, c.names.len()));
            (carried_names, carried_units) = (c.names, c.units);
        }
        let mut whole = true;
        let own = matches!(clock, Clock::Motion(_));
        for (name, m, width) in &columns {
            let rows = times[group_of(name) as usize].as_ref().map_or(rows, Vec::len);
            if own && times[group_of(name) as usize].is_none() {
                let what = "the joint motion has times of its own, and these channels have none".into();
                bad.push(error("Data::Missing", what).on(*name).hint("give their times (RecordBuilder::times)"));
                whole = false;
                continue;
            }
            if m.shape() != (rows, *width) {
                let (a, b) = m.shape();
                bad.push(error("Data::Shape", format!("is {a} x {b}, must be {rows} x {width}")).on(*name));
                whole = false;
            }
            // Without a branch per number: nearly every column ends here.
            if m.as_slice().iter().fold(true, |all, v| all & v.is_finite()) {
                continue;
            }
            let mut wrong = m.as_slice().iter().enumerate().filter(|(_, v)| !v.is_finite());
            let first = wrong.next();
            if let Some((k, v)) = first {
                let count = 1 + wrong.count();
                let msg = format!("column {} row {} is {v} ({count} non-finite in all)", k / a_rows(m), k % a_rows(m));
                bad.push(error("Data::NotFinite", msg).on(*name).hint("repair or cut out these samples"));
                whole = false;
            }
        }
        let sound: Vec<bool> = ChannelGroup::ALL
            .map(|g| {
                let Some(t) = &times[g as usize] else { return true };
                // Times that are those of the joint motion are judged with them.
                let again = g != ChannelGroup::Motion && times[ChannelGroup::Motion as usize].as_ref() == Some(t);
                again || time_checks::alone(g, t, self.need, self.long_gaps, bad)
            })
            .to_vec();
        let (t0, dt, stamps) = match &clock {
            // Its times are not sound, which has been said.
            Clock::Motion(_) if !sound[ChannelGroup::Motion as usize] => return None,
            Clock::Motion(t) => {
                let grid = Grid::over(t, self.grid_hz, bad)?;
                (grid.t0, grid.dt, None)
            }
            _ => check_clock(clock.clone(), rows, self.resample, bad)?,
        };
        let on_clock = stamps.as_ref().map_or(rows, |t: &Vec<f64>| grid_rows(t, dt));
        let grid = match &clock {
            Clock::Motion(t) => Grid::over(t, self.grid_hz, bad)?,
            _ => Grid { t0, dt, samples: on_clock },
        };
        let mut bases = TimeBases::default();
        for group in ChannelGroup::ALL {
            let Some(t) = times[group as usize].as_ref() else { continue };
            let since = if sound[group as usize] { time_checks::inside(group, t, &grid, bad) } else { None };
            match since {
                Some(since) => bases.set(group, since),
                None => whole = false,
            }
        }
        if !whole {
            return None;
        }
        let time = |name: &str, i: usize| {
            // Behind the last sample, as far as it is from the first on average.
            bases.of(group_of(name)).map_or(i as f64 * dt, |t| {
                let last = t.len() - 1;
                t.get(i).copied().unwrap_or(t[last] + (t[last] - t[0]) / last as f64)
            })
        };
        if let Some((_, att, _)) = columns.iter_mut().find(|c| c.0 == "att") {
            unwrap_attitude(att, bad);
        }
        for (name, m, _) in columns.iter().filter(|c| !(still && c.0 == "gyro" || c.0 == "carried")) {
            stuck(name, m, &self.joint_names, &|i| time(name, i), bad);
            if matches!(*name, "tau" | "gyro" | "acc") {
                for (j, c) in m.column_iter().enumerate() {
                    let axis = if *name == "tau" { &self.joint_names[j] } else { ["x", "y", "z"][j] };
                    record_checks::channel(&format!("{name}.{axis}"), c.as_slice(), &|i| time(name, i), bad);
                }
            }
        }
        let mut spiked: [Vec<usize>; 6] = Default::default();
        for (name, m, _) in columns.iter().filter(|c| matches!(c.0, "q" | "tau" | "gyro") && !(still && c.0 == "gyro"))
        {
            for (j, c) in m.column_iter().enumerate() {
                let axis = if *name == "gyro" { ["x", "y", "z"][j] } else { &self.joint_names[j] };
                let keep = self.keep_spikes || stamps.is_some();
                let found =
                    record_checks::spikes(&format!("{name}.{axis}"), c.as_slice(), &|i| time(name, i), keep, bad);
                spiked[group_of(name) as usize].extend(found);
            }
        }
        let mut own_motion = bases.of(ChannelGroup::Motion).is_some();
        for (group, out) in ChannelGroup::ALL.into_iter().zip(&mut spiked).filter(|(_, out)| !out.is_empty()) {
            out.sort_unstable();
            out.dedup();
            let rows = columns.iter().find(|c| group_of(c.0) == group).map_or(0, |c| c.1.nrows());
            let kept: Vec<usize> = (0..rows).filter(|i| out.binary_search(i).is_err()).collect();
            let own: Vec<f64> = match bases.of(group) {
                Some(t) => kept.iter().map(|&i| t[i]).collect(),
                None => kept.iter().map(|&i| i as f64 * dt).collect(),
            };
            bases.set(group, own);
            columns.iter_mut().filter(|c| group_of(c.0) == group).for_each(|c| c.1 = c.1.select_rows(&kept));
            own_motion |= group == ChannelGroup::Motion;
        }
        if let Some(t) = stamps {
            for (name, m, _) in columns.iter_mut().filter(|c| times[group_of(c.0) as usize].is_none()) {
                *m = interpolate(m, &t, dt);
                if *name == "att" {
                    for mut row in m.row_iter_mut() {
                        let norm = row.norm();
                        row.unscale_mut(norm);
                    }
                }
            }
        }
        let mut take = |name: &str| {
            let i = columns.iter().position(|c| c.0 == name)?;
            Some(columns.swap_remove(i).1)
        };
        let (q, qd) = (take("q")?, take("qd"));
        if let Some(qd) = &qd {
            degrees(&q, qd, dt, bases.of(ChannelGroup::Motion).map(|t| &**t), bad);
        }
        Some(Record {
            t0,
            dt,
            joint_names: self.joint_names,
            q,
            qd,
            qdd: take("qdd"),
            tau: take("tau")?,
            gyro: take("gyro")?,
            acc: take("acc"),
            att: take("att"),
            carried: take("carried").map(|values| Carried { names: carried_names, units: carried_units, values }),
            currents: if self.currents.contains(&true) { self.currents } else { Vec::new() },
            fixed_base: self.fixed_base,
            grid: own_motion.then_some(grid.samples),
            bases,
        })
    }
}

fn error(code: &'static str, message: String) -> Problem {
    Problem::error(Area::Data, code, message)
}
fn warning(code: &'static str, message: String) -> Problem {
    Problem::warning(Area::Data, code, message)
}
fn a_rows(m: &DMatrix<f64>) -> usize {
    m.nrows().max(1)
}

/// `(t0, dt, stamps since t0 when samples have to be interpolated)`.
fn check_clock(clock: Clock, rows: usize, resample: bool, bad: &mut Problems) -> Option<(f64, f64, Option<Vec<f64>>)> {
    let (t0, dt, stamps) = match clock {
        Clock::Uniform { t0, dt } => (t0, dt, None),
        Clock::Stamps(t) | Clock::Motion(t) => {
            if t.len() != rows {
                bad.push(error("Data::Shape", format!("{} time stamps for {rows} samples", t.len())).on("time"));
                return None;
            }
            if let Some(row) = t.iter().position(|x| !x.is_finite()) {
                bad.push(error("Data::NotFinite", format!("row {row} is {}", t[row])).on("time"));
                return None;
            }
            let back: Vec<usize> = (1..rows).filter(|&i| t[i] <= t[i - 1]).collect();
            for &i in back.iter().take(LISTED) {
                let m = format!("row {i}: time goes from {} to {} s ({} such rows)", t[i - 1], t[i], back.len());
                bad.push(error("Data::NonMonotone", m).on("time").hint("sort the rows or drop repeated ones"));
            }
            if !back.is_empty() || rows < 2 {
                return None;
            }
            let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
            let mid = steps.len() / 2;
            (t[0], *steps.select_nth_unstable_by(mid, f64::total_cmp).1, Some(t))
        }
    };
    if !(t0.is_finite() && dt.is_finite() && dt > 0.0) {
        bad.push(error("Data::TimeScale", format!("first time {t0} s, interval {dt} s")).on("time"));
        return None;
    }
    if !(1e-5..=0.5).contains(&dt) {
        let m = format!("median interval {dt} s is outside 1e-5 .. 0.5 s");
        bad.push(
            error("Data::TimeScale", m).on("time").hint("time must be in seconds, not milliseconds or nanoseconds"),
        );
    }
    if t0.abs() * f64::EPSILON > 1e-6 {
        let m = format!("times near {t0} s resolve only {:.1e} s", t0.abs() * f64::EPSILON);
        bad.push(warning("Data::TimeScale", m).on("time").hint("store time relative to the start"));
    }
    let Some(t) = stamps else {
        return Some((t0, dt, None));
    };
    let gaps: Vec<usize> = (1..rows).filter(|&i| t[i] - t[i - 1] > 1.5 * dt).collect();
    let lost: f64 = gaps.iter().map(|&i| ((t[i] - t[i - 1]) / dt - 1.0).round().max(1.0)).sum();
    let too_many = lost > 0.01 * rows as f64;
    for &i in gaps.iter().take(LISTED) {
        let m = format!(
            "{} s without samples after {} s ({} gaps, {lost} samples lost)",
            t[i] - t[i - 1],
            t[i - 1],
            gaps.len()
        );
        let p = if too_many || !resample { error("Data::Gap", m) } else { warning("Data::Gap", m) };
        bad.push(p.on("time").hint("cut the record at the gap, or allow resampling of up to 1 % lost samples"));
    }
    let jitter = if gaps.is_empty() {
        let mean = (t[rows - 1] - t[0]) / (rows - 1) as f64;
        t.iter().enumerate().map(|(i, x)| (x - t[0] - i as f64 * mean).abs()).fold(0.0, f64::max) / mean
    } else {
        f64::INFINITY
    };
    if jitter <= JITTER {
        return Some((t0, (t[rows - 1] - t[0]) / (rows - 1) as f64, None));
    }
    if gaps.is_empty() {
        let m = format!("samples are up to {jitter:.2} intervals off the uniform clock (limit {JITTER})");
        let p = if resample { warning("Data::Jitter", m) } else { error("Data::Jitter", m) };
        bad.push(p.on("time").hint("allow resampling, or record with a steadier clock"));
    }
    if resample {
        bad.push(warning("Data::Resampled", format!("interpolated linearly onto {dt} s")).on("time"));
        return Some((t0, dt, Some(t.iter().map(|x| x - t0).collect())));
    }
    None
}

/// Samples of the uniform clock up to the last stamp.
fn grid_rows(t: &[f64], dt: f64) -> usize {
    (t[t.len() - 1] / dt + 1e-9).floor() as usize + 1
}

/// The group that a column belongs to.
fn group_of(name: &str) -> ChannelGroup {
    match name {
        "tau" => ChannelGroup::Torque,
        "gyro" => ChannelGroup::Gyro,
        "acc" => ChannelGroup::Accelerometer,
        "att" => ChannelGroup::Attitude,
        "carried" => ChannelGroup::Carried,
        _ => ChannelGroup::Motion,
    }
}

/// Linear interpolation of every column from stamps `t` (from 0, ascending) onto `0, dt, 2 dt, ...`.
fn interpolate(m: &DMatrix<f64>, t: &[f64], dt: f64) -> DMatrix<f64> {
    let last = t[t.len() - 1];
    let rows = grid_rows(t, dt);
    let mut out = DMatrix::zeros(rows, m.ncols());
    let mut k = 0;
    for i in 0..rows {
        let x = (i as f64 * dt).min(last);
        while k + 2 < t.len() && t[k + 1] < x {
            k += 1;
        }
        let w = (x - t[k]) / (t[k + 1] - t[k]);
        for j in 0..m.ncols() {
            out[(i, j)] = (1.0 - w) * m[(k, j)] + w * m[(k + 1, j)];
        }
    }
    out
}

/// Row D18. A torque or gyro channel that never changes is a dead sensor; one that holds still for a tenth
/// of the record, or a joint that never moves, may be meant.
fn stuck(name: &str, m: &DMatrix<f64>, joints: &[String], time: &dyn Fn(usize) -> f64, bad: &mut Problems) {
    let sensor = matches!(name, "tau" | "gyro");
    if !(sensor || name == "q") || m.nrows() < 8 {
        return;
    }
    for (j, c) in m.column_iter().enumerate() {
        let longest = longest(c.as_slice());
        let (from, best) = (longest.start, longest.len());
        let axis = if name == "gyro" { ["x", "y", "z"][j] } else { &joints[j] };
        let (a, b) = (time(from), time(from + best));
        let message = format!("holds exactly {} from {a:.3} to {b:.3} s of {:.3} s", c[from], time(c.len()));
        let dead = best == c.len();
        if dead && sensor {
            let p = error("Data::Stuck", message).on(format!("{name}.{axis}"));
            bad.push(p.hint("check the sensor; for noise-free simulation allow Data::Stuck"));
        } else if dead || (sensor && best >= 50 && best * 10 >= c.len()) {
            bad.push(warning("Data::Stuck", message).on(format!("{name}.{axis}")));
        }
    }
}

/// Row D22: unit norm to 1e-3, then normalised; q and -q are the same attitude, so signs are made continuous.
fn unwrap_attitude(att: &mut DMatrix<f64>, bad: &mut Problems) {
    let mut last = [0.0; 4];
    for i in 0..att.nrows() {
        let norm = att.row(i).norm();
        if (norm - 1.0).abs() > 1e-3 {
            let m = format!("row {i}: quaternion norm {norm} differs from 1 by more than 1e-3");
            bad.push(error("Data::Quaternion", m).on("att").hint("order is w, x, y, z"));
            return;
        }
        let dot: f64 = (0..4).map(|k| att[(i, k)] * last[k]).sum();
        let scale = if dot < 0.0 { -1.0 / norm } else { 1.0 / norm };
        for k in 0..4 {
            att[(i, k)] *= scale;
            last[k] = att[(i, k)];
        }
    }
}

/// Row D09: recorded rates against differences of the positions.
fn degrees(q: &DMatrix<f64>, qd: &DMatrix<f64>, dt: f64, times: Option<&[f64]>, bad: &mut Problems) {
    let rows = q.nrows();
    let (mut a, mut b) = (0.0, 0.0);
    for (q, qd) in q.column_iter().zip(qd.column_iter()) {
        for i in 1..rows.saturating_sub(1) {
            let between = times.map_or(2.0 * dt, |t| t[i + 1] - t[i - 1]);
            a += ((q[i + 1] - q[i - 1]) / between).powi(2);
            b += qd[i].powi(2);
        }
    }
    let ratio = (a / b).sqrt();
    for (r, what) in [(ratio, "positions"), (1.0 / ratio, "rates")] {
        if (50.0..65.0).contains(&r) {
            let m = format!("{what} are {r:.1} times too large for the other: one is in degrees");
            bad.push(error("Data::LooksLikeDegrees", m).on("q, qd").hint("convert to radians"));
        }
    }
}
