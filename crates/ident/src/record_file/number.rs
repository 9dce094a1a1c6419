//! A number from bytes, without allocation.

/// Powers of ten that are exact.
const TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Greatest whole number up to which all are exact.
const EXACT: u64 = 1 << 53;

/// The nearest number to what a cell says; `None` when it says none. Spaces around it do not matter.
///
/// Up to 15 or so digits with a small power of ten are one exact operation on exact numbers, so that the result is the
/// nearest one (W. Clinger, *How to read floating point numbers accurately*, PLDI 1990); everything else is left to the
/// standard library, which is as exact, and slower.
#[inline]
pub(super) fn parse(cell: &[u8]) -> Option<f64> {
    quick(cell).or_else(|| core::str::from_utf8(cell).ok()?.trim().parse().ok())
}

#[inline]
fn quick(cell: &[u8]) -> Option<f64> {
    let (negative, digits) = match cell.split_first()? {
        (b'-', rest) => (true, rest),
        _ => (false, cell),
    };
    // 19 digits always fit.
    if digits.is_empty() || digits.len() > 20 {
        return None;
    }
    let (mut m, mut count, mut after, mut point) = (0u64, 0, 0, false);
    for &b in digits {
        let d = b.wrapping_sub(b'0');
        if d < 10 {
            if count == 19 {
                return None;
            }
            // At most 19 digits, so that nothing wraps; said so, because this is the innermost loop of a reader.
            m = m.wrapping_mul(10).wrapping_add(u64::from(d));
            count += 1;
            after += usize::from(point);
        } else if b == b'.' && !point {
            point = true;
        } else {
            return None;
        }
    }
    if count == 0 || m > EXACT || after >= TEN.len() {
        return None;
    }
    let x = m as f64 / TEN[after];
    Some(if negative { -x } else { x })
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
    fn random_numbers_read_back_to_the_bit() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for _ in 0..20_000 {
            let x = f64::from_bits(rng.random::<u64>());
            if x.is_finite() {
                assert_eq!(parse(format!("{x}").as_bytes()).unwrap().to_bits(), x.to_bits());
                assert_eq!(parse(format!("{x:e}").as_bytes()).unwrap().to_bits(), x.to_bits());
            }
            let short: f64 = rng.random_range(-1e3..1e3);
            let text = format!("{short:.6}");
            assert_eq!(parse(text.as_bytes()), text.parse().ok());
        }
    }
}
