//! Deviations of springs that are hardly told from rigid joints.
//!
//! What slow motion tells of a hinge that is stiff against what moves it is its compliance `1 / k`, and of its damper `d / k^2`. A deviation
//! `s` of the stiffness is that of a parabola around the estimate, in which `k + 2 s` is as likely as `k - 2 s`; with the compliance even,
//! the end of a 95 % interval on the stiff side is at `k / (1 - 2 s/k)`. For a spring that is known to a hundredth the two are alike. One that
//! is known to a third is as likely three times as stiff as the estimate, and one that is known to a half may as well be rigid: a
//! record of three stiff hinges, which tells the sum of their compliances, was explained with the outer one 7.6 stated deviations too
//! soft. Springs known worse than [`FROM`] of themselves have deviations that reach there, and their dampers with them.

use super::valleys::Ending;
use ident::Request;
use ident::parameters::{is_damping, is_stiffness};

/// Relative deviations of a spring from which it counts that its compliance is what is told, and from which it counts in full.
const FROM: f64 = 0.1;
const FULL: f64 = 0.3;
/// Relative deviation beyond which nothing is told.
const NOT_TOLD: f64 = 0.45;

/// Makes deviations of springs and their dampers allow for compliances that are even about the estimate. Allocates where it does.
pub(super) fn allow_for_compliances(request: &Request<'_>, ending: &mut Ending) {
    let e = &ending.estimate;
    let decl = |k: usize| &request.decls[request.selected[k]];
    let factor = |k: usize| e.parameters[k].std.map_or(1.0, |std| wider_by(std / e.parameters[k].value));
    let springs = (0..request.selected.len()).filter(|&k| is_stiffness(decl(k)));
    let wider: Vec<(usize, f64)> = springs.map(|k| (k, factor(k))).filter(|(_, factor)| *factor > 1.0).collect();
    if wider.is_empty() {
        return;
    }
    let mut covariance = e.uncertainty.covariance.clone();
    for (k, factor) in wider {
        covariance.row_mut(k).scale_mut(factor);
        covariance.column_mut(k).scale_mut(factor);
        let of_damper = decl(k).name.replace(".k[", ".d[");
        let damper = (0..request.selected.len()).find(|&d| decl(d).name == of_damper && is_damping(decl(d)));
        if let (Some(d), Some(std)) = (damper, e.parameters[k].std) {
            let stiffer = 1.0 + 2.0 * factor * std / e.parameters[k].value;
            let least = (0.5 * e.parameters[d].value * (stiffer * stiffer - 1.0)).powi(2);
            covariance[(d, d)] = covariance[(d, d)].max(least);
        }
    }
    ending.widened(covariance);
}

/// Factor on the deviation of a spring that is known to this part of itself: `1 / (1 - 2 r)`, as far as that counts.
fn wider_by(relative: f64) -> f64 {
    let counts = ((relative - FROM) / (FULL - FROM)).clamp(0.0, 1.0);
    1.0 + counts * ((1.0 - 2.0 * relative.min(NOT_TOLD)).recip() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_deviations_of_the_compliance_are_within_two_of_the_stiffness() {
        assert_eq!(wider_by(0.05), 1.0);
        for relative in [0.31, 0.37, 0.44] {
            // k = 300, known to this part of itself; a compliance two deviations lower.
            let (k, std) = (300.0, 300.0 * relative);
            let stiffer = f64::recip(1.0 / k - 2.0 * std / (k * k));
            assert!((k + 2.0 * wider_by(relative) * std - stiffer).abs() < 1e-9 * stiffer, "{relative}");
        }
        let mut before = 1.0;
        for k in 0..200 {
            let now = wider_by(0.0025 * f64::from(k));
            assert!(now >= before && now < 1.2 * before, "{k}: {before} {now}");
            before = now;
        }
        assert_eq!(wider_by(40.0), wider_by(NOT_TOLD));
    }
}
