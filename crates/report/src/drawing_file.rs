//! Drawings as files: SVG always, PNG where the feature `png` is on.

use std::{fs, path::Path};

use dioptric_files::is_stream;
use dioptric_pipeline::PipelineError;

/// Pixels of a PNG for each of the drawing's own where its name asks for one.
const FILE_SCALE: f64 = 2.0;

/// Whether this build draws PNG: its feature `png`.
pub const DRAWS_PNG: bool = cfg!(feature = "png");

/// How to get drawings as PNG where [`DRAWS_PNG`] is false, as one sentence.
pub const PNG_REMEDY: &str =
    "drawings are SVG alone in this build; build it with `--features png` for PNG, or open the SVG in a browser";

/// Writes a drawing as `NAME.svg` into a folder and, where this build [draws PNG](DRAWS_PNG), as `NAME.png` of
/// `png_scale` pixels for each of the drawing's own.
///
/// # Errors
/// When a file cannot be written, or the PNG would be longer than 20,000 pixels.
pub fn write_drawing(svg: &str, folder: &Path, name: &str, png_scale: f64) -> Result<(), PipelineError> {
    let write = |extension: &str, bytes: &[u8]| {
        let path = folder.join(format!("{name}.{extension}"));
        fs::write(&path, bytes).map_err(|e| PipelineError::Write { path, reason: e.to_string() })
    };
    write("svg", svg.as_bytes())?;
    if DRAWS_PNG {
        write("png", &png(svg, png_scale, folder)?)?;
    }
    Ok(())
}

/// Returns what to write to `target` for a drawing: the SVG itself, or a PNG of twice its size, by the name's
/// extension.
///
/// # Errors
/// When the extension is neither, when it is `.png` and this build does not [draw PNG](DRAWS_PNG), or when the PNG
/// cannot be made.
pub fn drawing_file(svg: &str, target: &Path) -> Result<Vec<u8>, PipelineError> {
    match extension(target).as_str() {
        "svg" => Ok(svg.as_bytes().to_vec()),
        "png" => png(svg, FILE_SCALE, target),
        _ => check_drawing_name(target).map(|()| Vec::new()),
    }
}

/// Checks before the work that a drawing can be written under this name.
///
/// # Errors
/// When its extension is neither `.svg` nor `.png`, or is `.png` and this build does not [draw PNG](DRAWS_PNG).
pub fn check_drawing_name(target: &Path) -> Result<(), PipelineError> {
    let cannot = |reason: String| Err(PipelineError::Write { path: target.to_owned(), reason });
    match extension(target).as_str() {
        "svg" => Ok(()),
        "png" if DRAWS_PNG => Ok(()),
        "png" => cannot(PNG_REMEDY.to_owned()),
        other => cannot(format!("'.{other}' is no format of drawings here; expected .svg or .png")),
    }
}

/// Returns what a name ends in; standard output and devices take SVG.
fn extension(target: &Path) -> String {
    let own = target.extension().map(|e| e.to_string_lossy().to_lowercase());
    own.unwrap_or_else(|| if is_stream(target) { "svg".to_owned() } else { String::new() })
}

#[cfg(feature = "png")]
fn png(svg: &str, scale: f64, _target: &Path) -> Result<Vec<u8>, PipelineError> {
    crate::svg_to_png(svg, scale)
}

#[cfg(not(feature = "png"))]
fn png(_svg: &str, _scale: f64, target: &Path) -> Result<Vec<u8>, PipelineError> {
    Err(PipelineError::Write { path: target.to_owned(), reason: PNG_REMEDY.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SVG: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"4\" height=\"2\"/>";

    #[test]
    fn the_extension_chooses_the_format() {
        assert_eq!(drawing_file(SVG, Path::new("a.SVG")).unwrap(), SVG.as_bytes());
        let message = drawing_file(SVG, Path::new("a.pdf")).unwrap_err().to_string();
        assert!(message.contains("'.pdf' is no format of drawings here; expected .svg or .png"), "{message}");
        match drawing_file(SVG, Path::new("a.png")) {
            Ok(bytes) => assert!(DRAWS_PNG && bytes.starts_with(b"\x89PNG")),
            Err(error) => assert!(!DRAWS_PNG && error.to_string().contains("--features png"), "{error}"),
        }
    }

    #[test]
    fn names_are_checked_as_files_are() {
        for name in ["a.svg", "a.png", "a.pdf", "a"] {
            let path = Path::new(name);
            assert_eq!(check_drawing_name(path).is_ok(), drawing_file(SVG, path).is_ok(), "{name}");
        }
    }

    #[test]
    fn a_folder_holds_what_the_build_draws() {
        let folder = tempfile::tempdir().unwrap();
        write_drawing(SVG, folder.path(), "plot", 2.0).unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("plot.svg")).unwrap(), SVG);
        assert_eq!(folder.path().join("plot.png").exists(), DRAWS_PNG);
    }
}
