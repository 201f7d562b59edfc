//! The distortion of lenses, as calibrations have it.

/// Where a lens pictures directions, as tangents to the right and downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Distortion {
    /// That of `OpenCV`: k1, k2, p1, p2, k3, k4, k5, k6; and what nerfstudio calls k4, which goes with r⁸.
    Polynomial { k: [f64; 8], r8: f64 },
    /// A fisheye by angles θ from the axis, `θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)` (Kannala & Brandt 2006, as `OpenCV` has it).
    Fisheye([f64; 4]),
}

impl Default for Distortion {
    fn default() -> Self {
        Self::Polynomial { k: [0.0; 8], r8: 0.0 }
    }
}

impl Distortion {
    /// Returns that of a list of coefficients of a model, which may be shorter.
    ///
    /// # Errors
    /// When the model has fewer.
    pub(super) fn of_list(list: &[f64], is_fisheye: bool) -> Result<Self, String> {
        // OpenCV has no lists of so many: three are k1, k2 and k3 elsewhere.
        if !is_fisheye && [3, 6, 7].contains(&list.len()) && list[2..].iter().any(|v| *v != 0.0) {
            let n = list.len();
            return Err(format!(
                "which {n} coefficients its distortion has is not known: expected 2, 4, 5 or 8 (k1, k2, p1, p2, k3 to k6), or their names"
            ));
        }
        fn of<const N: usize>(list: &[f64]) -> Result<[f64; N], String> {
            if list.iter().skip(N).any(|v| *v != 0.0) {
                return Err(format!("its distortion has more than {N} coefficients"));
            }
            let mut k = [0.0; N];
            k.iter_mut().zip(list).for_each(|(k, v)| *k = *v);
            Ok(k)
        }
        Ok(if is_fisheye { Self::Fisheye(of(list)?) } else { Self::Polynomial { k: of(list)?, r8: 0.0 } })
    }

    pub(super) fn is_finite(&self) -> bool {
        match self {
            Self::Polynomial { k, r8 } => k.iter().all(|v| v.is_finite()) && r8.is_finite(),
            Self::Fisheye(k) => k.iter().all(|v| v.is_finite()),
        }
    }

    /// Returns the tangents at which a direction is pictured.
    pub(super) fn apply(self, (x, y): (f64, f64)) -> (f64, f64) {
        match self {
            Self::Polynomial { k: [k1, k2, p1, p2, k3, k4, k5, k6], r8 } => {
                let r2 = x * x + y * y;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * r8)));
                let radial = above / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
                (
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                )
            }
            Self::Fisheye([k1, k2, k3, k4]) => {
                let r = x.hypot(y);
                let angle = r.atan();
                let a2 = angle * angle;
                let pictured = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
                let radial = if r > 0.0 { pictured / r } else { 1.0 };
                (x * radial, y * radial)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    #[test]
    fn fisheyes_picture_angles() {
        // An ideal one pictures 60 degrees at an angle's radians from the axis.
        let (x, y) = Distortion::Fisheye([0.0; 4]).apply((0.0, 60.0_f64.to_radians().tan()));
        assert_abs_diff_eq!(x, 0.0);
        assert_abs_diff_eq!(y, 60.0_f64.to_radians(), epsilon = 1e-12);
        let (x, _) = Distortion::Fisheye([0.1, 0.0, 0.0, 0.01]).apply((1.0, 0.0));
        let angle = 45.0_f64.to_radians();
        assert_abs_diff_eq!(x, angle + 0.1 * angle.powi(3) + 0.01 * angle.powi(9), epsilon = 1e-12);
        assert_eq!(Distortion::Fisheye([0.1; 4]).apply((0.0, 0.0)), (0.0, 0.0));
        assert!(Distortion::of_list(&[0.1; 5], true).is_err());
        assert!([3, 6, 7].iter().all(|n| Distortion::of_list(&vec![0.1; *n], false).is_err()));
        assert!(Distortion::of_list(&[0.1, 0.2, 0.0], false).is_ok());
    }
}
