//! Speed of a frame, such as the end effector.

use super::base::direction;
use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::signal::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use ff_dynamics::{State, Work, frame_jacobian};
use ff_model::Model;
use ff_model::tree::Frame;
use nalgebra::{DMatrix, Vector3};
use std::sync::Arc;

/// Speed of the origin of a frame against inertial space at zero momentum (m/s), at most `limit`.
///
/// With `c_k`, `w_k` the linear and angular velocity of the frame per unit of the rate of joint `k` of the tree, `W` the base rate and
/// `B` the base columns of the frame Jacobian, `v = sum c_k qd_k + B V` and
///
/// ```text
/// dv/dq_l = W x c_l + sum_k (w_min(k,l) x c_max(k,l)) qd_k + B dV/dq_l,     dv/dqd_l = c_l + B dV/dqd_l,
/// ```
///
/// because a joint turns all that it carries and moves the lever of what carries it. Where joints follow others, derivatives are folded to
/// the coordinates.
#[derive(Clone, Debug)]
pub struct FrameSpeed {
    system: Arc<HeldSystem>,
    /// The tree with every joint moving by itself.
    tree: Model,
    frame: Frame,
    channel: [Channel; 1],
}

/// Buffers of [`FrameSpeed`].
#[derive(Clone, Debug)]
pub struct FrameWork {
    held: HeldWork,
    partials: HeldPartials,
    state: State<f64>,
    work: Work<f64>,
    /// Rates of the joints of the tree.
    rates: Vec<f64>,
    jacobian: DMatrix<f64>,
}

impl FrameSpeed {
    /// For a frame of the model by name (every URDF link is one). Allocates.
    ///
    /// # Errors
    /// [`ConstraintError::Unknown`] with the frames there are, [`ConstraintError::Limit`].
    pub fn new(system: &Arc<HeldSystem>, frame: &str, limit: f64) -> Result<Self, ConstraintError> {
        check_limit(&format!("speed of {frame}"), limit, "m/s")?;
        let m = system.model();
        let found = m.frame(frame).cloned().ok_or_else(|| {
            let known = m.frames().iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
            ConstraintError::Unknown { kind: "frame", name: frame.into(), known }
        })?;
        let channel = [Channel::at_most("frame speed", frame, "m/s", limit)];
        Ok(Self { system: system.clone(), tree: m.spanning(), frame: found, channel })
    }
    /// Velocity of the frame's origin in its axes; the frame Jacobian stays in `jacobian`.
    fn velocity(&self, w: &mut FrameWork, q: &[f64], qd: &[f64], twist: &[f64]) -> Vector3<f64> {
        for (i, (to, rate)) in w.state.q.iter_mut().zip(&mut w.rates).enumerate() {
            let c = self.system.model().coordinate(i);
            (*to, *rate) = (c.multiplier * q[c.index] + c.offset, c.multiplier * qd[c.index]);
        }
        frame_jacobian(&self.tree, &w.state, &self.frame, &mut w.work, &mut w.jacobian);
        let mut v = Vector3::zeros();
        for (k, rate) in twist.iter().chain(&w.rates).enumerate() {
            v += w.jacobian.fixed_view::<3, 1>(0, k) * *rate;
        }
        v
    }
}

impl Signal for FrameSpeed {
    type Work = FrameWork;
    fn channels(&self) -> &[Channel] {
        &self.channel
    }
    fn work(&self) -> FrameWork {
        let m = &self.tree;
        FrameWork {
            held: self.system.work(),
            partials: self.system.partials(),
            state: State::zero(m),
            work: Work::new(m),
            rates: vec![0.0; m.nj()],
            jacobian: DMatrix::zeros(6, m.nv()),
        }
    }
    fn drive(&self, w: &mut FrameWork, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        if partials.is_some() {
            self.system.differentiate(&mut w.held, s, &mut w.partials);
        } else {
            self.system.evaluate(&mut w.held, s);
        }
        let [q, qd, _] = s;
        let n = q.len();
        let twist = w.held.twist;
        let v = self.velocity(w, q, qd, twist.as_slice());
        u[0] = v.norm();
        let Some(out) = partials else { return };
        let e = direction(&v);
        let j = &w.jacobian;
        let lin = |k: usize| j.fixed_view::<3, 1>(0, k).into_owned();
        let ang = |k: usize| j.fixed_view::<3, 1>(3, k).into_owned();
        let base = |d: usize| (0..6).map(|c| lin(c) * w.partials.twist[(c, d)]).sum::<Vector3<f64>>();
        let rate: Vector3<f64> = (0..6).map(|c| ang(c) * twist[c]).sum();
        for l in 0..n {
            out[(0, l)] = e.dot(&base(l));
            out[(0, n + l)] = e.dot(&base(n + l));
            out[(0, 2 * n + l)] = 0.0;
        }
        for i in 0..w.rates.len() {
            let mut dv = rate.cross(&lin(6 + i));
            for (k, qd) in w.rates.iter().enumerate() {
                dv += ang(6 + k.min(i)).cross(&lin(6 + k.max(i))) * *qd;
            }
            let c = self.system.model().coordinate(i);
            out[(0, c.index)] += c.multiplier * e.dot(&dv);
            out[(0, n + c.index)] += c.multiplier * e.dot(&lin(6 + i));
        }
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = self.velocity(&mut Signal::work(self), at.q, at.qd, &at.twist).norm();
    }
}
