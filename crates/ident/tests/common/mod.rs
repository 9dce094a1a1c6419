//! The paper's missions as test systems.
#![allow(dead_code, clippy::unwrap_used)]

use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
use ff_mission::Loaded;
use ff_model::Params;
use ff_records::{Record, RecordBuilder};
pub(crate) use ff_testkit::fixtures::paper;
use ident::estimate::{Estimate, EstimateError, Estimator, Request};

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

/// [`ident::estimate()`] compiled once for all estimators of these tests.
pub(crate) fn estimate(request: &Request<'_>, estimator: &mut dyn Estimator) -> Result<Estimate, EstimateError> {
    ident::estimate(request, estimator)
}
