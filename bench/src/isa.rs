//! Which instructions may be used.

use anyhow::bail;
use clap::ValueEnum;

/// Widest instruction set to use. Valgrind 3.19 knows no AVX-512, so that counting needs a cap.
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
    /// Makes the choice, for the rest of the process.
    pub(crate) fn select(self) -> anyhow::Result<()> {
        // PLACE FOR the hook of ff-lanes. Until it exists there is one code path, which is both the portable one and
        // the widest there is.
        match self {
            Self::Portable | Self::Auto => Ok(()),
            Self::V3 | Self::V4 => bail!("this build has no code for {self:?}; use --isa portable or auto"),
        }
    }
}
