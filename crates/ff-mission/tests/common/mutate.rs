//! Files changed at random, for tests of readers. Also used by the tests of `ffid`.

use proptest::prelude::*;

/// Pieces that matter to the readers, beside single bytes.
const PIECES: [&str; 24] = [
    "<",
    ">",
    "/>",
    "</",
    "\"",
    "'",
    "<!--",
    "-->",
    "<![CDATA[",
    "&",
    "=",
    "[",
    "]",
    "{",
    "}",
    "[[",
    "nan",
    "1e999",
    "-",
    "\n",
    "\u{feff}",
    "µ",
    "*",
    ".",
];

/// One change of a file.
#[derive(Clone, Debug)]
pub enum Edit {
    Byte(prop::sample::Index, u8),
    Insert(prop::sample::Index, usize),
    Remove(prop::sample::Index, usize),
    Copy(prop::sample::Index, prop::sample::Index, usize),
    Cut(prop::sample::Index),
}

/// One to seven changes.
pub fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let at = any::<prop::sample::Index>;
    let one = prop_oneof![
        4 => (at(), any::<u8>()).prop_map(|(i, b)| Edit::Byte(i, b)),
        4 => (at(), 0..PIECES.len()).prop_map(|(i, p)| Edit::Insert(i, p)),
        2 => (at(), 1..60usize).prop_map(|(i, n)| Edit::Remove(i, n)),
        2 => (at(), at(), 1..300usize).prop_map(|(i, j, n)| Edit::Copy(i, j, n)),
        1 => at().prop_map(Edit::Cut),
    ];
    prop::collection::vec(one, 1..8)
}

/// The changed file.
pub fn mutate(file: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut b = file.to_vec();
    for e in edits {
        if b.is_empty() {
            break;
        }
        let n = b.len();
        match e {
            Edit::Byte(i, x) => b[i.index(n)] = *x,
            Edit::Insert(i, p) => {
                let i = i.index(n);
                b.splice(i..i, PIECES[*p].bytes());
            }
            Edit::Remove(i, k) => {
                let i = i.index(n);
                b.drain(i..(i + k).min(n));
            }
            Edit::Copy(i, j, k) => {
                let (i, j) = (i.index(n), j.index(n));
                let piece = b[i..(i + k).min(n)].to_vec();
                b.splice(j..j, piece);
            }
            Edit::Cut(i) => b.truncate(i.index(n)),
        }
    }
    b
}
