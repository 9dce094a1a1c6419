//! What the derivatives of the reduced equations are made of: columns of the ports and of tracked links.
//!
//! `0 = R(z, u, p)` of [`crate::reduced::system`] is a sum over its parts. Each gives columns, a wrench about the base origin and its own
//! rows, at one point or at one point per lane; who asks decides where they go ([`Put`]): into the equations (`tangent.rs`) or
//! into the torques of the joints that carry the part (`torque_rows.rs`).

use crate::reduced::sensitivity::wanted::Wanted;
use crate::reduced::table::{ArmSource, Frame, Prescribed, Site};
use crate::work::port_work::PortWork;
use ff_model::port::port_len;
use ff_model::scalar::{D1, LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{M3, Moving, Pose, V3};
use ff_model::tree::Mounted;
use ff_model::{DynAppendage, Model, Motion, Params, PortAccel, PortMatrix, PortState};

/// Own indices with their factors, column.
type PortSum = (Vec<(usize, f64)>, usize);

/// Which columns are wanted, sorted by what they belong to: `(own index, column)`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    pub(crate) count: usize,
    /// The first column to which several parts may add.
    first_added: usize,
    pub(crate) base: Vec<(usize, usize)>,
    pub(crate) links: Vec<LinkColumns>,
    pub(crate) ports: Vec<Vec<(usize, usize)>>,
    /// Columns that are sums of parameters: factors of the base's ten numbers, and by port own indices with factors.
    pub(crate) base_combined: Vec<([f64; 10], usize)>,
    pub(crate) ports_combined: Vec<Vec<PortSum>>,
    /// Kinematic parameters and disturbances that the arm depends on: which of the table's slopes, column.
    pub(crate) arm: Vec<(usize, usize)>,
    /// By port, those that its frame depends on: which of the table's, which of its frames, column.
    pub(crate) placements: Vec<Vec<(usize, usize, usize)>>,
}

impl Columns {
    /// Columns of the parameters, alone and combined, the kinematic parameters and the disturbances of `wanted`, in that order.
    ///
    /// # Panics
    /// If a link, a kinematic parameter or a disturbance is not tracked by the table.
    pub(crate) fn new(model: &Model, table: &Prescribed, wanted: &Wanted) -> Self {
        let (ports, bodies) = (model.appendages(), 10 * model.n_bodies());
        let (count, first_added) = (wanted.forced(), wanted.params.len());
        let mut c = Self { count, first_added, ports: vec![Vec::new(); ports.len()], ..Self::default() };
        c.ports_combined = vec![Vec::new(); ports.len()];
        c.links = table
            .links
            .iter()
            .enumerate()
            .map(|(i, &body)| LinkColumns { site: ports.len() + i, body, wanted: Vec::new(), combined: Vec::new() })
            .collect();
        let link_of = |links: &[LinkColumns], p: usize| {
            let at = links.iter().position(|l| l.body == p / 10);
            assert!(at.is_some(), "body {} is not tracked by the prescribed motion", p / 10);
            at.unwrap_or(0)
        };
        let port_of = |p: usize| ports.iter().rposition(|a| a.param_offset <= p).unwrap_or(0);
        for (col, &p) in wanted.params.iter().enumerate() {
            if p < 10 {
                c.base.push((p, col));
            } else if p < bodies {
                let link = link_of(&c.links, p);
                c.links[link].wanted.push((p % 10, col));
            } else {
                let port = port_of(p);
                c.ports[port].push((p - ports[port].param_offset, col));
            }
        }
        for (col, parts) in (wanted.params.len()..).zip(&wanted.combined) {
            for &(p, by) in parts {
                if p < 10 {
                    last_of(&mut c.base_combined, col)[p] += by;
                } else if p < bodies {
                    let link = link_of(&c.links, p);
                    last_of(&mut c.links[link].combined, col)[p % 10] += by;
                } else {
                    let port = port_of(p);
                    last_of(&mut c.ports_combined[port], col).push((p - ports[port].param_offset, by));
                }
            }
        }
        c.links.retain(|l| !(l.wanted.is_empty() && l.combined.is_empty()));
        c.placements = vec![Vec::new(); ports.len()];
        let tracked = |of: &[usize], k: usize, what: &str| {
            let at = of.iter().position(|&of| of == k);
            assert!(at.is_some(), "{what} {k} is not tracked by the prescribed motion");
            at
        };
        let slopes = &table.slopes;
        let kinematics = wanted.kinematics.iter().map(|&k| tracked(&slopes.of, k, "kinematic parameter"));
        let behind = |i: usize| i + slopes.of.len();
        let disturbances = wanted.disturbances.iter();
        let disturbances = disturbances.map(|&k| tracked(&slopes.disturbances, k, "disturbance").map(behind));
        for (col, slope) in (wanted.inertial()..).zip(kinematics.chain(disturbances)) {
            let Some(i) = slope else { continue };
            let slope = &table.slopes.all[i];
            if slope.has_arm() {
                c.arm.push((i, col));
            }
            for (at, frame) in slope.frames.iter().enumerate() {
                c.placements[frame.port].push((i, at, col));
            }
        }
        c
    }
}

impl Columns {
    /// Columns to which several parts may add: those of combined and of kinematic parameters and of disturbances.
    pub(crate) fn added(&self) -> core::ops::Range<usize> {
        self.first_added..self.count
    }
}

/// What is gathered for the column `col`, whose parts come one after another.
fn last_of<T: Default>(all: &mut Vec<(T, usize)>, col: usize) -> &mut T {
    if all.last().is_none_or(|(_, last)| *last != col) {
        all.push((T::default(), col));
    }
    let last = all.len() - 1;
    &mut all[last].0
}

/// Wanted columns of a tracked link.
#[derive(Clone, Debug)]
pub(crate) struct LinkColumns {
    /// Where its frame is among the sites of the table.
    site: usize,
    pub(crate) body: usize,
    wanted: Vec<(usize, usize)>,
    /// Factors of its ten numbers, column.
    combined: Vec<([f64; 10], usize)>,
}

/// A column of the derivatives.
#[derive(Clone, Copy)]
pub(crate) enum Column {
    /// `[w 3 | eta m | nu m]`, then `v 3` where an appendage is not Galilean.
    State(usize),
    Param(usize),
    /// One of [`Columns::added`]: several parts may add to it.
    Added(usize),
}

/// Where columns go. A trait and not a closure, because closures of some size are not inlined, and code for lanes must
/// be (`ff-lanes`).
pub(crate) trait Put<T> {
    /// `column` with a wrench about the base origin in base axes and the own rows of a port.
    fn put(&mut self, column: Column, f: V3<T>, n: V3<T>, own: &[T]);
}

/// Motion of the base at one point, or one per lane.
#[derive(Clone, Copy)]
pub(crate) struct At<T> {
    v: V3<T>,
    pub(crate) w: V3<T>,
    pub(crate) a: V3<T>,
    pub(crate) al: V3<T>,
    pub(crate) field: M3<T>,
}

impl<T: ModelScalar> At<T> {
    #[inline(always)]
    pub(crate) fn new(z: &[T], u: &[T]) -> Self {
        let (w, al) = (V3::from_slice(&z[3..]), V3::from_slice(&u[3..]));
        Self { v: V3::from_slice(z), w, a: V3::from_slice(u), al, field: M3::field(&w, &al) }
    }
}

/// Columns of the ports and links at one point or one per lane, with their buffers.
pub(crate) struct Parts<'a, T: LaneScalar> {
    pub(crate) model: &'a Model,
    pub(crate) params: &'a Params<T>,
    pub(crate) table: &'a Prescribed,
    pub(crate) columns: &'a Columns,
    pub(crate) ports: Vec<PortWork<T>>,
    pub(crate) frames: Vec<Frame<T>>,
    at_speed: Vec<Option<AtSpeed>>,
    /// State columns of each port, `6+n` each: base angular velocity, coordinates, rates, base velocity.
    state: Vec<Vec<T>>,
    /// By port, derivatives of its frame with respect to kinematic parameters, and a column of them.
    slopes: Vec<Vec<Frame<T>>>,
    column: Vec<T>,
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
        let slow = |a: &Mounted| (!a.decl().galilean).then(|| AtSpeed::new(a.dim(), a.decl().params.len()));
        Self {
            model,
            params,
            table,
            columns,
            ports: ports.iter().map(PortWork::new).collect(),
            frames: (0..table.sites.len()).map(|i| table.at_rest(i)).collect(),
            at_speed: ports.iter().map(slow).collect(),
            state: ports.iter().map(|a| vec![T::zero(); (6 + 2 * a.dim()) * (6 + a.dim())]).collect(),
            slopes: columns.placements.iter().map(|c| vec![Frame::at_rest(Pose::identity()); c.len()]).collect(),
            column: vec![T::zero(); 6 + ports.iter().map(Mounted::dim).max().unwrap_or(0)],
        }
    }

    /// Places the frames that move; `frame` reads a column of the table.
    #[inline(always)]
    pub(crate) fn place(&mut self, frame: impl Fn(usize) -> Frame<T>) {
        for (f, site) in self.frames.iter_mut().zip(&self.table.sites) {
            if let Site::Body(_, _, column) = site {
                *f = frame(*column);
            }
        }
    }

    /// Reads what frames owe to kinematic parameters at nodes, one per lane.
    #[inline(always)]
    pub(crate) fn place_slopes(&mut self, nodes: &[usize]) {
        for (slopes, columns) in self.slopes.iter_mut().zip(&self.columns.placements) {
            for (to, &(slope, frame, _)) in slopes.iter_mut().zip(columns) {
                *to = self.table.slopes.all[slope].frames[frame].at(nodes);
            }
        }
    }

    /// Columns of port `k`. `M` stays in the port, and the residual where a kinematic parameter moves its frame.
    #[inline(always)]
    pub(crate) fn port(&mut self, k: usize, at: &At<T>, z: &[T], u: &[T], to: &mut impl Put<T>) {
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
        if !self.slopes[k].is_empty() {
            let mut mass = PortMatrix::over(n, &mut p.m);
            T::port(&*ap.appendage).residual(params, &s, &accel, &mut mass, &mut p.r);
            let moved = Moved { port: p, frame, at, w: host.w, v, first };
            for (slope, &(_, _, col)) in self.slopes[k].iter().zip(&self.columns.placements[k]) {
                let column = &mut self.column[..dim];
                let (f, n) = moved.column(slope, column);
                to.put(Column::Added(col), f, n, &column[6..]);
            }
        }
        let (wanted, combined) = (&self.columns.ports[k], &self.columns.ports_combined[k]);
        if !(wanted.is_empty() && combined.is_empty()) {
            T::tangent(&*ap.appendage).regressor(params, &s, &accel, &mut p.d);
        }
        for (parts, col) in combined {
            let column = &mut self.column[..dim];
            column.fill(T::zero());
            for &(own, by) in parts {
                let by = T::from_f64(by);
                column.iter_mut().zip(&p.d[own * dim..]).for_each(|(to, d)| *to += by * *d);
            }
            let (f, n) = frame.up(&V3::from_slice(column), &V3::from_slice(&column[3..]));
            to.put(Column::Added(*col), f, n, &column[6..]);
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
    pub(crate) fn link(&self, l: usize, at: &At<T>, to: &mut impl Put<T>) {
        let LinkColumns { site, wanted, combined, .. } = &self.columns.links[l];
        let frame = &self.frames[*site];
        let host = frame.carried(&at.w, &at.al, &at.a, &at.field);
        let moving = Moving::new(host.w, host.al, host.a);
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
        for (by, col) in combined {
            let mut sums = [T::zero(); 6];
            for (sum, row) in sums.iter_mut().zip(&rows) {
                row.iter().zip(by).for_each(|(x, by)| *sum += *x * T::from_f64(*by));
            }
            to.put(Column::Added(*col), V3::from_slice(&sums), V3::from_slice(&sums[3..]), &[]);
        }
    }
}

/// A port whose frame is displaced, at given accelerations of the base and of its own coordinates.
struct Moved<'a, T: LaneScalar> {
    /// With `M`, Jacobian and residual.
    port: &'a PortWork<T>,
    frame: &'a Frame<T>,
    at: &'a At<T>,
    /// Angular velocity and velocity of the frame in its axes, the latter zero where it plays no part.
    w: V3<T>,
    v: V3<T>,
    /// Columns of the Jacobian before those of the angular velocity.
    first: usize,
}

impl<T: LaneScalar> Moved<'_, T> {
    /// What the port's equations owe to a displacement with derivative `d` of the frame: wrench about the base origin, and
    /// own rows in `own[6..]`.
    ///
    /// With `X = R^T x` for the frame's motion `x` in base axes, `dX = dR^T x + R^T dx` goes through Jacobian and mass matrix;
    /// the residual `r` itself is carried to the base by `d(R f) = dR f`, `d(R n + p x R f) = dR n + dp x R f + p x dR f`.
    #[inline(always)]
    fn column(&self, d: &Frame<T>, own: &mut [T]) -> (V3<T>, V3<T>) {
        let Self { port, frame, at, w, v, first } = self;
        let (two, zero) = (T::from_f64(2.0), V3::zero());
        let mut a = at.field.mul_add(&frame.pose.p, &at.a);
        let (mut w_at, mut al_at) = (at.w, at.al);
        if frame.moving {
            a += frame.ddp + at.w.cross(&frame.dp).scaled(two);
            al_at += at.w.cross_add(&frame.w, &frame.dw);
            w_at += frame.w;
        }
        let da = at.field.mul_add(&d.pose.p, &(d.ddp + at.w.cross(&d.dp).scaled(two)));
        let (mut lin, al) = (turned(d, frame, &a, &da), turned(d, frame, &al_at, &at.w.cross_add(&d.w, &d.dw)));
        let dw = turned(d, frame, &w_at, &d.w);
        let mut dv = zero;
        if *first > 0 {
            let v_at = at.w.cross_add(&frame.pose.p, &at.v) + frame.dp;
            dv = turned(d, frame, &v_at, &at.w.cross_add(&d.pose.p, &d.dp));
            lin -= dw.cross(v) + w.cross(&dv);
        }
        port.along(*first, &dw, &dv, &lin, &al, own);
        let (mut f, mut n) = frame.up(&V3::from_slice(own), &V3::from_slice(&own[3..]));
        let (rf, rn) = (V3::from_slice(&port.r), V3::from_slice(&port.r[3..]));
        let (force, df) = (frame.up(&rf, &zero).0, d.pose.r.mul(&rf));
        f += df;
        n += d.pose.r.mul(&rn) + d.pose.p.cross(&force) + frame.pose.p.cross(&df);
        (f, n)
    }
}

/// `dR^T x + R^T dx`.
#[inline(always)]
fn turned<T: LaneScalar>(d: &Frame<T>, frame: &Frame<T>, x: &V3<T>, dx: &V3<T>) -> V3<T> {
    d.pose.r.tr_mul(x) + frame.down(dx)
}

/// Number of state columns.
pub(crate) fn state_columns(model: &Model) -> usize {
    let galilean = model.appendages().iter().all(|a| a.decl().galilean);
    3 + 2 * model.np() + if galilean { 0 } else { 3 }
}

#[inline(always)]
pub(crate) fn unit<T: ModelScalar>(k: usize) -> V3<T> {
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
