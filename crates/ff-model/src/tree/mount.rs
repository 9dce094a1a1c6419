//! Mounting appendages on the bodies of a model, one by one and as a set.

use super::model::{Model, Mounted};
use crate::diagnostics::problem::{Area, Limit, Problem, Problems};
use crate::port::declaration::{Decl, MAX_COORDS, MAX_PARAMS};
use crate::port::set::{AppendageSet, Place};
use crate::port::shared::SharedAppendage;
use crate::spatial::motion::Xform;

impl Model {
    /// Mounts an appendage: a kind (see [`derived!`](crate::derived)), [`Derived`](crate::port::Derived) of one, or a handle that
    /// a registry built. Allocates.
    ///
    /// # Errors
    /// [`Problems`] (area `Config`) if the name is taken, a nominal value lies outside its bounds, or the
    /// declaration has too many coordinates.
    ///
    /// # Panics
    /// If the host body does not exist.
    pub fn mount(
        &mut self,
        name: impl Into<String>,
        host: usize,
        mount: Xform<f64>,
        appendage: impl Into<SharedAppendage>,
    ) -> Result<(), Problems> {
        assert!(host < self.n_bodies(), "host body {host} does not exist");
        let (name, appendage) = (name.into(), appendage.into());
        let bad = self.refusals(&name, appendage.declaration());
        if bad.has_errors() {
            return Err(bad);
        }
        self.push(Place { name, host, mount }, appendage);
        Ok(())
    }
    /// Mounts a set of appendages, the `i`-th at the `i`-th place: a tuple of them, or boxed ones. All or none. Allocates.
    ///
    /// ```
    /// use ff_model::payload::Payload;
    /// use ff_model::{BaseKind, DynAppendage, Inertia, Model, Xform};
    /// use ff_model::port::Place;
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let block = |mass| Inertia::from_com(mass, &Vector3::new(0.1, -0.2, 0.3), &Matrix3::identity());
    /// let place = |name, x| Place::new(name, 0, Xform::new(Matrix3::identity(), Vector3::new(x, 0.4, -0.7)));
    /// let places = [place("left", 0.9), place("right", -1.1)];
    ///
    /// let mut typed = Model::new("typed", "hull", block(50.0), BaseKind::Floating);
    /// typed.mount_set(&places, (Payload::new(&block(3.0))?, Payload::new(&block(4.0))?))?;
    ///
    /// let mut boxed = Model::new("boxed", "hull", block(50.0), BaseKind::Floating);
    /// let set: Vec<Box<dyn DynAppendage>> = vec![Box::new(Payload::new(&block(3.0))?), Box::new(Payload::new(&block(4.0))?)];
    /// boxed.mount_set(&places, set)?;
    ///
    /// assert_eq!(typed.param_decls(), boxed.param_decls());
    /// assert_eq!(typed.total_mass(), 57.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Problems`] (area `Config`), everything at once, and nothing is mounted: those of [`Model::mount`] for each
    /// appendage, `Config::UnknownLink` for a host that does not exist, `Config::WrongLength` for a number of places that
    /// is not that of the appendages.
    pub fn mount_set(&mut self, places: &[Place], set: impl AppendageSet) -> Result<(), Problems> {
        let set = set.into_shared();
        let mut bad = Problems::default();
        if set.len() != places.len() {
            let what = format!("{} places for {} appendages", places.len(), set.len());
            bad.push(Problem::error(Area::Config, "Config::WrongLength", what).hint("give each appendage one place"));
        }
        let before = (self.appendages.len(), self.passive, self.params);
        for (place, appendage) in places.iter().zip(set) {
            bad.0.extend(self.refusals(&place.name, appendage.declaration()).0);
            if place.host >= self.n_bodies() {
                let what = format!("body {} does not exist, the last is {}", place.host, self.n_bodies() - 1);
                let p = Problem::error(Area::Config, "Config::UnknownLink", what).on(&place.name);
                bad.push(p.hint("add the body before its appendages, or name another"));
            }
            // Even where it is refused: a name that comes twice in the set is said together with the rest.
            self.push(place.clone(), appendage);
        }
        if bad.has_errors() {
            self.appendages.truncate(before.0);
            (self.passive, self.params) = (before.1, before.2);
            return Err(bad);
        }
        Ok(())
    }
    /// Adds an appendage without asking.
    fn push(&mut self, place: Place, appendage: SharedAppendage) {
        let (coord_offset, param_offset) = (self.passive, self.params);
        let decl = appendage.declaration();
        let dim = decl.coords.len();
        self.passive += dim;
        self.params += decl.params.len();
        let Place { name, host, mount } = place;
        let nominal = decl.params.iter().map(|p| p.nominal).collect();
        self.appendages.push(Mounted { name, host, mount, appendage, coord_offset, param_offset, nominal, dim });
    }
    /// Why an appendage cannot be mounted under this name.
    fn refusals(&self, name: &str, decl: &Decl) -> Problems {
        let mut bad = Problems::default();
        if self.appendages.iter().any(|a| a.name == name) {
            bad.push(
                Problem::error(Area::Config, "Config::DuplicateName", format!("two appendages are called '{name}'"))
                    .on(name)
                    .hint("rename one of them"),
            );
        }
        if decl.coords.len() > MAX_COORDS {
            let what = format!("{} coordinates, limit {}", decl.coords.len(), MAX_COORDS);
            let limit = Limit::AtMost(MAX_COORDS as f64);
            let p = Problem::error(Area::Config, "Config::TooManyCoordinates", what);
            bad.push(p.violating(decl.coords.len() as f64, limit, "coordinates"));
        }
        if decl.params.len() > MAX_PARAMS {
            let what = format!("{} parameters, limit {}", decl.params.len(), MAX_PARAMS);
            let limit = Limit::AtMost(MAX_PARAMS as f64);
            let p = Problem::error(Area::Config, "Config::TooManyParameters", what);
            bad.push(p.violating(decl.params.len() as f64, limit, "parameters"));
        }
        for p in &decl.params {
            let (lo, hi) = p.bounds;
            if !p.nominal.is_finite() || p.nominal < lo || p.nominal > hi || lo > hi {
                bad.push(
                    Problem::error(
                        Area::Config,
                        "Config::Param",
                        format!("value {} {} outside its bounds {lo} .. {hi}", p.nominal, p.unit),
                    )
                    .violating(p.nominal, Limit::Within(lo, hi), p.unit)
                    .on(format!("{name}.{}", p.name))
                    .hint("give a value inside the bounds"),
                );
            }
        }
        bad
    }
}
