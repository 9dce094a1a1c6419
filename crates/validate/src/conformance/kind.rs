//! A kind of a registry: its examples held to every law, its factory and a whole system tried with odd values.

use super::numbers::ODD;
use super::report::{Check, ConformanceReport};
use super::{AllocationMeter, check, declaration, law};
use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
use ff_model::registry::Factory;
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, DynAppendage, Inertia, Joint, JointKind, Model, Params, Problems, Registry, Xform};
use nalgebra::{Matrix3, Vector3};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use toml::{Table, Value};

/// Checks every example of a kind as [`super::check_appendage`] does, one entry per law with the worst figure of all
/// examples, and [`law::EXAMPLES`], [`law::TABLES`] and [`law::SYSTEM`] besides.
///
/// A kind without an example does not pass: there is nothing to check. `meter` as in
/// [`super::check_appendage_counting`]. Deterministic; allocates. Odd values may make an appendage panic; the panic is
/// caught and reported, its message still goes to standard error.
pub fn check_kind(registry: &Registry, kind: &str, meter: Option<AllocationMeter>) -> ConformanceReport {
    let mut report = ConformanceReport::new(kind);
    let examples = registry.examples(kind);
    let (mut refused, mut built) = (Vec::new(), Vec::new());
    for (i, text) in examples.iter().enumerate() {
        match registry.build(kind, text) {
            Ok(a) if a.declaration().kind != kind => {
                refused.push(format!("example {i} declares itself as '{}'", a.declaration().kind));
            }
            Ok(a) => built.push((i, a)),
            Err(e) => refused.push(format!("example {i}: {e}")),
        }
    }
    if examples.is_empty() {
        refused.push("none given; add one with Registry::example where the kind is registered".into());
    }
    report.push(Check::faults(law::EXAMPLES, &refused));
    for (i, a) in &built {
        report.merge(check(&**a, meter), &format!("example {i}"));
    }
    if !report.passed() {
        return report;
    }
    let (mut tables, mut systems) = (Vec::new(), Vec::new());
    if let Some(factory) = registry.get(kind) {
        for table in examples.iter().filter_map(|text| text.parse::<Table>().ok()) {
            odd_tables(factory, &table, &mut tables, &mut systems);
        }
    }
    for (_, a) in &built {
        odd_systems(a, &mut systems);
    }
    report.push(Check::faults(law::TABLES, &tables));
    report.push(Check::faults(law::SYSTEM, &systems));
    report
}

/// One change of a table.
enum Change {
    Put(Value),
    Remove,
}

/// Keys and places from the root of a table to one of its values.
type Path = Vec<Step>;

#[derive(Clone)]
enum Step {
    Key(String),
    Place(usize),
}

/// Every value below `value`, tables and arrays included.
fn paths(value: &Value, here: &Path, out: &mut Vec<(Path, bool)>) {
    let mut below = |step: Step, v: &Value| {
        let mut at = here.clone();
        at.push(step);
        out.push((at.clone(), matches!(v, Value::Float(_) | Value::Integer(_))));
        paths(v, &at, out);
    };
    match value {
        Value::Table(t) => t.iter().for_each(|(k, v)| below(Step::Key(k.clone()), v)),
        Value::Array(a) => a.iter().enumerate().for_each(|(i, v)| below(Step::Place(i), v)),
        _ => {}
    }
}

/// The table with one value put in place or removed.
fn changed(table: &Table, path: &[Step], change: &Change) -> Table {
    let mut root = Value::Table(table.clone());
    let Some((last, way)) = path.split_last() else { return table.clone() };
    let mut at = Some(&mut root);
    for step in way {
        at = at.and_then(|v| match step {
            Step::Key(k) => v.get_mut(k),
            Step::Place(i) => v.get_mut(*i),
        });
    }
    match (at, last, change) {
        (Some(Value::Table(t)), Step::Key(k), Change::Put(v)) => drop(t.insert(k.clone(), v.clone())),
        (Some(Value::Table(t)), Step::Key(k), Change::Remove) => drop(t.remove(k)),
        (Some(Value::Array(a)), Step::Place(i), Change::Put(v)) => a[*i] = v.clone(),
        (Some(Value::Array(a)), Step::Place(i), Change::Remove) => drop(a.remove(*i)),
        _ => {}
    }
    match root {
        Value::Table(t) => t,
        _ => table.clone(),
    }
}

fn show(path: &[Step]) -> String {
    path.iter().fold(String::new(), |s, step| match step {
        Step::Key(k) if s.is_empty() => k.clone(),
        Step::Key(k) => format!("{s}.{k}"),
        Step::Place(i) => format!("{s}[{i}]"),
    })
}

/// See [`law::TABLES`]; what a factory accepts must move as [`law::SYSTEM`] says.
fn odd_tables(factory: Factory, table: &Table, tables: &mut Vec<String>, systems: &mut Vec<String>) {
    let mut all = Vec::new();
    paths(&Value::Table(table.clone()), &Vec::new(), &mut all);
    // What is changed, and whether the factory has to refuse it.
    let mut trials = vec![(vec![Step::Key("no_such_key".into())], Change::Put(Value::Integer(3)), true)];
    for (path, number) in all {
        if number {
            let odd = ODD.iter().map(|&x| (path.clone(), Change::Put(Value::Float(x)), !x.is_finite()));
            trials.extend(odd);
            trials.push((path.clone(), Change::Put(Value::String("three".into())), true));
        } else {
            trials.push((path.clone(), Change::Put(Value::Boolean(true)), false));
        }
        trials.push((path, Change::Remove, false));
    }
    for (path, change, must_refuse) in trials {
        let what = match &change {
            // Plain printing of 1e300 fills three lines.
            Change::Put(Value::Float(x)) => format!("{} = {x:e}", show(&path)),
            Change::Put(v) => format!("{} = {v}", show(&path)),
            Change::Remove => format!("without {}", show(&path)),
        };
        let table = changed(table, &path, &change);
        match catch_unwind(AssertUnwindSafe(|| factory(&table))) {
            Err(_) => tables.push(format!("{what}: the factory panics")),
            Ok(Err(problems)) => tables.extend(poor(&problems).map(|why| format!("{what}: {why}"))),
            Ok(Ok(_)) if must_refuse => tables.push(format!("{what}: accepted")),
            Ok(Ok(a)) => {
                let sane = declaration::declaration(a.declaration());
                if sane.pass {
                    let params = nominal(&a);
                    systems.extend(moves(&a, &params, |_| {}).map(|why| format!("{what}: {why}")));
                } else {
                    tables.push(format!("{what}: accepted, but {}", sane.detail));
                }
            }
        }
    }
}

/// Why these problems would not help the author of a mission file, if so.
fn poor(problems: &Problems) -> Option<String> {
    if !problems.has_errors() {
        return Some("refused without an error".into());
    }
    problems.0.iter().find(|p| p.object.is_none()).map(|p| format!("the problem '{}' names no key", p.message))
}

/// See [`law::SYSTEM`]: every parameter, coordinate and rate of the appendage in turn takes each odd value.
fn odd_systems(a: &Arc<dyn DynAppendage>, systems: &mut Vec<String>) {
    let decl = a.declaration();
    for x in ODD {
        for (k, d) in decl.params.iter().enumerate() {
            let mut params = nominal(a);
            params[k] = x;
            systems.extend(moves(a, &params, |_| {}).map(|why| format!("{} = {x:e}: {why}", d.name)));
        }
        for (k, d) in decl.coords.iter().enumerate() {
            let params = nominal(a);
            systems.extend(moves(a, &params, |s| s.eta[k] = x).map(|why| format!("{} = {x:e}: {why}", d.name)));
            let at_rate = moves(a, &params, |s| s.nu_mut()[k] = x);
            systems.extend(at_rate.map(|why| format!("rate of {} = {x:e}: {why}", d.name)));
        }
        for k in 0..6 {
            let params = nominal(a);
            systems.extend(moves(a, &params, |s| s.v[k] = x).map(|why| format!("base twist {k} = {x:e}: {why}")));
        }
    }
}

fn nominal(a: &Arc<dyn DynAppendage>) -> Vec<f64> {
    a.declaration().params.iter().map(|p| p.nominal).collect()
}

/// Moves a free base with one jointed link and the appendage on it for two steps; what is wrong with the result, if
/// anything. An error of the simulation is a right answer.
fn moves(a: &Arc<dyn DynAppendage>, p: &[f64], change: impl FnOnce(&mut State<f64>)) -> Option<String> {
    let run = AssertUnwindSafe(|| -> Result<Option<Trace>, Problems> {
        let diag = |x, y, z| Matrix3::from_diagonal(&Vector3::new(x, y, z));
        let base = Inertia::from_com(600.0, &Vector3::new(0.9, 0.1, 0.6), &diag(150.0, 140.0, 160.0));
        let mut model = Model::new("odd", "base", base, BaseKind::Floating);
        let joint = Joint {
            name: "joint".into(),
            kind: JointKind::Revolute,
            axis: Vector3::new(0.3, -0.5, 0.8),
            placement: Xform::new(Matrix3::identity(), Vector3::new(0.4, 0.2, 1.2)),
            limits: JointLimits::default(),
        };
        let link = Inertia::from_com(20.0, &Vector3::new(0.1, 0.3, 0.2), &diag(2.0, 1.5, 2.5));
        let host = model.add_body(0, "link", joint, link);
        model.mount("a", host, Xform::new(Matrix3::identity(), Vector3::new(0.2, 0.5, -0.1)), a.clone())?;
        let mut values = Params::<f64>::nominal(&model).values().to_vec();
        let first = values.len() - p.len();
        values[first..].copy_from_slice(p);
        let params = Params::from_values(&model, values);
        let mut start = State::zero(&model);
        start.v.iter_mut().enumerate().for_each(|(i, v)| *v = 0.05 - 0.011 * i as f64);
        change(&mut start);
        let law = |_: f64, _: &State<f64>, tau: &mut [f64]| tau.fill(0.3);
        let options = SimOptions { duration_s: 0.02, step_s: 0.01, sample_s: 0.01 };
        Ok(simulate(&model, &params, &start, &Drive::Torque(&law), &options).ok())
    });
    match catch_unwind(run) {
        Err(_) => Some("panics".into()),
        Ok(Err(e)) => Some(format!("cannot be mounted: {e}")),
        Ok(Ok(None)) => None,
        Ok(Ok(Some(t))) => {
            let columns = [&t.qdd, &t.accel, &t.twist, &t.eta, &t.nu, &t.pos, &t.att];
            let finite =
                columns.iter().all(|m| m.iter().all(|x| x.is_finite())) && t.dissipated.iter().all(|x| x.is_finite());
            (!finite).then(|| "moves by numbers that are not finite, without an error".into())
        }
    }
}
