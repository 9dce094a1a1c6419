//! Time in two columns: seconds and a fraction of them, as the stamps of ROS, or a date and the time of day. Every line is rewritten with one
//! column in place of the two, so that whatever reads lines knows nothing of it.

use super::lines::cells;
use super::naming::{ignores, is_time, split};
use super::{dates, number};
use std::io::Write;

/// Columns whose two halves make the time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Joined {
    /// Column of the seconds, or of the date, where the time is put.
    first: usize,
    /// Column of the rest, which is taken out.
    second: usize,
    /// Nanoseconds per unit of the second column; `None` for a date and a time of day.
    scale: Option<i64>,
}

impl Joined {
    /// By the names, and the cells of the first row, if it is at hand; where no other column may be the time. `ignored` are left alone.
    pub(super) fn of(names: &[String], row: Option<&[Vec<u8>]>, ignored: &[String]) -> Option<Self> {
        let used = |i: &usize| !ignores(ignored, &names[*i]);
        let lower: Vec<String> = names.iter().map(|n| split(n).0.to_ascii_lowercase()).collect();
        let at: Vec<usize> = (0..names.len()).filter(used).collect();
        let pairs = at.iter().flat_map(|&a| at.iter().map(move |&b| (a, b)));
        let found: Vec<Self> = pairs.filter_map(|(a, b)| Self::pair((&lower, row), a, b)).collect();
        let [one] = found[..] else { return None };
        let other = |i: &usize| ![one.first, one.second].contains(i) && is_time(&names[*i]);
        (!at.iter().any(other)).then_some(one)
    }
    fn pair((names, row): (&[String], Option<&[Vec<u8>]>), first: usize, second: usize) -> Option<Self> {
        let (a, b) = (&names[first], &names[second]);
        if (a == "date" && b == "time") && row.is_some_and(|r| both(r, first, second).is_some()) {
            return Some(Self { first, second, scale: None });
        }
        let (stem, _) = stem(a, &["sec", "secs", "seconds"])?;
        let fractions = ["nanosec", "nanosecs", "nanoseconds", "nsec", "nsecs", "usec", "usecs", "microseconds"];
        let (_, unit) = self::stem(b, &fractions).filter(|s| s.0 == stem)?;
        let micro = unit.starts_with('u') || unit.starts_with("micro");
        Some(Self { first, second, scale: Some(if micro { 1000 } else { 1 }) })
    }
    /// Names with one column in place of the two.
    pub(super) fn rename(self, names: &mut Vec<String>) {
        names[self.first] = if self.scale.is_some() { "time[ns]" } else { "time" }.to_owned();
        names.remove(self.second);
    }
    /// A line with one cell in place of the two; both side by side where they make no time.
    pub(super) fn join(self, line: &mut Vec<u8>) {
        let Some(record) = cells(line) else { return };
        let rest = record.get(self.second).unwrap_or_default();
        line.clear();
        for (k, cell) in record.iter().enumerate().filter(|(k, _)| *k != self.second) {
            if !line.is_empty() || k > usize::from(self.second == 0) {
                line.push(b',');
            }
            if k != self.first {
                let quote: &[u8] = if cell.contains(&b',') { b"\"" } else { b"" };
                [quote, cell, quote].iter().for_each(|part| line.extend_from_slice(part));
            } else if let Some(ns) = self.scale.and_then(|s| nanoseconds(cell, rest, s)) {
                _ = write!(line, "{ns}");
            } else {
                [cell, b" ", rest].iter().for_each(|part| line.extend_from_slice(part));
            }
        }
    }
}

/// What stands before one of these words at the end of a name, and the word: all of it, or behind a dot, a slash or an underscore.
fn stem<'n>(name: &'n str, words: &[&str]) -> Option<(&'n str, &'n str)> {
    let at = name.rfind(['.', '/', '_']).map_or(0, |i| i + 1);
    let (stem, end) = name.split_at(at);
    // `tv_sec` and `tv_nsec`, `stamp.sec` and `stamp.nanosec`.
    words.contains(&end).then_some((stem, end))
}

fn both(row: &[Vec<u8>], first: usize, second: usize) -> Option<i64> {
    let text = [row.get(first)?.as_slice(), b" ", row.get(second)?].concat();
    dates::nanoseconds(&text).map(|d| d.0)
}

/// Whole seconds and a fraction of one, in nanoseconds.
fn nanoseconds(seconds: &[u8], fraction: &[u8], scale: i64) -> Option<i64> {
    // pandas writes whole numbers with `.0` where some are missing.
    let whole = |cell: &[u8]| {
        number::whole(cell).or_else(|| {
            let x = number::parse(cell).filter(|x| x.fract() == 0.0 && x.abs() < 1e15)?;
            Some(x as i64)
        })
    };
    let fraction = whole(fraction)?.checked_mul(scale).filter(|n| (0..dates::SECOND).contains(n))?;
    whole(seconds)?.checked_mul(dates::SECOND)?.checked_add(fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_columns_are_one_time() {
        let joined = |names: &str, line: &str| {
            let mut names: Vec<String> = names.split(',').map(str::to_owned).collect();
            let row: Vec<Vec<u8>> = line.split(',').map(|c| c.as_bytes().to_vec()).collect();
            let j = Joined::of(&names, Some(&row), &["seq".to_owned()])?;
            let mut line = line.as_bytes().to_vec();
            j.join(&mut line);
            j.rename(&mut names);
            Some(format!("{} {}", names.join(","), String::from_utf8(line).unwrap()))
        };
        let ros = "time[ns],q.a 1700000000000000123,0.5";
        assert_eq!(joined("sec,nanosec,q.a", "1700000000,123,0.5").unwrap(), ros);
        assert_eq!(joined("/js/header/stamp/nsecs,/js/header/stamp/secs,q.a", "123,1700000000.0,0.5").unwrap(), ros);
        assert_eq!(joined("stamp_sec,q.a,stamp_nsec", "1700000000,0.5,123").unwrap(), ros);
        assert_eq!(joined("tv_sec,tv_usec", "5,7").unwrap(), "time[ns] 5000007000");
        assert_eq!(joined("Date,Time,x", "2024-03-05,10:20:30.5,1").unwrap(), "time,x 2024-03-05 10:20:30.5,1");
        // No time, which is said where it is read.
        assert_eq!(joined("sec,nanosec", "5,-7").unwrap(), "time[ns] 5 -7");
        for other in ["sec,q.nanosec", "time[s],sec,nanosec", "a.sec,a.nanosec,b.sec,b.nanosec", "stamp,sec,nanosec"] {
            assert_eq!(joined(other, "1,2,3,4"), None, "{other}");
        }
    }
}
