//! The light field of a camera: the irradiance behind its array taken apart, or the pictures of a raster of cameras.

use dioptric_backward::{FilmLine, MicroArray};
use dioptric_spectrum::Cancel;
use ndarray::Array2;

use super::{Irradiance, KeptCamera, part::Part, watch::Watch};
use crate::{
    ArrayFrame, FilmSpec, FocusSpec, LightField, LightFieldSpec, PipelineError, Progress, SceneSource, ViewGeometry,
    light_field::{ArrayFilm, Decoding, View, fitted},
};

impl KeptCamera {
    /// Returns the light field that the camera takes, its channels red, green and blue as an observer sees the irradiance,
    /// linear sRGB in lux.
    ///
    /// `n_views` are the views along each side of the pupil behind an array of small lenses or holes: as many as there are
    /// pixels across the image of the pupil if left out. A raster of cameras has its own number.
    ///
    /// # Errors
    /// When the camera has no `light_field`, its numbers do not go together, or as [`capture`](Self::capture).
    pub fn light_field(
        &self,
        n_views: Option<usize>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<LightField, PipelineError> {
        match &self.camera().light_field {
            Some(LightFieldSpec::Array(_)) => {
                let rendered =
                    |_: &mut Decoding<'_>| Ok(self.irradiance(progress, cancel)?.summary.seen.planes.to_vec());
                self.taken_apart(rendered, n_views, &Watch { progress, cancel })
            }
            Some(LightFieldSpec::Cameras { columns, rows, spacing_mm }) => {
                self.of_cameras((*rows, *columns), *spacing_mm, progress, cancel)
            }
            None => Err(no_light_field()),
        }
    }

    /// Returns the light field of an irradiance that was rendered with this camera's array.
    ///
    /// # Errors
    /// When the camera has no array, or its numbers and the irradiance do not go together.
    pub fn decoded(
        &self,
        irradiance: &Irradiance,
        n_views: Option<usize>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<LightField, PipelineError> {
        self.taken_apart(|_| Ok(irradiance.summary.seen.planes.to_vec()), n_views, &Watch { progress, cancel })
    }

    /// Returns the light field of a frame that was taken behind this camera's array; with a white picture, by the lattice that is found in it,
    /// which is returned too.
    ///
    /// # Errors
    /// When the camera has no array, its numbers and the frame do not go together, or the white picture does not show the array.
    pub fn decoded_frame(
        &self,
        frame: &ArrayFrame,
        n_views: Option<usize>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(LightField, MicroArray), PipelineError> {
        let mut array = self.micro_array()?;
        let planes = |decoding: &mut Decoding<'_>| {
            if let Some(white) = frame.white() {
                decoding.array = fitted(decoding, white)?;
            }
            array = decoding.array;
            Ok(frame.planes().to_vec())
        };
        let field = self.taken_apart(planes, n_views, &Watch { progress, cancel })?;
        Ok((field, array))
    }

    fn micro_array(&self) -> Result<MicroArray, PipelineError> {
        self.camera().light_field.as_ref().and_then(LightFieldSpec::micro_array).ok_or_else(no_array)
    }

    /// Takes the planes apart that `planes_of` returns, which may change how.
    fn taken_apart(
        &self,
        planes_of: impl FnOnce(&mut Decoding<'_>) -> Result<Vec<Array2<f32>>, PipelineError>,
        n_views: Option<usize>,
        watch: &Watch<'_>,
    ) -> Result<LightField, PipelineError> {
        let array = self.micro_array()?;
        let (lens, place) = self.lens_and_film(watch.progress, watch.cancel)?;
        let [right_mm, down_mm] = place.exit_pupil_axis_mm;
        let film = ArrayFilm {
            rows: place.rows,
            columns: place.columns,
            pitch_mm: 1e-3 * place.pitch_um,
            // The array stands where the focus puts the film, and the film behind it.
            array_distance_mm: place.film_distance_mm,
            exit_pupil_axis_mm: [right_mm, -down_mm],
        };
        let mut decoding = Decoding { array, lens: &lens.reference, film: &film, n_views };
        decoding.check()?;
        let planes = planes_of(&mut decoding)?;
        let inputs = self.irradiance_inputs()?;
        let render = self.chain(watch.progress, watch.cancel).world_render(&inputs)?;
        decoding.light_field(&planes, Some(&|lines: &[FilmLine]| render.depth_along(lines, watch.cancel)))
    }

    /// Takes the pictures of a raster of cameras.
    fn of_cameras(
        &self,
        (rows, columns): (usize, usize),
        spacing_mm: f64,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<LightField, PipelineError> {
        let SceneSource::World(_) = &self.camera().scene.source else {
            let reason = "it is no world, of which a raster of cameras could see more than one side".to_owned();
            return Err(PipelineError::Unsuitable { what: "scene", reason });
        };
        if self.camera().scene.mean_lux.is_some() {
            let reason = "would give each camera another light: expected none with a raster of cameras".to_owned();
            return Err(PipelineError::Unsuitable { what: "mean_lux", reason });
        }
        if self.camera().scene.points.is_some() {
            let reason = "lie in directions, which are others from each camera: expected none with a raster of cameras"
                .to_owned();
            return Err(PipelineError::Unsuitable { what: "points", reason });
        }
        // Where focus and film are those of the camera in the middle.
        let (lens, place) = self.lens_and_film(progress, cancel)?;
        let of = rows * columns;
        let views = (0..of).map(|number| {
            let right = (number % columns) as f64 - 0.5 * (columns as f64 - 1.0);
            let up = 0.5 * (rows as f64 - 1.0) - (number / columns) as f64;
            let aside = self.with(|camera| {
                camera.focus = FocusSpec::FilmMm(place.film_distance_mm);
                camera.film = FilmSpec::Pixels { columns: place.columns, rows: place.rows, pitch_um: place.pitch_um };
                if let SceneSource::World(spec) = &mut camera.scene.source {
                    spec.aside_mm.0 += spacing_mm * right;
                    spec.aside_mm.1 += spacing_mm * up;
                }
            });
            let part = Part { progress, number, of };
            let irradiance = aside.irradiance(&part, cancel)?;
            let planes: Vec<Array2<f32>> = irradiance.summary.seen.planes.to_vec();
            let depth_m = aside.world_render(&part, cancel)?.auxiliary(cancel)?.z_m;
            Ok(View { planes, weight: 1.0, depth_m: Some(depth_m) })
        });
        let views = views.collect::<Result<Vec<View>, PipelineError>>()?;
        let pitch_mm = 1e-3 * place.pitch_um;
        let geometry = ViewGeometry::cameras(&lens.reference, place.film_distance_mm, spacing_mm, pitch_mm);
        LightField::new((rows, columns), views, geometry)
    }
}

fn no_array() -> PipelineError {
    let reason = "the camera has no array before its film, expected 'light_field: Array((...))'".to_owned();
    PipelineError::Unsuitable { what: "light_field", reason }
}

fn no_light_field() -> PipelineError {
    let reason = "the camera has none, expected 'light_field: Array((...))' or 'light_field: Cameras(...)'".to_owned();
    PipelineError::Unsuitable { what: "light_field", reason }
}
