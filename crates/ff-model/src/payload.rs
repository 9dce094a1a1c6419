//! A rigid body held by another: a grasped client, a payload, as ten parameters of its own.
//!
//! Without coordinates: `M = M_bb`, the ten parameters about the mount, and `h = V x* (M V)`. Unlike mass added to a link
//! ([`crate::tree::model::Model::add_rigid`]) its parameters can be estimated beside those of the link. Both belong to one body, so no
//! data can tell them apart: estimate the one or the other.

use crate::diagnostics::problem::Problems;
use crate::keys;
use crate::port::declaration::{Decl, ParamDecl};
use crate::port::dynamics::PortDynamics;
use crate::port::energies::Appendage;
use crate::port::matrix::PortMatrix;
use crate::port::shared::SharedAppendage;
use crate::port::state::{PortAccel, PortState, PortVector};
use crate::registry::Registry;
use crate::scalar::traits::{PlainScalar, Scalar};
use crate::spatial::inertia::{Inertia, InertiaError};
use crate::spatial::vec3::{Moving, PackedInertia, V3};
use nalgebra::Vector3;

/// The `kind` of mission files for this appendage.
pub const KIND: &str = "payload";

/// Adds this appendage to a registry under [`KIND`]. Allocates.
pub fn register(registry: &mut Registry) {
    registry.register(KIND, from_toml).example(KIND, EXAMPLE);
}

/// A client as its table stands in a mission file.
const EXAMPLE: &str = "
mass_kg = 180.0
com_m = [0.02, 0.5, -0.03]
inertia_com_kgm2 = [40.0, 1.0, -0.5, 35.0, 0.7, 38.0]";

/// A rigid body fixed to its host. Parameters `body.mass` ... `body.i_zz`, about the mount; no coordinates.
#[derive(Clone, Debug)]
pub struct Payload {
    decl: Decl,
}

impl Payload {
    /// From the ten inertial parameters about the mount. Allocates.
    ///
    /// # Errors
    /// The law that they break.
    pub fn new(body: &Inertia<f64>) -> Result<Self, InertiaError> {
        body.check()?;
        Ok(Self { decl: Decl::new(KIND, [], ParamDecl::inertial("body", body)) })
    }
}

/// Builds a [`Payload`] from its table in a mission file (a [`crate::registry::Factory`]). Allocates.
///
/// Keys: `mass_kg`, `com_m = [x, y, z]`, `inertia_com_kgm2 = [xx, xy, xz, yy, yz, zz]` (mount frame).
///
/// # Errors
/// Every problem of the table: those of [`keys::read`], and `Config::Inertia` for numbers that no body has.
pub fn from_toml(table: &toml::Table) -> Result<SharedAppendage, Problems> {
    let payload = keys::read(table, |t| {
        let (mass, com, i_com) = (t.number("mass_kg"), t.numbers("com_m"), t.symmetric("inertia_com_kgm2"));
        let body = Inertia::from_com(mass?, &Vector3::from(com?), &i_com?);
        match Payload::new(&body) {
            Ok(p) => Some(p),
            Err(e) => {
                let key =
                    if matches!(e, InertiaError::NonPositiveMass { .. }) { "mass_kg" } else { "inertia_com_kgm2" };
                let p = keys::error("Config::Inertia", e.to_string()).on(key);
                t.problems().push(p.hint("give a mass above 0 kg and the inertia about the centre of mass"));
                None
            }
        }
    })?;
    Ok(payload.into())
}

crate::shared!(Payload);

impl Appendage for Payload {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], _eta: &[T], m: &mut PortMatrix<'_, T>) {
        m.set_host(&PackedInertia::from_params(p));
    }
}

impl PortDynamics for Payload {
    const WRITES_ALL: bool = true;
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        press(&PackedInertia::from_params(p), &s.moving(None), h);
    }
    /// Newton's and Euler's equations of one body.
    #[inline(always)]
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        _: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        press(&PackedInertia::from_params(p), &s.moving(Some(acc)), r);
    }
    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, _: &PortAccel<'_, T>, j: &mut [T]) {
        let columns = PackedInertia::from_params(p).wrench_by_spin(&V3::from(&s.host.ang), &V3::from(&s.host.lin));
        write(&columns, j);
    }
    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, _: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        write(&s.moving(Some(acc)).columns(), y);
    }
}

#[inline(always)]
fn press<T: Scalar>(body: &PackedInertia<T>, m: &Moving<T>, r: &mut [T]) {
    let (f, n) = body.wrench(&m.w, &m.al, &m.a, &m.field);
    f.write_to(r);
    n.write_to(&mut r[3..]);
}

#[inline(always)]
fn write<T: Scalar>(columns: &[(V3<T>, V3<T>)], to: &mut [T]) {
    for ((f, n), to) in columns.iter().zip(to.chunks_exact_mut(6)) {
        f.write_to(to);
        n.write_to(&mut to[3..]);
    }
}
