//! The CSV form of a trajectory: samples, one row per instant, one `name[unit]` column per quantity.
//!
//! Columns `time[s]` and `q.<joint>[rad]` (`[m]` for sliding joints, `[deg]` is converted) are required; `qd.<joint>`
//! and `qdd.<joint>` are read when they are there for every joint. Their order does not matter.

use super::{MAX_BYTES, NamedJoint, data, named_joints};
use ff_dynamics::motion::{HermiteTable, JointMotion, MotionError};
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::{Area, Model, Problem, Problems};
use std::fmt::Write;
use std::path::Path;

/// Most problems of one kind listed one by one.
const LISTED: usize = 5;
/// Largest deviation from the even grid, relative to the sample time, that rounding of the stamps explains.
const EVEN: f64 = 1e-3;
/// Longest plausible time between samples (s): above it the stamps are in another unit.
const LONGEST_STEP: f64 = 10.0;
/// Ratios of speeds from positions to given speeds that only degrees explain (180/pi = 57.3).
const DEGREES: std::ops::Range<f64> = 50.0..65.0;
/// Greatest disagreement of given speeds with the slope of the positions, relative to the speeds (root mean square).
const DISAGREE: f64 = 0.05;
/// Columns read for each joint.
const KINDS: [&str; 3] = ["q", "qd", "qdd"];

/// A sampled trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Joints, in the order of the values.
    pub joints: Vec<NamedJoint>,
    /// Sample times from 0 (s), ascending.
    pub times: Vec<f64>,
    /// Positions (rad or m), `n` per sample, one sample after another.
    pub q: Vec<f64>,
    /// Rates, shaped like `q`, when the file gives them.
    pub qd: Option<Vec<f64>>,
    /// Accelerations, shaped like `q`, when the file gives them.
    pub qdd: Option<Vec<f64>>,
}

impl Samples {
    /// Samples a motion every `step` (s), its end included. Allocates.
    ///
    /// # Errors
    /// [`MotionError`] for a step that is not positive, or a motion that is not finite.
    pub fn of(motion: &dyn JointMotion, joints: &[NamedJoint], step: f64) -> Result<Self, MotionError> {
        // The checks are those of the table.
        let count = HermiteTable::sample(motion, step)?.samples();
        let n = motion.dof();
        let z = || vec![0.0; n * count];
        let (mut q, mut qd, mut qdd) = (z(), z(), z());
        for k in 0..count {
            let r = k * n..(k + 1) * n;
            motion.eval(k as f64 * step, &mut q[r.clone()], &mut qd[r.clone()], &mut qdd[r]);
        }
        let times = (0..count).map(|k| k as f64 * step).collect();
        Ok(Self { joints: joints.to_vec(), times, q, qd: Some(qd), qdd: Some(qdd) })
    }
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.times.len()
    }
    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }
    /// Time between samples when they are even (s).
    pub fn step(&self) -> Option<f64> {
        let n = self.len();
        let h = self.times.last()? / (n.max(2) - 1) as f64;
        let even = |(k, t): (usize, &f64)| (t - k as f64 * h).abs() <= EVEN * h;
        (n >= 2 && self.times.iter().enumerate().all(even)).then_some(h)
    }
    /// The quintic through even samples with rates and accelerations; `None` when there are none or the samples are not
    /// even. Allocates.
    pub fn table(&self) -> Option<HermiteTable> {
        let (qd, qdd) = (self.qd.as_ref()?, self.qdd.as_ref()?);
        HermiteTable::new(self.joints.len(), self.step()?, &self.q, qd, qdd).ok()
    }
    /// Reads a file of at most [`MAX_BYTES`] for a model; values come in the order of its joints.
    ///
    /// # Errors
    /// Those of [`Samples::from_csv`], with the file; `Io::Read`.
    pub fn load(path: &Path, model: &Model) -> Result<(Self, Problems), Problems> {
        let text = ff_model::diagnostics::text_file(path, MAX_BYTES)?;
        match Self::from_csv(&text, model) {
            Ok((s, warnings)) => Ok((s, warnings.in_file(path))),
            Err(p) => Err(p.in_file(path)),
        }
    }
    /// Reads a CSV text for a model; returns warnings beside the samples. Rows refer to `bad-inputs.md`.
    ///
    /// # Errors
    /// `Data::NoSamples` (D01), `Data::TooShort`, `Data::NotFinite` (D03), `Data::BadNumber`, `Data::RowLength` (D04),
    /// `Data::MaybeTruncated` (D05), `Data::Separator` (D06), `Data::Columns` (D07), `Data::UnitMissing` (D08),
    /// `Data::Unit`, `Data::LooksLikeDegrees` (D09), `Data::NonMonotone` (D11), `Data::TimeScale` (D12),
    /// `Data::NameMismatch` (D37), `Data::Uneven`, `Data::Rates`.
    pub fn from_csv(text: &str, model: &Model) -> Result<(Self, Problems), Problems> {
        let mut bad = Problems::default();
        let found = read(text, &named_joints(model), &mut bad);
        let found = found.filter(|_| !bad.has_errors());
        if let Some(s) = &found {
            judge(s, &mut bad);
        }
        bad.finish(found)
    }
}

/// The samples as CSV text; every number in its shortest exact form. Allocates.
pub fn write_csv(s: &Samples) -> String {
    let n = s.joints.len();
    let columns: Vec<(&str, &str, &Vec<f64>)> =
        [("q", "", Some(&s.q)), ("qd", "/s", s.qd.as_ref()), ("qdd", "/s^2", s.qdd.as_ref())]
            .into_iter()
            .filter_map(|(k, per, v)| Some((k, per, v?)))
            .collect();
    let mut out = String::from("time[s]");
    for (kind, per, _) in &columns {
        for j in &s.joints {
            let cell = format!("{kind}.{}[{}{per}]", j.name, j.unit);
            // Names with a separator or quote in them are quoted.
            let quoted = if cell.contains([',', '"']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell };
            // Writing to a text cannot fail.
            let _ = write!(out, ",{quoted}");
        }
    }
    out.push('\n');
    for (k, t) in s.times.iter().enumerate() {
        let _ = write!(out, "{t}");
        for (_, _, v) in &columns {
            v[k * n..(k + 1) * n].iter().for_each(|x| _ = write!(out, ",{}", shortest(*x)));
        }
        out.push('\n');
    }
    out
}

/// Shortest text that reads back exactly.
fn shortest(x: f64) -> String {
    let (plain, exp) = (format!("{x}"), format!("{x:e}"));
    if exp.len() < plain.len() { exp } else { plain }
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    Time,
    /// Kind, joint of the model, factor to SI.
    Joint(usize, usize, f64),
}

fn read(text: &str, joints: &[NamedJoint], bad: &mut Problems) -> Option<Samples> {
    if text.trim().is_empty() {
        bad.push(data("Data::NoSamples", "the file is empty").hint("write the trajectory again"));
        return None;
    }
    if !text.ends_with('\n') {
        let what = "the last line does not end; it may be cut short";
        bad.push(
            data("Data::MaybeTruncated", what)
                .at_line(text.lines().count())
                .hint("write the file again, or end the line"),
        );
    }
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
    let mut rows = reader.records();
    let Some(Ok(head)) = rows.next() else {
        bad.push(
            data("Data::NoSamples", "there is no line of column names").hint("begin with time[s],q.<joint>[rad],..."),
        );
        return None;
    };
    let head: Vec<String> = head.iter().map(|c| c.trim().to_owned()).collect();
    let columns = columns(&head, joints, bad)?;
    let n = joints.len();
    let mut s = Samples { joints: joints.to_vec(), times: Vec::new(), q: Vec::new(), qd: None, qdd: None };
    let present: Vec<bool> =
        (0..KINDS.len()).map(|k| columns.iter().any(|c| matches!(c, Column::Joint(k2, ..) if *k2 == k))).collect();
    let mut values = [Vec::new(), Vec::new(), Vec::new()];
    let mut numbers_bad = 0;
    for row in rows {
        let row = match row {
            Ok(r) => r,
            Err(e) => {
                bad.push(data("Data::Syntax", clip(&e.to_string())).hint("mend the quotes of this line"));
                return None;
            }
        };
        let line = row.position().map_or(0, |p| p.line() as usize);
        if row.len() != columns.len() {
            let what = format!("{} cells, the line of names has {}", row.len(), columns.len());
            bad.push(
                data("Data::RowLength", what).at_line(line).hint("the file may be cut short, or use decimal commas"),
            );
            return None;
        }
        let k = s.times.len();
        values.iter_mut().zip(&present).filter(|(_, p)| **p).for_each(|(v, _)| v.resize((k + 1) * n, 0.0));
        let mut time = 0.0;
        for ((cell, column), name) in row.iter().zip(&columns).zip(&head) {
            let x: Option<f64> = cell.trim().parse().ok();
            match (x, column) {
                (Some(x), _) if !x.is_finite() => {
                    numbers_bad += 1;
                    if numbers_bad <= LISTED {
                        let what = format!("'{}' in data row {} is not finite", clip(cell), k + 1);
                        bad.push(data("Data::NotFinite", what).at_line(line).on(name).hint("write the file again"));
                    }
                }
                (None, _) => {
                    numbers_bad += 1;
                    if numbers_bad <= LISTED {
                        let what = format!("'{}' in data row {} is not a number", clip(cell), k + 1);
                        bad.push(
                            data("Data::BadNumber", what)
                                .at_line(line)
                                .on(name)
                                .hint("write numbers with a decimal point"),
                        );
                    }
                }
                (Some(x), Column::Time) => time = x,
                (Some(x), Column::Joint(kind, joint, factor)) => values[*kind][k * n + joint] = x * factor,
            }
        }
        s.times.push(time);
    }
    if numbers_bad > LISTED {
        bad.push(
            data("Data::NotFinite", format!("{} cells more like these", numbers_bad - LISTED))
                .hint("write the file again"),
        );
    }
    let [q, qd, qdd] = values;
    s.q = q;
    (s.qd, s.qdd) = (present[1].then_some(qd), present[2].then_some(qdd));
    if s.times.is_empty() {
        bad.push(data("Data::NoSamples", "there are column names, but no samples").hint("write the trajectory again"));
        return None;
    }
    if s.len() < 8 {
        let what = format!("{} samples, at least 8 needed", s.len());
        bad.push(data("Data::TooShort", what).hint("sample the trajectory more finely"));
        return None;
    }
    times(&mut s, bad)?;
    Some(s)
}

/// Which column is what; all that is wrong with the names.
fn columns(head: &[String], joints: &[NamedJoint], bad: &mut Problems) -> Option<Vec<Column>> {
    if head.len() == 1 {
        let guess =
            [(';', "semicolons"), ('\t', "tabs"), ('|', "bars")].into_iter().find(|(c, _)| head[0].contains(*c));
        let what = match guess {
            Some((_, name)) => format!("columns seem to be separated by {name}, must be commas"),
            None => "only one column".to_owned(),
        };
        bad.push(data("Data::Separator", what).at_line(1).hint("separate columns by commas, and write decimal points"));
        return None;
    }
    let mut out: Vec<Option<Column>> = Vec::with_capacity(head.len());
    let mut extra: Vec<(&str, &str)> = Vec::new();
    for cell in head {
        let Some((name, unit)) = cell.strip_suffix(']').and_then(|c| c.rsplit_once('[')) else {
            let what = format!("column '{}' has no unit", clip(cell));
            bad.push(
                data("Data::UnitMissing", what).at_line(1).hint("write time[s], q.<joint>[rad], qd.<joint>[rad/s]"),
            );
            out.push(None);
            continue;
        };
        let known = KINDS.iter().position(|k| name.split_once('.').is_some_and(|(p, _)| p == *k));
        let joint = name.split_once('.').map_or("", |(_, j)| j);
        out.push(match (name, known) {
            ("time", _) if unit == "s" => Some(Column::Time),
            ("time", _) => {
                bad.push(unit_problem(cell, unit, "s"));
                None
            }
            (_, Some(kind)) => match joints.iter().position(|j| j.name == joint) {
                None => {
                    extra.push((cell, joint));
                    None
                }
                Some(j) => {
                    let per = ["", "/s", "/s^2"][kind];
                    let si = format!("{}{per}", joints[j].unit);
                    let degrees = joints[j].unit == "rad" && unit == format!("deg{per}");
                    if unit == si {
                        Some(Column::Joint(kind, j, 1.0))
                    } else if degrees {
                        Some(Column::Joint(kind, j, 1f64.to_radians()))
                    } else {
                        bad.push(unit_problem(cell, unit, &si));
                        None
                    }
                }
            },
            _ => {
                extra.push((cell, joint));
                None
            }
        });
    }
    for (i, c) in out.iter().enumerate().filter_map(|(i, c)| c.map(|c| (i, c))) {
        let same = |d: &Option<Column>| match (d, c) {
            (Some(Column::Time), Column::Time) => true,
            (Some(Column::Joint(k, j, _)), Column::Joint(k2, j2, _)) => (*k, *j) == (k2, j2),
            _ => false,
        };
        if out[..i].iter().any(same) {
            bad.push(
                data("Data::Columns", format!("column '{}' is there twice", clip(&head[i])))
                    .at_line(1)
                    .hint("keep one of the two"),
            );
        }
    }
    let has = |kind: usize, joint: usize| {
        out.iter().flatten().any(|c| matches!(c, Column::Joint(k, j, _) if (*k, *j) == (kind, joint)))
    };
    if !out.contains(&Some(Column::Time)) && !bad.0.iter().any(|p| p.message.contains("time")) {
        bad.push(data("Data::Columns", "there is no column time[s]").at_line(1).hint("give the time of every sample"));
    }
    let unitless = bad.has("Data::UnitMissing") || bad.has("Data::Unit");
    let missing: Vec<&str> =
        joints.iter().enumerate().filter(|(j, _)| !has(0, *j)).map(|(_, j)| j.name.as_str()).collect();
    if !extra.is_empty() || !(missing.is_empty() || unitless) {
        let say = |what: &str, names: &[&str]| {
            if names.is_empty() { String::new() } else { format!("{what}: {}", list(names.iter().copied(), 12)) }
        };
        let unknown: Vec<&str> = extra.iter().map(|(c, _)| *c).collect();
        let parts = [say("joints without a column q", &missing), say("unknown columns", &unknown)];
        let what = parts.into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join("; ");
        let near = extra
            .iter()
            .find_map(|(_, e)| nearest(e, missing.iter().copied()).map(|n| format!("is {} meant to be {n}?", clip(e))));
        let hint =
            near.unwrap_or_else(|| "name the joints of this robot, q.<joint>[rad], and drop other columns".into());
        bad.push(data("Data::NameMismatch", what).at_line(1).hint(hint));
    }
    for (kind, name) in KINDS.iter().enumerate().skip(1) {
        let without: Vec<&str> =
            joints.iter().enumerate().filter(|(j, _)| !has(kind, *j)).map(|(_, j)| j.name.as_str()).collect();
        if !without.is_empty() && without.len() < joints.len() {
            let what = format!("no column {name} for {}", list(without.iter().copied(), 12));
            bad.push(data("Data::Columns", what).at_line(1).hint(format!("give {name} for every joint, or for none")));
        }
    }
    if bad.has_errors() && out.iter().any(Option::is_none) { None } else { out.into_iter().collect() }
}

fn unit_problem(cell: &str, unit: &str, wanted: &str) -> Problem {
    let what = format!(
        "unit [{}], must be [{wanted}]{}",
        clip(unit),
        if wanted.starts_with("rad") { " or degrees" } else { "" }
    );
    data("Data::Unit", what).at_line(1).on(cell).hint("convert the column and its name")
}

/// Puts the first sample at time 0; checks the clock.
fn times(s: &mut Samples, bad: &mut Problems) -> Option<()> {
    let wrong = s.times.windows(2).enumerate().find(|(_, w)| w[1] <= w[0]);
    if let Some((i, w)) = wrong {
        let what = format!("data row {}: time {} s after {} s", i + 2, w[1], w[0]);
        bad.push(data("Data::NonMonotone", what).at_line(i + 3).on("time").hint("times must ascend, each only once"));
        return None;
    }
    let first = s.times[0];
    s.times.iter_mut().for_each(|t| *t -= first);
    let mut steps: Vec<f64> = s.times.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let median = steps[steps.len() / 2];
    if median > LONGEST_STEP {
        let what = format!("samples are {median} s apart, limit {LONGEST_STEP} s");
        bad.push(data("Data::TimeScale", what).on("time").hint("are the stamps in ms or ns? give seconds"));
        return None;
    }
    // Stamps of an epoch lose digits: neighbours must differ by much more than one unit in the last place.
    if first.abs() * f64::EPSILON > 1e-4 * median {
        let what = format!(
            "stamps near {first} s are known to {:.1e} s, samples are {median} s apart",
            first.abs() * f64::EPSILON
        );
        bad.push(data("Data::TimeScale", what).on("time").hint("count time from the start of the trajectory"));
        return None;
    }
    Some(())
}

/// What only all samples together show.
fn judge(s: &Samples, bad: &mut Problems) {
    let n = s.joints.len();
    if s.qdd.is_some() && s.qd.is_none() {
        bad.push(data("Data::Columns", "accelerations without speeds").at_line(1).hint("give qd as well, or drop qdd"));
        return;
    }
    if s.qdd.is_some() && s.step().is_none() {
        let what = "samples with speeds and accelerations are not evenly spaced";
        bad.push(
            data("Data::Uneven", what)
                .on("time")
                .hint("resample evenly, or give positions alone, which are then fitted"),
        );
    }
    let Some(qd) = &s.qd else { return };
    // Slope over two intervals against the speed in the middle: root mean squares over all joints.
    let (mut slope2, mut given2, mut off2) = (0.0, 0.0, 0.0);
    for k in 1..s.len() - 1 {
        let dt = s.times[k + 1] - s.times[k - 1];
        for j in 0..n {
            let slope = (s.q[(k + 1) * n + j] - s.q[(k - 1) * n + j]) / dt;
            let given = qd[k * n + j];
            slope2 += slope * slope;
            given2 += given * given;
            off2 += (slope - given).powi(2);
        }
    }
    if given2 <= 0.0 && slope2 <= 0.0 {
        return;
    }
    let ratio = (slope2 / given2).sqrt();
    if DEGREES.contains(&ratio) || DEGREES.contains(&(1.0 / ratio)) {
        let what =
            format!("the slope of the positions is {ratio:.3} times the speeds; 57.3 or its inverse means degrees");
        bad.push(
            data("Data::LooksLikeDegrees", what).on("qd").hint("name the unit: q.<joint>[deg] or qd.<joint>[deg/s]"),
        );
    } else if off2 > DISAGREE * DISAGREE * given2.max(slope2) {
        let off = 100.0 * (off2 / given2.max(slope2)).sqrt();
        let what =
            format!("speeds differ from the slope of the positions by {off:.1} %, limit {:.0} %", 100.0 * DISAGREE);
        bad.push(
            Problem::error(Area::Data, "Data::Rates", what).on("qd").hint("drop qd and qdd, or sample more finely"),
        );
    }
}
