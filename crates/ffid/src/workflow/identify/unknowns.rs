//! The unknowns of a fit: parameters, ties in place of some, start and priors.

use super::error::{IdentifyError, config};
use super::options::FitOptions;
use super::settings::Settings;
use super::ties::tie_map;
use ff_model::{Model, ParamDecl};
use ident::Estimator;
use ident::Posterior;
use ident::Priors;
use ident::Tied;
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
    /// Where the fit starts.
    pub(super) start: Vec<f64>,
    /// Parameters of the model that may change, ascending.
    pub(super) touched: Vec<usize>,
    map: Option<Arc<TieMap>>,
    width: Option<f64>,
    posterior: Option<Posterior>,
}

impl Unknowns {
    pub(super) fn new(
        model: &Model,
        estimated: &[usize],
        s: &Settings,
        options: &FitOptions,
    ) -> Result<Self, IdentifyError> {
        let refused = |code, e: String, hint: &str| IdentifyError::Refused(config(code, e, hint));
        let all = model.param_decls();
        let values: Vec<f64> = all.iter().map(|d| d.nominal).collect();
        let map = tie_map(&all, &values, &options.ties)
            .map_err(|e| refused("Config::Ties", e.to_string(), "see the names that `ffid check` lists"))?;
        let mut touched = estimated.to_vec();
        let (decls, nominal, mut selected) = match &map {
            None => (all, values, estimated.to_vec()),
            Some(m) => {
                let free = m.free();
                touched.extend((0..all.len()).filter(|i| free.binary_search(i).is_err()));
                let kept = estimated.iter().filter_map(|i| free.binary_search(i).ok());
                let selected = kept.chain(free.len()..m.decls().len()).collect();
                (m.decls().to_vec(), m.start(), selected)
            }
        };
        selected.sort_unstable();
        touched.sort_unstable();
        touched.dedup();
        let start = if s.start_offset == 0.0 {
            nominal.clone()
        } else {
            offset_start(&decls, &nominal, &selected, s.start_offset, s.seed)
        };
        let (width, posterior) = (s.prior, options.posterior.clone());
        Ok(Self { decls, selected, nominal, start, touched, map, width, posterior })
    }
    /// What is known beforehand of these.
    pub(super) fn priors(&self, selected: &[usize]) -> Result<Priors, IdentifyError> {
        let refused = |e: String, hint: &str| IdentifyError::Refused(config("Config::Prior", e, hint));
        let mut priors = match self.width {
            Some(w) => Priors::new(&self.decls, selected, &self.nominal, &[("*", Sigma::Relative(w))])
                .map_err(|e| refused(e.to_string(), "give a width such as 0.3"))?,
            None => Priors::default(),
        };
        if let Some(p) = &self.posterior {
            let rows = p.rows_for(&self.decls, selected);
            priors = priors.and(rows.map_err(|e| refused(e.to_string(), "identify the same robot, or leave it out"))?);
        }
        Ok(priors)
    }
    /// All parameters of the model.
    pub(super) fn expand(&self, values: &[f64]) -> Result<Vec<f64>, IdentifyError> {
        match &self.map {
            None => Ok(values.to_vec()),
            Some(m) => m.expand(values).map_err(|e| IdentifyError::Model(e.to_string())),
        }
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
            Some(m) => Box::new(Tied::new(inner, Arc::clone(m))),
        }
    }
    /// Whether ties stand for parameters of the model.
    pub(super) fn has_ties(&self) -> bool {
        self.map.is_some()
    }
}

/// Standard deviation that a posterior alone gives each parameter, by name; absent where it does not tell. Allocates.
pub(super) fn known_before(p: &Posterior) -> Result<BTreeMap<String, (f64, f64)>, SequenceError> {
    let mut out = BTreeMap::new();
    for (name, mean) in p.names.iter().zip(&p.mean) {
        // A name may look like a pattern (`k[0]`), but then it matches itself alone.
        if let Some(w) = p.marginal(&[name.as_str()])?.rows.first().and_then(|r| r.first()).filter(|w| **w != 0.0) {
            out.insert(name.clone(), (*mean, 1.0 / w.abs()));
        }
    }
    Ok(out)
}
