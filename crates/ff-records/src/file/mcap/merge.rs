//! Two clocks to one: joint states at their own stamps, the base sensors between theirs.
//!
//! For a joint state at `t` with the two nearest base samples at `t0 <= t <= t1` the value is `x0 + (x1 - x0) (t - t0) / (t1 -
//! t0)`, for an attitude the same of the quaternions (the nearer of the two signs), normalised. Joint states before the first
//! or behind the last base sample are left out: nothing is extrapolated. White noise of the base sensors keeps `(1 - s)^2 + s^2`
//! of its variance at `s = (t - t0) / (t1 - t0)`, 2/3 on average.

use super::cdr::{Imu, JointState};
use crate::file::blocks::BLOCK;
use core::ops::Range;
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

/// Most numbers of a base sample: three rates, three accelerations, four of the attitude.
const BASE: usize = 10;

/// Rows in the making. A row is joint values, then those of the base sensors.
pub(super) struct Merge {
    names: Vec<String>,
    /// Which names of joint states are these, and where the others have them.
    order: (u64, Option<Vec<usize>>),
    /// Numbers of a joint state and of a base sample.
    widths: (usize, usize),
    lengths: [usize; 3],
    base: Option<[bool; 3]>,
    /// Joint states that wait for a base sample, or for room.
    waiting: VecDeque<i64>,
    values: VecDeque<f64>,
    /// Base samples: what is measured, side by side.
    imu: VecDeque<(i64, [f64; BASE])>,
    last: (Option<i64>, Option<i64>),
    /// Complete rows: stamps, and a column per number.
    done: Vec<i64>,
    columns: Vec<Vec<f64>>,
    report: Report,
    intervals: Vec<i64>,
}

/// The base sensors at the stamp of a joint state.
enum Base {
    Known([f64; BASE]),
    /// Before the first sample.
    Outside,
    /// The sample behind it is not there yet.
    Later,
}

impl Merge {
    pub(super) fn new(first: &JointState, imu: Option<&Imu>) -> Self {
        let lengths = [first.position.len(), first.velocity.len(), first.effort.len()];
        let base = imu.map(|i| [i.gyro.is_some(), i.acc.is_some(), i.att.is_some()]);
        let of = |b: [bool; 3]| [3, 3, 4].iter().zip(b).map(|(n, b)| if b { *n } else { 0 }).sum();
        let widths = (lengths.iter().sum(), base.map_or(0, of));
        Self {
            names: first.names.clone(),
            order: (first.version, None),
            widths,
            lengths,
            base,
            waiting: VecDeque::new(),
            values: VecDeque::new(),
            imu: VecDeque::new(),
            last: (None, None),
            done: Vec::new(),
            columns: vec![Vec::new(); widths.0 + widths.1],
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
        if s.version != self.order.0 {
            // The same joints in another order.
            let place = |n: &String| s.names.iter().position(|m| m == n);
            let order: Option<Vec<usize>> = self.names.iter().map(place).collect();
            let order = order.ok_or("a JointState of other joints")?;
            self.order = (s.version, (s.names != self.names).then_some(order));
        }
        let parts = [&s.position, &s.velocity, &s.effort];
        if let Some(order) = self.order.1.take() {
            let there = parts.into_iter().filter(|v| !v.is_empty());
            self.row(stamp, there.flat_map(|v| order.iter().map(|&k| v[k])));
            self.order.1 = Some(order);
        } else {
            self.row(stamp, parts.into_iter().flatten().copied());
        }
        Ok(())
    }
    /// The numbers of a joint state: a row at once where the base is known, as it mostly is.
    fn row(&mut self, stamp: i64, numbers: impl Iterator<Item = f64>) {
        if !self.waiting.is_empty() || self.done.len() >= BLOCK {
            self.waiting.push_back(stamp);
            self.values.extend(numbers);
            return;
        }
        match self.base_at(stamp) {
            Base::Known(x) => {
                self.columns.iter_mut().zip(numbers).for_each(|(c, x)| c.push(x));
                self.complete(stamp, &x);
            }
            Base::Outside => self.report.outside += 1,
            Base::Later => {
                self.waiting.push_back(stamp);
                self.values.extend(numbers);
            }
        }
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
        let (mut x, mut at) = ([0.0; BASE], 0);
        let parts = [i.gyro.as_ref().map(|g| &g[..]), i.acc.as_ref().map(|a| &a[..]), i.att.as_ref().map(|q| &q[..])];
        for part in parts.into_iter().flatten() {
            x[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        self.imu.push_back((stamp, x));
        self.advance();
        Ok(())
    }
    /// No more samples will come, and rows were made of all that is complete.
    pub(super) fn end(&mut self) {
        self.report.outside += self.waiting.len();
        self.waiting.clear();
        self.values.clear();
    }
    /// Rows at hand.
    pub(super) fn ready(&self) -> usize {
        self.done.len()
    }
    /// Makes rows of what waits and is complete, a block of them at most.
    pub(super) fn advance(&mut self) {
        while self.done.len() < BLOCK
            && let Some(&t) = self.waiting.front()
        {
            let base = self.base_at(t);
            if let Base::Later = base {
                return;
            }
            self.waiting.pop_front();
            let joints = self.values.drain(..self.widths.0);
            if let Base::Known(x) = base {
                self.columns.iter_mut().zip(joints).for_each(|(c, x)| c.push(x));
                self.complete(t, &x);
            } else {
                self.report.outside += 1;
            }
        }
    }
    /// The base at the stamp of a joint state, whose stamps go forward.
    fn base_at(&mut self, t: i64) -> Base {
        let Some(measured) = self.base else { return Base::Known([0.0; BASE]) };
        // The samples around the stamp.
        while self.imu.get(1).is_some_and(|next| next.0 <= t) {
            self.imu.pop_front();
        }
        let (t0, x0) = match self.imu.front() {
            None => return Base::Later,
            Some(&(t0, _)) if t0 > t => return Base::Outside,
            Some((t0, x0)) => (*t0, x0),
        };
        if t0 == t {
            self.report.exact += 1;
            return Base::Known(*x0);
        }
        let Some((t1, x1)) = self.imu.get(1) else { return Base::Later };
        let apart = (t1 - t0) as f64;
        self.report.widest = self.report.widest.max(apart * 1e-9);
        // The attitude is last.
        let attitude = if measured[2] { self.widths.1 - 4..self.widths.1 } else { 0..0 };
        Base::Known(between(x0, x1, (t - t0) as f64 / apart, attitude))
    }
    /// Ends a row whose joint values are in their columns.
    fn complete(&mut self, t: i64, base: &[f64; BASE]) {
        self.done.push(t);
        self.report.rows += 1;
        self.columns[self.widths.0..].iter_mut().zip(base).for_each(|(c, x)| c.push(*x));
    }
    /// Hands out the rows at hand for empty buffers: stamps, and columns behind the first.
    pub(super) fn take(&mut self, stamps: &mut Vec<i64>, columns: &mut [Vec<f64>]) {
        std::mem::swap(stamps, &mut self.done);
        columns[1..].iter_mut().zip(&mut self.columns).for_each(|(to, from)| std::mem::swap(to, from));
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

/// Between two samples; those of the attitude are at `attitude`.
fn between(a: &[f64; BASE], b: &[f64; BASE], s: f64, attitude: Range<usize>) -> [f64; BASE] {
    let mut out = core::array::from_fn(|k| a[k] + s * (b[k] - a[k]));
    let (p, q) = (&a[attitude.clone()], &b[attitude.clone()]);
    // q and -q are the same attitude.
    let sign = if p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let turned = &mut out[attitude];
    turned.iter_mut().zip(p.iter().zip(q)).for_each(|(x, (p, q))| *x = p + s * (sign * q - p));
    // As long as its neighbours are, so that a quaternion that is none stays to be found.
    let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (have, want) = (norm(turned), norm(p) + s * (norm(q) - norm(p)));
    if have > 0.0 {
        turned.iter_mut().for_each(|v| *v *= want / have);
    }
    out
}
