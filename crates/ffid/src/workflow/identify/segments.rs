//! Records as they were logged: cut at gaps over which the joint motion cannot be told, and brought to an even clock for what needs one.

use super::error::IdentifyError;
use super::labelled_record::LabelledRecord;
use ff_model::{Area, Problem, Problems};
use ff_records::{ChannelGroup, Record};
use ident::motion::spectral_motion;

/// Fewest samples of the joint motion of a part that is kept: its noise and its spectrum are estimated from them.
const LEAST: usize = 64;

/// Part of the spacing of the knots at a cut within which torques are left out.
const EDGE: f64 = 0.5;

/// The parts of a record.
#[derive(Clone, Debug)]
pub struct Segments {
    /// In their order; one where nothing was cut.
    pub parts: Vec<Record>,
    /// What was cut, and where.
    pub warnings: Problems,
}

/// Cuts a record where the joint motion was not sampled for longer than the spacing of the knots that the rest of the motion needs: up to
/// there every piece of the spline is held by samples, so that the motion can be told across the gap. Torques within half a spacing of a
/// cut are left out. Parts with fewer than 64 samples
/// of the joint motion are left out, and said. Allocates.
///
/// # Errors
/// [`IdentifyError::Refused`] with `Data::Gap` when no part is long enough, `Data::Setup` when the motion of none can be told.
pub fn segments(label: &str, record: &Record) -> Result<Segments, IdentifyError> {
    let mut warnings = Problems::default();
    if !record.has_wide_gaps() {
        return Ok(Segments { parts: vec![record.clone()], warnings });
    }
    let (widest, intervals) = record.widest_gap();
    let samples = |r: &Record| r.q().nrows();
    // The part that can do without judging gaps says what the motion is like.
    let dense = record.split(4.0 * widest / intervals);
    let Some(longest) = dense.iter().max_by_key(|r| samples(r)).filter(|r| samples(r) >= LEAST) else {
        let most = dense.iter().map(samples).max().unwrap_or(0);
        let what = format!("{most} samples in a row without a gap of more than 4 intervals, at least {LEAST} needed");
        let p = Problem::error(Area::Data, "Data::Gap", what).on(label);
        return Err(IdentifyError::Refused(Problems(vec![p.hint("record again without losing samples")])));
    };
    let spacing = spectral_motion(longest).map_err(super::record_estimator::setup)?.fit.spacing;
    if widest <= spacing {
        return Ok(Segments { parts: vec![record.clone()], warnings });
    }
    let all = record.split(spacing);
    let total = all.len();
    let begin = record.t0();
    let end = begin + record.seconds() - 1.5 * record.dt();
    let (parts, short): (Vec<Record>, Vec<Record>) = all.into_iter().partition(|r| samples(r) >= LEAST);
    // At a cut the acceleration of the spline is that of the last few samples; torques follow it, base rates hardly do.
    let parts: Vec<Record> = parts
        .into_iter()
        .map(|r| {
            // A low pass leaves the ends out by itself.
            if r.is_fixed_base() {
                return r;
            }
            let last = r.time(r.samples() - 1);
            let from = if r.t0() > begin + 0.5 * r.dt() { EDGE * spacing } else { 0.0 };
            let to = if r.t0() + last < end { last - EDGE * spacing } else { last };
            r.with_torques_between(from, to)
        })
        .collect();
    let lost: usize = short.iter().map(samples).sum();
    let kept: Vec<String> = parts
        .iter()
        .map(|r| format!("{:.3} .. {:.3} s", r.t0() - record.t0(), r.t0() - record.t0() + r.seconds()))
        .collect();
    let what = format!(
        "the joint motion was not sampled for up to {widest:.3} s, and can be told across {spacing:.3} s (spacing of the knots of its spline): \
         {total} parts, each with an initial state of its own: {}; torques within {:.3} s of a cut and {} parts with {lost} samples together (fewer than {LEAST} each) were left out",
        ff_model::diagnostics::list(kept.iter().map(String::as_str), 6),
        EDGE * spacing,
        short.len()
    );
    let p = Problem::warning(Area::Data, "Data::Segments", what).on(label);
    warnings.push(p.hint("nothing to do; record without gaps, and fewer unknowns are estimated"));
    Ok(Segments { parts, warnings })
}

impl Segments {
    /// The longest part, for what can judge by one alone; none where there is none.
    #[must_use]
    pub fn longest(self) -> Option<Record> {
        self.parts.into_iter().max_by(|a, b| a.seconds().total_cmp(&b.seconds()))
    }
    /// The first part, which may begin at rest, unless the longest is twice as long; none where there is none.
    #[must_use]
    pub fn main(self) -> Option<Record> {
        let first = self.parts.first()?.seconds();
        let longer = self.parts.iter().any(|p| p.seconds() > 2.0 * first);
        if longer { self.longest() } else { self.parts.into_iter().next() }
    }
    /// As records of one fit: the first begins as the whole did, the others in the middle of a motion.
    #[must_use]
    pub fn labelled(self, label: &str) -> Vec<LabelledRecord> {
        let one = |(k, record): (usize, Record)| {
            let label = if k == 0 { label.to_owned() } else { format!("{label}-part{}", k + 1) };
            LabelledRecord { label, record, resampled: (false, false), continues: k > 0, ago: 0 }
        };
        self.parts.into_iter().enumerate().map(one).collect()
    }
}

/// A record on an even clock, for methods that filter: samples are interpolated by polynomials through six of them, on a straight line
/// across gaps of more than four intervals. A warning says how many samples are behind how many instants. Allocates.
///
/// # Errors
/// [`IdentifyError::Refused`] naming channels with fewer than six samples, or that end before the joint motion does.
pub fn on_even_clock(label: &str, record: &Record) -> Result<(Record, Problems), IdentifyError> {
    let mut warnings = Problems::default();
    if record.is_uniform() {
        return Ok((record.clone(), warnings));
    }
    let even = record.bridged().map_err(|e| {
        let p = Problem::error(Area::Data, "Data::TimeBase", e.to_string()).on(label);
        IdentifyError::Refused(Problems(vec![p.hint("cut the record to what all channels cover")]))
    })?;
    let of = |g| record.times(g).map_or(record.samples(), <[f64]>::len);
    let what = format!(
        "{} samples of the joint motion and {} of the torques were interpolated at {} instants, {:.4} Hz; the longest gap is {:.3e} s",
        of(ChannelGroup::Motion),
        of(ChannelGroup::Torque),
        even.samples(),
        even.rate_hz(),
        record.widest_gap().0
    );
    let p = Problem::warning(Area::Data, "Data::Resampled", what).on(label);
    warnings.push(p.hint("nothing to do: the low pass takes away what is faster"));
    Ok((even, warnings))
}
