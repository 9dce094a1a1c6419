//! The door for data: everything a record must satisfy before anything is computed from it.
//!
//! All problems are collected and returned together (`Area::Data`, exit code 12); rows refer to
//! `bad-inputs.md`. Nothing is repaired in silence: resampling has to be asked for, and is reported.

use crate::carried::Carried;
use crate::checks as record_checks;
use crate::record::Record;
use crate::stamps;
use crate::time_base::{ChannelGroup, TimeBases};
use crate::time_checks;
use crate::time_checks::Grid;
use crate::uniform::{Clock, check_clock, grid_rows, interpolate};
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem, Problems, Severity};
use nalgebra::DMatrix;

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
            record_checks::unwrap_attitude(att, bad);
        }
        let mut left_out: [Vec<usize>; 6] = Default::default();
        let keep = stamps.is_some() || self.allow.iter().any(|code| code == "Data::Stuck");
        for (name, m, _) in columns.iter().filter(|c| !(still && c.0 == "gyro" || c.0 == "carried")) {
            let found = record_checks::stuck(name, m, &self.joint_names, &|i| time(name, i), keep, bad);
            left_out[group_of(name) as usize].extend(found);
            if matches!(*name, "tau" | "gyro" | "acc") {
                for (j, c) in m.column_iter().enumerate() {
                    let axis = if *name == "tau" { &self.joint_names[j] } else { ["x", "y", "z"][j] };
                    record_checks::channel(&format!("{name}.{axis}"), c.as_slice(), &|i| time(name, i), bad);
                }
            }
        }
        for (name, m, _) in columns.iter().filter(|c| matches!(c.0, "q" | "tau" | "gyro") && !(still && c.0 == "gyro"))
        {
            for (j, c) in m.column_iter().enumerate() {
                let axis = if *name == "gyro" { ["x", "y", "z"][j] } else { &self.joint_names[j] };
                let keep = self.keep_spikes || stamps.is_some();
                let found =
                    record_checks::spikes(&format!("{name}.{axis}"), c.as_slice(), &|i| time(name, i), keep, bad);
                left_out[group_of(name) as usize].extend(found);
            }
        }
        let mut own_motion = bases.of(ChannelGroup::Motion).is_some();
        for (group, out) in ChannelGroup::ALL.into_iter().zip(&mut left_out).filter(|(_, out)| !out.is_empty()) {
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
            record_checks::degrees(&q, qd, dt, bases.of(ChannelGroup::Motion).map(|t| &**t), bad);
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
            uncounted: Vec::new(),
            averaging: None,
            bases,
        })
    }
}

fn error(code: &'static str, message: String) -> Problem {
    Problem::error(Area::Data, code, message)
}
fn a_rows(m: &DMatrix<f64>) -> usize {
    m.nrows().max(1)
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
