//! Starts for a fit that is lost, from what rings while the joints stand still.
//!
//! Where a mission's springs are several times too soft or too stiff, oscillations predicted and measured slip by periods within seconds,
//! and no step leads to where they agree. The frequency and the damping of a free decay are read without any of that
//! ([`ident::checks::resolved_decay`]). Whose they are is not known then: each appendage in turn has all of its springs changed in proportion, so
//! that the slowest of its modes has that frequency, and its dampers likewise; the record says which is best.

use super::elsewhere::{Subject, is_spring, owner};
use super::record_estimator::sigmas;
use ff_dynamics::analysis::{Boundary, Mode, modes};
use ff_model::Params;
use ident::Request;
use ident::checks::resolved_decay;
use ident::modal::Stray;
use ident::parameters::is_damping;

/// Relative deviation of a measured frequency up to which it is a line.
const SHARP: f64 = 0.02;
/// Ratio of frequencies up to which two are one.
const ONE_LINE: f64 = 1.05;
/// Lines that are tried.
const LINES: usize = 3;
/// Changes of the springs until the mode has the frequency, and ratio at which it has.
const STEPS: usize = 8;
const THERE: f64 = 1e-3;
/// Most by which dampers are changed.
const DAMPED: f64 = 30.0;

/// A line of a free decay.
struct Line {
    pose: Vec<f64>,
    frequency_hz: f64,
    damping_ratio: f64,
}

/// Starts at which an appendage rings as the records do while the joints stand still; none where nothing does. Allocates.
pub(super) fn tuned(of: &Subject<'_>, request: &Request<'_>) -> Vec<Vec<f64>> {
    let springs = request.selected.iter().copied().filter(|&i| is_spring(request, i));
    let mut owners: Vec<&str> = springs.filter_map(|i| owner(&request.decls[i].name)).collect();
    owners.dedup();
    let lines = lines(of, request.start);
    lines.iter().flat_map(|line| owners.iter().filter_map(|owner| one(of, request, owner, line))).collect()
}

/// Lines of the free decays, those of the longest record first.
fn lines(of: &Subject<'_>, start: &[f64]) -> Vec<Line> {
    let Ok(full) = of.unknowns.expand(start) else { return Vec::new() };
    let sigma = sigmas(of.model, &of.settings.noise);
    let mut out: Vec<Line> = Vec::new();
    let mut records: Vec<_> = of.records.iter().collect();
    records.sort_by(|a, b| b.record.seconds().total_cmp(&a.record.seconds()));
    for t in records {
        let Ok(even) = t.record.bridged() else { continue };
        let Ok(found) = resolved_decay(of.model, &full, &even, &sigma) else { continue };
        let middle = usize::midpoint(found.samples.0, found.samples.1);
        for (i, m) in found.fit.modes.iter().enumerate() {
            let product = found.matched.strays.iter().any(|s| s.0 == i && matches!(s.1, Stray::Combination { .. }));
            let near = |l: &Line| (l.frequency_hz / m.frequency).ln().abs() < ONE_LINE.ln();
            if product || m.frequency_deviation > SHARP * m.frequency || out.iter().any(near) {
                continue;
            }
            let pose = even.q().row(middle).iter().copied().collect();
            out.push(Line { pose, frequency_hz: m.frequency, damping_ratio: m.damping });
        }
        if !out.is_empty() {
            break;
        }
    }
    out.truncate(LINES);
    out
}

/// The start with the springs and dampers of an appendage changed in proportion, so that the slowest of its modes is the line; `None` where it
/// has none.
fn one(of: &Subject<'_>, request: &Request<'_>, owner_name: &str, line: &Line) -> Option<Vec<f64>> {
    let mine = |i: &usize| owner(&request.decls[*i].name) == Some(owner_name);
    let springs: Vec<usize> = request.selected.iter().copied().filter(|i| mine(i) && is_spring(request, *i)).collect();
    let dampers = request.selected.iter().copied().filter(|i| mine(i) && is_damping(&request.decls[*i]));
    let mut start = request.start.to_vec();
    for _ in 0..STEPS {
        let ratio = line.frequency_hz / slowest(of, &start, owner_name, &line.pose)?.frequency_hz;
        springs.iter().for_each(|&i| start[i] *= ratio.powi(2));
        if ratio.ln().abs() < THERE {
            break;
        }
    }
    let own = slowest(of, &start, owner_name, &line.pose)?.damping_ratio;
    let ratio = (line.damping_ratio / own).clamp(1.0 / DAMPED, DAMPED);
    if ratio.is_finite() {
        dampers.for_each(|i| start[i] *= ratio);
    }
    start.iter().all(|x| x.is_finite()).then_some(start)
}

/// The slowest mode of which more than half is the motion of an appendage.
fn slowest(of: &Subject<'_>, values: &[f64], owner_name: &str, pose: &[f64]) -> Option<Mode> {
    let params = Params::from_values(of.model, of.unknowns.expand(values).ok()?);
    let rest = of.model.rest_position(&params);
    let all = modes(of.model, &params, pose, &rest, Boundary::JointsHeld).ok()?;
    let names = of.model.passive_coords();
    let own = |m: &Mode| {
        let part = |mine: bool| {
            let of = m.passive.iter().zip(&names).filter(|(_, (name, _))| (owner(name) == Some(owner_name)) == mine);
            of.map(|(x, _)| x * x).sum::<f64>()
        };
        part(true) > part(false)
    };
    all.into_iter().filter(own).min_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz))
}
