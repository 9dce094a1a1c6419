//! The Reduced Dynamics Algorithm: a rigid system from joint motion, joint torques and the base gyro.
//!
//! Base acceleration is eliminated by momentum conservation, so neither it nor base position, velocity or
//! attitude has to be measured: `tau = H* qdd + c* = N^T Y phi`, rational in `phi`, with the exact Jacobian
//! `N^T Y` ([`ff_dynamics::reduced_torques`]; Rackl, Lampariello, Albu-Schaeffer 2013).

use crate::estimate::delay::OutputOperator;
use crate::estimate::estimator::Estimator;
use crate::estimate::row_stream::{RowBlock, RowStream};
use crate::estimate::setup::{Noise, SetupError, check_noise};
use crate::motion::tables::{Displaced, KEPT, Table, Tables};
use core::ops::Range;
use ff_dynamics::Wanted;
use ff_dynamics::reduced::reduced_torques_span;
use ff_least_squares::EvalError;
use ff_model::{Model, Params};
use ff_records::time_base::on_grid;
use ff_records::{ChannelGroup, Record};
use nalgebra::DMatrix;
use std::borrow::Cow;
use std::sync::Arc;

/// The rigid estimator.
///
/// Torques may have sample times of their own; predictions are then interpolated where they were read. So may the gyro, which is an
/// input here: its readings are brought to the grid (`docs/theory/output-operator.md`).
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::{Noise, Rda, Request, estimate};
///
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// let fit = estimate(&Request::new(&decls, &mass, &start), &mut rda)?;
/// assert!(fit.status.is_converged() && (fit.values[0] - 60.0).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Rda<'a> {
    model: &'a Model,
    record: &'a Record,
    sigma: f64,
    tables: Tables,
    /// Base rates on the grid (rad/s), samples x 3.
    rates: Cow<'a, DMatrix<f64>>,
    /// How torques are read, where they are not sampled on the grid.
    by: Option<OutputOperator>,
}

impl<'a> Rda<'a> {
    /// For a rigid model and a record of it.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(model: &'a Model, record: &'a Record, noise: &Noise) -> Result<Self, SetupError> {
        check_noise(noise)?;
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()));
        }
        let (samples, dt) = (record.samples(), record.dt());
        let rates = match record.times(ChannelGroup::Gyro) {
            Some(times) => Cow::Owned(on_grid(ChannelGroup::Gyro, times, record.gyro(), dt, samples)?),
            None => Cow::Borrowed(record.gyro()),
        };
        let by = match record.times(ChannelGroup::Torque) {
            Some(times) => {
                let by = OutputOperator::new(samples, dt, Some(Arc::from(times)), 0.0);
                let few = || SetupError::JointMotion("interpolation of readings needs six samples of the grid".into());
                Some(by.ok_or_else(few)?)
            }
            None => None,
        };
        let tables = Tables::new(model, record, 1, Some((noise, &[])), (true, false))?;
        Ok(Self { model, record, sigma: noise.torque, tables, rates, by })
    }
    /// Samples of the grid that readings need.
    fn needed(&self, readings: &Range<usize>) -> Range<usize> {
        match &self.by {
            Some(by) => by.first(readings.start)..by.end(readings.end - 1),
            None => readings.clone(),
        }
    }
    /// Whitened residuals and, unless there are no columns, derivatives of the torques at some readings, in rows of joints.
    fn run(
        &mut self,
        full: &[f64],
        selected: &[usize],
        readings: Range<usize>,
        r: &mut [f64],
    ) -> Result<DMatrix<f64>, EvalError> {
        let params = Params::from_values(self.model, full.to_vec());
        let wanted = Wanted { params: selected.to_vec(), initial: Vec::new(), ..Wanted::default() };
        let (model, grid) = (self.model, self.needed(&readings));
        let rates = match &self.rates {
            Cow::Borrowed(all) if grid.len() == all.nrows() => Cow::Borrowed(*all),
            all => Cow::Owned(all.rows(grid.start, grid.len()).into_owned()),
        };
        let Table { table, samples } = self.tables.span(model, &params, &Displaced::none(model), &wanted, grid.clone());
        let made = reduced_torques_span(model, &params, table, samples, &rates, &wanted);
        let (mut tau, mut d) = made.map_err(|e| EvalError::Rejected(e.to_string()))?;
        if let Some(by) = &self.by {
            tau = by.of(&tau, grid.start, readings.clone());
            d = by.of_rows(&d, model.nj(), grid.start, readings.clone());
        }
        let n = model.nj();
        for i in 0..tau.nrows() {
            for j in 0..n {
                r[i * n + j] = (tau[(i, j)] - self.record.tau()[(readings.start + i, j)]) / self.sigma;
            }
        }
        Ok(d)
    }
    fn readings(&self) -> usize {
        self.record.tau().nrows()
    }
}

impl Estimator for Rda<'_> {
    fn rows(&self) -> usize {
        self.readings() * self.model.nj()
    }
    fn residuals(&mut self, full: &[f64], _extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let n = self.model.nj();
        for part in parts(self.readings()) {
            self.run(full, &[], part.clone(), &mut r[part.start * n..part.end * n])?;
        }
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        _extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let n = self.model.nj();
        for part in parts(self.readings()) {
            let rows = part.start * n..part.end * n;
            let d = self.run(full, selected, part, &mut r[rows.clone()])?;
            j.view_mut((rows.start, 0), (rows.len(), selected.len())).copy_from(&(d / self.sigma));
        }
        Ok(())
    }
    fn streams<'s>(
        &'s mut self,
        full: &[f64],
        _extra: &[f64],
        selected: &[usize],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        Ok(vec![Box::new(Parts { full: full.to_vec(), selected: selected.to_vec(), next: 0, rda: self })])
    }
}

/// Readings that are evaluated together: all of them where a table of the whole record is kept.
fn parts(readings: usize) -> impl Iterator<Item = Range<usize>> {
    let length = if readings <= KEPT { readings.max(1) } else { PART };
    (0..readings).step_by(length).map(move |first| first..(first + length).min(readings))
}

/// Readings of a block of rows.
const PART: usize = 1024;

/// The rows, some readings at a time.
struct Parts<'s, 'a> {
    rda: &'s mut Rda<'a>,
    full: Vec<f64>,
    selected: Vec<usize>,
    next: usize,
}

impl RowStream for Parts<'_, '_> {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        let Self { rda, full, selected, next } = self;
        let (n, part) = (rda.model.nj(), *next..(*next + PART).min(rda.readings()));
        if part.is_empty() {
            return Ok(false);
        }
        let rows = part.start * n..part.end * n;
        block.resize(core::slice::from_ref(&rows), selected.len());
        let d = rda.run(full, selected, part.clone(), &mut block.residuals)?;
        block.jacobian.copy_from(&(d / rda.sigma));
        *next = part.end;
        Ok(true)
    }
}
