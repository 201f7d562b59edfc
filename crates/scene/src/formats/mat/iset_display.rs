//! Displays as `ISETCam` saves them: a structure `d` of primaries, a table from codes to light, and dots an inch.

use std::path::Path;

use dioptric_spectrum::{Observer, Spectrum, WavelengthGrid};

use super::{
    super::{
        stated::{name_of, note_of},
        unusable::unreadable,
    },
    container::{Content, MatArray, MatFile},
    iset_kinds::{DISPLAYS, structure_of},
    isetcam::ascending,
};
use crate::{DisplayCurve, DisplayModel, PixelLayout, SceneError};

/// Fields that are used or change nothing of the light of a pixel.
const KNOWN: [&str; 15] = [
    "name",
    "type",
    "wave",
    "spectrum",
    "spd",
    "gamma",
    "dpi",
    "dist",
    "ambient",
    "isEmissive",
    "comment",
    "image",
    "rgb",
    "viewing",
    "metadata",
];
/// An inch, µm.
const INCH_UM: f64 = 25_400.0;

/// Reads a display of `ISETCam`, and what of it is not used, a sentence each.
///
/// Its `spd` is the radiance of three primaries at full drive, W m⁻² sr⁻¹ nm⁻¹ (of more, the last have no part in pictures of three colors);
/// its `gamma` a column of linear light a primary, a row a code.
///
/// # Errors
/// When the file is no MATLAB file, holds no display, or one that lacks what pictures need.
pub fn read_iset_display(path: &Path) -> Result<(DisplayModel, Vec<String>), SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let file = MatFile::read(path, &|own| DISPLAYS.contains(&own.name.as_str()))?;
    let display = structure_of(&file, &DISPLAYS).map_err(wrong)?;
    let display = display.ok_or_else(|| wrong("it has no display of ISETCam, expected a structure 'd'".to_owned()))?;
    let lacks = |field: &str| wrong(format!("its display has no numbers '{field}'"));
    let wave = display.field("wave").or_else(|| display.field("spectrum").and_then(|spectrum| spectrum.field("wave")));
    let wave_nm = wave.and_then(MatArray::list).ok_or_else(|| lacks("wave"))?;
    let spd = display.field("spd").ok_or_else(|| lacks("spd"))?;
    let (numbers, n) = (spd.list().ok_or_else(|| lacks("spd"))?, wave_nm.len());
    let n_primaries = match spd.sides[..] {
        [rows, columns] if rows == n && columns >= 3 => columns,
        _ => {
            return Err(wrong(format!(
                "its 'spd' has the sides {:?}, expected {n} wavelengths by 3 primaries",
                spd.sides
            )));
        }
    };
    let order = ascending(&wave_nm);
    let spectrum = |of: &dyn Fn(usize) -> f64| {
        Spectrum::new(order.iter().map(|&i| wave_nm[i]).collect(), order.iter().map(|&i| of(i)).collect())
            .map_err(|reason| SceneError::Values { file: path.to_owned(), reason })
    };
    let primary = |k: usize| spectrum(&|i| numbers[i + n * k]);
    let primaries = [primary(0)?, primary(1)?, primary(2)?];
    let mut notes = vec![];
    if n_primaries > 3 {
        notes.push(format!(
            "{}: of its {n_primaries} primaries the first three are used, red, green and blue",
            name_of(path)
        ));
    }
    let gamma = display.field("gamma").ok_or_else(|| lacks("gamma"))?;
    let table = gamma.list().ok_or_else(|| lacks("gamma"))?;
    let n_codes = match gamma.sides[..] {
        [codes, columns] if codes >= 2 && (columns == n_primaries || columns == 1) => codes,
        _ => {
            let reason =
                format!("its 'gamma' has the sides {:?}, expected codes by {n_primaries} primaries", gamma.sides);
            return Err(wrong(reason));
        }
    };
    let column = |k: usize| {
        let k = if gamma.sides[1] == 1 { 0 } else { k };
        table[k * n_codes..(k + 1) * n_codes].to_vec()
    };
    let dpi = display.field("dpi").and_then(MatArray::number).ok_or_else(|| lacks("dpi"))?;
    let ambient = match display.field("ambient").and_then(MatArray::list) {
        Some(list) if list.len() == n => {
            let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
            let ambient = spectrum(&|i| list[i])?;
            Observer::Cie1931.xyz(&fine, &ambient.sample_or_zero(&fine)).luminance_cd_m2()
        }
        Some(list) => return Err(wrong(format!("its 'ambient' has {} numbers, expected {n}", list.len()))),
        None => 0.0,
    };
    if ambient > 0.0 {
        notes.push(format!("{}: its ambient light of {ambient:.3} cd/m² counts in the color of white", name_of(path)));
    }
    if let Content::Fields(fields) = &display.content {
        let left = fields.iter().filter(|(own, array)| array.len() > 0 && !KNOWN.contains(&own.as_str()));
        notes.extend(note_of(path, "field", &left.map(|(own, _)| own.clone()).collect::<Vec<_>>()));
    }
    let others: Vec<String> =
        file.listed.iter().map(|own| own.name.clone()).filter(|own| !DISPLAYS.contains(&own.as_str())).collect();
    notes.extend(note_of(path, "variable", &others));
    let mut model = DisplayModel {
        name: name_of(path),
        source: "a display of ISETCam".to_owned(),
        primaries,
        white_cd_m2: None,
        black_cd_m2: 0.0,
        curve: DisplayCurve::Tables([column(0), column(1), column(2)]),
        pixel_pitch_um: INCH_UM / dpi,
        pixels: PixelLayout::Even,
    };
    // The white of a model has its black in it.
    let white_cd_m2 = model.white_xyz().0[1];
    if ambient > 0.0 {
        (model.white_cd_m2, model.black_cd_m2) = (Some(white_cd_m2 + ambient), ambient);
    }
    model.check().map_err(|error| wrong(error.to_string()))?;
    Ok((model, notes))
}

#[cfg(test)]
mod tests {
    use super::{super::elements, *};
    use crate::formats::mat::{fixtures::mat_file, iset_write::named};
    use approx::assert_relative_eq;

    /// A display of three even bands, the tables of whose primaries are powers of their own.
    fn display(gamma_columns: usize) -> Vec<u8> {
        let wave_nm = [450.0, 550.0, 650.0];
        // Columns: red, green, blue.
        let spd = [0.0, 0.0, 0.01, 0.0, 0.01, 0.0, 0.01, 0.0, 0.0];
        let gamma: Vec<f64> = (0..gamma_columns)
            .flat_map(|k| (0..256).map(move |code| (f64::from(code) / 255.0).powf(1.8 + 0.2 * k as f64)))
            .collect();
        let fields = [
            named("type", elements::text("", "display").unwrap()),
            named("wave", elements::doubles("", &[3, 1], &wave_nm).unwrap()),
            named("spd", elements::doubles("", &[3, 3], &spd).unwrap()),
            named("gamma", elements::doubles("", &[256, gamma_columns], &gamma).unwrap()),
            named("dpi", elements::doubles("", &[1, 1], &[96.0]).unwrap()),
            named("dixel", elements::doubles("", &[1, 1], &[1.0]).unwrap()),
        ];
        mat_file(&[elements::variable(&elements::structure("d", &fields).unwrap()).unwrap()])
    }

    #[test]
    fn primaries_table_and_pitch_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lcd.mat");
        std::fs::write(&path, display(3)).unwrap();
        let (model, notes) = read_iset_display(&path).unwrap();
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].contains("dixel"));
        assert_relative_eq!(model.pixel_pitch_um, 264.583_333, max_relative = 1e-6);
        assert_eq!(model.primaries[0].values(), [0.0, 0.0, 0.01]);
        // Codes of the table, and straight lines between them.
        let drive = model.drive([51.0 / 255.0, 102.0 / 255.0, 1.0]);
        assert_relative_eq!(drive[0], 0.2_f64.powf(1.8), max_relative = 1e-9);
        assert_relative_eq!(drive[1], 0.4_f64.powf(2.0), max_relative = 1e-9);
        assert_eq!(drive[2], 1.0);
        // One column serves all three.
        std::fs::write(&path, display(1)).unwrap();
        let (model, _) = read_iset_display(&path).unwrap();
        assert_relative_eq!(model.drive([0.2; 3])[2], 0.2_f64.powf(1.8), max_relative = 1e-9);
        std::fs::write(&path, display(2)).unwrap();
        assert!(read_iset_display(&path).unwrap_err().to_string().contains("gamma"));
    }
}
