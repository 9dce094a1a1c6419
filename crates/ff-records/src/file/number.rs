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
        Some((x, len)) if len == cell.len() => Some(x),
        _ => any(cell),
    }
}

/// The cell that a line without quotes begins with: its value where that is a plain number, and its length.
#[inline]
pub(super) fn cell(line: &[u8]) -> (Option<f64>, usize) {
    match leading(line) {
        Some((x, len)) => (Some(x), len),
        None => (None, line.iter().position(|&b| b == b',').unwrap_or(line.len())),
    }
}

/// Whether a cell says that there is no number: empty, or one of the marks of pandas, R, spreadsheets, databases and C. Infinity is none of them.
pub(super) fn absent(cell: &[u8]) -> bool {
    const MARKS: [&str; 16] = [
        "nan",
        "-nan",
        "+nan",
        "nan(ind)",
        "-nan(ind)",
        "1.#qnan",
        "-1.#ind",
        "na",
        "n/a",
        "#n/a",
        "<na>",
        "nat",
        "null",
        "none",
        "-",
        "--",
    ];
    let cell = cell.trim_ascii();
    cell.is_empty() || MARKS.iter().any(|m| cell.eq_ignore_ascii_case(m.as_bytes()))
}

/// What the standard library takes for a number.
fn any(cell: &[u8]) -> Option<f64> {
    let text = core::str::from_utf8(cell).ok()?.trim();
    text.parse().ok().or_else(|| fortran(text)?.parse().ok())
}

/// A number of Fortran, `1.5D+02`, as others write it.
fn fortran(text: &str) -> Option<String> {
    let (mantissa, exponent) = text.split_once(['d', 'D'])?;
    mantissa.ends_with(|c: char| c.is_ascii_digit() || c == '.').then(|| format!("{mantissa}e{exponent}"))
}

/// Reads the plain decimal number that a line begins with, up to a comma or the end: its value and its length. `None` when the cell
/// is no such number, or has more than 19 digits.
///
/// Up to 15 or so digits with a small power of ten are one exact operation on exact numbers, so that the result is the
/// nearest one (W. Clinger, *How to read floating point numbers accurately*, PLDI 1990); everything else is left to the
/// standard library, which is as exact, and slower. Digits are taken up to eight at a time (D. Lemire, *Number parsing at a
/// gigabyte per second*, Software: Practice and Experience 51, 2021), however many there are, without a branch on their number or on
/// the sign: those of measured numbers cannot be predicted.
#[inline]
fn leading(line: &[u8]) -> Option<(f64, usize)> {
    let negative = line.first() == Some(&b'-');
    let begin = usize::from(negative);
    let (m, point) = digits(line, begin, 0);
    let (m, end, after) = match line.get(point) {
        Some(b'.') => {
            let (m, end) = digits(line, point + 1, m);
            (m, end, end - point - 1)
        }
        _ => (m, point, 0),
    };
    let count = point - begin + after;
    // With at most 19 digits nothing has wrapped.
    if count == 0 || count > 19 || !matches!(line.get(end), Some(b',') | None) {
        return None;
    }
    if m > EXACT {
        return Some((any(&line[..end])?, end));
    }
    // The cast to a signed number is one instruction.
    let x = m as i64 as f64 / TEN[after];
    Some((f64::from_bits(x.to_bits() | u64::from(negative) << 63), end))
}

/// Appends the digits at a place of a line to a whole number, modulo 2^64; where they end comes with it.
#[inline]
fn digits(line: &[u8], mut at: usize, mut m: u64) -> (u64, usize) {
    /// Powers of ten.
    const SHIFT: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];
    loop {
        // Digits become their values; then a byte above nine, or its carry out of a lower one that is, has its high bit set.
        let w = eight_bytes(line, at) ^ 0x3030_3030_3030_3030;
        let other = (w.wrapping_add(0x7676_7676_7676_7676) | w) & 0x8080_8080_8080_8080;
        let n = other.trailing_zeros() as usize / 8;
        // Zeros in front instead of what follows the digits; in two steps, as no digit at all is a shift by 64.
        let first = if n == 8 { w } else { w << (8 * (7 - n)) << 8 };
        m = m.wrapping_mul(SHIFT[n]).wrapping_add(eight_digits(first));
        at += n;
        if n < 8 {
            return (m, at);
        }
    }
}

/// Eight bytes of a line, the first one lowest, and zeros behind its end.
#[inline]
fn eight_bytes(line: &[u8], at: usize) -> u64 {
    let at = at.min(line.len());
    if let Some(eight) = line[at..].first_chunk::<8>() {
        return u64::from_le_bytes(*eight);
    }
    // The last eight of the line, without those in front.
    if let Some(eight) = line.last_chunk::<8>() {
        let skip = 8 - (line.len() - at);
        return if skip == 8 { 0 } else { u64::from_le_bytes(*eight) >> (8 * skip) };
    }
    line[at..].iter().rev().fold(0, |w, &b| w << 8 | u64::from(b))
}

/// The number of eight decimal digits given by their values, the first in the lowest byte.
#[inline]
fn eight_digits(w: u64) -> u64 {
    let pairs = w.wrapping_mul(10).wrapping_add(w >> 8);
    let low = (pairs & 0x0000_00FF_0000_00FF).wrapping_mul(0x000F_4240_0000_0064);
    let high = ((pairs >> 16) & 0x0000_00FF_0000_00FF).wrapping_mul(0x0000_2710_0000_0001);
    u64::from((low.wrapping_add(high) >> 32) as u32)
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
        assert_eq!(
            (parse(b"-1.5D+02"), parse(b"2.d0"), parse(b"d1"), parse(b"1d")),
            (Some(-150.0), Some(2.0), None, None)
        );
    }

    #[test]
    fn marks_of_a_missing_number_are_no_other_text() {
        for s in ["", "  ", "NaN", "nan", " NA ", "#N/A", "null", "None", "-", "-nan(ind)"] {
            assert!(absent(s.as_bytes()), "{s}");
        }
        for s in ["0", "inf", "-inf", "nano", "--1", "error", "1.#inf"] {
            assert!(!absent(s.as_bytes()), "{s}");
        }
    }

    #[test]
    fn a_cell_ends_at_the_comma() {
        assert_eq!(leading(b"-1.25,7"), Some((-1.25, 5)));
        assert_eq!(leading(b"0.30000000000000004,7"), Some((0.30000000000000004, 19)));
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
            assert_eq!(leading(format!("{n},x").as_bytes()), Some((n as f64, n.to_string().len())));
            let short: f64 = rng.random_range(-1e3..1e3);
            let text = format!("{short:.6}");
            assert_eq!(parse(text.as_bytes()), text.parse().ok());
        }
    }

    #[test]
    fn random_text_is_what_the_standard_library_takes_it_for() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let (mut numbers, mut ends) = (0, 0);
        for _ in 0..300_000 {
            let kinds: &[u8] = if rng.random_bool(0.5) { b"0123456789" } else { b"0123456789.-+e, /:\x00\xb9" };
            let len = rng.random_range(0..24);
            let mut text: Vec<u8> = (0..len).map(|_| kinds[rng.random_range(0..kinds.len())]).collect();
            if len > 2 && rng.random_bool(0.5) {
                text[rng.random_range(0..len)] = b'.';
            }
            let want = core::str::from_utf8(&text).ok().and_then(|s| s.trim().parse::<f64>().ok());
            assert_eq!(parse(&text).map(f64::to_bits), want.map(f64::to_bits), "{text:?}");
            numbers += usize::from(want.is_some());
            // What stands behind a comma does not matter.
            let (value, end) = cell(&text);
            let first = text.split(|&b| b == b',').next().unwrap();
            assert_eq!(end, first.len(), "{text:?}");
            assert!(value.is_none() || value.map(f64::to_bits) == parse(first).map(f64::to_bits), "{text:?}");
            ends += usize::from(end < text.len() && value.is_some());
        }
        assert!(numbers > 50_000 && ends > 1_000, "{numbers} {ends}");
    }
}
