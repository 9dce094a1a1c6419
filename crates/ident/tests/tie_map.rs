//! Parameters that are functions of fewer unknowns: one stiffness for all hinges, one filling level for all of the fuel.

use ff_least_squares::EvalError;
use ff_model::Inertia;
use ff_model::ParamDecl;
use ff_testkit::assert_within;
use ident::belief::Unknown;
use ident::compose::*;
use ident::estimate::Estimator;
use nalgebra::DMatrix;
use nalgebra::Vector3;

fn decls() -> Vec<ParamDecl> {
    let body = (0..5).fold(Inertia::zero(), |mut b, k| {
        b += Inertia::point(
            1.0 + f64::from(k),
            &Vector3::new(0.3 * f64::from(k), (0.7 * f64::from(k)).sin(), 0.2 - 0.1 * f64::from(k * k)),
        );
        b
    });
    let mut d = ParamDecl::inertial("base", &body);
    for (wing, k) in [("a", 200.0), ("b", 260.0)] {
        d.push(ParamDecl::positive(format!("panel_{wing}.k[0]"), "N m/rad", k));
        d.push(ParamDecl::positive(format!("panel_{wing}.k[1]"), "N m/rad", 1.5 * k));
        d.push(ParamDecl::positive(format!("panel_{wing}.d[0]"), "N m s/rad", 0.01 * k));
    }
    d
}
fn values() -> Vec<f64> {
    decls().iter().map(|d| d.nominal).collect()
}

/// Residuals that depend on everything, and a nuisance unknown.
struct Smooth;
impl Estimator for Smooth {
    fn rows(&self) -> usize {
        40
    }
    fn nuisance(&self) -> Vec<Unknown> {
        vec![Unknown { name: "bias".into(), unit: "N m".into(), size: 0.1 }]
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        for (i, r) in r.iter_mut().enumerate() {
            let s: f64 = full.iter().enumerate().map(|(k, p)| ((i * (k + 2)) as f64 * 0.3).sin() * (0.01 * p)).sum();
            *r = s + s * s + extra[0] * (i as f64).cos();
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
    ) -> Result<(), EvalError> {
        self.residuals(full, extra, r)?;
        for i in 0..r.len() {
            let f = |k: usize| ((i * (k + 2)) as f64 * 0.3).sin() * 0.01;
            let s: f64 = full.iter().enumerate().map(|(k, p)| f(k) * p).sum();
            for (c, &k) in selected.iter().enumerate() {
                j[(i, c)] = f(k) * (1.0 + 2.0 * s);
            }
            j[(i, selected.len())] = (i as f64).cos();
        }
        Ok(())
    }
}

/// Base mass and first moment along x for consumed fuel `u`: quadratic, so that the chain rule matters.
struct Fuel {
    unknowns: Vec<ParamDecl>,
    start: [f64; 2],
}
impl Tie for Fuel {
    fn unknowns(&self) -> &[ParamDecl] {
        &self.unknowns
    }
    fn parameters(&self) -> &[usize] {
        &[0, 1]
    }
    fn evaluate(&self, u: &[f64], p: &mut [f64]) -> Result<(), EvalError> {
        if u[0] > 2.0 {
            return Err(EvalError::Rejected("the tank is empty".into()));
        }
        (p[0], p[1]) = (self.start[0] - u[0], self.start[1] - 0.3 * u[0] * u[0]);
        Ok(())
    }
    fn derivative(&self, u: &[f64], d: &mut DMatrix<f64>) -> Result<(), EvalError> {
        d.copy_from_slice(&[-1.0, -0.6 * u[0]]);
        Ok(())
    }
}
fn map() -> TieMap {
    let (d, v) = (decls(), values());
    let fuel = Fuel { unknowns: vec![ParamDecl::positive("consumed", "kg", 0.4)], start: [v[0] + 0.4, v[1] + 0.048] };
    let ties: Vec<Box<dyn Tie>> = vec![
        Box::new(
            Affine::factors(&d, &v, "k", &[("panel_a.k[0]", 1.0), ("panel_b.k[*]", 1.3), ("!panel_b.k[1]", 0.0)])
                .unwrap(),
        ),
        Box::new(fuel),
        Box::new(Affine::fixed(&d, &[("panel_b.d[0]", 2.2)]).unwrap()),
    ];
    TieMap::new(&d, &v, ties).unwrap()
}

#[test]
fn the_shorter_vector_has_what_is_free_and_the_unknowns_of_the_ties() {
    let m = map();
    let names: Vec<&str> = m.decls().iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names[..2], ["base.h_y", "base.h_z"]);
    assert_eq!(names[8..], ["panel_a.k[1]", "panel_a.d[0]", "panel_b.k[1]", "k", "consumed"]);
    let start = m.start();
    let full = m.expand(&start).unwrap();
    assert_within!((start[11] - 0.5 * (200.0 + 200.0)).abs(), 1e-12, "{start:?}");
    assert_eq!((full[10], full[13], full[15]), (200.0, 260.0, 2.2));
    assert!((full[0] - values()[0]).abs() < 1e-12 && (full[1] - values()[1]).abs() < 1e-12);
    // What is carried to the full vector: the factor of each member.
    let j = m.jacobian(&start, &[3, 11]).unwrap();
    assert_eq!((j[(5, 0)], j[(10, 1)], j[(13, 1)], j[(14, 1)]), (1.0, 1.0, 1.3, 0.0));
}

#[test]
fn derivatives_follow_the_chain_rule() {
    let mut tied = Tied::new(Smooth, map());
    let short = tied.map().start();
    for selected in [(0..short.len()).collect::<Vec<_>>(), vec![2, 11], vec![12]] {
        let n = selected.len();
        let (mut r, mut j) = (vec![0.0; 40], DMatrix::from_element(40, n + 1, f64::NAN));
        tied.jacobian(&short, &[0.3], &selected, &mut r, &mut j).unwrap();
        let mut at = |c: usize, d: f64| {
            let (mut s, mut e) = (short.clone(), 0.3);
            if c < n {
                s[selected[c]] += d
            } else {
                e += d
            }
            let mut r = vec![0.0; 40];
            tied.residuals(&s, &[e], &mut r).unwrap();
            r
        };
        for c in 0..=n {
            let (up, down) = (at(c, 1e-5), at(c, -1e-5));
            for i in 0..40 {
                let fd = (up[i] - down[i]) / 2e-5;
                assert_within!((fd - j[(i, c)]).abs(), 1e-8 * (1.0 + fd.abs()), "{i} {c}: {fd} {}", j[(i, c)]);
            }
        }
    }
}

#[test]
fn points_outside_are_rejected_and_wrong_ties_are_named() {
    let mut tied = Tied::new(Smooth, map());
    let mut short = tied.map().start();
    let mut r = vec![0.0; 40];
    short[12] = 3.0;
    let e = tied.residuals(&short, &[0.0], &mut r).unwrap_err();
    assert!(e.to_string().contains("empty"), "{e}");
    short[12] = 0.4;
    // A second moment far below what mass and first moments need.
    short[2] = 1e-3;
    assert!(tied.residuals(&short, &[0.0], &mut r).unwrap_err().to_string().contains("base"));
    let (d, v) = (decls(), values());
    let shared = |p: &[&str]| Affine::shared(&d, &v, "k", p);
    assert!(matches!(shared(&["panel_a.k[*]", "panel_*.k[0]"]), Err(TieError::Twice { .. })));
    assert!(matches!(shared(&["panel_a.*"]), Err(TieError::Units { .. })));
    assert!(matches!(shared(&["wing*"]), Err(TieError::Selection(_))));
    assert!(matches!(Affine::factors(&d, &v, "k", &[("panel_a.k[0]", f64::NAN)]), Err(TieError::Factor { .. })));
    let twice = || {
        vec![
            Box::new(shared(&["panel_a.k[0]"]).unwrap()) as Box<dyn Tie>,
            Box::new(Affine::shared(&d, &v, "q", &["panel_a.k[*]"]).unwrap()),
        ]
    };
    assert!(matches!(TieMap::new(&d, &v, twice()), Err(TieError::Twice { .. })));
    let named = Affine::shared(&d, &v, "base.mass", &["panel_a.k[*]"]).unwrap();
    assert!(matches!(TieMap::new(&d, &v, vec![Box::new(named)]), Err(TieError::Name { .. })));
}
