//! Quantities over time: constant, in pulses, or sampled.

use super::InputError;

/// One pulse of a [`Signal`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse<const N: usize> {
    /// Begin (s).
    pub start_s: f64,
    /// End (s).
    pub end_s: f64,
    /// Value in between.
    pub value: [f64; N],
}

/// `N` quantities as functions of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal<const N: usize>(Shape<N>);

#[derive(Clone, Debug, PartialEq)]
enum Shape<const N: usize> {
    Constant([f64; N]),
    Pulses(Vec<Pulse<N>>),
    Sampled { times: Vec<f64>, values: Vec<[f64; N]> },
}

impl<const N: usize> Signal<N> {
    /// The same at all times.
    ///
    /// # Errors
    /// [`InputError`] for a number that is not finite.
    pub fn constant(value: [f64; N]) -> Result<Self, InputError> {
        value.iter().try_for_each(|x| InputError::finite("a constant value", *x, ""))?;
        Ok(Self(Shape::Constant(value)))
    }
    /// A constant during each pulse, `start <= t < end`, zero otherwise; pulses that overlap add up.
    ///
    /// # Errors
    /// [`InputError`] without pulses, for a number that is not finite, and for a pulse that ends before it begins.
    pub fn pulses(pulses: Vec<Pulse<N>>) -> Result<Self, InputError> {
        if pulses.is_empty() {
            return Err(InputError::Empty("pulse"));
        }
        for p in &pulses {
            InputError::finite("start of a pulse", p.start_s, "s")?;
            InputError::finite("end of a pulse", p.end_s, "s")?;
            p.value.iter().try_for_each(|x| InputError::finite("the value of a pulse", *x, ""))?;
            InputError::positive("the length of a pulse", p.end_s - p.start_s, "s")?;
        }
        Ok(Self(Shape::Pulses(pulses)))
    }
    /// Linear between samples at ascending times (s), zero before the first and after the last.
    ///
    /// # Errors
    /// [`InputError`] for fewer than two samples, lists of different lengths, numbers that are not finite and times that do
    /// not ascend.
    pub fn sampled(times: Vec<f64>, values: Vec<[f64; N]>) -> Result<Self, InputError> {
        if times.len() != values.len() {
            return Err(InputError::Length { times: times.len(), values: values.len() });
        }
        if times.len() < 2 {
            return Err(InputError::Empty("interval between two samples"));
        }
        times.iter().try_for_each(|t| InputError::finite("a sample time", *t, "s"))?;
        values.iter().flatten().try_for_each(|x| InputError::finite("a sample", *x, ""))?;
        times.windows(2).try_for_each(|w| InputError::positive("the time between two samples", w[1] - w[0], "s"))?;
        Ok(Self(Shape::Sampled { times, values }))
    }
    /// Values at time `t` (s). Does not allocate.
    pub fn at(&self, t: f64) -> [f64; N] {
        match &self.0 {
            Shape::Constant(value) => *value,
            Shape::Pulses(pulses) => {
                let mut sum = [0.0; N];
                for p in pulses.iter().filter(|p| p.start_s <= t && t < p.end_s) {
                    sum.iter_mut().zip(&p.value).for_each(|(s, x)| *s += x);
                }
                sum
            }
            Shape::Sampled { times, values } => {
                let after = times.partition_point(|x| *x <= t);
                if after == 0 || (after == times.len() && t > times[after - 1]) {
                    return [0.0; N];
                }
                let k = after.min(times.len() - 1);
                let s = (t - times[k - 1]) / (times[k] - times[k - 1]);
                std::array::from_fn(|i| values[k - 1][i] + s * (values[k][i] - values[k - 1][i]))
            }
        }
    }
    /// Times (s) at which the values or their rates jump. Allocates.
    pub fn breaks(&self) -> Vec<f64> {
        match &self.0 {
            Shape::Constant(_) => Vec::new(),
            Shape::Pulses(pulses) => pulses.iter().flat_map(|p| [p.start_s, p.end_s]).collect(),
            Shape::Sampled { times, .. } => times.clone(),
        }
    }
    /// The least of all values ever taken, zero outside pulses and samples aside.
    pub(crate) fn least(&self) -> f64 {
        let least = |v: &[f64; N]| v.iter().copied().fold(f64::INFINITY, f64::min);
        match &self.0 {
            Shape::Constant(v) => least(v),
            Shape::Pulses(p) => p.iter().map(|p| least(&p.value)).fold(f64::INFINITY, f64::min),
            Shape::Sampled { values, .. } => values.iter().map(least).fold(f64::INFINITY, f64::min),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_declared_on_either_side_of_every_break() {
        let p = |start_s, end_s, value| Pulse { start_s, end_s, value: [value] };
        let s = Signal::pulses(vec![p(0.3, 1.1, 2.5), p(0.9, 1.7, -0.4)]).unwrap();
        for (t, want) in [(0.29, 0.0), (0.3, 2.5), (0.9, 2.1), (1.1, -0.4), (1.7, 0.0)] {
            assert!((s.at(t)[0] - want).abs() < 1e-15, "{t}");
        }
        assert_eq!(s.breaks(), [0.3, 1.1, 0.9, 1.7]);
        let s = Signal::sampled(vec![0.2, 0.7, 1.9], vec![[1.0, -2.0], [3.0, 0.5], [-1.0, 0.7]]).unwrap();
        assert_eq!(s.at(0.1), [0.0; 2]);
        assert_eq!((s.at(0.2), s.at(1.9)), ([1.0, -2.0], [-1.0, 0.7]));
        let mid = s.at(1.0);
        assert!((mid[0] - 2.0).abs() < 1e-14 && (mid[1] - 0.55).abs() < 1e-14, "{mid:?}");
        assert_eq!(s.at(2.0), [0.0; 2]);
        assert_eq!(Signal::constant([0.7]).unwrap().at(-5.0), [0.7]);
    }

    #[test]
    fn signals_that_make_no_sense_are_refused() {
        let pulse = |start_s, end_s, value| Signal::pulses(vec![Pulse { start_s, end_s, value: [value] }]).unwrap_err();
        assert_eq!(
            pulse(1.0, 0.5, 2.0).to_string(),
            "the length of a pulse is -0.5 s, but must be positive and finite"
        );
        assert!(matches!(pulse(1.0, f64::NAN, 2.0), InputError::Value { what: "end of a pulse", .. }));
        assert!(matches!(pulse(1.0, 2.0, f64::INFINITY), InputError::Value { .. }));
        assert_eq!(Signal::<1>::pulses(vec![]).unwrap_err(), InputError::Empty("pulse"));
        assert!(matches!(
            Signal::sampled(vec![0.0, 1.0], vec![[1.0]]),
            Err(InputError::Length { times: 2, values: 1 })
        ));
        assert!(matches!(Signal::sampled(vec![0.0, 0.0], vec![[1.0]; 2]), Err(InputError::Value { .. })));
        assert!(Signal::constant([f64::NAN]).is_err());
    }
}
