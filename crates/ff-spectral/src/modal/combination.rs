//! Products of modes, which are no modes of their own.

use super::fit::{ModalFit, Mode};

/// Strength, relative to the modes it combines, up to which a tone can be their product.
const TONE: f64 = 0.05;
/// Greatest difference, relative, of decay rates that count as the same.
const SAME_DECAY: f64 = 0.1;

impl ModalFit {
    /// The louder modes whose sum, difference or double the mode `i` is, if any: panels and fuel are not linear, and
    /// torques have terms of second order in them.
    ///
    /// The product of two decays rings at the sum and at the difference of the frequencies at which they ring (not of their undamped ones),
    /// and decays at the sum of their rates: its poles are `p_a + p_b` and `p_a + conj(p_b)`. What is within [`ModalFit::df`] of such a
    /// frequency is no mode of its own if it is at most 5 % of both. A difference whose decay agrees to a tenth as well is none if it is
    /// weaker than both: a structure has no mode that slow and that damped by accident, and a channel that both modes hardly reach may
    /// show much of their product. A true mode at a double frequency does decay like the product, so that sums have no such rule.
    ///
    /// # Panics
    /// If there is no such mode.
    pub fn combination(&self, i: usize) -> Option<(usize, usize)> {
        let m: &Mode = &self.modes[i];
        let near = |f: f64| (f - m.damped_frequency()).abs() < self.df;
        let louder: Vec<usize> = (0..self.modes.len()).filter(|&k| m.snr < self.modes[k].snr).collect();
        for (n, &a) in louder.iter().enumerate() {
            for &b in &louder[n..] {
                let (one, other) = (&self.modes[a], &self.modes[b]);
                let (fa, fb) = (one.damped_frequency(), other.damped_frequency());
                let (sum, difference) = (near(fa + fb), near((fa - fb).abs()));
                let weak = m.snr < TONE * one.snr.min(other.snr);
                let rate = one.decay_rate() + other.decay_rate();
                let decays = (m.decay_rate() - rate).abs() < SAME_DECAY * rate;
                if weak && (sum || difference) || difference && decays {
                    return Some((a, b));
                }
            }
        }
        None
    }
}
