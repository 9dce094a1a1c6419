//! Units of columns: what the header may say, and the factor to SI.

/// What a column measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Time (s).
    Time,
    /// Angle (rad).
    Angle,
    /// Angular rate (rad/s).
    AngularRate,
    /// Angular acceleration (rad/s^2).
    AngularAcceleration,
    /// Torque (N m).
    Torque,
    /// Length (m).
    Length,
    /// Speed (m/s).
    Speed,
    /// Acceleration, specific force (m/s^2).
    Acceleration,
    /// Force (N).
    Force,
    /// Electric current (A).
    Current,
    /// A pure number (1).
    One,
}

/// A unit: a value in it is `value * mul / div` in SI.
///
/// Two whole numbers rather than one factor, so that 0.1 s as 100 ms is read as the nearest number to 0.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// As the header writes it.
    pub symbol: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// Multiplier.
    pub mul: f64,
    /// Divisor.
    pub div: f64,
}

use Dimension::{
    Acceleration, Angle, AngularAcceleration, AngularRate, Current, Force, Length, One, Speed, Time, Torque,
};
use std::f64::consts::{PI, TAU};

const fn unit(symbol: &'static str, dimension: Dimension, mul: f64, div: f64) -> Unit {
    Unit { symbol, dimension, mul, div }
}

/// Every unit the reader knows. The SI unit of a dimension comes first.
pub const UNITS: &[Unit] = &[
    unit("s", Time, 1.0, 1.0),
    unit("ms", Time, 1.0, 1e3),
    unit("us", Time, 1.0, 1e6),
    unit("ns", Time, 1.0, 1e9),
    unit("min", Time, 60.0, 1.0),
    unit("rad", Angle, 1.0, 1.0),
    unit("mrad", Angle, 1.0, 1e3),
    unit("urad", Angle, 1.0, 1e6),
    unit("deg", Angle, PI, 180.0),
    unit("arcmin", Angle, PI, 10_800.0),
    unit("arcsec", Angle, PI, 648_000.0),
    unit("rev", Angle, TAU, 1.0),
    unit("rad/s", AngularRate, 1.0, 1.0),
    unit("mrad/s", AngularRate, 1.0, 1e3),
    unit("urad/s", AngularRate, 1.0, 1e6),
    unit("deg/s", AngularRate, PI, 180.0),
    unit("deg/h", AngularRate, PI, 648_000.0),
    unit("rpm", AngularRate, TAU, 60.0),
    unit("rev/s", AngularRate, TAU, 1.0),
    unit("rad/s^2", AngularAcceleration, 1.0, 1.0),
    unit("mrad/s^2", AngularAcceleration, 1.0, 1e3),
    unit("deg/s^2", AngularAcceleration, PI, 180.0),
    unit("N m", Torque, 1.0, 1.0),
    unit("mN m", Torque, 1.0, 1e3),
    unit("N mm", Torque, 1.0, 1e3),
    unit("uN m", Torque, 1.0, 1e6),
    unit("kN m", Torque, 1e3, 1.0),
    unit("N cm", Torque, 1.0, 1e2),
    unit("m", Length, 1.0, 1.0),
    unit("cm", Length, 1.0, 1e2),
    unit("mm", Length, 1.0, 1e3),
    unit("um", Length, 1.0, 1e6),
    unit("m/s", Speed, 1.0, 1.0),
    unit("cm/s", Speed, 1.0, 1e2),
    unit("mm/s", Speed, 1.0, 1e3),
    unit("m/s^2", Acceleration, 1.0, 1.0),
    unit("mm/s^2", Acceleration, 1.0, 1e3),
    // Standard gravity, exact by definition (3rd CGPM, 1901).
    unit("g0", Acceleration, 9.80665, 1.0),
    unit("mg0", Acceleration, 9.80665, 1e3),
    unit("ug0", Acceleration, 9.80665, 1e6),
    unit("N", Force, 1.0, 1.0),
    unit("mN", Force, 1.0, 1e3),
    unit("kN", Force, 1e3, 1.0),
    unit("A", Current, 1.0, 1.0),
    unit("mA", Current, 1.0, 1e3),
    unit("1", One, 1.0, 1.0),
];

/// The unit of a dimension with this symbol. Spaces, `*`, `.` and the middle dot between symbols are the same, `s2`,
/// `s**2` and `s²` are `s^2`, the Greek and the Latin micro sign are `u`, `°` is `deg`, and `Nm` is `N m`; units in words (`degrees`, `radians/sec`,
/// `Newton metres`) count in any size of letters.
pub fn find(symbol: &str, dimension: Dimension) -> Option<&'static Unit> {
    let plain = plain(symbol);
    UNITS.iter().find(|u| u.dimension == dimension && self::plain(u.symbol) == plain)
}

/// The unit with this symbol, of whatever dimension: no symbol stands for two.
pub fn any(symbol: &str) -> Option<&'static Unit> {
    let plain = plain(symbol);
    UNITS.iter().find(|u| self::plain(u.symbol) == plain)
}

/// Symbols of a dimension, comma separated, the SI unit first. Allocates.
pub fn symbols(dimension: Dimension) -> String {
    let all: Vec<&str> = UNITS.iter().filter(|u| u.dimension == dimension).map(|u| u.symbol).collect();
    all.join(", ")
}

/// Symbol of the SI unit.
pub fn si(dimension: Dimension) -> &'static str {
    UNITS.iter().find(|u| u.dimension == dimension).map_or("1", |u| u.symbol)
}

/// Units in words, in small letters, as the parts of a quotient.
const WORDS: [(&str, &str); 27] = [
    ("rad", "rad"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("mrad", "mrad"),
    ("deg", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("millisecond", "ms"),
    ("milliseconds", "ms"),
    ("usec", "us"),
    ("microsecond", "us"),
    ("microseconds", "us"),
    ("nsec", "ns"),
    ("nanosecond", "ns"),
    ("nanoseconds", "ns"),
    ("newtonmetre", "Nm"),
    ("newtonmetres", "Nm"),
    ("newtonmeter", "Nm"),
    ("newtonmeters", "Nm"),
    ("ampere", "A"),
    ("amperes", "A"),
    ("amps", "A"),
];

fn plain(symbol: &str) -> String {
    let spelled = spelled(symbol);
    if spelled.eq_ignore_ascii_case("dps") {
        return "deg/s".to_owned();
    }
    let word = |part: &str| {
        let (base, power) = part.split_once('^').map_or((part, None), |(b, p)| (b, Some(p)));
        let small = base.replace('-', "").to_ascii_lowercase();
        let known = WORDS.iter().find(|w| w.0 == small).map_or(base, |w| w.1);
        power.map_or_else(|| known.to_owned(), |p| format!("{known}^{p}"))
    };
    spelled.split('/').map(word).collect::<Vec<_>>().join("/")
}

fn spelled(symbol: &str) -> String {
    let s = symbol.trim().replace("**", "^").replace('²', "^2").replace("s2", "s^2");
    let s = s.replace(['µ', 'μ'], "u").replace('°', "deg");
    s.chars().filter(|c| !c.is_whitespace() && !matches!(c, '*' | '.' | '·' | '⋅')).collect()
}

impl Unit {
    /// A value of this unit in SI.
    #[inline]
    pub fn to_si(&self, x: f64) -> f64 {
        x * self.mul / self.div
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    #[test]
    fn spellings_of_one_unit_are_one_unit() {
        for s in ["N m", "Nm", "N*m", "N·m", "N.m"] {
            assert_eq!(find(s, Torque).unwrap().symbol, "N m", "{s}");
        }
        for s in ["rad/s^2", "rad/s2", "rad/s²", "rad/s**2"] {
            assert_eq!(find(s, AngularAcceleration).unwrap().symbol, "rad/s^2", "{s}");
        }
        assert_eq!(find("µs", Time).unwrap().symbol, "us");
        assert_eq!(find("°/s", AngularRate).unwrap().symbol, "deg/s");
        for (s, d, symbol) in [
            ("Degrees", Angle, "deg"),
            ("RAD", Angle, "rad"),
            ("radians/sec", AngularRate, "rad/s"),
            ("deg/sec^2", AngularAcceleration, "deg/s^2"),
            ("dps", AngularRate, "deg/s"),
            ("Newton-metres", Torque, "N m"),
            ("msec", Time, "ms"),
        ] {
            assert_eq!(find(s, d).unwrap().symbol, symbol, "{s}");
        }
        // Letters of another size are other units.
        assert!(find("MNm", Torque).is_none() && find("MS", Time).is_none());
        assert!(find("rad", Time).is_none() && find("", Angle).is_none());
    }

    #[test]
    fn conversions_are_exact_where_the_numbers_are() {
        let of = |s: &str, d, x| find(s, d).unwrap().to_si(x);
        assert_eq!(of("ms", Time, 100.0), 0.1);
        assert_eq!(of("ns", Time, 123_456_789.0), 0.123_456_789);
        assert_eq!(of("min", Time, 1.5), 90.0);
        assert_within!((of("deg", Angle, 90.0) - PI / 2.0).abs(), 1e-16);
        assert_within!((of("rpm", AngularRate, 30.0) - PI).abs(), 1e-15);
        assert_within!((of("deg/h", AngularRate, 3600.0) - PI / 180.0).abs(), 1e-17);
        assert_eq!(of("mN m", Torque, 1500.0), 1.5);
        assert_eq!(of("g0", Acceleration, 2.0), 19.6133);
        // No symbol stands for two units.
        for (i, a) in UNITS.iter().enumerate() {
            assert!(UNITS[..i].iter().all(|b| plain(b.symbol) != plain(a.symbol)));
        }
    }
}
