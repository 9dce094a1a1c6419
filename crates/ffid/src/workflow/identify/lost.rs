//! What a fit has lost on its way: parameters that have vanished or strayed, bodies at the edge of what can exist, appendages of which no spring is
//! told.

use super::ends::{WIDE, explains, given_back, is_spring, of_body, owner};
use ff_model::{Inertia, Model, ParamGroup};
use ident::estimate::{Estimate, Estimated};
use ident::parameters::is_damping;
use ident::{Request, Transform};

/// Factor on the start of a positive parameter beyond which it has strayed.
const STRAYED: f64 = 10.0;
/// Part of its start below which a stiffness, damping or mass has vanished in a valley that leads nowhere.
const VANISHED: f64 = 0.01;
/// Part of itself by which a spring or damper is hardly known.
const HARDLY: f64 = 0.5;

/// The end of a fit with what has vanished as the mission has it.
pub(super) fn given_life(request: &Request<'_>, e: &Estimate) -> Vec<f64> {
    given_back(request, e, |i| has_vanished(request, e, i))
}

/// Whether a positive parameter is gone.
pub(super) fn vanished(request: &Request<'_>, e: &Estimate) -> bool {
    request.selected.iter().any(|&i| has_vanished(request, e, i))
}

/// Whether a positive parameter is gone, or far from where the mission has it.
pub(super) fn has_lost(request: &Request<'_>, e: &Estimate) -> bool {
    !lost(request, e).0.is_empty()
}

/// Whether this parameter is one that is positive and gone.
pub(super) fn has_vanished(request: &Request<'_>, e: &Estimate, i: usize) -> bool {
    request.decls[i].group == ParamGroup::Positive && e.values[i] < VANISHED * request.start[i]
}

/// Positive parameters that are far from where the mission has them.
pub(super) fn strayed(request: &Request<'_>, e: &Estimate) -> Vec<usize> {
    let positive = |i: &usize| request.decls[*i].group == ParamGroup::Positive;
    request.selected.iter().copied().filter(|i| positive(i) && has_strayed(request, e, *i)).collect()
}

/// Whether a positive number is far from where the mission has it.
fn has_strayed(request: &Request<'_>, e: &Estimate, i: usize) -> bool {
    !(1.0 / STRAYED..STRAYED).contains(&(e.values[i] / request.start[i]))
}

/// Whether a body is at the edge of what can exist, or its mass far from where the mission has it.
pub(super) fn bodies_strayed(request: &Request<'_>, e: &Estimate) -> bool {
    let at_edge = Transform::new(request.decls, request.selected, &e.values).is_err();
    let mass = |i: &usize| of_body(request, *i) && request.decls[*i].unit == "kg";
    at_edge || request.selected.iter().filter(|i| mass(i)).any(|&i| has_strayed(request, e, i))
}

/// Whether a fit hardly tells this spring or damper.
pub(super) fn is_hardly_told(p: &Estimated) -> bool {
    p.std.is_none_or(|std| std > HARDLY * p.value)
}

/// Springs of the appendages of which the fit tells no spring: what rings is not where the data do.
fn untold(request: &Request<'_>, e: &Estimate) -> Vec<usize> {
    let spring = |&(&i, _): &(&usize, _)| is_spring(request, i);
    let springs: Vec<_> = request.selected.iter().zip(&e.parameters).filter(spring).collect();
    let owner = |i: usize| owner(&request.decls[i].name);
    let told = |of: Option<&str>| springs.iter().any(|(i, p)| owner(**i) == of && !is_hardly_told(p));
    springs.iter().map(|(i, _)| **i).filter(|&i| !told(owner(i))).collect()
}

/// The end of a fit with what has strayed as the mission has it, but springs as stiff as those of the same appendage that the fit tells, in the
/// geometric mean: a mission that has an appendage wrong has all of its springs wrong. `None` where there is no such spring.
pub(super) fn as_others_are_told(request: &Request<'_>, e: &Estimate, astray: &[usize]) -> Option<Vec<f64>> {
    let mut out = given_back(request, e, |i| astray.contains(&i));
    let mut any = false;
    for &i in astray.iter().filter(|&&i| is_spring(request, i)) {
        let decl = |i: usize| (owner(&request.decls[i].name), &request.decls[i].unit);
        let alike = |(j, p): &(usize, &Estimated)| {
            is_spring(request, *j) && decl(*j) == decl(i) && !astray.contains(j) && !is_hardly_told(p)
        };
        let told: Vec<f64> =
            request.selected.iter().copied().zip(&e.parameters).filter(alike).map(|t| t.1.value.ln()).collect();
        if !told.is_empty() {
            out[i] = (told.iter().sum::<f64>() / told.len() as f64).exp();
            any = true;
        }
    }
    any.then_some(out)
}

/// Parameters of the appendages of which one has vanished or strayed, or none is told where much is left over, and the end of the fit with all
/// of them as the mission has them. Near the record, a damper that is gone is no reason to look for springs that ring where the data do, while
/// another appendage is lost by more than that; far from it, what has strayed counts where no appendage is untold.
pub(super) fn lost(request: &Request<'_>, e: &Estimate) -> (Vec<usize>, Vec<f64>) {
    let owner = |i: usize| owner(&request.decls[i].name);
    // What has vanished has strayed.
    let strayed = strayed(request, e);
    let near = e.chi2_per_dof < WIDE * request.noise;
    let untold = if explains(e, request.noise) { Vec::new() } else { untold(request, e) };
    let by_more = strayed.iter().copied().filter(|&i| near && !is_damping(&request.decls[i])).chain(untold);
    let mut owners: Vec<_> = by_more.map(owner).collect();
    if owners.is_empty() {
        owners = strayed.into_iter().map(owner).collect();
    }
    let of: Vec<usize> = request.selected.iter().copied().filter(|&i| owners.contains(&owner(i))).collect();
    let back = given_back(request, e, |i| of.contains(&i));
    (of, back)
}

/// Takes what masses on the base have become heavier by off the base, where they are mounted: what the fit has found of the whole is right. Where
/// nothing would be left that is a body, the start stays.
pub(super) fn keep_whole(model: &Model, request: &Request<'_>, from: &[f64], start: &mut [f64]) {
    let decls = request.decls;
    let is_base = |&i: &usize| decls[i].name == "base.mass" && request.selected.contains(&(i + 9));
    let Some(base) = request.selected.iter().copied().find(is_base) else { return };
    let mut body = Inertia::from_params(&start[base..base + 10]);
    for mounted in model.appendages().iter().filter(|m| m.host == 0) {
        let mass = |i: &usize| decls[*i].unit == "kg" && owner(&decls[*i].name) == Some(mounted.name.as_str());
        let heavier: f64 = request.selected.iter().copied().filter(mass).map(|i| start[i] - from[i]).sum();
        body += Inertia::point(-heavier, &mounted.mount.pos);
    }
    if body.pseudo().cholesky().is_some() {
        start[base..base + 10].copy_from_slice(&body.to_params());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_least_squares::EvalError;
    use ff_mission::{LoadOptions, Mission};
    use ff_model::ParamDecl;
    use ident::Estimator;
    use ident::estimate::attempt;
    use ident::parameters::select;
    use nalgebra::{DMatrix, Vector3};

    /// Springs that static tests tell to a hundredth of themselves.
    struct Told([f64; 4]);
    impl Estimator for Told {
        fn rows(&self) -> usize {
            4
        }
        fn residuals(&mut self, k: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            (0..4).for_each(|i| r[i] = 100.0 * (k[i] / self.0[i]).ln());
            Ok(())
        }
        fn jacobian(
            &mut self,
            k: &[f64],
            extra: &[f64],
            _: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            j.fill(0.0);
            (0..4).for_each(|i| j[(i, i)] = 100.0 / k[i]);
            self.residuals(k, extra, r)
        }
    }

    #[test]
    fn a_spring_that_ran_away_is_as_stiff_as_those_beside_it() {
        let decls =
            ["tank.k[0]", "tank.k[1]", "tank.k[2]", "wing.k[0]"].map(|name| ParamDecl::positive(name, "N m/rad", 0.0));
        let start = [34.0, 4.3, 5.1, 560.0];
        let request = Request::new(&decls, &[0, 1, 2, 3], &start);
        let mut e = attempt(&request, &mut Told([11.0, 8.0, 18.0, 620.0])).unwrap();
        assert!(as_others_are_told(&request, &e, &strayed(&request, &e)).is_none());
        e.values[0] = 5e5;
        let astray = strayed(&request, &e);
        assert_eq!(astray, [0]);
        let found = as_others_are_told(&request, &e, &astray).unwrap();
        assert!((found[0] - 12.0).abs() < 1e-4 && found[1..] == e.values[1..], "{found:?}");
        // What is hardly told says nothing of others.
        for p in &mut e.parameters[1..3] {
            p.std = None;
        }
        assert!(as_others_are_told(&request, &e, &astray).is_none());
    }

    #[test]
    fn what_an_appendage_becomes_heavier_by_is_taken_off_the_base() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/verdict/truth.toml");
        let model = Mission::load(file.as_ref(), &crate::default_registry(), &LoadOptions::default()).unwrap().model;
        let decls = model.param_decls();
        let selected = select(&decls, &["base.*", "tank.mass", "tank.length"]).unwrap();
        let from: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
        let request = Request::new(&decls, &selected, &from);
        let tank = decls.iter().position(|d| d.name == "tank.mass").unwrap();
        let mount = model.appendages().iter().find(|a| a.name == "tank").unwrap().mount.pos;
        let heavier_by = |more: f64| {
            let mut start = from.clone();
            start[tank] += more;
            keep_whole(&model, &request, &from, &mut start);
            start
        };
        let start = heavier_by(31.0);
        let whole = |x: &[f64]| {
            let h = Vector3::new(x[1], x[2], x[3]) + mount * x[tank];
            [x[0] + x[tank], h.x, h.y, h.z]
        };
        assert!((start[0] - (from[0] - 31.0)).abs() < 1e-9 && start[tank] == from[tank] + 31.0);
        for (a, b) in whole(&start).iter().zip(whole(&from)) {
            assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
        }
        // A base of less than nothing is none.
        let start = heavier_by(2.0 * from[0]);
        assert_eq!(start[..10], from[..10]);
    }
}
