//! What the paper's misprints do to its figures, in numbers: `docs/paper-errata.md` says why each cannot stand.

use super::experiment::{Experiment, LEAD_S, manoeuvre};
use super::score::Columns;
use super::system::System;
use crate::table::sig;
use ff_dynamics::Trace;
use ff_model::Params;
use ff_report::plot::{Figure, Panel};
use nalgebra::Vector3;
use serde::Serialize;
use std::f64::consts::TAU;
use toml::{Table, Value};

/// Longest simulation with springs that repel (s).
const RUNAWAY_S: f64 = 12.0;
/// Deflection at which a panel has plainly left its place (rad).
const GONE: f64 = 0.5;
/// Ringing that a comparison of manoeuvres and tanks takes (s), and of a quick run.
const RING_S: [f64; 2] = [30.0, 8.0];

fn ring_s(s: &System) -> f64 {
    RING_S[usize::from(s.quick)]
}

/// An erratum and what it does.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Effect {
    /// Items of the list of errata.
    pub(super) items: &'static str,
    pub(super) printed: &'static str,
    /// Which figures and tables it touches.
    pub(super) touches: &'static str,
    pub(super) effect: String,
}

/// Every effect, and figures that show some of them.
pub(super) struct Errata {
    pub(super) effects: Vec<Effect>,
    /// Fig. 4 with the signs as printed.
    pub(super) runaway: Figure,
    /// Forces of the fuel on the base (Fig. 3).
    pub(super) forces: Figure,
}

impl Errata {
    /// From both cases, with the noise-free columns of Tables II and III and the residuals of the rigid fits of their records.
    pub(super) fn of(
        flex: &Experiment,
        slosh: &Experiment,
        columns: [&Columns; 2],
        rigid_residuals: &[f64],
    ) -> anyhow::Result<Self> {
        let (gone, runaway) = runaway(flex)?;
        let (force, forces) = forces(slosh);
        let effects = vec![
            Effect {
                items: "1, 2",
                printed: "K and D with negative signs: springs repel, dampers drive",
                touches: "Figs. 4, 6 and all that follows",
                effect: match gone {
                    Some(t) => format!("a panel is {GONE} rad out of place {} s after the start of the manoeuvre and turns over; Fig. 4 decays", sig(t, 2)),
                    None => format!("deflections grow without bound, but not to {GONE} rad within {RUNAWAY_S} s"),
                },
            },
            Effect {
                items: "8",
                printed: "cost (10), the reciprocal of a signed sum",
                touches: "the excitation",
                effect: signed_cost(flex),
            },
            Effect {
                items: "9",
                printed: "maximum speed and acceleration, \"close to Dirac impulse\"",
                touches: "the excitation, Fig. 4",
                effect: timing(flex)?,
            },
            Effect {
                items: "11",
                printed: "cost (11), a signed sum of torque errors",
                touches: "Tables II, III",
                effect: cancelling(rigid_residuals),
            },
            Effect {
                items: "12",
                printed: "all inertias of base and panels are to be estimated",
                touches: "Table II",
                effect: "58 parameters have rank 46 in any record: three combinations per hinge move nothing (crates/ident/tests/recovery.rs)".into(),
            },
            Effect { items: "13", printed: "length, spring and damper of the pendulum are to be estimated", touches: "Fig. 6", effect: twins(slosh)? },
            Effect { items: "14, 15", printed: "force of the fuel (14), with the damper added and the couple left out", touches: "Fig. 3", effect: force },
            Effect { items: "16", printed: "the lateral force is higher than the axial one", touches: "Fig. 3", effect: lateral(&slosh.system) },
            Effect {
                items: "21",
                printed: "the first two natural frequencies",
                touches: "Fig. 5",
                effect: {
                    let hz: Vec<String> = flex.modes.iter().map(|m| sig(m.frequency_hz, 3)).collect();
                    format!("of the four modes ({} Hz) the two that turn the base; the lowest turns it hardly and is missing in the paper", hz.join(", "))
                },
            },
            Effect { items: "22", printed: "0.06 Hz for the fuel", touches: "Fig. 7", effect: frequency(slosh) },
            Effect {
                items: "23",
                printed: "errors against a rigid reference model",
                touches: "Tables II, III",
                effect: {
                    let [f, s] = columns.map(|c| sig(c.floor.mean_pos_m, 3));
                    format!("the true satellite itself is {f} m (panels) and {s} m (fuel) away from it in the mean: no model can be judged below that")
                },
            },
        ];
        Ok(Self { effects, runaway, forces })
    }
}

/// Parameters whose names end in `k[i]` or `d[i]`, multiplied.
fn springs(s: &System, by: f64) -> Params<f64> {
    let decls = s.model().param_decls();
    let is = |name: &str| [".k[", ".d["].iter().any(|p| name.contains(p));
    let values = decls.iter().zip(s.params.values()).map(|(d, x)| if is(&d.name) { by * x } else { *x });
    Params::from_values(s.model(), values.collect())
}

/// Largest deflection of any passive coordinate per sample.
fn deflections(t: &Trace) -> Vec<f64> {
    t.eta.row_iter().map(|r| r.iter().fold(0.0, |m: f64, x| m.max(x.abs()))).collect()
}

/// When a panel has left its place (s after the manoeuvre begins), and base rates with printed and corrected signs until then.
fn runaway(x: &Experiment) -> anyhow::Result<(Option<f64>, Figure)> {
    let s = &x.system;
    // Longer ones until a panel is gone; numbers overflow soon after.
    let (wrong, seconds) = [0.25 * RUNAWAY_S, 0.5 * RUNAWAY_S, RUNAWAY_S]
        .into_iter()
        .map_while(|t| Some((s.fly_for(&springs(s, -1.0), &x.manoeuvre, t).ok()?, t)))
        .reduce(|a, b| if deflections(&a.0).iter().any(|d| *d > GONE) { a } else { b })
        .ok_or_else(|| anyhow::anyhow!("the motion with printed signs cannot be simulated"))?;
    let gone = deflections(&wrong).iter().position(|d| *d > GONE).map(|i| i as f64 * wrong.dt);
    let end = gone.unwrap_or(seconds);
    let rows = ((end / wrong.dt) as usize).min(wrong.len()).min(x.ringing.len());
    let t: Vec<f64> = (0..rows).map(|i| i as f64 * wrong.dt).collect();
    let rate = |trace: &Trace| -> Vec<f64> { (0..rows).map(|i| trace.twist[(i, 3)]).collect() };
    let bent = |trace: &Trace| -> Vec<f64> { deflections(trace)[..rows].to_vec() };
    let figure = Figure::new("Fig. 4 with the signs of (4) as printed")
        .panel(Panel::new("time (s)", "base rate about x (rad/s)").curve("as printed", &t, &rate(&wrong)).curve(
            "corrected",
            &t,
            &rate(&x.ringing),
        ))
        .panel(Panel::new("time (s)", "largest hinge angle (rad)").curve("as printed", &t, &bent(&wrong)).curve(
            "corrected",
            &t,
            &bent(&x.ringing),
        ))
        .caption("Springs that repel and dampers that drive (errata, item 1). The same manoeuvre, the same satellite.");
    Ok((gone.map(|t| t - LEAD_S), figure))
}

/// The sum of (10) over the manoeuvre: signed, against that of the sizes.
fn signed_cost(x: &Experiment) -> String {
    let s = &x.system;
    let axis = s.model().appendages().first().and_then(|a| {
        let links = a.appendage.tree_twin()?.tree_bodies(s.params.appendage(s.model(), 0))?;
        Some(a.mount.rot * links.first()?.axis)
    });
    let hinge: Vector3<f64> = axis.unwrap_or_else(Vector3::x);
    let along: Vec<f64> =
        (0..x.ringing.len()).map(|i| (0..3).map(|k| hinge[k] * x.ringing.accel[(i, 3 + k)]).sum()).collect();
    let moving = ((x.ring_from / x.ringing.dt) as usize).min(along.len());
    let (sum, sizes) = (along[..moving].iter().sum::<f64>(), along[..moving].iter().map(|a| a.abs()).sum::<f64>());
    format!(
        "over the manoeuvre the base's accelerations about the hinges add up to {} of the sum of their sizes: (10) hardly tells a strong manoeuvre from a weak one",
        sig(sum.abs() / sizes, 2)
    )
}

/// What is left ringing when the manoeuvre takes a whole period instead of half a one.
fn timing(x: &Experiment) -> anyhow::Result<String> {
    let s = &x.system;
    let hz = super::experiment::turning_hz(&x.modes);
    let long = manoeuvre(s, 0.5 * hz, ring_s(s))?;
    let rings = |t: &Trace, from: f64| -> f64 {
        let first = (from / t.dt).ceil() as usize;
        let count = (ring_s(s) / t.dt) as usize;
        (first..(first + count).min(t.len())).map(|i| t.twist[(i, 3)].powi(2)).sum::<f64>().sqrt()
    };
    let other = s.fly(&long)?;
    let (half, whole) = (rings(&x.ringing, x.manoeuvre.ringing().0), rings(&other, long.ringing().0));
    Ok(format!(
        "the same speed and acceleration over a whole period of {} Hz, instead of half a one, leave {} of the ringing",
        sig(hz, 3),
        sig(whole / half, 2)
    ))
}

/// How far signed residuals cancel.
fn cancelling(residuals: &[f64]) -> String {
    let (sum, sizes) = (residuals.iter().sum::<f64>(), residuals.iter().map(|r| r.abs()).sum::<f64>());
    format!(
        "the residuals of the rigid fit, which explains the record badly, add up to {} of their sizes: (11) is nearly zero there, and has no minimum",
        sig(sum.abs() / sizes, 2)
    )
}

/// The same satellite with a pendulum of another length whose mass rests at the same place: Fig. 6 hardly changes.
fn twins(x: &Experiment) -> anyhow::Result<String> {
    const LONGER: f64 = 1.25;
    let other = x.source.with(x.system.quick, |m| lengthen(m, LONGER))?;
    let t = other.fly_for(&other.params, &x.manoeuvre, x.ring_from + ring_s(&x.system))?;
    let rows = t.len().min(x.ringing.len());
    let far = |a: &nalgebra::DMatrix<f64>, b: &nalgebra::DMatrix<f64>| {
        let (mut most, mut size) = (0.0_f64, 0.0_f64);
        for i in 0..rows {
            for j in 0..a.ncols() {
                most = most.max((a[(i, j)] - b[(i, j)]).abs());
                size = size.max(a[(i, j)].abs());
            }
        }
        most / size
    };
    Ok(format!(
        "an arm {LONGER} times as long, its spring and damper {:.2} times as strong and its fulcrum moved so that the mass rests where it did give Fig. 6 to {} of its \
         largest torque and {} of its largest base rate",
        LONGER * LONGER,
        sig(far(&x.ringing.tau, &t.tau), 2),
        sig(far(&x.ringing.gyro(), &t.gyro()), 2)
    ))
}

fn lengthen(m: &mut Table, by: f64) {
    let all = m.get_mut("appendage").and_then(Value::as_array_mut).into_iter().flatten();
    for t in all.filter_map(Value::as_table_mut) {
        let Some(length) = t.get("length_m").and_then(Value::as_float) else { continue };
        t.insert("length_m".into(), Value::Float(by * length));
        for key in ["stiffness_nm_per_rad", "damping_nms_per_rad"] {
            let Some(list) = t.get_mut(key).and_then(Value::as_array_mut) else { continue };
            for v in list.iter_mut() {
                *v = Value::Float(by * by * v.as_float().unwrap_or(0.0));
            }
        }
        // The mass rests below the fulcrum: this goes up by what the arm has grown.
        let mount = t.get_mut("mount").and_then(|m| m.get_mut("xyz_m")).and_then(Value::as_array_mut);
        if let Some(z) = mount.and_then(|xyz| xyz.get_mut(2)) {
            *z = Value::Float(z.as_float().unwrap_or(0.0) + (by - 1.0) * length);
        }
    }
}

/// The first pendulum of a satellite: mass (kg), length (m), spring and damper about the first axis.
fn pendulum(s: &System) -> [f64; 4] {
    let decls = s.model().param_decls();
    ["tank.mass", "tank.length", "tank.k[0]", "tank.d[0]"]
        .map(|name| decls.iter().position(|d| d.name == name).map_or(f64::NAN, |i| s.params.values()[i]))
}

/// Fig. 3: the lateral force and the couple of the fuel on the base while it rings, and the force as (14) has it; then the lateral force on a
/// base that shakes.
fn forces(x: &Experiment) -> (String, Figure) {
    let [m, l, k, d] = pendulum(&x.system);
    let t = x.ringing.times();
    let end = (x.ring_from + 40.0).min(t.last().copied().unwrap_or(0.0));
    let rows = t.iter().take_while(|u| **u <= end).count();
    let swing = |f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        (0..rows).map(|i| f(x.ringing.eta[(i, 0)], x.ringing.nu[(i, 0)])).collect()
    };
    // Small angles: -m (x'' + l a'') = (k a + d a') / l, so that (14), which adds d a' / l to m (x'' + l a''), is -k a / l.
    let force = swing(&|a, v| (k * a + d * v) / l);
    let printed = swing(&|a, _| -k * a / l);
    let couple = swing(&|a, v| k * a + d * v);
    let largest = |y: &[f64]| y.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let apart: Vec<f64> = force.iter().zip(&printed).map(|(a, b)| a - b).collect();
    let said = format!(
        "(14) is off by up to {} of the force, which is at most {} N here, and has the opposite sign; the couple of up to {} N m is missing",
        sig(largest(&apart) / largest(&force), 3),
        sig(largest(&force), 3),
        sig(largest(&couple), 3)
    );
    let w = (k / (m * l * l)).sqrt();
    let zeta = d / (2.0 * (k * m * l * l).sqrt());
    let hz: Vec<f64> = (1..=600).map(|i| 0.0005 * f64::from(i)).collect();
    let ratio = |f: &f64| {
        let u = (TAU * f / w).powi(2);
        ((1.0 + 4.0 * zeta * zeta * u) / ((1.0 - u).powi(2) + 4.0 * zeta * zeta * u)).sqrt()
    };
    let lateral: Vec<f64> = hz.iter().map(ratio).collect();
    let frozen = vec![1.0; hz.len()];
    let (t, half) = (&t[..rows], core::f64::consts::SQRT_2 * w / TAU);
    let figure = Figure::new("Fig. 3: what the fuel does to the base")
        .panel(
            Panel::new("time (s)", "force (N)")
                .titled("A) lateral force of the fuel on the base while it rings, in the plane of swing[0]")
                .curve("corrected", t, &force)
                .curve("(14) as printed", t, &printed)
                .vline(x.ring_from, "joints hold"),
        )
        .panel(
            Panel::new("time (s)", "couple (N m)")
                .titled("B) its couple about the fulcrum, which (14) and (15) leave out")
                .curve("", t, &couple)
                .vline(x.ring_from, "joints hold"),
        )
        .panel(
            Panel::log_y("frequency (Hz)", "force over that of frozen fuel")
                .titled("C) lateral force on a base that shakes at one frequency")
                .curve("lateral", &hz, &lateral)
                .curve("axial", &hz, &frozen)
                .vline(w / TAU, format!("{:.3} natural frequency", w / TAU))
                .vline(half, format!("{half:.3} from here on lower than axial")),
        )
        .caption("A and B: noise-free simulation of Fig. 6, small angles. C: Table I, base motion prescribed (errata, item 16).");
    (said, figure)
}

fn lateral(s: &System) -> String {
    let [m, l, k, d] = pendulum(s);
    let w = (k / (m * l * l)).sqrt();
    let zeta = d / (2.0 * (k * m * l * l).sqrt());
    let ratio = |u: f64| ((1.0 + 4.0 * zeta * zeta * u) / ((1.0 - u).powi(2) + 4.0 * zeta * zeta * u)).sqrt();
    format!(
        "{} times at the natural frequency, but {} at twice it: true below {} Hz only",
        sig(ratio(1.0), 2),
        sig(ratio(4.0), 2),
        sig(core::f64::consts::SQRT_2 * w / TAU, 3)
    )
}

fn frequency(x: &Experiment) -> String {
    let [m, l, ..] = pendulum(&x.system);
    let held = x.cantilever.iter().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min);
    let wanted = (TAU * 0.06).powi(2);
    let free: Vec<String> = x.modes.iter().map(|m| sig(m.frequency_hz, 4)).collect();
    format!(
        "Table I gives {} Hz with the base held and {} Hz on the free base; 0.06 Hz would take a spring of {} N m/rad",
        sig(held, 3),
        free.join(" and "),
        sig(wanted * m * l * l, 2)
    )
}
