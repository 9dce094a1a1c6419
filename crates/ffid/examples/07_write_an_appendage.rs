//! A new kind of appendage: `cargo run --release -p ffid --example 07_write_an_appendage`.
//!
//! A tuned mass damper: a mass `m` slides along x of its mount on a spring `k` and a damper `d`. Declaration and three energies
//! are all; forces on the base, sensitivities and modes follow from them. `docs/add-an-appendage.md` goes on from here.

use ffid::dynamics::Boundary;
use ffid::mission::Leniency;
use ffid::model::nalgebra::{Matrix3, Vector3};
use ffid::model::{Appendage, CoordDecl, Decl, ParamDecl, PortMatrix, Scalar, SharedAppendage, Xform};
use ffid::modes::ModeTable;

struct MassDamper {
    decl: Decl,
}

ffid::model::derived!(MassDamper);

impl Appendage for MassDamper {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let position = Vector3::new(eta[0], T::from_f64(0.0), T::from_f64(0.0));
        m.add_point(p[0], &position, &[Vector3::x().map(|x: f64| T::from_f64(x))]);
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (p[1] * eta[0] * eta[0]).scale(0.5)
    }
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[2] * nu[0] * nu[0]).scale(0.5)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let damper = || {
        let params = [("mass", "kg", 4.0), ("k", "N/m", 8.0), ("d", "N s/m", 1.2)];
        let params = params.map(|(name, unit, nominal)| ParamDecl::positive(name, unit, nominal)).to_vec();
        let coords = vec![CoordDecl { name: "slide".into(), unit: "m", range: (-0.3, 0.3) }];
        MassDamper { decl: Decl::new("mass_damper", coords, params) }
    };
    // The laws of mechanics, before it is used.
    let report = ffid::validate::check_appendage(&*SharedAppendage::from(damper()));
    println!("{report}");

    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let mut model = system.model.clone();
    model.mount("damper", 0, Xform::new(Matrix3::identity(), Vector3::new(0.4, 0.1, 0.9)), damper())?;
    println!("{}", ModeTable::new(&model, &system.pose(), Boundary::JointsHeld)?);
    Ok(())
}
