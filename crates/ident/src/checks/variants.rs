//! Variants of a model for comparison: rigid, flexible, sloshing, or both.
//!
//! A variant without some appendages has them frozen at rest, their inertia added to their hosts: their motion is left out, not
//! their mass.

use ff_model::{Model, Params, Problems};

/// Which appendages of a model move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelVariant {
    /// Panels and fuel frozen.
    Rigid,
    /// Fuel frozen.
    Flexible,
    /// Panels frozen.
    Slosh,
    /// The model as it is.
    Both,
}

impl ModelVariant {
    /// All.
    pub const ALL: [Self; 4] = [Self::Rigid, Self::Flexible, Self::Slosh, Self::Both];
    /// Name in results: `rigid`, `flexible`, `slosh` or `both`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Flexible => "flexible",
            Self::Slosh => "slosh",
            Self::Both => "both",
        }
    }
    fn moves(self, kind: &str) -> bool {
        let (panel, fuel) = (matches!(kind, "flex_panel" | "modal"), kind.starts_with("slosh"));
        match self {
            Self::Both => true,
            Self::Rigid => !panel && !fuel,
            Self::Flexible => !fuel,
            Self::Slosh => !panel,
        }
    }
    /// The model with the appendages frozen that do not move in this variant, parameters nominal. Allocates.
    ///
    /// # Errors
    /// Those of [`Model::mount`] and [`Model::set_nominal`].
    pub fn of(self, model: &Model) -> Result<Model, Problems> {
        let params = Params::nominal(model);
        let put = |to: &mut Model, keep: bool| -> Result<(), Problems> {
            for (k, a) in model.appendages().iter().enumerate() {
                if self.moves(a.decl().kind) == keep {
                    to.mount(a.name.clone(), a.host, a.mount, a.appendage.clone())?;
                    let first = to.appendages().last().map_or(0, |a| a.param_offset);
                    let values: Vec<(usize, f64)> =
                        params.appendage(model, k).iter().enumerate().map(|(i, v)| (first + i, *v)).collect();
                    to.set_nominal(&values)?;
                }
            }
            Ok(())
        };
        let mut frozen = model.without_appendages();
        put(&mut frozen, false)?;
        let mut out = frozen.frozen(&Params::nominal(&frozen));
        put(&mut out, true)?;
        Ok(out)
    }
    /// Those of `wanted` that differ from one another for this model, in the order of [`ModelVariant::ALL`]. Allocates.
    pub fn distinct(model: &Model, wanted: &[Self]) -> Vec<Self> {
        let moving = |v: Self| -> Vec<bool> { model.appendages().iter().map(|a| v.moves(a.decl().kind)).collect() };
        let mut out: Vec<Self> = Vec::new();
        for v in Self::ALL {
            if wanted.contains(&v) && !out.iter().any(|o| moving(*o) == moving(v)) {
                out.push(v);
            }
        }
        out
    }
}
