//! Robots from SDF, the model files of Gazebo, as the links and joints that [`crate::urdf`] makes a model of.
//!
//! Read are the links and joints of the one `<model>` of a file, with poses against any link, joint or frame of the model (`relative_to`), axes in any of
//! their frames (`expressed_in`), limits, dynamics with springs, and `<mimic>`. The frame of a link is that of its joint, as in URDF. A link without
//! `<inertial>` has 1 kg and 1 kg m^2, which is what SDF says, with a warning. Refused are nested models and `<include>`.
pub(crate) mod reader;

pub(crate) use reader::read;
