use crate::motion::bspline::*;
use crate::motion::joint::JointMotion;
use approx::assert_relative_eq;
use ff_testkit::{assert_within, scaled};

fn wave(seed: f64, n: usize, k: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, k, |i, j| (seed + 1.7 * i as f64 + 0.9 * j as f64).sin() + 0.3 * (j as f64).sqrt())
}

fn all_knots() -> Vec<Knots> {
    let mut v: Vec<_> = (1..=MAX_DEGREE).map(|p| Knots::uniform(p, p + 6, 3.7).unwrap()).collect();
    v.push(Knots::new(4, vec![0., 0., 0., 0., 0., 0.7, 1.1, 1.1, 2.9, 3.3, 3.3, 3.3, 3.3, 3.3]).unwrap());
    v
}

#[test]
fn partition_of_unity_and_of_zero_for_derivatives() {
    for k in all_knots() {
        for i in 0..=113 {
            let t = 3.7 * i as f64 / 113.0;
            let (first, rows) = k.local::<4>(t);
            assert!(first + k.degree() < k.count());
            assert_relative_eq!(rows[0].iter().sum::<f64>(), 1.0, epsilon = scaled(1e-13));
            assert!(rows[0].iter().all(|x| *x >= 0.0));
            for r in &rows[1..] {
                assert!(r.iter().sum::<f64>().abs() < 1e-10);
            }
            for (order, r) in rows.iter().enumerate() {
                let b = k.derivative_at(t, order);
                assert_eq!((b.first, b.values), (first, *r));
            }
        }
    }
}

#[test]
fn derivatives_match_central_differences() {
    for k in all_knots() {
        let m = BSplineMotion::new(k.clone(), wave(0.4, 3, k.count())).unwrap();
        let (mut a, mut b, mut d) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for t in [0.311, 1.234, 1.93, 2.71, 3.17] {
            for order in 1..=k.degree() {
                let h = 1e-5;
                m.derivative(t + h, order - 1, &mut a);
                m.derivative(t - h, order - 1, &mut b);
                m.derivative(t, order, &mut d);
                for i in 0..3 {
                    assert_relative_eq!(
                        (a[i] - b[i]) / (2.0 * h),
                        d[i],
                        max_relative = scaled(2e-5),
                        epsilon = scaled(1e-5)
                    );
                }
            }
        }
    }
}

#[test]
fn derivative_control_polygon_is_the_derivative() {
    for k in all_knots() {
        let m = BSplineMotion::new(k.clone(), wave(1.3, 2, k.count())).unwrap();
        for order in 1..k.degree().min(3) {
            let (dk, dc) = m.derivative_control(order).unwrap();
            let (dk2, map) = k.derivative_map(order).unwrap();
            assert_eq!(dk, dk2);
            assert_relative_eq!(
                dc,
                m.control() * map.transpose(),
                max_relative = scaled(1e-11),
                epsilon = scaled(1e-11)
            );
            let d = BSplineMotion::new(dk, dc).unwrap();
            let (mut x, mut y) = ([0.0; 2], [0.0; 2]);
            for i in 0..50 {
                let t = 3.3 * i as f64 / 49.3;
                m.derivative(t, order, &mut x);
                d.derivative(t, 0, &mut y);
                assert_relative_eq!(x[..], y[..], max_relative = scaled(1e-10), epsilon = scaled(1e-10));
            }
        }
    }
}

#[test]
fn a_jump_has_no_derivative() {
    // Knot 1.1 four times: degree 4 is only continuous there, its derivative jumps.
    let k = Knots::new(4, vec![0., 0., 0., 0., 0., 1.1, 1.1, 1.1, 1.1, 2., 2., 2., 2., 2.]).unwrap();
    assert!(k.derivative_map(1).is_ok());
    assert_eq!(k.derivative_map(2).unwrap_err(), BSplineError::Order { order: 2, degree: 4 });
}

#[test]
fn refinement_keeps_the_curve_and_narrows_the_polygon() {
    for k in all_knots() {
        let m = BSplineMotion::new(k.clone(), wave(2.1, 2, k.count())).unwrap();
        let (mut x, mut y) = ([0.0; 2], [0.0; 2]);
        let one = k.insert(0.93).unwrap();
        let variants = [
            m.refined(1),
            m.refined(4),
            BSplineMotion::new(one.knots().clone(), one.apply(m.control())).unwrap(),
            BSplineMotion::new(one.knots().clone(), m.control() * one.matrix().transpose()).unwrap(),
        ];
        assert_eq!(variants[0].knots(), m.knots());
        assert_relative_eq!(variants[0].control(), m.control(), epsilon = scaled(1e-13));
        for f in &variants {
            for i in 0..=60 {
                let t = k.duration() * i as f64 / 60.0;
                for order in 0..2 {
                    m.derivative(t, order, &mut x);
                    f.derivative(t, order, &mut y);
                    assert_relative_eq!(x[..], y[..], max_relative = scaled(1e-11), epsilon = scaled(1e-11));
                }
            }
            assert!(f.control().max() <= m.control().max() + 1e-14);
            assert!(f.control().min() >= m.control().min() - 1e-14);
        }
    }
}

#[test]
fn reproduces_the_line_and_scales_with_duration() {
    let k = Knots::uniform(5, 11, 2.3).unwrap();
    let line = BSplineMotion::new(k.clone(), DMatrix::from_row_slice(1, 11, &k.greville())).unwrap();
    let (mut q, mut qd, mut qdd) = ([0.0], [0.0], [0.0]);
    line.eval(1.37, &mut q, &mut qd, &mut qdd);
    assert_relative_eq!(q[0], 1.37, epsilon = scaled(1e-14));
    assert_relative_eq!(qd[0], 1.0, epsilon = scaled(1e-13));
    assert_within!(qdd[0].abs(), 1e-11);
    let slow = line.with_duration(6.9).unwrap();
    assert_eq!(slow.duration(), 6.9);
    slow.eval(3.0 * 1.37, &mut q, &mut qd, &mut qdd);
    assert_relative_eq!(q[0], 1.37, epsilon = scaled(1e-14));
    assert_relative_eq!(qd[0], 1.0 / 3.0, epsilon = scaled(1e-13));
}

#[test]
fn row_is_the_local_row_in_place() {
    let k = Knots::uniform(3, 9, 1.9).unwrap();
    let mut row = vec![7.0; 9];
    k.row(1.01, 1, &mut row);
    let b = k.derivative_at(1.01, 1);
    assert_eq!(&row[b.first..b.first + 4], b.as_slice());
    assert_eq!(row.iter().filter(|x| **x != 0.0).count(), 4);
}

#[test]
fn outside_the_motion_rests_at_its_ends() {
    let k = Knots::uniform(5, 9, 1.9).unwrap();
    let m = BSplineMotion::new(k, wave(0.2, 2, 9)).unwrap();
    let (mut q, mut qd, mut qdd) = ([1.0; 2], [1.0; 2], [1.0; 2]);
    m.eval(-0.2, &mut q, &mut qd, &mut qdd);
    assert_relative_eq!(q[1], m.control()[(1, 0)], epsilon = scaled(1e-15));
    assert_eq!((qd, qdd), ([0.0; 2], [0.0; 2]));
    m.eval(2.5, &mut q, &mut qd, &mut qdd);
    assert_relative_eq!(q[0], m.control()[(0, 8)], epsilon = scaled(1e-15));
    assert_eq!((qd, qdd), ([0.0; 2], [0.0; 2]));
    m.eval(1.9, &mut q, &mut qd, &mut qdd);
    assert!(qd[0] != 0.0);
}

/// The last sample of a record, by its number and the interval, may be behind the end by a rounding error.
#[test]
fn the_last_sample_of_a_record_is_in_its_motion() {
    let last = 17.38_f64.next_up();
    let m = BSplineMotion::new(Knots::uniform(5, 9, 17.38).unwrap(), wave(0.2, 2, 9)).unwrap();
    let ([mut q, mut qd, mut qdd], [mut q1, mut qd1, mut qdd1]) = ([[1.0; 2]; 3], [[0.0; 2]; 3]);
    m.eval(last, &mut q, &mut qd, &mut qdd);
    m.eval(17.38, &mut q1, &mut qd1, &mut qdd1);
    assert!((q, qd, qdd) == (q1, qd1, qdd1) && qd[0] != 0.0 && qdd[1] != 0.0);
}

#[test]
fn bad_arguments_are_named() {
    assert_eq!(Knots::uniform(8, 20, 1.0), Err(BSplineError::Degree(8)));
    assert_eq!(Knots::uniform(0, 20, 1.0), Err(BSplineError::Degree(0)));
    assert_eq!(Knots::uniform(5, 5, 1.0), Err(BSplineError::TooFew { degree: 5, got: 5 }));
    assert!(matches!(Knots::uniform(5, 8, f64::NAN), Err(BSplineError::Duration(_))));
    assert!(matches!(Knots::new(1, vec![0., 0., 2., 1., 3., 3.]), Err(BSplineError::Knot { index: 3, .. })));
    assert!(matches!(Knots::new(1, vec![0., 0., f64::NAN, 3., 3.]), Err(BSplineError::Knot { index: 2, .. })));
    assert!(matches!(Knots::new(1, vec![0., 0.1, 1., 3., 3.]), Err(BSplineError::Knot { index: 1, .. })));
    assert!(matches!(Knots::new(2, vec![0., 0., 0., 1., 1., 1., 3., 3., 3.]), Err(BSplineError::Knot { .. })));
    let k = Knots::uniform(3, 5, 1.0).unwrap();
    assert!(BSplineMotion::new(k.clone(), DMatrix::zeros(2, 4)).is_err());
    let mut c = DMatrix::zeros(2, 5);
    c[(1, 3)] = f64::INFINITY;
    assert_eq!(BSplineMotion::new(k.clone(), c).unwrap_err(), BSplineError::Control("joint 1, point 3 is inf".into()));
    assert!(k.insert(1.0).is_err() && k.insert(f64::NAN).is_err());
}
