//! The table of a prescribed motion: numbers of the arm at half integration steps, rows of joints at samples.

use super::numbers::{ARM, Arm, FORM, FRAME, Frame, JointRow, ROW, TorqueForm, columns};
use super::pool::Pool;
use super::sampling::Sampling;
use super::slopes::Slopes;
use ff_lanes::WIDEST;
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::{Model, Xform};

/// Tables of one prescribed motion: nodes at half integration steps, joint rows at samples.
///
/// ```
/// use ff_dynamics::{Prescribed, Sampling};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// // 2 s at 50 Hz, two integration steps per sample.
/// let sampling = Sampling { samples: 101, sample_s: 0.02, substeps: 2 };
/// let table = Prescribed::new(&robot, &Params::nominal(&robot), &motion, &sampling, &[]);
/// assert_eq!((table.samples(), table.sample_s(), table.step()), (101, 0.02, 0.01));
/// ```
#[derive(Clone, Debug)]
pub struct Prescribed {
    /// Integration step (s); nodes lie at half steps.
    pub(crate) step: f64,
    pub(crate) substeps: usize,
    pub(crate) samples: usize,
    pub(crate) sample_s: f64,
    /// Sample of the motion that is the first of the table.
    pub(crate) first: usize,
    pub(crate) nj: usize,
    /// [`ARM`] numbers per node (base body not included).
    pub(crate) arm: Vec<f64>,
    /// [`FRAME`] numbers per moving frame and node.
    pub(crate) frames: Vec<f64>,
    /// Frames of the appendages' mounts, then of the tracked links: column among the moving ones, or at rest.
    pub(crate) sites: Vec<Site>,
    pub(crate) moving: usize,
    /// Tracked links.
    pub(crate) links: Vec<usize>,
    /// [`ROW`] numbers per joint and sample.
    pub(crate) rows: Vec<f64>,
    /// `[q | qd | qdd]` per sample.
    pub(crate) joints: Vec<f64>,
    /// [`FORM`] numbers per node: the power of the joint torques, `sum_j qd_j tau_j`, where it was asked for.
    pub(crate) power: Vec<f64>,
    /// `above[body]`: joints on the way from that body to the base (0-based joint indices).
    pub(crate) above: Vec<Vec<usize>>,
    /// Derivatives with respect to kinematic parameters, where they were asked for.
    pub(crate) slopes: Slopes,
}

/// Where a frame is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Site {
    /// At rest in the base.
    Base(Xform<f64>),
    /// Moving with the body of this index, here in it: column of the table.
    Body(usize, Xform<f64>, usize),
}

impl Prescribed {
    /// Tables of the right size, to be filled.
    pub(crate) fn empty(model: &Model, sampling: &Sampling, links: &[usize]) -> Self {
        Self::empty_in(&mut Pool::default(), model, sampling, links)
    }
    /// [`Prescribed::empty`] in memory that is at hand.
    pub(crate) fn empty_in(pool: &mut Pool, model: &Model, sampling: &Sampling, links: &[usize]) -> Self {
        let mut t = Self::layout(model, sampling, links);
        let nodes = sampling.nodes();
        t.arm = pool.zeros(nodes * ARM);
        t.frames = pool.zeros(nodes * t.moving * FRAME);
        t.rows = pool.zeros(t.samples * t.nj * ROW);
        t.joints = pool.zeros(t.samples * 3 * t.nj);
        t
    }
    /// Its memory, in the order in which a table like it takes it.
    pub(crate) fn into_pool(self) -> Pool {
        let mut pool = Pool::default();
        pool.put([self.arm, self.frames, self.rows, self.joints].into_iter().chain(self.slopes.into_vectors()));
        pool
    }

    /// Steps, samples and sites, without tables.
    pub(crate) fn layout(model: &Model, sampling: &Sampling, links: &[usize]) -> Self {
        let Sampling { samples, sample_s, substeps } = *sampling;
        assert!(samples > 0 && substeps > 0, "at least one sample and one step per sample");
        let nj = model.nj();
        let mut above = vec![Vec::new(); model.n_bodies()];
        for i in 1..model.n_bodies() {
            let mut path = vec![i - 1];
            path.extend_from_slice(&above[model.bodies()[i - 1].parent]);
            above[i] = path;
        }
        let mut moving = 0;
        let mut site = |host: usize, x: Xform<f64>| {
            if host == 0 {
                return Site::Base(x);
            }
            moving += 1;
            Site::Body(host, x, moving - 1)
        };
        let mut sites: Vec<Site> = model.appendages().iter().map(|a| site(a.host, a.mount)).collect();
        sites.extend(links.iter().map(|&l| site(l, Xform::identity())));
        Self {
            step: sampling.step(),
            substeps,
            samples,
            sample_s,
            first: 0,
            nj,
            arm: Vec::new(),
            frames: Vec::new(),
            sites,
            moving,
            links: links.to_vec(),
            rows: Vec::new(),
            joints: Vec::new(),
            power: Vec::new(),
            above,
            slopes: Slopes::default(),
        }
    }

    /// With the power of the joint torques at every node, once filled.
    pub(crate) fn with_power(mut self) -> Self {
        self.power = vec![0.0; self.arm.len() / ARM * FORM];
        self
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }
    /// Time between samples (s).
    pub fn sample_s(&self) -> f64 {
        self.sample_s
    }
    /// Time of the first sample of the table since the beginning of the motion (s).
    pub fn start_s(&self) -> f64 {
        self.first as f64 * self.sample_s
    }
    /// Node of the motion that is the first of the table.
    pub(crate) fn first_node(&self) -> usize {
        self.node_of(self.first)
    }
    /// Integration step (s).
    pub fn step(&self) -> f64 {
        self.step
    }
    /// The arm at a node, the same in every lane.
    #[inline(always)]
    pub(crate) fn arm<T: ModelScalar>(&self, node: usize) -> Arm<T> {
        let x = &self.arm[node * ARM..(node + 1) * ARM];
        Arm::read(|i| T::from_f64(x[i]))
    }
    /// The arm at several nodes, one per lane.
    #[inline(always)]
    pub(crate) fn arms<L: LaneScalar>(&self, nodes: &[usize]) -> Arm<L> {
        let all: [L; ARM] = columns(&self.arm, nodes);
        Arm::read(|i| all[i])
    }
    /// A frame that moves, at a node.
    #[inline(always)]
    pub(crate) fn frame<T: ModelScalar>(&self, column: usize, node: usize) -> Frame<T> {
        let x = &self.frames[(node * self.moving + column) * FRAME..][..FRAME];
        Frame::read(|i| T::from_f64(x[i]))
    }
    /// A frame that moves, at several nodes, one per lane.
    #[inline(always)]
    pub(crate) fn frames_at<L: LaneScalar>(&self, column: usize, nodes: &[usize]) -> Frame<L> {
        let mut places = [0; WIDEST];
        places.iter_mut().zip(&nodes[..L::N]).for_each(|(p, n)| *p = n * self.moving + column);
        let all: [L; FRAME] = columns(&self.frames, &places);
        Frame::read(|i| all[i])
    }
    /// The row of joint `j` at a sample.
    #[inline(always)]
    pub(crate) fn row<T: ModelScalar>(&self, sample: usize, j: usize) -> JointRow<T> {
        JointRow::read(&self.rows[(sample * self.nj + j) * ROW..], T::from_f64)
    }
    /// Whether the power of the joint torques is tabulated.
    #[inline(always)]
    pub(crate) fn has_power(&self) -> bool {
        !self.power.is_empty()
    }
    /// `[q | qd | qdd]` at a sample.
    #[inline(always)]
    pub(crate) fn joints(&self, sample: usize) -> &[f64] {
        &self.joints[sample * 3 * self.nj..(sample + 1) * 3 * self.nj]
    }
    /// The power of the joint torques at a node, appendages on links left out.
    #[inline(always)]
    pub(crate) fn power<T: ModelScalar>(&self, node: usize) -> TorqueForm<T> {
        TorqueForm::read(&self.power[node * FORM..(node + 1) * FORM], T::from_f64)
    }
    /// Whether another table can stand beside it in another lane: same steps, joints and hosts of the frames.
    pub(crate) fn is_like(&self, o: &Self) -> bool {
        let steps = |t: &Self| (t.first, t.samples, t.substeps, t.step.to_bits(), t.nj, t.moving);
        let column = |s: &Site| match s {
            Site::Base(_) => None,
            Site::Body(host, _, column) => Some((*host, *column)),
        };
        let sites = self.sites.len().min(o.sites.len());
        steps(self) == steps(o)
            && self.sites[..sites].iter().map(column).eq(o.sites[..sites].iter().map(column))
            && self.above == o.above
    }
    /// Node of a sample.
    pub(crate) fn node_of(&self, sample: usize) -> usize {
        sample * 2 * self.substeps
    }
}
