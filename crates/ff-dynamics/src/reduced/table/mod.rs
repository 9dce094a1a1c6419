//! A prescribed joint motion, condensed once into what the base and the passive coordinates feel of it.
//!
//! With the joints following a given motion, the arm is one time-varying rigid body plus a momentum. Let `r` be the
//! position of a mass element in base coordinates and a dot its rate seen from the base. At base angular velocity `w`,
//! angular acceleration `al` and classical acceleration `a` of the origin, the wrench about the base origin that keeps
//! the arm moving is `f = int a(r) dm`, `n = int r x a(r) dm` with
//! `a(r) = a + al x r + w x (w x r) + 2 w x r. + r..`, that is
//!
//! ```text
//! f = m a + al x h + w x (w x h + 2 h.) + h..
//! n = J al + h x a + w x J w + C w + L.
//! h = int r dm,  J = int (r.r) 1 - r r^T dm,  L. = int r x r.. dm,
//! C = 2 (tr(K) 1 - K^T),  K = int r r.^T dm      (Coriolis: C w = 2 int r x (w x r.) dm).
//! ```
//!
//! None of it depends on the state of the base or of the appendages, nor on their parameters: 28 numbers per instant,
//! tabulated once per record and arm, and every later evaluation costs the same whatever the number of joints. The same
//! sums over the subtree of joint `j`, contracted with its screw `(s, u)` about the base origin, give its torque
//!
//! ```text
//! tau_j = ga.a + gb.al + gw.w + w^T Q w + c,
//! ga = m s + u x h,  gb = h x s + J u,  gw = 2 h. x s + C^T u,  c = s.h.. + u.L.,
//! w^T Q w = s.(w x (w x h)) + u.(w x J w).
//! ```
//!
//! These equations stand once, over any scalar (`sweep`). Tables of records are filled for several instants at a
//! time, one per lane (`fill.rs`); [`ArmModel`] evaluates one instant, with derivatives or with other links in
//! every lane.
pub(crate) mod arm_model;
pub(crate) mod arm_table;
pub(crate) mod disturbance;
pub(crate) mod fill;
mod instants;
pub(crate) mod key;
pub(crate) mod numbers;
mod pool;
pub(crate) mod prescribed;
pub(crate) mod sampling;
pub(crate) mod slopes;
pub(crate) mod source;
pub(crate) mod sweep;

pub use arm_model::ArmModel;
pub use arm_table::ArmTable;
pub use disturbance::{BaseWrench, Disturbance, Disturbances};
pub(crate) use fill::Filler;
pub use key::TableKey;
pub(crate) use numbers::products;
pub use numbers::{Arm, Frame, JointRow, TorqueForm};
pub use prescribed::Prescribed;
pub(crate) use prescribed::Site;
pub use sampling::Sampling;
pub(crate) use source::{ArmSource, OnePerLane};
