//! Two clocks to one: joint states at their own stamps, the base sensors between theirs.
//!
//! For a joint state at `t` with the two nearest base samples at `t0 <= t <= t1` the value is `x0 + (x1 - x0) (t - t0) / (t1 -
//! t0)`, for an attitude the same of the quaternions (the nearer of the two signs), normalised. Joint states before the first
//! or behind the last base sample are left out: nothing is extrapolated. White noise of the base sensors keeps `(1 - s)^2 + s^2`
//! of its variance at `s = (t - t0) / (t1 - t0)`, 2/3 on average.

use super::cdr::{Imu, JointState};
use std::collections::VecDeque;

/// Most samples of the intervals from which the median is taken.
const INTERVALS: usize = 4096;
/// Most joint states that wait for a base sample.
const WAITING: usize = 1 << 20;

/// What was done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Report {
    pub(super) rows: usize,
    /// Rows whose stamp is that of a base sample.
    pub(super) exact: usize,
    /// Greatest distance between two base samples that a row lies between (s).
    pub(super) widest: f64,
    /// Median interval of the base samples (s).
    pub(super) interval: f64,
    /// Joint states before the first or behind the last base sample.
    pub(super) outside: usize,
}

/// Rows in the making. A row is joint values, then those of the base sensors.
pub(super) struct Merge {
    names: Vec<String>,
    /// Numbers of a joint state and of a base sample.
    widths: (usize, usize),
    lengths: [usize; 3],
    base: Option<[bool; 3]>,
    waiting: VecDeque<i64>,
    values: VecDeque<f64>,
    imu: VecDeque<(i64, [f64; 10])>,
    last: (Option<i64>, Option<i64>),
    done: VecDeque<i64>,
    rows: VecDeque<f64>,
    ended: bool,
    report: Report,
    intervals: Vec<i64>,
}

impl Merge {
    pub(super) fn new(first: &JointState, imu: Option<&Imu>) -> Self {
        let lengths = [first.position.len(), first.velocity.len(), first.effort.len()];
        let base = imu.map(|i| [i.gyro.is_some(), i.acc.is_some(), i.att.is_some()]);
        let of = |b: [bool; 3]| [3, 3, 4].iter().zip(b).map(|(n, b)| if b { *n } else { 0 }).sum();
        Self {
            names: first.names.clone(),
            widths: (lengths.iter().sum(), base.map_or(0, of)),
            lengths,
            base,
            waiting: VecDeque::new(),
            values: VecDeque::new(),
            imu: VecDeque::new(),
            last: (None, None),
            done: VecDeque::new(),
            rows: VecDeque::new(),
            ended: false,
            report: Report { rows: 0, exact: 0, widest: 0.0, interval: 0.0, outside: 0 },
            intervals: Vec::new(),
        }
    }
    /// A joint state; the error says what is wrong with it.
    pub(super) fn joints(&mut self, stamp: i64, s: &JointState) -> Result<(), String> {
        if [s.position.len(), s.velocity.len(), s.effort.len()] != self.lengths {
            return Err(format!("a JointState with {} positions, others have {}", s.position.len(), self.lengths[0]));
        }
        if self.last.0.is_some_and(|l| stamp <= l) {
            return Err(format!("a stamp of {stamp} ns that does not go forward"));
        }
        if self.waiting.len() >= WAITING {
            return Err("no base samples for a million joint states".to_owned());
        }
        self.last.0 = Some(stamp);
        self.waiting.push_back(stamp);
        if s.names == self.names {
            for v in [&s.position, &s.velocity, &s.effort] {
                self.values.extend(v);
            }
        } else {
            // The same joints in another order.
            let place = |n: &String| s.names.iter().position(|m| m == n);
            let order: Option<Vec<usize>> = self.names.iter().map(place).collect();
            let order = order.ok_or("a JointState of other joints")?;
            for v in [&s.position, &s.velocity, &s.effort].into_iter().filter(|v| !v.is_empty()) {
                self.values.extend(order.iter().map(|&k| v[k]));
            }
        }
        self.advance();
        Ok(())
    }
    /// A base sample.
    pub(super) fn imu(&mut self, stamp: i64, i: &Imu) -> Result<(), String> {
        if self.base != Some([i.gyro.is_some(), i.acc.is_some(), i.att.is_some()]) {
            return Err("an Imu that measures something else than the first".to_owned());
        }
        if let Some(last) = self.last.1 {
            if stamp <= last {
                return Err(format!("a stamp of {stamp} ns that does not go forward"));
            }
            if self.intervals.len() < INTERVALS {
                self.intervals.push(stamp.saturating_sub(last));
            }
        }
        self.last.1 = Some(stamp);
        let mut x = [0.0; 10];
        let parts = [(0, i.gyro.as_ref().map(|g| &g[..])), (3, i.acc.as_ref().map(|a| &a[..]))];
        for (at, part) in parts.into_iter().chain([(6, i.att.as_ref().map(|q| &q[..]))]) {
            if let Some(p) = part {
                x[at..at + p.len()].copy_from_slice(p);
            }
        }
        self.imu.push_back((stamp, x));
        self.advance();
        Ok(())
    }
    /// No more samples will come.
    pub(super) fn end(&mut self) {
        if !self.ended {
            self.ended = true;
            self.report.outside += self.waiting.len();
            self.waiting.clear();
            self.values.clear();
        }
    }
    /// Rows at hand.
    pub(super) fn ready(&self) -> usize {
        self.done.len()
    }
    /// Makes rows of what is complete.
    fn advance(&mut self) {
        while let Some(&t) = self.waiting.front() {
            let base = match self.base {
                None => None,
                Some(_) => {
                    // The samples around the stamp.
                    while self.imu.len() > 1 && self.imu[1].0 <= t {
                        self.imu.pop_front();
                    }
                    let Some(&(t0, x0)) = self.imu.front() else { return };
                    if t0 > t {
                        self.report.outside += 1;
                        self.waiting.pop_front();
                        self.values.drain(..self.widths.0);
                        continue;
                    }
                    if t0 == t {
                        self.report.exact += 1;
                        Some(x0)
                    } else {
                        let Some(&(t1, x1)) = self.imu.get(1) else { return };
                        let apart = (t1 - t0) as f64;
                        self.report.widest = self.report.widest.max(apart * 1e-9);
                        Some(between(&x0, &x1, (t - t0) as f64 / apart))
                    }
                }
            };
            self.waiting.pop_front();
            self.done.push_back(t);
            self.report.rows += 1;
            self.rows.extend(self.values.drain(..self.widths.0));
            if let (Some(x), Some(b)) = (base, self.base) {
                for (k, range) in [0..3, 3..6, 6..10].into_iter().enumerate() {
                    if b[k] {
                        self.rows.extend(&x[range]);
                    }
                }
            }
        }
    }
    /// Moves up to `most` rows out: stamps, and numbers to the columns behind the first.
    pub(super) fn drain(&mut self, most: usize, stamps: &mut Vec<i64>, columns: &mut [Vec<f64>]) {
        let n = most.min(self.done.len());
        stamps.extend(self.done.drain(..n));
        let width = self.widths.0 + self.widths.1;
        let mut numbers = self.rows.drain(..n * width);
        for _ in 0..n {
            for c in columns[1..].iter_mut().take(width) {
                c.extend(numbers.next());
            }
        }
    }
    /// What was done; `None` without base sensors.
    pub(super) fn report(&self) -> Option<Report> {
        self.base?;
        let mut all = self.intervals.clone();
        all.sort_unstable();
        let interval = all.get(all.len() / 2).map_or(0.0, |&ns| ns as f64 * 1e-9);
        Some(Report { interval, ..self.report })
    }
}

fn between(a: &[f64; 10], b: &[f64; 10], s: f64) -> [f64; 10] {
    let mut out = [0.0; 10];
    // q and -q are the same attitude.
    let sign = if (6..10).map(|k| a[k] * b[k]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    for k in 0..10 {
        let to = if k < 6 { b[k] } else { sign * b[k] };
        out[k] = a[k] + s * (to - a[k]);
    }
    // As long as its neighbours are, so that a quaternion that is none stays to be found.
    let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (have, want) = (norm(&out[6..]), norm(&a[6..]) + s * (norm(&b[6..]) - norm(&a[6..])));
    if have > 0.0 {
        out[6..].iter_mut().for_each(|v| *v *= want / have);
    }
    out
}
