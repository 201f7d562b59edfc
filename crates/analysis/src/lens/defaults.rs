//! A lens and how it is meant to be used, as far as its file says: the defaults of commands.

use dioptric_optics::{Field, Iris, Lens, LensFile, glam::DVec2};

use crate::{AnalysisFields, AnalysisFilm, ConfigurationData, FilmUse};
use dioptric_pipeline::{
    LensReadOptions, LensSpec, Movements, PipelineError, REFERENCE_WAVELENGTH_NM, StopSpec, nearest_to_reference_nm,
    with_blades,
};

/// A lens, and what its file says of its use.
#[derive(Clone, Debug, PartialEq)]
pub struct LensDefaults {
    /// The lens.
    pub lens: Lens,
    /// What the file says and this program does otherwise or not at all, a sentence each.
    pub notes: Vec<String>,
    /// The wavelengths that the file names, of those at which all media are known, nm.
    pub wavelengths_nm: Vec<f64>,
    /// The weight of each of them; empty where they count alike.
    wavelength_weights: Vec<f64>,
    /// The one of them that is the main one, nm.
    pub reference_nm: Option<f64>,
    /// Distance of the object before the first vertex, mm; infinite where it is far or not stated.
    pub distance_mm: f64,
    /// What the file calls each surface; empty where it names none.
    pub surface_comments: Vec<String>,
    /// The points of the field, as the file names them.
    fields: Vec<Field>,
    /// How much each of them counts; empty where they count alike.
    field_weights: Vec<f64>,
    /// The file, of one that has several configurations.
    several: Option<Box<LensFile>>,
    /// Distance of the film behind the last vertex that the file states, mm.
    pub film_distance_mm: Option<f64>,
}

impl LensDefaults {
    /// Returns the lens that `LENS` on the command line means, with its stop set to `stop_mm` where given, and what its file
    /// says of its use.
    ///
    /// # Errors
    /// When there is no such lens, its file or a catalogue cannot be read, or the stop does not open so far.
    pub fn open(text: &str, reading: &LensReadOptions, stop_mm: Option<f64>) -> Result<Self, PipelineError> {
        let mut used = Self::of(LensSpec::named(text).open(reading)?);
        used.lens = stop_mm.map_or(StopSpec::AsGiven, StopSpec::DiameterMm).apply(used.lens)?;
        Ok(used)
    }

    /// Returns it with the stop of the lens set, with blades where there are any, and the lens turned and moved; an f-number is that at this wavelength, nm. What is to
    /// be noted about the stop is added to the notes.
    ///
    /// # Errors
    /// When the stop does not open so far, a movement is not finite, or a glass is not known at the wavelength.
    pub fn placed(
        self,
        stop: StopSpec,
        iris: Option<Iris>,
        movements: Movements,
        wavelength_nm: f64,
    ) -> Result<Self, PipelineError> {
        let mut notes = self.notes;
        notes.extend(stop.note_at(&self.lens, wavelength_nm));
        let lens = stop.apply_at(with_blades(self.lens, iris)?, wavelength_nm)?;
        notes.extend(lens.note_on_iris());
        let lens = movements.apply_at(lens, wavelength_nm)?;
        let mono = lens.at(wavelength_nm)?;
        notes.extend([mono.note_on_limit(self.distance_mm), mono.note_on_bent_axis()].into_iter().flatten());
        Ok(Self { lens, notes, ..self })
    }

    /// Returns what a file says.
    pub fn of(file: LensFile) -> Self {
        let is_known = |nm: &f64| file.lens.at(*nm).is_ok();
        let wavelengths_nm: Vec<f64> = file.wavelengths_nm.iter().copied().filter(is_known).collect();
        let weighed = file.wavelengths_nm.iter().zip(&file.wavelength_weights);
        let wavelength_weights = weighed.filter(|(nm, _)| is_known(nm)).map(|(_, weight)| *weight).collect();
        let several = (file.configurations.len() > 1).then(|| Box::new(file.clone()));
        let is_solved = file.film_distance_mm != Some(0.0);
        let unsolved = (!is_solved).then(|| {
            "the file's image plane lies on the last surface, as where its distance was never solved for: the best focus stands for it, \
             and --film-mm puts it elsewhere"
                .to_owned()
        });
        let weightless = [&file.wavelength_weights, &file.field_weights]
            .into_iter()
            .any(|weights| !weights.is_empty() && weights.iter().all(|weight| *weight == 0.0));
        let weightless = weightless.then(|| "weights that are all 0 count as alike".to_owned());
        Self {
            several,
            wavelength_weights,
            reference_nm: file.main_wavelength_nm().filter(is_known),
            wavelengths_nm,
            distance_mm: file.object_distance_mm.unwrap_or(f64::INFINITY),
            surface_comments: file.surface_comments,
            fields: file.fields,
            field_weights: file.field_weights,
            film_distance_mm: file.film_distance_mm.filter(|_| is_solved),
            lens: file.lens,
            notes: file.notes.into_iter().chain(unsolved).chain(weightless).collect(),
        }
    }

    /// Returns all configurations of a file that has several; nothing of others.
    ///
    /// # Errors
    /// When a glass is not known at the wavelength.
    pub fn configurations(&self, wavelength_nm: f64) -> Result<Vec<ConfigurationData>, PipelineError> {
        self.several.as_ref().map_or(Ok(Vec::new()), |file| ConfigurationData::all(file, wavelength_nm))
    }

    /// Whether all media of the lens are known at a wavelength.
    pub fn is_known_at(&self, wavelength_nm: f64) -> bool {
        self.lens.at(wavelength_nm).is_ok()
    }

    /// Returns the wavelength of focus and f-number where these are looked at, nm, as [`FilmUse::reference`] has it.
    ///
    /// # Errors
    /// When the lens is not known there.
    pub fn focus_wavelength_nm(&self, wavelengths_nm: &[f64]) -> Result<f64, PipelineError> {
        let of = FilmUse { main_nm: self.reference_nm, wavelengths_nm, weights: &[], distance_mm: self.distance_mm };
        Ok(of.reference(&self.lens)?.wavelength_nm())
    }

    /// Returns the wavelengths that stand for those not asked for, nm: the file's; else the usual ones; else, of a lens
    /// that is not known there, as many evenly within the range that its media are known in.
    pub fn wavelengths_or(&self, usual_nm: &[f64]) -> Vec<f64> {
        match (self.wavelengths_nm.is_empty(), known_range_nm(&self.lens)) {
            (false, _) => self.wavelengths_nm.clone(),
            (true, Some((first_nm, last_nm))) if !usual_nm.iter().all(|&nm| self.is_known_at(nm)) => {
                let step_nm = (last_nm - first_nm) / (usual_nm.len() + 1) as f64;
                (1..=usual_nm.len()).map(|i| (first_nm + step_nm * i as f64).round()).collect()
            }
            _ => usual_nm.to_vec(),
        }
    }

    /// Returns the weights of these wavelengths, if they are those of the file and it weighs them; none where they count alike.
    pub fn weights_of(&self, wavelengths_nm: &[f64]) -> Vec<f64> {
        let weights = &self.wavelength_weights;
        let are_weights = weights.iter().all(|weight| *weight >= 0.0) && weights.iter().any(|weight| *weight > 0.0);
        match wavelengths_nm == self.wavelengths_nm && are_weights {
            true => weights.clone(),
            false => Vec::new(),
        }
    }

    /// Returns how much so many points of the field count, if they are those of the file and it weighs them; none where they count alike.
    pub fn field_weights(&self, n_fields: usize) -> Vec<f64> {
        let weights = &self.field_weights;
        let are_weights = weights.iter().all(|weight| *weight >= 0.0) && weights.iter().any(|weight| *weight > 0.0);
        if weights.len() == n_fields && are_weights { weights.clone() } else { Vec::new() }
    }

    /// Returns where the film is that nobody asked for: at the image plane that the file states, else where the spot on the axis is
    /// smallest.
    pub fn film(&self) -> AnalysisFilm {
        self.film_distance_mm.map_or(AnalysisFilm::BestFocus, AnalysisFilm::OfFile)
    }

    /// Returns the field angles along x and y that stand for those of the file, degrees: of a lens with an axis of symmetry all
    /// to the right of the axis, each once; `None` where the file names none.
    pub fn psf_fields_deg(&self, wavelength_nm: f64) -> Option<Vec<[f64; 2]>> {
        if self.lens.is_rotational() {
            let mut fields_deg = self.drawing_fields_deg(wavelength_nm)?;
            fields_deg.iter_mut().for_each(|field_deg| *field_deg = field_deg.abs());
            fields_deg.sort_by(f64::total_cmp);
            fields_deg.dedup();
            return Some(fields_deg.into_iter().map(|field_deg| [field_deg, 0.0]).collect());
        }
        let way_mm = self.distance_mm + self.lens.at(wavelength_nm).ok()?.projection_center_z_mm();
        let of_height = |height_mm: &[f64; 2]| height_mm.map(|mm| (mm / way_mm).atan().to_degrees());
        match self.analysis_fields(wavelength_nm)? {
            AnalysisFields::AnglesDeg(angles_deg) => Some(angles_deg),
            AnalysisFields::HeightsMm(heights_mm) => Some(heights_mm.iter().map(of_height).collect()),
            AnalysisFields::ByLight => None,
        }
    }

    /// Returns the one wavelength that stands where none is asked for, nm: the file's main one, else as
    /// [`wavelengths_or`](Self::wavelengths_or) with 550 nm.
    pub fn wavelength_or_usual(&self) -> f64 {
        let among = || nearest_to_reference_nm(&self.wavelengths_or(&[REFERENCE_WAVELENGTH_NM]));
        self.reference_nm.unwrap_or_else(among)
    }

    /// Returns the points of the field that the file names, by first-order optics at a wavelength where it states paraxial
    /// image heights, by real chief rays where it states real ones; `None` where it names none, or a height that none has.
    ///
    /// Design programs state where light goes to: a positive angle is one of rising light, of an object below the axis. Of a
    /// lens with an axis of symmetry that is the same, and the numbers stay as they are.
    pub fn analysis_fields(&self, wavelength_nm: f64) -> Option<AnalysisFields> {
        let mono = self.lens.at(wavelength_nm).ok()?;
        let first = mono.first_order();
        let sign = if mono.is_rotational() { 1.0 } else { -1.0 };
        // Not −0.
        let far = |tan: DVec2| tan.to_array().map(|tan| tan.atan().to_degrees() + 0.0);
        let (mut angles_deg, mut heights_mm) = (Vec::new(), Vec::new());
        for field in &self.fields {
            match *field {
                Field::Angle { x_deg, y_deg } => angles_deg.push([x_deg, y_deg].map(|deg| sign * deg + 0.0)),
                Field::ObjectHeight { x_mm, y_mm } => heights_mm.push([x_mm, y_mm]),
                Field::RealImageHeight { x_mm, y_mm } => {
                    let way_mm = self.distance_mm + mono.projection_center_z_mm();
                    let film_distance_mm =
                        self.film_distance_mm.or_else(|| mono.film_distance_mm_for(self.distance_mm).ok())?;
                    let tan =
                        -sign * mono.field_tan_of_image(DVec2::new(x_mm, y_mm), film_distance_mm, 1e3 / way_mm)?;
                    match self.distance_mm.is_finite() {
                        true => heights_mm.push((tan * way_mm).to_array()),
                        false => angles_deg.push(far(tan)),
                    }
                }
                Field::ImageHeight { x_mm, y_mm } if self.distance_mm.is_finite() => {
                    let scale = -sign / mono.conjugate(self.distance_mm).magnification;
                    heights_mm.push([scale * x_mm, scale * y_mm]);
                }
                Field::ImageHeight { x_mm, y_mm } => {
                    angles_deg.push(far(sign * DVec2::new(x_mm, y_mm) / (first.efl_mm * first.object_index)));
                }
            }
        }
        match (angles_deg.is_empty(), heights_mm.is_empty()) {
            (false, true) => Some(AnalysisFields::AnglesDeg(angles_deg)),
            (true, false) if self.distance_mm.is_finite() => Some(AnalysisFields::HeightsMm(heights_mm)),
            _ => None,
        }
    }

    /// Returns the field angles in the plane of a drawing, degrees, each once; `None` where the file names none.
    ///
    /// Of a lens with an axis of symmetry they are the angles from the axis, of others those in the y–z plane.
    pub fn drawing_fields_deg(&self, wavelength_nm: f64) -> Option<Vec<f64>> {
        let mono = self.lens.at(wavelength_nm).ok()?;
        let way_mm = self.distance_mm + mono.projection_center_z_mm();
        let is_rotational = mono.is_rotational();
        let degrees = |tan: DVec2| if is_rotational && tan.x != 0.0 { tan.length() } else { tan.y }.atan().to_degrees();
        let of_angles = |[x_deg, y_deg]: &[f64; 2]| match *x_deg == 0.0 {
            true => *y_deg,
            false => degrees(DVec2::new(x_deg.to_radians().tan(), y_deg.to_radians().tan())),
        };
        let mut fields_deg: Vec<f64> = match self.analysis_fields(wavelength_nm)? {
            AnalysisFields::AnglesDeg(angles) => angles.iter().map(of_angles).collect(),
            AnalysisFields::HeightsMm(heights) => heights.iter().map(|&h| degrees(DVec2::from(h) / way_mm)).collect(),
            AnalysisFields::ByLight => return None,
        };
        fields_deg.retain(|field| field.abs() < 89.9);
        fields_deg.sort_by(f64::total_cmp);
        fields_deg.dedup();
        (!fields_deg.is_empty()).then_some(fields_deg)
    }
}

/// Returns the range in which all media of a lens are known, nm; `None` where none of them states an end.
fn known_range_nm(lens: &Lens) -> Option<(f64, f64)> {
    let media = lens.interfaces().iter().map(|interface| &interface.medium_after).chain([lens.object_medium()]);
    let narrower = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.min(b.1));
    media.filter_map(|medium| medium.range_nm()).reduce(narrower).filter(|(first, last)| first < last)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use dioptric_optics::ReadOptions;

    use super::*;

    fn of_file(path: &str, text: &str) -> LensDefaults {
        LensDefaults::of(LensFile::from_bytes(Path::new(path), text.as_bytes(), &ReadOptions::default()).unwrap())
    }

    fn read(keys: &str, glass: &str) -> LensDefaults {
        let text = format!("RDM\nEPD 5\n{keys}\nS 50 5 {glass}\n STO\nS -50 60\nSI 0\n");
        of_file("a.seq", &text)
    }

    #[test]
    fn fields_of_every_kind_are_those_of_the_file() {
        let fields = |keys: &str| {
            let lens = read(keys, "1.5");
            (lens.analysis_fields(550.0), lens.drawing_fields_deg(550.0))
        };
        let angles = |list: &[[f64; 2]]| Some(AnalysisFields::AnglesDeg(list.to_vec()));
        assert_eq!(
            fields("YAN 0 7 10\nSO 0 1E10"),
            (angles(&[[0.0, 0.0], [0.0, 7.0], [0.0, 10.0]]), Some(vec![0.0, 7.0, 10.0]))
        );
        let heights = |list: &[[f64; 2]]| Some(AnalysisFields::HeightsMm(list.to_vec()));
        let (of_heights, drawn) = fields("YOB 0 -3\nXOB 0 4\nSO 0 200");
        assert_eq!(of_heights, heights(&[[0.0, 0.0], [4.0, -3.0]]));
        // The stop is the first surface: 5 mm from the axis at 200 mm.
        assert!((drawn.unwrap()[1] - (5.0_f64 / 200.0).atan().to_degrees()).abs() < 1e-12);
        // A far image height h is seen under h/f.
        let efl_mm = read("SO 0 1E10", "1.5").lens.at(550.0).unwrap().first_order().efl_mm;
        let Some(AnalysisFields::AnglesDeg(found)) = fields("YIM 0 5\nSO 0 1E10").0 else { panic!("angles") };
        assert!((found[1][1].to_radians().tan() - 5.0 / efl_mm).abs() < 1e-15);
        // Real heights are those at which chief rays meet the image, 60 mm behind the lens.
        let lens = read("YRI 0 5\nSO 0 1E10", "1.5");
        let Some(AnalysisFields::AnglesDeg(found)) = lens.analysis_fields(550.0) else { panic!("angles") };
        let mono = lens.lens.at(550.0).unwrap();
        let tan = DVec2::new(0.0, found[1][1].to_radians().tan());
        let point = dioptric_optics::ObjectPoint::from_field(&mono, tan, 0.0);
        assert!((mono.chief_film_point_mm(&point, 60.0).unwrap().y + 5.0).abs() < 1e-9, "{found:?}");
        let Some(AnalysisFields::HeightsMm(found)) = fields("YIM 0 5\nSO 0 200").0 else { panic!("heights") };
        let magnification = read("SO 0 1E10", "1.5").lens.at(550.0).unwrap().conjugate(200.0).magnification;
        assert!((found[1][1] + 5.0 / magnification).abs() < 1e-12 && found[1][1] > 0.0);
        assert_eq!(fields("SO 0 1E10"), (None, None));
    }

    #[test]
    fn angle_of_rising_light_is_an_object_below_a_lens_without_symmetry() {
        let lens = read("YAN 0 10\nSO 0 1E10", "1.5\n CYL; CUX 0");
        assert_eq!(lens.drawing_fields_deg(550.0), Some(vec![-10.0, 0.0]));
    }

    #[test]
    fn wavelengths_are_those_of_the_file_or_within_what_its_glasses_know() {
        let wavelengths = |keys: &str, glass: &str| {
            let lens = read(keys, glass);
            (lens.wavelengths_or(&[450.0, 550.0, 650.0]), lens.wavelength_or_usual())
        };
        assert_eq!(wavelengths("WL 656 588 486\nREF 2\nSO 0 1E10", "1.5"), (vec![656.0, 588.0, 486.0], 588.0));
        assert_eq!(wavelengths("WL 500 10000\nREF 2\nSO 0 1E10", "GERMANIUM"), (vec![10_000.0], 10_000.0));
        assert_eq!(wavelengths("SO 0 1E10", "NBK7_SCHOTT"), (vec![450.0, 550.0, 650.0], 550.0));
        let text = "(name: \"ir\", source: \"test\", surfaces: [(radius_mm: 50.0, stop: true, semi_aperture_mm: 5.0,
            medium: Named(\"MISC:GERMANIUM\"), thickness_mm: 2.0), (radius_mm: 70.0, semi_aperture_mm: 5.0,
            thickness_mm: 0.0)])";
        let infrared = of_file("a.ron", text);
        // Of wavelengths that nobody sees one is the main one; of others 550 nm stand for it.
        let main = |list: &str| {
            of_file("a.ron", &text.replace("source:", &format!("wavelengths_nm: {list}, source:"))).reference_nm
        };
        assert_eq!(main("[9000.0, 5000.0]"), Some(5000.0));
        assert_eq!(read("WL 656 486\nSO 0 1E10", "1.5").wavelengths_or(&[550.0]), [656.0, 486.0]);
        assert_eq!(infrared.wavelengths_or(&[450.0, 550.0, 650.0]), [5000.0, 8000.0, 11_000.0]);
        assert_eq!(infrared.wavelength_or_usual(), 8000.0);
    }

    #[test]
    fn stop_is_set() {
        let open = |text: &str, stop_mm| LensDefaults::open(text, &LensReadOptions::default(), stop_mm);
        let lens = open("dgauss-50mm", Some(8.0)).unwrap().lens;
        assert_eq!(lens.stop_semi_aperture_mm(), 4.0);
        assert!(open("dgauss-50mm", Some(80.0)).is_err());
        let message = open("no-such-lens", None).unwrap_err().to_string();
        assert!(message.contains("no-such-lens") && message.contains("dgauss-50mm"), "{message}");
    }
}
