//! Poses and Jacobians of named frames.

use crate::state::State;
use crate::work::buffers::Work;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::so3::quat_to_rot;
use ff_model::tree::Frame;
use ff_model::{Model, Motion, Xform};
use nalgebra::DMatrix;

/// Pose of a frame in the world. Does not allocate.
pub fn frame_pose<T: ModelScalar>(model: &Model, state: &State<T>, frame: &Frame, work: &mut Work<T>) -> Xform<T> {
    work.place(model, &state.q);
    let mut x = frame.placement.lift();
    let mut i = frame.body;
    while i > 0 {
        x = work.x[i] * x;
        i = model.bodies()[i - 1].parent;
    }
    Xform::new(quat_to_rot(&state.att), state.pos) * x
}

/// Frame Jacobian in frame coordinates: `V_frame = J [base twist | qd | nu]`, `6 x nv`, linear rows first.
///
/// Passive columns are zero (an appendage does not move its host kinematically). Does not allocate.
///
/// # Panics
/// If `j` is not `6 x nv`.
pub fn frame_jacobian<T: ModelScalar>(
    model: &Model,
    state: &State<T>,
    frame: &Frame,
    work: &mut Work<T>,
    j: &mut DMatrix<T>,
) {
    work.place(model, &state.q);
    assert_eq!(j.shape(), (6, model.nv()), "Jacobian shape");
    j.fill(T::zero());
    let nb = model.nb();
    let mut write = |col: usize, m: &Motion<T>| {
        for r in 0..6 {
            j[(r, col)] += m.get(r);
        }
    };
    let mut x: Xform<T> = frame.placement.lift();
    let mut i = frame.body;
    while i > 0 {
        let along = model.coordinate(i - 1);
        write(nb + along.index, &x.motion_to_child(&work.joint_motion(model, i)).scaled(T::from_f64(along.multiplier)));
        x = work.x[i] * x;
        i = model.bodies()[i - 1].parent;
    }
    for c in 0..nb {
        let mut e = [T::zero(); 6];
        e[c] = T::one();
        write(c, &x.motion_to_child(&Motion::from_slice(&e)));
    }
}
