//! Other nominal values for a model that is complete: those of an identification.

use super::model::Model;
use crate::diagnostics::problem::{Area, Problem, Problems};
use crate::spatial::inertia::{Inertia, InertiaError};

impl Model {
    /// Gives parameters other nominal values, each taken as it is to the last bit. Pairs of index and value; the indices
    /// are those of the parameter vector. All or none. Allocates.
    ///
    /// ```
    /// use ff_model::{BaseKind, Inertia, Model};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let hull = Inertia::from_com(50.0, &Vector3::new(0.1, -0.2, 0.3), &Matrix3::identity());
    /// let mut model = Model::new("probe", "hull", hull, BaseKind::Floating);
    /// model.set_nominal(&[(0, 50.3)])?;
    /// assert_eq!(model.param_decls()[0].nominal, 50.3);
    /// assert_eq!(model.total_mass(), 50.3);
    /// assert!(model.set_nominal(&[(0, -50.3)]).is_err());
    /// # Ok::<(), ff_model::Problems>(())
    /// ```
    ///
    /// What it returns are warnings, `Config::Triangle`: a body whose moments are positive and break the triangle inequality moves as its ten numbers
    /// say, as one from a URDF does, and no fit can begin at it.
    ///
    /// # Errors
    /// [`Problems`] (area `Config`), the object being the name of the parameter or body: `Config::NotFinite`,
    /// `Config::Param` for a value outside its bounds, `Config::Inertia` for a body that cannot exist.
    ///
    /// # Panics
    /// If an index is not below [`Model::n_params`].
    pub fn set_nominal(&mut self, values: &[(usize, f64)]) -> Result<Problems, Problems> {
        let decls = self.param_decls();
        let mut bad = Problems::default();
        let mut fail = |code, what: String, on: &str, hint: &str| {
            bad.push(Problem::error(Area::Config, code, what).on(on).hint(hint));
        };
        let mut all: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
        let mut touched = vec![false; self.n_bodies()];
        for &(i, x) in values {
            let d = &decls[i];
            let (lo, hi) = d.bounds;
            if !x.is_finite() {
                fail("Config::NotFinite", format!("{x} is not a finite number"), &d.name, "give a finite number");
            } else if x < lo || x > hi {
                let what = format!("value {x} {} outside its bounds {lo} .. {hi}", d.unit);
                fail("Config::Param", what, &d.name, "give a value inside the bounds");
            }
            all[i] = x;
            if let Some(t) = touched.get_mut(i / 10) {
                *t = true;
            }
        }
        for i in (0..self.n_bodies()).filter(|&i| touched[i]) {
            let body = Inertia::from_params(&all[10 * i..10 * i + 10]);
            let on = if i == 0 { "base" } else { self.body_name(i) };
            let hint = "give all ten parameters of the body as they were estimated";
            match body.check() {
                Ok(()) => {}
                Err(e @ InertiaError::Triangle { .. }) => {
                    let p = Problem::warning(Area::Config, "Config::Triangle", format!("{e}; taken as given"));
                    bad.push(p.on(on).hint(hint));
                }
                Err(e) => bad.push(Problem::error(Area::Config, "Config::Inertia", e.to_string()).on(on).hint(hint)),
            }
        }
        if bad.has_errors() {
            return Err(bad);
        }
        for i in (0..self.n_bodies()).filter(|&i| touched[i]) {
            let body = Inertia::from_params(&all[10 * i..10 * i + 10]);
            match i.checked_sub(1) {
                None => self.base_inertia = body,
                Some(k) => self.bodies[k].inertia = body,
            }
        }
        for a in &mut self.appendages {
            let n = a.nominal.len();
            a.nominal.copy_from_slice(&all[a.param_offset..a.param_offset + n]);
        }
        Ok(bad)
    }
}
