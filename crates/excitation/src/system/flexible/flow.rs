//! The record and its sensitivities over time, and the exact way back through it.
//!
//! Classical Runge-Kutta steps of state and columns together, a sample at the start of every step; the gradient is that
//! of the discrete solution, by the adjoint of each step.

use super::system::{Outputs, Point, System};
use ff_dynamics::reduced::{STAGE, WEIGHT};
use nalgebra::{DMatrix, DVector};

/// Joint motion at a node: `q, qd, qdd`.
pub(super) type Joints = [Vec<f64>; 3];

/// Place of a stage within the step, as a fraction of it.
fn fraction(stage: usize) -> f64 {
    0.5 * STAGE[stage] as f64
}

/// A motion tabulated at half steps.
pub(super) struct Table {
    numbers: Vec<Vec<f64>>,
    pub(super) step: f64,
}

impl Table {
    pub(super) fn new(system: &System, nodes: &[Joints], step: f64) -> Self {
        let mut arm = system.arm.clone();
        let one = |(i, [q, qd, qdd]): (usize, &Joints)| {
            let mut out = Vec::new();
            let [q, qd, qdd] = &system.of_tree([q, qd, qdd]);
            arm.numbers([q, qd, qdd], i % 2 == 0, &mut out);
            out
        };
        Self { numbers: nodes.iter().enumerate().map(one).collect(), step }
    }
    pub(super) fn steps(&self) -> usize {
        self.numbers.len() / 2
    }
}

/// Every point of an integration: four per step, and the last sample.
pub(super) struct Flow {
    points: Vec<Point>,
}

impl Flow {
    /// `None` where a mass matrix is not positive definite or the state is lost.
    pub(super) fn new(system: &System, table: &Table, z: DVector<f64>, s: DMatrix<f64>) -> Option<Self> {
        let (mut z, mut s, h) = (z, s, table.step);
        let mut points = Vec::with_capacity(4 * table.steps() + 1);
        for step in 0..table.steps() {
            let (mut zi, mut si) = (z.clone(), s.clone());
            let (z0, s0) = (z.clone(), s.clone());
            for stage in 0..4 {
                let node = 2 * step + STAGE[stage];
                let p = system.point(&table.numbers[node], zi, si)?;
                let (dz, ds) = system.rates(&p);
                z.axpy(h * WEIGHT[stage], &dz, 1.0);
                add(&mut s, h * WEIGHT[stage], &ds);
                if stage < 3 {
                    (zi, si) = (z0.clone(), s0.clone());
                    zi.axpy(h * fraction(stage + 1), &dz, 1.0);
                    add(&mut si, h * fraction(stage + 1), &ds);
                } else {
                    (zi, si) = (DVector::zeros(0), DMatrix::zeros(0, 0));
                }
                points.push(p);
            }
            if z.iter().any(|x| !x.is_finite()) {
                return None;
            }
        }
        points.push(system.point(table.numbers.last()?, z, s)?);
        Some(Self { points })
    }
    /// Sensitivities of torque, gyro and accelerometer at every sample.
    pub(super) fn samples(&self, system: &System, table: &Table) -> Vec<Outputs> {
        let at = |i: usize| system.outputs(&self.points[4 * i], &table.numbers[2 * i]);
        (0..=table.steps()).map(at).collect()
    }
    /// From gradients over the samples to those over the numbers of the table and over the step. Those over the initial
    /// state are dropped: the start does not depend on the plan.
    pub(super) fn pull(&self, system: &System, table: &Table, over: &[Outputs]) -> (Vec<Vec<f64>>, f64) {
        let h = table.step;
        let (nz, columns) = (system.nz, system.columns);
        let zero = || (DVector::<f64>::zeros(nz), DMatrix::<f64>::zeros(nz, columns));
        let mut numbers: Vec<Vec<f64>> = table.numbers.iter().map(|x| vec![0.0; x.len()]).collect();
        let mut over_step = 0.0;
        let (mut lz, mut ls) = zero();
        let last = table.steps();
        let (nothing_z, nothing_s) = zero();
        system.pull(
            &self.points[4 * last],
            &table.numbers[2 * last],
            (&nothing_z, &nothing_s),
            over.last(),
            (&mut lz, &mut ls, &mut numbers[2 * last]),
        );
        for step in (0..last).rev() {
            // Gradients over the state at each stage, gathered from the last stage to the first.
            let (mut to_z, mut to_s) = (lz.clone(), ls.clone());
            let mut later: Option<(DVector<f64>, DMatrix<f64>)> = None;
            for stage in (0..4).rev() {
                let p = &self.points[4 * step + stage];
                let node = 2 * step + STAGE[stage];
                let (dz, ds) = system.rates(p);
                let (mut kz, mut ks) = (&lz * (h * WEIGHT[stage]), &ls * (h * WEIGHT[stage]));
                over_step += WEIGHT[stage] * (lz.dot(&dz) + ls.dot(&ds));
                if let Some((az, a_s)) = &later {
                    kz.axpy(h * fraction(stage + 1), az, 1.0);
                    add(&mut ks, h * fraction(stage + 1), a_s);
                    over_step += fraction(stage + 1) * (az.dot(&dz) + a_s.dot(&ds));
                }
                let (mut oz, mut os) = zero();
                let sample = if stage == 0 { over.get(step) } else { None };
                system.pull(p, &table.numbers[node], (&kz, &ks), sample, (&mut oz, &mut os, &mut numbers[node]));
                to_z += &oz;
                to_s += &os;
                later = Some((oz, os));
            }
            (lz, ls) = (to_z, to_s);
        }
        (numbers, over_step)
    }
}

fn add(to: &mut DMatrix<f64>, k: f64, x: &DMatrix<f64>) {
    to.as_mut_slice().iter_mut().zip(x.as_slice()).for_each(|(t, x)| *t += k * x);
}
