//! An appendage that the mission lacks as what keeps a fit from any answer: a tank, a panel, a boom.
//!
//! Springs and dampers of what the mission has take its place, until the fit leads nowhere. Where it is held to the shape of the signals and to
//! the mission ([`super::suspects`]) they cannot, and what is left over there rings as it does: a mode is searched for in that
//! ([`super::extra_mode`]), mounted on the base ([`super::mounted_mode`]), and fitted to the shape and then to the noise of the sensors. Fuel moves
//! in two directions, of which the larger one hides the other: what a fit with one mode leaves over is searched for the next ([`MODES`]).

use super::assembly::{Assembled, Assembly, Setup};
use super::error::IdentifyError;
use super::evidence::{EXTRA_MODE, NamedError};
use super::explain::Tests;
use super::extra_mode;
use super::fitted::{Ended, Fitted};
use super::mounted_mode::Mounted;
use super::record_estimator::Twin;
use super::refit::{MOST_ANEW, SETTLED, moved};
use super::settings::Settings;
use super::signals::Signals;
use super::suspects::{EXPLAINS, Found, Shape, Suspects, Until, least};
use crate::open::Opened;
use flex_panel::modal::Mode;
use ident::Request;
use ident::estimate::Estimate;
use std::collections::BTreeMap;

/// Modes that are mounted, at most.
const MODES: usize = 2;
/// Parts of a mode that are mounted in turn, until the base has room for what it is part of: to first order it may be several times too large.
const PARTS: [f64; 3] = [1.0, 0.3, 0.1];

/// The end of a fit over all data, to the shape of the signals or to the noise of the sensors, and what it was made of.
pub(super) struct Place<'a, 't> {
    pub(super) setup: &'a Setup,
    pub(super) opened: &'a Opened,
    pub(super) end: &'a Estimate,
    /// With its noise.
    pub(super) settings: &'a Settings,
    pub(super) twins: &'a [Twin<'t>],
    /// Standard deviation of every channel of a sample, and residuals of each record.
    pub(super) sigma: &'a [f64],
    pub(super) rows: &'a [usize],
}

/// Modes with which a fit follows the record.
pub(super) struct WithModes {
    line: NamedError,
    objective: f64,
    /// Whether nothing is left with them.
    explains: bool,
}

impl WithModes {
    /// As what kept this fit from an answer.
    pub(super) fn found(self, stuck: &Estimate) -> Found {
        let tests = Tests::default().explained_by(vec![self.line], self.explains);
        Found::with(stuck.clone(), tests)
    }
}

impl Suspects<'_> {
    /// Modes that the mission lacks beside those that are mounted already, if the record is followed with them, and better than by `to_beat`.
    pub(super) fn modes(
        &self,
        stuck: &Estimate,
        at: &Place<'_, '_>,
        mounted: Vec<Mode>,
        to_beat: f64,
    ) -> Result<Option<WithModes>, IdentifyError> {
        // Priors are about the base as it is.
        if self.setup.unknowns.has_priors() {
            return Ok(None);
        }
        let room = MODES - mounted.len().min(MODES);
        let next = if room > 0 { self.next_mode(at)?.unwrap_or_default() } else { Vec::new() };
        if next.is_empty() {
            return Ok(None);
        }
        for part in PARTS {
            let next = next.iter().take(room).map(|m| Mode { participation: m.participation * part, ..*m });
            let modes: Vec<Mode> = mounted.iter().cloned().chain(next).collect();
            let Some(with) = Mounted::with(self.opened, &modes) else { continue };
            let max_iterations = MOST_ANEW.min(self.settings.max_iterations);
            let settings = Settings { max_iterations, ..self.settings.clone() };
            let Ok(setup) = Setup::new(&with.opened, self.records, &settings, self.options) else { continue };
            if let Some(shape) = self.shape_of(at, &setup, &with)? {
                return self.followed_with(stuck, (&setup, &with), &shape, to_beat);
            }
        }
        Ok(None)
    }
    /// The fit with modes to the shape of the signals: from this place, or from the mission, since here the base may be at the edge of what can
    /// exist, with no room for what they are part of.
    fn shape_of(&self, at: &Place<'_, '_>, setup: &Setup, with: &Mounted) -> Result<Option<Estimate>, IdentifyError> {
        let loud = self.at_the_shape(&setup.settings);
        let assembly = Assembly { settings: &loud, ..setup.assembly(&with.opened.model, self.records) };
        let Ok(Assembled { mut whole, .. }) = assembly.assemble(&setup.uncertain) else { return Ok(None) };
        let mut all = Vec::new();
        for from in [at.setup.unknowns.by_name(&at.end.values), BTreeMap::new()] {
            all.extend(self.shape(setup, &mut *whole, &with.start(&from, &setup.unknowns), Until::Follows)?);
        }
        Ok(least(all))
    }
    /// The fit with modes to the noise of the sensors, from the end of that to the shape, and with another where something is left.
    fn followed_with(
        &self,
        stuck: &Estimate,
        (setup, with): (&Setup, &Mounted),
        shape: &Estimate,
        to_beat: f64,
    ) -> Result<Option<WithModes>, IdentifyError> {
        if !Shape::of(setup, shape).follows() {
            return Ok(None);
        }
        let made = setup.assembly(&with.opened.model, self.records).assemble(&setup.uncertain);
        let Ok(Assembled { mut whole, twins, sigma, rows }) = made else { return Ok(None) };
        let mut request = Request { start: &shape.values, noise: self.noise, ..setup.request()? };
        request.settings.gain_tolerance = request.settings.gain_tolerance.max(SETTLED);
        let Some(end) = self.fit(&request, &mut *whole)? else { return Ok(None) };
        drop(whole);
        let best = self.told(stuck, with, &end).filter(|w| w.objective < to_beat);
        if best.as_ref().is_some_and(|w| w.explains) {
            return Ok(best);
        }
        let Some(modes) = with.modes_at(&end) else { return Ok(best) };
        let (opened, settings) = (&with.opened, &setup.settings);
        let at = Place { setup, opened, end: &end, settings, twins: &twins, sigma: &sigma, rows: &rows };
        let to_beat = best.as_ref().map_or(to_beat, |w| w.objective);
        Ok(self.modes(stuck, &at, modes, to_beat)?.or(best))
    }
    /// The mode that accounts for most of what is left there.
    fn next_mode(&self, at: &Place<'_, '_>) -> Result<Option<Vec<Mode>>, IdentifyError> {
        let Setup { unknowns, shared, labels, .. } = at.setup;
        let (model, records) = (&at.opened.model, self.records);
        let signals = Signals::of_each(model, records, at.rows, &at.end.residuals, at.sigma);
        let (fitted, values) = (Fitted::of(at.end.clone(), &unknowns.selected), unknowns.expand(&at.end.values)?);
        let end = Ended {
            model,
            shared,
            labels,
            unknowns,
            fitted: &fitted,
            values: &values,
            records,
            signals: &signals,
            loud: false,
        };
        let found = extra_mode::search(&end, at.twins, at.settings)?;
        Ok(found.and_then(|mode| mode.modes(&end)))
    }
    /// The modes of such a fit; `None` where it does not follow the record, or cannot tell them.
    fn told(&self, stuck: &Estimate, with: &Mounted, e: &Estimate) -> Option<WithModes> {
        if !e.is_solution() || self.above_noise(e) > EXPLAINS * self.above_noise(stuck) {
            return None;
        }
        let unknowns = &self.setup.unknowns;
        let moves = moved((stuck, &unknowns.selected), unknowns, e, &|name| with.takes(name)).unwrap_or_default();
        let drop = stuck.objective - e.objective;
        let line = NamedError::fitted(EXTRA_MODE.to_owned(), String::new(), Vec::new(), drop, moves);
        let mut line = NamedError { freedom: with.freedom(), ..line };
        let (objective, explains) = (e.objective, self.explained(e));
        with.describe(e, &mut line).then_some(WithModes { line, objective, explains })
    }
}
