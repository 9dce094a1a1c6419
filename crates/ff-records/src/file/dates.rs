//! Date-times as time stamps: ISO 8601 and RFC 3339, year first; day or month first; times of day; what has elapsed.

use super::options::DateOrder;
use std::ops::RangeInclusive;

/// Days from 1 March of the year 0 to 1 January 1970, in the proleptic Gregorian calendar.
const EPOCH: i64 = 719_468;
/// Nanoseconds of a second.
pub(crate) const SECOND: i64 = 1_000_000_000;
const MONTHS: [&[u8; 3]; 12] =
    [b"jan", b"feb", b"mar", b"apr", b"may", b"jun", b"jul", b"aug", b"sep", b"oct", b"nov", b"dec"];

/// How stamps are written that are no numbers; all of a file alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// Dates with a zone.
    Zoned,
    /// Dates without one.
    Local,
    /// Times of day, `10:20:30.5`.
    OfDay,
    /// `25.03.2024 10:20:30.5`, `25/3/2024 10:20:30.5`.
    DayFirst,
    /// `3/25/2024 10:20:30.5 AM`.
    MonthFirst,
    /// `3/5/2024 10:20:30`, which is the one or the other.
    Either,
    /// `0.25 sec`, `0 days 00:00:00.25`.
    Elapsed,
}

impl Style {
    /// With what the user says of dates that are the one or the other.
    pub(super) fn settled(self, order: DateOrder) -> Self {
        match (self, order) {
            (Self::Either, DateOrder::DayFirst) => Self::DayFirst,
            (Self::Either, DateOrder::MonthFirst) => Self::MonthFirst,
            _ => self,
        }
    }
}

/// Nanoseconds from midnight of a time of day, such as `10:20:30.123`, or of what has elapsed, or else those of a date, and how it is written.
/// Of a date that is the one or the other, the first number is taken for the day.
pub(super) fn nanoseconds(cell: &[u8]) -> Option<(i64, Style)> {
    if let Some((ns, zone)) = date_time(cell) {
        return Some((ns, if zone { Style::Zoned } else { Style::Local }));
    }
    if let Some(numbers) = numbers(cell) {
        let style = numbers.style();
        return Some((numbers.nanoseconds(style)?, style));
    }
    if let Some(ns) = named_month(cell) {
        return Some((ns, Style::Local));
    }
    if let Some(ns) = elapsed(cell) {
        return Some((ns, Style::Elapsed));
    }
    let mut rest = cell.trim_ascii();
    let ns = time_of_day(&mut rest)?;
    rest.is_empty().then_some((ns, Style::OfDay))
}

/// Nanoseconds of a stamp that is written in this style.
pub(super) fn of_style(cell: &[u8], style: Style) -> Option<i64> {
    match style {
        Style::DayFirst | Style::MonthFirst | Style::Either => numbers(cell)?.nanoseconds(style),
        _ => nanoseconds(cell).filter(|d| d.1 == style).map(|d| d.0),
    }
}

/// A date whose first two numbers are day and month, or month and day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Numbers {
    first: i64,
    second: i64,
    year: i64,
    of_day: i64,
    /// With points between them, which only those write who begin with the day.
    points: bool,
}

/// Such a date with a time of day behind it.
pub(super) fn numbers(cell: &[u8]) -> Option<Numbers> {
    let mut rest = cell.trim_ascii();
    let first = up_to_two(&mut rest, 1..=31)?;
    let separator = *rest.first().filter(|b| matches!(b, b'.' | b'/' | b'-'))?;
    skip(&mut rest, separator)?;
    let second = up_to_two(&mut rest, 1..=31)?;
    skip(&mut rest, separator)?;
    let year = number(&mut rest, 4, 0..=9999)?;
    _ = skip(&mut rest, b',');
    skip(&mut rest, b'T').or_else(|| skip(&mut rest, b' '))?;
    rest = rest.trim_ascii_start();
    let of_day = time_of_day(&mut rest)?;
    rest.is_empty().then_some(Numbers { first, second, year, of_day, points: separator == b'.' })
}

impl Numbers {
    /// Which of them is the day, by themselves.
    pub(super) fn style(&self) -> Style {
        match (self.points || self.first > 12, self.second > 12) {
            (true, _) => Style::DayFirst,
            (false, true) => Style::MonthFirst,
            (false, false) => Style::Either,
        }
    }
    /// Which of them is the day, by those of a later row of the same file: the day is that which has gone on.
    pub(super) fn settled_by(&self, later: &Self) -> Option<Style> {
        match later.style() {
            Style::Either if self.year != later.year => None,
            Style::Either if self.first == later.first && self.second + 1 == later.second => Some(Style::MonthFirst),
            Style::Either if self.second == later.second && self.first + 1 == later.first => Some(Style::DayFirst),
            Style::Either => None,
            style => Some(style),
        }
    }
    /// Whether another has the same date.
    pub(super) fn same_date(&self, other: &Self) -> bool {
        (self.first, self.second, self.year) == (other.first, other.second, other.year)
    }
    /// Whether both readings are one.
    pub(super) fn is_one(&self) -> bool {
        self.first == self.second
    }
    /// Both readings, in words.
    pub(super) fn readings(&self) -> String {
        let (a, b, year) = (self.first, self.second, self.year);
        format!("{year:04}-{b:02}-{a:02} (day first) or {year:04}-{a:02}-{b:02} (month first)")
    }
    /// Nanoseconds from 1970.
    pub(super) fn nanoseconds(&self, style: Style) -> Option<i64> {
        let (day, month) =
            if style == Style::MonthFirst { (self.second, self.first) } else { (self.first, self.second) };
        ((1..=12).contains(&month) && day <= days_of(self.year, month)).then_some(())?;
        (days(self.year, month, day) * 24 * 3600).checked_mul(SECOND)?.checked_add(self.of_day)
    }
}

/// A date with the name of its month, `05-Mar-2024 10:20:30.123`, as MATLAB writes it.
fn named_month(cell: &[u8]) -> Option<i64> {
    let mut rest = cell.trim_ascii();
    let day = up_to_two(&mut rest, 1..=31)?;
    let separator = *rest.first().filter(|b| matches!(b, b'-' | b' '))?;
    skip(&mut rest, separator)?;
    let (name, behind) = rest.split_at_checked(3)?;
    let month = MONTHS.iter().position(|m| name.eq_ignore_ascii_case(*m))? as i64 + 1;
    rest = behind;
    skip(&mut rest, separator)?;
    let year = number(&mut rest, 4, 0..=9999)?;
    skip(&mut rest, b' ')?;
    let of_day = time_of_day(&mut rest)?;
    (rest.is_empty() && day <= days_of(year, month)).then_some(())?;
    (days(year, month, day) * 24 * 3600).checked_mul(SECOND)?.checked_add(of_day)
}

/// What has elapsed: `0.25 sec` of MATLAB, `0 days 00:00:00.250000` of pandas.
fn elapsed(cell: &[u8]) -> Option<i64> {
    let text = core::str::from_utf8(cell).ok()?.trim();
    let (number, rest) = text.split_once(' ')?;
    let rest = rest.trim_start();
    let scale = match rest {
        "sec" | "s" | "seconds" => Some(1e9),
        "min" => Some(60e9),
        "hr" => Some(3600e9),
        _ => None,
    };
    if let Some(scale) = scale {
        let ns = (number.parse::<f64>().ok()? * scale).round();
        return (ns.abs() < 9e18).then_some(ns as i64);
    }
    let behind = rest.strip_prefix("days ").or_else(|| rest.strip_prefix("day "))?;
    let mut rest = behind.as_bytes();
    let of_day = time_of_day(&mut rest)?;
    rest.is_empty().then_some(())?;
    number.parse::<i64>().ok()?.checked_mul(24 * 3600 * SECOND)?.checked_add(of_day)
}

/// Nanoseconds from midnight, of the time that `rest` begins with; of twelve hours where `AM` or `PM` is behind.
fn time_of_day(rest: &mut &[u8]) -> Option<i64> {
    let mut hour = up_to_two(rest, 0..=23)?;
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
    let half = rest.trim_ascii_start().get(..2).map(<[u8]>::to_ascii_lowercase);
    if let Some(half @ (b"am" | b"pm")) = half.as_deref() {
        (1..=12).contains(&hour).then_some(())?;
        hour = hour % 12 + if half == b"pm" { 12 } else { 0 };
        *rest = &rest.trim_ascii_start()[2..];
    }
    Some(((hour * 60 + minute) * 60 + second) * SECOND + fraction)
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
    Some(((minutes * 60).checked_mul(SECOND)?.checked_add(of_day)?, zone))
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

/// One digit or two, as a number within its range.
fn up_to_two(rest: &mut &[u8], range: RangeInclusive<i64>) -> Option<i64> {
    let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
    if digits > 2 { None } else { number(rest, digits.max(1), range) }
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
    fn dates_of_spreadsheets_say_their_order_or_nothing() {
        let of = |s: &str| nanoseconds(s.as_bytes());
        let day = of("2024-03-25 22:20:30.5").unwrap().0;
        for (s, style) in [
            ("25.03.2024 22:20:30.5", Style::DayFirst),
            ("25/3/2024 22:20:30,500", Style::DayFirst),
            ("3/25/2024, 10:20:30.5 PM", Style::MonthFirst),
            ("03-25-2024 22:20:30.5", Style::MonthFirst),
            ("25-Mar-2024 22:20:30.5", Style::Local),
        ] {
            assert_eq!(of(s), Some((day, style)), "{s}");
        }
        let either = numbers(b"3/5/2024 12:00:00 AM").unwrap();
        assert_eq!(
            (either.style(), either.nanoseconds(Style::MonthFirst)),
            (Style::Either, of("2024-03-05 00:00:00").map(|d| d.0))
        );
        let by = |s: &str| either.settled_by(&numbers(s.as_bytes()).unwrap());
        assert_eq!(by("3/6/2024 00:00:00"), Some(Style::MonthFirst));
        assert_eq!(by("4/5/2024 00:00:00"), Some(Style::DayFirst));
        assert_eq!(by("3/13/2024 00:00:00"), Some(Style::MonthFirst));
        assert_eq!((by("4/6/2024 00:00:00"), by("3/6/2025 00:00:00")), (None, None));
        assert_eq!(of("0.25 sec"), Some((250_000_000, Style::Elapsed)));
        assert_eq!(of("1 days 00:00:00.25"), Some((86_400_250_000_000, Style::Elapsed)));
        for wrong in [
            "13/13/2024 10:00:00",
            "30.02.2024 10:00:00",
            "3.5.24 10:00:00",
            "3/5/2024 13:00:00 PM",
            "3/5/2024",
            "0.25 m",
            "3.5 1",
        ] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }

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
