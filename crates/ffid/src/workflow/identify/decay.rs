//! Modes of the free decay in a record: while the joints stand still, panels and fuel ring.

use super::asked::Take;
use super::findings::{DecayMode, DecayModes, UnseenMode};
use super::fit::sigmas;
use super::{IdentifyError, Settings};
use crate::open::MAX_DENSE;
use ff_dynamics::Boundary;
use ff_model::{Area, Model, Params, Problem, Problems};
use ff_records::Record;
use ff_spectral::modal::ModalError;
use ff_spectral::psd::{PsdError, energy_at_the_top};
use ff_spectral::{ModalFit, ModalSettings, fit_modes};
use ident::modal::{HeldPose, ModalModel};
use ident::modal::{MatchSettings, ModeMatch, Stray, match_modes};

/// A joint stands still while it stays within this part of its range in the record.
const STILL: f64 = 1e-3;
/// Modes are looked for up to this many times the highest of the model.
const ABOVE: f64 = 1.5;
/// How well the frequencies of an identified model are known, relative, for the match.
const KNOWN: f64 = 0.05;
/// Shortest decay that is looked at, in periods of the slowest mode of the model.
const PERIODS: f64 = 2.0;
/// Part of the energy of a channel just below half the rate at which it was not filtered before it was sampled.
const ALIASED: f64 = 0.01;

/// What became of the question.
#[derive(Clone, Debug, PartialEq)]
pub enum Decay {
    /// Modes.
    Found(Box<DecayModes>, Problems),
    /// None, and why: problems of area data, whose first code is that of `bad-inputs.md` (rows D23 to D25).
    None(Problems),
}

/// The longest time during which no joint moves: first sample and the one after the last. Allocates.
pub fn still(record: &Record) -> (usize, usize) {
    let q = record.q();
    let tolerance: Vec<f64> = q.column_iter().map(|c| STILL * (c.max() - c.min())).collect();
    let (mut best, mut from) = ((0, 0), 0);
    let mut lo: Vec<f64> = q.row(0).iter().copied().collect();
    let mut hi = lo.clone();
    for i in 0..q.nrows() {
        for j in 0..q.ncols() {
            (lo[j], hi[j]) = (lo[j].min(q[(i, j)]), hi[j].max(q[(i, j)]));
        }
        while (0..q.ncols()).any(|j| hi[j] - lo[j] > tolerance[j]) {
            // Begin later: after the first sample that is too far from this one.
            from += 1;
            while from < i && (0..q.ncols()).any(|j| (q[(from, j)] - q[(i, j)]).abs() > tolerance[j]) {
                from += 1;
            }
            for j in 0..q.ncols() {
                let part = q.column(j).rows(from, i + 1 - from).into_owned();
                (lo[j], hi[j]) = (part.min(), part.max());
            }
        }
        if i + 1 - from > best.1 - best.0 {
            best = (from, i + 1);
        }
    }
    best
}

fn none(code: &'static str, what: String, hint: &str) -> Decay {
    Decay::None(Problems(vec![Problem::error(Area::Data, code, what).hint(hint)]))
}

/// Looks for the modes of the free decay in a record and matches them to those of the model at `values`. Allocates.
///
/// # Errors
/// [`IdentifyError`] when the model has no modes at that pose because of its numbers.
pub fn modes(model: &Model, values: &[f64], take: &Take, s: &Settings) -> Result<Decay, IdentifyError> {
    if model.np() == 0 || model.nv() > MAX_DENSE {
        return Ok(none("Data::NoDecay", "the model has nothing that rings".into(), "leave --modes out"));
    }
    let record = &take.record;
    let (from, to) = still(record);
    let (dt, n) = (record.dt(), to - from);
    let mid = (from + to) / 2;
    let pose: Vec<f64> = record.q().row(mid).iter().copied().collect();
    let params = Params::from_values(model, values.to_vec());
    let eta = model.rest_position(&params);
    let held = HeldPose { q: &pose, eta: &eta, boundary: Boundary::JointsHeld };
    let modal = ModalModel::new(model, &params, &held).map_err(|e| IdentifyError::Model(e.to_string()))?;
    let known = modal.modes();
    let (Some(first), Some(last)) = (known.first(), known.last()) else {
        return Ok(none("Data::NoDecay", "no mode of the model oscillates".into(), "leave --modes out"));
    };
    let (slow, f_max) = (first.frequency(), ABOVE * last.frequency());
    let seconds = n as f64 * dt;
    let needed = PERIODS / slow;
    if seconds < needed {
        let what = format!(
            "the joints stand still for {seconds:.2} s at most; modes from {slow:.4} Hz need {needed:.2} s (a spectrum of \
             that part resolves {:.4} Hz)",
            1.0 / seconds.max(dt)
        );
        return Ok(none("Data::Resolution", what, "hold the joints longer after the motion, such as with --hold"));
    }
    let window = record.window(from as f64 * dt, to as f64 * dt).map_err(IdentifyError::Refused)?;
    let sigma = sigmas(model, &s.noise);
    let fit = match fit_modes(&window.responses(), &sigma, record.rate_hz(), &ModalSettings::up_to(f_max)) {
        Ok(f) => f,
        Err(e) => return refusal(&e),
    };
    let settings = MatchSettings { frequency_spread: KNOWN, ..MatchSettings::up_to(f_max) };
    let matched = match_modes(&fit, known, &sigma, &settings);
    let mut warnings = Problems::default();
    for u in &fit.unresolved {
        let what = format!(
            "modes at {:.4} and {:.4} Hz are closer than the {:.4} Hz that the record keeps apart",
            u.f1, u.f2, u.df
        );
        let p = Problem::warning(Area::Data, "Data::Unresolved", what).on(&take.label);
        warnings.push(p.hint("read their frequencies and damping together, or record a longer decay"));
    }
    aliases(&window, &sigma).into_iter().for_each(|p| warnings.push(p.on(&take.label)));
    let line = |i: usize| {
        let m = &fit.modes[i];
        let pair = matched.pairs.iter().find(|p| p.measured == i);
        DecayMode {
            frequency_hz: m.frequency,
            frequency_std_hz: m.frequency_deviation,
            damping_ratio: m.damping,
            damping_std: m.damping_deviation,
            model_hz: pair.map(|p| known[p.model].frequency()),
            model_damping: pair.map(|p| known[p.model].damping()),
            mac: pair.map(|p| p.mac),
            note: stray(&fit, &matched, i),
        }
    };
    let found = DecayModes {
        record: take.label.clone(),
        from_s: from as f64 * dt,
        to_s: to as f64 * dt,
        resolution_hz: fit.df,
        noise_ratio: fit.noise_ratio,
        modes: (0..fit.modes.len()).map(line).collect(),
        unresolved: fit.unresolved.iter().map(|u| (u.f1, u.f2)).collect(),
        unseen: matched
            .unseen
            .iter()
            .map(|(j, why)| UnseenMode { frequency_hz: known[*j].frequency(), why: why.words().to_owned() })
            .collect(),
    };
    Ok(Decay::Found(Box::new(found), warnings))
}

/// Row D24: channels that are not quiet just below half the rate.
fn aliases(window: &Record, sigma: &[f64]) -> Option<Problem> {
    let rate = window.rate_hz();
    let all = window.responses();
    let share = |k: usize| energy_at_the_top(all.column(k).as_slice(), rate, sigma[k]).unwrap_or(0.0);
    let names = window.response_names().into_iter().enumerate();
    let loud: Vec<String> = names
        .map(|(k, name)| (share(k), name))
        .filter(|(share, _)| *share > ALIASED)
        .map(|(share, name)| format!("{:.1} % of {name}", 100.0 * share))
        .collect();
    if loud.is_empty() {
        return None;
    }
    let what = format!(
        "above {:.3} Hz, nine tenths of half the rate, lies {} (limit {} %): what is faster than half the rate appears slower, and may \
         pass for a mode",
        0.45 * rate,
        ff_model::diagnostics::list(loud.iter().map(String::as_str), 6),
        100.0 * ALIASED
    );
    let hint = "sample faster, or behind an anti-alias filter";
    Some(Problem::warning(Area::Data, "Data::Aliasing", what).hint(hint))
}

/// What a measured mode is that the model has not.
fn stray(fit: &ModalFit, m: &ModeMatch, i: usize) -> String {
    match m.strays.iter().find(|s| s.0 == i).map(|s| &s.1) {
        None => String::new(),
        Some(Stray::Combination { of }) => {
            let hz = |k: usize| fit.modes[k].frequency;
            format!("a product of {:.4} and {:.4} Hz, not a mode", hz(of.0), hz(of.1))
        }
        Some(Stray::NoCounterpart { nearest, mac }) => match nearest {
            Some(f) => format!("not in the model (nearest {f:.4} Hz, MAC {mac:.2})"),
            None => "not in the model".to_owned(),
        },
    }
}

fn refusal(e: &ModalError) -> Result<Decay, IdentifyError> {
    let (code, hint) = match e {
        ModalError::Signal(PsdError::Nyquist { .. }) => {
            ("Data::Nyquist", "sample faster, or leave out the stiffest appendage")
        }
        ModalError::TooShort { .. } => ("Data::Resolution", "hold the joints longer after the motion"),
        ModalError::NoMode { .. } => ("Data::NoPeak", "excite more strongly before the joints stop"),
        ModalError::Linalg(_) | ModalError::Fit(_) => {
            return Err(IdentifyError::Model(e.to_string()));
        }
        _ => ("Data::NoDecay", "look at the record while the joints stand still"),
    };
    Ok(none(code, e.to_string(), hint))
}
