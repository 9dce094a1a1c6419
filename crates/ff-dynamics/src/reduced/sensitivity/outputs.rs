//! Joint torques as linear forms of what the derivatives of a trajectory are: state, accelerations and parameters.

use crate::linalg::rows::BLOCK;
use crate::reduced::sensitivity::partials::{At, Column, Columns, Parts, Put, state_columns, unit};
use crate::reduced::system::hung;
use crate::reduced::table::{Prescribed, products};
use ff_model::spatial::vec3::V3;
use ff_model::{Model, Params};

/// Joint torques as linear forms at one sample: `d tau = t_u du + t_z dz + t_p`.
pub(crate) struct TorqueRows<'a> {
    parts: Parts<'a, f64>,
    /// `n x (6 + m)` and `n x nz`, column by column.
    pub(crate) by_u: Vec<f64>,
    pub(crate) by_z: Vec<f64>,
    /// `n x P`, row by row; rows are `wide` apart, a multiple of [`BLOCK`], with zeros behind the last column.
    pub(crate) by_p: Vec<f64>,
    pub(crate) wide: usize,
    /// Columns beyond 6 of `by_u`, beyond 3 of `by_z` and `by_p` can be other than zero.
    pub(crate) carried: bool,
}

impl<'a> TorqueRows<'a> {
    pub(crate) fn new(model: &'a Model, params: &'a Params<f64>, table: &'a Prescribed, columns: &'a Columns) -> Self {
        let (nj, wide) = (model.nj(), columns.count.next_multiple_of(BLOCK));
        Self {
            parts: Parts::new(model, params, table, columns),
            by_u: vec![0.0; nj * (6 + model.np())],
            by_z: vec![0.0; nj * state_columns(model)],
            by_p: vec![0.0; nj * wide],
            wide,
            carried: model.appendages().iter().any(|a| a.host > 0)
                || !columns.links.is_empty()
                || !columns.added().is_empty(),
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
            let form = table.row::<f64>(sample, j).form;
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
        parts.place_slopes(&[node]);
        let ww = products(&at.w);
        for &(slope, col) in &parts.columns.arm {
            for j in 0..nj {
                by_p[j * wide + col] += table.slopes.all[slope].row(sample, j).form.value(&at.a, &at.al, &at.w, &ww);
            }
        }
        for l in 0..parts.columns.links.len() {
            let above = &table.above[parts.columns.links[l].body];
            parts.link(l, &at, &mut Felt { table, sample, above, nj, wide, by_z, by_p });
        }
        let felt = |j: usize, f: &V3<f64>, n: &V3<f64>| table.row::<f64>(sample, j).of(f, n);
        for (k, ap) in model.appendages().iter().enumerate().filter(|(_, a)| a.host > 0) {
            let above = &table.above[ap.host];
            parts.port(k, &at, z, u, &mut Felt { table, sample, above, nj, wide, by_z, by_p });
            let (p, frame) = (&parts.ports[k], &parts.frames[k]);
            // The residual is at hand where a kinematic parameter moves the frame; if it moves a joint above, it does.
            for &(slope, _, col) in &parts.columns.placements[k] {
                let slope = &table.slopes.all[slope];
                if slope.has_arm() {
                    let (f, n) = frame.up(&V3::from_slice(&p.r), &V3::from_slice(&p.r[3..]));
                    above.iter().for_each(|&j| by_p[j * wide + col] += slope.row(sample, j).of(&f, &n));
                }
            }
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
            let torque = self.table.row::<f64>(self.sample, j).of(&f, &n);
            match column {
                Column::State(c) => self.by_z[c * self.nj + j] += torque,
                Column::Param(c) | Column::Added(c) => self.by_p[j * self.wide + c] += torque,
            }
        }
    }
}
