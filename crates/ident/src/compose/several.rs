//! Several records in one fit: parameters that they share, and parameters that each has for itself.
//!
//! Every record keeps its own estimator, with its own model (before and after grasping a client the robot is not the same) and
//! its own biases, delays and initial state. [`Shared`] says which parameters of these models are one and the same unknown:
//! those of equal name, unless a pattern claims them for each record. [`Several`] is then an [`Estimator`] like any other; its
//! residuals are those of all records below one another.

use crate::belief::covariance::Unknown;
use crate::estimate::along::Direction;
use crate::estimate::estimator::{At, Between, Coarse, Estimator, Steps, columns_by_directions};
use crate::estimate::row_stream::{RowBlock, RowStream};
use core::ops::Range;
use ff_least_squares::EvalError;
use ff_model::tree::{SelectionError, select, sift};
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::DMatrix;

/// How often the beginning of a part is taken twice as long ([`Estimator::beginning`]) before there is none.
const LONGER: u32 = 5;

/// Whether a nuisance unknown of one record, or of several with their labels before its name, is the one called `name`.
///
/// ```
/// use ident::compose::is_called;
///
/// let labels = ["before".to_owned(), "after".to_owned()];
/// assert!(is_called("after.gyro.bias.x", "gyro.bias.x", &labels) && is_called("gyro.bias.x", "gyro.bias.x", &[]));
/// ```
pub fn is_called(unknown: &str, name: &str, labels: &[String]) -> bool {
    let labelled = |l: &String| unknown.strip_prefix(l.as_str()).and_then(|r| r.strip_prefix('.')) == Some(name);
    unknown == name || labels.iter().any(labelled)
}

/// The parameters of several models as one list.
#[derive(Clone, Debug)]
pub struct Shared {
    /// All parameters: those of the first record, then what the others add. Parameters that a record has for itself are
    /// called `<record>.<name>`.
    pub decls: Vec<ParamDecl>,
    /// For each record: where each of its parameters is in the list.
    maps: Vec<Vec<usize>>,
    labels: Vec<String>,
}

/// Why parameters cannot be shared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SharedError {
    /// No record was given.
    #[error("no record; give at least one")]
    NoRecord,
    /// Two records have the same label.
    #[error("two records are called '{0}'; parameters and biases of each need a name")]
    Label(String),
    /// A pattern matches no parameter.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// Two records mean different things by one name.
    #[error(
        "'{name}' is {first} in record '{one}' and {second} in record '{other}'; rename it, or let each record have its own"
    )]
    Differs {
        /// The parameter.
        name: String,
        /// Unit and kind in the first.
        first: String,
        /// Unit and kind in the second.
        second: String,
        /// The first record.
        one: String,
        /// The second record.
        other: String,
    },
}

fn kind(d: &ParamDecl) -> String {
    let group = match &d.group {
        ParamGroup::Inertial(_) => "a number of a body",
        ParamGroup::Positive => "positive",
        ParamGroup::Free => "free",
    };
    format!("{group} in {}", d.unit)
}

impl Shared {
    /// For records with labels and the parameters of their models. `own` are patterns ([`ff_model::tree::select`]) of parameters
    /// that every record has for itself; a body is claimed as a whole if one of its ten numbers is. Allocates.
    ///
    /// # Errors
    /// [`SharedError`].
    pub fn new<S: AsRef<str>>(records: &[(&str, &[ParamDecl])], own: &[S]) -> Result<Self, SharedError> {
        if records.is_empty() {
            return Err(SharedError::NoRecord);
        }
        let mut out = Self { decls: Vec::new(), maps: Vec::new(), labels: Vec::new() };
        // The record that brought a parameter, and its name there.
        let mut origin: Vec<(usize, bool)> = Vec::new();
        let everything: Vec<ParamDecl> = records.iter().flat_map(|r| r.1.iter().cloned()).collect();
        if !own.is_empty() {
            select(&everything, own)?;
        }
        for (k, (label, decls)) in records.iter().enumerate() {
            if out.labels.iter().any(|l| l == label) {
                return Err(SharedError::Label((*label).to_owned()));
            }
            let claimed: Vec<usize> = if own.is_empty() { Vec::new() } else { sift(decls, own).0 };
            let is_own = |i: usize| {
                let same_body =
                    |j: &usize| matches!(decls[i].group, ParamGroup::Inertial(_)) && decls[*j].group == decls[i].group;
                claimed.contains(&i) || claimed.iter().any(same_body)
            };
            let mut map = Vec::with_capacity(decls.len());
            for (i, d) in decls.iter().enumerate() {
                let mine = is_own(i);
                let known = out.decls.iter().zip(&origin).position(|(o, (_, own))| !own && o.name == d.name);
                if let (Some(at), false) = (known, mine) {
                    let first = &out.decls[at];
                    if first.unit != d.unit || first.group != d.group {
                        return Err(SharedError::Differs {
                            name: d.name.clone(),
                            first: kind(first),
                            second: kind(d),
                            one: out.labels[origin[at].0].clone(),
                            other: (*label).to_owned(),
                        });
                    }
                    map.push(at);
                    continue;
                }
                let mut added = d.clone();
                if mine {
                    added.name = format!("{label}.{}", d.name);
                    if let ParamGroup::Inertial(body) = &d.group {
                        added.group = ParamGroup::Inertial(format!("{label}.{body}"));
                    }
                }
                map.push(out.decls.len());
                out.decls.push(added);
                origin.push((k, mine));
            }
            out.maps.push(map);
            out.labels.push((*label).to_owned());
        }
        Ok(out)
    }
    /// Directions of record `k`, over its parameters and its nuisance unknowns `own` of all, and which of the columns `along` directions
    /// over all they are. Directions that the record does not depend on are left out. Allocates.
    fn along(&self, k: usize, along: &[Direction], own: Range<usize>) -> (Vec<Direction>, Vec<usize>) {
        let map = &self.maps[k];
        // A parameter of the list may stand for several of the record.
        let of_record = |all: usize| -> Vec<usize> {
            if all < self.decls.len() {
                return (0..map.len()).filter(|&i| map[i] == all).collect();
            }
            let nuisance = all - self.decls.len();
            if own.contains(&nuisance) { vec![map.len() + nuisance - own.start] } else { Vec::new() }
        };
        let mut out = (Vec::new(), Vec::new());
        for (column, d) in along.iter().enumerate() {
            let parts: Vec<(usize, f64)> =
                d.0.iter().flat_map(|&(all, by)| of_record(all).into_iter().map(move |i| (i, by))).collect();
            if !parts.is_empty() {
                out.0.push(Direction(parts));
                out.1.push(column);
            }
        }
        out
    }
    /// The values of record `k` out of those of all. Allocates.
    ///
    /// # Panics
    /// If there is no such record, or `all` is shorter than the list.
    pub fn of_record(&self, k: usize, all: &[f64]) -> Vec<f64> {
        self.maps[k].iter().map(|&i| all[i]).collect()
    }
    /// The values of all out of those of each record; of a shared parameter, that of the first record which has it. Allocates.
    ///
    /// # Panics
    /// If there is not one vector per record, as long as its parameters.
    pub fn gather(&self, each: &[Vec<f64>]) -> Vec<f64> {
        assert_eq!(each.len(), self.maps.len(), "one vector per record");
        let mut out = vec![f64::NAN; self.decls.len()];
        for (map, values) in self.maps.iter().zip(each).rev() {
            assert_eq!(map.len(), values.len(), "one value per parameter");
            map.iter().zip(values).for_each(|(&at, v)| out[at] = *v);
        }
        out
    }
}

/// Estimators of several records as one.
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
/// use ident::compose::Shared;
/// use ident::{Estimator, Noise, Rda, Request, Several, estimate};
///
/// // Two records of the same robot, here twice the same: every variance is half.
/// let noise = Noise { torque: 0.01, gyro: 1e-5 };
/// let part = || Rda::new(&robot, &record, &noise).map(|rda| Box::new(rda) as Box<dyn Estimator>);
/// let shared = Shared::new::<&str>(&[("first", decls.as_slice()), ("second", decls.as_slice())], &[])?;
/// let (mut both, mut one) = (Several::new(&shared, vec![part()?, part()?]), part()?);
/// let std = |fit: ident::estimate::Estimate| fit.parameters[0].std.unwrap();
/// let two = std(estimate(&Request::new(&shared.decls, &mass, &start), &mut both)?);
/// let single = std(estimate(&Request::new(&decls, &mass, &start), &mut one)?);
/// assert!((single / two - 2.0_f64.sqrt()).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Several<'a> {
    shared: &'a Shared,
    parts: Vec<Box<dyn Estimator + 'a>>,
}

impl<'a> Several<'a> {
    /// One estimator per record, in the order of `shared`.
    ///
    /// # Panics
    /// If there is not one estimator per record.
    pub fn new(shared: &'a Shared, parts: Vec<Box<dyn Estimator + 'a>>) -> Self {
        assert_eq!(parts.len(), shared.maps.len(), "one estimator per record");
        Self { shared, parts }
    }
    /// All parts over less data; those of which there is no such look as `other` makes them. `None` where no part has one, or one has neither.
    fn over_less<'s>(
        &'s self,
        looks: Vec<Option<Coarse<'s>>>,
        other: impl Fn(&'s (dyn Estimator + 's)) -> Option<Coarse<'s>>,
    ) -> Option<Coarse<'s>> {
        if looks.iter().all(Option::is_none) {
            return None;
        }
        let (mut first, mut rows, mut parts) = (0, Vec::new(), Vec::new());
        let (mut between, mut whole) = (Vec::new(), true);
        for (part, look) in self.parts.iter().zip(looks) {
            let look = match look {
                Some(look) => look,
                None => other(&**part)?,
            };
            let behind = rows.len();
            whole &= look.between.len() == part.rows();
            between.extend(look.between.iter().map(|b| Between { rows: b.rows.map(|i| behind + i), ..*b }));
            rows.extend(look.rows.iter().map(|i| first + i));
            first += part.rows();
            parts.push(look.estimator);
        }
        if !whole {
            between.clear();
        }
        Some(Coarse { estimator: Box::new(Several { shared: self.shared, parts }), rows, between })
    }
}

impl Estimator for Several<'_> {
    fn rows(&self) -> usize {
        self.parts.iter().map(|p| p.rows()).sum()
    }
    fn left_out(&self) -> usize {
        self.parts.iter().map(|p| p.left_out()).sum()
    }
    /// A part that has too little to give away stays whole, so that a short record does not keep long ones from being thinned.
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let thin = self.parts.iter().enumerate().map(|(k, p)| p.coarse(&self.shared.of_record(k, full))).collect();
        self.over_less(thin, |part| part.beginning(1.0))
    }
    fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let thin = self.parts.iter().enumerate().map(|(k, p)| p.rough(&self.shared.of_record(k, full))).collect();
        self.over_less(thin, |part| part.beginning(1.0))
    }
    fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        let own = |k: usize| self.shared.of_record(k, full);
        let thin = self.parts.iter().enumerate().map(|(k, p)| p.stepped(&own(k), steps)).collect();
        self.over_less(thin, |part| part.beginning(1.0))
    }
    /// A part of which so little says nothing begins with more of it.
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let begun = self.parts.iter().map(|p| p.beginning(share)).collect();
        let longer = move |k: u32| (share * f64::from(1 << k)).min(1.0);
        self.over_less(begun, move |part| (1..LONGER).find_map(|k| part.beginning(longer(k))))
    }
    fn nuisance(&self) -> Vec<Unknown> {
        let mut out = Vec::new();
        for (part, label) in self.parts.iter().zip(&self.shared.labels) {
            out.extend(part.nuisance().into_iter().map(|u| Unknown { name: format!("{label}.{}", u.name), ..u }));
        }
        out
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let (mut row, mut at) = (0, 0);
        for (k, part) in self.parts.iter_mut().enumerate() {
            let (rows, count) = (part.rows(), part.nuisance().len());
            let own = self.shared.of_record(k, full);
            part.residuals(&own, &extra[at..at + count], &mut r[row..row + rows])?;
            (row, at) = (row + rows, at + count);
        }
        Ok(())
    }
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        let mut done: Vec<Result<(), EvalError>> = at.iter().map(|_| Ok(())).collect();
        let (mut row, mut first) = (0, 0);
        for (k, part) in self.parts.iter_mut().enumerate() {
            let (rows, count) = (part.rows(), part.nuisance().len());
            let own: Vec<Vec<f64>> = at.iter().map(|(full, _)| self.shared.of_record(k, full)).collect();
            let own: Vec<At<'_>> =
                own.iter().zip(at).map(|(full, (_, extra))| (&full[..], &extra[first..first + count])).collect();
            let mut mine: Vec<&mut [f64]> = r.iter_mut().map(|r| &mut r[row..row + rows]).collect();
            let made = part.residuals_at(&own, &mut mine);
            for (done, made) in done.iter_mut().zip(made).filter(|(done, _)| done.is_ok()) {
                *done = made;
            }
            (row, first) = (row + rows, first + count);
        }
        done
    }
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        let (mut refined, mut at) = (false, 0);
        for (k, part) in self.parts.iter_mut().enumerate() {
            let count = part.nuisance().len();
            refined |= part.refine(&self.shared.of_record(k, full), &extra[at..at + count], most)?;
            at += count;
        }
        Ok(refined)
    }
    columns_by_directions!();
    fn jacobian_along(
        &mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        j.fill(0.0);
        let (mut row, mut at) = (0, 0);
        for (k, part) in self.parts.iter_mut().enumerate() {
            let (rows, count) = (part.rows(), part.nuisance().len());
            let own = self.shared.of_record(k, full);
            let (mine, to) = self.shared.along(k, along, at..at + count);
            let mut block = DMatrix::zeros(rows, mine.len());
            part.jacobian_along(&own, &extra[at..at + count], &mine, &mut r[row..row + rows], &mut block)?;
            for (from, &to) in to.iter().enumerate() {
                j.view_mut((row, to), (rows, 1)).copy_from(&block.column(from));
            }
            (row, at) = (row + rows, at + count);
        }
        Ok(())
    }
    /// Those of all records, side by side.
    fn streams_along<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let (mut out, mut row, mut at) = (Vec::<Box<dyn RowStream + 's>>::new(), 0, 0);
        for (k, part) in self.parts.iter_mut().enumerate() {
            let (rows, count) = (part.rows(), part.nuisance().len());
            let own = self.shared.of_record(k, full);
            let (mine, to) = self.shared.along(k, along, at..at + count);
            for inner in part.streams_along(&own, &extra[at..at + count], &mine)? {
                let (to, buffer) = (to.clone(), RowBlock::default());
                out.push(Box::new(OfRecord { inner, row, to, columns: along.len(), buffer }));
            }
            (row, at) = (row + rows, at + count);
        }
        Ok(out)
    }
}

/// Rows of one record among those of all.
struct OfRecord<'s> {
    inner: Box<dyn RowStream + 's>,
    /// Its first row, where its columns belong, and how many there are.
    row: usize,
    to: Vec<usize>,
    columns: usize,
    buffer: RowBlock,
}

impl RowStream for OfRecord<'_> {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        if !self.inner.next(&mut self.buffer)? {
            return Ok(false);
        }
        let rows: Vec<Range<usize>> = self.buffer.rows.iter().map(|r| self.row + r.start..self.row + r.end).collect();
        block.resize(&rows, self.columns);
        core::mem::swap(&mut block.residuals, &mut self.buffer.residuals);
        block.jacobian.fill(0.0);
        for (from, &to) in self.to.iter().enumerate() {
            block.jacobian.column_mut(to).copy_from(&self.buffer.jacobian.column(from));
        }
        Ok(true)
    }
}
