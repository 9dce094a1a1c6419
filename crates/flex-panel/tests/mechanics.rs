//! The chain against elementary mechanics of points.
//!
//! Every segment is replaced by six point masses with the same ten inertial parameters. Kinetic energy comes
//! from their velocities by the elementary rule `v + w x r`; forces come from second differences of their
//! positions alone. No spatial vector, composite body or dual number takes part.
use crate::common::{State, amax, chain, rel, rng, sym, vec3};
use ff_model::port::PortModel;
use flex_panel::{PanelChain, Segment};
use nalgebra::{DMatrix, DVector, Rotation3, Unit, Vector3};

/// Six points `c +- sqrt(3 s_i / m) e_i` of mass `m / 6` with the second moments `s_i` of the body about `c`.
fn points(s: &Segment) -> Vec<(f64, Vector3<f64>)> {
    let (m, c) = (s.inertia.mass, s.inertia.com().unwrap());
    let e = s.inertia.about_com().symmetric_eigen();
    let half = e.eigenvalues.sum() / 2.0;
    (0..6)
        .map(|i| {
            let spread = (3.0 * (half - e.eigenvalues[i / 2]) / m).sqrt() * if i % 2 == 0 { 1.0 } else { -1.0 };
            (m / 6.0, c + e.eigenvectors.column(i / 2) * spread)
        })
        .collect()
}

/// Positions of all points, segment by segment, for a mount at `origin` turned by `turn`.
fn positions(
    segments: &[Segment],
    origin: Vector3<f64>,
    turn: Rotation3<f64>,
    eta: &[f64],
) -> Vec<(f64, Vector3<f64>)> {
    let (mut o, mut r, mut out) = (origin, turn, Vec::new());
    for (s, &angle) in segments.iter().zip(eta) {
        o += r * s.hinge;
        r *= Rotation3::from_axis_angle(&Unit::new_normalize(s.axis), angle);
        out.extend(points(s).into_iter().map(|(m, x)| (m, o + r * x)));
    }
    out
}

fn segments(c: &PanelChain) -> Vec<Segment> {
    (0..c.count()).map(|i| c.segment(i).unwrap()).collect()
}

fn matrix(c: &PanelChain, eta: &[f64]) -> DMatrix<f64> {
    c.dense_inertia(&c.nominal(), eta)
}

#[test]
fn kinetic_energy_is_that_of_the_points() {
    let mut r = rng(10);
    let mut worst = 0.0_f64;
    for n in [1, 2, 3, 5, 16] {
        for _ in 0..200 {
            let c = chain(&mut r, n);
            let s = State::new(&mut r, n);
            let y = DVector::from_vec(s.y());
            let have = 0.5 * y.dot(&(matrix(&c, &s.eta) * &y));
            // Velocity of the hinge origin and rate of each segment, all in mount axes.
            let (mut v, mut w, mut turn, mut want) = (s.host.lin, s.host.ang, Rotation3::identity(), 0.0);
            for (i, seg) in segments(&c).iter().enumerate() {
                v += w.cross(&(turn * seg.hinge));
                turn *= Rotation3::from_axis_angle(&Unit::new_normalize(seg.axis), s.eta[i]);
                w += turn * seg.axis * s.nu[i];
                for (m, x) in points(seg) {
                    want += 0.5 * m * (v + w.cross(&(turn * x))).norm_squared();
                }
            }
            worst = worst.max((have - want).abs() / want);
        }
    }
    println!("kinetic energy, largest relative difference {worst:.2e}");
    assert!(worst < 1e-13, "{worst:e}");
}

#[test]
fn inertia_is_symmetric_and_positive_semidefinite() {
    let mut r = rng(11);
    // Semidefinite only: turning host and hinge against each other moves no massive body of a one-hinge chain.
    let mut least = f64::INFINITY;
    for n in [1, 2, 3, 5, 16] {
        for _ in 0..200 {
            let c = chain(&mut r, n);
            let eta: Vec<f64> = (0..n).map(|_| sym(&mut r, 3.0)).collect();
            let m = matrix(&c, &eta);
            assert_eq!(m, m.transpose());
            let e = m.symmetric_eigenvalues();
            least = least.min(e.min() / e.max());
        }
    }
    println!("least eigenvalue over largest {least:.2e}");
    assert!(least > -1e-14, "{least:e}");
}

/// Eighth-order central differences at step `h`: first and second derivative at zero.
fn derivatives(f: impl Fn(f64) -> Vec<Vector3<f64>>, h: f64) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    const C1: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    const C2: [f64; 4] = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
    let zero = f(0.0);
    let mut first = vec![Vector3::zeros(); zero.len()];
    let mut second: Vec<_> = zero.iter().map(|x| x * (-205.0 / 72.0 / (h * h))).collect();
    for k in 0..4 {
        let t = h * (k + 1) as f64;
        let (plus, minus) = (f(t), f(-t));
        for j in 0..zero.len() {
            first[j] += (plus[j] - minus[j]) * (C1[k] / h);
            second[j] += (plus[j] + minus[j]) * (C2[k] / (h * h));
        }
    }
    (first, second)
}

#[test]
fn equations_of_motion_follow_from_positions_alone() {
    // d'Alembert: generalised force = sum m x'' . dx/dq, for a motion with given V, A, nu, nu' at t = 0.
    let mut r = rng(12);
    let mut worst = 0.0_f64;
    for n in [1, 2, 4] {
        for _ in 0..340 {
            let c = chain(&mut r, n);
            let seg = segments(&c);
            let s = State::new(&mut r, n);
            let (a_lin, a_ang) = (vec3(&mut r, 2.0), vec3(&mut r, 2.0));
            let acc: Vec<f64> = (0..n).map(|_| sym(&mut r, 2.0)).collect();
            let at = |q: &[f64], t: f64| -> Vec<Vector3<f64>> {
                // Virtual displacement q = [mount shift, mount turn, hinge angles] on top of the motion at t; the
                // acceleration of the mount origin is A + w x v because A differentiates components.
                let (v, w) = (s.host.lin, s.host.ang);
                let o = v * t + (a_lin + w.cross(&v)) * (t * t / 2.0);
                let turn = Rotation3::new(w * t + a_ang * (t * t / 2.0));
                let shift = Vector3::new(q[0], q[1], q[2]);
                let extra = Rotation3::new(Vector3::new(q[3], q[4], q[5]));
                let eta: Vec<f64> = (0..n).map(|i| s.eta[i] + s.nu[i] * t + acc[i] * t * t / 2.0 + q[6 + i]).collect();
                positions(&seg, o + shift, turn * extra, &eta).into_iter().map(|p| p.1).collect()
            };
            let mass: Vec<f64> = seg.iter().flat_map(points).map(|p| p.0).collect();
            let rest = vec![0.0; 6 + n];
            let xdd = derivatives(|t| at(&rest, t), 0.02).1;
            let mut want = vec![0.0; 6 + n];
            for k in 0..6 + n {
                let dx = derivatives(
                    |e| {
                        let mut q = rest.clone();
                        q[k] = e;
                        at(&q, 0.0)
                    },
                    0.02,
                )
                .0;
                want[k] = (0..mass.len()).map(|j| mass[j] * xdd[j].dot(&dx[j])).sum();
            }
            for i in 0..n {
                want[6 + i] += seg[i].stiffness * (s.eta[i] - seg[i].rest) + seg[i].damping * s.nu[i];
            }
            let mut have = vec![0.0; 6 + n];
            c.bias(&c.nominal(), &s.port(), &mut have);
            let a = DVector::from_iterator(6 + n, a_lin.iter().chain(a_ang.iter()).chain(acc.iter()).copied());
            let ma = matrix(&c, &s.eta) * a;
            for k in 0..6 + n {
                have[k] += ma[k];
            }
            worst = worst.max(rel(&have, &want));
            assert!(amax(&have) > 0.0);
        }
    }
    println!("equations of motion, largest relative difference {worst:.2e}");
    assert!(worst < 1e-9, "{worst:e}");
}
