//! Errors that records share: one prior, one column, one estimate.

use crate::output_error::short_record;
use ff_least_squares::Settings;
use ff_model::{ParamDecl, ParamGroup};
use ff_testkit::assert_within;
use ident::belief::{PriorRow, prior_shares, tightened};
use ident::compose::{Affine, Shared, SharedErrors, TieMap};
use ident::estimate::attempt;
use ident::uncertain::ErrorSource;
use ident::{Estimator, Noise, Options, OutputError, Priors, Request, Several, Tied};

const GAIN: f64 = 0.013;
const SENSORS: Noise = Noise { torque: 5e-4, gyro: 7e-7 };

/// Deviation of the mass of the base relative to the mass, and of the gain, from so many records of the same motion.
fn deviations(records: usize) -> ((f64, f64), f64) {
    let l = crate::common::paper("slosh.toml");
    let decls = l.model.param_decls();
    let values: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
    let record = short_record(&l);
    let options = Options { errors: vec![ErrorSource::TorqueGain(None)], ..Options::new(SENSORS) };
    let labels: Vec<String> = (0..records).map(|k| format!("r{k}")).collect();
    let lists: Vec<(&str, &[ParamDecl])> = labels.iter().map(|n| (n.as_str(), decls.as_slice())).collect();
    let shared = Shared::new::<&str>(&lists, &[]).unwrap();
    let part = |_| Box::new(OutputError::new(&l.model, &record, &options).unwrap()) as Box<dyn Estimator>;
    let several: Box<dyn Estimator> = Box::new(Several::new(&shared, (0..records).map(part).collect()));
    let names = ["torque.gain".to_owned()];
    let with_gain = SharedErrors::new(several, decls.len(), &names, &labels);
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
    // All that torques are made of but the base changes in one proportion.
    let held = |d: &&ParamDecl| {
        !d.name.starts_with("base.") && matches!(d.unit, "kg" | "kg m" | "kg m^2" | "N m/rad" | "N m s/rad")
    };
    let others: Vec<usize> = (0..decls.len()).filter(|&i| held(&&decls[i]) && values[i] != 0.0).collect();
    let matrix = nalgebra::DMatrix::from_fn(others.len(), 1, |r, _| values[others[r]]);
    let scale = ParamDecl { bounds: (0.0, f64::INFINITY), ..ParamDecl::positive("scale", "1", 1.0) };
    let tie = Affine::new(vec![scale], others.clone(), nalgebra::DVector::zeros(others.len()), matrix).unwrap();
    let map = TieMap::new(&all, &start, vec![Box::new(tie)]).unwrap();
    let (short, from) = (map.decls().to_vec(), map.start());
    let mut tied = Tied::new(with_gain, map);
    let wanted = |d: &ParamDecl| d.name.starts_with("base.") || d.name == "scale" || d.name == "torque.gain";
    let selected: Vec<usize> = (0..short.len()).filter(|&i| wanted(&short[i])).collect();
    let column = |name: &str| selected.iter().position(|&i| short[i].name == name).unwrap();
    let (mass, gain) = (column("base.mass"), column("torque.gain"));
    let priors = Priors::default().with(PriorRow { column: gain, mean: 0.0, sigma: GAIN });
    // The truth itself: what counts is what the record tells there.
    let settings = Settings { max_iterations: 0, ..Settings::default() };
    let marginal = vec![(selected[gain], GAIN)];
    let request = Request { priors, marginal, settings, coarse: false, ..Request::new(&short, &selected, &from) };
    let e = attempt(&request, &mut tied).unwrap();
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
fn a_common_gain_scales_the_base_by_as_much_whatever_the_number_of_records() {
    for records in [1, 3] {
        let ((mass, gain), share) = deviations(records);
        // Nothing but its prior tells the gain, once, and the mass follows it.
        assert_within!((gain / GAIN - 1.0).abs(), 0.01, "{gain}");
        assert_within!((mass / GAIN - 1.0).abs(), 0.01, "{mass}");
        assert!(share > 0.98, "{share}");
    }
}
