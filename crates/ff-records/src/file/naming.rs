//! What a name of a column says by itself: its unit, whether there is one, whether it is the time, whether a rule fits it.

/// Most names listed in one message; a warning lists all that were taken.
pub(crate) const LISTED: usize = 12;
/// What others call the time, in small letters.
const TIMES: [&str; 13] = [
    "time",
    "t",
    "timestamp",
    "time_stamp",
    "timestamps",
    "stamp",
    "datetime",
    "date",
    "header.stamp",
    "seconds",
    "__time",
    "%time",
    "date_time",
];
/// Units at the end of a name, behind an underscore.
const SUFFIXES: [(&str, &str); 13] = [
    ("s", "s"),
    ("sec", "s"),
    ("secs", "s"),
    ("seconds", "s"),
    ("ms", "ms"),
    ("msec", "ms"),
    ("milliseconds", "ms"),
    ("us", "us"),
    ("usec", "us"),
    ("microseconds", "us"),
    ("ns", "ns"),
    ("nsec", "ns"),
    ("nanoseconds", "ns"),
];
/// Name and unit of a header cell, `name[unit]` or `name (unit)`.
pub(super) fn split(cell: &str) -> (&str, Option<&str>) {
    let cell = cell.trim();
    let brackets = cell.strip_suffix(']').and_then(|c| c.rsplit_once('['));
    // `q.elbow (rad)`, as spreadsheets and plotting programs write it.
    // The place in an array, `position[3]`, is no unit; pure numbers have the unit 1, which arrays of joint states have not.
    let array = |name: &str| ["position", "velocity", "effort"].iter().any(|a| name.ends_with(a));
    let index = |(name, unit): &(&str, &str)| {
        !unit.is_empty() && unit.bytes().all(|b| b.is_ascii_digit()) && (*unit != "1" || array(name))
    };
    let brackets = brackets.filter(|b| !index(b));
    match brackets.or_else(|| cell.strip_suffix(')').and_then(|c| c.rsplit_once(" ("))) {
        Some((name, unit)) => (name.trim(), Some(unit)),
        None => (cell, None),
    }
}

/// Name and unit of a cell, where `[1]` beside `[0]` or `[2]` is the place in an array.
pub(super) fn parts<'c>(cell: &'c str, all: &[String]) -> (&'c str, Option<&'c str>) {
    let (name, unit) = split(cell);
    let beside =
        |k: &str| all.iter().any(|c| c.trim().strip_prefix(name).is_some_and(|rest| rest.trim_start().starts_with(k)));
    if unit == Some("1") && cell.trim().ends_with("[1]") && (beside("[0]") || beside("[2]")) {
        return (cell.trim(), None);
    }
    (name, unit)
}

/// What `*` stands for; empty where there is none and both are the same.
pub(super) fn starred<'t>(pattern: &str, text: &'t str) -> Option<&'t str> {
    match pattern.split_once('*') {
        Some((before, after)) => text.strip_prefix(before)?.strip_suffix(after),
        None => (pattern == text).then_some(""),
    }
}

/// Whether one of these rules leaves a column out: its name, the whole cell, or either with one `*` for any text.
pub fn ignores(rules: &[String], cell: &str) -> bool {
    let name = split(cell).0;
    rules.iter().any(|rule| starred(rule, name).is_some() || starred(rule, cell).is_some())
}

/// Whether a column has no name and is left out: the row numbers that pandas writes, which it calls `Unnamed: 0` when it has read and written them again, or what a
/// comma at the end of every line makes.
pub fn is_nameless(cell: &str) -> bool {
    let numbered = |rest: &str| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit());
    cell.trim().is_empty() || cell.trim().strip_prefix("Unnamed: ").is_some_and(numbered)
}

/// Whether a column has a name of the time, with or without a unit.
pub(super) fn is_time(cell: &str) -> bool {
    let name = split(cell).0.to_ascii_lowercase();
    let stem = suffixed(&name).map_or(&*name, |s| s.0);
    TIMES.contains(&&*name) || TIMES.contains(&stem)
}

/// The name without the unit at its end, and that unit.
pub(super) fn suffixed(name: &str) -> Option<(&str, &'static str)> {
    let (stem, end) = name.rsplit_once('_')?;
    SUFFIXES.iter().find(|s| s.0 == end).map(|s| (stem, s.1))
}

/// Whether a name in small letters is one of the time.
pub(super) fn names_time(name: &str) -> bool {
    TIMES.contains(&name)
}
