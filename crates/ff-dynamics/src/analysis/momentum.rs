//! Momentum and energy.

use crate::state::State;
use crate::tree::crba::port_momentum;
use crate::work::buffers::Work;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::so3::quat_to_rot;
use ff_model::{Force, Model, Params, Xform};
use nalgebra::Vector3;

/// Momentum and energy of a system at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget<T: ModelScalar> {
    /// Linear momentum and angular momentum about the world origin, world axes (kg m/s, kg m^2/s).
    pub momentum: Force<T>,
    /// Angular momentum about the centre of mass, world axes (kg m^2/s).
    pub angular_com: Vector3<T>,
    /// Centre of mass of everything, appendages included, in the world (m).
    pub com: Vector3<T>,
    /// Total mass (kg).
    pub mass: T,
    /// Kinetic energy (J).
    pub kinetic: T,
    /// Potential energy of springs, plus gravity `-m g . com` (J).
    pub potential: T,
    /// Power dissipated by dampers, `nu . dR/d nu` (W).
    pub dissipation: T,
}

impl<T: ModelScalar> Budget<T> {
    /// Kinetic plus potential energy (J).
    pub fn energy(&self) -> T {
        self.kinetic + self.potential
    }
}

/// Momentum, energy and dissipated power. Does not allocate.
///
/// Momentum is `sum_i X_i^* I_i V_i` over bodies, plus `M_bb V + M_be nu` at every port, carried to the world.
/// For a fixed base it is the momentum of the moving parts.
pub fn budget<T: ModelScalar>(model: &Model, params: &Params<T>, state: &State<T>, work: &mut Work<T>) -> Budget<T> {
    work.place(model, &state.q);
    work.twists(model, state);
    work.port_inertias(model, params, &state.eta);
    let nu = state.nu();
    let (mut kinetic, mut potential, mut dissipation) = (T::zero(), T::zero(), T::zero());
    for i in 0..model.n_bodies() {
        work.ic[i] = *params.body(i);
        work.f[i] = work.ic[i].mul_motion(&work.v[i]);
        kinetic += work.v[i].dot(&work.f[i]);
    }
    for (k, ap) in model.appendages().iter().enumerate() {
        let p = &work.ports[k];
        let r = ap.coord_offset..ap.coord_offset + ap.dim();
        let (eta, nu) = (&state.eta[r.clone()], &nu[r]);
        let w = port_momentum(p, &p.v, nu);
        kinetic += p.v.dot(&w);
        for i in 0..nu.len() {
            let mut row = p.v.dot(&p.coupling(i));
            for j in 0..nu.len() {
                row += p.mass().own(i, j) * nu[j];
            }
            kinetic += nu[i] * row;
        }
        let port = T::port(&*ap.appendage);
        potential += port.potential(params.appendage(model, k), eta);
        dissipation += port.dissipated_power(params.appendage(model, k), nu);
        let up = p.mount.force_to_parent(&w);
        work.f[ap.host] += up;
        let hung = crate::tree::crba::host_block(p).to_parent(&p.mount);
        work.ic[ap.host] += hung;
    }
    for i in (1..model.n_bodies()).rev() {
        let parent = model.bodies()[i - 1].parent;
        let up = work.x[i].force_to_parent(&work.f[i]);
        work.f[parent] += up;
        let c = work.ic[i].to_parent(&work.x[i]);
        work.ic[parent] += c;
    }
    let world = Xform::new(quat_to_rot(&state.att), state.pos);
    let momentum = world.force_to_parent(&work.f[0]);
    let total = work.ic[0].to_parent(&world);
    let com = total.h / total.mass;
    let g = model.gravity().map(T::from_f64);
    Budget {
        momentum,
        angular_com: momentum.ang - com.cross(&momentum.lin),
        com,
        mass: total.mass,
        kinetic: kinetic.scale(0.5),
        potential: potential - (g.x * total.h.x + g.y * total.h.y + g.z * total.h.z),
        dissipation,
    }
}
