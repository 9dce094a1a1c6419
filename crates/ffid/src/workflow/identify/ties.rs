//! Ties between parameters, as a file gives them.

use ff_model::{Area, ParamDecl, ParamGroup, Problem, Problems};
use ident::Tie;
use ident::compose::{Affine, TieError, TieMap};
use ident::parameters::select;
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

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
            for i in select(decls, &[pattern.as_str()])? {
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

/// The map from unknowns to parameters, of ties as given and of `others`; `None` without any.
pub(super) fn tie_map(
    decls: &[ParamDecl],
    values: &[f64],
    ties: &[TieSpec],
    others: Vec<Box<dyn Tie>>,
) -> Result<Option<Arc<TieMap>>, TieError> {
    if ties.is_empty() && others.is_empty() {
        return Ok(None);
    }
    let mut made = ties.iter().map(|t| t.make(decls, values)).collect::<Result<Vec<_>, _>>()?;
    made.extend(others);
    TieMap::new(decls, values, made).map(|m| Some(Arc::new(m)))
}
