//! Date-times as time stamps: ISO 8601 and RFC 3339, year first; and times of day.

use std::ops::RangeInclusive;

/// Days from 1 March of the year 0 to 1 January 1970, in the proleptic Gregorian calendar.
const EPOCH: i64 = 719_468;

/// How stamps are written that are no numbers; all of a file alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// Dates with a zone.
    Zoned,
    /// Dates without one.
    Local,
    /// Times of day, `10:20:30.5`.
    OfDay,
}

/// Nanoseconds from midnight of a time of day, such as `10:20:30.123`, or else those of [`date_time`].
pub(super) fn nanoseconds(cell: &[u8]) -> Option<(i64, Style)> {
    if let Some((ns, zone)) = date_time(cell) {
        return Some((ns, if zone { Style::Zoned } else { Style::Local }));
    }
    let mut rest = cell.trim_ascii();
    let ns = time_of_day(&mut rest)?;
    rest.is_empty().then_some((ns, Style::OfDay))
}

/// Nanoseconds from midnight, of the time that `rest` begins with.
fn time_of_day(rest: &mut &[u8]) -> Option<i64> {
    let hour = number(rest, 2, 0..=23)?;
    skip(rest, b':')?;
    let minute = number(rest, 2, 0..=59)?;
    skip(rest, b':')?;
    // A leap second is the first one of the next minute.
    let second = number(rest, 2, 0..=60)?;
    let mut fraction = 0;
    if skip(rest, b'.').or_else(|| skip(rest, b',')).is_some() {
        let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
        if digits == 0 {
            return None;
        }
        fraction = (0..9).fold(0, |f, k| 10 * f + if k < digits { i64::from(rest[k] - b'0') } else { 0 });
        *rest = &rest[digits..];
    }
    Some(((hour * 60 + minute) * 60 + second) * 1_000_000_000 + fraction)
}

/// Nanoseconds from 1970-01-01 00:00 of a date-time such as `2024-03-05T10:20:30.123456Z` or `2024-03-05 10:20:30,5+01:00`, and whether it names its
/// zone; a time without one counts as if it were UTC, which moves all stamps alike. Digits beyond nanoseconds are cut off. `None` for what
/// is no such date-time, or before 1678 or after 2261.
fn date_time(cell: &[u8]) -> Option<(i64, bool)> {
    let mut rest = cell.trim_ascii();
    let year = number(&mut rest, 4, 0..=9999)?;
    let separator = *rest.first().filter(|b| matches!(b, b'-' | b'/'))?;
    skip(&mut rest, separator)?;
    let month = number(&mut rest, 2, 1..=12)?;
    skip(&mut rest, separator)?;
    let day = number(&mut rest, 2, 1..=days_of(year, month))?;
    skip(&mut rest, b'T').or_else(|| skip(&mut rest, b' '))?;
    let of_day = time_of_day(&mut rest)?;
    let (offset, zone) = zone(rest)?;
    let minutes = days(year, month, day) * 24 * 60 - offset;
    Some(((minutes * 60).checked_mul(1_000_000_000)?.checked_add(of_day)?, zone))
}

/// Minutes that a zone is ahead of UTC (`Z`, `+01:00`, `-0530`, `+01`), and whether there is one.
fn zone(rest: &[u8]) -> Option<(i64, bool)> {
    let (sign, mut rest) = match rest.trim_ascii() {
        [] => return Some((0, false)),
        b"Z" | b"z" | b"UTC" => return Some((0, true)),
        [b'+', rest @ ..] => (1, rest),
        [b'-', rest @ ..] => (-1, rest),
        _ => return None,
    };
    let hours = number(&mut rest, 2, 0..=23)?;
    _ = skip(&mut rest, b':');
    let minutes = if rest.is_empty() { 0 } else { number(&mut rest, 2, 0..=59)? };
    rest.is_empty().then_some((sign * (60 * hours + minutes), true))
}

/// So many digits, as a number within its range.
fn number(rest: &mut &[u8], digits: usize, range: RangeInclusive<i64>) -> Option<i64> {
    let (all, behind) = rest.split_at_checked(digits)?;
    let value = all.iter().try_fold(0, |n, b| b.is_ascii_digit().then(|| 10 * n + i64::from(b - b'0')))?;
    *rest = behind;
    range.contains(&value).then_some(value)
}

fn skip(rest: &mut &[u8], b: u8) -> Option<()> {
    *rest = rest.strip_prefix(&[b])?;
    Some(())
}

fn days_of(year: i64, month: i64) -> i64 {
    match month {
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 1970-01-01 (H. Hinnant, *chrono-compatible low-level date algorithms*, `days_from_civil`).
fn days(year: i64, month: i64, day: i64) -> i64 {
    let y = if month <= 2 { year - 1 } else { year };
    let (era, of_era) = (y.div_euclid(400), y.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + 365 * of_era + of_era / 4 - of_era / 100 + of_year - EPOCH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn date_times_are_nanoseconds_of_the_epoch() {
        let of = |s: &str| date_time(s.as_bytes());
        assert_eq!(nanoseconds(b" 10:20:30.5"), Some((37_230_500_000_000, Style::OfDay)));
        assert_eq!((nanoseconds(b"10:20:30:500"), nanoseconds(b"24:00:00")), (None, None));
        // By `date -u -d ... +%s`.
        assert_eq!(of("1970-01-01T00:00:00Z"), Some((0, true)));
        assert_eq!(of("2024-02-29 23:59:59.25"), Some((1_709_251_199_250_000_000, false)));
        assert_eq!(of("2000/03/01T12:00:00,000000001+05:30"), Some((951_892_200_000_000_001, true)));
        assert_eq!(of(" 1969-12-31T23:59:59.999999999987-00 "), Some((-1, true)));
        assert_eq!(of("1900-03-01 00:00:00 UTC"), Some((-2_203_891_200_000_000_000, true)));
        for wrong in [
            "",
            "1709251199",
            "2023-02-29T00:00:00",
            "29-02-2024 10:00:00",
            "2024-2-29 10:00:00",
            "2024-02-29",
            "10:00:00.5",
            "2024-02-29T10:00:00.",
            "2024-02-29T24:00:00",
            "2024-02/29 10:00:00",
            "2024-02-29T10:00:00+1",
            "9999-01-01T00:00:00Z",
        ] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }
}
