//! The experiments that the paper does not do.

use super::super::beyond::{Beyond, Filling, Level, ModelFit, SensorFit, Sensors, Together, Unknown};
use super::super::identify::Row;
use super::shown::POINTS;
use crate::table::sig;
use ff_report::page::{Block, Cell, Table, interval};
use ff_report::plot::{Figure, Interval, Intervals, Panel};

/// All three.
///
/// # Errors
/// Those of [`Figure::to_svg`].
pub(super) fn blocks(b: &Beyond) -> anyhow::Result<Vec<Block>> {
    let mut out = together(&b.together)?;
    out.extend(sensors(&b.sensors));
    out.extend(filling(&b.filling)?);
    Ok(out)
}

fn words(x: f64, std: Option<f64>) -> String {
    std.map_or_else(|| sig(x, 4), |s| format!("{} \u{b1} {}", sig(x, 4), sig(s, 2)))
}

fn yes(ended: bool) -> Cell {
    Cell::words(if ended { "yes" } else { "no" })
}

fn together(t: &Together) -> anyhow::Result<Vec<Block>> {
    let row = |m: &ModelFit| {
        let (found, std, truth) = (m.base_mass_kg, m.base_mass_std_kg, m.base_mass_truth_kg);
        vec![
            Cell::words(m.model),
            Cell::number(m.unknowns.to_string()),
            Cell::number(sig(m.chi2_per_dof, 3)),
            yes(m.converged),
            Cell::number(words(found, std)),
            Cell::number(sig(truth, 4)),
            Cell::number(std.map_or_else(String::new, |s| sig((found - truth).abs() / s, 2))),
            Cell::number(sig(m.path.mean_pos_m, 2)),
            Cell::number(sig(m.path.mean_angle_rad, 2)),
        ]
    };
    let head = [
        "model",
        "unknowns",
        "\u{3c7}\u{b2} per degree of freedom",
        "converged",
        "base mass (kg)",
        "truth (kg)",
        "off by (deviations)",
        "mean position error (m)",
        "mean angle (rad)",
    ];
    let table = Table {
        caption: format!(
            "1. Panels and fuel at once: one noisy record of {} s of the satellite with both, and four models. What a model has no part for is mass of its base",
            sig(t.seconds, 3)
        ),
        head: head.map(String::from).to_vec(),
        rows: t.models.iter().map(row).collect(),
    };
    let (name, far) = &t.furthest;
    Ok(vec![
        Block::Table(table),
        Block::figure(&estimates(&t.estimates), POINTS)?,
        Block::text(format!(
            "Of the estimates of the model with both, {name} is furthest from the truth: {} of its stated deviations.",
            sig(*far, 2)
        )),
    ])
}

/// Start and estimate of every parameter against the truth.
fn estimates(rows: &[Row]) -> Figure {
    let row = |r: &Row| {
        let of = |x: f64| 100.0 * (x - r.truth) / r.truth.abs();
        let start = of(r.start);
        let mut all = vec![Interval { low: start, high: start, at: Some(start), colour: 6, wide: false }];
        if let Some(s) = r.std {
            let (low, high) = (of(r.value - 1.96 * s), of(r.value + 1.96 * s));
            all.push(Interval { low, high, at: Some(of(r.value)), colour: 0, wide: false });
        }
        (r.name.clone(), all)
    };
    // Where the truth is zero there is no relative error.
    let shown = rows.iter().filter(|r| r.truth.abs() > 1e-6);
    let intervals = Intervals {
        x_label: "difference from the truth (%)".into(),
        legend: vec![("start of the fit".into(), 6), ("estimate with its 95 % interval".into(), 0)],
        marks: vec![0.0],
        rows: shown.map(row).collect(),
        ..Intervals::default()
    };
    Figure::new("Panels and fuel at once: estimates against the truth")
        .intervals(intervals)
        .caption("Parameters whose true value is zero are in summary.json.")
}

fn sensors(s: &Sensors) -> Vec<Block> {
    let row = |f: &SensorFit| {
        vec![
            Cell::words(if f.with { "among the unknowns" } else { "taken as none" }),
            Cell::number(sig(f.chi2_per_dof, 4)),
            yes(f.converged),
            Cell::number(format!("{:.0} %", 100.0 * f.covered)),
            Cell::number(sig(f.furthest.1, 3)),
            Cell::words(f.furthest.0.clone()),
        ]
    };
    let head = [
        "biases and delay",
        "\u{3c7}\u{b2} per degree of freedom",
        "converged",
        "truths inside their 95 % intervals",
        "furthest (deviations)",
        "which",
    ];
    let fits = Table {
        caption: "2. Biases of all torque sensors and the gyro, and torques that come 3 ms late: one record, two fits"
            .into(),
        head: head.map(String::from).to_vec(),
        rows: s.fits.iter().map(row).collect(),
    };
    let row = |u: &Unknown| {
        let bar = u.std.map(|s| (u.value - 1.96 * s, u.value + 1.96 * s));
        vec![
            Cell::words(u.name.clone()),
            Cell::number(sig(u.truth, 4)),
            Cell::number(words(u.value, u.std)),
            Cell::words(u.unit.clone()),
            interval(u.value, bar, None, u.truth),
        ]
    };
    let unknowns = Table {
        caption: "A dot and a bar for the estimate and its 95 % interval, a tick for the truth".into(),
        head: ["", "truth", "found", "unit", "interval and truth"].map(String::from).to_vec(),
        rows: s.unknowns.iter().map(row).collect(),
    };
    vec![Block::Table(fits), Block::Details("Every bias and the delay".into(), vec![Block::Table(unknowns)])]
}

/// A fill level or a mass: estimate and deviation.
type Told = (f64, f64);

fn filling(f: &Filling) -> anyhow::Result<Vec<Block>> {
    let x: Vec<f64> = (1..=f.levels.len()).map(|i| i as f64).collect();
    let of = |pick: &dyn Fn(&Level) -> f64| -> Vec<f64> { f.levels.iter().map(pick).collect() };
    let told = |p: Panel, name: &str, colour: usize, scale: f64, pick: fn(&Level) -> Told| {
        let end = |by: f64| of(&|l| scale * (pick(l).0 + by * pick(l).1));
        let p = p.range(&x, &end(-1.96), &end(1.96), colour);
        let mut p = p.curve(name, &x, &end(0.0));
        p.series.iter_mut().last().into_iter().for_each(|s| s.colour = Some(colour));
        p
    };
    let fill = told(Panel::new("record", "fill level (%)"), "each record by itself", 1, 100.0, |l| l.alone);
    let fill = told(fill, "over the sequence", 0, 100.0, |l| l.sequence);
    let mut fill = fill.curve("truth", &x, &of(&|l| 100.0 * l.truth));
    let slosh =
        told(Panel::new("record", "sloshing mass (kg)"), "over the sequence", 0, 1.0, |l| (l.slosh_kg.1, l.slosh_kg.2));
    let mut slosh = slosh.curve("truth", &x, &of(&|l| l.slosh_kg.0));
    for s in [&mut fill, &mut slosh].into_iter().filter_map(|p| p.series.last_mut()) {
        (s.colour, s.dashed) = (Some(6), true);
    }
    let figure = Figure::new("The fill level, followed over a sequence of records").panel(fill).panel(slosh).caption(format!(
        "Shaded: 95 % intervals. Records of {} s; fuel is burnt between them, and nobody says how much. A full tank holds {} kg.",
        f.record_s, f.full_kg
    ));
    let row = |(i, l): (usize, &Level)| {
        let told = |(v, s): Told| Cell::number(format!("{:.1} \u{b1} {:.1}", 100.0 * v, 100.0 * s));
        vec![
            Cell::words((i + 1).to_string()),
            Cell::number(format!("{:.0}", 100.0 * l.truth)),
            told(l.alone),
            told(l.sequence),
            Cell::number(sig(l.slosh_kg.0, 4)),
            Cell::number(words(l.slosh_kg.1, Some(l.slosh_kg.2))),
        ]
    };
    let head = [
        "record",
        "fill (%)",
        "by itself (%)",
        "over the sequence (%)",
        "sloshing mass (kg)",
        "over the sequence (kg)",
    ];
    let table = Table {
        caption: "3. The fill level over a sequence of records".into(),
        head: head.map(String::from).to_vec(),
        rows: f.levels.iter().enumerate().map(row).collect(),
    };
    Ok(vec![Block::figure(&figure, POINTS)?, Block::Table(table)])
}
