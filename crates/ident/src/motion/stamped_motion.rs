//! Joint motion through positions, rates and accelerations at sample times of their own.
//!
//! Between two samples the polynomial of degree five that takes their six end values, as in
//! [`ff_dynamics::motion::HermiteTable`], for intervals of any length. Its error is at most
//! `h^6 max|q^(6)| / 46080` in position, `h` the interval (Hermite interpolation with three conditions at each end).

use ff_dynamics::motion::JointMotion;
use nalgebra::DMatrix;

/// The motion.
#[derive(Clone, Debug)]
pub(crate) struct StampedHermite {
    dof: usize,
    times: Vec<f64>,
    /// Per sample `[q n | qd n | qdd n]`.
    data: Vec<f64>,
}

impl StampedHermite {
    /// Through rows of `q`, `qd`, `qdd` (samples x joints) at ascending `times`, the first at 0: what a record guarantees. Allocates.
    pub(crate) fn new(times: &[f64], q: &DMatrix<f64>, qd: &DMatrix<f64>, qdd: &DMatrix<f64>) -> Self {
        let of = |i: usize| [q, qd, qdd].into_iter().flat_map(move |m| m.row(i).iter().copied().collect::<Vec<f64>>());
        Self { dof: q.ncols(), times: times.to_vec(), data: (0..times.len()).flat_map(of).collect() }
    }
}

impl JointMotion for StampedHermite {
    fn dof(&self) -> usize {
        self.dof
    }
    fn duration(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let (n, end) = (self.dof, self.duration());
        // The last interval serves its end, too.
        let k = self.times.partition_point(|x| *x <= t).clamp(1, (self.times.len() - 1).max(1)) - 1;
        let a = &self.data[3 * n * k..3 * n * (k + 1)];
        let Some(b) = self.data.get(3 * n * (k + 1)..3 * n * (k + 2)) else {
            q[..n].copy_from_slice(&a[..n]);
            qd[..n].fill(0.0);
            qdd[..n].fill(0.0);
            return;
        };
        let h = self.times[k + 1] - self.times[k];
        let s = (t.clamp(0.0, end) - self.times[k]) / h;
        for i in 0..n {
            let (c0, c1, c2) = (a[i], h * a[n + i], 0.5 * h * h * a[2 * n + i]);
            let d = b[i] - c0 - c1 - c2;
            let e = h * b[n + i] - c1 - 2.0 * c2;
            let f = h * h * b[2 * n + i] - 2.0 * c2;
            let (c3, c4, c5) = (10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f);
            q[i] = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))));
            qd[i] = (c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h;
            qdd[i] = (2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h);
        }
        // As every motion: held before its beginning and after its end.
        if t < -1e-9 * h || t > end + 1e-9 * h {
            qd[..n].fill(0.0);
            qdd[..n].fill(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_dynamics::motion::HermiteTable;

    fn rows(times: &[f64]) -> [DMatrix<f64>; 3] {
        let of = |d: i32| {
            DMatrix::from_fn(times.len(), 2, |i, j| {
                let w = 1.3 + 0.4 * j as f64;
                let phase = w * times[i] + 0.3 + f64::from(d) * core::f64::consts::FRAC_PI_2;
                w.powi(d) * phase.sin()
            })
        };
        [of(0), of(1), of(2)]
    }

    #[test]
    fn even_times_give_the_table_and_uneven_ones_the_same_motion() {
        let even: Vec<f64> = (0..41).map(|i| 0.05 * i as f64).collect();
        let uneven: Vec<f64> =
            (0..41).filter(|i| i % 7 != 3).map(|i| 0.05 * (i as f64 + 0.3 * (1.7 * i as f64).sin())).collect();
        let flat = |m: &DMatrix<f64>| m.transpose().as_slice().to_vec();
        let [q, qd, qdd] = rows(&even);
        let table = HermiteTable::new(2, 0.05, &flat(&q), &flat(&qd), &flat(&qdd)).unwrap();
        let same = StampedHermite::new(&even, &q, &qd, &qdd);
        let [q, qd, qdd] = rows(&uneven);
        let own = StampedHermite::new(&uneven, &q, &qd, &qdd);
        for k in 0..190 {
            let t = 0.0101 * k as f64;
            let at = |m: &dyn JointMotion| {
                let (mut q, mut qd, mut qdd) = ([0.0; 2], [0.0; 2], [0.0; 2]);
                m.eval(t, &mut q, &mut qd, &mut qdd);
                [q, qd, qdd]
            };
            let (a, b, c) = (at(&table), at(&same), at(&own));
            for d in 0..3 {
                for j in 0..2 {
                    assert!((a[d][j] - b[d][j]).abs() < 1e-9, "{t} {d}");
                    // Intervals up to 0.13 s: h^6 w^6 / 46080 in position, two powers of h less in acceleration.
                    assert!((a[d][j] - c[d][j]).abs() < [1e-8, 1e-6, 1e-4][d], "{t} {d}: {:e}", a[d][j] - c[d][j]);
                }
            }
        }
        let mut still = [1.0; 2];
        own.eval(-0.1, &mut [0.0; 2], &mut still, &mut [0.0; 2]);
        assert_eq!(still, [0.0; 2]);
        assert_eq!(own.duration(), *uneven.last().unwrap());
    }
}
