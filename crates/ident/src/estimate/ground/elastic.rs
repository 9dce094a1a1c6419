//! Joints that bend between the encoder, on the motor's side, and the link.
//!
//! The link of joint `j` is at `q_j = theta_j - c_j tau_j`, with the encoder's `theta_j`, the compliance `c_j` (rad/(N m)) and the torque `tau_j` that the
//! rigid bodies need, as an estimate has them. With the motion of the links in place of that of the motors the equations are linear as before.
//! Compliances are found where the squared error `J(c)` of blocks of samples, each predicted by a fit of the others, has its minimum, by
//! Newton's method with differences that bend a joint by [`BENT`] at most. Joints are taken one by one, that which lowers the error most first; one is taken
//! where it lowers the error by the part [`GAIN`] and by [`BORNE_OUT`] standard errors over the blocks, and is positive. Twice the inverse
//! of the curvature `H` of `J`, in squares of the deviations of the joints, is their covariance with all else fitted beside them, if what is left is white. With the
//! slopes `g_b` of `n` blocks it is `H^-1 (n / (n - 1) sum_b g_b g_b^T) H^-1`, whatever is left. The larger of the two variances counts.

use super::GroundEstimate;
use super::calibration::Ground;
use super::currents;
use super::equations::{Instants, groups, rigid_torques};
use super::problem::Problem;
use super::selection::{Folds, borne_out, cut};
use super::smoothed::{ACCELERATION, RATE, slopes};
use crate::solve::linear::{LinearError, Weights};
use ff_least_squares::Triangle;
use ff_records::Record;
use nalgebra::{DMatrix, DVector};

/// Angle by which a joint bends when its compliance is tried (rad, or m).
const BENT: f64 = 5e-3;
/// Torque below which a joint counts as unloaded (N m, or N).
const LEAST: f64 = 1e-6;
/// Part of the squared error of all joints that a compliance has to take away.
const GAIN: f64 = 0.01;
/// Mean over standard error of what it takes away of the blocks, at least. One unknown more takes a thousandth away by chance: the part says enough.
const BORNE_OUT: f64 = 1.5;
/// Most steps to the minimum over all compliances that were taken, and part of a deviation below which the last one ends.
const ROUNDS: usize = 5;
/// See [`ROUNDS`].
const NEAR: f64 = 0.1;
/// Times that a step is halved.
const HALVED: usize = 4;

/// A joint that bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elastic {
    /// Which joint.
    pub joint: usize,
    /// Compliance (rad/(N m), m/N).
    pub compliance: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// The squared error of the blocks over the compliances of some joints, to second order.
struct Bowl {
    slope: DVector<f64>,
    bend: DMatrix<f64>,
    /// Slopes of the single blocks, one a row.
    slopes: DMatrix<f64>,
}

/// Squared error of every block by the compliances.
type Errors<'s> = dyn Fn(&[f64]) -> Result<Vec<f64>, LinearError> + 's;

/// Compliances, and the squared error of every block with them.
struct Place {
    at: Vec<f64>,
    errors: Vec<f64>,
}

/// Where the search for compliances is.
struct Search<'s> {
    here: Place,
    /// Change of every compliance that is tried.
    steps: Vec<f64>,
    errors: &'s Errors<'s>,
}

fn sum(errors: &[f64]) -> f64 {
    errors.iter().sum()
}

impl Search<'_> {
    fn moved(&self, joints: &[usize], by: &[f64]) -> Vec<f64> {
        let mut at = self.here.at.clone();
        joints.iter().zip(by).for_each(|(&j, b)| at[j] += b);
        at
    }
    /// Differences about the place; none where the error has no minimum.
    fn bowl(&self, joints: &[usize]) -> Result<Option<Bowl>, LinearError> {
        let n = joints.len();
        let errors = |of: &[usize], by: &[f64]| (self.errors)(&self.moved(of, by));
        let here = sum(&self.here.errors);
        let (mut slopes, mut bend) = (DMatrix::zeros(self.here.errors.len(), n), DMatrix::zeros(n, n));
        let mut high = vec![0.0; n];
        for (a, &j) in joints.iter().enumerate() {
            let step = self.steps[j];
            let (low, up) = (errors(&[j], &[-step])?, errors(&[j], &[step])?);
            let each = low.iter().zip(&up).map(|(low, up)| (up - low) / (2.0 * step));
            slopes.set_column(a, &DVector::from_iterator(low.len(), each));
            high[a] = sum(&up);
            bend[(a, a)] = (high[a] + sum(&low) - 2.0 * here) / (step * step);
            for (b, &k) in joints[..a].iter().enumerate() {
                let both = sum(&errors(&[j, k], &[step, self.steps[k]])?);
                bend[(a, b)] = (both - high[a] - high[b] + here) / (step * self.steps[k]);
                bend[(b, a)] = bend[(a, b)];
            }
        }
        let slope = slopes.row_sum().transpose();
        Ok(bend.clone().cholesky().map(|_| Bowl { slope, bend, slopes }))
    }
    /// A lower place on the way, and its errors: what bends far is no parabola, and half of the way may be lower where the whole is not.
    fn lower(&self, joints: &[usize], by: &[f64]) -> Result<Option<Place>, LinearError> {
        let mut by = by.to_vec();
        for _ in 0..=HALVED {
            let at = self.moved(joints, &by);
            let errors = (self.errors)(&at)?;
            if sum(&errors) < sum(&self.here.errors) {
                return Ok(Some(Place { at, errors }));
            }
            by.iter_mut().for_each(|b| *b *= 0.5);
        }
        Ok(None)
    }
    /// Goes to the minimum over the compliances of these joints.
    fn settle(&mut self, joints: &[usize]) -> Result<(), LinearError> {
        for _ in 0..ROUNDS {
            let Some(Bowl { slope, bend, .. }) = self.bowl(joints)? else { break };
            let Some(covariance) = bend.try_inverse() else { break };
            let by = -(&covariance * slope);
            let far = (0..joints.len()).any(|k| by[k].abs() > NEAR * (2.0 * covariance[(k, k)]).sqrt());
            if !far {
                break;
            }
            let Some(place) = self.lower(joints, by.as_slice())? else { break };
            self.here = place;
        }
        Ok(())
    }
}

impl Ground<'_> {
    /// A record as the links move, where encoders sit before joints of these compliances (rad/(N m), zero for stiff ones), with the torques of rigid
    /// bodies of these parameters. Ends that are trimmed are cut off. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn link_side(&self, record: &Record, values: &[f64], compliances: &[f64]) -> Result<Record, LinearError> {
        let used = self.window(record)?.used;
        let Instants { q, qd, qdd, external, .. } = self.instants(record)?;
        let mut bent = rigid_torques(self.model, values, (&q, &qd, &qdd));
        if let Some(external) = external {
            bent -= external;
        }
        bent.column_iter_mut().zip(compliances).for_each(|(mut x, c)| x *= *c);
        let dt = record.dt();
        let (rate, acceleration) = (slopes(&bent, dt, RATE), slopes(&bent, dt * dt, ACCELERATION));
        Ok(record.rows(used).with_motion(q - bent, qd - rate, qdd - acceleration))
    }
    /// Joints that bend, as the records bear out, beside `found`, an estimate of the parameters `selected` about `start` from them; none where they
    /// are too short to be cut into blocks. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn elastic(
        &self,
        records: &[&Record],
        (selected, start): (&[usize], &[f64]),
        found: &GroundEstimate,
    ) -> Result<Vec<Elastic>, LinearError> {
        let nj = self.model.nj();
        let errors = |c: &[f64]| self.errors_of_blocks(records, (selected, start), found, c);
        let stiff = vec![0.0; nj];
        let here = Place { errors: errors(&stiff)?, at: stiff };
        if here.errors.len() < 2 {
            return Ok(Vec::new());
        }
        let steps = self.largest(records, found)?.iter().map(|torque| BENT / torque).collect();
        let mut search = Search { here, steps, errors: &errors };
        // The joint that takes away most first: what is left of it looks like others that bend.
        let mut taken: Vec<usize> = Vec::new();
        while taken.len() < nj {
            let mut found: Option<(usize, Place)> = None;
            for joint in (0..nj).filter(|j| !taken.contains(j)) {
                let Some(Bowl { slope, bend, .. }) = search.bowl(&[joint])? else { continue };
                let by = -slope[0] / bend[(0, 0)];
                // Half of that is what a parabola would gain.
                if slope[0] * slope[0] / bend[(0, 0)] < GAIN * sum(&search.here.errors) {
                    continue;
                }
                let Some(place) = search.lower(&[joint], &[by])? else { continue };
                if place.at[joint] > 0.0 && found.as_ref().is_none_or(|f| sum(&place.errors) < sum(&f.1.errors)) {
                    found = Some((joint, place));
                }
            }
            let taken_by_blocks = |p: &Place| borne_out(&search.here.errors, &p.errors, (GAIN, BORNE_OUT));
            let Some((joint, place)) = found.filter(|f| taken_by_blocks(&f.1)) else { break };
            search.here = place;
            taken.push(joint);
            search.settle(&taken)?;
        }
        taken.sort_unstable();
        let Some(Bowl { bend, slopes, .. }) = (if taken.is_empty() { None } else { search.bowl(&taken)? }) else {
            return Ok(Vec::new());
        };
        let Some(covariance) = bend.try_inverse() else { return Ok(Vec::new()) };
        let n = search.here.errors.len() as f64;
        let of_blocks = &covariance * slopes.tr_mul(&slopes) * &covariance * (n / (n - 1.0));
        let one = |(k, &joint): (usize, &usize)| {
            let std = (2.0 * covariance[(k, k)]).max(of_blocks[(k, k)]).sqrt();
            Elastic { joint, compliance: search.here.at[joint], std }
        };
        let positive = |e: &Elastic| e.std.is_finite() && e.compliance > 0.0;
        Ok(taken.iter().enumerate().map(one).filter(positive).collect())
    }
    /// Squared error of every block, in deviations of the joints, with the links where these compliances have them.
    fn errors_of_blocks(
        &self,
        records: &[&Record],
        (selected, start): (&[usize], &[f64]),
        found: &GroundEstimate,
        compliances: &[f64],
    ) -> Result<Vec<f64>, LinearError> {
        let linked = records.iter().enumerate().map(|(k, r)| self.link_side(r, &self.present(k, found), compliances));
        let linked = linked.collect::<Result<Vec<_>, _>>()?;
        let records: Vec<&Record> = linked.iter().collect();
        // The ends are cut off already.
        let bare = Ground { trim_s: 0.0, ..self.clone() };
        let groups = groups(&bare, &records)?;
        let terms = self.all_terms();
        let own = terms.len();
        let problem = Problem::new(&bare, &groups, currents(&records, self.model.nj())?, (selected, start), terms);
        let blocks = cut(&problem, &groups, &found.fit.values, &found.joints.gains)?;
        if blocks.len() < 2 {
            return Ok(Vec::new());
        }
        // Weighted as they are judged, whatever the compliances: places differ by these alone.
        let sigma = found.torque_sigma();
        let fits = Folds { problem: &problem, blocks: &blocks, own }.fits(&[], &Weights::Given(sigma.clone()))?;
        let of =
            |(block, x): (&Vec<Triangle>, &Vec<f64>)| block.iter().zip(&sigma).map(|(t, s)| t.cost(x) / (s * s)).sum();
        Ok(blocks.iter().zip(&fits).map(of).collect())
    }
    /// The values of an estimate as the robot was in record `k`.
    fn present(&self, k: usize, found: &GroundEstimate) -> Vec<f64> {
        let mut values = found.fit.values.clone();
        self.absent.get(k).into_iter().flatten().for_each(|&p| values[p] = 0.0);
        values
    }
    /// The largest torque of the rigid bodies on every joint.
    fn largest(&self, records: &[&Record], found: &GroundEstimate) -> Result<Vec<f64>, LinearError> {
        let mut most = vec![LEAST; self.model.nj()];
        for (k, r) in records.iter().enumerate() {
            let Instants { q, qd, qdd, .. } = self.instants(r)?;
            let torques = rigid_torques(self.model, &self.present(k, found), (&q, &qd, &qdd));
            most.iter_mut().zip(torques.column_iter()).for_each(|(most, t)| *most = most.max(t.amax()));
        }
        Ok(most)
    }
}
