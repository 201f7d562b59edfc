//! Tables of reflectances (`.csv`) as charts: a patch a column, in rows from the top left.

use std::path::Path;

use dioptric_files::text;
use ndarray::Array2;

use super::{
    column_names::is_no_reflectance,
    contents::Cube,
    reading::FileQuantity,
    stated::{name_of, note_of, short},
    unusable::{check_made, unreadable},
    wavelength_unit::{comments_of, wavelengths_of_column},
};
use crate::SceneError;

/// Samples along the side of a patch.
const PATCH_PX: usize = 32;
/// Names of patches that a note holds.
const MOST_NAMES: usize = 24;

/// Reads a table: wavelengths in nm in the first column, a reflectance in each other; names of columns in its first line.
///
/// # Errors
/// Names the line that is no list of numbers, or is longer or shorter than the first.
pub(super) fn read_chart(path: &Path) -> Result<Cube, SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let text = text::read(path).map_err(|error| unreadable(path, error))?;
    let text = text::with_commas(&text);
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let (mut names, mut wavelengths_nm, mut lines): (Vec<String>, Vec<f64>, Vec<Vec<f32>>) = (vec![], vec![], vec![]);
    let mut first = String::new();
    for (index, record) in reader.records().enumerate() {
        let record = record.map_err(|error| wrong(format!("line {}: {error}", index + 1)))?;
        let line = record.position().map_or(index as u64 + 1, csv::Position::line);
        let numbers: Result<Vec<f64>, _> = record.iter().map(str::parse::<f64>).collect();
        let Ok(numbers) = numbers else {
            if index == 0 {
                names = record.iter().map(str::to_owned).collect();
                first = if names.is_empty() { String::new() } else { names.remove(0) };
                continue;
            }
            let text = record.iter().collect::<Vec<_>>().join(",");
            return Err(wrong(format!("line {line}: '{}', expected a wavelength and reflectances", short(&text))));
        };
        let n = lines.first().map_or(names.len().max(numbers.len().saturating_sub(1)), Vec::len);
        if numbers.len() != n + 1 || n == 0 {
            return Err(wrong(format!(
                "line {line}: {} numbers, expected a wavelength and {} reflectances",
                numbers.len(),
                n.max(1)
            )));
        }
        wavelengths_nm.push(numbers[0]);
        lines.push(numbers[1..].iter().map(|v| *v as f32).collect());
    }
    let n = lines.first().map_or(0, Vec::len);
    if n == 0 {
        return Err(wrong(
            "it has no line of numbers: expected wavelengths in nm and a reflectance a column".to_owned(),
        ));
    }
    if let Some(other) = names.iter().find(|name| is_no_reflectance(name)) {
        return Err(wrong(format!("its column '{}' says that it holds no reflectances, expected such", short(other))));
    }
    let wavelengths_nm = wavelengths_of_column(&first, &wavelengths_nm, comments_of(&text)).map_err(wrong)?;
    let mut notes = vec![];
    let is_percent = |name: &&String| name.contains('%') || name.to_lowercase().contains("percent");
    if names.iter().chain([&first]).any(|name| is_percent(&name)) {
        lines.iter_mut().flatten().for_each(|value| *value /= 100.0);
        notes.push(format!("{}: its reflectances are in percent", name_of(path)));
    }
    let comments: Vec<String> = comments_of(&text).map(str::to_owned).collect();
    notes.extend(note_of(path, "comment", &comments));
    // As wide to its height as the usual charts of 6 × 4.
    let across = ((1.5 * n as f64).sqrt().ceil() as usize).min(n);
    let down = n.div_ceil(across);
    let (rows, columns) = (down * PATCH_PX, across * PATCH_PX);
    check_made(path, (4 * lines.len() as u64).saturating_mul((rows * columns) as u64))?;
    let plane = |line: &Vec<f32>| {
        let patch = |(row, column): (usize, usize)| {
            line.get(row / PATCH_PX * across + column / PATCH_PX).copied().unwrap_or(0.0)
        };
        Array2::from_shape_fn((rows, columns), patch)
    };
    let named = names.iter().take(MOST_NAMES).map(|name| short(name)).collect::<Vec<_>>().join(", ");
    let more = if names.len() > MOST_NAMES { ", …" } else { "" };
    let named = if names.is_empty() { String::new() } else { format!(", from the top left: {named}{more}") };
    notes.push(format!("{}: {n} patches, {across} × {down}, of {PATCH_PX} samples each{named}", name_of(path)));
    let planes = lines.iter().map(plane).collect();
    Ok(Cube {
        planes,
        top: None,
        wavelengths_nm: Some(wavelengths_nm),
        quantity: Some(FileQuantity::Reflectance),
        unit: None,
        packed: None,
        called: None,
        notes,
    })
}

#[cfg(test)]
mod tests {
    use crate::{ReadOptions, SceneLight, read_scene};
    use approx::assert_relative_eq;
    use dioptric_spectrum::Illuminant;

    #[test]
    fn tables_of_reflectances_are_charts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("skin.csv");
        let write = |text: &str| std::fs::write(&path, text).unwrap();
        write("nm, pale, dark, gray\n400,0.2,0.05,0.5\n500,0.3,0.08,0.5\n600,0.5,0.1,0.5\n700,0.6,0.12,0.5\n");
        let options =
            ReadOptions { light: Some(Illuminant::A), illuminance_lux: Some(500.0), ..ReadOptions::default() };
        let scene = read_scene(&path, &options).unwrap();
        assert_eq!((scene.rows(), scene.columns()), (32, 96));
        let white = Illuminant::A.white_radiance(scene.radiance.grid(), 500.0);
        for (column, reflectances) in [(0, [0.2, 0.3, 0.5, 0.6]), (40, [0.05, 0.08, 0.1, 0.12]), (95, [0.5; 4])] {
            for ((found, white), reflectance) in
                scene.radiance.spectrum_at(9, column).iter().zip(&white).zip(reflectances)
            {
                assert_relative_eq!(*found, white * reflectance, max_relative = 1e-6);
            }
        }
        assert_eq!(scene.light, Some(SceneLight::new(Illuminant::A, 500.0)));
        assert!(
            scene.notes[1].contains("3 patches, 3 × 1") && scene.notes[1].contains("pale, dark, gray"),
            "{:?}",
            scene.notes
        );
        // As spreadsheets of half the world write it, in other units.
        for text in [
            "nm;pale;dark;gray\n400;0,2;0,05;0,5\n500;0,3;0,08;0,5\n600;0,5;0,1;0,5\n700;0,6;0,12;0,5\n",
            "sep=;\nµm;pale;dark;gray\n0,4;0,2;0,05;0,5\n0,5;0,3;0,08;0,5\n0,6;0,5;0,1;0,5\n0,7;0,6;0,12;0,5\n",
            "\u{feff}angstrom\tpale %\tdark\tgray\n4000\t20\t5\t50\n5000\t30\t8\t50\n6000\t50\t10\t50\n7000\t60\t12\t50\n",
        ] {
            write(text);
            let other = read_scene(&path, &options).unwrap();
            assert_eq!(other.radiance.grid(), scene.radiance.grid(), "{text}");
            for column in [0, 40] {
                for (a, b) in other.radiance.spectrum_at(9, column).iter().zip(scene.radiance.spectrum_at(9, column)) {
                    assert_relative_eq!(*a, b, max_relative = 1e-6);
                }
            }
        }
        std::fs::write(&path, b"nm,Gr\xfcn\n400,.2\n500,.3\n").unwrap();
        assert!(read_scene(&path, &options).unwrap().notes[1].contains("Grün"));
        write("nm,ABS plastic,log cabin,photonic paint\n400,.2,.3,.4\n500,.2,.3,.4\n");
        assert!(read_scene(&path, &options).is_ok());
        for (text, word) in [
            ("", "it is empty"),
            ("# nothing\n", "no line of numbers"),
            ("nm,absorbance\n400,.2\n", "'absorbance' says that it holds no reflectances"),
            ("nm,absorption coefficient (1/cm)\n400,.2\n", "says that it holds no reflectances"),
            ("nm,W/m2/nm\n400,.2\n", "'W/m2/nm' says that it holds no reflectances"),
            ("nm,catalog red,Optical_Density\n400,.2,.3\n", "'Optical_Density' says that it holds no reflectances"),
            ("nm,skin OD\n400,.2\n", "'skin OD' says that it holds no reflectances"),
            ("nm,logR\n400,.2\n", "'logR' says that it holds no reflectances"),
            ("nm,log(1/T)\n400,.2\n", "'log(1/T)' says that it holds no reflectances"),
            ("nm,F(R)\n400,.2\n", "'F(R)' says that it holds no reflectances"),
            ("nm,Reflectance (0-255)\n400,.2\n", "(0-255)' says that it holds no reflectances"),
            ("Pixel,a\n400,.2\n500,.2\n", "'Pixel' holds no wavelengths"),
            ("waves (zorp),a\n400,.2\n", "'zorp'"),
            ("nm,a\n400,0.1\n500\n", "line 3: 1 numbers"),
            ("nm,a\n400,0.1\n500,x\n", "line 3: '500,x'"),
            ("nm\n400\n", "line 2"),
            ("500,0.1\n400,0.1\n400,0.2\n", "bands 2 and 3 lie both at 400 nm"),
        ] {
            write(text);
            let message = read_scene(&path, &options).unwrap_err().to_string();
            assert!(message.contains(word), "{text:?}: {message}");
        }
    }
}
