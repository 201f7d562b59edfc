//! What an item is called: a hash of all that its results depend on.

use std::{fmt, str::FromStr};

use dioptric_pipeline::{Camera, FilmSpec};
use serde::{Serialize, Serializer};

use crate::{SweepError, inputs::Inputs, plan::Keep};

/// Counts the changes of results that no camera file shows: raised whenever an equal camera and equal files make another
/// picture, report or file, so that items made before are not taken for those made now.
pub const RESULTS_EPOCH: u32 = 43;

/// The name of an item: the BLAKE3 hash of its camera, of the content of the files that it is made from, and of
/// [`RESULTS_EPOCH`].
///
/// The camera is hashed as the text of its camera file with every default filled in (JSON has no infinity, which automatic
/// exposures hold), each path replaced by the hash of its content and the file's name; so folders do not count, and neither does the order or
/// the spelling of a plan. Where less is kept of an item than usual, that is hashed too.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ItemId([u8; 32]);

impl fmt::Display for ItemId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ItemId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ItemId({self})")
    }
}

impl FromStr for ItemId {
    type Err = SweepError;

    /// Reads a name as it is displayed: 64 hexadecimal digits.
    fn from_str(text: &str) -> Result<Self, SweepError> {
        let digit = |byte: &u8| char::from(*byte).to_digit(16).map(|digit| digit as u8);
        let bytes: Option<Vec<u8>> =
            text.as_bytes().chunks(2).map(|pair| Some(16 * digit(&pair[0])? + digit(pair.get(1)?)?)).collect();
        let id = bytes.and_then(|bytes| bytes.try_into().ok());
        id.map(Self).ok_or_else(|| SweepError::Id { found: text.to_owned() })
    }
}

impl Serialize for ItemId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The names of an item and of what it shares with others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ItemKey {
    pub(crate) id: ItemId,
    /// Of all that the irradiance depends on: items with the same one image their scene once.
    pub(crate) imaging: u64,
    /// Of what each stage before the picture takes from the camera, in the order of the stages.
    pub(crate) stages: [u64; 7],
}

impl ItemKey {
    /// Returns the key of a camera; `still` has the settings of those stages behind the irradiance that are left out of
    /// [`imaging`](Self::imaging).
    pub(crate) fn of(camera: &Camera, still: &Camera, inputs: &Inputs) -> Result<Self, SweepError> {
        let camera = inputs.by_content(camera)?;
        let scene = &camera.scene;
        let sensor = matches!(camera.film, FilmSpec::Sensor | FilmSpec::Field).then_some(&camera.sensor);
        // They decide nothing but the order, so that the words of a debugger will do.
        let of = |part: &dyn fmt::Debug| short(&hash(&format!("{part:?}")));
        let stages = [
            of(&(&scene.source, scene.field_of_view_deg, scene.depth_m, scene.flat, &camera.wavelengths)),
            of(&((&camera.lens, &camera.lens_reading), (camera.stop, camera.iris), camera.movements)),
            of(&((camera.focus, camera.film, camera.crop), sensor, camera.diffraction, &camera.psfs)),
            of(&(camera.blur, camera.border, camera.lens_reflections, &camera.light_field)),
            of(&(&scene.illuminant, scene.illuminance_lux, &scene.light, (scene.mean_luminance_cd_m2, scene.mean_lux))),
            of(&(&camera.sensor, &camera.filters)),
            of(&(camera.exposure, camera.noise, &camera.frames, camera.seed, camera.chip_seed)),
        ];
        let imaging = Camera {
            name: String::new(),
            sensor: sensor.unwrap_or(&still.sensor).clone(),
            exposure: still.exposure,
            noise: still.noise,
            frames: still.frames.clone(),
            processing: still.processing.clone(),
            seed: still.seed,
            outputs: still.outputs.clone(),
            ..camera.clone()
        };
        Ok(Self { id: ItemId(hash(&camera.to_ron())), imaging: short(&hash(&imaging.to_ron())), stages })
    }

    /// Returns the key of an item of which these files are kept: of fewer than all another one, since its folder is another.
    pub(crate) fn keeping(self, keep: &[Keep]) -> Self {
        let kept: Vec<Keep> = Keep::all().into_iter().filter(|file| keep.contains(file)).collect();
        let id = if kept == Keep::all() { self.id } else { ItemId(hash(&format!("{} keeps {kept:?}", self.id))) };
        Self { id, ..self }
    }
}

fn hash(text: &str) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    // Lines end alike on every system.
    hasher.update(b"dioptric item ").update(&RESULTS_EPOCH.to_le_bytes()).update(text.replace("\r\n", "\n").as_bytes());
    *hasher.finalize().as_bytes()
}

fn short(hash: &[u8; 32]) -> u64 {
    let [a, b, c, d, e, f, g, h, ..] = *hash;
    u64::from_le_bytes([a, b, c, d, e, f, g, h])
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use dioptric_pipeline::{LensSpec, StopSpec};

    use super::*;

    #[test]
    fn names_follow_what_results_depend_on() {
        let inputs = Inputs::default();
        let demo = Camera::demo().unwrap();
        let key = |change: &dyn Fn(&mut Camera)| {
            let mut camera = demo.clone();
            change(&mut camera);
            ItemKey::of(&camera, &demo, &inputs).unwrap()
        };
        let first = key(&|_| {});
        assert_eq!(first, key(&|_| {}));
        let (seed, stop) = (key(&|camera| camera.seed = 2), key(&|camera| camera.stop = StopSpec::FNumber(8.0)));
        assert!(first.id != seed.id && first.imaging == seed.imaging);
        assert!(first.id != stop.id && first.imaging != stop.imaging);
        assert_eq!((first.id.to_string().len(), first.id.to_string().parse::<ItemId>().unwrap()), (64, first.id));
        for text in ["", "0", "zz", &"a".repeat(63), &"a".repeat(66), &"ä".repeat(32)] {
            assert!(text.parse::<ItemId>().unwrap_err().to_string().contains("64 hexadecimal digits"), "{text}");
        }
        // The pixels of the sensor are those of the film only where they are asked to be.
        let sensor = key(&|camera| camera.sensor = dioptric_pipeline::SensorSpec::named("imx363"));
        assert!(first.imaging == sensor.imaging && first.id != sensor.id);
    }

    #[test]
    fn files_count_by_content() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, text).unwrap();
            path
        };
        let demo = Camera::demo().unwrap();
        let id = |path: PathBuf| {
            ItemKey::of(&Camera { lens: LensSpec::File(path), ..demo.clone() }, &demo, &Inputs::default()).unwrap().id
        };
        let first = id(put("a/lens.ron", "1"));
        assert_eq!(first, id(put("b/lens.ron", "1")));
        assert_ne!(first, id(put("b/lens.ron", "2")));
        assert_ne!(first, id(put("b/other.ron", "1")));
    }
}
