//! The last predictions of a record: a fit asks for one and the same several times, to compare places, to begin and to go on from them.

use ff_dynamics::reduced::Stages;

/// Places that are remembered: where a fit is, and where it may go.
const PLACES: usize = 2;

/// Residuals at the last places, and the stages of what they were predicted by.
#[derive(Debug, Default)]
pub(crate) struct Remembered {
    places: Vec<Place>,
    /// Memory for those of the next place.
    pub(crate) spare: Stages,
}

#[derive(Debug, Default)]
struct Place {
    full: Vec<f64>,
    extra: Vec<f64>,
    residuals: Vec<f64>,
    stages: Stages,
    /// Whether these are of this place.
    integrated: bool,
}

impl Remembered {
    /// The stages at this place, if they are known.
    pub(crate) fn stages(&self, full: &[f64], extra: &[f64]) -> Option<&Stages> {
        let known = self.places.iter().find(|p| p.full == full && p.extra == extra)?;
        known.integrated.then_some(&known.stages)
    }
    /// Fills `r` with those at this place, and says whether they are known. Does not allocate.
    pub(crate) fn fill(&self, full: &[f64], extra: &[f64], r: &mut [f64]) -> bool {
        let known = self.places.iter().find(|p| p.full == full && p.extra == extra);
        known.is_some_and(|p| {
            r.copy_from_slice(&p.residuals);
            true
        })
    }
    /// Keeps those at this place, with the stages that are in [`Remembered::spare`] where they are `integrated`, in the memory of the oldest, which
    /// is forgotten.
    pub(crate) fn keep(&mut self, full: &[f64], extra: &[f64], r: &[f64], integrated: bool) {
        if self.places.len() < PLACES {
            self.places.push(Place::default());
        }
        self.places.rotate_right(1);
        let place = &mut self.places[0];
        for (kept, new) in [(&mut place.full, full), (&mut place.extra, extra), (&mut place.residuals, r)] {
            kept.clear();
            kept.extend_from_slice(new);
        }
        place.integrated = integrated;
        if integrated {
            core::mem::swap(&mut place.stages, &mut self.spare);
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
        m.keep(&[1.5], &[0.2], &[3.0, -4.0], true);
        m.keep(&[1.7], &[0.2], &[5.0, 6.0], false);
        assert!(m.fill(&[1.5], &[0.2], &mut r) && r == [3.0, -4.0]);
        assert!(m.stages(&[1.5], &[0.2]).is_some() && m.stages(&[1.7], &[0.2]).is_none());
        assert!(!m.fill(&[1.5], &[0.3], &mut r) && !m.fill(&[1.6], &[0.2], &mut r));
        m.keep(&[1.9], &[], &[7.0, 8.0], true);
        assert!(!m.fill(&[1.5], &[0.2], &mut r) && m.fill(&[1.7], &[0.2], &mut r) && r == [5.0, 6.0]);
    }
}
