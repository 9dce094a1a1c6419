//! The suite accepts what keeps the laws and names the law that a wrong appendage breaks.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

use ff_model::appendage::CoordDecl;
use ff_model::{Appendage, Decl, Inertia, ParamDecl, PortMatrix, PortState, PortVector, Scalar, derived_bias};
use flex_panel::{PanelChain, Segment};
use nalgebra::{Matrix3, Vector3};
use slosh_pendulum::SloshPendulum;
use validate::check_appendage;
use validate::conformance::law;

/// The mistakes that authors of appendages make.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    Nothing,
    /// The bias forgets the damper, so that it does no work: shipped for eight years by a widely used simulator.
    DamperMissing,
    /// `R` with the paper's sign.
    DamperNegative,
    /// The bias pushes the mass inwards instead of outwards.
    CentripetalSign,
    /// One of two coupling entries written.
    NonSymmetric,
    /// More coupling than the masses allow.
    NotPsd,
    /// The own inertia left out.
    NoOwnInertia,
    /// The mass grows with the angle.
    HostBlock,
    /// The coupling has the wrong sign: still a valid quadratic form.
    CouplingSign,
    /// The stiffness is read from the nominal value, not from the parameter.
    DeadParameter,
    /// The angle goes through `value()`, which drops derivatives.
    BrokenDerivative,
    /// The lower bound above the upper.
    Bounds,
    /// Two parameters of one name.
    SameName,
    /// Divides by the angle's distance from the end of its range.
    PoleAtRangeEnd,
    /// A damper that weakens with speed makes `R` concave in places.
    NotConvex,
    /// Dissipates at rest.
    DampsAtRest,
    /// NaN everywhere.
    Nan,
}

/// A point mass on a rotating arm about the z axis through `HUB`: `r = HUB + l (cos q, sin q, 0.3)`.
struct Arm {
    decl: Decl,
    wrong: Wrong,
}

const HUB: [f64; 3] = [0.3, -0.2, 0.5];

impl Arm {
    fn new(wrong: Wrong) -> Self {
        let mut params = vec![
            ParamDecl::positive("mass", "kg", 7.0),
            ParamDecl::positive("length", "m", 0.8),
            ParamDecl::positive("k", "N m/rad", 12.0),
            ParamDecl::positive("d", "N m s/rad", 1.5),
        ];
        if wrong == Wrong::Bounds {
            params[2].bounds = (5.0, 1.0);
        }
        if wrong == Wrong::SameName {
            params[3].name = "k".into();
        }
        let coords = vec![CoordDecl { name: "q".into(), unit: "rad", range: (-2.0, 2.0) }];
        Self { decl: Decl { kind: "arm", coords, params }, wrong }
    }
    fn geometry<T: Scalar>(&self, p: &[T], q: T) -> (Vector3<T>, Vector3<T>) {
        let q = if self.wrong == Wrong::BrokenDerivative { T::from_f64(q.value()) } else { q };
        let (s, c) = q.sin_cos();
        let hub = Vector3::from(HUB).map(T::from_f64);
        (hub + Vector3::new(c, s, T::from_f64(0.3)) * p[1], Vector3::new(-s, c, T::zero()) * p[1])
    }
}

impl Appendage for Arm {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let (r, dr) = self.geometry(p, eta[0]);
        let mut mass = p[0];
        if self.wrong == Wrong::HostBlock {
            mass += eta[0] * eta[0];
        }
        m.add_host(&Inertia::point(mass, &r));
        let mut lin = dr * mass;
        if self.wrong == Wrong::CouplingSign {
            lin = -lin;
        }
        if self.wrong == Wrong::NotPsd {
            lin *= T::from_f64(1.5);
        }
        let ang = r.cross(&lin);
        for i in 0..3 {
            m.set_sym(i, 6, lin[i]);
            m.set_sym(3 + i, 6, ang[i]);
        }
        if self.wrong == Wrong::NonSymmetric {
            m.set(6, 1, T::zero());
        }
        let mut own = mass * p[1] * p[1];
        if self.wrong == Wrong::PoleAtRangeEnd {
            own += T::one() / (eta[0] - T::from_f64(2.0)) / (eta[0] - T::from_f64(2.0));
        }
        if self.wrong == Wrong::Nan {
            own = T::zero() / T::zero();
        }
        if self.wrong != Wrong::NoOwnInertia {
            m.set_sym(6, 6, own);
        }
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let k = if self.wrong == Wrong::DeadParameter { T::from_f64(12.0) } else { p[2] };
        (k * eta[0] * eta[0]).scale(0.5)
    }
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let r = (p[3] * nu[0] * nu[0]).scale(0.5);
        match self.wrong {
            Wrong::DamperNegative => -r,
            Wrong::NotConvex => r / (T::one() + (nu[0] * nu[0]).scale(9.0)),
            Wrong::DampsAtRest => r + T::one(),
            _ => r,
        }
    }
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        derived_bias(self, p, s, h);
        let (r, _) = self.geometry(p, s.eta[0]);
        match self.wrong {
            Wrong::DamperMissing => h[6] -= p[3] * s.nu[0],
            Wrong::CentripetalSign => {
                let hub = Vector3::from(HUB).map(T::from_f64);
                let mut inward = r - hub;
                inward.z = T::zero();
                let f = inward * (p[0] * s.nu[0] * s.nu[0]).scale(2.0);
                let n = r.cross(&f);
                for i in 0..3 {
                    h[i] += f[i];
                    h[3 + i] += n[i];
                }
            }
            _ => {}
        }
    }
}

/// The wrong arm is refused, and the broken law is among the named ones.
#[track_caller]
fn refused(wrong: Wrong, law: &str) {
    let report = check_appendage(&Arm::new(wrong));
    println!("{wrong:?}: {report}");
    assert!(!report.passed(), "{wrong:?} passed: {report}");
    assert!(report.failures().any(|c| c.law == law), "{wrong:?}: '{law}' not named: {report}");
    assert!(report.to_string().contains("FAIL"));
    assert!(report.require().is_err());
}

#[test]
fn a_right_appendage_passes_with_room_to_spare() {
    let report = check_appendage(&Arm::new(Wrong::Nothing));
    println!("{report}");
    assert!(report.clone().require().is_ok(), "{report}");
    assert_eq!(report.checks.len(), 16, "every law is reported once");
    assert!(report.checks.iter().all(|c| c.pass), "{report}");
    assert_eq!(report, check_appendage(&Arm::new(Wrong::Nothing)), "deterministic");
}

#[test]
fn dampers_that_do_no_work_or_feed_the_motion_are_refused() {
    refused(Wrong::DamperMissing, law::BIAS);
    refused(Wrong::DamperMissing, law::ENERGY);
    refused(Wrong::DamperNegative, law::DISSIPATES);
    refused(Wrong::NotConvex, law::CONVEX);
    refused(Wrong::DampsAtRest, law::NO_DAMPING_AT_REST);
}

#[test]
fn a_wrong_override_is_refused() {
    refused(Wrong::CentripetalSign, law::BIAS);
    refused(Wrong::CentripetalSign, law::BIAS_DERIVATIVE);
    refused(Wrong::CentripetalSign, law::ENERGY);
}

#[test]
fn matrices_that_are_no_inertia_are_refused() {
    refused(Wrong::NonSymmetric, law::SYMMETRIC);
    refused(Wrong::NotPsd, law::SEMIDEFINITE);
    refused(Wrong::NoOwnInertia, law::OWN_BLOCK);
    refused(Wrong::HostBlock, law::HOST_BLOCK);
}

#[test]
fn a_coupling_of_the_wrong_sign_is_noted() {
    // A valid quadratic form of some device, so no law of energy is broken: the advice is all that shows it.
    let report = check_appendage(&Arm::new(Wrong::CouplingSign));
    println!("{report}");
    assert!(!report.check(law::FIRST_MOMENT).unwrap().pass);
    assert!(report.to_string().contains("note"));
}

#[test]
fn declarations_and_numbers_that_cannot_be_are_refused() {
    refused(Wrong::DeadParameter, law::PARAMETERS);
    refused(Wrong::BrokenDerivative, law::DERIVATIVES);
    refused(Wrong::Bounds, law::DECLARATION);
    refused(Wrong::SameName, law::DECLARATION);
    refused(Wrong::PoleAtRangeEnd, law::EXTREME);
    refused(Wrong::Nan, law::FINITE);
}

#[test]
fn shipped_appendages_pass() {
    let i = Matrix3::new(3.1, 0.2, -0.3, 0.2, 2.4, 0.1, -0.3, 0.1, 3.7);
    let s = |x: f64| {
        Segment::new(20.0 + x, Vector3::new(0.1, 1.0, -0.2), &i, Vector3::new(0.4, x, 0.3), Vector3::new(1.0, 0.3, -x))
            .with_spring(150.0, 2.0)
            .with_rest(0.1 * x)
    };
    for n in [1, 2, 5, 16] {
        let report = check_appendage(&PanelChain::new((0..n).map(|i| s(0.4 + f64::from(i))).collect()).unwrap());
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{report}");
    }
    let report = check_appendage(&SloshPendulum::new(100.0, 0.8, [20.0, 21.0], [5.0, 6.0]).unwrap());
    println!("{report}");
    assert!(report.checks.iter().all(|c| c.pass), "{report}");
}
