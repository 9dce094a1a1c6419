//! ROS 2 bags of another writer (`mcap-ros2-support`, `fixtures/records/make.py`), and damaged ones.

use crate::bags::{T0, file, fixture, joints, value};
use ff_records::file::*;
use ff_testkit::assert_within;

const N: usize = 300;
#[test]
fn bags_are_read_on_the_clock_of_the_joints() {
    // Base samples at the same instants every second time, or never; their last one is before the last joint state.
    for (name, exact) in [("zstd.mcap", 150), ("lz4.mcap", 0)] {
        let l = read(&fixture(name), &joints(), &ReadOptions::default()).unwrap();
        let (r, text) = (&l.record, l.warnings.to_string());
        let rows = r.samples();
        assert_eq!(rows, N - 1);
        assert!((r.dt() - 0.01).abs() < 1e-9 && (r.t0() - T0 as f64 * 1e-9).abs() < 1e-6, "{}", r.t0());
        assert!(r.qd().is_none() && r.acc().is_none() && r.att().is_some());
        for i in 0..rows {
            // The order of the model, whatever that of a message.
            assert_eq!((r.q()[(i, 1)], r.q()[(i, 0)]), (value(i, 0), value(i, 1)));
            assert_eq!((r.tau()[(i, 1)], r.tau()[(i, 0)]), (value(i, 2), value(i, 3)));
            let t = 0.01 * i as f64;
            for j in 0..3 {
                // Linear in time, so that interpolation is exact.
                let want = 0.1 + (0.02 + 0.01 * j as f64) * t;
                assert_within!((r.gyro()[(i, j)] - want).abs(), 1e-12, "{name} {i}: {}", r.gyro()[(i, j)]);
            }
            let q = r.att().unwrap().row(i);
            let (s, c) = (0.1 * t).sin_cos();
            let off: f64 = [c, 0.6 * s, 0.8 * s, 0.0].iter().zip(q.iter()).map(|(a, b)| a * b).sum();
            // The sign alternates in the bag; between two attitudes 0.8 mrad apart the chord is as good as the arc.
            assert_within!((off.abs() - 1.0).abs(), 1e-9, "{name} {i}: {q}");
        }
        assert!(text.contains("/bus/imu") && text.contains("/arm/joint_states"), "{text}");
        assert!(text.contains("up to 0.004000 s apart (median interval 0.004000 s)"), "{text}");
        assert!(text.contains(&format!(": {exact} at stamps of their own")), "{text}");
        assert!(text.contains(&format!("{} joint states outside left out", N - rows)), "{text}");
    }
}

#[test]
fn d36_topics_are_found_chosen_and_listed() {
    let bag = fixture("two_arms.mcap");
    // The one that has the joints of the robot.
    let l = read(&bag, &joints(), &ReadOptions::default()).unwrap();
    assert!(l.record.samples() > 50);
    // Without a robot there is no telling.
    let p = open(&bag, &[], &ReadOptions::default()).map(|_| ()).unwrap_err();
    assert!(p.has("Data::Topics") && p.exit_code() == 12, "{p}");
    let text = p.to_string();
    assert!(
        ["/arm/joint_states", "/other/joint_states", "/log (std_msgs/msg/String)", "--topic"]
            .iter()
            .all(|s| text.contains(s)),
        "{text}"
    );
    let options =
        ReadOptions { topics: vec!["/other/joint_states".into()], slides: vec!["other".into()], ..Default::default() };
    let (format, source) = open(&bag, &[], &options).unwrap();
    assert_eq!(
        (format, &source.names()[..3]),
        (Format::Mcap, &["time[ns]", "q.other[m]", "tau.other[N]"].map(String::from)[..])
    );
    // Joints of another robot.
    let other = [JointColumn { name: "wrist".into(), slides: false }];
    let one = ReadOptions { topics: vec!["/arm/joint_states".into()], ..Default::default() };
    assert!(read(&bag, &other, &one).unwrap_err().has("Data::NameMismatch"));
}

#[test]
fn d35_truncated_bags_are_read_to_the_last_complete_chunk_with_a_warning() {
    let good = std::fs::read(fixture("zstd.mcap")).unwrap();
    let cut = &good[..good.len() * 2 / 3];
    // The recorder was killed, or power was cut and the file system left zeros.
    for bytes in [cut.to_vec(), [cut, &[0; 5000]].concat()] {
        let l = read(file(&bytes).path(), &joints(), &ReadOptions::default()).unwrap_or_else(|p| panic!("{p}"));
        assert!((150..290).contains(&l.record.samples()), "{}", l.record.samples());
        assert_eq!(l.record.q()[(100, 1)], value(100, 0));
        let last = T0 + 10_000_000 * (l.record.samples() as i64 - 1);
        let until = format!("up to {}.{:09} s", last / 1_000_000_000, last % 1_000_000_000);
        let said = l.warnings.0.iter().find(|p| p.code == "Data::MaybeTruncated").unwrap();
        assert!(said.message.contains(&until) && said.message.contains(&format!("byte {}", bytes.len())), "{said}");
    }
    // Nothing complete is nothing.
    let p = read(file(&good[..good.len() / 80]).path(), &joints(), &ReadOptions::default()).unwrap_err();
    assert!(p.exit_code() == 12 && p.0[0].hint.is_some(), "{p}");
}

#[test]
fn d35_lengths_that_cannot_be_are_refused_before_memory_is_taken() {
    let good = std::fs::read(fixture("lz4.mcap")).unwrap();
    // The first chunk, found by walking the records.
    let mut at = 8;
    while good[at] != 0x06 {
        at += 9 + u64::from_le_bytes(*good[at + 1..].first_chunk().unwrap()) as usize;
    }
    let with = |offset: usize, bytes: &[u8]| {
        let mut b = good.clone();
        b[at + offset..at + offset + bytes.len()].copy_from_slice(bytes);
        read(file(&b).path(), &joints(), &ReadOptions::default()).unwrap_err()
    };
    let huge = u64::MAX.to_le_bytes();
    // Length of the record, size when unpacked, checksum, compression, length of the packed records.
    assert!(with(1, &huge).has("Data::TooLarge"), "{}", with(1, &huge));
    assert!(with(9 + 16, &huge).has("Data::TooLarge"), "{}", with(9 + 16, &huge));
    assert!(with(9 + 16, &[7, 7]).has("Data::Mcap"), "{}", with(9 + 16, &[7, 7]));
    assert!(with(9 + 24, &[1]).to_string().contains("wrong checksum"), "{}", with(9 + 24, &[1]));
    assert!(with(9 + 32, b"zzz").to_string().contains("compressed by 'zzz'"), "{}", with(9 + 32, b"zzz"));
    assert!(with(9 + 35, &huge).has("Data::Mcap"), "{}", with(9 + 35, &huge));
}

#[test]
#[ignore = "full tier: 3 s"]
fn no_damage_makes_it_panic() {
    for name in ["zstd.mcap", "two_arms.mcap"] {
        let good = std::fs::read(fixture(name)).unwrap();
        let mut bytes = good.clone();
        let mut seed = 0x2545_f491_4f6c_dd1d_u64;
        for k in 0..600 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Uncompressed, every byte is structure or number; most changes near the start, where the topics are.
            let at = 8 + (seed >> 20) as usize % if k % 2 == 0 { 3000 } else { good.len() - 8 };
            bytes[at] = (seed >> 50) as u8;
            let options = ReadOptions { allow: vec!["Data::MaybeTruncated".into()], ..Default::default() };
            if let Err(p) = read(file(&bytes).path(), &joints(), &options) {
                assert!(p.has_errors(), "{p}");
            }
            bytes[at] = good[at];
        }
    }
}

/// Where the record that begins at a byte ends.
fn end_of(bag: &[u8], at: usize) -> usize {
    at + 9 + u64::from_le_bytes(*bag[at + 1..].first_chunk().unwrap()) as usize
}

/// The crate takes the length of such a record from that of its chunk without a check.
#[test]
fn a_record_longer_than_its_plain_chunk_is_refused() {
    let good = std::fs::read(fixture("two_arms.mcap")).unwrap();
    let mut bag = good[..end_of(&good, 8)].to_vec();
    // Times, size, no checksum, no compression, size: then a chunk of 20 bytes whose one record has 100.
    let mut chunk = [0; 16].to_vec();
    chunk.extend(20u64.to_le_bytes());
    chunk.extend([0; 8]);
    chunk.extend(20u64.to_le_bytes());
    chunk.push(5);
    chunk.extend(100u64.to_le_bytes());
    chunk.extend([7; 11]);
    bag.push(6);
    bag.extend((chunk.len() as u64).to_le_bytes());
    bag.extend(chunk);
    bag.extend(&good[end_of(&good, 8)..]);
    let p = read(file(&bag).path(), &joints(), &ReadOptions::default()).unwrap_err();
    assert!(p.exit_code() == 12 && ["Data::Mcap", "Data::Topics"].iter().any(|c| p.has(c)), "{p}");
}

#[test]
fn attachments_too_large_to_hold_are_left_out() {
    use std::io::{Seek, SeekFrom, Write};
    let good = std::fs::read(fixture("zstd.mcap")).unwrap();
    let (head, rest) = good.split_at(end_of(&good, 8));
    let n = 300u64 << 20;
    let mut f = tempfile::NamedTempFile::new().unwrap();
    f.write_all(head).unwrap();
    f.write_all(&[9]).unwrap();
    f.write_all(&n.to_le_bytes()).unwrap();
    // A hole, which takes no room on the disk.
    f.seek(SeekFrom::Current(n as i64)).unwrap();
    f.write_all(rest).unwrap();
    let l = read(f.path(), &joints(), &ReadOptions::default()).unwrap();
    assert_eq!(l.record.samples(), N - 1);
    // One that the file does not have: nothing can be found behind it.
    let cut = file(&[head, &[9], &n.to_le_bytes(), rest].concat());
    assert!(read(cut.path(), &joints(), &ReadOptions::default()).unwrap_err().has("Data::Topics"));
}
