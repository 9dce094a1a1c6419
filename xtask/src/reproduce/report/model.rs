//! Table I beside the missions, what the paper leaves open and what is chosen, Figs. 1 and 2.

use super::super::experiment::Experiment;
use super::super::system::{Source, System};
use super::schematics;
use super::shown::Shown;
use crate::table::sig;
use crate::workspace;
use ff_model::Inertia;
use ff_report::page::{Block, Cell, Level, Table};
use ff_report::replay::{Appearance, Replay, Scene, Subject};

/// Table I, and Figs. 1 and 2.
///
/// # Errors
/// A mission that cannot be read again.
pub(super) fn blocks(shown: &Shown<'_>) -> anyhow::Result<Vec<Block>> {
    let (flex, slosh) = (&shown.flex.system, &shown.slosh.system);
    let drawn = drawing()?;
    Ok(vec![
        Block::Drawing {
            svg: drawn,
            caption: "Fig. 1: the free-floating robot with panels and tank, drawn from the mission files: base and links as boxes of their inertia, panels to their \
                      size, fuel as a ball of its mass. Arm in the pose of Fig. 4."
                .into(),
        },
        schematics::pendulum(),
        table_one(flex, slosh),
        Block::Table(chosen(shown.flex, shown.slosh)),
    ])
}

/// Fig. 1: panels and fuel on one robot.
fn drawing() -> anyhow::Result<String> {
    let s = Source::read(&workspace::root()?.join("fixtures/paper/combined.toml"))?.with(false, |_| ())?;
    let appearance = Appearance::default();
    let scene = Scene::new(&Subject {
        label: "the robot",
        model: s.model(),
        params: &s.params,
        pose: &s.reproduce.hold_rad,
        trace: None,
        known: None,
        appearance: &appearance,
    });
    Ok(Replay::new("Fig. 1", vec![scene], appearance).drawing())
}

/// A value of a satellite by name.
fn value(s: &System, name: &str) -> Option<f64> {
    let place = s.model().param_decls().iter().position(|d| d.name == name)?;
    Some(s.params.values()[place])
}

/// The values of all parameters whose names begin and end like this, when they are the same; in words.
fn same(s: &System, begins: &str, ends: &str) -> Option<f64> {
    let decls = s.model().param_decls();
    let mut of =
        decls.iter().zip(s.params.values()).filter(|(d, _)| d.name.starts_with(begins) && d.name.contains(ends));
    let first = *of.next()?.1;
    of.all(|(_, x)| *x == first).then_some(first)
}

fn diagonal(i: &Inertia<f64>) -> [f64; 3] {
    let c = i.about_com();
    [c[(0, 0)], c[(1, 1)], c[(2, 2)]]
}

fn list(x: &[f64]) -> String {
    x.iter().map(|v| sig(*v, 3)).collect::<Vec<_>>().join(", ")
}

/// Table I beside the values of the loaded missions.
fn table_one(flex: &System, slosh: &System) -> Block {
    let base = flex.params.body(0);
    let arm: Vec<&Inertia<f64>> =
        (1..flex.model().n_bodies()).map(|i| flex.params.body(i)).filter(|b| b.mass > 0.0).collect();
    let links: f64 = flex.model().bodies().iter().skip(1).map(|b| b.joint.placement.pos.norm()).sum();
    // The last link carries the tool as far as the others carry the next joint.
    let length = links * arm.len() as f64 / (flex.model().nj() - 1) as f64;
    let segment = |m: &str| same(flex, "panel_", m);
    let panel: Option<[f64; 3]> = {
        let decls = flex.model().param_decls();
        let first = decls.iter().position(|d| d.name.starts_with("panel_"));
        first.map(|i| diagonal(&Inertia::from_params(&flex.params.values()[i..i + 10])))
    };
    let one = |x: Option<f64>| x.map_or_else(|| "several".to_owned(), |x| sig(x, 4));
    let com: Option<[f64; 3]> = base.com().map(Into::into);
    let rows: [(&str, &str, String, &str, &str); 13] = [
        ("mass of the base", "600", sig(base.mass, 4), "kg", ""),
        ("its centre of mass", "0.9, 0.0, 0.6", com.map_or_else(String::new, |c| list(&c)), "m", ""),
        (
            "its inertia",
            "diag(150, 150, 150)",
            list(&diagonal(base)),
            "kg m\u{b2}",
            "about the centre of mass: about the origin no body could have it (item 20)",
        ),
        ("length of the arm", "3.0", sig(length, 3), "m", "seven equal links"),
        ("mass of the arm", "60.0", sig(arm.iter().map(|b| b.mass).sum(), 4), "kg", ""),
        (
            "inertia of a link",
            "diag(0.4, 0.04, 0.4)",
            arm.first().map_or_else(String::new, |b| list(&diagonal(b))),
            "kg m\u{b2}",
            "printed in m (item 19)",
        ),
        ("mass of a panel", "33.0", one(segment(".mass")), "kg", ""),
        (
            "inertia of a panel",
            "diag(15.0, 11.0, 15.0)",
            panel.map_or_else(String::new, |p| list(&p)),
            "kg m\u{b2}",
            "no thin plate (item 20)",
        ),
        ("stiffness of a hinge", "200.0", one(segment(".k[")), "N m/rad", ""),
        ("damping of a hinge", "2.0", one(segment(".d[")), "N m s/rad", ""),
        ("sloshing mass", "100.0", one(value(slosh, "tank.mass")), "kg", ""),
        ("length of the pendulum", "0.8", one(value(slosh, "tank.length")), "m", ""),
        (
            "its stiffness and damping",
            "20.0, 5.0",
            format!("{}, {}", one(same(slosh, "tank", ".k[")), one(same(slosh, "tank", ".d["))),
            "N m/rad, N m s/rad",
            "about both axes",
        ),
    ];
    let row = |(what, paper, ours, unit, note): &(&str, &str, String, &str, &str)| {
        vec![
            Cell::words(*what),
            Cell::number(*paper),
            Cell::number(ours.clone()),
            Cell::words(*unit),
            Cell::words(*note),
        ]
    };
    Block::Table(Table {
        caption: "Table I, and the values that the missions are loaded with".into(),
        head: ["quantity", "paper", "here", "unit", ""].map(String::from).to_vec(),
        rows: rows.iter().map(row).collect(),
    })
}

/// What the paper does not say, and what is taken.
fn chosen(flex: &Experiment, slosh: &Experiment) -> Table {
    let (f, s) = (&flex.system, &slosh.system);
    let mount = |s: &System| s.model().appendages().first().map_or_else(String::new, |a| list(a.mount.pos.as_slice()));
    let limits =
        f.limits.first().map_or_else(String::new, |l| format!("{} rad/s, {} rad/s\u{b2}", l.velocity, l.acceleration));
    let rows = [
        (
            "panels",
            format!("along +y and -y, hinges along x; first hinge at {} m; 2.15 m from hinge to hinge", mount(f)),
            "swept",
        ),
        ("fulcrum of the tank, direction in which fuel settles", format!("{} m; towards -z", mount(s)), "swept"),
        (
            "posture while the modes ring",
            format!("panels: {} rad; fuel: {} rad", list(&f.reproduce.hold_rad), list(&s.reproduce.hold_rad)),
            "swept",
        ),
        (
            "noise",
            format!(
                "torque {} N m, gyro {} rad/s, encoders of 20 bits; the paper simulates without",
                sig(f.noise.torque, 2),
                sig(f.noise.gyro, 2)
            ),
            "swept",
        ),
        ("trajectories", "planned with seeds; the paper's are not printed".to_owned(), "repeated with other seeds"),
        ("joint limits", limits, "not swept"),
        (
            "lengths",
            format!(
                "{} s of ringing, {} s to identify from, {} s to compare",
                f.reproduce.record_s, f.reproduce.identification_s, f.reproduce.reference_s
            ),
            "not swept",
        ),
    ];
    Table {
        caption: "What the paper leaves open, and what is chosen here (the reasons are in the mission files)".into(),
        head: ["", "chosen", "in this report"].map(String::from).to_vec(),
        rows: rows
            .into_iter()
            .map(|(a, b, c)| {
                vec![
                    Cell::words(a),
                    Cell::words(b),
                    Cell::Mark(if c == "not swept" { Level::Fair } else { Level::Good }, c.into()),
                ]
            })
            .collect(),
    }
}
