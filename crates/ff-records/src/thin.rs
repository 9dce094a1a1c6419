//! A record with every k-th sample, for a first pass over it.
//!
//! Far from the answer, thousands of samples per period say no more than ten do. A fit started on a thinned record
//! and finished on the whole one costs a k-th per step until it is close.

use crate::record::Record;
use crate::time_base::ChannelGroup;
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;

impl Record {
    /// Every `every`-th sample, from the first. No filter: frequencies above half the new rate fold back, so thin no further
    /// than ten samples per period of the fastest mode of interest. Of channels with sample times of their own, every `every`-th,
    /// too, and the last of the joint motion; the last of their readings may lie less than an interval behind the last instant of the grid.
    /// Allocates.
    ///
    /// # Errors
    /// `Data::Window` when fewer than two samples would be left, or `every` is 0.
    pub fn thinned(&self, every: usize) -> Result<Self, Problems> {
        let left = if every == 0 { 0 } else { self.samples().div_ceil(every) };
        if left < 2 {
            let m = format!("every {every}th of {} samples leaves {left}, at least 2 are needed", self.samples());
            return Err(Problems(vec![Problem::error(Area::Data, "Data::Window", m).hint("thin less")]));
        }
        let rows = |n: usize| (0..n).step_by(every).collect::<Vec<_>>();
        let mut out =
            Self { dt: self.dt * every as f64, ..self.mapped(|m: &DMatrix<f64>| m.select_rows(&rows(m.nrows()))) };
        for group in ChannelGroup::ALL {
            if let Some(times) = self.times(group) {
                out.bases.set(group, times.iter().copied().step_by(every).collect());
            }
        }
        if let Some(times) = self.times(ChannelGroup::Motion) {
            // The motion reaches to the end of the grid: its last sample stays.
            let mut kept = rows(times.len());
            if kept.last() != Some(&(times.len() - 1)) {
                kept.push(times.len() - 1);
            }
            let of = |m: &DMatrix<f64>| m.select_rows(&kept);
            (out.q, out.qd, out.qdd) = (of(&self.q), self.qd.as_ref().map(of), self.qdd.as_ref().map(of));
            out.bases.set(ChannelGroup::Motion, kept.iter().map(|&i| times[i]).collect());
            out.grid = Some(left);
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use crate::builder::RecordBuilder;
    use nalgebra::DMatrix;

    #[test]
    fn every_third_sample_keeps_its_time_and_values() {
        let f = |k: f64| move |i: usize, j: usize| (0.2 * i as f64 + k * (j + 1) as f64).sin();
        let b = RecordBuilder::new(["a", "b"]).uniform(4.0, 50.0).q(DMatrix::from_fn(31, 2, f(0.3)));
        let r = b.tau(DMatrix::from_fn(31, 2, f(0.7))).gyro(DMatrix::from_fn(31, 3, f(1.1))).build().unwrap().0;
        let t = r.thinned(3).unwrap();
        assert_eq!((t.samples(), t.t0()), (11, 4.0));
        assert!((t.dt() - 0.06).abs() < 1e-15);
        assert_eq!((t.tau()[(7, 1)], t.gyro()[(10, 2)]), (r.tau()[(21, 1)], r.gyro()[(30, 2)]));
        assert!(r.thinned(31).is_err() && r.thinned(0).is_err() && r.thinned(1).unwrap() == r);
    }
}
