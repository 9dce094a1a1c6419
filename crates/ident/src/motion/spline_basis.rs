//! The basis of a spline at the times of the samples, its normal equations, and kinks beside it.

use crate::motion::banded::Banded;
use crate::motion::kink::{Column, Kink};
use crate::motion::spline_fit::{FitError, JointSamples};
use core::ops::Range;
use ff_dynamics::motion::bspline::{Knots, LOCAL};
use nalgebra::{DMatrix, DVector};

/// Weight of the rate at the first sample, where it is held, over that of the samples on its knots: leaves `1e-8` of it, and half the
/// digits.
pub(super) const HELD: f64 = 1e8;

/// Basis functions at a time: index of the first, and the values of those that are not zero.
type Row = (usize, [f64; LOCAL]);

/// Least squares over positions, rates where they are read, and a rate that may be held at zero.
pub(super) struct SplineBasis {
    pub(super) knots: Knots,
    /// At each sample.
    positions: Vec<Row>,
    /// The same of their first derivative, where rates are read; else only at the first sample.
    rates: Vec<Row>,
    /// Squared weight of a rate.
    of_rates: f64,
    /// That of the rate held at the first sample; 0 for none.
    held: f64,
    normal: Banded,
}

/// A spline with kinks.
pub(super) struct Bent {
    pub(super) columns: Vec<Column>,
    pub(super) sizes: DVector<f64>,
    /// Of the sizes, for noise of unit deviation in the positions.
    pub(super) variances: DVector<f64>,
    /// Control points of the spline beside them.
    pub(super) control: DVector<f64>,
}

impl SplineBasis {
    /// So many spans of equal length over the samples, whose first time is zero.
    pub(super) fn new(s: &JointSamples<'_>, spans: usize, degree: usize, from_rest: bool) -> Result<Self, FitError> {
        let knots = Knots::uniform(degree, spans + degree, s.times[s.times.len() - 1])?;
        let mut normal = Banded::zeros(knots.count());
        let of_rates = if s.qd.is_some() { s.rate_weight * s.rate_weight } else { 0.0 };
        let (mut positions, mut rates) = (Vec::with_capacity(s.times.len()), Vec::new());
        for &t in s.times {
            let (first, [b, d]) = knots.local::<2>(t);
            normal.add_outer(first, &b[..=degree], 1.0);
            positions.push((first, b));
            if s.qd.is_some() {
                normal.add_outer(first, &d[..=degree], of_rates);
                rates.push((first, d));
            }
        }
        if rates.is_empty() {
            let (first, [_, d]) = knots.local::<2>(0.0);
            rates.push((first, d));
        }
        let (first, d) = rates[0];
        let held = if from_rest { normal.hold(first, &d[..=degree], HELD) } else { 0.0 };
        normal.factor().map_err(|i| FitError::Undetermined { time: knots.greville()[i] })?;
        Ok(Self { knots, positions, rates, of_rates, held, normal })
    }
    fn degree(&self) -> usize {
        self.knots.degree()
    }
    /// Control points of all joints without kinks, joints x functions.
    pub(super) fn smooth(&self, s: &JointSamples<'_>) -> DMatrix<f64> {
        let n = s.dof;
        let mut rhs = DMatrix::zeros(n, self.knots.count());
        let mut add = |(first, row): &Row, weight: f64, read: &[f64]| {
            for (a, x) in row.iter().enumerate().take(self.knots.degree() + 1) {
                (0..n).for_each(|j| rhs[(j, first + a)] += weight * x * read[j]);
            }
        };
        for (i, row) in self.positions.iter().enumerate() {
            add(row, 1.0, &s.q[i * n..(i + 1) * n]);
            if let Some(qd) = s.qd {
                add(&self.rates[i], self.of_rates, &qd[i * n..(i + 1) * n]);
            }
        }
        self.normal.solve(&mut rhs);
        rhs
    }
    /// Variance of the rate at the first sample for white noise of unit deviation in position (1/s^2).
    pub(super) fn start_rate_variance(&self) -> f64 {
        let (first, rate) = self.rates[0];
        let mut of_rate = DMatrix::zeros(1, self.knots.count());
        (0..=self.degree()).for_each(|a| of_rate[(0, first + a)] = rate[a]);
        self.normal.solve(&mut of_rate);
        (0..=self.degree()).map(|a| rate[a] * of_rate[(0, first + a)]).sum()
    }
    /// Samples at which a column may be other than zero.
    pub(super) fn covered(times: &[f64], column: &Column) -> Range<usize> {
        let (from, to) = column.support();
        times.partition_point(|t| *t < from)..times.partition_point(|t| *t <= to)
    }
    /// A column at the samples that it covers.
    pub(super) fn values(&self, times: &[f64], column: &Column) -> (Range<usize>, Vec<f64>) {
        let range = Self::covered(times, column);
        let value = |i: usize| {
            let (first, row) = &self.positions[i];
            column.at(times[i], 0, (*first, &row[..=self.degree()]), 0.0)
        };
        (range.clone(), range.map(value).collect())
    }
    /// Sum of the squares of a column, by its values, as far as the spline does not take it up.
    pub(super) fn squares_left(&self, range: &Range<usize>, values: &[f64]) -> f64 {
        let mut products = DMatrix::zeros(1, self.knots.count());
        for (i, x) in range.clone().zip(values) {
            let (first, row) = &self.positions[i];
            (0..=self.degree()).for_each(|a| products[(0, first + a)] += row[a] * x);
        }
        let mut taken = products.clone();
        self.normal.solve(&mut taken);
        values.iter().map(|x| x * x).sum::<f64>() - products.dot(&taken)
    }
    /// Positions of joint `j` less those of a spline with these control points, and kinks.
    pub(super) fn residuals(
        &self,
        s: &JointSamples<'_>,
        j: usize,
        control: &DVector<f64>,
        kinks: impl Iterator<Item = (f64, (Range<usize>, Vec<f64>))>,
    ) -> Vec<f64> {
        let of_spline = |(first, row): &Row| (0..=self.degree()).map(|a| row[a] * control[first + a]).sum::<f64>();
        let read = s.q.iter().skip(j).step_by(s.dof);
        let mut r: Vec<f64> = read.zip(&self.positions).map(|(q, row)| q - of_spline(row)).collect();
        for (size, (range, values)) in kinks {
            r[range].iter_mut().zip(&values).for_each(|(r, x)| *r -= size * x);
        }
        r
    }
    /// Joint `j` with these kinks of its own, whose control points without them are `smooth`: the equations of the kinks are those of the
    /// columns less what the spline takes up of them.
    ///
    /// # Errors
    /// [`FitError::Undetermined`] at a kink that the samples do not tell from the others.
    pub(super) fn bend(
        &self,
        s: &JointSamples<'_>,
        j: usize,
        kinks: &[Kink],
        smooth: &DVector<f64>,
    ) -> Result<Bent, FitError> {
        let (n, degree, count) = (s.dof, self.degree(), kinks.len());
        let columns: Vec<Column> = kinks.iter().map(|&k| Column::new(&self.knots, k)).collect();
        let mut of_spline = DMatrix::zeros(count, self.knots.count());
        let mut squares = DMatrix::zeros(count, count);
        let mut read = DVector::zeros(count);
        let mut add = |derivative: usize, row: &Row, weight: f64, (t, y): (f64, f64), active: &[usize]| {
            let (first, row) = (row.0, &row.1[..=degree]);
            let x: Vec<f64> = active.iter().map(|&a| columns[a].at(t, derivative, (first, row), 0.0)).collect();
            for (&a, x_a) in active.iter().zip(&x) {
                let x_a = weight * x_a;
                read[a] += x_a * y;
                row.iter().enumerate().for_each(|(k, b)| of_spline[(a, first + k)] += x_a * b);
                active.iter().zip(&x).for_each(|(&b, x_b)| squares[(a, b)] += x_a * x_b);
            }
        };
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| columns[a].support().0.total_cmp(&columns[b].support().0));
        let (mut next, mut active) = (0, Vec::new());
        for (i, &t) in s.times.iter().enumerate() {
            active.retain(|&a: &usize| columns[a].support().1 >= t);
            while next < count && columns[order[next]].support().0 <= t {
                active.push(order[next]);
                next += 1;
            }
            if active.is_empty() {
                continue;
            }
            add(0, &self.positions[i], 1.0, (t, s.q[i * n + j]), &active);
            if let Some(qd) = s.qd {
                add(1, &self.rates[i], self.of_rates, (t, qd[i * n + j]), &active);
            }
            if i == 0 && self.held > 0.0 {
                add(1, &self.rates[0], self.held, (t, 0.0), &active);
            }
        }
        let mut taken = of_spline.clone();
        self.normal.solve(&mut taken);
        let unseen = |a: usize| FitError::Undetermined { time: kinks[a].time };
        let left = squares - &of_spline * taken.transpose();
        let weakest = (0..count).min_by(|&a, &b| left[(a, a)].total_cmp(&left[(b, b)])).unwrap_or(0);
        let factor = left.cholesky().ok_or_else(|| unseen(weakest))?;
        let sizes = factor.solve(&(read - &of_spline * smooth));
        let variances = factor.inverse().diagonal();
        if let Some(a) = (0..count).find(|&a| !(sizes[a].is_finite() && variances[a] > 0.0)) {
            return Err(unseen(a));
        }
        let control = smooth - taken.tr_mul(&sizes);
        Ok(Bent { columns, sizes, variances, control })
    }
}
