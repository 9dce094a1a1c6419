//! The unknowns of a fit: parameters, ties in place of some, start and priors.

use super::error::{IdentifyError, config};
use super::options::FitOptions;
use super::settings::Settings;
use super::ties::tie_map;
use super::uncertain::{UncertainItems, UncertainUnknown};
use ff_model::{Model, ParamDecl};
use ident::Estimator;
use ident::Posterior;
use ident::Priors;
use ident::Tied;
use ident::Transform;
use ident::belief::PriorRow;
use ident::belief::SequenceError;
use ident::belief::Sigma;
use ident::compose::TieMap;
use ident::parameters::offset_start;
use ident::uncertain::Combination;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The unknowns of a fit: the parameters asked for, with ties in place of those they determine.
pub(super) struct Unknowns {
    /// What is selected from.
    pub(super) decls: Vec<ParamDecl>,
    /// What is estimated, ascending.
    pub(super) selected: Vec<usize>,
    /// Values of the mission.
    pub(super) nominal: Vec<f64>,
    /// Values that a prior of everything is about: those of the mission, unless it says others ([`ff_mission::Mission::prior_means`]).
    pub(super) means: Vec<f64>,
    /// Where the fit starts.
    pub(super) start: Vec<f64>,
    /// Those among them that are not asked for, by index, each with what the mission says of it.
    pub(super) marginal: Vec<(usize, UncertainUnknown)>,
    /// Those of which nothing is known and that are not asked for either, by index: friction and gains of joints.
    pub(super) beside: Vec<usize>,
    /// Parameters of the model that may change, ascending.
    pub(super) touched: Vec<usize>,
    /// Parameters of the model; behind them come the errors that records share.
    of_model: usize,
    /// Estimated parameters of which the mission knows something: index, mean, deviation.
    known: Vec<(usize, f64, f64)>,
    map: Option<Arc<TieMap>>,
    width: Option<f64>,
    posterior: Option<Posterior>,
    /// By the name of a step from record to record: what it adds to the changes of parameters in records.
    pub(super) combined: BTreeMap<String, Vec<(String, f64)>>,
}

impl Unknowns {
    pub(super) fn new(
        model: &Model,
        estimated: &[usize],
        s: &Settings,
        options: &FitOptions,
        uncertain: &UncertainItems,
    ) -> Result<Self, IdentifyError> {
        let refused = |code, e: String, hint: &str| IdentifyError::Refused(config(code, e, hint));
        let mut all = model.param_decls();
        let of_model = all.len();
        all.extend(uncertain.shared.iter().cloned());
        // Errors that records share begin at their means.
        let mean = |d: &ParamDecl| {
            let beside = || uncertain.beside.iter().find(|b| b.0 == d.name).map_or(d.nominal, |b| b.1);
            uncertain.unknowns.iter().find(|u| u.name == d.name).map_or_else(beside, |u| u.mean)
        };
        let values: Vec<f64> =
            all.iter().enumerate().map(|(i, d)| if i < of_model { d.nominal } else { mean(d) }).collect();
        let map = tie_map(&all, &values, &options.ties, uncertain.ties(&values)?)
            .map_err(|e| refused("Config::Ties", e.to_string(), "see the names that `ffid check` lists"))?;
        let mut touched = estimated.to_vec();
        touched.extend(&uncertain.parameters);
        let mut wanted = touched.clone();
        wanted.extend(of_model..all.len());
        let (decls, nominal, mut selected) = match &map {
            None => (all, values, wanted),
            Some(m) => {
                let free = m.free();
                touched.extend((0..all.len()).filter(|i| free.binary_search(i).is_err()));
                let kept = wanted.iter().filter_map(|i| free.binary_search(i).ok());
                let selected = kept.chain(free.len()..m.decls().len()).collect();
                (m.decls().to_vec(), m.start(), selected)
            }
        };
        selected.sort_unstable();
        touched.sort_unstable();
        touched.dedup();
        let stands_for = |&i: &usize| {
            let of = uncertain.unknowns.iter().find(|u| u.name == decls[i].name)?;
            Some((i, of.clone()))
        };
        let marginal: Vec<(usize, UncertainUnknown)> = selected.iter().filter_map(stands_for).collect();
        let named = |i: &usize| uncertain.beside.iter().any(|b| b.0 == decls[*i].name);
        let beside: Vec<usize> = selected.iter().copied().filter(named).collect();
        let at = |i: usize| match &map {
            None => Some(i),
            Some(m) => m.free().binary_search(&i).ok(),
        };
        let known = uncertain.priors.iter().filter_map(|&(i, mean, std)| Some((at(i)?, mean, std))).collect();
        let start = if s.start_offset == 0.0 {
            let earlier = options.posterior.as_ref().filter(|_| options.start_at_posterior);
            earlier.and_then(|p| at_means(p, &decls, &selected, &nominal)).unwrap_or_else(|| nominal.clone())
        } else {
            let is_asked = |i: &usize| marginal.iter().all(|m| m.0 != *i) && !beside.contains(i);
            let asked: Vec<usize> = selected.iter().copied().filter(is_asked).collect();
            offset_start(&decls, &nominal, &asked, s.start_offset, s.seed)
        };
        let means =
            decls.iter().zip(&nominal).map(|(d, x)| uncertain.means.get(&d.name).copied().unwrap_or(*x)).collect();
        let (width, posterior) = (s.prior, options.posterior.clone());
        let combined = uncertain.over_time.combined.clone();
        Ok(Self {
            decls,
            selected,
            nominal,
            means,
            start,
            marginal,
            beside,
            touched,
            of_model,
            known,
            map,
            width,
            posterior,
            combined,
        })
    }
    /// What is known beforehand of these.
    pub(super) fn priors(&self, selected: &[usize]) -> Result<Priors, IdentifyError> {
        let refused = |e: String, hint: &str| IdentifyError::Refused(config("Config::Prior", e, hint));
        let mut priors = match self.width {
            Some(w) => Priors::new(&self.decls, selected, &self.means, &[("*", Sigma::Relative(w))])
                .map_err(|e| refused(e.to_string(), "give a width such as 0.3"))?
                .of_columns(|column| !self.beside.contains(&selected[column])),
            None => Priors::default(),
        };
        // What an earlier identification knows of them has these rows in it.
        let earlier = |i: usize| self.posterior.as_ref().is_some_and(|p| p.names.contains(&self.decls[i].name));
        let declared = self.known.iter().copied().chain(self.marginal.iter().map(|(i, u)| (*i, u.mean, u.std)));
        for (i, mean, sigma) in declared.filter(|d| !earlier(d.0)) {
            if let Some(column) = selected.iter().position(|&s| s == i) {
                priors = priors.with(PriorRow { column, mean, sigma });
            }
        }
        if let Some(p) = &self.posterior {
            let rows = p.rows_for(&self.decls, selected);
            priors = priors.and(rows.map_err(|e| refused(e.to_string(), "identify the same robot, or leave it out"))?);
        }
        Ok(priors)
    }
    /// All parameters of the model.
    pub(super) fn expand(&self, values: &[f64]) -> Result<Vec<f64>, IdentifyError> {
        match &self.map {
            None => Ok(values[..self.of_model].to_vec()),
            Some(m) => {
                let mut all = m.expand(values).map_err(|e| IdentifyError::Model(e.to_string()))?;
                all.truncate(self.of_model);
                Ok(all)
            }
        }
    }
    /// Whether an unknown is asked for, and not one of those the mission is not sure of, or friction or a gain of a joint.
    pub(super) fn is_asked(&self, i: usize) -> bool {
        self.marginal.iter().all(|m| m.0 != i) && !self.beside.contains(&i)
    }
    /// Whether something is known beforehand of what is asked for.
    pub(super) fn has_priors(&self) -> bool {
        self.width.is_some() || self.posterior.is_some() || !self.known.is_empty()
    }
    /// What earlier records have told of every parameter: mean and standard deviation, by name.
    pub(super) fn known_before(&self) -> Result<BTreeMap<String, (f64, f64)>, IdentifyError> {
        let Some(p) = &self.posterior else { return Ok(BTreeMap::new()) };
        known_before(p).map_err(|e| IdentifyError::Model(e.to_string()))
    }
    /// The start with these values in place of those of the same name.
    pub(super) fn at(&self, values: &BTreeMap<String, f64>) -> Vec<f64> {
        let one = |(d, start): (&ParamDecl, &f64)| values.get(&d.name).copied().unwrap_or(*start);
        self.decls.iter().zip(&self.start).map(one).collect()
    }
    /// The values of unknowns by name.
    pub(super) fn by_name(&self, values: &[f64]) -> BTreeMap<String, f64> {
        self.decls.iter().map(|d| d.name.clone()).zip(values.iter().copied()).collect()
    }
    /// Selected unknowns as combinations of the model's parameters, at these values of the unknowns.
    pub(super) fn columns(&self, selected: &[usize], values: &[f64]) -> Result<Vec<Combination>, IdentifyError> {
        let Some(map) = &self.map else { return Ok(selected.iter().map(|&i| vec![(i, 1.0)]).collect()) };
        let d = map.jacobian(values, selected).map_err(|e| IdentifyError::Model(e.to_string()))?;
        let of = |column: usize| (0..d.nrows()).map(|i| (i, d[(i, column)])).filter(|c| c.1 != 0.0).collect();
        Ok((0..selected.len()).map(of).collect())
    }
    /// Puts the ties before an estimator of the whole model.
    pub(super) fn tied<'a>(&self, inner: Box<dyn Estimator + 'a>) -> Box<dyn Estimator + 'a> {
        match &self.map {
            None => inner,
            // Errors of a slender body may lead through numbers that no body has.
            Some(m) if !self.marginal.is_empty() => Box::new(Tied::new(inner, Arc::clone(m)).unchecked()),
            Some(m) => Box::new(Tied::new(inner, Arc::clone(m))),
        }
    }
    /// Whether ties stand for parameters of the model.
    pub(super) fn has_ties(&self) -> bool {
        self.map.is_some()
    }
}

/// The values with the means of a posterior in place of those it names; `None` where no such body exists. Allocates.
fn at_means(p: &Posterior, decls: &[ParamDecl], selected: &[usize], values: &[f64]) -> Option<Vec<f64>> {
    let mut out = values.to_vec();
    for &i in selected {
        if let Some(k) = p.names.iter().position(|n| *n == decls[i].name) {
            out[i] = p.mean[k];
        }
    }
    Transform::affine(decls, selected, &out).is_ok_and(|t| t.inconsistent(&out).is_none()).then_some(out)
}

/// Standard deviation that a posterior alone gives each parameter, by name; absent where it does not tell. Allocates.
pub(super) fn known_before(p: &Posterior) -> Result<BTreeMap<String, (f64, f64)>, SequenceError> {
    let mut out = BTreeMap::new();
    if let Some(c) = p.covariance()? {
        let one = |(k, (name, mean)): (usize, (&String, &f64))| (name.clone(), (*mean, c[(k, k)].sqrt()));
        return Ok(p.names.iter().zip(&p.mean).enumerate().map(one).collect());
    }
    for (name, mean) in p.names.iter().zip(&p.mean) {
        // A name may look like a pattern (`k[0]`), but then it matches itself alone.
        if let Some(w) = p.marginal(&[name.as_str()])?.rows.first().and_then(|r| r.first()).filter(|w| **w != 0.0) {
            out.insert(name.clone(), (*mean, 1.0 / w.abs()));
        }
    }
    Ok(out)
}
