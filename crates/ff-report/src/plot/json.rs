//! A figure as data for the scripts of a page: curves thinned to what a screen shows, as packed numbers.

use super::draw::{colour_index, covers, is_zero, y_range};
use super::figure::{Figure, Panel, Range, Series};
use super::scale::typeset;
use crate::packed::singles;
use serde_json::{Value, json};

/// The figure; every curve has about `points` points, the least and the greatest of each interval among them.
pub(super) fn figure(f: &Figure, points: usize) -> String {
    let panels: Vec<Value> = f.panels.iter().map(|p| panel(p, points)).collect();
    json!({ "title": f.title, "panels": panels }).to_string()
}

fn panel(p: &Panel, points: usize) -> Value {
    // Curves with the same abscissae share them.
    let mut groups: Vec<(&[f64], Vec<usize>)> = Vec::new();
    for (i, s) in p.series.iter().enumerate() {
        match groups.iter_mut().find(|(x, _)| *x == s.xs.as_slice()) {
            Some((_, members)) => members.push(i),
            None => groups.push((&s.xs, vec![i])),
        }
    }
    let data = |(xs, members): &(&[f64], Vec<usize>)| {
        let curves: Vec<&Series> = members.iter().map(|&i| &p.series[i]).collect();
        let (x, ys) = thin(xs, &curves, points);
        let ys: Vec<String> = ys.into_iter().map(|y| singles(y.into_iter())).collect();
        json!({ "x": singles(x.into_iter()), "ys": ys, "series": members })
    };
    let curve = |(i, s): (usize, &Series)| {
        // A panel without labels takes those of the first, which must not say what is so there alone.
        json!({ "label": s.label, "zero": is_zero(p, s), "colour": colour_index(s, i), "dashed": s.dashed || covers(p, i) })
    };
    json!({
        "title": p.title,
        "x": typeset(&p.x_label),
        "y": typeset(&p.y_label),
        "log": p.log_y,
        "xRange": p.x_range,
        "yRange": y_range(p),
        "height": p.height,
        "groups": groups.iter().map(data).collect::<Vec<_>>(),
        "series": p.series.iter().enumerate().map(curve).collect::<Vec<_>>(),
        "lines": p.vlines.iter().map(|v| json!({ "x": v.x, "label": v.label, "colour": v.colour })).collect::<Vec<_>>(),
        "ranges": p.ranges.iter().map(range).collect::<Vec<_>>(),
        "bands": p.bands.iter().map(|b| json!([b.from, b.to])).collect::<Vec<_>>(),
    })
}

/// Few points, such as one for each record of a sequence: all are kept.
fn range(r: &Range) -> Value {
    let packed = |x: &[f64]| singles(x.iter().copied());
    json!({ "x": packed(&r.xs), "low": packed(&r.low), "high": packed(&r.high), "colour": r.colour })
}

/// Two samples of every interval of the abscissa: for each curve its least and its greatest value there, in the order in which they
/// occur. Short curves are kept whole.
fn thin(xs: &[f64], curves: &[&Series], points: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = xs.len();
    if n <= points {
        return (xs.to_vec(), curves.iter().map(|s| s.ys.clone()).collect());
    }
    let intervals = (points / 2).max(1);
    let edge = |k: usize| k * n / intervals;
    let x = (0..intervals).flat_map(|k| [xs[edge(k)], xs[(edge(k) + edge(k + 1) - 1).div_ceil(2)]]).collect();
    let extremes = |ys: &[f64]| -> Vec<f64> {
        (0..intervals)
            .flat_map(|k| {
                let part = &ys[edge(k)..edge(k + 1)];
                let by = |better: fn(f64, f64) -> bool| {
                    (1..part.len()).fold(0, |best, i| if better(part[i], part[best]) { i } else { best })
                };
                let (least, greatest) = (by(|a, b| a < b), by(|a, b| a > b));
                [part[least.min(greatest)], part[least.max(greatest)]]
            })
            .collect()
    };
    (x, curves.iter().map(|s| extremes(&s.ys)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;

    fn numbers(v: &Value) -> Vec<f32> {
        let bytes = STANDARD.decode(v.as_str().unwrap()).unwrap();
        bytes.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    #[test]
    fn a_long_curve_keeps_its_spike_and_its_place() {
        let t: Vec<f64> = (0..360_000).map(|i| i as f64 * 0.01).collect();
        let y: Vec<f64> = (0..360_000).map(|i| if i == 271_828 { 9.0 } else { (i as f64 * 1e-3).sin() }).collect();
        let f = Figure::new("hour").panel(Panel::new("time (s)", "rate (rad/s^2)").curve("w", &t, &y));
        let v: Value = serde_json::from_str(&figure(&f, 2000)).unwrap();
        let group = &v["panels"][0]["groups"][0];
        let (x, w) = (numbers(&group["x"]), numbers(&group["ys"][0]));
        assert_eq!((x.len(), w.len()), (2000, 2000));
        assert!(x.is_sorted() && x[0] == 0.0);
        let at = w.iter().position(|y| *y == 9.0).unwrap();
        assert!((f64::from(x[at]) - 2718.28).abs() < 3.6, "{}", x[at]);
        assert_eq!(v["panels"][0]["y"], "rate (rad/s²)");
    }

    #[test]
    fn a_curve_is_called_zero_in_the_panel_where_it_is() {
        let t = [0.0, 1.0, 2.0];
        let first = Panel::new("x", "y").curve("still", &t, &[0.0; 3]).curve("moves", &t, &t);
        let second = Panel::new("x", "y").curve("", &t, &[0.3, 0.2, 0.7]).curve("", &t, &t);
        let v: Value = serde_json::from_str(&figure(&Figure::new("").panel(first).panel(second), 100)).unwrap();
        let series = |k: usize| &v["panels"][k]["series"];
        assert_eq!((&series(0)[0]["label"], &series(0)[0]["zero"]), (&json!("still"), &json!(true)));
        assert_eq!((&series(1)[0]["label"], &series(1)[0]["zero"]), (&json!(""), &json!(false)));
    }

    #[test]
    fn curves_share_abscissae_where_they_are_the_same() {
        let (a, b) = ([0.0, 1.0, 2.0], [0.0, 2.0]);
        let p = Panel::new("x", "y").curve("1", &a, &a).curve("2", &b, &b).curve("3", &a, &a);
        let v: Value = serde_json::from_str(&figure(&Figure::new("").panel(p), 100)).unwrap();
        let groups = &v["panels"][0]["groups"];
        assert_eq!((&groups[0]["series"], &groups[1]["series"]), (&json!([0, 2]), &json!([1])));
        assert_eq!(numbers(&groups[1]["ys"][0]), [0.0, 2.0]);
    }
}
