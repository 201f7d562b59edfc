//! Pictures blended between samples, as in the paper: for comparison with interpolated rays.

use glam::DVec2;
use ndarray::{Array2, s};

use crate::{ModelUse, PsfQuery, drawing::Drawn, rotational::RotationalBank};

impl RotationalBank {
    /// Returns the blend of the pictures of the samples about a point, of sum 1.
    ///
    /// Weights are linear in the tangent of the field, in metres and in nanometres, as the paper's are; pictures are
    /// laid centroid on centroid and turned with the field. A depth between a sample and infinity is that of the sample.
    pub(crate) fn blend(&self, query: PsfQuery, side: Option<usize>) -> Drawn {
        let settings = self.settings();
        let direction = query.field_tan.try_normalize().unwrap_or(DVec2::X);
        let fields = linear(self.field_tans(), query.field_tan.length(), |tan| tan);
        let depths = linear(&settings.dioptres, query.dioptres, |dioptres| 1.0 / dioptres);
        let colors = linear(&settings.wavelengths_nm, query.wavelength_nm, |nm| nm);
        let mut pictures = Vec::with_capacity(8);
        let mut model = ModelUse { wave_fraction: 0.0, fallback: None };
        let mut lambda_n_px = 0.0;
        for (field, field_weight) in fields {
            for (dioptres, depth_weight) in depths {
                for (wavelength_nm, color_weight) in colors {
                    let weight = field_weight * depth_weight * color_weight;
                    if weight == 0.0 {
                        continue;
                    }
                    let here = PsfQuery { field_tan: direction * field, dioptres, wavelength_nm, ..query };
                    let own = self.draw_rays(here, side);
                    model.wave_fraction += weight * own.model.wave_fraction;
                    model.fallback = model.fallback.or(own.model.fallback);
                    lambda_n_px += weight * own.lambda_n_px;
                    pictures.push((own.energies, weight));
                }
            }
        }
        Drawn { energies: blended(&pictures), lambda_n_px, model }
    }
}

/// Returns the two numbers of an ascending list about a place, each with its weight, linear in a measure of them; the
/// ends beyond the list.
fn linear(list: &[f64], at: f64, measure: impl Fn(f64) -> f64) -> [(f64, f64); 2] {
    let last = list.len() - 1;
    let at = at.clamp(list[0], list[last]);
    let above = list.partition_point(|v| *v < at).min(last);
    let below = above.saturating_sub(1);
    let [low, high, here] = [list[below], list[above], at].map(measure);
    let share = (here - low) / (high - low);
    // On a sample; from infinity the other one is nearer than any depth but itself.
    let share = match share.is_finite() {
        true => share,
        false if at == list[below] => 0.0,
        false => 1.0,
    };
    [(list[below], 1.0 - share), (list[above], share)]
}

/// Returns the sum of pictures of sum 1 with these weights, middle on middle, in a window that holds the largest.
fn blended(pictures: &[(Array2<f64>, f64)]) -> Array2<f64> {
    let side = pictures.iter().map(|(picture, _)| picture.nrows()).max().unwrap_or(1);
    let mut sum = Array2::zeros((side, side));
    for (picture, weight) in pictures {
        let (n, total) = (picture.nrows(), picture.sum());
        if total > 0.0 {
            let start = (side - n) / 2;
            sum.slice_mut(s![start..start + n, start..start + n]).scaled_add(weight / total, picture);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;

    use super::*;
    use crate::{BankSettings, Diffraction, Interpolation, LensImageModel};

    #[test]
    fn weights_are_linear_in_metres() {
        // Halfway between 2 m and 1 m, at 1/1.5 dioptres.
        let [(far, a), (near, b)] = linear(&[0.0, 0.5, 1.0], 1.0 / 1.5, |d| 1.0 / d);
        assert_eq!((far, near), (0.5, 1.0));
        assert!((a - 0.5).abs() < 1e-12 && (b - 0.5).abs() < 1e-12);
        // Any depth is nearer than infinity; infinity is itself.
        assert_eq!(linear(&[0.0, 0.5, 1.0], 0.1, |d| 1.0 / d), [(0.0, 0.0), (0.5, 1.0)]);
        assert_eq!(linear(&[0.0, 0.5, 1.0], 0.0, |d| 1.0 / d)[0], (0.0, 1.0));
        assert_eq!(linear(&[550.0], 600.0, |nm| nm), [(550.0, 1.0), (550.0, 0.0)]);
        assert_eq!(linear(&[1.0, 3.0], 2.5, |v| v), [(1.0, 0.25), (3.0, 0.75)]);
    }

    #[test]
    fn on_a_sample_a_blend_is_its_picture() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
        let rays = BankSettings::covering(film_distance_mm, 0.2, (0.0, 1.0), (450.0, 650.0), Diffraction::None);
        let images = BankSettings { interpolation: Interpolation::Images, ..rays.clone() };
        let [rays, images] = [rays, images].map(|settings| LensImageModel::build(&lens, &settings).unwrap());
        let at = |bank: &LensImageModel, tan: f64, d: f64, nm: f64| {
            bank.kernel(PsfQuery::new(DVec2::new(0.0, tan), d, nm, 5.0)).normalized()
        };
        let middle = rays.settings().fields.axes().0[4];
        for (tan, dioptres, nm) in [(0.0, 0.0, 450.0), (middle, 0.5, 650.0), (0.2, 1.0, 450.0)] {
            let (a, b) = (at(&rays, tan, dioptres, nm), at(&images, tan, dioptres, nm));
            assert_eq!(a.samples.dim(), b.samples.dim());
            // The kernels hold all but 1e-7, in single precision.
            assert!(a.samples.iter().zip(&b.samples).all(|(a, b)| (a - b).abs() < 1e-6), "{tan} {dioptres} {nm}");
        }
        let query = PsfQuery { field_tan: DVec2::new(0.07, 0.03), dioptres: 0.3, wavelength_nm: 500.0, pitch_um: 5.0 };
        assert!((images.picture(query, 301).unwrap().0.sum() - 1.0).abs() < 1e-9);
    }
}
