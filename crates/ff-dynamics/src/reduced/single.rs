//! One trajectory of the reduced system at one parameter set.

use crate::reduced::coupled;
use crate::reduced::follow::Follow;
use crate::reduced::stages::Stages;
use crate::reduced::system::{Reduced, ReducedError, Response, check, integrate};
use crate::reduced::table::Prescribed;
use core::ops::Range;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{LaneTask, dispatch_one, splat};
use ff_model::{Model, Params};

/// Integrates the reduced system from `z0 = [V 6 | eta m | nu m]` (classical RK4) and samples it.
///
/// Allocates the response and buffers once.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If `z0` has the wrong length.
pub fn simulate_reduced(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
) -> Result<Response, ReducedError> {
    simulate_reduced_span(model, params, table, 0..table.samples, &mut z0.to_vec())
}

/// [`simulate_reduced`] over the samples `span` of the table, from the state `z` at the first of them on. `z` becomes the state at the
/// sample `span.end`, from which the next part goes on; at the end of the table, that of its last sample. The parts give what the
/// whole gives, bit for bit, and so do tables of parts ([`Prescribed::span`]) with one sample more than is asked for.
///
/// Allocates the response of the span and buffers once.
///
/// # Errors
/// [`ReducedError`]; `z` is then as it was.
///
/// # Panics
/// If `z` has the wrong length, or the span is empty or ends beyond the table.
pub fn simulate_reduced_span(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    span: Range<usize>,
    z: &mut [f64],
) -> Result<Response, ReducedError> {
    let own = span.clone();
    if let Some(done) =
        coupled::over_tree(model, |tree| simulate_reduced_span(tree, params, table, own, z), Response::folded)
    {
        return done;
    }
    single(model, params, table, span, z, None)
}

impl Stages {
    /// [`crate::simulate_reduced`], whose stages take the place of those that were kept. Allocates the response twice, and the stages where
    /// there is less room than they take.
    ///
    /// # Errors
    /// [`ReducedError`]; nothing is kept then.
    ///
    /// # Panics
    /// If `z0` has the wrong length.
    pub fn integrate(
        &mut self,
        model: &Model,
        params: &Params<f64>,
        table: &Prescribed,
        z0: &[f64],
    ) -> Result<Response, ReducedError> {
        if let Some(done) = coupled::over_tree(model, |tree| self.integrate(tree, params, table, z0), Response::folded)
        {
            return done;
        }
        self.begin((table.samples() - 1) * table.substeps, model.np());
        let response = single(model, params, table, 0..table.samples(), &mut z0.to_vec(), Some(self))?;
        self.end(&response);
        Ok(response)
    }
}

/// [`simulate_reduced_span`] of a tree in which every joint moves by itself, whose stages are kept where there is a place for them.
pub(crate) fn single(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    span: Range<usize>,
    z: &mut [f64],
    stages: Option<&mut Stages>,
) -> Result<Response, ReducedError> {
    check(model)?;
    assert_eq!(z.len(), 6 + 2 * model.np(), "initial state");
    assert!(span.start < span.end && span.end <= table.samples, "samples of a span");
    dispatch_one(Single { model, params, table, span, z, stages })
}

struct Single<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    table: &'a Prescribed,
    span: Range<usize>,
    z: &'a mut [f64],
    stages: Option<&'a mut Stages>,
}

impl LaneTask for Single<'_> {
    type Output = Result<Response, ReducedError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, params, table, span, z, stages } = self;
        let m = model.np();
        let mut out = Response::new(span.len(), model.nj(), m);
        let params = params.lift::<L>(model);
        let mut sys = Reduced::new(model, &params, table);
        let written = Written::new(core::slice::from_mut(&mut out), (m, model.nj()), stages);
        let last = integrate(&mut sys, &splat::<L>(z), span, None, written)?;
        z.iter_mut().zip(&last).for_each(|(z, x)| *z = x.lane(0));
        Ok(out)
    }
}

/// Trajectories lane by lane, as many as there are places for them, and the stages of the first where there is one.
pub(crate) struct Written<'a> {
    out: &'a mut [Response],
    /// A sample of one of them.
    plain: Vec<f64>,
    m: usize,
    stages: Option<&'a mut Stages>,
}

impl<'a> Written<'a> {
    /// Of a system with so many passive coordinates and joints.
    pub(crate) fn new(out: &'a mut [Response], (m, nj): (usize, usize), stages: Option<&'a mut Stages>) -> Self {
        Self { out, plain: vec![0.0; 12 + 3 * m + nj], m, stages }
    }
}

impl<L: LaneScalar> Follow<L> for Written<'_> {
    #[inline(always)]
    fn stage(&mut self, z: &[L], u: &[L]) {
        if let Some(stages) = &mut self.stages {
            stages.push(z, u);
        }
    }
    #[inline(always)]
    fn sample(&mut self, i: usize, z: &[L], u: &[L], tau: &[L]) {
        for (lane, out) in self.out.iter_mut().enumerate() {
            write_lane(out, &mut self.plain, lane, (i, self.m), z, u, tau);
        }
    }
}

/// Lane `lane` of a sample into `out`, through a buffer.
#[inline(always)]
fn write_lane<L: LaneScalar>(
    out: &mut Response,
    plain: &mut [f64],
    lane: usize,
    (i, m): (usize, usize),
    z: &[L],
    u: &[L],
    tau: &[L],
) {
    let from = z.iter().chain(u).chain(tau);
    plain.iter_mut().zip(from).for_each(|(x, y)| *x = y.lane(lane));
    let (z, rest) = plain.split_at(6 + 2 * m);
    let (u, tau) = rest.split_at(6 + m);
    out.write(i, m, z, u, tau);
}
