//! Derivatives of the reduced equations at several points at once, one per lane.
//!
//! `0 = R(z, u, p)` of [`crate::reduced::system`] at given `z`, `u = [a | al | nu']`: the mass matrix `R_u`, the state columns
//! `R_z` and one column of `R_p` per wanted parameter. The points of a trajectory are known before its derivatives
//! are, so that eight stages of the integration go through this together.

use crate::reduced::sensitivity::partials::{At, Column, Columns, Parts, Put, state_columns, unit};
use crate::reduced::system::{at_zero_acceleration, hung};
use crate::reduced::table::Prescribed;
use crate::tree::condense::{Inverse, OwnRows};
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{Moving, PackedInertia, V3};
use ff_model::{Model, Params};

/// All derivatives at one point per lane.
pub(crate) struct Tangent<'a, L: LaneScalar> {
    parts: Parts<'a, L>,
    /// State columns: `3 + 2m`, or three more.
    pub(crate) nz: usize,
    mass: Inverse<L>,
    /// The passive rows that a column has.
    own_z: Vec<OwnRows>,
    own_p: Vec<OwnRows>,
    /// `R_z` and `R_p` by columns of length `n = 6 + m`. What is zero in `R_p` always is.
    rz: Vec<L>,
    rp: Vec<L>,
}

impl<'a, L: LaneScalar> Tangent<'a, L> {
    pub(crate) fn new(model: &'a Model, params: &'a Params<L>, table: &'a Prescribed, columns: &'a Columns) -> Self {
        let n = 6 + model.np();
        let nz = state_columns(model);
        let z = |k| vec![L::zero(); k];
        let parts = Parts::new(model, params, table, columns);
        let (m, ports) = (model.np(), model.appendages());
        // Angular velocity of the base, and its velocity, move all ports.
        let mut own_z = vec![OwnRows::All; nz];
        for (k, a) in ports.iter().enumerate() {
            let own = 3 + a.coord_offset..3 + a.coord_offset + a.dim();
            own_z[own.start + m..own.end + m].fill(OwnRows::Port(k));
            own_z[own].fill(OwnRows::Port(k));
        }
        let mut own_p = vec![OwnRows::None; columns.count];
        for (k, wanted) in columns.ports.iter().enumerate() {
            wanted.iter().for_each(|&(_, col)| own_p[col] = OwnRows::Port(k));
        }
        let placed = |k: usize| columns.placements[k].iter().map(|p| p.2);
        let combined = |k: usize| columns.ports_combined[k].iter().map(|c| c.1);
        for k in 0..ports.len() {
            for col in placed(k).chain(combined(k)) {
                own_p[col] = if own_p[col] == OwnRows::None { OwnRows::Port(k) } else { OwnRows::All };
            }
        }
        Self { parts, nz, mass: Inverse::new(model), own_z, own_p, rz: z(n * nz), rp: z(n * columns.count) }
    }

    /// Evaluates all columns at points `(z, u)`, given by lane, and nodes. False where a mass matrix is not positive definite; there
    /// is then nothing to solve with.
    #[inline(always)]
    pub(crate) fn evaluate(&mut self, nodes: &[usize], z: &[L], u: &[L]) -> bool {
        let Self { parts, nz, mass, rz, rp, .. } = self;
        let (model, table) = (parts.model, parts.table);
        let (m, nz) = (model.np(), *nz);
        let n = 6 + m;
        rz[..n * nz].fill(L::zero());
        parts.place(|column| table.frames_at(column, nodes));
        let at = At::new(z, u);
        let base = PackedInertia::from(parts.params.body(0));
        let arm = table.arms::<L>(nodes);
        let (mut c, _, _) = at_zero_acceleration(&base, &arm, &at.w);
        // d/dw of w x (w x h + 2 h.) and of w x J w + C w.
        let (wh, jw) = (at.w.cross_add(&c.h, &arm.dh2), c.i.mul(&at.w));
        for j in 0..3 {
            let e = unit::<L>(j);
            let f = at.w.cross_add(&e.cross(&c.h), &e.cross(&wh));
            let n_row = at.w.cross_add(&c.i.mul(&e), &arm.c.mul_add(&e, &e.cross(&jw)));
            f.write_to(&mut rz[j * n..]);
            n_row.write_to(&mut rz[j * n + 3..]);
        }
        let moving = Moving { w: at.w, al: at.al, a: at.a, field: at.field };
        let added = parts.columns.added();
        rp[n * added.start..n * added.end].fill(L::zero());
        if !(parts.columns.base.is_empty() && parts.columns.base_combined.is_empty()) {
            for r in 0..6 {
                let (e, o) = (unit::<L>(r % 3), V3::zero());
                let row = if r < 3 { moving.powers(&e, &o) } else { moving.powers(&o, &e) };
                for &(k, col) in &parts.columns.base {
                    rp[col * n + r] = row[k];
                }
                for (by, col) in &parts.columns.base_combined {
                    row.iter().zip(by).for_each(|(x, by)| rp[col * n + r] += *x * L::from_f64(*by));
                }
            }
        }
        if !added.is_empty() {
            parts.place_slopes(nodes);
        }
        for &(slope, col) in &parts.columns.arm {
            let d = table.slopes.all[slope].arm::<L>(nodes);
            let (f, t) = d.ten.wrench(&at.w, &at.al, &at.a, &at.field);
            (f + at.w.cross_add(&d.dh2, &d.ddh)).write_to(&mut rp[col * n..]);
            (t + d.c.mul_add(&at.w, &d.dl)).write_to(&mut rp[col * n + 3..]);
        }
        for l in 0..parts.columns.links.len() {
            parts.link(l, &at, &mut Rows { n, first: 6, rz, rp });
        }
        for (k, ap) in model.appendages().iter().enumerate() {
            let first = 6 + ap.coord_offset;
            parts.port(k, &at, z, u, &mut Rows { n, first, rz, rp });
            let (p, frame) = (&mut parts.ports[k], &parts.frames[k]);
            c.add(&hung(frame, p));
            for j in 0..p.n {
                let (f, t) = p.mass().coupling(j);
                p.g[j] = frame.up(&f, &t);
            }
        }
        mass.set(&mut parts.ports, &c)
    }

    /// `-M^-1 R_z`, column by column.
    #[inline(always)]
    pub(crate) fn solve_states(&self, to: &mut [L]) {
        self.solve(&self.rz, &self.own_z, to);
    }

    /// `-M^-1 R_p` of the parameters `columns`, column by column.
    #[inline(always)]
    pub(crate) fn solve_params(&self, columns: core::ops::Range<usize>, to: &mut [L]) {
        let n = 6 + self.parts.model.np();
        self.solve(&self.rp[n * columns.start..n * columns.end], &self.own_p[columns], to);
    }

    /// `-M^-1 R` of columns `R` with these own rows.
    #[inline(always)]
    fn solve(&self, rhs: &[L], own: &[OwnRows], to: &mut [L]) {
        let n = 6 + self.parts.model.np();
        // Two columns at a time, so that a number of the inverse serves both; what they do not share is done for both.
        let pairs = own.len() / 2 * 2;
        for (c, own) in own[..pairs].chunks_exact(2).enumerate() {
            let both = if own[0] == own[1] { own[0] } else { OwnRows::All };
            let at = 2 * c * n..2 * (c + 1) * n;
            self.mass.solve_minus::<2>(both, &rhs[at.clone()], &mut to[at]);
        }
        for (c, &own) in own.iter().enumerate().skip(pairs) {
            let at = c * n..(c + 1) * n;
            self.mass.solve_minus::<1>(own, &rhs[at.clone()], &mut to[at]);
        }
    }
}

/// Columns of `R_z` and `R_p`, to which a part adds its own; its own rows begin with `first`.
struct Rows<'a, T> {
    n: usize,
    first: usize,
    rz: &'a mut [T],
    rp: &'a mut [T],
}

impl<T: ModelScalar> Put<T> for Rows<'_, T> {
    #[inline(always)]
    fn put(&mut self, column: Column, f: V3<T>, moment: V3<T>, own: &[T]) {
        let to = match column {
            Column::State(c) => {
                let to = &mut self.rz[c * self.n..(c + 1) * self.n];
                (f + V3::from_slice(to)).write_to(to);
                (moment + V3::from_slice(&to[3..])).write_to(&mut to[3..]);
                to
            }
            Column::Added(c) => {
                let to = &mut self.rp[c * self.n..(c + 1) * self.n];
                (f + V3::from_slice(to)).write_to(to);
                (moment + V3::from_slice(&to[3..])).write_to(&mut to[3..]);
                to
            }
            // A parameter belongs to one part, and its column is written anew.
            Column::Param(c) => {
                let to = &mut self.rp[c * self.n..(c + 1) * self.n];
                f.write_to(to);
                moment.write_to(&mut to[3..]);
                to
            }
        };
        // A few numbers: not worth a call.
        for (to, own) in to[self.first..].iter_mut().zip(own) {
            *to = *own;
        }
    }
}
