//! A point mass on a telescopic arm that turns about the z axis through [`HUB`], with and without a mistake.
//!
//! `r = HUB + (l + x) e(q)` with `e = (cos q, sin q, 0.3)`; springs and dampers on `q` and `x`, the damper of `q`
//! acting on the tip with the arm `l`: `R = d_q (l q')^2 / 2 + d_x x'^2 / 2`.

use ff_model::CoordDecl;
use ff_model::port::add_inertial;
use ff_model::port::{derived_jacobian, derived_power, derived_regressor};
use ff_model::scalar::PlainScalar;
use ff_model::spatial::vec3::{PackedInertia, V3};
use ff_model::{
    Appendage, Decl, Inertia, Motion, ParamDecl, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Scalar,
};
use nalgebra::Vector3;

const HUB: [f64; 3] = [0.3, -0.2, 0.5];
const RISE: f64 = 0.3;
const MASS: usize = 0;
const LENGTH: usize = 1;
const K: usize = 2;
const D: usize = 4;
const NOMINAL_K: f64 = 12.0;

/// The mistakes; see [`super::known_wrong`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ArmMistake {
    DamperWithoutWork,
    DamperWithoutArm,
    DamperTwice,
    HalfThePower,
    NegativeDamping,
    ConstantTorque,
    NotConvex,
    DampsAtRest,
    SpringSign,
    Circulating,
    HalfCoriolis,
    CentripetalSign,
    TorqueWithoutArm,
    CouplingWithoutArm,
    NotCleared,
    NotDefinite,
    NoOwnInertia,
    MassGrows,
    UnusedParameter,
    DroppedDerivative,
    TypesDisagree,
    SwappedBounds,
    NameTwice,
    PoleAtRangeEnd,
    Undefined,
    Panics,
    Allocates,
    TermsWithoutDamper,
    ClassicalAcceleration,
    JacobianOfBias,
    ColumnForgotten,
    BranchOnValue,
}
use ArmMistake as Wrong;

/// The arm.
pub(super) struct Arm {
    decl: Decl,
    wrong: Option<Wrong>,
}

impl Arm {
    pub(super) fn new(wrong: Option<Wrong>) -> Self {
        let mut params = vec![
            ParamDecl::positive("mass", "kg", 7.0),
            ParamDecl::positive("length", "m", 0.8),
            ParamDecl::positive("k_q", "N m/rad", NOMINAL_K),
            ParamDecl::positive("k_x", "N/m", 30.0),
            ParamDecl::positive("d_q", "N s/m", 1.5),
            ParamDecl::positive("d_x", "N s/m", 2.5),
        ];
        match wrong {
            Some(Wrong::SwappedBounds) => params[K].bounds = (50.0, 1.0),
            Some(Wrong::NameTwice) => params[K + 1].name = "k_q".into(),
            _ => {}
        }
        let coords = [CoordDecl::new("q", "rad", (-2.0, 2.0)), CoordDecl::new("x", "m", (-0.3, 0.25))];
        Self { decl: Decl::new("arm", coords, params), wrong }
    }
    fn is(&self, wrong: Wrong) -> bool {
        self.wrong == Some(wrong)
    }
    /// Whether the bias is written by hand: in the right arm and where the mistake is there. A mistake in an energy
    /// reaches the bias as it does for an author who does not override it.
    fn writes_bias(&self) -> bool {
        match self.wrong {
            None => true,
            Some(w) => matches!(
                w,
                Wrong::DamperWithoutWork
                    | Wrong::DamperWithoutArm
                    | Wrong::DamperTwice
                    | Wrong::SpringSign
                    | Wrong::Circulating
                    | Wrong::HalfCoriolis
                    | Wrong::CentripetalSign
                    | Wrong::TorqueWithoutArm
            ),
        }
    }
    /// Position of the mass, `e`, `de/dq`.
    fn geometry<T: Scalar>(&self, p: &[T], eta: &[T]) -> [Vector3<T>; 3] {
        let q = if self.is(Wrong::DroppedDerivative) { T::from_f64(eta[0].value()) } else { eta[0] };
        let (s, c) = q.sin_cos();
        let e = Vector3::new(c, s, T::from_f64(RISE));
        [Vector3::from(HUB).map(T::from_f64) + e * (p[LENGTH] + eta[1]), e, Vector3::new(-s, c, T::zero())]
    }
}

impl Appendage for Arm {
    fn decl(&self) -> &Decl {
        &self.decl
    }

    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        if self.is(Wrong::Panics) {
            assert!(eta[0].value().abs() < 1e3, "angle out of range");
        }
        let [r, e, e_q] = self.geometry(p, eta);
        let mut mass = p[MASS];
        if self.is(Wrong::MassGrows) {
            mass += eta[0] * eta[0];
        }
        if self.is(Wrong::TypesDisagree) && size_of::<T>() > size_of::<f64>() {
            mass = mass.scale(1.0 + 1e-9);
        }
        m.add_host(&Inertia::point(mass, &r));
        let reach = p[LENGTH] + eta[1];
        let mut columns = [e_q * (mass * reach), e * mass];
        if self.is(Wrong::NotDefinite) {
            columns = columns.map(|c| c * T::from_f64(1.5));
        }
        if self.is(Wrong::Allocates) {
            columns = [columns.to_vec()[0], columns[1]];
        }
        let arm = if self.is(Wrong::CouplingWithoutArm) { r - Vector3::from(HUB).map(T::from_f64) } else { r };
        for (k, c) in columns.iter().enumerate() {
            m.set_coupling(k, &V3::from(c), &V3::from(&arm.cross(c)));
        }
        let mut own = mass * reach * reach;
        if self.is(Wrong::PoleAtRangeEnd) {
            let gap = eta[0] - T::from_f64(2.0);
            own += T::one() / gap / gap;
        }
        if self.is(Wrong::Undefined) {
            own = T::zero() / T::zero();
        }
        if !self.is(Wrong::NoOwnInertia) {
            m.set_sym(6, 6, own);
        }
        m.set_sym(7, 7, mass.scale(1.0 + RISE * RISE));
    }

    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let k = if self.is(Wrong::UnusedParameter) { T::from_f64(NOMINAL_K) } else { p[K] };
        let u = (k * eta[0] * eta[0] + p[K + 1] * eta[1] * eta[1]).scale(0.5);
        if self.is(Wrong::BranchOnValue) {
            // A spring that hardens with |x|^5, smooth enough for every law.
            let x = if eta[1].value() < 0.0 { -eta[1] } else { eta[1] };
            let square = x * x;
            return u + p[K + 1] * square * square * x;
        }
        u
    }

    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let tip = p[LENGTH] * nu[0];
        let along = p[D + 1] * nu[1] * nu[1];
        let r = (p[D] * tip * tip + if self.is(Wrong::NegativeDamping) { -along } else { along }).scale(0.5);
        match self.wrong {
            Some(Wrong::NotConvex) => r / (T::one() + (nu[0] * nu[0]).scale(9.0)),
            Some(Wrong::DampsAtRest) => r + T::one(),
            Some(Wrong::ConstantTorque) => r + nu[0].scale(0.8),
            _ => r,
        }
    }
}

impl PortDynamics for Arm {
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        derived_power(self, p, nu).scale(if self.is(Wrong::HalfThePower) { 0.5 } else { 1.0 })
    }

    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        if self.is(Wrong::NotCleared) {
            m.set_host(&PackedInertia::zero());
        } else {
            m.clear();
        }
        self.inertia(p, s.eta, m);
        self.bias(p, s, h);
        if self.is(Wrong::TermsWithoutDamper) {
            h[7] -= p[D + 1] * s.nu[1];
        }
    }

    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        let mut acc = *acc;
        if self.is(Wrong::ClassicalAcceleration) {
            acc.host.lin += s.host.ang.cross(&s.host.lin);
        }
        self.terms(p, s, scratch, r);
        add_inertial(scratch, &acc, r);
    }

    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        if self.is(Wrong::JacobianOfBias) {
            let still = PortAccel { host: Motion::zero(), nu: &[T::zero(); 2] };
            return derived_jacobian(self, p, s, &still, j);
        }
        derived_jacobian(self, p, s, acc, j);
    }

    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        derived_regressor(self, p, s, acc, y);
        if self.is(Wrong::ColumnForgotten) {
            y[8 * (D + 1)..8 * (D + 2)].fill(T::zero());
        }
    }

    /// Newton's law for the mass: `f = m (w x (v + w x r + 2 r') + (l + x) q'^2 e_qq + 2 x' q' e_q)`.
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        if !self.writes_bias() {
            return ff_model::port::derived_bias(self, p, s, h);
        }
        let [r, e, e_q] = self.geometry(p, s.eta);
        let reach = p[LENGTH] + s.eta[1];
        let (q1, x1) = (s.nu[0], s.nu[1]);
        let rate = e_q * (reach * q1) + e * x1;
        let outward = Vector3::new(e.x, e.y, T::zero());
        let sign = if self.is(Wrong::CentripetalSign) { -1.0 } else { 1.0 };
        let own = e_q * (q1 * x1).scale(2.0) - outward * (reach * q1 * q1).scale(sign);
        let factor = if self.is(Wrong::HalfCoriolis) { 1.0 } else { 2.0 };
        let w = &s.host.ang;
        let f = (w.cross(&(s.host.lin + w.cross(&r) + rate.map(|x| x.scale(factor)))) + own) * p[MASS];
        let arm = if self.is(Wrong::TorqueWithoutArm) { r - Vector3::from(HUB).map(T::from_f64) } else { r };
        let n = arm.cross(&f);
        for i in 0..3 {
            h[i] = f[i];
            h[3 + i] = n[i];
        }
        let spring = if self.is(Wrong::SpringSign) { -p[K] } else { p[K] };
        let drag = p[D] * p[LENGTH] * q1;
        let damper = match self.wrong {
            Some(Wrong::DamperWithoutWork) => T::zero(),
            Some(Wrong::DamperWithoutArm) => drag,
            _ => drag * p[LENGTH],
        };
        h[6] = reach * e_q.dot(&f) + spring * s.eta[0] + damper;
        h[7] = e.dot(&f) + p[K + 1] * s.eta[1] + p[D + 1] * x1;
        if self.is(Wrong::Circulating) {
            h[6] += s.eta[1].scale(4.0);
            h[7] -= s.eta[0].scale(4.0);
        }
        if self.is(Wrong::DamperTwice) {
            let again = e_q * drag;
            let moment = r.cross(&again);
            for i in 0..3 {
                h[i] += again[i];
                h[3 + i] += moment[i];
            }
        }
    }
}
