//! Other starts for a fit that ended in the wrong valley.
//!
//! A record of oscillations has minima beside the right one: a spring whose mode lies between two lines of the spectrum is drawn to the
//! wrong one, and the line it should have explained is left over in the residuals. So the first other starts are those that put a mode of
//! the model where the residuals have their power, and only then come random ones.

use super::drawn_anew::Search;
use super::ends::{
    FAR, LOWER, NOWHERE, WIDE, explains, given_back, gone_on, has_springs, is_spring, keeps_rows, of_body, within,
};
use super::known::of_channel;
use super::labelled_record::LabelledRecord;
use super::lost::{as_others_are_told, bodies_strayed, given_life, has_lost, keep_whole, lost, strayed, vanished};
use super::noise_floor::NoiseFloor;
use super::observed_estimator::ObservedEstimator;
use super::record_estimator::Twin;
use super::row_layout::RowLayout;
use super::settings::Settings;
use super::signals::Signals;
use super::unknowns::Unknowns;
use super::valleys::ASIDE;
use crate::workflow::amplitude::{PART, loudness};
use ff_dynamics::analysis::{Boundary, modes};
use ff_least_squares::{Settings as Solver, Status};
use ff_model::{Model, ParamGroup, Params};
use ident::checks::whiteness::{self, ChannelResiduals};
use ident::estimate::{Estimate, attempt};
use ident::parameters::{is_damping, wide_start};
use ident::{Estimator, Loss, Request};

/// The same from which a stiffness alone is given back to the mission.
const ASTRAY: f64 = 2.0;
/// Factors on the whole bodies and on the springs of starts whose damping is [`DAMPED`] times that of the mission.
const EASED: [(f64, f64); 5] = [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0), (1.0 / 3.0, 1.0), (1.0, 1.0 / 3.0)];
/// See [`EASED`]. Oscillations that die within periods cannot slip by periods.
const DAMPED: f64 = 10.0;
/// Factor on a spring up to which modes of a thinned record are allowed for: beyond, it has gone astray.
pub(super) const STIFFER: f64 = 3.0;
/// The same where the end of the fit itself cannot be followed otherwise.
const STIFFEST: f64 = 30.0;
/// Starts drawn at random.
const RANDOM: usize = 6;
/// Starts at lines of the residuals, at most.
const AIMED: usize = 10;
/// Lines of the residuals that are aimed at.
const LINES: usize = 3;
/// `p` of Smirnov below which the power of a channel counts.
const POWER: f64 = 1e-4;
/// Frequencies closer than this ratio are one.
const ONE_LINE: f64 = 1.12;
/// Factors on the start of a stiffness that are tried.
const FACTORS: (f64, f64) = (1.0 / 30.0, 30.0);
/// Passes over springs that are put to lines together.
const SETTLES: usize = 3;
/// Ratio beyond the slowest and the fastest mode up to which a line may be that of one of them in the wrong place.
const BEYOND: f64 = 1.5;
/// Change of a stiffness that shows which mode it belongs to.
const NUDGE: f64 = 1.05;
/// Promised relative reduction at which a try has shown where it leads.
const SHOWN: f64 = 1e-4;
/// Rounds of such starts: a spring that has gone astray takes one, and so does the next.
const ROUNDS: usize = 4;
/// Rounds after which there is another although they have led nowhere, where everything is far off.
const AGAIN: usize = 2;
/// How often a start that explains the thinned record, and has not ended after [`MOST`] linearisations, is led on.
const LONGER: usize = 2;
/// Linearisations of a pass after which it leads nowhere.
const MOST: usize = 20;
/// The same of the end itself, which all data have led to: what fewer make of it is next to it.
const OWN: usize = 3;

/// What a fit was of.
pub(super) struct Subject<'a> {
    pub(super) model: &'a Model,
    pub(super) records: &'a [LabelledRecord],
    pub(super) unknowns: &'a Unknowns,
    pub(super) settings: &'a Settings,
    /// Standard deviation of every channel of a sample.
    pub(super) sigma: &'a [f64],
    /// What predicts the records with other unknowns.
    pub(super) twins: &'a [Twin<'a>],
    /// What noise alone leaves.
    pub(super) floor: &'a NoiseFloor,
}

/// The fit, or a better one from another start when it does not explain the record, leaves a line in the residuals, or a positive parameter has
/// vanished in it: starts that put a mode where power is left over, then random ones, are fitted to the thinned record until one of them
/// explains that; the best goes on over the whole. Where that is better and leaves lines as well, its own are aimed at, spring after spring ([`ROUNDS`]);
/// where everything is far off and a round leads nowhere, others are drawn ([`AGAIN`]).
/// What fails on the way is no error: the fit stays. `again` where that has been done before in this fit: what was tried then is not.
pub(super) fn elsewhere(
    request: &Request<'_>,
    first: Estimate,
    again: bool,
    of: &Subject<'_>,
    estimator: &mut ObservedEstimator<'_>,
) -> Estimate {
    let mut at = first;
    let begun = if again { ROUNDS } else { 0 };
    let mut round = Round { number: begun, led: true };
    while round.number < begun + ROUNDS {
        let (before, had_lost) = (at.objective, has_lost(request, &at));
        at = one_round(request, at, of, round, estimator);
        // Nor has anything been tried around an end that has lost an appendage on the way.
        let led =
            at.objective < before - 2.0 * LOWER || !had_lost && !explains(&at, request.noise) && has_lost(request, &at);
        let once_more = round.number < begun + AGAIN && at.chi2_per_dof > WIDE * request.noise;
        if estimator.stopped() || !(led || once_more) {
            break;
        }
        round = Round { number: round.number + 1, led };
    }
    at
}

/// A round of other starts.
#[derive(Clone, Copy)]
struct Round {
    number: usize,
    /// Whether the one before has led to another end, around which nothing has been tried yet.
    led: bool,
}

/// See [`elsewhere`].
fn one_round(
    request: &Request<'_>,
    first: Estimate,
    of: &Subject<'_>,
    round: Round,
    estimator: &mut ObservedEstimator<'_>,
) -> Estimate {
    // Under a robust loss, what is left may be outliers. Without springs to be estimated there are no modes to be in the wrong place, and a fit that has
    // ended is at its end.
    if request.loss != Loss::Squares || !has_springs(request) && first.is_solution() {
        return first;
    }
    // A line that is left over may be that of a mode in the wrong place, however little it adds to the whole.
    let mut lines = lines(&first, of);
    let near = within(&first, FAR, request.noise);
    if near {
        let modes = if lines.is_empty() { None } else { frequencies(of, &first.values) }.unwrap_or_default();
        let (slow, fast) = modes.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), f| (a.min(*f), b.max(*f)));
        lines.retain(|hz| (slow / BEYOND..fast * BEYOND).contains(hz));
    }
    // Residuals that are white wherever a fit has ended are larger than was said, and no other valley has less to leave.
    let answers = lines.is_empty() && (near || first.is_solution());
    if answers && !vanished(request, &first) {
        return first;
    }
    // All data say whether what has vanished is wanted after all: a thinned record is explained without it.
    let (start, coarse) = if answers {
        (given_life(request, &first), false)
    } else {
        let Some(best) = best_start(request, &first, (&lines, round), of, estimator) else { return first };
        // From what explains the thinned record, still less of it leads away.
        (best.values, request.coarse && !best.explains)
    };
    let led = !coarse && !answers;
    match attempt(&Request { start: &start, centre: Some(request.start), coarse, led, ..request.clone() }, estimator) {
        // What has not ended is no answer where there is one, unless it is the better valley.
        Ok(e)
            if e.objective < first.objective
                && (e.is_solution() || !first.is_solution() || e.objective < first.objective - LOWER) =>
        {
            gone_on(e, &first, request)
        }
        _ => first,
    }
}

/// Where the best of other starts leads over the thinned record, if that is better there than where the fit ended, which has left `lines`
/// over.
fn best_start(
    request: &Request<'_>,
    first: &Estimate,
    (lines, round): (&[f64], Round),
    of: &Subject<'_>,
    estimator: &mut ObservedEstimator<'_>,
) -> Option<Lead> {
    let (lost, back) = lost(request, first);
    let far = first.chi2_per_dof > WIDE * request.noise;
    // An appendage beside which all is nearly right is looked for by itself.
    if !far
        && round.led
        && !lost.is_empty()
        && let Some(found) = drawn_anew(request, first, (&lost, &back), lines, of, estimator)
    {
        return Some(found);
    }
    // What has strayed goes back first.
    let astray = if round.led { strayed(request, first) } else { Vec::new() };
    let is_astray = |i: usize| astray.contains(&i);
    let mut starts = Vec::new();
    if !astray.is_empty() {
        starts.push(given_back(request, first, is_astray));
        starts.extend(as_others_are_told(request, first, &astray));
    }
    // While springs were elsewhere, bodies may have been led to the edge of what can exist, where a fit ends, or to masses of no sense. Springs
    // that were found on the way are nearer than the mission's; with these bodies nothing leads back from there.
    if far && round.led && (first.is_solution() || bodies_strayed(request, first)) {
        starts.push(given_back(request, first, |i| of_body(request, i)));
        if !astray.is_empty() {
            starts.push(given_back(request, first, |i| of_body(request, i) || is_astray(i)));
        }
    }
    let mut wide: Vec<Vec<f64>> = Vec::new();
    if far || !lost.is_empty() {
        // What a round before has tried is not tried again.
        let drawn = round.number * RANDOM..(round.number + 1) * RANDOM;
        let seed = |k: usize| of.settings.seed.wrapping_add(1 + k as u64);
        if far && (round.number == 0 || lost.is_empty()) {
            if round.number == 0 {
                wide.extend(EASED.iter().map(|&(bodies, springs)| eased(request, bodies, springs)));
            }
            wide.extend(drawn.map(|k| wide_start(request.decls, request.start, request.selected, seed(k))));
        } else {
            // All but the appendages that are lost is nearly right. With the frequencies that are left over their masses and lengths are told by
            // amplitudes, wherever they start.
            wide.push(back.clone());
            wide.extend(drawn.map(|k| wide_start(request.decls, &back, &lost, seed(k))));
            for (turn, start) in wide.iter_mut().enumerate() {
                keep_whole(of.model, request, &first.values, start);
                at_lines(of, request, &lost, (lines, turn), start);
            }
        }
    }
    // Lines of residuals far off are those of everything, and springs there say nothing; with quiet sensors a record is followed long before it is explained.
    let follows = follows(first, of);
    let near = if round.led && (follows || first.chi2_per_dof < NOWHERE * request.noise) {
        [aimed(request, first, lines, of), springs_back(request, first)].concat()
    } else {
        Vec::new()
    };
    let wide_first = if far { !follows } else { !lost.is_empty() };
    starts.extend(if wide_first { [wide, near] } else { [near, wide] }.concat());
    let settings = of_a_try(request);
    let led = |looked: &mut dyn Estimator, follows_end: bool| {
        led_best(request, &settings, (first, follows_end), &starts, looked)
    };
    let thin = |up_to: f64, follows_end: bool| {
        let mut thin = estimator.rough(&stiffest(request, &first.values, up_to))?;
        led(&mut *thin.estimator, follows_end)
    };
    // Where there is no thinner look at the record, or none that follows what is as fast as this, all of it leads.
    let found = thin(STIFFER, true).or_else(|| thin(STIFFEST, true)).or_else(|| thin(STIFFER, false));
    found.or_else(|| led(estimator, false))
}

/// Where the best of many draws of what is `lost` leads; `back` has that as the mission does. `None` where none explains the record, or there are no
/// fewer rows or more than are kept. Allocates rows of several draws at a time.
fn drawn_anew(
    request: &Request<'_>,
    first: &Estimate,
    (lost, back): (&[usize], &[f64]),
    lines: &[f64],
    of: &Subject<'_>,
    estimator: &ObservedEstimator<'_>,
) -> Option<Lead> {
    if !keeps_rows(request, first) || !lost.iter().any(|&i| is_spring(request, i)) {
        return None;
    }
    let (mut near, beyond) = estimator.beside(request, first, back)?;
    let to_lines = |which: &[usize], turn: usize, at: &mut [f64]| at_lines(of, request, which, (lines, turn), at);
    let whole = |at: &mut [f64], from: &[f64]| keep_whole(of.model, request, from, at);
    let seed = of.settings.seed;
    let settings = of_a_try(request);
    let search = Search { request, first, lost, back, seed, settings, to_lines: &to_lines, whole: &whole };
    let found = search.best(&mut near, beyond)?;
    Some(Lead { objective: found.objective + beyond, explains: true, values: found.values })
}

/// Whether a fit leaves no more than a twentieth of the signals.
pub(super) fn follows(e: &Estimate, of: &Subject<'_>) -> bool {
    let loud = of.records.iter().map(|t| loudness(&t.record, of.sigma)).sum::<f64>() / of.records.len() as f64;
    e.chi2_per_dof < PART.powi(2) * loud
}

/// Settings of a pass that shows where a start leads.
pub(super) fn of_a_try(request: &Request<'_>) -> Solver {
    let max_iterations = MOST.min(request.settings.max_iterations);
    Solver { decrement_tolerance: SHOWN, max_iterations, ..request.settings.clone() }
}

/// Where a start has led over fewer data.
struct Lead {
    values: Vec<f64>,
    objective: f64,
    explains: bool,
}

impl Lead {
    fn to(e: Estimate, noise: f64) -> Self {
        Self { explains: explains(&e, noise), objective: e.objective, values: e.values }
    }
}

/// Where the best of some starts leads, the end of the fit among them; `None` where nothing can be predicted, or not that end and it must be.
fn led_best(
    request: &Request<'_>,
    settings: &Solver,
    (first, follows_end): (&Estimate, bool),
    starts: &[Vec<f64>],
    looked: &mut dyn Estimator,
) -> Option<Lead> {
    let mut lead = |start: &[f64], to_beat: Option<f64>, max_iterations: usize| {
        let settings = Solver { max_iterations, ..settings.clone() };
        let tried = Request { start, centre: Some(request.start), settings, to_beat, finer: ASIDE, ..request.clone() };
        attempt(&tried, looked)
    };
    // What the thinned record makes of the end itself is what the others are measured by. It has fewer readings, so that it may be explained
    // there: that ends nothing.
    let mut best = lead(&first.values, None, OWN).ok().map(|e| Lead::to(e, request.noise));
    let own = best.as_ref().map(|b| b.objective);
    if follows_end && own.is_none() {
        return None;
    }
    // An end that the thinned record cannot follow, as where a spring has run away, has as much for every reading there as with all data.
    let by_reading = first.objective / first.residuals.len().max(1) as f64;
    for start in starts {
        let to_beat = best.as_ref().map_or(f64::INFINITY, |b| b.objective);
        let Ok(mut e) = lead(start, Some(to_beat), settings.max_iterations) else { continue };
        let own = own.unwrap_or(by_reading * e.residuals.len() as f64);
        // One that is nearly there is led to its end, which is cheaper here than over all data. Far off, that may be the end of a wrong valley.
        for _ in 0..LONGER {
            let unfinished = e.status == Status::IterationLimit && explains(&e, request.noise);
            if !unfinished || e.objective >= (own - LOWER).min(to_beat) {
                break;
            }
            match lead(&e.values, Some(to_beat), settings.max_iterations) {
                Ok(on) if on.objective < e.objective => e = on,
                _ => break,
            }
        }
        let there = Lead::to(e, request.noise);
        let done = there.objective < own - LOWER && there.explains;
        if there.objective < to_beat {
            best = Some(there);
        }
        if done {
            break;
        }
    }
    best
}

/// Changes the springs of what is lost so that their modes are at lines of the residuals, one after another from that whose turn it is.
fn at_lines(
    of: &Subject<'_>,
    request: &Request<'_>,
    lost: &[usize],
    (lines, turn): (&[f64], usize),
    start: &mut [f64],
) {
    let springs: Vec<usize> = lost.iter().copied().filter(|&i| is_spring(request, i)).collect();
    // One spring moves the modes of the others.
    for _ in 0..SETTLES {
        for (k, &i) in springs.iter().enumerate() {
            let Some(line) = lines.get((k + turn) % lines.len().max(1)) else { return };
            let Some(here) = frequencies(of, start) else { return };
            let Some(own) = own_mode(of, start, &here, i).filter(|&own| here[own] > 0.0) else { return };
            start[i] *= (line / here[own]).powi(2).clamp(FACTORS.0, FACTORS.1);
        }
    }
}

/// The start with bodies, springs and dampers changed together ([`EASED`]).
fn eased(request: &Request<'_>, bodies: f64, springs: f64) -> Vec<f64> {
    let mut out = request.start.to_vec();
    for &i in request.selected {
        let d = &request.decls[i];
        out[i] *= match d.group {
            ParamGroup::Inertial(_) => bodies,
            _ if is_spring(request, i) => springs,
            _ if is_damping(d) => DAMPED,
            _ => 1.0,
        };
    }
    out
}

/// The start with every spring at least as stiff as in `other`: modes there are as fast as in either, which a thinned record has to follow. One
/// that is stiffer there by more than a factor is no mode that anything should follow.
pub(super) fn stiffest(request: &Request<'_>, other: &[f64], up_to: f64) -> Vec<f64> {
    let mut out = request.start.to_vec();
    for &i in request.selected.iter().filter(|&&i| is_spring(request, i)) {
        if other[i] < up_to * out[i] {
            out[i] = out[i].max(other[i]);
        }
    }
    out
}

/// Starts from the end of a fit with one stiffness changed, so that its mode comes to a line of the residuals: the strongest line
/// first, and of the springs the one that the record tells least.
fn aimed(request: &Request<'_>, first: &Estimate, lines: &[f64], of: &Subject<'_>) -> Vec<Vec<f64>> {
    let Some(here) = (if lines.is_empty() { None } else { frequencies(of, &first.values) }) else {
        return Vec::new();
    };
    let mut found: Vec<(usize, f64, Vec<f64>)> = Vec::new();
    for (&i, p) in request.selected.iter().zip(&first.parameters) {
        if !is_spring(request, i) {
            continue;
        }
        let Some(own) = own_mode(of, &first.values, &here, i) else { continue };
        let told = p.std.map_or(0.0, |std| (p.value / std).abs());
        for (rank, line) in lines.iter().enumerate() {
            let by = (line / here[own]).powi(2);
            let mut start = first.values.clone();
            start[i] *= by;
            if by.ln().abs() > ONE_LINE.ln() && (FACTORS.0..FACTORS.1).contains(&(start[i] / request.start[i])) {
                found.push((rank, told, start));
            }
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    found.into_iter().take(AIMED).map(|(_, _, start)| start).collect()
}

/// Starts from the end of a fit with one stiffness as the mission has it, the farthest from there first: the mode of one that has gone astray may be the line
/// that is left over.
fn springs_back(request: &Request<'_>, first: &Estimate) -> Vec<Vec<f64>> {
    let far = |i: usize| (first.values[i] / request.start[i]).ln().abs();
    let springs = |i: &usize| is_spring(request, *i) && far(*i) > ASTRAY.ln();
    let mut found: Vec<usize> = request.selected.iter().copied().filter(springs).collect();
    found.sort_by(|&a, &b| far(b).total_cmp(&far(a)));
    found.into_iter().take(AIMED).map(|i| given_back(request, first, |k| k == i)).collect()
}

/// The mode, among those of the frequencies `here`, that a stiffness moves most.
pub(super) fn own_mode(of: &Subject<'_>, values: &[f64], here: &[f64], i: usize) -> Option<usize> {
    let mut nudged = values.to_vec();
    nudged[i] *= NUDGE;
    let there = frequencies(of, &nudged)?;
    let gain = |k: usize| (there[k] / here[k]).ln();
    (0..here.len().min(there.len())).max_by(|&a, &b| gain(a).total_cmp(&gain(b)))
}

/// Where the residuals have the most power above the noise (Hz), the strongest first.
fn lines(first: &Estimate, of: &Subject<'_>) -> Vec<f64> {
    let mut found = Vec::new();
    let mut at = 0;
    for (record, t) in of.records.iter().enumerate() {
        let rows = RowLayout::of(&t.record, of.sigma.len()).rows();
        let Some(part) = first.residuals.get(at..at + rows) else { break };
        at += rows;
        let signals = Signals::of(of.model, &t.record, part, of.sigma);
        for (k, sigma) in of.sigma.iter().enumerate() {
            let (read, rate) = signals.readings(k);
            let channel = ChannelResiduals {
                channel: signals.names[k].clone(),
                residuals: read.iter().map(|r| r / sigma).collect(),
                rate_hz: rate,
                besides: of.floor.drawn.get(record).map_or_else(Vec::new, |d| of_channel(d, k, &t.record)),
            };
            if let Ok(c) = whiteness::check_beside(&channel, &[])
                && c.excess_p < POWER
            {
                found.push((c.mean_square, c.peak_hz));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut out: Vec<f64> = Vec::new();
    for (_, hz) in found {
        if hz > 0.0 && out.iter().all(|o| (hz / o).ln().abs() > ONE_LINE.ln()) {
            out.push(hz);
        }
    }
    out.truncate(LINES);
    out
}

/// Natural frequencies (Hz), ascending, at the first pose of the first record.
pub(super) fn frequencies(of: &Subject<'_>, values: &[f64]) -> Option<Vec<f64>> {
    let params = Params::from_values(of.model, of.unknowns.expand(values).ok()?);
    let q: Vec<f64> = of.records.first()?.record.q().row(0).iter().copied().collect();
    let rest = of.model.rest_position(&params);
    let found = modes(of.model, &params, &q, &rest, Boundary::JointsHeld).ok()?;
    Some(found.iter().map(|m| m.frequency_hz).collect())
}
