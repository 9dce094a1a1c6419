//! Orientations of MJCF as unit quaternions, scalar first.

use nalgebra::{Matrix3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};

/// What `<compiler>` says about angles.
#[derive(Clone, Debug)]
pub(super) struct Angles {
    /// Radians per unit of the file.
    pub(super) unit: f64,
    /// Order of Euler angles: `xyz` turned with the frame, capital letters about fixed axes.
    pub(super) sequence: [char; 3],
}

/// A rotation in the notation of the attribute that gave it; `None` where the numbers are no rotation.
pub(super) fn rotation(notation: &str, x: &[f64], angles: &Angles) -> Option<UnitQuaternion<f64>> {
    // The square of a huge component is infinite.
    turned(notation, x, angles).filter(|r| r.coords.iter().all(|c| c.is_finite()))
}

fn turned(notation: &str, x: &[f64], angles: &Angles) -> Option<UnitQuaternion<f64>> {
    let vector = |k: usize| Vector3::new(x[k], x[k + 1], x[k + 2]);
    match notation {
        "quat" => UnitQuaternion::try_new(Quaternion::new(x[0], x[1], x[2], x[3]), 1e-9),
        "axisangle" => Some(UnitQuaternion::from_axis_angle(&Unit::try_new(vector(0), 1e-9)?, x[3] * angles.unit)),
        "euler" => Some(angles.sequence.iter().zip(x).fold(UnitQuaternion::identity(), |r, (axis, angle)| {
            let about = match axis.to_ascii_lowercase() {
                'x' => Vector3::x_axis(),
                'y' => Vector3::y_axis(),
                _ => Vector3::z_axis(),
            };
            let turn = UnitQuaternion::from_axis_angle(&about, angle * angles.unit);
            if axis.is_ascii_lowercase() { r * turn } else { turn * r }
        })),
        "xyaxes" => {
            let a = Unit::try_new(vector(0), 1e-9)?.into_inner();
            let b = Unit::try_new(vector(3) - a * a.dot(&vector(3)), 1e-9)?.into_inner();
            let axes = Matrix3::from_columns(&[a, b, a.cross(&b)]);
            Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
        }
        "zaxis" => along(&vector(0)),
        _ => None,
    }
}

/// The smallest rotation that takes z to a direction.
pub(super) fn along(direction: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let z = Unit::try_new(*direction, 1e-9)?;
    let opposite = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Some(UnitQuaternion::rotation_between(&Vector3::z(), &z).unwrap_or_else(opposite))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn all_notations_of_a_rotation_are_the_same() {
        let degrees = Angles { unit: std::f64::consts::PI / 180.0, sequence: ['x', 'y', 'z'] };
        let want = rotation("euler", &[20.0, -35.0, 70.0], &degrees).unwrap();
        // Turning about fixed axes in the opposite order is the same.
        let fixed = Angles { sequence: ['Z', 'Y', 'X'], ..degrees.clone() };
        let same = rotation("euler", &[70.0, -35.0, 20.0], &fixed).unwrap();
        assert_relative_eq!(same, want, epsilon = 1e-15);
        let q = want.quaternion();
        let twice = [2.0 * q.w, 2.0 * q.i, 2.0 * q.j, 2.0 * q.k];
        assert_relative_eq!(rotation("quat", &twice, &degrees).unwrap(), want, epsilon = 1e-15);
        let (axis, angle) = want.axis_angle().unwrap();
        let given = [axis.x * 3.0, axis.y * 3.0, axis.z * 3.0, angle.to_degrees()];
        assert_relative_eq!(rotation("axisangle", &given, &degrees).unwrap(), want, epsilon = 1e-14);
        let (x, y): (Vector3<f64>, Vector3<f64>) = (want * Vector3::x(), want * Vector3::new(0.3, 1.0, 0.0));
        let given = [x.x, x.y, x.z, y.x, y.y, y.z];
        assert_relative_eq!(rotation("xyaxes", &given, &degrees).unwrap(), want, epsilon = 1e-14);
        for d in [Vector3::new(0.2, -0.5, 0.7), Vector3::new(0.0, 0.0, -2.0)] {
            let r = rotation("zaxis", d.as_slice(), &degrees).unwrap();
            assert_relative_eq!(r * Vector3::z(), d.normalize(), epsilon = 1e-15);
        }
        assert!(rotation("quat", &[0.0; 4], &degrees).is_none());
    }
}
