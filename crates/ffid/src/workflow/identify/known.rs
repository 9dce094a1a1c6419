//! Identifiability of a result: structural and unexcited directions, intervals from the likelihood, whiteness.

use super::error::{IdentifyError, config};
use super::findings::{ProfileLine, ReducedSet, UnobservedDirections, Whiteness};
use super::fitted::Fitted;
use super::labelled_record::{LabelledRecord, channel_name};
use super::options::FitOptions;
use super::result::channel::ModeLine;
use super::result::parameter::Value;
use super::row_layout::RowLayout;
use super::signals::Signals;
use super::unknowns::Unknowns;
use ff_linalg::LinalgError;
use ff_model::{Model, Params};
use ff_records::Record;
use ident::Estimator;
use ident::Request;
use ident::Transform;
use ident::Uncertainty;
use ident::belief::profile;
use ident::belief::{reduce_parameters, silence, structural};
use ident::checks::whiteness::{ChannelResiduals, LEVEL, check_all};
use ident::estimate::Estimate;
use ident::parameters::matches;
use nalgebra::DMatrix;

/// How far a profile looks, in standard deviations.
const REACH: f64 = 5.0;

fn linalg(e: LinalgError) -> IdentifyError {
    IdentifyError::Model(e.to_string())
}

/// Structural and unexcited null directions of the data; none when there is none, or with ties, whose structure is not that of
/// the equations of motion alone.
pub(super) fn silent(
    model: &Model,
    values: &[f64],
    unknowns: &Unknowns,
    full: &Uncertainty,
) -> Result<Option<UnobservedDirections>, IdentifyError> {
    if full.null.is_empty() || unknowns.has_ties() {
        return Ok(None);
    }
    let params = Params::from_values(model, values.to_vec());
    // Errors that records share come behind the parameters of the model, and the equations of motion do not know them.
    let of_model: Vec<usize> = unknowns.selected.iter().copied().filter(|&i| i < params.values().len()).collect();
    let structure = structural(model, &params, &of_model).map_err(linalg)?;
    Ok(Some(UnobservedDirections::of(&silence(full, &structure).map_err(linalg)?)))
}

/// Columns of the parameters that the data determine, and what is then held.
pub(super) fn reduced(full: &Uncertainty, selected: &[usize]) -> Result<(Vec<usize>, ReducedSet), IdentifyError> {
    let set = reduce_parameters(full, selected.len()).map_err(linalg)?;
    let held: Vec<String> =
        set.held.iter().filter(|&&k| k < selected.len()).map(|&k| full.unknowns[k].name.clone()).collect();
    let kept: Vec<usize> = set.kept.iter().copied().filter(|&k| k < selected.len()).collect();
    if kept.is_empty() {
        let what = "the record tells none of the parameters";
        return Err(IdentifyError::Refused(config("Fit::Unidentifiable", what, "excite the robot, or give priors")));
    }
    Ok((kept, ReducedSet::of(&set, held)))
}

/// Start of the fit that holds what the data do not tell: the held parameters as the mission has them, listed with their values, and
/// the others moved by what the held ones moved from `values`, where the first fit ended (`docs/theory`: raising a held one by `dx` and
/// lowering the kept ones by `C dx` changes no prediction).
pub(super) fn held_at_mission(unknowns: &Unknowns, set: &ReducedSet, values: &[f64]) -> (Vec<f64>, Vec<Value>) {
    let index = |name: &str| unknowns.decls.iter().position(|d| d.name == name);
    let mut start = values.to_vec();
    let mut held = Vec::new();
    for i in set.held.iter().filter_map(|name| index(name)) {
        start[i] = unknowns.nominal[i];
        let d = &unknowns.decls[i];
        held.push(Value { name: d.name.clone(), unit: d.unit.to_owned(), value: start[i] });
    }
    let mut moved = start.clone();
    for c in &set.combinations {
        let Some(k) = index(&c.name) else { continue };
        for (name, by) in &c.terms {
            if let Some(i) = index(name) {
                moved[k] += by * (values[i] - unknowns.nominal[i]);
            }
        }
    }
    // Held values far from the truth may ask for a body or a spring that cannot exist: the fit then starts from the mission.
    let selected = |i: usize| unknowns.selected.contains(&i) && !held.iter().any(|h| h.name == unknowns.decls[i].name);
    let some: Vec<usize> = (0..start.len()).filter(|&i| selected(i)).collect();
    let physical = |v: &[f64]| Transform::affine(&unknowns.decls, &some, v).is_ok_and(|t| t.inconsistent(v).is_none());
    if physical(&moved) { (moved, held) } else { (unknowns.nominal.clone(), held) }
}

/// Names that a message lists.
const LISTED: usize = 8;

/// Refuses profiles of what is not estimated, before anything is fitted.
pub(super) fn profiled(unknowns: &Unknowns, options: &FitOptions) -> Result<(), IdentifyError> {
    let names: Vec<&str> = unknowns.selected.iter().map(|&i| unknowns.decls[i].name.as_str()).collect();
    let Some(pattern) = options.profile.iter().find(|p| !names.iter().any(|n| matches(p, n))) else { return Ok(()) };
    let more = if names.len() > LISTED { ", ..." } else { "" };
    let known = format!("estimated are {}{more}", names[..names.len().min(LISTED)].join(", "));
    let near = ff_model::diagnostics::nearest(pattern, names.iter().copied());
    let hint = near.map_or_else(|| known.clone(), |n| format!("did you mean {n}? {known}"));
    let what = format!("--profile {pattern}: no such parameter is estimated");
    Err(IdentifyError::Refused(config("Config::UnknownParameter", what, &hint)))
}

/// Profiles of the parameters that the options name, where they are estimated.
pub(super) fn profiles(
    request: &Request<'_>,
    unknowns: &Unknowns,
    (selected, at): (&[usize], &Estimate),
    options: &FitOptions,
    estimator: &mut impl Estimator,
) -> Result<Vec<ProfileLine>, IdentifyError> {
    let mut columns: Vec<usize> = Vec::new();
    // What a reduction has held has none.
    for pattern in &options.profile {
        columns.extend((0..selected.len()).filter(|&k| matches(pattern, &at.parameters[k].name)));
    }
    columns.sort_unstable();
    columns.dedup();
    let own = Request { selected, priors: unknowns.priors(selected)?, ..request.clone() };
    let one = |column: usize| {
        let p = &at.parameters[column];
        let gaussian = p.std.map(|s| (p.value - 1.96 * s, p.value + 1.96 * s));
        Ok(ProfileLine::of(&profile(&own, at, column, REACH, estimator)?, gaussian))
    };
    columns.into_iter().map(one).collect()
}

/// Adds the intervals of parameters along which the valley of the fit is no parabola, where they were not asked for.
pub(super) fn bent(f: &Fitted, profiles: &mut Vec<ProfileLine>) {
    for p in &f.bent {
        if let Some(known) = profiles.iter_mut().find(|line| line.name == p.name) {
            known.bent = true;
            continue;
        }
        let alone = f.alone.as_ref().unwrap_or(&f.estimate.uncertainty);
        let column = f.estimate.parameters.iter().position(|line| line.name == p.name);
        let std = column.and_then(|k| alone.deviation[k]);
        let gaussian = std.map(|s| (p.value - 1.96 * s, p.value + 1.96 * s));
        profiles.push(ProfileLine { bent: true, ..ProfileLine::of(p, gaussian) });
    }
}

/// Residuals of every channel against white noise. Channels too short to be judged are left out, and those that were interpolated.
/// `drawn` are draws of the encoders' noise in the residuals of every record, rows sample by sample, where it counts.
pub(super) fn whiteness(
    records: &[LabelledRecord],
    signals: &[Signals],
    modes: &[ModeLine],
    drawn: &[DMatrix<f64>],
) -> Vec<Whiteness> {
    let hz: Vec<f64> = modes.iter().map(|m| m.frequency_hz).collect();
    let mut channels = Vec::new();
    for (k, (labelled, s)) in records.iter().zip(signals).enumerate() {
        for (j, name) in s.names.iter().enumerate() {
            let (torques, gyro) = labelled.resampled;
            let smoothed = if name.starts_with("tau.") || name.starts_with("current.") { torques } else { gyro };
            if smoothed {
                continue;
            }
            // Samples that were lost leave those that are there one behind the other: white noise stays white.
            let (read, rate) = s.readings(j);
            channels.push(ChannelResiduals {
                channel: channel_name(records, k, name).into_owned(),
                residuals: read.iter().map(|r| r / s.sigma[j]).collect(),
                rate_hz: rate,
                besides: drawn.get(k).map_or_else(Vec::new, |d| of_channel(d, j, &labelled.record)),
            });
        }
    }
    let level = LEVEL / channels.len().max(1) as f64;
    check_all(&channels, &hz).iter().map(|(c, white)| Whiteness::of(c, *white, c.excess_p < level)).collect()
}

/// Draws of one channel out of those of all, in the order of the rows.
pub(super) fn of_channel(drawn: &DMatrix<f64>, channel: usize, record: &Record) -> Vec<Vec<f64>> {
    let layout = RowLayout::of(record, record.joints() + 3);
    // The rigid method has no draws of its own rows.
    if drawn.nrows() != layout.rows() {
        return Vec::new();
    }
    let of = |k: usize| (0..layout.samples(channel)).map(|i| drawn[(layout.row(channel, i), k)]).collect();
    (0..drawn.ncols()).map(of).collect()
}
