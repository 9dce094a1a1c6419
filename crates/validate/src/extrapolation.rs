//! A high-order integrator of its own, so that a law can be judged without the error of the project's integrator.
//!
//! Gragg-Bulirsch-Stoer: modified midpoint with 2, 4, .. 12 steps, extrapolated in the square of the step to order 12,
//! with step control (E. Hairer, S. Norsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., II.9).
//! At a tolerance of 1e-13 what is left is rounding.

/// Steps of the modified midpoint rule, per column of the extrapolation table.
const STEPS: [usize; 6] = [2, 4, 6, 8, 10, 12];
const COLUMNS: usize = STEPS.len();

/// Why an integration stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Stopped<E> {
    /// The right-hand side failed.
    #[error("at t = {t} s: {source}")]
    Failed {
        /// Time at the start of the step (s).
        t: f64,
        /// Why.
        source: E,
    },
    /// The step became too small for the tolerance, or the state is not finite.
    #[error("at t = {t} s: the step would have to be below {step} s")]
    TooSmall {
        /// Time (s).
        t: f64,
        /// Last step tried (s).
        step: f64,
    },
}

/// Integrator with its buffers.
#[derive(Clone, Debug)]
pub struct Extrapolation {
    tolerance: f64,
    table: [Vec<f64>; COLUMNS],
    slope: [Vec<f64>; 2],
    old: Vec<f64>,
}

impl Extrapolation {
    /// For `n` equations; a step is accepted when its estimated error, relative to the greater of each component and
    /// 0.1, is below `tolerance`. Allocates.
    pub fn new(n: usize, tolerance: f64) -> Self {
        let z = vec![0.0; n];
        Self { tolerance, table: std::array::from_fn(|_| z.clone()), slope: [z.clone(), z.clone()], old: z }
    }

    /// Takes one accepted step of at most `step` from `t`, in place of `z`; returns the step taken and the one to try
    /// next. `rhs(t, z, dz)` writes the derivative. Does not allocate.
    ///
    /// # Errors
    /// [`Stopped`]; `z` is then unchanged.
    pub fn step<E>(
        &mut self,
        t: f64,
        mut step: f64,
        z: &mut [f64],
        mut rhs: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(f64, f64), Stopped<E>> {
        let fail = |source| Stopped::Failed { t, source };
        rhs(t, z, &mut self.slope[0]).map_err(fail)?;
        // Below the resolution of `t` a step leads nowhere.
        while t + step > t {
            for j in 0..COLUMNS {
                self.midpoint(j, t, step, z, &mut rhs).map_err(fail)?;
                self.extrapolate(j);
            }
            // After `extrapolate` entry 0 is T(K, K) and entry 1 is T(K, K-1).
            let error = (0..z.len()).fold(0.0_f64, |e, i| {
                let [best, less] = [self.table[0][i], self.table[1][i]];
                let x = (best - less).abs() / best.abs().max(0.1);
                if x.is_finite() { e.max(x) } else { f64::INFINITY }
            });
            let order = 2.0 * COLUMNS as f64 - 1.0;
            let factor = 0.9 * (self.tolerance / error.max(1e-30)).powf(1.0 / order);
            if error <= self.tolerance {
                z.copy_from_slice(&self.table[0]);
                return Ok((step, step * factor.clamp(0.3, 2.0)));
            }
            step *= factor.clamp(0.1, 0.8);
        }
        Err(Stopped::TooSmall { t, step })
    }

    /// Modified midpoint rule with `STEPS[j]` steps over `step`, into entry `j` of the table.
    fn midpoint<E>(
        &mut self,
        j: usize,
        t: f64,
        step: f64,
        z: &[f64],
        rhs: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let n = STEPS[j];
        let h = step / n as f64;
        let [first, slope] = &mut self.slope;
        let now = &mut self.table[j];
        self.old.copy_from_slice(z);
        for i in 0..z.len() {
            now[i] = z[i] + h * first[i];
        }
        for m in 1..n {
            rhs(t + m as f64 * h, now, slope)?;
            for i in 0..z.len() {
                let next = self.old[i] + 2.0 * h * slope[i];
                self.old[i] = now[i];
                now[i] = next;
            }
        }
        Ok(())
    }

    /// Aitken-Neville in `h^2` after entry `j` was computed: entry `j - k` becomes `T(j, k)`.
    fn extrapolate(&mut self, j: usize) {
        for k in (0..j).rev() {
            let ratio = (STEPS[j] as f64 / STEPS[k] as f64).powi(2) - 1.0;
            let (low, high) = self.table.split_at_mut(k + 1);
            for (less, best) in low[k].iter_mut().zip(&high[0]) {
                *less = best + (best - *less) / ratio;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    type Never = std::convert::Infallible;

    /// The pendulum's energy is conserved, and its motion from 1 rad has the period 4 K(sin 1/2) (elliptic integral).
    #[test]
    fn a_pendulum_keeps_its_energy_and_period() {
        let rhs = |_: f64, z: &[f64], d: &mut [f64]| -> Result<(), Never> {
            (d[0], d[1]) = (z[1], -z[0].sin());
            Ok(())
        };
        // Arithmetic-geometric mean: K(k) = pi / (2 agm(1, sqrt(1 - k^2))).
        let (mut a, mut b) = (1.0_f64, 0.5_f64.cos());
        for _ in 0..8 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        let period = 2.0 * std::f64::consts::PI / a;
        let mut z = vec![1.0, 0.0];
        let (mut t, mut h) = (0.0_f64, 0.1_f64);
        let mut e = Extrapolation::new(2, 1e-13);
        let mut steps = 0;
        while t < 10.0 * period {
            let (done, next) = e.step(t, h.min(10.0 * period - t), &mut z, rhs).unwrap();
            t += done;
            h = next;
            steps += 1;
        }
        let energy = 0.5 * z[1] * z[1] - z[0].cos();
        println!("{steps} steps, z = {z:?}, energy error {:e}", energy + 1.0_f64.cos());
        assert_within!((energy + 1.0_f64.cos()).abs(), 1e-13);
        assert!((z[0] - 1.0).abs() < 1e-12 && z[1].abs() < 1e-11, "{z:?}");
        assert!((40..300).contains(&steps), "{steps} steps");
    }

    #[test]
    fn it_stops_with_an_error_where_the_equations_end() {
        let rhs = |t: f64, _: &[f64], d: &mut [f64]| -> Result<(), Never> {
            d[0] = if t < 0.7 { 0.3 } else { f64::NAN };
            Ok(())
        };
        let mut z = vec![1.0];
        let mut e = Extrapolation::new(1, 1e-13);
        let (mut t, mut h) = (0.0_f64, 0.1_f64);
        let stopped = loop {
            match e.step(t, h, &mut z, rhs) {
                Ok((done, next)) => (t, h) = (t + done, next),
                Err(e) => break e,
            }
        };
        assert!(matches!(stopped, Stopped::TooSmall { .. }), "{stopped}");
        assert!((t - 0.7).abs() < 1e-9 && (z[0] - 1.21).abs() < 1e-9, "{t} {z:?}");
        let failing = |_: f64, _: &[f64], _: &mut [f64]| Err("no");
        assert!(matches!(e.step(0.1, 0.2, &mut z, failing), Err(Stopped::Failed { t, source: "no" }) if t == 0.1));
    }
}
