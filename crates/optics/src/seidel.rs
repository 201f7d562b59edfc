//! Third-order aberrations: the Seidel sums, surface by surface.

use std::ops::AddAssign;

use serde::Serialize;

use crate::{
    C_LINE_NM, D_LINE_NM, F_LINE_NM, Lens, MonoLens, OpticsError,
    trace::{Kind, Phase, Step},
};

/// The Seidel sums of a surface or of a whole lens, mm, in the sign convention of Welford.
///
/// S1 = −A² y Δ(u/n), and so on; C1 = A y Δ(δn/n), δn = n(short) − n(long). A positive S1 is undercorrected spherical
/// aberration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub struct SeidelSums {
    /// Spherical aberration.
    pub s1: f64,
    /// Coma.
    pub s2: f64,
    /// Astigmatism.
    pub s3: f64,
    /// Petzval curvature.
    pub s4: f64,
    /// Distortion.
    pub s5: f64,
    /// Axial color.
    pub c1: f64,
    /// Lateral color.
    pub c2: f64,
}

impl AddAssign for SeidelSums {
    fn add_assign(&mut self, other: Self) {
        self.s1 += other.s1;
        self.s2 += other.s2;
        self.s3 += other.s3;
        self.s4 += other.s4;
        self.s5 += other.s5;
        self.c1 += other.c1;
        self.c2 += other.c2;
    }
}

/// The Seidel sums of a lens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Seidel {
    /// Those of each surface, the stop included.
    pub per_surface: Vec<SeidelSums>,
    /// Their sum.
    pub total: SeidelSums,
    /// The Lagrange invariant n (u ȳ − ū y), mm.
    pub lagrange_mm: f64,
    /// How high the marginal and the chief ray meet each surface and, last, the paraxial image plane where there is one, mm.
    #[serde(skip)]
    pub heights_mm: Vec<[f64; 2]>,
}

/// For which rays and wavelengths Seidel sums are wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeidelSettings {
    /// The main wavelength, nm.
    pub wavelength_nm: f64,
    /// The two wavelengths between which color is counted, the shorter first, nm.
    pub colors_nm: [f64; 2],
    /// Distance of the object before the first vertex, mm; infinite for a far one.
    pub object_distance_mm: f64,
    /// Slope dy/dz of the chief ray before the lens. Where the entrance pupil is too far for a slope to say where the
    /// ray is, it is that of the line from the object point to the first vertex.
    pub chief_slope: f64,
}

impl SeidelSettings {
    /// Returns the usual settings: a far object, the d line, and color from F to C.
    pub fn far(chief_slope: f64) -> Self {
        let (wavelength_nm, colors_nm) = (D_LINE_NM, [F_LINE_NM, C_LINE_NM]);
        Self { wavelength_nm, colors_nm, object_distance_mm: f64::INFINITY, chief_slope }
    }

    /// Returns the chief ray on the first vertex plane.
    fn chief_ray(&self, lens: &MonoLens) -> Paraxial {
        let (pupil_z_mm, center_z_mm) = (lens.first_order().entrance_pupil_z_mm, lens.projection_center_z_mm());
        if pupil_z_mm == center_z_mm || self.object_distance_mm.is_infinite() {
            return Paraxial { y: -pupil_z_mm * self.chief_slope, u: self.chief_slope };
        }
        let object_mm = -self.chief_slope * (self.object_distance_mm + center_z_mm);
        let u = -object_mm / (self.object_distance_mm + pupil_z_mm);
        Paraxial { y: object_mm + self.object_distance_mm * u, u }
    }
}

/// A paraxial ray: its height and its slope.
#[derive(Clone, Copy)]
struct Paraxial {
    y: f64,
    u: f64,
}

impl Paraxial {
    fn refracted(self, step: &Step) -> Self {
        Self { u: (step.index_before * self.u - step.power() * self.y) / step.index_after, ..self }
    }

    fn moved(self, distance: f64) -> Self {
        Self { y: self.y + distance * self.u, ..self }
    }
}

impl Lens {
    /// Returns the Seidel sums of the lens for a full aperture.
    ///
    /// The marginal ray passes the edge of the paraxial entrance pupil, the chief ray its center. (Of a far object and a
    /// lens that is telecentric on its side, where such rays do not exist, the sums are infinite.) An ideal lens in
    /// the train adds nothing; a conic or asphere adds what its r⁴ term departs from the sphere, diffractive rings what their order
    /// does to the path (docs/mirrors.md), with the color of their power.
    ///
    /// # Errors
    /// When a glass is not known at one of the wavelengths, a surface is not one of revolution about the
    /// lens's axis, or it has a wavefront error by field; apertures may have any shape.
    pub fn seidel(&self, settings: &SeidelSettings) -> Result<Seidel, OpticsError> {
        if !self.has_third_order() {
            return Err(OpticsError::NotRotational {
                lens: self.name().to_owned(),
                task: "a sum of Seidel aberrations",
            });
        }
        let mono = self.at(settings.wavelength_nm)?;
        let [short, long] = [self.at(settings.colors_nm[0])?, self.at(settings.colors_nm[1])?];
        let index_before = mono.steps()[0].index_before;
        let ray = mono.marginal_ray(settings.object_distance_mm);
        let mut marginal = Paraxial { y: ray.height_mm, u: ray.reduced_slope / index_before };
        let mut chief = settings.chief_ray(&mono);
        let lagrange_mm = index_before * (marginal.u * chief.y - chief.u * marginal.y);

        let (mut per_surface, mut total, mut heights_mm) = (Vec::new(), SeidelSums::default(), Vec::new());
        let steps = mono.steps();
        for (i, step) in steps.iter().enumerate() {
            if i > 0 {
                let gap = step.vertex_z - steps[i - 1].vertex_z;
                (marginal, chief) = (marginal.moved(gap), chief.moved(gap));
            }
            heights_mm.push([marginal.y, chief.y]);
            let colors = [&short.steps()[i], &long.steps()[i]];
            let index_difference = difference(colors.map(|s| [s.index_before, s.index_after]));
            let [of_short, of_long] = colors.map(|s| s.phase.as_ref().map_or(0.0, Phase::power));
            let phase_power_difference = of_short - of_long;
            let at = AtSurface { step, marginal, chief, lagrange_mm, index_difference, phase_power_difference };
            let sums = at.sums();
            per_surface.push(sums);
            total += sums;
            (marginal, chief) = (marginal.refracted(step), chief.refracted(step));
        }
        let image_z_mm = mono.conjugate(settings.object_distance_mm).image_z_mm;
        if image_z_mm.is_finite() {
            heights_mm.push([marginal, chief].map(|ray| ray.moved(image_z_mm).y));
        }
        Ok(Seidel { per_surface, total, lagrange_mm, heights_mm })
    }
}

fn difference([short, long]: [[f64; 2]; 2]) -> [f64; 2] {
    [short[0] - long[0], short[1] - long[1]]
}

/// The rays that arrive at a surface.
struct AtSurface<'a> {
    step: &'a Step,
    marginal: Paraxial,
    chief: Paraxial,
    lagrange_mm: f64,
    /// Dispersion before and after.
    index_difference: [f64; 2],
    /// By how much the power of a phase at the shorter wavelength exceeds that at the longer one, 1/mm.
    phase_power_difference: f64,
}

impl AtSurface<'_> {
    fn sums(&self) -> SeidelSums {
        let (step, h) = (self.step, self.lagrange_mm);
        if let Some(phase) = &step.phase {
            return self.sums_with_phase(phase);
        }
        if matches!(step.kind, Kind::Window | Kind::ThinLens { .. }) {
            return SeidelSums::default();
        }
        // A mirror is a boundary to the opposite index.
        let (n0, c) = (step.index_before, step.vertex_curvature());
        let n1 = if step.is_mirror { -n0 } else { step.index_after };
        let (y, y_bar) = (self.marginal.y, self.chief.y);
        let a = n0 * (self.marginal.u + c * y);
        let a_bar = n0 * (self.chief.u + c * y_bar);
        let u_over_n = self.marginal.refracted(step).u / step.index_after - self.marginal.u / n0;
        let petzval = c * (1.0 / n1 - 1.0 / n0);
        // Free of the quotient of Ā and A, which fails where the marginal ray meets the surface head-on.
        let s5 = a_bar * (petzval * y_bar * (a_bar * y - h) - a_bar * a_bar * y * (1.0 / (n1 * n1) - 1.0 / (n0 * n0)));
        let color = self.index_difference[1] / step.index_after - self.index_difference[0] / n0;
        let bent = (step.fourth_order() - c.powi(3)) * (n1 - n0);
        SeidelSums {
            s1: -a * a * y * u_over_n + bent * y.powi(4),
            s2: -a * a_bar * y * u_over_n + bent * y.powi(3) * y_bar,
            s3: -a_bar * a_bar * y * u_over_n + bent * (y * y_bar).powi(2),
            s4: -h * h * petzval,
            s5: s5 + bent * y * y_bar.powi(3),
            c1: a * y * color,
            c2: a_bar * y * color,
        }
    }

    /// The sums where a phase is added: A = n (u + c y), on which the usual sums rest, is not the same before and after.
    ///
    /// The terms of fourth order of the path along paraxial rays (docs/mirrors.md, "Third order").
    fn sums_with_phase(&self, phase: &Phase) -> SeidelSums {
        let (step, c) = (self.step, self.step.vertex_curvature());
        let (y, y_bar) = (self.marginal.y, self.chief.y);
        // A mirror is a boundary to the opposite index, behind which slopes are opposite too.
        let sign = if step.is_mirror { -1.0 } else { 1.0 };
        let (marginal, chief) = (self.marginal.refracted(step), self.chief.refracted(step));
        let before = Side { n: step.index_before, u: self.marginal.u, u_bar: self.chief.u };
        let after = Side { n: sign * step.index_after, u: sign * marginal.u, u_bar: sign * chief.u };
        let step_of = |of: &dyn Fn(Side) -> f64| of(after) - of(before);
        let fourth = (after.n - before.n) * step.fourth_order() - 8.0 * phase.fourth_order_per_mm3();
        let [dn_before, dn_after] = self.index_difference;
        let color = |u_before: f64, u_after: f64, y: f64| {
            sign * dn_after * (u_after + c * y) - dn_before * (u_before + c * y) + self.phase_power_difference * y
        };
        SeidelSums {
            s1: fourth * y.powi(4) - y * step_of(&|Side { n, u, .. }| n * u * u * (u + 2.0 * c * y)),
            s2: fourth * y.powi(3) * y_bar
                - y * step_of(&|Side { n, u, u_bar }| n * u * (u * u_bar + c * (y * u_bar + y_bar * u))),
            s3: fourth * (y * y_bar).powi(2)
                - y * step_of(&|Side { n, u, u_bar }| n * u * u_bar * (u_bar + 2.0 * c * y_bar)),
            // The power of a phase has no Petzval curvature.
            s4: -self.lagrange_mm * self.lagrange_mm * c * step_of(&|Side { n, .. }| 1.0 / n),
            s5: fourth * y * y_bar.powi(3)
                - step_of(&|Side { n, u, u_bar }| {
                    n * u_bar * (y * u_bar * u_bar + c * y_bar * (y * u_bar + y_bar * u))
                }),
            c1: y * color(before.u, after.u, y),
            c2: y * color(before.u_bar, after.u_bar, y_bar),
        }
    }
}

/// A side of a surface: the index, and the slopes of the marginal and the chief ray.
#[derive(Clone, Copy)]
struct Side {
    n: f64,
    u: f64,
    u_bar: f64,
}

impl Step {
    /// Eight times the coefficient of r⁴ of the sag, 1/mm³: the cube of the curvature for a sphere.
    fn fourth_order(&self) -> f64 {
        let of = |conic: f64, a4: f64| (1.0 + conic) * self.curvature.powi(3) + 8.0 * a4;
        match &self.kind {
            Kind::Conic { conic } => of(*conic, 0.0),
            Kind::EvenAsphere { conic, coefficients, .. } => of(*conic, at_or_zero(coefficients, 0)),
            Kind::OddAsphere { conic, coefficients } => of(*conic, at_or_zero(coefficients, 3)),
            _ => self.vertex_curvature().powi(3),
        }
    }
}

fn at_or_zero(coefficients: &[f64], i: usize) -> f64 {
    coefficients.get(i).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Glass, Interface, Surface};

    #[test]
    fn thin_lens_of_glass_has_the_textbook_petzval_and_color() {
        // A thin equiconvex lens at the stop: S4 = H² φ/n, C1 = y² φ/V, C2 = 0.
        let side = |radius_mm: f64, medium_after: Glass| Interface {
            surface: Surface::sphere(radius_mm, 5.0),
            medium_after,
            thickness_after_mm: 0.0,
        };
        let glass = Glass::NdVd { nd: 1.5, vd: 50.0 };
        let lens = Lens::new("thin", "test", vec![side(100.0, glass), side(-100.0, Glass::Air)], 0).unwrap();
        let total = lens.seidel(&SeidelSettings::far(0.1)).unwrap().total;
        let power = 0.01;
        assert!((total.s4 - 0.25 * power / 1.5).abs() < 1e-12, "{total:?}");
        assert!((total.c1 - 25.0 * power / 50.0).abs() < 1e-9, "{total:?}");
        assert!(total.c2.abs() < 1e-15 && total.s5.abs() < 1e-15);
        // Astigmatism of a thin lens at the stop: S3 = H² φ.
        assert!((total.s3 - 0.25 * power).abs() < 1e-12);
    }

    #[test]
    fn telecentric_lens_has_the_sums_of_one_that_nearly_is() {
        // A stop in the rear focal plane of a singlet, and a hair before it.
        let lens = |stop_mm: f64| {
            let front = |radius_mm: f64, medium_after: Glass, thickness_after_mm: f64| Interface {
                surface: Surface::sphere(radius_mm, 12.0),
                medium_after,
                thickness_after_mm,
            };
            let stop = Interface { surface: Surface::plane(3.0), medium_after: Glass::Air, thickness_after_mm: 0.0 };
            let glass = Glass::NdVd { nd: 1.6, vd: 50.0 };
            let surfaces = vec![front(60.0, glass, 5.0), front(-60.0, Glass::Air, stop_mm), stop];
            Lens::new("telecentric", "test", surfaces, 2).unwrap()
        };
        let probe = lens(1.0);
        let bfl_mm = probe.at(D_LINE_NM).unwrap().film_distance_mm_for(f64::INFINITY).unwrap() + 1.0;
        let settings = SeidelSettings { object_distance_mm: 90.0, ..SeidelSettings::far(0.05) };
        let exact = lens(bfl_mm);
        assert!(exact.at(D_LINE_NM).unwrap().first_order().entrance_pupil_z_mm.is_infinite());
        let exact = exact.seidel(&settings).unwrap();
        let near = lens(bfl_mm * (1.0 - 1e-6)).seidel(&settings).unwrap();
        let pairs = |of: fn(&SeidelSums) -> f64| (of(&exact.total), of(&near.total));
        let sums: [fn(&SeidelSums) -> f64; 7] = [|s| s.s1, |s| s.s2, |s| s.s3, |s| s.s4, |s| s.s5, |s| s.c1, |s| s.c2];
        for (found, expected) in sums.map(pairs) {
            assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
        }
        // The chief ray runs parallel to the axis at the height of the object.
        assert!((exact.lagrange_mm.abs() - 0.05 * 90.0 * 3.0 / focal_length_mm(&probe)).abs() < 1e-9);
    }

    /// The focal length of the lens, which turns slopes before it into heights in its rear focal plane.
    fn focal_length_mm(lens: &Lens) -> f64 {
        lens.at(D_LINE_NM).unwrap().first_order().efl_mm
    }

    #[test]
    fn ellipsoid_has_no_spherical_aberration() {
        let surface = Surface { shape: crate::Shape::Conic { conic: -1.0 / 2.25 }, ..Surface::sphere(20.0, 5.0) };
        let medium_after = Glass::Constant { index: 1.5 };
        let interface = Interface { surface, medium_after, thickness_after_mm: 0.0 };
        let lens = Lens::new("ellipsoid", "test", vec![interface], 0).unwrap();
        assert!(lens.seidel(&SeidelSettings::far(0.0)).unwrap().total.s1.abs() < 1e-15);
    }
}
