//! The last predictions of a record: a fit asks for one and the same several times, to compare places, to begin and to go on from them.

/// Places that are remembered: where a fit is, and where it may go.
const PLACES: usize = 2;

/// Residuals at the last places.
#[derive(Debug, Default)]
pub(crate) struct Remembered {
    places: Vec<Place>,
}

#[derive(Debug, Default)]
struct Place {
    full: Vec<f64>,
    extra: Vec<f64>,
    residuals: Vec<f64>,
}

impl Remembered {
    /// Fills `r` with those at this place, and says whether they are known. Does not allocate.
    pub(crate) fn fill(&self, full: &[f64], extra: &[f64], r: &mut [f64]) -> bool {
        let known = self.places.iter().find(|p| p.full == full && p.extra == extra);
        known.is_some_and(|p| {
            r.copy_from_slice(&p.residuals);
            true
        })
    }
    /// Keeps those at this place in the memory of the oldest, which is forgotten.
    pub(crate) fn keep(&mut self, full: &[f64], extra: &[f64], r: &[f64]) {
        if self.places.len() < PLACES {
            self.places.push(Place::default());
        }
        self.places.rotate_right(1);
        let place = &mut self.places[0];
        for (kept, new) in [(&mut place.full, full), (&mut place.extra, extra), (&mut place.residuals, r)] {
            kept.clear();
            kept.extend_from_slice(new);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_two_places_are_known() {
        let mut m = Remembered::default();
        let mut r = [0.0; 2];
        assert!(!m.fill(&[1.5], &[0.2], &mut r));
        m.keep(&[1.5], &[0.2], &[3.0, -4.0]);
        m.keep(&[1.7], &[0.2], &[5.0, 6.0]);
        assert!(m.fill(&[1.5], &[0.2], &mut r) && r == [3.0, -4.0]);
        assert!(!m.fill(&[1.5], &[0.3], &mut r) && !m.fill(&[1.6], &[0.2], &mut r));
        m.keep(&[1.9], &[], &[7.0, 8.0]);
        assert!(!m.fill(&[1.5], &[0.2], &mut r) && m.fill(&[1.7], &[0.2], &mut r) && r == [5.0, 6.0]);
    }
}
