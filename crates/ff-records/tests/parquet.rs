//! Parquet: files of another writer (pyarrow, `fixtures/records/make.py`), our own, and damaged ones.

use ff_model::diagnostics::Limit;
use ff_records::file::*;
use ff_testkit::problem::{assert_violation, problem_of};
use std::path::PathBuf;

const N: usize = 300;
const T0: i64 = 1_700_000_000_123_456_789;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/records").join(name)
}
fn joints() -> Vec<JointColumn> {
    ["shoulder", "elbow"].map(|n| JointColumn { name: n.into(), slides: false }).to_vec()
}
/// Channel `k` at row `i`, as the script has it.
fn value(i: usize, k: usize) -> f64 {
    (0.05 * i as f64 + 0.7 * k as f64).sin() / (1.0 + 0.3 * k as f64) + 0.01 * k as f64
}
fn near(r: &ff_records::record::Record, first: usize, tolerance: f64) {
    for i in 0..r.samples() {
        let all = [r.q()[(i, 0)], r.q()[(i, 1)], r.tau()[(i, 0)], r.tau()[(i, 1)], r.gyro()[(i, 0)], r.gyro()[(i, 2)]];
        for (x, k) in all.into_iter().zip([0, 1, 2, 3, 4, 6]) {
            assert!((x - value(i + first, k)).abs() < tolerance, "row {i}, channel {k}: {x}");
        }
    }
}

#[test]
fn files_of_pyarrow_are_read_whatever_their_codec_and_types() {
    let l = read(&fixture("plain.parquet"), &joints(), &ReadOptions::default()).unwrap();
    assert!(l.warnings.0.is_empty(), "{}", l.warnings);
    assert_eq!((l.record.samples(), l.record.t0()), (N, 0.0));
    near(&l.record, 0, 1e-15);
    // Units as metadata, stamps of nanoseconds since 1970, degrees as 32-bit numbers.
    let l = read(&fixture("metadata.parquet"), &joints(), &ReadOptions::default()).unwrap();
    assert_eq!(l.record.samples(), N);
    assert!((l.record.dt() - 0.01).abs() < 1e-12 && (l.record.t0() - T0 as f64 * 1e-9).abs() < 1e-6);
    near(&l.record, 0, 1e-7);
}

#[test]
fn decimals_structs_stamps_of_96_bits_and_gzip_are_read() {
    let l = read(&fixture("types.parquet"), &joints(), &ReadOptions::default()).unwrap();
    assert!((l.record.dt() - 0.01).abs() < 1e-12 && (l.record.t0() - T0 as f64 * 1e-9).abs() < 1e-6);
    near(&l.record, 0, 1e-6);
    let p = read(&fixture("integers.parquet"), &joints(), &ReadOptions::default()).unwrap_err();
    assert!(p.exit_code() == 12 && p.0[0].code == "Data::Format" && p.to_string().contains("brotli"), "{p}");
}

#[test]
fn d03_nulls_are_missing_numbers() {
    let p = read(&fixture("holes.parquet"), &joints(), &ReadOptions::default()).unwrap_err();
    assert!(p.exit_code() == 12 && p.has("Data::NotFinite"), "{p}");
    assert!(p.to_string().contains("row 42: a cell is empty"), "{p}");
    let options =
        ReadOptions { drop_gaps: true, allow: vec!["Data::Gap".into()], resample: true, ..Default::default() };
    match read(&fixture("holes.parquet"), &joints(), &options) {
        Ok(l) => {
            assert!(
                l.warnings.0.iter().any(|p| p.code == "Data::Dropped" && p.message.contains("3 rows")),
                "{}",
                l.warnings
            );
        }
        Err(p) => panic!("{p}"),
    }
}

/// What a writer of ours makes of blocks.
fn written(rows: usize, whole: bool) -> Vec<u8> {
    let names: Vec<String> = ["tau.shoulder[mN m]", "time[ns]", "q.shoulder[deg]"].map(String::from).to_vec();
    let names = if whole { names } else { names.into_iter().map(|n| n.replace("[ns]", "[ms]")).collect() };
    let mut w = ParquetWriter::new(Vec::new(), &names, whole).unwrap();
    for start in (0..rows).step_by(700) {
        let range = start..(start + 700).min(rows);
        let mut b = Block::new(3);
        b.stamps = if whole {
            Stamps::Whole(range.clone().map(|i| T0 + 2_500_000 * i as i64).collect())
        } else {
            Stamps::Real(range.clone().map(|i| 2.5 * i as f64).collect())
        };
        b.columns[0] = range.clone().map(|i| 1e3 * value(i, 3)).collect();
        b.columns[2] = range.map(|i| value(i, 5)).collect();
        w.write(&b).unwrap();
    }
    w.finish().unwrap()
}

fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
    let f = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(f.path(), bytes).unwrap();
    f
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    // More than a row group, and no multiple of a block.
    for (rows, whole) in [(140_003, true), (9_001, false)] {
        let f = file(&written(rows, whole));
        let (format, mut source) = open(f.path(), &[], &ReadOptions::default()).unwrap();
        assert_eq!(format, Format::Parquet);
        assert_eq!(source.names()[2], "q.shoulder[deg]");
        assert_eq!(source.declared_rows(), Some(rows as u64));
        let (mut block, mut seen) = (Block::new(3), 0);
        while source.next(&mut block).unwrap() {
            for i in 0..block.rows() {
                assert_eq!(block.columns[0][i].to_bits(), (1e3 * value(seen + i, 3)).to_bits());
                assert_eq!(block.columns[2][i].to_bits(), value(seen + i, 5).to_bits());
                match &block.stamps {
                    Stamps::Whole(t) => assert_eq!(t[i], T0 + 2_500_000 * (seen + i) as i64),
                    Stamps::Real(t) => assert_eq!(t[i], 2.5 * (seen + i) as f64),
                }
            }
            seen += block.rows();
        }
        assert_eq!(seen, rows);
    }
}

#[test]
fn d34_more_rows_than_allowed_are_refused_before_they_are_read() {
    let options = ReadOptions { max_rows: 299, ..Default::default() };
    let p = read(&fixture("plain.parquet"), &joints(), &options).unwrap_err();
    assert_violation(problem_of(&p, "Data::TooLarge"), 300.0, Limit::AtMost(299.0), "rows");
    let options = ReadOptions { max_bytes: 1000, ..Default::default() };
    assert!(read(&fixture("plain.parquet"), &joints(), &options).unwrap_err().has("Data::TooLarge"));
}

#[test]
fn tables_of_numbers_come_back() {
    let columns = [
        ("chain".to_owned(), TableColumn::Whole(vec![0, 1, -3])),
        ("tank.k[0]".to_owned(), TableColumn::Real(vec![0.1, f64::NAN, 1e-300], "N m/rad".to_owned())),
    ];
    let bytes = write_table(Vec::new(), &columns).unwrap();
    let back = read_table(file(&bytes).path()).unwrap();
    assert_eq!(back[0], ("chain".to_owned(), vec![0.0, 1.0, -3.0]));
    assert_eq!(back[1].0, "tank.k[0]");
    assert!(back[1].1[0] == 0.1 && back[1].1[1].is_nan() && back[1].1[2] == 1e-300);
    let cut = read_table(file(&bytes[..bytes.len() - 3]).path()).unwrap_err();
    assert!(cut.has("Data::Parquet") && cut.0[0].file.is_some(), "{cut}");
}

#[test]
fn problems_of_names_are_those_of_csv() {
    let mut two = joints();
    two[1].name = "elbo".into();
    let p = read(&fixture("plain.parquet"), &two, &ReadOptions::default()).unwrap_err();
    assert!(p.has("Data::NameMismatch") && p.to_string().contains("is elbow meant to be elbo?"), "{p}");
    assert!(p.0.iter().all(|p| p.line.is_none() && p.file.is_some()), "{p:?}");
}

#[test]
#[ignore = "full tier: 4 s"]
fn damaged_files_are_refused_and_nothing_panics() {
    let good = std::fs::read(fixture("holes.parquet")).unwrap();
    for cut in [4, 5, 12, good.len() / 2, good.len() - 9, good.len() - 1] {
        let p = read(file(&good[..cut]).path(), &joints(), &ReadOptions::default()).unwrap_err();
        assert!(p.exit_code() == 12 && p.has("Data::Parquet"), "{cut}: {p}");
    }
    let mut bytes = good.clone();
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    for _ in 0..1500 {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // Half of the changes in the footer, which says where everything is.
        let span = if seed >> 63 == 0 { 4..good.len() } else { good.len() - 5000..good.len() };
        let at = span.start + (seed >> 20) as usize % span.len();
        bytes[at] ^= 1 << ((seed >> 8) & 7);
        match read(file(&bytes).path(), &joints(), &ReadOptions::default()) {
            Ok(_) => {}
            Err(p) => assert!(p.has_errors(), "{p}"),
        }
        bytes[at] = good[at];
    }
}
