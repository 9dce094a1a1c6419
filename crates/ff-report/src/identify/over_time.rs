//! What changes over time: parameters from record to record, biases within one.

use crate::plot::{Figure, Panel, Series};
use ffid::workflow::identify::{Course, IdentificationResult};

/// Most panels of a figure.
const MOST: usize = 12;
/// Half the width of a 95 % interval, in standard deviations.
const WIDTH: f64 = 1.96;

/// Values over the records and over time with their 95 % intervals; `None` where nothing is said to change.
pub fn over_time_figure(r: &IdentificationResult) -> Option<(String, Figure)> {
    let shown = &r.over_time[..r.over_time.len().min(MOST)];
    if shown.is_empty() {
        return None;
    }
    let mut figure = Figure::new(format!("{}: what changes", r.robot));
    for (k, course) in shown.iter().enumerate() {
        figure = figure.panel(panel(course, k == 0));
    }
    let left = r.over_time.len() - shown.len();
    let more = if left > 0 { format!(" {left} more are in result.json.") } else { String::new() };
    Some(("over-time".to_owned(), figure.caption(format!("Dashed: 95 % intervals.{more}"))))
}

fn panel(c: &Course, first: bool) -> Panel {
    let at: Vec<f64> = c.points.iter().map(|p| p.at).collect();
    let of = |by: f64| -> Vec<f64> { c.points.iter().map(|p| p.value + by * p.std.unwrap_or(0.0)).collect() };
    let (axis, title) = match &c.record {
        Some(record) => ("time (s)", format!("{} of {record}", c.name)),
        None => ("record", c.name.clone()),
    };
    let mut p = Panel::new(axis, c.unit.clone()).titled(title);
    p.height = 150.0;
    let label = |l: &str| if first { l.to_owned() } else { String::new() };
    p.series.push(Series::new(label("estimate"), &at, &of(0.0)).colour(1));
    if c.points.iter().all(|p| p.std.is_some()) {
        p.series.push(Series::new(label("95 %"), &at, &of(WIDTH)).dashed().colour(5));
        p.series.push(Series::new("", &at, &of(-WIDTH)).dashed().colour(5));
    }
    p
}
