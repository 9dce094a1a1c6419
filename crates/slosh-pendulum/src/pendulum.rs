//! The pendulum: declaration, energies, and the bias by hand for speed.

use crate::KIND;
use ff_model::appendage::CoordDecl;
use ff_model::keys::{check_damping, check_stiffness};
use ff_model::{
    Appendage, Area, Decl, Inertia, ParamDecl, PortMatrix, PortState, PortVector, Problem, Problems, Scalar, TwinBody,
    Xform,
};
use nalgebra::Vector3;

/// Greatest magnitude of each swing angle (rad).
///
/// `swing[0]` turns about a mount-fixed axis and has no singularity; its range is one turn. `swing[1]` has: at
/// `|swing[1]| = pi/2` the arm lies along the first axis, turning about that axis no longer moves the mass
/// (`M_aa = m l^2 cos^2 b` is zero) and the acceleration of `swing[0]` is undefined. At the limit of 1.4 rad
/// `cos^2 b` is still 0.029. The range ends before pi/2, so no simulation crosses it.
pub const SWING_LIMITS: [f64; 2] = [std::f64::consts::PI, 1.4];

const MASS: usize = 0;
const LENGTH: usize = 1;
const K: usize = 2;
const D: usize = 4;

/// A point mass on a massless universal joint with springs and dampers (see the crate docs).
///
/// Parameters, all positive: `mass` (kg), `length` (m), `k[0]`, `k[1]` (N m/rad), `d[0]`, `d[1]` (N m s/rad).
/// Coordinates `swing[0]`, `swing[1]` (rad), within [`SWING_LIMITS`].
///
/// Motion of the base alone does not determine all of them: in weightlessness and at small angles
/// `(l, k, d) -> (s l, s^2 k, s^2 d)` with the fulcrum moved so that the mass rests where it did leaves the wrench
/// on the host as it was. See [`crate::formulas::SpringMass`].
#[derive(Clone, Debug)]
pub struct SloshPendulum {
    decl: Decl,
}

impl SloshPendulum {
    /// A pendulum of mass `mass` (kg) and arm `length` (m), with springs `k` (N m/rad) and dampers `d`
    /// (N m s/rad) on the first and second swing angle. Allocates.
    ///
    /// # Errors
    /// Every problem, all of [`Area::Config`]: `Config::NotFinite`, `Config::Param` (mass or length not above
    /// zero), `Config::NotPassive` (negative stiffness or damping).
    pub fn new(mass: f64, length: f64, k: [f64; 2], d: [f64; 2]) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        check(mass, length, k, d, &mut problems);
        if problems.has_errors() {
            return Err(problems);
        }
        let mut params = vec![ParamDecl::positive("mass", "kg", mass), ParamDecl::positive("length", "m", length)];
        for i in 0..2 {
            params.push(ParamDecl::positive(format!("k[{i}]"), "N m/rad", k[i]));
        }
        for i in 0..2 {
            params.push(ParamDecl::positive(format!("d[{i}]"), "N m s/rad", d[i]));
        }
        let coords = (0..2)
            .map(|i| CoordDecl { name: format!("swing[{i}]"), unit: "rad", range: (-SWING_LIMITS[i], SWING_LIMITS[i]) })
            .collect();
        Ok(Self { decl: Decl { kind: KIND, coords, params } })
    }

    /// Nominal values `[mass, length, k_0, k_1, d_0, d_1]`. Does not allocate.
    pub fn nominal(&self) -> [f64; 6] {
        std::array::from_fn(|i| self.decl.params[i].nominal)
    }

    /// The pendulum as two ordinary tree links with external springs, at nominal parameters (see [`TwinBody`]).
    /// Allocates.
    pub fn twin_bodies(&self) -> Vec<TwinBody> {
        let [m, l, k0, k1, d0, d1] = self.nominal();
        let link = |parent, axis, inertia, stiffness, damping| TwinBody {
            parent,
            axis,
            placement: Xform::identity(),
            inertia,
            stiffness,
            damping,
            rest: 0.0,
        };
        vec![
            link(None, Vector3::x(), Inertia::zero(), k0, d0),
            link(Some(0), Vector3::y(), Inertia::point(m, &Vector3::new(0.0, 0.0, -l)), k1, d1),
        ]
    }
}

/// Adds everything that is wrong with the numbers to `problems`. Allocates on trouble only.
pub(crate) fn check(mass: f64, length: f64, k: [f64; 2], d: [f64; 2], problems: &mut Problems) {
    let mut bad = |code, key: String, message: String, hint: &str| {
        problems.push(Problem::error(Area::Config, code, message).on(key).hint(hint));
    };
    for (key, unit, x) in [("mass_kg", "kg", mass), ("length_m", "m", length)] {
        if !x.is_finite() {
            let why = format!("{x} {unit} is not a finite number");
            bad("Config::NotFinite", key.into(), why, "give a number above 0");
        } else if x <= 0.0 {
            let why = format!("{x} {unit} is not above the limit 0 {unit}");
            bad("Config::Param", key.into(), why, "leave the slosh table out where there is no sloshing fuel");
        }
    }
    for i in 0..2 {
        let springs = [
            check_stiffness(&format!("stiffness_nm_per_rad[{i}]"), k[i]),
            check_damping(&format!("damping_nms_per_rad[{i}]"), d[i]),
        ];
        springs.into_iter().flatten().for_each(|p| problems.push(p));
    }
}

/// Position of the mass and its partial derivatives, in units of the arm length, mount frame.
pub(crate) struct Arm<T: Scalar> {
    pub(crate) r: Vector3<T>,
    pub(crate) r_a: Vector3<T>,
    pub(crate) r_b: Vector3<T>,
    /// `d^2 r / da db`.
    pub(crate) r_ab: Vector3<T>,
    /// `d^2 r / da^2`.
    pub(crate) r_aa: Vector3<T>,
}

impl<T: Scalar> Arm<T> {
    #[inline(always)]
    pub(crate) fn new(eta: &[T]) -> Self {
        let (sa, ca) = eta[0].sin_cos();
        let (sb, cb) = eta[1].sin_cos();
        let o = T::zero();
        Self {
            r: Vector3::new(-sb, sa * cb, -(ca * cb)),
            r_a: Vector3::new(o, ca * cb, sa * cb),
            r_b: Vector3::new(-cb, -(sa * sb), ca * sb),
            r_ab: Vector3::new(o, -(ca * sb), -(sa * sb)),
            r_aa: Vector3::new(o, -(sa * cb), ca * cb),
        }
    }
}

#[inline(always)]
fn dot<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a.x * b.x + a.y * b.y + a.z * b.z
}

impl Appendage for SloshPendulum {
    fn decl(&self) -> &Decl {
        &self.decl
    }

    /// `M = m J^T J` with `J = [1, -[r]x, dr/da, dr/db]` the 3 x 8 Jacobian of the mass.
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let arm = Arm::new(eta);
        let l = p[LENGTH];
        let h = p[MASS] * l;
        let r = arm.r * l;
        m.add_host(&Inertia::point(p[MASS], &r));
        for (k, d) in [arm.r_a, arm.r_b].iter().enumerate() {
            let q = d * h;
            let n = r.cross(&q);
            for i in 0..3 {
                m.set_sym(i, 6 + k, q[i]);
                m.set_sym(3 + i, 6 + k, n[i]);
            }
        }
        // dr/da and dr/db are orthogonal, of length l cos b and l.
        let i_b = h * l;
        m.set_sym(6, 6, i_b * dot(&arm.r_a, &arm.r_a));
        m.set_sym(7, 7, i_b);
    }

    /// `U = (k_0 a^2 + k_1 b^2) / 2` (J).
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (p[K] * eta[0] * eta[0] + p[K + 1] * eta[1] * eta[1]).scale(0.5)
    }

    /// `R = (d_0 a'^2 + d_1 b'^2) / 2` (W).
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[D] * nu[0] * nu[0] + p[D + 1] * nu[1] * nu[1]).scale(0.5)
    }

    /// Newton's law for the mass at zero `A` and `nu'`:
    /// `f = m (w x (v + w x r + 2 r') + r_aa a'^2 + 2 r_ab a' b' + r_bb b'^2)`, where `r_bb = -r`; the wrench is
    /// `[f; r x f]`, the own rows `dr/da . f + k_0 a + d_0 a'` and likewise for `b`.
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        let arm = Arm::new(s.eta);
        let (a1, b1) = (s.nu[0], s.nu[1]);
        let l = p[LENGTH];
        let r = arm.r * l;
        let rate = (arm.r_a * a1 + arm.r_b * b1) * l;
        let own = (arm.r_aa * (a1 * a1) + arm.r_ab * (a1 * b1).scale(2.0) - arm.r * (b1 * b1)) * l;
        let w = &s.host.ang;
        let carried = s.host.lin + w.cross(&r) + rate.map(|x| x.scale(2.0));
        let f = (w.cross(&carried) + own) * p[MASS];
        let n = r.cross(&f);
        for i in 0..3 {
            h[i] = f[i];
            h[3 + i] = n[i];
        }
        h[6] = l * dot(&arm.r_a, &f) + p[K] * s.eta[0] + p[D] * a1;
        h[7] = l * dot(&arm.r_b, &f) + p[K + 1] * s.eta[1] + p[D + 1] * b1;
    }
    fn twin(&self) -> Option<Vec<TwinBody>> {
        Some(self.twin_bodies())
    }
}
