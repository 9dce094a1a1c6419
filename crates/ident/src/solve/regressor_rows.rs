//! The equations of motion of a record as rows that are linear in the parameters: `Y phi + extra = measured`.

use crate::motion::zero_phase::ZeroPhase;
use core::ops::Range;
use ff_dynamics::{Regressor, State, Work, regressor};
use ff_least_squares::{Stream, Triangle};
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::scalar::lanes::{Isa, LaneScalar, LaneTask, Lanes, dispatch};
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// An unknown besides the parameters of the model, in one row per sample.
#[derive(Clone, Debug)]
pub(crate) struct Extra {
    /// Degree of freedom in whose row it stands.
    pub(crate) dof: usize,
    /// Its factor at every sample.
    pub(crate) factor: Vec<f64>,
}

/// Rows of one standard deviation.
#[derive(Clone, Debug)]
pub(crate) struct Kind {
    pub(crate) name: String,
    /// Degrees of freedom.
    pub(crate) dofs: Vec<usize>,
}

/// Motion and measured forces at N instants; every matrix is N x channels.
#[derive(Clone, Debug)]
pub(crate) struct Equations<'a> {
    /// Rigid model.
    pub(crate) model: &'a Model,
    pub(crate) q: DMatrix<f64>,
    /// Generalised velocity, N x nv.
    pub(crate) v: DMatrix<f64>,
    /// Generalised acceleration, N x nv.
    pub(crate) a: DMatrix<f64>,
    /// Generalised forces, N x nv.
    pub(crate) measured: DMatrix<f64>,
    /// Indices of the unknown parameters, ascending.
    pub(crate) selected: &'a [usize],
    /// All parameters; the known ones go to the right side.
    pub(crate) values: &'a [f64],
    /// Indices of parameters that are zero here, whether or not they are unknown: what is not mounted.
    pub(crate) absent: &'a [usize],
    pub(crate) extra: Vec<Extra>,
    /// Samples left out of the row of a degree of freedom: 0 leaves out, 1 keeps. N x nv, none for all.
    pub(crate) keep: Option<DMatrix<f64>>,
    pub(crate) kinds: Vec<Kind>,
}

impl Equations<'_> {
    /// One triangle per kind; unknowns are `selected`, then `extra`.
    ///
    /// # Errors
    /// [`LinalgError::NotFinite`].
    pub(crate) fn triangles(&self) -> Result<Vec<Triangle>, LinalgError> {
        let n = self.q.nrows();
        let columns: Vec<Columns> = self.kinds.iter().map(|k| self.columns(k)).collect();
        let r = dispatch(Isa::detect(), Fold { eq: self, columns: &columns })?;
        let rows = |k: &Kind| match &self.keep {
            None => k.dofs.len() * n,
            Some(keep) => k.dofs.iter().map(|&d| keep.column(d).sum() as usize).sum(),
        };
        Ok(self
            .kinds
            .iter()
            .zip(columns)
            .zip(r)
            .map(|((k, c), r)| Triangle {
                name: k.name.clone(),
                columns: c.unknown.iter().map(|u| u.0).chain(c.extra).collect(),
                r,
                rows: rows(k),
            })
            .collect())
    }
    /// The same of equations that have passed filters, column by column: linear in their unknowns as before. Every kind is one
    /// degree of freedom; each record, given by its samples, is filtered by itself. Neighbours of a filtered signal tell the
    /// same, so that each row weighs as much as it is worth of an independent one ([`ZeroPhase::noise_gain`]). A triangle per kind for each
    /// of the `blocks` of samples; without filters, of equations as they are. Allocates the rows of one kind.
    ///
    /// # Errors
    /// [`LinalgError::NotFinite`].
    pub(crate) fn filtered_triangles(
        &self,
        filters: &[(Range<usize>, &ZeroPhase)],
        blocks: &[Range<usize>],
    ) -> Result<Vec<Vec<Triangle>>, LinalgError> {
        let mut out = vec![Vec::with_capacity(self.kinds.len()); blocks.len()];
        for kind in &self.kinds {
            let c = self.columns(kind);
            let width = c.unknown.len() + c.extra.len() + 1;
            let mut columns = dispatch(Isa::detect(), Tabulate { eq: self, columns: &c, kind });
            let kept = |i: &usize| self.keep.as_ref().is_none_or(|k| kind.dofs.iter().all(|&d| k[(*i, d)] > 0.0));
            for (samples, z) in filters {
                z.run_all(columns.iter_mut().map(|x| &mut x[samples.clone()]));
            }
            let worth = |i: &usize| filters.iter().find(|f| f.0.contains(i)).map_or(1.0, |f| f.1.noise_gain());
            let unknowns: Vec<usize> = c.unknown.iter().map(|u| u.0).chain(c.extra).collect();
            for (block, to) in blocks.iter().zip(&mut out) {
                let used: Vec<(usize, f64)> = block.clone().filter(kept).map(|i| (i, worth(&i))).collect();
                let mut rows = DMatrix::zeros(used.len().max(width), width);
                for (mut to, x) in rows.column_iter_mut().zip(&columns) {
                    to.iter_mut().zip(&used).for_each(|(to, &(i, worth))| *to = worth.sqrt() * x[i]);
                }
                to.push(Triangle {
                    name: kind.name.clone(),
                    columns: unknowns.clone(),
                    r: linalg::qr_r(&rows)?,
                    rows: used.iter().map(|u| u.1).sum::<f64>().round() as usize,
                });
            }
        }
        Ok(out)
    }
    /// What the rows of a kind may depend on: a force on the base on masses and first moments, a moment on it on
    /// everything, the torque of a joint on the bodies that it carries.
    fn columns(&self, kind: &Kind) -> Columns {
        let (model, nb) = (self.model, self.model.nb());
        let moved = |dof: usize, body: usize| {
            if dof < nb {
                return true;
            }
            let mut b = body;
            while b > 0 {
                if nb + model.coordinate(b - 1).index == dof {
                    return true;
                }
                b = model.bodies()[b - 1].parent;
            }
            false
        };
        // The ten numbers of a grasped payload are those of its mount, of which no order is assumed.
        let own = 10 * model.n_bodies();
        let body = |p: usize| match model.appendages().iter().rev().find(|a| a.param_offset <= p) {
            Some(a) => a.host,
            None => p / 10,
        };
        let depends =
            |p: usize| kind.dofs.iter().any(|&d| moved(d, body(p)) && (d >= nb.min(3) || p >= own || p % 10 < 4));
        let mut out = Columns::default();
        for p in 0..model.n_params() {
            if !depends(p) || self.absent.contains(&p) {
                continue;
            }
            match self.selected.binary_search(&p) {
                Ok(k) => out.unknown.push((k, p)),
                Err(_) if self.values[p] != 0.0 => out.known.push((p, self.values[p])),
                Err(_) => {}
            }
        }
        let m = self.selected.len();
        out.extra = (0..self.extra.len()).filter(|&e| kind.dofs.contains(&self.extra[e].dof)).map(|e| m + e).collect();
        out
    }
}

#[derive(Clone, Debug, Default)]
struct Columns {
    /// Number of the unknown, number of the parameter.
    unknown: Vec<(usize, usize)>,
    known: Vec<(usize, f64)>,
    /// Numbers of the unknowns.
    extra: Vec<usize>,
}

/// Where rows go: numbers of a row one after the other, a sample in every lane.
trait Rows<L> {
    fn put(&mut self, column: usize, x: L);
    fn end_row(&mut self);
}

impl<L: LaneScalar> Rows<L> for Stream<L> {
    #[inline(always)]
    fn put(&mut self, column: usize, x: L) {
        Stream::put(self, column, x);
    }
    #[inline(always)]
    fn end_row(&mut self) {
        Stream::end_row(self);
    }
}

/// Whole columns.
struct Table(Vec<Vec<f64>>);

impl<L: LaneScalar> Rows<L> for Table {
    #[inline(always)]
    fn put(&mut self, column: usize, x: L) {
        let to = &mut self.0[column];
        let n = to.len();
        to.resize(n + L::N, 0.0);
        x.store(&mut to[n..]);
    }
    fn end_row(&mut self) {}
}

struct Fold<'a> {
    eq: &'a Equations<'a>,
    columns: &'a [Columns],
}

impl LaneTask for Fold<'_> {
    type Output = Result<Vec<DMatrix<f64>>, LinalgError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { eq, columns } = self;
        let mut streams: Vec<Stream<L>> =
            columns.iter().map(|c| Stream::new(c.unknown.len() + c.extra.len())).collect();
        write_rows(eq, &eq.kinds, columns, eq.keep.as_ref(), &mut streams);
        for stream in &mut streams {
            stream.flush();
        }
        streams.into_iter().map(Stream::finish).collect()
    }
}

/// The rows of one kind of one degree of freedom, as columns of a sample each; all samples are kept.
struct Tabulate<'a> {
    eq: &'a Equations<'a>,
    columns: &'a Columns,
    kind: &'a Kind,
}

impl LaneTask for Tabulate<'_> {
    type Output = Vec<Vec<f64>>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { eq, columns, kind } = self;
        let (n, width) = (eq.q.nrows(), columns.unknown.len() + columns.extra.len() + 1);
        let mut table = Table(vec![Vec::with_capacity(n + L::N); width]);
        let (kinds, columns) = (core::slice::from_ref(kind), core::slice::from_ref(columns));
        write_rows::<L, _>(eq, kinds, columns, None, core::slice::from_mut(&mut table));
        // The last group of lanes repeats its last sample.
        table.0.iter_mut().for_each(|c| c.truncate(n));
        table.0
    }
}

/// Writes the rows of every kind to its place, weighted by `keep`.
#[inline(always)]
fn write_rows<L: LaneScalar, R: Rows<L>>(
    eq: &Equations<'_>,
    kinds: &[Kind],
    columns: &[Columns],
    keep: Option<&DMatrix<f64>>,
    to: &mut [R],
) {
    let (model, n) = (eq.model, eq.q.nrows());
    let (nv, first_extra) = (model.nv(), eq.selected.len());
    let params = Params::<L>::from_values(model, eq.values.iter().map(|&x| L::splat(x)).collect());
    let mut work = Work::<L>::new(model);
    let mut state = State::<L>::zero(model);
    let mut a = vec![L::splat(0.0); nv];
    let mut y = Regressor::<L>::new(model);
    for first in (0..n).step_by(L::N) {
        let full = first + L::N <= n;
        // A group that is not full repeats its last sample with weight zero.
        let load = |column: &[f64]| {
            if full {
                L::load(&column[first..])
            } else {
                L::load(&core::array::from_fn::<f64, 8, _>(|lane| column[(first + lane).min(n - 1)]))
            }
        };
        let of = |m: &DMatrix<f64>, k: usize| load(&m.as_slice()[k * n..(k + 1) * n]);
        let present = if full {
            L::splat(1.0)
        } else {
            L::load(&core::array::from_fn::<f64, 8, _>(|lane| f64::from(u8::from(first + lane < n))))
        };
        (0..model.nj()).for_each(|k| state.q[k] = of(&eq.q, k));
        (0..nv).for_each(|k| state.v[k] = of(&eq.v, k));
        (0..nv).for_each(|k| a[k] = of(&eq.a, k));
        regressor(model, &params, &state, &a, &mut work, &mut y);
        let y = y.as_slice();
        for ((kind, c), rows) in kinds.iter().zip(columns).zip(to.iter_mut()) {
            for &dof in &kind.dofs {
                let w = keep.map_or(present, |keep| of(keep, dof) * present);
                let weighted = !full || keep.is_some();
                let mut b = of(&eq.measured, dof);
                for &(p, x) in &c.known {
                    b = Lanes::mul_add(y[p * nv + dof], L::splat(-x), b);
                }
                for (k, &(_, p)) in c.unknown.iter().enumerate() {
                    let x = y[p * nv + dof];
                    rows.put(k, if weighted { x * w } else { x });
                }
                for (k, &e) in c.extra.iter().enumerate() {
                    let e = &eq.extra[e - first_extra];
                    let x = if e.dof == dof { load(&e.factor) * w } else { L::splat(0.0) };
                    rows.put(c.unknown.len() + k, x);
                }
                rows.put(c.unknown.len() + c.extra.len(), if weighted { b * w } else { b });
                rows.end_row();
            }
        }
    }
}
