//! From data to pixels, and where the ticks go.

/// One axis: a range of data, linear or logarithmic, laid over a range of pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    log: bool,
    /// Range in data space (linear) or its decimal logarithm.
    lo: f64,
    hi: f64,
    px0: f64,
    px1: f64,
}

/// A tick: pixel position and label; an empty label marks a minor tick.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub(super) at: f64,
    pub(super) label: String,
}

impl Axis {
    /// A linear axis; an empty range is widened.
    pub(super) fn linear((lo, hi): (f64, f64), px: (f64, f64)) -> Self {
        let (lo, hi) = if hi > lo { (lo, hi) } else { (lo - 0.5 * lo.abs().max(1.0), lo + 0.5 * lo.abs().max(1.0)) };
        Self { log: false, lo, hi, px0: px.0, px1: px.1 }
    }
    /// A logarithmic axis over positive numbers.
    pub(super) fn log((lo, hi): (f64, f64), px: (f64, f64)) -> Self {
        let (lo, hi) = (lo.max(f64::MIN_POSITIVE).log10(), hi.max(f64::MIN_POSITIVE).log10());
        let (lo, hi) = if hi - lo > 1e-9 { (lo, hi) } else { (lo - 0.5, hi + 0.5) };
        Self { log: true, lo, hi, px0: px.0, px1: px.1 }
    }
    /// Pixel of a value; `None` where a logarithm does not exist.
    pub(super) fn px(&self, v: f64) -> Option<f64> {
        let u = if self.log {
            if v <= 0.0 {
                return None;
            }
            v.log10()
        } else {
            v
        };
        Some(self.px0 + (u - self.lo) / (self.hi - self.lo) * (self.px1 - self.px0))
    }
    fn unit_px(&self, u: f64) -> f64 {
        self.px0 + (u - self.lo) / (self.hi - self.lo) * (self.px1 - self.px0)
    }
    /// Ticks about `spacing` pixels apart, and the power of ten taken out of their labels (0 for none).
    pub(super) fn ticks(&self, spacing: f64) -> (Vec<Tick>, i32) {
        let want = ((self.px1 - self.px0).abs() / spacing).max(2.0);
        if self.log { (self.log_ticks(want), 0) } else { self.linear_ticks(want) }
    }

    fn linear_ticks(&self, want: f64) -> (Vec<Tick>, i32) {
        let step = nice_step((self.hi - self.lo) / want);
        let (first, last) = ((self.lo / step - 1e-9).ceil() as i64, (self.hi / step + 1e-9).floor() as i64);
        let greatest = first.abs().max(last.abs()) as f64 * step;
        let exp = if greatest > 0.0 { (greatest * (1.0 + 1e-12)).log10().floor() as i32 } else { 0 };
        let exp = if (-2..5).contains(&exp) { 0 } else { exp };
        let unit = 10f64.powi(exp);
        let decimals = (-(step / unit * (1.0 + 1e-9)).log10().floor()).max(0.0) as usize;
        let tick = |i: i64| {
            let v = i as f64 * step;
            // Adding zero turns -0 into 0.
            Tick { at: self.unit_px(v), label: minus(&format!("{:.decimals$}", v / unit + 0.0)) }
        };
        ((first..=last).map(tick).collect(), exp)
    }

    fn log_ticks(&self, want: f64) -> Vec<Tick> {
        let (first, last) = ((self.lo - 1e-9).ceil() as i32, (self.hi + 1e-9).floor() as i32);
        let decades = self.hi - self.lo;
        let every = (decades / want).ceil().max(1.0) as i32;
        let mut out: Vec<Tick> = (first..=last)
            .map(|e| {
                let label = if e.rem_euclid(every) == 0 { format!("10{}", superscript(e)) } else { String::new() };
                Tick { at: self.unit_px(f64::from(e)), label }
            })
            .collect();
        // Less than two decades: label 2 and 5 as well, or the axis would carry one number or none.
        if every == 1 && decades < 2.5 {
            for e in first - 1..=last {
                for m in 2..10 {
                    let u = f64::from(e) + f64::from(m).log10();
                    if (self.lo..=self.hi).contains(&u) {
                        let named = matches!(m, 2 | 5) && decades < 1.5;
                        let label = if named { format!("{m}·10{}", superscript(e)) } else { String::new() };
                        out.push(Tick { at: self.unit_px(u), label });
                    }
                }
            }
        }
        out
    }
}

/// The round number (1, 2 or 5 times a power of ten) next above `raw`.
fn nice_step(raw: f64) -> f64 {
    let p = 10f64.powf(raw.log10().floor());
    let m = raw / p;
    p * if m <= 1.0 + 1e-9 {
        1.0
    } else if m <= 2.0 {
        2.0
    } else if m <= 5.0 {
        5.0
    } else {
        10.0
    }
}

/// The integer in superscript characters.
pub(super) fn superscript(n: i32) -> String {
    n.to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            c => c.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(c),
        })
        .collect()
}

/// A label with its exponents raised: `rad/s^2` as `rad/s²`.
pub(crate) fn typeset(label: &str) -> String {
    let mut parts = label.split('^');
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let digits = part.len() - part.trim_start_matches(|c: char| c == '-' || c.is_ascii_digit()).len();
        match part[..digits].parse() {
            Ok(n) => out.push_str(&superscript(n)),
            // No number: as it was.
            Err(_) => {
                out.push('^');
                out.push_str(&part[..digits]);
            }
        }
        out.push_str(&part[digits..]);
    }
    out
}

/// A typographic minus sign.
fn minus(s: &str) -> String {
    s.replace('-', "−")
}

/// Least and greatest of the values, `None` without any.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |r, v| Some(r.map_or((v, v), |(lo, hi): (f64, f64)| (lo.min(v), hi.max(v)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(t: &[Tick]) -> Vec<&str> {
        t.iter().map(|t| t.label.as_str()).collect()
    }

    #[test]
    fn round_ticks_inside_the_range() {
        let (t, e) = Axis::linear((-1.2, 2.3), (0.0, 400.0)).ticks(80.0);
        assert_eq!((labels(&t), e), (vec!["−1", "0", "1", "2"], 0));
        let (t, e) = Axis::linear((0.0, 0.6), (0.0, 300.0)).ticks(80.0);
        assert_eq!((labels(&t), e), (vec!["0.0", "0.2", "0.4", "0.6"], 0));
    }

    #[test]
    fn exponents_are_raised_and_other_carets_kept() {
        assert_eq!(typeset("PSD ((N m)^2/Hz)"), "PSD ((N m)²/Hz)");
        assert_eq!(typeset("rad^2/s^4 m^-12"), "rad²/s⁴ m⁻¹²");
        assert_eq!(typeset("a^b ^"), "a^b ^");
    }

    #[test]
    fn small_numbers_share_a_power_of_ten() {
        let (t, e) = Axis::linear((-3e-4, 4e-4), (0.0, 400.0)).ticks(60.0);
        assert_eq!(e, -4);
        assert_eq!(labels(&t), ["−2", "0", "2", "4"]);
    }

    #[test]
    fn decades_on_a_log_axis() {
        let a = Axis::log((1e-6, 1e2), (200.0, 0.0));
        let (t, _) = a.ticks(40.0);
        assert_eq!(labels(&t), ["10⁻⁶", "", "10⁻⁴", "", "10⁻²", "", "10⁰", "", "10²"]);
        assert_eq!(a.px(1e-6), Some(200.0));
        assert_eq!(a.px(0.0), None);
    }

    #[test]
    fn constant_data_gets_an_axis() {
        let (t, _) = Axis::linear((5.0, 5.0), (0.0, 100.0)).ticks(30.0);
        assert!(t.len() >= 2);
    }
}
