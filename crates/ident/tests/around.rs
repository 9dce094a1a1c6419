//! All data near the end of a fit, by fewer of their rows.

use crate::common::estimate;
use crate::common::*;
use ff_dynamics::{Drive, SimOptions, State, simulate};
use ff_least_squares::Settings;
use ff_model::Params;
use ff_records::{Record, RecordBuilder};
use ff_testkit::assert_within;
use ident::belief::Sigma;
use ident::estimate::{Around, Direction, Estimate, Steps};
use ident::parameters::offset_start;
use ident::parameters::select;
use ident::uncertain::ErrorSource;
use ident::*;
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };

/// Readings with noise.
fn noisy(l: &ff_mission::Loaded, of: &Record, seed: u64) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut with = |m: &DMatrix<f64>, sigma: f64| {
        m.map(|x| {
            let e: f64 = StandardNormal.sample(&mut rng);
            x + sigma * e
        })
    };
    let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 100.0).q(of.q().clone());
    let b = b.tau(with(of.tau(), NOISE.torque)).gyro(with(of.gyro(), NOISE.gyro));
    b.qd(of.qd().unwrap().clone()).qdd(of.qdd().unwrap().clone()).build().unwrap().0
}

fn squares(r: &[f64]) -> f64 {
    r.iter().map(|r| r * r).sum()
}

#[test]
fn the_cost_near_the_end_of_a_fit_is_that_of_all_rows() {
    let l = paper("flex.toml");
    let record = noisy(&l, &exact(&l, &run(&l, &planned(&l, 30.0, 10), 30.0)), 5);
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "panel_*.k[*]", "panel_*.d[*]"]).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.05, 7);
    let options = Options { substeps: 1, gyro_bias: true, torque_bias: true, ..Options::new(NOISE) };
    let mut all = OutputError::new(&l.model, &record, &options).unwrap();
    let settings = Settings { decrement_tolerance: 1e-12, cost_floor: 1e-13, ..Settings::default() };
    let request = Request { settings, ..Request::new(&decls, &selected, &start) };
    let e = estimate(&request, &mut all).unwrap();
    let masses = |i: usize| decls[i].name == "base.mass";
    let other = OutputError::new(&l.model, &record, &options).unwrap();
    let near = Around::new(&request, &e, other.coarse(&e.values).unwrap(), masses).unwrap().unwrap();
    assert!(3 * near.rows() <= all.rows(), "{} of {}", near.rows(), all.rows());
    // What it knows of the end serves the next look around it, and none around another end or with other columns that stay.
    let known = || std::sync::Arc::clone(near.centred());
    let fewer = || other.coarse(&e.values).unwrap();
    let moved = Estimate { values: e.values.iter().map(|x| 1.01 * x).collect(), ..e.clone() };
    assert!(Around::again(&request, &moved, fewer(), masses, known()).is_none());
    assert!(Around::again(&request, &e, fewer(), |_| false, known()).is_none());
    let again = Around::again(&request, &e, fewer(), masses, known()).unwrap();
    let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
    // At the end itself columns are at hand, next to it they are made.
    let columns = |mut near: Around<'_>, by: f64| {
        let mut at = e.values.clone();
        at[selected[12]] *= by;
        let (mut r, mut j) = (vec![0.0; near.rows()], DMatrix::zeros(near.rows(), selected.len() + extra.len()));
        near.jacobian(&at, &extra, &selected, &mut r, &mut j).unwrap();
        (DVector::from_vec(r), j)
    };
    let fresh = || Around::new(&request, &e, fewer(), masses).unwrap().unwrap();
    let (there, beside) = (columns(again, 1.0), columns(fresh(), 1.0 + 1e-9));
    assert_within!((&there.0 - &beside.0).norm(), 1e-3 * there.0.norm());
    assert_within!((&there.1 - &beside.1).norm(), 1e-5 * there.1.norm());
    like_all_rows(&request, &e, &mut all, near);
}

/// Steps are as long as tell of every direction what all rows do, and finer ones predict where modes are too fast for them.
#[test]
fn steps_are_as_long_as_the_data_allow() {
    let l = paper("flex.toml");
    let decls = l.model.param_decls();
    let mut truth = Params::<f64>::nominal(&l.model).values().to_vec();
    // Outer hinges so stiff that they hardly ring.
    let outer = select(&decls, &["panel_*.k[1]"]).unwrap();
    outer.iter().for_each(|&i| truth[i] *= 60.0);
    let (p, o) =
        (Params::from_values(&l.model, truth.clone()), SimOptions { duration_s: 30.0, step_s: 1e-3, sample_s: 0.01 });
    let motion = planned(&l, 30.0, 10);
    let trace = simulate(&l.model, &p, &State::zero(&l.model), &Drive::Prescribed(&motion), &o).unwrap();
    let record = noisy(&l, &exact(&l, &trace), 5);
    let selected = select(&decls, &["base.*", "panel_*.k[0]", "panel_*.d[0]"]).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.05, 7);
    let options = Options { substeps: 1, gyro_bias: true, torque_bias: true, ..Options::new(NOISE) };
    let new = || OutputError::new(&l.model, &record, &options).unwrap();
    let (mut all, other) = (new(), new());
    let settings = Settings { decrement_tolerance: 1e-12, cost_floor: 1e-13, ..Settings::default() };
    let request = Request { settings, ..Request::new(&decls, &selected, &start) };
    let e = estimate(&request, &mut all).unwrap();
    let (near, steps) = Around::thinnest(&request, &e, &other, |_| false).unwrap().unwrap();
    let followed = other.coarse(&e.values).map_or(all.rows(), |coarse| coarse.estimator.rows());
    assert!(3 * near.rows() < followed, "{} of {followed}", near.rows());
    let known = || std::sync::Arc::clone(near.centred());
    let again = |e: &Estimate| Around::stepped_again(&request, e, (&other, steps), |_| false, known());
    assert_eq!(again(&e).unwrap().rows(), near.rows());
    let moved = Estimate { values: e.values.iter().map(|x| 1.01 * x).collect(), ..e.clone() };
    assert!(again(&moved).is_none());
    // Springs so stiff that the long steps predict nothing: what the finer ones do is what all rows do.
    let inner = *selected.iter().find(|&&i| decls[i].name.contains(".k[")).unwrap();
    let stiff = |by: f64| {
        let mut at = e.values.clone();
        outer.iter().for_each(|&i| at[i] *= by);
        at[inner] *= 1.02;
        at
    };
    let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
    let places = [stiff(8.5), stiff(1.02), stiff(6.5)];
    let mut near = again(&e).unwrap();
    let long = other.stepped(&e.values, Steps { per_period: steps, each_in: 1 }).unwrap();
    let (mut long, mut s) = (long.estimator, vec![0.0; near.rows()]);
    let told = places.each_ref().map(|at| long.residuals(at, &extra, &mut s).is_ok());
    assert_eq!(told, [false, true, false]);
    let at = places.each_ref().map(|at| (&at[..], &extra[..]));
    let mut rows = vec![vec![0.0; near.rows()]; 3];
    let mut to: Vec<&mut [f64]> = rows.iter_mut().map(|r| &mut r[..]).collect();
    assert!(near.residuals_at(&at, &mut to).iter().all(Result::is_ok));
    for (at, side_by_side) in places.iter().zip(&rows) {
        let mut r = vec![0.0; all.rows()];
        all.residuals(at, &extra, &mut r).unwrap();
        let (rise, thin) = (squares(&r) - e.objective, squares(side_by_side) + near.centred().beyond - e.objective);
        assert!(rise > 20.0);
        assert_within!((rise - thin).abs(), 0.02 * rise + 0.1, "{rise} {thin}");
        near.residuals(at, &extra, &mut s).unwrap();
        assert_within!(squares(&s) - squares(side_by_side), 1e-9 * squares(&s));
    }
    like_all_rows(&request, &e, &mut all, again(&e).unwrap());
}

/// The cost of fewer rows is that of all of them, and a fit on it ends where theirs does.
fn like_all_rows(request: &Request<'_>, e: &Estimate, all: &mut OutputError<'_>, mut near: Around<'_>) {
    let (decls, selected) = (request.decls, request.selected);
    let beyond = near.centred().beyond;
    let mut cost = |at: &[f64], extra: &[f64]| {
        let (mut r, mut s) = (vec![0.0; all.rows()], vec![0.0; near.rows()]);
        all.residuals(at, extra, &mut r).unwrap();
        near.residuals(at, extra, &mut s).unwrap();
        [squares(&r) - e.objective, squares(&s) + beyond - e.objective]
    };
    let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
    // At the end itself nothing has risen but by the correction of the slope.
    let [_, there] = cost(&e.values, &extra);
    assert_within!(there.abs(), 1e-6 * e.objective);
    // Draws of the posterior: a rise of some tens.
    let (n, root) = (selected.len(), e.uncertainty.covariance.clone().cholesky().unwrap().l());
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut rises = Vec::new();
    for _ in 0..6 {
        let z = DVector::from_fn(root.nrows(), |_, _| StandardNormal.sample(&mut rng));
        let step = &root * &z;
        let mut at = e.values.clone();
        selected.iter().zip(step.iter()).for_each(|(&i, x)| at[i] += x);
        let moved: Vec<f64> = extra.iter().zip(step.iter().skip(n)).map(|(e, x)| e + x).collect();
        let [rise, thin] = cost(&at, &moved);
        assert_within!((rise - thin).abs(), 0.02 * rise + 0.1, "{rise} {thin}");
        rises.push(rise);
    }
    assert!(rises.iter().all(|r| *r > 5.0), "{rises:?}");
    // A spring so far off that its mode has moved by a line: no parabola, and what noise says there counts.
    let spring = *selected.iter().find(|&&i| decls[i].name.contains(".k[")).unwrap();
    for by in [0.9, 1.15] {
        let mut at = e.values.clone();
        at[spring] *= by;
        let [rise, thin] = cost(&at, &extra);
        assert!(rise > 100.0);
        assert_within!((rise - thin).abs(), 0.02 * rise, "{rise} {thin}");
    }
    // A fit on it ends where that of all rows does.
    let request = Request { coarse: false, ..request.clone() };
    let f = estimate(&request, &mut near).unwrap();
    for (a, b) in e.parameters.iter().zip(&f.parameters) {
        assert_within!((a.value - b.value).abs(), 0.05 * a.std.unwrap(), "{}", a.name);
        assert_within!((b.std.unwrap() / a.std.unwrap() - 1.0).abs(), 0.05, "{}", a.name);
    }
}

/// The last steps go over fewer rows, and what is not asked for keeps its columns; all rows say where the end is.
#[test]
#[ignore = "full tier: 3 s"]
fn the_last_steps_over_fewer_rows_end_where_all_rows_do() {
    let l = paper("flex.toml");
    let record = noisy(&l, &exact(&l, &run(&l, &planned(&l, 30.0, 10), 30.0)), 5);
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "panel_*.k[*]", "panel_*.d[0]", "panel_*.seg[*].mass"]).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.1, 7);
    let options = Options { substeps: 1, gyro_bias: true, torque_bias: true, ..Options::new(NOISE) };
    let mut all = OutputError::new(&l.model, &record, &options).unwrap();
    let masses = "panel_*.seg[*].mass";
    let priors = Priors::new(&decls, &selected, &truth, &[(masses, Sigma::Relative(0.05))]).unwrap();
    let marginal: Vec<(usize, f64)> = priors.rows().iter().map(|r| (selected[r.column], r.sigma)).collect();
    let settings = Settings { gain_tolerance: 1e-3, decrement_tolerance: 1e-12, ..Settings::default() };
    let request = Request { settings, coarse: false, priors, marginal, ..Request::new(&decls, &selected, &start) };
    let mut of = |coarse: bool, near_end: bool| {
        let found = estimate(&Request { coarse, near_end, ..request.clone() }, &mut all);
        found.unwrap_or_else(|e| panic!("{coarse} {near_end}: {:.300}", e.to_string()))
    };
    let (whole, fewer) = (of(false, false), of(false, true));
    let over = |e: &ident::estimate::Estimate, every: bool| {
        e.descent.iter().filter(|l| (l.residuals == e.residuals.len()) == every).count()
    };
    assert!(over(&fewer, false) > 0 && over(&whole, false) == 0, "{} {}", over(&fewer, false), over(&whole, false));
    assert!(over(&fewer, true) <= over(&whole, true), "{} {}", over(&fewer, true), over(&whole, true));
    assert_within!(fewer.objective - whole.objective, 0.01);
    // From where less data lead, fewer rows with the cost of all of them lead on, so that all begin at their end.
    let (led, landed) = (of(true, false), of(true, true));
    assert!(over(&landed, true) < over(&led, true), "{} {}", over(&landed, true), over(&led, true));
    assert_within!(landed.objective - whole.objective, 0.01);
    for (a, b) in whole.parameters.iter().zip(&fewer.parameters) {
        assert_within!((a.value - b.value).abs(), 0.1 * a.std.unwrap(), "{}", a.name);
        assert_within!((b.std.unwrap() / a.std.unwrap() - 1.0).abs(), 0.02, "{}", a.name);
    }
}

#[test]
fn columns_of_some_nuisance_unknowns_are_those_of_all() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 12.0, 8), 12.0));
    let decls = l.model.param_decls();
    let mut errors = vec![ErrorSource::TorqueGain(None), ErrorSource::TorqueGain(Some(2))];
    errors.extend((0..3).map(ErrorSource::GyroRotation));
    errors.extend([ErrorSource::Force(1), ErrorSource::Moment(2)]);
    let placed = l.model.kinematic_params();
    let kinematics = [3, 8, 1].map(|k: usize| placed[k].name.clone()).to_vec();
    let with = |torque_delay: bool| {
        let options =
            Options { gyro_bias: true, torque_bias: true, initial_state: true, torque_delay, ..Options::new(NOISE) };
        let options = Options { substeps: 1, errors: errors.clone(), kinematics: kinematics.clone(), ..options };
        OutputError::new(&l.model, &record, &options).unwrap()
    };
    for torque_delay in [false, true] {
        let mut oe = with(torque_delay);
        let n = oe.nuisance().len();
        let full = offset_start(&decls, Params::<f64>::nominal(&l.model).values(), &[0, 2], 0.1, 4);
        let extra: Vec<f64> = oe.nuisance().iter().enumerate().map(|(k, u)| u.size * 0.01 * (k as f64 - 3.7)).collect();
        let (mut r, mut all) = (vec![0.0; oe.rows()], DMatrix::zeros(oe.rows(), 1 + n));
        oe.jacobian(&full, &extra, &[4], &mut r, &mut all).unwrap();
        assert!(all.column_iter().all(|c| c.norm() > 0.0));
        let some: Vec<usize> = (0..n).filter(|k| k % 3 == 1).rev().collect();
        let mut along: Vec<Direction> = some.iter().map(|k| Direction::of(full.len() + k)).collect();
        along.insert(2, Direction::of(4));
        let mut few = DMatrix::from_element(oe.rows(), along.len(), f64::NAN);
        oe.jacobian_along(&full, &extra, &along, &mut r, &mut few).unwrap();
        let mut columns: Vec<usize> = some.iter().map(|k| 1 + k).collect();
        columns.insert(2, 0);
        for (c, &of) in columns.iter().enumerate() {
            let apart = (few.column(c) - all.column(of)).norm();
            assert_within!(apart, 1e-12 * all.column(of).norm(), "column {of}, {torque_delay}");
        }
    }
}
