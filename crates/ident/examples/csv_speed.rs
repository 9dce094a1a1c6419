//! How fast records are read: writes a file of the given size and reads it, three times.
//!
//! `cargo run --release -p ident --example csv_speed -- 200` for 200 MB.

use ident::record_file::{CsvWriter, JointColumn, ReadOptions, read};
use nalgebra::DMatrix;
use std::io::{BufWriter, Write};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let megabytes: usize = std::env::args().nth(1).map_or(Ok(100), |a| a.parse())?;
    let joints: Vec<JointColumn> = (1..=7).map(|j| JointColumn { name: format!("joint{j}"), slides: false }).collect();
    // Numbers with all their digits take 18 to 20 characters, those of a recorder with six places ten.
    for (name, digits) in [("every digit", None), ("six places", Some(6))] {
        let rows = megabytes * 1_000_000 / if digits.is_none() { 345 } else { 190 };
        let value = |i: usize, j: usize| {
            let x = ((i as f64 * 0.37 + j as f64) * 1.7).sin();
            digits.map_or(x, |d| (x * 10f64.powi(d)).round() / 10f64.powi(d))
        };
        let wave = |n: usize, k: usize| DMatrix::from_fn(rows, n, |i, j| value(i, 10 * k + j));
        let (q, tau, gyro) = (wave(7, 0), wave(7, 1), wave(3, 2));
        let time: Vec<f64> = (0..rows).map(|i| i as f64 / 1000.0).collect();
        let w = CsvWriter {
            joints: &joints,
            time: &time,
            q: &q,
            dq: None,
            ddq: None,
            tau: &tau,
            gyro: &gyro,
            acc: None,
            att: None,
        };
        let path = std::env::temp_dir().join(format!("ident-csv-speed-{}.csv", std::process::id()));
        let mut file = BufWriter::new(std::fs::File::create(&path)?);
        w.write(&mut file)?;
        file.flush()?;
        for _ in 0..3 {
            let start = Instant::now();
            let loaded = read(&path, &joints, &ReadOptions::default())?;
            let seconds = start.elapsed().as_secs_f64();
            let mb = loaded.bytes as f64 / 1e6;
            println!(
                "{name}: {mb:.1} MB, {} samples, {seconds:.3} s, {:.0} MB/s",
                loaded.record.samples(),
                mb / seconds
            );
        }
        std::fs::remove_file(&path)?;
    }
    Ok(())
}
