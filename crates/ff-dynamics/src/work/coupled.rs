//! Joints that follow others: motions expanded to the joints of the tree, forces folded back to the coordinates.
//!
//! The passes of the algorithms know trees of one degree of freedom a joint. Where joints follow others they run over the tree with every
//! joint moving by itself, `v_tree = G v`, and their results are folded: `tau = G^T tau_tree`, `H = G^T H_tree G`
//! ([`ff_model::tree::Coordinates`]). A model whose joints all move by themselves takes the passes directly.

use crate::linalg::ltl::ROOT;
use crate::state::State;
use crate::work::buffers::Work;
use crate::work::derivative_matrices::Derivatives;
use ff_model::Model;
use ff_model::scalar::ModelScalar;
use nalgebra::DMatrix;

/// The tree with every joint moving by itself, and buffers over it.
#[derive(Clone, Debug)]
pub(crate) struct Coupled<T: ModelScalar> {
    pub(crate) tree: Model,
    pub(crate) state: State<T>,
    /// Accelerations in, generalised forces out; joint forces.
    pub(crate) a: Vec<T>,
    pub(crate) tau: Vec<T>,
    pub(crate) joint: Vec<T>,
    pub(crate) h: DMatrix<T>,
    pub(crate) derivatives: Derivatives<T>,
    /// Mass matrix of the coordinates, row-major, and zero accelerations.
    pub(crate) lower: Vec<T>,
    pub(crate) zeros: Vec<T>,
    /// Every degree of freedom hangs on the one before: a mass matrix without zeros ([`crate::linalg::ltl`]).
    pub(crate) dense: Vec<usize>,
    /// By degree of freedom of the tree: that of the coordinates, and motion per motion of it.
    of: Vec<(usize, f64)>,
}

impl<T: ModelScalar> Coupled<T> {
    /// Allocates.
    pub(crate) fn new(model: &Model, tree: Model) -> Self {
        let (nb, nj, n) = (tree.nb(), tree.n_joints(), tree.nv());
        let z = T::zero();
        let dof = |d: usize| match d {
            d if d < nb => (d, 1.0),
            d if d < nb + nj => {
                let c = model.coordinate(d - nb);
                (nb + c.index, c.multiplier)
            }
            d => (d - nj + model.nj(), 1.0),
        };
        Self {
            state: State::zero(&tree),
            a: vec![z; n],
            tau: vec![z; n],
            joint: vec![z; nj],
            h: DMatrix::from_element(n, n, z),
            derivatives: Derivatives::new(&tree),
            lower: vec![z; model.nv().pow(2)],
            zeros: vec![z; model.nv()],
            dense: (0..model.nv()).map(|d| if d > nb { d - 1 } else { ROOT }).collect(),
            of: (0..n).map(dof).collect(),
            tree,
        }
    }
    /// The state of the tree.
    pub(crate) fn set(&mut self, model: &Model, state: &State<T>) {
        if self.tree.gravity() != model.gravity() {
            self.tree = self.tree.clone().with_gravity(*model.gravity());
        }
        let s = &mut self.state;
        (s.pos, s.att) = (state.pos, state.att);
        s.eta.copy_from_slice(&state.eta);
        if let Some(map) = model.coordinates() {
            map.positions(&state.q, &mut s.q);
        }
        expand(&self.of, &state.v, &mut s.v);
    }
    /// Accelerations of the tree.
    pub(crate) fn accelerate(&mut self, a: &[T]) {
        expand(&self.of, a, &mut self.a);
    }
    /// Generalised forces from those of the tree in `tau`.
    pub(crate) fn forces(&self, tau: &mut [T]) {
        tau.fill(T::zero());
        for (&x, &(i, m)) in self.tau.iter().zip(&self.of) {
            tau[i] += x.scale(m);
        }
    }
    /// `G^T M G` of a matrix over the tree, column by column.
    pub(crate) fn both(&self, of_tree: &DMatrix<T>, to: &mut DMatrix<T>) {
        to.fill(T::zero());
        congruence(&self.of, of_tree, |i, j, x| to[(i, j)] += x);
    }
    /// The mass matrix in `h`, row-major, into `lower`.
    pub(crate) fn fold_mass(&mut self) {
        let (n, lower) = (self.zeros.len(), &mut self.lower);
        lower.fill(T::zero());
        congruence(&self.of, &self.h, |i, j, x| lower[i * n + j] += x);
    }
    /// `G^T M` of a matrix with a row per degree of freedom of the tree.
    pub(crate) fn rows(&self, of_tree: &DMatrix<T>, to: &mut DMatrix<T>) {
        to.fill(T::zero());
        for (from, mut column) in of_tree.column_iter().zip(to.column_iter_mut()) {
            for (&x, &(i, m)) in from.iter().zip(&self.of) {
                column[i] += x.scale(m);
            }
        }
    }
}

/// Elements that `G^T M G` is the sum of, column by column of `M`.
fn congruence<T: ModelScalar>(of: &[(usize, f64)], m: &DMatrix<T>, mut add: impl FnMut(usize, usize, T)) {
    for (column, &(j, mj)) in m.column_iter().zip(of) {
        for (&x, &(i, mi)) in column.iter().zip(of) {
            add(i, j, x.scale(mi * mj));
        }
    }
}

/// `G v`.
fn expand<T: ModelScalar>(of: &[(usize, f64)], v: &[T], to: &mut [T]) {
    for (to, &(i, m)) in to.iter_mut().zip(of) {
        *to = v[i].scale(m);
    }
}

impl<T: ModelScalar> Work<T> {
    /// Runs `f` over the tree where joints of `model` follow others; `None` where none does. `f` gets the buffers of the passes, which
    /// know of no coupling meanwhile.
    #[inline(always)]
    pub(crate) fn over_tree<R>(&mut self, f: impl FnOnce(&mut Self, &mut Coupled<T>) -> R) -> Option<R> {
        if self.coupled.is_some() { self.run_over_tree(f) } else { None }
    }
    #[cold]
    #[inline(never)]
    fn run_over_tree<R>(&mut self, f: impl FnOnce(&mut Self, &mut Coupled<T>) -> R) -> Option<R> {
        let mut c = self.coupled.take()?;
        let out = f(self, &mut c);
        self.coupled = Some(c);
        Some(out)
    }
}
