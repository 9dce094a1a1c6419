//! Exact sensitivities of the simulated record with respect to any parameters, integrated beside the states.
//!
//! Differentiating `0 = R(z, u, p)` of [`crate::reduced`] with `u = [A | nu']`:
//!
//! ```text
//! M_uu du = -(R_z dz + R_p dp),
//! ```
//!
//! so one regressor `R_p`, one derivative pass `R_z` and one factorisation of `M_uu` per stage serve all
//! parameters. The discrete sensitivities are the exact derivatives of the discrete (RK4) solution.

use crate::ldl;
use crate::prescribed::Prescribed;
use crate::reduced::{Reduced, ReducedError, ReducedWork, Response, STAGE, WEIGHT, check, rate, torques};
use crate::regressor::{PortDerivatives, PortJacobian, body_regressor};
use ff_model::{Force, Model, Motion, Params, PortState};
use nalgebra::DMatrix;

/// What to differentiate with respect to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Indices into the parameter vector (base body, tracked links, appendages).
    pub params: Vec<usize>,
    /// Indices into the initial state `z0 = [V 6 | eta m | nu m]`.
    pub initial: Vec<usize>,
}

impl Wanted {
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.params.len() + self.initial.len()
    }
    /// True without columns.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Bodies other than the base whose parameters are wanted: the `links` of [`Prescribed::new`].
    pub fn links(&self, model: &Model) -> Vec<usize> {
        let mut l: Vec<usize> =
            self.params.iter().filter(|&&p| p >= 10 && p < 10 * model.n_bodies()).map(|p| p / 10).collect();
        l.dedup();
        l.sort_unstable();
        l.dedup();
        l
    }
}

/// Derivatives of torque and gyro samples; row `i * n + j` is channel `j` at sample `i`, one column per
/// entry of [`Wanted`] (parameters first).
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivities {
    /// d tau, `(N n) x P` (N m per unit).
    pub tau: DMatrix<f64>,
    /// d gyro, `(N 3) x P` (rad/s per unit).
    pub gyro: DMatrix<f64>,
}

/// Where a wanted parameter lives.
#[derive(Clone, Copy)]
enum Place {
    Base(usize),
    Link { frame: usize, body: usize, k: usize },
    Port { port: usize, k: usize },
}

/// Derivatives of the reduced equations at one node and state.
struct Tangent<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    table: &'a Prescribed,
    places: Vec<Place>,
    /// Per port: derivatives with respect to its wanted parameters.
    by_port: Vec<PortDerivatives>,
    by_state: Vec<PortJacobian>,
    /// `R_z`, `(6+m) x nz` row-major, and the port wrenches' `d/dz`, 6 x nz each.
    rz: Vec<f64>,
    gain: Vec<f64>,
    wz: Vec<Vec<f64>>,
    /// `R_p`, `(6+m) x P` column by column, and the wrench part that sits on a link, per column.
    rp: Vec<f64>,
    wp: Vec<Force<f64>>,
}

impl<'a> Tangent<'a> {
    fn new(model: &'a Model, params: &'a Params<f64>, table: &'a Prescribed, wanted: &Wanted) -> Self {
        let bodies = 10 * model.n_bodies();
        let ports = model.appendages();
        let places: Vec<Place> = wanted
            .params
            .iter()
            .map(|&p| {
                if p < 10 {
                    Place::Base(p)
                } else if p < bodies {
                    let body = p / 10;
                    let at = table.links.iter().position(|&l| l == body);
                    assert!(at.is_some(), "body {body} is not tracked by the prescribed motion");
                    Place::Link { frame: ports.len() + at.unwrap_or(0), body, k: p % 10 }
                } else {
                    let port = ports.iter().rposition(|a| a.param_offset <= p).unwrap_or(0);
                    Place::Port { port, k: p - ports[port].param_offset }
                }
            })
            .collect();
        let mut by_port = vec![Vec::new(); ports.len()];
        for (col, p) in places.iter().enumerate() {
            if let Place::Port { port, k } = p {
                by_port[*port].push((*k, col));
            }
        }
        let (m, nz) = (model.np(), 6 + 2 * model.np());
        Self {
            model,
            params,
            table,
            by_port: ports.iter().zip(&by_port).map(|(a, w)| PortDerivatives::new(&*a.appendage, w)).collect(),
            by_state: ports
                .iter()
                .enumerate()
                .map(|(k, a)| PortJacobian::new(a.dim(), params.appendage(model, k)))
                .collect(),
            rz: vec![0.0; (6 + m) * nz],
            gain: vec![0.0; (6 + m) * nz],
            wz: vec![vec![0.0; 6 * nz]; ports.len()],
            rp: vec![0.0; (6 + m) * places.len()],
            wp: vec![Force::zero(); places.len()],
            places,
        }
    }

    /// Fills `R_z` and `R_p` at `(node, z, u)`; plain port terms are taken from `real`.
    ///
    /// Base rows: `d/dV [I' V + V x* ((I_base + I) V + h)]` by columns, plus per port, with `T = X^-1`,
    /// `d w = h_V T dV + M_b T (dV x s) + h_eta d eta + h_nu d nu`.
    fn evaluate(&mut self, node: usize, z: &[f64], u: &[f64], real: &ReducedWork<f64>) {
        let (m, nz) = (self.model.np(), z.len());
        let (v, a) = (Motion::from_slice(z), Motion::<f64>::from_slice(u));
        self.rz.fill(0.0);
        let arm = &self.table.arm[node];
        let total = *self.params.body(0) + arm.inertia;
        let p = total.mul_motion(&v) + arm.h;
        let unit: [Motion<f64>; 6] = core::array::from_fn(|j| {
            let mut e = [0.0; 6];
            e[j] = 1.0;
            Motion::from_slice(&e)
        });
        for (j, e) in unit.iter().enumerate() {
            let col = arm.d_inertia.mul_motion(e) + e.cross_force(&p) + v.cross_force(&total.mul_motion(e));
            for i in 0..6 {
                self.rz[i * nz + j] = col.get(i);
            }
        }
        let frames = self.table.frames_at(node);
        for (k, ap) in self.model.appendages().iter().enumerate() {
            let (f, n) = (&frames[k], ap.dim());
            let (dim, first) = (6 + n, ap.coord_offset);
            let s = PortState {
                host: real.v[k],
                eta: &z[6 + first..6 + first + n],
                nu: &z[6 + m + first..6 + m + first + n],
            };
            let host = f.x.motion_to_child(&(a + f.ds + v.cross(&f.s)));
            let jac = &mut self.by_state[k];
            jac.evaluate(&*ap.appendage, &s, &host, &u[6 + first..6 + first + n]);
            self.wz[k].fill(0.0);
            let (rz, wz) = (&mut self.rz, &mut self.wz[k]);
            let mut put = |col: usize, d: &[f64]| {
                let w = f.x.force_to_parent(&Force::from_slice(d));
                for i in 0..6 {
                    rz[i * nz + col] += w.get(i);
                    wz[i * nz + col] = w.get(i);
                }
                for i in 0..n {
                    rz[(6 + first + i) * nz + col] += d[6 + i];
                }
            };
            let mut d = [0.0; 6 + ff_model::MAX_COORDS];
            for (j, e) in unit.iter().enumerate() {
                let dv = f.x.motion_to_child(e);
                let da = f.x.motion_to_child(&e.cross(&f.s));
                d[..dim].fill(0.0);
                for c in 0..6 {
                    let (x, y) = (dv.get(c), da.get(c));
                    for i in 0..dim {
                        d[i] += jac.columns[c * dim + i] * x + real.port_m(k, i, c) * y;
                    }
                }
                put(j, &d[..dim]);
            }
            for i in 0..n {
                put(6 + first + i, &jac.columns[(6 + i) * dim..(7 + i) * dim]);
                put(6 + m + first + i, &jac.columns[(6 + n + i) * dim..(7 + n + i) * dim]);
            }
        }
        self.parameters(node, z, u, real);
    }

    /// Fills `R_p` alone.
    fn parameters(&mut self, node: usize, z: &[f64], u: &[f64], real: &ReducedWork<f64>) {
        let m = self.model.np();
        self.rp.fill(0.0);
        let (v, a) = (Motion::from_slice(z), Motion::<f64>::from_slice(u));
        let frames = self.table.frames_at(node);
        let rows = 6 + m;
        let base = body_regressor(&v, &a);
        for (col, place) in self.places.iter().enumerate() {
            match *place {
                Place::Base(k) => base[k].write_to(&mut self.rp[col * rows..]),
                Place::Link { frame, k, .. } => {
                    let f = &frames[frame];
                    let vh = f.x.motion_to_child(&(v + f.s));
                    let ah = f.x.motion_to_child(&(a + f.ds + v.cross(&f.s)));
                    let w = f.x.force_to_parent(&body_regressor(&vh, &ah)[k]);
                    w.write_to(&mut self.rp[col * rows..]);
                    self.wp[col] = w;
                }
                Place::Port { .. } => {}
            }
        }
        for (port, ap) in self.model.appendages().iter().enumerate() {
            let f = &frames[port];
            let host = f.x.motion_to_child(&(a + f.ds + v.cross(&f.s)));
            let r = ap.coord_offset..ap.coord_offset + ap.dim();
            let s = PortState {
                host: real.v[port],
                eta: &z[6 + r.start..6 + r.end],
                nu: &z[6 + m + r.start..6 + m + r.end],
            };
            let (rp, wp) = (&mut self.rp, &mut self.wp);
            let p = self.params.appendage(self.model, port);
            let acc = &u[6 + r.start..6 + r.end];
            self.by_port[port].evaluate(&*ap.appendage, p, &s, &host, acc, |col, d| {
                let w = f.x.force_to_parent(&Force::from_slice(d));
                w.write_to(&mut rp[col * rows..]);
                wp[col] = w;
                rp[col * rows + 6 + r.start..col * rows + 6 + r.end].copy_from_slice(&d[6..]);
            });
        }
    }

    /// `du` of every column: `M_uu du = -(R_z dz + R_p)`, as `du = G dz + M_uu^-1 (-R_p)` with
    /// `G = -M_uu^-1 R_z` formed once.
    fn solve(&mut self, mass: &[f64], dz: &[f64], du: &mut [f64]) {
        let rows = 6 + self.model.np();
        let nz = 6 + 2 * self.model.np();
        for c in 0..nz {
            let g = &mut self.gain[c * rows..(c + 1) * rows];
            for (i, x) in g.iter_mut().enumerate() {
                *x = -self.rz[i * nz + c];
            }
            ldl::solve(mass, rows, g);
        }
        for (col, (du, dz)) in du.chunks_exact_mut(rows).zip(dz.chunks_exact(nz)).enumerate() {
            if col < self.places.len() {
                for (x, r) in du.iter_mut().zip(&self.rp[col * rows..]) {
                    *x = -r;
                }
                ldl::solve(mass, rows, du);
            } else {
                du.fill(0.0);
            }
            for (g, &z) in self.gain.chunks_exact(rows).zip(dz) {
                du.iter_mut().zip(g).for_each(|(x, g)| *x += g * z);
            }
        }
    }

    /// Torque derivatives of one sample into `out[j]` for column `col`.
    #[allow(clippy::too_many_arguments)] // state, its derivative, accelerations, theirs: all are needed
    fn torque(
        &self,
        sample: usize,
        col: usize,
        z: &[f64],
        dz: &[f64],
        du: &[f64],
        real: &ReducedWork<f64>,
        out: &mut [f64],
    ) {
        let v = Motion::from_slice(z);
        let (dv, da) = (Motion::from_slice(dz), Motion::<f64>::from_slice(du));
        let rows = self.table.rows_at(sample);
        for (t, r) in out.iter_mut().zip(rows) {
            let c = &r.carrier;
            let f = c.inertia.mul_motion(&da)
                + c.d_inertia.mul_motion(&dv)
                + dv.cross_force(&(c.inertia.mul_motion(&v) + c.h))
                + v.cross_force(&c.inertia.mul_motion(&dv));
            *t = r.screw.dot(&f);
        }
        let mut add = |host: usize, w: &Force<f64>| {
            for &j in &self.table.above[host] {
                out[j] += rows[j].screw.dot(w);
            }
        };
        let node = sample * 2 * self.table.substeps;
        let nz = z.len();
        for (k, ap) in self.model.appendages().iter().enumerate().filter(|(_, ap)| ap.host > 0) {
            let x = &self.table.frames_at(node)[k].x;
            let mut w = real.host_block(k, x).mul_motion(&da);
            for j in 0..ap.dim() {
                w += x.force_to_parent(&real.coupling(k, j)).scaled(du[6 + ap.coord_offset + j]);
            }
            let mut along = [0.0; 6];
            for (i, a) in along.iter_mut().enumerate() {
                *a = self.wz[k][i * nz..(i + 1) * nz].iter().zip(dz).map(|(a, b)| a * b).sum();
            }
            w += Force::from_slice(&along);
            add(ap.host, &w);
        }
        match self.places.get(col) {
            Some(Place::Link { body, .. }) => add(*body, &self.wp[col]),
            Some(Place::Port { port, .. }) => add(self.model.appendages()[*port].host, &self.wp[col]),
            _ => {}
        }
    }
}

/// Integrates the reduced system and its sensitivities from `z0`; see [`crate::simulate_reduced`].
///
/// The response is bit for bit that of [`crate::simulate_reduced`]. Allocates results and buffers once.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If `z0` has the wrong length or a wanted link is not tracked by `table`.
pub fn sensitivities(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    check(model)?;
    let (m, nj, np) = (model.np(), model.nj(), wanted.len());
    let (nz, nu) = (6 + 2 * m, 6 + m);
    assert_eq!(z0.len(), nz, "initial state");
    let mut sys = Reduced::new(model, params, table);
    let mut tan = Tangent::new(model, params, table, wanted);
    let mut out = Response::new(table.samples, nj, m);
    let mut sens =
        Sensitivities { tau: DMatrix::zeros(table.samples * nj, np), gyro: DMatrix::zeros(table.samples * 3, np) };
    let mut z = z0.to_vec();
    let mut dz = vec![0.0; nz * np];
    for (c, &i) in wanted.initial.iter().enumerate() {
        dz[(wanted.params.len() + c) * nz + i] = 1.0;
    }
    let (mut zs, mut k, mut sum) = (z.clone(), vec![0.0; nz], vec![0.0; nz]);
    let (mut dzs, mut dk, mut dsum) = (dz.clone(), dz.clone(), dz.clone());
    let (mut u, mut du) = (vec![0.0; nu], vec![0.0; nu * np]);
    let mut tau = vec![0.0; nj];
    for i in 0..table.samples {
        let node = i * 2 * table.substeps;
        for s in 0..table.substeps {
            sum.fill(0.0);
            dsum.fill(0.0);
            for stage in 0..4 {
                zs.copy_from_slice(&z);
                dzs.copy_from_slice(&dz);
                let c = 0.5 * table.step * STAGE[stage] as f64;
                if stage > 0 {
                    zs.iter_mut().zip(&k).for_each(|(x, k)| *x += c * k);
                    dzs.iter_mut().zip(&dk).for_each(|(x, k)| *x += c * k);
                }
                let at = node + 2 * s + STAGE[stage];
                sys.accelerations(at, &zs, &mut u)?;
                tan.evaluate(at, &zs, &u, &sys.work);
                tan.solve(&sys.mass, &dzs, &mut du);
                if s == 0 && stage == 0 {
                    sys.work.residual(model, params, table, at, &zs, &u);
                    torques(
                        model,
                        table,
                        i,
                        &Motion::from_slice(&z),
                        &Motion::from_slice(&u),
                        &sys.work.wrench,
                        &mut tau,
                    );
                    out.write(i, m, &z, &u, &tau);
                    for c in 0..np {
                        let (dz, du) = (&dz[c * nz..(c + 1) * nz], &du[c * nu..(c + 1) * nu]);
                        tan.torque(
                            i,
                            c,
                            &z,
                            dz,
                            du,
                            &sys.work,
                            &mut sens.tau.as_mut_slice()[c * table.samples * nj + i * nj..][..nj],
                        );
                        sens.gyro.as_mut_slice()[c * table.samples * 3 + i * 3..][..3].copy_from_slice(&dz[3..6]);
                    }
                    if i + 1 == table.samples {
                        return Ok((out, sens));
                    }
                }
                rate(m, &zs, &u, &mut k);
                sum.iter_mut().zip(&k).for_each(|(x, k)| *x += WEIGHT[stage] * table.step * k);
                for c in 0..np {
                    rate(m, &dzs[c * nz..(c + 1) * nz], &du[c * nu..(c + 1) * nu], &mut dk[c * nz..(c + 1) * nz]);
                }
                dsum.iter_mut().zip(&dk).for_each(|(x, k)| *x += WEIGHT[stage] * table.step * k);
            }
            z.iter_mut().zip(&sum).for_each(|(x, d)| *x += d);
            dz.iter_mut().zip(&dsum).for_each(|(x, d)| *x += d);
        }
        if !z.iter().all(|x| x.is_finite()) {
            return Err(ReducedError::NotFinite { t: i as f64 * table.sample_s, step: table.step });
        }
    }
    Ok((out, sens))
}

/// Joint torques of a rigid system for measured base rates, base acceleration eliminated: the reduced
/// dynamics of the RDA, with exact parameter derivatives.
///
/// `rates` is `N x 3`, the base angular velocity at the samples. Momentum conservation gives the base
/// acceleration, `A = -H_b^-1 (H_bm qdd + c_b)`, whatever the linear velocity (Galilean invariance), and
///
/// ```text
/// tau = H_m qdd + H_bm^T A + c_m = N^T Y phi,     d tau / d phi = N^T Y(A),     N^T = [-H_bm^T H_b^-1, 1].
/// ```
///
/// Rackl, Lampariello, Albu-Schaeffer 2013 (reference 2 of the paper); `docs/theory/rda.md`. Returns torques
/// (`N x n`) and their derivatives (`(N n) x P`, columns as in `wanted.params`). Allocates the results.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If the model has passive coordinates, `wanted.initial` is not empty, or a shape is wrong.
pub fn reduced_torques(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    rates: &DMatrix<f64>,
    wanted: &Wanted,
) -> Result<(DMatrix<f64>, DMatrix<f64>), ReducedError> {
    check(model)?;
    assert_eq!(model.np(), 0, "reduced torques are those of a rigid model");
    assert!(wanted.initial.is_empty(), "there is no initial state to differentiate with respect to");
    assert_eq!(rates.shape(), (table.samples, 3), "base rates");
    let (n, nj, np) = (table.samples, model.nj(), wanted.params.len());
    let mut sys = Reduced::new(model, params, table);
    let mut tan = Tangent::new(model, params, table, wanted);
    let (mut tau, mut d) = (DMatrix::zeros(n, nj), DMatrix::zeros(n * nj, np));
    let (mut u, mut du, dz) = ([0.0; 6], vec![0.0; 6 * np], vec![0.0; 6 * np]);
    let mut row = vec![0.0; nj];
    for i in 0..n {
        let z = [0.0, 0.0, 0.0, rates[(i, 0)], rates[(i, 1)], rates[(i, 2)]];
        let node = i * 2 * table.substeps;
        sys.accelerations(node, &z, &mut u)?;
        torques(model, table, i, &Motion::from_slice(&z), &Motion::from_slice(&u), &[], &mut row);
        row.iter().enumerate().for_each(|(j, &t)| tau[(i, j)] = t);
        tan.parameters(node, &z, &u, &sys.work);
        tan.solve(&sys.mass, &dz, &mut du);
        for c in 0..np {
            let out = &mut d.as_mut_slice()[c * n * nj + i * nj..][..nj];
            tan.torque(i, c, &z, &dz[..6], &du[c * 6..c * 6 + 6], &sys.work, out);
        }
    }
    Ok((tau, d))
}
