//! Record checks on simulated records: a change of momentum, the variants of a model.

use crate::common::paper;
use ff_dynamics::{Drive, SimOptions, State, simulate};
use ff_model::{BaseKind, Model, Params};
use ff_records::{Record, RecordBuilder};
use ff_testkit::assert_within;
use ff_testkit::motion::Sines;
use ff_testkit::tree::branched_arm;
use ident::checks::{ModelVariant, MomentumChange, momentum_change};
use ident::estimate::fit_nuisance;
use ident::{Noise, Options, OutputError};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const NOISE: Noise = Noise { torque: 0.02, gyro: 2e-4 };

/// A record with white noise, and a jump of the base rate by `step` from sample `from` on.
fn record(m: &Model, step: Vector3<f64>, from: usize) -> Record {
    let motion = Sines::new(17, m.nj(), 12.0, 0.7);
    let o = SimOptions { duration_s: 12.0, step_s: 5e-3, sample_s: 0.02 };
    let t = simulate(m, &Params::nominal(m), &State::zero(m), &Drive::Prescribed(&motion), &o).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let tau = t.tau.map(|x| x + NOISE.torque * normal());
    let mut gyro = t.gyro().map(|x| x + NOISE.gyro * normal());
    for i in from..gyro.nrows() {
        (0..3).for_each(|k| gyro[(i, k)] += step[k]);
    }
    let b = RecordBuilder::new(m.joint_names()).uniform(0.0, 1.0 / t.dt).q(t.q.clone());
    b.qd(t.qd.clone()).qdd(t.qdd.clone()).tau(tau).gyro(gyro).build().unwrap().0
}

fn change(m: &Model, record: &Record) -> Option<MomentumChange> {
    let mut e = OutputError::new(m, record, &Options { initial_state: false, ..Options::new(NOISE) }).unwrap();
    let values = Params::<f64>::nominal(m).values().to_vec();
    let fitted = fit_nuisance(&mut e, &values, 50).unwrap();
    let selected = ident::parameters::select(&m.param_decls(), &["base.*"]).unwrap();
    momentum_change(m, record, &mut e, (&values, &selected), fitted, NOISE.gyro).unwrap()
}

#[test]
fn a_jump_of_the_base_rate_is_found_with_its_size_and_instant() {
    let m = branched_arm(5, 3, BaseKind::Floating);
    let step = Vector3::new(3.1e-3, -1.7e-3, 2.3e-3);
    let from = 331;
    let r = record(&m, step, from);
    let found = change(&m, &r).unwrap();
    // Instants are tried every sixtieth of the record.
    assert!((found.at.unwrap() - r.time(from)).abs() < 12.0 / 60.0, "{found:?}");
    assert!((found.rate - step).norm() < 0.2 * step.norm(), "{found:?}");
    assert!(found.drop > 0.6 * found.excess && found.momentum.dot(&found.rate) > 0.0, "{found:?}");
    assert_eq!(change(&m, &record(&m, Vector3::zeros(), from)), None);
}

#[test]
fn a_variant_leaves_out_motion_and_keeps_mass() {
    for (mission, moving) in [("flex.toml", ModelVariant::Flexible), ("slosh.toml", ModelVariant::Slosh)] {
        let whole = paper(mission).model;
        let mass = |m: &Model| {
            let p = Params::nominal(m);
            let mut h = nalgebra::DMatrix::zeros(m.nv(), m.nv());
            ff_dynamics::mass_matrix(m, &p, &State::<f64>::zero(m), &mut ff_dynamics::Work::new(m), &mut h);
            h[(0, 0)]
        };
        let rigid = ModelVariant::Rigid.of(&whole).unwrap();
        assert_eq!((rigid.np(), rigid.nj()), (0, whole.nj()));
        assert_within!((mass(&rigid) - mass(&whole)).abs(), 1e-9 * mass(&whole));
        let same = moving.of(&whole).unwrap();
        assert_eq!((same.np(), same.param_decls().len()), (whole.np(), whole.param_decls().len()));
        let distinct = ModelVariant::distinct(&whole, &ModelVariant::ALL);
        assert_eq!(distinct, [ModelVariant::Rigid, moving]);
    }
}
