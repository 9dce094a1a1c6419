//! Modes of the model as the sensors see them, and how they depend on the parameters.
//!
//! With joints held, small motion of the passive coordinates obeys `M b'' + D b' + K b = 0` with
//! `M = N^T H N`, `N = [-H_b^-1 H_bp; 0; 1]` when the base floats and `N = [0; 0; 1]` when it is held
//! (`docs/theory/modal-identification.md`). A pole `l` and its shape `phi` solve
//!
//! ```text
//! (l^2 M + l D + K) phi = 0,        tau = H_m. N l^2 phi,      omega_base = (N)_w l phi
//! dl/dp = - phi^T (l^2 dM + l dD + dK) phi / phi^T (2 l M + D) phi,      phi^T dM phi = (N phi)^T dH (N phi)
//! ```
//!
//! M, D, K are symmetric, so the left eigenvector is the right one, transposed (P. Lancaster, *Lambda-matrices and
//! vibrating systems*, 1966, section 7). `N` minimises the energy, so its own change drops out of `dM`. Derivatives of H, D
//! and K are exact, by forward duals.

use core::f64::consts::TAU;
use ff_dynamics::Boundary;
use ff_dynamics::analysis::stiffness_damping;
use ff_dynamics::{State, Work, mass_matrix};
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::scalar::{D1, D2, ModelScalar};
use ff_model::{Model, Motion, Params, PortState};
use nalgebra::{Complex, DMatrix, DVector};

/// Relative distance of poles below which they count as one of higher multiplicity.
const REPEATED: f64 = 1e-7;

/// Why there are no modes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModalModelError {
    /// The mass matrix is not positive definite.
    #[error("mass matrix is not positive definite at this pose; check masses and inertias")]
    Singular,
    /// Pose of the wrong length.
    #[error("{what} has {got} values, the model needs {want}")]
    Length {
        /// Which argument.
        what: &'static str,
        /// Length met.
        got: usize,
        /// Length needed.
        want: usize,
    },
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

impl ModalModelError {
    /// Process exit code of `bad-inputs.md`: 11 (configuration) for a wrong length, else 14 (numerical).
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Length { .. }) { 11 } else { 14 }
    }
}

/// Where the joints are held, and what else is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldPose<'a> {
    /// Joint positions (rad or m).
    pub q: &'a [f64],
    /// Passive coordinates about which the motion is small: their rest, in zero gravity.
    pub eta: &'a [f64],
    /// Base held (cantilever modes), base free, or joints free as well.
    pub boundary: Boundary,
}

/// One mode of the model, scaled to a peak kinetic energy of 1 J: `|l|^2 phi^H M phi = 2`.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelMode {
    /// Pole with positive imaginary part (1/s).
    pub pole: Complex<f64>,
    /// Complex shape over the passive coordinates.
    pub shape: Vec<Complex<f64>>,
    /// Complex amplitudes of the joint torques (N m or N), then of the base rate (rad/s).
    pub channels: Vec<Complex<f64>>,
}

impl ModelMode {
    /// Undamped frequency `|l| / 2 pi` (Hz).
    pub fn frequency(&self) -> f64 {
        self.pole.norm() / TAU
    }
    /// Damping ratio `-Re l / |l|`.
    pub fn damping(&self) -> f64 {
        -self.pole.re / self.pole.norm()
    }
}

/// How the modes depend on parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeDerivatives {
    /// Of the poles, modes x parameters (1/s per unit of the parameter).
    pub poles: DMatrix<Complex<f64>>,
    /// Per mode, of its channels, channels x parameters; none for a repeated pole.
    pub channels: Vec<Option<DMatrix<Complex<f64>>>>,
}

/// The system linearised at a pose.
#[derive(Clone, Debug)]
pub struct ModalModel {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    /// H, nv x nv.
    inertia: DMatrix<f64>,
    /// N: generalised accelerations per passive acceleration, nv x m.
    lift: DMatrix<f64>,
    /// Rows and columns of H that move freely: base, joints.
    free: usize,
    modes: Vec<ModelMode>,
    overdamped: usize,
}

impl ModalModel {
    /// Linearises `model` at `pose`. Allocates.
    ///
    /// # Errors
    /// [`ModalModelError`].
    pub fn new(model: &Model, params: &Params<f64>, pose: &HeldPose<'_>) -> Result<Self, ModalModelError> {
        let (m, nb, nj, nv) = (model.np(), model.nb(), model.nj(), model.nv());
        for (what, got, want) in [
            ("joint pose", pose.q.len(), nj),
            ("passive pose", pose.eta.len(), m),
            ("parameters", params.values().len(), model.n_params()),
        ] {
            if got != want {
                return Err(ModalModelError::Length { what, got, want });
            }
        }
        let state = state::<f64>(model, pose);
        let mut h = DMatrix::zeros(nv, nv);
        mass_matrix(model, params, &state, &mut Work::new(model), &mut h);
        linalg::check_finite("mass matrix", &h)?;
        let free = match pose.boundary {
            Boundary::BaseHeld => 0,
            Boundary::JointsHeld => nb,
            Boundary::JointsFree => nb + nj,
        };
        let mut lift = DMatrix::zeros(nv, m);
        lift.view_mut((nb + nj, 0), (m, m)).fill_with_identity();
        if free > 0 {
            let own = h.view((0, 0), (free, free)).into_owned().cholesky().ok_or(ModalModelError::Singular)?;
            let moved = own.solve(&h.view((0, nb + nj), (free, m)).into_owned());
            lift.view_mut((0, 0), (free, m)).copy_from(&-moved);
        }
        let mass = lift.tr_mul(&(&h * &lift));
        let mass = (&mass + mass.transpose()) * 0.5;
        let (stiffness, damping) = stiffness_damping(model, params, pose.eta);
        let chol = mass.clone().cholesky().ok_or(ModalModelError::Singular)?;
        let mut first = DMatrix::zeros(2 * m, 2 * m);
        first.view_mut((0, m), (m, m)).fill_with_identity();
        first.view_mut((m, 0), (m, m)).copy_from(&-chol.solve(&stiffness));
        first.view_mut((m, m), (m, m)).copy_from(&-chol.solve(&damping));
        let (mut modes, mut real) = (Vec::new(), 0);
        if m > 0 {
            let torque = torque_rows(model, &h, &lift, pose.boundary);
            let (values, vectors) = linalg::general_eigen(&first)?;
            for (i, &l) in values.iter().enumerate() {
                if l.im.abs() <= 1e-9 * l.norm() {
                    real += 1;
                }
                if l.im <= 1e-9 * l.norm() {
                    continue;
                }
                let phi = DVector::from_fn(m, |r, _| vectors[(r, i)]);
                let energy = (phi.adjoint() * mass.map(Complex::from) * &phi)[0].re * l.norm_sqr();
                let phi = phi * Complex::from((2.0 / energy).sqrt());
                let mut channels: Vec<Complex<f64>> =
                    (0..nj).map(|r| l * l * (0..m).map(|c| phi[c] * torque[(r, c)]).sum::<Complex<f64>>()).collect();
                channels.extend((0..3).map(|r| {
                    if nb == 6 {
                        l * (0..m).map(|c| phi[c] * lift[(3 + r, c)]).sum::<Complex<f64>>()
                    } else {
                        Complex::new(0.0, 0.0)
                    }
                }));
                modes.push(ModelMode { pole: l, shape: phi.as_slice().to_vec(), channels });
            }
        }
        modes.sort_by(|a, b| a.pole.norm().total_cmp(&b.pole.norm()));
        Ok(Self { mass, damping, stiffness, inertia: h, lift, free, modes, overdamped: real / 2 })
    }
    /// Oscillating modes, by frequency.
    pub fn modes(&self) -> &[ModelMode] {
        &self.modes
    }
    /// Number of overdamped pairs, which oscillate not at all and are not among [`Self::modes`].
    pub fn overdamped(&self) -> usize {
        self.overdamped
    }
    /// Effective inertia `H_p - H_bp^T H_b^-1 H_bp` of the passive coordinates, m x m.
    pub fn mass(&self) -> &DMatrix<f64> {
        &self.mass
    }
    /// Exact derivatives of the poles by the parameters `selected`, modes x selected (1/s per unit of the parameter).
    ///
    /// Repeated poles (two equal wings on a held base) are differentiated in the basis in which a generic change of the
    /// selected parameters splits them. `pose` and `params` must be those of construction. Allocates.
    ///
    /// # Panics
    /// If an index does not exist or the pose has another length than at construction.
    pub fn derivatives(
        &self,
        model: &Model,
        params: &Params<f64>,
        pose: &HeldPose<'_>,
        selected: &[usize],
    ) -> DMatrix<Complex<f64>> {
        let changes: Vec<Change> = selected.iter().map(|&p| Change::of(model, params, pose, p)).collect();
        self.of_poles(params, selected, &changes)
    }
    /// [`Self::derivatives`], and those of the channels of every mode (channels x selected each), up to a complex multiple
    /// of the channels themselves, since the scale of a shape means nothing.
    ///
    /// The shape follows by R. Nelson's method (AIAA J. 14(9), 1976): one component of `phi` is held, and
    /// `(l^2 M + l D + K) dphi = -(l^2 dM + l dD + dK + dl (2 l M + D)) phi` is solved without its row and column. None for
    /// a repeated pole, whose shapes are not determined. Allocates.
    ///
    /// # Panics
    /// As [`Self::derivatives`].
    pub fn channel_derivatives(
        &self,
        model: &Model,
        params: &Params<f64>,
        pose: &HeldPose<'_>,
        selected: &[usize],
    ) -> ModeDerivatives {
        let changes: Vec<Change> = selected.iter().map(|&p| Change::of(model, params, pose, p)).collect();
        let poles = self.of_poles(params, selected, &changes);
        let (nb, nj, m) = (model.nb(), model.nj(), self.mass.nrows());
        let torque = torque_rows(model, &self.inertia, &self.lift, pose.boundary);
        // Per parameter: dM, dN, d(torque rows).
        let base = self.inertia.view((0, 0), (self.free, self.free)).into_owned().lu();
        let matrices: Vec<[DMatrix<f64>; 3]> = changes
            .iter()
            .map(|c| {
                let moved = &c.inertia * &self.lift;
                let mut lift = DMatrix::zeros(self.lift.nrows(), m);
                if self.free > 0
                    && let Some(x) = base.solve(&moved.rows(0, self.free).into_owned())
                {
                    lift.view_mut((0, 0), (self.free, m)).copy_from(&-x);
                }
                let mut rows = (&moved + &self.inertia * &lift).rows(nb, nj).into_owned();
                if pose.boundary == Boundary::JointsFree {
                    rows.fill(0.0);
                }
                [self.lift.tr_mul(&moved), lift, rows]
            })
            .collect();
        let complex = |a: &DMatrix<f64>| a.map(Complex::from);
        let of_mode = |k: usize, mode: &ModelMode| -> Option<DMatrix<Complex<f64>>> {
            let l = mode.pole;
            let near = |o: &&ModelMode| (o.pole - l).norm() <= REPEATED * l.norm();
            if self.modes.iter().filter(near).count() > 1 {
                return None;
            }
            let phi = DVector::from_column_slice(&mode.shape);
            let pivot = (0..m).max_by(|&a, &b| phi[a].norm().total_cmp(&phi[b].norm()))?;
            let slope = complex(&self.mass) * (l * 2.0) + complex(&self.damping);
            let a = complex(&self.mass) * (l * l) + complex(&self.damping) * l + complex(&self.stiffness);
            let reduced = a.remove_row(pivot).remove_column(pivot).lu();
            let mut out = DMatrix::zeros(nj + 3, selected.len());
            for (c, (change, [mass, lift, rows])) in changes.iter().zip(&matrices).enumerate() {
                let dl = poles[(k, c)];
                let matrix = complex(mass) * (l * l) + complex(&change.damping) * l + complex(&change.stiffness);
                let rhs = -((matrix + &slope * dl) * &phi).remove_row(pivot);
                let dphi = if m > 1 {
                    reduced.solve(&rhs)?.insert_row(pivot, Complex::from(0.0))
                } else {
                    phi.clone() * Complex::from(0.0)
                };
                let tau = complex(&torque) * (&phi * (l * dl * 2.0) + &dphi * (l * l)) + complex(rows) * &phi * (l * l);
                out.view_mut((0, c), (nj, 1)).copy_from(&tau);
                if nb == 6 {
                    let rate = complex(&self.lift) * (&phi * dl + &dphi * l) + complex(lift) * &phi * l;
                    out.view_mut((nj, c), (3, 1)).copy_from(&rate.rows(3, 3));
                }
            }
            Some(out)
        };
        let channels = self.modes.iter().enumerate().map(|(k, mode)| of_mode(k, mode)).collect();
        ModeDerivatives { poles, channels }
    }
    fn of_poles(&self, params: &Params<f64>, selected: &[usize], changes: &[Change]) -> DMatrix<Complex<f64>> {
        let sizes: Vec<f64> = selected.iter().map(|&p| params.values()[p].abs().max(1e-3)).collect();
        let mut out = DMatrix::zeros(self.modes.len(), selected.len());
        let mut from = 0;
        while from < self.modes.len() {
            let l = self.modes[from].pole;
            let near = |m: &&ModelMode| (m.pole - l).norm() <= REPEATED * l.norm();
            let to = from + self.modes[from..].iter().take_while(near).count();
            let basis = self.normalised(from, to);
            let lifted = self.lift.map(Complex::from) * &basis;
            let forms: Vec<DMatrix<Complex<f64>>> = changes
                .iter()
                .map(|c| {
                    let inertia = lifted.transpose() * c.inertia.map(Complex::from) * &lifted * (l * l);
                    let rest = (c.damping.map(Complex::from) * l) + c.stiffness.map(Complex::from);
                    -(inertia + basis.transpose() * rest * &basis)
                })
                .collect();
            let r = to - from;
            let turn = if r == 1 {
                DMatrix::identity(1, 1)
            } else {
                // Weights without a pattern, so that no two changes cancel by accident.
                let mut generic = DMatrix::zeros(r, r);
                for (k, (f, s)) in forms.iter().zip(&sizes).enumerate() {
                    generic += f * Complex::from(s * (1.0 + (0.618_033_988_75 * (k + 1) as f64).fract()));
                }
                diagonalise(generic)
            };
            for (k, f) in forms.iter().enumerate() {
                let turned = turn.transpose() * f * &turn;
                for i in 0..r {
                    out[(from + i, k)] = turned[(i, i)];
                }
            }
            from = to;
        }
        out
    }
    /// Shapes `from..to` of one (repeated) pole as columns with `phi_i^T (2 l M + D) phi_j = delta_ij`.
    fn normalised(&self, from: usize, to: usize) -> DMatrix<Complex<f64>> {
        let (m, r, l) = (self.mass.nrows(), to - from, self.modes[from].pole);
        let weight = self.mass.map(Complex::from) * (l * 2.0) + self.damping.map(Complex::from);
        let mut v = DMatrix::from_fn(m, r, |i, k| self.modes[from + k].shape[i]);
        for k in 0..r {
            for q in 0..k {
                let along = (v.column(q).transpose() * &weight * v.column(k))[0];
                let c = v.column(k) - v.column(q) * along;
                v.set_column(k, &c);
            }
            let own = |v: &DMatrix<Complex<f64>>| (v.column(k).transpose() * &weight * v.column(k))[0];
            let size = |v: &DMatrix<Complex<f64>>| weight.map(|x| x.norm()).max() * v.column(k).norm_squared();
            // The bilinear form has isotropic vectors, such as (1, i) in the plane of a double pole; any neighbour is not.
            if k + 1 < r && own(&v).norm() < 1e-3 * size(&v) {
                let c = v.column(k) + v.column(k + 1);
                v.set_column(k, &c);
                for q in 0..k {
                    let along = (v.column(q).transpose() * &weight * v.column(k))[0];
                    let c = v.column(k) - v.column(q) * along;
                    v.set_column(k, &c);
                }
            }
            let s = own(&v).sqrt();
            v.column_mut(k).iter_mut().for_each(|x| *x /= s);
        }
        v
    }
}

/// Joint torques per passive acceleration, nj x m; joints that are free have none.
fn torque_rows(model: &Model, h: &DMatrix<f64>, lift: &DMatrix<f64>, boundary: Boundary) -> DMatrix<f64> {
    let mut rows = (h * lift).rows(model.nb(), model.nj()).into_owned();
    if boundary == Boundary::JointsFree {
        rows.fill(0.0);
    }
    rows
}

/// Derivatives of H, D and K by one parameter.
struct Change {
    inertia: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

impl Change {
    fn of(model: &Model, params: &Params<f64>, pose: &HeldPose<'_>, p: usize) -> Self {
        let mut values: Vec<D1> = params.values().iter().map(|&x| D1::constant(x)).collect();
        values[p].eps[0] = 1.0;
        let varied = Params::from_values(model, values);
        let (m, nv) = (model.np(), model.nv());
        let mut h = DMatrix::from_element(nv, nv, D1::constant(0.0));
        mass_matrix(model, &varied, &state::<D1>(model, pose), &mut Work::new(model), &mut h);
        let (mut stiffness, mut damping) = (DMatrix::zeros(m, m), DMatrix::zeros(m, m));
        for (i, a) in model.appendages().iter().enumerate() {
            let n = a.dim();
            let own = varied.appendage(model, i);
            if own.iter().all(|x| x.eps[0] == 0.0) {
                continue;
            }
            // Outer direction: the coordinate or rate; inner one: the parameter.
            let lifted: Vec<D2> = own.iter().map(|&x| D2::constant(x)).collect();
            let zero = D2::constant(D1::constant(0.0));
            let eta: Vec<D2> = (0..n).map(|j| D2::constant(D1::constant(pose.eta[a.coord_offset + j]))).collect();
            let mut out = vec![zero; 6 + n];
            for c in 0..n {
                for (matrix, along_eta) in [(&mut stiffness, true), (&mut damping, false)] {
                    let (mut e, mut r) = (eta.clone(), vec![zero; n]);
                    if along_eta { &mut e[c] } else { &mut r[c] }.eps[0] = D1::constant(1.0);
                    out.fill(zero);
                    let s = PortState { host: Motion::zero(), eta: &e, nu: &r };
                    D2::port(&*a.appendage).bias(&lifted, &s, &mut out);
                    for row in 0..n {
                        matrix[(a.coord_offset + row, a.coord_offset + c)] = out[6 + row].eps[0].eps[0];
                    }
                }
            }
        }
        Self { inertia: h.map(|x| x.eps[0]), damping, stiffness }
    }
}

fn state<T: ModelScalar>(model: &Model, pose: &HeldPose<'_>) -> State<T> {
    let mut s = State::zero(model);
    s.q.iter_mut().zip(pose.q).for_each(|(a, &b)| *a = T::from_f64(b));
    s.eta.iter_mut().zip(pose.eta).for_each(|(a, &b)| *a = T::from_f64(b));
    s
}

/// Complex orthogonal `X` (`X^T X = 1`) that makes a complex symmetric matrix diagonal: cyclic Jacobi rotations with the
/// real formulas (P. Eberlein, J. Res. NBS 74B, 1970, for the symmetric case).
fn diagonalise(mut a: DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    let n = a.nrows();
    let mut x = DMatrix::identity(n, n);
    for _ in 0..60 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|ij| a[ij].norm()).sum();
        if off <= 1e-15 * a.norm() {
            break;
        }
        for i in 0..n {
            for j in i + 1..n {
                let b = a[(i, j)];
                if b.norm() <= 1e-16 * a.norm() {
                    continue;
                }
                let tau = (a[(j, j)] - a[(i, i)]) / (b * 2.0);
                let root = (tau * tau + 1.0).sqrt();
                let den = if (tau + root).norm() > (tau - root).norm() { tau + root } else { tau - root };
                let t = den.inv();
                let c = (t * t + 1.0).sqrt().inv();
                if !(c.re.is_finite() && c.im.is_finite()) {
                    continue;
                }
                let mut g = DMatrix::identity(n, n);
                (g[(i, i)], g[(j, j)], g[(i, j)], g[(j, i)]) = (c, c, t * c, -t * c);
                a = g.transpose() * a * &g;
                x *= g;
            }
        }
    }
    x
}
