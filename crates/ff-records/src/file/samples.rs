//! The samples of a file as they grow, with the checks of every row: the same for text and for blocks.

use super::columns::{GROUPS, Group, Target, carried_channels};
use super::held;
use super::order;
use super::{FollowerColumn, JointColumn, ReadOptions, data, dates, number, over};
use crate::builder::RecordBuilder;
use crate::carried::Carried;
use crate::time_base::ChannelGroup;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Most problems of one kind listed one by one.
const LISTED: usize = 5;
/// Largest error of a time stamp from its own digits (s).
const RESOLUTION: f64 = 1e-6;
/// What can be done about cells without a number.
pub(super) const NOT_FINITE: &str = "repair or cut out these samples, or leave such rows out with --gaps drop";

/// Time stamps: whole numbers are counted from the first one before they become floating-point numbers.
pub(super) struct Clock {
    whole: Option<i64>,
    scale: (f64, f64),
    origin: f64,
    stamps: Vec<f64>,
    /// How stamps are written, if not as numbers.
    pub(super) dates: Option<dates::Style>,
    /// The first date of those that are day first or month first, until a row settles it.
    open: Option<dates::Numbers>,
}

impl Clock {
    /// A clock in the unit of the column of the time.
    fn new(targets: &[Target]) -> Self {
        let unit = targets.iter().find_map(|t| if let Target::Time(u) = t { Some((u.mul, u.div)) } else { None });
        Self {
            whole: None,
            scale: unit.unwrap_or((1.0, 1.0)),
            origin: 0.0,
            stamps: Vec::new(),
            dates: None,
            open: None,
        }
    }
    fn to_si(&self, x: f64) -> f64 {
        x * self.scale.0 / self.scale.1
    }
    /// Seconds of a whole stamp, counted from the first; `None` beyond what whole numbers hold.
    pub(super) fn of_whole(&mut self, w: i64) -> Option<f64> {
        if self.whole.is_none() {
            (self.whole, self.origin) = (Some(w), self.to_si(w as f64));
        }
        Some(self.to_si(w.checked_sub(self.whole?)? as f64))
    }
    /// Seconds of a stamp.
    pub(super) fn of_real(&self, x: f64) -> f64 {
        self.to_si(x) - self.origin
    }
    /// Seconds of a cell, relative to the origin.
    pub(super) fn read(&mut self, cell: &[u8]) -> Option<f64> {
        if let Some(zone) = self.dates {
            if self.stamps.is_empty() {
                self.whole = None;
            }
            if zone == dates::Style::Either {
                self.settle(dates::numbers(cell)?)?;
            }
            return self.of_whole(dates::of_style(cell, self.dates?)?);
        }
        let whole = || number::whole(cell);
        // Small whole numbers are exact either way, and the others may have a fraction.
        let w = if self.stamps.is_empty() {
            self.whole = None;
            whole().filter(|w| w.unsigned_abs() > 1 << 50)
        } else {
            self.whole.and_then(|_| whole())
        };
        match w {
            Some(w) => self.of_whole(w),
            None => Some(self.of_real(number::parse(cell)?)),
        }
    }
    /// Tells by another date which of its numbers is the day, if it does; `None` for one that fits no reading. Until then all have the
    /// same date, whose reading moves all stamps alike.
    fn settle(&mut self, date: dates::Numbers) -> Option<()> {
        if self.stamps.is_empty() {
            self.open = Some(date);
            self.dates = Some(date.style());
            return Some(());
        }
        let first = self.open?;
        if first.same_date(&date) {
            return Some(());
        }
        let style = first.settled_by(&date)?;
        let origin = first.nanoseconds(style)?;
        (self.dates, self.whole, self.origin) = (Some(style), Some(origin), self.to_si(origin as f64));
        Some(())
    }
    /// What is said of dates that a row settled, or none.
    fn unsettled(&self, bad: &mut Problems) {
        let Some(first) = self.open.filter(|f| !f.is_one()) else { return };
        let order = match self.dates {
            Some(dates::Style::Either) => return bad.push(either(&first)),
            Some(dates::Style::MonthFirst) => "month first",
            _ => "day first",
        };
        let what = format!("the time is in dates, {order}, as a row behind the first one says");
        bad.push(Problem::warning(Area::Data, "Data::Dates", what).on("time").hint("nothing to do, if that is so"));
    }
    /// Row D12: stamps of an epoch as floating-point numbers lose digits.
    fn resolution(&self, bad: &mut Problems) {
        let (None, Some(t0), Some(last)) = (self.whole, self.stamps.first(), self.stamps.last()) else { return };
        let first = t0 + self.origin;
        let lost = first.abs() * f64::EPSILON;
        if lost > RESOLUTION {
            let dt = (last - t0) / (self.stamps.len().max(2) - 1) as f64;
            let what = format!("stamps near {first} s are known to {lost:.1e} s, samples are {dt:.3e} s apart");
            let hint = if dt > 0.5 {
                "is the time in ms or us? name it time[ms], or time[us]"
            } else {
                "count time from the start of the record, or write whole numbers of ns"
            };
            bad.push(data("Data::TimeScale", what).on("time").hint(hint));
        }
    }
}

/// What is said of dates that are day first or month first, and nothing in the file says which.
pub(super) fn either(first: &dates::Numbers) -> Problem {
    let what = format!("dates are {}, and no row says which", first.readings());
    data("Data::Dates", what).on("time").hint("give --dates day-first or --dates month-first")
}

/// What is counted along the way.
#[derive(Default)]
struct Count {
    bad_cells: usize,
    /// Rows whose time is not behind that of the row before: how many, and how many of them repeat that row.
    backward: usize,
    identical: usize,
    /// The first of them: its place, and its number among the samples.
    listed: Vec<(usize, usize)>,
    repeated: usize,
    dropped: usize,
    first_dropped: Option<usize>,
}

/// The columns so far.
pub(super) struct Samples<'a> {
    targets: &'a [Target],
    /// Names of the columns.
    head: &'a [String],
    options: &'a ReadOptions,
    /// Says in which row a problem is: lines of a text, rows of a table.
    place: fn(Problem, usize) -> Problem,
    pub(super) clock: Clock,
    columns: Vec<Vec<f64>>,
    count: Count,
}

impl<'a> Samples<'a> {
    pub(super) fn new(
        (head, targets): (&'a [String], &'a [Target]),
        options: &'a ReadOptions,
        place: fn(Problem, usize) -> Problem,
    ) -> Self {
        let (clock, columns) = (Clock::new(targets), vec![Vec::new(); targets.len()]);
        Self { targets, head, options, place, clock, columns, count: Count::default() }
    }
    /// Row D34: what is wrong with so many rows more.
    pub(super) fn too_many(&self, more: usize) -> Option<Problem> {
        let limit = self.options.max_rows;
        let rows = self.clock.stamps.len() + more;
        (rows > limit).then(|| too_many(rows, limit))
    }
    /// A row with cells that are not finite, which is left out.
    pub(super) fn drop_row(&mut self, number: usize) {
        self.count.dropped += 1;
        self.count.first_dropped.get_or_insert(number);
    }
    /// Whether the cells without a number in a row are all those of groups that were not sampled then: another group was. Rates and
    /// accelerations may be without numbers beside positions; whether they are in every row is known at the end.
    pub(super) fn unsampled(&self, row: &[f64]) -> bool {
        let cells = || row.iter().zip(self.targets).filter(|(_, t)| t.unit().is_some());
        // How many cells of a group are without a number, and how many there are.
        let count = |is: &dyn Fn(&Target) -> bool| {
            let of = || cells().filter(|(_, t)| is(t));
            (of().filter(|(x, _)| x.is_nan()).count(), of().count())
        };
        let whole = |(empty, all): (usize, usize)| empty == 0 || empty == all;
        let others = ChannelGroup::ALL.into_iter().filter(|g| *g != ChannelGroup::Motion);
        let positions = count(&|t| t.is_position());
        let rates = [Group::Dq, Group::Ddq].map(|g| count(&|t| matches!(t, Target::Channel(h, ..) if *h == g)));
        others.into_iter().all(|g| whole(count(&|t| t.sampled_with() == Some(g))))
            && whole(positions)
            && rates.into_iter().all(|n| whole(n) && (positions.0 == 0 || n.0 == n.1))
            && cells().all(|(x, _)| !x.is_infinite())
            && cells().any(|(x, _)| x.is_finite())
    }
    /// A cell that cannot be used.
    pub(super) fn bad_cell(&mut self, p: Problem, bad: &mut Problems) {
        self.count.bad_cells += 1;
        if self.count.bad_cells <= LISTED {
            bad.push(p);
        }
    }
    /// Whether rows with these time stamps go on from the last one.
    pub(super) fn forward(&self, times: &[f64]) -> bool {
        let first = self.clock.stamps.last().is_none_or(|&l| times.first().is_none_or(|&t| t > l));
        first && times.iter().all(|t| t.is_finite()) && times.windows(2).all(|w| w[1] > w[0])
    }
    /// Takes rows that need no check, a column at a time: in SI already, or by their units.
    pub(super) fn append(&mut self, times: &[f64], columns: &[Vec<f64>]) {
        for (to, (from, t)) in self.columns.iter_mut().zip(columns.iter().zip(self.targets)) {
            if let Some(u) = t.unit() {
                if u.mul == 1.0 && u.div == 1.0 {
                    to.extend_from_slice(from);
                } else {
                    to.extend(from.iter().map(|&x| u.to_si(x)));
                }
            }
        }
        self.clock.stamps.extend_from_slice(times);
    }
    /// Takes a row of finite numbers in SI, unless it repeats the one before and may be left out. `number` is its place.
    pub(super) fn push(&mut self, number: usize, time: f64, row: &[f64]) {
        if let Some(&last) = self.clock.stamps.last() {
            let same = || {
                let mut all = self.columns.iter().zip(row).zip(self.targets);
                all.all(|((c, x), t)| t.unit().is_none() || c.last() == Some(x))
            };
            if time <= last {
                let identical = time == last && same();
                if identical && self.options.drop_repeated {
                    self.count.repeated += 1;
                    return;
                }
                self.count.backward += 1;
                self.count.identical += usize::from(identical);
                if self.count.listed.len() < LISTED {
                    self.count.listed.push((number, self.clock.stamps.len()));
                }
            }
        }
        self.clock.stamps.push(time);
        for ((c, &x), t) in self.columns.iter_mut().zip(row).zip(self.targets) {
            if t.unit().is_some() {
                c.push(x);
            }
        }
    }
    /// The samples as a builder, and the origin of its clock; `None` when there are none. `end` is the last line of a text.
    pub(super) fn finish(
        self,
        joints: &[JointColumn],
        end: Option<usize>,
        bad: &mut Problems,
    ) -> Option<(RecordBuilder, f64)> {
        self.report(bad);
        if self.clock.stamps.is_empty() {
            if !bad.has_errors() {
                let what = "there are column names, but no samples";
                let p = data("Data::NoSamples", what).hint("check that recording had started");
                bad.push(Problem { line: end, ..p });
            }
            return None;
        }
        self.clock.unsettled(bad);
        self.clock.resolution(bad);
        let Clock { stamps, origin, .. } = self.clock;
        let mut columns = self.columns;
        let held = if self.count.listed.is_empty() {
            held::take_out(&mut columns, self.targets, &stamps, bad)
        } else {
            Vec::new()
        };
        let (stamps, times) = sampled(&mut columns, self.targets, stamps, (self.options.fixed_base, &held), bad)?;
        unwrap_turns(&mut columns, self.targets, joints, bad);
        compare_followers(&columns, self.targets, (joints, &self.options.followers), bad);
        let builder = builder(columns, (self.head, self.targets), joints, stamps);
        let builder = times.into_iter().fold(builder, |b, (group, t)| b.times(group, t));
        Some((builder, origin))
    }
    fn report(&self, bad: &mut Problems) {
        let c = &self.count;
        for (row, p) in order::explain(&self.clock.stamps, self.clock.origin, &c.listed, c.identical) {
            bad.push((self.place)(p, row));
        }
        let all = [(c.bad_cells, "Data::NotFinite", "cells"), (c.backward, "Data::NonMonotone", "rows")];
        for (n, code, what) in all.into_iter().filter(|(n, ..)| *n > LISTED) {
            let what = format!("{} {what} more like these", n - LISTED);
            bad.push(data(code, what).hint("the first ones say what to do"));
        }
        let warn = |what: String| Problem::warning(Area::Data, "Data::Dropped", what);
        if let Some(row) = c.first_dropped {
            let what = format!("{} rows with cells that are not finite left out, the first here", c.dropped);
            bad.push((self.place)(warn(what), row).hint("see why the recorder had no numbers"));
        }
        if c.repeated > 0 {
            let what = format!("{} rows that repeat the one before left out", c.repeated);
            bad.push(warn(what).hint("see why the recorder wrote them twice"));
        }
    }
}

/// Row D34, of rows: before memory is taken.
pub(super) fn too_many(rows: usize, limit: usize) -> Problem {
    over(rows as f64, limit as f64, "rows").hint("cut the record, or raise --max-rows")
}

/// Sample times of the groups that were not sampled in every row, whose columns keep the rows they were; and the times of the joint motion.
/// What lies outside the joint motion is left out, and said.
#[allow(clippy::type_complexity, reason = "times of the motion, and of each group that has others")]
fn sampled(
    columns: &mut [Vec<f64>],
    targets: &[Target],
    stamps: Vec<f64>,
    (fixed_base, held): (bool, &[ChannelGroup]),
    bad: &mut Problems,
) -> Option<(Vec<f64>, Vec<(ChannelGroup, Vec<f64>)>)> {
    let of = |group: ChannelGroup| {
        let is = move |t: &Target| t.sampled_with() == Some(group);
        targets.iter().enumerate().filter(move |(_, t)| is(t)).map(|(c, _)| c)
    };
    let whole = |c: usize, columns: &[Vec<f64>]| columns[c].iter().fold(true, |all, x| all & !x.is_nan());
    if (0..columns.len()).all(|c| whole(c, columns)) {
        return Some((stamps, Vec::new()));
    }
    let mut rows: Vec<(ChannelGroup, Vec<usize>)> = Vec::new();
    for group in ChannelGroup::ALL {
        let Some(any) = of(group).next() else { continue };
        let first = of(group).find(|&c| targets[c].is_position()).unwrap_or(any);
        rows.push((group, (0..stamps.len()).filter(|&i| !columns[first][i].is_nan()).collect()));
    }
    let motion = rows.iter().find(|r| r.0 == ChannelGroup::Motion).map(|r| r.1.clone()).unwrap_or_default();
    let (Some(&from), Some(&to)) = (motion.first(), motion.last()) else {
        bad.push(data("Data::NoSamples", "no row has joint positions").hint("check that recording had started"));
        return None;
    };
    leave_out_absent_rates(columns, targets, &motion, bad)?;
    let mut out = Vec::new();
    for (group, mut of_group) in rows {
        let all = of_group.len();
        of_group.retain(|i| (from..=to).contains(i));
        if all < stamps.len() && !held.contains(&group) {
            bad.push(apart(group, (all, stamps.len()), all - of_group.len(), fixed_base));
        }
        for c in of(group).filter(|&c| !columns[c].is_empty()).collect::<Vec<_>>() {
            columns[c] = of_group.iter().map(|&i| columns[c][i]).collect();
        }
        if group != ChannelGroup::Motion && of_group != motion && all > 0 {
            out.push((group, of_group.iter().map(|&i| stamps[i]).collect()));
        }
    }
    Some((motion.iter().map(|&i| stamps[i]).collect(), out))
}

/// What is said of a group that has numbers in `of.0` of `of.1` rows, some of them `outside` the joint motion.
fn apart(group: ChannelGroup, of: (usize, usize), outside: usize, fixed_base: bool) -> Problem {
    let (all, rows) = of;
    let needed = group == ChannelGroup::Torque || group == ChannelGroup::Gyro && !fixed_base;
    let p = match (all, needed) {
        (0, true) => {
            data("Data::NoSamples", format!("no number in any of {rows} rows")).hint("check that it was recorded")
        }
        (0, false) => {
            Problem::warning(Area::Data, "Data::NotUsed", format!("no number in any of {rows} rows: left out"))
                .hint("nothing to do, unless it was measured")
        }
        _ => {
            let what = format!(
                "{all} samples in {rows} rows, no number in the other {}: it counts at its own times; {outside} of them before or behind the \
                 joint motion were left out",
                rows - all
            );
            Problem::warning(Area::Data, "Data::SampledApart", what).hint("nothing to do")
        }
    };
    p.on(group.name())
}

/// Takes out rates and accelerations that have no number in any row of the joint motion, and refuses those that have some; `None` then.
fn leave_out_absent_rates(
    columns: &mut [Vec<f64>],
    targets: &[Target],
    motion: &[usize],
    bad: &mut Problems,
) -> Option<()> {
    let mut good = true;
    for group in [Group::Dq, Group::Ddq] {
        let of = |t: &Target| matches!(t, Target::Channel(g, ..) if *g == group);
        let Some(first) = targets.iter().position(of) else { continue };
        let empty = motion.iter().filter(|&&i| columns[first][i].is_nan()).count();
        if empty == 0 {
            continue;
        }
        let name = format!("{}.*", group.prefix());
        if empty == motion.len() {
            let what = format!("no number in any of {empty} rows: left out");
            bad.push(
                Problem::warning(Area::Data, "Data::NotUsed", what)
                    .on(name)
                    .hint("nothing to do, unless it was measured"),
            );
            targets.iter().zip(columns.iter_mut()).filter(|(t, _)| of(t)).for_each(|(_, c)| c.clear());
        } else {
            let what = format!("no number in {empty} of {} rows with positions", motion.len());
            bad.push(
                data("Data::NotFinite", what).on(name).hint("leave these columns out with --ignore, each by its name"),
            );
            good = false;
        }
    }
    good.then_some(())
}

/// Positions of joints that turn, whose encoders begin anew after a turn: jumps of a whole turn between neighbouring samples are taken out, since
/// no joint turns by more than half a turn in one sample that is worth reading.
fn unwrap_turns(columns: &mut [Vec<f64>], targets: &[Target], joints: &[JointColumn], bad: &mut Problems) {
    const FAR: f64 = 1.0;
    for (column, target) in columns.iter_mut().zip(targets) {
        let Target::Channel(Group::Q, k, _) = target else { continue };
        let Some(joint) = joints.get(*k).filter(|j| !j.slides) else { continue };
        let (mut turns, mut jumps, mut last) = (0.0, 0_usize, None);
        for x in column.iter_mut() {
            if let Some(before) = last {
                let jump: f64 = *x - before;
                if (jump.abs() - TAU).abs() < FAR {
                    turns -= jump.signum();
                    jumps += 1;
                }
            }
            last = Some(*x);
            *x += turns * TAU;
        }
        if jumps > 0 {
            let what = format!("{jumps} jumps of a whole turn between neighbouring samples: turns were counted");
            let p = Problem::warning(Area::Data, "Data::Wrapped", what).on(format!("q.{}", joint.name));
            bad.push(p.hint("nothing to do, if the encoder begins anew after a turn"));
        }
    }
}

/// Positions of joints that follow others, against what their ratio makes of the joints that they follow.
fn compare_followers(
    columns: &[Vec<f64>],
    targets: &[Target],
    (joints, followers): (&[JointColumn], &[FollowerColumn]),
    bad: &mut Problems,
) {
    // Play and elasticity of a gear, by share of the travel, and what rounding of small travels leaves (rad or m).
    const SHARE: f64 = 0.05;
    const LEAST: f64 = 1e-3;
    for (column, target) in columns.iter().zip(targets) {
        let Target::Follower(k, _) = target else { continue };
        let f = &followers[*k];
        let of = |t: &Target| matches!(t, Target::Channel(Group::Q, k, _) if *k == f.joint);
        let Some(driver) = targets.iter().position(of).map(|c| &columns[c]) else { continue };
        let expected = || driver.iter().map(|q| f.multiplier * q + f.offset);
        let worst = expected().zip(column).map(|(e, x)| (x - e).abs()).fold(0.0, f64::max);
        let (low, high) = expected().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (x.min(l), x.max(h)));
        let limit = SHARE * (high - low) + LEAST;
        if worst <= limit {
            continue;
        }
        let (unit, followed) = (if f.slides { "m" } else { "rad" }, &joints[f.joint].name);
        let what = format!(
            "up to {worst} {unit} from {} {followed} + {}, which it follows, limit {limit:.3e} {unit}",
            f.multiplier, f.offset
        );
        let p = Problem::warning(Area::Data, "Data::NotFollowing", what).violating(worst, Limit::AtMost(limit), unit);
        bad.push(
            p.on(format!("q.{}", f.name))
                .hint("check multiplier and offset of its <mimic>, and the zero of its encoder"),
        );
    }
}

fn builder(
    mut columns: Vec<Vec<f64>>,
    (head, targets): (&[String], &[Target]),
    joints: &[JointColumn],
    stamps: Vec<f64>,
) -> RecordBuilder {
    let mut b = RecordBuilder::new(joints.iter().map(|j| j.name.clone())).stamps(stamps);
    let of = |g: Group, k: usize| {
        targets.iter().position(|t| matches!(t, Target::Channel(g2, k2, _) if (*g2, *k2) == (g, k)))
    };
    // The current of a motor stands in place of a torque that was not measured, and is carried beside one that was.
    let (mut names, mut units) = carried_channels(head, targets);
    let mut beside: Vec<usize> = (0..targets.len()).filter(|&c| matches!(targets[c], Target::Carried(..))).collect();
    let instead: Vec<bool> = (0..joints.len()).map(|k| of(Group::Tau, k).is_none()).collect();
    for (k, joint) in joints.iter().enumerate() {
        if let Some(c) = of(Group::Current, k).filter(|_| !instead[k]) {
            names.push(format!("current.{}", joint.name));
            units.push("A");
            beside.push(c);
        }
    }
    if !beside.is_empty() {
        // Without rows where none of them was measured.
        let rows = columns[beside[0]].len();
        // Currents beside torques are sampled with these, wrenches and wheels perhaps not.
        beside.retain(|&c| columns[c].len() == rows);
        let all: Vec<f64> = beside.iter().flat_map(|&c| std::mem::take(&mut columns[c])).collect();
        if beside.len() == names.len() && rows > 0 {
            b = b.carried(Carried { values: DMatrix::from_vec(rows, names.len(), all), names, units });
        }
    }
    if instead.contains(&true) {
        b = b.currents(instead.clone());
    }
    for g in GROUPS.into_iter().filter(|g| *g != Group::Current) {
        let width = g.channels(joints).len();
        let of_group =
            |t: &Target| matches!(t, Target::Channel(g2, ..) if *g2 == g || g == Group::Tau && *g2 == Group::Current);
        let rows = targets.iter().position(of_group).map_or(0, |c| columns[c].len());
        let mut all = Vec::new();
        for k in 0..width {
            let g = if g == Group::Tau && instead[k] { Group::Current } else { g };
            let Some(c) = of(g, k) else { continue };
            if width == 1 {
                all = std::mem::take(&mut columns[c]);
            } else {
                all.reserve_exact(if all.is_empty() { rows * width } else { 0 });
                // Freed one by one, so that a record is never held twice.
                all.append(&mut std::mem::take(&mut columns[c]));
            }
        }
        if all.is_empty() || all.len() != rows * width || width == 0 {
            continue;
        }
        let m = DMatrix::from_vec(rows, width, all);
        b = match g {
            Group::Q => b.q(m),
            Group::Dq => b.qd(m),
            Group::Ddq => b.qdd(m),
            Group::Tau => b.tau(m),
            Group::Gyro => b.gyro(m),
            Group::Acc => b.acc(m),
            Group::Att => b.att(m),
            Group::Current => b,
        };
    }
    b
}
