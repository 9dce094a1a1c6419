//! `[[client]]`: what the robot holds. A rigid body of ten parameters with a frame of its own, on which panels and tanks
//! hang like on any link.

use super::appendage::Mount;
use super::reader::{Table, error};
use super::robot::RigidBody;
use ff_model::payload::Payload;
use serde::Serialize;
use std::sync::Arc;

/// One `[[client]]`: a body held by a link, by the end effector unless another is named.
///
/// ```toml
/// [[client]]
/// name = "client"
/// mass_kg = 320.0
/// com_m = [0.0, 0.1, 0.6]
/// inertia_com_kgm2 = [90.0, 0.0, 0.0, 80.0, 0.0, 70.0]
///
/// [[appendage]]
/// kind = "slosh_pendulum"
/// name = "client_tank"
/// host = "client"
/// # ...
/// ```
///
/// Its parameters are `client.body.mass` and so on, about the client frame. Appendages with `host = "client"` hang on it,
/// mounted in its frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Client {
    /// `name`: name of its frame, prefix of its parameters. Required; no dots, brackets, stars or blanks.
    pub name: String,
    /// `host`: the link that holds it; `robot.end_effector` unless given.
    pub host: Option<String>,
    /// `mount`: pose of the client frame in the link frame; the link frame itself unless given.
    pub mount: Mount,
    /// `mass_kg`, `com_m`, `inertia_com_kgm2`: the body, in the client frame.
    #[serde(flatten)]
    pub body: RigidBody,
}

impl Client {
    /// Reads one table; `None` where a problem is recorded.
    pub(super) fn read(t: &Table<'_, '_>) -> Option<Self> {
        let name = super::appendage::name(t);
        let host = t.string("host");
        let mount = Mount::of_table(t);
        let body = RigidBody::read(t);
        t.finish();
        Some(Self { name: name?, host, mount: mount?, body: body? })
    }
    /// As an appendage without coordinates; `None` where a problem is recorded.
    pub(super) fn payload(&self, t: &Table<'_, '_>) -> Option<Arc<Payload>> {
        match Payload::new(&self.body.inertia()) {
            Ok(p) => Some(Arc::new(p)),
            Err(e) => {
                let p = error("Config::Inertia", e.to_string());
                t.fail("inertia_com_kgm2", p.hint("give the inertia about the centre of mass"));
                None
            }
        }
    }
}
