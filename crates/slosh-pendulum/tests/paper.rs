//! The paper's formulas, as corrected, against the appendage and against Table I.
use ff_dynamics::{Boundary, State, Work, mass_matrix, modes};
use ff_model::port::PortModel;
use ff_model::{BaseKind, Inertia, Model, Motion, Params, PortState, Xform};
use nalgebra::{Complex, DMatrix, Matrix3, SMatrix, SVector, Vector3};
use slosh_pendulum::SloshPendulum;
use slosh_pendulum::formulas::{
    SpringMass, damping_ratio, natural_frequency, natural_frequency_hz, small_angle_acceleration, small_angle_wrench,
};

/// Table I: mass, length, stiffness, damping.
const TABLE_I: (f64, f64, f64, f64) = (100.0, 0.8, 20.0, 5.0);

#[test]
fn table_one_gives_0_0890_hz_and_damping_ratio_0_070() {
    let (m, l, k, d) = TABLE_I;
    let f = natural_frequency_hz(m, l, k, 0.0).unwrap();
    let zeta = damping_ratio(m, l, k, d, 0.0).unwrap();
    println!("f = {f:.6} Hz (the paper reads 0.06 Hz off a spectrum), zeta = {zeta:.6}");
    assert!((f - 0.0890).abs() < 5e-5);
    assert!((zeta - 0.070).abs() < 5e-4);
    // What 0.06 Hz would need (theory.md 5.14).
    assert!((natural_frequency_hz(m, l, 9.1, 0.0).unwrap() - 0.06).abs() < 1e-4);
}

#[test]
fn no_frequency_without_a_stable_rest() {
    let (m, l, k, d) = TABLE_I;
    assert_eq!(natural_frequency(m, l, k, -1.0), None);
    assert_eq!(natural_frequency(m, 0.0, k, 0.0), None);
    assert_eq!(natural_frequency(-m, l, k, 1.0), None);
    assert_eq!(natural_frequency(m, l, f64::NAN, 0.0), None);
    assert_eq!(natural_frequency(m, l, f64::INFINITY, 0.0), None);
    assert_eq!(damping_ratio(m, l, k, f64::NAN, 0.0), None);
    assert_eq!(damping_ratio(m, l, -k, d, 0.0), None);
}

/// Own acceleration and wrench on the host, from the appendage, for host acceleration `a` (host not moving).
fn appendage(c: &SloshPendulum, eta: [f64; 2], nu: [f64; 2], a: [f64; 6]) -> ([f64; 2], [f64; 6]) {
    let p = c.nominal();
    let m: SMatrix<f64, 8, 8> = c.dense_inertia(&p, &eta).fixed_view::<8, 8>(0, 0).into_owned();
    let mut h = [0.0; 8];
    c.bias(&p, &PortState { host: Motion::zero(), eta: &eta, nu: &nu }, &mut h);
    let h = SVector::<f64, 8>::from(h);
    let a = SVector::<f64, 6>::from(a);
    let e = m.fixed_view::<2, 6>(6, 0) * a + h.fixed_rows::<2>(6);
    let acc = -m.fixed_view::<2, 2>(6, 6).into_owned().try_inverse().unwrap() * e;
    let w = m.fixed_view::<6, 6>(0, 0) * a + m.fixed_view::<6, 2>(0, 6) * acc + h.fixed_rows::<6>(0);
    ([acc[0], acc[1]], (-w).into())
}

#[test]
fn small_swings_give_the_corrected_force_and_the_couple() {
    let (m, l, _, _) = TABLE_I;
    let (k, d) = ([20.0, 26.0], [5.0, 3.0]);
    let c = SloshPendulum::new(m, l, k, d).unwrap();
    for scale in [1e-3, 1e-4, 1e-5] {
        // Everything small of the order `scale` but the axial acceleration.
        let (eta, nu) = ([0.9 * scale, -0.7 * scale], [0.4 * scale, 0.6 * scale]);
        let (ax, ay, az) = (0.3 * scale, -0.5 * scale, 0.2);
        let (acc, on_base) = appendage(&c, eta, nu, [ax, ay, az, 0.0, 0.0, 0.0]);
        // swing[0]: lateral axis y, couple about x. swing[1]: lateral axis -x, couple about y.
        for (i, (lat, sign, row, moment)) in [(ay, 1.0, 1, 3), (-ax, -1.0, 0, 4)].into_iter().enumerate() {
            let want_acc = small_angle_acceleration(m, l, k[i], d[i], [eta[i], nu[i]], lat, az);
            let want = small_angle_wrench(m, l, k[i], d[i], [eta[i], nu[i], want_acc], lat, az);
            let also = (d[i] * nu[i] + k[i] * eta[i]) / l + m * az * eta[i];
            let second_order = 10.0 * scale;
            assert!((acc[i] - want_acc).abs() < second_order * want_acc.abs());
            assert!((sign * on_base[row] - want.lateral).abs() < second_order * want.lateral.abs());
            assert!((on_base[2] - want.axial).abs() < second_order * want.axial.abs());
            assert!((on_base[moment] - want.couple).abs() < second_order * want.couple.abs());
            assert!((want.lateral - also).abs() < 1e-12 * want.lateral.abs());
            // Eq. (14) as printed has the other sign and the damper twice: off by more than the force itself.
            let printed = m * lat + (want_acc * l * m + d[i] * nu[i] / l);
            assert!((printed - want.lateral).abs() > want.lateral.abs());
        }
    }
}

#[test]
fn eqs_12_and_13_as_corrected_hold_at_any_angle() {
    // Plane of the first swing: lateral y, axial z, mass at l (sin a, -cos a). The tension from the axial balance must
    // satisfy the lateral one; with the printed sign of a'^2 cos a it does not (theory.md 5.10).
    let (m, l, k, d) = TABLE_I;
    let c = SloshPendulum::new(m, l, [k, 26.0], [d, 3.0]).unwrap();
    for (a, rate, lat, ax) in [(0.7, 0.9, 0.3, -0.4), (-1.1, 0.6, -0.5, 0.8), (2.3, -1.4, 0.7, 0.2)] {
        let (acc, on_base) = appendage(&c, [a, 0.0], [rate, 0.0], [0.0, lat, ax, 0.0, 0.0, 0.0]);
        let (s, co) = a.sin_cos();
        let transverse = m * l * acc[0] + (d * rate + k * a) / l;
        let tension = (m * ax + m * l * rate * rate * co + transverse * s) / co;
        let lateral = m * lat - m * l * rate * rate * s + transverse * co + tension * s;
        let scale = m * lat.abs() + transverse.abs() + tension.abs();
        assert!(lateral.abs() < 1e-13 * scale, "{lateral}");
        let printed = (m * ax - m * l * rate * rate * co + transverse * s) / co;
        assert!((m * lat - m * l * rate * rate * s + transverse * co + printed * s).abs() > 0.1 * m * l * rate * rate);
        // What the base feels is arm force (tension and transverse spring force) and couple.
        let arm = [(d * rate + k * a) / l * co + tension * s, (d * rate + k * a) / l * s - tension * co];
        assert!((on_base[1] - arm[0]).abs() < 1e-12 * scale && (on_base[2] - arm[1]).abs() < 1e-12 * scale);
        assert!((on_base[3] - (k * a + d * rate)).abs() < 1e-12 * scale);
    }
}

#[test]
fn eq_16_is_the_small_angle_frequency_of_the_appendage() {
    let (m, l, k, d) = TABLE_I;
    let c = SloshPendulum::new(m, l, [k, 26.0], [d, 3.0]).unwrap();
    for axial in [0.0, 0.35, -0.2] {
        for (i, k) in [k, 26.0].into_iter().enumerate() {
            // Prescribed base, constant axial acceleration: alpha'' = -omega^2 alpha for small alpha.
            let mut eta = [0.0; 2];
            eta[i] = 1e-6;
            let (acc, _) = appendage(&c, eta, [0.0; 2], [0.0, 0.0, axial, 0.0, 0.0, 0.0]);
            let want = natural_frequency(m, l, k, axial).unwrap();
            assert!(((-acc[i] / 1e-6).sqrt() / want - 1.0).abs() < 1e-9);
            // And the decay of the damper: alpha'' = -2 zeta omega alpha'.
            let mut nu = [0.0; 2];
            nu[i] = 1e-6;
            let (acc, _) = appendage(&c, [0.0; 2], nu, [0.0, 0.0, axial, 0.0, 0.0, 0.0]);
            let zeta = damping_ratio(m, l, k, [d, 3.0][i], axial).unwrap();
            assert!((-acc[i] / 1e-6 / (2.0 * zeta * want) - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn on_a_free_base_eq_16_has_the_reduced_inertia() {
    // m l^2 becomes m l^2 - h_s^T H_b^-1 h_s: the frequency rises (theory.md 5.13).
    let (m, l, k, _) = TABLE_I;
    let mut model = Model::new("sat", "base", body(), BaseKind::Floating);
    let mount = Vector3::new(0.3, -0.2, 0.5);
    let pendulum = SloshPendulum::new(m, l, [k; 2], [0.0; 2]).unwrap();
    model.mount("tank", 0, Xform::new(Matrix3::identity(), mount), pendulum.into()).unwrap();
    let p = Params::nominal(&model);
    let mut h = DMatrix::zeros(8, 8);
    mass_matrix(&model, &p, &State::zero(&model), &mut Work::new(&model), &mut h);
    let hs = h.view((0, 6), (6, 2)).into_owned();
    let reduced: DMatrix<f64> =
        h.view((6, 6), (2, 2)) - hs.transpose() * h.view((0, 0), (6, 6)).into_owned().cholesky().unwrap().solve(&hs);
    let mut want: Vec<f64> =
        reduced.symmetric_eigenvalues().iter().map(|x| (k / x).sqrt() / std::f64::consts::TAU).collect();
    want.sort_by(f64::total_cmp);
    let found = modes(&model, &p, &[], &[0.0; 2], Boundary::JointsHeld).unwrap();
    let held = natural_frequency_hz(m, l, k, 0.0).unwrap();
    for (f, w) in found.iter().zip(&want) {
        assert!(
            (f.frequency_hz / w - 1.0).abs() < 1e-9 && f.frequency_hz > 1.01 * held,
            "{} {w} {held}",
            f.frequency_hz
        );
    }
    let bound = modes(&model, &p, &[], &[0.0; 2], Boundary::BaseHeld).unwrap();
    assert!(bound.iter().all(|f| (f.frequency_hz / held - 1.0).abs() < 1e-12));
}

fn body() -> Inertia<f64> {
    let i = Matrix3::new(150.0, 4.0, -6.0, 4.0, 170.0, 3.0, -6.0, 3.0, 140.0);
    Inertia::from_com(560.0, &Vector3::new(0.1, 0.05, -0.2), &i)
}

#[test]
fn the_lateral_force_exceeds_a_frozen_mass_only_below_root_two_times_the_frequency() {
    // theory.md 5.12: |F / (m x'')| from the appendage's own matrices, harmonic base motion.
    let (m, l, k, d) = TABLE_I;
    let c = SloshPendulum::new(m, l, [k; 2], [d; 2]).unwrap();
    let h = c.dense_inertia(&c.nominal(), &[0.0; 2]);
    let wn = natural_frequency(m, l, k, 0.0).unwrap();
    let ratio = |w: f64| {
        let dynamic = Complex::new(k - w * w * h[(6, 6)], w * d);
        (Complex::new(h[(1, 1)], 0.0) + h[(1, 6)] * h[(6, 1)] * w * w / dynamic).norm() / m
    };
    assert!((ratio(wn * 2.0_f64.sqrt()) - 1.0).abs() < 1e-12);
    assert!(
        (ratio(wn) - 7.2).abs() < 0.05 && (ratio(2.0 * wn) - 0.34).abs() < 0.01,
        "{} {}",
        ratio(wn),
        ratio(2.0 * wn)
    );
}

#[test]
fn springs_dampers_and_fulcrum_trade_against_each_other() {
    // (l, k, d) -> (s l, s^2 k, s^2 d), fulcrum moved so that the mass rests where it did: same force on the base,
    // and the same moment about a fixed point, to first order in the swing.
    let (m, l, k, d) = TABLE_I;
    let s = 1.7;
    let one = SpringMass::of_pendulum(m, l, k, d);
    assert_eq!(one.to_pendulum(l), (k, d));
    let (k2, d2) = one.to_pendulum(s * l);
    assert!((k2 - s * s * k).abs() < 1e-12 && (d2 - s * s * d).abs() < 1e-12);
    let f = |l, k| natural_frequency(m, l, k, 0.0).unwrap();
    assert!((f(l, k) - f(s * l, k2)).abs() < 1e-15);
    let (x, v) = (1e-6, 2e-6); // displacement and speed of the mass: angles x / l
    let run = |l: f64, k: f64, d: f64, height: f64| {
        let c = SloshPendulum::new(m, l, [k, k], [d, d]).unwrap();
        // Host acceleration at the fulcrum, `height` above the reference point that accelerates and turns.
        let (a_y, w_x) = (1e-6, 3e-6);
        let host = [0.0, a_y - w_x * height, 0.0, w_x, 0.0, 0.0];
        let (_, w) = appendage(&c, [x / l, 0.0], [v / l, 0.0], host);
        [w[1], w[3] - height * w[1]]
    };
    let (a, b) = (run(l, k, d, 0.5), run(s * l, k2, d2, 0.5 + (s - 1.0) * l));
    for i in 0..2 {
        assert!((a[i] - b[i]).abs() < 1e-9 * a[i].abs(), "{a:?} {b:?}");
    }
}
