//! A lens with rays through it, drawn as SVG.

use dioptric_optics::{Layout, Lens};

use dioptric_pipeline::PipelineError;

/// Rays of each fan.
const RAYS: usize = 9;
/// Width of the drawing, pixels.
const WIDTH_PX: f64 = 1100.0;

/// What is drawn with a lens.
#[derive(Clone, Debug, PartialEq)]
pub struct LensDrawing {
    /// Field angles at the entrance pupil, degrees; a fan of rays each.
    pub fields_deg: Vec<f64>,
    /// Distance of the object before the first vertex, mm; infinity for a far one.
    pub distance_mm: f64,
    /// Wavelengths of the rays, nm; focus and f-number are those of the first.
    pub wavelengths_nm: Vec<f64>,
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// What is written beside the film.
    pub film_label: String,
}

impl LensDrawing {
    /// Returns the drawing as an SVG document, to scale.
    ///
    /// # Errors
    /// When a field is wider than a drawing shows, or a glass is not known at the wavelength.
    pub fn to_svg(&self, lens: &Lens) -> Result<String, PipelineError> {
        let (widest, expected) = match self.distance_mm.is_finite() {
            true => (-89.9..=89.9, "angles below 89.9 degrees of an object at a finite distance"),
            false => (Layout::WIDEST_FIELDS_DEG, "angles of up to 120 degrees"),
        };
        if let Some(field) = self.fields_deg.iter().find(|field| !widest.contains(*field)) {
            return Err(PipelineError::Value {
                origin: "the drawing".to_owned(),
                key: "fields_deg",
                found: field.to_string(),
                expected: expected.to_owned(),
            });
        }
        Ok(lens.draw(&Layout {
            film_distance_mm: self.film_distance_mm,
            film_label: self.film_label.clone(),
            object_distance_mm: self.distance_mm,
            fields_deg: self.fields_deg.clone(),
            wavelengths_nm: self.wavelengths_nm.clone(),
            n_rays: RAYS,
            width_px: WIDTH_PX,
        })?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing() -> LensDrawing {
        LensDrawing {
            fields_deg: vec![0.0, 14.0],
            distance_mm: 2000.0,
            wavelengths_nm: vec![550.0],
            film_distance_mm: 55.0,
            film_label: "film".to_owned(),
        }
    }

    #[test]
    fn a_lens_is_drawn() {
        let svg = drawing().to_svg(&Lens::built_in("dgauss-50mm").unwrap()).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("dgauss-50mm") && !svg.contains("NaN"));
    }

    #[test]
    fn a_field_beyond_the_horizon_is_refused() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        for wrong in [121.0, f64::NAN] {
            assert!(
                LensDrawing { fields_deg: vec![wrong], distance_mm: f64::INFINITY, ..drawing() }.to_svg(&lens).is_err()
            );
        }
    }
}
