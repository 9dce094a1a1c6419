//! The extension point: a passive subsystem hanging from one body, described by its energies.
//!
//! With host twist `V` (mount frame, linear first), own rates `nu` and `y = [V; nu]`, an appendage states
//!
//! * `M(p, eta)`: its kinetic-energy matrix, `T = y^T M y / 2`, symmetric positive semidefinite;
//! * `U(p, eta)`: its potential energy (springs);
//! * `R(p, nu)`: its Rayleigh dissipation function (dampers), convex with its minimum `R(0) = 0` at rest. Convex
//!   with `R(0) = 0` alone is not enough: `R = d nu^2 / 2 + c nu` is both, and its constant torque `-c` feeds energy
//!   into slow motion. With the minimum at rest `nu . dR/d nu >= R(nu) >= 0`: dampers dissipate.
//!
//! `validate::check_appendage` checks all of this, and what else the trait promises.
//!
//! Lagrange's equations in the quasi-velocities `V` (Boltzmann-Hamel form, K and D restoring and
//! dissipating; the paper's eq. (1) with the signs of `docs/paper-errata.md`) then give, with `pi = M y`,
//!
//! ```text
//! w = M_bb A + M_be nu' + h_b,     h_b = (dM/dt)_b y + V x* pi_b
//! 0 = M_eb A + M_ee nu' + h_e,     h_e = (dM/dt)_e y - 1/2 d(y^T M y)/d eta + dU/d eta + dR/d nu
//! ```
//!
//! where `w` is the wrench the host exerts on the appendage, about the mount origin. [`derived_bias`]
//! obtains `h` from the three energies by forward differentiation, so that momentum conservation, energy
//! balance and "damping dissipates" hold by construction.
pub(crate) mod derived;
pub(crate) mod matrix;
pub(crate) mod set;
pub(crate) mod twin;

pub use twin::TwinBody;

pub use derived::{derived_jacobian, derived_regressor};
pub use port_matrix::{PortMatrix, PortView, add_inertial, port_len};
pub use set::{AppendageSet, Place};

use crate::port::twin::TwinBody;
use crate::scalar::dual::Dual;
use crate::scalar::traits::{D1, D2, Grad, LaneScalar, Scalar};
use crate::spatial::motion::Motion;
use crate::spatial::vec3::{Moving, V3};
use ff_lanes::{Kernel, Portable4};
use nalgebra::DMatrix;
use serde::Serialize;

/// Most coordinates one appendage may declare; buffers of the derived bias live on the stack.
pub const MAX_COORDS: usize = 16;
/// Most parameters one appendage may declare.
pub const MAX_PARAMS: usize = 256;
const MAX_PORT: usize = 6 + MAX_COORDS;

/// One generalised coordinate of an appendage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoordDecl {
    /// Name within the appendage, such as `hinge[0]`.
    pub name: String,
    /// Unit of the coordinate: `rad` or `m` (rates are per second).
    pub unit: &'static str,
    /// Range in which the model is valid; simulation stops with an error outside.
    pub range: (f64, f64),
}

/// What a parameter is, so that an estimator can keep it physical.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ParamGroup {
    /// One of ten consecutive inertial parameters of the named body, in the order of
    /// [`crate::spatial::inertia::INERTIAL_NAMES`]; the ten stay a positive definite pseudo-inertia. The kinetic energy
    /// must be linear in them with factors that depend on the coordinates alone, not on other parameters, and the
    /// other energies must not depend on them: sensitivities are the port equations at unit parameters.
    Inertial(String),
    /// Positive: masses, lengths, stiffness, damping.
    Positive,
    /// Any sign.
    Free,
}

/// One parameter of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParamDecl {
    /// Name within its owner, such as `k[0]`.
    pub name: String,
    /// SI unit, such as `N m/rad`.
    pub unit: &'static str,
    /// Nominal value.
    pub nominal: f64,
    /// Lower and upper bound, inclusive.
    pub bounds: (f64, f64),
    /// What it is.
    pub group: ParamGroup,
}

impl ParamDecl {
    /// A positive parameter with bounds `(0, inf)`.
    pub fn positive(name: impl Into<String>, unit: &'static str, nominal: f64) -> Self {
        Self { name: name.into(), unit, nominal, bounds: (0.0, f64::INFINITY), group: ParamGroup::Positive }
    }
    /// The ten inertial parameters of a body, named `prefix.mass`, `prefix.h_x`, ...
    pub fn inertial(prefix: &str, nominal: &crate::spatial::inertia::Inertia<f64>) -> Vec<Self> {
        let inf = f64::INFINITY;
        let phi = nominal.to_params();
        (0..10)
            .map(|i| Self {
                name: format!("{prefix}.{}", crate::spatial::inertia::INERTIAL_NAMES[i]),
                unit: crate::spatial::inertia::INERTIAL_UNITS[i],
                nominal: phi[i],
                bounds: (if matches!(i, 0 | 4 | 6 | 9) { 0.0 } else { -inf }, inf),
                group: ParamGroup::Inertial(prefix.to_owned()),
            })
            .collect()
    }
}

/// What an appendage declares of itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decl {
    /// The `kind` of mission files.
    pub kind: &'static str,
    /// Generalised coordinates, at most [`MAX_COORDS`].
    pub coords: Vec<CoordDecl>,
    /// Parameters, in the order of the slice `p` passed to every method.
    pub params: Vec<ParamDecl>,
}

/// Motion of an appendage: host twist in the mount frame, own coordinates and rates.
#[derive(Clone, Copy, Debug)]
pub struct PortState<'a, T: Scalar> {
    /// Host twist at the mount origin, in mount axes.
    pub host: Motion<T>,
    /// Own coordinates.
    pub eta: &'a [T],
    /// Own rates.
    pub nu: &'a [T],
}

impl<T: Scalar> PortState<'_, T> {
    /// Motion of the mount as the inner loops hold it, with the classical acceleration `A + w x v`; without
    /// accelerations (`A = 0`) for a bias.
    #[inline(always)]
    pub fn moving(&self, acc: Option<&PortAccel<'_, T>>) -> Moving<T> {
        let (v, w) = (V3::from(&self.host.lin), V3::from(&self.host.ang));
        match acc {
            Some(a) => Moving::new(w, V3::from(&a.host.ang), w.cross_add(&v, &V3::from(&a.host.lin))),
            None => Moving::new(w, V3::zero(), w.cross(&v)),
        }
    }
}

/// Accelerations at a port.
#[derive(Clone, Copy, Debug)]
pub struct PortAccel<'a, T: Scalar> {
    /// Host acceleration at the mount origin, in mount axes: the componentwise derivative of [`PortState::host`].
    pub host: Motion<T>,
    /// Own accelerations.
    pub nu: &'a [T],
}

/// A `6+n` vector over (host twist, own rates): wrench first, then own rows.
pub type PortVector<T> = [T];

/// A passive subsystem on one host body. Implement this; everything else is derived.
///
/// `p` holds the parameters in the order of [`Decl::params`], `eta` and `nu` the coordinates and rates in
/// the order of [`Decl::coords`]. All frames are the mount frame. No method may allocate, [`Appendage::twin`] excepted.
pub trait Appendage: Send + Sync + 'static {
    /// Coordinates and parameters.
    fn decl(&self) -> &Decl;
    /// Whether [`Appendage::inertia`] writes every number of `m`, which need not arrive zeroed then. For speed alone.
    const WRITES_ALL: bool = false;
    /// Kinetic-energy matrix `M(p, eta)`; `m` arrives zeroed, unless [`Appendage::WRITES_ALL`].
    ///
    /// The host block must be the inertia of the appendage as one rigid body at `eta`, about the mount origin:
    /// `M_bb = [[m 1, -[h]x], [[h]x, I]]` with `m` independent of `eta` and `I` symmetric, ten numbers in all.
    /// That is what rigid motion of host and appendage together costs, so every true kinetic energy has it; one
    /// linearised by hand may not. `ff-dynamics` relies on it: composite inertias are carried through the tree as
    /// ten parameters. [`PortMatrix::set_host`] and [`PortMatrix::add_host`] write it.
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>);
    /// Potential energy `U(p, eta)` (J).
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let _ = (p, eta);
        T::zero()
    }
    /// Rayleigh function `R(p, nu)` (W), convex with its minimum `R(p, 0) = 0`; dampers exert `-dR/d nu`.
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let _ = (p, nu);
        T::zero()
    }
    /// Power that the dampers take out, `nu . dR/d nu >= 0` (W).
    ///
    /// The default differentiates [`Appendage::rayleigh`] along `nu`. An override is for speed alone and must equal it: `2 R` where `R` is
    /// quadratic. A simulation asks for it at every stage.
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        derived_power(self, p, nu)
    }
    /// Bias `h(p, s)`, length `6+n`: everything in the equations of motion but `M [A; nu']`.
    ///
    /// The default differentiates the energies. An override is for speed alone and must equal it.
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        derived_bias(self, p, s, h);
    }
    /// Whether the equations of motion are the same for observers in uniform motion: with `A + [w x v; 0]` given, the
    /// acceleration of the mount in an inertial frame, they then do not depend on the host's velocity `v`.
    ///
    /// True of every kinetic energy that is the kinetic energy of matter. One linearised by hand keeps the inertia of
    /// the undeformed shape while mass moves about and may not be; it must say `false`, and `ff-dynamics` then
    /// differentiates with respect to `v`, too.
    fn galilean(&self) -> bool {
        true
    }
    /// The same system at nominal parameters as ordinary tree links, where there is one: a free oracle, which
    /// `validate::check_appendage` holds the energies to. The only method that may allocate.
    fn twin(&self) -> Option<Vec<TwinBody>> {
        None
    }
    /// `M` and `h` of one state together, for appendages that share work between them. For speed alone. `m` arrives with anything in
    /// it, and an override sets every number or clears it first.
    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        if !Self::WRITES_ALL {
            m.clear();
        }
        self.inertia(p, s.eta, m);
        self.bias(p, s, h);
    }
    /// Port equations `r = M [A; nu'] + h`, length `6+n`; `scratch` may be used for `M` and arrives with
    /// anything in it.
    ///
    /// An override is for speed alone and must equal the default.
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        self.terms(p, s, scratch, r);
        add_inertial(scratch, acc, r);
    }
    /// Derivatives of [`Appendage::residual`] at fixed accelerations, columns of length `6+n`: three for the
    /// angular velocity of the host, `n` for the coordinates, `n` for the rates.
    ///
    /// There is none for the host's linear velocity: the port equations depend on it only through the
    /// acceleration `A + [w x v; 0]` of the mount point in an inertial frame (Galilean invariance, which
    /// follows from the form of `M_bb`). The default differentiates [`Appendage::residual`] by forward duals; an
    /// override is for speed alone and must equal it.
    fn jacobian<T: LaneScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        derived_jacobian(self, p, s, acc, j);
    }
    /// Derivatives of [`Appendage::residual`] with respect to the parameters, one column of length `6+n` each.
    ///
    /// The default evaluates inertial parameters, in which the equations are linear, at unit vectors, and
    /// differentiates with respect to the others; an override is for speed alone and must equal it.
    fn regressor<T: LaneScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        derived_regressor(self, p, s, acc, y);
    }
}

/// The bias that follows from the three energies (module docs), by forward differentiation.
///
/// `h` has length `6+n` and is overwritten. Costs `2 + 3n` evaluations over duals; does not allocate.
///
/// # Panics
/// If the appendage declares more than [`MAX_COORDS`] coordinates or [`MAX_PARAMS`] parameters.
pub fn derived_bias<A: Appendage + ?Sized, T: Scalar>(a: &A, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
    type D<T> = Dual<T, 1>;
    let n = s.eta.len();
    let dim = 6 + n;
    let mut buf = [D::<T>::constant(T::zero()); port_len(MAX_COORDS)];
    let mut y = [T::zero(); MAX_PORT];
    s.host.write_to(&mut y);
    y[6..dim].copy_from_slice(s.nu);
    let mut pd_store = [D::<T>::constant(T::zero()); MAX_PARAMS];
    let pd = &mut pd_store[..p.len()];
    for (d, &x) in pd.iter_mut().zip(p) {
        *d = D::constant(x);
    }
    let mut eta = [D::<T>::constant(T::zero()); MAX_COORDS];

    // Along the motion: real part M, dual part dM/dt.
    for i in 0..n {
        eta[i] = Dual::new(s.eta[i], s.nu[i]);
    }
    let mut m = PortMatrix::new(n, &mut buf);
    a.inertia(pd, &eta[..n], &mut m);
    let m = m.view();
    let mut pi = [T::zero(); 6];
    for i in 0..dim {
        let mut acc = T::zero();
        for j in 0..dim {
            acc += m.get(i, j).eps[0] * y[j];
            if i < 6 {
                pi[i] += m.get(i, j).re * y[j];
            }
        }
        h[i] = acc;
    }
    let mut host = [T::zero(); 6];
    s.host.cross_force(&crate::spatial::motion::Force::from_slice(&pi)).write_to(&mut host);
    for i in 0..6 {
        h[i] += host[i];
    }
    // Along each coordinate: gradient of U - T; along each rate: gradient of R.
    for k in 0..n {
        for i in 0..n {
            eta[i] = Dual::new(s.eta[i], if i == k { T::one() } else { T::zero() });
        }
        let mut m = PortMatrix::new(n, &mut buf);
        a.inertia(pd, &eta[..n], &mut m);
        let m = m.view();
        let mut yy = T::zero();
        for i in 0..dim {
            for j in 0..dim {
                yy += y[i] * m.get(i, j).eps[0] * y[j];
            }
        }
        let du = a.potential(pd, &eta[..n]).eps[0];
        for i in 0..n {
            eta[i] = Dual::new(s.nu[i], if i == k { T::one() } else { T::zero() });
        }
        let dr = a.rayleigh(pd, &eta[..n]).eps[0];
        h[6 + k] += du + dr - yy.scale(0.5);
    }
}

/// The power that follows from the Rayleigh function, `nu . dR/d nu`, by a dual number along `nu`: the default of
/// [`Appendage::dissipated_power`]. Does not allocate.
///
/// # Panics
/// If there are more than [`MAX_COORDS`] rates or [`MAX_PARAMS`] parameters.
pub fn derived_power<A: Appendage + ?Sized, T: Scalar>(a: &A, p: &[T], nu: &[T]) -> T {
    fn sized<A: Appendage + ?Sized, T: Scalar, const N: usize>(a: &A, p: &[T], nu: &[T]) -> T {
        let mut pd = [Dual::<T, 1>::constant(T::zero()); N];
        for (d, &x) in pd.iter_mut().zip(p) {
            *d = Dual::constant(x);
        }
        let mut nd = [Dual::<T, 1>::constant(T::zero()); MAX_COORDS];
        for (d, &x) in nd.iter_mut().zip(nu) {
            *d = Dual::new(x, x);
        }
        a.rayleigh(&pd[..p.len()], &nd[..nu.len()]).eps[0]
    }
    // Most appendages are small, and clearing buffers for the largest would cost more than the power.
    match p.len() {
        0..=8 => sized::<A, T, 8>(a, p, nu),
        9..=32 => sized::<A, T, 32>(a, p, nu),
        _ => sized::<A, T, MAX_PARAMS>(a, p, nu),
    }
}

/// An appendage at one number type: the object-safe twin of [`Appendage`].
pub trait PortModel<T: Scalar> {
    /// See [`Appendage::inertia`]; `m` may hold anything.
    fn inertia(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>);
    /// See [`Appendage::potential`].
    fn potential(&self, p: &[T], eta: &[T]) -> T;
    /// See [`Appendage::rayleigh`].
    fn rayleigh(&self, p: &[T], nu: &[T]) -> T;
    /// See [`Appendage::bias`].
    fn bias(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>);
    /// See [`Appendage::terms`].
    fn terms(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>);
    /// See [`Appendage::residual`].
    fn residual(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    );
    /// See [`Appendage::dissipated_power`].
    fn dissipated_power(&self, p: &[T], nu: &[T]) -> T;
    /// `M(p, eta)` in full, `(6+n) x (6+n)`, to be looked at. Allocates.
    fn dense_inertia(&self, p: &[T], eta: &[T]) -> DMatrix<T> {
        let mut buffer = vec![T::zero(); port_len(eta.len())];
        let mut m = PortMatrix::over(eta.len(), &mut buffer);
        self.inertia(p, eta, &mut m);
        m.view().dense()
    }
}

/// Derivatives of the port equations of an appendage at numbers and lanes.
pub trait PortTangent<T: LaneScalar> {
    /// See [`Appendage::jacobian`].
    fn jacobian(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]);
    /// See [`Appendage::regressor`].
    fn regressor(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]);
}

/// Calls a method of [`Appendage`] in a function compiled for the instructions of the scalar: a trait object's
/// methods are functions of their own, so whatever instructions the caller was compiled for end at the call.
macro_rules! entered {
    ($bound:ident, $this:ident . $method:ident($($arg:ident: $ty:ty),*) $(-> $out:ty)?) => {{
        struct Call<'x, 'y, 'z, A, T: $bound> {
            this: &'x A,
            $($arg: $ty,)*
            borrowed: core::marker::PhantomData<(&'x &'y &'z (), T)>,
        }
        impl<'x, 'y, 'z, A: Appendage, T: $bound> Kernel for Call<'x, 'y, 'z, A, T> {
            type Output = entered!(@ $($out)?);
            #[inline(always)]
            fn run(self) -> Self::Output {
                Appendage::$method(self.this, $(self.$arg),*)
            }
        }
        T::enter(Call::<A, T> { this: $this, $($arg,)* borrowed: core::marker::PhantomData })
    }};
    (@) => { () };
    (@ $out:ty) => { $out };
}

impl<A: Appendage, T: Scalar> PortModel<T> for A {
    fn inertia(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        if !A::WRITES_ALL {
            m.clear();
        }
        entered!(Scalar, self.inertia(p: &'x [T], eta: &'x [T], m: &'x mut PortMatrix<'z, T>));
    }
    fn potential(&self, p: &[T], eta: &[T]) -> T {
        Appendage::potential(self, p, eta)
    }
    fn rayleigh(&self, p: &[T], nu: &[T]) -> T {
        Appendage::rayleigh(self, p, nu)
    }
    fn bias(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        entered!(Scalar, self.bias(p: &'x [T], s: &'x PortState<'y, T>, h: &'x mut PortVector<T>));
    }
    fn terms(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        if T::DERIVATIVES {
            m.clear();
            Appendage::inertia(self, p, s.eta, m);
            Appendage::bias(self, p, s, h);
            return;
        }
        entered!(Scalar, self.terms(p: &'x [T], s: &'x PortState<'y, T>, m: &'x mut PortMatrix<'z, T>, h: &'x mut [T]));
    }
    fn residual(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        if T::DERIVATIVES {
            scratch.clear();
            Appendage::inertia(self, p, s.eta, scratch);
            Appendage::bias(self, p, s, r);
            add_inertial(scratch, acc, r);
            return;
        }
        entered!(Scalar, self.residual(p: &'x [T], s: &'x PortState<'y, T>, acc: &'x PortAccel<'y, T>,
            scratch: &'x mut PortMatrix<'z, T>, r: &'x mut [T]));
    }
    fn dissipated_power(&self, p: &[T], nu: &[T]) -> T {
        entered!(Scalar, self.dissipated_power(p: &'x [T], nu: &'x [T]) -> T)
    }
}

impl<A: Appendage, T: LaneScalar> PortTangent<T> for A {
    fn jacobian(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        entered!(LaneScalar, self.jacobian(p: &'x [T], s: &'x PortState<'y, T>, acc: &'x PortAccel<'y, T>, j: &'x mut [T]));
    }
    fn regressor(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        entered!(LaneScalar, self.regressor(p: &'x [T], s: &'x PortState<'y, T>, acc: &'x PortAccel<'y, T>, y: &'x mut [T]));
    }
}

/// Appendages at the widest number types of the machine's architecture.
#[cfg(target_arch = "x86_64")]
pub trait WidePorts:
    PortModel<ff_lanes::Avx2x1>
    + PortTangent<ff_lanes::Avx2x1>
    + PortModel<ff_lanes::Avx2x4>
    + PortModel<ff_lanes::Avx512x8>
    + PortTangent<ff_lanes::Avx2x4>
    + PortTangent<ff_lanes::Avx512x8>
{
}
/// Appendages at the widest number types of the machine's architecture: none beyond the portable ones here.
#[cfg(not(target_arch = "x86_64"))]
pub trait WidePorts {}
impl<A: Appendage> WidePorts for A {}

/// An appendage behind a trait object, at every number type of the project.
///
/// Implemented for every [`Appendage`]; nobody implements it by hand.
pub trait DynAppendage:
    PortModel<f64>
    + PortModel<D1>
    + PortModel<Grad>
    + PortModel<D2>
    + PortModel<Portable4>
    + PortTangent<f64>
    + PortTangent<Portable4>
    + WidePorts
    + Send
    + Sync
{
    /// Coordinates and parameters.
    fn declaration(&self) -> &Decl;
    /// See [`Appendage::galilean`].
    fn is_galilean(&self) -> bool;
    /// See [`Appendage::twin`].
    fn tree_twin(&self) -> Option<Vec<TwinBody>>;
}

impl<A: Appendage> DynAppendage for A {
    fn declaration(&self) -> &Decl {
        Appendage::decl(self)
    }
    fn is_galilean(&self) -> bool {
        Appendage::galilean(self)
    }
    fn tree_twin(&self) -> Option<Vec<TwinBody>> {
        Appendage::twin(self)
    }
}
