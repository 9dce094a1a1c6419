//! Instruction sets a test runs on.

use ff_model::scalar::lanes::Isa;

/// The instruction sets that this machine has and this build has code for, narrowest first. Others are printed as skipped, with the name
/// of the test: a test that did not run is not one that passed.
///
/// # Panics
/// When `FF_REQUIRE_ISA` (`v3` or `v4`) asks for a set that is not available, or holds another word.
#[track_caller]
pub fn instruction_sets() -> Vec<Isa> {
    let required = match std::env::var("FF_REQUIRE_ISA").ok().as_deref() {
        None | Some("") => Isa::Portable,
        Some("v3") => Isa::V3,
        Some("v4") => Isa::V4,
        Some(other) => panic!("FF_REQUIRE_ISA is '{other}', expected v3 or v4"),
    };
    let (have, lacking): (Vec<Isa>, Vec<Isa>) =
        [Isa::Portable, Isa::V3, Isa::V4].into_iter().partition(|isa| isa.is_available());
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    for isa in lacking {
        let needed = Isa::Portable < isa && isa <= required;
        assert!(!needed, "{test}: {isa:?}, which FF_REQUIRE_ISA requires, is not available");
        eprintln!("SKIPPED {test} on {isa:?}: not available here ({})", std::panic::Location::caller());
    }
    have
}
