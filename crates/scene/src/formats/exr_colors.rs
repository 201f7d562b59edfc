//! The colors of EXR files without bands: which channels they are, and of what primaries.

use std::path::Path;

use dioptric_spectrum::{Xyz, adapt_bradford};
use exr::meta::attribute::Chromaticities;
use glam::{DMat3, DVec3};
use ndarray::Array2;

use super::{exr_depth::COMPOSITE, stated::Stated, unusable::unreadable};
use crate::SceneError;

/// The channels that a picture has.
pub(super) const EXPECTED: &str =
    "channels R, G and B or Y, or named like S0.550,000000nm (light) or T.550,000000nm (reflectance)";

/// Whether a layer has the name of a picture, and not of one of its passes.
pub(super) fn is_called_picture(layer: &str) -> bool {
    let last = layer.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    ["combined", "rgb", "rgba", "color", "beauty", "image"].contains(&last.as_str())
}

/// What the channels of a picture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorsOf {
    /// Red, green and blue, or gray.
    Primaries,
    /// X, Y and Z of CIE 1931.
    Xyz,
}

/// Takes red, green and blue of the layer told, or else `R`, `G` and `B`, or those of a layer, Blender's only `….Combined` before others; or
/// `X`, `Y` and `Z`; or gray, `Y`. Returns what they are, and them with what stands before their letters.
///
/// # Errors
/// When there are no such channels, or layers of which none, or several, are called a picture.
pub(super) fn colors_of(
    path: &Path,
    channels: &mut Stated<Array2<f32>>,
    told: Option<&str>,
) -> Result<(String, ColorsOf, [Array2<f32>; 3]), SceneError> {
    let names: Vec<String> = channels.names().map(str::to_owned).collect();
    let full =
        |prefix: &str, letter: &str| if prefix.is_empty() { letter.to_owned() } else { format!("{prefix}.{letter}") };
    let prefixes: Vec<&str> = names
        .iter()
        .filter_map(|name| match name.as_str() {
            "R" => Some(""),
            name => name.strip_suffix(".R"),
        })
        .filter(|prefix| ["G", "B"].iter().all(|letter| names.contains(&full(prefix, letter))))
        .collect();
    // Gray layers, where none has colors or one is asked for by name; neither X, Y and Z nor a depth.
    let is_gray = |prefix: &&str| {
        let has = |letter: &str| names.contains(&full(prefix, letter));
        let last = prefix.rsplit('.').next().unwrap_or_default();
        !(has("RY") || has("BY") || has("X") && has("Z") || last.eq_ignore_ascii_case("depth"))
    };
    let grays = names.iter().filter_map(|name| if name == "Y" { Some("") } else { name.strip_suffix(".Y") });
    let grays: Vec<&str> = grays.filter(is_gray).filter(|gray| !prefixes.contains(gray)).collect();
    let is_xyz = ["X", "Y", "Z"].iter().all(|letter| channels.get(letter).is_some());
    let prefixes = match told {
        None if is_xyz || !prefixes.is_empty() => prefixes,
        _ => [prefixes, grays].concat(),
    };
    let shown = |prefix: &&str| if prefix.is_empty() { "one without a name".to_owned() } else { format!("'{prefix}'") };
    let listed = || prefixes.iter().map(shown).collect::<Vec<_>>().join(", ");
    let is_whole = |prefix: &&&str| prefix.is_empty() || **prefix == COMPOSITE;
    let called: Vec<&&str> = prefixes.iter().filter(|prefix| is_called_picture(prefix)).collect();
    let of_picture = || prefixes.iter().find(is_whole).or(called.first().copied().filter(|_| called.len() == 1));
    let prefix = match told {
        Some(told) => {
            let found = prefixes.iter().find(|prefix| **prefix == told);
            let has = if prefixes.is_empty() { "expected it without".to_owned() } else { format!("but {}", listed()) };
            let reason = || format!("it has no layer '{told}' of red, green and blue, or gray (--variable), {has}");
            Some(found.ok_or_else(|| unreadable(path, reason()))?)
        }
        None => of_picture().or_else(|| prefixes.first().filter(|_| prefixes.len() == 1)),
    };
    let no_bands = || SceneError::NoBands { file: path.to_owned(), expected: EXPECTED };
    if let Some(prefix) = prefix.map(|prefix| (*prefix).to_owned()) {
        let mut take = |letter| channels.take(&full(&prefix, letter)).ok_or_else(no_bands);
        let planes = if ["R", "G", "B"].iter().all(|letter| names.contains(&full(&prefix, letter))) {
            [take("R")?, take("G")?, take("B")?]
        } else {
            let gray = take("Y")?;
            [gray.clone(), gray.clone(), gray]
        };
        return Ok((prefix, ColorsOf::Primaries, planes));
    }
    if prefixes.len() > 1 {
        let reason = format!("it has several layers of colors, {}: expected --variable with the name of one", listed());
        return Err(unreadable(path, reason));
    }
    if is_xyz {
        let mut take = |letter| channels.take(letter).ok_or_else(no_bands);
        let planes = [take("X")?, take("Y")?, take("Z")?];
        return Ok((String::new(), ColorsOf::Xyz, planes));
    }
    Err(no_bands())
}

/// Returns the matrix from CIE XYZ, of which the white of D65 has a Y of 1, to linear sRGB.
pub(super) fn srgb_from_xyz() -> [[f64; 3]; 3] {
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|of| Xyz(of).to_linear_srgb());
    [0, 1, 2].map(|i| [x[i], y[i], z[i]])
}

/// Returns the matrix from colors of these primaries to linear sRGB, their white adapted to D65 (Bradford).
pub(super) fn srgb_from(own: &Chromaticities) -> Option<[[f64; 3]; 3]> {
    let xyz = |p: exr::prelude::Vec2<f32>| {
        let (x, y) = (f64::from(p.0), f64::from(p.1));
        let is_color = x.is_finite() && y.is_finite() && y.abs() > 1e-6;
        is_color.then(|| [x / y, 1.0, (1.0 - x - y) / y])
    };
    let [r, g, b, w] = [xyz(own.red)?, xyz(own.green)?, xyz(own.blue)?, xyz(own.white)?];
    let primaries = DMat3::from_cols(DVec3::from(r), DVec3::from(g), DVec3::from(b));
    if primaries.determinant().abs() < 1e-9 || w.iter().any(|v| *v <= 0.0) {
        return None;
    }
    let shares = primaries.inverse() * DVec3::from(w);
    let d65 = Xyz::from_linear_srgb([1.0; 3]);
    let columns = [r, g, b]
        .into_iter()
        .zip(shares.to_array())
        .map(|(primary, share)| adapt_bradford(Xyz(primary.map(|v| v * share)), Xyz(w), d65).to_linear_srgb());
    let columns: Vec<[f64; 3]> = columns.collect();
    Some([0, 1, 2].map(|i| [columns[0][i], columns[1][i], columns[2][i]]))
}

/// Whether primaries and white are those of sRGB, to the digits that writers have.
pub(super) fn are_srgb(own: &Chromaticities) -> bool {
    let pairs =
        [(own.red, [0.64, 0.33]), (own.green, [0.30, 0.60]), (own.blue, [0.15, 0.06]), (own.white, [0.3127, 0.329])];
    pairs.iter().all(|(own, srgb)| (own.0 - srgb[0]).abs() < 1e-3 && (own.1 - srgb[1]).abs() < 1e-3)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use exr::prelude::Vec2;

    use super::*;

    #[test]
    fn acescg_becomes_srgb_by_the_published_matrix() {
        let ap1 = Chromaticities {
            red: Vec2(0.713, 0.293),
            green: Vec2(0.165, 0.830),
            blue: Vec2(0.128, 0.044),
            white: Vec2(0.32168, 0.33767),
        };
        // AP1 to linear Rec. 709 with Bradford's adaptation, as the ACES documents and colour-science give it.
        let published = [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]];
        for (row, expected) in srgb_from(&ap1).unwrap().iter().zip(published) {
            for (value, expected) in row.iter().zip(expected) {
                // Four digits of the chromaticities.
                assert_abs_diff_eq!(*value, expected, epsilon = 3e-4);
            }
        }
        let srgb = Chromaticities {
            red: Vec2(0.64, 0.33),
            green: Vec2(0.30, 0.60),
            blue: Vec2(0.15, 0.06),
            white: Vec2(0.3127, 0.3290),
        };
        assert!(are_srgb(&srgb) && !are_srgb(&ap1));
        assert!(srgb_from(&Chromaticities { red: srgb.green, ..srgb }).is_none());
    }

    #[test]
    fn colors_are_the_picture_not_another_pass() {
        let take_of = |names: &[&str], told: Option<&str>| {
            let planes = names.iter().map(|name| ((*name).to_owned(), Array2::zeros((1, 1)))).collect();
            let mut channels = Stated::new("channel", planes);
            colors_of(Path::new("a.exr"), &mut channels, told)
                .map(|(prefix, ..)| (prefix, channels.names().map(str::to_owned).collect::<Vec<_>>()))
        };
        let take = |names: &[&str]| take_of(names, None);
        let pair = |a: &str, b: &str| vec![a.to_owned(), b.to_owned()];
        let pass = |pass: &str| ["R", "G", "B"].map(|letter| format!("{pass}.{letter}"));
        let both = [pass("V.Noisy Image"), pass("V.Combined")].concat();
        let names: Vec<&str> = both.iter().map(String::as_str).collect();
        let (prefix, left) = take(&names).unwrap();
        assert_eq!((prefix.as_str(), left.len()), ("V.Combined", 3));
        let both = [pass("A.Combined"), pass("Composite.Combined")].concat();
        assert_eq!(take(&both.iter().map(String::as_str).collect::<Vec<_>>()).unwrap().0, "Composite.Combined");
        let both = [pass("A.Combined"), pass("B.Combined")].concat();
        assert!(
            take(&both.iter().map(String::as_str).collect::<Vec<_>>())
                .unwrap_err()
                .to_string()
                .contains("'B.Combined'")
        );
        assert_eq!(take(&["Y"]).unwrap().0, "");
        assert_eq!(take(&["A", "X", "Y", "Z"]).unwrap().1, ["A"]);
        assert!(take(&["Y", "RY", "BY"]).is_err() && take(&["R", "G"]).is_err());
        // Gray layers, where there are no others.
        assert_eq!(take(&["gray.Y", "gray.Z", "Depth.Y"]).unwrap(), ("gray".to_owned(), pair("gray.Z", "Depth.Y")));
        assert_eq!(take(&["mask.Y", "Y"]).unwrap().0, "");
        assert_eq!(take(&["mask.Y", "X", "Y", "Z"]).unwrap().1, ["mask.Y"]);
        assert_eq!(take_of(&["gray.Y", "mask.Y"], Some("mask")).unwrap().0, "mask");
        let message = take(&["gray.Y", "mask.Y"]).unwrap_err().to_string();
        assert!(message.contains("'gray', 'mask'") && message.contains("--variable"), "{message}");
        // Of two passes neither of which is called a picture none is chosen.
        let two = [pass("x"), pass("y")].concat();
        let two: Vec<&str> = two.iter().map(String::as_str).collect();
        let message = take(&two).unwrap_err().to_string();
        assert!(message.contains("'x', 'y'") && message.contains("--variable"), "{message}");
        assert_eq!(take_of(&two, Some("y")).unwrap().0, "y");
        assert!(take_of(&two, Some("z")).is_err());
    }
}
