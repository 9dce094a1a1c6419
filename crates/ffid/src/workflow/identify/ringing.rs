//! Starts for a fit that is lost, from what rings while the joints stand still.
//!
//! Where a mission's springs are several times too soft or too stiff, oscillations predicted and measured slip by periods within seconds,
//! and no step leads to where they agree. The frequency and the damping of a free decay are read without any of that
//! ([`ident::checks::resolved_decay`]). Whose they are is not known then: each appendage in turn has all of its springs changed in proportion, so
//! that the slowest of its modes has that frequency, and its dampers likewise; the record says which is best.

use super::ends::{is_spring, owner};
use super::labelled_record::LabelledRecord;
use super::record_estimator::sigmas;
use super::unknowns::Unknowns;
use ff_dynamics::analysis::{Boundary, Mode, modes, stiffness_damping};
use ff_model::{Model, Params};
use ff_records::Record;
use ident::checks::resolved_decay;
use ident::modal::Stray;
use ident::parameters::is_damping;
use ident::{Noise, Request};
use nalgebra::DVector;

/// Relative deviation of a measured frequency up to which it is a line.
const SHARP: f64 = 0.02;
/// Ratio of frequencies up to which two are one.
const ONE_LINE: f64 = 1.05;
/// Lines that are tried.
const LINES: usize = 3;
/// Changes of the springs until the mode has the frequency, and ratio at which it has.
const STEPS: usize = 8;
const THERE: f64 = 1e-3;
/// Most by which dampers are changed in a step.
const DAMPED: f64 = 30.0;

/// What rings.
pub(in crate::workflow) struct Ringing<'a> {
    pub(in crate::workflow) model: &'a Model,
    pub(in crate::workflow) noise: &'a Noise,
    pub(in crate::workflow) records: Vec<&'a Record>,
    /// All parameters of the model from those of a request; `None` where they make none.
    pub(in crate::workflow) expand: &'a dyn Fn(&[f64]) -> Option<Vec<f64>>,
}

/// [`tuned`] for a fit of these unknowns.
pub(super) fn starts(
    model: &Model,
    records: &[LabelledRecord],
    unknowns: &Unknowns,
    noise: &Noise,
    request: &Request<'_>,
) -> Vec<Vec<f64>> {
    let expand = |values: &[f64]| unknowns.expand(values).ok();
    let records = records.iter().map(|t| &t.record).collect();
    tuned(&Ringing { model, noise, records, expand: &expand }, request)
}

/// A line of a free decay.
struct Line {
    pose: Vec<f64>,
    frequency_hz: f64,
    damping_ratio: f64,
}

/// Starts at which an appendage rings as the records do while the joints stand still; none where nothing does. Allocates.
pub(in crate::workflow) fn tuned(of: &Ringing<'_>, request: &Request<'_>) -> Vec<Vec<f64>> {
    let springs = request.selected.iter().copied().filter(|&i| is_spring(request, i));
    let mut owners: Vec<&str> = springs.filter_map(|i| owner(&request.decls[i].name)).collect();
    owners.dedup();
    let lines = lines(of, request.start);
    lines.iter().flat_map(|line| owners.iter().filter_map(|owner| one(of, request, owner, line))).collect()
}

/// Lines of the free decays, those of the longest record first.
fn lines(of: &Ringing<'_>, start: &[f64]) -> Vec<Line> {
    let Some(full) = (of.expand)(start) else { return Vec::new() };
    let sigma = sigmas(of.model, of.noise);
    let mut out: Vec<Line> = Vec::new();
    let mut records = of.records.clone();
    records.sort_by(|a, b| b.seconds().total_cmp(&a.seconds()));
    for record in records {
        let Ok(even) = record.bridged() else { continue };
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
fn one(of: &Ringing<'_>, request: &Request<'_>, owner_name: &str, line: &Line) -> Option<Vec<f64>> {
    let mine = |i: &usize| owner(&request.decls[*i].name) == Some(owner_name);
    let springs: Vec<usize> = request.selected.iter().copied().filter(|i| mine(i) && is_spring(request, *i)).collect();
    let is_damper = |i: &usize| mine(i) && is_damping(&request.decls[*i]);
    let dampers: Vec<usize> = request.selected.iter().copied().filter(is_damper).collect();
    let mut start = request.start.to_vec();
    for _ in 0..STEPS {
        let params = Params::from_values(of.model, (of.expand)(&start)?);
        let mode = slowest(of.model, &params, owner_name, &line.pose)?;
        let ratio = line.frequency_hz / mode.frequency_hz;
        springs.iter().for_each(|&i| start[i] *= ratio.powi(2));
        // Modes that do not oscillate have no frequency to go by, so that the damping ratio is put right on the way.
        let damped = ratio * (line.damping_ratio / mode.damping_ratio).clamp(1.0 / DAMPED, DAMPED);
        if damped.is_finite() {
            dampers.iter().for_each(|&i| start[i] *= damped);
        }
        if ratio.ln().abs() < THERE {
            break;
        }
    }
    start.iter().all(|x| x.is_finite()).then_some(start)
}

/// The slowest mode of which more than half of the energy in springs is that of an appendage. Amplitudes do not tell: a small pendulum swings
/// far along in the modes of the others.
fn slowest(model: &Model, params: &Params<f64>, owner_name: &str, pose: &[f64]) -> Option<Mode> {
    let rest = model.rest_position(params);
    let names = model.passive_coords();
    let k = stiffness_damping(model, params, &rest).0;
    let own = |m: &Mode| {
        let energy = |mine: bool| {
            let of = |x: &f64, name: &str| if (owner(name) == Some(owner_name)) == mine { *x } else { 0.0 };
            let shape = m.passive.iter().zip(&names).map(|(x, (name, _))| of(x, name));
            let shape = DVector::from_iterator(m.passive.len(), shape);
            shape.dot(&(&k * &shape))
        };
        energy(true) > energy(false)
    };
    let all = modes(model, params, pose, &rest, Boundary::JointsHeld).ok()?;
    all.into_iter().filter(own).min_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_mission::{LoadOptions, Mission};
    use ident::parameters::is_stiffness;

    #[test]
    fn a_small_pendulum_that_swings_along_has_a_mode_of_its_own() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/verdict/truth.toml");
        let loaded = Mission::load(file.as_ref(), &crate::default_registry(), &LoadOptions::default()).unwrap();
        let model = loaded.model;
        let mut values = Params::<f64>::nominal(&model).values().to_vec();
        // A thousandth of the fuel on a tenth of the length, and an own frequency above that of the wing.
        for (i, d) in model.param_decls().iter().enumerate().filter(|(_, d)| owner(&d.name) == Some("tank")) {
            values[i] *= match d.unit {
                "kg" => 1e-3,
                "m" => 0.1,
                _ if is_stiffness(d) => 2.3e-5,
                _ if is_damping(d) => 1e-5,
                _ => 1.0,
            };
        }
        let params = Params::from_values(&model, values);
        let pose = &loaded.mission.excite.start_rad;
        let all = modes(&model, &params, pose, &model.rest_position(&params), Boundary::JointsHeld).unwrap();
        let names = model.passive_coords();
        let largest = |m: &Mode| {
            names[(0..names.len()).max_by(|&a, &b| m.passive[a].abs().total_cmp(&m.passive[b].abs())).unwrap()]
                .0
                .clone()
        };
        assert_eq!(owner(&largest(&all[0])), Some("tank"), "no test where it does not swing along");
        let own = slowest(&model, &params, "tank", pose).unwrap();
        assert!(own.frequency_hz > 1.03 * all[0].frequency_hz, "{} of {:?}", own.frequency_hz, all);
        let wing = slowest(&model, &params, "wing", pose).unwrap();
        assert!((wing.frequency_hz - all[0].frequency_hz).abs() < 1e-9);
    }
}
