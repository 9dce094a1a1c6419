//! The pendulum against elementary mechanics of one point: positions, velocities, second differences.
//! No spatial vector or dual number takes part.
use crate::common::{State, pendulum, rel, rng, sym, vec3};
use ff_model::port::PortModel;
use ff_model::{Motion, PortState};
use nalgebra::{DMatrix, DVector, Matrix2, Rotation3, Vector2, Vector3};
use rand::RngExt;
use slosh_pendulum::SloshPendulum;

fn matrix(c: &SloshPendulum, eta: &[f64]) -> DMatrix<f64> {
    c.dense_inertia(&c.nominal(), eta)
}

/// Rotation of the arm in the mount: about x, then about the turned y.
fn arm(eta: &[f64]) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::x_axis(), eta[0]) * Rotation3::from_axis_angle(&Vector3::y_axis(), eta[1])
}

#[test]
fn kinetic_energy_is_that_of_the_point() {
    let mut r = rng(10);
    let (mut worst, mut least) = (0.0_f64, f64::INFINITY);
    for _ in 0..1000 {
        let (c, s) = (pendulum(&mut r), State::new(&mut r));
        let y = DVector::from_column_slice(&s.y());
        let m = matrix(&c, &s.eta);
        let [mass, l, ..] = c.nominal();
        let axis_b = Rotation3::from_axis_angle(&Vector3::x_axis(), s.eta[0]) * Vector3::y();
        let w = s.host.ang + Vector3::x() * s.nu[0] + axis_b * s.nu[1];
        let v = s.host.lin + w.cross(&(arm(&s.eta) * Vector3::new(0.0, 0.0, -l)));
        let want = 0.5 * mass * v.norm_squared();
        worst = worst.max((0.5 * y.dot(&(&m * &y)) - want).abs() / want);
        assert_eq!(m, m.transpose());
        let e = m.symmetric_eigenvalues();
        least = least.min(e.min() / e.max());
    }
    println!("kinetic energy, largest relative difference {worst:.2e}; least eigenvalue over largest {least:.2e}");
    assert!(worst < 1e-13, "{worst:e}");
    assert!(least > -1e-14, "{least:e}"); // rank 3: one point
}

/// Eighth-order central differences at step `h`: first and second derivative at zero.
fn derivatives(f: impl Fn(f64) -> Vector3<f64>, h: f64) -> (Vector3<f64>, Vector3<f64>) {
    const C1: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    const C2: [f64; 4] = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
    let (mut first, mut second) = (Vector3::zeros(), f(0.0) * (-205.0 / 72.0 / (h * h)));
    for k in 0..4 {
        let t = h * (k + 1) as f64;
        first += (f(t) - f(-t)) * (C1[k] / h);
        second += (f(t) + f(-t)) * (C2[k] / (h * h));
    }
    (first, second)
}

#[test]
fn equations_of_motion_follow_from_the_position_alone() {
    // d'Alembert: generalised force = m x'' . dx/dq, for a motion with given V, A, nu, nu' at t = 0.
    let mut r = rng(12);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let (c, s) = (pendulum(&mut r), State::new(&mut r));
        let [mass, l, k0, k1, d0, d1] = c.nominal();
        let (a_lin, a_ang, acc) = (vec3(&mut r, 2.0), vec3(&mut r, 2.0), [sym(&mut r, 2.0), sym(&mut r, 2.0)]);
        let at = |q: &[f64; 8], t: f64| {
            let (v, w) = (s.host.lin, s.host.ang);
            let o = v * t + (a_lin + w.cross(&v)) * (t * t / 2.0) + Vector3::new(q[0], q[1], q[2]);
            let turn = Rotation3::new(w * t + a_ang * (t * t / 2.0)) * Rotation3::new(Vector3::new(q[3], q[4], q[5]));
            let eta = [0, 1].map(|i| s.eta[i] + s.nu[i] * t + acc[i] * t * t / 2.0 + q[6 + i]);
            o + turn * arm(&eta) * Vector3::new(0.0, 0.0, -l)
        };
        let xdd = derivatives(|t| at(&[0.0; 8], t), 0.02).1;
        let mut want: [f64; 8] = std::array::from_fn(|k| {
            let shift = |e| {
                let mut q = [0.0; 8];
                q[k] = e;
                at(&q, 0.0)
            };
            mass * xdd.dot(&derivatives(shift, 0.02).0)
        });
        want[6] += k0 * s.eta[0] + d0 * s.nu[0];
        want[7] += k1 * s.eta[1] + d1 * s.nu[1];
        let mut have = [0.0; 8];
        c.bias(&c.nominal(), &s.port(), &mut have);
        let a = DVector::from_iterator(8, a_lin.iter().chain(a_ang.iter()).chain(acc.iter()).copied());
        let ma = matrix(&c, &s.eta) * a;
        for k in 0..8 {
            have[k] += ma[k];
        }
        worst = worst.max(rel(&have, &want));
    }
    println!("equations of motion, largest relative difference {worst:.2e}");
    assert!(worst < 1e-9, "{worst:e}");
}

/// State derivative, energy, dissipated power of the pendulum on a host at rest.
fn rates(c: &SloshPendulum, x: &[f64; 4]) -> ([f64; 4], f64, f64) {
    let p = c.nominal();
    let (eta, nu) = ([x[0], x[1]], [x[2], x[3]]);
    let m = matrix(c, &eta);
    let m = Matrix2::new(m[(6, 6)], m[(6, 7)], m[(7, 6)], m[(7, 7)]);
    let mut h = [0.0; 8];
    c.bias(&p, &PortState { host: Motion::zero(), eta: &eta, nu: &nu }, &mut h);
    let a = -m.cholesky().unwrap().solve(&Vector2::new(h[6], h[7]));
    let v = Vector2::from(nu);
    let energy = 0.5 * v.dot(&(m * v)) + c.potential(&p, &eta);
    ([nu[0], nu[1], a.x, a.y], energy, c.dissipated_power(&p, &nu))
}

#[test]
fn energy_lost_is_energy_dissipated() {
    let mut r = rng(20);
    for _ in 0..3 {
        // Heavy and long enough for the step: d h / (m l^2) stays below 0.002.
        let mut u = |a: f64, b: f64| r.random_range(a..b);
        let (k, d) = ([u(5.0, 50.0), u(5.0, 50.0)], [u(1.0, 8.0), u(1.0, 8.0)]);
        let c = SloshPendulum::new(u(20.0, 200.0), u(0.5, 1.5), k, d).unwrap();
        let mut x = [sym(&mut r, 1.0), sym(&mut r, 0.8), sym(&mut r, 0.8), sym(&mut r, 0.8)];
        let (e0, h, mut work) = (rates(&c, &x).1, 1e-3, 0.0);
        let step = |x: &[f64; 4], k: &[f64; 4], a: f64| std::array::from_fn(|i| x[i] + a * k[i]);
        for _ in 0..10_000 {
            let (k1, _, p1) = rates(&c, &x);
            let (k2, _, p2) = rates(&c, &step(&x, &k1, h / 2.0));
            let (k3, _, p3) = rates(&c, &step(&x, &k2, h / 2.0));
            let (k4, _, p4) = rates(&c, &step(&x, &k3, h));
            for i in 0..4 {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
            work += h / 6.0 * (p1 + 2.0 * p2 + 2.0 * p3 + p4);
            assert!(p1 > 0.0);
        }
        let e1 = rates(&c, &x).1;
        let drift = (e1 + work - e0).abs() / e0;
        println!("energy {e0:.3} -> {e1:.3} J, dissipated {work:.3} J, balance {drift:.2e}");
        assert!(work > 0.05 * e0, "the dampers must matter in this test");
        assert!(drift < 1e-10, "{drift:e}");
    }
}
