//! What is at a place of the picture, and what the lens makes of a point that is seen there.

use dioptric_optics::glam::DVec2;
use dioptric_pipeline::display::SpectrumToRgb;
use dioptric_psf::{LensImage, Picture, PointImage};
use dioptric_spectrum::WavelengthGrid;
use ndarray::Array2;

use super::Product;

/// Pixels along the side of the drawn point spread.
const SIDE: usize = 65;
/// The share of the side that the blur takes.
const FILLED: f64 = 0.45;
/// Frequencies of the modulation, from 0 on.
const N_FREQUENCIES: usize = 60;

/// What is at a place of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Column and row of the pixel.
    pub pixel: [usize; 2],
    /// Angle from the axis at the entrance pupil, degrees; none where the lens sees nothing.
    pub field_deg: Option<f64>,
    /// Axial depth of what is seen there from the entrance pupil, m; none beside the scene.
    pub depth_m: Option<f64>,
    /// Irradiance by wavelength: nm and W m⁻² nm⁻¹.
    pub spectrum: Vec<(f64, f64)>,
    /// Electrons of the first frame, a filter each: one for a mosaic.
    pub electrons: Vec<f64>,
    /// Samples of the raw frame: digital numbers, or volts.
    pub samples: Vec<f64>,
    /// The filter of the pixel of a mosaic.
    pub filter: Option<String>,
    /// The picture's code, 0–255.
    pub rgb: [u8; 3],
}

/// The point spread function of what is seen at a place, all wavelengths together, and the modulation that it leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Linear sRGB of each pixel, 1 at the brightest: red, green and blue in turn, row by row from the top.
    pub rgb: Vec<[f32; 3]>,
    /// Pixels along the side.
    pub side: usize,
    /// Side of a pixel of the drawing, µm.
    pub pitch_um: f64,
    /// Frequencies, cycles/mm.
    pub frequencies_per_mm: Vec<f64>,
    /// Modulation of waves along the radius of the field.
    pub tangential: Vec<f64>,
    /// Modulation of waves across it.
    pub sagittal: Vec<f64>,
    /// Half the sampling frequency of the sensor's pixels, cycles/mm.
    pub nyquist_per_mm: f64,
    /// Root-mean-square radius, µm.
    pub rms_um: f64,
}

impl Product {
    /// Returns a place of the film, mm to the right and upwards in the picture, from shares of its width and height from the top left.
    fn place_mm(&self, share: [f64; 2]) -> DVec2 {
        let place = &self.capture.place;
        let (first, of) = match place.part {
            Some(part) => ([part.first_column, part.first_row], [part.of_columns, part.of_rows]),
            None => ([0, 0], [place.columns, place.rows]),
        };
        let right = first[0] as f64 + share[0] * place.columns as f64 - 0.5 * of[0] as f64;
        let down = first[1] as f64 + share[1] * place.rows as f64 - 0.5 * of[1] as f64;
        DVec2::new(right, -down) * place.pitch_um * 1e-3
    }

    /// Columns and rows of pixels of the whole film, of which the picture may show a part.
    pub fn film_size(&self) -> [usize; 2] {
        let place = &self.capture.place;
        let of = place.part.map_or([place.columns, place.rows], |part| [part.of_columns, part.of_rows]);
        of.map(|n| n * place.binning)
    }

    /// Half the diagonal of the whole film, mm.
    pub(crate) fn film_corner_mm(&self) -> f64 {
        let place = &self.capture.place;
        let [columns, rows] = self.film_size().map(|n| n as f64 / place.binning as f64);
        0.5e-3 * place.pitch_um * columns.hypot(rows)
    }

    /// Returns the field that is seen at a place of the film, tangents.
    fn field_tan(&self, place_mm: DVec2) -> Option<DVec2> {
        let reference_nm = self.model.settings().reference_wavelength_nm;
        let map = self.model.film_map(reference_nm, place_mm.length().max(self.film_corner_mm()));
        map.field_tan(place_mm).filter(|_| map.irradiance_sr(place_mm) > 0.0)
    }

    /// Returns the tangent of the field that is seen so far off the axis of the film.
    pub(crate) fn field_at_radius(&self, radius_mm: f64) -> Option<f64> {
        self.field_tan(DVec2::new(radius_mm, 0.0)).map(DVec2::length)
    }

    /// Returns the field and the depth in metres of what is seen at a place.
    fn seen(&self, share: [f64; 2]) -> Option<(DVec2, Option<f64>)> {
        let tan = self.field_tan(self.place_mm(share))?;
        Some((tan, self.depth_at(tan)))
    }

    /// Returns the depth of the scene in a field, m.
    fn depth_at(&self, tan: DVec2) -> Option<f64> {
        let view = self.view.as_ref()?;
        let column = view.center_x_px + view.focal_px * tan.x;
        let row = view.center_y_px - view.focal_px * tan.y;
        let z_m = self.depth.z_m();
        let is_inside = row > -0.5 && column > -0.5;
        let sample = z_m.get((row.round().max(0.0) as usize, column.round().max(0.0) as usize));
        sample.filter(|_| is_inside).map(|z_m| f64::from(*z_m))
    }

    /// Returns what is at a place, stated as shares of the picture's width and height from the top left; of the light that of the film there, which has
    /// more pixels than the picture where several are read as one.
    pub fn probe(&self, share: [f64; 2]) -> Option<Probe> {
        let [columns, rows] = self.size();
        let index = |share: f64, n: usize| {
            let index = (share * n as f64).floor();
            (index >= 0.0 && index < n as f64).then_some(index as usize)
        };
        let (column, row) = (index(share[0], columns)?, index(share[1], rows)?);
        let of = |plane: (usize, usize)| Some((index(share[1], plane.0)?, index(share[0], plane.1)?));
        let seen = self.seen(share);
        let capture = &self.capture;
        let grid = capture.grid();
        let irradiance = |band: usize| match capture.irradiance.cube() {
            Some(cube) => {
                let (_, rows, columns) = cube.dim();
                of((rows, columns)).map(|(row, column)| f64::from(cube[(band, row, column)]))
            }
            None => None,
        };
        let spectrum = (0..grid.len()).filter_map(|band| Some((grid.centers_nm()[band], irradiance(band)?))).collect();
        let exposed = &capture.frames.exposed;
        let electrons = exposed.electrons.planes_e.iter().filter_map(|plane| Some(plane[of(plane.dim())?]));
        let samples = exposed.raw.planes.iter().filter_map(|plane| plane.sample(row, column));
        let filter =
            exposed.raw.tile.as_ref().map(|tile| exposed.raw.filter_names[tile.filter_at(row, column)].clone());
        let first = 3 * (row * columns + column);
        Some(Probe {
            pixel: [column, row],
            field_deg: seen.map(|(tan, _)| tan.length().atan().to_degrees()),
            depth_m: seen.and_then(|(_, depth_m)| depth_m),
            spectrum,
            electrons: electrons.map(f64::from).collect(),
            samples: samples.collect(),
            filter,
            rgb: [self.rgb8[first], self.rgb8[first + 1], self.rgb8[first + 2]],
        })
    }

    /// Returns the distance before the first vertex that is in focus where what is seen at a place is, mm.
    pub fn focus_distance_mm(&self, share: [f64; 2]) -> Option<f64> {
        let (_, depth_m) = self.seen(share)?;
        let distance_mm = 1e3 * depth_m? - self.capture.lens.reference.projection_center_z_mm();
        (distance_mm.is_finite() && distance_mm > 0.0).then_some(distance_mm)
    }

    /// Returns the point spread function of what is seen at a place.
    pub fn spread(&self, share: [f64; 2]) -> Option<Spread> {
        let (tan, depth_m) = self.seen(share)?;
        let scene = &self.capture.scene;
        let dioptres = depth_m.map_or(0.5 * (1.0 / scene.far_m + 1.0 / scene.near_m), |depth_m| 1.0 / depth_m);
        let (first_nm, last_nm) = self.capture.grid().range_nm();
        let wavelengths_nm: Vec<f64> =
            (0..5).map(|i| first_nm + (last_nm - first_nm) * (f64::from(i) + 0.5) / 5.0).collect();
        let images: Vec<Option<PointImage>> =
            wavelengths_nm.iter().map(|&nm| self.model.point(tan, dioptres, nm)).collect();
        let widest_mm = images.iter().flatten().map(PointImage::spread_mm).fold(0.0, f64::max);
        // Where there is hardly any blur, Airy's disc fills the window.
        let airy_mm = 1.22e-6 * last_nm * self.capture.lens.reference.first_order().f_number.abs().clamp(1.0, 200.0);
        let pitch_um = 1e3 * (widest_mm + airy_mm) / (FILLED * SIDE as f64);
        let grid = WavelengthGrid::new(wavelengths_nm.clone()).ok()?;
        let to_rgb = SpectrumToRgb::with_white(&grid, &vec![1.0; grid.len()]);
        let middle_um = 1e3 * images[2].as_ref()?.centroid_mm();
        let mut rgb = vec![[0.0_f32; 3]; SIDE * SIDE];
        let mut energy = Array2::<f64>::zeros((SIDE, SIDE));
        for (band, image) in images.iter().enumerate() {
            let Some(image) = image else { continue };
            let (picture, _) = image.picture(pitch_um, SIDE);
            // Lateral color moves the wavelengths against each other.
            let moved = (1e3 * image.centroid_mm() - middle_um) / pitch_um;
            let moved = [moved.x.round() as isize, -moved.y.round() as isize];
            let weights = to_rgb.of_band(band);
            for ((row, column), &e) in picture.indexed_iter() {
                let place = (row.checked_add_signed(moved[1]), column.checked_add_signed(moved[0]));
                if let (Some(row @ 0..SIDE), Some(column @ 0..SIDE)) = place {
                    energy[(row, column)] += e;
                    let pixel = &mut rgb[row * SIDE + column];
                    (0..3).for_each(|channel| pixel[channel] += (e * weights[channel]) as f32);
                }
            }
        }
        let brightest = rgb.iter().flatten().copied().fold(f32::MIN_POSITIVE, f32::max);
        rgb.iter_mut().flatten().for_each(|value| *value /= brightest);
        let picture = Picture::new(energy.view(), pitch_um);
        let nyquist_per_mm = 500.0 / self.capture.place.pixel_pitch_um();
        // Up to where little is left, but no further than the drawing's own pixels can tell.
        let reach_per_mm = (600.0 / picture.rms_radius_um().max(1e-3)).min(250.0 / pitch_um);
        let along_rad = if tan.length() > 1e-9 { tan.y.atan2(tan.x) } else { std::f64::consts::FRAC_PI_2 };
        let frequencies_per_mm: Vec<f64> =
            (0..N_FREQUENCIES).map(|i| reach_per_mm * i as f64 / (N_FREQUENCIES - 1) as f64).collect();
        let modulation =
            |direction_rad: f64| frequencies_per_mm.iter().map(|&f| picture.mtf(direction_rad, f)).collect();
        Some(Spread {
            tangential: modulation(along_rad),
            sagittal: modulation(along_rad + std::f64::consts::FRAC_PI_2),
            rgb,
            side: SIDE,
            pitch_um,
            frequencies_per_mm,
            nyquist_per_mm,
            rms_um: picture.rms_radius_um(),
        })
    }
}

#[cfg(test)]
mod tests {
    use dioptric_pipeline::{Camera, FilmSpec, KeptCamera, SceneSource, Silent, WavelengthSpec};
    use dioptric_spectrum::Cancel;

    use super::*;
    use crate::engine::Rung;

    fn product() -> Product {
        let mut camera = Camera::demo().unwrap();
        camera.film = FilmSpec::Pixels { columns: 48, rows: 32, pitch_um: 660.0 };
        camera.scene.source = SceneSource::StillLife { columns: 108, rows: 72 };
        camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
        Product::make(&KeptCamera::new(camera.clone()), &camera, Rung::Full, &Silent, &Cancel::new()).unwrap()
    }

    #[test]
    fn a_probe_tells_what_the_stages_hold() {
        let product = product();
        let probe = product.probe([20.5 / 48.0, 10.5 / 32.0]).unwrap();
        assert_eq!(probe.pixel, [20, 10]);
        let electrons = &product.capture.frames.exposed.electrons.planes_e[0];
        assert_eq!(probe.electrons, [f64::from(electrons[(10, 20)])]);
        assert_eq!(probe.samples, [f64::from(product.capture.frames.exposed.raw.dn().unwrap()[(10, 20)])]);
        assert_eq!(probe.spectrum.len(), 3);
        assert_eq!(probe.rgb[1], product.rgb8[3 * (10 * 48 + 20) + 1]);
        assert!(product.probe([1.0, 0.5]).is_none() && product.probe([0.5, -0.01]).is_none());
    }

    #[test]
    fn the_corner_lies_at_the_field_of_the_lens() {
        let product = product();
        let middle = product.probe([0.5, 0.5]).unwrap();
        assert!(middle.field_deg.unwrap() < 1e-6);
        // 32 x 21 mm behind 50 mm: the corner is 19 mm off axis, a little more than 20 degrees.
        let corner = product.probe([0.999, 0.001]).unwrap();
        assert!((corner.field_deg.unwrap() - 20.2).abs() < 0.8, "{:?}", corner.field_deg);
        let (near_m, far_m) = product.depth.range_m();
        let depth_m = middle.depth_m.unwrap();
        assert!((near_m..=far_m).contains(&depth_m));
        // A click there focuses on it: the pupil lies in the lens, some centimetres behind its first vertex.
        let focus_mm = product.focus_distance_mm([0.5, 0.5]).unwrap();
        assert!((1e3 * depth_m - focus_mm - 25.0).abs() < 25.0, "{focus_mm} {depth_m}");
    }

    #[test]
    fn modulation_starts_at_one_and_falls() {
        let spread = product().spread([0.7, 0.4]).unwrap();
        for line in [&spread.tangential, &spread.sagittal] {
            assert!((line[0] - 1.0).abs() < 1e-9 && line[20] < 0.9, "{line:?}");
        }
        assert!(spread.rms_um > 0.0 && (spread.nyquist_per_mm - 500.0 / 660.0).abs() < 1e-9);
        assert!(spread.rgb.iter().flatten().all(|v| *v <= 1.0));
    }
}
