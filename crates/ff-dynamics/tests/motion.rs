//! Hold, sequence and Hermite table.

use approx::assert_relative_eq;
use ff_dynamics::motion::{FnMotion, HermiteTable, Hold, JointMotion, MotionError, Sequence};
use ff_testkit::scaled;

/// Joint `i` follows a polynomial of degree 5 with no vanishing coefficient.
struct Quintic(f64);

fn poly(i: usize, t: f64) -> (f64, f64, f64) {
    let c = [0.3, -1.1, 0.7, 0.45, -0.23, 0.019].map(|x| x * (1.0 + 0.6 * i as f64));
    (
        c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5])))),
        c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5]))),
        2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5])),
    )
}

impl JointMotion for Quintic {
    fn dof(&self) -> usize {
        2
    }
    fn duration(&self) -> f64 {
        self.0
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for i in 0..2 {
            (q[i], qd[i], qdd[i]) = poly(i, t);
        }
    }
}

fn at(m: &dyn JointMotion, t: f64) -> ([f64; 2], [f64; 2], [f64; 2]) {
    let (mut q, mut qd, mut qdd) = ([9.0; 2], [9.0; 2], [9.0; 2]);
    m.eval(t, &mut q, &mut qd, &mut qdd);
    (q, qd, qdd)
}

#[test]
fn hermite_table_is_exact_for_degree_five() {
    let table = HermiteTable::sample(&Quintic(2.1), 0.3).unwrap();
    assert_eq!(table.samples(), 8);
    assert_relative_eq!(table.duration(), 2.1, epsilon = scaled(1e-15));
    for k in 0..=211 {
        let t = 2.1 * k as f64 / 211.0;
        let (a, b) = (at(&table, t), at(&Quintic(2.1), t));
        assert_relative_eq!(a.0[..], b.0[..], epsilon = scaled(1e-14), max_relative = scaled(1e-14));
        assert_relative_eq!(a.1[..], b.1[..], epsilon = scaled(1e-13), max_relative = scaled(1e-13));
        assert_relative_eq!(a.2[..], b.2[..], epsilon = scaled(1e-12), max_relative = scaled(1e-12));
    }
}

#[test]
fn hermite_table_returns_samples_bit_for_bit() {
    let h = 0.01;
    let table = HermiteTable::sample(&Quintic(3.0), h).unwrap();
    for k in 0..=300 {
        let t = k as f64 * h;
        assert_eq!(at(&table, t), at(&Quintic(3.0), t));
    }
    let after = at(&table, 3.4);
    assert_eq!((after.0, after.1, after.2), (at(&table, 3.0).0, [0.0; 2], [0.0; 2]));
    assert_eq!(at(&table, -0.4).1, [0.0; 2]);
}

#[test]
fn sequence_joins_and_reports_breaks() {
    let (q0, _, _) = at(&Quintic(1.0), 0.0);
    let parts: Vec<Box<dyn JointMotion>> =
        vec![Box::new(Hold::new(vec![0.4, -0.2], 0.7).unwrap()), Box::new(Hold::new(vec![0.4, -0.2], 1.9).unwrap())];
    let s = Sequence::new(parts).unwrap();
    assert_relative_eq!(s.duration(), 2.6);
    assert_eq!(s.breaks(), vec![0.0, 0.7, s.duration()]);
    assert_eq!(at(&s, 5.0).0, [0.4, -0.2]);

    // A jump in position, and a jump in rate at equal position, are refused.
    let gap = Sequence::new(vec![Box::new(Hold::new(vec![q0[0], 0.1], 0.7).unwrap()), Box::new(Quintic(1.0))]);
    assert!(matches!(gap, Err(MotionError::Gap { segment: 1, what: "position", joint: 1, .. })));
    let kick = Sequence::new(vec![Box::new(Hold::new(q0.to_vec(), 0.7).unwrap()), Box::new(Quintic(1.0))]);
    assert!(matches!(kick, Err(MotionError::Gap { segment: 1, what: "rate", joint: 0, .. })));
}

#[test]
fn bad_arguments_are_named() {
    assert!(matches!(Hold::new(vec![], 1.0), Err(MotionError::Empty("joint"))));
    assert!(matches!(Hold::new(vec![0.1], -1.0), Err(MotionError::BadTime { .. })));
    assert!(matches!(Hold::new(vec![0.1, f64::NAN], 1.0), Err(MotionError::NotFinite { joint: 1, .. })));
    assert!(matches!(Sequence::new(vec![]), Err(MotionError::Empty("segment"))));
    assert!(matches!(HermiteTable::new(2, 0.0, &[1.0; 4], &[1.0; 4], &[1.0; 4]), Err(MotionError::BadTime { .. })));
    assert!(matches!(
        HermiteTable::new(2, 0.1, &[1.0; 4], &[1.0; 3], &[1.0; 4]),
        Err(MotionError::Length { what: "qd", got: 3, expected: 4 })
    ));
    let bad = HermiteTable::new(2, 0.1, &[1.0; 4], &[1.0; 4], &[1.0, 1.0, 1.0, f64::NAN]);
    assert!(matches!(bad, Err(MotionError::NotFinite { what: "qdd", joint: 1, index: 1, .. })));
}

#[test]
fn a_function_moves_joints_and_is_held_outside() {
    let f = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        assert!((0.0..=2.1).contains(&t) && q.len() == 2 && qd.len() == 2 && qdd.len() == 2);
        (0..2).for_each(|i| (q[i], qd[i], qdd[i]) = poly(i, t));
    };
    let motion = FnMotion::new(2, 2.1, f).unwrap();
    // The table interpolates samples: another way to the same polynomial.
    let table = HermiteTable::sample(&Quintic(2.1), 0.3).unwrap();
    for k in 0..=97 {
        let t = 2.1 * k as f64 / 97.0;
        let (a, b) = (at(&motion, t), at(&table, t));
        assert_relative_eq!(a.0[..], b.0[..], epsilon = 1e-13, max_relative = 1e-13);
        assert_relative_eq!(a.1[..], b.1[..], epsilon = 1e-12, max_relative = 1e-12);
        assert_relative_eq!(a.2[..], b.2[..], epsilon = 1e-11, max_relative = 1e-11);
    }
    for (t, end) in [(-0.4, 0.0), (2.7, 2.1)] {
        let (q, qd, qdd) = at(&motion, t);
        assert_eq!(q, at(&motion, end).0);
        assert_eq!((qd, qdd), ([0.0; 2], [0.0; 2]));
    }
    assert_eq!(motion.with_breaks(vec![1.7, 0.2]).unwrap().breaks(), [0.2, 1.7]);
}

#[test]
fn a_function_that_cannot_be_followed_is_refused() {
    let still = |_: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        [q, qd, qdd].into_iter().for_each(|x| x.fill(0.7));
    };
    assert_eq!(FnMotion::new(0, 1.3, still).unwrap_err(), MotionError::Empty("joint"));
    assert!(matches!(FnMotion::new(2, -1.3, still), Err(MotionError::BadTime { value: -1.3, .. })));
    let break_time = FnMotion::new(2, 1.3, still).unwrap().with_breaks(vec![f64::NAN]);
    assert!(matches!(break_time, Err(MotionError::BadTime { what: "break", .. })));
    // A pole at the end, and an acceleration that was forgotten.
    let pole = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        still(t, q, qd, qdd);
        qd[1] = 1.0 / (1.3 - t);
    };
    let e = FnMotion::new(2, 1.3, pole).unwrap_err();
    assert_eq!(e, MotionError::NotFinite { what: "rate", joint: 1, index: 1, value: f64::INFINITY });
    let forgotten = |_: f64, q: &mut [f64], qd: &mut [f64], _: &mut [f64]| (q[0], qd[0]) = (0.7, 0.3);
    let e = FnMotion::new(1, 1.3, forgotten).unwrap_err();
    assert!(matches!(e, MotionError::NotFinite { what: "acceleration", joint: 0, index: 0, .. }));
}
