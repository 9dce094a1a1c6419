//! A robot that may not have been at rest when a record began, as what keeps a fit from any answer.

use super::assembly::Setup;
use super::ends::WIDE;
use super::error::IdentifyError;
use super::evidence::NamedError;
use super::explain::{Tests, in_words};
use super::refit::{moved, sizes};
use super::result::fit::Method;
use super::settings::{Settings, method};
use super::suspects::{EXPLAINS, Found, Suspects};
use ff_records::Record;
use ident::Request;
use ident::estimate::Estimate;
use ident::uncertain::hypotheses;

/// Name of the error ([`ident::uncertain::hypotheses`]).
pub(super) const IN_MOTION: &str = "start-in-motion";
/// Beginning of a record (s) and its fewest samples. A base that is at rest then, under joints that are, reads less than this part of what the gyro
/// ranges over, and what it reads changes by less than this part of what it changes by at most.
const BEGINNING: f64 = 0.1;
const FEWEST: usize = 12;
const AT_REST: (f64, f64) = (0.02, 0.1);

impl Suspects<'_> {
    /// The first fit from a start in motion, where a record may begin with one, if that leaves a part of what the fit from rest does.
    pub(super) fn in_motion(&self, stuck: &Estimate) -> Result<Option<Found>, IdentifyError> {
        let model = &self.opened.model;
        let from_rest = !self.settings.initial_state && method(model, self.settings.method) == Method::OutputError;
        if !from_rest || !self.records.iter().any(|t| !t.continues && may_turn(&t.record)) {
            return Ok(None);
        }
        let settings = Settings { initial_state: true, ..self.settings.clone() };
        let Ok(setup) = Setup::new(self.opened, self.records, &settings, self.options) else { return Ok(None) };
        let mut whole = setup.estimator(model, self.records)?;
        let request = Request { give_up: Some(WIDE), noise: self.noise, ..setup.request()? };
        let Some(e) = self.fit(&request, &mut *whole)? else { return Ok(None) };
        if self.above_noise(&e) > EXPLAINS * self.above_noise(stuck) {
            return Ok(None);
        }
        let unknowns = &setup.unknowns;
        let all = hypotheses(model, &unknowns.selected, &unknowns.expand(&e.values)?);
        let Some(h) = all.into_iter().find(|h| h.name == IN_MOTION) else { return Ok(None) };
        let Some(size) = sizes(&h, &e, &setup.labels) else { return Ok(None) };
        let before = (stuck, &self.setup.unknowns.selected[..]);
        let moves = moved(before, &self.setup.unknowns, &e, &|_| 0.0).unwrap_or_default();
        let line = NamedError::fitted(h.name, in_words(&h.words, &size), size, stuck.objective - e.objective, moves);
        let tests = Tests::default().explained_by(vec![line], self.explained(&e));
        Ok(Some(Found::with(stuck.clone(), tests)))
    }
}

/// Whether the base may turn, or be shaken, when a record begins ([`AT_REST`]); a gyro with a bias of that size reads the same.
pub(super) fn may_turn(record: &Record) -> bool {
    let gyro = record.gyro();
    let n = ((BEGINNING / record.dt()) as usize).max(FEWEST);
    if record.is_fixed_base() || gyro.nrows() < 2 * n {
        return false;
    }
    // Differences of sums over halves of a window: what changes in it, times a constant that is that of all windows.
    let half = n / 2;
    let sum = |c: &[f64]| c.iter().sum::<f64>();
    let change = |c: &[f64]| (sum(&c[n - half..n]) - sum(&c[..half])).abs();
    gyro.column_iter().any(|column| {
        let c: Vec<f64> = column.iter().copied().collect();
        let range = column.max() - column.min();
        let most = c.windows(n).step_by(half).map(change).fold(0.0, f64::max);
        sum(&c[..n]).abs() / n as f64 > AT_REST.0 * range || change(&c) > AT_REST.1 * most
    })
}
