//! A number from bytes, without allocation.

/// Powers of ten that are exact.
const TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Greatest whole number up to which all are exact.
const EXACT: u64 = 1 << 53;

/// The nearest number to what a cell says; `None` when it says none. Spaces around it do not matter.
pub(super) fn parse(cell: &[u8]) -> Option<f64> {
    match leading(cell) {
        // A comma in a cell is no end but a mistake.
        Some((Some(x), len)) if len == cell.len() => Some(x),
        _ => core::str::from_utf8(cell).ok()?.trim().parse().ok(),
    }
}

/// The cell that a line without quotes begins with: its value where that is a plain number, and its length.
#[inline]
pub(super) fn cell(line: &[u8]) -> (Option<f64>, usize) {
    leading(line).unwrap_or_else(|| (None, line.iter().position(|&b| b == b',').unwrap_or(line.len())))
}

/// Reads the plain decimal number that a line begins with, up to a comma or the end: its value if that is exact here, and
/// its length. `None` when the cell is no such number, or has more than 19 digits.
///
/// Up to 15 or so digits with a small power of ten are one exact operation on exact numbers, so that the result is the
/// nearest one (W. Clinger, *How to read floating point numbers accurately*, PLDI 1990); everything else is left to the
/// standard library, which is as exact, and slower. Digits are taken eight at a time (D. Lemire, *Number parsing at a
/// gigabyte per second*, Software: Practice and Experience 51, 2021).
#[inline]
fn leading(line: &[u8]) -> Option<(Option<f64>, usize)> {
    let negative = line.first() == Some(&b'-');
    let mut i = usize::from(negative);
    let (mut m, mut count, mut after, mut point) = (0u64, 0, 0, false);
    // At most 19 digits, so that nothing wraps; said so, because this is the innermost loop of a reader.
    loop {
        if count <= 11
            && let Some(eight) = line.get(i..).and_then(|l| l.first_chunk::<8>())
            && let Some(d) = eight_digits(u64::from_le_bytes(*eight))
        {
            m = m.wrapping_mul(100_000_000).wrapping_add(d);
            (i, count) = (i + 8, count + 8);
            after += if point { 8 } else { 0 };
            continue;
        }
        match line.get(i) {
            Some(b @ b'0'..=b'9') if count < 19 => {
                m = m.wrapping_mul(10).wrapping_add(u64::from(b - b'0'));
                count += 1;
                after += usize::from(point);
            }
            Some(b'.') if !point => point = true,
            Some(b',') | None => break,
            _ => return None,
        }
        i += 1;
    }
    if count == 0 {
        return None;
    }
    if m > EXACT || after >= TEN.len() {
        return Some((None, i));
    }
    let x = m as f64 / TEN[after];
    Some((Some(if negative { -x } else { x }), i))
}

/// Eight decimal digits, the first in the lowest byte.
#[inline]
fn eight_digits(w: u64) -> Option<u64> {
    const HIGH: u64 = 0xF0F0_F0F0_F0F0_F0F0;
    let digits = (w & HIGH) | ((w.wrapping_add(0x0606_0606_0606_0606) & HIGH) >> 4) == 0x3333_3333_3333_3333;
    if !digits {
        return None;
    }
    let w = w.wrapping_sub(0x3030_3030_3030_3030);
    let pairs = w.wrapping_mul(10).wrapping_add(w >> 8);
    let low = (pairs & 0x0000_00FF_0000_00FF).wrapping_mul(0x000F_4240_0000_0064);
    let high = ((pairs >> 16) & 0x0000_00FF_0000_00FF).wrapping_mul(0x0000_2710_0000_0001);
    Some(u64::from((low.wrapping_add(high) >> 32) as u32))
}

/// A whole number, for time stamps that would lose digits as a floating-point number.
pub(super) fn whole(cell: &[u8]) -> Option<i64> {
    core::str::from_utf8(cell).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_the_one_of_the_standard_library() {
        for s in [
            "0",
            "-0",
            "-0.0",
            "1",
            "3.25",
            "-17.0001",
            "0.1",
            "123456789.123456",
            "9007199254740992",
            "9007199254740993",
            "0.30000000000000004",
            "1e3",
            "-2.5e-300",
            "1e400",
            "nan",
            "inf",
            "+4.5",
            ".5",
            "5.",
            "00012.50",
            " 7.25 ",
            "18446744073709551615",
            "99999999999999999999",
            "0.0000000000000000000001",
            "1.7976931348623157e308",
        ] {
            let want: f64 = s.trim().parse().unwrap();
            let got = parse(s.as_bytes()).unwrap();
            assert_eq!(got.to_bits(), want.to_bits(), "{s}");
        }
        for s in ["", "-", ".", "-.", "1.2.3", "1,5", "abc", "0x10", "1_000", "--1", "1 2"] {
            assert_eq!(parse(s.as_bytes()), None, "{s}");
        }
        assert_eq!(parse(&[b'1', 0xff]), None);
    }

    #[test]
    fn a_cell_ends_at_the_comma() {
        assert_eq!(leading(b"-1.25,7"), Some((Some(-1.25), 5)));
        assert_eq!(leading(b"0.30000000000000004,7"), Some((None, 19)));
        for s in [&b"1e3,"[..], b" 1,", b",", b"", b"-,", b"1;2", b"12345678901234567890,", b"1.2.3", b"1234567x"] {
            assert_eq!(leading(s), None, "{s:?}");
        }
    }

    #[test]
    fn random_numbers_read_back_to_the_bit() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for _ in 0..20_000 {
            let x = f64::from_bits(rng.random::<u64>());
            if x.is_finite() {
                assert_eq!(parse(format!("{x}").as_bytes()).unwrap().to_bits(), x.to_bits());
                assert_eq!(parse(format!("{x:e}").as_bytes()).unwrap().to_bits(), x.to_bits());
            }
            let n: u64 = rng.random_range(0..1_000_000_000_000);
            assert_eq!(leading(format!("{n},x").as_bytes()), Some((Some(n as f64), n.to_string().len())));
            let short: f64 = rng.random_range(-1e3..1e3);
            let text = format!("{short:.6}");
            assert_eq!(parse(text.as_bytes()), text.parse().ok());
        }
    }
}
