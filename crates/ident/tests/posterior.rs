//! One identification after another: what the first has learnt is what the next knows beforehand.

use approx::assert_relative_eq;
use ff_model::ParamDecl;
use ff_testkit::scaled;
use ident::belief::*;
use nalgebra::{DMatrix, DVector};

fn covariance() -> DMatrix<f64> {
    let a = DMatrix::from_fn(4, 4, |i, j| {
        [30.0, 0.2, 5.0, 1.0][i] * (((i * 5 + j * 3) as f64).sin() + if i == j { 1.6 } else { 0.0 })
    });
    &a * a.transpose()
}
fn names() -> Vec<String> {
    ["base.mass", "tank.k[0]", "base.h_x", "tank.mass"].map(String::from).to_vec()
}
fn posterior() -> Posterior {
    let units = ["kg", "N m/rad", "kg m", "kg"].map(String::from).to_vec();
    Posterior::from_covariance(names(), units, vec![600.0, 20.0, 0.0, 100.0], &covariance()).unwrap()
}
fn sub(c: &DMatrix<f64>, k: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(k.len(), k.len(), |i, j| c[(k[i], k[j])])
}

#[test]
fn marginals_are_blocks_of_the_covariance() {
    let (p, c) = (posterior(), covariance());
    assert_relative_eq!(p.covariance().unwrap().unwrap(), c, max_relative = scaled(1e-10), epsilon = scaled(1e-10));
    let m = p.marginal(&["base.*"]).unwrap();
    assert_eq!(m.names, ["base.mass", "base.h_x"]);
    assert_relative_eq!(m.covariance().unwrap().unwrap(), sub(&c, &[0, 2]), max_relative = scaled(1e-10));
    // Forgotten parameters carry no information, the others what they carried alone.
    let f = p.forget(&["tank.*"]).unwrap();
    assert_eq!((f.len(), f.rows.len()), (4, 2));
    assert!(f.covariance().unwrap().is_none());
    assert_relative_eq!(
        f.marginal(&["base.*"]).unwrap().covariance().unwrap().unwrap(),
        sub(&c, &[0, 2]),
        max_relative = scaled(1e-9)
    );
    // A random step adds its variance and leaves the covariances.
    let l = p.loosen(&["base.mass", "tank.mass"], 7.0).unwrap();
    let mut wider = c.clone();
    wider[(0, 0)] += 49.0;
    wider[(3, 3)] += 49.0;
    assert_relative_eq!(l.covariance().unwrap().unwrap(), wider, max_relative = scaled(1e-9));
    assert!(matches!(p.loosen(&["base.mass"], 0.0), Err(SequenceError::Width { .. })));
    assert!(matches!(p.marginal(&["wing"]), Err(SequenceError::Selection(_))));
}

#[test]
fn a_direction_that_is_not_known_stays_unknown_in_every_marginal() {
    // Only mass + 2 k and h_x are known.
    let mut p = posterior();
    p.rows = vec![vec![0.1, 0.2, 0.0, 0.0], vec![0.0, 0.0, 3.0, 0.0]];
    assert!(p.covariance().unwrap().is_none());
    let m = p.marginal(&["base.*"]).unwrap();
    // Nothing is left of the mass once k may be anything.
    assert_eq!(m.rows.len(), 1);
    assert!(m.rows[0][0].abs() < 1e-12 && (m.rows[0][1].abs() - 3.0).abs() < 1e-12, "{:?}", m.rows);
    let both = p.marginal(&["base.mass", "tank.k[0]"]).unwrap();
    assert_relative_eq!(
        both.information(),
        DMatrix::from_row_slice(2, 2, &[0.01, 0.02, 0.02, 0.04]),
        epsilon = scaled(1e-14)
    );
    // A step of k then blurs the sum.
    let l = p.loosen(&["tank.k[0]"], 5.0).unwrap().marginal(&["base.mass", "tank.k[0]"]).unwrap();
    assert_eq!(l.rows.len(), 1);
    let variance = 100.0 + 4.0 * 25.0;
    assert_relative_eq!(l.information()[(0, 0)], 1.0 / variance, max_relative = scaled(1e-10));
}

#[test]
fn files_give_back_every_bit_and_refuse_what_is_not_a_posterior() {
    let p = posterior();
    let text = serde_json::to_string(&p).unwrap();
    let back: Posterior = serde_json::from_str(&text).unwrap();
    assert_eq!(back, p);
    assert_eq!(serde_json::to_string(&back).unwrap(), text);
    let wrong = |f: &dyn Fn(&mut Posterior)| {
        let mut p = posterior();
        f(&mut p);
        p.checked().unwrap_err().to_string()
    };
    assert!(wrong(&|p| p.rows[2].truncate(3)).contains("row 2"));
    assert!(wrong(&|p| p.names[1] = "base.mass".into()).contains("twice"));
    assert!(wrong(&|p| p.mean[1] = f64::NAN).contains("finite"));
    assert!(wrong(&|p| p.sizes[0] = 0.0).contains("size"));
    assert!(wrong(&|p| p.units.truncate(1)).contains("units"));
    let (n, u) = (names(), vec!["kg".to_owned(); 4]);
    let mut c = covariance();
    c[(0, 0)] = -1.0;
    assert!(Posterior::from_covariance(n, u, vec![0.0; 4], &c).unwrap_err().to_string().contains("positive definite"));
}

#[test]
fn rows_of_a_fit_are_those_of_what_is_estimated_in_it() {
    let decl = |n: &str, u: &'static str| ParamDecl::positive(n, u, 1.0);
    let decls = [decl("tank.mass", "kg"), decl("other", "m"), decl("base.mass", "kg"), decl("tank.k[0]", "N m/rad")];
    let rows = posterior().rows_for(&decls, &[0, 1, 2]).unwrap();
    assert_eq!(rows.len(), 2);
    let mut j = DMatrix::from_element(4, 3, 9.0);
    // At the mean the rows are those of the marginal; elsewhere they are derivatives of the residuals.
    rows.fill_jacobian(&[100.0, 5.0, 600.0], &mut j, 1);
    let w = j.rows(1, 2).into_owned();
    assert_eq!(w.column(1).amax(), 0.0);
    // The information on (tank.mass, base.mass) is that of the marginal.
    let both = DMatrix::from_columns(&[w.column(0), w.column(2)]);
    let expected = sub(&covariance(), &[3, 0]).try_inverse().unwrap();
    assert_relative_eq!(both.transpose() * &both, expected, max_relative = scaled(1e-9));
    assert!(j.row(0).iter().all(|x| *x == 9.0) && j.row(3).iter().all(|x| *x == 9.0));
    let p = [100.0 + 3e-6, 5.0, 600.0 - 1e-5];
    let mut r = vec![1.5];
    rows.push_residuals(&p, &mut r);
    let d = DVector::from_column_slice(&[3e-6, 5.0, -1e-5]);
    assert_relative_eq!(DVector::from_column_slice(&r[1..]), &w * d, max_relative = scaled(1e-6));
    assert!(matches!(posterior().rows_for(&decls, &[1]), Err(SequenceError::Disjoint { .. })));
    let other = [decl("tank.mass", "m")];
    assert!(matches!(posterior().rows_for(&other, &[0]), Err(SequenceError::Unit { .. })));
}

#[test]
fn what_a_grasp_has_added_carries_both_uncertainties() {
    let before = posterior();
    let mut after = posterior();
    after.mean = vec![640.0, 20.0, 25.0, 100.0];
    let c = change(&before, &after, &["base.h_x", "base.mass"], |n| n.replace("base", "payload")).unwrap();
    assert_eq!((c.names[1].as_str(), c.mean[1], c.mean[0]), ("payload.mass", 40.0, 25.0));
    assert_relative_eq!(
        c.covariance().unwrap().unwrap(),
        sub(&covariance(), &[2, 0]) * 2.0,
        max_relative = scaled(1e-9)
    );
    assert!(change(&before, &after, &["wing.mass"], str::to_owned).is_err());
    let blind = after.forget(&["base.mass"]).unwrap();
    assert!(change(&before, &blind, &["base.mass"], str::to_owned).unwrap_err().to_string().contains("after"));
}

/// Linear residuals `A p - y` of unit noise, with one bias.
struct Linear {
    a: DMatrix<f64>,
    y: Vec<f64>,
}

impl ident::estimate::Estimator for Linear {
    fn rows(&self) -> usize {
        self.y.len()
    }
    fn residuals(&mut self, full: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), ff_least_squares::EvalError> {
        for (i, r) in r.iter_mut().enumerate() {
            *r = full.iter().enumerate().map(|(k, p)| self.a[(i, k)] * p).sum::<f64>() - self.y[i];
        }
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), ff_least_squares::EvalError> {
        self.residuals(full, extra, r)?;
        selected.iter().enumerate().for_each(|(c, &i)| j.set_column(c, &self.a.column(i)));
        Ok(())
    }
}

#[test]
fn one_record_after_the_other_is_both_at_once() {
    use crate::common::estimate;
    use ident::belief::{Priors, Sigma};
    use ident::estimate::Request;
    let decls: Vec<ParamDecl> = [("tank.mass", "kg"), ("k", "N m/rad"), ("d", "N m s/rad")]
        .map(|(n, u)| ParamDecl::positive(n, u, 3.0))
        .to_vec();
    let a = DMatrix::from_fn(40, 3, |i, k| ((0.37 * (k + 1) as f64) * i as f64 + 0.2).sin() + 0.4);
    let y: Vec<f64> =
        (0..40).map(|i| 2.0 * a[(i, 0)] + 4.0 * a[(i, 1)] + a[(i, 2)] + 0.3 * (2.9 * i as f64).sin()).collect();
    let part = |from: usize, n: usize| Linear { a: a.rows(from, n).into_owned(), y: y[from..from + n].to_vec() };
    let (all, start) = ([0, 1, 2], [3.0; 3]);
    let cad = Priors::new(&decls, &all, &start, &[("d", Sigma::Relative(0.5))]).unwrap();
    let first = Request { priors: cad.clone(), ..Request::new(&decls, &all, &start) };
    let first = estimate(&first, &mut part(0, 15)).unwrap();
    let known = Posterior::of(&first).unwrap().rows_for(&decls, &all).unwrap();
    let second = Request { priors: Priors::default().and(known), ..Request::new(&decls, &all, &start) };
    let second = estimate(&second, &mut part(15, 25)).unwrap();
    let both = estimate(&Request { priors: cad, ..Request::new(&decls, &all, &start) }, &mut part(0, 40)).unwrap();
    for (s, b) in second.parameters.iter().zip(&both.parameters) {
        assert_relative_eq!(s.value, b.value, max_relative = scaled(1e-9));
        assert_relative_eq!(s.std.unwrap(), b.std.unwrap(), max_relative = scaled(1e-8));
    }
    assert!(first.parameters[0].std.unwrap() > 1.2 * both.parameters[0].std.unwrap());
}

/// Torques `(1 + gain) A p` of unit noise: the same for all `p` times a factor and the gain over it.
struct Gained {
    a: DMatrix<f64>,
    y: Vec<f64>,
}

impl Gained {
    /// Of 60 samples with noise of their own, at a gain of 1 %.
    fn record(number: usize, p: &[f64; 5]) -> Self {
        let at = |i: usize, k: usize| 0.31 * (k + 1) as f64 * (i + 60 * number) as f64 + 0.7 * number as f64;
        let a = DMatrix::from_fn(60, 5, |i, k| [40.0, 900.0, 2e3, 8e3, 3e3][k] * (at(i, k).sin() + 0.3));
        // Uniform over twelve times a variance of one.
        let noise = |i: usize| ((12.9898 * (i + 1 + 60 * number) as f64).sin() * 43_758.545_3).rem_euclid(1.0) - 0.5;
        let y = (0..60).map(|i| 1.01 * (0..5).map(|k| a[(i, k)] * p[k]).sum::<f64>() + noise(i) * 12.0_f64.sqrt());
        let y = y.collect();
        Self { a, y }
    }
}

impl ident::estimate::Estimator for Gained {
    fn rows(&self) -> usize {
        self.y.len()
    }
    fn residuals(&mut self, full: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), ff_least_squares::EvalError> {
        for (i, r) in r.iter_mut().enumerate() {
            *r = (1.0 + full[5]) * (0..5).map(|k| self.a[(i, k)] * full[k]).sum::<f64>() - self.y[i];
        }
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), ff_least_squares::EvalError> {
        self.residuals(full, extra, r)?;
        for (c, &k) in selected.iter().enumerate() {
            for i in 0..self.y.len() {
                j[(i, c)] = if k < 5 { (1.0 + full[5]) * self.a[(i, k)] } else { (r[i] + self.y[i]) / (1.0 + full[5]) };
            }
        }
        Ok(())
    }
}

#[test]
fn a_gain_that_no_record_determines_stays_as_uncertain_through_five_posteriors() {
    use ff_model::ParamGroup;
    use ident::belief::{PriorRow, Priors};
    use ident::estimate::Request;
    const GAIN: f64 = 0.013;
    let truth = [612.0, -37.0, 4.0, 21.0, 1.7];
    let units = [("base.mass", "kg"), ("base.h_x", "kg m"), ("base.i_xy", "kg m^2"), ("tank.k", "N m/rad")];
    let mut decls: Vec<ParamDecl> = units.iter().zip(truth).map(|(d, v)| ParamDecl::positive(d.0, d.1, v)).collect();
    for d in &mut decls[1..3] {
        (d.group, d.bounds) = (ParamGroup::Free, (f64::NEG_INFINITY, f64::INFINITY));
    }
    decls.push(ParamDecl::positive("tank.d", "N m s/rad", truth[4]));
    let bounds = (-5.0 * GAIN, 5.0 * GAIN);
    let gain = ParamDecl { bounds, group: ParamGroup::Free, ..ParamDecl::positive("torque.gain", "1", 0.0) };
    decls.push(gain);
    let selected = [0, 1, 2, 3, 4, 5];
    let start = [600.0, -30.0, 3.0, 20.0, 2.0, 0.0];
    let prior = Priors::default().with(PriorRow { column: 5, mean: 0.0, sigma: GAIN });
    let mut priors = prior.clone();
    let mut from = start;
    for number in 0..5 {
        let request = Request { priors: priors.clone(), ..Request::new(&decls, &selected, &from) };
        let e = crate::common::estimate(&request, &mut Gained::record(number, &truth)).unwrap();
        let std = |k: usize| e.parameters[k].std.unwrap();
        assert!((std(5) / GAIN - 1.0).abs() < 0.01, "after {} records: {}", number + 1, std(5));
        let relative = std(0) / e.parameters[0].value;
        assert!((relative * (1.0 + e.parameters[5].value) / std(5) - 1.0).abs() < 0.01, "{relative} {}", std(5));
        // What the records do tell: they share one value of the product.
        let product = (1.0 + e.parameters[5].value) * e.parameters[0].value;
        assert!((product / (1.01 * truth[0]) - 1.0).abs() < 1e-4, "{product}");
        assert!(e.parameters[5].value.abs() < 0.1 * GAIN, "no record tells the gain: {}", e.parameters[5].value);
        priors = Priors::default().and(Posterior::of(&e).unwrap().rows_for(&decls, &selected).unwrap());
        from.copy_from_slice(&e.values);
    }
}

#[test]
fn rows_in_coordinates_of_scale_have_derivatives_everywhere_and_do_not_feel_a_common_factor() {
    use ff_model::ParamGroup;
    let free = |n: &str, unit: &'static str| ParamDecl {
        group: ParamGroup::Free,
        bounds: (f64::NEG_INFINITY, f64::INFINITY),
        ..ParamDecl::positive(n, unit, 1.0)
    };
    let decls = [
        ParamDecl::positive("base.mass", "kg", 1.0),
        free("base.h_x", "kg m"),
        ParamDecl::positive("tank.k[0]", "N m/rad", 1.0),
        free("torque.gain", "1"),
        free("tank.angle", "rad"),
    ];
    let names = decls.iter().map(|d| d.name.clone()).collect::<Vec<_>>();
    let units = decls.iter().map(|d| d.unit.to_owned()).collect::<Vec<_>>();
    let mean = vec![600.0, -31.0, 20.0, 0.02, 0.1];
    let along = [600.0, -31.0, 20.0, -1.02, 0.0];
    // Rows that cost nothing in the direction of a common factor.
    let rows = (0..4).map(|i| {
        let row: Vec<f64> = (0..5).map(|k| ((i * 5 + k * 3 + 1) as f64).sin() * 4e3 / mean[k]).collect();
        let off = row.iter().zip(along).map(|(w, d)| w * d).sum::<f64>() / along[3];
        row.iter().enumerate().map(|(k, w)| if k == 3 { w - off } else { *w }).collect()
    });
    let sizes = mean.iter().map(|m| m.abs()).collect();
    let p = Posterior { names, units, sizes, mean: mean.clone(), rows: rows.collect() }.checked().unwrap();
    let rows = p.rows_for(&decls, &[0, 1, 2, 3, 4]).unwrap();
    let at = |p: &[f64]| {
        let mut r = vec![];
        rows.push_residuals(p, &mut r);
        DVector::from_vec(r)
    };
    for s in [0.5, 1.03, 1.7] {
        let p: Vec<f64> = (0..5).map(|k| [mean[k] * s, 1.02 / s - 1.0, 0.1][[0, 0, 0, 1, 2][k]]).collect();
        assert!(at(&p).amax() < 1e-8, "{s}: {}", at(&p));
    }
    // Also where a mass is far below its mean, or negative.
    for p in [[640.0, 12.0, 17.0, -0.1, 0.3], [20.0, 12.0, -3.0, 0.1, 0.3]] {
        let mut j = DMatrix::from_element(rows.len(), 5, 9.0);
        rows.fill_jacobian(&p, &mut j, 0);
        for k in 0..5 {
            let h = 1e-6 * mean[k].abs();
            let (mut up, mut down) = (p, p);
            (up[k], down[k]) = (p[k] + h, p[k] - h);
            let d = (at(&up) - at(&down)) / (2.0 * h);
            assert_relative_eq!(
                d,
                j.column(k).into_owned(),
                max_relative = scaled(1e-5),
                epsilon = scaled(1e-6) * d.amax()
            );
        }
    }
}
