//! Joints of a model that follow others.

use crate::diagnostics::problem::{Area, Problem, Problems};
use crate::tree::coordinates::{Coordinates, JointCoordinate};
use crate::tree::model::{Body, JointImpedance, Model};

impl Model {
    /// Makes the joint that carries body `follower` follow the one that carries body `driver`:
    /// `theta_follower = multiplier theta_driver + offset` (rad or m). It has no coordinate any more: those of the joints behind it move
    /// up by one. The driver may follow another itself, as may those that follow the follower. Allocates.
    ///
    /// ```
    /// # let mut arm = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
    /// let joints = arm.nj();
    /// arm.couple(3, 2, -1.7, 0.4)?;
    /// assert_eq!((arm.nj(), arm.n_joints()), (joints - 1, joints));
    /// let followed = arm.coordinate(2);
    /// assert_eq!((followed.index, followed.multiplier, followed.offset), (1, -1.7, 0.4));
    /// # Ok::<(), ff_model::Problems>(())
    /// ```
    ///
    /// # Errors
    /// [`Problems`] (area `Model`): `Model::Coupling` where the follower follows already, the driver follows the follower, or a number is
    /// not finite.
    ///
    /// # Panics
    /// If a body does not exist or is the base.
    pub fn couple(&mut self, follower: usize, driver: usize, multiplier: f64, offset: f64) -> Result<(), Problems> {
        let joint = |body: usize| {
            assert!((1..self.n_bodies()).contains(&body), "no joint carries body {body}");
            body - 1
        };
        let (i, k) = (joint(follower), joint(driver));
        let name = |j: usize| &self.bodies()[j].joint.name;
        let fail = |what: String, hint: &str| {
            let p = Problem::error(Area::Model, "Model::Coupling", what).on(format!("joint {}", name(i)));
            Problems(vec![p.hint(hint)])
        };
        if !(multiplier.is_finite() && offset.is_finite()) {
            let what = format!("follows {} with multiplier {multiplier} and offset {offset}", name(k));
            return Err(fail(what, "give finite numbers"));
        }
        let mut map = self.coordinates.clone().unwrap_or_else(|| Coordinates::independent(self.n_joints()));
        let (at, by) = (map.of[i].index, map.of[k]);
        if map.own[at] != i {
            let what = format!("follows {} already", name(map.own[at]));
            return Err(fail(what, "let a joint follow one other"));
        }
        if by.index == at {
            return Err(fail(
                format!("follows {}, which follows it", name(k)),
                "let one joint of the circle move by itself",
            ));
        }
        let by = JointCoordinate {
            index: by.index,
            multiplier: multiplier * by.multiplier,
            offset: multiplier * by.offset + offset,
        };
        for c in map.of.iter_mut().filter(|c| c.index == at) {
            // The followers of the follower follow what it follows.
            let (multiplier, offset) = (c.multiplier * by.multiplier, c.multiplier * by.offset + c.offset);
            *c = JointCoordinate { index: by.index, multiplier, offset };
        }
        map.own.remove(at);
        map.of.iter_mut().filter(|c| c.index > at).for_each(|c| c.index -= 1);
        self.coordinates = Some(map);
        Ok(())
    }
    /// The map from coordinates to joints where joints follow others; `None` where every joint moves by itself.
    #[inline(always)]
    pub fn coordinates(&self) -> Option<&Coordinates> {
        self.coordinates.as_ref()
    }
    /// Number of joints of the tree, those that follow others included: one for every body but the base.
    #[inline(always)]
    pub fn n_joints(&self) -> usize {
        self.bodies.len()
    }
    /// The coordinate of joint `i` of the tree, which carries body `i + 1`.
    ///
    /// # Panics
    /// If there is no such joint.
    pub fn coordinate(&self, i: usize) -> JointCoordinate {
        assert!(i < self.n_joints(), "joint {i} does not exist");
        self.coordinates.as_ref().map_or(JointCoordinate { index: i, multiplier: 1.0, offset: 0.0 }, |c| c.of[i])
    }
    /// The bodies on joints that move by themselves, in the order of `q` and `tau`: one for every coordinate.
    pub fn own_bodies(&self) -> impl ExactSizeIterator<Item = &Body> + Clone {
        (0..self.nj()).map(|j| self.own_body(j))
    }
    /// The body on the joint that coordinate `j` belongs to.
    ///
    /// # Panics
    /// If there is no such coordinate.
    pub fn own_body(&self, j: usize) -> &Body {
        &self.bodies[self.coordinates.as_ref().map_or(j, |c| c.own[j])]
    }
    /// The joints of the tree that follow others, with what they follow; empty where every joint moves by itself.
    pub fn followers(&self) -> impl Iterator<Item = (&Body, JointCoordinate)> {
        let map = self.coordinates.as_ref();
        map.into_iter().flat_map(|c| {
            let all = self.bodies.iter().zip(&c.of).enumerate();
            all.filter(|(i, (_, at))| c.own[at.index] != *i).map(|(_, (body, at))| (body, *at))
        })
    }
    /// Spring, damper and dry friction that coordinate `j` feels: those of its own joint, and those of its followers reflected.
    /// With multiplier `m` and offset `o` a follower adds `m^2 k` and `m^2 d`, its spring relaxed at `(rest - o) / m`, and `|m|` times its
    /// dry friction.
    ///
    /// # Panics
    /// If there is no such coordinate.
    pub fn reflected_impedance(&self, j: usize) -> JointImpedance {
        let Some(map) = &self.coordinates else { return self.bodies[j].impedance };
        let mut sum = JointImpedance::default();
        let mut moment = 0.0;
        for (b, c) in self.bodies.iter().zip(&map.of).filter(|(_, c)| c.index == j) {
            let (own, m) = (&b.impedance, c.multiplier);
            sum.stiffness += m * m * own.stiffness;
            sum.viscous += m * m * own.viscous;
            sum.coulomb += m.abs() * own.coulomb;
            moment += m * own.stiffness * (own.rest - c.offset);
        }
        let own = self.own_body(j).impedance.rest;
        sum.rest = if sum.stiffness == 0.0 { own } else { moment / sum.stiffness };
        sum
    }
    /// The same tree with every joint a coordinate of its own: what the coupled one is a motion of. Allocates.
    #[must_use]
    pub fn spanning(&self) -> Self {
        Self { coordinates: None, ..self.clone() }
    }
}
