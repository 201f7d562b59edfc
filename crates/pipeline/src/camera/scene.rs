//! What stands before the camera, as a camera file says it.

use std::{
    f64::consts::PI,
    path::{Path, PathBuf},
};

use dioptric_scene::{
    FileReading, FillDepth, Part, Pattern, ReadOptions, Scene, SceneLight, Target, TargetLight, View, read_scene,
};
use dioptric_spectrum::{Cancel, DepthMap, Illuminant, WavelengthGrid};
use serde::{Deserialize, Serialize};

use super::{check::Checker, world::WorldSpec};
use crate::{PipelineError, ranges::range_of, still_life::StillLife};

/// What stands before the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Where its radiance comes from.
    pub source: SceneSource,
    /// Horizontal field of view from edge to edge, degrees; for files that hold no camera data, for targets, and for the still
    /// life, whose own is 34.
    #[serde(default)]
    pub field_of_view_deg: Option<f64>,
    /// One depth for the whole scene, m; for files that hold no depth, and for targets.
    #[serde(default)]
    pub depth_m: Option<f64>,
    /// A flat scene by its size, in place of field of view and depth: slides, documents, wafers. For files, whose own camera data
    /// and depth it takes the place of, and for targets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flat: Option<FlatSize>,
    /// The depth of samples of a file where none was measured: code 0 of a depth picture (`Beside` if left out), 0 or NaN of
    /// channel `Z` (refused if left out).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fill_depth: Option<FillDepth>,
    /// A file of what lies behind the first surface of a file: radiance and depth of the same samples, depth 0 where that is not
    /// known. A layer `hidden` of the file itself does as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hidden: Option<PathBuf>,
    /// A table (`.csv`) of points that shine beside the samples: stars, LEDs, lamps. Each is drawn once, at its exact place, hidden by what lies before it.
    /// Columns: `x_deg`, `y_deg` (angles to the right and upwards) or `x_mm`, `y_mm` (on the film); `magnitude`, `lux`, `candela` or `w_per_sr`; and
    /// `depth_m` (infinite if left out), `light` (D65 if left out), `name`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<PathBuf>,
    /// The number that a perfect white has in a cube that does not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub white_level: Option<f64>,
    /// What else a file does not state itself: what its numbers are, and where depth and camera data are.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub reading: FileReading,
    /// The light that the scene is put under: it lights reflectances and targets (D65 if left out), and takes the place of
    /// the light on all others (their own if left out), where that is known.
    #[serde(default)]
    pub illuminant: Option<Illuminant>,
    /// Its illuminance, lux; for a picture, that of a white in it. Left out, 1000 for reflectances, targets and pictures, and
    /// its own for a scene that has one.
    #[serde(default)]
    pub illuminance_lux: Option<f64>,
    /// The light that is on a file of radiance, which does not state it itself: what white balance goes by, and what
    /// `illuminant` takes the place of.
    #[serde(default)]
    pub light: Option<Illuminant>,
    /// Scales the radiance to this mean luminance, cd/m²; nothing is scaled unless this is given.
    #[serde(default)]
    pub mean_luminance_cd_m2: Option<f64>,
    /// Scales the light of the scene so that the illuminance of what is simulated of the film is this on average, lux; of any scene,
    /// worlds too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_lux: Option<f64>,
}

/// Whether nothing is said of a file.
fn is_unsaid(reading: &FileReading) -> bool {
    *reading == FileReading::default()
}

/// The size and the place of a flat scene that faces the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FlatSize {
    /// Its width from edge to edge, mm.
    pub width_mm: f64,
    /// Its distance from the first vertex of the lens, mm.
    pub distance_mm: f64,
}

impl FlatSize {
    /// Returns the field of view (degrees) and the depth (m) of it, seen from the middle of an entrance pupil so far behind the first
    /// vertex.
    ///
    /// # Errors
    /// When the pupil is infinitely far away, or not behind the scene.
    pub(crate) fn seen_from(self, pupil_z_mm: f64) -> Result<(f64, f64), PipelineError> {
        let depth_mm = self.distance_mm + pupil_z_mm;
        if !(depth_mm.is_finite() && depth_mm > 0.0) {
            let reason = format!(
                "the lens has its entrance pupil {pupil_z_mm} mm behind its first vertex, expected one behind the scene, {} mm \
                 before it, and not at infinity",
                self.distance_mm
            );
            return Err(PipelineError::Unsuitable { what: "flat", reason });
        }
        let (fov_deg, depth_m) = (2.0 * (0.5 * self.width_mm / depth_mm).atan().to_degrees(), 1e-3 * depth_mm);
        for (key, found) in [("field_of_view_deg", fov_deg), ("depth_m", depth_m)] {
            let range = range_of(key).expect("the key has a range");
            if !range.holds(found) {
                let reason = format!(
                    "{} mm wide, {} mm away, it has a {key} of {found}, expected {range}",
                    self.width_mm, self.distance_mm
                );
                return Err(PipelineError::Unsuitable { what: "flat", reason });
            }
        }
        Ok((fov_deg, depth_m))
    }
}

/// Where a scene's radiance comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[expect(clippy::large_enum_variant, reason = "a camera has one")]
pub enum SceneSource {
    /// A spectral EXR, an ENVI header or its file of numbers, a MATLAB file, an array of `NumPy`, a stack of TIFF pages, a folder of band
    /// pictures, or an ordinary picture.
    File(PathBuf),
    /// The built-in still life, with objects at several depths.
    StillLife {
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// A flat target that faces the camera; needs a field of view and a depth.
    Target {
        /// What is drawn on it.
        pattern: Pattern,
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// A three-dimensional world, with lights of its own.
    World(WorldSpec),
}

/// The illuminance on what has none of its own, lux.
const USUAL_LUX: f64 = 1000.0;

impl SceneSpec {
    /// A file, with the defaults for all else.
    pub fn of_file(path: PathBuf) -> Self {
        Self {
            source: SceneSource::File(path),
            field_of_view_deg: None,
            depth_m: None,
            flat: None,
            fill_depth: None,
            hidden: None,
            points: None,
            white_level: None,
            reading: FileReading::default(),
            illuminant: None,
            illuminance_lux: None,
            light: None,
            mean_luminance_cd_m2: None,
            mean_lux: None,
        }
    }

    pub(crate) fn check(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if let Some(angle) = self.field_of_view_deg {
            checker.number("field_of_view_deg", angle)?;
        }
        if let Some(depth) = self.depth_m {
            checker.number("depth_m", depth)?;
        }
        if let Some(luminance) = self.mean_luminance_cd_m2 {
            checker.number("mean_luminance_cd_m2", luminance)?;
        }
        if let Some(lux) = self.mean_lux {
            checker.number("mean_lux", lux)?;
        }
        if self.mean_lux.is_some() && self.mean_luminance_cd_m2.is_some() {
            let found = "a level of the film beside one of the scene";
            checker.wrong("mean_lux", found, "one of mean_lux and mean_luminance_cd_m2: either sets the other")?;
        }
        if let Some(level) = self.white_level {
            checker.number("white_level", level)?;
        }
        if let Some(FillDepth::Metres(z_m)) = self.fill_depth.filter(|fill| fill.check().is_err()) {
            checker.wrong("fill_depth", &z_m.to_string(), "Beside, Far, or Metres above 0")?;
        }
        self.check_flat(checker)?;
        if let Err(error) = self.reading.check() {
            checker.refused("reading", &error)?;
        }
        if !is_unsaid(&self.reading) && !matches!(self.source, SceneSource::File(_)) {
            checker.refused(
                "reading",
                &"it says what a scene's file does not, but the scene is no file: expected one (--scene FILE)",
            )?;
        }
        if self.white_level.is_some() && !matches!(self.source, SceneSource::File(_)) {
            checker.wrong("white_level", "what is said of a file", "a source that is a file")?;
        }
        if self.fill_depth.is_some() && !matches!(self.source, SceneSource::File(_)) {
            checker.wrong(
                "fill_depth",
                "what is said of a file",
                "a source that is a file: others have all their depths",
            )?;
        }
        if self.depth_m.is_some() && matches!(self.source, SceneSource::StillLife { .. }) {
            checker.wrong("depth_m", "one depth", "none: the still life has depths of its own")?;
        }
        if self.hidden.is_some() && !matches!(self.source, SceneSource::File(_)) {
            checker.wrong("hidden", "a file", "a source that is a file as well")?;
        }
        if self.points.is_some() && matches!(&self.source, SceneSource::World(world) if world.backward().is_some()) {
            checker.wrong("points", "a table", "none where rays from the film make the picture: they meet no point")?;
        }
        if let Some(lux) = self.illuminance_lux {
            checker.number("illuminance_lux", lux)?;
        }
        for (key, light) in [("illuminant", &self.illuminant), ("light", &self.light)] {
            if let Some(Err(error)) = light.as_ref().map(Illuminant::check) {
                return checker.refused(key, &error);
            }
        }
        match self.source {
            SceneSource::File(_) => Ok(()),
            SceneSource::World(ref world) => {
                let others = [self.illuminance_lux, self.mean_luminance_cd_m2, self.depth_m];
                if self.illuminant.is_some() || others.iter().any(Option::is_some) {
                    let expected = "field_of_view_deg and light at most: a world has lights and depths of its own";
                    return checker.wrong("scene", "a world under another light or at another depth", expected);
                }
                world.check(checker)
            }
            SceneSource::StillLife { columns, rows } => check_size(checker, columns, rows),
            SceneSource::Target { columns, rows, .. } => {
                check_size(checker, columns, rows)?;
                let missing = |key| checker.wrong(key, "missing", "a number: a target has none of its own");
                match (self.field_of_view_deg, self.depth_m) {
                    _ if self.flat.is_some() => Ok(()),
                    (None, _) => missing("field_of_view_deg"),
                    (_, None) => missing("depth_m"),
                    _ => Ok(()),
                }
            }
        }
    }

    fn check_flat(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        let Some(FlatSize { width_mm, distance_mm }) = self.flat else { return Ok(()) };
        checker.number("width_mm", width_mm)?;
        checker.number("distance_mm", distance_mm)?;
        if distance_mm.is_infinite() {
            checker.wrong("distance_mm", "inf", "a finite number: a flat scene has a size")?;
        }
        if self.field_of_view_deg.is_some() || self.depth_m.is_some() {
            let found = "a size beside a field of view or a depth";
            checker.wrong("flat", found, "one or the other: they say the same")?;
        }
        match self.source {
            SceneSource::File(_) | SceneSource::Target { .. } => Ok(()),
            SceneSource::StillLife { .. } | SceneSource::World(_) => {
                checker.wrong("flat", "the size of what has depths of its own", "a file or a target for it")
            }
        }
    }

    /// Returns the scene as it is seen through a lens whose entrance pupil is so far behind its first vertex: a flat scene by its
    /// field of view and depth.
    ///
    /// # Errors
    /// When no picture of a flat scene can be seen from there.
    pub(crate) fn seen_from(mut self, pupil_z_mm: f64) -> Result<Self, PipelineError> {
        if let Some(flat) = self.flat {
            let (fov_deg, depth_m) = flat.seen_from(pupil_z_mm)?;
            (self.field_of_view_deg, self.depth_m) = (Some(fov_deg), Some(depth_m));
        }
        Ok(self)
    }

    /// Returns the scene on the bands wanted, or on its own. A flat scene by its size needs a lens, and is none here.
    ///
    /// # Errors
    /// When a file cannot be read, lacks what is needed or holds what cannot be.
    pub fn open(&self, wanted: Option<&WavelengthGrid>) -> Result<Scene, PipelineError> {
        self.open_with(wanted, None, |life, grid| life.scene(grid, None, &|_| {}, &Cancel::new()))
    }

    /// Returns the still life of this size as it is pictured.
    pub(crate) fn still_life(&self, columns: usize, rows: usize) -> StillLife {
        let usual = StillLife::new(columns, rows);
        StillLife { horizontal_fov_deg: self.field_of_view_deg.unwrap_or(usual.horizontal_fov_deg), ..usual }
    }

    /// As [`open`](Self::open), a picture no finer than asked for; where it is the still life, `paint` has or makes it.
    ///
    /// # Errors
    /// As [`open`](Self::open), and those of `paint`.
    pub(crate) fn open_with(
        &self,
        wanted: Option<&WavelengthGrid>,
        finest_tangent: Option<f64>,
        paint: impl FnOnce(&StillLife, &WavelengthGrid) -> Result<Scene, PipelineError>,
    ) -> Result<Scene, PipelineError> {
        if self.flat.is_some() && self.depth_m.is_none() {
            let reason =
                "a scene by its size is seen through a lens, expected a camera's, or a field of view and a depth";
            return Err(PipelineError::Unsuitable { what: "flat", reason: reason.to_owned() });
        }
        let light = self.illuminant.clone().unwrap_or(Illuminant::D65);
        let illuminance_lux = self.illuminance_lux.unwrap_or(USUAL_LUX);
        let mut scene = match &self.source {
            SceneSource::File(_) => {
                let scene = self.read_file(wanted, finest_tangent)?;
                self.lay_flat(scene)?
            }
            SceneSource::World(world) => {
                let reason = format!("{} is no picture but a world, expected to be rendered", world.file.display());
                return Err(PipelineError::Unsuitable { what: "scene", reason });
            }
            SceneSource::StillLife { columns, rows } => {
                paint(&self.still_life(*columns, *rows), &bands_or_own(wanted)?)?
            }
            SceneSource::Target { pattern, columns, rows } => Target {
                pattern: pattern.clone(),
                rows: *rows,
                columns: *columns,
                light: TargetLight::Illuminant(light),
                luminance_cd_m2: illuminance_lux / PI,
                dark: 0.02,
                // Small discs show in the spectrum of a texture how exactly their edges are drawn.
                supersampling: if matches!(pattern, Pattern::DeadLeaves { .. }) { 8 } else { 4 },
                horizontal_fov_deg: self.field_of_view_deg.unwrap_or(f64::NAN),
                distance_m: self.depth_m.unwrap_or(f64::NAN),
            }
            .scene(&bands_or_own(wanted)?)?,
        };
        self.light_up(&mut scene)?;
        scene.require_depth_and_view()?;
        Ok(scene)
    }

    /// Returns the scene of a file as it is, with or without depth and view.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn look(&self, wanted: Option<&WavelengthGrid>) -> Result<Scene, PipelineError> {
        self.look_at(wanted, None, false)
    }

    /// As [`look`](Self::look), of a part of its samples; of a cube beyond the memory means over blocks of them where a `summary` does.
    ///
    /// # Errors
    /// As [`look`](Self::look), and when the part reaches beyond the scene.
    pub fn look_at(
        &self,
        wanted: Option<&WavelengthGrid>,
        part: Option<Part>,
        summary: bool,
    ) -> Result<Scene, PipelineError> {
        // A layer behind is of all samples.
        let (early, late) = if self.hidden.is_none() { (part, None) } else { (None, part) };
        let options = ReadOptions { part: early, summary, ..self.options(wanted, None) };
        let scene = self.read_with(&options)?;
        let mut scene = match late {
            Some(part) => part.of(scene)?,
            None => scene,
        };
        self.light_up(&mut scene)?;
        Ok(scene)
    }

    /// Reads the scene of a file, a picture no finer than asked for.
    fn read_file(&self, wanted: Option<&WavelengthGrid>, finest_tangent: Option<f64>) -> Result<Scene, PipelineError> {
        self.read_with(&self.options(wanted, finest_tangent))
    }

    fn options(&self, wanted: Option<&WavelengthGrid>, finest_tangent: Option<f64>) -> ReadOptions {
        ReadOptions {
            grid: wanted.cloned(),
            light: self.illuminant.clone(),
            illuminance_lux: self.illuminance_lux,
            depth_m: self.depth_m,
            horizontal_fov_deg: self.field_of_view_deg,
            fill_depth: self.fill_depth,
            // Two files of the same samples are read as they are.
            finest_tangent: finest_tangent.filter(|_| self.hidden.is_none()),
            white_level: self.white_level,
            part: None,
            summary: false,
            hidden: self.hidden.clone(),
            reading: self.reading.clone(),
        }
    }

    fn read_with(&self, options: &ReadOptions) -> Result<Scene, PipelineError> {
        let SceneSource::File(path) = &self.source else {
            let reason = "expected the file of a scene".to_owned();
            return Err(PipelineError::Unsuitable { what: "scene", reason });
        };
        Ok(read_scene(path, options)?)
    }

    /// Returns a scene that is in no file, with what it leaves open taken from here, on the bands wanted.
    ///
    /// # Errors
    /// When it lacks what is needed, or holds what cannot be.
    pub(crate) fn finish(&self, mut scene: Scene, wanted: Option<&WavelengthGrid>) -> Result<Scene, PipelineError> {
        if let Some(depth_m) = self.depth_m {
            scene = scene.or_flat_depth_m(depth_m)?;
        }
        if let Some(fov_deg) = self.field_of_view_deg {
            scene = scene.or_horizontal_fov_deg(fov_deg)?;
        }
        scene = self.lay_flat(scene)?;
        if let Some(grid) = wanted.filter(|grid| *grid != scene.radiance.grid()) {
            scene = scene.resampled(grid)?;
        }
        scene.validate()?;
        self.light_up(&mut scene)?;
        scene.require_depth_and_view()?;
        Ok(scene)
    }

    /// Returns the scene with the depth and the view of a flat one in place of its own, where its size is given.
    fn lay_flat(&self, mut scene: Scene) -> Result<Scene, PipelineError> {
        if let (Some(_), Some(fov_deg), Some(depth_m)) = (self.flat, self.field_of_view_deg, self.depth_m) {
            let (rows, columns) = (scene.rows(), scene.columns());
            scene.view = Some(View::from_horizontal_fov_deg(fov_deg, columns, rows)?);
            let flat = DepthMap::flat(rows, columns, depth_m).map_err(dioptric_scene::SceneError::from)?;
            if scene.depth.as_ref().is_some_and(|own| *own != flat) {
                scene.notes.push(format!("{}: its depth is not used, since it is laid flat by its size", scene.name));
            }
            scene.depth = Some(flat);
        }
        Ok(scene)
    }

    /// Puts a scene under the light that is asked for, and checks that it is whole.
    fn light_up(&self, scene: &mut Scene) -> Result<(), PipelineError> {
        match (&scene.light, &self.light) {
            (None, Some(illuminant)) => {
                scene.light = Some(SceneLight { illuminant: illuminant.clone(), illuminance_lux: None });
            }
            (Some(_), Some(_)) => {
                scene.notes.push("its light is known: the light that is stated for it is not used".to_owned());
            }
            _ => {}
        }
        if self.illuminant.is_some() || self.illuminance_lux.is_some() {
            let before_cd_m2 = scene.mean_luminance_cd_m2();
            scene.relight(self.illuminant.as_ref(), self.illuminance_lux)?;
            let mean_cd_m2 = scene.mean_luminance_cd_m2();
            // What was read under that light already has its luminance in the line of what was understood.
            if (mean_cd_m2 / before_cd_m2 - 1.0).abs() > 1e-3 {
                scene.notes.push(format!("under the light that was asked for it has {mean_cd_m2:.4} cd/m² on average"));
            }
        }
        if let Some(wanted_cd_m2) = self.mean_luminance_cd_m2 {
            let factor = wanted_cd_m2 / scene.mean_luminance_cd_m2();
            scene.scale(factor)?;
            // The light on it is so many times as strong too.
            if let Some(lux) = scene.light.as_mut().and_then(|light| light.illuminance_lux.as_mut()) {
                *lux *= factor;
            }
            scene.notes.push(format!("its radiance is multiplied by {factor:.4e}, to {wanted_cd_m2} cd/m² on average"));
        }
        Ok(())
    }

    pub(crate) fn resolve_paths(&mut self, folder: &Path) {
        match &mut self.source {
            SceneSource::File(path) => *path = folder.join(&path),
            SceneSource::World(world) if !world.is_still_life() => world.file = folder.join(&world.file),
            SceneSource::World(_) => {}
            SceneSource::StillLife { .. } | SceneSource::Target { .. } => {}
        }
        for file in
            [&mut self.hidden, &mut self.points, &mut self.reading.depth, &mut self.reading.view].into_iter().flatten()
        {
            *file = folder.join(&file);
        }
    }
}

/// Returns the bands wanted, or those of what is computed: 400 nm to 700 nm in steps of 10 nm.
pub(crate) fn bands_or_own(wanted: Option<&WavelengthGrid>) -> Result<WavelengthGrid, PipelineError> {
    Ok(wanted.cloned().map_or_else(|| WavelengthGrid::uniform(400.0, 700.0, 10.0), Ok)?)
}

fn check_size(checker: &Checker<'_>, columns: usize, rows: usize) -> Result<(), PipelineError> {
    checker.count("columns", columns, 1..=65_536)?;
    checker.count("rows", rows, 1..=65_536)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use dioptric_scene::{ExrParts, write_spectral_exr};
    use dioptric_spectrum::{Quantity, SpectralImage};
    use ndarray::Array2;

    use super::*;

    /// A file of gray under 100 lx of D65, which does not say so.
    fn radiance_file(folder: &Path) -> PathBuf {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let white = Illuminant::D65.white_radiance(&grid, 100.0);
        let planes = white.iter().map(|&w| Array2::from_elem((4, 6), 0.18 * w as f32)).collect();
        let image = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
        let path = folder.join("room.exr");
        write_spectral_exr(&path, &image, &ExrParts::default()).unwrap();
        path
    }

    #[test]
    fn flat_scenes_are_seen_from_the_pupil() {
        let flat = FlatSize { width_mm: 20.0, distance_mm: 90.0 };
        // From 10 mm behind the first vertex 20 mm are 2 atan(.1) wide; a pupil before the lens sees less.
        let (fov_deg, depth_m) = flat.seen_from(10.0).unwrap();
        assert_relative_eq!(fov_deg, 2.0 * 0.1_f64.atan().to_degrees(), max_relative = 1e-12);
        assert_relative_eq!(depth_m, 0.1, max_relative = 1e-12);
        assert_relative_eq!(flat.seen_from(-40.0).unwrap().1, 0.05, max_relative = 1e-12);
        for pupil_z_mm in [-90.0, -200.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            let message = flat.seen_from(pupil_z_mm).unwrap_err().to_string();
            assert!(message.starts_with("flat: the lens has its entrance pupil"), "{message}");
        }
        let of_file = SceneSpec { flat: Some(flat), ..SceneSpec::of_file(PathBuf::from("wafer.exr")) };
        assert!(of_file.open(None).unwrap_err().to_string().contains("through a lens"));
    }

    #[test]
    fn what_is_said_of_files_is_refused_of_others() {
        let checker = Checker::of_settings("test");
        let life = SceneSource::StillLife { columns: 48, rows: 32 };
        let target = SceneSource::Target { pattern: Pattern::Uniform, columns: 32, rows: 32 };
        let of = |source: &SceneSource| SceneSpec { source: source.clone(), ..SceneSpec::of_file(PathBuf::new()) };
        assert!(of(&life).check(&checker).is_ok());
        let refused = |spec: SceneSpec| spec.check(&checker).unwrap_err().to_string();
        let message = refused(SceneSpec { depth_m: Some(5.0), ..of(&life) });
        assert!(message.contains("depth_m") && message.contains("depths of its own"), "{message}");
        let message = refused(of(&SceneSource::StillLife { columns: 0, rows: 32 }));
        assert!(message.contains("columns is 0, expected 1 to 65536"), "{message}");
        let seen = SceneSpec { field_of_view_deg: Some(14.0), depth_m: Some(2.0), ..of(&target) };
        assert!(seen.check(&checker).is_ok());
        for spec in [of(&life), seen] {
            let message = refused(SceneSpec { fill_depth: Some(FillDepth::Far), ..spec });
            assert!(message.contains("fill_depth") && message.contains("a file"), "{message}");
        }
    }

    #[test]
    fn only_scenes_of_known_light_are_relit() {
        let folder = tempfile::tempdir().unwrap();
        let of_file = SceneSpec::of_file(radiance_file(folder.path()));
        let bare = SceneSpec { depth_m: Some(2.0), field_of_view_deg: Some(20.0), ..of_file };
        // As it is, it is opened, and what light it is under is not known.
        assert!(bare.open(None).unwrap().light.is_none());
        for asked in [
            SceneSpec { illuminant: Some(Illuminant::A), ..bare.clone() },
            SceneSpec { illuminance_lux: Some(5.0), ..bare.clone() },
        ] {
            let message = asked.open(None).unwrap_err().to_string();
            assert!(message.contains("room.exr") && message.contains("not known"), "{message}");
        }
        // Once its light is stated, it is put under another: the same gray, of the same luminance.
        let stated = SceneSpec { light: Some(Illuminant::D65), illuminant: Some(Illuminant::A), ..bare.clone() };
        let relit = stated.open(None).unwrap();
        let white = Illuminant::A.white_radiance(relit.radiance.grid(), 100.0);
        for (found, white) in relit.radiance.spectrum_at(1, 2).iter().zip(white) {
            // Single precision.
            assert_relative_eq!(*found, 0.18 * white, max_relative = 1e-6);
        }
        assert_eq!(relit.light.unwrap().illuminant, Illuminant::A);
        // Its illuminance is still not known.
        assert!(SceneSpec { illuminance_lux: Some(5.0), ..stated }.open(None).is_err());
    }
}
