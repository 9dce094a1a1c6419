//! Energy with the damping on: what the dampers take is what the motion loses.
use crate::common::{chain, rng, sym};
use ff_model::port::PortModel;
use ff_model::{Motion, PortState};
use flex_panel::PanelChain;
use nalgebra::DVector;

/// `nu'` and energy of the chain on a host at rest in inertial space.
fn rates(c: &PanelChain, x: &[f64]) -> (Vec<f64>, f64, f64) {
    let n = c.count();
    let p = c.nominal();
    let (eta, nu) = x.split_at(n);
    let m = c.dense_inertia(&p, eta).view((6, 6), (n, n)).into_owned();
    let mut h = vec![0.0; 6 + n];
    c.bias(&p, &PortState { host: Motion::zero(), eta, nu }, &mut h);
    let rhs = DVector::from_column_slice(&h[6..]);
    let v = DVector::from_column_slice(nu);
    let energy = 0.5 * v.dot(&(&m * &v)) + c.potential(&p, eta);
    let mut dx = nu.to_vec();
    dx.extend(m.cholesky().unwrap().solve(&rhs).iter().map(|a| -a));
    (dx, energy, c.dissipated_power(&p, nu))
}

#[test]
fn energy_lost_is_energy_dissipated() {
    // The work of the dampers is integrated along with the state by the same method.
    let mut r = rng(20);
    for n in [1, 2, 3] {
        let c = chain(&mut r, n);
        let mut x: Vec<f64> = (0..2 * n).map(|_| sym(&mut r, 0.8)).collect();
        let (e0, h) = (rates(&c, &x).1, 2e-4);
        let mut work = 0.0;
        let step = |x: &[f64], k: &[f64], a: f64| x.iter().zip(k).map(|(x, k)| x + a * k).collect::<Vec<_>>();
        for _ in 0..20_000 {
            let (k1, _, p1) = rates(&c, &x);
            let (k2, _, p2) = rates(&c, &step(&x, &k1, h / 2.0));
            let (k3, _, p3) = rates(&c, &step(&x, &k2, h / 2.0));
            let (k4, _, p4) = rates(&c, &step(&x, &k3, h));
            for i in 0..x.len() {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
            work += h / 6.0 * (p1 + 2.0 * p2 + 2.0 * p3 + p4);
            assert!(p1 > 0.0);
        }
        let e1 = rates(&c, &x).1;
        let drift = (e1 + work - e0).abs() / e0;
        println!("{n} hinges: energy {e0:.3} -> {e1:.3} J, dissipated {work:.3} J, balance {drift:.2e}");
        assert!(work > 0.05 * e0, "the dampers must matter in this test");
        assert!(drift < 1e-10, "{drift:e}");
    }
}

#[test]
fn power_of_host_wrench_and_dampers_is_the_rate_of_energy() {
    // At any instant, host moving and accelerating: w . V - nu . dR/dnu = d/dt (T + U), the right side
    // by differences of the energy along the motion.
    let mut r = rng(21);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let c = chain(&mut r, 2);
        let p = c.nominal();
        let s = crate::common::State::new(&mut r, 2);
        let y = DVector::from_vec(s.y());
        let a = DVector::from_fn(8, |_, _| sym(&mut r, 2.0));
        let energy = |t: f64| {
            let eta: Vec<f64> = (0..2).map(|i| s.eta[i] + t * s.nu[i]).collect();
            let yt = &y + t * &a;
            0.5 * yt.dot(&(c.dense_inertia(&p, &eta) * &yt)) + c.potential(&p, &eta)
        };
        let h = 0.01;
        let rate: f64 = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0]
            .iter()
            .enumerate()
            .map(|(k, c)| c / h * (energy(h * (k + 1) as f64) - energy(-h * (k + 1) as f64)))
            .sum();
        let mut f = c.dense_inertia(&p, &s.eta) * &a;
        let mut h = vec![0.0; 8];
        c.bias(&p, &s.port(), &mut h);
        f += DVector::from_vec(h);
        // Own rows must balance by an outside torque f_e here, because nu' is prescribed: it does work too.
        let power = f.dot(&y) - c.dissipated_power(&p, &s.nu);
        worst = worst.max((power - rate).abs() / (f.norm() * y.norm()));
    }
    println!("power balance, largest relative difference {worst:.2e}");
    assert!(worst < 1e-11, "{worst:e}");
}

#[test]
fn nothing_happens_at_rest() {
    // A spring at its rest angle, everything still: no force of any kind.
    let mut r = rng(22);
    let c = chain(&mut r, 3);
    let eta: Vec<f64> = (0..3).map(|i| c.segment(i).unwrap().rest).collect();
    let mut h = vec![1.0; 9];
    c.bias(&c.nominal(), &PortState { host: Motion::zero(), eta: &eta, nu: &[0.0; 3] }, &mut h);
    assert_eq!(h, vec![0.0; 9]);
}
