//! A camera in words for elsewhere: a camera file, a command line, Python.

use dioptric_pipeline::{
    Camera, Diffraction, FilmSpec, FocusSpec, FramesSpec, Iris, LensReadOptions, LensSpec, PICTURE, SensorSpec,
    StopSpec, light_word, with_analog_gain, with_exposure_s,
};
use dioptric_sensor::{Exposure, ExposureControl, NoiseSource, NoiseSources};

use super::{Session, absolute};

/// Returns the text of the camera file, its paths absolute.
pub fn as_ron(camera: &Camera) -> String {
    let mut text = absolute(camera).to_ron();
    text.push('\n');
    text
}

/// Returns a command for a shell that takes this picture: options of `dioptric run` where they can say what differs from the file
/// or from the demo, else a command that writes the camera file first.
pub fn as_command(session: &Session) -> String {
    let base = Base::of(session);
    match base.words(session.camera(), Tongue::Shell) {
        Some(words) => {
            let file = base.path.iter().map(|path| quoted(path));
            let parts = ["dioptric run".to_owned()].into_iter().chain(file);
            let options = words.into_iter().map(|Word { key, value }| format!("--{key} {}", quoted(&value)));
            parts.chain(options).collect::<Vec<_>>().join(" ")
        }
        // The file lies in a folder of its own, so that none that is there is written over.
        None => {
            let ron = as_ron(session.camera());
            format!("file=$(mktemp -d)/camera.ron\ncat > \"$file\" <<'END'\n{ron}END\ndioptric run \"$file\"")
        }
    }
}

/// Returns lines of Python that take this picture.
pub fn as_python(session: &Session) -> String {
    let base = Base::of(session);
    let start = base.path.as_ref().map_or("dp.Camera.demo()".to_owned(), |path| format!("dp.Camera.read({path:?})"));
    let camera = match base.words(session.camera(), Tongue::Python) {
        Some(words) if words.is_empty() => start,
        Some(words) => {
            let changes: Vec<String> = words.into_iter().map(|Word { key, value }| format!("{key}={value}")).collect();
            format!("{start}.with_({})", changes.join(", "))
        }
        None => format!("dp.Camera.from_ron(r'''\n{}''')", as_ron(session.camera())),
    };
    format!("import dioptric as dp\n\ncamera = {camera}\nshot = camera.render()\nshot.save(\"dioptric-out\")\n")
}

/// Who reads the words.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Tongue {
    Shell,
    Python,
}

/// A word that changes a camera, and its value as it is written.
struct Word {
    key: String,
    value: String,
}

/// What a command starts from.
struct Base {
    camera: Camera,
    path: Option<String>,
}

/// The words so far, and the camera that they make.
struct Telling {
    tongue: Tongue,
    made: Camera,
    words: Vec<Word>,
}

impl Base {
    fn of(session: &Session) -> Self {
        match (session.path(), session.kept()) {
            (Some(path), Some(kept)) => {
                let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
                Self { camera: kept.clone(), path: Some(path.display().to_string()) }
            }
            _ => Self { camera: Camera::demo().unwrap_or_else(|_| session.camera().clone()), path: None },
        }
    }

    /// Returns the words that make a camera of this one; `None` where words cannot.
    fn words(&self, camera: &Camera, tongue: Tongue) -> Option<Vec<Word>> {
        let mut telling = Telling { tongue, made: self.camera.clone(), words: Vec::new() };
        // The demo has a film for its own lens and scene, which the command line changes with them.
        if camera.lens != telling.made.lens && self.path.is_some() && tongue == Tongue::Shell {
            telling.lens(camera);
        }
        telling.optics(camera);
        telling.sensor(camera);
        telling.scene(camera);
        telling.processing(camera);
        let Telling { mut made, words, .. } = telling;
        // Neither changes the picture.
        made.name.clone_from(&camera.name);
        made.outputs.clone_from(&camera.outputs);
        (made == *camera).then_some(words)
    }
}

impl Telling {
    fn number(&mut self, key: &str, value: f64) {
        self.word(key, format!("{value}"));
    }

    fn text(&mut self, key: &str, value: &str) {
        let value = if self.tongue == Tongue::Python { format!("{value:?}") } else { value.to_owned() };
        self.word(key, value);
    }

    fn word(&mut self, key: &str, value: String) {
        let key = if self.tongue == Tongue::Python { key.replace('-', "_") } else { key.to_owned() };
        self.words.push(Word { key, value });
    }

    fn lens(&mut self, camera: &Camera) {
        let Some(named) = camera.lens.text() else { return };
        if LensSpec::named(&named) == camera.lens {
            self.text("lens", &named);
            self.made.lens = camera.lens.clone();
            (self.made.stop, self.made.lens_reading) = (StopSpec::AsGiven, LensReadOptions::default());
            self.made.iris = None;
        }
    }

    fn optics(&mut self, camera: &Camera) {
        if camera.stop != self.made.stop {
            match camera.stop {
                StopSpec::FNumber(n) => self.number("f-number", n),
                StopSpec::DiameterMm(d) => self.number("stop-mm", d),
                StopSpec::AsGiven => return,
            }
            self.made.stop = camera.stop;
        }
        if let Some(Iris { blades, rotation_deg, curvature }) = camera.iris
            && camera.iris != self.made.iris
        {
            self.number("blades", f64::from(blades));
            self.number("blade-rotation-deg", rotation_deg);
            self.number("blade-curvature", curvature);
            self.made.iris = camera.iris;
        }
        if camera.focus != self.made.focus {
            match camera.focus {
                FocusSpec::DistanceMm(d) => self.number("focus-mm", d),
                FocusSpec::FilmMm(d) => self.number("film-mm", d),
                FocusSpec::NearObject => return,
            }
            self.made.focus = camera.focus;
        }
        let (new, old) = (camera.movements, self.made.movements);
        for (key, new, old) in [
            ("tilt-deg", new.tilt_deg, old.tilt_deg),
            ("swing-deg", new.swing_deg, old.swing_deg),
            ("rise-mm", new.rise_mm, old.rise_mm),
            ("shift-mm", new.shift_mm, old.shift_mm),
        ] {
            if new != old {
                self.number(key, new);
            }
        }
        self.made.movements = camera.movements;
        if camera.diffraction != self.made.diffraction {
            let word = match camera.diffraction {
                Diffraction::None => "none",
                Diffraction::Hurb { gamma: 1.0 } => "hurb",
                Diffraction::HurbCalibrated => "hurb-calibrated",
                Diffraction::Wave => "wave",
                Diffraction::Hurb { .. } => return,
            };
            self.text("diffraction", word);
            self.made.diffraction = camera.diffraction;
        }
        if camera.psfs != self.made.psfs {
            let named = camera.psfs.as_ref().map_or_else(|| "none".to_owned(), |path| path.display().to_string());
            self.text("psfs", &named);
            self.made.psfs.clone_from(&camera.psfs);
        }
        if camera.blur != self.made.blur {
            self.text("blur", &camera.blur.to_string());
            self.made.blur = camera.blur;
        }
        if camera.border != self.made.border {
            self.text("border", &camera.border.to_string());
            self.made.border = camera.border;
        }
        if camera.lens_reflections != self.made.lens_reflections {
            self.text("lens_reflections", &camera.lens_reflections.to_string());
            self.made.lens_reflections = camera.lens_reflections;
        }
    }

    fn sensor(&mut self, camera: &Camera) {
        if camera.sensor != self.made.sensor {
            let named = match &camera.sensor {
                SensorSpec::BuiltIn(name) => name.clone(),
                SensorSpec::File(path) => path.display().to_string(),
            };
            if SensorSpec::named(&named) != camera.sensor {
                return;
            }
            self.text("sensor", &named);
            (self.made.sensor, self.made.film) = (camera.sensor.clone(), FilmSpec::Sensor);
        }
        if let FilmSpec::Pixels { columns, rows, pitch_um } = camera.film
            && camera.film != self.made.film
        {
            match self.tongue {
                Tongue::Shell => self.word("pixels", format!("{columns}x{rows}")),
                Tongue::Python => self.word("pixels", format!("({columns}, {rows})")),
            }
            self.number("pixel-um", pitch_um);
            self.made.film = camera.film;
        }
        if camera.dual_pixel != self.made.dual_pixel {
            self.text("dual-pixel", &camera.dual_pixel.map_or_else(|| "none".to_owned(), |spec| spec.to_string()));
            self.made.dual_pixel = camera.dual_pixel;
        }
        let time_s = |control: &ExposureControl| match control {
            ExposureControl::Manual(exposure) => Some(exposure.time_s),
            ExposureControl::Auto(_) => None,
        };
        if let Some(new_s) = time_s(&camera.exposure).filter(|new_s| Some(*new_s) != time_s(&self.made.exposure)) {
            self.number("exposure-s", new_s);
            self.made.exposure = with_exposure_s(self.made.exposure, new_s);
        }
        let (shot, made) = (*camera.exposure.shot(), *self.made.exposure.shot());
        if shot.analog_gain != made.analog_gain {
            self.number("analog-gain", shot.analog_gain);
            self.made.exposure = with_analog_gain(self.made.exposure, shot.analog_gain);
        }
        if shot.binning != made.binning {
            self.word("binning", shot.binning.map_or("none".to_owned(), |binning| binning.to_string()));
            self.made.exposure = self.made.exposure.with_shot(|made| Exposure { binning: shot.binning, ..made });
        }
        if camera.noise != self.made.noise {
            self.text("noise", &noise_words(camera.noise));
            self.made.noise = camera.noise;
        }
        if let (FramesSpec::Burst(n), true) = (&camera.frames, camera.frames != self.made.frames) {
            self.word("burst", n.to_string());
            self.made.frames = camera.frames.clone();
        }
        if camera.seed != self.made.seed {
            self.word("seed", camera.seed.to_string());
            self.made.seed = camera.seed;
        }
    }

    fn scene(&mut self, camera: &Camera) {
        let (new, old) = (&camera.scene, self.made.scene.clone());
        for (key, new, old) in [
            ("fov-deg", new.field_of_view_deg, old.field_of_view_deg),
            ("depth-m", new.depth_m, old.depth_m),
            ("illuminance-lux", new.illuminance_lux, old.illuminance_lux),
        ] {
            if let Some(new) = new.filter(|new| Some(*new) != old) {
                self.number(key, new);
            }
        }
        let made = &mut self.made.scene;
        made.field_of_view_deg = new.field_of_view_deg.or(old.field_of_view_deg);
        made.depth_m = new.depth_m.or(old.depth_m);
        made.illuminance_lux = new.illuminance_lux.or(old.illuminance_lux);
        if let Some(light) = new.illuminant.as_ref().filter(|light| Some(*light) != old.illuminant.as_ref())
            && let Some(word) = light_word(light)
        {
            self.text("illuminant", &word);
            self.made.scene.illuminant = Some(light.clone());
        }
    }

    fn processing(&mut self, camera: &Camera) {
        for key in &PICTURE {
            let Some(word) = key.word(&camera.processing) else { continue };
            if key.word(&self.made.processing).as_ref() == Some(&word) {
                continue;
            }
            let mut changed = self.made.processing.clone();
            if key.set(&mut changed, &word).is_ok() {
                self.made.processing = changed;
                if key.is_number() { self.word(key.option, word) } else { self.text(key.option, &word) }
            }
        }
    }
}

/// Returns the sources of noise as a command line has them.
fn noise_words(noise: NoiseSources) -> String {
    let on: Vec<&str> =
        NoiseSource::NAMES.iter().filter(|(_, source)| noise.has(*source)).map(|(name, _)| *name).collect();
    match on.len() {
        0 => "none".to_owned(),
        n if n == NoiseSource::NAMES.len() => "all".to_owned(),
        _ => on.join(","),
    }
}

/// Returns a word for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:+=%@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use dioptric_spectrum::Illuminant;

    use super::*;

    fn changed(change: impl FnOnce(&mut Camera)) -> Session {
        let mut session = Session::new(Camera::demo().unwrap());
        let mut camera = session.camera().clone();
        change(&mut camera);
        session.change(camera, None);
        session
    }

    #[test]
    fn options_say_what_differs_from_the_demo() {
        assert_eq!(as_command(&changed(|_| {})), "dioptric run");
        let session = changed(|camera| {
            camera.stop = StopSpec::FNumber(2.8);
            camera.movements.swing_deg = -3.5;
            camera.noise = NoiseSources::only(&[NoiseSource::Photon, NoiseSource::Read]);
            camera.scene.illuminant = Some(Illuminant::Blackbody(3200.0));
            camera.sensor = SensorSpec::BuiltIn("imx363".to_owned());
        });
        let options = "--f-number 2.8 --swing-deg -3.5 --sensor imx363 --pixels 960x640 --pixel-um 33 --noise photon,read \
                       --illuminant 3200K";
        assert_eq!(as_command(&session), format!("dioptric run {options}"));
        let python = as_python(&session);
        let words =
            "dp.Camera.demo().with_(f_number=2.8, swing_deg=-3.5, sensor=\"imx363\", pixels=(960, 640), pixel_um=33, ";
        assert!(python.contains(words), "{python}");
    }

    #[test]
    fn a_camera_that_has_no_words_is_written_out() {
        let session =
            changed(|camera| camera.processing.white = dioptric_sensor::WhiteBalance::Gains(vec![2.0, 1.0, 1.5]));
        let text = as_command(&session);
        let start = "file=$(mktemp -d)/camera.ron\ncat > \"$file\" <<'END'\n";
        let ron = text.strip_prefix(start).unwrap().split("END\n").next().unwrap();
        assert!(text.ends_with("END\ndioptric run \"$file\""));
        assert_eq!(Camera::parse(ron, Path::new("/camera.ron")).unwrap(), *session.camera());
        let python = as_python(&session);
        let ron = python.split("'''").nth(1).unwrap();
        assert_eq!(Camera::parse(ron, Path::new("/camera.ron")).unwrap(), *session.camera());
    }

    #[test]
    fn a_file_is_named_and_quoted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("my camera.ron");
        let mut session = changed(|camera| camera.seed = 9);
        session.save(&path).unwrap();
        assert_eq!(as_command(&session), format!("dioptric run '{}'", path.display()));
        let lens = Camera { lens: LensSpec::BuiltIn("tessar-50mm".to_owned()), ..session.camera().clone() };
        session.change(lens, None);
        // Another lens starts at its own stop.
        assert!(as_command(&session).ends_with("my camera.ron' --lens tessar-50mm --f-number 4"));
    }
}
