//! Whether anything moves.
//!
//! The travel of a joint is the range of its means over up to 64 blocks of samples, which noise of one sample hardly moves; the same is
//! asked of torques and gyro.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, NOTHING_MOVES, Topic};
use ff_model::diagnostics::{Limit, list};
use ff_model::{Area, JointKind, Problem};
use nalgebra::DVectorView;

/// Blocks that means are taken over.
const BLOCKS: usize = 64;
/// Travel below so many standard deviations of a block mean is noise: the range of 64 normal numbers is 4.7, seldom above 6.5.
const NOISE: f64 = 7.0;
/// Steps of an encoder that a joint at rest flickers over.
const STEPS: f64 = 1.5;
/// Travel below this (rad or m) is none.
const LEAST: f64 = 1e-9;
/// Outputs whose range stays below so many deviations of a block mean are silent. Wider than for joints: sensors drift.
const SILENT: f64 = 10.0;

/// Range of the means over blocks, and samples of the shortest block.
pub(super) fn travel(x: DVectorView<'_, f64>) -> (f64, usize) {
    let n = x.len();
    let blocks = BLOCKS.min(n / 4).max(1);
    let (mut lo, mut hi, mut shortest) = (f64::INFINITY, f64::NEG_INFINITY, n);
    for b in 0..blocks {
        let (from, to) = (b * n / blocks, (b + 1) * n / blocks);
        let mean = x.rows(from, to - from).mean();
        (lo, hi, shortest) = (lo.min(mean), hi.max(mean), shortest.min(to - from));
    }
    (hi - lo, shortest.max(1))
}

/// Travel of the means over blocks up to which an output is noise or flickers over a step; `shortest` block in samples.
pub(super) fn quiet_below(noise: f64, step: f64, shortest: usize) -> f64 {
    (SILENT * noise / (shortest as f64).sqrt()).max(STEPS * step).max(LEAST)
}

pub(super) fn findings(case: &Case<'_>) -> Vec<Finding> {
    let (record, level) = (case.record, &case.level);
    let mut moving = Vec::new();
    let mut still = Vec::new();
    let (mut least, mut most, mut bound) = (f64::INFINITY, 0.0f64, 0.0f64);
    for (j, name) in record.joint_names().iter().enumerate() {
        let (range, shortest) = travel(record.q().column(j).as_view());
        let own = NOISE * level.position[j] / (shortest as f64).sqrt();
        let own = own.max(STEPS * level.position_step[j]).max(LEAST);
        bound = bound.max(own);
        if range > own {
            moving.push(name.as_str());
            (least, most) = (least.min(range), most.max(range));
        } else {
            still.push(name.as_str());
            most = most.max(range);
        }
    }
    let slides = case.model.own_bodies().all(|b| b.joint.kind == JointKind::Prismatic);
    let unit = if slides { "m" } else { "rad" };
    if !moving.is_empty() {
        let mut text =
            format!("{} of {} joints move, by {least:.3} to {most:.3} {unit}", moving.len(), record.joints());
        if still.is_empty() {
            return vec![case.finding(Topic::Excitation, Judgement::Good, text).figures(most, bound, unit)];
        }
        let stand = if still.len() == 1 { "stands" } else { "stand" };
        let named = list(still.iter().copied(), 8);
        text += &format!("; {named} {stand} still (travel below {bound:.1e} {unit})");
        // A robot in space feels its own motion everywhere; the friction of a joint on the ground is told by that joint alone.
        if !record.is_fixed_base() {
            return vec![case.finding(Topic::Excitation, Judgement::Good, text).figures(most, bound, unit)];
        }
        let what = format!("{text}: what its motion alone tells, its friction among it, cannot be estimated");
        let p = Problem::warning(Area::Data, "Data::JointsStill", what.clone()).on(case.label);
        let p = p.hint(format!("move {named} as well, or hold it: [robot] lock"));
        return vec![
            case.finding(Topic::Excitation, Judgement::Suspicious, what).figures(most, bound, unit).raising(p),
        ];
    }
    let silent = |m: &nalgebra::DMatrix<f64>, noise: &[f64], step: &[f64]| {
        m.column_iter().enumerate().all(|(k, c)| {
            let (range, shortest) = travel(c.as_view());
            range <= quiet_below(noise[k], step[k], shortest)
        })
    };
    let quiet = silent(record.tau(), &level.torque, &level.torque_step)
        && (record.is_fixed_base() || silent(record.gyro(), &level.gyro, &level.gyro_step));
    let measure = format!(
        "no joint moves: the largest travel is {most:.2e} {unit}, limit {bound:.2e} {unit} by the noise of the encoders"
    );
    let hint = if record.is_fixed_base() {
        "record while the joints move, or at several poses"
    } else {
        "record while the joints move: plan a motion with ffid excite"
    };
    let make = |p: Problem| p.on(case.label).violating(most, Limit::Above(bound), unit).hint(hint);
    if quiet || record.is_fixed_base() {
        let text = match (record.is_fixed_base(), quiet) {
            (false, _) => format!("{measure}; torques and gyro read noise alone"),
            // What they hold against gravity in one pose is one number a joint.
            (true, true) => format!("{measure}; torques are constant but for their noise"),
            // Below the torque at which a joint begins to slide it may take any value, which tells nothing of what it carries.
            (true, false) => format!("{measure}; torques change, which friction at rest takes up"),
        };
        let p = make(Problem::error(Area::Data, NOTHING_MOVES, text.clone()));
        return vec![case.finding(Topic::Excitation, Judgement::Wrong, text).figures(most, bound, unit).raising(p)];
    }
    let text = format!("{measure}; torques or gyro change all the same");
    let p = make(Problem::warning(Area::Data, "Data::JointsStill", text.clone()));
    vec![case.finding(Topic::Excitation, Judgement::Suspicious, text).figures(most, bound, unit).raising(p)]
}
