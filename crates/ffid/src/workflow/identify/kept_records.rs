//! Records that a result keeps, so that a later identification is fitted to them as well.
//!
//! What a weak record says is no parabola around its own estimates: ridges of slosh mass, length and stiffness are curved, and a Gaussian
//! taken from there is confidently wrong where a later record leads. The records themselves have the whole shape, and the order in which
//! they come plays no part.

use super::labelled_record::LabelledRecord;
use crate::exit::Failure;
use crate::files::atomic;
use crate::files::folder::Folder;
use ff_model::{BaseKind, Model, Problems};
use ff_records::Record;
use ff_records::file::{CsvWriter, ParquetWriter, ReadOptions, joints_of, read};
use serde::{Deserialize, Serialize};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Samples of all records of a result together up to which it keeps them: an hour at 100 Hz, three times over.
pub const MOST_SAMPLES: usize = 1 << 20;

/// A record of a result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptRecord {
    /// Its label there.
    pub label: String,
    /// Its file in the folder of the result: what was fitted, corrected clocks included.
    pub file: String,
    /// Whether its torques were put on another clock by interpolation.
    pub resampled_torques: bool,
    /// Whether its gyro was.
    pub resampled_gyro: bool,
    /// Whether it is the part behind a gap, which begins in the middle of a motion.
    #[serde(default)]
    pub continues: bool,
    /// Identifications before that one it was fitted first.
    #[serde(default)]
    pub ago: usize,
}

/// Writes the records of a fit into its folder; none of them when they are longer than [`MOST_SAMPLES`] or have several clocks.
///
/// # Errors
/// [`Failure::Io`].
pub fn keep(folder: &Folder, model: &Model, records: &[LabelledRecord]) -> Result<Vec<KeptRecord>, Failure> {
    let samples: usize = records.iter().map(|r| r.record.samples()).sum();
    if samples > MOST_SAMPLES || records.iter().any(|r| !r.record.is_uniform()) {
        return Ok(Vec::new());
    }
    let mut kept = Vec::new();
    for (k, labelled) in records.iter().enumerate() {
        let file = format!("record-{}.parquet", k + 1);
        write(&folder.path().join(&file), model, &labelled.record)?;
        let (resampled_torques, resampled_gyro) = labelled.resampled;
        let label = labelled.label.clone();
        let LabelledRecord { continues, ago, .. } = *labelled;
        kept.push(KeptRecord { label, file, resampled_torques, resampled_gyro, continues, ago });
    }
    Ok(kept)
}

/// One record, with every number as it is.
fn write(path: &Path, model: &Model, r: &Record) -> Result<(), Failure> {
    let joints = joints_of(model);
    let time: Vec<f64> = (0..r.samples()).map(|i| r.time(i)).collect();
    let columns = CsvWriter {
        currents: r.currents(),
        joints: &joints,
        time: &time,
        q: r.q(),
        dq: r.qd(),
        ddq: r.qdd(),
        tau: r.tau(),
        gyro: (!r.is_fixed_base()).then(|| r.gyro()),
        acc: r.acc(),
        att: r.att(),
    };
    atomic::stream(path, |f| {
        let mut w = ParquetWriter::new(BufWriter::new(f), &columns.header(), false)?;
        w.write(&columns.block())?;
        w.finish()?.flush()
    })
}

/// Reads the records that a result keeps. `allow` are the codes of what was let through when they were read first.
///
/// # Errors
/// Those of [`ff_records::file::read()`]: a model with other joints, a file that cannot be read.
pub fn read_kept(
    folder: &Path,
    kept: &[KeptRecord],
    model: &Model,
    allow: &[String],
) -> Result<Vec<LabelledRecord>, Problems> {
    let options = ReadOptions {
        fixed_base: model.base_kind() == BaseKind::Fixed,
        allow: allow.to_vec(),
        // Those that were left out are not in the file; those in it were fitted.
        keep_spikes: true,
        ..ReadOptions::default()
    };
    let one = |k: &KeptRecord| {
        let record = read(&folder.join(&k.file), &joints_of(model), &options)?.record;
        let resampled = (k.resampled_torques, k.resampled_gyro);
        Ok(LabelledRecord { label: k.label.clone(), record, resampled, continues: k.continues, ago: k.ago + 1 })
    };
    kept.iter().map(one).collect()
}
