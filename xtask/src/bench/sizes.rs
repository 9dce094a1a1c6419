//! `cargo xtask bench --sizes`: time against the number of bodies, as a figure and as the exponent of growth.

use super::build;
use super::options::{Args, Effort};
use super::run::{self, Pin};
use crate::table::{Table, sig};
use ff_report::plot::{Figure, Panel, Series};
use ffid::exit::Failure;
use ffid::files::atomic;
use serde_json::Value;
use std::path::Path;

/// One curve: the least disturbed repetition of all rounds at each size. Sizes are measured one after the other, so
/// that a median would carry what else the machine did meanwhile into the slope.
#[derive(Clone, Debug, PartialEq)]
struct Curve {
    family: String,
    function: String,
    size: Vec<f64>,
    ns: Vec<f64>,
}

/// The exponent is fitted from this size on: below, what a call costs at size zero dominates.
const FIT_FROM: f64 = 8.0;
/// What is drawn: family, heading, name of the abscissa.
const FAMILIES: [(&str, &str, &str); 2] = [
    ("chain", "A) one chain of joints on a free base", "joints"),
    ("panels", "B) panels of two segments on a free base", "panels"),
];

/// Measures, prints and draws.
///
/// # Errors
/// As [`run::lines`]; [`Failure::Io`] when the figure cannot be written.
pub fn run(root: &Path, args: &Args, effort: Effort) -> anyhow::Result<()> {
    let program = build::ff_bench(root, build::Target::Portable)?;
    let pin = Pin::to(args.core);
    let mut lines = Vec::new();
    for round in 1..=effort.rounds {
        eprintln!("sizes, round {round} of {}", effort.rounds);
        lines.extend(run::lines(root, &program, &["sizes".into(), "--reps".into(), effort.reps.to_string()], &pin)?);
    }
    let curves = curves(&lines)?;
    let mut t = Table::new(format!("Time against size, {}", pin.text()), &["", "sizes", "largest (ns)", "exponent"]);
    for c in &curves {
        let range = format!("{}..{}", c.size.first().unwrap_or(&0.0), c.size.last().unwrap_or(&0.0));
        let last = c.ns.last().map_or("-".into(), |&x| sig(x, 4));
        t.row([format!("{}.{}", c.family, c.function), range, last, shown(exponent(c))]);
    }
    t.note(format!("Exponent of ns = a size^b, fitted from size {FIT_FROM} on. The mass matrix has size^2 elements."));
    print!("{t}");
    let path = root.join("docs").join("figures").join("bench-linear.svg");
    atomic::write(&path, figure(&curves).to_svg()?.as_bytes())?;
    eprintln!("wrote {}", path.display());
    Ok(())
}

fn shown(b: Option<f64>) -> String {
    b.map_or("-".into(), |b| format!("{b:.2}"))
}

fn curves(lines: &[Value]) -> Result<Vec<Curve>, Failure> {
    let mut all: Vec<Curve> = Vec::new();
    for l in lines {
        let entry = || {
            let text = |k: &str| l[k].as_str().map(str::to_owned);
            let ns = l["min_ns"].as_f64().filter(|x| x.is_finite() && *x > 0.0)?;
            Some((text("family")?, text("fn")?, l["size"].as_u64()? as f64, ns))
        };
        let (family, function, size, ns) =
            entry().ok_or_else(|| Failure::Numerical(format!("ff-bench sizes printed no figures in: {l}")))?;
        match all.iter_mut().find(|c| c.family == family && c.function == function) {
            Some(c) => match c.size.iter().position(|s| *s == size) {
                Some(i) => c.ns[i] = c.ns[i].min(ns),
                None => {
                    c.size.push(size);
                    c.ns.push(ns);
                }
            },
            None => all.push(Curve { family, function, size: vec![size], ns: vec![ns] }),
        }
    }
    Ok(all)
}

/// Slope of `ln ns` over `ln size` by least squares, from [`FIT_FROM`] on; `None` for fewer than two sizes.
fn exponent(c: &Curve) -> Option<f64> {
    let points: Vec<(f64, f64)> =
        c.size.iter().zip(&c.ns).filter(|(s, _)| **s >= FIT_FROM).map(|(s, t)| (s.ln(), t.ln())).collect();
    if points.len() < 2 {
        return None;
    }
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let (sxy, sxx) = points.iter().fold((0.0, 0.0), |(a, b), p| (a + (p.0 - mx) * (p.1 - my), b + (p.0 - mx).powi(2)));
    Some(sxy / sxx)
}

fn figure(curves: &[Curve]) -> Figure {
    let mut f = Figure::new("Time per call against size");
    for (family, title, x) in FAMILIES {
        let mut p = Panel::new(format!("number of {x}"), "time per call (us)").titled(title);
        for c in curves.iter().filter(|c| c.family == family) {
            let us: Vec<f64> = c.ns.iter().map(|ns| ns / 1e3).collect();
            let label = format!("{} (exponent {})", c.function, shown(exponent(c)));
            let series = Series::new(label, &c.size, &us);
            // Without joints hybrid is fd: the dashes show both.
            p.series.push(if c.function == "hybrid" { series.dashed() } else { series });
        }
        f = f.panel(p);
    }
    f.caption(
        "One state at a time, portable build, fastest repetition. rnea, fd and hybrid are linear in the number of bodies. crba fills a \
         matrix of size squared.",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_exponent_of_a_power_is_found() {
        let size: Vec<f64> = [1, 2, 4, 8, 16, 32, 64].map(f64::from).to_vec();
        // An offset that would bend the fit at small sizes only.
        let ns: Vec<f64> = size.iter().map(|s| if *s < 8.0 { 900.0 } else { 80.0 * s.powf(1.25) }).collect();
        let c = Curve { family: "chain".into(), function: "rnea".into(), size, ns };
        assert!((exponent(&c).unwrap() - 1.25).abs() < 1e-12);
    }

    #[test]
    fn lines_become_a_figure() {
        let line = |n: u32, ns: f64| json!({"family": "chain", "size": n, "fn": "fd", "min_ns": ns});
        let curves = curves(&[line(1, 300.0), line(8, 1600.0), line(16, 4700.0), line(16, 3100.0)]).unwrap();
        assert_eq!((curves.len(), curves[0].ns.len()), (1, 3));
        let svg = figure(&curves).to_svg().unwrap();
        assert!(svg.contains("fd (exponent 0.95)"), "{svg}");
        assert!(super::curves(&[json!({"family": "chain", "size": 3})]).is_err());
    }
}
