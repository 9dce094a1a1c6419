//! The peers' space robot (`peers/src/make_models.py`, `fixtures/peers-model`) in both of our forms.

use anyhow::anyhow;
use clap::ValueEnum;
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, DynAppendage, Inertia, Joint, JointKind, Model, Xform};
use flex_panel::{PanelChain, Segment};
use nalgebra::{Matrix3, Vector3};
use slosh_pendulum::SloshPendulum;
use std::sync::Arc;

/// Which of the peers' models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Name {
    /// Base and seven joints.
    Rigid,
    /// With two wings of two panels each.
    Flex,
    /// With one fuel pendulum.
    Slosh,
}

impl Name {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [Self::Rigid, Self::Flex, Self::Slosh];

    /// The forms worth timing: without passive bodies both are one.
    pub(crate) fn forms(self) -> &'static [Form] {
        if self == Self::Rigid { &[Form::Ports] } else { &[Form::Ports, Form::Tree] }
    }
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Flex => "flex",
            Self::Slosh => "slosh",
        }
    }
}

/// How the passive bodies are described.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Form {
    /// As appendages with springs and dampers: the form users have, and the one that is compared.
    Ports,
    /// As ordinary joints of the tree, without springs: what the peers compute.
    Tree,
}

impl Form {
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Ports => "ports",
            Self::Tree => "tree",
        }
    }
}

/// A model of the peers with the springs of its passive coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Peer {
    pub(crate) name: Name,
    pub(crate) form: Form,
    pub(crate) model: Model,
    /// `(k, d)` per passive coordinate, as far as the model contains them: zero in the tree form.
    pub(crate) springs: Vec<(f64, f64)>,
}

impl Peer {
    /// Model and form in words.
    pub(crate) fn label(&self) -> String {
        format!("{} {}", self.name.text(), self.form.text())
    }
}

const PANEL: (f64, f64) = (200.0, 2.0);
const SLOSH: (f64, f64) = (20.0, 5.0);

/// Builds one. The rigid model has no passive bodies: both forms are the same.
pub(crate) fn build(name: Name, form: Form) -> anyhow::Result<Peer> {
    let mut model = arm();
    let springs = match (name, form) {
        (Name::Rigid, _) => Vec::new(),
        (Name::Flex, Form::Ports) => {
            for (wing, x, side) in WINGS {
                let hinges = [0.0, 2.0 * side].map(|x| Vector3::new(x, 0.0, 0.0));
                let segment = |hinge| Segment {
                    inertia: panel(side),
                    hinge,
                    axis: Vector3::y(),
                    stiffness: PANEL.0,
                    damping: PANEL.1,
                    rest: 0.0,
                };
                let chain = PanelChain::new(hinges.map(segment).to_vec()).map_err(|p| anyhow!("{p}"))?;
                mount(&mut model, wing, Vector3::new(x, 0.0, 0.6), chain.into())?;
            }
            vec![PANEL; 4]
        }
        (Name::Flex, Form::Tree) => {
            for (wing, x, side) in WINGS {
                let mut add = |parent, k: usize, at| {
                    let joint = revolute(format!("{wing}_{k}"), Vector3::y(), Xform::new(Matrix3::identity(), at));
                    model.add_body(parent, format!("{wing}_{k}"), joint, panel(side))
                };
                let inner = add(0, 1, Vector3::new(x, 0.0, 0.6));
                add(inner, 2, Vector3::new(2.0 * side, 0.0, 0.0));
            }
            vec![(0.0, 0.0); 4]
        }
        (Name::Slosh, Form::Ports) => {
            let p = SloshPendulum::new(100.0, 0.8, [SLOSH.0; 2], [SLOSH.1; 2]).map_err(|p| anyhow!("{p}"))?;
            mount(&mut model, "slosh", FULCRUM, p.into())?;
            vec![SLOSH; 2]
        }
        (Name::Slosh, Form::Tree) => {
            let at = Xform::new(Matrix3::identity(), FULCRUM);
            let cross = model.add_body(0, "slosh_u", revolute("slosh_x".into(), Vector3::x(), at), Inertia::zero());
            let fuel = Inertia::point(100.0, &Vector3::new(0.0, 0.0, -0.8));
            model.add_body(cross, "slosh_mass", revolute("slosh_y".into(), Vector3::y(), Xform::identity()), fuel);
            vec![(0.0, 0.0); 2]
        }
    };
    Ok(Peer { name, form, model, springs })
}

const WINGS: [(&str, f64, f64); 2] = [("panel_a", 1.8, 1.0), ("panel_b", 0.0, -1.0)];
const FULCRUM: Vector3<f64> = Vector3::new(0.9, 0.0, 0.9);

fn panel(side: f64) -> Inertia<f64> {
    let about_com = Matrix3::from_diagonal(&Vector3::new(15.0, 11.0, 15.0));
    Inertia::from_com(33.0, &Vector3::new(side, 0.0, 0.0), &about_com)
}

fn mount(model: &mut Model, name: &str, at: Vector3<f64>, appendage: Arc<dyn DynAppendage>) -> anyhow::Result<()> {
    model.mount(name, 0, Xform::new(Matrix3::identity(), at), appendage).map_err(|p| anyhow!("{p}"))
}

fn revolute(name: String, axis: Vector3<f64>, placement: Xform<f64>) -> Joint {
    Joint { name, kind: JointKind::Revolute, axis, placement, limits: JointLimits::default() }
}

/// Base and seven joints.
fn arm() -> Model {
    let length = 3.0 / 7.0;
    let about_com = Matrix3::from_diagonal_element(150.0);
    let base = Inertia::from_com(600.0, &Vector3::new(0.9, 0.0, 0.6), &about_com);
    let mut model = Model::new("peers", "base", base, BaseKind::Floating);
    let about_com = Matrix3::from_diagonal(&Vector3::new(0.4, 0.04, 0.4));
    let link = Inertia::from_com(60.0 / 7.0, &Vector3::new(0.0, length / 2.0, 0.0), &about_com);
    let mut parent = 0;
    for i in 1..=7 {
        let axis = if i % 2 == 1 { Vector3::y() } else { Vector3::z() };
        let placement = if i == 1 {
            let upright = rot_of_rpy(&Vector3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0));
            Xform::new(upright, Vector3::new(0.4, 0.0, 1.2))
        } else {
            Xform::new(Matrix3::identity(), Vector3::new(0.0, length, 0.0))
        };
        parent = model.add_body(parent, format!("arm_l{i}"), revolute(format!("arm_j{i}"), axis, placement), link);
    }
    model
}
