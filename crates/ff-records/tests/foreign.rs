//! Records under names, in encodings and in files of other programs.

use crate::csv::{N, good, joints, load, refused};
use ff_records::file::*;
use ff_testkit::problem::problem_of;
use nalgebra::DMatrix;

/// The name of a channel: its group, and its number in it.
type Names<'f> = &'f dyn Fn(&str, usize) -> String;

/// Three joints and a gyro under names of others: the record, or what is said.
fn others(
    names: Names<'_>,
    more: &str,
    joints: [&str; 3],
    options: &ReadOptions,
) -> Result<Loaded, ff_model::Problems> {
    let joints: Vec<JointColumn> = joints.map(|n| JointColumn { name: n.into(), slides: false }).to_vec();
    let groups = ["q", "tau", "gyro"];
    let mut text = "time[s]".to_owned();
    groups.iter().for_each(|g| (0..3).for_each(|k| text += &format!(",{}", names(g, k))));
    text += more;
    text.push('\n');
    let extra = more.matches(',').count();
    for i in 0..100 {
        text += &format!("{}", 0.01 * i as f64);
        (0..9).for_each(|c| text += &format!(",{}", (0.1 * i as f64 + f64::from(c)).sin()));
        text += &",0.5".repeat(extra);
        text.push('\n');
    }
    read_from(text.as_bytes(), &joints, options)
}

#[test]
fn columns_of_other_programs_are_taken_where_they_say_one_thing() {
    let arm = ["shoulder", "elbow", "wrist"];
    let default = ReadOptions::default();
    let own = |g: &str, k: usize| match g {
        "gyro" => format!("gyro.{}[rad/s]", ["x", "y", "z"][k]),
        _ => format!("{g}.{}[{}]", arm[k], if g == "q" { "rad" } else { "N m" }),
    };
    let plain = others(&own, "", arm, &default).unwrap();
    assert!(plain.warnings.0.is_empty(), "{}", plain.warnings);
    let pick = |g: &str, of: [&str; 3]| of[["q", "tau", "gyro"].iter().position(|n| *n == g).unwrap()].to_owned();
    // By numbers from 0 or from 1, with units in brackets, in the name or in the definition of the message; by names among other words.
    let ways: [Names<'_>; 6] = [
        &|g, k| {
            pick(g, [&format!("q{}[rad]", k + 1), &format!("tau_{k} [Nm]"), &format!("w{}[rad/s]", ["x", "y", "z"][k])])
        },
        &|g, k| {
            pick(
                g,
                [
                    &format!("joint_{}_pos (rad)", k + 1),
                    &format!("eff_{} (N m)", k + 1),
                    &format!("gyro_{}[rad/s]", k + 1),
                ],
            )
        },
        &|g, k| {
            pick(
                g,
                [
                    &format!("pos_joint{}_rad", k + 1),
                    &format!("tau{}_Nm", k + 1),
                    &format!("imu_gyro_{}_rad_s", ["x", "y", "z"][k]),
                ],
            )
        },
        &|g, k| {
            pick(
                g,
                [
                    &format!("/joint_states/position.{k}"),
                    &format!("/joint_states/effort[{k}]"),
                    &format!("/imu/angular_velocity/{}", ["x", "y", "z"][k]),
                ],
            )
        },
        &|g, k| {
            pick(
                g,
                [
                    &format!("/joint_states/{}/position", arm[k]),
                    &format!("/joint_states/{}/effort", arm[k]),
                    &format!("/imu/angular_velocity/{}", ["x", "y", "z"][k]),
                ],
            )
        },
        &|g, k| {
            pick(
                g,
                [
                    &format!("Joint {} Position [rad]", k + 1),
                    &format!("Torque {} [Nm]", k + 1),
                    &format!("Gyro {} [rad/s]", ["X", "Y", "Z"][k]),
                ],
            )
        },
    ];
    for names in ways {
        let l = others(names, "", arm, &default).unwrap_or_else(|p| panic!("{p}"));
        assert!(l.record == plain.record);
        let said = l.warnings.to_string();
        assert!(
            l.warnings.has("Data::Named")
                && said.contains(&format!("'{}' as q.wrist", name_and_unit(&names("q", 2)).0)),
            "{said}"
        );
    }
    // What has no unit is asked for it, with the rule that gives it.
    let bare = |g: &str, k: usize| {
        pick(g, [&format!("q{k}"), &format!("position_tau{k}"), &own(g, k)]).replace("position_", "")
    };
    let p = others(&bare, "", arm, &default).unwrap_err();
    assert!(p.to_string().contains("--rename 'q*=q*[rad]'") && p.has("Data::UnitMissing"), "{p}");
    let rename = [("q*", "q*[rad]"), ("tau*", "tau*[N m]")].map(|(a, b)| (a.to_owned(), b.to_owned())).to_vec();
    assert!(others(&bare, "", arm, &ReadOptions { rename, ..default.clone() }).unwrap().record == plain.record);
    // Two readings, or none.
    let by = |n: usize| move |g: &str, k: usize| if g == "q" { format!("q{}[rad]", k + n) } else { String::new() };
    let q = |n: usize| move |g: &str, k: usize| if g == "q" { by(n)(g, k) } else { own(g, k) };
    for (names, more, joints, says) in [
        (q(1), ",joint_1_pos[rad],joint_2_pos[rad],joint_3_pos[rad]", arm, "--ignore 'joint_*_pos'"),
        (q(1), "", ["j3", "j1", "j2"], "mean the numbers in their names"),
        (q(2), "", arm, "'q2' .. 'q4'"),
        (q(1), ",q4[rad]", arm, "4 columns 'q1' .. 'q4'"),
    ] {
        let names: Names<'_> =
            &|g, k| names(g, k).replace("shoulder", joints[0]).replace("elbow", joints[1]).replace("wrist", joints[2]);
        let p = others(names, more, joints, &default).unwrap_err();
        assert!(p.has("Data::Columns") && p.to_string().contains(says), "{says}: {p}");
    }
    // Set points beside are no positions; a pattern leaves them out.
    let demanded = ",q_des_1[rad],q_des_2[rad],q_des_3[rad]";
    assert!(others(&q(1), demanded, arm, &default).unwrap_err().to_string().contains("q_des_1"));
    let ignore = vec!["q_des_*".to_owned()];
    assert!(others(&q(1), demanded, arm, &ReadOptions { ignore, ..default.clone() }).unwrap().record == plain.record);
    // Exact names are another robot, however many there are.
    let robot = |g: &str, k: usize| {
        if g == "gyro" { own(g, k) } else { format!("{g}.joint{}[{}]", k + 1, if g == "q" { "rad" } else { "N m" }) }
    };
    assert!(others(&robot, "", arm, &default).unwrap_err().has("Data::NameMismatch"));
}

#[test]
fn names_of_joints_in_a_message_give_their_order() {
    let joints = ["b", "a"].map(|n| JointColumn { name: n.into(), slides: false });
    let mut text = "%time,field.name0,field.name1,field.name2,field.position0,field.position1,field.position2,field.effort0,field.effort1,field.effort2\n".to_owned();
    for i in 0..50_u64 {
        let x = |k: f64| (0.1 * i as f64 + k).sin();
        text += &format!(
            "{},finger,a,b,{},{},{},{},{},{}\n",
            1_700_000_000_000_000_000 + 10_000_000 * i,
            x(0.0),
            x(1.0),
            x(2.0),
            x(3.0),
            x(4.0),
            x(5.0)
        );
    }
    let l = read_from(text.as_bytes(), &joints, &ReadOptions { fixed_base: true, ..ReadOptions::default() }).unwrap();
    assert_eq!((l.record.q()[(0, 0)], l.record.q()[(0, 1)]), (2f64.sin(), 1f64.sin()));
    assert_eq!((l.record.tau()[(0, 0)], l.record.tau()[(0, 1)]), (5f64.sin(), 4f64.sin()));
    assert!(problem_of(&l.warnings, "Data::NotUsed").message.contains("field.position0"), "{}", l.warnings);
}

#[test]
fn text_in_utf_16_is_decoded() {
    let (text, _) = good();
    let plain = load(&text, &ReadOptions::default()).unwrap().record;
    let f = tempfile::NamedTempFile::new().unwrap();
    for (mark, little) in [(true, true), (true, false), (false, true), (false, false)] {
        let units = mark.then_some(0xfeff).into_iter().chain(text.encode_utf16());
        let bytes: Vec<u8> = units.flat_map(|u| if little { u.to_le_bytes() } else { u.to_be_bytes() }).collect();
        std::fs::write(f.path(), bytes).unwrap();
        let l = read(f.path(), &joints(), &ReadOptions::default()).unwrap_or_else(|p| panic!("{p}"));
        assert!(l.record == plain && l.warnings.has("Data::Encoding"), "{}", l.warnings);
    }
    let p = refused("0,0.5,0.25\n0.01,0.5,0.25\n");
    assert!(p.0[0].message.contains("no names") && p.0[0].line == Some(1), "{p}");
}

#[test]
fn the_same_readings_are_known_in_another_file() {
    let noisy = |seed: u64, n: usize| {
        let mut x = seed;
        DMatrix::from_fn(n, 3, |i, j| {
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (0.01 * i as f64 + j as f64).sin() + 0.02 * ((x >> 40) as f64 / 1e7)
        })
    };
    let record = |q: DMatrix<f64>, tau: DMatrix<f64>, gyro: DMatrix<f64>, t0: f64| {
        ff_records::RecordBuilder::new(["a", "b", "c"]).uniform(t0, 100.0).q(q).tau(tau).gyro(gyro).build().unwrap().0
    };
    let (q, tau, gyro) = (noisy(1, 400), noisy(2, 400), noisy(3, 400));
    let one = record(q.clone(), tau.clone(), gyro.clone(), 0.0);
    let content = ff_records::Content::of(&one);
    // On another clock, with fewer digits, in part; and another flight of the same motion.
    let digits = tau.map(|x| (x * 1e6).round() / 1e6);
    assert!(content.is_in(&record(q.clone(), digits, gyro.clone(), 1e9)));
    assert!(content.is_in(&one.window(1.0, 3.0).unwrap()));
    assert!(!content.is_in(&record(q, noisy(4, 400), noisy(5, 400), 0.0)));
    assert_eq!(ff_records::Content::from_words(&content.to_string()), content);
    assert!(!ff_records::Content::default().is_in(&one));
}

/// What the flags open: other separators with decimal commas, names of others, dates; the record is the same.
#[test]
fn logs_with_other_separators_names_and_dates_are_the_same_record() {
    let (text, _) = good();
    let plain = load(&text, &ReadOptions::default()).unwrap().record;
    for (s, separator) in [(";", b';'), ("\t", b'\t'), ("|", b'|'), ("  ", b' ')] {
        let head = text.lines().next().unwrap().replace(',', s).replace(&format!("rail{s} left"), "rail, left");
        // The comma in a quoted name is a point then, too.
        let rule = ("q.rail. left".to_owned(), "q.rail, left".to_owned());
        let rules: Vec<_> = ["q.", "dq.", "ddq.", "tau."]
            .iter()
            .filter(|g| text.contains(&format!("\"{g}rail, left")))
            .map(|g| (rule.0.replacen("q.", g, 1), rule.1.replacen("q.", g, 1)))
            .collect();
        let rows: String =
            text.lines().skip(1).map(|l| l.replace(',', s).replace('.', ",") + "\n# a remark\n").collect();
        let options = ReadOptions { separator, rename: rules, ..ReadOptions::default() };
        let read = load(&format!("{head}\n{rows}"), &options).unwrap_or_else(|p| panic!("{s:?}: {p}"));
        assert!(read.record == plain, "{s:?}");
    }
    // Commas at the end of the samples alone.
    let (head, rows) = text.split_once('\n').unwrap();
    let commas: String = rows.lines().map(|l| format!("{l},\n")).collect();
    assert!(load(&format!("{head}\n{commas}"), &ReadOptions::default()).unwrap().record == plain);
    assert!(refused(&format!("{head}\n{}", commas.replace(",\n", ",0\n"))).has("Data::RowLength"));
    // Dates, in a column of whatever name of the time, the first one without a name included.
    let dated = |name: &str, form: &dyn Fn(usize) -> String| {
        let rows = rows.lines().enumerate().map(|(i, l)| format!("{}{}\n", form(i), &l[l.find(',').unwrap()..]));
        head.replacen("time[s]", name, 1) + "\n" + &rows.collect::<String>()
    };
    let ms = |i: usize| 10 * i;
    // Across the midnight before a leap day.
    let stamp = |i: usize| {
        let of_day = 86_398_500 + ms(i);
        let (day, t) = (28 + of_day / 86_400_000, of_day % 86_400_000);
        format!("2024-02-{day} {:02}:{:02}:{:02}.{:03}", t / 3_600_000, t / 60_000 % 60, t / 1000 % 60, t % 1000)
    };
    for name in ["time", "timestamp", "", "Datetime"] {
        let read = load(&dated(name, &stamp), &ReadOptions::default()).unwrap_or_else(|p| panic!("{name}: {p}"));
        assert!(read.record.is_uniform() && (read.record.dt() - 0.01).abs() < 1e-12, "{name}");
        assert_eq!((read.record.q(), read.record.t0()), (plain.q(), 1_709_164_798.5));
    }
    // A zone that comes and goes, days first.
    // Day or month first, by the numbers or by the row in which one of them goes on; else both readings and the flag are named.
    let parts = |i: usize| {
        let s = stamp(i);
        (s[8..10].to_owned(), s[11..].to_owned())
    };
    let march = |i: usize, from: usize| {
        let of_day = 86_398_500 + ms(i);
        let (day, t) = (from + of_day / 86_400_000, of_day % 86_400_000);
        let (h, half) = (t / 3_600_000, if t < 43_200_000 { "AM" } else { "PM" });
        format!("3/{day}/2024 {}:{:02}:{:02}.{:03} {half}", (h + 11) % 12 + 1, t / 60_000 % 60, t / 1000 % 60, t % 1000)
    };
    let points = |i: usize| format!("{}.02.2024 {}", parts(i).0, parts(i).1);
    let named = |i: usize| format!("{}-Feb-2024 {}", parts(i).0, parts(i).1);
    let slashes = |i: usize| march(i, 25);
    let across = |i: usize| march(i, 5);
    let days = |n: f64| 86_400.0 * n;
    let ways: [(&dyn Fn(usize) -> String, f64); 4] =
        [(&points, 0.0), (&named, 0.0), (&slashes, days(26.0)), (&across, days(6.0))];
    for (form, later) in ways {
        let read = load(&dated("Time", form), &ReadOptions::default()).unwrap_or_else(|p| panic!("{}: {p}", form(0)));
        assert!((read.record.dt() - 0.01).abs() < 1e-12 && read.record.q() == plain.q(), "{}", form(0));
        assert_eq!(read.record.t0(), 1_709_164_798.5 + later, "{}", form(0));
        assert!(read.warnings.has("Data::Dates") || form(0).contains("Feb"), "{}", read.warnings);
    }
    let open = dated("time", &|i| format!("3/5/2024 10:00:{:02}.{:03}", ms(i) / 1000, ms(i) % 1000));
    let p = refused(&open);
    assert!(
        p.has("Data::Dates") && p.to_string().contains("2024-05-03 (day first) or 2024-03-05 (month first)"),
        "{p}"
    );
    let settled = |dates| load(&open, &ReadOptions { dates, ..ReadOptions::default() }).unwrap().record.t0();
    assert_eq!(settled(DateOrder::DayFirst) - settled(DateOrder::MonthFirst), days(59.0));
    // What has elapsed, and nanoseconds of an epoch without a name for them.
    for form in [&(|i: usize| format!("{} sec", 0.01 * i as f64)) as &dyn Fn(usize) -> String, &|i| {
        format!("0 days 00:00:{:09.6}", 0.01 * i as f64)
    }] {
        assert!((load(&dated("Time", form), &ReadOptions::default()).unwrap().record.dt() - 0.01).abs() < 1e-12);
    }
    let epoch = dated("%time", &|i| format!("{}", 1_709_164_798_500_000_000 + 1_000_000 * ms(i) as u64));
    assert_eq!(load(&epoch, &ReadOptions::default()).unwrap().record.t0(), 1_709_164_798.5);
    let p = refused(&dated("time", &|i| stamp(i) + if i == 7 { "Z" } else { "" }));
    assert_eq!(p.0[0].line, Some(9), "{p}");
    assert!(refused(&dated("time", &|i| stamp(i).replacen("2024-02-", "02/2024/", 1))).has("Data::UnitMissing"));
    // A unit in the name.
    let ns = load(
        &dated("timestamp_ns", &|i| format!("{}", 1_709_164_798_500_000_000 + 1_000_000 * ms(i) as u64)),
        &ReadOptions::default(),
    );
    assert_eq!(ns.unwrap().record.t0(), 1_709_164_798.5);
}

#[test]
fn time_in_two_columns_and_lines_of_units_and_text() {
    let (text, _) = good();
    let whole = load(&text, &ReadOptions::default()).unwrap().record;
    let two = |l: &str| -> String {
        let (time, rest) = l.split_once(',').unwrap();
        let Ok(t) = time.parse::<f64>() else { return format!("header.stamp.sec,header.stamp.nanosec,{rest}\n") };
        let ns = (t * 1e9).round() as i64;
        format!("{},{},{rest}\n", 1_700_000_000 + ns / 1_000_000_000, ns % 1_000_000_000)
    };
    let l = load(&text.lines().map(two).collect::<String>(), &ReadOptions::default()).unwrap();
    assert!((l.record.time(N - 1) - whole.time(N - 1)).abs() < 1e-9);
    assert_eq!(l.record.tau(), whole.tau());
    // Units in a line of their own; a carriage return at the end of lines.
    let mut file = csv::Reader::from_reader(text.as_bytes());
    let (names, units): (Vec<String>, Vec<String>) = file
        .headers()
        .unwrap()
        .iter()
        .map(|h| name_and_unit(h))
        .map(|(n, u)| (format!("\"{n}\""), u.unwrap().to_owned()))
        .unzip();
    let t = format!("{}\n{}\n{}", names.join(","), units.join(","), text.split_once('\n').unwrap().1);
    assert_eq!(load(&t, &ReadOptions::default()).unwrap().record.tau(), whole.tau());
    assert_eq!(load(&text.replace('\n', "\r"), &ReadOptions::default()).unwrap().record.tau(), whole.tau());
    let p = refused(&format!("{text}END OF FILE\n"));
    assert!(p.0.len() == 1 && p.0[0].message.contains("'END OF FILE'") && p.0[0].line == Some(N + 2), "{p}");
}

/// What other programs write about a table: remarks, names behind a `#` (NumPy), row numbers in a column without a name (pandas).
#[test]
fn remarks_and_row_numbers_of_other_programs_are_no_signals() {
    let (text, _) = good();
    let plain = load(&text, &ReadOptions::default()).unwrap();
    let numpy = format!("# {text}");
    let remarks = format!("# robot 7, arm A\n#\n{text}");
    for other in [&numpy, &remarks] {
        let read = load(other, &ReadOptions::default()).unwrap();
        assert!(read.record == plain.record);
    }
    let number = |(k, line): (usize, &str)| if k == 0 { format!(",{line}\n") } else { format!("{},{line}\n", k - 1) };
    let pandas: String = text.lines().enumerate().map(number).collect();
    let read = load(&pandas, &ReadOptions::default()).unwrap();
    assert!(read.record == plain.record);
    let p = problem_of(&read.warnings, "Data::NotUsed");
    assert_eq!(p.line, Some(1));
    // Read and written again, and with a comma at the end of every line.
    let again = pandas.replacen(',', "Unnamed: 0,", 1);
    let commas: String = text.lines().map(|l| format!("{l},\n")).collect();
    for other in [again, commas] {
        let read = load(&other, &ReadOptions::default()).unwrap();
        assert!(read.record == plain.record);
        assert!(problem_of(&read.warnings, "Data::NotUsed").message.contains("no name") || other.contains(",\n"));
    }
    // What others call the time is asked after.
    let stamp = refused(&text.replacen("time[s]", "Timestamp", 1)).to_string();
    assert!(stamp.contains("is 'Timestamp' the time?"), "{stamp}");
    // Places count all lines, and a wrong name is found in its own.
    let wrong = remarks.replacen("q.shoulder[rad]", "q.shoulder", 1);
    let p = refused(&wrong);
    assert_eq!(problem_of(&p, "Data::UnitMissing").line, Some(3));
    let p = refused("# 1.5 2.5\n");
    assert_eq!(problem_of(&p, "Data::NoSamples").line, Some(1));
}
