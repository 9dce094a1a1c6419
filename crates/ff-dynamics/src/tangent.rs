//! Derivatives of the reduced equations at several points at once, one per lane.
//!
//! `0 = R(z, u, p)` of [`crate::reduced`] at given `z`, `u = [a | al | nu']`: the mass matrix `R_u`, the state columns
//! `R_z` and one column of `R_p` per wanted parameter. The points of a trajectory are known before its derivatives
//! are, so that eight stages of the integration go through this together.

use crate::condense::{Inverse, OwnRows};
use crate::prescribed::{Frame, Prescribed, Site};
use crate::reduced::{at_rest, at_zero_acceleration, hung};
use crate::work::PortWork;
use ff_model::vec3::{M3, Moving, Ten, V3};
use ff_model::{
    D1, DynAppendage, LaneScalar, Model, ModelScalar, Motion, Mounted, Params, PortAccel, PortMatrix, PortState,
    port_len,
};

/// Which columns are wanted, sorted by what they belong to: `(own index, column)`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    pub(crate) count: usize,
    base: Vec<(usize, usize)>,
    links: Vec<LinkColumns>,
    ports: Vec<Vec<(usize, usize)>>,
}

impl Columns {
    /// Columns of the parameters `wanted`, in that order.
    ///
    /// # Panics
    /// If a link is not tracked by the table.
    pub(crate) fn new(model: &Model, table: &Prescribed, wanted: &[usize]) -> Self {
        let (ports, bodies) = (model.appendages(), 10 * model.n_bodies());
        let mut c = Self { count: wanted.len(), ports: vec![Vec::new(); ports.len()], ..Self::default() };
        c.links = table
            .links
            .iter()
            .enumerate()
            .map(|(i, &body)| LinkColumns { site: ports.len() + i, body, wanted: Vec::new() })
            .collect();
        for (col, &p) in wanted.iter().enumerate() {
            if p < 10 {
                c.base.push((p, col));
            } else if p < bodies {
                let body = p / 10;
                let link = c.links.iter_mut().find(|l| l.body == body);
                assert!(link.is_some(), "body {body} is not tracked by the prescribed motion");
                link.into_iter().for_each(|l| l.wanted.push((p % 10, col)));
            } else {
                let port = ports.iter().rposition(|a| a.param_offset <= p).unwrap_or(0);
                c.ports[port].push((p - ports[port].param_offset, col));
            }
        }
        c.links.retain(|l| !l.wanted.is_empty());
        c
    }
}

/// Wanted columns of a tracked link.
#[derive(Clone, Debug)]
struct LinkColumns {
    /// Where its frame is among the sites of the table.
    site: usize,
    body: usize,
    wanted: Vec<(usize, usize)>,
}

/// A column of the derivatives.
#[derive(Clone, Copy)]
pub(crate) enum Column {
    /// `[w 3 | eta m | nu m]`, then `v 3` where an appendage is not Galilean.
    State(usize),
    Param(usize),
}

/// Where columns go. A trait and not a closure, because closures of some size are not inlined, and code for lanes must
/// be (`ff-lanes`).
trait Put<T> {
    /// `column` with a wrench about the base origin in base axes and the own rows of a port.
    fn put(&mut self, column: Column, f: V3<T>, n: V3<T>, own: &[T]);
}

/// Motion of the base at one point, or one per lane.
#[derive(Clone, Copy)]
struct At<T> {
    v: V3<T>,
    w: V3<T>,
    a: V3<T>,
    al: V3<T>,
    field: M3<T>,
}

impl<T: ModelScalar> At<T> {
    #[inline(always)]
    fn new(z: &[T], u: &[T]) -> Self {
        let (w, al) = (V3::from_slice(&z[3..]), V3::from_slice(&u[3..]));
        Self { v: V3::from_slice(z), w, a: V3::from_slice(u), al, field: M3::field(&w, &al) }
    }
}

/// Columns of the ports and links at one point or one per lane, with their buffers.
pub(crate) struct Parts<'a, T: LaneScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    table: &'a Prescribed,
    columns: &'a Columns,
    ports: Vec<PortWork<T>>,
    frames: Vec<Frame<T>>,
    at_speed: Vec<Option<AtSpeed>>,
    /// State columns of each port, `6+n` each: base angular velocity, coordinates, rates, base velocity.
    state: Vec<Vec<T>>,
}

impl<T: LaneScalar> PortWork<T> {
    /// `M [a; al]` plus the derivatives in `d` along a host angular velocity `dw` (columns from `first` on) and, with
    /// `first` other than zero, a velocity `dv` (columns from zero on).
    #[inline(always)]
    fn along(&self, first: usize, dw: &V3<T>, dv: &V3<T>, a: &V3<T>, al: &V3<T>, to: &mut [T]) {
        let (m, dim) = (self.mass(), 6 + self.n);
        let (f, n) = m.host().momentum(a, al);
        f.write_to(to);
        n.write_to(&mut to[3..]);
        for k in 0..self.n {
            let (f, n) = m.coupling(k);
            to[6 + k] = f.dot(a) + n.dot(al);
        }
        for (i, to) in to.iter_mut().enumerate() {
            let mut y = *to;
            let column = |j: usize| self.d[j * dim + i];
            if first > 0 {
                y += V3::new(column(0), column(1), column(2)).dot(dv);
            }
            *to = y + V3::new(column(first), column(first + 1), column(first + 2)).dot(dw);
        }
    }
}

impl<'a, T: LaneScalar> Parts<'a, T> {
    pub(crate) fn new(model: &'a Model, params: &'a Params<T>, table: &'a Prescribed, columns: &'a Columns) -> Self {
        let ports = model.appendages();
        let slow = |a: &Mounted| (!a.appendage.is_galilean()).then(|| AtSpeed::new(a.dim(), a.decl().params.len()));
        Self {
            model,
            params,
            table,
            columns,
            ports: ports.iter().map(PortWork::new).collect(),
            frames: table.sites.iter().map(at_rest).collect(),
            at_speed: ports.iter().map(slow).collect(),
            state: ports.iter().map(|a| vec![T::zero(); (6 + 2 * a.dim()) * (6 + a.dim())]).collect(),
        }
    }

    /// Places the frames that move; `frame` reads a column of the table.
    #[inline(always)]
    fn place(&mut self, frame: impl Fn(usize) -> Frame<T>) {
        for (f, site) in self.frames.iter_mut().zip(&self.table.sites) {
            if let Site::Body(_, _, column) = site {
                *f = frame(*column);
            }
        }
    }

    /// Columns of port `k`. `M` stays in the port.
    #[inline(always)]
    fn port(&mut self, k: usize, at: &At<T>, z: &[T], u: &[T], to: &mut impl Put<T>) {
        let (ap, p, frame) = (&self.model.appendages()[k], &mut self.ports[k], &self.frames[k]);
        let (m, n) = (self.model.np(), p.n);
        let dim = 6 + n;
        let own = ap.coord_offset..ap.coord_offset + n;
        let (eta, nu) = (&z[6 + own.start..6 + own.end], &z[6 + m + own.start..6 + m + own.end]);
        let acc = &u[6 + own.start..6 + own.end];
        let params = self.params.appendage(self.model, k);
        T::port(&*ap.appendage).inertia(params, eta, &mut PortMatrix::over(n, &mut p.m));
        let host = frame.carried(&at.w, &at.al, &at.a, &at.field);
        // What does not depend on the host's velocity is asked in a frame that moves with the mount.
        let slow = self.at_speed[k].as_mut();
        let v = if slow.is_some() { frame.velocity(&at.v, &at.w) } else { V3::zero() };
        let lin = host.a - host.w.cross(&v);
        let s = PortState { host: Motion { lin: v.into(), ang: host.w.into() }, eta, nu };
        let accel = PortAccel { host: Motion { lin: lin.into(), ang: host.al.into() }, nu: acc };
        let first = match slow {
            Some(slow) => {
                slow.evaluate(&*ap.appendage, params, &s, &accel, &mut p.d);
                3
            }
            None => {
                T::tangent(&*ap.appendage).jacobian(params, &s, &accel, &mut p.d);
                0
            }
        };
        let two = T::from_f64(2.0);
        let state = &mut self.state[k][..];
        for j in 0..3 {
            let e = unit::<T>(j);
            let ep = e.cross(&frame.pose.p);
            let mut a = at.w.cross_add(&ep, &e.cross(&at.w.cross(&frame.pose.p)));
            let mut al = V3::zero();
            if frame.moving {
                a += e.cross(&frame.dp).scaled(two);
                al = frame.down(&e.cross(&frame.w));
            }
            let (dw, mut a, mut dv) = (frame.down(&e), frame.down(&a), V3::zero());
            if first > 0 {
                dv = frame.down(&ep);
                a -= dw.cross(&v) + host.w.cross(&dv);
            }
            p.along(first, &dw, &dv, &a, &al, &mut state[j * dim..(j + 1) * dim]);
            if first > 0 {
                // The velocity of the base alone; its classical acceleration stays.
                let a = -host.w.cross(&dw);
                p.along(first, &V3::zero(), &dw, &a, &V3::zero(), &mut state[(3 + 2 * n + j) * dim..][..dim]);
            }
        }
        let own_columns = 2 * n * dim;
        state[3 * dim..][..own_columns].copy_from_slice(&p.d[(first + 3) * dim..][..own_columns]);
        let wanted = &self.columns.ports[k];
        if !wanted.is_empty() {
            T::tangent(&*ap.appendage).regressor(params, &s, &accel, &mut p.d);
        }
        let states = 3 + 2 * n + first;
        for c in 0..states + wanted.len() {
            let (column, d) = if c < states {
                let full = match c {
                    0..3 => c,
                    c if c < 3 + n => own.start + c,
                    c if c < 3 + 2 * n => m - n + own.start + c,
                    c => 2 * (m - n) + c,
                };
                (Column::State(full), &state[c * dim..(c + 1) * dim])
            } else {
                let (own, col) = wanted[c - states];
                (Column::Param(col), &p.d[own * dim..(own + 1) * dim])
            };
            let (f, n) = frame.up(&V3::from_slice(d), &V3::from_slice(&d[3..]));
            to.put(column, f, n, &d[6..]);
        }
    }

    /// Columns of the inertial parameters of tracked link `l`.
    #[inline(always)]
    fn link(&self, l: usize, at: &At<T>, to: &mut impl Put<T>) {
        let LinkColumns { site, wanted, .. } = &self.columns.links[l];
        let frame = &self.frames[*site];
        let host = frame.carried(&at.w, &at.al, &at.a, &at.field);
        let moving = Moving { w: host.w, al: host.al, a: host.a, field: M3::field(&host.w, &host.al) };
        let mut rows = [[T::zero(); 10]; 6];
        for (r, row) in rows.iter_mut().enumerate() {
            let e = unit::<T>(r % 3);
            let zero = V3::zero();
            let (v, w) = if r < 3 { (e, zero) } else { (e.cross(&frame.pose.p), e) };
            *row = moving.powers(&frame.down(&v), &frame.down(&w));
        }
        for &(k, col) in wanted {
            let [a, b, c, d, e, f] = &rows;
            to.put(Column::Param(col), V3::new(a[k], b[k], c[k]), V3::new(d[k], e[k], f[k]), &[]);
        }
    }
}

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
        let own_z = |c: usize| match c {
            c if (3..3 + 2 * m).contains(&c) => {
                ports.iter().rposition(|a| a.coord_offset <= (c - 3) % m).map_or(OwnRows::All, OwnRows::Port)
            }
            _ => OwnRows::All,
        };
        let mut own_p = vec![OwnRows::None; columns.count];
        for (k, wanted) in columns.ports.iter().enumerate() {
            wanted.iter().for_each(|&(_, col)| own_p[col] = OwnRows::Port(k));
        }
        Self {
            parts,
            nz,
            mass: Inverse::new(model),
            own_z: (0..nz).map(own_z).collect(),
            own_p,
            rz: z(n * nz),
            rp: z(n * columns.count),
        }
    }

    /// Evaluates all columns at points `(z, u)`, given by lane, and nodes.
    #[inline(always)]
    pub(crate) fn evaluate(&mut self, nodes: &[usize], z: &[L], u: &[L]) {
        let Self { parts, nz, mass, rz, rp, .. } = self;
        let (model, table) = (parts.model, parts.table);
        let (m, nz) = (model.np(), *nz);
        let n = 6 + m;
        rz[..n * nz].fill(L::zero());
        parts.place(|column| table.frames_at(column, nodes));
        let at = At::new(z, u);
        let base = Ten::from(parts.params.body(0));
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
        if !parts.columns.base.is_empty() {
            for r in 0..6 {
                let (e, o) = (unit::<L>(r % 3), V3::zero());
                let row = if r < 3 { moving.powers(&e, &o) } else { moving.powers(&o, &e) };
                for &(k, col) in &parts.columns.base {
                    rp[col * n + r] = row[k];
                }
            }
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
        mass.set(&mut parts.ports, &c);
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

/// Number of state columns of [`Tangent`].
pub(crate) fn state_columns(model: &Model) -> usize {
    let galilean = model.appendages().iter().all(|a| a.appendage.is_galilean());
    3 + 2 * model.np() + if galilean { 0 } else { 3 }
}

/// Joint torques as linear forms at one sample: `d tau = t_u du + t_z dz + t_p`.
pub(crate) struct TorqueRows<'a> {
    parts: Parts<'a, f64>,
    /// `n x (6 + m)` and `n x nz`, column by column.
    pub(crate) by_u: Vec<f64>,
    pub(crate) by_z: Vec<f64>,
    /// `n x P`, row by row; rows are `wide` apart, a multiple of eight, with zeros behind the last column.
    pub(crate) by_p: Vec<f64>,
    pub(crate) wide: usize,
    /// Columns beyond 6 of `by_u`, beyond 3 of `by_z` and `by_p` can be other than zero.
    pub(crate) carried: bool,
}

impl<'a> TorqueRows<'a> {
    pub(crate) fn new(model: &'a Model, params: &'a Params<f64>, table: &'a Prescribed, columns: &'a Columns) -> Self {
        let (nj, wide) = (model.nj(), columns.count.next_multiple_of(8));
        Self {
            parts: Parts::new(model, params, table, columns),
            by_u: vec![0.0; nj * (6 + model.np())],
            by_z: vec![0.0; nj * state_columns(model)],
            by_p: vec![0.0; nj * wide],
            wide,
            carried: model.appendages().iter().any(|a| a.host > 0) || !columns.links.is_empty(),
        }
    }

    /// At sample `i` with state `z` and accelerations `u`.
    pub(crate) fn evaluate(&mut self, sample: usize, z: &[f64], u: &[f64]) {
        let Self { parts, by_u, by_z, by_p, wide, carried } = self;
        let (model, table, wide) = (parts.model, parts.table, *wide);
        let nj = model.nj();
        let at = At::new(z, u);
        let w2 = at.w.scaled(2.0);
        for j in 0..nj {
            let form = table.row(sample, j).form;
            let gw = form.q.mul_add(&w2, &form.gw);
            for (c, x) in [form.ga.x, form.ga.y, form.ga.z, form.gb.x, form.gb.y, form.gb.z].into_iter().enumerate() {
                by_u[c * nj + j] = x;
            }
            for (c, x) in [gw.x, gw.y, gw.z].into_iter().enumerate() {
                by_z[c * nj + j] = x;
            }
        }
        if !*carried {
            return;
        }
        by_u[6 * nj..].fill(0.0);
        by_z[3 * nj..].fill(0.0);
        by_p.fill(0.0);
        let node = table.node_of(sample);
        parts.place(|column| table.frame(column, node));
        for l in 0..parts.columns.links.len() {
            let above = &table.above[parts.columns.links[l].body];
            parts.link(l, &at, &mut Felt { table, sample, above, nj, wide, by_z, by_p });
        }
        let felt = |j: usize, f: &V3<f64>, n: &V3<f64>| table.row(sample, j).of(f, n);
        for (k, ap) in model.appendages().iter().enumerate().filter(|(_, a)| a.host > 0) {
            let above = &table.above[ap.host];
            parts.port(k, &at, z, u, &mut Felt { table, sample, above, nj, wide, by_z, by_p });
            let (p, frame) = (&parts.ports[k], &parts.frames[k]);
            let b = hung(frame, p);
            for i in 0..3 {
                let e = unit::<f64>(i);
                let (lin, ang) = (b.momentum(&e, &V3::zero()), b.momentum(&V3::zero(), &e));
                for &j in above {
                    by_u[i * nj + j] += felt(j, &lin.0, &lin.1);
                    by_u[(3 + i) * nj + j] += felt(j, &ang.0, &ang.1);
                }
            }
            for i in 0..p.n {
                let (f, n) = p.mass().coupling(i);
                let (f, n) = frame.up(&f, &n);
                above.iter().for_each(|&j| by_u[(6 + ap.coord_offset + i) * nj + j] += felt(j, &f, &n));
            }
        }
    }
}

/// Joint torques that the joints `above` feel of columns.
struct Felt<'a> {
    table: &'a Prescribed,
    sample: usize,
    above: &'a [usize],
    nj: usize,
    wide: usize,
    by_z: &'a mut [f64],
    by_p: &'a mut [f64],
}

impl Put<f64> for Felt<'_> {
    fn put(&mut self, column: Column, f: V3<f64>, n: V3<f64>, _: &[f64]) {
        for &j in self.above {
            let torque = self.table.row(self.sample, j).of(&f, &n);
            match column {
                Column::State(c) => self.by_z[c * self.nj + j] += torque,
                Column::Param(c) => self.by_p[j * self.wide + c] += torque,
            }
        }
    }
}

/// `a b + c`, whichever trait's method of that name is meant.
#[inline(always)]
pub(crate) fn fma<T: ModelScalar>(a: T, b: T, c: T) -> T {
    a.mul_add(b, c)
}

#[inline(always)]
fn unit<T: ModelScalar>(k: usize) -> V3<T> {
    let mut e = [T::zero(); 3];
    e[k] = T::one();
    V3::from_slice(&e)
}

/// State derivatives of a port that is not Galilean: by one forward dual per direction, lane by lane.
#[derive(Clone, Debug)]
struct AtSpeed {
    p: Vec<D1>,
    eta: Vec<D1>,
    nu: Vec<D1>,
    acc: Vec<D1>,
    m: Vec<D1>,
    r: Vec<D1>,
}

impl AtSpeed {
    fn new(n: usize, np: usize) -> Self {
        let z = |k| vec![D1::constant(0.0); k];
        Self { p: z(np), eta: z(n), nu: z(n), acc: z(n), m: z(port_len(n)), r: z(6 + n) }
    }

    /// Columns of `M [A; nu'] + h` at fixed accelerations, `6+n` each: host twist 6, coordinates n, rates n.
    fn evaluate<T: LaneScalar>(
        &mut self,
        appendage: &dyn DynAppendage,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        out: &mut [T],
    ) {
        let n = s.eta.len();
        let dim = 6 + n;
        let port = D1::port(appendage);
        for lane in 0..T::N {
            let constant = |to: &mut [D1], from: &[T]| {
                to.iter_mut().zip(from).for_each(|(d, x)| *d = D1::constant(x.lane(lane)));
            };
            constant(&mut self.p, p);
            constant(&mut self.acc, acc.nu);
            let host = Motion {
                lin: acc.host.lin.map(|x| D1::constant(x.lane(lane))),
                ang: acc.host.ang.map(|x| D1::constant(x.lane(lane))),
            };
            for dir in 0..6 + 2 * n {
                let seed = |i: usize, x: f64| D1::new(x, if i == dir { 1.0 } else { 0.0 });
                for i in 0..n {
                    self.eta[i] = seed(6 + i, s.eta[i].lane(lane));
                    self.nu[i] = seed(6 + n + i, s.nu[i].lane(lane));
                }
                let v: [D1; 6] = core::array::from_fn(|i| seed(i, s.host.get(i).lane(lane)));
                let state = PortState { host: Motion::from_slice(&v), eta: &self.eta, nu: &self.nu };
                let accel = PortAccel { host, nu: &self.acc };
                port.residual(&self.p, &state, &accel, &mut PortMatrix::over(n, &mut self.m), &mut self.r);
                for (i, r) in self.r.iter().enumerate() {
                    out[dir * dim + i].set_lane(lane, r.eps[0]);
                }
            }
        }
    }
}
