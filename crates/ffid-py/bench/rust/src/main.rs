//! Times what `bench/dynamics.py` times, in Rust: batches of the dynamics on threads, and an identification from samples in memory.
//!
//! Usage: `ffid-py-bench URDF ROWS ROUNDS MISSION RECORD FITS`. Prints JSON: the least time of all rounds of each, in seconds.
#![forbid(unsafe_code)]

use ffid::dynamics::batch::{Algorithm, Motions, batch, position_width};
use ffid::exit::Exit;
use ffid::files::folder::Entry;
use ffid::mission::Leniency;
use ffid::model::{Model, Params};
use ffid::open::open;
use ffid::records::RecordBuilder;
use ffid::workflow::identify::Observer;
use ffid_cli::session;
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::thread::{available_parallelism, scope};
use std::time::Instant;

/// Numbers between -1 and 1 that repeat.
struct Random(u64);

impl Random {
    fn fill(&mut self, out: &mut [f64]) {
        for x in out {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *x = (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        }
    }
}

fn least(rounds: usize, mut work: impl FnMut()) -> f64 {
    (0..rounds).fold(f64::INFINITY, |least, _| {
        let begun = Instant::now();
        work();
        least.min(begun.elapsed().as_secs_f64())
    })
}

/// One algorithm over all rows, a part of them on each thread.
fn on_threads(algorithm: Algorithm, model: &Model, params: &Params<f64>, m: &Motions<'_>, out: &mut [f64]) {
    let width = algorithm.result_width(model);
    let share = m.rows.div_ceil(available_parallelism().map_or(1, usize::from)).next_multiple_of(8);
    scope(|s| {
        for (k, out) in out.chunks_mut(share * width).enumerate() {
            s.spawn(move || {
                let (first, rows) = (k * share, out.len() / width);
                let part = |x: &[f64]| first * (x.len() / m.rows)..(first + rows) * (x.len() / m.rows);
                let own = Motions { rows, q: &m.q[part(m.q)], v: &m.v[part(m.v)], given: &m.given[part(m.given)] };
                black_box(batch(algorithm, model, params, &own, out).is_ok())
            });
        }
    });
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().collect();
    let [_, urdf, rows, rounds, mission, record, fits] = words.as_slice() else {
        return Err("usage: ffid-py-bench URDF ROWS ROUNDS MISSION RECORD FITS".into());
    };
    let (rows, rounds, fits): (usize, usize, usize) = (rows.parse()?, rounds.parse()?, fits.parse()?);
    let opened = open(Path::new(urdf), Leniency::default())?;
    let (model, params) = (&opened.model, Params::nominal(&opened.model));
    let (nv, width) = (model.nv(), position_width(model));
    let mut random = Random(1);
    let (mut q, mut v, mut a) = (vec![0.0; rows * width], vec![0.0; rows * nv], vec![0.0; rows * nv]);
    [&mut q, &mut v, &mut a].into_iter().for_each(|x| random.fill(x));
    for row in q.chunks_mut(width) {
        let norm = row[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
        row[3..7].iter_mut().for_each(|x| *x /= norm);
    }
    let mut found = serde_json::Map::new();
    let cases =
        [("rnea", Algorithm::Rnea), ("mass_matrix", Algorithm::MassMatrix), ("regressor", Algorithm::Regressor)];
    for (name, algorithm) in cases {
        let mut out = vec![0.0; rows * algorithm.result_width(model)];
        let (v, given) = match algorithm {
            Algorithm::MassMatrix => (&[][..], &[][..]),
            _ => (&v[..], &a[..]),
        };
        let m = Motions { rows, q: &q, v, given };
        let time = least(rounds, || on_threads(algorithm, model, &params, &m, &mut out));
        found.insert(name.into(), time.into());
    }
    let m = Motions { rows, q: &q, v: &v, given: &a };
    let threads = available_parallelism().map_or(1, usize::from);
    let time = least(rounds, || _ = black_box(ffid::regressor_triangle(model, &params, &m, None, threads).is_ok()));
    found.insert("regressor_qr".into(), time.into());
    if fits > 0 {
        found.insert("identify".into(), identify(Path::new(mission), Path::new(record), fits)?.into());
    }
    println!("{}", serde_json::Value::Object(found));
    Ok(())
}

/// From samples in memory to the result.
fn identify(mission: &Path, record: &Path, fits: usize) -> Result<f64, Box<dyn Error>> {
    let opened = open(mission, Leniency::default())?;
    let read = session::read_record(&opened.model, record, &[]).map_err(|r| r.problems)?.record;
    let t: Vec<f64> = (0..read.samples()).map(|i| read.t0() + read.time(i)).collect();
    let mut ended = Vec::new();
    let time = least(fits, || {
        let built = RecordBuilder::new(opened.model.joint_names())
            .stamps(t.clone())
            .long_gaps(true)
            .need_samples(8)
            .q(read.q().clone())
            .tau(read.tau().clone())
            .gyro(read.gyro().clone())
            .build();
        ended.push(built.map_err(session::Refused::from).and_then(|(samples, warnings)| {
            let slices = [&t[..], read.q().as_slice(), read.tau().as_slice(), read.gyro().as_slice()];
            let source = Entry::of_numbers(&slices, "arrays");
            let leniency = Leniency::default();
            let given = session::given(&opened.model, Path::new("arrays"), samples, warnings, source, &leniency)?;
            session::identify(mission, &opened, &[given], None, &[], &Observer::default()).map(|i| i.exit)
        }));
    });
    match ended.into_iter().find(|e| !matches!(e, Ok(Exit::Done))) {
        Some(other) => Err(format!("{other:?}").into()),
        None => Ok(time),
    }
}
