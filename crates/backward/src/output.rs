//! `OpenEXR` files of renderings, in the layout of Fichet et al. 2021 (`S0.550,000000nm`).

use std::{fs, path::Path};

use dioptric_files::Staged;
use dioptric_spectrum::{Quantity, SpectralImage, sort_exr_attributes};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder, SmallVec,
    Text, WritableImage,
};
use ndarray::Array2;

use crate::{Auxiliary, BackwardError, Rendering};

/// Writes a picture: its bands as `S0.…nm`, the standard error of each as `SE.…nm`, and `Z` where a depth is given.
///
/// # Errors
/// When the file cannot be written; it is then not there.
pub fn write_rendering_exr(path: &Path, rendering: &Rendering, z_m: Option<&Array2<f32>>) -> Result<(), BackwardError> {
    let mut channels = band_channels("S0", &rendering.picture);
    channels.extend(band_channels("SE", &rendering.standard_error));
    channels.extend(z_m.map(|z_m| channel("Z", z_m)));
    let unit = match rendering.picture.quantity() {
        Quantity::Radiance => "W.m^-2.sr^-1",
        Quantity::Irradiance => "W.m^-2",
        Quantity::Reflectance => "1",
    };
    let mut attributes = LayerAttributes::default();
    let mut put = |name: &str, value| attributes.other.insert(Text::from(name), value);
    put("spectralLayoutVersion", AttributeValue::Text(Text::from("1.0")));
    put("emissiveUnits", AttributeValue::Text(Text::from(unit)));
    if let Some(pitch_um) = rendering.picture.pitch_um() {
        put("samplePitchUm", AttributeValue::F64(pitch_um));
    }
    write(path, (rendering.picture.rows(), rendering.picture.columns()), attributes, channels)
}

/// Writes what a camera sees besides light: `Z` and `distance` (m), `normal.X` to `normal.Z`, `material`, `instance`,
/// `shape`, `object` and the albedo as `T.…nm`.
///
/// # Errors
/// When the file cannot be written; it is then not there.
pub fn write_auxiliary_exr(path: &Path, seen: &Auxiliary) -> Result<(), BackwardError> {
    let mut channels = vec![
        channel("Z", &seen.z_m),
        channel("distance", &seen.distance_m),
        channel("material", &seen.material),
        channel("instance", &seen.instance),
        channel("shape", &seen.shape),
        channel("object", &seen.object),
    ];
    channels.extend(
        ["normal.X", "normal.Y", "normal.Z"].iter().zip(&seen.normal).map(|(name, plane)| channel(name, plane)),
    );
    channels.extend(band_channels("T", &seen.albedo));
    write(path, seen.z_m.dim(), LayerAttributes::default(), channels)
}

type Channel = AnyChannel<FlatSamples>;

fn band_channels(kind: &str, image: &SpectralImage) -> Vec<Channel> {
    let name = |nm: &f64| format!("{kind}.{}nm", format!("{nm:.6}").replace('.', ","));
    image.grid().centers_nm().iter().zip(image.planes()).map(|(nm, plane)| channel(&name(nm), plane)).collect()
}

fn channel(name: &str, plane: &Array2<f32>) -> Channel {
    AnyChannel::new(name, FlatSamples::F32(plane.iter().copied().collect()))
}

/// Writes a file, whole or not at all.
fn write(
    path: &Path,
    (rows, columns): (usize, usize),
    attributes: LayerAttributes,
    channels: Vec<Channel>,
) -> Result<(), BackwardError> {
    let failed = |reason: String| BackwardError::Write { file: path.to_owned(), reason };
    let staged = Staged::file(path)?;
    let list: SmallVec<[Channel; 4]> = channels.into_iter().collect();
    // In a fixed order, so that equal pictures are equal files whatever the threads do.
    let encoding = Encoding { line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS };
    let layer = Layer::new((columns, rows), attributes, encoding, AnyChannels::sort(list));
    Image::from_layer(layer).write().to_file(staged.path()).map_err(|error| failed(error.to_string()))?;
    let file = fs::File::options().read(true).write(true).open(staged.path());
    file.and_then(|mut file| sort_exr_attributes(&mut file)).map_err(|error| failed(error.to_string()))?;
    Ok(staged.commit()?)
}
