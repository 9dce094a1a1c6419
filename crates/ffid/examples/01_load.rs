//! Load a mission: `cargo run --release -p ffid --example 01_load [FILE]`. Prints bodies, appendages and what will be estimated.

use ffid::mission::Leniency;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let file = std::env::args().nth(1).unwrap_or_else(|| default.into());
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let model = &system.model;
    print!("{}", system.warnings);
    println!("{}: {:.1} kg, base {:?}", model.name(), model.total_mass(), model.base_kind());
    println!("degrees of freedom: base {}, joints {}, passive {}", model.nb(), model.nj(), model.np());
    for i in 0..model.n_bodies() {
        let com = model.inertia(i).com().unwrap_or_default();
        println!(
            "  {:12} {:8.2} kg, centre of mass [{:.3}, {:.3}, {:.3}] m",
            model.body_name(i),
            model.inertia(i).mass,
            com.x,
            com.y,
            com.z
        );
    }
    for a in model.appendages() {
        println!("  {:12} {} on {}, {} coordinates", a.name, a.decl().kind, model.body_name(a.host), a.dim());
    }
    let decls = model.param_decls();
    println!("parameters: {}, to estimate {}", decls.len(), system.estimated.len());
    for &i in &system.estimated {
        println!("  {:20} {:10.4} {}", decls[i].name, decls[i].nominal, decls[i].unit);
    }
    Ok(())
}
