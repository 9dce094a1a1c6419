//! `ffid convert` and records that are no CSV, through the real binary.

use crate::common;
use crate::common::ffid;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn fixture(path: &str) -> PathBuf {
    common::fixture("records").join(path)
}

fn convert(dir: &Path, args: &[&str]) -> Value {
    let (code, out, err) = ffid(dir, &[&["convert", "--json"], args].concat());
    assert_eq!(code, 0, "{out}\n{err}");
    serde_json::from_str::<Value>(&out).unwrap()
}

const TEXT: &str = "q.a[deg],time[ms],tau.a[mN m],gyro.x[rpm],\"note, or so[1]\"\n\
    0.1,0,1e-7,0.3333333333333333,7\n-12.000000000000002,2.5,123456789.123,-0,\n1e300,5,-4.9e-324,17,9007199254740993\n";

#[test]
fn csv_to_parquet_and_back_keeps_every_bit() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.csv"), TEXT).unwrap();
    let v = &convert(dir.path(), &["a.csv", "a.parquet"])["converted"];
    assert_eq!((v["rows"].as_u64(), v["from"].as_str(), v["to"].as_str()), (Some(3), Some("CSV"), Some("Parquet")));
    assert_eq!(v["columns"].as_array().unwrap().len(), 5);
    convert(dir.path(), &["a.parquet", "b.csv"]);
    let cells = |name: &str| {
        let text = fs::read_to_string(dir.path().join(name)).unwrap();
        let mut lines = text.lines();
        let head = lines.next().unwrap().to_owned();
        let numbers: Vec<Vec<Option<u64>>> =
            lines.map(|l| l.split(',').map(|c| c.parse::<f64>().ok().map(f64::to_bits)).collect()).collect();
        (head, numbers)
    };
    assert_eq!(cells("a.csv"), cells("b.csv"));
    // To SI: the header says so, the numbers follow.
    convert(dir.path(), &["a.parquet", "si.csv", "--si", "--ignore", "note, or so"]);
    let text = fs::read_to_string(dir.path().join("si.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("q.a[rad],time[ms],tau.a[N m],gyro.x[rad/s]"));
    let row: Vec<f64> = lines.next().unwrap().split(',').map(|c| c.parse().unwrap()).collect();
    assert!((row[0] - 0.1_f64.to_radians()).abs() < 1e-17 && (row[2] - 1e-10).abs() < 1e-24, "{row:?}");
    // Whole stamps of an epoch keep their last digit.
    let epoch = "time[ns],q.a[rad]\n1700000000123456789,0.5\n1700000000133456790,0.25\n";
    fs::write(dir.path().join("e.csv"), epoch).unwrap();
    convert(dir.path(), &["e.csv", "e.parquet"]);
    convert(dir.path(), &["e.parquet", "f.csv"]);
    assert_eq!(fs::read_to_string(dir.path().join("f.csv")).unwrap(), epoch);
}

/// pandas' row numbers are read by all commands alike.
#[test]
fn two_recorders_on_one_clock_make_one_record() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("joints.csv", "time[s],q.a[deg],tau.a[N m]\n0,1,2\n0.01,3,4\n0.02,5,6\n");
    write("gyro.csv", "stamp[ms],gyro.x[rad/s]\n5,0.1\n10,0.2\n15,0.3\n");
    let with = |name: &str| ffid(dir.path(), &["convert", "joints.csv", "out.csv", "--with", name, "--force"]);
    let (code, _, err) = with("gyro.csv");
    assert_eq!(code, 0, "{err}");
    let want = "time[ns],q.a[deg],tau.a[N m],gyro.x[rad/s]\n0,1,2,\n5000000,,,0.1\n10000000,3,4,0.2\n15000000,,,0.3\n20000000,5,6,\n";
    assert_eq!(fs::read_to_string(dir.path().join("out.csv")).unwrap(), want);
    let epoch = "time[s],gyro.x[rad/s]\n1700000000.5,0.1\n1700000001,0.2\n";
    write("epoch.csv", epoch);
    write("later.csv", &epoch.replace("17000000", ""));
    write("twice.csv", "time[s],q.a[rad]\n0,1\n1,2\n");
    write("back.csv", "time[s],gyro.x[rad/s]\n0,1\n0.01,2\n0.005,3\n");
    let wrong = [
        ("epoch.csv", "Data::Outside", "1970"),
        ("later.csv", "Data::Outside", "do not overlap"),
        ("twice.csv", "Data::Columns", "q.a"),
        ("back.csv", "Data::NonMonotone", "row 3"),
    ];
    for (name, code, what) in wrong {
        let (exit, out, err) = with(name);
        assert!(exit == 12 && err.contains(code) && err.contains(what) && err.contains(name), "{out}\n{err}");
    }
}

/// A rule that fits no column of any of the files says which are closest, whatever else is missing for want of it.
#[test]
fn a_rule_for_no_column_names_the_closest() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("joints.csv", "stamp,q.a[deg],tau.a[N m]\n0,1,2\n0.01,3,4\n0.02,5,6\n");
    write("gyro.csv", "stamp,w_x[rad/s]\n0.005,0.1\n0.01,0.2\n");
    let with = |rules: &[&str]| {
        let rules: Vec<&str> = rules.iter().flat_map(|r| ["--rename", r]).collect();
        ffid(dir.path(), &[&["convert", "joints.csv", "out.csv", "--with", "gyro.csv", "--force"][..], &rules].concat())
    };
    let (code, _, err) = with(&["stmap=time[s]", "w_x=gyro.x"]);
    assert!(
        code == 12
            && err.contains("'stmap'")
            && err.contains("closest: 'stamp' in 'joints.csv'; 'stamp' in 'gyro.csv'"),
        "{err}"
    );
    let (code, _, err) = with(&["stamp=time[s]", "wx_*=gyro.*"]);
    assert!(code == 12 && err.contains("'wx_*'") && err.contains("closest: 'w_x' in 'gyro.csv'"), "{err}");
    let (code, out, err) = with(&["stamp=time[s]", "w_*=gyro.*"]);
    assert!(code == 0 && !err.contains("error"), "{out}\n{err}");
    let (code, _, err) = ffid(dir.path(), &["convert", "joints.csv", "out.csv", "--force", "--rename", "stmp=time[s]"]);
    assert!(code == 12 && err.contains("closest: stamp"), "{err}");
    // Dates that a later row settles, and a bag that was cut short.
    let rows = "stamp,q.a[rad]\n3/5/2024 11:59:59.5 PM,1\n3/6/2024 12:00:00.5 AM,2\n";
    write("dates.csv", rows);
    convert(dir.path(), &["dates.csv", "out.csv", "--force"]);
    let text = fs::read_to_string(dir.path().join("out.csv")).unwrap();
    assert_eq!(text, "time[ns],q.a[rad]\n1709683199500000000,1\n1709683200500000000,2\n");
    write("open.csv", &rows.replace("3/6/2024 12", "3/5/2024 12"));
    let (code, _, err) = ffid(dir.path(), &["convert", "open.csv", "out.csv", "--force"]);
    assert!(code == 12 && err.contains("Data::Dates") && err.contains("--dates day-first"), "{err}");
    let bag = fs::read(fixture("zstd.mcap")).unwrap();
    fs::write(dir.path().join("cut.mcap"), &bag[..bag.len() * 2 / 3]).unwrap();
    let v = convert(dir.path(), &["cut.mcap", "out.csv", "--force"]);
    assert_eq!(
        (v["converted"]["rows"].as_u64(), &v["problems"][0]["code"]),
        (Some(205), &"Data::MaybeTruncated".into())
    );
}

#[test]
fn columns_without_a_name_are_left_out_with_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("p.csv"), ",time[s],q.a[rad]\n0,0.5,-0.25\n1,0.75,0.125\n").unwrap();
    let v = convert(dir.path(), &["p.csv", "q.csv"]);
    assert_eq!(v["problems"][0]["code"], "Data::NotUsed");
    assert_eq!(fs::read_to_string(dir.path().join("q.csv")).unwrap(), "time[s],q.a[rad]\n0.5,-0.25\n0.75,0.125\n");
}

#[test]
fn a_bag_becomes_a_record_on_the_clock_of_its_joints() {
    let dir = tempfile::tempdir().unwrap();
    let bag = fixture("zstd.mcap");
    let v = convert(dir.path(), &[bag.to_str().unwrap(), "bag.csv"]);
    assert_eq!(v["converted"]["rows"].as_u64(), Some(299));
    let said = &v["problems"][0];
    assert_eq!((said["code"].as_str(), said["severity"].as_str()), (Some("Data::Merged"), Some("warning")));
    assert!(said["message"].as_str().unwrap().contains("interpolated to 299 stamps of '/arm/joint_states'"), "{said}");
    let text = fs::read_to_string(dir.path().join("bag.csv")).unwrap();
    let head = "time[ns],q.shoulder[rad],q.elbow[rad],tau.shoulder[N m],tau.elbow[N m],gyro.x[rad/s],gyro.y[rad/s],gyro.z[rad/s],";
    assert!(text.starts_with(head), "{}", text.lines().next().unwrap());
    assert!(text.lines().nth(1).unwrap().starts_with("1700000000123456789,0,0.5"), "{}", text.lines().nth(1).unwrap());
    // Which topic, when there are two.
    let two = fixture("two_arms.mcap");
    let (code, _, err) = ffid(dir.path(), &["convert", two.to_str().unwrap(), "x.parquet"]);
    assert!(code == 12 && err.contains("Data::Topics") && err.contains("/other/joint_states"), "{err}");
    convert(dir.path(), &[two.to_str().unwrap(), "x.parquet", "--topic", "/arm/joint_states"]);
}

#[test]
fn what_cannot_be_converted_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("unit.csv", "time[s],q.a\n0,1\n");
    write("odd.csv", "time[s],q.a[furlong]\n0,1\n");
    write("word.csv", "time[s],q.a[rad]\n0,1\n0.1,left\n");
    write("cut.csv", "time[s],q.a[rad]\n0,1\n0.1,2");
    write("old.parquet", "mine");
    for (file, code, says) in [
        ("unit.csv", "Data::UnitMissing", "NAME[UNIT]"),
        ("odd.csv", "Data::UnknownUnit", "furlong"),
        ("word.csv", "Data::BadNumber", ":3:5:"),
        ("cut.csv", "Data::MaybeTruncated", ":3:"),
    ] {
        let (exit, _, err) = ffid(dir.path(), &["convert", file, "old.parquet", "--force"]);
        assert_eq!(exit, 12, "{err}");
        assert!(err.contains(code) && err.contains(says), "{file}: {err}");
    }
    let (exit, _, err) = ffid(dir.path(), &["convert", "unit.csv", "old.parquet"]);
    assert!(exit == 20 && err.contains("--force"), "{err}");
    assert_eq!(fs::read_to_string(dir.path().join("old.parquet")).unwrap(), "mine");
    let (exit, _, err) = ffid(dir.path(), &["convert", "cut.csv", "out.xlsx"]);
    assert!(exit == 11 && err.contains(".parquet"), "{err}");
    let left = fs::read_dir(dir.path())
        .unwrap()
        .filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().contains("partial"));
    assert_eq!(left.count(), 0);
}

#[test]
fn the_schema_is_json_and_knows_the_kinds() {
    let dir = tempfile::tempdir().unwrap();
    let (code, out, err) = ffid(dir.path(), &["schema", "mission"]);
    assert_eq!(code, 0, "{err}");
    let v: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(v["required"], serde_json::json!(["robot"]));
    let kinds = v["properties"]["appendage"]["items"]["properties"]["kind"]["enum"].to_string();
    assert!(kinds.contains("flex_panel") && kinds.contains("slosh_tank"), "{kinds}");
}
