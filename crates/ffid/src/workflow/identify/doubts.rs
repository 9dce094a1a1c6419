//! What else may be wrong with a record, asked after the fit: it may not begin at rest (row D30), its clocks may disagree (D15,
//! D16), something from outside may have acted on the robot (D29). What can be mended is mended, with a warning, and fitted again.

use super::asked::{Asked, Take};
use super::decay;
use super::decay::Decay;
use super::findings::ClockLine;
use super::held_out::beside;
use super::result::Provenance;
use super::{Fit, Identified, IdentifyError, Method, Settings, Watch, identify};
use crate::open::Opened;
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::{Area, Inertia, Model, Params, Problem, Problems};
use ident::checks::{ClockError, ClockEstimate, Clocks, correct_clocks, estimate_clocks};
use ident::parameters::sizes;
use nalgebra::{DMatrix, DVector, Vector3};

/// What a fit with an initial state must leave of chi-squared to be believed.
const BETTER: f64 = 0.2;
/// Uncertainty of the parameters beside the clocks, relative to their size: the fit has bent them to the wrong clock.
const BENT: f64 = 0.1;
/// Offsets and skews below so many standard deviations are none.
const SURE: f64 = 3.0;
/// Largest offset looked for (s), and its part of a record.
const LATEST: (f64, f64) = (0.25, 0.03);
/// Rounds of clock and fit at most; they end when the rest is below this part of a sample.
const ROUNDS: (usize, f64) = (4, 0.05);
/// Part of the misfit that a change of momentum must explain to be named.
const EXPLAINS: f64 = 0.6;
/// Least drop of chi-squared for that, by three unknowns.
const DROP: f64 = 60.0;
/// Instants at which a jump is looked for.
const INSTANTS: usize = 60;

/// What becomes of clocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Watches {
    /// Compare them where the record tells; correct what is off by more than half a sample.
    #[default]
    Correct,
    /// The same, and refuse a record that does not tell.
    Require,
    /// Take them as they are.
    Trust,
}

/// Which doubts are asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Doubts {
    /// Clocks of the channels.
    pub clocks: Watches,
    /// External torques are declared: a change of momentum is a warning.
    pub external: bool,
    /// Refuse records that do not tell modes (rows D23 to D25); else they are left out.
    pub modes: bool,
}

/// Refuses records whose axes are turned, given the settings of the fit.
pub type AxesCheck<'a> = &'a dyn Fn(&[Take], &Settings) -> Result<(), IdentifyError>;

/// [`identify`] with doubts. `turned` refuses records whose axes are (row D21). Takes that were corrected are changed in place. Warnings beside the result.
///
/// # Errors
/// Those of [`identify`], and the refusals of the rows named above.
#[allow(clippy::too_many_arguments, reason = "one call; each is a thing of its own")]
pub fn careful(
    opened: &Opened,
    takes: &mut [Take],
    settings: &Settings,
    asked: &Asked,
    doubts: Doubts,
    turned: AxesCheck<'_>,
    provenance: &Provenance,
    watch: &Watch<'_>,
) -> Result<(Identified, Settings, Problems), IdentifyError> {
    let fit = |takes: &[Take], s: &Settings| identify(opened, takes, s, asked, provenance.clone(), watch);
    let mut s = settings.clone();
    let mut problems = Problems::default();
    let mut found = fit(takes, &s)?;
    if found.result.method == Method::Ground {
        return Ok((found, s, problems));
    }
    if found.result.chi2_per_dof > s.limit {
        turned(takes, &s)?;
    }
    if found.result.chi2_per_dof > s.limit && !s.initial_state && found.result.method == Method::OutputError {
        let moving = Settings { initial_state: true, ..s.clone() };
        let again = fit(takes, &moving)?;
        if again.result.chi2_per_dof < BETTER * found.result.chi2_per_dof {
            problems.push(not_at_rest(&again, found.result.chi2_per_dof));
            (found, s) = (again, moving);
        }
    }
    let mut clocks = Vec::new();
    if doubts.clocks != Watches::Trust {
        let (again, lines, said) = set_clocks(opened, takes, &s, doubts, found, &fit)?;
        (found, clocks) = (again, lines);
        problems.extend(said);
    }
    if found.result.chi2_per_dof > s.limit {
        for take in takes.iter() {
            let Some(p) = momentum(opened, &found, take, &s, watch)? else { continue };
            let hint = "leave the firing out of the record, or declare it with --external-torque";
            if doubts.external {
                problems.push(Problem::warning(Area::Data, p.0, p.1).on(&take.label).hint(hint));
            } else {
                return Err(IdentifyError::Refused(Problems(vec![
                    Problem::error(Area::Data, p.0, p.1).on(&take.label).hint(hint),
                ])));
            }
        }
    }
    found.result.clocks = clocks;
    for take in takes.iter() {
        match decay::modes(&opened.model, &found.values, take, &s)? {
            Decay::Found(modes, warnings) => {
                found.result.decay.push(*modes);
                problems.extend(warnings);
            }
            Decay::None(why) if doubts.modes => return Err(IdentifyError::IllPosed(why)),
            Decay::None(_) => {}
        }
    }
    Ok((found, s, problems))
}

/// Row D30.
fn not_at_rest(found: &Identified, before: f64) -> Problem {
    let sure = |p: &&super::result::Parameter| p.std.is_some_and(|s| p.value.abs() > SURE * s);
    let initial = |p: &&super::result::Parameter| p.name.contains("initial");
    let all: Vec<String> = found
        .result
        .nuisance
        .iter()
        .filter(initial)
        .filter(sure)
        .map(|p| format!("{} {} {}", p.name, super::text::num(p.value), p.unit))
        .collect();
    let what = format!(
        "the record does not begin at rest ({}); chi-squared per degree of freedom {before:.3} with rest, {:.3} with its \
         initial state estimated, which was done",
        ff_model::diagnostics::list(all.iter().map(String::as_str), 6),
        found.result.chi2_per_dof
    );
    Problem::warning(Area::Data, "Data::NotAtRest", what)
        .hint("give --initial-state, or begin to record before the motion")
}

type Refit<'a> = &'a dyn Fn(&[Take], &Settings) -> Result<Identified, IdentifyError>;

/// Rows D15 and D16.
fn set_clocks(
    opened: &Opened,
    takes: &mut [Take],
    s: &Settings,
    doubts: Doubts,
    mut found: Identified,
    fit: Refit<'_>,
) -> Result<(Identified, Vec<ClockLine>, Problems), IdentifyError> {
    let model = &opened.model;
    let mut problems = Problems::default();
    let originals: Vec<Take> = takes.to_vec();
    let mut totals: Vec<Option<Clocks>> = vec![None; takes.len()];
    // A start in the middle of a motion is not predicted by the comparison.
    if s.initial_state {
        return Ok((found, Vec::new(), problems));
    }
    let all_sizes = sizes(&model.param_decls(), &found.values);
    for round in 0..ROUNDS.0 {
        let params = Params::from_values(model, found.values.clone());
        let uncertain: Vec<(usize, f64)> = found.selected.iter().map(|&i| (i, BENT * all_sizes[i])).collect();
        let mut changed = false;
        for (k, take) in takes.iter_mut().enumerate() {
            let latest = LATEST.0.min(LATEST.1 * take.record.seconds());
            let told = match estimate_clocks(model, &params, &take.record, &s.noise, &uncertain, latest) {
                Ok(c) => c,
                Err(ClockError::NotEstimable { group, why }) if round == 0 => {
                    if doubts.clocks == Watches::Require {
                        let p = Problem::error(Area::Data, "Data::ClockNotEstimable", format!("{group}: {why}"));
                        let hint =
                            "move the joints faster while recording, or take the clocks as they are: --clocks trust";
                        return Err(IdentifyError::IllPosed(Problems(vec![p.on(&take.label).hint(hint)])));
                    }
                    continue;
                }
                // A record too short to compare, or a start too far off to predict: the fit itself says more about that.
                Err(_) => continue,
            };
            let mut told = told;
            let dt = take.record.dt();
            for e in [&mut told.torque, &mut told.gyro] {
                drop_doubtful(e);
            }
            let total = match totals[k].take() {
                None => told.clone(),
                Some(t) => Clocks { torque: added(&t.torque, &told.torque), gyro: added(&t.gyro, &told.gyro) },
            };
            let more = |e: &ClockEstimate| {
                e.offset.abs() > ROUNDS.1 * dt || (e.skew * take.record.seconds()).abs() > ROUNDS.1 * dt
            };
            let go_on = more(&told.torque) || more(&told.gyro);
            let (corrected, mask, said) = correct_clocks(&originals[k].record, &total);
            if !said.0.is_empty() && go_on {
                // Samples at the end for which there is no reading.
                let n = corrected.samples();
                let gone = |i: usize| mask.tau.row(i).iter().chain(mask.gyro.row(i).iter()).any(|w| *w == 0.0);
                let kept = (n / 2..n).find(|&i| gone(i)).unwrap_or(n);
                take.record = corrected.window(0.0, kept as f64 * dt).map_err(IdentifyError::Refused)?;
                changed = true;
            }
            totals[k] = Some(total);
        }
        if !changed {
            break;
        }
        found = fit(takes, s)?;
    }
    let mut lines = Vec::new();
    for (k, total) in totals.iter().enumerate() {
        let Some(t) = total else { continue };
        let (_, _, mut said) = correct_clocks(&originals[k].record, t);
        let dt = originals[k].record.dt();
        for (group, e) in [("torque", &t.torque), ("gyro", &t.gyro)] {
            let drift = e.skew * originals[k].record.seconds();
            lines.push(ClockLine {
                record: takes[k].label.clone(),
                group: group.to_owned(),
                offset_s: e.offset,
                offset_std_s: e.offset_deviation,
                skew_ppm: 1e6 * e.skew,
                skew_std_ppm: 1e6 * e.skew_deviation,
                corrected: e.offset.abs() > 0.5 * dt || drift.abs() > 0.5 * dt,
            });
        }
        said.0
            .iter_mut()
            .for_each(|p| p.object = Some(format!("{} of {}", p.object.as_deref().unwrap_or(""), takes[k].label)));
        problems.extend(said);
    }
    Ok((found, lines, problems))
}

/// What noise may have made is no offset.
fn drop_doubtful(e: &mut ClockEstimate) {
    if e.offset.abs() < SURE * e.offset_deviation {
        e.offset = 0.0;
    }
    if e.skew.abs() < SURE * e.skew_deviation {
        e.skew = 0.0;
    }
}

fn added(a: &ClockEstimate, b: &ClockEstimate) -> ClockEstimate {
    ClockEstimate { offset: a.offset + b.offset, skew: a.skew + b.skew, ..b.clone() }
}

/// Row D29: would a jump or a drift of the angular momentum explain what the fit does not?
///
/// The score test of three more unknowns: with the Jacobian J of everything that was fitted and the residuals r, both projected
/// onto what J does not reach, the columns of a jump of the base rate at some instant (or of its steady drift) lower
/// chi-squared by `|P_S r|^2`. The momentum is that of the change of the rate, everything locked.
fn momentum(
    opened: &Opened,
    found: &Identified,
    take: &Take,
    s: &Settings,
    watch: &Watch<'_>,
) -> Result<Option<(&'static str, String)>, IdentifyError> {
    let model = &opened.model;
    let s = Settings { method: Some(Method::OutputError), ..s.clone() };
    let mut fit = Fit::new(model, &take.record, &s)?;
    let (extra, mut r) = beside(fit.estimator(), &found.values, &s, watch)?;
    let mut j = DMatrix::zeros(r.len(), found.selected.len() + extra.len());
    fit.estimator()
        .jacobian(&found.values, &extra, &found.selected, &mut r, &mut j)
        .map_err(|e| IdentifyError::Model(e.to_string()))?;
    for mut c in j.column_iter_mut() {
        let norm = c.norm();
        if norm > 0.0 && norm.is_finite() {
            c.unscale_mut(norm);
        }
    }
    if j.iter().chain(&r).any(|x| !x.is_finite()) {
        return Ok(None);
    }
    let q = j.qr().q();
    let r = DVector::from_vec(r);
    let left = &r - &q * q.tr_mul(&r);
    let (n, nj) = (take.record.samples(), model.nj());
    let width = nj + 3;
    let excess = left.norm_squared() - (r.len() - q.ncols()) as f64;
    // What three columns explain: the drop of chi-squared, and the change of rate over the record.
    let explained = |shape: &dyn Fn(usize) -> f64| -> Option<(f64, Vector3<f64>)> {
        let mut columns = DMatrix::zeros(n * width, 3);
        for i in 0..n {
            (0..3).for_each(|k| columns[(i * width + nj + k, k)] = shape(i) / s.noise.gyro);
        }
        columns -= &q * q.tr_mul(&columns);
        let g = columns.tr_mul(&left);
        let change = (columns.tr_mul(&columns)).cholesky()?.solve(&g);
        Some((g.dot(&change), Vector3::new(change[0], change[1], change[2])))
    };
    let last = (n - 1).max(1) as f64;
    let mut best: (f64, Vector3<f64>, Option<f64>) = (0.0, Vector3::zeros(), None);
    if let Some((drop, change)) = explained(&|i| i as f64 / last) {
        best = (drop, change, None);
    }
    for m in 1..INSTANTS {
        let from = m * n / INSTANTS;
        if let Some((drop, change)) = explained(&|i| f64::from(u8::from(i >= from)))
            && drop > best.0
        {
            best = (drop, change, Some(take.record.time(from)));
        }
    }
    let (drop, change, at) = best;
    if drop < DROP || drop < EXPLAINS * excess {
        return Ok(None);
    }
    let momentum = locked_inertia(model, &found.values, take) * change;
    let when =
        at.map_or_else(|| "drifts steadily".to_owned(), |t| format!("jumps about {t:.1} s after the first sample"));
    let what = format!(
        "angular momentum {when}, by {:.3e} N m s (base rate {:.2e} rad/s): that would explain {:.0} % of what the model does not; a \
         system on which nothing acts keeps its momentum",
        momentum.norm(),
        change.norm(),
        100.0 * (drop / excess).min(1.0)
    );
    Ok(Some(("Data::MomentumNotConserved", what)))
}

/// Inertia of the whole system about its centre of mass, everything locked at the middle of a record.
fn locked_inertia(model: &Model, values: &[f64], take: &Take) -> nalgebra::Matrix3<f64> {
    let params = Params::from_values(model, values.to_vec());
    let mut state = State::<f64>::zero(model);
    let mid = take.record.samples() / 2;
    (0..model.nj()).for_each(|j| state.q[j] = take.record.q()[(mid, j)]);
    state.eta.copy_from_slice(&model.rest_position(&params));
    let mut h = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, &params, &state, &mut Work::new(model), &mut h);
    Inertia::from_elements(|i, j| h[(i, j)]).about_com()
}
