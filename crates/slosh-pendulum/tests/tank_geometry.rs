//! Volume and centre of mass of the liquid against the integral over its slices.

use ff_testkit::assert_within;
use slosh_pendulum::geometry::Tank;
use std::f64::consts::PI;

/// `(integral of A dz, integral of z A dz)` over the slices of area `A(z)` up to `fill`, by Gauss's rule of three points,
/// which is exact for the polynomials of degree three that these are.
fn slices(fill: f64, area: impl Fn(f64) -> f64) -> (f64, f64) {
    let nodes = [(-0.6_f64.sqrt(), 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 9.0)];
    nodes.iter().fold((0.0, 0.0), |(v, m), &(x, weight)| {
        let z = 0.5 * fill * (1.0 + x);
        let dv = 0.5 * fill * weight * area(z);
        (v + dv, m + z * dv)
    })
}

#[test]
fn volume_and_centre_are_those_of_the_slices() {
    for radius in [0.37, 1.0, 2.3] {
        for part in [0.15, 0.6, 1.0, 1.45, 1.85] {
            let fill = part * radius;
            let cylinder = slices(fill, |_| PI * radius * radius);
            let sphere = slices(fill, |z| PI * z * (2.0 * radius - z));
            for (tank, (volume, moment)) in
                [(Tank::Cylinder { radius, fill }, cylinder), (Tank::Sphere { radius, fill }, sphere)]
            {
                assert_within!((tank.volume() / volume - 1.0).abs(), 1e-13, "{tank:?}");
                assert_within!((tank.centre() / (moment / volume) - 1.0).abs(), 1e-13, "{tank:?}");
                assert_eq!(tank.radius(), radius);
            }
        }
    }
}

/// Slosh masses and the rest have the mass and the first moment of all the liquid.
#[test]
fn what_does_not_slosh_keeps_the_centre_of_mass_in_its_place() {
    let density = 870.0;
    for tank in [Tank::Sphere { radius: 0.7, fill: 0.5 }, Tank::Cylinder { radius: 0.7, fill: 0.9 }] {
        let m = tank.model(density, 2).unwrap();
        let mass: f64 = m.modes.iter().map(|n| n.mass).sum::<f64>() + m.fixed_mass;
        let moment = m.modes.iter().map(|n| n.mass * n.height).sum::<f64>() + m.fixed_mass * m.fixed_height;
        assert_within!((mass / (density * tank.volume()) - 1.0).abs(), 1e-12, "{tank:?}");
        assert_within!((moment / mass / tank.centre() - 1.0).abs(), 1e-12, "{tank:?}");
        // A mode: stiffness and frequency belong together, the fulcrum lies one length above the mass.
        for n in &m.modes {
            let a = 0.31;
            assert_within!((n.stiffness(a) / (n.mass * n.omega(a).powi(2)) - 1.0).abs(), 1e-13);
            assert!((n.fulcrum() - n.height - n.length).abs() < 1e-13 && n.length > 0.0);
        }
    }
}
