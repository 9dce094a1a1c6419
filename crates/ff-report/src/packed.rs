//! Numbers as text: little-endian, base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Single precision, 24 bits: a tenth of a micrometre over a metre, enough to draw by.
pub(crate) fn singles(values: impl Iterator<Item = f64>) -> String {
    STANDARD.encode(values.flat_map(|x| (x as f32).to_le_bytes()).collect::<Vec<u8>>())
}

/// Whole numbers of 16 bits.
pub(crate) fn shorts(values: impl Iterator<Item = u16>) -> String {
    STANDARD.encode(values.flat_map(u16::to_le_bytes).collect::<Vec<u8>>())
}
