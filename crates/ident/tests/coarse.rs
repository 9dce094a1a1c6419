//! The look at less data that a fit takes first.

use crate::common::estimate;
use crate::common::*;
use ff_least_squares::Settings;
use ff_model::Params;
use ff_records::Mask;
use ff_testkit::assert_within;
use ident::Several;
use ident::compose::Masked;
use ident::compose::Shared;
use ident::compose::{Affine, TieMap};
use ident::estimate::FINEST;
use ident::parameters::offset_start;
use ident::parameters::select;
use ident::*;
use ident::{Tie, Tied};
use nalgebra::DMatrix;

const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Residuals of less data are those of the rows of all data that it says, but for the longer steps of the integration.
fn agree(what: &str, e: &mut dyn Estimator, full: &[f64]) {
    let mut all = vec![0.0; e.rows()];
    e.residuals(full, &[], &mut all).unwrap();
    let mut thin = e.coarse(full).unwrap();
    let mut some = vec![0.0; thin.estimator.rows()];
    thin.estimator.residuals(full, &[], &mut some).unwrap();
    let picked: Vec<f64> = thin.rows.iter().map(|&i| all[i]).collect();
    let apart: Vec<f64> = picked.iter().zip(&some).map(|(a, b)| a - b).collect();
    assert!(2 * some.len() <= all.len(), "{what}: {} of {} rows", some.len(), all.len());
    assert!(norm(&apart) < 0.1 * norm(&picked), "{what}: {:e} of {:e}", norm(&apart), norm(&picked));
}

/// Residuals at several places at once are those at each, to the rounding of the lanes.
fn side_by_side(what: &str, e: &mut dyn Estimator, places: &[Vec<f64>]) {
    let at: Vec<_> = places.iter().map(|full| (&full[..], &[][..])).collect();
    let mut all = vec![vec![0.0; e.rows()]; places.len()];
    let mut to: Vec<&mut [f64]> = all.iter_mut().map(|r| &mut r[..]).collect();
    assert!(e.residuals_at(&at, &mut to).iter().all(Result::is_ok), "{what}");
    for (full, r) in places.iter().zip(&all) {
        let mut one = vec![0.0; r.len()];
        e.residuals(full, &[], &mut one).unwrap();
        let apart: Vec<f64> = r.iter().zip(&one).map(|(a, b)| a - b).collect();
        assert_within!(norm(&apart), 1e-7 * norm(&one), "{what}");
    }
}

#[test]
fn places_side_by_side_are_those_one_by_one() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 12.0, 10), 12.0));
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let of = |names: &[&str], n: u64| -> Vec<Vec<f64>> {
        let selected = select(&decls, names).unwrap();
        (0..n).map(|k| offset_start(&decls, &truth, &selected, 0.1, 3 + k)).collect()
    };
    let options = Options { substeps: 1, ..Options::new(NOISE) };
    let oe = || OutputError::new(&l.model, &record, &options).unwrap();
    let (base, links) = (["base.mass", "panel_*.k[*]"], ["base.mass", "link3.mass"]);
    side_by_side("one table", &mut oe(), &of(&base, 5));
    side_by_side("a table each", &mut oe(), &of(&links, 3));
    let mut mask = Mask::all(record.samples(), l.model.nj());
    mask.tau.row_mut(40).fill(0.0);
    side_by_side("mask", &mut Masked::new(oe(), &mask).unwrap(), &of(&base, 3));
    let shared = Shared::new(&[("one", &decls[..]), ("two", &decls[..])], &["base.mass"]).unwrap();
    let both: Vec<Vec<f64>> = of(&base, 4).into_iter().map(|v| shared.gather(&[v, truth.clone()])).collect();
    side_by_side("records", &mut Several::new(&shared, vec![Box::new(oe()), Box::new(oe())]), &both);
    // What goes wrong with one place is its own.
    let mut places = of(&base, 3);
    // So stiff that no step follows it.
    select(&decls, &["panel_*.k[*]"]).unwrap().iter().for_each(|&i| places[1][i] *= 1e9);
    let at: Vec<_> = places.iter().map(|full| (&full[..], &[][..])).collect();
    let mut e = oe();
    let mut all = vec![vec![0.0; e.rows()]; 3];
    let mut to: Vec<&mut [f64]> = all.iter_mut().map(|r| &mut r[..]).collect();
    let done = e.residuals_at(&at, &mut to);
    assert!(done[0].is_ok() && done[1].is_err() && done[2].is_ok());
    assert!(all[0].iter().chain(&all[2]).all(|r| r.is_finite()));
}

/// Steps of the integration are as many as the data ask for: at the start, and where springs are ten times stiffer.
#[test]
#[ignore = "full tier: 3 s"]
fn steps_follow_the_data() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 30.0, 10), 30.0)).thinned(10).unwrap();
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    // Under so much noise the record speaks against none of the springs.
    let loud = Noise { torque: 1e3 * NOISE.torque, gyro: 1e3 * NOISE.gyro };
    let under = |noise: &Noise, substeps: usize, limit: f64| {
        let options = Options { substeps, step_error: Some(limit), ..Options::new(*noise) };
        OutputError::new(&l.model, &record, &options).unwrap()
    };
    let of = |substeps: usize, limit: f64| under(&loud, substeps, limit);
    let error = |steps: usize| of(steps, 1.0).integration_error(&truth, &[]).unwrap();
    // A method of fourth order, and the error is what steps of a tenth of the length say that it is.
    let (coarse, fine) = (error(2), error(4));
    assert!((12.0..22.0).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
    let residuals = |steps: usize| {
        let mut r = vec![0.0; record.samples() * (l.model.nj() + 3)];
        of(steps, 1.0).residuals(&truth, &[], &mut r).unwrap();
        r
    };
    let (a, b) = (residuals(2), residuals(20));
    let apart: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
    assert_within!((coarse / norm(&apart) - 1.0).abs(), 0.1, "{coarse:e} {:e}", norm(&apart));
    let limit = 0.3 * fine;
    let mut suited = of(40, limit).suited(&truth).unwrap();
    let steps = suited.steps();
    assert!((5..12).contains(&steps), "{steps}");
    assert!(suited.integration_error(&truth, &[]).unwrap() < limit);
    assert!(!suited.refine(&truth, &[], FINEST).unwrap());
    let mut stiff = truth.clone();
    select(&decls, &["panel_*.k[*]"]).unwrap().iter().for_each(|&i| stiff[i] *= 10.0);
    assert!(suited.refine(&stiff, &[], FINEST).unwrap() && suited.steps() > steps, "{}", suited.steps());
    assert!(suited.integration_error(&stiff, &[]).unwrap() < 2.0 * limit);
    // Where the record speaks against them, they need be no finer than what is left.
    let mut far = under(&NOISE, steps, 1e3 * limit);
    let mut r = vec![0.0; record.samples() * (l.model.nj() + 3)];
    far.residuals(&stiff, &[], &mut r).unwrap();
    far.refine(&stiff, &[], FINEST).unwrap();
    assert!(far.steps() < suited.steps(), "{} {}", far.steps(), suited.steps());
    let off = far.integration_error(&stiff, &[]).unwrap();
    assert!((2e3 * limit..2e-3 * norm(&r)).contains(&off), "{off:e} {:e} {limit:e}", norm(&r));
    // So stiff that in the steps of the truth nothing is predicted at all, and so that no step follows.
    let mut stiffer = truth.clone();
    select(&decls, &["panel_*.k[*]"]).unwrap().iter().for_each(|&i| stiffer[i] *= 1e4);
    let mut few = of(1, limit);
    assert!(few.integration_error(&stiffer, &[]).is_err());
    assert!(few.refine(&stiffer, &[], 2).is_err() && few.steps() == 1, "more than twice the work");
    assert!(few.refine(&stiffer, &[], FINEST).unwrap());
    // The first steps that predict anything are too long for the fourth order to hold.
    let more = (0..3).take_while(|_| few.refine(&stiffer, &[], FINEST).unwrap()).count();
    assert!(more < 3, "{} steps", few.steps());
    assert!(few.integration_error(&stiffer, &[]).unwrap() < 2.0 * limit, "{} steps", few.steps());
    let mut never = of(1, limit);
    select(&decls, &["panel_*.k[*]"]).unwrap().iter().for_each(|&i| stiffer[i] *= 1e12);
    assert!(never.refine(&stiffer, &[], FINEST).is_err() && never.steps() == 1);
    // Without a limit they stay as they are.
    let mut fixed = OutputError::new(&l.model, &record, &Options { substeps: 1, ..Options::new(NOISE) }).unwrap();
    assert!(!fixed.refine(&stiff, &[], FINEST).unwrap() && fixed.steps() == 1);
}

#[test]
fn rows_of_less_data_are_rows_of_all_through_masks_ties_and_several_records() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 30.0, 10), 30.0));
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let springs = select(&decls, &["base.mass", "panel_*.k[*]"]).unwrap();
    let values = offset_start(&decls, &truth, &springs, 0.1, 3);
    let options = Options { substeps: 1, ..Options::new(NOISE) };
    let oe = || OutputError::new(&l.model, &record, &options).unwrap();
    agree("record", &mut oe(), &values);
    let mut mask = Mask::all(record.samples(), l.model.nj());
    for i in (0..record.samples()).filter(|i| i % 7 < 4) {
        mask.tau.row_mut(i).fill(0.0);
    }
    agree("mask", &mut Masked::new(oe(), &mask).unwrap(), &values);
    let tie = Affine::shared(&decls, &values, "k", &["panel_*.k[*]"]).unwrap();
    let map = TieMap::new(&decls, &values, vec![Box::new(tie) as Box<dyn Tie>]).unwrap();
    let short = map.start();
    agree("ties", &mut Tied::new(oe(), map), &short);
    let shared = Shared::new(&[("one", &decls[..]), ("two", &decls[..])], &["base.mass"]).unwrap();
    let both = shared.gather(&[values.clone(), truth]);
    let mut several = Several::new(&shared, vec![Box::new(oe()), Box::new(Masked::new(oe(), &mask).unwrap())]);
    agree("records", &mut several, &both);
}

#[test]
fn where_samples_are_few_a_first_pass_takes_longer_steps() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 30.0, 10), 30.0)).thinned(10).unwrap();
    let values = Params::<f64>::nominal(&l.model).values().to_vec();
    let of =
        |substeps: usize| OutputError::new(&l.model, &record, &Options { substeps, ..Options::new(NOISE) }).unwrap();
    let (mut fine, mut once) = (of(24), of(1));
    assert!(once.coarse(&values).is_none());
    let residuals = |oe: &mut dyn Estimator| {
        let mut r = vec![0.0; oe.rows()];
        oe.residuals(&values, &[], &mut r).unwrap();
        r
    };
    let (exact, rough) = (residuals(&mut fine), residuals(&mut once));
    let mut first = fine.coarse(&values).unwrap();
    let first = residuals(&mut *first.estimator);
    // All rows, neither as in the steps of the fit nor as in one step a sample.
    assert_eq!(first.len(), exact.len());
    let apart = |a: &[f64]| norm(&a.iter().zip(&exact).map(|(a, b)| a - b).collect::<Vec<_>>());
    assert!(apart(&first) > 0.0 && apart(&first) <= apart(&rough), "{:e} {:e}", apart(&first), apart(&rough));
}

/// A mode that hardly rings above the noise is not followed on the way, nor by columns that need not be exact; one that rings is.
#[test]
fn what_hardly_rings_is_not_followed_on_the_way() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 60.0, 10), 60.0)).thinned(5).unwrap();
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let of = |by: f64| {
        let noise = Noise { torque: by * NOISE.torque, gyro: by * NOISE.gyro };
        let options = Options { substeps: 1, step_error: Some(0.02), ..Options::new(noise) };
        OutputError::new(&l.model, &record, &options).unwrap()
    };
    let rows = |e: &OutputError<'_>| {
        [e.coarse(&truth), e.rough(&truth)].map(|thin| thin.map_or(usize::MAX, |thin| thin.estimator.rows()))
    };
    let (loud, quiet) = (of(1e3).suited(&truth).unwrap(), of(1e-3).suited(&truth).unwrap());
    // Nobody knows before the integration was looked at.
    for e in [&of(1e3), &quiet] {
        let [coarse, rough] = rows(e);
        assert_eq!(coarse, rough);
    }
    let [coarse, rough] = rows(&loud);
    assert!(3 * rough <= 2 * coarse, "{rough} {coarse}");
    let mut all = vec![0.0; record.samples() * (l.model.nj() + 3)];
    of(1e3).residuals(&truth, &[], &mut all).unwrap();
    let mut thin = loud.rough(&truth).unwrap();
    let mut some = vec![0.0; thin.estimator.rows()];
    thin.estimator.residuals(&truth, &[], &mut some).unwrap();
    let apart: Vec<f64> = thin.rows.iter().zip(&some).map(|(&i, b)| all[i] - b).collect();
    assert!(norm(&apart) > 1e-6 && norm(&apart) < 1.0, "{:e}", norm(&apart));
    let selected = select(&decls, &["base.mass", "panel_*.k[*]", "panel_*.d[*]"]).unwrap();
    for e in [&loud, &quiet] {
        let options = Options { gyro_bias: true, ..Options::new(NOISE) };
        let columns = |mut of: OutputError<'_>| {
            let mut r = vec![0.0; of.rows()];
            let mut j = DMatrix::zeros(of.rows(), selected.len() + 3);
            of.jacobian(&truth, &[0.0; 3], &selected, &mut r, &mut j).unwrap();
            // Whatever the order of the rows.
            j.tr_mul(&j)
        };
        let exact = columns(e.with_options(&options).unwrap());
        let surveyed = columns(e.survey(&options, &truth).unwrap());
        let sizes = exact.diagonal().map(f64::sqrt);
        for (k, x) in (surveyed - exact).iter().enumerate() {
            let of = sizes[k / sizes.len()] * sizes[k % sizes.len()];
            assert_within!(x.abs(), 0.03 * of, "{k}");
        }
    }
}

#[test]
fn the_way_over_less_data_leads_to_the_same_answer() {
    let l = paper("flex.toml");
    let record = exact(&l, &run(&l, &planned(&l, 30.0, 10), 30.0));
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "panel_*.k[*]"]).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.2, 7);
    let fit = |coarse: bool| {
        let mut oe = OutputError::new(&l.model, &record, &Options { substeps: 1, ..Options::new(NOISE) }).unwrap();
        let settings = Settings { cost_floor: 1e-13, ..Settings::default() };
        let request = Request { coarse, settings, ..Request::new(&decls, &selected, &start) };
        estimate(&request, &mut oe).unwrap()
    };
    let (over, direct) = (fit(true), fit(false));
    assert!(over.status.is_converged() && direct.status.is_converged(), "{:?} {:?}", over.status, direct.status);
    assert_eq!(over.residuals.len(), direct.residuals.len());
    for (a, b) in over.parameters.iter().zip(&direct.parameters) {
        let (sa, sb) = (a.std.unwrap(), b.std.unwrap());
        assert_within!((a.value - b.value).abs(), 1e-4 * sb, "{}: {a:?} {b:?}", a.name);
        assert_within!((sa / sb - 1.0).abs(), 1e-6, "{}: {a:?} {b:?}", a.name);
        assert_ne!(a.value, a.start);
    }
}
