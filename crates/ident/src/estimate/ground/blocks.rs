//! Parts of a log that predict each other, each by a fit of all others: what settings of a calibration are chosen by, a low pass for one.

use super::calibration::Ground;
use super::currents;
use super::problem::Problem;
use super::selection::Folds;
use crate::solve::linear::{LinearError, Weights};
use ff_least_squares::Triangle;
use ff_records::Record;

/// The equations of a log, block by block, in triangles: fits and errors take no other pass over its samples.
pub struct Blocks<'a> {
    problem: Problem<'a>,
    /// Triangles of every joint, block by block.
    blocks: Vec<Vec<Triangle>>,
}

impl Ground<'_> {
    /// Cuts a record at `edges` (s, on its clock, ascending) into blocks, whose equations are set up for the parameters `selected` about `start`
    /// and the friction. Joints with currents count in N m, by the gains that the whole record tells. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn blocks<'a>(
        &'a self,
        record: &Record,
        edges: &[f64],
        (selected, start): (&'a [usize], &'a [f64]),
    ) -> Result<Blocks<'a>, LinearError> {
        let groups = self.checked(&[record], selected, start)?;
        let problem =
            Problem::new(self, &groups, currents(&[record], self.model.nj())?, (selected, start), self.all_terms());
        let at = |edge: &f64| ((edge - record.t0()) * record.rate_hz()).round().max(0.0) as usize;
        let mut blocks = Vec::new();
        for g in &groups {
            let (n, trimmed) = (g.samples(), record.samples().saturating_sub(g.samples()) / 2);
            let places: Vec<usize> = edges.iter().map(|e| at(e).saturating_sub(trimmed).min(n)).collect();
            let cuts: Vec<_> = places.windows(2).filter(|w| w[0] < w[1]).map(|w| w[0]..w[1]).collect();
            let found = g.triangles(self, &problem.layout, (selected, start, start), &cuts)?;
            let gains = if problem.currents.contains(&true) {
                problem.solve(&problem.triangles(&groups, start)?, &self.weights)?.joints.gains
            } else {
                vec![None; self.model.nj()]
            };
            let every = |_: usize| true;
            for block in found {
                let linear = block.iter().enumerate().map(|(j, t)| problem.linear(j, t, &gains, &every));
                blocks.push(linear.collect::<Result<Vec<_>, _>>()?);
            }
        }
        Ok(Blocks { problem, blocks })
    }
}

impl Blocks<'_> {
    /// Unknowns, parameters before the terms of the joints, as all blocks but one tell them: for each block. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn left_out(&self) -> Result<Vec<Vec<f64>>, LinearError> {
        let own = self.problem.layout.terms.len();
        Folds { problem: &self.problem, blocks: &self.blocks, own }.fits(&[], &Weights::FromResiduals(2))
    }
    /// Squared error (N^2 m^2, summed over the samples) of every block and joint by unknowns of its own. Allocates.
    pub fn missed(&self, by: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let of = |(block, x): (&Vec<Triangle>, &Vec<f64>)| block.iter().map(|t| t.cost(x)).collect();
        self.blocks.iter().zip(by).map(of).collect()
    }
    /// Squared torques of every block and joint, less those of parameters that are not selected. Allocates.
    pub fn torques(&self) -> Vec<Vec<f64>> {
        let zero = vec![0.0; self.problem.selected.len() + self.problem.layout.terms.len()];
        self.missed(&vec![zero; self.blocks.len()])
    }
}
