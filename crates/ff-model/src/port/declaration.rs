//! The declaration of an appendage: its coordinates and parameters.

use crate::spatial::inertia::{INERTIAL_NAMES, INERTIAL_UNITS, Inertia};

/// Most coordinates one appendage may declare; buffers of the derived bias live on the stack.
pub const MAX_COORDS: usize = 16;
/// Most parameters one appendage may declare.
pub const MAX_PARAMS: usize = 256;
/// Most rows of the port equations.
pub(crate) const MAX_PORT: usize = 6 + MAX_COORDS;

/// One generalised coordinate of an appendage.
///
/// ```
/// use ff_model::CoordDecl;
///
/// let hinge = CoordDecl::new("hinge[1]", "rad", (-0.6, 0.8)); // a simulation stops outside
/// assert_eq!((hinge.name.as_str(), hinge.range.1), ("hinge[1]", 0.8));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CoordDecl {
    /// Name within the appendage, such as `hinge[0]`.
    pub name: String,
    /// Unit of the coordinate: `rad` or `m` (rates are per second).
    pub unit: &'static str,
    /// Range in which the model is valid; simulation stops with an error outside.
    pub range: (f64, f64),
}

impl CoordDecl {
    /// A coordinate in `unit` (`rad` or `m`) that is valid within `range`. Allocates for the name.
    pub fn new(name: impl Into<String>, unit: &'static str, range: (f64, f64)) -> Self {
        Self { name: name.into(), unit, range }
    }
}

/// What a parameter is, so that an estimator can keep it physical.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ff_model::{Inertia, ParamDecl, ParamGroup};
///
/// let tip = Inertia::from_com(3.2, &Vector3::new(0.4, -0.1, 0.2), &Matrix3::from_diagonal_element(0.3));
/// let mut params = ParamDecl::inertial("tip", &tip);
/// params.push(ParamDecl::positive("k[0]", "N m/rad", 17.0));
/// assert_eq!(params[3].group, ParamGroup::Inertial("tip".into()));
/// assert_eq!((params[10].group.clone(), params[10].bounds.0), (ParamGroup::Positive, 0.0));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ParamGroup {
    /// One of ten consecutive inertial parameters of the named body, in the order of
    /// [`INERTIAL_NAMES`]; the ten stay a positive definite pseudo-inertia. The kinetic energy
    /// must be linear in them with factors that depend on the coordinates alone, not on other parameters, and the
    /// other energies must not depend on them: sensitivities are the port equations at unit parameters.
    Inertial(String),
    /// Positive: masses, lengths, stiffness, damping.
    Positive,
    /// Any sign.
    Free,
}

/// One parameter of a model.
///
/// ```
/// use ff_model::{ParamDecl, ParamGroup};
///
/// let rest = ParamDecl { bounds: (-0.4, 0.4), group: ParamGroup::Free, ..ParamDecl::positive("rest[0]", "rad", 0.15) };
/// assert_eq!((rest.unit, rest.nominal, rest.bounds), ("rad", 0.15, (-0.4, 0.4)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ParamDecl {
    /// Name within its owner, such as `k[0]`.
    pub name: String,
    /// SI unit, such as `N m/rad`.
    pub unit: &'static str,
    /// Nominal value.
    pub nominal: f64,
    /// Lower and upper bound, inclusive.
    pub bounds: (f64, f64),
    /// What it is.
    pub group: ParamGroup,
}

impl ParamDecl {
    /// A positive parameter with bounds `(0, inf)`.
    pub fn positive(name: impl Into<String>, unit: &'static str, nominal: f64) -> Self {
        Self { name: name.into(), unit, nominal, bounds: (0.0, f64::INFINITY), group: ParamGroup::Positive }
    }
    /// The ten inertial parameters of a body, named `prefix.mass`, `prefix.h_x`, ...
    pub fn inertial(prefix: &str, nominal: &Inertia<f64>) -> Vec<Self> {
        let inf = f64::INFINITY;
        let phi = nominal.to_params();
        (0..10)
            .map(|i| Self {
                name: format!("{prefix}.{}", INERTIAL_NAMES[i]),
                unit: INERTIAL_UNITS[i],
                nominal: phi[i],
                bounds: (if matches!(i, 0 | 4 | 6 | 9) { 0.0 } else { -inf }, inf),
                group: ParamGroup::Inertial(prefix.to_owned()),
            })
            .collect()
    }
}

/// What an appendage declares of itself.
///
/// ```
/// use ff_model::{CoordDecl, Decl, ParamDecl};
///
/// let spring = ["k[0]", "k[1]"].map(|name| ParamDecl::positive(name, "N m/rad", 23.0));
/// let decl = Decl::new("mast", [CoordDecl::new("bend", "rad", (-0.2, 0.2))], spring);
/// assert_eq!((decl.coords.len(), decl.params[1].name.as_str(), decl.galilean), (1, "k[1]", true));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Decl {
    /// The `kind` of mission files.
    pub kind: &'static str,
    /// Generalised coordinates, at most [`MAX_COORDS`].
    pub coords: Vec<CoordDecl>,
    /// Parameters, in the order of the slice `p` passed to every method.
    pub params: Vec<ParamDecl>,
    /// Whether the equations of motion are the same for observers in uniform motion (Galilean invariance): with the
    /// acceleration `A + [w x v; 0]` of the mount in an inertial frame given, they do not depend on the velocity `v` of
    /// the host.
    ///
    /// True of every kinetic energy that is the kinetic energy of matter. An energy linearised by hand keeps the
    /// inertia of the undeformed shape while mass moves about, and may not be; it must say so
    /// ([`Decl::not_galilean`]), and `ff-dynamics` then differentiates with respect to `v`, too.
    pub galilean: bool,
}

impl Decl {
    /// The declaration of a Galilean-invariant appendage, as every true kinetic energy is. Allocates.
    pub fn new(
        kind: &'static str,
        coords: impl IntoIterator<Item = CoordDecl>,
        params: impl IntoIterator<Item = ParamDecl>,
    ) -> Self {
        let (coords, params) = (coords.into_iter().collect(), params.into_iter().collect());
        Self { kind, coords, params, galilean: true }
    }
    /// The same declaration for an inertia linearised by hand: see [`Decl::galilean`].
    #[must_use]
    pub fn not_galilean(mut self) -> Self {
        self.galilean = false;
        self
    }
}
