//! Records as CSV: what is written is read, and what is wrong is named.

use ff_model::diagnostics::Limit;
use ff_records::ChannelGroup;
use ff_records::file::*;
use ff_testkit::assert_within;
use ff_testkit::problem::{assert_violation, problem_of};
use nalgebra::DMatrix;

pub(crate) const N: usize = 300;

pub(crate) fn joints() -> Vec<JointColumn> {
    vec![
        JointColumn { name: "shoulder".into(), slides: false },
        JointColumn { name: "rail, left".into(), slides: true },
    ]
}
fn wave(n: usize, k: f64) -> DMatrix<f64> {
    DMatrix::from_fn(N, n, |i, j| 0.3 + (k * i as f64 + 0.7 * j as f64).sin() / 3.0)
}
fn slope(n: usize, k: f64) -> DMatrix<f64> {
    DMatrix::from_fn(N, n, |i, j| 100.0 * k * (k * i as f64 + 0.7 * j as f64).cos() / 3.0)
}

/// The text of a good record, and what is in it.
pub(crate) fn good() -> (String, [DMatrix<f64>; 6]) {
    let all = [wave(2, 0.01), slope(2, 0.01), slope(2, 0.017), wave(2, 0.023), wave(3, 0.031), wave(3, 0.041)];
    let time: Vec<f64> = (0..N).map(|i| 7.25 + i as f64 / 100.0).collect();
    let joints = joints();
    let w = CsvWriter {
        currents: &[],
        joints: &joints,
        time: &time,
        q: &all[0],
        dq: Some(&all[1]),
        ddq: Some(&all[2]),
        tau: &all[3],
        gyro: Some(&all[4]),
        acc: Some(&all[5]),
        att: None,
    };
    let mut out = Vec::new();
    w.write(&mut out).unwrap();
    (String::from_utf8(out).unwrap(), all)
}

pub(crate) fn load(text: &str, options: &ReadOptions) -> Result<Loaded, ff_model::Problems> {
    read_from(text.as_bytes(), &joints(), options)
}
pub(crate) fn refused(text: &str) -> ff_model::Problems {
    let p = load(text, &ReadOptions::default()).unwrap_err();
    assert_eq!(p.exit_code(), 12, "{p}");
    p
}
/// The text with one cell replaced: line (from 1), column (from 0).
pub(crate) fn with(text: &str, line: usize, column: usize, cell: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
    cells[column] = cell;
    lines[line - 1] = cells.join(",");
    lines.join("\n") + "\n"
}

#[test]
fn a_written_record_is_read_back_bit_for_bit() {
    let (text, [q, dq, ddq, tau, gyro, acc]) = good();
    assert!(text.starts_with("time[s],q.shoulder[rad],\"q.rail, left[m]\",dq.shoulder[rad/s],\"dq.rail, left[m/s]\""));
    let l = load(&text, &ReadOptions::default()).unwrap();
    assert!(l.warnings.0.is_empty(), "{}", l.warnings);
    let r = &l.record;
    assert_eq!((r.samples(), r.joint_names()[1].as_str(), r.t0()), (N, "rail, left", 7.25));
    assert_within!((r.dt() - 0.01).abs(), 1e-15);
    assert_eq!((r.q(), r.qd(), r.qdd()), (&q, Some(&dq), Some(&ddq)));
    assert_eq!((r.tau(), r.gyro(), r.acc()), (&tau, &gyro, Some(&acc)));
    assert_eq!(l.bytes, text.len() as u64);
}

#[test]
fn columns_in_any_order_and_unit_give_the_same_record() {
    let (text, _) = good();
    let want = load(&text, &ReadOptions::default()).unwrap().record;
    // Columns backwards, angles in degrees, times in ms, torques in mN m; lines end like on Windows, a BOM in front.
    let mut lines: Vec<String> = Vec::new();
    for (i, line) in text.replace("\"q.rail, left[m]\"", "R").lines().enumerate() {
        let line = if i == 0 {
            line.replace('R', "A")
                .replace("\"dq.rail, left[m/s]\"", "B")
                .replace("\"ddq.rail, left[m/s^2]\"", "C")
                .replace("\"tau.rail, left[N]\"", "D")
        } else {
            line.to_owned()
        };
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if i == 0 {
            cells[0] = "time[ms]".into();
            cells[1] = "q.shoulder[deg]".into();
            cells[7] = "tau.shoulder[mNm]".into();
            for (k, name) in [
                (2, "\"q.rail, left[mm]\""),
                (4, "\"qd.rail, left[m/s]\""),
                (6, "\"qdd.rail, left[m/s2]\""),
                (8, "\"tau.rail, left[N]\""),
            ] {
                cells[k] = name.into();
            }
        } else {
            for (k, factor) in [(0, 1e3), (1, 180.0 / std::f64::consts::PI), (2, 1e3), (7, 1e3)] {
                cells[k] = format!("{}", cells[k].parse::<f64>().unwrap() * factor);
            }
        }
        cells.reverse();
        lines.push(cells.join(","));
    }
    let other = format!("\u{feff}{}\r\n", lines.join("\r\n"));
    let r = load(&other, &ReadOptions::default()).unwrap().record;
    assert!((r.q() - want.q()).amax() < 1e-15 && (r.tau() - want.tau()).amax() < 1e-15);
    assert_eq!((r.gyro(), r.qd(), r.acc()), (want.gyro(), want.qd(), want.acc()));
    assert!((r.dt() - want.dt()).abs() < 1e-14 && (r.t0() - 7.25).abs() < 1e-14);
}

#[test]
fn nanoseconds_of_an_epoch_keep_every_digit() {
    let (text, _) = good();
    let lines: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(i, l)| match i {
            0 => l.replace("time[s]", "time[ns]"),
            _ => format!("{}{}", 1_763_000_000_000_000_123 + 10_000_000 * i as i64, &l[l.find(',').unwrap()..]),
        })
        .collect();
    let l = load(&(lines.join("\n") + "\n"), &ReadOptions::default()).unwrap();
    assert_eq!(l.record.dt(), 0.01);
    assert!((l.record.t0() - 1_763_000_000.01).abs() < 1e-6 && l.warnings.0.is_empty());
}

#[test]
fn d01_empty_files_and_headers_alone() {
    let (text, _) = good();
    let header = &text[..text.find('\n').unwrap() + 1];
    for t in ["", "\n", "\u{feff}", header, &format!("{header}\n\n")] {
        assert!(refused(t).has("Data::NoSamples"), "{t:?}");
    }
}

#[test]
fn d02_too_few_samples() {
    let options = ReadOptions { need_samples: N + 1, ..ReadOptions::default() };
    let p = load(&good().0, &options).unwrap_err();
    assert_violation(problem_of(&p, "Data::TooShort"), N as f64, Limit::AtLeast(N as f64 + 1.0), "samples");
}

#[test]
fn d03_cells_that_are_not_finite_have_line_and_column_and_can_make_a_gap() {
    let (text, _) = good();
    for cell in ["nan", "inf", "1e400", "-INF", ""] {
        let p = refused(&with(&text, 20, 3, cell));
        assert_eq!((p.0[0].code, p.0[0].line), ("Data::NotFinite", Some(20)), "{p}");
        assert!(p.0[0].column.is_some_and(|c| c > 20) && p.to_string().contains("dq, channel 1"), "{p}");
    }
    let p = refused(&with(&text, 20, 3, "0x1f"));
    assert!(p.has("Data::BadNumber"), "{p}");
    let all = text.lines().fold(String::new(), |s, l| s + &l.replace("0.", "x.") + "\n");
    assert!(refused(&all).0.len() < 12);
    let options = ReadOptions { drop_gaps: true, resample: true, ..ReadOptions::default() };
    let l = load(&with(&text, 20, 3, "nan"), &options).unwrap();
    assert!(l.warnings.has("Data::Dropped") && l.warnings.has("Data::Gap") && l.record.samples() == N);
    let l = load(&with(&text, 20, 3, "nan"), &ReadOptions { drop_gaps: true, ..ReadOptions::default() }).unwrap();
    assert!(l.warnings.has("Data::Gap") && l.record.tau().nrows() == N - 1, "{}", l.warnings);
}

#[test]
fn d04_rows_of_another_length_and_blank_lines() {
    let (text, _) = good();
    let mut lines: Vec<&str> = text.lines().collect();
    let cut = &lines[41][..lines[41].rfind(',').unwrap()];
    lines[41] = cut;
    let p = refused(&(lines.join("\n") + "\n"));
    assert_eq!((p.0[0].code, p.0[0].line, p.0.len()), ("Data::RowLength", Some(42), 1), "{p}");
    lines[41] = "";
    assert_eq!(refused(&(lines.join("\n") + "\n")).0[0].line, Some(42));
    assert!(load(&(text + "\n\n"), &ReadOptions::default()).is_ok());
}

#[test]
fn d05_a_last_line_without_its_end_may_be_cut() {
    let (text, _) = good();
    let p = refused(text.trim_end());
    assert!(p.has("Data::MaybeTruncated") && p.0[0].line == Some(N + 1), "{p}");
    let options = ReadOptions { allow: vec!["Data::MaybeTruncated".into()], ..ReadOptions::default() };
    let l = load(text.trim_end(), &options).unwrap();
    assert!(l.warnings.has("Data::MaybeTruncated") && l.record.samples() == N);
}

#[test]
fn d06_other_separators_are_told_by_the_file() {
    let (text, [q, _, _, tau, ..]) = good();
    let plain = text.replace("\"q.rail, left[m]\"", "q.rail[m]").replace(", left", "").replace('\"', "");
    let two = [joints()[0].clone(), JointColumn { name: "rail".into(), slides: true }];
    let told = |t: &str| read_from(t.as_bytes(), &two, &ReadOptions::default());
    for (s, word) in [(";", "semicolons"), ("\t", "tabs"), ("|", "bars")] {
        let (head, rows) = plain.split_once('\n').unwrap();
        let other = format!("{}\n{}", head.replace(',', s), rows.replace(',', s).replace('.', ","));
        for t in [other.clone(), format!("sep={s}\n{other}"), plain.replace(',', s)] {
            let l = told(&t).unwrap_or_else(|p| panic!("{p}"));
            assert_eq!((l.record.q(), l.record.tau()), (&q, &tau));
            assert!(problem_of(&l.warnings, "Data::Separator").message.contains(word), "{}", l.warnings);
        }
        // A comma beside a point may stand between thousands; rows of another length are not taken for a table.
        let both = plain.replace(',', s).replacen("7.25", "7,25", 1);
        let p = told(&both).unwrap_err();
        assert!(
            p.has("Data::Separator") && p.to_string().contains("'7,25' beside '0.") && p.to_string().contains(word),
            "{p}"
        );
        let p = told(&plain.replace(',', s).replacen(&format!("7.25{s}"), "7.25", 1)).unwrap_err();
        assert!(problem_of(&p, "Data::Separator").hint.as_ref().unwrap().contains("--separator"), "{p}");
    }
    // Numbers in quotes are CSV all the same.
    let first = text.lines().nth(1).unwrap().split(',').next().unwrap().to_owned();
    assert!(load(&with(&text, 2, 0, &format!("\"{first}\"")), &ReadOptions::default()).is_ok());
    // Decimal commas make too many cells.
    let p = refused(&text.replacen("0.3", "0,3", 1));
    assert!(problem_of(&p, "Data::RowLength").hint.is_some(), "{p}");
}

#[test]
fn d07_missing_extra_and_repeated_columns() {
    let (text, _) = good();
    let p = refused(&text.replace("gyro.y[rad/s]", "gyroscope[rad/s]"));
    let s = p.to_string();
    assert!(p.has("Data::Columns") && s.contains("gyro.y") && s.contains("gyroscope"), "{p}");
    let twice = refused(&text.replace("gyro.y[", "gyro.x["));
    assert!(twice.0.iter().any(|p| p.code == "Data::Columns" && p.object.as_deref() == Some("gyro.x")), "{twice}");
    let timeless = refused(&text.replace("time[s]", "clock[s]"));
    assert!(timeless.0.iter().any(|p| p.code == "Data::Columns" && p.object.as_deref() == Some("time")), "{timeless}");
    // An optional group is there whole or not at all.
    assert!(refused(&text.replace("acc.y[m/s^2]", "temperature")).to_string().contains("acc.y"));
    let more = text
        .lines()
        .enumerate()
        .fold(String::new(), |s, (i, l)| s + l + if i == 0 { ",temperature" } else { ",warm" } + "\n");
    assert!(problem_of(&refused(&more), "Data::Columns").hint.as_ref().unwrap().contains("--ignore"));
    let options = ReadOptions { ignore: vec!["temperature".into()], ..ReadOptions::default() };
    assert!(load(&more, &options).is_ok());
}

/// A log with encoders on both fingers: the second follows the first.
#[test]
fn columns_of_followers_are_compared_and_left_out() {
    let (text, [q, ..]) = good();
    let follower = FollowerColumn { name: "other".into(), slides: true, joint: 0, multiplier: -0.4, offset: 0.07 };
    let options = ReadOptions { followers: vec![follower], ..ReadOptions::default() };
    let with = |head: &str, shift: f64| {
        let line = |(i, l): (usize, &str)| match i {
            0 => format!("{l},{head}\n"),
            // In mm.
            i => format!(
                "{l},{},{}\n",
                1e3 * (-0.4 * q[(i - 1, 0)] + 0.07 + shift * (0.3 * i as f64).sin()),
                0.3 * i as f64
            ),
        };
        text.lines().enumerate().map(line).collect::<String>()
    };
    let both = with("q.other[mm],tau.other", 1e-4);
    let l = load(&both, &options).unwrap();
    assert_eq!((l.warnings.0.len(), l.record.q(), l.record.joint_names().len()), (1, &q, 2), "{}", l.warnings);
    let w = problem_of(&l.warnings, "Data::NotUsed");
    assert!(w.message.contains("q.other, tau.other") && w.line == Some(1), "{w}");
    // Elsewhere than its ratio says, by more than play.
    let far = load(&with("q.other[mm],tau.other", 0.05), &options).unwrap();
    let w = problem_of(&far.warnings, "Data::NotFollowing");
    let span = 0.4 * (q.column(0).max() - q.column(0).min());
    let largest = (1..=N).map(|i| (0.3 * i as f64).sin().abs()).fold(0.0, f64::max);
    let v = w.violation.as_ref().unwrap();
    let Limit::AtMost(limit) = v.limit else { panic!("{w}") };
    assert_within!((v.value - 0.05 * largest).abs() + (limit - 0.05 * span - 1e-3).abs(), 1e-12, "{w}");
    assert_violation(w, v.value, v.limit, "m");
    assert_eq!((w.object.as_deref(), far.record.q()), (Some("q.other"), &q));
    // Without a unit there is nothing to compare.
    assert_eq!(load(&with("q.other,tau.other", 0.05), &options).unwrap().warnings.0.len(), 1);
    // Of a robot without followers they are strangers.
    assert!(refused(&both).has("Data::NameMismatch"));
}

#[test]
fn d08_units_are_required_and_known() {
    let (text, _) = good();
    let p = refused(&text.replace("q.shoulder[rad]", "q.shoulder"));
    assert!(p.has("Data::UnitMissing") && p.to_string().contains("rad, mrad, urad, deg"), "{p}");
    let p = refused(&text.replace("tau.shoulder[N m]", "tau.shoulder[ft lbf]"));
    assert!(p.has("Data::UnknownUnit") && p.to_string().contains("N m, mN m"), "{p}");
    // A length is no unit of an angle.
    assert!(refused(&text.replace("q.shoulder[rad]", "q.shoulder[m]")).has("Data::UnknownUnit"));
}

#[test]
fn d11_time_must_go_forward_and_repeated_rows_can_be_left_out() {
    let (text, _) = good();
    let mut lines: Vec<&str> = text.lines().collect();
    let twice = lines[30];
    lines.insert(31, twice);
    let t = lines.join("\n") + "\n";
    let p = refused(&t);
    assert_eq!((p.0[0].code, p.0[0].line), ("Data::NonMonotone", Some(32)), "{p}");
    assert!(p.0[0].message.contains("7.54") && p.0[0].hint.is_some(), "{p}");
    let options = ReadOptions { drop_repeated: true, ..ReadOptions::default() };
    let l = load(&t, &options).unwrap();
    assert!(l.warnings.has("Data::Dropped") && l.record.samples() == N);
    lines.swap(50, 60);
    assert!(refused(&(lines.join("\n") + "\n")).has("Data::NonMonotone"));
}

#[test]
fn d12_times_in_another_unit_and_epochs_that_lose_digits() {
    let (text, _) = good();
    let stamps = |f: &dyn Fn(usize) -> String| {
        let lines: Vec<String> = text
            .lines()
            .enumerate()
            .map(|(i, l)| if i == 0 { l.to_owned() } else { format!("{}{}", f(i), &l[l.find(',').unwrap()..]) })
            .collect();
        lines.join("\n") + "\n"
    };
    let p = refused(&stamps(&|i| format!("{}", 10 * i)));
    assert!(p.has("Data::TimeScale") && p.to_string().contains("time[ms]"), "{p}");
    let p = refused(&stamps(&|i| format!("{}", 3e-6 * i as f64)));
    assert!(p.has("Data::TimeScale") && p.to_string().contains("time[s]"), "{p}");
    let p = refused(&stamps(&|i| format!("{}.5", 17_000_000_000_i64 + i as i64)));
    assert!(p.has("Data::TimeScale"), "{p}");
}

#[test]
fn d13_d14_samples_count_at_their_times_unless_resampled() {
    let (text, _) = good();
    let gap: Vec<&str> = text.lines().enumerate().filter(|(i, _)| *i != 100).map(|(_, l)| l).collect();
    let gap = gap.join("\n") + "\n";
    let l = load(&gap, &ReadOptions::default()).unwrap();
    assert!(l.warnings.has("Data::Gap") && !l.record.is_uniform() && l.record.q().nrows() == N - 1);
    let options = ReadOptions { resample: true, ..ReadOptions::default() };
    let l = load(&gap, &options).unwrap();
    assert!(l.warnings.has("Data::Gap") && l.record.samples() == N);
    let t = with(&text, 100, 0, "8.2322");
    let l = load(&t, &ReadOptions::default()).unwrap();
    // Its readings are those of the even clock: the stamp alone is wrong.
    assert!(l.warnings.has("Data::Jitter") && l.record.is_uniform() && l.record.q().nrows() == N, "{}", l.warnings);
    assert!(load(&t, &options).unwrap().warnings.has("Data::Resampled"));
}

#[test]
fn empty_cells_are_channels_at_a_rate_of_their_own() {
    let (text, _) = good();
    // Behind the time: two columns each of q, dq, ddq and tau.
    let without = |l: &str| -> String {
        let cells = l.split(',').enumerate().map(|(k, c)| if (7..9).contains(&k) { "" } else { c });
        cells.collect::<Vec<_>>().join(",")
    };
    let lines = text.lines().enumerate();
    let half: Vec<String> = lines.map(|(i, l)| if i > 0 && i % 2 == 0 { without(l) } else { l.to_owned() }).collect();
    let l = load(&(half.join("\n") + "\n"), &ReadOptions::default()).unwrap();
    let whole = load(&text, &ReadOptions::default()).unwrap().record;
    let times = l.record.times(ChannelGroup::Torque).unwrap();
    assert_eq!((times.len(), l.record.tau().nrows(), l.record.q().nrows()), (N.div_ceil(2), N.div_ceil(2), N));
    assert!(l.record.times(ChannelGroup::Motion).is_none() && l.warnings.has("Data::SampledApart"), "{}", l.warnings);
    assert!((times[7] - whole.time(14)).abs() < 1e-9);
    assert_eq!(l.record.tau().row(7), whole.tau().row(14));
    // Part of a group is a cell that is missing.
    let cut = half[21].rfind(',').unwrap();
    let p = refused(&(half[..21].join("\n") + "\n" + &half[21][..=cut] + "\n" + &half[22..].join("\n") + "\n"));
    assert_eq!((p.0[0].code, p.0[0].line), ("Data::NotFinite", Some(22)), "{p}");
}

#[test]
fn marks_of_missing_numbers_are_empty_cells() {
    let (text, _) = good();
    // Behind the time: two columns each of q, dq, ddq and tau, three of the gyro and three of the accelerometer.
    let filled = |columns: core::ops::Range<usize>, odd: &str, even: &str| {
        let one = |(i, l): (usize, &str)| -> String {
            let cell = if i % 2 == 0 { even } else { odd };
            let of = |(k, c)| if i > 0 && columns.contains(&k) && cell != "as it is" { cell } else { c };
            l.split(',').enumerate().map(of).collect::<Vec<_>>().join(",") + "\n"
        };
        text.lines().enumerate().map(one).collect::<String>()
    };
    let options = ReadOptions::default();
    let want = load(&filled(9..12, "as it is", ""), &options).unwrap();
    for mark in ["NaN", "NA", "null", "None", "-"] {
        let l = load(&filled(9..12, "as it is", mark), &options).unwrap();
        assert!(
            l.warnings.to_string().contains("gyro: 150 samples in 300 rows, no number in the other 150"),
            "{}",
            l.warnings
        );
        assert_eq!(l.record.gyro(), want.record.gyro());
    }
    // Never measured: what is required is named once, and what is not is left out.
    let p = refused(&filled(9..12, "NaN", "NaN"));
    assert!(p.has("Data::NoSamples") && p.0.iter().filter(|p| p.code != "Data::NotUsed").count() == 1, "{p}");
    for unused in [3..5, 12..15] {
        let l = load(&filled(unused, "NaN", "NaN"), &options).unwrap();
        assert!(l.warnings.has("Data::NotUsed") && l.record.q().nrows() == N, "{}", l.warnings);
    }
    // A row without a time, and rates in half of the rows.
    let p = refused(&with(&text, 20, 0, "NaN"));
    assert_eq!((p.0[0].code, p.0[0].line, p.0.len()), ("Data::NotFinite", Some(20), 1), "{p}");
    assert!(refused(&filled(3..5, "as it is", "NaN")).to_string().contains("150 of 300 rows"));
}

#[test]
fn held_readings_of_a_slow_sensor_count_once() {
    let (text, _) = good();
    let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    let held = |columns: core::ops::Range<usize>| {
        let one = |i: usize| -> String {
            let from = if i > 0 { (i - 1) / 3 * 3 + 1 } else { 0 };
            let of = |k: usize| lines[if columns.contains(&k) { from } else { i }][k];
            (0..lines[i].len()).map(of).collect::<Vec<_>>().join(",") + "\n"
        };
        (0..lines.len()).map(one).collect::<String>()
    };
    let l = load(&held(9..12), &ReadOptions::default()).unwrap();
    assert!(l.warnings.has("Data::Held") && !l.warnings.has("Data::SampledApart"), "{}", l.warnings);
    assert!(l.warnings.to_string().contains("every 3.000 rows, 33.3333 Hz"), "{}", l.warnings);
    assert_eq!(l.record.times(ChannelGroup::Gyro).map(<[f64]>::len), Some(N / 3));
    // A motor may hold its torque.
    let l =
        load(&held(7..9), &ReadOptions { allow: vec!["Data::Saturated".into()], ..ReadOptions::default() }).unwrap();
    assert!(l.warnings.has("Data::Held") && l.record.tau().nrows() == N, "{}", l.warnings);
}

#[test]
fn d34_limits_come_before_memory() {
    let (text, _) = good();
    let p = load(&text, &ReadOptions { max_rows: 100, ..ReadOptions::default() }).unwrap_err();
    let too_large = problem_of(&p, "Data::TooLarge");
    assert_violation(too_large, 101.0, Limit::AtMost(100.0), "rows");
    assert!(too_large.line == Some(102) && too_large.hint.is_some(), "{p}");
    let p = load(&text, &ReadOptions { max_bytes: 5000, ..ReadOptions::default() }).unwrap_err();
    let of_bytes = problem_of(&p, "Data::TooLarge").violation.as_ref().unwrap();
    assert!(of_bytes.value > 5000.0 && of_bytes.limit == Limit::AtMost(5000.0) && of_bytes.unit == "bytes", "{p}");
    let endless = std::io::BufReader::new(std::io::Read::take(std::io::repeat(b'a'), 1 << 30));
    assert!(read_from(endless, &joints(), &ReadOptions::default()).unwrap_err().has("Data::TooLarge"));
    // A file is refused by its size before it is read.
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("huge.csv");
    std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    let p = read(&path, &joints(), &ReadOptions::default()).unwrap_err();
    let huge = problem_of(&p, "Data::TooLarge");
    assert_eq!(huge.file.as_deref(), Some(path.as_path()), "{p}");
    assert_eq!(huge.violation.as_ref().unwrap().value, 2f64.powi(40), "{p}");
}

#[test]
fn d37_joints_of_another_robot() {
    let (text, _) = good();
    let p = refused(&text.replace("shoulder", "shoulder_pan"));
    assert!(p.has("Data::NameMismatch"), "{p}");
    let s = &problem_of(&p, "Data::NameMismatch").message;
    assert!(s.contains("shoulder_pan") && s.ends_with("shoulder"), "{p}");
}

#[test]
fn files_that_are_not_text_or_not_there() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(read(&dir.path().join("none.csv"), &joints(), &ReadOptions::default()).unwrap_err().exit_code(), 20);
    assert_eq!(read(dir.path(), &joints(), &ReadOptions::default()).unwrap_err().exit_code(), 20);
    let path = dir.path().join("latin1.csv");
    std::fs::write(&path, b"time[s],q.Gelenk_\xfc[rad]\n0,1\n").unwrap();
    let p = read(&path, &joints(), &ReadOptions::default()).unwrap_err();
    let p = problem_of(&p, "Data::NotUtf8");
    assert_eq!((p.file.as_deref(), p.line, p.column), (Some(path.as_path()), Some(1), Some(18)), "{p}");
    for bytes in [&b"\"\n"[..], b"\0\0\0", b"time[s]\n\"", b",,,\n,,,\n", b"[s]\n1\n", b"time[,]\n"] {
        let p = read_from(bytes, &joints(), &ReadOptions::default()).unwrap_err();
        assert_eq!(p.exit_code(), 12, "{p}");
    }
}

#[test]
fn a_base_that_is_bolted_down_needs_no_gyro() {
    let (text, [_, _, _, tau, ..]) = good();
    // A comma in a joint name would be quoted; the columns before it count the same in every line.
    let plain = text.replace("rail, left", "rail").replace('"', "");
    let joints = [joints()[0].clone(), JointColumn { name: "rail".into(), slides: true }];
    let head = plain.lines().next().unwrap();
    let gyro: Vec<usize> =
        head.split(',').enumerate().filter(|(_, c)| c.starts_with("gyro.")).map(|(i, _)| i).collect();
    assert_eq!(gyro.len(), 3);
    let cut = |line: &str| {
        let kept: Vec<&str> = line.split(',').enumerate().filter(|(i, _)| !gyro.contains(i)).map(|(_, c)| c).collect();
        kept.join(",") + "\n"
    };
    let short: String = plain.lines().map(cut).collect();
    let fixed = ReadOptions { fixed_base: true, ..ReadOptions::default() };
    let r = read_from(short.as_bytes(), &joints, &fixed).unwrap().record;
    assert!(r.is_fixed_base() && r.tau() == &tau && r.gyro().amax() == 0.0);
    // Half a gyro is none, and a floating base needs a whole one.
    let half = short.replacen("time[s]", "time[s],gyro.x[rad/s]", 1);
    let p = read_from(half.as_bytes(), &joints, &fixed).unwrap_err();
    assert!(p.0[0].message.contains("gyro.y, gyro.z"), "{p}");
    let p = read_from(short.as_bytes(), &joints, &ReadOptions::default()).unwrap_err();
    assert!(p.0[0].message.contains("gyro.x, gyro.y, gyro.z"), "{p}");
}

#[test]
fn encoders_that_begin_anew_after_a_turn_are_unwrapped() {
    let one = [JointColumn { name: "a".into(), slides: false }];
    let mut text = String::from("time[s],q.a[deg],tau.a[N m]\n");
    let angle = |i: usize| 700.0 * (0.02 * i as f64).sin();
    for i in 0..400 {
        let wrapped = angle(i).rem_euclid(360.0);
        text.push_str(&format!("{},{wrapped},{}\n", 0.01 * i as f64, (0.3 * i as f64).sin()));
    }
    let options = ReadOptions { fixed_base: true, ..ReadOptions::default() };
    let l = read_from(text.as_bytes(), &one, &options).unwrap();
    assert!(l.warnings.has("Data::Wrapped"), "{}", l.warnings);
    let worst = (0..400).map(|i| (l.record.q()[(i, 0)] - angle(i).to_radians()).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}");
    // A joint that slides may move by six metres.
    let slides = [JointColumn { name: "a".into(), slides: true }];
    let text = "time[s],q.a[m],tau.a[N]\n0,0.5,1\n0.1,6.9,2\n0.2,7.1,1.5\n0.3,7,1\n";
    let l = read_from(text.as_bytes(), &slides, &options).unwrap();
    assert!(!l.warnings.has("Data::Wrapped") && l.record.q()[(1, 0)] == 6.9, "{}", l.warnings);
}

#[test]
fn currents_wheels_and_wrenches_are_read_with_their_units() {
    let two = ["a", "b"].map(|n| JointColumn { name: n.into(), slides: false });
    let head = "time[s],q.a[rad],q.b[rad],tau.a[N m],current.b[mA],wheel.x[rpm],wrench.tool.fx[N],wrench.tool.fy[N],wrench.tool.fz[N],\
                wrench.tool.tx[N m],wrench.tool.ty[N m],wrench.tool.tz[mN m]\n";
    let mut text = head.to_owned();
    for i in 0..50 {
        let s = |k: f64| (0.3 * i as f64 + k).sin();
        text.push_str(&format!(
            "{},{},{},{},{},{},{},{},{},{},{},{}\n",
            0.01 * i as f64,
            s(0.1),
            s(0.2),
            s(0.3),
            1500.0 * s(0.4),
            30.0,
            s(0.5),
            s(0.6),
            s(0.7),
            s(0.8),
            s(0.9),
            250.0
        ));
    }
    let options = ReadOptions { fixed_base: true, ..ReadOptions::default() };
    let l = read_from(text.as_bytes(), &two, &options).unwrap();
    let r = &l.record;
    assert_eq!((r.currents(), r.has_torques()), (&[false, true][..], false));
    assert!((r.tau()[(7, 1)] - 1.5 * (0.3f64 * 7.0 + 0.4).sin()).abs() < 1e-12);
    assert_eq!(r.response_names()[..2], ["tau.a".to_owned(), "current.b".to_owned()]);
    let c = r.window(0.1, 0.4).unwrap().carried().unwrap().clone();
    let (frame, columns) = c.wrenches().remove(0);
    assert_eq!((frame.as_str(), c.units[0], c.values.nrows()), ("tool", "rad/s", 30));
    assert!(
        (c.values[(0, 0)] - std::f64::consts::PI).abs() < 1e-12 && (c.values[(3, columns[5])] - 0.25).abs() < 1e-12
    );
    // A torque or a current of every joint, and all of a wrench.
    let p = read_from(text.replace("current.b[mA]", "wheel.y[rpm]").as_bytes(), &two, &options).unwrap_err();
    assert!(p.has("Data::Columns") && p.to_string().contains("tau.b"), "{p}");
    let p = read_from(text.replace("wrench.tool.tz[mN m]", "wheel.y[rpm]").as_bytes(), &two, &options).unwrap_err();
    assert!(p.to_string().contains("wrench.tool.tz"), "{p}");
}

#[test]
fn archives_are_named() {
    for (bytes, what) in
        [(&b"\x1f\x8b\x08\0abc"[..], "gunzip"), (b"SQLite format 3\0", "MCAP"), (b"PK\x03\x04rest", "unpack")]
    {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), bytes).unwrap();
        let p = read(f.path(), &[], &ReadOptions::default()).unwrap_err();
        assert!(p.has("Data::Format") && p.to_string().contains(what), "{p}");
    }
}
