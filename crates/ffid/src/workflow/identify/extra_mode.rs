//! Is it a mode that the mission lacks? Where residuals keep a colour that no error accounts for, an oscillator on the base is looked
//! for: at lines of their spectrum, then by Gauss-Newton steps in frequency and damping together with all unknowns of the fit.

use super::error::IdentifyError;
use super::evidence::{EXTRA_MODE, ErrorSize, NamedError};
use super::fitted::Ended;
use super::known;
use super::mounted_mode::{Mounted, base_held};
use super::number::num;
use super::record_estimator::Twin;
use super::settings::Settings;
use super::survey::{Columns, Survey};
use crate::open::Opened;
use ff_linalg::fourier::RealFft;
use ff_model::Model;
use flex_panel::modal::Mode;
use ident::uncertain::{ELEMENTS, Hypothesis, Oscillator, Ranking, Searched, Shape, elements, evidence};
use nalgebra::DMatrix;

/// Part of what is left over that other errors may account for at most for a mode to be looked for.
const ACCOUNTED: f64 = 0.97;
/// Lines of the residuals' spectrum that are tried.
const LINES: usize = 5;
/// Damping ratios that are tried at each of them.
const DAMPING: [f64; 2] = [0.01, 0.05];
/// Steps in frequency and damping.
const STEPS: usize = 6;
/// Gain of chi-squared below which steps end, relative.
const GAIN: f64 = 1e-3;
/// Damping ratios between which a mode is one.
const RANGE: (f64, f64) = (1e-4, 0.4);
/// Periods that the record must have of the slowest, and samples per period of the fastest.
const PERIODS: f64 = 2.0;
/// See [`PERIODS`].
const SAMPLES: f64 = 5.0;
/// Lines to either side that are the surroundings of one.
const AROUND: usize = 20;
/// By how much, of chi-squared and of its fall, two coordinates must explain more than one.
const SECOND: (f64, f64) = (22.0, 0.05);
/// Part of the fall of chi-squared that an effective inertia which can exist must keep.
const KEPT: f64 = 0.5;

/// A mode that was found.
pub(super) struct ExtraMode {
    oscillator: Oscillator,
    /// Standard deviations of frequency (Hz) and damping ratio.
    std: [f64; 2],
    /// Independent places that were looked at.
    places: f64,
    /// The effective inertia that can exist, and by how much chi-squared falls with it.
    shape: Shape,
    drop: f64,
    /// Power of the residuals around the line, over that of noise: a line has to stand out of a colour, too.
    level: f64,
    /// `p` of its test at its place alone, noise of the encoders allowed for: that rings modes of the robot as if there were another.
    chance: f64,
}

/// Takes the size off a mode whose fit has not ended after so many linearisations: what a fit says that can still move has no deviation.
/// Frequency and damping are those of the search.
pub(super) fn without_size(line: &mut NamedError, linearisations: usize) {
    line.size.retain(|s| s.name.starts_with("frequency") || s.name.starts_with("damping_ratio"));
    line.mission.clear();
    let seen = line.text.split(" (").next().unwrap_or_default();
    line.text =
        format!("{seen} (mass and place unknown: a fit with it had not ended after {linearisations} linearisations)");
}

impl ExtraMode {
    /// With the elements of its inertia alone as columns.
    pub(super) fn oscillator(&self) -> Oscillator {
        Oscillator { inertia: None, ..self.oscillator.clone() }
    }
    /// What finding it has cost: frequency and damping, wherever in the spectrum.
    pub(super) fn searched(&self) -> Searched {
        Searched { freedom: 2, places: self.places }
    }
    /// The robot with it, for a fit.
    pub(super) fn mounted(&self, end: &Ended<'_>, opened: &Opened) -> Option<Mounted> {
        Mounted::with(opened, &self.modes(end)?)
    }
    /// Its coordinates as modes with the base held.
    pub(super) fn modes(&self, end: &Ended<'_>) -> Option<Vec<Mode>> {
        let Oscillator { frequency_hz, damping_ratio, .. } = self.oscillator;
        base_held(end, &self.shape.momenta, frequency_hz, damping_ratio)
    }
    /// Numbers that were adjusted: frequency, damping, and momenta per coordinate but for how coordinates are mixed.
    fn freedom(&self) -> usize {
        let c = self.shape.coordinates;
        2 + 6 * c - c * (c - 1) / 2
    }
    /// What the record says for it, as of other errors ([`ident::uncertain::Score::evidence`]).
    pub(super) fn evidence(&self) -> f64 {
        evidence(self.drop, self.freedom()) - self.places.ln()
    }
    /// Whether it stands out of the residuals around its line, which may have a colour, more than chance allows at this level.
    pub(super) fn stands_out(&self, level: f64) -> bool {
        evidence(self.drop / self.level, self.freedom()) - self.places.ln() > -level.ln()
            && self.chance * self.places < level
    }
    /// Puts its numbers in place of the elements of its inertia.
    pub(super) fn describe(&self, line: &mut NamedError) {
        let Oscillator { frequency_hz, damping_ratio, .. } = self.oscillator;
        let [of_frequency, of_damping] = self.std;
        let size = |name: &str, unit: &str, (value, std): (f64, f64)| ErrorSize {
            name: name.into(),
            unit: unit.into(),
            value,
            std,
        };
        line.size = vec![
            size("frequency", "Hz", (frequency_hz, of_frequency)),
            size("damping_ratio", "1", (damping_ratio, of_damping)),
            size("effective_mass", "kg", self.shape.mass),
            size("effective_inertia", "kg m^2", self.shape.moment),
        ];
        if !line.beside {
            (line.drop, line.freedom) = (self.drop, self.freedom());
        }
        let kind = match self.shape.coordinates {
            1 => "along one direction, as an appendage on a hinge or a spring",
            _ => "along two directions, as fuel",
        };
        line.text = format!(
            "a mode at {} +- {} Hz, damping {} +- {} %, that the mission lacks ({kind}; to first order, effective mass {} kg, inertia about \
             the base's origin {} kg m^2)",
            num(frequency_hz),
            num(of_frequency),
            num(100.0 * damping_ratio),
            num(100.0 * of_damping),
            num(self.shape.mass.0),
            num(self.shape.moment.0),
        );
    }
}

/// The hypothesis of it.
pub(super) fn hypothesis() -> Hypothesis {
    Hypothesis::new(EXTRA_MODE, "a mode that the mission lacks", Vec::new())
}

/// Mass of the base (kg) and the length (m) that its inertia is that of.
fn scale(model: &Model, values: &[f64]) -> (f64, f64) {
    let decls = model.param_decls();
    let of = |name: &str| decls.iter().position(|d| d.name == name).map_or(0.0, |i| values[i]);
    let mass = of("base.mass").max(f64::MIN_POSITIVE);
    let trace = of("base.i_xx") + of("base.i_yy") + of("base.i_zz");
    (mass, (0.5 * trace.max(0.0) / mass).sqrt().max(1e-3))
}

/// How large each element of an effective inertia may be (standard deviation): the base's own.
pub(super) fn widths(model: &Model, values: &[f64]) -> [f64; ELEMENTS] {
    let (mass, length) = scale(model, values);
    let mut out = [mass; ELEMENTS];
    out.iter_mut().zip(elements()).for_each(|(w, (i, j))| {
        *w *= length.powi(i32::from(i > 2) + i32::from(j > 2));
    });
    out
}

/// Whether there is anything to look for: residuals larger than noise that the errors which were tried do not account for, or
/// coloured ones where they are no larger.
pub(super) fn may_be(end: &Ended<'_>, survey: &Survey, ranking: &Ranking) -> bool {
    match ranking.explained {
        Some(part) => part < ACCOUNTED,
        None => {
            let channels = known::whiteness(end.records, end.signals, &[], &survey.drawn);
            channels.iter().any(|w| w.excess == Some(true))
        }
    }
}

/// Frequencies (Hz) where the residuals of all channels together have the most power, the strongest first, and the number of lines.
fn lines(end: &Ended<'_>) -> (Vec<f64>, Spectrum) {
    let seconds = end.records.iter().map(|r| r.record.seconds()).fold(0.0, f64::max);
    let rate = end.records.iter().map(|r| r.record.rate_hz()).fold(f64::INFINITY, f64::min);
    let (first, last) = (PERIODS.ceil() as usize, (rate / SAMPLES * seconds) as usize);
    let mut power = vec![0.0f64; last + 2];
    for (labelled, s) in end.records.iter().zip(end.signals) {
        let own = labelled.record.seconds();
        for (k, sigma) in s.sigma.iter().enumerate() {
            let r = s.residual(k);
            let mut fft = RealFft::new(r.len());
            fft.input().iter_mut().zip(&r).for_each(|(x, r)| *x = r / sigma);
            let Ok(found) = fft.run() else { continue };
            for (line, p) in power.iter_mut().enumerate() {
                let at = (line as f64 * own / seconds).round() as usize;
                *p += found.get(at).map_or(0.0, |c| c.norm_sqr() / r.len() as f64);
            }
        }
    }
    let highest = |i: usize| power[i] >= power[i - 1] && power[i] > power[i + 1];
    let mut peaks: Vec<usize> = (first.max(1)..=last).filter(|&i| highest(i)).collect();
    peaks.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
    peaks.truncate(LINES);
    let channels = end.records.iter().zip(end.signals).map(|(_, s)| s.sigma.len()).sum();
    let spectrum = Spectrum { power, seconds, channels, first, last };
    (peaks.into_iter().map(|i| i as f64 / seconds).collect(), spectrum)
}

/// Power of the residuals of all channels together, one for each under noise of the assumed size.
struct Spectrum {
    power: Vec<f64>,
    seconds: f64,
    channels: usize,
    first: usize,
    last: usize,
}

impl Spectrum {
    /// Lines that a mode may be at.
    fn places(&self) -> usize {
        (self.last + 1).saturating_sub(self.first)
    }
    /// Median around a frequency (Hz) over that of noise of the assumed size, at least one.
    fn level(&self, hz: f64) -> f64 {
        let at = (hz * self.seconds).round() as usize;
        let mut around: Vec<f64> = (at.saturating_sub(AROUND).max(1)..(at + AROUND + 1).min(self.power.len()))
            .map(|i| self.power[i])
            .collect();
        around.sort_by(f64::total_cmp);
        around.get(around.len() / 2).map_or(1.0, |p| (p / self.channels.max(1) as f64).max(1.0))
    }
}

/// The best oscillator there is, if it has an effective inertia that can exist.
pub(super) fn search(end: &Ended<'_>, twins: &[Twin<'_>], s: &Settings) -> Result<Option<ExtraMode>, IdentifyError> {
    let (hz, spectrum) = lines(end);
    let at =
        |&frequency_hz: &f64| DAMPING.map(|damping_ratio| Oscillator { frequency_hz, damping_ratio, inertia: None });
    let tried: Vec<Oscillator> = hz.iter().flat_map(at).collect();
    if tried.is_empty() {
        return Ok(None);
    }
    let Some(survey) = Survey::new(end, twins, s, &Columns::Oscillators(&tried))? else { return Ok(None) };
    let scored = tried.iter().zip(&survey.oscillators).filter_map(|(o, of)| Some((o, survey.scores.test(of, &[])?)));
    let Some((best, score)) = scored.max_by(|a, b| a.1.drop.total_cmp(&b.1.drop)) else { return Ok(None) };
    let inertia = |estimate: &[f64]| -> Option<[f64; ELEMENTS]> { estimate.get(..ELEMENTS)?.try_into().ok() };
    let mut here = Oscillator { inertia: inertia(&score.estimate), ..best.clone() };
    let seconds = end.records.iter().map(|r| r.record.seconds()).fold(0.0, f64::max);
    let (_, length) = scale(end.model, end.values);
    let (mut found, mut drop, mut may_be_noise): (Option<ExtraMode>, f64, bool) = (None, 0.0, false);
    for _ in 0..STEPS {
        let one = core::slice::from_ref(&here);
        let Some(survey) = Survey::new(end, twins, s, &Columns::Oscillators(one))? else { break };
        let of = &survey.oscillators[0];
        let (Some(own), Some(score)) = (survey.scores.test(&of[..ELEMENTS], &[]), survey.scores.test(of, &[])) else {
            break;
        };
        if own.drop < drop {
            break;
        }
        let ended = own.drop < drop * (1.0 + GAIN);
        drop = own.drop;
        let Some(inertia) = inertia(&score.estimate) else { break };
        let Some(covariance) = survey.scores.covariance(of) else { break };
        let of_inertia = covariance.view((0, 0), (ELEMENTS, ELEMENTS)).into_owned();
        let Some(shape) = shape(&inertia, &of_inertia, length, drop) else { break };
        let std = [score.std[ELEMENTS], score.std[ELEMENTS + 1]];
        let places = (spectrum.places() * DAMPING.len()) as f64;
        let level = spectrum.level(here.frequency_hz);
        let drop = score.drop - shape.misfit;
        let chance = score.p;
        may_be_noise = end.loud && survey.scores.may_be_motion_noise(score.drop);
        found = Some(ExtraMode { oscillator: here.clone(), std, places, shape, drop, level, chance });
        if ended {
            break;
        }
        let most = 0.5 / seconds;
        here.frequency_hz = (here.frequency_hz + score.estimate[ELEMENTS].clamp(-most, most)).max(most);
        here.damping_ratio =
            (here.damping_ratio + score.estimate[ELEMENTS + 1].clamp(-0.02, 0.02)).clamp(RANGE.0, RANGE.1);
        here.inertia = Some(inertia);
    }
    // What pushes the base where it should hold it back is no mode.
    let Some(mode) = found.filter(|m| m.drop > KEPT * drop) else { return Ok(None) };
    if !may_be_noise {
        return Ok(Some(mode));
    }
    // Nor is what noise of the encoders alone drives: it explains that noise.
    let one = core::slice::from_ref(&mode.oscillator);
    let survey = Survey::without_noise_in_columns(end, twins, s, &Columns::Oscillators(one), &|_, _| true)?;
    let score = survey.and_then(|survey| survey.scores.test(&survey.oscillators[0], &[]));
    Ok(score.map(|score| ExtraMode { drop: (score.drop - mode.shape.misfit).max(0.0), chance: score.p, ..mode }))
}

/// The effective inertia that can exist: of one coordinate, unless two explain more.
fn shape(estimate: &[f64; ELEMENTS], covariance: &DMatrix<f64>, length: f64, drop: f64) -> Option<Shape> {
    let one = Shape::nearest(estimate, covariance, 1, length);
    let two = Shape::nearest(estimate, covariance, 2, length);
    match (one, two) {
        (Some(one), Some(two)) => Some(if one.misfit - two.misfit > SECOND.0.max(SECOND.1 * drop) { two } else { one }),
        (one, two) => one.or(two),
    }
}
