//! Natural frequencies, damping and shapes of the passive coordinates, base free or held.
//!
//! Linearised about rest at a given configuration, with the joints held,
//!
//! ```text
//! H_p* b'' + D b' + K b = 0,    H_p* = H_p - H_bp^T H_b^-1 H_bp,
//! K = d^2U/d eta^2,  D = d^2R/d nu^2.
//! ```
//!
//! Eliminating the base (and joints, when free) only takes inertia away, so free-floating frequencies are
//! never below those of the same appendage on a held base. Gravity is left out: modes are about zero-g rest.

use crate::state::State;
use crate::tree::blocks::MassBlocks;
use crate::tree::crba::mass_matrix;
use crate::work::buffers::Work;
use ff_model::scalar::{D1, ModelScalar};
use ff_model::{Model, Motion, Params, PortState};
use nalgebra::{DMatrix, DVector, Vector6};
use std::f64::consts::TAU;

/// What may move besides the passive coordinates.
///
/// ```
/// use ff_dynamics::{Boundary, modes};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
///
/// let (params, q, eta) = (Params::nominal(&robot), [0.3, -0.5, 0.2, 0.7, -0.1, 0.4, 0.6], vec![0.0; robot.np()]);
/// let lowest = |boundary| modes(&robot, &params, &q, &eta, boundary).map(|m| m[0].frequency_hz);
/// // A base that may recoil raises the frequencies.
/// assert!(lowest(Boundary::JointsHeld)? > lowest(Boundary::BaseHeld)?);
/// # Ok::<(), ff_dynamics::analysis::ModesError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Boundary {
    /// Base and joints held: cantilever modes.
    BaseHeld,
    /// Base free, joints held (position-controlled arm). The usual case in orbit.
    JointsHeld,
    /// Base and joints free (limp arm).
    JointsFree,
}

/// One mode.
///
/// ```
/// use ff_dynamics::{Boundary, Mode, modes};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
///
/// let (params, q, eta) = (Params::nominal(&robot), [0.3, -0.5, 0.2, 0.7, -0.1, 0.4, 0.6], vec![0.0; robot.np()]);
/// let found: Vec<Mode> = modes(&robot, &params, &q, &eta, Boundary::JointsHeld)?;
/// let first = &found[0];
/// assert!((first.damped_hz / first.frequency_hz - (1.0 - first.damping_ratio.powi(2)).sqrt()).abs() < 1e-3);
/// assert_eq!((found.len(), first.passive.len()), (robot.np(), robot.np()));
/// # Ok::<(), ff_dynamics::analysis::ModesError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency of the linearised system, `|lambda| / 2 pi` (Hz).
    pub frequency_hz: f64,
    /// Damping ratio `-Re lambda / |lambda|`; 1 or more is reported as overdamped pairs of real roots.
    pub damping_ratio: f64,
    /// Frequency of the free oscillation, `Im lambda / 2 pi` (Hz).
    pub damped_hz: f64,
    /// Shape over the passive coordinates, largest component 1 (of the undamped mode that fits best).
    pub passive: Vec<f64>,
    /// Base acceleration per unit of modal acceleration of `passive`, linear first (m/s^2, rad/s^2).
    pub base: Vector6<f64>,
}

/// Why the modes could not be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModesError {
    /// The mass matrix is not positive definite.
    #[error("mass matrix is not positive definite at this configuration; check masses and inertias")]
    Singular,
    /// The eigenvalue iteration did not converge.
    #[error("eigenvalue iteration did not converge")]
    NoConvergence,
}

/// Stiffness `K` and damping `D` of all passive coordinates at `eta` and zero rates, `m x m`, exact.
///
/// Read off the port biases by forward duals: `K = d h_e / d eta`, `D = d h_e / d nu` at rest. Allocates.
pub fn stiffness_damping(model: &Model, params: &Params<f64>, eta: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let m = model.np();
    let (mut k, mut d) = (DMatrix::zeros(m, m), DMatrix::zeros(m, m));
    for (i, a) in model.appendages().iter().enumerate() {
        let n = a.dim();
        let p: Vec<D1> = params.appendage(model, i).iter().map(|&x| D1::constant(x)).collect();
        let own: Vec<D1> = (0..n).map(|j| D1::constant(eta[a.coord_offset + j])).collect();
        let zero = vec![D1::constant(0.0); n];
        let mut h = vec![D1::constant(0.0); 6 + n];
        for c in 0..n {
            for (matrix, along_eta) in [(&mut k, true), (&mut d, false)] {
                let (mut e, mut r) = (own.clone(), zero.clone());
                if along_eta { &mut e[c] } else { &mut r[c] }.eps[0] = 1.0;
                let s = PortState { host: Motion::zero(), eta: &e, nu: &r };
                D1::port(&*a.appendage).bias(&p, &s, &mut h);
                for row in 0..n {
                    matrix[(a.coord_offset + row, a.coord_offset + c)] = h[6 + row].eps[0];
                }
            }
        }
    }
    (k, d)
}

/// Modes at joint positions `q` and passive coordinates `eta`, in ascending frequency. Allocates.
///
/// # Errors
/// [`ModesError`].
///
/// # Panics
/// If `q` or `eta` has the wrong length.
pub fn modes(
    model: &Model,
    params: &Params<f64>,
    q: &[f64],
    eta: &[f64],
    boundary: Boundary,
) -> Result<Vec<Mode>, ModesError> {
    let m = model.np();
    if m == 0 {
        return Ok(Vec::new());
    }
    let mut state = State::zero(model);
    state.q.copy_from_slice(q);
    state.eta.copy_from_slice(eta);
    let nv = model.nv();
    let mut h = DMatrix::zeros(nv, nv);
    mass_matrix(model, params, &state, &mut Work::new(model), &mut h);
    let (nb, nj) = (model.nb(), model.nj());
    let b = MassBlocks::new(&h, nb, nj);
    // The rows that move freely with the passive coordinates, and their coupling.
    let (free, coupling) = match boundary {
        Boundary::BaseHeld => (DMatrix::zeros(0, 0), DMatrix::zeros(0, m)),
        Boundary::JointsHeld => (b.h_b.clone(), b.h_bp.clone()),
        Boundary::JointsFree => {
            (h.view((0, 0), (nb + nj, nb + nj)).into_owned(), h.view((0, nb + nj), (nb + nj, m)).into_owned())
        }
    };
    let solved = if free.nrows() == 0 {
        coupling.clone()
    } else {
        free.cholesky().ok_or(ModesError::Singular)?.solve(&coupling)
    };
    let hp = &b.h_p - coupling.transpose() * &solved;
    let (k, d) = stiffness_damping(model, params, eta);
    // Undamped shapes: L^-1 K L^-T is symmetric.
    let chol = hp.clone().cholesky().ok_or(ModesError::Singular)?;
    let l = chol.l();
    let li = l.clone().try_inverse().ok_or(ModesError::Singular)?;
    let sym = &li * &k * li.transpose();
    let eig = nalgebra::SymmetricEigen::try_new((&sym + sym.transpose()) * 0.5, 1e-15, 10_000)
        .ok_or(ModesError::NoConvergence)?;
    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&i, &j| eig.eigenvalues[i].total_cmp(&eig.eigenvalues[j]));
    // Damped roots of the first-order form, one per conjugate pair.
    let (a1, a2) = (-chol.solve(&k), -chol.solve(&d));
    let mut first = DMatrix::zeros(2 * m, 2 * m);
    first.view_mut((0, m), (m, m)).fill_with_identity();
    first.view_mut((m, 0), (m, m)).copy_from(&a1);
    first.view_mut((m, m), (m, m)).copy_from(&a2);
    let schur = nalgebra::Schur::try_new(first, 1e-15, 100_000).ok_or(ModesError::NoConvergence)?;
    let mut roots: Vec<(f64, f64)> = schur.complex_eigenvalues().iter().map(|z| (z.re, z.im)).collect();
    roots.sort_by(|a, b| a.0.hypot(a.1).total_cmp(&b.0.hypot(b.1)).then(b.1.total_cmp(&a.1)));
    // Roots come in pairs: conjugates share their modulus; overdamped real pairs are taken as they lie.
    let pairs: Vec<RootPair> = roots.chunks_exact(2).map(|r| (r[0], r[1])).collect();
    let shapes: Vec<DVector<f64>> = order.iter().map(|&c| li.transpose() * eig.eigenvectors.column(c)).collect();
    let mut out = Vec::with_capacity(m);
    for (&((re, im), (re2, im2)), shape) in pairs.iter().zip(assign(&pairs, &shapes, &hp, &d, &k)) {
        let wn = (re.hypot(im) * re2.hypot(im2)).sqrt();
        let zeta = if wn > 0.0 { -0.5 * (re + re2) / wn } else { 0.0 };
        let shape = &shapes[shape] / shapes[shape][shapes[shape].icamax()];
        let moved = -(&solved * &shape);
        let base =
            if boundary == Boundary::BaseHeld || nb == 0 { Vector6::zeros() } else { moved.fixed_rows::<6>(0).into() };
        out.push(Mode {
            frequency_hz: wn / TAU,
            damping_ratio: zeta,
            damped_hz: im.abs() / TAU,
            passive: shape.as_slice().to_vec(),
            base,
        });
    }
    Ok(out)
}

/// A conjugate pair of roots, `(re, im)` each.
type RootPair = ((f64, f64), (f64, f64));

/// Which undamped shape belongs to which pair of damped roots: the one that nearly solves
/// `phi^T (l^2 H + l D + K) phi = 0`, best matches first. Order of frequency is not enough, since unequal
/// damping may swap close modes.
fn assign(
    pairs: &[RootPair],
    shapes: &[DVector<f64>],
    h: &DMatrix<f64>,
    d: &DMatrix<f64>,
    k: &DMatrix<f64>,
) -> Vec<usize> {
    let mut costs = Vec::with_capacity(pairs.len() * shapes.len());
    for (j, s) in shapes.iter().enumerate() {
        let form = |m: &DMatrix<f64>| s.dot(&(m * s));
        let (mh, md, mk) = (form(h), form(d), form(k));
        for (i, &((re, im), _)) in pairs.iter().enumerate() {
            let real = (re * re - im * im) * mh + re * md + mk;
            let imaginary = 2.0 * re * im * mh + im * md;
            let scale = (re * re + im * im) * mh + mk;
            costs.push((real.hypot(imaginary) / scale.max(f64::MIN_POSITIVE), i, j));
        }
    }
    costs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut shape_of = vec![usize::MAX; pairs.len()];
    let mut taken = vec![false; shapes.len()];
    for (_, i, j) in costs {
        if shape_of[i] == usize::MAX && !taken[j] {
            shape_of[i] = j;
            taken[j] = true;
        }
    }
    shape_of
}
