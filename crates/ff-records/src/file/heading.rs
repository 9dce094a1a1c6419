//! Names of columns as others write them: changed as the user says, and the column of the time told by its name, its unit, or its dates.

use super::dates::Style;
use super::naming::{LISTED, is_nameless, is_time, names_time, split, starred, suffixed};
use super::units::{Dimension, any, find};
use super::{data, dates, number};
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::{Area, Problem, Problems};

/// Nanoseconds from 1970 to 2001, and to 2042.
const EPOCH_FROM: i64 = 1_000_000_000_000_000_000;
const EPOCH_TO: i64 = 2_300_000_000_000_000_000;

/// The line of names.
pub(super) struct Heading {
    pub(super) names: Vec<String>,
    /// Its number.
    pub(super) line: usize,
    /// How stamps are written, if not as numbers.
    pub(super) dates: Option<Style>,
    /// Names as they stand in the file.
    pub(super) raw: Vec<String>,
}

/// Takes the units of names that have none from a line of units behind that of the names. False, with nothing changed, where that is no
/// such line: no cell is a number, and most are known units.
pub(super) fn take_units(names: &mut [String], line: &[Vec<u8>]) -> bool {
    let bare = |cell: &[u8]| -> String {
        let cell = String::from_utf8_lossy(cell).trim().to_owned();
        let inner = cell.strip_prefix(['[', '(']).and_then(|c| c.strip_suffix([']', ')']));
        inner.map_or(cell.clone(), str::to_owned)
    };
    let units: Vec<String> = line.iter().map(|c| bare(c)).collect();
    let number = |u: &&String| u.as_str() != "1" && number::parse(u.as_bytes()).is_some();
    let known = units.iter().filter(|u| u.as_str() != "1" && any(u).is_some()).count();
    let others = units.iter().filter(|u| !u.is_empty() && any(u).is_none()).count();
    if units.len() != names.len() || units.iter().any(|u| number(&u)) || known <= others {
        return false;
    }
    let lacking = |(name, unit): &(&mut String, &String)| split(name).1.is_none() && !unit.is_empty();
    names.iter_mut().zip(&units).filter(lacking).for_each(|(n, u)| *n = format!("{n}[{u}]"));
    true
}

/// Changes the names that a rule `(old, new)` fits: a whole cell, or the part before the unit, which is kept unless the new name has one. `*` stands
/// for any text, the same in both. False where a rule fits no column.
pub(super) fn rename(names: &mut [String], rules: &[(String, String)], bad: &mut Problems) -> bool {
    let old = names.to_vec();
    let mut good = true;
    for (from, to) in rules {
        let mut any = false;
        for (cell, new) in old.iter().zip(names.iter_mut()) {
            let (name, unit) = split(cell);
            let (star, unit) = match (starred(from, cell), starred(from, name)) {
                (Some(star), _) => (star, None),
                (None, Some(star)) => (star, unit),
                (None, None) => continue,
            };
            any = true;
            let put = to.replacen('*', star, 1);
            *new = match (split(&put).1, unit) {
                (None, Some(unit)) => format!("{put}[{unit}]"),
                _ => put,
            };
        }
        if !any {
            good = false;
            let what = format!("no column is called '{}'", clip(from));
            let near = closest(from, &old);
            let near = if near.is_empty() {
                String::new()
            } else {
                format!("closest: {}; ", list(near.iter().copied(), LISTED))
            };
            let hint = format!("{near}columns: {}", list(old.iter().map(String::as_str), LISTED));
            bad.push(data("Data::Columns", what).on("--rename").hint(hint));
        }
    }
    good
}

/// The names, without units, that the old name of a rule is most like: three at most, the nearest first. Of a pattern the text around its
/// `*` is compared.
pub(super) fn closest<'n>(rule: &str, names: &'n [String]) -> Vec<&'n str> {
    const MOST: usize = 3;
    let plain: Vec<&str> = names.iter().map(|n| split(n).0).filter(|n| !is_nameless(n)).collect();
    let around = |name: &str| match rule.split_once('*') {
        Some((before, after)) => {
            let (a, b) = (before.chars().count(), after.chars().count());
            let n = name.chars().count();
            name.chars().take(a).chain(name.chars().skip(a.max(n.saturating_sub(b)))).collect()
        }
        None => name.to_owned(),
    };
    let mut left: Vec<(String, &str)> = plain.into_iter().map(|n| (around(n), n)).collect();
    let word = rule.replacen('*', "", 1);
    let mut out = Vec::new();
    while out.len() < MOST {
        let Some(near) = nearest(&word, left.iter().map(|l| l.0.as_str())).map(str::to_owned) else { break };
        let Some(at) = left.iter().position(|l| l.0 == near) else { break };
        out.push(left.remove(at).1);
    }
    out
}

/// Gives the column of the time its name, where that is certain: the only one with a name of the time, or the first one without a name, if it has
/// dates; in a unit that the name says, or with dates. `first` are the cells of the first row, if it is at hand. How stamps are written, if
/// not as numbers.
pub(super) fn tell_time(names: &mut [String], first: Option<&[Vec<u8>]>) -> (Option<Style>, Option<usize>) {
    let date = |i: usize| first.and_then(|f| f.get(i)).and_then(|c| dates::nanoseconds(c)).map(|d| d.1);
    let at = match names.iter().position(|n| split(n).0 == "time") {
        Some(at) => at,
        None => {
            let called: Vec<usize> = (0..names.len()).filter(|&i| is_time(&names[i])).collect();
            match called[..] {
                [at] => at,
                [] if names.first().is_some_and(|n| is_nameless(n)) && date(0).is_some() => 0,
                _ => return (None, None),
            }
        }
    };
    let style = date(at);
    // Whole numbers of so many digits are nanoseconds since 1970: of any other unit they were thousands of years.
    let epoch = || {
        let cell = first.and_then(|f| f.get(at))?;
        number::whole(cell).filter(|w| (EPOCH_FROM..EPOCH_TO).contains(w) && split(&names[at]).1.is_none())
    };
    if style.is_some() || epoch().is_some() {
        names[at] = "time[ns]".to_owned();
    } else if let Some(unit) = unit(&names[at]) {
        names[at] = format!("time[{unit}]");
    }
    (style, Some(at))
}

/// What is said of a time whose unit or dates are not those of its name: `name` before and `now` as [`tell_time`] left it, with its first cell.
pub(super) fn told_time(name: &str, now: &str, dates: Option<Style>, cell: Option<&str>) -> Option<Problem> {
    let bare = split(name).1.is_none();
    let suffix =
        suffixed(&name.to_ascii_lowercase()).is_some_and(|s| names_time(s.0)) || name.eq_ignore_ascii_case("seconds");
    let how = match (dates, split(now).1) {
        (Some(Style::DayFirst), _) => "in dates, day first",
        (Some(Style::MonthFirst), _) => "in dates, month first",
        (Some(Style::Elapsed), _) => "what has elapsed, with its unit",
        (None, Some("ns")) if bare && !suffix => "whole nanoseconds",
        (None, Some("s")) if bare && !suffix => "seconds",
        _ => return None,
    };
    let shown = cell.map_or(String::new(), |c| format!(": '{}'", clip(c)));
    let what = format!("the time, column '{}', is {how}{shown}", clip(split(name).0));
    Some(
        Problem::warning(Area::Data, "Data::Dates", what)
            .on("time")
            .hint("nothing to do, if that is so; else --rename"),
    )
}

/// The unit of a time that its name says.
fn unit(cell: &str) -> Option<&'static str> {
    let (name, unit) = split(cell);
    let name = name.to_ascii_lowercase();
    match unit {
        Some(u) => find(u, Dimension::Time).map(|u| u.symbol),
        None if name == "seconds" => Some("s"),
        // PlotJuggler writes seconds, rostopic nanoseconds, and no other program these names.
        None if name == "__time" => Some("s"),
        None if name == "%time" => Some("ns"),
        None => suffixed(&name).filter(|s| names_time(s.0)).map(|s| s.1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_told_where_it_is_certain() {
        let told = |names: &[&str], first: &[&str]| {
            let mut names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
            let first: Vec<Vec<u8>> = first.iter().map(|c| c.as_bytes().to_vec()).collect();
            let (zone, _) = tell_time(&mut names, Some(&first));
            (names.join(";"), zone)
        };
        let date = "2024-03-05 10:20:30.5";
        assert_eq!(told(&["q.a", "t [s]"], &["1", "2"]), ("q.a;time[s]".into(), None));
        assert_eq!(told(&["timestamp_ns", "x"], &["1", "2"]).0, "time[ns];x");
        assert_eq!(told(&["Datetime", "x"], &[date, "2"]), ("time[ns];x".into(), Some(Style::Local)));
        assert_eq!(told(&["", "x"], &[&format!("{date}Z"), "2"]), ("time[ns];x".into(), Some(Style::Zoned)));
        // Numbers without a unit, two that may be it, numbers of rows.
        for same in [&["timestamp", "x"][..], &["stamp_ns", "t_s"], &["", "x"], &["tau_s", "x"]] {
            assert_eq!(told(same, &["1", "2"]).0, same.join(";"));
        }
    }

    #[test]
    fn a_line_of_units_is_no_sample() {
        let with = |names: &[&str], line: &[&str]| {
            let mut names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
            let line: Vec<Vec<u8>> = line.iter().map(|c| c.as_bytes().to_vec()).collect();
            take_units(&mut names, &line).then(|| names.join(";"))
        };
        let names = ["time", "q.a", "att.w", "note", "tau.a[N m]"];
        let units = "time[s];q.a[deg];att.w[1];note;tau.a[N m]";
        assert_eq!(with(&names, &["s", "[deg]", "1", "", "Nm"]).as_deref(), Some(units));
        assert_eq!(
            with(&["t", "q.a", "temperature"], &["s", "rad", "degC"]).unwrap(),
            "t[s];q.a[rad];temperature[degC]"
        );
        for samples in [["0", "1", "1"], ["1", "1", "1"], ["", "", ""], ["s", "2", "deg"], ["s", "one", "two"]] {
            assert_eq!(with(&["time", "q.a", "q.b"], &samples), None, "{samples:?}");
        }
    }

    #[test]
    fn names_are_changed_by_patterns() {
        let changed = |names: &[&str], rules: &[(&str, &str)]| {
            let mut names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
            let rules: Vec<_> = rules.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
            let mut bad = Problems::default();
            (rename(&mut names, &rules, &mut bad), names.join(";"), bad)
        };
        let names = ["/js/j1/position", "/js/j2/position", "%time", "tau.x[N m]"];
        let rules = [("/js/*/position", "q.*[deg]"), ("%time", "time[ns]"), ("tau.x", "tau.j1")];
        let (good, now, _) = changed(&names, &rules);
        assert_eq!((good, now.as_str()), (true, "q.j1[deg];q.j2[deg];time[ns];tau.j1[N m]"));
        let (good, _, bad) = changed(&names, &[("/js/*/effort", "tau.*")]);
        assert!(!good && bad.has("Data::Columns") && bad.0[0].hint.as_ref().unwrap().contains("%time"));
    }
}
