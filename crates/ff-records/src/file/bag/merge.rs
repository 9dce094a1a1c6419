//! Several clocks to one: joint states at their own stamps, base sensors and wrenches between theirs.
//!
//! For a joint state at `t` with the two nearest samples of another topic at `t0 <= t <= t1` the value is `x0 + (x1 - x0) (t - t0) / (t1 -
//! t0)`, for an attitude the same of the quaternions (the nearer of the two signs), normalised. Joint states before the first
//! or behind the last sample of a topic are left out: nothing is extrapolated. White noise of the other topics keeps `(1 - s)^2 + s^2`
//! of its variance at `s = (t - t0) / (t1 - t0)`, 2/3 on average.

use super::container::DAMAGED;
use super::message::{Imu, JointState, Wrench};
use crate::file::blocks::BLOCK;
use core::ops::Range;
use std::collections::VecDeque;

/// Most samples of the intervals from which the median is taken.
const INTERVALS: usize = 4096;
/// Most joint states that wait for a sample of another topic.
const WAITING: usize = 1 << 20;

/// What was done with a topic beside the joint states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Report {
    /// Rows whose stamp is that of a sample.
    pub(super) exact: usize,
    /// Greatest distance between two samples that a row lies between (s).
    pub(super) widest: f64,
    /// Median interval of the samples (s).
    pub(super) interval: f64,
}

/// Why a message is not taken, and what to do.
pub(super) struct Refused {
    pub(super) what: String,
    pub(super) hint: &'static str,
}

fn refused(what: impl Into<String>) -> Refused {
    Refused { what: what.into(), hint: DAMAGED }
}

fn backward(stamp: i64) -> Refused {
    Refused {
        what: format!("a stamp of {stamp} ns that does not go forward"),
        hint: "--stamps receive takes the times of recording",
    }
}

/// What became of joint states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Counts {
    /// Rows made.
    pub(super) rows: usize,
    /// Before the first or behind the last sample of another topic.
    pub(super) outside: usize,
    /// Of other joints on the same topic.
    pub(super) others: usize,
    /// With the stamp of the one before.
    pub(super) repeated: usize,
}

/// Most numbers of a sample: three rates, three accelerations, four of an attitude.
const MOST: usize = 10;

/// A topic beside the joint states.
pub(super) struct Side {
    width: usize,
    /// Where the attitude stands among the numbers.
    attitude: Range<usize>,
    /// What an Imu measures: rates, specific force, attitude.
    measured: [bool; 3],
    samples: VecDeque<(i64, [f64; MOST])>,
    last: Option<i64>,
    exact: usize,
    widest: f64,
    intervals: Vec<i64>,
}

impl Side {
    fn new(width: usize, attitude: Range<usize>, measured: [bool; 3]) -> Self {
        Self {
            width,
            attitude,
            measured,
            samples: VecDeque::new(),
            last: None,
            exact: 0,
            widest: 0.0,
            intervals: Vec::new(),
        }
    }
    /// Of an Imu that measures what this one does.
    pub(super) fn imu(i: &Imu) -> Self {
        let measured = measured(i);
        let width = [3, 3, 4].iter().zip(measured).map(|(n, b)| if b { *n } else { 0 }).sum::<usize>();
        Self::new(width, if measured[2] { width - 4..width } else { 0..0 }, measured)
    }
    /// Of a wrench.
    pub(super) fn wrench() -> Self {
        Self::new(6, 0..0, [false; 3])
    }
    fn push(&mut self, stamp: i64, x: [f64; MOST]) -> Result<(), Refused> {
        if let Some(last) = self.last {
            if stamp <= last {
                return Err(backward(stamp));
            }
            if self.intervals.len() < INTERVALS {
                self.intervals.push(stamp.saturating_sub(last));
            }
        }
        self.last = Some(stamp);
        self.samples.push_back((stamp, x));
        Ok(())
    }
    /// The values at the stamp of a joint state, whose stamps go forward, and how far apart the samples are around it (ns; 0 at one).
    fn at(&mut self, t: i64) -> At {
        while self.samples.get(1).is_some_and(|next| next.0 <= t) {
            self.samples.pop_front();
        }
        let (t0, x0) = match self.samples.front() {
            None => return At::Later,
            Some(&(t0, _)) if t0 > t => return At::Outside,
            Some((t0, x0)) => (*t0, x0),
        };
        if t0 == t {
            return At::Known(*x0, 0.0);
        }
        let Some((t1, x1)) = self.samples.get(1) else { return At::Later };
        let apart = (t1 - t0) as f64;
        At::Known(between(x0, x1, (t - t0) as f64 / apart, self.attitude.clone()), apart)
    }
    fn count(&mut self, apart: f64) {
        self.exact += usize::from(apart == 0.0);
        self.widest = self.widest.max(apart * 1e-9);
    }
    fn report(&self) -> Report {
        let mut all = self.intervals.clone();
        all.sort_unstable();
        let interval = all.get(all.len() / 2).map_or(0.0, |&ns| ns as f64 * 1e-9);
        Report { exact: self.exact, widest: self.widest, interval }
    }
}

/// Whether an Imu measures rates, specific force, attitude.
fn measured(i: &Imu) -> [bool; 3] {
    [i.gyro.is_some(), i.acc.is_some(), i.att.is_some()]
}

/// A topic at the stamp of a joint state.
enum At {
    Known([f64; MOST], f64),
    /// Before the first sample.
    Outside,
    /// The sample behind it is not there yet.
    Later,
}

/// Rows in the making. A row is joint values, then those of the other topics.
pub(super) struct Merge {
    names: Vec<String>,
    /// Which names of joint states are these, and where the others have them.
    order: (u64, Option<Vec<usize>>),
    lengths: [usize; 3],
    sides: Vec<Side>,
    /// Joint states that wait for a sample of another topic, or for room.
    waiting: VecDeque<i64>,
    values: VecDeque<f64>,
    last: Option<i64>,
    /// Complete rows: stamps, and a column per number.
    done: Vec<i64>,
    columns: Vec<Vec<f64>>,
    counts: Counts,
}

impl Merge {
    /// Of the joints `names`, all of which `first` has.
    pub(super) fn new(names: Vec<String>, first: &JointState, sides: Vec<Side>) -> Self {
        let of = |v: &Vec<f64>| if v.is_empty() { 0 } else { names.len() };
        let lengths = [of(&first.position), of(&first.velocity), of(&first.effort)];
        let width = lengths.iter().sum::<usize>() + sides.iter().map(|s| s.width).sum::<usize>();
        Self {
            names,
            order: (u64::MAX, None),
            lengths,
            sides,
            waiting: VecDeque::new(),
            values: VecDeque::new(),
            last: None,
            done: Vec::new(),
            columns: vec![Vec::new(); width],
            counts: Counts::default(),
        }
    }
    fn joint_width(&self) -> usize {
        self.lengths.iter().sum()
    }
    /// A joint state; the error says what is wrong with it.
    pub(super) fn joints(&mut self, stamp: i64, s: &JointState) -> Result<(), Refused> {
        if s.version != self.order.0 {
            // The same joints in another order, or beside others.
            let place = |n: &String| s.names.iter().position(|m| m == n);
            let there = self.names.iter().filter(|n| place(n).is_some()).count();
            if there == 0 && !self.names.is_empty() {
                // Another publisher of the same topic, such as that of a gripper.
                self.counts.others += 1;
                return Ok(());
            }
            let order: Option<Vec<usize>> = self.names.iter().map(place).collect();
            let order = order.ok_or_else(|| refused("a JointState with some of the joints alone"))?;
            self.order = (s.version, (s.names != self.names).then_some(order));
        }
        let of = |v: &Vec<f64>| if v.is_empty() { 0 } else { self.names.len() };
        if [of(&s.position), of(&s.velocity), of(&s.effort)] != self.lengths {
            return Err(refused(format!(
                "a JointState with {} positions, {} rates and {} efforts, unlike the first",
                s.position.len(),
                s.velocity.len(),
                s.effort.len()
            )));
        }
        if self.last == Some(stamp) {
            self.counts.repeated += 1;
            return Ok(());
        }
        if self.last.is_some_and(|l| stamp < l) {
            return Err(backward(stamp));
        }
        if self.waiting.len() >= WAITING {
            return Err(refused("no samples of another topic for a million joint states"));
        }
        self.last = Some(stamp);
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
    /// The numbers of a joint state: a row at once where the other topics are known, as they mostly are.
    fn row(&mut self, stamp: i64, numbers: impl Iterator<Item = f64>) {
        if self.waiting.is_empty() && self.done.len() < BLOCK {
            match self.sides_at(stamp) {
                Some(true) => {
                    self.columns.iter_mut().zip(numbers).for_each(|(c, x)| c.push(x));
                    self.complete(stamp);
                    return;
                }
                Some(false) => {
                    self.counts.outside += 1;
                    return;
                }
                None => {}
            }
        }
        self.waiting.push_back(stamp);
        self.values.extend(numbers);
    }
    /// Whether every topic is known at a stamp: true, or never will be: false.
    fn sides_at(&mut self, stamp: i64) -> Option<bool> {
        let mut known = Some(true);
        for side in &mut self.sides {
            match side.at(stamp) {
                At::Known(..) => {}
                At::Outside => return Some(false),
                At::Later => known = None,
            }
        }
        known
    }
    /// A sample of the base.
    pub(super) fn imu(&mut self, side: usize, stamp: i64, i: &Imu) -> Result<(), Refused> {
        if self.sides[side].measured != measured(i) {
            return Err(refused("an Imu that measures something else than the first"));
        }
        let (mut x, mut at) = ([0.0; MOST], 0);
        let parts = [i.gyro.as_ref().map(|g| &g[..]), i.acc.as_ref().map(|a| &a[..]), i.att.as_ref().map(|q| &q[..])];
        for part in parts.into_iter().flatten() {
            x[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        self.sides[side].push(stamp, x)?;
        self.advance();
        Ok(())
    }
    /// A wrench.
    pub(super) fn wrench(&mut self, side: usize, stamp: i64, w: &Wrench) -> Result<(), Refused> {
        let mut x = [0.0; MOST];
        x[..6].copy_from_slice(&w.numbers);
        self.sides[side].push(stamp, x)?;
        self.advance();
        Ok(())
    }
    /// No more samples will come, and rows were made of all that is complete.
    pub(super) fn end(&mut self) {
        self.counts.outside += self.waiting.len();
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
            let Some(known) = self.sides_at(t) else { return };
            self.waiting.pop_front();
            let joints = self.values.drain(..self.lengths.iter().sum::<usize>());
            if known {
                self.columns.iter_mut().zip(joints).for_each(|(c, x)| c.push(x));
                self.complete(t);
            } else {
                drop(joints);
                self.counts.outside += 1;
            }
        }
    }
    /// Ends a row whose joint values are in their columns, and at whose stamp every topic is known.
    fn complete(&mut self, t: i64) {
        self.done.push(t);
        self.counts.rows += 1;
        let mut first = self.joint_width();
        for side in &mut self.sides {
            if let At::Known(x, apart) = side.at(t) {
                side.count(apart);
                self.columns[first..first + side.width].iter_mut().zip(&x).for_each(|(c, x)| c.push(*x));
            }
            first += side.width;
        }
    }
    /// Hands out the rows at hand for empty buffers: stamps, and columns behind the first.
    pub(super) fn take(&mut self, stamps: &mut Vec<i64>, columns: &mut [Vec<f64>]) {
        std::mem::swap(stamps, &mut self.done);
        columns[1..].iter_mut().zip(&mut self.columns).for_each(|(to, from)| std::mem::swap(to, from));
    }
    /// What became of the joint states.
    pub(super) fn counts(&self) -> Counts {
        self.counts
    }
    /// What was done with a topic.
    pub(super) fn report(&self, side: usize) -> Report {
        self.sides[side].report()
    }
}

/// Between two samples; those of the attitude are at `attitude`.
fn between(a: &[f64; MOST], b: &[f64; MOST], s: f64, attitude: Range<usize>) -> [f64; MOST] {
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
