//! Springs in a row, which a record tells by their compliances.
//!
//! A wing of several hinges whose first mode alone rings tells one number of all their springs. With `r_i` the moment in hinge i that its
//! beginning motion takes, `1 / omega^2 = sum_i r_i^2 / k_i` to first order (S. Dunkerley, *Phil. Trans. R. Soc. A* 185, 1894, 279): linear in the
//! compliances `1 / k_i`. The valley along which springs trade stiffness is straight in these and a hyperbola in the stiffnesses, which
//! a fit creeps along.

use ff_model::{ParamDecl, ParamGroup};

/// Whether a parameter is the stiffness of a spring.
pub fn is_stiffness(decl: &ParamDecl) -> bool {
    decl.group == ParamGroup::Positive && matches!(decl.unit, "N m/rad" | "N/m")
}

/// Whether a parameter is the damping of a spring.
pub fn is_damping(decl: &ParamDecl) -> bool {
    decl.group == ParamGroup::Positive && matches!(decl.unit, "N m s/rad" | "N s/m")
}

/// Those of the `selected` parameters, by their place among them, that are stiffnesses of an appendage of which others are selected too.
pub(crate) fn springs_in_rows(decls: &[ParamDecl], selected: &[usize]) -> Vec<usize> {
    let owner = |k: usize| decls[selected[k]].name.split_once('.').map(|name| name.0);
    let springs: Vec<usize> = (0..selected.len()).filter(|&k| is_stiffness(&decls[selected[k]])).collect();
    let in_row = |&k: &usize| springs.iter().any(|&o| o != k && owner(o) == owner(k));
    springs.iter().copied().filter(in_row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Transform;

    #[test]
    fn a_spring_alone_is_in_no_row() {
        let mut decls = vec![ParamDecl::positive("boom.k[0]", "N m/rad", 31.0)];
        for name in ["wing.k[0]", "wing.k[1]", "wing.k[2]"] {
            decls.push(ParamDecl::positive(name, "N m/rad", 190.0));
        }
        decls.push(ParamDecl::positive("wing.d[0]", "N m s/rad", 1.7));
        assert_eq!(springs_in_rows(&decls, &[0, 1, 3, 4]), [1, 2]);
        // The others of the wing are held.
        assert_eq!(springs_in_rows(&decls, &[0, 2, 4]), [0; 0]);
    }
    #[test]
    fn compliances_lead_there_and_back() {
        let decls: Vec<ParamDecl> =
            ["k[0]", "k[1]"].map(|k| ParamDecl::positive(format!("wing.{k}"), "N m/rad", 190.0)).into();
        let full = [170.0, 230.0];
        let map = Transform::affine(&decls, &[0, 1], &full).unwrap().reciprocal(&[1], &full);
        assert_eq!(map.coordinates(&full).unwrap(), [1.0, 1.0]);
        let x = [0.8, 1.3];
        let there = map.physical(&x);
        assert!((there[1] - 230.0 / 1.3).abs() < 1e-12, "{there:?}");
        let back = map.coordinates(&there).unwrap();
        assert!(back.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-14), "{back:?}");
        let slope = (map.physical(&[0.8, 1.3 + 1e-6])[1] - map.physical(&[0.8, 1.3 - 1e-6])[1]) / 2e-6;
        assert!((map.jacobian(&x)[(1, 1)] / slope - 1.0).abs() < 1e-8, "{slope}");
        assert_eq!(map.bounds()[1], (0.0, f64::INFINITY));
    }
}
