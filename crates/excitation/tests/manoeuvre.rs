//! The simplified manoeuvre of the paper: limits, exact angles, continuity, timing.

use approx::assert_relative_eq;
use excitation::plan::{Extent, ManoeuvreError, Shape};
use excitation::{JointCommand, JointLimits, Manoeuvre, ManoeuvreSpec, check_manoeuvre};
use ff_dynamics::motion::{JointMotion, Sequence};

fn command(joint: usize, shape: Shape, extent: Extent) -> JointCommand {
    JointCommand { joint, shape, extent, velocity: 0.17, acceleration: 0.15 }
}

fn spec(commands: Vec<JointCommand>, grid: Option<f64>) -> ManoeuvreSpec {
    ManoeuvreSpec { start: vec![0.11, 0.82, -0.43], commands, ramp: 0.083, lead: 0.57, hold: 20.3, grid }
}

/// Largest |velocity|, |acceleration|, |jerk| by sampling, and that each is the derivative of the one before.
fn sampled_peaks(m: &Manoeuvre, joint: usize) -> [f64; 3] {
    let n = m.dof();
    let h = 1e-4;
    let (end, _) = m.ringing();
    let mut peaks = [0.0f64; 3];
    let mut last: Option<[f64; 3]> = None;
    for i in 0..((end + 0.5) / h) as usize {
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        m.eval(i as f64 * h, &mut q, &mut qd, &mut qdd);
        let now = [q[joint], qd[joint], qdd[joint]];
        if let Some(l) = last {
            assert!((now[0] - l[0] - 0.5 * h * (now[1] + l[1])).abs() < 1e-11);
            assert!((now[1] - l[1] - 0.5 * h * (now[2] + l[2])).abs() < 1e-7 * 0.2);
            peaks[2] = peaks[2].max((now[2] - l[2]).abs() / h);
        }
        peaks[0] = peaks[0].max(now[1].abs());
        peaks[1] = peaks[1].max(now[2].abs());
        last = Some(now);
    }
    peaks
}

#[test]
fn limits_hold_and_angles_are_exact() {
    for grid in [None, Some(0.01), Some(0.025)] {
        for angle in [0.9, -0.31, 0.05, -0.0007] {
            for shape in [Shape::Single, Shape::Doublet] {
                let m = Manoeuvre::new(&spec(vec![command(1, shape, Extent::Angle(angle))], grid)).unwrap();
                let mv = m.moves()[0];
                let peaks = sampled_peaks(&m, 1);
                assert!(peaks[0] <= 0.17 + 1e-9 && peaks[1] <= 0.15 + 1e-9, "{peaks:?}");
                assert_relative_eq!(peaks[0], mv.velocity, max_relative = 1e-4);
                assert_relative_eq!(peaks[1], mv.acceleration, max_relative = 2e-3);
                assert_relative_eq!(peaks[2], mv.jerk, max_relative = 1e-6);
                assert!(mv.jerk <= 0.15 / 0.083 + 1e-9);
                let (mut q, mut qd, mut qdd) = ([0.0; 3], [0.0; 3], [0.0; 3]);
                m.eval(m.duration(), &mut q, &mut qd, &mut qdd);
                let end = 0.82 + if shape == Shape::Single { angle } else { 0.0 };
                assert_eq!((q, qd, qdd), ([0.11, end, -0.43], [0.0; 3], [0.0; 3]));
                if grid.is_none() && angle == 0.9 {
                    assert_relative_eq!(mv.velocity, 0.17, epsilon = 1e-12);
                    assert_relative_eq!(mv.acceleration, 0.15, epsilon = 1e-12);
                }
                if let Some(h) = grid {
                    assert!(m.breaks().iter().all(|b| ((b / h).round() * h - b).abs() < 1e-12));
                }
            }
        }
    }
}

#[test]
fn half_period_moves_drive_the_mode() {
    // Response of an undamped mode to the acceleration: |int a exp(-i w t) dt|, best near its timing.
    let gain = |m: &Manoeuvre, f: f64| {
        let h = 1e-3;
        let (mut re, mut im) = (0.0, 0.0);
        for i in 0..(m.duration() / h) as usize {
            let t = (i as f64 + 0.5) * h;
            let (mut q, mut qd, mut qdd) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            m.eval(t, &mut q, &mut qd, &mut qdd);
            let w = std::f64::consts::TAU * f;
            re += qdd[2] * (w * t).cos() * h;
            im += qdd[2] * (w * t).sin() * h;
        }
        re.hypot(im)
    };
    for shape in [Shape::Single, Shape::Doublet] {
        let timed = |f: f64, grid| {
            let extent = Extent::HalfPeriod { frequency: f, negative: true };
            Manoeuvre::new(&spec(vec![command(2, shape, extent)], grid)).unwrap()
        };
        let m = timed(0.23, Some(0.01));
        let mv = m.moves()[0];
        assert!(mv.angle < 0.0);
        let lobes = if shape == Shape::Single { 1.0 } else { 2.0 };
        if shape == Shape::Doublet {
            assert_relative_eq!(mv.end - mv.start, 2.0 * 2.17, epsilon = 1e-9);
        }
        let at_mode = gain(&m, 0.23);
        assert!(at_mode > 0.9 * lobes * 2.0 * 0.5 * mv.velocity, "{at_mode}");
        assert!(at_mode > gain(&timed(0.5, None), 0.23));
    }
    let short = JointCommand {
        velocity: 0.17,
        ..command(2, Shape::Doublet, Extent::HalfPeriod { frequency: 4.0, negative: false })
    };
    assert!(matches!(Manoeuvre::new(&spec(vec![short], None)), Err(ManoeuvreError::RampTooLong { .. })));
}

#[test]
fn several_joints_and_bad_arguments() {
    let a = command(0, Shape::Single, Extent::Angle(0.3));
    let b = command(2, Shape::Doublet, Extent::Angle(-0.4));
    let m = Manoeuvre::new(&spec(vec![a, b], None)).unwrap();
    assert_eq!(m.excursion(2), (-0.43 - 0.4, -0.43));
    assert_relative_eq!(m.ringing().1 - m.ringing().0, 20.3, epsilon = 1e-12);
    assert_eq!(Manoeuvre::new(&spec(vec![a, a], None)), Err(ManoeuvreError::Twice(0)));
    let bad = |f: fn(&mut ManoeuvreSpec)| {
        let mut s = spec(vec![command(0, Shape::Single, Extent::Angle(0.3))], None);
        f(&mut s);
        Manoeuvre::new(&s).unwrap_err()
    };
    assert!(matches!(bad(|s| s.ramp = 0.0), ManoeuvreError::Value { what: "ramp time", .. }));
    assert!(matches!(bad(|s| s.hold = -1.0), ManoeuvreError::Value { what: "hold time", .. }));
    assert!(matches!(bad(|s| s.commands[0].joint = 3), ManoeuvreError::Joint { joint: 3, dof: 3 }));
    assert!(matches!(bad(|s| s.commands[0].extent = Extent::Angle(f64::NAN)), ManoeuvreError::Value { .. }));
    assert!(matches!(bad(|s| s.start[1] = f64::INFINITY), ManoeuvreError::Value { .. }));
    assert!(matches!(bad(|s| s.grid = Some(0.0)), ManoeuvreError::Value { .. }));
}

#[test]
fn grid_manoeuvres_keep_their_limits_exactly_and_join() {
    let model = ff_model::tree::JointLimits { lower: -3.0, upper: 3.0, velocity: 0.17, effort: 9.0 };
    let limits = [JointLimits::from_model(&model, 0.15); 3];
    for k in 1..400 {
        let grid = [None, Some(0.01), Some(0.004), Some(1.0 / 128.0)][k % 4];
        let shape = if k % 3 == 0 { Shape::Single } else { Shape::Doublet };
        let extent = if k % 5 == 0 {
            Extent::HalfPeriod { frequency: 0.05 + 0.003 * k as f64, negative: k % 2 == 0 }
        } else {
            Extent::Angle(0.0031 * k as f64 * if k % 2 == 0 { 1.0 } else { -1.0 })
        };
        let mut s = spec(vec![command(0, shape, extent)], grid);
        s.ramp = 0.02 + 0.0001 * k as f64;
        let first = Manoeuvre::new(&s).unwrap();
        let report = check_manoeuvre(&first, &limits).unwrap();
        assert!(report.holds, "{k}: {:?}", report.worst());
        // A second one starts where the first ended.
        s.start[0] = if shape == Shape::Single { s.start[0] + first.moves()[0].angle } else { s.start[0] };
        let second = Manoeuvre::new(&s).unwrap();
        let end = first.duration();
        let both = Sequence::new(vec![Box::new(first), Box::new(second)]).unwrap();
        assert!(both.breaks().contains(&end));
    }
}
