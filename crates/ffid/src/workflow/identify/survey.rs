//! One pass over the records at the end of a fit, with columns of what the fit did not estimate.

use super::error::IdentifyError;
use super::evidence::OTHER_ROBOT;
use super::extra_mode::{self, ExtraMode};
use super::fitted::Ended;
use super::noise_floor::DRAWS;
use super::over_time::OverTime;
use super::record_estimator::Twin;
use super::row_layout::RowLayout;
use super::settings::Settings;
use ff_model::Model;
use ident::belief::Unknown;
use ident::compose::is_called;
use ident::uncertain::{
    self, Combination, Component, Direction, ELEMENTS, EndOfFit, ErrorSource, Hypothesis, Layout, NormalEquations,
    Oscillator, OscillatorColumn, Scores, hypotheses,
};
use ident::{Estimator, Options, OutputError, SetupError, Several};
use nalgebra::DMatrix;

/// Draws that are added to the motion and taken off it.
const SHAKEN: usize = 3;
/// Draws where that noise is loud in the residuals: as many as directions that the estimates may move along, and no more numbers than [`ROOM`] where
/// there are [`DRAWS`] at least.
const MANY: usize = 24;
/// See [`MANY`] (128 MB).
const ROOM: usize = 1 << 24;

/// Deviations of what was known before that a parameter may be off by where a record does not tell it.
const WIDE: f64 = 30.0;

/// Whose columns there are beside those of the fit's unknowns.
pub(super) enum Columns<'a> {
    /// All errors, and an oscillator that was found.
    Every(Option<&'a ExtraMode>),
    /// Oscillators alone.
    Oscillators(&'a [Oscillator]),
    /// No others, and what the fit would be with noise of the encoders added to the motion ([`Survey::shaken`]).
    Shaken,
}

/// Products of all columns, and what they are of.
pub(super) struct Survey {
    pub(super) scores: Scores,
    pub(super) layout: Layout,
    pub(super) tried: Vec<Hypothesis>,
    /// Unknowns of the fit.
    pub(super) names: Vec<String>,
    /// What draws of the encoders' noise add to the residuals of each record.
    pub(super) drawn: Vec<DMatrix<f64>>,
    /// Which of the hypotheses is the oscillator.
    pub(super) oscillator: usize,
    /// Components of every oscillator where there are no others: elements of its inertia, then frequency and damping where it has one.
    pub(super) oscillators: Vec<Vec<usize>>,
    /// Normal equations of the fit, and those with noise of the encoders added to the motion and taken off it, draw after draw; none unless they were asked
    /// for and the motion was fitted.
    pub(super) shaken: Option<(NormalEquations, Vec<[NormalEquations; 2]>)>,
}

/// An estimator with these columns beside those of the fit.
fn wide<'m>(
    of: &Twin<'m>,
    end: &Ended<'_>,
    s: &Settings,
    columns: &Columns<'_>,
    estimated: &dyn Fn(&str) -> bool,
) -> Result<OutputError<'m>, SetupError> {
    let model = end.model;
    let numbers = of.record().samples() * (model.nj() + 3);
    let draws = if end.loud { MANY.min((ROOM / numbers.max(1)).max(DRAWS)) } else { DRAWS };
    let plain = Options {
        deflected_at: Some(end.values.to_vec()),
        compliances: end.compliances(),
        motion_noise: draws,
        noise_is_loud: end.loud,
        ..Options::new(s.noise)
    };
    let (mut options, oscillators) = match columns {
        Columns::Every(extra) => {
            let found: Vec<Oscillator> = extra.iter().map(|m| m.oscillator()).collect();
            (uncertain::with_every_column(model, &plain), found)
        }
        Columns::Oscillators(all) => (with_columns_of(model, &plain, estimated), all.to_vec()),
        Columns::Shaken => (with_columns_of(model, &plain, estimated), Vec::new()),
    };
    for (k, o) in oscillators.iter().enumerate() {
        options.errors.extend(columns_of(o).map(|c| ErrorSource::Oscillator(k, c)));
    }
    options.oscillators = oscillators;
    options.errors.extend_from_slice(&of.own);
    of.survey(&options, end.values)
}

/// Columns of an oscillator.
fn columns_of(o: &Oscillator) -> impl Iterator<Item = OscillatorColumn> + use<> {
    let searched = o.inertia.map(|_| [OscillatorColumn::Frequency, OscillatorColumn::Damping]);
    (0..ELEMENTS).map(OscillatorColumn::Inertia).chain(searched.into_iter().flatten())
}

/// Options of an estimator that has the columns of these nuisance unknowns.
fn with_columns_of(model: &Model, plain: &Options, estimated: &dyn Fn(&str) -> bool) -> Options {
    let every = uncertain::with_every_column(model, plain);
    let joints = model.joint_names();
    let starts = model.passive_coords().into_iter().map(|(n, _)| format!("initial.{n}"));
    Options {
        gyro_bias: estimated("gyro.bias.x"),
        torque_bias: joints.iter().any(|j| estimated(&format!("torque.bias.{j}"))),
        initial_state: estimated("initial.rate.x") || starts.into_iter().any(|n| estimated(&n)),
        torque_delay: estimated("torque.delay"),
        gyro_delay: estimated("gyro.delay"),
        kinematics: every.kinematics.iter().filter(|k| estimated(k)).cloned().collect(),
        errors: every.errors.iter().copied().filter(|e| estimated(&e.name(&joints))).collect(),
        ..plain.clone()
    }
}

/// The error that parameters are others in the record of this label.
pub(super) fn other_robot(label: &str, components: Vec<Component>) -> Hypothesis {
    let words = format!("parameters that are others in record {label}");
    Hypothesis::new(format!("{OTHER_ROBOT}.{label}"), words, components)
}

impl Survey {
    /// `None` where the model cannot be evaluated with these columns.
    pub(super) fn new(
        end: &Ended<'_>,
        twins: &[Twin<'_>],
        s: &Settings,
        columns: &Columns<'_>,
    ) -> Result<Option<Self>, IdentifyError> {
        Self::without_noise_in_columns(end, twins, s, columns, &|_, _| false)
    }
    /// [`Survey::new`]; where the scores `may_be_noise`, without what noise of the encoders gives them because it is in the columns as well
    /// ([`Scores::allow_for_noise_in_columns`]), for which the records are gone through seven times more.
    pub(super) fn without_noise_in_columns(
        end: &Ended<'_>,
        twins: &[Twin<'_>],
        s: &Settings,
        columns: &Columns<'_>,
        may_be_noise: &dyn Fn(&Scores, &Layout) -> bool,
    ) -> Result<Option<Self>, IdentifyError> {
        let (model, e) = (end.model, &end.fitted.estimate);
        if twins.is_empty() {
            return Ok(None);
        }
        let several = twins.len() > 1;
        let decls = model.param_decls();
        let labels_of = if several { end.labels } else { &[] };
        let own = |name: &str| {
            let of_fit = e.nuisance.iter().map(|u| u.name.as_str());
            let of_records = end.unknowns.decls.iter().map(|d| d.name.as_str());
            of_fit.chain(of_records).any(|u| is_called(u, name, labels_of))
                || s.biases && (name.starts_with("gyro.bias.") || name.starts_with("torque.bias."))
        };
        let mut parts: Vec<Box<dyn Estimator + '_>> = Vec::new();
        let (mut rows, mut orders, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
        let channels = model.nj() + 3;
        for twin in twins {
            let Ok(part) = wide(twin, end, s, columns, &own) else { return Ok(None) };
            // Rows of the fit are listed sample by sample, or group after group where these are, too.
            let by_sample = part.is_interleaved() || !RowLayout::of(twin.record(), channels).is_interleaved();
            let order = order(part.rows(), channels, by_sample);
            // Those of the rigid method are not residuals of these rows.
            if e.residuals.len() >= residuals.len() + order.len() {
                let first = residuals.len();
                let counts = |r: f64| s.loss.rho(r).sqrt().copysign(r);
                residuals.extend(order.iter().map(|i| counts(e.residuals[first + i])));
            }
            rows.push(part.rows());
            orders.push(order);
            parts.push(OverTime::changed(Box::new(part), &decls, &twin.changes));
        }
        let residuals = (residuals.len() == e.residuals.len()).then_some(&residuals[..]);
        let mut all: Box<dyn Estimator + '_> =
            if several { Box::new(Several::new(end.shared, parts)) } else { parts.remove(0) };
        let nuisance = all.nuisance();
        let names: Vec<String> =
            decls.iter().map(|d| d.name.clone()).chain(nuisance.iter().map(|u| u.name.clone())).collect();
        let value_of = |name: &str| e.nuisance.iter().find(|u| u.name == name).map(|u| u.value);
        let beside = |name: &str| -> Combination {
            let own = nuisance.iter().enumerate().filter(|(_, u)| is_called(&u.name, name, labels_of));
            own.map(|(k, _)| (decls.len() + k, 1.0)).collect()
        };
        let places = |made: &[(String, f64)]| -> Combination {
            let one = |(name, by): &(String, f64)| {
                let k = nuisance.iter().position(|u| u.name == *name)?;
                Some((decls.len() + k, *by))
            };
            made.iter().filter_map(one).collect()
        };
        // Errors that records share, whether the mission is not sure of them or they were adopted.
        let shared: Vec<(&str, f64)> =
            end.unknowns.decls.iter().map(|d| d.name.as_str()).zip(e.values.iter().copied()).collect();
        let shared_value = |name: &str| shared.iter().find(|(n, _)| is_called(name, n, labels_of)).map(|s| s.1);
        // Changes of parameters in a record are made of steps from record to record.
        let steps = |name: &str| {
            let made = end.unknowns.combined.iter().filter_map(|(step, made)| {
                let by: f64 = made.iter().filter(|m| m.0 == name).map(|m| m.1).sum();
                Some(by * shared.iter().find(|(n, _)| n == step)?.1)
            });
            made.sum::<f64>()
        };
        let of = |name: &str| value_of(name).or_else(|| shared_value(name)).or_else(|| Some(steps(name)));
        let extra: Vec<f64> = nuisance.iter().map(|u| of(&u.name).unwrap_or(0.0)).collect();
        let sizes = ident::parameters::sizes(&decls, end.values);
        let (mut base, mut base_names) = (Vec::new(), Vec::new());
        for (column, &i) in end.unknowns.columns(&end.fitted.selected, &e.values)?.into_iter().zip(&end.fitted.selected)
        {
            // An error that records share is a column of every one of them.
            let column = match column[..] {
                [(shared, _)] if shared >= decls.len() => {
                    match end.unknowns.combined.get(&end.unknowns.decls[i].name) {
                        Some(made) => places(made),
                        None => beside(&end.unknowns.decls[i].name),
                    }
                }
                _ => column,
            };
            if column.is_empty() {
                return Ok(None);
            }
            let largest = column
                .iter()
                .map(|&(p, by)| sizes.get(p).map_or_else(|| nuisance[p - decls.len()].size, |s| s / by.abs()))
                .fold(f64::INFINITY, f64::min);
            base.push((column, largest));
            base_names.push(end.unknowns.decls[i].name.clone());
        }
        for (k, u) in nuisance.iter().enumerate() {
            // What output error estimates and the rigid method does not.
            let bias = residuals.is_none() && s.biases && u.name.contains(".bias.");
            if value_of(&u.name).is_some() || bias {
                base.push((vec![(decls.len() + k, 1.0)], u.size));
                base_names.push(u.name.clone());
            }
        }
        let priors = end.unknowns.priors(&end.fitted.selected)?;
        let mut known = DMatrix::zeros(priors.len(), base.len());
        let mut of_priors = Vec::new();
        let at: Vec<f64> = end.fitted.selected.iter().map(|&i| e.values[i]).collect();
        priors.push_residuals(&at, &mut of_priors);
        priors.fill_jacobian(&at, &mut known, 0);
        // Of ties, the parameters that they determine.
        let mut estimated = Vec::new();
        for ((c, _), &i) in base.iter().zip(&end.fitted.selected) {
            // Of a body of which one error is estimated, the others may be wrong as well.
            if end.unknowns.is_asked(i) || c.len() == 1 {
                estimated.extend(c.iter().map(|c| c.0).filter(|&i| i < decls.len()));
            }
        }
        let every = matches!(columns, Columns::Every(_));
        let mut tried = if every { hypotheses(model, &estimated, end.values) } else { Vec::new() };
        // Of the friction of a joint what is not estimated.
        for h in tried.iter_mut().filter(|h| h.name.starts_with("friction.")) {
            h.components.retain(|c| c.of.iter().any(|(name, _)| !own(name)));
        }
        let held: Vec<usize> = base.iter().flat_map(|(c, _)| c.iter().map(|c| c.0)).collect();
        let mut layout = Layout::new(&tried, &names, labels_of, &held);
        // Each record but the first against all the others: what it alone would say of the parameters.
        // Errors that were adopted are no parameters of the robot.
        let of_model = |k: &usize| base[*k].0.iter().all(|c| c.0 < decls.len());
        let asked = |k: &usize| end.unknowns.is_asked(end.fitted.selected[*k]) && of_model(k);
        let of_parameters: Vec<usize> = (0..end.fitted.selected.len()).filter(asked).collect();
        let parameters: Vec<_> = of_parameters.iter().map(|&k| base[k].0.clone()).collect();
        let mut first = 0;
        for (label, n) in labels_of.iter().zip(&rows).filter(|_| every) {
            if first > 0 {
                layout.differing(tried.len(), &parameters, &(first..first + n));
                let unit = |k: &usize| end.unknowns.decls[end.fitted.selected[*k]].unit.to_owned();
                let one = |k: &usize| Component { name: base_names[*k].clone(), unit: unit(k), of: Vec::new() };
                let components = of_parameters.iter().map(one).collect();
                tried.push(other_robot(label, components));
            }
            first += n;
        }
        if every {
            // What this record alone would say of what earlier ones have told.
            let before = end.unknowns.known_before()?;
            if !before.is_empty() {
                let of = |k: &usize| before.get(&base_names[*k]).map_or(f64::INFINITY, |(_, std)| WIDE * std);
                let direction = |k: &usize| Direction { width: of(k), ..base[*k].0.clone().into() };
                layout.push(tried.len(), of_parameters.iter().map(direction), uncertain::Searched::default());
                let unit = |k: &usize| end.unknowns.decls[end.fitted.selected[*k]].unit.to_owned();
                let one = |k: &usize| Component { name: base_names[*k].clone(), unit: unit(k), of: Vec::new() };
                let components = of_parameters.iter().map(one).collect();
                let words = "parameters that are others than those identified before".to_owned();
                tried.push(Hypothesis::new(OTHER_ROBOT, words, components));
            }
        }
        let oscillator = tried.len();
        let widths = extra_mode::widths(model, end.values);
        let direction = |k: usize, c: OscillatorColumn| {
            let width = if let OscillatorColumn::Inertia(e) = c { widths[e] } else { f64::INFINITY };
            Direction { width, ..beside(&ErrorSource::Oscillator(k, c).name(&[])).into() }
        };
        let mut oscillators = Vec::new();
        match columns {
            Columns::Every(None) | Columns::Shaken => {}
            Columns::Every(Some(found)) => {
                let inertia = columns_of(&found.oscillator()).map(|c| direction(0, c));
                layout.push(oscillator, inertia, found.searched());
                tried.push(extra_mode::hypothesis());
            }
            Columns::Oscillators(all) => {
                for (k, o) in all.iter().enumerate() {
                    let first = layout.components.len();
                    layout.push(k, columns_of(o).map(|c| direction(k, c)), uncertain::Searched::default());
                    oscillators.push((first..layout.components.len()).collect());
                }
            }
        }
        // Parameters that no column is made of need no derivatives.
        let mut selected: Vec<usize> = (0..decls.len()).collect();
        if !every {
            selected.retain(|i| held.contains(i));
        }
        let place = |i: usize| match i.checked_sub(decls.len()) {
            Some(k) => selected.len() + k,
            None => selected.binary_search(&i).unwrap_or_default(),
        };
        base.iter_mut().for_each(|(c, _)| c.iter_mut().for_each(|c| c.0 = place(c.0)));
        layout.components.iter_mut().for_each(|d| d.columns.iter_mut().for_each(|c| c.0 = place(c.0)));
        // A draw is one of all records, each with its own noise.
        let columns_of_draw = |k: usize| -> ident::uncertain::Combination {
            let of_draw = format!("motion.noise[{k}]");
            let own = (decls.len()..names.len()).filter(|&i| names[i].ends_with(&of_draw));
            own.map(|i| (place(i), 1.0)).collect()
        };
        let draws: Vec<_> = (0..).map(columns_of_draw).take_while(|c| !c.is_empty()).collect();
        let at_end = EndOfFit {
            full: end.values,
            extra: &extra,
            selected: &selected,
            base: &base,
            asked: &of_parameters,
            residuals,
            priors: (known, of_priors),
        };
        // The model may not move there at all: then nothing is tested.
        let Ok(mut scores) = Scores::new(&mut *all, &at_end, &layout.components, &draws) else { return Ok(None) };
        let shaken = if matches!(columns, Columns::Shaken) {
            with_noise_added(&at_end, &nuisance, &mut |at| NormalEquations::new(&mut *all, at).ok())
        } else {
            None
        };
        if may_be_noise(&scores, &layout) {
            let mut sums = |at: &EndOfFit<'_>| {
                let scores = Scores::new(&mut *all, at, &layout.components, &[]).ok()?;
                Some(scores.sums().clone_owned())
            };
            if let Some((still, shaken)) = with_noise_added(&at_end, &nuisance, &mut sums) {
                scores.allow_for_noise_in_columns(&still, &shaken);
            }
        }
        let (mut drawn, mut first) = (Vec::new(), 0);
        for (n, order) in rows.iter().zip(&orders) {
            let of_rows = scores.drawn().rows(first, *n);
            let mut by_sample = DMatrix::zeros(*n, of_rows.ncols());
            order.iter().enumerate().for_each(|(row, &at)| by_sample.set_row(at, &of_rows.row(row)));
            drawn.push(by_sample);
            first += n;
        }
        Ok(Some(Self { scores, layout, tried, names: base_names, drawn, oscillator, oscillators, shaken }))
    }
}

/// What `of` makes of the end of a fit, with the motion as it is, and with noise of the encoders added to it and taken off it, draw after draw. `None`
/// where the motion was not fitted, or the model does not move with the noise.
fn with_noise_added<T>(
    end: &EndOfFit<'_>,
    nuisance: &[Unknown],
    of: &mut dyn FnMut(&EndOfFit<'_>) -> Option<T>,
) -> Option<(T, Vec<[T; 2]>)> {
    let mut at = |size: f64, draw: usize| {
        let mut extra = end.extra.to_vec();
        let mut found = false;
        let of_draw = format!("motion.noise[{draw}]");
        for (x, _) in extra.iter_mut().zip(nuisance).filter(|(_, u)| u.name.ends_with(&of_draw)) {
            (*x, found) = (size, true);
        }
        // Residuals of the fit are those of its own steps and of the motion as it is.
        let priors = end.priors.clone();
        let shaken = EndOfFit { extra: &extra, residuals: None, priors, ..*end };
        found.then(|| of(&shaken))?
    };
    let still = at(0.0, 0)?;
    let all: Option<Vec<_>> = (0..SHAKEN).map(|k| Some([at(1.0, k)?, at(-1.0, k)?])).collect();
    Some((still, all?))
}

/// For every row of an estimator its place among rows that are listed sample by sample: torques, then three axes of the gyro.
fn order(rows: usize, channels: usize, interleaved: bool) -> Vec<usize> {
    if interleaved {
        return (0..rows).collect();
    }
    let (samples, joints) = (rows / channels, channels - 3);
    let torques = (0..samples).flat_map(|i| (0..joints).map(move |c| i * channels + c));
    torques.chain((0..samples).flat_map(|i| (joints..channels).map(move |c| i * channels + c))).collect()
}
