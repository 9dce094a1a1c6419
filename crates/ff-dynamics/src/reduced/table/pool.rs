//! Memory of tables that have served.

/// Vectors to be filled anew. Tables of a record that is gone through span by span are large and alike: asking the system for their
/// memory each time took a fifth of a fit.
#[derive(Debug, Default)]
pub(crate) struct Pool(Vec<Vec<f64>>);

impl Pool {
    /// `n` zeros.
    pub(crate) fn zeros(&mut self, n: usize) -> Vec<f64> {
        let mut v = self.0.pop().unwrap_or_default();
        v.clear();
        v.resize(n, 0.0);
        v
    }
    /// Gives vectors back, to be taken in this order.
    pub(crate) fn put(&mut self, all: impl DoubleEndedIterator<Item = Vec<f64>>) {
        self.0.extend(all.rev());
    }
}
