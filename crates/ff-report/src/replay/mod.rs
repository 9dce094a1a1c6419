//! Robots in motion: a 3-D view in one HTML file that needs nothing from elsewhere.
//!
//! A [`Replay`] is data: scenes beside each other (the identified robot and the prior, a model and the truth), each a tree of
//! [`Node`]s with shapes, natural modes, and a motion if there is one. The page computes poses from joint positions and passive
//! coordinates, so that deflections can be exaggerated and modes animated. `docs/replay.md` is the guide for its readers.
//!
//! | file | what it holds |
//! |---|---|
//! | `scene` | a robot: its nodes, modes, motion |
//! | `node`, `shapes` | a frame and what is drawn on it; shapes of links from inertia |
//! | `appendage` | panels, fuel and wheels as nodes |
//! | `appearance`, `mesh`, `collada` | what a URDF says that links look like |
//! | `motion` | a simulated motion, thinned and packed |
//! | `mass` | the centre of mass and its covariance |
//! | `drawing` | the robot as it stands, for paper |
//! | `page` | the page |

mod appearance;
mod appendage;
mod collada;
mod drawing;
mod mass;
mod mesh;
mod motion;
mod node;
mod page;
mod scene;
mod shapes;
#[cfg(test)]
mod tests;

pub use appearance::Appearance;
pub use mass::Knowledge;
pub use node::{Drawn, Form, Moves, Node, Pose, Role};
pub use scene::{Scene, Subject};

use ffid::exit::Failure;
use serde::Serialize;

/// `format` of the data in a page.
pub const FORMAT: &str = "ffid-replay";
/// Version of the data in a page.
pub const VERSION: u32 = 1;

/// What a page shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Replay {
    /// [`FORMAT`].
    format: &'static str,
    /// [`VERSION`].
    version: u32,
    /// Title of the page.
    pub title: String,
    /// Robots, the first in front.
    pub scenes: Vec<Scene>,
    /// Meshes that scenes name by index.
    meshes: Vec<mesh::Mesh>,
    /// What a reader has to know: what is left out, what was thinned.
    pub notes: Vec<String>,
}

impl Replay {
    /// Scenes that look alike: their bodies have the surfaces of `appearance`. Allocates.
    pub fn new(title: impl Into<String>, scenes: Vec<Scene>, appearance: Appearance) -> Self {
        let Appearance { meshes, notes, .. } = appearance;
        Self { format: FORMAT, version: VERSION, title: title.into(), scenes, meshes, notes }
    }
    /// The first robot as it stands, as SVG: joints at its pose, springs relaxed, meshes as the boxes that hold them. Empty without a
    /// robot. Allocates.
    pub fn drawing(&self) -> String {
        self.scenes.first().map(|s| drawing::svg(s, &self.meshes)).unwrap_or_default()
    }
    /// The page. Allocates.
    ///
    /// # Errors
    /// [`Failure::Numerical`] for numbers that JSON does not know.
    pub fn render(&self) -> Result<String, Failure> {
        page::render(self)
    }
}
