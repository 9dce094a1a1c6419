//! Natural modes: `cargo run --release -p ffid --example 03_modes`. The base free and held, and the effect of fuel that sloshes.

use ffid::dynamics::Boundary;
use ffid::mission::Leniency;
use ffid::modes::ModeTable;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for mission in ["flex", "slosh", "combined"] {
        let file = format!("{}/../../fixtures/paper/{mission}.toml", env!("CARGO_MANIFEST_DIR"));
        let system = ffid::open::open(file.as_ref(), Leniency::default())?;
        println!("{mission}.toml");
        // A free base raises the frequencies: its mass moves against that of the appendage.
        for boundary in [Boundary::JointsHeld, Boundary::BaseHeld] {
            println!("{}", ModeTable::new(&system.model, &system.pose(), boundary)?);
        }
    }
    Ok(())
}
