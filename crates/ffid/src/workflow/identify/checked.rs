//! Identification with record checks after the fit: axes (row D21), start at rest (D30), clocks (D15, D16), momentum (D29), modes of
//! the free decay (D23 to D25). What can be corrected is corrected with a warning and fitted again. The checks themselves are
//! [`ident::checks`]; here are their order and their messages.

use super::clocks::set_clocks;
use super::decay::{DecayOutcome, decay_modes};
use super::drives::behind_gears;
use super::error::IdentifyError;
use super::evidence::{Evidence, NamedError};
use super::held_out::nuisance;
use super::identified::Identified;
use super::in_motion::{IN_MOTION, may_turn};
use super::labelled_record::LabelledRecord;
use super::number::num;
use super::observed_estimator::{Observer, RecordCheck};
use super::options::FitOptions;
use super::record_estimator::{RecordEstimator, setup};
use super::refit::UNEXPLAINED;
use super::result::fit::Method;
use super::result::parameter::Parameter;
use super::result::provenance::Provenance;
use super::run::identify;
use super::settings::Settings;
use crate::open::Opened;
use ff_model::{Area, Problem, Problems};
use ident::checks::{ClockPolicy, MomentumChange, RecordChecks, momentum_change};

/// Part of chi-squared that a fit with an initial state must leave at most to be preferred.
const BETTER: f64 = 0.2;
/// Initial values below this many standard deviations are not named.
const SURE: f64 = 3.0;

/// [`identify`] with record checks. `axes` refuses records with an axis mismatch (row D21). Records that were corrected are
/// changed in place. Returns the settings of the last fit and warnings beside the result.
///
/// # Errors
/// Those of [`identify`], and the refusals of the rows named above.
#[allow(clippy::too_many_arguments, reason = "one call; each is a thing of its own")]
pub fn identify_checked(
    opened: &Opened,
    records: &mut [LabelledRecord],
    settings: &Settings,
    options: &FitOptions,
    checks: RecordChecks,
    axes: RecordCheck<'_>,
    provenance: &Provenance,
    watch: &Observer<'_>,
) -> Result<(Identified, Settings, Problems), IdentifyError> {
    let fit =
        |records: &[LabelledRecord], s: &Settings| identify(opened, records, s, options, provenance.clone(), watch);
    let mut s = settings.clone();
    let mut problems = Problems::default();
    let mut found = fit(records, &s)?;
    if found.result.method == Method::Ground || watch.ends_with_result() {
        return Ok((found, s, problems));
    }
    if found.result.over_noise() > s.limit {
        axes(records, &s)?;
    }
    // Where a fit has not ended, what would lower chi-squared there says little against records that begin at rest.
    let seen = || found.result.status.is_solution() || records.iter().any(|t| may_turn(&t.record));
    let moving_may_be = speaks_for(&found, &[IN_MOTION]) && seen();
    if found.result.over_noise() > s.limit
        && !s.initial_state
        && moving_may_be
        && found.result.method == Method::OutputError
    {
        let moving = Settings { initial_state: true, ..s.clone() };
        match fit(records, &moving) {
            // The fit before it has ended.
            Err(IdentifyError::Interrupted) | Ok(_) if watch.ends_with_result() => return Ok((found, s, problems)),
            again => {
                let again = again?;
                if again.result.chi2_per_dof < BETTER * found.result.chi2_per_dof {
                    problems.push(not_at_rest(&again, found.result.chi2_per_dof));
                    (found, s) = (again, moving);
                }
            }
        }
    }
    let mut clocks = Vec::new();
    // A start in the middle of a motion is not predicted by the comparison of clocks.
    // Nor is a clock put right where another error explains more.
    // With errors of sensors among the unknowns, which the comparison of clocks does not know, clocks are among the errors that are tested.
    let of_drives = !s.drives.is_empty() || records.iter().any(|r| !r.record.has_torques());
    let errors = of_drives || found.result.uncertain.iter().any(|u| u.kind.is_shared());
    let may_be = checks.clocks == ClockPolicy::Require || !errors && speaks_for(&found, &CLOCKS);
    // Nor are clocks compared where channels count at times of their own: errors of clocks are among those that are tested.
    let even = records.iter().all(|r| r.record.is_uniform() && !r.continues);
    let may_be = may_be && (even || checks.clocks == ClockPolicy::Require);
    if checks.clocks != ClockPolicy::Trust && !s.initial_state && may_be {
        let first = watch.partial.then(|| found.clone());
        match (set_clocks(&opened.model, records, &s, checks.clocks, found, &fit), first) {
            (Err(IdentifyError::Interrupted), Some(first)) => return Ok((first, s, problems)),
            (set, _) => {
                let warnings;
                (found, clocks, warnings) = set?;
                problems.extend(warnings);
            }
        }
    }
    if found.result.over_noise() > s.limit && speaks_for(&found, &["external-torque", "external-force"]) {
        for (k, labelled) in records.iter().enumerate() {
            let at = found.values_in(records, k);
            let change = momentum(opened, (&found, &at), labelled, &s, watch);
            if matches!(change, Err(IdentifyError::Interrupted)) && watch.partial {
                break;
            }
            let change = checkable(change, labelled, "momentum", &mut problems)?;
            let Some(change) = change.flatten() else { continue };
            let p = not_conserved(&change, labelled, checks.external_torque, found.result.evidence.as_ref());
            if !checks.external_torque {
                return Err(IdentifyError::Refused(Problems(vec![p])));
            }
            problems.push(p);
        }
    }
    found.result.clocks = clocks;
    if watch.ends_with_result() {
        return Ok((found, s, problems));
    }
    for (k, labelled) in records.iter().enumerate() {
        let modes = decay_modes(&opened.model, &found.values_in(records, k), labelled, &s);
        let modes =
            if checks.require_modes { Some(modes?) } else { checkable(modes, labelled, "free decay", &mut problems)? };
        match modes {
            Some(DecayOutcome::Found(modes, warnings)) => {
                found.result.decay.push(*modes);
                problems.extend(warnings);
            }
            Some(DecayOutcome::None(why)) if checks.require_modes => return Err(IdentifyError::IllPosed(why)),
            _ => {}
        }
    }
    Ok((found, s, problems))
}

/// What a check after the fit has found. Where the model cannot be evaluated, such as at the values of a fit that has not ended, there is no
/// check, which is said; the result is there all the same.
fn checkable<T>(
    found: Result<T, IdentifyError>,
    labelled: &LabelledRecord,
    check: &str,
    problems: &mut Problems,
) -> Result<Option<T>, IdentifyError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(e @ (IdentifyError::Fit(_) | IdentifyError::Model(_))) => {
            let what = format!("the {check} of the record was not checked at the values of the fit: {e}");
            let hint = "look at the fit first: it has not ended, or its springs and dampers are far from the mission's";
            problems.push(Problem::warning(Area::Data, "Data::NotChecked", what).on(&labelled.label).hint(hint));
            Ok(None)
        }
        Err(e) => Err(e),
    }
}

/// Errors of clocks ([`ident::uncertain::hypotheses`]).
const CLOCKS: [&str; 4] = ["torque-clock", "gyro-clock", "torque-clock-rate", "gyro-clock-rate"];

/// Whether the tests of errors leave it open that the error is one of these: one of them explains most, or cannot be told from what
/// does, or nothing explains most of what is left over.
fn speaks_for(found: &Identified, errors: &[&str]) -> bool {
    let Some(e) = &found.result.evidence else { return true };
    let Some(best) = e.named.first() else { return true };
    let is = |name: &str| errors.contains(&name);
    is(&best.name) || best.alike.iter().any(|n| is(n)) || e.explained.is_some_and(|part| part < UNEXPLAINED)
}

/// Row D30.
fn not_at_rest(found: &Identified, before: f64) -> Problem {
    let sure = |p: &&Parameter| p.std.is_some_and(|s| p.value.abs() > SURE * s);
    let initial = |p: &&Parameter| p.name.contains("initial");
    let all: Vec<String> = found
        .result
        .nuisance
        .iter()
        .filter(initial)
        .filter(sure)
        .map(|p| format!("{} {} {}", p.name, num(p.value), p.unit))
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

/// Row D29: the change of momentum that explains what the fit leaves, if one does.
fn momentum(
    opened: &Opened,
    (found, values): (&Identified, &[f64]),
    labelled: &LabelledRecord,
    s: &Settings,
    watch: &Observer<'_>,
) -> Result<Option<MomentumChange>, IdentifyError> {
    let even = labelled.record.bridged().map_err(ident::SetupError::from).map_err(setup)?;
    let model = &opened.model;
    let (record, s, _) = behind_gears(model, values, &even, s)?;
    let record = &*record;
    let s = Settings { method: Some(Method::OutputError), initial_state: s.initial_state || labelled.continues, ..s };
    let mut fit = RecordEstimator::new(model, record, &s)?;
    let beside = nuisance(fit.estimator(), values, &s, watch)?;
    let at = (values, found.selected.as_slice());
    momentum_change(model, record, fit.estimator(), at, beside, s.noise.gyro).map_err(IdentifyError::from)
}

fn not_conserved(
    c: &MomentumChange,
    labelled: &LabelledRecord,
    declared: bool,
    evidence: Option<&Evidence>,
) -> Problem {
    let when =
        c.at.map_or_else(|| "drifts steadily".to_owned(), |t| format!("jumps about {t:.1} s after the first sample"));
    let what = format!(
        "angular momentum {when}, by {:.3e} N m s (base rate {:.2e} rad/s): that would explain {:.0} % of what the model does not; a \
         system on which nothing acts keeps its momentum",
        c.momentum.norm(),
        c.rate.norm(),
        100.0 * (c.drop / c.excess).min(1.0)
    );
    let make = if declared { Problem::warning } else { Problem::error };
    // Both turn the gyro's rate by a ramp.
    let acting = |n: &&NamedError| n.name.starts_with("external-");
    let hint = match (c.at, evidence.and_then(|e| e.named.iter().find(acting))) {
        (Some(_), _) => "leave the firing out of the record, or declare it with --external-torque".to_owned(),
        (None, Some(n)) => format!(
            "{} would explain it, which --adopt {} estimates; --external-torque lets the record pass without",
            n.text, n.name
        ),
        (None, None) => {
            "a torque acts, or the bias of the gyro drifts: --external-torque lets the record pass, and the tests of errors tell which it is"
                .to_owned()
        }
    };
    make(Area::Data, "Data::MomentumNotConserved", what).on(&labelled.label).hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_records::RecordBuilder;
    use ident::EstimateError;

    #[test]
    fn a_check_that_cannot_be_made_takes_nothing_from_the_result() {
        let record = RecordBuilder::new(["arm"]).uniform(0.0, 50.0).q(nalgebra::DMatrix::zeros(9, 1));
        let wave = |columns| nalgebra::DMatrix::from_fn(9, columns, |i, j| (0.7 * i as f64 + j as f64).sin());
        let record = record.tau(wave(1)).gyro(wave(3)).allow("Data::Stuck");
        let record = record.build().unwrap().0;
        let of =
            LabelledRecord { label: "log.csv".into(), record, resampled: (false, false), continues: false, ago: 0 };
        let mut problems = Problems::default();
        let mut tried = |found: Result<u8, IdentifyError>| checkable(found, &of, "momentum", &mut problems);
        assert_eq!(tried(Ok(3)).unwrap(), Some(3));
        assert_eq!(tried(Err(IdentifyError::Model("the mass matrix is not positive definite".into()))).unwrap(), None);
        assert_eq!(tried(Err(IdentifyError::Fit(EstimateError::NoStart))).unwrap(), None);
        assert!(matches!(tried(Err(IdentifyError::Interrupted)), Err(IdentifyError::Interrupted)));
        assert_eq!(problems.0.len(), 2);
        let said = problems.0[0].to_string();
        assert!(
            said.contains("Data::NotChecked") && said.contains("log.csv") && said.contains("not positive"),
            "{said}"
        );
    }
}
