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
use ident::parameters::offset_start;
use ident::parameters::select;
use ident::*;
use ident::{Tie, Tied};

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
