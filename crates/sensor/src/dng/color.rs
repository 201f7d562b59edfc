//! What a DNG file says about color: the numbers of the filters, and matrices from XYZ to the camera.

use dioptric_spectrum::{Illuminant, Observer, Spectrum, Xyz, adapt_bradford, color_checker_reflectances};

use crate::{
    ColorMatrix, Raw, Sensor, SensorError, Tile,
    least_squares::Normal,
    white_light::{color_weights, fine_grid, white_response},
};

/// The filters that DNG knows, in the order of their numbers (TIFF/EP, `CFAPattern`); W is clear.
pub(super) const FILTERS: [&str; 7] = ["R", "G", "B", "C", "M", "Y", "W"];
/// The longest side of a tile.
const LARGEST_TILE: usize = 8;
/// How much more the white counts than a patch of the chart: a neutral must stay one.
const WHITE_WEIGHT: f64 = 100.0;

/// Returns the number that DNG has for each filter; empty for a single one.
pub(crate) fn color_codes(raw: &Raw) -> Result<Vec<u8>, SensorError> {
    let names = &raw.filter_names;
    let refused = |reason: String| Err(SensorError::Unsuitable { what: "a DNG file", reason });
    if names.len() == 1 {
        return Ok(Vec::new());
    }
    let number = |name: &String| FILTERS.iter().position(|known| known == name);
    let codes: Vec<u8> = names.iter().filter_map(number).map(|n| n as u8).collect();
    let most = if raw.tile.is_some() { 4 } else { 3 };
    if codes.len() != names.len() || !(3..=most).contains(&codes.len()) {
        return refused(format!(
            "has one filter, three, or in a mosaic four of R, G, B, C, M, Y and W, but the sensor has {}",
            names.join(", ")
        ));
    }
    match &raw.tile {
        Some(tile) if tile.rows().max(tile.columns()) > LARGEST_TILE => refused(format!(
            "has a mosaic of at most 8 × 8 pixels, but the sensor's is {} × {}",
            tile.rows(),
            tile.columns()
        )),
        _ => Ok(codes),
    }
}

/// Returns the order in which a file counts the filters as planes.
///
/// It is the sensor's own, but for mosaics of three: readers that go back to dcraw want the filter that lies on every
/// second pixel as the second plane, and take no matrix whose first plane does not see X, so that the redder of the
/// others comes first. For red, green and blue that is the usual order.
pub(crate) fn plane_order(codes: &[u8], tile: Option<&Tile>) -> Vec<usize> {
    const REDDEST_FIRST: [u8; 7] = [0, 4, 5, 6, 1, 2, 3];
    let mut order: Vec<usize> = (0..codes.len()).collect();
    if let (3, Some(tile)) = (codes.len(), tile) {
        let pixels = |filter: usize| (0..tile.rows()).flat_map(|row| tile.row(row)).filter(|f| **f == filter).count();
        order.sort_by_key(|&filter| REDDEST_FIRST.iter().position(|code| *code == codes[filter]));
        let most = (0..3).rev().max_by_key(|&place| pixels(order[place])).unwrap_or(1);
        let filter = order.remove(most);
        order.insert(1, filter);
    }
    order
}

/// Returns a row a channel: the matrix from XYZ (white of luminance 1) to the channels of a neutral light's own scale, as
/// DNG wants it.
///
/// For three channels it is the inverse of the matrix by which we develop; for more, which have none, the least-squares
/// fit to the chart.
pub(crate) fn camera_from_xyz(sensor: &Sensor, light: &Illuminant) -> Vec<[f64; 3]> {
    let white = white_response(sensor, light);
    let brightest = white.iter().copied().fold(0.0, f64::max);
    let chart: Vec<Spectrum> = color_checker_reflectances().into_iter().map(|(_, s)| s).collect();
    if sensor.filters.len() == 3 {
        let fitted = ColorMatrix::fit(sensor, light, &chart);
        let balanced_from_xyz = balanced_from_xyz(fitted.rows.each_ref().map(|row| [row[0], row[1], row[2]]), light);
        return (0..3).map(|i| balanced_from_xyz[i].map(|v| v * white[i] / brightest)).collect();
    }
    let grid = fine_grid();
    let lit = light.on_bands(&grid);
    let weights = color_weights(sensor, &grid);
    let white_y = Observer::Cie1931.xyz(&grid, &lit).0[1];
    let mut normals: Vec<Normal> = weights.iter().map(|_| Normal::new(3)).collect();
    for (reflectance, weight) in chart.iter().map(|s| (Some(s), 1.0)).chain([(None, WHITE_WEIGHT)]) {
        let spectrum: Vec<f64> = match reflectance {
            Some(reflectance) => reflectance.sample_held(&grid).iter().zip(&lit).map(|(r, s)| r * s).collect(),
            None => lit.clone(),
        };
        let xyz = Observer::Cie1931.xyz(&grid, &spectrum).0.map(|v| weight * v / white_y);
        for (normal, weights) in normals.iter_mut().zip(&weights) {
            let signal: f64 = weights.iter().zip(&spectrum).map(|(w, s)| w * s).sum();
            normal.add(&xyz, weight * signal / brightest);
        }
    }
    normals
        .into_iter()
        .map(|normal| {
            let row = normal.solve(0.0);
            [row[0], row[1], row[2]]
        })
        .collect()
}

/// Returns the matrix from balanced channels to XYZ under D50, of white (1, 1, 1) to that of D50, by which we develop: of three
/// channels, for a light.
pub(crate) fn xyz_d50_from_balanced(sensor: &Sensor, light: &Illuminant) -> Option<[[f64; 3]; 3]> {
    if sensor.filters.len() != 3 {
        return None;
    }
    let chart: Vec<Spectrum> = color_checker_reflectances().into_iter().map(|(_, s)| s).collect();
    let fitted = ColorMatrix::fit(sensor, light, &chart);
    let grid = fine_grid();
    let d50 = Observer::Cie1931.xyz(&grid, &Illuminant::D50.spectrum().sample_held(&grid));
    let d50 = Xyz(d50.0.map(|v| v / d50.0[1]));
    // The white of sRGB is that of its own matrix.
    let white = Xyz::from_linear_srgb([1.0; 3]);
    let columns = [0, 1, 2].map(|channel| {
        let rgb = fitted.rows.each_ref().map(|row| row[channel]);
        adapt_bradford(Xyz::from_linear_srgb(rgb), white, d50).0
    });
    Some([0, 1, 2].map(|i| columns.map(|column| column[i])))
}

/// Returns the matrix from XYZ under a light to balanced channels.
fn balanced_from_xyz(srgb_from_balanced: [[f64; 3]; 3], light: &Illuminant) -> [[f64; 3]; 3] {
    let balanced_from_srgb = inverse(srgb_from_balanced);
    let grid = fine_grid();
    let light_xyz = Observer::Cie1931.xyz(&grid, &light.on_bands(&grid));
    let light_xyz = Xyz(light_xyz.0.map(|v| v / light_xyz.0[1]));
    // Column by column: what the camera gives for X, Y and Z alone.
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|unit| {
        let rgb = adapt_bradford(Xyz(unit), light_xyz, Xyz::D65).to_linear_srgb();
        balanced_from_srgb.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
    });
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| columns[j][i]))
}

/// The white of the profile connection space, D50.
pub(super) const D50_XY: [f64; 2] = [0.3457, 0.3585];

/// Returns the color of a chromaticity, of luminance 1.
pub(super) fn xyz_of([x, y]: [f64; 2]) -> Xyz {
    Xyz([x / y, 1.0, (1.0 - x - y) / y])
}

/// Returns the inverse of a matrix.
pub(super) fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_neutral_of_the_light_comes_out_of_both_kinds_of_matrix() {
        let three = Sensor::built_in("imx363").unwrap();
        let mut four = three.clone();
        let clear = crate::Filter {
            exposure_fraction: 1.0,
            name: "W".to_owned(),
            quantum_efficiency: Spectrum::new(vec![380.0, 730.0], vec![0.8; 2]).unwrap(),
        };
        four.filters.push(clear);
        for sensor in [three, four] {
            for light in [Illuminant::A, Illuminant::D65] {
                let grid = fine_grid();
                let xyz = Observer::Cie1931.xyz(&grid, &light.on_bands(&grid)).0;
                let white = white_response(&sensor, &light);
                let brightest = white.iter().copied().fold(0.0, f64::max);
                for (row, white) in camera_from_xyz(&sensor, &light).iter().zip(&white) {
                    let neutral: f64 = row.iter().zip(xyz).map(|(m, v)| m * v / xyz[1]).sum();
                    // Bradford's D65 has five digits; the fit weighs the white a hundredfold, not without end.
                    assert!((neutral - white / brightest).abs() < 1e-3, "{light:?}: {neutral}");
                }
            }
        }
    }

    #[test]
    fn forward_matrices_take_white_to_d50() {
        for light in [Illuminant::A, Illuminant::D65] {
            let rows = xyz_d50_from_balanced(&Sensor::built_in("imx363").unwrap(), &light).unwrap();
            // The white that DNG states for D50.
            for (row, wanted) in rows.iter().zip([0.9642, 1.0, 0.8249]) {
                assert!((row.iter().sum::<f64>() - wanted).abs() < 5e-4, "{rows:?}");
            }
        }
    }

    #[test]
    fn the_filter_of_every_second_pixel_is_the_second_plane() {
        let order = |letters: &str, names: &[&str]| {
            let tile = crate::Cfa::two_by_two(letters).unwrap().resolve("test", names).unwrap().unwrap();
            let codes: Vec<u8> =
                names.iter().map(|name| FILTERS.iter().position(|known| known == name).unwrap() as u8).collect();
            plane_order(&codes, Some(&tile)).iter().map(|&filter| names[filter]).collect::<String>()
        };
        assert_eq!(order("GBRG", &["R", "G", "B"]), "RGB");
        assert_eq!(order("GBRG", &["B", "G", "R"]), "RGB");
        assert_eq!(order("RYYB", &["R", "Y", "B"]), "RYB");
        assert_eq!(order("CYYM", &["C", "Y", "M"]), "MYC");
        assert_eq!(plane_order(&[0, 1, 2], None), [0, 1, 2]);
    }
}
