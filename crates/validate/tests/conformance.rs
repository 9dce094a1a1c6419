//! The suite accepts what keeps the laws and names the law that a wrong appendage breaks.

use ff_model::Registry;
use flex_panel::PanelChain;
use flex_panel::Segment;
use nalgebra::{Matrix3, Vector3};
use slosh_pendulum::SloshPendulum;
use std::collections::BTreeSet;
use std::sync::Arc;
use validate::conformance::law;
use validate::known_wrong::{known_wrong, right};
use validate::{ConformanceReport, check_appendage, check_appendage_counting, check_kind};

/// Allocations of one call, by the counting allocator of this test program.
fn meter(f: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(f).count_total
}

#[test]
fn the_meter_counts() {
    assert_eq!(meter(&mut || drop(std::hint::black_box(vec![1_u8; 3]))), 1);
}

#[test]
fn right_appendages_pass_with_room_to_spare() {
    for (name, a) in right() {
        let report = check_appendage_counting(&*a, meter);
        println!("{report}");
        assert!(report.clone().require().is_ok(), "{name}: {report}");
        assert!(report.checks.iter().all(|c| c.pass), "{name}, advice included: {report}");
        let laws: BTreeSet<&str> = report.checks.iter().map(|c| c.law).collect();
        assert_eq!(laws.len(), report.checks.len(), "every law is reported once");
        // A figure near its limit would make the suite a matter of luck.
        let close = report.checks.iter().find(|c| c.limit > 0.0 && c.limit < 1.0 && c.figure > 0.3 * c.limit);
        assert!(close.is_none(), "{name}: {close:?}");
        assert_eq!(report, check_appendage_counting(&*a, meter), "deterministic");
    }
}

/// One pass over all of them, which takes half a minute: every one is refused by the law it breaks, every law of an appendage is
/// broken by one of them, and their reports are JSON whatever the figures.
#[test]
#[ignore = "full tier: 3 s"]
fn every_wrong_appendage_is_refused_by_the_law_it_breaks() {
    let all = known_wrong();
    assert!(all.len() >= 36);
    let names: BTreeSet<&str> = all.iter().map(|w| w.name).collect();
    assert_eq!(names.len(), all.len(), "names are unique");
    let mut caught: BTreeSet<&str> = BTreeSet::new();
    for w in &all {
        let report = check_appendage_counting(&*w.appendage, meter);
        let broken: Vec<&str> = report.failures().map(|c| c.law).collect();
        println!("{}: {broken:?}", w.name);
        assert!(!report.passed(), "{} passed: {report}", w.name);
        assert!(broken.contains(&w.law), "{}: '{}' not among the broken laws: {report}", w.name, w.law);
        assert!(report.to_string().contains("FAIL"));
        assert!(report.clone().require().is_err());
        let culprit = report.check(w.law).unwrap();
        assert!(!culprit.detail.is_empty(), "{}: where is not said: {report}", w.name);
        caught.extend(broken);
        survives_json(&report);
    }
    let report = check_appendage_counting(&*right()[1].1, meter);
    let silent: Vec<&str> =
        report.checks.iter().filter(|c| c.required && !caught.contains(c.law)).map(|c| c.law).collect();
    assert!(silent.is_empty(), "no wrong appendage breaks {silent:?}");
}

/// Infinite and missing figures, too, are numbers or absent in JSON.
fn survives_json(report: &ConformanceReport) {
    let json = serde_json::to_value(report).unwrap();
    assert!(!json.to_string().contains("null"), "{json}");
    let first = &json["checks"][0];
    assert!(["law", "figure", "limit", "where", "pass"].iter().all(|k| first.get(*k).is_some()), "{first}");
}

fn shipped() -> Vec<Arc<dyn ff_model::DynAppendage>> {
    let i = Matrix3::new(3.1, 0.2, -0.3, 0.2, 2.4, 0.1, -0.3, 0.1, 3.7);
    let s = |x: f64| {
        Segment::new(20.0 + x, Vector3::new(0.1, 1.0, -0.2), &i, Vector3::new(0.4, x, 0.3), Vector3::new(1.0, 0.3, -x))
            .with_spring(150.0, 2.0)
            .with_rest(0.1 * x)
    };
    let chain = |n: i32| PanelChain::new((0..n).map(|i| s(0.4 + f64::from(i))).collect()).unwrap();
    vec![
        chain(1).into(),
        chain(2).into(),
        chain(5).into(),
        chain(16).into(),
        SloshPendulum::new(100.0, 0.8, [20.0, 21.0], [5.0, 6.0]).unwrap().into(),
    ]
}

#[test]
fn shipped_appendages_pass() {
    for a in shipped() {
        let report = check_appendage_counting(&*a, meter);
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{report}");
        // Instruction sets that this machine lacks are listed as not checked.
        assert!(report.skipped.iter().all(|s| s.law == law::NUMBER_TYPES), "{report}");
    }
}

#[test]
fn what_was_not_checked_is_said() {
    let report = check_appendage(&*right()[0].1);
    let skipped: Vec<&str> = report.skipped.iter().map(|s| s.law).filter(|l| *l != law::NUMBER_TYPES).collect();
    assert_eq!(skipped, [law::TWIN, law::NO_ALLOCATION]);
    assert!(report.to_string().contains("not checked"), "{report}");
}

/// Two appendages of one kind are judged by the worse.
fn kind(register: fn(&mut Registry), name: &str) -> ConformanceReport {
    let mut r = Registry::new();
    register(&mut r);
    check_kind(&r, name, Some(meter))
}

#[test]
fn shipped_kinds_pass_with_their_factories() {
    for (register, name) in [
        (flex_panel::register as fn(&mut Registry), flex_panel::KIND),
        (slosh_pendulum::register, slosh_pendulum::KIND),
    ] {
        let report = kind(register, name);
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{report}");
        for law in [law::EXAMPLES, law::TABLES, law::SYSTEM, law::NO_ALLOCATION, law::TWIN] {
            assert!(report.check(law).is_some(), "'{law}' was not checked: {report}");
        }
    }
}

mod factories {
    //! Factories with a mistake each.
    use ff_model::keys;
    use ff_model::port::Derived;
    use ff_model::{Appendage, Decl, DynAppendage, PortMatrix, Problems, Scalar};
    use slosh_pendulum::SloshPendulum;
    use std::sync::Arc;

    type Made = Result<Arc<dyn DynAppendage>, Problems>;
    pub(super) const TABLE: &str = "mass_kg = 3.0\nlength_m = 0.7";

    fn make(mass: f64, length: f64) -> Made {
        Ok(SloshPendulum::new(mass, length, [2.0, 3.0], [0.2, 0.3])?.into())
    }
    pub(super) fn panics(t: &toml::Table) -> Made {
        make(t["mass_kg"].as_float().unwrap(), t["length_m"].as_float().unwrap())
    }
    pub(super) fn takes_any_key(t: &toml::Table) -> Made {
        let only = |k: &str| t.get(k).and_then(toml::Value::as_float).unwrap_or(0.4);
        make(only("mass_kg"), only("length_m"))
    }
    /// Accepts any rest angle and stops the program when asked for the motion about a strange one.
    struct Assertive {
        rest: f64,
        inner: SloshPendulum,
    }
    impl Appendage for Assertive {
        fn decl(&self) -> &Decl {
            Appendage::decl(&self.inner)
        }
        fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
            assert!(self.rest.abs() < 10.0, "rest angle");
            Appendage::inertia(&self.inner, p, eta, m);
        }
        fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
            Appendage::potential(&self.inner, p, &[eta[0] - T::from_f64(self.rest), eta[1]])
        }
        fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
            Appendage::rayleigh(&self.inner, p, nu)
        }
    }
    pub(super) fn asserts_later(t: &toml::Table) -> Made {
        let rest = keys::read(t, |k| k.number("rest_rad"))?;
        Ok(Derived::new(Assertive { rest, inner: SloshPendulum::new(3.0, 0.7, [2.0, 3.0], [0.2, 0.3])? }).into())
    }
    pub(super) fn refuses_in_silence(t: &toml::Table) -> Made {
        let made = keys::read(t, |k| {
            let (m, l) = (k.number("mass_kg"), k.number("length_m"));
            Some((m?, l?))
        });
        made.map_err(|_| Problems::default()).and_then(|(m, l)| make(m, l))
    }
}

#[test]
fn factories_that_do_not_check_are_refused() {
    for (factory, table, law, says) in [
        (factories::panics as ff_model::registry::Factory, factories::TABLE, law::TABLES, "panics"),
        (factories::takes_any_key, factories::TABLE, law::TABLES, "no_such_key = 3: accepted"),
        (factories::refuses_in_silence, factories::TABLE, law::TABLES, "without an error"),
        (factories::asserts_later, "rest_rad = 0.3", law::SYSTEM, "rest_rad = 1e300: panics"),
    ] {
        let mut r = Registry::new();
        r.register("slosh_pendulum", factory).example("slosh_pendulum", table);
        let report = check_kind(&r, "slosh_pendulum", None);
        let check = report.check(law).unwrap();
        assert!(!check.pass && check.detail.contains(says), "{report}");
    }
}

#[test]
fn a_kind_without_a_good_example_is_refused() {
    let mut r = Registry::new();
    r.register("slosh_pendulum", slosh_pendulum::from_toml);
    let says = |r: &Registry, kind: &str, text: &str| {
        let report = check_kind(r, kind, None);
        assert!(!report.check(law::EXAMPLES).unwrap().pass, "{report}");
        assert!(report.to_string().contains(text), "{report}");
    };
    says(&r, "slosh_pendulum", "none given");
    says(&r, "unknown", "none given");
    r.example("slosh_pendulum", "mass_kg = ");
    says(&r, "slosh_pendulum", "Config::Syntax");
    r.register("slosh_pendulum", slosh_pendulum::from_toml).example("slosh_pendulum", "mass_kg = -4.0");
    says(&r, "slosh_pendulum", "length_m");
    let good = "mass_kg = 4.0\nlength_m = 0.6\nstiffness_nm_per_rad = [2.0, 3.0]\ndamping_nms_per_rad = [0.5, 0.6]";
    r.register("fuel", slosh_pendulum::from_toml).example("fuel", good);
    says(&r, "fuel", "declares itself as 'slosh_pendulum'");
}

mod sums {
    //! A pendulum whose inertia adds its host block to what is there, which is right where that is zero.
    use ff_model::port::port_len;
    use ff_model::{Appendage, Decl, Inertia, PortDynamics, PortMatrix, Scalar};
    use slosh_pendulum::SloshPendulum;

    pub(super) struct Sums<const WRITES_ALL: bool>(pub(super) SloshPendulum);

    impl<const WRITES_ALL: bool> PortDynamics for Sums<WRITES_ALL> {
        const WRITES_ALL: bool = WRITES_ALL;
    }

    impl<const WRITES_ALL: bool> Appendage for Sums<WRITES_ALL> {
        fn decl(&self) -> &Decl {
            Appendage::decl(&self.0)
        }
        fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
            let mut buffer = [T::zero(); port_len(2)];
            let mut right = PortMatrix::new(2, &mut buffer);
            Appendage::inertia(&self.0, p, eta, &mut right);
            let right = right.view();
            m.add_host(&Inertia::from_elements(|i, j| right.get(i, j)));
            for i in 6..8 {
                (0..=i).for_each(|j| m.set_sym(i, j, right.get(i, j)));
            }
        }
        fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
            Appendage::potential(&self.0, p, eta)
        }
        fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
            Appendage::rayleigh(&self.0, p, nu)
        }
    }
}

#[test]
fn an_inertia_that_leans_on_zeros_must_not_say_that_it_writes_everything() {
    let pendulum = || slosh_pendulum::SloshPendulum::new(3.0, 0.7, [2.0, 3.0], [0.2, 0.3]).unwrap();
    let modest = check_appendage(&sums::Sums::<false>(pendulum()));
    assert!(modest.passed(), "{modest}");
    assert!(!check_appendage(&sums::Sums::<true>(pendulum())).passed());
}
