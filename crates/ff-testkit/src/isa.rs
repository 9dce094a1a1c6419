//! Instruction sets a test runs on.

use ff_model::scalar::lanes::Isa;

/// The instruction sets of this machine, narrowest first. Those it lacks are printed as skipped, with the name of the
/// test: a test that did not run is not one that passed.
///
/// # Panics
/// When `FF_REQUIRE_ISA` (`v3` or `v4`) asks for a set that the machine lacks, or holds another word.
#[track_caller]
pub fn instruction_sets() -> Vec<Isa> {
    let required = match std::env::var("FF_REQUIRE_ISA").ok().as_deref() {
        None | Some("") => Isa::Portable,
        Some("v3") => Isa::V3,
        Some("v4") => Isa::V4,
        Some(other) => panic!("FF_REQUIRE_ISA is '{other}', expected v3 or v4"),
    };
    let widest = Isa::detect();
    let (have, lacking): (Vec<Isa>, Vec<Isa>) =
        [Isa::Portable, Isa::V3, Isa::V4].into_iter().partition(|&isa| isa <= widest);
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    for isa in lacking {
        assert!(isa > required, "{test}: this machine lacks {isa:?}, which FF_REQUIRE_ISA requires");
        eprintln!(
            "SKIPPED {test} on {isa:?}: this machine has {widest:?} at most ({})",
            std::panic::Location::caller()
        );
    }
    have
}
