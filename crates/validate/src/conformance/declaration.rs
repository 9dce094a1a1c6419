//! The declaration: counts, names, units, bounds, ranges, nominal inertias.

use super::law;
use super::report::Check;
use ff_model::port::MAX_COORDS;
use ff_model::port::MAX_PARAMS;
use ff_model::{Decl, Inertia, ParamGroup};
use std::cmp::Ordering;

/// See [`law::DECLARATION`].
pub(super) fn declaration(d: &Decl) -> Check {
    let mut faults = Vec::new();
    let (n, np) = (d.coords.len(), d.params.len());
    if d.kind.is_empty() {
        faults.push("kind is empty".into());
    }
    if n > MAX_COORDS {
        faults.push(format!("{n} coordinates, at most {MAX_COORDS}"));
    }
    if np > MAX_PARAMS {
        faults.push(format!("{np} parameters, at most {MAX_PARAMS}"));
    }
    let names: Vec<&str> = d.coords.iter().map(|c| &*c.name).chain(d.params.iter().map(|p| &*p.name)).collect();
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() || names[..i].contains(name) {
            faults.push(format!("name '{name}' is empty or used twice"));
        }
        // Patterns such as `panel.k[*]` select parameters by name.
        if name.contains(|c: char| c.is_whitespace() || c == '*') {
            faults.push(format!("name '{name}' holds a blank or a star"));
        }
    }
    for c in &d.coords {
        let (lo, hi) = c.range;
        if !matches!(c.unit, "rad" | "m") {
            faults.push(format!("{}: unit '{}' is neither rad nor m", c.name, c.unit));
        }
        // `partial_cmp` rather than `>=`, so that NaN is a fault too.
        if lo.partial_cmp(&hi) != Some(Ordering::Less) {
            faults.push(format!("{}: range {lo} to {hi} {} is empty", c.name, c.unit));
        }
    }
    for p in &d.params {
        let (lo, hi) = p.bounds;
        if !p.nominal.is_finite() || !(lo..=hi).contains(&p.nominal) {
            faults.push(format!("{}: nominal {} {} is outside {lo} to {hi}", p.name, p.nominal, p.unit));
        }
        if lo.partial_cmp(&hi) != Some(Ordering::Less) {
            faults.push(format!("{}: bounds {lo} to {hi} {} leave no room", p.name, p.unit));
        }
        if p.unit.is_empty() {
            faults.push(format!("{}: no unit; a pure number has the unit 1", p.name));
        }
        if p.group == ParamGroup::Positive && (lo < 0.0 || lo.is_nan()) {
            faults.push(format!("{}: positive, but its lower bound is {lo} {}", p.name, p.unit));
        }
    }
    let mut i = 0;
    while i < np {
        let ParamGroup::Inertial(body) = &d.params[i].group else {
            i += 1;
            continue;
        };
        let ten = &d.params[i..np.min(i + 10)];
        if ten.len() < 10 || ten.iter().any(|p| p.group != d.params[i].group) {
            faults.push(format!("{body}: inertial parameters must come as ten in a row"));
        } else {
            let phi: Vec<f64> = ten.iter().map(|p| p.nominal).collect();
            if let Err(e) = Inertia::from_params(&phi).check() {
                faults.push(format!("{body}: {e}"));
            }
        }
        i += 10;
    }
    Check::faults(law::DECLARATION, &faults)
}
