//! Stand-ins for the appendage crates: the readers are tested without their physics.
// Every test file is its own crate and uses a part of this; helpers may unwrap like the tests they serve.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use ff_model::port::Derived;
use ff_model::{
    Appendage, Area, CoordDecl, Decl, DynAppendage, Inertia, ParamDecl, PortMatrix, Problem, Problems, Registry, Scalar,
};
use nalgebra::Vector3;
use std::sync::Arc;

/// Unit point masses on springs: the names and counts of the real kinds without their physics.
struct StandIn {
    decl: Decl,
}

impl Appendage for StandIn {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    fn inertia<T: Scalar>(&self, _p: &[T], _eta: &[T], m: &mut PortMatrix<'_, T>) {
        m.add_host(&Inertia::point(T::one(), &Vector3::zeros()));
        for i in 6..m.dim() {
            m.set_sym(i, i, T::one());
        }
    }
}

fn stand_in(kind: &'static str, coord: &str, k: &[f64], d: &[f64]) -> Arc<dyn DynAppendage> {
    let coords = (0..k.len()).map(|i| CoordDecl::new(format!("{coord}[{i}]"), "rad", (-1.5, 1.5)));
    let params = (k.iter().enumerate().map(|(i, &k)| ParamDecl::positive(format!("k[{i}]"), "N m/rad", k)))
        .chain(d.iter().enumerate().map(|(i, &d)| ParamDecl::positive(format!("d[{i}]"), "N m s/rad", d)));
    Derived::new(StandIn { decl: Decl::new(kind, coords, params) }).into()
}

fn number(t: &toml::Table, key: &str, path: &str) -> Result<f64, Problems> {
    t.get(key).and_then(|v| v.as_float().or_else(|| v.as_integer().map(|i| i as f64))).ok_or_else(|| {
        Problems(vec![
            Problem::error(Area::Config, "Config::MissingKey", format!("required key '{key}' is missing")).on(path),
        ])
    })
}

fn panel(t: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let (mut k, mut d, mut bad) = (Vec::new(), Vec::new(), Problems::default());
    let segments = t.get("segments").and_then(toml::Value::as_array).cloned().unwrap_or_default();
    for (i, s) in segments.iter().enumerate() {
        let s = s.as_table().unwrap();
        for (key, out) in [("stiffness_nm_per_rad", &mut k), ("damping_nms_per_rad", &mut d)] {
            let path = format!("segments[{i}].{key}");
            match number(s, key, &path) {
                Ok(x) if x < 0.0 => bad.push(
                    Problem::error(Area::Config, "Config::NotPassive", format!("value {x}, limit >= 0"))
                        .on(path)
                        .hint("springs and dampers resist"),
                ),
                Ok(x) => out.push(x),
                Err(p) => bad.extend(p),
            }
        }
    }
    if bad.has_errors() { Err(bad) } else { Ok(stand_in("flex_panel", "hinge", &k, &d)) }
}

fn pendulum(t: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let get = |key: &str| -> Vec<f64> {
        t.get(key).and_then(toml::Value::as_array).into_iter().flatten().filter_map(toml::Value::as_float).collect()
    };
    Ok(stand_in("slosh_pendulum", "angle", &get("stiffness_nm_per_rad"), &get("damping_nms_per_rad")))
}

/// The two kinds of the paper, as stand-ins.
pub fn registry() -> Registry {
    let mut r = Registry::new();
    r.register("flex_panel", panel).register("slosh_pendulum", pendulum);
    r
}
