//! ROS 1 bags of another writer (`rosbags`, `fixtures/records/make_rosbag.py`), and damaged ones.

use crate::bags::{T0, file, fixture, joints, value};
use ff_records::file::*;
use ff_testkit::assert_within;

#[test]
fn bags_of_ros_1_are_read_by_the_definitions_in_them() {
    for (name, n) in [("lz4.bag", 200), ("vendor.bag", 80)] {
        let l = read(&fixture(name), &joints(), &ReadOptions::default()).unwrap();
        let (r, text) = (&l.record, l.warnings.to_string());
        assert!((r.samples(), r.has_torques()) == (n, true), "{name}: {} {text}", r.samples());
        assert!((r.dt() - 0.01).abs() < 1e-9 && (r.t0() - T0 as f64 * 1e-9).abs() < 1e-6, "{}", r.t0());
        assert!(r.qd().is_none() && r.acc().is_none() && r.att().is_none());
        for i in 0..n {
            assert_eq!((r.q()[(i, 1)], r.q()[(i, 0)]), (value(i, 0), value(i, 1)));
            assert_eq!((r.tau()[(i, 1)], r.tau()[(i, 0)]), (value(i, 2), value(i, 3)));
            for j in 0..3 {
                let want = 0.1 + (0.02 + 0.01 * j as f64) * 0.01 * i as f64;
                assert_within!((r.gyro()[(i, j)] - want).abs(), 1e-9, "{name} {i}");
            }
        }
        assert!(text.contains("/bus/imu") && text.contains("/arm/joint_states"), "{text}");
        if name == "vendor.bag" {
            // A gripper that writes to the topic of the arm, and a wrist sensor.
            assert!(text.contains("80 messages of '/arm/joint_states' are of other joints"), "{text}");
            let c = r.carried().unwrap();
            let (frame, of) = c.wrenches().remove(0);
            assert_eq!((frame.as_str(), c.units[of[0]], c.units[of[5]]), ("tool", "N", "N m"));
            let t = 0.01 * 40.0;
            assert_within!((c.values[(40, of[1])] - (0.5 + 0.03 * t)).abs(), 1e-9);
            assert_within!((c.values[(40, of[5])] - (0.7 + 0.04 * t)).abs(), 1e-9);
        }
    }
}

#[test]
fn the_time_of_recording_is_taken_where_it_is_asked_for() {
    let options = ReadOptions { stamps: StampSource::Receive, ..Default::default() };
    let l = read(&fixture("lz4.bag"), &joints(), &options).unwrap();
    // Three milliseconds later than the sensors.
    assert!((l.record.t0() - (T0 + 3_000_000) as f64 * 1e-9).abs() < 1e-6, "{}", l.record.t0());
    assert!(l.warnings.to_string().contains("times of recording"), "{}", l.warnings);
}

#[test]
fn truncated_bags_are_read_to_the_last_complete_chunk_with_a_warning() {
    let good = std::fs::read(fixture("lz4.bag")).unwrap();
    // In the middle of the first chunk there is nothing; the index at the end is not needed.
    let allow = ReadOptions { allow: vec!["Data::MaybeTruncated".into()], ..Default::default() };
    let cut = file(&good[..good.len() - 37]);
    let l = read(cut.path(), &joints(), &ReadOptions::default()).unwrap();
    assert_eq!((l.record.samples(), l.warnings.has("Data::MaybeTruncated")), (200, true));
    let p = read(file(&good[..good.len() / 3]).path(), &joints(), &allow).unwrap_err();
    assert!(p.exit_code() == 12, "{p}");
}

#[test]
#[ignore = "full tier: 2 s"]
fn no_damage_makes_it_panic() {
    for name in ["lz4.bag", "vendor.bag"] {
        let good = std::fs::read(fixture(name)).unwrap();
        let mut bytes = good.clone();
        let mut seed = 0x2545_f491_4f6c_dd1d_u64;
        for k in 0..300 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Most changes where the records begin, behind the padded head of the bag.
            let at = (seed >> 20) as usize % if k % 2 == 0 { 5000 } else { good.len() };
            bytes[at] = (seed >> 50) as u8;
            let options = ReadOptions { allow: vec!["Data::MaybeTruncated".into()], ..Default::default() };
            if let Err(p) = read(file(&bytes).path(), &joints(), &options) {
                assert!(p.has_errors(), "{p}");
            }
            bytes[at] = good[at];
        }
    }
}

/// A record of a bag: header fields, data.
fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut head = Vec::new();
    for (name, value) in fields {
        head.extend(((name.len() + 1 + value.len()) as u32).to_le_bytes());
        head.extend(name.as_bytes());
        head.push(b'=');
        head.extend(*value);
    }
    [&(head.len() as u32).to_le_bytes()[..], &head, &(data.len() as u32).to_le_bytes(), data].concat()
}

#[test]
fn lengths_that_cannot_be_are_refused_before_memory_is_taken() {
    let with = |chunk: &[u8]| {
        let bag = [b"#ROSBAG V2.0\n", chunk].concat();
        read(file(&bag).path(), &joints(), &ReadOptions::default()).unwrap_err()
    };
    let op = |k: u8| [k];
    let size = u32::MAX.to_le_bytes();
    let p = with(&record(&[("op", &op(5)), ("compression", b"bz2"), ("size", &size)], b"BZh9"));
    assert!(p.has("Data::TooLarge"), "{p}");
    let p = with(&record(&[("op", &op(5)), ("compression", b"zip"), ("size", &[1, 0, 0, 0])], b"x"));
    assert!(p.has("Data::Rosbag") && p.to_string().contains("compressed by 'zip'"), "{p}");
    let p = with(&record(&[("op", &op(5)), ("compression", b"lz4"), ("size", &[9, 0, 0, 0])], b"garbage"));
    assert!(p.has("Data::Rosbag"), "{p}");
    let mut long = record(&[("op", &op(2))], b"");
    let end = long.len() - 4;
    long[end..].copy_from_slice(&u32::MAX.to_le_bytes());
    // What cannot be read is said when there is nothing else.
    assert!(["Data::MaybeTruncated", "Data::Topics"].iter().any(|c| with(&long).has(c)), "{}", with(&long));
    assert!(with(&record(&[("op", &op(99))], b"")).has("Data::Rosbag"));
}
