//! A system made of a tuple of appendages and one made of boxed appendages are the same system.

use crate::common::*;
use ff_dynamics::*;
use ff_model::payload::Payload;
use ff_model::port::Place;
use ff_model::*;
use nalgebra::DMatrix;
use slosh_pendulum::SloshPendulum;

#[test]
fn tuples_and_boxed_sets_give_the_same_bits() {
    let r = &mut rng(41);
    let arm = random_tree(r, 4, BaseKind::Floating);
    // Kinds of little code: what stands in a tuple by its type is compiled here, for every number type.
    let fuel = SloshPendulum::new(90.0, 0.8, [20.0, 21.0], [5.0, 6.0]).unwrap();
    let other = SloshPendulum::new(41.0, 0.55, [13.0, 9.0], [1.5, 0.7]).unwrap();
    let client = Payload::new(&body(r, 9.0)).unwrap();
    let names = ["fuel", "other", "client"];
    let places: Vec<Place> = names
        .iter()
        .zip([2, 0, 4])
        .map(|(n, host)| Place::new(*n, host, Xform::new(rotation(r), vector(r, 0.9))))
        .collect();

    let mut typed = arm.clone();
    typed.mount_set(&places, (fuel.clone(), other.clone(), client.clone())).unwrap();
    let mut boxed = arm;
    let set: Vec<Box<dyn DynAppendage>> = vec![Box::new(fuel), Box::new(other), Box::new(client)];
    boxed.mount_set(&places, set).unwrap();
    assert_eq!(typed.param_decls(), boxed.param_decls());
    assert_eq!(typed.passive_coords(), boxed.passive_coords());
    assert_eq!((typed.np(), typed.n_params()), (4, 10 * 5 + 6 + 6 + 10));

    for seed in 0..20 {
        let s = random_state(&typed, &mut rng(100 + seed), 0.6);
        let tau: Vec<f64> = (0..typed.nv()).map(|_| uniform(r, -5.0, 5.0)).collect();
        // Accelerations, joint torques back, mass matrix and regressor, as bits.
        let of = |m: &Model| -> Vec<u64> {
            let (p, mut work, nv) = (Params::<f64>::nominal(m), Work::new(m), m.nv());
            let (mut a, mut back) = (vec![0.0; nv], vec![0.0; nv]);
            assert!(forward_dynamics(m, &p, &s, &tau, &mut work, &mut a).is_ok());
            rnea(m, &p, &s, &a, &mut work, &mut back);
            let (mut h, mut y) = (DMatrix::zeros(nv, nv), Regressor::new(m));
            mass_matrix(m, &p, &s, &mut work, &mut h);
            regressor(m, &p, &s, &a, &mut work, &mut y);
            assert!(tau.iter().zip(&back).all(|(t, b)| (t - b).abs() < 1e-9 * (1.0 + t.abs())));
            a.iter().chain(&back).chain(h.iter()).chain(y.iter()).map(|x| x.to_bits()).collect()
        };
        assert_eq!(of(&typed), of(&boxed), "seed {seed}");
    }
}
