//! The fit of `ffid identify`, the prediction of what was held out, and the comparison of models.

use super::args::Args;
use super::columns::Columns;
use super::faults::INTERRUPTED;
use super::prepare::{Held, Ready};
use crate::flags::choice::Clocks;
use crate::flags::fit::watched;
use crate::results::Refusal;
use ff_model::{Area, Params, Problem, Problems};
use ff_records::Record;
use ffid::workflow::doctor::before_fit;
use ffid::workflow::identify::{
    Arm, Comparison, Evidence, IdentificationResult, Identified, IdentifyError, InputFile, Interim, Known, LOW_PASS,
    LabelledRecord, Method, ModelVariant, Observer, Provenance, RecordChecks, RecordLine, Sampled, SampledState,
    Settings, Signals, State, axes, compare_variants, held_errors, identify_checked, judge_held_out, method,
    sample_posterior, verdict,
};
use ident::Loss;
use std::collections::BTreeMap;

/// [`fit_observed`], with progress on a terminal.
pub(crate) fn fit(args: &Args, r: &mut Ready) -> Result<Fitted, Refusal> {
    watched(&args.output, true, |watch| fit_observed(args, r, watch))
}

/// The parameters, the signals of what was held out, and warnings.
pub(crate) type Fitted = (Identified, Option<Signals>, Problems);

/// The fit, and the judgement of what was held out.
pub(crate) fn fit_observed(args: &Args, r: &mut Ready, watch: &Observer<'_>) -> Result<Fitted, IdentifyError> {
    let settings_words = words(args, r);
    let Ready { opened, settings: s, options, records, sources, earlier, held, truth, inputs, contents, .. } = r;
    let model = &opened.model;
    let provenance = Provenance {
        program: concat!("ffid ", env!("CARGO_PKG_VERSION")).to_owned(),
        inputs: inputs
            .iter()
            .map(|e| {
                let content = contents.iter().find(|c| c.0 == e.file).map(|c| c.1.to_string());
                InputFile { file: e.file.clone(), bytes: e.bytes, sha256: e.sha256.clone(), content }
            })
            // So that an identification that goes on from this one knows all that has been fitted.
            .chain(earlier.iter().filter(|e| inputs.iter().all(|i| i.sha256 != e.sha256)).cloned())
            .collect(),
        record: RecordLine { samples: 0, rate_hz: 0.0, seconds: 0.0, t0: 0.0, rates: false },
        noise_torque_nm: s.noise.torque,
        noise_gyro_rad_per_s: s.noise.gyro,
        settings: settings_words,
    };
    let checks =
        RecordChecks { clocks: args.clocks.into(), external_torque: args.external_torque, require_modes: args.modes };
    // An axis mismatch explains a misfit, and is looked for only then.
    let axes = |records: &[LabelledRecord], s: &Settings| -> Result<(), IdentifyError> {
        let nominal = Params::nominal(model);
        for (labelled, path) in records.iter().zip(&*sources).filter(|(r, _)| !r.continues) {
            let turned = axes::mismatch(model, nominal.values(), &labelled.record, s)?;
            if turned.has_errors() {
                return Err(IdentifyError::Refused(turned.in_file(path)));
            }
        }
        Ok(())
    };
    // What makes a fit useless is found in a fraction of its time.
    let mut before = Problems::default();
    // Records of an earlier identification have been judged there.
    for (labelled, path) in records.iter().zip(&*sources).filter(|(r, _)| r.ago == 0) {
        let found = before_fit(opened, labelled, s).map_err(|e| match e {
            IdentifyError::IllPosed(p) => IdentifyError::IllPosed(p.in_file(path.clone())),
            other => other,
        })?;
        before.extend(found.in_file(path));
    }
    args.input.leniency().settle(&mut before);
    if before.has_errors() {
        return Err(IdentifyError::Refused(before));
    }
    let asked = Columns::new(opened, sources, args.input.leniency());
    let doubts = |records: &[LabelledRecord], s: &Settings| asked.refuse(records, s);
    let doubting = Observer { doubts: Some(&doubts), ..*watch };
    let (mut found, s, mut warnings) =
        identify_checked(opened, records, s, options, checks, &axes, &provenance, &doubting)?;
    warnings.0.splice(0..0, before.0);
    let unexplained = |e: &Evidence| e.state != State::Explained && e.with_first != Some(State::Explained);
    if !watch.ends_with_result() && found.result.evidence.as_ref().is_some_and(unexplained) {
        let in_doubt = asked.behind(records, &s, &found)?;
        if let Some(evidence) = &mut found.result.evidence {
            let in_words =
                |p: &Problem| p.object.iter().chain([&p.message]).map(String::as_str).collect::<Vec<_>>().join(": ");
            evidence.columns = in_doubt.0.iter().map(in_words).collect();
        }
        warnings.extend(in_doubt);
    }
    // What follows does not change it.
    if let Some(kept) = watch.kept {
        let r = &found.result;
        let (values, chi2_per_residual, linearisations) = (found.values.clone(), r.chi2_per_dof, r.iterations);
        kept.replace(Some(Interim { values, chi2_per_residual, linearisations }));
    }
    let aside = &Observer { progress: watch.progress, ..watch.aside() };
    let mut left_out =
        if watch.ends_with_result() { vec!["tests of the model that were still to come"] } else { Vec::new() };
    let last = s.clone();
    let s = &Settings { held_errors: held_errors(&found.result), ..s };
    let arm = Arm::of(&found.result, &model.joint_names());
    let mut signals = None;
    // What a fit that has not ended would have learnt is no knowledge: what it predicts is compared, and no more.
    let posterior = found.result.posterior.as_ref().filter(|_| found.result.status.is_solution());
    let known = Known { opened, posterior, ties: &options.ties };
    let judge = |record: &Record, s: &Settings, source: String| {
        judge_held_out(known, &found.values, arm.as_ref(), record, s, source, aside)
    };
    let judged = match held {
        _ if watch.ends_with_result() => None,
        Held::None => None,
        // A part of a record begins in the middle of a motion.
        Held::Part { record, words } => {
            watch.unless_ended(judge(record, &Settings { initial_state: true, ..s.clone() }, words.clone()))?
        }
        Held::File { record, path, moving } => {
            let s = Settings { initial_state: s.initial_state || *moving, ..s.clone() };
            watch.unless_ended(judge(record, &s, path.display().to_string()))?
        }
    };
    if judged.is_none() && !matches!(held, Held::None) {
        left_out.push("the judgement of held-out data");
    }
    if let Some((held, of)) = judged {
        found.result.held_out = Some(held);
        signals = Some(of);
    }
    if !args.compare.is_empty() {
        let (record, source, moving) = match held {
            Held::Part { record, words } => (&*record, words.clone(), true),
            Held::File { record, path, moving } => (&*record, path.display().to_string(), *moving),
            // Not reached: comparing holds something out.
            Held::None => return Ok((found, signals, warnings)),
        };
        let data =
            Comparison { opened, records: records.as_slice(), held: record, source: &source, moving, settings: s };
        let variants: Vec<ModelVariant> = args.compare.iter().map(|&c| c.into()).collect();
        if !watch.ends_with_result() {
            let compared = compare_variants(&data, &variants, &provenance, aside);
            found.result.comparison = watch.unless_ended(compared)?;
        }
        left_out.extend(found.result.comparison.is_none().then_some("the comparison of models"));
    }
    // Last, because an interruption keeps what has been drawn.
    if let Some(chains) = args.sampling() {
        if watch.ends_with_result() {
            left_out.push("draws from the posterior");
        } else {
            sample_posterior(opened, records, &last, options, &chains, &mut found, watch)?;
            let cut = |s: &Sampled| s.state == SampledState::Interrupted;
            left_out.extend(found.result.sampled.as_ref().is_some_and(cut).then_some("more draws from the posterior"));
        }
    }
    // Of a fit that has not ended itself nothing more need be said.
    if !left_out.is_empty() && watch.partial && !found.result.status.is_interrupted() {
        let what = format!("interrupted after the fit had ended; left out: {}", left_out.join(", "));
        warnings.push(Problem::warning(Area::Data, INTERRUPTED, what).hint("run the command again, and let it end"));
    }
    found.result.set_truth(truth);
    found.result.verdict = verdict(&found.result);
    Ok((found, signals, warnings))
}

/// Settings by name, for result and manifest.
fn words(args: &Args, r: &Ready) -> BTreeMap<String, String> {
    let s = &r.settings;
    let how = method(&r.opened.model, s.method);
    let passive = how == Method::OutputError;
    let name = match how {
        Method::Rda => "rda",
        Method::OutputError => "output_error",
        Method::Ground => "ground",
    };
    let yes = |b: bool| if b { "estimated" } else { "none" }.to_owned();
    let mut all = vec![
        ("method", name.to_owned()),
        ("biases", yes(s.biases && passive)),
        ("initial_state", if s.initial_state && passive { "estimated" } else { "at rest" }.to_owned()),
        (IdentificationResult::PRIOR, s.prior.map_or_else(|| "none".to_owned(), |p| p.to_string())),
        ("start_offset", s.start_offset.to_string()),
        ("max_chi2", s.limit.to_string()),
    ];
    all.extend((s.loss != Loss::Squares).then(|| ("loss", format!("{:?}", s.loss).to_lowercase())));
    all.extend(r.options.reduce.then(|| ("reduce", "yes".to_owned())));
    all.extend(s.low_pass_hz.map(|hz| (LOW_PASS, hz.to_string())));
    all.extend(args.consider.then(|| ("uncertain", "considered".to_owned())));
    all.extend((args.starts > 1).then(|| ("starts", args.starts.to_string())));
    all.extend((!args.profile.is_empty()).then(|| ("profile", args.profile.join(", "))));
    all.extend(args.sample.map(|n| ("sample", n.to_string())));
    all.extend((!args.adopt.is_empty()).then(|| ("adopt", args.adopt.join(", "))));
    all.extend(args.prior_from.iter().map(|p| ("prior_from", p.display().to_string())));
    all.extend(args.ties.iter().map(|p| ("ties", p.display().to_string())));
    let variants: Vec<&str> = args.compare.iter().map(|&k| ModelVariant::from(k).name()).collect();
    all.extend((!variants.is_empty()).then(|| ("compare", variants.join(", "))));
    all.extend(args.external_torque.then(|| ("external_torque", "declared".to_owned())));
    all.extend((args.clocks == Clocks::Trust).then(|| ("clocks", "trusted".to_owned())));
    all.extend(args.truth.iter().map(|p| ("truth", p.display().to_string())));
    all.extend(args.held_out.iter().map(|h| ("held_out", h.clone())));
    all.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}
