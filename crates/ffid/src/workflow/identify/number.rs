//! Numbers in sentences.

/// Five significant digits, in exponent form when very large or small.
pub fn num(x: f64) -> String {
    significant(x, 5)
}

/// So many significant digits, in exponent form below a thousandth and where there are two places more before the point.
pub(in crate::workflow) fn significant(x: f64, digits: i32) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".into()
    } else if (1e-3..10f64.powi(digits + 1)).contains(&size) {
        let places = (digits - 1 - size.log10().floor() as i32).max(0) as usize;
        format!("{x:.places$}")
    } else {
        let places = digits as usize - 1;
        format!("{x:.places$e}")
    }
}
