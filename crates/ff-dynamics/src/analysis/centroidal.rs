//! The centroidal momentum matrix and its rate.
//!
//! ```text
//! h_G = A_G(q) v,        h_G' = A_G v' + A_G' v = [f; n_G] of everything that acts from outside
//! ```
//!
//! with `h_G = [linear momentum; angular momentum about the centre of mass]` in world axes and `v` the generalised
//! velocity `[base 6 | joints n | passive m]` (D. E. Orin, A. Goswami, S.-H. Lee, *Centroidal dynamics of a humanoid
//! robot*, Auton. Robots 35, 2013, eqs. (1), (2)). A system that floats freely keeps `h_G`: the columns say how
//! moving a joint or a panel turns the base.
//!
//! The first six rows of the mass matrix are the momentum about the base origin per unit velocity, in base axes;
//! moved to the centre of mass `c` and turned into world axes they are
//!
//! ```text
//! A_G = [ R H_lin ; R (H_ang - [c]x H_lin) ].
//! ```

use crate::state::State;
use crate::tree::crba::mass_matrix;
use crate::work::buffers::Work;
use ff_model::scalar::{D1, ModelScalar};
use ff_model::spatial::small::{cross, mv};
use ff_model::spatial::so3::{quat_mul, quat_to_rot};
use ff_model::{BaseKind, Model, Params};
use nalgebra::{DMatrix, Vector3, Vector4};

/// `A_G` of one model at one state, with its buffers. Allocates in [`Centroidal::new`] only.
#[derive(Clone, Debug)]
pub struct Centroidal<T: ModelScalar> {
    /// The model with a free base: a fixed base has no rows in the mass matrix, its arm has momentum all the same.
    floating: Model,
    /// Columns of the base that a fixed base lacks.
    skip: usize,
    work: Work<T>,
    state: State<T>,
    h: DMatrix<T>,
    matrix: DMatrix<T>,
    com: Vector3<T>,
    mass: T,
}

impl<T: ModelScalar> Centroidal<T> {
    /// Buffers for `model`. Allocates.
    pub fn new(model: &Model) -> Self {
        let floating = model.clone().with_base_kind(BaseKind::Floating);
        let (nv, z) = (floating.nv(), T::zero());
        Self {
            skip: nv - model.nv(),
            work: Work::new(&floating),
            state: State::zero(&floating),
            h: DMatrix::from_element(nv, nv, z),
            matrix: DMatrix::from_element(6, model.nv(), z),
            com: Vector3::zeros(),
            mass: z,
            floating,
        }
    }

    /// Computes everything at `state`; velocities play no part. Does not allocate. Cost of the mass matrix.
    ///
    /// # Panics
    /// If `state` belongs to another model.
    pub fn evaluate(&mut self, params: &Params<T>, state: &State<T>) {
        self.state.q.copy_from_slice(&state.q);
        self.state.eta.copy_from_slice(&state.eta);
        mass_matrix(&self.floating, params, &self.state, &mut self.work, &mut self.h);
        let h = &self.h;
        self.mass = h[(0, 0)];
        // The upper right block of a composite inertia is -[m c]x.
        let c = Vector3::new(h[(1, 5)], h[(2, 3)], h[(0, 4)]) / self.mass;
        let r = quat_to_rot(&state.att);
        self.com = state.pos + mv(&r, &c);
        for j in 0..self.matrix.ncols() {
            let from = j + self.skip;
            let lin = Vector3::new(h[(0, from)], h[(1, from)], h[(2, from)]);
            let ang = Vector3::new(h[(3, from)], h[(4, from)], h[(5, from)]) - cross(&c, &lin);
            let (lin, ang) = (mv(&r, &lin), mv(&r, &ang));
            for i in 0..3 {
                self.matrix[(i, j)] = lin[i];
                self.matrix[(3 + i, j)] = ang[i];
            }
        }
    }

    /// `A_G`, `6 x nv`: linear momentum, then angular momentum about the centre of mass, world axes (kg, kg m).
    pub fn matrix(&self) -> &DMatrix<T> {
        &self.matrix
    }
    /// Centre of mass of everything, appendages included, in the world (m).
    pub fn com(&self) -> &Vector3<T> {
        &self.com
    }
    /// Total mass (kg).
    pub fn mass(&self) -> T {
        self.mass
    }
    /// `h_G = A_G v`: linear (kg m/s) and angular (kg m^2/s) momentum, world axes.
    ///
    /// # Panics
    /// If `v` is not `nv` long.
    pub fn momentum(&self, v: &[T]) -> [T; 6] {
        times(&self.matrix, v)
    }
}

/// `A_G` and its rate `A_G'` along the motion, exact by a dual number in time. Allocates in [`CentroidalRate::new`]
/// only.
#[derive(Clone, Debug)]
pub struct CentroidalRate {
    dual: Centroidal<D1>,
    params: Params<D1>,
    values: Vec<D1>,
    state: State<D1>,
    matrix: DMatrix<f64>,
    rate: DMatrix<f64>,
}

impl CentroidalRate {
    /// Buffers for `model`. Allocates.
    pub fn new(model: &Model) -> Self {
        let params = Params::<D1>::nominal(model);
        Self {
            dual: Centroidal::new(model),
            values: params.values().to_vec(),
            params,
            state: State::zero(model),
            matrix: DMatrix::zeros(6, model.nv()),
            rate: DMatrix::zeros(6, model.nv()),
        }
    }

    /// Computes `A_G` and `A_G'` at `state`, along its velocity: `q' = qd`, `eta' = nu`, and
    /// `att' = att [0, w] / 2` for the base rate `w` in base axes. Does not allocate.
    ///
    /// # Panics
    /// If `state` or `params` belong to another model.
    pub fn evaluate(&mut self, params: &Params<f64>, state: &State<f64>) {
        self.values.iter_mut().zip(params.values()).for_each(|(d, &x)| *d = D1::constant(x));
        self.params.set(&self.values);
        let twist = state.base_twist();
        let w = Vector4::new(0.0, twist.ang.x, twist.ang.y, twist.ang.z);
        let datt = quat_mul(&state.att, &w) * 0.5;
        let dpos = quat_to_rot(&state.att) * twist.lin;
        let s = &mut self.state;
        (0..3).for_each(|i| s.pos[i] = D1::new(state.pos[i], dpos[i]));
        (0..4).for_each(|i| s.att[i] = D1::new(state.att[i], datt[i]));
        let along = |to: &mut [D1], x: &[f64], dx: &[f64]| {
            to.iter_mut().zip(x.iter().zip(dx)).for_each(|(d, (&x, &dx))| *d = D1::new(x, dx));
        };
        along(&mut s.q, &state.q, state.qd());
        along(&mut s.eta, &state.eta, state.nu());
        self.dual.evaluate(&self.params, &self.state);
        for (k, d) in self.dual.matrix().iter().enumerate() {
            (self.matrix[k], self.rate[k]) = (d.re, d.eps[0]);
        }
    }

    /// `A_G`, as [`Centroidal::matrix`].
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }
    /// `A_G'`, `6 x nv` (kg/s, kg m/s).
    pub fn rate(&self) -> &DMatrix<f64> {
        &self.rate
    }
    /// `A_G' v`: what the momentum gains at zero acceleration; N and N m, world axes.
    ///
    /// # Panics
    /// If `v` is not `nv` long.
    pub fn bias(&self, v: &[f64]) -> [f64; 6] {
        times(&self.rate, v)
    }
}

fn times<T: ModelScalar>(a: &DMatrix<T>, v: &[T]) -> [T; 6] {
    assert_eq!(a.ncols(), v.len(), "velocity length");
    let mut h = [T::zero(); 6];
    for (j, &x) in v.iter().enumerate() {
        h.iter_mut().enumerate().for_each(|(i, h)| *h += a[(i, j)] * x);
    }
    h
}
