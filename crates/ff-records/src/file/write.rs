//! Writing a record: every number in its shortest exact form.

use super::JointColumn;
use super::blocks::{Block, Stamps};
use super::columns::{GROUPS, Group, time_column};
use super::units::si;
use nalgebra::DMatrix;
use std::io;
use std::io::Write;

/// What a file is to hold. Matrices are N x channels, as in [`Record`](crate::record::Record).
#[derive(Clone, Copy, Debug)]
pub struct CsvWriter<'a> {
    /// Joints, in the order of the columns.
    pub joints: &'a [JointColumn],
    /// Time stamps (s), N.
    pub time: &'a [f64],
    /// Joint positions.
    pub q: &'a DMatrix<f64>,
    /// Joint rates.
    pub dq: Option<&'a DMatrix<f64>>,
    /// Joint accelerations.
    pub ddq: Option<&'a DMatrix<f64>>,
    /// Joint torques; currents (A) of the joints that `currents` marks.
    pub tau: &'a DMatrix<f64>,
    /// Joints whose channel is the current of the motor, not the torque; none when empty.
    pub currents: &'a [bool],
    /// Base rates; none of a base that is bolted down.
    pub gyro: Option<&'a DMatrix<f64>>,
    /// Specific force.
    pub acc: Option<&'a DMatrix<f64>>,
    /// Attitude quaternions.
    pub att: Option<&'a DMatrix<f64>>,
}

impl CsvWriter<'_> {
    /// The groups that are there, with their matrices.
    fn groups(&self) -> impl Iterator<Item = (Group, &DMatrix<f64>)> {
        let all = [Some(self.q), self.dq, self.ddq, Some(self.tau), self.gyro, self.acc, self.att];
        GROUPS.into_iter().zip(all).filter_map(|(g, m)| Some((g, m?)))
    }
    /// Header cells, in order. Allocates.
    pub fn header(&self) -> Vec<String> {
        let mut out = vec!["time[s]".to_owned()];
        for (g, _) in self.groups() {
            for (k, name) in g.channels(self.joints).iter().enumerate() {
                if g == Group::Tau && self.currents.get(k) == Some(&true) {
                    out.push(format!("{}.{name}[{}]", Group::Current.prefix(), si(Group::Current.dimension(false))));
                    continue;
                }
                let slides = self.joints.get(k).is_some_and(|j| j.slides);
                out.push(format!("{}.{name}[{}]", g.prefix(), si(g.dimension(slides))));
            }
        }
        out
    }
    /// Its columns as a block of [`CsvWriter::header`], the time in its stamps. Allocates.
    pub fn block(&self) -> Block {
        let columns = std::iter::once(Vec::new());
        let values = self.groups().flat_map(|(_, m)| m.column_iter()).map(|c| c.iter().copied().collect());
        Block { stamps: Stamps::Real(self.time.to_vec()), columns: columns.chain(values).collect() }
    }
    /// Writes the file; the reader gives the same numbers back, bit for bit.
    ///
    /// # Errors
    /// Those of `out`; [`io::ErrorKind::InvalidData`] for a number that is not finite or a matrix of another shape, with
    /// nothing written.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let wrong = |what: String| Err(io::Error::new(io::ErrorKind::InvalidData, what));
        for (g, m) in self.groups() {
            let want = (self.time.len(), g.channels(self.joints).len());
            if m.shape() != want {
                return wrong(format!("{}: {:?} instead of {want:?} numbers", g.prefix(), m.shape()));
            }
            if let Some(i) = m.as_slice().iter().position(|x| !x.is_finite()) {
                let (row, column) = (i % want.0, i / want.0);
                return wrong(format!("{} of channel {column}, row {row} is not finite", g.prefix()));
            }
        }
        if let Some(row) = self.time.iter().position(|t| !t.is_finite()) {
            return wrong(format!("time of row {row} is not finite"));
        }
        let mut names = csv::Writer::from_writer(Vec::new());
        names.write_record(self.header()).map_err(io::Error::other)?;
        out.write_all(&names.into_inner().map_err(|e| io::Error::other(e.to_string()))?)?;
        let matrices: Vec<&DMatrix<f64>> = self.groups().map(|(_, m)| m).collect();
        for (i, t) in self.time.iter().enumerate() {
            number(out, *t)?;
            for m in &matrices {
                for j in 0..m.ncols() {
                    out.write_all(b",")?;
                    number(out, m[(i, j)])?;
                }
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    }
}

/// Rows of CSV, block after block.
#[derive(Debug)]
pub struct CsvRows<W> {
    out: W,
    /// Column of the time in a block.
    time: Option<usize>,
}

impl<W: Write> CsvRows<W> {
    /// Writes the line of names (`name[unit]`, time among them or not).
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(mut out: W, names: &[String]) -> io::Result<Self> {
        let mut head = csv::Writer::from_writer(Vec::new());
        head.write_record(names).map_err(io::Error::other)?;
        out.write_all(&head.into_inner().map_err(|e| io::Error::other(e.to_string()))?)?;
        Ok(Self { out, time: time_column(names).ok() })
    }
    /// Writes rows; NaN is an empty cell. The block has a column per name; that of the time is in its stamps.
    ///
    /// # Errors
    /// Those of `out`; [`io::ErrorKind::InvalidData`] for a column that is too short.
    pub fn write(&mut self, block: &Block) -> io::Result<()> {
        let n = block.rows();
        if block.columns.iter().enumerate().any(|(k, c)| Some(k) != self.time && c.len() != n) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a block of another shape"));
        }
        for i in 0..n {
            for (k, c) in block.columns.iter().enumerate() {
                if k > 0 {
                    self.out.write_all(b",")?;
                }
                match (&block.stamps, Some(k) == self.time) {
                    (Stamps::Whole(v), true) => write!(self.out, "{}", v[i])?,
                    (Stamps::Real(v), true) => number(&mut self.out, v[i])?,
                    _ if c[i].is_nan() => {}
                    _ => number(&mut self.out, c[i])?,
                }
            }
            self.out.write_all(b"\n")?;
        }
        Ok(())
    }
    /// Gives back what was written to.
    ///
    /// # Errors
    /// None so far; for the symmetry of writers.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.out)
    }
}

/// Shortest text that reads back exactly: plain digits, or an exponent for the very large and small.
fn number(out: &mut impl Write, x: f64) -> io::Result<()> {
    if x == 0.0 || (1e-4..1e16).contains(&x.abs()) { write!(out, "{x}") } else { write!(out, "{x:e}") }
}
