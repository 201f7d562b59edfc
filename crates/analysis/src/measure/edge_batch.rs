//! The slanted edges of several pictures, a row each.

use std::path::{Path, PathBuf};

use dioptric_pipeline::PipelineError;
use serde::Serialize;

use super::{CodeCurve, EdgeMeasurement, EdgeRequest, MeasuredPicture, Measurement, edge};
use crate::{Corner, LineChart, Scale, Series, palette};

/// The extensions of the pictures that are looked for in a folder.
const PICTURES: [&str; 9] = ["png", "tif", "tiff", "jpg", "jpeg", "exr", "dng", "webp", "bmp"];

/// Pictures whose edges are measured one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeBatchRequest {
    /// How each is measured.
    pub edge: EdgeRequest,
    /// How samples stand for light.
    pub curve: CodeCurve,
}

/// The edges of several pictures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeBatch {
    /// The measurements, in the order of the pictures.
    pub pictures: Vec<EdgeMeasurement>,
    /// Pictures that cannot be measured, with the reason.
    pub not_measured: Vec<UnmeasuredPicture>,
    /// What of the pictures' statements is used or not, a sentence each.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// A picture whose edge cannot be measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnmeasuredPicture {
    /// The file.
    pub picture: String,
    /// Why.
    pub reason: String,
}

impl EdgeBatchRequest {
    /// Returns the files that are named, and in place of a folder the pictures in it, by name.
    ///
    /// # Errors
    /// When a folder cannot be read, or holds no picture.
    pub fn pictures_of(paths: &[PathBuf]) -> Result<Vec<PathBuf>, PipelineError> {
        let mut all = Vec::new();
        for path in paths {
            if path.is_dir() {
                all.extend(pictures_in(path)?);
            } else {
                all.push(path.clone());
            }
        }
        Ok(all)
    }

    /// Measures the edge of each picture. One that cannot be measured does not stop the others.
    ///
    /// # Errors
    /// When none can be measured.
    pub fn measure(&self, pictures: &[PathBuf]) -> Result<EdgeBatch, PipelineError> {
        let mut batch = EdgeBatch { pictures: Vec::new(), not_measured: Vec::new(), notes: Vec::new() };
        for path in pictures {
            let measured = MeasuredPicture::open(path, self.curve).and_then(|picture| {
                batch.notes.extend(picture.notes.iter().cloned());
                self.edge.measure(&picture)
            });
            match measured {
                Ok(measured) => batch.pictures.push(measured),
                Err(error) => {
                    let (picture, reason) = (path.display().to_string(), edge::reason_of(&error));
                    batch.not_measured.push(UnmeasuredPicture { picture, reason });
                }
            }
        }
        match (batch.pictures.is_empty(), batch.not_measured.first()) {
            (true, Some(first)) => {
                let reason =
                    format!("{} (none of the {} pictures can be measured)", first.reason, batch.not_measured.len());
                Err(PipelineError::Read { path: PathBuf::from(&first.picture), reason })
            }
            _ => Ok(batch),
        }
    }
}

/// Returns the pictures in a folder, by name.
fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, PipelineError> {
    let wrong = |reason: String| PipelineError::Read { path: folder.to_owned(), reason };
    let entries = std::fs::read_dir(folder).map_err(|e| wrong(e.to_string()))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let is_picture = |path: &PathBuf| {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        path.is_file() && extension.is_some_and(|extension| PICTURES.contains(&extension.as_str()))
    };
    let mut pictures: Vec<PathBuf> = paths.map_err(|e| wrong(e.to_string()))?.into_iter().filter(is_picture).collect();
    if pictures.is_empty() {
        return Err(wrong(format!("holds no picture, expected some of {}", PICTURES.join(", "))));
    }
    pictures.sort();
    Ok(pictures)
}

impl Measurement for EdgeBatch {
    /// The response of the last channel of each picture, which is the luminance where there are colors.
    fn charts(&self) -> Vec<(String, LineChart)> {
        let series: Vec<Series> = self
            .pictures
            .iter()
            .filter_map(|measured| Some((measured, measured.channels.last()?)))
            .enumerate()
            .map(|(i, (measured, channel))| Series {
                label: Some(
                    Path::new(&measured.picture)
                        .file_name()
                        .map_or_else(|| measured.picture.clone(), |name| name.to_string_lossy().into_owned()),
                ),
                color: palette::line(i),
                is_dashed: false,
                ..edge::response_series(&channel.channel, &channel.frequencies_cycles_per_pixel, &channel.response)
            })
            .collect();
        let highest = series.iter().flat_map(|series| &series.points).map(|point| point.1).fold(1.0, f64::max);
        let chart = LineChart {
            title: "Spatial frequency response of each picture".to_owned(),
            x_label: "cycles a pixel".to_owned(),
            y_label: "response".to_owned(),
            x_range: (0.0, 1.0),
            y_range: (0.0, (10.0 * highest).ceil() / 10.0),
            series,
            legend: Corner::TopRight,
            scale: Scale::Linear,
        };
        vec![("mtf".to_owned(), chart)]
    }

    /// A row a picture and channel, and one for each picture that cannot be measured, with the reason in its last column.
    fn csv(&self) -> Option<String> {
        let mut text = "picture,channel,column,row,columns,rows,slant_deg,mtf50_cycles_per_pixel,mtf50_error_cycles_per_pixel,\
                        mtf50p_cycles_per_pixel,mtf50_cycles_per_mm,mtf50p_cycles_per_mm,response_at_nyquist,aliasing_share,acutance,\
                        offset_px,offset_error_px,reason\n"
            .to_owned();
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let or_empty = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v}"));
        for measured in &self.pictures {
            let place = measured.region;
            for channel in &measured.channels {
                let numbers = [
                    channel.mtf50_cycles_per_pixel,
                    channel.mtf50_error_cycles_per_pixel,
                    channel.mtf50p_cycles_per_pixel,
                    channel.mtf50_cycles_per_mm,
                    channel.mtf50p_cycles_per_mm,
                    channel.response_at_nyquist,
                    channel.aliasing_share,
                    channel.acutance,
                    channel.offset_px,
                    channel.offset_error_px,
                ]
                .map(or_empty);
                text += &format!(
                    "{},{},{},{},{},{},{},{},\n",
                    quoted(&measured.picture),
                    quoted(&channel.channel),
                    place.column,
                    place.row,
                    place.columns,
                    place.rows,
                    measured.slant_deg,
                    numbers.join(",")
                );
            }
            for channel in &measured.not_measured {
                let (picture, name, reason) = (&measured.picture, &channel.channel, &channel.reason);
                text += &format!("{},{}{}{}\n", quoted(picture), quoted(name), ",".repeat(16), quoted(reason));
            }
        }
        for picture in &self.not_measured {
            text += &format!("{}{}{}\n", quoted(&picture.picture), ",".repeat(17), quoted(&picture.reason));
        }
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::measure::PixelRegion;

    /// Writes a gray picture of an edge blurred so much, 16 bits.
    fn write_edge(path: &Path, blur_px: f64) {
        let light = Array2::from_shape_fn((96, 96), |(row, column)| {
            let distance = column as f64 - 47.5 - 0.1 * (row as f64 - 47.5);
            10_000.0 + 40_000.0 / (1.0 + (-1.7 * distance / blur_px).exp())
        });
        let codes: Vec<u16> = light.iter().map(|v| *v as u16).collect();
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(96, 96, codes).unwrap();
        image.save(path).unwrap();
    }

    #[test]
    fn pictures_of_a_folder_are_measured_and_one_that_fails_stops_no_other() {
        let folder = tempfile::tempdir().unwrap();
        write_edge(&folder.path().join("b-soft.png"), 1.6);
        write_edge(&folder.path().join("a-sharp.png"), 0.8);
        std::fs::write(folder.path().join("c-broken.png"), b"no picture").unwrap();
        std::fs::write(folder.path().join("notes.txt"), b"of no matter").unwrap();
        let pictures = EdgeBatchRequest::pictures_of(&[folder.path().to_owned()]).unwrap();
        let names: Vec<_> = pictures.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["a-sharp.png", "b-soft.png", "c-broken.png"]);
        let request = EdgeBatchRequest { edge: EdgeRequest::default(), curve: CodeCurve::ByFile };
        let batch = request.measure(&pictures).unwrap();
        let mtf50 = |i: usize| batch.pictures[i].channels[0].mtf50_cycles_per_pixel.unwrap();
        // One of twice the blur has half the frequency.
        assert!((mtf50(0) / mtf50(1) - 2.0).abs() < 0.03, "{} {}", mtf50(0), mtf50(1));
        assert_eq!(batch.not_measured.len(), 1);
        assert!(batch.not_measured[0].picture.ends_with("c-broken.png"));
        let alone = request.edge.measure(&MeasuredPicture::open(&pictures[0], CodeCurve::ByFile).unwrap()).unwrap();
        assert_eq!(batch.pictures[0], alone);
        let csv = batch.csv().unwrap();
        let rows: Vec<&str> = csv.lines().collect();
        let n_columns = |row: &str| row.split(',').count();
        assert_eq!((rows.len(), n_columns(rows[0]), n_columns(rows[1])), (4, 18, 18), "{csv}");
        assert!(rows[3].contains("c-broken.png"), "{csv}");
        let none = request.measure(&pictures[2..]).unwrap_err().to_string();
        assert!(none.contains("c-broken.png") && none.contains("none of the 1"), "{none}");
        let empty = tempfile::tempdir().unwrap();
        let message = EdgeBatchRequest::pictures_of(&[empty.path().to_owned()]).unwrap_err().to_string();
        assert!(message.contains("holds no picture"), "{message}");
    }

    #[test]
    fn edges_of_colors_lie_as_far_apart_as_they_do() {
        // Red lies a third of a pixel to the right of green, blue a quarter up; one frame of colors, one mosaic.
        let moved = [[1.0 / 3.0, 0.0], [0.0, 0.0], [0.0, -0.25]];
        let (slope, normal) = (0.1_f64, 1.0 / 1.01_f64.sqrt());
        let light = |row: usize, column: usize, [right, down]: [f64; 2]| {
            let distance = (column as f64 - right - 79.5 - slope * (row as f64 - down - 79.5)) * normal;
            (0.1 + 0.8 / (1.0 + (-1.7 * distance / 1.1).exp())) as f32
        };
        let plane = |moved: [f64; 2]| Array2::from_shape_fn((160, 160), |(row, column)| light(row, column, moved));
        let expected = moved.map(|[right, down]| normal * (right - slope * down));
        let named = ["R", "G", "B"].into_iter().zip(moved).map(|(name, moved)| (name, plane(moved))).collect();
        let colors = MeasuredPicture::of_light("colors", named);
        let bayer = |row: usize, column: usize| [[0, 1], [1, 2]][row % 2][column % 2];
        let mosaic = Array2::from_shape_fn((160, 160), |(row, column)| light(row, column, moved[bayer(row, column)]));
        let raw = MeasuredPicture::of_light("raw", vec![("raw", mosaic)]);
        let region = Some(PixelRegion { row: 31, column: 29, rows: 97, columns: 101 });
        let request = EdgeRequest { region, ..EdgeRequest::default() };
        let of_raw = EdgeRequest { mosaic: Some("RGGB".to_owned()), ..request.clone() };
        for (measured, bar_px) in [(request.measure(&colors), 0.002), (of_raw.measure(&raw), 0.01)] {
            let measured = measured.unwrap();
            for (name, expected) in ["R", "G", "B"].into_iter().zip(expected) {
                let channel = measured.channels.iter().find(|channel| channel.channel == name).unwrap();
                assert!(
                    (channel.offset_px.unwrap() - expected).abs() < bar_px,
                    "{name}: {:?} {expected}",
                    channel.offset_px
                );
            }
        }
    }
}
