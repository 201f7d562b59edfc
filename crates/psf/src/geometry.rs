//! Where a rotationally symmetric lens puts the centroids of points, and how bright it makes them.

/// Image height and irradiance against field, for one depth and wavelength.
///
/// A field is the tangent of the angle at the entrance pupil; heights are in the picture frame, where a distant point
/// at tan θ lands at about + f tan θ.
#[derive(Clone, Debug, PartialEq)]
pub struct RadialGeometry {
    // Invariants: fields ascend from 0, and the heights with them; all lists are of one length.
    field_tans: Vec<f64>,
    /// Image height over field, mm, over the angle, in which it is smooth up to 90°.
    magnification_mm: EvenSpline,
    radii_mm: Vec<f64>,
    irradiance_per_radiance: Vec<f64>,
    /// Derivatives of these by the angle.
    irradiance_slopes: Vec<f64>,
}

impl RadialGeometry {
    /// Returns the geometry through `magnification_mm` (height over field; at field 0, its limit) and the pupil's
    /// `cos⁴`-weighted area, mm², at each field. Fields at which the height no longer grows are cut off.
    pub(crate) fn new(mut field_tans: Vec<f64>, mut magnification_mm: Vec<f64>, pupil_mm2: &[f64]) -> Self {
        let radii: Vec<f64> = field_tans.iter().zip(&magnification_mm).map(|(f, g)| f * g).collect();
        let n = 1 + radii.windows(2).take_while(|pair| pair[1].abs() > pair[0].abs()).count();
        field_tans.truncate(n);
        magnification_mm.truncate(n);
        let angles = field_tans.iter().map(|tan| tan.atan()).collect();
        let mut this = Self {
            field_tans,
            magnification_mm: EvenSpline::new(angles, magnification_mm),
            radii_mm: radii[..n].to_vec(),
            irradiance_per_radiance: vec![],
            irradiance_slopes: vec![],
        };
        this.irradiance_per_radiance = (0..n)
            .map(|i| {
                let (g, slope) = this.magnification_at(this.field_tans[i]);
                pupil_mm2[i] / (g * (g + this.field_tans[i] * slope)).abs()
            })
            .collect();
        this.irradiance_slopes = monotone_slopes(this.angles(), &this.irradiance_per_radiance);
        this
    }

    /// Returns the height of the centroid in the picture frame, mm, positive outwards. Beyond the traced field it goes
    /// on straight.
    pub fn image_radius_mm(&self, field_tan: f64) -> f64 {
        let last = self.last_field_tan();
        if field_tan > last {
            let (g, slope) = self.magnification_at(last);
            return last * g + (field_tan - last) * (g + last * slope);
        }
        field_tan * self.magnification_at(field_tan).0
    }

    /// Returns the field that lands at this height, or `None` beyond the traced field.
    pub fn field_tan(&self, image_radius_mm: f64) -> Option<f64> {
        let n = self.radii_mm.len();
        let target = image_radius_mm;
        let sign = if self.radii_mm[n - 1] < 0.0 { -1.0 } else { 1.0 };
        // Rounding must not lose the last field.
        if n < 2 || target * sign > self.radii_mm[n - 1] * sign * (1.0 + 1e-12) {
            return None;
        }
        let above = self.radii_mm.partition_point(|&r| r * sign < target * sign).clamp(1, n - 1);
        let (mut low, mut high) = (self.angles()[above - 1], self.angles()[above]);
        let (r_low, r_high) = (self.radii_mm[above - 1], self.radii_mm[above]);
        let mut angle = low + (high - low) * (target - r_low) / (r_high - r_low);
        // Newton's method in the angle, kept inside the bracket.
        for _ in 0..20 {
            let field = angle.tan();
            let (g, slope) = self.magnification_at(field);
            let error = field * g - target;
            if error.abs() <= 1e-13 * r_high.abs() {
                break;
            }
            if error * sign > 0.0 {
                high = angle;
            } else {
                low = angle;
            }
            let next = angle - error / ((g + field * slope) * (1.0 + field * field));
            angle = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        Some(angle.tan())
    }

    /// Returns irradiance on the film over radiance of a locally uniform scene, sr: the projected solid angle of the
    /// pupil times `|dA_object / dA_film|`. It holds vignetting and every cosine; losses in glass are not in it.
    pub fn irradiance_per_radiance(&self, field_tan: f64) -> f64 {
        let n = self.field_tans.len();
        if n == 1 {
            return self.irradiance_per_radiance[0];
        }
        let at = field_tan.clamp(0.0, self.last_field_tan());
        let above = self.field_tans.partition_point(|&f| f < at).clamp(1, n - 1);
        let width = self.angles()[above] - self.angles()[above - 1];
        let t = (at.atan() - self.angles()[above - 1]) / width;
        let (a, b) = (self.irradiance_per_radiance[above - 1], self.irradiance_per_radiance[above]);
        let (slope_a, slope_b) = (self.irradiance_slopes[above - 1] * width, self.irradiance_slopes[above] * width);
        // Hermite's cubic.
        let bend = slope_a + slope_b - 2.0 * (b - a);
        a + t * (slope_a + t * ((b - a) - slope_a - bend + t * bend))
    }

    /// The largest field that was traced.
    pub fn last_field_tan(&self) -> f64 {
        self.field_tans[self.field_tans.len() - 1]
    }

    /// The largest image height that was traced, mm.
    pub fn last_image_radius_mm(&self) -> f64 {
        self.radii_mm[self.radii_mm.len() - 1]
    }

    /// The angles of the fields.
    fn angles(&self) -> &[f64] {
        &self.magnification_mm.x
    }

    /// Returns height over field, mm, and its derivative by the field.
    fn magnification_at(&self, field_tan: f64) -> (f64, f64) {
        let (value, slope) = self.magnification_mm.value_and_slope(field_tan.atan());
        (value, slope / (1.0 + field_tan * field_tan))
    }
}

/// The cubic spline through values of an even function, from x = 0 on; its curvature is constant over the last interval.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EvenSpline {
    // Invariant: x ascends, and all lists are of one length, at least 1.
    x: Vec<f64>,
    y: Vec<f64>,
    /// Second derivatives at x.
    bends: Vec<f64>,
}

impl EvenSpline {
    pub(crate) fn new(x: Vec<f64>, y: Vec<f64>) -> Self {
        let bends = even_spline(&x, &y);
        Self { x, y, bends }
    }

    /// Returns the value and the slope at a place; beyond the last value the last cubic goes on.
    pub(crate) fn value_and_slope(&self, at: f64) -> (f64, f64) {
        let n = self.x.len();
        if n == 1 {
            return (self.y[0], 0.0);
        }
        let above = self.x.partition_point(|&x| x < at).clamp(1, n - 1);
        let (x0, x1) = (self.x[above - 1], self.x[above]);
        let (y0, y1) = (self.y[above - 1], self.y[above]);
        let (m0, m1) = (self.bends[above - 1], self.bends[above]);
        let h = x1 - x0;
        let (a, b) = ((x1 - at) / h, (at - x0) / h);
        let value = a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
        let slope = (y1 - y0) / h + ((1.0 - 3.0 * a * a) * m0 + (3.0 * b * b - 1.0) * m1) * h / 6.0;
        (value, slope)
    }
}

/// Returns slopes at the knots with which cubics between them never overshoot and join without a kink: 0 at the first, where the
/// function is even, and those of the parabola through a knot and its neighbors, no steeper than three times the less steep side of it
/// (Fritsch & Carlson 1980), so that the rim at which vignetting begins is rounded within its interval.
fn monotone_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let h = |i: usize| x[i + 1] - x[i];
    let rise = |i: usize| (y[i + 1] - y[i]) / h(i);
    let no_steeper = |slope: f64, least: f64| slope.clamp(-3.0 * least, 3.0 * least);
    let slope = |i: usize| {
        if i == 0 {
            return 0.0;
        }
        if i == n - 1 {
            // Of two knots those of a parabola that is flat at the first.
            let bend = if i > 1 { (rise(i - 1) - rise(i - 2)) / (h(i - 2) + h(i - 1)) } else { rise(0) / h(0) };
            let slope = rise(i - 1) + bend * h(i - 1);
            return if slope * rise(i - 1) > 0.0 { no_steeper(slope, rise(i - 1).abs()) } else { 0.0 };
        }
        let (below, above) = (rise(i - 1), rise(i));
        if below * above <= 0.0 {
            return 0.0;
        }
        let parabola = (below * h(i) + above * h(i - 1)) / (h(i - 1) + h(i));
        no_steeper(parabola, below.abs().min(above.abs()))
    };
    (0..n).map(slope).collect()
}

/// Returns the second derivatives at the knots of the cubic spline that is flat at the first, and whose curvature is
/// constant over the last interval.
fn even_spline(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    if n < 2 {
        return vec![0.0; n];
    }
    let (mut diagonal, mut right) = (vec![0.0; n], vec![0.0; n]);
    let mut above = vec![0.0; n];
    let h = |i: usize| x[i + 1] - x[i];
    let rise = |i: usize| (y[i + 1] - y[i]) / h(i);
    (diagonal[0], above[0], right[0]) = (h(0) / 3.0, h(0) / 6.0, rise(0));
    for i in 1..n {
        let below = if i < n - 1 { h(i - 1) / 6.0 } else { -1.0 };
        let factor = below / diagonal[i - 1];
        let (own, next, value) =
            if i < n - 1 { ((h(i - 1) + h(i)) / 3.0, h(i) / 6.0, rise(i) - rise(i - 1)) } else { (1.0, 0.0, 0.0) };
        diagonal[i] = own - factor * above[i - 1];
        above[i] = next;
        right[i] = value - factor * right[i - 1];
    }
    let mut bends = vec![0.0; n];
    for i in (0..n).rev() {
        let next = if i + 1 < n { bends[i + 1] } else { 0.0 };
        bends[i] = (right[i] - above[i] * next) / diagonal[i];
    }
    bends
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Height over field of a lens whose distortion is a parabola over the angle.
    fn magnification_mm(field_tan: f64) -> f64 {
        50.0 * (1.0 - 0.1 * field_tan.atan().powi(2))
    }

    fn barrel() -> RadialGeometry {
        let fields: Vec<f64> = (0..13).map(|i| f64::from(i) / 20.0).collect();
        let magnification = fields.iter().map(|f| magnification_mm(*f)).collect();
        RadialGeometry::new(fields, magnification, &[100.0; 13])
    }

    #[test]
    fn heights_follow_the_distortion_and_back() {
        let geometry = barrel();
        for field in [0.0, 0.01, 0.123, 0.3, 0.55, 0.6] {
            let expected = field * magnification_mm(field);
            // A cubic spline meets a parabola exactly but for its ends.
            assert!((geometry.image_radius_mm(field) - expected).abs() < 1e-9, "at {field}");
            assert!((geometry.field_tan(expected).unwrap() - field).abs() < 1e-9, "at {field}");
        }
        assert_eq!(geometry.field_tan(31.0), None);
        assert!(geometry.image_radius_mm(0.7) > geometry.image_radius_mm(0.6));
    }

    #[test]
    fn brightness_is_the_pupil_over_the_magnifications() {
        let geometry = barrel();
        assert!((geometry.irradiance_per_radiance(0.0) - 100.0 / 2500.0).abs() < 1e-9);
        let field = 0.4f64;
        let slope_mm = magnification_mm(field) - 50.0 * 0.2 * field * field.atan() / (1.0 + field * field);
        let expected = 100.0 / (magnification_mm(field) * slope_mm);
        assert!((geometry.irradiance_per_radiance(field) / expected - 1.0).abs() < 1e-6);
    }

    /// Of the fourth power of the cosine, smooth; of a pupil that a rim cuts from a field on, between what is known at its knots.
    #[test]
    fn brightness_has_no_kinks_and_no_overshoot() {
        let fields: Vec<f64> = (0..25).map(|i| (f64::from(i) * 0.02).tan()).collect();
        let magnification = vec![50.0; 25];
        let pupil: Vec<f64> = fields.iter().map(|f| 100.0 * f.atan().cos().powi(4)).collect();
        let cut: Vec<f64> = pupil
            .iter()
            .enumerate()
            .map(|(i, p)| if i > 12 { p * (1.0 - 0.05 * (i - 12) as f64) } else { *p })
            .collect();
        let smooth = RadialGeometry::new(fields.clone(), magnification.clone(), &pupil);
        for i in 0..480 {
            let angle = 0.001 * f64::from(i);
            let expected = 0.04 * angle.cos().powi(4);
            let found = smooth.irradiance_per_radiance(angle.tan());
            // Straight lines are off by 2e-4, these cubics by 2e-6, but for the last interval, whose end has one side.
            assert!((found / expected - 1.0).abs() < 1e-5, "{angle}: {}", found / expected - 1.0);
        }
        let vignetted = RadialGeometry::new(fields, magnification, &cut);
        let values: Vec<f64> =
            (0..4800).map(|i| vignetted.irradiance_per_radiance((1e-4 * f64::from(i)).tan())).collect();
        assert!(values.windows(2).all(|pair| pair[1] <= pair[0] + 1e-15));
        // Straight lines have a kink of .05 over .02 rad where the rim begins, 2.5e-4 over such a step; a cubic spreads it over 200 steps.
        let second = values.windows(3).map(|v| (v[2] - 2.0 * v[1] + v[0]).abs()).fold(0.0, f64::max) / 0.04;
        assert!(second < 5e-6, "{second}");
    }

    #[test]
    fn fields_that_fold_back_are_cut_off() {
        let fields: Vec<f64> = (0..11).map(f64::from).collect();
        let magnification = fields.iter().map(|f| 10.0 - f).collect();
        let geometry = RadialGeometry::new(fields, magnification, &[1.0; 11]);
        assert_eq!(geometry.last_field_tan(), 5.0);
        assert_eq!(geometry.field_tan(26.0), None);
    }
}
