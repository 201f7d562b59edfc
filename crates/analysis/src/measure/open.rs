//! Pictures opened to be measured, in linear light.

use std::{fs::File, io::Read, path::Path};

use dioptric_scene::{PictureSamples, StatedColors, notes_on_samples, read_picture_samples};
use dioptric_sensor::{ColorSpace, DngFile, Picture, Raw, Tile, raw_format_by_name, raw_format_of};
use dioptric_spectrum::{Xyz, srgb_decode, srgb_encode};
use image::{ColorType, ImageDecoder, ImageReader};
use ndarray::{Array2, Array3};

use super::PixelRegion;
use dioptric_pipeline::PipelineError;

/// How a picture's samples stand for light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CodeCurve {
    /// Linear for 16-bit gray (raw frames) and floating-point samples, for everything else the curve that the file states, that of sRGB where it says
    /// nothing.
    #[default]
    ByFile,
    /// Linear.
    Linear,
    /// The curve of sRGB.
    Srgb,
}

/// A picture in linear light.
#[derive(Clone, Debug)]
pub struct MeasuredPicture {
    /// The file, or what a program calls it.
    pub name: String,
    /// Each channel with its name; the highest code of a file of whole numbers is 1, saturation of a raw file.
    pub planes: Vec<(String, Array2<f32>)>,
    /// The mosaic of the single plane of a raw file, and the names of its filters.
    pub mosaic: Option<(Tile, Vec<String>)>,
    /// What its red, green and blue are.
    primaries: Primaries,
    /// Whether it was read from a file.
    is_of_file: bool,
    /// What of its file is not used, a sentence each.
    pub notes: Vec<String>,
}

/// A channel's name, the plane that holds it, and which pixels are its own.
pub(crate) type FilterSamples<'a> = (String, &'a Array2<f32>, Box<dyn Fn((usize, usize)) -> bool + 'a>);

/// What red, green and blue of a picture are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Primaries {
    /// Those of sRGB.
    Srgb,
    /// Others: the matrix to linear sRGB.
    Stated([[f64; 3]; 3]),
    /// The filters of a camera.
    Filters,
}

/// Returns the raw frame of a file that is a DNG, whose first picture is but a preview; `None` for pictures.
///
/// # Errors
/// When it begins as a DNG does and cannot be read, or is a raw file of another kind.
pub(crate) fn read_dng(path: &Path) -> Result<Option<DngFile>, PipelineError> {
    const LONGEST_HEAD: u64 = 16;
    let wrong = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    let mut head = Vec::new();
    // Whoever reads the picture says what is wrong with it.
    let Ok(file) = File::open(path) else { return Ok(None) };
    if file.take(LONGEST_HEAD).read_to_end(&mut head).is_err() {
        return Ok(None);
    }
    let is_raw = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dng")) || raw_format_by_name(path).is_some();
    if head.is_empty() {
        return Err(wrong("is empty, expected a picture".to_owned()));
    }
    let is_tiff = [&b"II*\0"[..], b"MM\0*"].iter().any(|start| head.starts_with(start));
    if !is_tiff && !is_raw && raw_format_of(&head).is_none() {
        return Ok(None);
    }
    let is_dng =
        is_raw || std::fs::read(path).is_ok_and(|bytes| DngFile::is_dng(&bytes) || raw_format_of(&bytes).is_some());
    if is_dng { Ok(Some(DngFile::read(path)?)) } else { Ok(None) }
}

/// Returns the error of a picture that does not do: of a file that cannot be used, or of what a program holds.
fn unfit(name: &str, is_of_file: bool, reason: String) -> PipelineError {
    match is_of_file {
        true => PipelineError::Read { path: name.into(), reason },
        false => PipelineError::Unsuitable { what: "the picture", reason },
    }
}

/// Returns what of a picture's statements is used or not when it is measured, a sentence each: how it is turned, which colors it has, and what
/// nobody asks for. What cannot be read is refused when the picture is opened.
pub fn notes_on_picture(path: &Path, curve: CodeCurve) -> Vec<String> {
    notes_on_samples(path).into_iter().flatten().chain(notes_on_colors(path, curve)).collect()
}

/// Returns which colors of a picture's file are used when it is measured.
fn notes_on_colors(path: &Path, curve: CodeCurve) -> Vec<String> {
    let mut notes = vec![];
    let decoder = ImageReader::open(path).ok().and_then(|r| r.with_guessed_format().ok()?.into_decoder().ok());
    let kind = decoder.map(|decoder| decoder.color_type());
    // Gray floats are of no kind of picture's.
    let are_floats = matches!(kind, None | Some(ColorType::Rgb32F | ColorType::Rgba32F));
    if let Ok(Some(colors)) = if are_floats { StatedColors::of_floats(path) } else { StatedColors::of(path) } {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let used = match (kind, curve) {
            (Some(ColorType::L16 | ColorType::La16), CodeCurve::ByFile) => {
                "its 16-bit gray is taken as linear, not by what it states"
            }
            (Some(kind), CodeCurve::Linear | CodeCurve::Srgb) if !kind.has_color() => {
                "its codes become light as the command line says, not by what it states"
            }
            (_, CodeCurve::ByFile) if are_floats => "its numbers become light by what it states",
            (_, CodeCurve::ByFile) => "its codes become light by what it states",
            (_, CodeCurve::Linear | CodeCurve::Srgb) => {
                "its codes become light as the command line says, its primaries are those that it states"
            }
        };
        notes.push(format!("{name}: {used}, {}", colors.name));
    }
    notes
}

impl MeasuredPicture {
    /// Opens a PNG, JPEG, TIFF or EXR file, or the raw frame of a DNG: linear, and corrected as far as the file asks before demosaicing.
    ///
    /// Planes are those of the file's own primaries; [`rgb`](Self::rgb) and what follows from it are linear sRGB.
    ///
    /// # Errors
    /// When the file cannot be read, is empty, holds samples that are not finite, or colors that cannot be converted.
    pub fn open(path: &Path, curve: CodeCurve) -> Result<Self, PipelineError> {
        if let Some(DngFile { raw, notes, .. }) = read_dng(path)? {
            return Ok(Self { is_of_file: true, notes, ..Self::of_raw(path.display().to_string(), &raw) });
        }
        let mut notes = vec![];
        let samples = read_picture_samples(path)?.told_in(&mut notes);
        notes.extend(notes_on_colors(path, curve));
        Ok(Self { notes, ..Self::of_codes(path.display().to_string(), samples, curve, true)? })
    }

    /// Takes samples that a program holds: R, G and B, or one plane of gray.
    ///
    /// # Errors
    /// When there are none, one is not finite, or they have colors that cannot be converted.
    pub fn of_samples(name: &str, samples: PictureSamples, curve: CodeCurve) -> Result<Self, PipelineError> {
        Self::of_codes(name.to_owned(), samples, curve, false)
    }

    fn of_codes(
        name: String,
        PictureSamples { planes, top, colors }: PictureSamples,
        curve: CodeCurve,
        is_of_file: bool,
    ) -> Result<Self, PipelineError> {
        let wrong = |reason: String| unfit(&name, is_of_file, reason);
        if planes.first().is_none_or(|(_, plane)| plane.is_empty()) {
            return Err(wrong("it has no pixels".to_owned()));
        }
        if planes.iter().any(|(_, plane)| plane.iter().any(|v| !v.is_finite())) {
            return Err(wrong("a sample is not finite".to_owned()));
        }
        let is_coded = match curve {
            CodeCurve::Linear => false,
            CodeCurve::Srgb => true,
            CodeCurve::ByFile => top.is_some_and(|top| top == u16::from(u8::MAX) || planes.len() > 1),
        };
        // Whatever the curve, the primaries are the file's.
        let is_by_file = curve == CodeCurve::ByFile && (is_coded || top.is_none());
        let needs_colors = planes.len() > 1 || is_by_file;
        let colors = if needs_colors { colors.map_err(wrong)? } else { None };
        let scale = top.map_or(1.0, |top| 1.0 / f32::from(top));
        let own_curve = colors.as_ref().filter(|_| is_by_file);
        let light = |channel: usize, v: f32| match (is_coded, own_curve) {
            (false, Some(own)) => {
                let mut light = [v * scale];
                own.make_light(channel.min(2), &mut light);
                light[0]
            }
            (false, None) => v * scale,
            (true, None) => srgb_decode(f64::from(v * scale)) as f32,
            (true, Some(own)) => own.light(channel.min(2), (v * scale * f32::from(u16::MAX)).round() as u16) as f32,
        };
        let linear =
            |(channel, (name, plane)): (usize, (String, Array2<f32>))| (name, plane.mapv(|v| light(channel, v)));
        Ok(Self {
            is_of_file,
            notes: vec![],
            name,
            planes: planes.into_iter().enumerate().map(linear).collect(),
            mosaic: None,
            primaries: colors.as_ref().map_or(Primaries::Srgb, |colors| Primaries::Stated(colors.to_srgb)),
        })
    }

    /// Takes a raw frame that a program holds, in shares of saturation.
    pub fn of_raw(name: String, raw: &Raw) -> Self {
        let (planes, names) = (raw.linear(), raw.filter_names.clone());
        // One filter everywhere is no mosaic.
        let tile = raw.tile.clone().filter(|_| names.len() > 1);
        let named = if tile.is_some() { vec!["raw".to_owned()] } else { names.clone() };
        Self {
            is_of_file: false,
            notes: vec![],
            name,
            planes: named.into_iter().zip(planes).collect(),
            mosaic: tile.map(|tile| (tile, names)),
            primaries: Primaries::Filters,
        }
    }

    /// Refuses a mosaic, whose pixels are not all of one filter.
    ///
    /// # Errors
    /// When the picture is the frame of a raw file with a mosaic.
    pub(crate) fn require_whole(&self) -> Result<(), PipelineError> {
        if self.mosaic.is_none() {
            return Ok(());
        }
        let reason =
            "holds a mosaic, of whose pixels each has one filter, expected a picture: `dioptric develop` makes one";
        Err(self.unfit(reason.to_owned()))
    }

    /// Returns the error of a picture that does not do.
    pub(crate) fn unfit(&self, reason: String) -> PipelineError {
        unfit(&self.name, self.is_of_file, reason)
    }

    /// Takes planes of linear light of sRGB's primaries.
    #[cfg(test)]
    pub(crate) fn of_light(name: &str, planes: Vec<(&str, Array2<f32>)>) -> Self {
        Self {
            name: name.to_owned(),
            planes: planes.into_iter().map(|(name, plane)| (name.to_owned(), plane)).collect(),
            mosaic: None,
            primaries: Primaries::Srgb,
            is_of_file: true,
            notes: vec![],
        }
    }

    /// Returns each channel with the plane that holds it and which of its pixels are its own: of a mosaic those of one filter.
    pub(crate) fn filters(&self) -> Vec<FilterSamples<'_>> {
        match &self.mosaic {
            Some((tile, names)) => {
                let has = |filter: usize| (0..tile.rows()).any(|row| tile.row(row).contains(&filter));
                let of = |(filter, name): (usize, &String)| -> FilterSamples<'_> {
                    let is_own = move |(row, column): (usize, usize)| tile.filter_at(row, column) == filter;
                    (name.clone(), &self.planes[0].1, Box::new(is_own))
                };
                names.iter().enumerate().filter(|(filter, _)| has(*filter)).map(of).collect()
            }
            None => {
                let all = |(name, plane)| -> FilterSamples<'_> { (String::clone(name), plane, Box::new(|_| true)) };
                self.planes.iter().map(|(name, plane)| all((name, plane))).collect()
            }
        }
    }

    /// Returns the share of samples of a region at the ends of the codes: at 0 where none is below it, as of a raw frame less its black, and at 1
    /// where none is beyond it, as of light in a file of floats.
    pub(crate) fn clipped_share_of(&self, region: PixelRegion) -> f64 {
        let all = || self.planes.iter().flat_map(|(_, plane)| plane.iter());
        let ends = [(0.0, all().all(|v| *v >= 0.0)), (1.0, all().all(|v| *v <= 1.0))];
        let of_plane = |(_, plane): &(String, Array2<f32>)| {
            region.of(plane).iter().filter(|v| ends.iter().any(|(end, is_code)| *is_code && **v == *end)).count()
        };
        let n = region.rows * region.columns * self.planes.len();
        self.planes.iter().map(of_plane).sum::<usize>() as f64 / n as f64
    }

    /// Returns the same of the whole picture.
    pub(crate) fn clipped_share(&self) -> f64 {
        let (rows, columns) = self.size();
        self.clipped_share_of(PixelRegion { column: 0, row: 0, columns, rows })
    }

    /// What a sample is.
    pub(crate) fn unit(&self) -> &'static str {
        match self.primaries {
            Primaries::Filters => {
                "share of saturation, as the camera's filters see it: no color before `dioptric develop`"
            }
            Primaries::Srgb | Primaries::Stated(_) => "share of the highest code; of EXR files their own",
        }
    }

    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        self.planes[0].1.dim()
    }

    /// Returns the channel of a name.
    fn plane(&self, name: &str) -> Option<&Array2<f32>> {
        self.planes.iter().find(|(own, _)| own == name).map(|(_, plane)| plane)
    }

    /// Returns red, green and blue in linear light of sRGB's primaries, or one gray channel three times; rows × columns × 3.
    ///
    /// # Errors
    /// When the picture has other channels, or is the frame of a raw file, whose planes are what the camera's filters see.
    pub fn rgb(&self) -> Result<Array3<f32>, PipelineError> {
        self.require_whole()?;
        let planes = match (self.plane("R"), self.plane("G"), self.plane("B"), self.planes.as_slice()) {
            (Some(r), Some(g), Some(b), _) => [r, g, b],
            (_, _, _, [(_, gray)]) => [gray; 3],
            _ => {
                let names: Vec<&str> = self.planes.iter().map(|(name, _)| name.as_str()).collect();
                let reason = format!("its channels are {}, expected R, G and B or a single one", names.join(", "));
                return Err(self.unfit(reason));
            }
        };
        let (rows, columns) = self.size();
        match self.primaries {
            Primaries::Filters if self.planes.len() > 1 => {
                let reason = "holds what a camera's filters see, which is no color yet, expected a picture: \
                              `dioptric develop` makes one";
                Err(self.unfit(reason.to_owned()))
            }
            Primaries::Stated(matrix) if self.planes.len() > 1 => {
                let at = |(r, c, k): (usize, usize, usize)| {
                    matrix[k].iter().zip(planes).map(|(m, plane)| m * f64::from(plane[(r, c)])).sum::<f64>() as f32
                };
                Ok(Array3::from_shape_fn((rows, columns, 3), at))
            }
            _ => Ok(Array3::from_shape_fn((rows, columns, 3), |(r, c, k)| planes[k][(r, c)])),
        }
    }

    /// Returns the luminance where there are colors, else the mean of all channels.
    pub fn luminance(&self) -> Array2<f32> {
        if self.planes.len() > 1
            && let Ok(rgb) = self.rgb()
        {
            return Array2::from_shape_fn(self.size(), |(r, c)| {
                let light = [0, 1, 2].map(|k| f64::from(rgb[(r, c, k)]));
                Xyz::from_linear_srgb(light).luminance_cd_m2() as f32
            });
        }
        let mut sum = Array2::zeros(self.size());
        self.planes.iter().for_each(|(_, plane)| sum += plane);
        sum / self.planes.len() as f32
    }

    /// Returns the picture as sRGB codes of 0–1.
    ///
    /// # Errors
    /// As [`rgb`](Self::rgb).
    pub fn coded(&self) -> Result<Picture, PipelineError> {
        let codes = self.rgb()?.mapv(|v| srgb_encode(f64::from(v.clamp(0.0, 1.0))) as f32);
        Ok(Picture { codes, space: ColorSpace::Srgb })
    }
}
