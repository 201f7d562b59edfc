//! A lens described in numbers.

use dioptric_optics::{
    C_LINE_NM, F_LINE_NM, FirstOrder, Lens, LensFile, MonoLens, SchematicEye, SeidelSettings, SeidelSums,
    analysis::{NumericalApertures, field_limits_deg},
};
use serde::Serialize;

use dioptric_pipeline::PipelineError;

use super::{
    afocal::{AfocalView, angular_magnification},
    film::{AnalysisFilm, FilmUse},
    sharp::SharpDepths,
};

/// By how much of it the f-number of the light may differ from that of the axial beam and be taken for the same.
const SAME_LIGHT: f64 = 0.01;

/// One of the configurations of a lens file that has several: a position of a zoom lens, say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConfigurationData {
    /// Counted from 1.
    pub number: usize,
    /// What the file calls it; empty where it does not.
    pub name: String,
    /// Whether it is the one in use.
    pub in_use: bool,
    /// The focal length, mm.
    pub efl_mm: f64,
    /// The f-number, of a far object.
    pub f_number: f64,
    /// Distance of the object before the first vertex, mm; infinite for a far one.
    pub object_distance_mm: f64,
    /// Distance of the film behind the last vertex, mm, where the file states it.
    pub film_distance_mm: Option<f64>,
}

impl ConfigurationData {
    /// Returns all configurations of a file that has several.
    ///
    /// # Errors
    /// When a glass is not known at the wavelength.
    pub fn all(file: &LensFile, wavelength_nm: f64) -> Result<Vec<Self>, PipelineError> {
        let states = file.states();
        let row = |(i, (state, name)): (usize, (&LensFile, &str))| {
            let first = state.lens.at(wavelength_nm)?.first_order();
            Ok(Self {
                number: i + 1,
                name: name.to_owned(),
                in_use: i + 1 == file.configuration,
                efl_mm: first.efl_mm,
                f_number: first.f_number,
                object_distance_mm: state.object_distance_mm.unwrap_or(f64::INFINITY),
                film_distance_mm: state.film_distance_mm,
            })
        };
        states.iter().zip(file.configuration_names()).enumerate().map(row).collect()
    }
}

/// The first-order data and third-order sums of a lens at one wavelength.
///
/// z of things in front is from the first vertex, of things behind from the last. What is infinite is left out of
/// JSON as `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensData {
    /// The lens.
    pub lens: String,
    /// All configurations of a lens file that has several; the data are of the one in use.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub configurations: Vec<ConfigurationData>,
    /// Focal lengths, principal planes, pupils and f-number at a wavelength.
    #[serde(flatten)]
    pub first_order: FirstOrder,
    /// The f-number by the real rays of the far point on the axis; `None` where none get through.
    pub real_f_number: Option<f64>,
    /// The f-number of the round beam with as much light, of a lens whose pupil is no whole disc: with openings of other shapes or
    /// obscurations, tilted or decentered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub f_number_of_light: Option<f64>,
    /// The share of the light of the axial beam that surfaces and glass let through; `None` where no light gets through the rims.
    pub transmission: Option<f64>,
    /// The f-number of a lens without losses that has as much light: the f-number (of the light, where that is another) over the square
    /// root of the transmission.
    pub t_number: Option<f64>,
    /// The f-number of the largest round beam within the blades of a stop that they close.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub f_number_inscribed: Option<f64>,
    /// Whether the stop limits the light of the point on the axis at the object's distance. Where it does not, f-number and
    /// diameters of pupils are those of the beam that the rims let through.
    pub stop_limits: bool,
    /// The surface whose rim limits it, counted from 0.
    pub limiting_surface: usize,
    /// The tangent of the angle under which light of a far point leaves over that under which it comes in, of a lens without power,
    /// negative for an image upside down.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angular_magnification: Option<f64>,
    /// Exit-pupil diameter over entrance-pupil diameter.
    pub pupil_magnification: f64,
    /// Radius of the image surface if there were no astigmatism (Petzval's), mm; negative when it bends towards the lens.
    /// Only a rotationally symmetric lens has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub petzval_radius_mm: Option<f64>,
    /// The field angle at which the illumination of a far object falls to half, degrees: half the field of view, where
    /// no film limits it.
    pub half_light_field_deg: Option<f64>,
    /// The field angle at which hardly any light is left, 1 %, degrees.
    pub last_light_field_deg: Option<f64>,
    /// Distance of the film behind the last vertex that the lens's file states, mm.
    #[serde(rename = "film_mm", skip_serializing_if = "Option::is_none")]
    pub film_distance_mm: Option<f64>,
    /// The image of an object at the distance asked for.
    #[serde(flatten)]
    pub image: Option<ImageData>,
    /// Between which distances an object is sharp enough, where a blur is named.
    #[serde(flatten)]
    pub sharp: Option<SharpDepths>,
    /// The two wavelengths between which the third-order sums count color, nm; `None` where their color is unknown.
    pub seidel_colors_nm: Option<[f64; 2]>,
    /// The third-order sums of the whole lens, mm. Only a rotationally symmetric lens has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seidel: Option<SeidelSums>,
    /// The third-order sums of each surface, mm.
    pub seidel_surfaces: Vec<SeidelSums>,
    /// What differs in the x–z plane, of a lens that is not rotationally symmetric; the rest is then of the y–z plane,
    /// with tilts and decenters left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x_plane: Option<PlaneData>,
}

/// First-order data of a lens in one plane through its axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlaneData {
    /// Effective focal length, mm.
    pub efl_mm: f64,
    /// z of the rear focal point from the last vertex, mm.
    pub bfl_mm: f64,
    /// f-number for a far object.
    pub f_number: f64,
}

/// What the data of a lens is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensInfoRequest {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Distance of an object before the first vertex, mm, of which the image is wanted.
    pub distance_mm: Option<f64>,
    /// Half field of the third-order sums, degrees.
    pub field_deg: f64,
    /// The two wavelengths, the shorter first, between which those sums count color; the F and C lines where none are named or
    /// the lens is not known at them. A lens that is not known there either has sums without color.
    pub colors_nm: Option<[f64; 2]>,
    /// The diameter of the blur that is taken to be sharp, µm, of which the depth of field is wanted.
    pub blur_um: Option<f64>,
}

impl LensInfoRequest {
    /// Returns the wavelengths between which color is counted, nm.
    fn colors_nm(&self, lens: &Lens) -> Option<[f64; 2]> {
        let is_known = |lines_nm: &[f64; 2]| lines_nm.iter().all(|&nm| lens.at(nm).is_ok());
        [self.colors_nm, Some([F_LINE_NM, C_LINE_NM])].into_iter().flatten().find(is_known)
    }
}

/// The paraxial image of an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImageData {
    /// Distance of the object before the first vertex, mm.
    pub distance_mm: f64,
    /// z of the image from the last vertex, mm.
    pub image_distance_mm: f64,
    /// Lateral magnification, negative for an image upside down.
    pub magnification: f64,
    /// f-number of the cone at the image.
    pub working_f_number: f64,
    /// Numerical aperture at the object, of real rays; `None` where none come through on the axis.
    pub object_na: Option<f64>,
    /// Numerical aperture at the image, of real rays.
    pub image_na: Option<f64>,
}

impl PlaneData {
    /// Returns that of the x–z plane.
    pub(crate) fn of_x(mono: &MonoLens) -> Self {
        let FirstOrder { efl_mm, bfl_mm, f_number, .. } = mono.first_order_x();
        Self { efl_mm, bfl_mm, f_number }
    }
}

impl LensData {
    /// Returns what of the data of a lens is left out and why, in one sentence; nothing where it has all.
    pub fn note_on_third_order(lens: &Lens) -> Option<String> {
        (!lens.has_third_order()).then(|| {
            format!(
                "{}: third-order sums and Petzval's radius are left out: only a centered lens of revolution without wavefront errors by field has them",
                lens.name()
            )
        })
    }

    /// Returns what the f-number and the pupils' diameters are of, in one sentence, where the light is not that of a round beam about the
    /// axis; nothing of others.
    pub fn note_on_light(&self) -> Option<String> {
        let of_light = self.f_number_of_light?;
        let first = &self.first_order;
        ((of_light / first.f_number - 1.0).abs() > SAME_LIGHT).then(|| {
            format!(
                "the light is no round beam about the axis: f_number {:.4} and the pupils' diameters are those of the axial beam along y, \
                 the light and the exposure those of f/{of_light:.4} (f_number_of_light)",
                first.f_number
            )
        })
    }

    /// Returns the data of a lens; with those of an image where an object distance is given.
    ///
    /// The third-order sums are those of an object at that distance, else of a far one.
    ///
    /// # Errors
    /// When a glass is not known at the wavelength, or the distance is not above 0.
    pub fn new(lens: &Lens, question: &LensInfoRequest) -> Result<Self, PipelineError> {
        let LensInfoRequest { wavelength_nm, distance_mm, field_deg, .. } = *question;
        if field_deg.is_nan() || field_deg.abs() >= 90.0 {
            return Err(PipelineError::Value {
                origin: "the third-order sums".to_owned(),
                key: "field_deg",
                found: field_deg.to_string(),
                expected: "an angle between -90 and 90 degrees, whose tangent they count with".to_owned(),
            });
        }
        let mono = lens.at(wavelength_nm)?;
        let is_round_but_for_blades = lens.clone().with_iris(None).is_ok_and(|lens| lens.is_rotational());
        let x_plane = (!is_round_but_for_blades).then(|| PlaneData::of_x(&mono));
        let colors_nm = question.colors_nm(lens);
        let settings = SeidelSettings {
            wavelength_nm,
            colors_nm: colors_nm.unwrap_or([wavelength_nm; 2]),
            object_distance_mm: distance_mm.unwrap_or(f64::INFINITY),
            chief_slope: field_deg.to_radians().tan(),
        };
        let has_sums = lens.has_third_order();
        let mut seidel = has_sums.then(|| lens.seidel(&settings)).transpose()?;
        if let (Some(seidel), None) = (&mut seidel, colors_nm) {
            for sums in seidel.per_surface.iter_mut().chain([&mut seidel.total]) {
                (sums.c1, sums.c2) = (f64::NAN, f64::NAN);
            }
        }
        let object_distance_mm = distance_mm.unwrap_or(f64::INFINITY);
        let first = mono.first_order_for(object_distance_mm);
        // A far point does not fill the stop of a lens whose pupil is infinitely far.
        let limit = match object_distance_mm.is_infinite() && first.entrance_pupil_diameter_mm.is_infinite() {
            true => mono.axial_beam(f64::INFINITY).filter(|beam| !beam.is_limited_by_stop),
            false => mono.limiting_beam_for(object_distance_mm),
        };
        let has_odd_apertures = !lens.is_rotational() || mono.n_obscurations() > 0;
        let f_number_of_light = has_odd_apertures.then(|| mono.f_number_of_light()).flatten();
        let transmission = mono.axial_transmission(object_distance_mm);
        let t_number = transmission.map(|share| mono.f_number_by_area() / share.sqrt());
        // Light that leaves in parallel falls on no film: it is looked at as everywhere, through an ideal lens.
        let far = FilmUse {
            main_nm: Some(wavelength_nm),
            wavelengths_nm: &[wavelength_nm],
            weights: &[],
            distance_mm: f64::INFINITY,
        };
        let (seen, _) = AfocalView::applied(lens, AnalysisFilm::BestFocus, &far)?;
        let [half_light_field_deg, last_light_field_deg] = field_limits_deg(&seen.at(wavelength_nm)?, [0.5, 0.01]);
        Ok(Self {
            lens: lens.name().to_owned(),
            configurations: Vec::new(),
            first_order: first,
            real_f_number: mono.real_f_number(),
            f_number_of_light,
            transmission,
            t_number,
            f_number_inscribed: lens
                .iris_opening()
                .map(|opening| first.f_number * lens.stop_semi_aperture_mm() / opening.inscribed_radius_mm()),
            stop_limits: limit.is_none_or(|beam| beam.limiting_surface == mono.stop()),
            limiting_surface: limit.map_or(mono.stop(), |beam| beam.limiting_surface),
            angular_magnification: angular_magnification(lens, &mono),
            pupil_magnification: first.pupil_magnification(),
            petzval_radius_mm: has_sums.then(|| petzval_radius_mm(lens, &mono)).transpose()?,
            half_light_field_deg,
            last_light_field_deg,
            film_distance_mm: None,
            image: distance_mm.map(|distance_mm| image_of(&mono, distance_mm)).transpose()?,
            sharp: match question.blur_um {
                Some(blur_um) => SharpDepths::of(&mono, blur_um, distance_mm)?,
                None => None,
            },
            seidel_colors_nm: colors_nm,
            seidel: seidel.as_ref().map(|seidel| seidel.total),
            seidel_surfaces: seidel.map(|seidel| seidel.per_surface).unwrap_or_default(),
            x_plane,
        })
    }
}

/// Returns R of S4 = −H² / (n' R) (Welford 1986, 6.3): the same for any two rays.
fn petzval_radius_mm(lens: &Lens, mono: &MonoLens) -> Result<f64, PipelineError> {
    let any = SeidelSettings { wavelength_nm: mono.wavelength_nm(), ..SeidelSettings::far(0.1) };
    let any = SeidelSettings { colors_nm: [mono.wavelength_nm(); 2], ..any };
    let sums = lens.seidel(&any)?;
    Ok(-sums.lagrange_mm * sums.lagrange_mm / (mono.image_index() * sums.total.s4))
}

fn image_of(lens: &MonoLens, distance_mm: f64) -> Result<ImageData, PipelineError> {
    if distance_mm.is_nan() || distance_mm <= 0.0 {
        return Err(PipelineError::Value {
            origin: "the object".to_owned(),
            key: "distance_mm",
            found: distance_mm.to_string(),
            expected: "a number above 0, or inf".to_owned(),
        });
    }
    let conjugate = lens.conjugate(distance_mm);
    let apertures = NumericalApertures::find(lens, distance_mm);
    Ok(ImageData {
        object_na: apertures.map(|found| found.object),
        image_na: apertures.map(|found| found.image),
        distance_mm,
        image_distance_mm: conjugate.image_z_mm,
        magnification: conjugate.magnification,
        working_f_number: lens.working_f_number(distance_mm),
    })
}

/// A built-in lens as a row of a list.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensRow {
    /// The name that `LENS` takes.
    pub name: String,
    /// Effective focal length at 550 nm, mm.
    pub efl_mm: f64,
    /// f-number wide open.
    pub f_number: f64,
    /// Number of surfaces, the stop included.
    pub surfaces: usize,
    /// Where the prescription comes from.
    pub source: String,
}

/// Returns the built-in lenses.
///
/// # Errors
/// Never; the built-in lenses are held to by tests.
pub fn built_in_lenses() -> Result<Vec<LensRow>, PipelineError> {
    // Eyes are named by their accommodation; relaxed ones stand for them.
    Lens::built_in_names()
        .chain(SchematicEye::NAMES)
        .map(|name| {
            let lens = Lens::built_in(name)?;
            let first = lens.at(dioptric_pipeline::REFERENCE_WAVELENGTH_NM)?.first_order();
            Ok(LensRow {
                name: name.to_owned(),
                efl_mm: first.efl_mm,
                f_number: first.f_number,
                surfaces: lens.interfaces().len(),
                source: lens.source().to_owned(),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Surface;

    use super::*;
    use approx::assert_relative_eq;

    fn question(distance_mm: Option<f64>) -> LensInfoRequest {
        LensInfoRequest { wavelength_nm: 550.0, distance_mm, field_deg: 10.0, colors_nm: None, blur_um: None }
    }

    #[test]
    fn the_papers_lens_has_its_focal_length() {
        let lens = Lens::built_in("paper-2el").unwrap();
        let data = LensData::new(&lens, &question(Some(8000.0))).unwrap();
        // PHYSICS, "paraxial anchors": five digits.
        assert_relative_eq!(data.first_order.efl_mm, 51.9971, epsilon = 1e-4);
        assert_relative_eq!(data.image.unwrap().image_distance_mm, 51.4200, epsilon = 1e-4);
        assert!(LensData::new(&lens, &question(Some(-1.0))).is_err());
    }

    #[test]
    fn json_has_the_keys_of_the_contract() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let json = serde_json::to_value(LensData::new(&lens, &question(Some(2000.0))).unwrap()).unwrap();
        for key in "efl_mm bfl_mm ffl_mm front_principal_mm rear_principal_mm entrance_pupil_z_mm \
                    entrance_pupil_diameter_mm exit_pupil_z_mm exit_pupil_diameter_mm f_number image_distance_mm \
                    wavelength_nm power_per_mm image_index pupil_magnification petzval_radius_mm \
                    half_light_field_deg last_light_field_deg magnification working_f_number"
            .split_whitespace()
        {
            assert!(json[key].is_f64(), "{key}");
        }
        for key in ["S1", "S2", "S3", "S4", "S5", "C1", "C2"] {
            let of_surfaces = json["seidel_surfaces"].as_array().unwrap();
            let sum: f64 = of_surfaces.iter().map(|sums| sums[key].as_f64().unwrap()).sum();
            assert_relative_eq!(json["seidel"][key].as_f64().unwrap(), sum, epsilon = 1e-12);
        }
    }

    #[test]
    fn infrared_lens_counts_color_between_the_wavelengths_asked_for() {
        // Germanium's kind: known from 2 to 14 µm only.
        let glass = dioptric_optics::Glass::Sellmeier {
            b: vec![14.76, 0.24],
            c_um2: vec![0.19, 1530.0],
            range_nm: Some((2e3, 14e3)),
        };
        let front = dioptric_optics::Interface {
            surface: Surface::sphere(50.0, 12.0),
            medium_after: glass,
            thickness_after_mm: 0.0,
        };
        let lens = Lens::new("infrared", "test", vec![front], 0).unwrap();
        let question = LensInfoRequest { wavelength_nm: 10e3, ..question(None) };
        let data = LensData::new(&lens, &question).unwrap();
        assert!(data.seidel_colors_nm.is_none() && data.seidel.unwrap().c1.is_nan() && data.seidel.unwrap().s1 > 0.0);
        let ends = LensInfoRequest { colors_nm: Some([8e3, 12e3]), ..question };
        let data = LensData::new(&lens, &ends).unwrap();
        assert_eq!(data.seidel_colors_nm, Some([8e3, 12e3]));
        // C1 of one surface with the marginal ray coming in straight: A y Δ(δn/n) = c y² δn/n.
        let index = |nm: f64| lens.at(nm).unwrap().image_index();
        let expected = 12.0 * 12.0 / 50.0 * (index(8e3) - index(12e3)) / index(10e3);
        assert_relative_eq!(data.seidel.unwrap().c1, expected, max_relative = 1e-12);
        let narrower = LensInfoRequest { colors_nm: Some([1e3, 12e3]), ..question };
        assert!(LensData::new(&lens, &narrower).unwrap().seidel_colors_nm.is_none());
    }

    #[test]
    fn rings_have_third_order_and_gratings_a_note() {
        use dioptric_optics::{DiffractiveSurface, PhaseProfile};

        let with = |profile: PhaseProfile| {
            let surface = DiffractiveSurface { surface: 0, order: 1, profile, blaze: None };
            Lens::built_in("singlet-50mm").unwrap().with_diffractive(vec![surface]).unwrap()
        };
        let plain = LensData::new(&Lens::built_in("singlet-50mm").unwrap(), &question(None)).unwrap();
        let rings = with(PhaseProfile::Rings { radius_mm: 12.7, coefficients_rad: vec![-40.0] });
        let data = LensData::new(&rings, &question(None)).unwrap();
        // The power of the rings is −m λ A₁ / (π R²): with it the focal length is shorter.
        let rings_per_mm = 40.0 * plain.first_order.wavelength_nm * 1e-6 / (std::f64::consts::PI * 12.7 * 12.7);
        let apart = 1.0 / data.first_order.efl_mm - 1.0 / plain.first_order.efl_mm;
        assert!((apart / rings_per_mm - 1.0).abs() < 0.1, "{apart} {rings_per_mm}");
        // It has no Petzval curvature, and a color of the other sign.
        assert_relative_eq!(data.petzval_radius_mm.unwrap(), plain.petzval_radius_mm.unwrap(), max_relative = 1e-12);
        assert!(data.seidel_surfaces[0].c1 < plain.seidel_surfaces[0].c1);
        assert_eq!(LensData::note_on_third_order(&rings), None);
        let grating = with(PhaseProfile::Grating { lines_per_mm: [0.0, 100.0] });
        assert!(LensData::new(&grating, &question(None)).unwrap().seidel.is_none());
        assert!(LensData::note_on_third_order(&grating).unwrap().contains("third-order sums"));
    }

    #[test]
    fn petzval_radius_of_a_single_surface_is_its_own() {
        // One surface: −n' R_p⁻¹ = (n' − n) / (n n' R) n', so R_p = −n R / (n' − n) for n = 1.
        let ball = dioptric_optics::Interface {
            surface: Surface::sphere(20.0, 2.0),
            medium_after: dioptric_optics::Glass::Constant { index: 1.5 },
            thickness_after_mm: 0.0,
        };
        let lens = Lens::new("ball", "test", vec![ball], 0).unwrap();
        let data = LensData::new(&lens, &question(None)).unwrap();
        assert_relative_eq!(data.petzval_radius_mm.unwrap(), -40.0, max_relative = 1e-12);
        assert_relative_eq!(data.first_order.image_index, 1.5);
    }

    #[test]
    fn built_in_lenses_have_rows() {
        assert!(built_in_lenses().unwrap().iter().any(|row| row.name == "dgauss-50mm"));
    }
}
