//! `ff-bench sizes`: time against the number of bodies, for chains of joints and for bases with panels.

use crate::functions::{Function, Runner};
use crate::generate;
use crate::states::Set;
use crate::timing::time;
use anyhow::anyhow;
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Xform};
use flex_panel::{PanelChain, Segment};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// Arguments of `sizes`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Repetitions of the loop over the states
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,
    /// States per system
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    states: u32,
}

/// One point of the figure.
#[derive(Serialize)]
struct Line {
    /// `chain` or `panels`.
    family: &'static str,
    /// Links of the chain; panels on the base.
    size: usize,
    r#fn: &'static str,
    median_ns: f64,
    min_ns: f64,
    max_ns: f64,
}

/// Bodies of the chain.
const CHAIN: [usize; 13] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 40, 48, 64];
/// Panels on the base.
const PANELS: [usize; 9] = [1, 2, 3, 4, 6, 8, 10, 12, 16];

/// Times every size.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    for n in CHAIN {
        one(args, "chain", n, &chain(n))?;
    }
    for n in PANELS {
        one(args, "panels", n, &panels(n)?)?;
    }
    Ok(())
}

fn one(args: &Args, family: &'static str, size: usize, model: &Model) -> anyhow::Result<()> {
    let samples = generate::samples(model, args.states as usize);
    let mut r = Runner::<f64>::new(model, Set::new(model, &samples)?);
    crate::check::mutual(&format!("{family} of {size}"), &mut r)?;
    for f in [Function::Rnea, Function::Crba, Function::Fd, Function::Hybrid] {
        // `mutual` has shown that none of these states is singular.
        let t = time(samples.len(), 1, args.reps as usize, |i| r.call(f, i).unwrap_or(f64::NAN));
        let line = Line { family, size, r#fn: f.text(), median_ns: t.median_ns, min_ns: t.min_ns, max_ns: t.max_ns };
        println!("{}", serde_json::to_string(&line)?);
    }
    Ok(())
}

/// A free base of the size of the peers', so that long chains do not swing it about.
fn base() -> Model {
    let about_com = Matrix3::from_diagonal(&Vector3::new(150.0, 170.0, 160.0));
    let body = Inertia::from_com(600.0, &Vector3::new(0.9, 0.1, 0.6), &about_com);
    Model::new("sizes", "base", body, BaseKind::Floating)
}

/// One chain of `n` equal links on skewed axes.
fn chain(n: usize) -> Model {
    let mut model = base();
    let about_com = Matrix3::from_diagonal(&Vector3::new(0.4, 0.04, 0.35));
    let link = Inertia::from_com(8.0, &Vector3::new(0.02, 0.2, 0.01), &about_com);
    let mut parent = 0;
    for i in 0..n {
        let joint = Joint {
            name: format!("j{i}"),
            kind: JointKind::Revolute,
            axis: Vector3::new(0.3, 0.9 - 0.4 * (i % 3) as f64, 0.5),
            placement: Xform::new(rot_of_rpy(&Vector3::new(0.2, -0.1, 0.3)), Vector3::new(0.03, 0.4, -0.02)),
            limits: JointLimits::default(),
        };
        parent = model.add_body(parent, format!("l{i}"), joint, link);
    }
    model
}

/// A base with `n` panels of two hinged segments, around its middle.
fn panels(n: usize) -> anyhow::Result<Model> {
    let mut model = base();
    let about_com = Matrix3::from_diagonal(&Vector3::new(3.0, 2.0, 3.5));
    for k in 0..n {
        let segment = |x: f64| {
            let hinge = Vector3::new(x, 0.05, 0.02);
            Segment::new(6.0, Vector3::new(0.5, 0.03, 0.01), &about_com, hinge, Vector3::new(0.1, 1.0, 0.2))
                .with_spring(120.0, 1.5)
        };
        let panel = PanelChain::new(vec![segment(0.1), segment(1.0)]).map_err(|p| anyhow!("{p}"))?;
        let angle = std::f64::consts::TAU * (k as f64 + 0.3) / n as f64;
        let at = Vector3::new(0.9 + angle.cos(), 0.1 + angle.sin(), 0.6);
        let mount = Xform::new(rot_of_rpy(&Vector3::new(0.1, 0.05, angle)), at);
        model.mount(format!("panel{k}"), 0, mount, panel.into()).map_err(|p| anyhow!("{p}"))?;
    }
    Ok(model)
}
