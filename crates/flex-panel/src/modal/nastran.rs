//! Modes from the printed output (`.f06`) of a Nastran normal-modes run (SOL 103) with `MEFFMASS(PARTFAC)=YES`.
//!
//! Two tables are read, by their titles and rows, wherever they stand and however often pages repeat the titles:
//!
//! ```text
//!                                    R E A L   E I G E N V A L U E S
//!    MODE  EXTRACTION    EIGENVALUE       RADIANS        CYCLES      GENERALIZED    GENERALIZED
//!     NO.    ORDER                                                      MASS         STIFFNESS
//!         1         1   2.088409E+00   1.445133E+00   2.300000E-01   1.000000E+00   2.088409E+00
//!
//!                                      MODAL PARTICIPATION FACTORS
//!    MODE   FREQUENCY       T1          T2          T3          R1          R2          R3
//!     NO.
//!         1  2.300000E-01  ...six factors
//! ```
//!
//! Nastran prints the factor `gamma = phi^T M D / m` of a mode with generalised mass `m = phi^T M phi`, `D` the six
//! rigid-body motions about the reference point of MEFFMASS (MSC Nastran, *Quick Reference Guide*, case control command
//! MEFFMASS; effective mass `m gamma^2`). Scaled to a modal mass of 1 kg it is `P = sqrt(m) gamma`.
//!
//! Nastran knows no units: the deck must be in kg, m and s (not in t, mm and s), and the reference point must be the
//! mount, with the basic system along the mount axes.

use super::Mode;
use super::table::{fault, number};
use ff_model::Problems;
use nalgebra::Vector6;
use std::collections::BTreeMap;
use std::path::Path;

/// The two frequencies of a mode, one from each table, agree to this part: what seven printed digits leave, generously.
const SAME_FREQUENCY: f64 = 1e-4;

#[derive(Clone, Copy, PartialEq)]
enum Block {
    None,
    Eigenvalues,
    Factors,
}

/// Modes by number from the text of an f06 file; every mode gets `damping_ratio`, which Nastran does not print.
/// `file` is for messages. Allocates.
///
/// # Errors
/// Everything that is wrong, all of [`ff_model::Area::Data`]: `Data::Missing` (a table, or a mode in one of the two),
/// `Data::Columns` (a row of a table with too few or too many columns), `Data::BadNumber`, `Data::Duplicate` (a mode
/// printed twice with other numbers, as several subcases do), `Data::Inconsistent` (frequencies that differ between the
/// tables, generalised mass not above zero).
pub fn read_f06(text: &str, damping_ratio: f64, file: &Path) -> Result<BTreeMap<u32, Mode>, Problems> {
    let mut out = Problems::default();
    // Line and numbers: cycles and generalised mass; frequency and six factors.
    let mut eigen: BTreeMap<u32, (usize, Vec<f64>)> = BTreeMap::new();
    let mut factors: BTreeMap<u32, (usize, Vec<f64>)> = BTreeMap::new();
    let (mut block, mut seen) = (Block::None, [false; 2]);
    for (line, text) in (1..).zip(text.lines()) {
        let tokens: Vec<&str> = text.split_whitespace().collect();
        match title(&tokens) {
            Some(b) => {
                block = b;
                seen[0] |= b == Block::Eigenvalues;
                seen[1] |= b == Block::Factors;
                continue;
            }
            // A row starts with the number of its mode and then has a number; page headers start with "1" and a word.
            None if block == Block::None || tokens.len() < 2 || tokens[1].parse::<f64>().is_err() => continue,
            None => {}
        }
        let Ok(mode) = tokens[0].parse::<u32>() else { continue };
        let (name, wanted, skip, table) = match block {
            Block::Eigenvalues => ("real eigenvalues", 7, 2, &mut eigen),
            _ => ("modal participation factors", 8, 1, &mut factors),
        };
        if tokens.len() != wanted {
            let what = format!("{} columns in the table of {name}, expected {wanted}", tokens.len());
            out.push(fault(file, line, "Data::Columns", what, "numbers that run together need a wider print format"));
            continue;
        }
        let mut row = Vec::with_capacity(wanted);
        for t in &tokens[skip..] {
            match number(t) {
                Ok(x) => row.push(x),
                Err(why) => out.push(fault(file, line, "Data::BadNumber", why, "print the tables anew")),
            }
        }
        if row.len() + skip == wanted && table.insert(mode, (line, row.clone())).is_some_and(|(_, r)| r != row) {
            let what = format!("mode {mode} is printed twice with other numbers in the table of {name}");
            out.push(fault(file, line, "Data::Duplicate", what, "give a file with one subcase"));
        }
    }
    for (found, name) in [(seen[0], "R E A L   E I G E N V A L U E S"), (seen[1], "MODAL PARTICIPATION FACTORS")] {
        if !found {
            let what = format!("has no table '{name}'");
            out.push(fault(
                file,
                1,
                "Data::Missing",
                what,
                "run SOL 103 with MEFFMASS(PARTFAC)=YES in the case control",
            ));
        }
    }
    if out.has_errors() {
        return Err(out);
    }
    let modes = join(&eigen, &factors, damping_ratio, file, &mut out);
    if modes.is_empty() && !out.has_errors() {
        out.push(fault(file, 1, "Data::Missing", "the tables have no modes", "check the range of the EIGRL card"));
    }
    if out.has_errors() { Err(out) } else { Ok(modes) }
}

/// Which table a line begins, or that it ends one; `None` for a line that is no title.
fn title(tokens: &[&str]) -> Option<Block> {
    let line = tokens.join(" ");
    if line.starts_with("R E A L E I G E N V A L U E S") {
        Some(Block::Eigenvalues)
    } else if line.starts_with("MODAL PARTICIPATION FACTORS") {
        Some(Block::Factors)
    } else if line.starts_with("MODAL EFFECTIVE")
        || line.starts_with("M O D A L")
        || line.starts_with("R E A L E I G E N V E C T O R")
    {
        Some(Block::None)
    } else {
        None
    }
}

/// One mode from a row of each table.
fn join(
    eigen: &BTreeMap<u32, (usize, Vec<f64>)>,
    factors: &BTreeMap<u32, (usize, Vec<f64>)>,
    damping_ratio: f64,
    file: &Path,
    out: &mut Problems,
) -> BTreeMap<u32, Mode> {
    let mut modes = BTreeMap::new();
    for (mode, (line, _)) in eigen.iter().filter(|(m, _)| !factors.contains_key(m)) {
        let what = format!("mode {mode} has an eigenvalue but no participation factors");
        out.push(fault(file, *line, "Data::Missing", what, "give the whole f06 file"));
    }
    for (&mode, (line, row)) in factors {
        // Of a row of eigenvalues: eigenvalue, radians, cycles, generalised mass, generalised stiffness.
        let Some((at, e)) = eigen.get(&mode) else {
            let what = format!("mode {mode} has participation factors but no eigenvalue");
            out.push(fault(file, *line, "Data::Missing", what, "give the whole f06 file"));
            continue;
        };
        let (cycles, mass) = (e[2], e[3]);
        if (cycles - row[0]).abs() > SAME_FREQUENCY * cycles.abs().max(row[0].abs()) {
            let what = format!("mode {mode}: {} Hz here, {cycles} Hz on line {at}", row[0]);
            out.push(fault(file, *line, "Data::Inconsistent", what, "the tables are of two runs; give a file of one"));
        }
        if mass <= 0.0 {
            let what = format!("mode {mode}: generalised mass {mass}, limit > 0");
            out.push(fault(file, *at, "Data::Inconsistent", what, "normalise eigenvectors by mass (NORM = MASS)"));
            continue;
        }
        let participation = Vector6::from_fn(|i, _| mass.sqrt() * row[1 + i]);
        modes.insert(mode, Mode { frequency_hz: cycles, damping_ratio, participation });
    }
    modes
}
