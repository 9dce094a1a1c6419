//! The size of a parameter: what "relative" means when its value may be zero.
//!
//! Singular values compare parameters of different units only after each is divided by a size. For positive
//! and free parameters that is the value itself. A first moment or product of inertia may well be zero, so the
//! numbers of a body are measured by the body: mass m, radius of gyration `l = sqrt(tr I / (2 m))` about the
//! frame origin, hence `m l` for first moments and `m l^2` for rotational inertia.

use ff_model::{ParamDecl, ParamGroup};

/// The size of a parameter that belongs to no body: its value; of a free one that is zero unless something is wrong, half the range of
/// its declaration.
pub(crate) fn of_one(d: &ParamDecl, value: f64) -> f64 {
    let half = 0.5 * (d.bounds.1 - d.bounds.0);
    let size = if d.group == ParamGroup::Free && d.nominal == 0.0 && half.is_finite() { half } else { value.abs() };
    if size.is_finite() && size > 0.0 { size } else { 1.0 }
}

/// The size of every parameter of a model, in its own SI unit, at the given values. Always positive and
/// finite; 1 where nothing better is known. Allocates.
///
/// # Panics
/// If the lengths differ.
pub fn sizes(decls: &[ParamDecl], values: &[f64]) -> Vec<f64> {
    assert_eq!(decls.len(), values.len(), "one value per declaration");
    let usable = |x: f64| if x.is_finite() && x > 0.0 { x } else { 1.0 };
    let mut out = Vec::with_capacity(decls.len());
    while out.len() < decls.len() {
        let i = out.len();
        let ten = i + 10 <= decls.len()
            && matches!(decls[i].group, ParamGroup::Inertial(_))
            && decls[i..i + 10].iter().all(|d| d.group == decls[i].group);
        if ten {
            let m = usable(values[i].abs());
            let l = usable(((values[i + 4] + values[i + 6] + values[i + 9]).abs() / (2.0 * m)).sqrt());
            out.push(m);
            out.extend([m * l; 3]);
            out.extend([m * l * l; 6]);
        } else {
            out.push(of_one(&decls[i], values[i]));
        }
    }
    out
}

/// [`sizes`], those of parameters that belong to no body no smaller than at `least`: a damper that has gone to zero is told in its own units as well as
/// ever, and measured by next to nothing the data would seem silent on it. Allocates.
///
/// # Panics
/// If the lengths differ.
pub(crate) fn sizes_at_least(decls: &[ParamDecl], values: &[f64], least: &[f64]) -> Vec<f64> {
    let mut out = sizes(decls, values);
    for ((size, d), least) in out.iter_mut().zip(decls).zip(sizes(decls, least)) {
        if !matches!(d.group, ParamGroup::Inertial(_)) {
            *size = size.max(least);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_model::Inertia;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn zero_moments_have_the_size_of_their_body() {
        let b = Inertia::from_com(4.0, &Vector3::zeros(), &Matrix3::from_diagonal(&Vector3::new(1.0, 1.5, 2.0)));
        let mut d = ParamDecl::inertial("base", &b);
        d.push(ParamDecl::positive("k", "N m/rad", 0.0));
        d.push(ParamDecl::positive("k2", "N m/rad", 200.0));
        let v: Vec<f64> = d.iter().map(|p| p.nominal).collect();
        let l = (4.5f64 / 8.0).sqrt();
        let s = sizes(&d, &v);
        assert_eq!((s[0], s[2], s[5], s[10], s[11]), (4.0, 4.0 * l, 4.0 * l * l, 1.0, 200.0));
    }

    #[test]
    fn what_has_come_close_to_zero_is_measured_by_where_it_began() {
        let rest = ParamDecl { group: ParamGroup::Free, ..ParamDecl::positive("rest", "m", 0.03) };
        let d = [rest, ParamDecl::positive("d", "N s/m", 1.7)];
        assert_eq!(sizes_at_least(&d, &[-2e-6, 3e-9], &[0.03, 1.7]), [0.03, 1.7]);
        assert_eq!(sizes_at_least(&d, &[-0.1, 2.9], &[0.03, 1.7]), [0.1, 2.9]);
    }
}
