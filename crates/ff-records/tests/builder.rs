//! Columns become a record, or are refused with every reason at once.

use approx::assert_relative_eq;
use ff_model::Severity;
use ff_records::builder::*;
use ff_records::{ChannelGroup, Record};
use ff_testkit::problem::problem_of;
use ff_testkit::scaled;
use nalgebra::DMatrix;

const N: usize = 400;

fn wave(n: usize, k: f64) -> DMatrix<f64> {
    DMatrix::from_fn(N, n, |i, j| 0.3 + (k * i as f64 + 0.7 * j as f64).sin())
}
fn good() -> RecordBuilder {
    RecordBuilder::new(["a", "b"]).uniform(3.0, 100.0).q(wave(2, 0.01)).tau(wave(2, 0.023)).gyro(wave(3, 0.017))
}
fn code_of(b: RecordBuilder) -> &'static str {
    let p = b.build().unwrap_err();
    assert_eq!(p.exit_code(), 12, "{p}");
    p.0[0].code
}

#[test]
fn a_good_record_passes_and_is_cut_by_time() {
    let (r, w) = good().build().unwrap();
    assert!(w.0.is_empty());
    assert_relative_eq!(r.seconds(), 4.0, max_relative = scaled(1e-12));
    let c = r.window(0.5, 1.25).unwrap();
    assert_eq!((c.samples(), c.joints()), (75, 2));
    assert_eq!(c.tau()[(3, 1)], r.tau()[(53, 1)]);
    assert_relative_eq!(c.t0(), 3.5);
    assert_eq!(r.window(0.5, 0.505).unwrap_err().exit_code(), 12);
    assert!(r.window(f64::NAN, 1.0).is_err() && r.window(2.0, 1.0).is_err());
    assert_eq!((r.responses().ncols(), &r.response_names()[1][..]), (5, "tau.b"));
    assert!(r.check_joints(&["a".into(), "b".into()]).is_ok());
    for (other, named) in [(["a", "c"], "c"), (["b", "a"], "b")] {
        let p = r.check_joints(&other.map(String::from)).unwrap_err();
        let p = problem_of(&p, "Data::NameMismatch");
        assert!(p.message.contains(&format!("{named:?}")) && p.hint.is_some(), "{p}");
    }
}

#[test]
fn each_defect_has_its_code() {
    let none = DMatrix::zeros(0, 2);
    assert_eq!(code_of(good().q(none)), "Data::NoSamples");
    assert_eq!(code_of(good().need_samples(500)), "Data::TooShort");
    assert_eq!(code_of(good().gyro(wave(2, 0.1))), "Data::Shape");
    assert_eq!(code_of(RecordBuilder::new(["a"]).uniform(0.0, 10.0)), "Data::Missing");
    assert_eq!(code_of(RecordBuilder::new(["a", "a"])), "Data::DuplicateName");
    assert_eq!(code_of(good().uniform(0.0, 0.1)), "Data::TimeScale");
    assert_eq!(code_of(good().uniform(0.0, 0.0)), "Data::TimeScale");
    let mut tau = wave(2, 0.023);
    tau[(17, 1)] = f64::NAN;
    let p = good().tau(tau).build().unwrap_err();
    assert!(p.to_string().contains("tau: column 1 row 17 is NaN"), "{p}");
    let mut dead = wave(3, 0.017);
    dead.column_mut(2).fill(0.25);
    assert_eq!(code_of(good().gyro(dead.clone())), "Data::Stuck");
    let (_, w) = good().gyro(dead).allow("Data::Stuck").build().unwrap();
    assert!(w.has("Data::Stuck") && !w.has_errors());
    let rate = DMatrix::from_fn(N, 2, |i, j| (0.01 * i as f64 + 0.7 * j as f64).cos());
    assert!(good().qd(rate.clone()).build().unwrap().1.0.is_empty());
    assert_eq!(code_of(good().qd(rate.clone()).q(wave(2, 0.01) * 57.3)), "Data::LooksLikeDegrees");
    assert_eq!(code_of(good().qd(rate * 57.3)), "Data::LooksLikeDegrees");
}

#[test]
fn all_problems_come_at_once() {
    let mut gyro = wave(3, 0.017);
    gyro[(1, 1)] = f64::INFINITY;
    let p = good().gyro(gyro).tau(wave(1, 0.2)).need_samples(1000).build().unwrap_err();
    for code in ["Data::TooShort", "Data::Shape", "Data::NotFinite"] {
        assert!(p.has(code), "{p}");
    }
}

#[test]
fn clocks_are_uniform_or_refused() {
    let clean: Vec<f64> = (0..N).map(|i| 7.3 + 0.01 * i as f64).collect();
    assert_relative_eq!(good().stamps(clean.clone()).build().unwrap().0.rate_hz(), 100.0, max_relative = scaled(1e-9));
    let mut back = clean.clone();
    back[40] = back[39];
    assert_eq!(code_of(good().stamps(back)), "Data::NonMonotone");
    assert_eq!(code_of(good().stamps(clean.iter().map(|t| t * 1e3).collect())), "Data::TimeScale");
    assert_eq!(code_of(good().stamps(clean[1..].to_vec())), "Data::Shape");
    let jitter: Vec<f64> = clean.iter().enumerate().map(|(i, t)| t + 0.003 * (1.3 * i as f64).sin()).collect();
    let wave_at = |t: &[f64]| DMatrix::from_fn(N, 2, |i, j| (2.0 * (t[i] - t[0]) + 0.7 * j as f64).sin());
    // Without leave to resample, samples count at their own times.
    let (r, w) = good().stamps(jitter.clone()).q(wave_at(&jitter)).build().unwrap();
    assert!(w.has("Data::Jitter") && !w.has("Data::Resampled"), "{w}");
    let times = r.times(ChannelGroup::Torque).unwrap();
    assert!(times.len() == N && (times[200] - (jitter[200] - jitter[0])).abs() < 1e-12);
    let (r, w) = good().stamps(jitter.clone()).q(wave_at(&jitter)).resample(true).build().unwrap();
    assert!(w.has("Data::Resampled"));
    assert_relative_eq!(r.q()[(200, 1)], (2.0 * r.time(200) + 0.7).sin(), epsilon = scaled(5e-4));
    let gap: Vec<f64> = clean.iter().enumerate().map(|(i, t)| t + if i >= 100 { 0.02 } else { 0.0 }).collect();
    let (r, w) = good().stamps(gap.clone()).build().unwrap();
    assert!(w.has("Data::Gap") && !r.is_uniform() && r.tau().nrows() == N, "{w}");
    let (r, w) = good().stamps(gap).resample(true).build().unwrap();
    assert_eq!((r.samples(), w.has("Data::Gap")), (N + 2, true));
    let hole: Vec<f64> = clean.iter().enumerate().map(|(i, t)| t + if i >= 100 { 0.2 } else { 0.0 }).collect();
    assert_eq!(code_of(good().stamps(hole.clone()).resample(true)), "Data::Gap");
    // The motion cannot be interpolated across it: refused, or cut there.
    assert_eq!(code_of(good().stamps(hole.clone())), "Data::Gap");
    let (r, w) = good().stamps(hole).long_gaps(true).build().unwrap();
    let parts = r.split(0.1);
    assert!(w.has("Data::Gap") && r.has_wide_gaps() && parts.len() == 2, "{w}");
    assert_eq!(parts.iter().map(|p| p.q().nrows()).sum::<usize>(), N);
    assert!((parts[1].t0() - parts[0].t0() - 1.2).abs() < 1e-9 && !parts[1].has_wide_gaps());
}

/// Rows of positions that are left out do not move torques and gyro, wherever a part or a window begins.
#[test]
fn channels_stay_at_their_times_where_positions_are_left_out() {
    let mut q = wave(2, 0.01);
    for i in 61..140 {
        q[(i, 1)] = q[(60, 1)];
    }
    q[(200, 0)] += 0.3;
    let (r, w) = good().q(q.clone()).build().unwrap();
    assert!(w.has("Data::Stuck") && w.has("Data::Spikes") && !w.has_errors(), "{w}");
    assert_eq!((r.q().nrows(), r.tau().nrows()), (N - 80, N));
    let is_part = |part: &Record| {
        let of = |m: &DMatrix<f64>, all: &DMatrix<f64>, g: ChannelGroup| {
            assert!(m.nrows() > 10);
            for (i, t) in (0..m.nrows()).map(|i| (i, part.times(g).map_or_else(|| part.time(i), |t| t[i]))) {
                let at = ((part.t0() + t - r.t0()) / r.dt()).round() as usize;
                assert_eq!(m.row(i), all.row(at), "{g:?} {i}");
            }
        };
        of(part.q(), &q, ChannelGroup::Motion);
        of(part.tau(), r.tau(), ChannelGroup::Torque);
        of(part.gyro(), r.gyro(), ChannelGroup::Gyro);
    };
    let parts = r.split(0.1);
    assert_eq!(parts.len(), 2);
    parts.iter().for_each(is_part);
    is_part(&r.window(r.time(200), r.time(280)).unwrap());
    // As they were.
    let (kept, w) = good().q(q).allow("Data::Stuck").keep_spikes(true).build().unwrap();
    assert!(w.has("Data::Stuck") && kept.is_uniform(), "{w}");
}

#[test]
fn attitude_signs_are_made_continuous() {
    let att = DMatrix::from_fn(N, 4, |i, k| {
        let a = 0.004 * i as f64 + 0.2;
        let sign = if i % 7 == 3 { -1.0 } else { 1.0 };
        sign * [a.cos(), 0.6 * a.sin(), 0.8 * a.sin(), 0.0][k]
    });
    let (r, _) = good().att(att.clone()).build().unwrap();
    let a = r.att().unwrap();
    assert!((1..N).all(|i| a.row(i).dot(&a.row(i - 1)) > 0.99));
    assert_eq!(code_of(good().att(att * 1.01)), "Data::Quaternion");
}

#[test]
fn a_record_on_the_ground_needs_no_gyro() {
    let bolted = || RecordBuilder::new(["a", "b"]).uniform(3.0, 100.0).q(wave(2, 0.01)).tau(wave(2, 0.023));
    assert_eq!(code_of(bolted()), "Data::Missing");
    let (r, w) = bolted().fixed_base().build().unwrap();
    assert!(w.0.is_empty() && r.is_fixed_base() && r.window(0.5, 1.0).unwrap().is_fixed_base());
    assert_eq!((r.gyro().shape(), r.gyro().amax()), ((N, 3), 0.0));
    // One that is given is kept and checked.
    assert_eq!(bolted().fixed_base().gyro(wave(3, 0.017)).build().unwrap().0.gyro(), &wave(3, 0.017));
    assert_eq!(code_of(bolted().fixed_base().gyro(wave(2, 0.017))), "Data::Shape");
    assert!(!good().build().unwrap().0.is_fixed_base());
}

/// Times about 10 ms apart with jitter, every tenth lost.
fn own(from: f64) -> Vec<f64> {
    (0..N).filter(|i| i % 10 != 7).map(|i| from + 0.01 * (i as f64 + 0.2 * (1.9 * i as f64).sin())).collect()
}
fn at(t: &[f64], channels: usize) -> DMatrix<f64> {
    DMatrix::from_fn(t.len(), channels, |i, j| (1.7 * t[i] + 0.7 * j as f64).sin())
}

#[test]
fn groups_of_channels_have_times_of_their_own() {
    let t: Vec<f64> = own(3.005).into_iter().filter(|t| *t < 6.989).collect();
    let (r, w) = good().tau(at(&t, 2)).times(ChannelGroup::Torque, t.clone()).build().unwrap();
    let own_times = r.times(ChannelGroup::Torque).unwrap();
    assert!(!r.is_uniform() && r.times(ChannelGroup::Gyro).is_none() && own_times.len() == t.len());
    assert_eq!((r.samples(), r.tau(), r.gyro().nrows()), (N, &at(&t, 2), N));
    assert_relative_eq!(own_times[5], t[5] - 3.0, epsilon = 1e-12);
    let p = w.0.iter().find(|p| p.code == "Data::Gap").unwrap();
    assert_eq!((p.object.as_deref(), w.has_errors()), (Some("torque times"), false), "{p}");
    // A window keeps what lies inside, and counts from its beginning.
    let c = r.window(0.5, 1.25).unwrap();
    let first = t.iter().position(|t| *t >= 3.5).unwrap();
    assert_eq!((c.samples(), c.tau().row(0)), (75, r.tau().row(first)));
    assert_relative_eq!(c.times(ChannelGroup::Torque).unwrap()[0], t[first] - 3.5, epsilon = 1e-9);
    let thin = r.thinned(3).unwrap();
    assert_eq!((thin.tau().nrows(), thin.gyro().nrows()), (t.len().div_ceil(3), N.div_ceil(3)));
    assert_eq!(thin.times(ChannelGroup::Torque).unwrap()[4], own_times[12]);
    // Back on the clock, which begins and ends within an interval of the torques.
    let back = r.resampled().unwrap();
    assert!(back.is_uniform());
    assert_relative_eq!(back.tau()[(200, 1)], (1.7 * 5.0f64 + 0.7).sin(), epsilon = 1e-9);
}

#[test]
fn a_joint_motion_with_times_of_its_own_spans_a_grid() {
    let (q, s) = (own(12.0), own(12.02).into_iter().filter(|t| *t < 15.9).collect::<Vec<_>>());
    let b = || {
        let b = RecordBuilder::new(["a", "b"]).q(at(&q, 2)).times(ChannelGroup::Motion, q.clone()).tau(at(&s, 2));
        b.times(ChannelGroup::Torque, s.clone()).gyro(at(&s, 3)).times(ChannelGroup::Gyro, s.clone())
    };
    let (r, _) = b().grid(50.0).build().unwrap();
    assert_eq!((r.t0(), r.q().nrows()), (q[0], q.len()));
    // Whole intervals, as near to the rate as the ends allow.
    assert_relative_eq!(r.time(r.samples() - 1), q[q.len() - 1] - q[0], max_relative = 1e-12);
    assert!((r.rate_hz() / 50.0 - 1.0).abs() < 0.01, "{}", r.rate_hz());
    // The median interval is that of the jittered times.
    assert!((b().build().unwrap().0.rate_hz() / 100.0 - 1.0).abs() < 0.2);
    let c = r.window(1.0, 2.5).unwrap();
    assert_eq!(c.times(ChannelGroup::Motion).unwrap()[0], 0.0);
    let end = c.time(c.samples() - 1);
    assert!(ChannelGroup::ALL[..3].iter().all(|g| c.times(*g).unwrap().iter().all(|t| (0.0..=end).contains(t))));
    assert_eq!(code_of(b().uniform(12.0, 100.0)), "Data::Clock");
    assert!(b().grid(0.0).build().unwrap_err().has("Data::TimeScale"));
    let none = RecordBuilder::new(["a", "b"]).q(at(&q, 2)).times(ChannelGroup::Motion, q.clone());
    assert_eq!(code_of(none.tau(at(&q, 2)).gyro(at(&q, 3))), "Data::Missing");
}

#[test]
fn each_defect_of_times_has_its_code_and_names_its_place() {
    let t: Vec<f64> = own(3.01).into_iter().filter(|t| *t < 6.9).collect();
    let with = |t: &[f64]| good().tau(at(t, 2)).times(ChannelGroup::Torque, t.to_vec());
    let spoiled = |f: &dyn Fn(&mut Vec<f64>)| {
        let mut t = t.clone();
        f(&mut t);
        let all = with(&t).build().unwrap_err().0;
        all.into_iter().find(|p| p.severity == Severity::Error).unwrap()
    };
    let p = spoiled(&|t| t[40] = t[39]);
    assert_eq!((p.code, p.object.as_deref()), ("Data::NonMonotone", Some("torque times")));
    assert!(p.to_string().contains("sample 40"), "{p}");
    assert_eq!(spoiled(&|t| t[40] = f64::NAN).code, "Data::NotFinite");
    assert_eq!(spoiled(&|t| t.iter_mut().for_each(|t| *t *= 1e3)).code, "Data::Outside");
    let p = spoiled(&|t| t[0] = 2.9);
    assert!(p.code == "Data::Outside" && p.to_string().contains("sample 0 at 2.9 s"), "{p}");
    assert_eq!(code_of(with(&t).tau(at(&t[1..], 2))), "Data::Shape");
    assert_eq!(code_of(with(&t[..1])), "Data::TooShort");
    assert_eq!(code_of(with(&t).need_samples(390)), "Data::TooShort");
    // Joint motion must be known everywhere.
    let mut q = own(3.0);
    q.drain(50..60);
    let b = RecordBuilder::new(["a", "b"]).q(at(&q, 2)).times(ChannelGroup::Motion, q.clone());
    let b =
        b.tau(at(&q, 2)).times(ChannelGroup::Torque, q.clone()).gyro(at(&q, 3)).times(ChannelGroup::Gyro, q.clone());
    let p = b.clone().build().unwrap_err();
    assert!(p.has("Data::Gap") && p.to_string().contains("limit 4 intervals"), "{p}");
    assert!(b.allow("Data::Gap").build().is_ok());
}

#[test]
fn readings_that_do_not_count_stay_so_in_parts_of_a_record() {
    let of = |n: usize, c: usize| DMatrix::from_fn(n, c, |i, k| (0.3 * i as f64 + 1.7 * k as f64).sin());
    let built = RecordBuilder::new(["a"]).uniform(3.7, 50.0).q(of(200, 1)).tau(of(200, 1)).gyro(of(200, 3));
    let record = built.build().unwrap().0.with_uncounted(&[(0.31, 0.37), (2.49, 2.51)]);
    let counted = |r: &Record| (0..r.samples()).filter(|&i| !r.counts(r.time(i))).collect::<Vec<_>>();
    assert_eq!(counted(&record), [16, 17, 18, 125]);
    // By the clock of the recorder, wherever a part begins.
    let part = record.window(0.33, 3.0).unwrap();
    assert_eq!(counted(&part), [0, 1, 108]);
    assert_eq!(counted(&record.rows(120..200)), [5]);
    assert_eq!(counted(&record.clone().with_tau(of(200, 1))), counted(&record));
    assert!(counted(&record.resampled().unwrap()) == counted(&record));
}
