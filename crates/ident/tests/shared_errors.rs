//! Errors that records share: one prior, one column, one estimate.

use crate::output_error::short_record;
use ff_least_squares::Settings;
use ff_model::{ParamDecl, ParamGroup};
use ff_testkit::assert_within;
use ident::belief::{PriorRow, prior_shares, tightened};
use ident::compose::{Affine, Shared, SharedErrors, Tie, TieMap};
use ident::estimate::{Estimate, attempt};
use ident::uncertain::ErrorSource;
use ident::{Estimator, Noise, Options, OutputError, Priors, Request, Several, Tied};
use std::sync::Arc;

const GAIN: f64 = 0.013;
const SENSORS: Noise = Noise { torque: 5e-4, gyro: 7e-7 };

/// Relative deviation of the mass of the base, deviation of the gain, and the share of the variance of the mass that is the prior's,
/// from so many records of the same motion; a sequence fits the records again that it keeps, and is the joint fit. Masses of all bodies, springs
/// and dampers are free.
fn deviations(records: usize) -> ((f64, f64), f64) {
    let l = crate::common::paper("slosh.toml");
    let decls = l.model.param_decls();
    let values: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
    let record = short_record(&l);
    let options = Options { errors: vec![ErrorSource::TorqueGain(None)], ..Options::new(SENSORS) };
    let names = ["torque.gain".to_owned()];
    let mut all = decls.clone();
    all.push(ParamDecl {
        name: names[0].clone(),
        unit: "1",
        nominal: 0.0,
        bounds: (-5.0 * GAIN, 5.0 * GAIN),
        group: ParamGroup::Free,
    });
    let mut start = values.clone();
    start.push(0.0);
    // The ten numbers of a link change in proportion to its mass.
    let links = (0..decls.len())
        .filter(|&i| matches!(&decls[i].group, ParamGroup::Inertial(body) if body != "base") && decls[i].unit == "kg");
    let tie = |i: usize| -> Box<dyn Tie> {
        let scale = ParamDecl {
            bounds: (0.0, f64::INFINITY),
            ..ParamDecl::positive(format!("scale.{}", decls[i].name), "1", 1.0)
        };
        let matrix = nalgebra::DMatrix::from_fn(10, 1, |r, _| values[i + r]);
        Box::new(Affine::new(vec![scale], (i..i + 10).collect(), nalgebra::DVector::zeros(10), matrix).unwrap())
    };
    let map = Arc::new(TieMap::new(&all, &start, links.map(tie).collect()).unwrap());
    let (short, from) = (map.decls().to_vec(), map.start());
    let wanted = |d: &ParamDecl| {
        let of_tank = d.name.starts_with("tank.") && matches!(d.unit, "kg" | "N m/rad" | "N m s/rad");
        d.name.starts_with("base.") || d.name.starts_with("scale.") || of_tank || d.name == "torque.gain"
    };
    let selected: Vec<usize> = (0..short.len()).filter(|&i| wanted(&short[i])).collect();
    let column = |name: &str| selected.iter().position(|&i| short[i].name == name).unwrap();
    let (mass, gain) = (column("base.mass"), column("torque.gain"));
    let fit = |count: usize, priors: Priors| -> Estimate {
        let labels: Vec<String> = (0..count).map(|k| format!("r{k}")).collect();
        let lists: Vec<(&str, &[ParamDecl])> = labels.iter().map(|n| (n.as_str(), decls.as_slice())).collect();
        let shared = Shared::new::<&str>(&lists, &[]).unwrap();
        let part = |_| Box::new(OutputError::new(&l.model, &record, &options).unwrap()) as Box<dyn Estimator>;
        let several: Box<dyn Estimator> = Box::new(Several::new(&shared, (0..count).map(part).collect()));
        let mut tied = Tied::new(SharedErrors::new(several, decls.len(), &names, &labels), Arc::clone(&map));
        // The truth itself: what counts is what the record tells there.
        let settings = Settings { max_iterations: 0, ..Settings::default() };
        let marginal = vec![(selected[gain], GAIN)];
        let request = Request { priors, marginal, settings, coarse: false, ..Request::new(&short, &selected, &from) };
        attempt(&request, &mut tied).unwrap()
    };
    let first = Priors::default().with(PriorRow { column: gain, mean: 0.0, sigma: GAIN });
    let e = fit(records, first);
    assert!(e.data_only.full_rank(), "the prior of the gain counts as a measurement: {:?}", e.data_only.null);
    let d = |k: usize| e.parameters[k].std.unwrap();
    let share = prior_shares(&e.uncertainty.covariance, mass, &[vec![(gain, GAIN)]])[0];
    let better = tightened(&e.uncertainty.covariance, mass, &vec![(gain, GAIN)], 0.5);
    let noise = (1.0 - share).max(0.0).sqrt() * d(mass);
    let half = noise.hypot(0.5 * share.sqrt() * d(mass));
    assert_within!((better - half).abs(), 0.02 * d(mass));
    ((d(mass) / e.values[selected[mass]], d(gain)), share)
}

#[test]
#[ignore = "full tier: 2 s"]
fn a_common_gain_scales_the_base_by_as_much_whatever_the_number_of_records() {
    for records in [1, 5] {
        let ((mass, gain), share) = deviations(records);
        // Nothing but its prior tells the gain, once, and the mass follows it.
        assert_within!((gain / GAIN - 1.0).abs(), 0.01, "{records} records: {gain}");
        assert_within!((mass / gain - 1.0).abs(), 0.01, "{records} records: {mass} {gain}");
        assert!(share > 0.98, "{share}");
    }
}
