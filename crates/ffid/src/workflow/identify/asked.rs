//! What may be asked of an identification beside its settings: several records, ties, earlier knowledge, doubts.

use super::{IdentifyError, Settings, config};
use ff_model::{Area, Model, ParamDecl, ParamGroup, Problem, Problems};
use ff_records::Record;
use ident::Estimator;
use ident::Posterior;
use ident::Priors;
use ident::belief::SequenceError;
use ident::belief::Sigma;
use ident::compose::{Affine, TieError, TieMap};
use ident::parameters::offset_start;
use ident::parameters::selection;
use ident::{Tie, Tied};
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A record with the name of what belongs to it alone.
#[derive(Clone, Debug)]
pub struct Take {
    /// Prefix of its biases and initial state when there are several.
    pub label: String,
    /// The samples.
    pub record: Record,
}

/// Questions beside the fit. The default asks nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Asked {
    /// Where the data are silent, estimate the parameters that they can tell and hold the others.
    pub reduce: bool,
    /// Patterns of parameters whose likelihood is to be profiled.
    pub profile: Vec<String>,
    /// Fits from random starts, beside the one from the start.
    pub more_starts: usize,
    /// What an earlier identification has learnt.
    pub posterior: Option<Posterior>,
    /// Parameters that are functions of fewer unknowns.
    pub ties: Vec<TieSpec>,
}

/// One tie, as a file gives it; exactly one of `parameters`, `factors` and `slope`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TieSpec {
    /// Name of the unknown.
    pub name: String,
    /// Patterns of parameters that are one value; it starts at their mean.
    #[serde(default)]
    pub parameters: Vec<String>,
    /// Parameters (patterns) that are one value times a factor.
    #[serde(default)]
    pub factors: BTreeMap<String, f64>,
    /// Parameters that change by so much per unit of the unknown, from their values in the mission, which belong to `start`.
    #[serde(default)]
    pub slope: BTreeMap<String, f64>,
    /// Start of the unknown; with `slope` only.
    pub start: Option<f64>,
}

/// Everything in a file of ties.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TieFile {
    tie: Vec<TieSpec>,
}

impl TieSpec {
    /// Reads a file of `[[tie]]` tables.
    ///
    /// # Errors
    /// `Config::Ties`, with what is wrong and where.
    pub fn read(text: &str) -> Result<Vec<Self>, Problems> {
        let hint = "write [[tie]] with a name and one of parameters, factors and slope (docs/results.md)";
        let file: TieFile = ff_model::toml::from_str(text).map_err(|e| {
            let line = e.span().map(|s| text[..s.start.min(text.len())].matches('\n').count() + 1);
            let p = Problem::error(Area::Config, "Config::Ties", e.message().to_owned()).hint(hint);
            Problems(vec![match line {
                Some(l) => p.at_line(l),
                None => p,
            }])
        })?;
        for t in &file.tie {
            let given = [!t.parameters.is_empty(), !t.factors.is_empty(), !t.slope.is_empty()];
            let finite = t.factors.values().chain(t.slope.values()).chain(&t.start).all(|x| x.is_finite());
            let what = if given.iter().filter(|g| **g).count() != 1 {
                "exactly one of parameters, factors and slope is needed"
            } else if t.start.is_some() == t.slope.is_empty() {
                "start belongs to slope, and slope needs it"
            } else if !finite {
                "a number is not finite"
            } else {
                continue;
            };
            let p = Problem::error(Area::Config, "Config::Ties", what).on(format!("tie '{}'", t.name));
            return Err(Problems(vec![p.hint(hint)]));
        }
        Ok(file.tie)
    }
    fn make(&self, decls: &[ParamDecl], values: &[f64]) -> Result<Box<dyn Tie>, TieError> {
        if !self.parameters.is_empty() {
            let patterns: Vec<&str> = self.parameters.iter().map(String::as_str).collect();
            return Ok(Box::new(Affine::shared(decls, values, &self.name, &patterns)?));
        }
        if !self.factors.is_empty() {
            let members: Vec<(&str, f64)> = self.factors.iter().map(|(n, f)| (n.as_str(), *f)).collect();
            return Ok(Box::new(Affine::factors(decls, values, &self.name, &members)?));
        }
        let start = self.start.unwrap_or_default();
        let mut parameters = Vec::new();
        let mut slopes = Vec::new();
        for (pattern, slope) in &self.slope {
            for i in selection::select(decls, &[pattern.as_str()])? {
                if parameters.contains(&i) {
                    return Err(TieError::Twice { parameter: decls[i].name.clone() });
                }
                parameters.push(i);
                slopes.push(*slope);
            }
        }
        let offset = DVector::from_fn(parameters.len(), |k, _| values[parameters[k]] - slopes[k] * start);
        let matrix = DMatrix::from_iterator(slopes.len(), 1, slopes);
        let inf = f64::INFINITY;
        let unknown = ParamDecl {
            name: self.name.clone(),
            unit: "1",
            nominal: start,
            bounds: (-inf, inf),
            group: ParamGroup::Free,
        };
        Ok(Box::new(Affine::new(vec![unknown], parameters, offset, matrix)?))
    }
}

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
    pub(super) fn new(model: &Model, estimated: &[usize], s: &Settings, asked: &Asked) -> Result<Self, IdentifyError> {
        let refused = |code, e: String, hint: &str| IdentifyError::Refused(config(code, e, hint));
        let all = model.param_decls();
        let values: Vec<f64> = all.iter().map(|d| d.nominal).collect();
        let map = tie_map(&all, &values, &asked.ties)
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
        let (width, posterior) = (s.prior, asked.posterior.clone());
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

fn tie_map(decls: &[ParamDecl], values: &[f64], ties: &[TieSpec]) -> Result<Option<Arc<TieMap>>, TieError> {
    if ties.is_empty() {
        return Ok(None);
    }
    let made = ties.iter().map(|t| t.make(decls, values)).collect::<Result<Vec<_>, _>>()?;
    TieMap::new(decls, values, made).map(|m| Some(Arc::new(m)))
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
