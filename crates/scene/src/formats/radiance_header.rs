//! What the header of a Radiance picture states: "Radiance file formats", Ward 2004, "Picture file format".

use std::{
    fs::File,
    io::{BufRead, BufReader, Read},
    path::Path,
};

use dioptric_pictures::is_xyze;
use exr::{meta::attribute::Chromaticities, prelude::Vec2};
use ndarray::Array2;

use super::{
    exr_colors::srgb_from,
    primaries::into_srgb,
    stated::{name_of, note_of, tells},
    unusable::unreadable,
};
use crate::SceneError;

/// A header longer than this is none.
const LIMIT_BYTES: u64 = 1 << 20;
/// Lines that say who made a picture when and how.
const HARMLESS: [&str; 9] = ["FORMAT", "SOFTWARE", "CAPDATE", "GMT", "OWNER", "LATLONG", "TIME", "COMMENT", "CREATED"];

/// What changes the numbers of a Radiance picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RadianceHeader {
    /// What red, green and blue were multiplied by: all exposures and corrections of color.
    factors: [f64; 3],
    chromaticities: Option<Chromaticities>,
    /// What is not used, or was done.
    notes: Vec<String>,
}

impl RadianceHeader {
    /// Reads the lines before the picture.
    ///
    /// # Errors
    /// When the file cannot be read, or a line that counts has no numbers.
    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        let file = File::open(path).map_err(|error| unreadable(path, error))?;
        let mut lines = BufReader::new(file.take(LIMIT_BYTES)).split(b'\n');
        let mut header = Self { factors: [1.0; 3], chromaticities: None, notes: vec![] };
        let is_xyze = is_xyze(path);
        if is_xyze {
            header.notes.push(format!("{}: its X, Y and Z become red, green and blue of sRGB", name_of(path)));
        }
        let mut unused = vec![];
        // The first says what kind of file it is.
        lines.next();
        for line in lines {
            let line = line.map_err(|error| unreadable(path, error))?;
            let line = String::from_utf8_lossy(&line).trim().to_owned();
            if line.is_empty() {
                break;
            }
            // Comments, and the commands that made the picture, some of which say how it is seen or was fitted to a display.
            let Some((key, value)) = line.split_once('=').filter(|(key, _)| !key.trim().contains([' ', '\t', '#']))
            else {
                let is_of_view = line.contains(" -v") || line.contains("pcond");
                unused.extend((is_of_view || tells(&line)).then(|| line.clone()));
                continue;
            };
            let numbers = |n: usize| -> Result<Vec<f64>, SceneError> {
                let found: Vec<f64> = value.split_whitespace().map_while(|word| word.parse().ok()).collect();
                let is_right = found.len() == n && found.iter().all(|v| v.is_finite());
                is_right
                    .then_some(found)
                    .ok_or_else(|| unreadable(path, format!("its {key} is '{}', expected {n} numbers", value.trim())))
            };
            match key.trim() {
                "EXPOSURE" => header.multiply([numbers(1)?[0]; 3], path, key)?,
                "COLORCORR" => {
                    let rgb = numbers(3)?;
                    if is_xyze && rgb.iter().any(|factor| *factor != rgb[0]) {
                        let reason =
                            format!("its {key} is of X, Y and Z, expected one of red, green and blue (ra_xyze -r)");
                        return Err(unreadable(path, reason));
                    }
                    header.multiply([rgb[0], rgb[1], rgb[2]], path, key)?;
                }
                "PRIMARIES" if !is_xyze => {
                    let xy: Vec<f32> = numbers(8)?.into_iter().map(|v| v as f32).collect();
                    let [red, green, blue, white] = [0, 1, 2, 3].map(|i| Vec2(xy[2 * i], xy[2 * i + 1]));
                    header.chromaticities = Some(Chromaticities { red, green, blue, white });
                }
                "PIXASPECT" if numbers(1)?[0] == 1.0 => {}
                "GAMMA" if numbers(1)?[0] == 1.0 => {}
                own if HARMLESS.contains(&own) => {}
                own => unused.push(own.to_owned()),
            }
        }
        header.notes.extend(note_of(path, "line", &unused));
        Ok(header)
    }

    fn multiply(&mut self, by: [f64; 3], path: &Path, key: &str) -> Result<(), SceneError> {
        for (factor, by) in self.factors.iter_mut().zip(by) {
            *factor *= by;
            if !(*factor > 0.0 && (*factor as f32).is_normal()) {
                return Err(unreadable(path, format!("its {key} leaves no light, expected a number above 0")));
            }
        }
        Ok(())
    }

    /// Makes the numbers of a picture linear light of sRGB's primaries, and returns what is to be said of it.
    ///
    /// # Errors
    /// When its primaries are none.
    pub(super) fn apply(mut self, path: &Path, planes: &mut [Array2<f32>; 3]) -> Result<Vec<String>, SceneError> {
        if self.factors != [1.0; 3] {
            for (plane, factor) in planes.iter_mut().zip(self.factors) {
                let by = (1.0 / factor) as f32;
                plane.mapv_inplace(|v| by * v);
            }
            let [r, g, b] = self.factors;
            let by = if r == g && g == b { format!("{r}") } else { format!("{r}, {g} and {b}") };
            self.notes
                .push(format!("{}: its numbers are divided by {by}, the exposures that it states", name_of(path)));
        }
        if let Some(own) = &self.chromaticities {
            let wrong = || unreadable(path, "its PRIMARIES are no three primaries and a white");
            into_srgb(planes, &srgb_from(own).ok_or_else(wrong)?);
            self.notes.push(format!("{}: its primaries become those of sRGB, its white D65", name_of(path)));
        }
        Ok(self.notes)
    }
}
