//! Every lane computes what plain numbers do, on every instruction set of the machine.

use crate::common::*;
use ff_dynamics::*;
use ff_model::scalar::lanes::{Isa, LaneScalar, LaneTask, dispatch};
use ff_model::*;
use nalgebra::DMatrix;

/// The largest difference between lanes and plain numbers, relative to the largest element of each result.
struct Compare(u64);

impl LaneTask for Compare {
    type Output = f64;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> f64 {
        let mut r = rng(self.0);
        let t = rand_twins(&mut r);
        let m = &t.ports;
        let nv = m.nv();
        let states: Vec<State<f64>> = (0..L::N).map(|_| rand_state(m, &mut r, 0.6)).collect();
        let acc: Vec<Vec<f64>> = (0..L::N).map(|_| (0..nv).map(|_| uni(&mut r, -2.0, 2.0)).collect()).collect();
        let pack = |of: &dyn Fn(usize) -> f64| {
            let mut x = L::splat(0.0);
            (0..L::N).for_each(|l| x.set_lane(l, of(l)));
            x
        };
        let mut s = State::<L>::zero(m);
        (0..4).for_each(|k| s.att[k] = pack(&|l| states[l].att[k]));
        (0..m.nj()).for_each(|k| s.q[k] = pack(&|l| states[l].q[k]));
        (0..m.np()).for_each(|k| s.eta[k] = pack(&|l| states[l].eta[k]));
        (0..nv).for_each(|k| s.v[k] = pack(&|l| states[l].v[k]));
        let a: Vec<L> = (0..nv).map(|k| pack(&|l| acc[l][k])).collect();
        let z = L::splat(0.0);
        let (p, mut w) = (Params::<L>::nominal(m), Work::<L>::new(m));
        let (mut tau, mut back) = (vec![z; nv], vec![z; nv]);
        rnea(m, &p, &s, &a, &mut w, &mut tau);
        assert!(forward_dynamics(m, &p, &s, &tau, &mut w, &mut back).is_ok());
        // What was in a result before must not show.
        let old = L::splat(7.3);
        let (mut h, mut y) = (DMatrix::from_element(nv, nv, old), Regressor::new(m));
        mass_matrix(m, &p, &s, &mut w, &mut h);
        regressor(m, &p, &s, &tau, &mut w, &mut y);
        regressor(m, &p, &s, &a, &mut w, &mut y);
        let (mut ah, mut th) = (vec![z; nv], vec![z; m.nj()]);
        assert!(hybrid_dynamics(m, &p, &s, &a[m.nb()..m.nb() + m.nj()], &mut w, &mut ah, &mut th).is_ok());
        let mut worst = 0.0f64;
        let mut differ = |lanes: &[L], plain: &[f64], l: usize| {
            let scale = plain.iter().fold(1e-9f64, |m, x| m.max(x.abs()));
            lanes.iter().zip(plain).for_each(|(x, y)| worst = worst.max((x.lane(l) - y).abs() / scale));
        };
        let (pf, mut wf, mut yf) = (Params::<f64>::nominal(m), Work::<f64>::new(m), Regressor::new(m));
        for l in 0..L::N {
            let (mut t, mut hf) = (vec![0.0; nv], DMatrix::zeros(nv, nv));
            rnea(m, &pf, &states[l], &acc[l], &mut wf, &mut t);
            differ(&tau, &t, l);
            differ(&back, &acc[l], l);
            mass_matrix(m, &pf, &states[l], &mut wf, &mut hf);
            differ(h.as_slice(), hf.as_slice(), l);
            regressor(m, &pf, &states[l], &acc[l], &mut wf, &mut yf);
            differ(y.as_slice(), yf.as_slice(), l);
            let (mut a1, mut t1) = (vec![0.0; nv], vec![0.0; m.nj()]);
            let qdd = &acc[l][m.nb()..m.nb() + m.nj()];
            assert!(hybrid_dynamics(m, &pf, &states[l], qdd, &mut wf, &mut a1, &mut t1).is_ok());
            differ(&ah, &a1, l);
            differ(&th, &t1, l);
        }
        worst
    }
}

#[test]
fn lanes_compute_what_plain_numbers_do() {
    for isa in [Isa::Portable, Isa::V3, Isa::V4].into_iter().filter(|&i| i <= Isa::detect()) {
        for seed in 0..20 {
            let worst = dispatch(isa, Compare(seed));
            assert!(worst < 1e-10, "{isa:?}, seed {seed}: {worst:e}");
        }
    }
}
