//! How fast records are read, and in how much memory: writes a file of each format and reads it, once into a record and once block
//! by block as `ffid convert` does. Speeds are of decoded samples, eight bytes each, and of the file.
//!
//! ```sh
//! cargo run --release -p ff-records --features parquet,mcap --example record_speed -- 200               # MB of samples
//! cargo run --release -p ff-records --features parquet,mcap --example record_speed -- 2100 csv blocks   # a file of 5 GB
//! ```
//!
//! After the size come formats (`csv`, every digit; `csv6`, six places; `parquet`; `mcap`; all unless named), and `blocks` for blocks
//! alone.

use ff_records::file::{Block, Blocks, CsvRows, JointColumn, ParquetWriter, ReadOptions, Stamps, open, read};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs::File;
use std::io;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

const JOINTS: usize = 7;
/// Numbers of a row: time, positions and torques of the joints, base rates.
const WIDTH: usize = 1 + 2 * JOINTS + 3;

fn value(i: usize, j: usize) -> f64 {
    ((i as f64 * 0.37 + j as f64) * 1.7).sin()
}

fn names() -> Vec<String> {
    let mut names = vec!["time[s]".to_owned()];
    names.extend((1..=JOINTS).map(|j| format!("q.joint{j}[rad]")));
    names.extend((1..=JOINTS).map(|j| format!("tau.joint{j}[N m]")));
    names.extend(["x", "y", "z"].map(|a| format!("gyro.{a}[rad/s]")));
    names
}

/// The rows of a table, block after block.
fn blocks(rows: usize, of: fn(usize, usize) -> f64, mut to: impl FnMut(&Block) -> io::Result<()>) -> io::Result<()> {
    for start in (0..rows).step_by(8192) {
        let range = start..(start + 8192).min(rows);
        let mut block = Block::new(WIDTH);
        block.stamps = Stamps::Real(range.clone().map(|i| i as f64 / 1000.0).collect());
        for (j, c) in block.columns.iter_mut().enumerate().skip(1) {
            c.extend(range.clone().map(|i| of(i, j)));
        }
        to(&block)?;
    }
    Ok(())
}

fn csv(path: &Path, rows: usize, of: fn(usize, usize) -> f64) -> Result<(), Box<dyn Error>> {
    let mut w = CsvRows::new(BufWriter::new(File::create(path)?), &names())?;
    blocks(rows, of, |b| w.write(b))?;
    w.finish()?.flush()?;
    Ok(())
}

/// Every digit of a number: 18 to 20 characters.
fn all_digits(path: &Path, rows: usize) -> Result<(), Box<dyn Error>> {
    csv(path, rows, value)
}

/// Six places, as most recorders write: ten characters.
fn six_places(path: &Path, rows: usize) -> Result<(), Box<dyn Error>> {
    csv(path, rows, |i, j| (value(i, j) * 1e6).round() / 1e6)
}

fn parquet(path: &Path, rows: usize) -> Result<(), Box<dyn Error>> {
    let mut w = ParquetWriter::new(BufWriter::new(File::create(path)?), &names(), false)?;
    blocks(rows, value, |b| w.write(b))?;
    w.finish()?.flush()?;
    Ok(())
}

/// A CDR message in the making; positions count from behind the header.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new(stamp: u64) -> Self {
        let mut c = Self(vec![0, 1, 0, 0]);
        c.u32((stamp / 1_000_000_000) as u32);
        c.u32((stamp % 1_000_000_000) as u32);
        c.text("bus");
        c
    }
    fn align(&mut self, n: usize) {
        while !(self.0.len() - 4).is_multiple_of(n) {
            self.0.push(0);
        }
    }
    fn u32(&mut self, x: u32) {
        self.align(4);
        self.0.extend(x.to_le_bytes());
    }
    fn f64(&mut self, x: f64) {
        self.align(8);
        self.0.extend(x.to_le_bytes());
    }
    fn text(&mut self, s: &str) {
        self.u32(s.len() as u32 + 1);
        self.0.extend(s.as_bytes());
        self.0.push(0);
    }
}

/// A bag of joint states with base samples at the same instants, in lz4 chunks of about 1 MB.
fn bag(path: &Path, rows: usize) -> Result<(), Box<dyn Error>> {
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4)).chunk_size(Some(1_000_000));
    let mut out = options.create(BufWriter::new(File::create(path)?))?;
    let mut channel = |topic: &str, schema: &str| {
        let schema = out.add_schema(schema, "ros2msg", &[])?;
        out.add_channel(schema, topic, "cdr", &BTreeMap::new())
    };
    let joints_id = channel("/joint_states", "sensor_msgs/msg/JointState")?;
    let imu_id = channel("/imu", "sensor_msgs/msg/Imu")?;
    for i in 0..rows {
        let stamp = 1_700_000_000_000_000_000 + i as u64 * 1_000_000;
        let mut joints = Cdr::new(stamp);
        joints.u32(JOINTS as u32);
        (1..=JOINTS).for_each(|j| joints.text(&format!("joint{j}")));
        for part in [1, 0, 1 + JOINTS] {
            // No rates.
            joints.u32(if part > 0 { JOINTS as u32 } else { 0 });
            (0..JOINTS).filter(|_| part > 0).for_each(|j| joints.f64(value(i, part + j)));
        }
        let mut imu = Cdr::new(stamp);
        for k in 0..37 {
            // No attitude, no accelerometer: their first covariances are -1.
            imu.f64(match k {
                4 | 28 => -1.0,
                13..=15 => value(i, 1 + 2 * JOINTS + k - 13),
                _ => 0.0,
            });
        }
        for (channel_id, message) in [(imu_id, imu.0), (joints_id, joints.0)] {
            let header = MessageHeader { channel_id, sequence: i as u32, log_time: stamp, publish_time: stamp };
            out.write_to_known_channel(&header, &message)?;
        }
    }
    out.finish()?;
    Ok(())
}

/// Greatest memory of this process so far (MB); none where `/proc` is not.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1e3)
}

/// Time that this process has been on a processor (s); none where `/proc` is not. On a machine that is busy it says more than the
/// clock on the wall.
fn busy() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? / 1e9)
}

/// What reading has taken since these times.
fn say(what: &str, rows: usize, (wall, cpu): (Instant, Option<f64>), file: &Path) -> Result<(), Box<dyn Error>> {
    let (seconds, decoded) = (wall.elapsed().as_secs_f64(), (rows * WIDTH * 8) as f64 / 1e6);
    let on_disk = std::fs::metadata(file)?.len() as f64 / 1e6;
    let used = cpu.zip(busy()).map(|(from, to)| to - from);
    let cpu = used.map_or(String::new(), |u| format!(" ({:.0} per second on a processor)", decoded / u));
    let peak = peak().map_or(String::new(), |p| format!(", peak memory {p:.0} MB"));
    println!(
        "{what}: {rows} rows, {seconds:.3} s, {:.0} MB/s decoded{cpu}, {:.0} MB/s of {on_disk:.0} MB on disk{peak}",
        decoded / seconds,
        on_disk / seconds
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let megabytes: usize = words.next().map_or(Ok(100), |a| a.parse())?;
    let words: Vec<String> = words.collect();
    let only_blocks = words.iter().any(|w| w == "blocks");
    let rows = megabytes * 1_000_000 / (8 * WIDTH);
    let joints: Vec<JointColumn> =
        (1..=JOINTS).map(|j| JointColumn { name: format!("joint{j}"), slides: false }).collect();
    let file = |end: &str| -> PathBuf {
        std::env::temp_dir().join(format!("ident-record-speed-{}.{end}", std::process::id()))
    };
    type Make = fn(&Path, usize) -> Result<(), Box<dyn Error>>;
    let all = [("csv", all_digits as Make), ("csv6", six_places), ("parquet", parquet), ("mcap", bag)];
    let named = all.iter().any(|(name, _)| words.iter().any(|w| w == name));
    for (name, make) in all.into_iter().filter(|(name, _)| !named || words.iter().any(|w| w == name)) {
        let path = file(name);
        make(&path, rows)?;
        let options = ReadOptions { max_rows: usize::MAX, ..ReadOptions::default() };
        for _ in 0..3 {
            let start = (Instant::now(), busy());
            let (_, mut source): (_, Box<dyn Blocks>) = open(&path, &joints, &options).map_err(|p| p.to_string())?;
            let (mut block, mut n) = (Block::new(source.names().len()), 0);
            while source.next(&mut block).map_err(|p| p.to_string())? {
                n += block.rows();
            }
            say(&format!("{name}, in blocks"), n, start, &path)?;
        }
        for _ in 0..if only_blocks { 0 } else { 3 } {
            let start = (Instant::now(), busy());
            let loaded = read(&path, &joints, &options).map_err(|p| p.to_string())?;
            say(&format!("{name}, a record"), loaded.record.samples(), start, &path)?;
        }
        std::fs::remove_file(&path)?;
    }
    Ok(())
}
