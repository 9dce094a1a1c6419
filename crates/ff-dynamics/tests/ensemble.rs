//! An ensemble is its runs, one by one.

use crate::common::*;
use ff_dynamics::sim::simulate_ensemble_with;
use ff_dynamics::sim::{Keep, Run, simulate_ensemble};
use ff_dynamics::*;
use ff_model::*;

/// Eleven runs that differ in everything that may differ: on eight lanes one group and a rest of three.
fn runs(m: &Model) -> (Vec<Params<f64>>, Vec<State<f64>>) {
    let mut r = rng(61);
    let nominal = Params::<f64>::nominal(m);
    let params = (0..11)
        .map(|_| {
            let v = nominal.values().iter().map(|x| x * uniform(&mut r, 0.97, 1.03)).collect();
            Params::from_values(m, v)
        })
        .collect();
    let starts = (0..11)
        .map(|_| {
            let mut s = random_state(m, &mut r, 0.05);
            s.v.iter_mut().for_each(|x| *x *= 0.1);
            s
        })
        .collect();
    (params, starts)
}

#[test]
fn every_run_is_the_simulation_of_its_own() {
    let m = system();
    let (params, starts) = runs(&m);
    let all: Vec<Run<'_>> = params.iter().zip(&starts).map(|(params, start)| Run { params, start }).collect();
    let motion = Wave(m.nj());
    let o = SimOptions { duration_s: 1.5, step_s: 4e-3, sample_s: 0.01 };
    for isa in instruction_sets() {
        let traces = simulate_ensemble_with(isa, &m, &all, &motion, &o, Keep::ALL).unwrap();
        assert_eq!(traces.len(), 11);
        for (k, (got, run)) in traces.iter().zip(&all).enumerate() {
            let want = simulate(&m, run.params, run.start, &Drive::Prescribed(&motion), &o).unwrap();
            let channels = [
                (&got.tau, &want.tau),
                (&got.twist, &want.twist),
                (&got.accel, &want.accel),
                (&got.pos, &want.pos),
                (&got.att, &want.att),
                (&got.eta, &want.eta),
                (&got.nu, &want.nu),
            ];
            for (c, (got, want)) in channels.into_iter().enumerate() {
                let e = relative_error(got.as_slice(), want.as_slice());
                assert_within!(e, 1e-10, "{isa:?}, run {k}, channel {c}: {e:e}");
            }
            let end = (got.last.att - want.last.att).amax() + (got.last.pos - want.last.pos).amax();
            assert!(end < 1e-11 && got.last.q == want.last.q, "{isa:?}, run {k}: {end:e}");
        }
    }
}

#[test]
fn what_is_not_kept_takes_no_room() {
    let m = system();
    let (params, starts) = runs(&m);
    let run = Run { params: &params[3], start: &starts[3] };
    let o = SimOptions { duration_s: 0.1, step_s: 0.01, sample_s: 0.02 };
    let t = simulate_ensemble(&m, &[run], &Wave(m.nj()), &o, Keep::default()).unwrap().remove(0);
    assert_eq!((t.tau.shape(), t.twist.shape()), ((6, 7), (6, 6)));
    assert_eq!((t.accel.ncols(), t.pos.ncols(), t.att.ncols(), t.eta.ncols(), t.nu.ncols()), (0, 0, 0, 0, 0));
}

#[test]
fn an_error_says_which_runs_and_why() {
    let m = system();
    let (mut params, mut starts) = runs(&m);
    let o = SimOptions { duration_s: 0.5, step_s: 0.01, sample_s: 0.01 };
    let go = |params: &[Params<f64>], starts: &[State<f64>], o: &SimOptions, joints: usize| {
        let all: Vec<Run<'_>> = params.iter().zip(starts).map(|(params, start)| Run { params, start }).collect();
        let four = instruction_sets()[0];
        simulate_ensemble_with(four, &m, &all, &Wave(joints), o, Keep::default()).unwrap_err()
    };
    let bad = SimOptions { step_s: f64::NAN, ..o };
    assert!(matches!(go(&params, &starts, &bad, m.nj()).source, SimError::Options { what: "integration step", .. }));
    assert!(matches!(go(&params, &starts, &o, 3).source, SimError::Joints { got: 3, want: 7 }));
    // Run 6 is in lane 2 of the second group of four; its neighbours are fine.
    starts[6].eta[1] = 7.0;
    let e = go(&params, &starts, &o, m.nj());
    assert_eq!((e.first, e.last), (4, 7), "{e}");
    assert!(matches!(e.source, SimError::Range { .. }), "{e}");
    starts[6].eta[1] = 0.0;
    // A base lighter than nothing.
    let mut v = params[9].values().to_vec();
    v[..10].iter_mut().for_each(|x| *x *= -5.0);
    params[9] = Params::from_values(&m, v);
    let e = go(&params, &starts, &o, m.nj());
    assert_eq!((e.first, e.last), (8, 10), "{e}");
    assert!(matches!(e.source, SimError::Singular { .. }), "{e}");
}
