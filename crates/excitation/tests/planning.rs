//! Plans for the paper's robot: limits, predicted standard deviations and quietness.

use crate::common::{paper, request};
use excitation::planning::{InformationRequest, Planned};
use excitation::solve::Status;
use excitation::*;
use ff_dynamics::Wanted;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Prescribed, Sampling, sensitivities};
use ff_model::Params;

fn print(what: &str, p: &Planned) {
    eprintln!("{what}: {:?}, searches {:?}", p.status, p.searches);
    eprintln!("  -log det: random {:.2}, planned {:.2}", p.random_information_cost, p.information_cost);
    for q in &p.predictions {
        eprintln!(
            "  {:14} {:9.3} {:7}  random {:.2e}  planned {:.2e}  ratio {:.2}",
            q.name,
            q.value,
            q.unit,
            q.random,
            q.planned,
            q.random / q.planned
        );
    }
}

#[test]
fn information_beats_random_plans_within_the_limits() {
    let loaded = paper("flex.toml");
    let params = Params::nominal(&loaded.model);
    let all: Vec<usize> = (0..10).collect();
    let request = request(&loaded, 3);
    let p = plan_information(&loaded.model, &params, &all, &request).unwrap();
    print("information", &p);
    assert_eq!(p.status, Status::Converged);
    // For all time by the control polygons, and at samples, which share nothing with that proof.
    assert!(p.limits.holds, "{:?}", p.limits.worst());
    let (mut q, mut qd, mut qdd) = ([0.0; 7], [0.0; 7], [0.0; 7]);
    for i in 0..=6000 {
        p.motion.eval(0.01 * f64::from(i), &mut q, &mut qd, &mut qdd);
        for (j, l) in request.limits.iter().enumerate() {
            assert!(q[j] >= l.lower && q[j] <= l.upper && qd[j].abs() <= 0.17 && qdd[j].abs() <= 0.15);
        }
        if i % 6000 == 0 {
            assert!(qd.iter().chain(&qdd).all(|x| x.abs() < 1e-12));
            assert!(q.iter().zip(&request.start).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }
    // Measured: 8.3 (centre of mass, x) to 41 times, base mass 12.4 times.
    assert_eq!(p.predictions.len(), 19);
    for q in &p.predictions {
        assert!(q.planned < q.random / 5.0, "{q:?}");
    }
    assert!(p.predictions[0].name == "base.mass" && p.predictions[0].planned < 6.0);
    assert!(p.information_cost < p.random_information_cost - 40.0);
}

#[test]
fn predictions_are_the_bound_of_an_output_error_fit() {
    // The whole record simulated and differentiated by the dynamics crate: base rates not measured but
    // simulated, known start at rest, every sample instead of a quadrature.
    let loaded = paper("flex.toml");
    let params = Params::nominal(&loaded.model);
    let all: Vec<usize> = (0..10).collect();
    let request =
        InformationRequest { options: SqpOptions { iterations: 15, ..SqpOptions::default() }, ..request(&loaded, 1) };
    let p = plan_information(&loaded.model, &params, &all, &request).unwrap();
    let again = plan_information(&loaded.model, &params, &all, &request).unwrap();
    assert_eq!((&p.x, &p.predictions), (&again.x, &again.predictions)); // bit for bit
    let frozen = loaded.model.frozen(&params);
    let values = Params::nominal(&frozen);
    let sampling = Sampling { samples: 1201, sample_s: 0.05, substeps: 2 };
    let table = Prescribed::new(&frozen, &values, &p.motion, &sampling, &[]);
    let wanted = Wanted { params: all, initial: Vec::new(), ..Wanted::default() };
    let (_, s) = sensitivities(&frozen, &values, &table, &[0.0; 6], &wanted).unwrap();
    let (tau, gyro) = (s.tau / request.noise.torque, s.gyro / request.noise.gyro.unwrap());
    let m = (tau.tr_mul(&tau) + gyro.tr_mul(&gyro)) * (request.noise.rate * sampling.sample_s);
    let scale = nalgebra::DMatrix::from_fn(10, 10, |i, j| 1.0 / (m[(i, i)] * m[(j, j)]).sqrt());
    let inverse = m.component_mul(&scale).try_inverse().unwrap();
    for (k, q) in p.predictions[..10].iter().enumerate() {
        let std = (inverse[(k, k)] / m[(k, k)]).sqrt();
        eprintln!("{:10} predicted {:.4e}, output error {std:.4e}", q.name, q.planned);
        // Measured: 0.2 %. The difference is that of measured and simulated base rates.
        assert!((q.planned / std - 1.0).abs() < 0.01);
    }
}
