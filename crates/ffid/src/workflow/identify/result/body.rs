//! Estimated bodies as an engineer reads them: centre of mass, inertia about it, principal axes, with deviations.

use ff_model::{Inertia, ParamDecl, ParamGroup};
use ident::Uncertainty;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

/// One quantity of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyQuantity {
    /// `mass`, `com_x` to `com_z`, or `inertia_com_xx` to `inertia_com_zz`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value at the start of the fit.
    pub start: f64,
    /// Value.
    pub value: f64,
    /// Standard deviation; absent where data and priors do not determine it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std: Option<f64>,
    /// Change against the start (%); absent for a start of zero.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub change_percent: Option<f64>,
}

/// One principal axis of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrincipalAxis {
    /// Its moment (kg m^2).
    pub moment_kgm2: f64,
    /// The standard deviation of the moment (kg m^2).
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub moment_std_kgm2: Option<f64>,
    /// Change of the moment against the start (%).
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub change_percent: Option<f64>,
    /// Unit vector in the frame of the body.
    pub axis: [f64; 3],
    /// Standard deviation of its direction (rad), the larger of its two turns; absent where it is not determined, or where another moment
    /// is closer than the deviations, as any axes in the plane of the two would do.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub axis_std_rad: Option<f64>,
}

/// A body of which parameters were estimated.
///
/// From mass `m`, first moment `h` and inertia `I` about the frame's origin follow the centre of mass `c = h / m` and the inertia about it,
/// `I_c = I - m (|c|^2 1 - c c^T)`; with the principal axes `v_k` of `I_c`, its principal moments are `J_k = v_k^T I_c v_k`. Deviations are
/// propagated to first order from the covariance of the estimated parameters; those held count as exact. Axis k turns towards axis l by
/// `v_k^T dI_c v_l / (J_k - J_l)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyLine {
    /// Name of the body.
    pub name: String,
    /// Mass, centre of mass in the frame of the body, inertia about it in the axes of that frame.
    pub quantities: Vec<BodyQuantity>,
    /// Principal axes of that inertia, smallest moment first, right-handed.
    pub principal: Vec<PrincipalAxis>,
}

/// Entries of a symmetric matrix.
const ENTRIES: [(usize, usize, &str); 6] =
    [(0, 0, "xx"), (0, 1, "xy"), (0, 2, "xz"), (1, 1, "yy"), (1, 2, "yz"), (2, 2, "zz")];

/// Change in percent, where there is something to compare with.
fn percent(new: f64, old: f64) -> Option<f64> {
    (old != 0.0).then(|| 100.0 * (new - old) / old.abs())
}

impl BodyLine {
    /// Every body of which a parameter was estimated, in the order of the parameters. `values` are start and end, over `decls`;
    /// the first unknowns of `u` are those `selected`. Bodies without mass are left out. Allocates.
    pub(in crate::workflow::identify) fn all(
        decls: &[ParamDecl],
        values: (&[f64], &[f64]),
        selected: &[usize],
        u: &Uncertainty,
    ) -> Vec<Self> {
        let mut out = Vec::new();
        let mut i = 0;
        while i < decls.len() {
            let ParamGroup::Inertial(name) = &decls[i].group else {
                i += 1;
                continue;
            };
            let columns: [Option<usize>; 10] = core::array::from_fn(|k| selected.iter().position(|&s| s == i + k));
            if columns.iter().any(Option::is_some) {
                out.extend(Self::of(name, (&values.0[i..i + 10], &values.1[i..i + 10]), columns, u));
            }
            i += 10;
        }
        out
    }

    fn of(name: &str, values: (&[f64], &[f64]), columns: [Option<usize>; 10], u: &Uncertainty) -> Option<Self> {
        let [before, body] = [values.0, values.1].map(Inertia::from_params);
        let (m, c) = (body.mass, body.com()?);
        let known = columns.iter().flatten().all(|&k| u.deviation[k].is_some());
        let covariance = SMatrix::<f64, 10, 10>::from_fn(|a, b| match (columns[a], columns[b]) {
            (Some(a), Some(b)) => u.covariance[(a, b)],
            _ => 0.0,
        });
        let std = |gradient: &SVector<f64, 10>| known.then(|| gradient.dot(&(covariance * gradient)).max(0.0).sqrt());
        let unit = |k: usize| SVector::<f64, 10>::from_fn(|i, _| f64::from(u8::from(i == k)));
        let com_gradient: [SVector<f64, 10>; 3] = core::array::from_fn(|a| (unit(1 + a) - unit(0) * c[a]) / m);
        // I_c = I - (|h|^2 1 - h h^T) / m, differentiated; the parameters are in the order of Inertia::to_params.
        let ic = body.about_com();
        let slope = |k: usize| -> Matrix3<f64> {
            let d = Inertia::from_params(unit(k).as_slice());
            let point =
                |a: &Vector3<f64>, b: &Vector3<f64>| Matrix3::from_diagonal_element(a.dot(b)) - a * b.transpose();
            let square = point(&c, &c);
            d.rot - (point(&c, &d.h) + point(&d.h, &c) - square * d.mass)
        };
        let slopes: [Matrix3<f64>; 10] = core::array::from_fn(slope);
        let along = |a: &Vector3<f64>, b: &Vector3<f64>| {
            SVector::<f64, 10>::from_fn(|k, _| (a.transpose() * slopes[k] * b)[(0, 0)])
        };
        let old_com = before.com()?;
        let old_ic = before.about_com();
        let quantity =
            |name: String, unit: &str, (start, value): (f64, f64), gradient: &SVector<f64, 10>| BodyQuantity {
                name,
                unit: unit.to_owned(),
                start,
                value,
                std: std(gradient),
                change_percent: percent(value, start),
            };
        let mut quantities = vec![quantity("mass".into(), "kg", (before.mass, m), &unit(0))];
        for (a, axis) in ["x", "y", "z"].iter().enumerate() {
            quantities.push(quantity(format!("com_{axis}"), "m", (old_com[a], c[a]), &com_gradient[a]));
        }
        for (a, b, name) in ENTRIES {
            let gradient = SVector::<f64, 10>::from_fn(|k, _| slopes[k][(a, b)]);
            let pair = (old_ic[(a, b)], ic[(a, b)]);
            quantities.push(quantity(format!("inertia_com_{name}"), "kg m^2", pair, &gradient));
        }
        let (moments, axes) = principal(&ic);
        let (old, _) = principal(&old_ic);
        let vectors: [Vector3<f64>; 3] = core::array::from_fn(|k| axes.column(k).into_owned());
        let moment_std: [Option<f64>; 3] = core::array::from_fn(|k| std(&along(&vectors[k], &vectors[k])));
        let turned = |k: usize| -> Option<f64> {
            let mut worst = 0.0f64;
            for l in (0..3).filter(|&l| l != k) {
                let apart = (moments[k] - moments[l]).abs();
                if apart <= moment_std[k]?.hypot(moment_std[l]?) {
                    return None;
                }
                worst = worst.max(std(&along(&vectors[k], &vectors[l]))? / apart);
            }
            Some(worst)
        };
        let axis = |k: usize| PrincipalAxis {
            moment_kgm2: moments[k],
            moment_std_kgm2: moment_std[k],
            change_percent: percent(moments[k], old[k]),
            axis: vectors[k].into(),
            axis_std_rad: turned(k),
        };
        Some(Self { name: name.to_owned(), quantities, principal: (0..3).map(axis).collect() })
    }
}

/// Principal moments, ascending, and their axes as columns of a rotation.
fn principal(i: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let e = i.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| e.eigenvalues[a].total_cmp(&e.eigenvalues[b]));
    let mut axes = Matrix3::from_columns(&order.map(|k| e.eigenvectors.column(k).into_owned()));
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    (order.map(|k| e.eigenvalues[k]), axes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ident::belief::{Unknown, analyse};
    use nalgebra::DMatrix;

    /// Differences of many perturbed bodies: every deviation is that of the quantity itself.
    #[test]
    fn deviations_are_those_of_the_quantities() {
        let i = Matrix3::new(15.0, 0.9, -1.3, 0.9, 11.0, 0.7, -1.3, 0.7, 23.0);
        let body = Inertia::from_com(33.0, &Vector3::new(0.2, -0.4, 0.7), &i);
        let decls = ParamDecl::inertial("hull", &body);
        let values = body.to_params();
        // Rows that determine all ten, correlated.
        let j = DMatrix::from_fn(40, 10, |r, k| 3e2 * ((0.37 * (k + 1) as f64) * r as f64 + 0.2 * k as f64).sin());
        let names = |d: &ParamDecl| Unknown { name: d.name.clone(), unit: d.unit.to_owned(), size: 1.0 };
        let unknowns: Vec<Unknown> = decls.iter().map(names).collect();
        let u = analyse(&j, &unknowns, 1e-9).unwrap();
        let selected: Vec<usize> = (0..10).collect();
        let start: Vec<f64> = values.iter().map(|v| 0.8 * v).collect();
        let all = BodyLine::all(&decls, (&start, &values), &selected, &u);
        let b = &all[0];
        assert_eq!((all.len(), b.quantities.len(), b.principal.len()), (1, 10, 3));
        let root = u.covariance.clone().cholesky().unwrap().l();
        let line = |p: &[f64]| {
            let moved = BodyLine::all(&decls, (&start, p), &selected, &u).remove(0);
            let q = moved.quantities.iter().map(|q| q.value);
            q.chain(moved.principal.iter().map(|a| a.moment_kgm2)).collect::<Vec<f64>>()
        };
        // The covariance of a function is the sum of its squared differences along the columns of the root.
        let h = 1e-3;
        let mut squares = vec![0.0; 13];
        for k in 0..10 {
            let side = |s: f64| line(&(0..10).map(|n| values[n] + s * h * root[(n, k)]).collect::<Vec<f64>>());
            for (sum, (a, b)) in squares.iter_mut().zip(side(1.0).iter().zip(side(-1.0))) {
                *sum += ((a - b) / (2.0 * h)).powi(2);
            }
        }
        let stds = b.quantities.iter().map(|q| q.std).chain(b.principal.iter().map(|a| a.moment_std_kgm2));
        for (k, (std, square)) in stds.zip(&squares).enumerate() {
            let std = std.unwrap();
            assert!((std - square.sqrt()).abs() < 1e-5 * std, "{k}: {std} {}", square.sqrt());
        }
        assert!((b.quantities[0].change_percent.unwrap() - 25.0).abs() < 1e-9);
        let v: Vec<Vector3<f64>> = b.principal.iter().map(|a| a.axis.into()).collect();
        assert!((v[0].cross(&v[1]) - v[2]).norm() < 1e-12 && b.principal.iter().all(|a| a.axis_std_rad.is_some()));
        assert!((i * v[0] - v[0] * b.principal[0].moment_kgm2).norm() < 1e-9);
        // A ball has no axes of its own.
        let ball =
            Inertia::from_com(5.0, &Vector3::new(0.1, 0.0, 0.0), &Matrix3::from_diagonal_element(2.0)).to_params();
        let round = BodyLine::all(&decls, (&start, &ball), &selected, &u).remove(0);
        assert!(round.principal.iter().all(|a| a.axis_std_rad.is_none()));
    }
}
