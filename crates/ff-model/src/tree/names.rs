//! Bodies, joints, appendages and parameters by name.

use crate::scalar::traits::Scalar;
use crate::tree::model::Model;
use crate::tree::parameters::Params;
use crate::tree::selection::{SelectionError, select};

impl Model {
    /// Index of the body called `name` (0 is the base, which also answers to `base`); `None` if there is none. Does not
    /// allocate.
    ///
    /// ```
    /// use ff_model::nalgebra::{Matrix3, Vector3};
    /// use ff_model::{BaseKind, Inertia, Model};
    ///
    /// let hull = Inertia::from_com(50.0, &Vector3::new(0.1, -0.2, 0.3), &Matrix3::identity());
    /// let model = Model::new("probe", "hull", hull, BaseKind::Floating);
    /// assert_eq!((model.body("hull"), model.body("base"), model.body("arm")), (Some(0), Some(0), None));
    /// ```
    pub fn body(&self, name: &str) -> Option<usize> {
        let link = (0..self.n_bodies()).find(|&i| self.body_name(i) == name);
        link.or_else(|| (name == "base").then_some(0))
    }
    /// Index of the joint called `name` in `q` and `tau`. Where no joint follows another, joint `i` carries body `i + 1`. `None` if there is
    /// none, or if it follows another joint. Does not allocate.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.own_bodies().position(|b| b.joint.name == name)
    }
    /// Index of the appendage called `name` in [`Model::appendages`]; `None` if there is none. Does not allocate.
    pub fn appendage(&self, name: &str) -> Option<usize> {
        self.appendages().iter().position(|a| a.name == name)
    }
    /// Indices in the parameter vector of the parameters that match `pattern`, ascending. `*` stands for any run of
    /// characters, as in mission files and on the command line ([`crate::tree::select`]). Allocates.
    ///
    /// ```
    /// use ff_model::nalgebra::{Matrix3, Vector3};
    /// use ff_model::{BaseKind, Inertia, Model};
    ///
    /// let hull = Inertia::from_com(50.0, &Vector3::new(0.1, -0.2, 0.3), &Matrix3::identity());
    /// let model = Model::new("probe", "hull", hull, BaseKind::Floating);
    /// assert_eq!(model.parameter_indices("base.h_*")?, [1, 2, 3]);
    /// let error = model.parameter_indices("base.mas").unwrap_err();
    /// assert_eq!(error.to_string(), "'base.mas' matches no parameter; the nearest name is 'base.mass'");
    /// # Ok::<(), ff_model::tree::SelectionError>(())
    /// ```
    ///
    /// # Errors
    /// [`SelectionError`] if the pattern matches nothing, with the nearest name.
    pub fn parameter_indices(&self, pattern: &str) -> Result<Vec<usize>, SelectionError> {
        select(&self.param_decls(), &[pattern])
    }
}

impl<T: Scalar> Params<T> {
    /// Value of the parameter called `name` (`base.mass`, `panel_left.k[0]`), SI units. `model` is the model that the values
    /// belong to. Allocates: a loop should keep the index from [`Model::parameter_indices`] and read [`Params::values`].
    ///
    /// # Errors
    /// [`SelectionError::NoMatch`], with the nearest name.
    ///
    /// # Panics
    /// If the values belong to another model.
    pub fn get(&self, model: &Model, name: &str) -> Result<T, SelectionError> {
        assert_eq!(self.values().len(), model.n_params(), "parameter vector length");
        let decls = model.param_decls();
        match decls.iter().position(|d| d.name == name) {
            Some(i) => Ok(self.values()[i]),
            None => Err(SelectionError::no_match(&decls, name)),
        }
    }
    /// Gives every parameter that matches `pattern` the value `value` (SI units), and returns how many they are. Bounds are not
    /// checked: [`Model::set_nominal`] does that. Allocates.
    ///
    /// ```
    /// use ff_model::nalgebra::{Matrix3, Vector3};
    /// use ff_model::{BaseKind, Inertia, Model, Params};
    ///
    /// let hull = Inertia::from_com(50.0, &Vector3::new(0.1, -0.2, 0.3), &Matrix3::identity());
    /// let model = Model::new("probe", "hull", hull, BaseKind::Floating);
    /// let mut params = Params::<f64>::nominal(&model);
    /// params.set_matching(&model, "base.mass", 47.5)?;
    /// assert_eq!(params.get(&model, "base.mass")?, 47.5);
    /// assert_eq!(params.set_matching(&model, "base.h_*", 0.0)?, 3);
    /// # Ok::<(), ff_model::tree::SelectionError>(())
    /// ```
    ///
    /// # Errors
    /// [`SelectionError`] if the pattern matches nothing, with the nearest name; nothing is changed.
    ///
    /// # Panics
    /// If the values belong to another model.
    pub fn set_matching(&mut self, model: &Model, pattern: &str, value: T) -> Result<usize, SelectionError> {
        assert_eq!(self.values().len(), model.n_params(), "parameter vector length");
        let matching = model.parameter_indices(pattern)?;
        let mut values = self.values().to_vec();
        matching.iter().for_each(|&i| values[i] = value);
        self.set(&values);
        Ok(matching.len())
    }
}
