//! Schematic eyes: models of the human eye by surfaces, accommodated by so many dioptres.

use crate::{Glass, GlassCatalogue, ImageSurface, Interface, Lens, OpticsError, Shape, Surface, formats::LensFile};

/// A schematic eye, looking at a distance.
///
/// Light falls on the cornea first; the stop is the pupil, 4 mm wide, in the plane of the front of the lens, and the film is the retina.
/// Models say nothing of how far the media reach: the cornea is 5.8 mm wide from the axis (its rear 5.2 mm), the lens 4.5 mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchematicEye {
    /// Whose model it is.
    pub model: EyeModel,
    /// One over the distance from the cornea that the eye is accommodated to, 1/m; 0 for a relaxed eye.
    pub accommodation_dioptres: f64,
}

/// A model of the human eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EyeModel {
    /// Navarro, Santamaría and Bescós 1985, Journal of the Optical Society of America A 2, 1273: conics, whose lens and depth before it
    /// change with accommodation while the depth behind it stays, and the dispersion of its media. The retina is that of Escudero-Sanz and Navarro 1999, ibid. 16, 1881.
    Navarro,
    /// The Arizona eye: Schwiegerling 2004, Field Guide to Visual and Ophthalmic Optics (SPIE), page 16.
    Arizona,
    /// The full theoretical eye of Le Grand, relaxed and fully accommodated: Le Grand and El Hage 1980, Physiological Optics (Springer). Its
    /// indices are of one wavelength: media disperse as Navarro's, and the retina is Navarro's.
    LeGrand,
}

/// The wavelength that schematic eyes are stated at, nm.
const EYE_NM: f64 = 589.3;
/// How far the accommodation of models that have it goes, dioptres.
const MOST_DIOPTRES: f64 = 10.0;
/// The accommodation of Le Grand's second state, dioptres: what its prescription makes of it, to the digits of its name.
const LE_GRAND_NEAR: f64 = 7.05;
/// Half the widths of the cornea, front and rear, of the pupil and of the lens, mm.
const CORNEA_MM: [f64; 2] = [5.8, 5.2];
const PUPIL_MM: f64 = 2.0;
const LENS_MM: f64 = 4.5;

/// What differs between eyes: radii, conic constants and distances from the front of the cornea on, the media behind each surface, and the
/// radius of the retina, mm.
struct Numbers {
    radii_mm: [f64; 4],
    conics: [f64; 4],
    thicknesses_mm: [f64; 4],
    media: [Glass; 4],
    retina_mm: f64,
}

impl SchematicEye {
    /// Their names, relaxed.
    pub const NAMES: [&str; 3] = ["eye:navarro", "eye:arizona", "eye:legrand"];
    /// How these eyes are named.
    pub const PATTERNS: &str = "eye:navarro, eye:arizona, eye:legrand, accommodated as eye:navarro:4D";

    /// Returns the eye of such a name; `None` for names of other kinds.
    ///
    /// # Errors
    /// When the name begins as these do and goes on otherwise, or the model is not known to accommodate so far.
    pub fn named(name: &str) -> Option<Result<Self, OpticsError>> {
        let rest = name.strip_prefix("eye:").or_else(|| (name == "eye").then_some(""))?;
        let (model, state) = rest.split_once(':').map_or((rest, None), |(model, state)| (model, Some(state)));
        let model = match model.to_ascii_lowercase().as_str() {
            "navarro" => Some(EyeModel::Navarro),
            "arizona" => Some(EyeModel::Arizona),
            "legrand" => Some(EyeModel::LeGrand),
            _ => None,
        };
        let dioptres = match state {
            None => Some(0.0),
            Some(text) => text.trim().strip_suffix(['D', 'd']).and_then(|text| text.trim().parse::<f64>().ok()),
        };
        let unknown = |known: String| OpticsError::Unknown { kind: "lens", name: name.to_owned(), known };
        let Some((model, dioptres)) = model.zip(dioptres) else {
            return Some(Err(unknown(format!("schematic eyes are named {}", Self::PATTERNS))));
        };
        let eye = Self { model, accommodation_dioptres: dioptres };
        Some(if eye.is_known() { Ok(eye) } else { Err(unknown(eye.known_states())) })
    }

    fn is_known(self) -> bool {
        let dioptres = self.accommodation_dioptres;
        match self.model {
            EyeModel::Navarro | EyeModel::Arizona => (0.0..=MOST_DIOPTRES).contains(&dioptres),
            EyeModel::LeGrand => dioptres == 0.0 || dioptres == LE_GRAND_NEAR,
        }
    }

    fn known_states(self) -> String {
        match self.model {
            EyeModel::LeGrand => format!("Le Grand's eye is known relaxed and at {LE_GRAND_NEAR}D"),
            _ => format!("the eye accommodates by 0 to {MOST_DIOPTRES} D, as {}", Self::PATTERNS),
        }
    }

    /// Returns the eye as a lens with the retina for its film and, of an accommodated one, its object.
    ///
    /// # Errors
    /// When the model is not known to accommodate so far.
    pub fn file(self) -> Result<LensFile, OpticsError> {
        if !self.is_known() {
            let (name, known) = (format!("{:?}", self.model), self.known_states());
            return Err(OpticsError::Unknown { kind: "lens", name, known });
        }
        let (name, source) = self.title();
        let Numbers { radii_mm, conics, thicknesses_mm, media, retina_mm } = self.numbers()?;
        let rims_mm = [CORNEA_MM[0], CORNEA_MM[1], LENS_MM, LENS_MM];
        let [cornea, aqueous, lens, vitreous] = media;
        let side = |i: usize, medium_after: Glass, thickness_after_mm: f64| {
            let shape = if conics[i] == 0.0 { Shape::Sphere } else { Shape::Conic { conic: conics[i] } };
            let surface = Surface { shape, ..Surface::sphere(radii_mm[i], rims_mm[i]) };
            Interface { surface, medium_after, thickness_after_mm }
        };
        let pupil =
            Interface { surface: Surface::plane(PUPIL_MM), medium_after: aqueous.clone(), thickness_after_mm: 0.0 };
        let interfaces = vec![
            side(0, cornea, thicknesses_mm[0]),
            side(1, aqueous, thicknesses_mm[1]),
            pupil,
            side(2, lens, thicknesses_mm[2]),
            side(3, vitreous, 0.0),
        ];
        let retina = ImageSurface { curvature_per_mm: -1.0 / retina_mm, conic: 0.0 };
        let lens = Lens::new(name, source, interfaces, 2)?.with_image_surface(retina)?;
        let near = Some(1e3 / self.accommodation_dioptres).filter(|distance_mm| distance_mm.is_finite());
        Ok(LensFile { film_distance_mm: Some(thicknesses_mm[3]), object_distance_mm: near, ..LensFile::from(lens) })
    }

    fn title(self) -> (String, &'static str) {
        let (name, source) = match self.model {
            EyeModel::Navarro => (
                "eye:navarro",
                "Navarro, Santamaria, Bescos 1985, JOSA A 2, 1273; retina of Escudero-Sanz, Navarro 1999, JOSA A 16, 1881",
            ),
            EyeModel::Arizona => {
                ("eye:arizona", "Schwiegerling 2004, Field Guide to Visual and Ophthalmic Optics, SPIE")
            }
            EyeModel::LeGrand => (
                "eye:legrand",
                "Le Grand, El Hage 1980, Physiological Optics, Springer; dispersion and retina of Navarro's eye",
            ),
        };
        match self.accommodation_dioptres {
            0.0 => (name.to_owned(), source),
            dioptres => (format!("{name}:{dioptres}D"), source),
        }
    }

    fn numbers(self) -> Result<Numbers, OpticsError> {
        let a = self.accommodation_dioptres;
        Ok(match self.model {
            EyeModel::Navarro => {
                let log = (a + 1.0).ln();
                let lens = 9e-5 * (10.0 * a + a * a);
                Numbers {
                    radii_mm: [7.72, 6.5, 10.2 - 1.75 * log, -6.0 + 0.2294 * log],
                    conics: [-0.26, 0.0, -3.1316 - 0.34 * log, -1.0 - 0.125 * log],
                    thicknesses_mm: [0.55, 3.05 - 0.05 * log, 4.0 + 0.1 * log, 16.40398],
                    media: [named("CORNEA"), named("AQUEOUS"), shifted("LENS", lens)?, named("VITREOUS")],
                    retina_mm: 12.0,
                }
            }
            EyeModel::Arizona => Numbers {
                radii_mm: [7.8, 6.5, 12.0 - 0.4 * a, -5.224557 + 0.2 * a],
                conics: [-0.25, -0.25, -7.518749 + 1.285720 * a, -1.353971 - 0.431762 * a],
                thicknesses_mm: [0.55, 2.97 - 0.04 * a, 3.767 + 0.04 * a, 16.713],
                media: [
                    Glass::NdVd { nd: 1.377, vd: 57.1 },
                    Glass::NdVd { nd: 1.337, vd: 61.3 },
                    Glass::NdVd { nd: 1.42 + 0.00256 * a - 0.00022 * a * a, vd: 51.9 },
                    Glass::NdVd { nd: 1.336, vd: 61.1 },
                ],
                retina_mm: 13.4,
            },
            EyeModel::LeGrand => {
                let is_relaxed = a == 0.0;
                let (lens_mm, lens_index) = if is_relaxed { ([10.2, -6.0], 1.42) } else { ([6.0, -5.5], 1.427) };
                let thicknesses_mm = if is_relaxed { [0.55, 3.05, 4.0, 16.59655] } else { [0.55, 2.65, 4.5, 16.49655] };
                Numbers {
                    radii_mm: [7.8, 6.5, lens_mm[0], lens_mm[1]],
                    conics: [0.0; 4],
                    thicknesses_mm,
                    media: [
                        of_index("CORNEA", 1.3771)?,
                        of_index("AQUEOUS", 1.3374)?,
                        of_index("LENS", lens_index)?,
                        of_index("VITREOUS", 1.336)?,
                    ],
                    retina_mm: 12.0,
                }
            }
        })
    }
}

fn named(medium: &str) -> Glass {
    Glass::Named(format!("EYE:{medium}"))
}

/// Returns a medium of Navarro's with an index that is higher by so much at every wavelength.
fn shifted(medium: &str, by: f64) -> Result<Glass, OpticsError> {
    match GlassCatalogue::built_in().find(&format!("EYE:{medium}"))?.glass.clone() {
        Glass::Tabulated { wavelengths_nm, indices } if by != 0.0 => {
            Ok(Glass::Tabulated { wavelengths_nm, indices: indices.into_iter().map(|index| index + by).collect() })
        }
        _ => Ok(named(medium)),
    }
}

/// Returns a medium that disperses as one of Navarro's and has this index at the wavelength of schematic eyes.
fn of_index(medium: &str, index: f64) -> Result<Glass, OpticsError> {
    shifted(medium, index - named(medium).index_at(EYE_NM)?)
}
