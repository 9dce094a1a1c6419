//! The paper's missions as test systems.
#![allow(dead_code, clippy::unwrap_used)]

use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Params, Registry};
use ff_records::{Record, RecordBuilder};

pub(crate) fn load(name: &str) -> Loaded {
    let mut r = Registry::new();
    flex_panel::register(&mut r);
    slosh_pendulum::register(&mut r);
    let path = format!("{}/../../fixtures/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Mission::load(path.as_ref(), &r, &LoadOptions::default()).unwrap()
}

pub(crate) fn run(l: &Loaded, motion: &dyn JointMotion, seconds: f64) -> Trace {
    let o = SimOptions { duration_s: seconds, step_s: 1e-3, sample_s: 0.01 };
    let p = Params::nominal(&l.model);
    simulate(&l.model, &p, &State::zero(&l.model), &Drive::Prescribed(motion), &o).unwrap()
}

/// A noise-free record: positions, rates, accelerations, torques, gyro.
pub(crate) fn exact(l: &Loaded, t: &Trace) -> Record {
    RecordBuilder::new(l.model.joint_names())
        .uniform(0.0, 1.0 / t.dt)
        .q(t.q.clone())
        .qd(t.qd.clone())
        .qdd(t.qdd.clone())
        .tau(t.tau.clone())
        .gyro(t.gyro())
        .allow("Data::Stuck")
        .build()
        .unwrap()
        .0
}

/// The most informative plan for the base, as `cargo xtask reproduce` makes it.
pub(crate) fn planned(l: &Loaded, seconds: f64, free: usize) -> BSplineMotion {
    use excitation::plan_information;
    use excitation::planning::InformationRequest;
    let limits = excitation::JointLimits {
        lower: -3.1,
        upper: 3.1,
        velocity: l.mission.limits.velocity_rad_per_s.unwrap(),
        acceleration: l.mission.limits.acceleration_rad_per_s2.unwrap(),
        jerk: None,
    };
    let request = InformationRequest {
        start: l.mission.reproduce.as_ref().unwrap().hold_rad.clone(),
        end: excitation::End::Free,
        limits: vec![limits; l.model.nj()],
        duration: seconds,
        control_points: free,
        seed: 1,
        starts: 1,
        noise: excitation::SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 },
        options: Default::default(),
    };
    plan_information(&l.model, &Params::nominal(&l.model), &(0..10).collect::<Vec<_>>(), &request).unwrap().motion
}

/// A random rigid tree on skewed axes, floating unless said otherwise, with nothing symmetric about it.
pub(crate) mod tree {
    use ff_dynamics::motion::JointMotion;
    use ff_model::spatial::so3::{exp_so3, quat_to_rot};
    use ff_model::tree::JointLimits;
    use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Xform};
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    pub(crate) struct Draw(ChaCha8Rng);
    impl Draw {
        pub(crate) fn new(seed: u64) -> Self {
            Self(ChaCha8Rng::seed_from_u64(seed))
        }
        pub(crate) fn sym(&mut self, x: f64) -> f64 {
            self.0.random_range(-x..x)
        }
        pub(crate) fn between(&mut self, a: f64, b: f64) -> f64 {
            self.0.random_range(a..b)
        }
        pub(crate) fn vec3(&mut self, x: f64) -> Vector3<f64> {
            Vector3::from_fn(|_, _| self.sym(x))
        }
        fn body(&mut self, scale: f64) -> Inertia<f64> {
            (0..6).fold(Inertia::zero(), |mut b, _| {
                b += Inertia::point(scale * self.between(0.2, 1.0), &self.vec3(0.5));
                b
            })
        }
    }

    /// `joints` bodies; every fourth joint slides, every third hangs from the body before the last.
    pub(crate) fn model(seed: u64, joints: usize, kind: BaseKind) -> Model {
        let mut s = Draw::new(seed);
        let mut m = Model::new("tree", "base", s.body(60.0), kind);
        for i in 0..joints {
            let parent = if i % 3 == 2 { i - 1 } else { i };
            let kind = if i % 4 == 3 { JointKind::Prismatic } else { JointKind::Revolute };
            let axis = loop {
                let v = s.vec3(1.0);
                if v.norm() > 0.3 {
                    break v.normalize();
                }
            };
            let placement = Xform::new(quat_to_rot(&exp_so3(&s.vec3(1.7))), s.vec3(0.6));
            let body = s.body(6.0);
            m.add_body(
                parent,
                format!("l{i}"),
                Joint { name: format!("j{i}"), kind, axis, placement, limits: JointLimits::default() },
                body,
            );
        }
        m
    }

    /// Two sines per joint, from rest.
    pub(crate) struct Sines {
        terms: Vec<[(f64, f64); 2]>,
        seconds: f64,
        reach: f64,
    }
    impl Sines {
        pub(crate) fn new(seed: u64, joints: usize, seconds: f64, reach: f64) -> Self {
            let mut s = Draw::new(seed);
            let terms = (0..joints).map(|_| [(s.sym(1.0), s.between(0.05, 0.25)), (s.sym(0.4), s.between(0.2, 0.5))]);
            Self { terms: terms.collect(), seconds, reach }
        }
    }
    impl JointMotion for Sines {
        fn dof(&self) -> usize {
            self.terms.len()
        }
        fn duration(&self) -> f64 {
            self.seconds
        }
        fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
            for (j, terms) in self.terms.iter().enumerate() {
                (q[j], qd[j], qdd[j]) = (0.3 - 0.1 * j as f64, 0.0, 0.0);
                for &(a, f) in terms {
                    let (a, w) = (a * self.reach, TAU * f);
                    let (s, c) = (w * t).sin_cos();
                    q[j] += a * (1.0 - c);
                    qd[j] += a * w * s;
                    qdd[j] += a * w * w * c;
                }
            }
        }
    }
}
