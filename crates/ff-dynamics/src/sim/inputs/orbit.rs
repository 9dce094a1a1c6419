//! The gradient of gravity on a circular orbit.

use super::{ExternalInput, InputError, Loads, Scene};
use ff_model::port::MAX_PARAMS;
use ff_model::port::{MAX_COORDS, port_len};
use ff_model::scalar::D1;
use ff_model::scalar::ModelScalar;
use ff_model::{Force, Inertia, Model, PortMatrix, Xform};
use nalgebra::Vector3;

/// Gravity gradient on a circular orbit, to first order in size over radius.
///
/// The world frame falls with a point on the orbit and keeps its orientation. A mass element at `x` then accelerates
/// relative to it by the linear field (P. Hughes, *Spacecraft Attitude Dynamics*, Wiley 1986, sec. 8.1)
///
/// ```text
/// G x,   G = k (3 o o^T - 1),   k = mu / r^3,   o(t) = cos(w t) o_0 + sin(w t) n x o_0,   w = sqrt(k)
/// ```
///
/// with `o` the direction from the centre of the Earth and `n` the normal of the orbit. A body with mass `m`, first moment
/// `h` and inertia `I` about its origin at `p` feels, in its own axes, with `g = R^T G p`,
///
/// ```text
/// f = m g + G h,     n = h x g + 3 k o x I o,
/// ```
///
/// exactly the integral over its mass elements. An appendage has the same with the `m`, `h(eta)`, `I(eta)` of its `M_bb`, and
/// the force on its coordinate `j` is the derivative of the same integral's force function,
///
/// ```text
/// Q_j = M_be[:3, j] . g + k/2 d(tr I - 3 o . I o)/d eta_j,
/// ```
///
/// exact as well for every appendage whose `M_bb` is that of its mass at `eta`. One linearised by hand with a constant
/// `M_bb` (a modal appendage) lacks the last term, as it lacks the displaced mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityGradient {
    k: f64,
    radial: Vector3<f64>,
    /// `n x o_0`: along the motion at time zero.
    along: Vector3<f64>,
}

impl GravityGradient {
    /// Gravitational parameter of the Earth (m^3/s^2), IERS Conventions 2010, table 1.1.
    pub const EARTH: f64 = 3.986_004_418e14;

    /// Around a body of gravitational parameter `mu` (m^3/s^2) at distance `radius` (m) from its centre, with the
    /// direction away from the centre at time zero and the normal of the orbit, in world axes, of any length.
    ///
    /// # Errors
    /// [`InputError`] for numbers that are not positive and finite, and directions that are not perpendicular to 1e-6.
    pub fn new(mu: f64, radius: f64, radial: Vector3<f64>, normal: Vector3<f64>) -> Result<Self, InputError> {
        InputError::positive("the gravitational parameter", mu, "m^3/s^2")?;
        InputError::positive("the radius of the orbit", radius, "m")?;
        InputError::positive("the length of the radial direction", radial.norm(), "")?;
        InputError::positive("the length of the orbit normal", normal.norm(), "")?;
        let (radial, normal) = (radial.normalize(), normal.normalize());
        let c = radial.dot(&normal);
        if c.abs() > 1e-6 {
            let what = "the cosine between radial direction and orbit normal";
            return Err(InputError::Value { what, value: c, unit: "", need: "zero to 1e-6" });
        }
        let k = mu / radius.powi(3);
        InputError::positive("the gradient mu / r^3", k, "1/s^2")?;
        let along = normal.cross(&radial).normalize();
        Ok(Self { k, radial, along })
    }
    /// Angular rate of the orbit (rad/s).
    pub fn rate(&self) -> f64 {
        self.k.sqrt()
    }
    /// The direction away from the centre of the Earth at time `t` (s), world axes.
    pub fn radial(&self, t: f64) -> Vector3<f64> {
        let (s, c) = (self.rate() * t).sin_cos();
        self.radial * c + self.along * s
    }
    /// Field at the origin of a frame and direction `o`, both in its axes.
    fn at(&self, o: &Vector3<f64>, frame: &Xform<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let g = (o * (3.0 * o.dot(&frame.pos)) - frame.pos) * self.k;
        (frame.rot.tr_mul(&g), frame.rot.tr_mul(o))
    }
    /// Wrench on a rigid body about its origin, in its axes.
    fn wrench(&self, i: &Inertia<f64>, g: &Vector3<f64>, o: &Vector3<f64>) -> Force<f64> {
        let f = g * i.mass + (o * (3.0 * o.dot(&i.h)) - i.h) * self.k;
        Force::new(f, i.h.cross(g) + o.cross(&(i.rot * o)) * (3.0 * self.k))
    }
}

impl ExternalInput for GravityGradient {
    fn act(&self, t: f64, scene: &Scene<'_>, on: &mut Loads) {
        let o = self.radial(t);
        for i in 0..scene.model.n_bodies() {
            let (g, o) = self.at(&o, scene.pose(i));
            on.add(i, self.wrench(scene.params.body(i), &g, &o));
        }
        let mut p = [D1::constant(0.0); MAX_PARAMS];
        let mut eta = [D1::constant(0.0); MAX_COORDS];
        let mut buffer = [D1::constant(0.0); port_len(MAX_COORDS)];
        for (k, ap) in scene.model.appendages().iter().enumerate() {
            let (g, o) = self.at(&o, &(*scene.pose(ap.host) * ap.mount));
            let values = scene.params.appendage(scene.model, k);
            let p = &mut p[..values.len()];
            p.iter_mut().zip(values).for_each(|(p, x)| *p = D1::constant(*x));
            let n = ap.dim();
            let eta = &mut eta[..n];
            let own = &scene.state.eta[ap.coord_offset..ap.coord_offset + n];
            // One pass per coordinate, each with its derivative; a rigid appendage needs the values alone.
            for j in 0..n.max(1) {
                for (i, (e, x)) in eta.iter_mut().zip(own).enumerate() {
                    *e = D1::new(*x, f64::from(i == j));
                }
                let mut m = PortMatrix::over(n, &mut buffer);
                D1::port(&*ap.appendage).inertia(p, eta, &mut m);
                let m = m.view();
                if j == 0 {
                    let hung = Inertia::from_elements(|a, b| m.get(a, b).re);
                    on.add(ap.host, ap.mount.force_to_parent(&self.wrench(&hung, &g, &o)));
                }
                if j < n {
                    let pull = Vector3::new(m.get(0, 6 + j).re, m.get(1, 6 + j).re, m.get(2, 6 + j).re);
                    let d = Inertia::from_elements(|a, b| m.get(a, b).eps[0]).rot;
                    let stretch = 0.5 * self.k * (d.trace() - 3.0 * o.dot(&(d * o)));
                    on.add_passive(ap.coord_offset + j, pull.dot(&g) + stretch);
                }
            }
        }
    }
    fn check(&self, _: &Model) -> Result<(), InputError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_model::spatial::so3::{exp_so3, quat_to_rot};

    /// Against the sum over the mass points of a body, each in the field.
    #[test]
    fn the_wrench_on_a_body_is_the_sum_over_its_mass() {
        let v = Vector3::new;
        let g = GravityGradient::new(0.8, 1.1, v(0.5, 0.4, -0.7), v(0.4, -0.5, 0.0)).unwrap();
        let pose = Xform::new(quat_to_rot(&exp_so3(&v(0.7, -1.2, 0.4))), v(0.8, -0.5, 1.7));
        let points = [(1.3, v(0.4, -0.2, 0.9)), (0.7, v(-0.8, 0.3, 0.5)), (2.1, v(0.1, 1.1, -0.6))];
        let o = g.radial(2.3);
        assert!((o.norm() - 1.0).abs() < 1e-15);
        let (mut body, mut want) = (Inertia::zero(), Force::zero());
        for (mass, r) in points {
            body += Inertia::point(mass, &r);
            let x = pose.point(&r);
            let f = pose.rot.tr_mul(&((o * (3.0 * o.dot(&x)) - x) * (g.k * mass)));
            want += Force::new(f, r.cross(&f));
        }
        let (field, local) = g.at(&o, &pose);
        let got = g.wrench(&body, &field, &local);
        assert!((got.to_vector() - want.to_vector()).norm() < 1e-13, "{got:?} {want:?}");
    }
}
