//! Which instructions may be used.

use anyhow::ensure;
use clap::ValueEnum;
use ff_model::scalar::lanes::Isa as Set;

/// Widest instruction set to use for lanes. Whole tasks that are timed (`sim`, `sensitivities`) choose for themselves; under valgrind
/// 3.19, which knows no AVX-512, they choose AVX2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Isa {
    /// What the program was compiled for, no more.
    Portable,
    /// x86-64-v3: AVX2 and FMA.
    V3,
    /// x86-64-v4: AVX-512.
    V4,
    /// The widest this processor has.
    Auto,
}

impl Isa {
    /// The instruction set meant.
    pub(crate) fn widest(self) -> anyhow::Result<Set> {
        let (have, want) = (
            Set::detect(),
            match self {
                Self::Portable => Set::Portable,
                Self::V3 => Set::V3,
                Self::V4 => Set::V4,
                Self::Auto => Set::detect(),
            },
        );
        ensure!(want <= have, "this processor has no {want:?}; use --isa auto");
        Ok(want)
    }
    /// The sets to measure lanes with: every one that is wider than the program, up to this.
    pub(crate) fn all(self) -> anyhow::Result<Vec<Set>> {
        let widest = self.widest()?;
        let sets: Vec<Set> = [Set::V3, Set::V4].into_iter().filter(|s| *s <= widest).collect();
        Ok(if sets.is_empty() { vec![Set::Portable] } else { sets })
    }
}
