//! What the tables of a file hold, declared once: the reader takes types, limits and defaults from here, the schema prints them.

/// A key of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Its name; ends with its unit, where it has one.
    pub name: &'static str,
    /// Whether the table must have it.
    pub required: bool,
    /// What it holds.
    pub holds: Holds,
    /// What stands for it when it is absent.
    pub default: Option<Literal>,
    /// What it is, in a few words.
    pub about: &'static str,
}

/// A default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Literal {
    /// A number.
    Number(f64),
    /// A whole number.
    Whole(u64),
    /// A word.
    Word(&'static str),
}

/// What a key holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Holds {
    /// A text.
    Text,
    /// One of several words.
    OneOf(&'static [&'static str]),
    /// A finite number.
    Number,
    /// A number above zero.
    Positive,
    /// A number of zero or more.
    NotNegative,
    /// An angle above zero and below pi (rad).
    Angle,
    /// A number of zero or more, below one.
    Fraction,
    /// A relative change, above minus one.
    Offset,
    /// A whole number of zero or more.
    Whole,
    /// A whole number within limits, both inclusive.
    WholeWithin {
        /// Least.
        from: u64,
        /// Greatest.
        to: u64,
        /// Unit behind a blank, or nothing.
        unit: &'static str,
    },
    /// True or false.
    Flag,
    /// This number and no other.
    Just(u32),
    /// Texts.
    Texts,
    /// Numbers.
    Numbers,
    /// Whole numbers.
    Wholes,
    /// Exactly so many numbers.
    Vector(usize),
    /// Three rows of three numbers.
    Rows,
    /// Six numbers xx, xy, xz, yy, yz, zz, or three rows of three.
    Symmetric,
    /// Rows of any length.
    Matrix,
    /// Two numbers each.
    Pairs,
    /// A name and a number each.
    Terms,
    /// A table.
    Table(&'static [Key]),
    /// An array of tables.
    Tables(&'static [Key]),
    /// One of several tables.
    Either(&'static [&'static [Key]]),
    /// An array of tables that are each one of several; all have the key `kind`, whose word says which.
    TablesOf(&'static [&'static [Key]]),
    /// An array of appendages: these keys, and those that their kind knows.
    Appendages(&'static [Key]),
    /// A table of any names with numbers.
    Named,
    /// A table of any names with texts.
    Words,
}

/// A key that may be left out.
pub const fn key(name: &'static str, holds: Holds, about: &'static str) -> Key {
    Key { name, required: false, holds, default: None, about }
}

/// A key that must be there.
pub const fn must(name: &'static str, holds: Holds, about: &'static str) -> Key {
    Key { required: true, ..key(name, holds, about) }
}

impl Key {
    /// The same key with a number for when it is absent.
    #[must_use]
    pub const fn or(self, x: f64) -> Self {
        Self { default: Some(Literal::Number(x)), ..self }
    }
    /// The same key with a whole number for when it is absent.
    #[must_use]
    pub const fn or_whole(self, x: u64) -> Self {
        Self { default: Some(Literal::Whole(x)), ..self }
    }
    /// The same key with a word for when it is absent.
    #[must_use]
    pub const fn or_word(self, word: &'static str) -> Self {
        Self { default: Some(Literal::Word(word)), ..self }
    }
}

/// The words of a list of words and what each stands for.
pub(crate) const fn words<V: Copy, const N: usize>(known: &[(&'static str, V); N]) -> [&'static str; N] {
    let mut out = [""; N];
    let mut i = 0;
    while i < N {
        out[i] = known[i].0;
        i += 1;
    }
    out
}
