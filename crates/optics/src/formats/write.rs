//! Lens files written: what each format can hold of a lens, and a refusal where it cannot.

use std::{fmt::Write as _, path::Path};

use serde_json::{Value, json};

use crate::{Glass, Interface, Lens, OpticsError, Placement, Shape, Surface, glass::D_LINE_NM};

use super::{
    lens_file::{Field, LensFile, Microlens, REFERENCE_WAVELENGTH_NM, nearest_nm},
    number::reciprocal,
};

impl From<Lens> for LensFile {
    fn from(lens: Lens) -> Self {
        Self::of_lens(lens)
    }
}

/// Returns the refusal of a format.
pub(super) fn cannot(format: &'static str, surface: usize, what: &str) -> OpticsError {
    OpticsError::CannotWrite { format, reason: format!("surface {surface} {what}") }
}

/// Whether a surface is a plane with nothing added.
fn is_plane(surface: &Surface) -> bool {
    surface.shape == Shape::Sphere && surface.curvature_per_mm == 0.0
}

/// The longest way to a surface whose tilts and decenters are written, mm: the moves that these become are then within 1e9, which readers hold to.
const MOST_REACH_MM: f64 = 2.5e8;

impl LensFile {
    /// Writes the lens to a file, in the format of its extension: `.ron`, `.dat`, `.json` (ISET), `.zmx` or `.seq`.
    ///
    /// # Errors
    /// When the format cannot hold the lens, the extension is none of these, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), OpticsError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
        let text = match extension.as_str() {
            "ron" => self.to_ron(),
            "dat" => self.to_dat()?,
            "json" => self.to_omni_json()?,
            "zmx" => self.to_zmx()?,
            "seq" => self.to_seq()?,
            _ => {
                let expected = "expected .ron, .dat, .json, .zmx or .seq";
                return Err(failed(format!("the extension '.{extension}' is no format to write; {expected}")));
            }
        };
        dioptric_files::write(path, text.as_bytes())
            .map_err(|error| failed(format!("cannot be written: {}", error.reason)))
    }

    /// Returns the lens as a `.dat` file, which holds spheres around a plane stop in air, and of each medium one index:
    /// that at the reference wavelength, or at the d line where the file states none.
    ///
    /// # Errors
    /// When the object is not in air, a surface is a plane that is not the stop, an asphere or an ideal lens, or tilted or decentered, or the stop
    /// is curved.
    pub fn to_dat(&self) -> Result<String, OpticsError> {
        const FORMAT: &str = "a .dat file";
        let wavelength_nm = self.dat_nm();
        let lens = &self.lens;
        if let Some(surface) = first_moved(lens) {
            return Err(cannot(FORMAT, surface, "is tilted or decentered"));
        }
        check_air(FORMAT, lens)?;
        check_refracting(FORMAT, lens)?;
        check_round(FORMAT, lens)?;
        let efl_mm = lens.at(wavelength_nm)?.first_order().efl_mm;
        let mut text = format!(
            "# Name: {}\n# Indices at {wavelength_nm} nm. Focal length (mm):\n{efl_mm}\n",
            one_line(lens.name())
        );
        text.push_str("# radius\taxpos\tN\taperture\n");
        for (i, interface) in lens.interfaces().iter().enumerate() {
            let surface = &interface.surface;
            let radius_mm = match (i == lens.stop(), is_plane(surface)) {
                (true, true) => 0.0,
                (true, false) => return Err(cannot(FORMAT, i, "is the stop but not a plane")),
                (false, true) => return Err(cannot(FORMAT, i, "is a plane, which only the stop may be")),
                (false, false) if surface.shape == Shape::Sphere => reciprocal(surface.curvature_per_mm),
                (false, false) => return Err(cannot(FORMAT, i, "is not a sphere")),
            };
            let index = lens.index_in(&interface.medium_after, wavelength_nm)?;
            let (thickness_mm, diameter_mm) = (interface.thickness_after_mm, 2.0 * surface.semi_aperture_mm);
            let _ = writeln!(text, "{radius_mm}\t{thickness_mm}\t{index}\t{diameter_mm}");
        }
        Ok(text)
    }

    /// Returns the lens as a `.json` file of ISET, with each index as a table at the file's wavelengths, or from 400 to
    /// 700 nm in steps of 10 where it states none.
    ///
    /// ISET reads no planes but the stop, and no stop but a plane: such surfaces are written with the keys that only
    /// this crate reads (`"radius": null`, `"stop": true`), so that ISET refuses the file instead of misreading it.
    ///
    /// # Errors
    /// When the object is not in air, a surface is an odd asphere, a toroid or an ideal lens, the film is tilted or decentered, or a glass is not
    /// known at one of the wavelengths.
    pub fn to_omni_json(&self) -> Result<String, OpticsError> {
        let (lens, wavelengths_nm) = (&self.lens, self.omni_nm());
        if lens.film_motion() != Placement::centered(0.0) {
            return Err(cannot(OMNI, lens.interfaces().len(), "(the film) is tilted or decentered"));
        }
        check_air(OMNI, lens)?;
        check_refracting(OMNI, lens)?;
        check_round(OMNI, lens)?;
        let mut file = json!({
            "name": lens.name(),
            "description": lens.source(),
            "type": "multi element lens",
            "surfaces": omni_rows(lens, &wavelengths_nm)?,
        });
        if let Some(Microlens { dimensions, offsets_mm, lens }) = &self.microlens {
            let surfaces = omni_rows(lens, &wavelengths_nm)?;
            file["microlens"] = json!({ "dimensions": dimensions, "offsets": offsets_mm, "surfaces": surfaces });
        }
        Ok(format!("{file:#}\n"))
    }
}

impl LensFile {
    /// The wavelength of the indices of a `.dat` file, nm.
    fn dat_nm(&self) -> f64 {
        self.reference_wavelength_nm.unwrap_or(D_LINE_NM)
    }

    /// The wavelengths of the indices of a `.json` file of ISET, nm.
    fn omni_nm(&self) -> Vec<f64> {
        let mut wavelengths_nm = self.wavelengths_nm.clone();
        if wavelengths_nm.is_empty() {
            wavelengths_nm = (0..=30).map(|step| 400.0 + 10.0 * f64::from(step)).collect();
        }
        wavelengths_nm.sort_by(f64::total_cmp);
        wavelengths_nm.dedup();
        wavelengths_nm
    }

    /// Where the film of a file stands that must state one, mm behind the last vertex: the lens's own place of it, or else where
    /// first-order optics focuses the file's object; 0 where there is no such place.
    pub(super) fn film_or_focus_mm(&self) -> f64 {
        self.film_distance_mm.or_else(|| self.focus_mm()).unwrap_or(0.0)
    }

    /// Checks that surfaces and the film stand where tilts and decenters can be stated from one to the next.
    pub(super) fn check_places(&self, format: &'static str) -> Result<(), OpticsError> {
        let lens = &self.lens;
        if lens.moves().is_empty() {
            return Ok(());
        }
        let film_mm = self.film_or_focus_mm();
        let distances_mm = lens.interfaces().iter().map(|interface| interface.thickness_after_mm.abs());
        let mut places_mm = lens
            .placements()
            .into_iter()
            .zip(distances_mm)
            .map(|(place, distance_mm)| place.vertex_mm.abs().max_element().max(distance_mm));
        let film_reach_mm = lens.film_z_mm(film_mm).abs().max(film_mm.abs());
        let is_too_far = |mm: f64| mm.is_nan() || mm >= MOST_REACH_MM;
        if let Some(surface) = places_mm.position(is_too_far) {
            return Err(cannot(format, surface, "stands 2.5e8 mm or more from the first or the next"));
        }
        if is_too_far(film_reach_mm) {
            let reason = "the film stands 2.5e8 mm or more from the first or the last surface".to_owned();
            return Err(OpticsError::CannotWrite { format, reason });
        }
        Ok(())
    }

    /// Returns where first-order optics focuses the file's object, mm behind the last vertex.
    pub(super) fn focus_mm(&self) -> Option<f64> {
        let lens = self.lens.at(self.listed_main_nm().unwrap_or(REFERENCE_WAVELENGTH_NM)).ok()?;
        lens.film_distance_mm_for(self.object_distance_mm.unwrap_or(f64::INFINITY)).ok().filter(|mm| mm.is_finite())
    }

    /// Returns the states for a format in which all have as many fields of one kind: those without take the angles of the first that has
    /// any. The main wavelength of each is one of its list.
    pub(super) fn listed_states(&self) -> Vec<Self> {
        let mut states = self.states();
        for state in &mut states {
            state.reference_wavelength_nm = state.listed_main_nm();
            if let (true, Some(nm)) = (state.wavelengths_nm.is_empty(), state.reference_wavelength_nm) {
                state.wavelengths_nm = vec![nm];
            }
        }
        if let Some(number) = self.lends_fields() {
            let Self { fields, field_weights, .. } = states[number - 1].clone();
            for state in states.iter_mut().filter(|state| state.fields.is_empty()) {
                (state.fields, state.field_weights) = (fields.clone(), field_weights.clone());
            }
        }
        states
    }

    /// The main wavelength in a format in which it is one of the list, nm: the nearest of it, else what is stated alone.
    fn listed_main_nm(&self) -> Option<f64> {
        let main_nm = self.main_wavelength_nm().unwrap_or(REFERENCE_WAVELENGTH_NM);
        nearest_nm(&self.wavelengths_nm, main_nm).or(self.reference_wavelength_nm)
    }

    /// Returns a sentence on a main wavelength that is not one of the list, for a format in which it is.
    fn note_on_main_wavelength(&self, extension: &str) -> Option<String> {
        let main_nm = self.main_wavelength_nm().unwrap_or(REFERENCE_WAVELENGTH_NM);
        let listed_nm = self.listed_main_nm()?;
        if self.wavelengths_nm.is_empty() {
            return Some(format!("the file states no wavelengths but the main one: it has {listed_nm} nm alone"));
        }
        (listed_nm != main_nm).then(|| {
            format!(
                "the main wavelength of a .{extension} file is one of its list: it has {listed_nm} nm, not {main_nm} nm"
            )
        })
    }

    /// The number of the configuration whose fields those take that state none, where there are both.
    fn lends_fields(&self) -> Option<usize> {
        let states = self.states();
        let are_angles = |state: &Self| state.fields.iter().all(|field| matches!(field, Field::Angle { .. }));
        let first = states.iter().position(|state| !state.fields.is_empty())?;
        let asks = states.iter().any(|state| state.fields.is_empty());
        (asks && are_angles(&states[first])).then_some(first + 1)
    }

    /// Returns the kind of the fields (angles 0, object heights 1, paraxial image heights 2, real ones 3), and their x and y.
    pub(super) fn fields_of_one_kind(&self, format: &'static str) -> Result<(usize, [Vec<f64>; 2]), OpticsError> {
        let of = |field: &Field| match *field {
            Field::Angle { x_deg, y_deg } => (0, x_deg, y_deg),
            Field::ObjectHeight { x_mm, y_mm } => (1, x_mm, y_mm),
            Field::ImageHeight { x_mm, y_mm } => (2, x_mm, y_mm),
            Field::RealImageHeight { x_mm, y_mm } => (3, x_mm, y_mm),
        };
        let fields: Vec<(usize, f64, f64)> = self.fields.iter().map(of).collect();
        let kind = fields.first().map_or(0, |field| field.0);
        if fields.iter().any(|field| field.0 != kind) {
            let reason = "its fields are of several kinds, where the format has one".to_owned();
            return Err(OpticsError::CannotWrite { format, reason });
        }
        Ok((kind, [fields.iter().map(|field| field.1).collect(), fields.iter().map(|field| field.2).collect()]))
    }

    /// Returns what the format of an extension has no place for and so leaves out of what the file says beside the lens, and what it
    /// states that the file does not, a sentence each.
    pub fn left_out(&self, extension: &str) -> Vec<String> {
        let holds_use = matches!(extension, "ron" | "zmx" | "seq");
        let is_blazed = self.lens.diffractive().iter().any(|phase| phase.blaze.is_some());
        let states_wavelengths = !self.wavelengths_nm.is_empty() || self.reference_wavelength_nm.is_some();
        let stated = [
            ("its array of microlenses", self.microlens.is_some() && extension != "json"),
            ("the place of the film", self.film_distance_mm.is_some() && !holds_use),
            ("the curvature of the film", self.lens.image_surface().curvature_per_mm != 0.0 && !holds_use),
            ("the distance of the object", self.object_distance_mm.is_some() && !holds_use),
            ("wavelengths", states_wavelengths && !holds_use),
            ("fields", !self.fields.is_empty() && !holds_use),
            ("names of surfaces", !self.surface_comments.is_empty() && !holds_use),
            ("comments", !self.comments.is_empty() && !holds_use),
            ("coatings", !self.lens.coatings().is_empty() && extension != "ron"),
            ("blades of the stop (iris)", self.lens.iris().is_some() && extension != "ron"),
            ("the relief of gratings (blaze)", is_blazed && extension != "ron"),
        ];
        let left_out: Vec<&str> =
            stated.iter().filter(|(_, is_left_out)| *is_left_out).map(|(what, _)| *what).collect();
        let mut notes = Vec::new();
        if !left_out.is_empty() {
            notes.push(format!("a .{extension} file has no place for {}: left out", left_out.join(", ")));
        }
        let has_dispersion = |side: &Interface| !matches!(side.medium_after, Glass::Air | Glass::Constant { .. });
        if self.lens.interfaces().iter().any(has_dispersion) {
            notes.extend(match extension {
                "dat" => Some(format!("a .dat file has the indices of glasses at {} nm alone", self.dat_nm())),
                "json" => {
                    let nm = self.omni_nm();
                    let n = nm.len();
                    Some(format!(
                        "a .json file has the indices of glasses at {n} wavelengths from {} to {} nm: between them they are interpolated",
                        nm[0],
                        nm[n - 1]
                    ))
                }
                _ => None,
            });
        }
        let n_configurations = self.configurations.len();
        if n_configurations > 1 && !holds_use {
            let in_use = self.configuration;
            notes.push(format!(
                "a .{extension} file has no place for several configurations: of {n_configurations} it has number {in_use} alone"
            ));
        }
        if n_configurations > 1 && extension == "seq" && self.configuration != 1 {
            notes.push(format!(
                "a .seq file does not say which configuration is in use: it is read with number 1, not {}",
                self.configuration
            ));
        }
        if let (Some(number), "zmx" | "seq") = (self.lends_fields(), extension) {
            notes.push(format!("configurations that state no fields have the angles of number {number}"));
        }
        if matches!(extension, "zmx" | "seq") {
            let mut of_states: Vec<String> =
                self.states().iter().filter_map(|state| state.note_on_main_wavelength(extension)).collect();
            of_states.dedup();
            notes.extend(of_states);
        }
        if matches!(extension, "zmx" | "seq") && self.film_distance_mm.is_none() {
            notes.push(match self.focus_mm() {
                Some(mm) => {
                    let nm = self.listed_main_nm().unwrap_or(REFERENCE_WAVELENGTH_NM);
                    format!(
                        "the place of the film is not stated: the file has the paraxial focus at {nm} nm, {mm:.4} mm"
                    )
                }
                None => "the place of the film is not stated, and there is no focus: the file has 0 mm".to_owned(),
            });
        }
        notes
    }
}

const OMNI: &str = "a .json file of ISET";

/// Checks that no surface reflects or diffracts, for which a format has no word.
fn check_refracting(format: &'static str, lens: &Lens) -> Result<(), OpticsError> {
    if let Some(&mirror) = lens.mirrors().first() {
        return Err(cannot(format, mirror, "is a mirror"));
    }
    match lens.diffractive().first() {
        Some(phase) => Err(cannot(format, phase.surface, "is a grating or diffractive surface")),
        None => Ok(()),
    }
}

/// Checks that the object of a lens is in air, as a format takes for granted.
fn check_air(format: &'static str, lens: &Lens) -> Result<(), OpticsError> {
    match lens.object_medium() {
        Glass::Air => Ok(()),
        medium => {
            let reason = format!("the object is in {}, where the format knows only air", medium.describe());
            Err(OpticsError::CannotWrite { format, reason })
        }
    }
}

/// Checks that all rims are circles about the axis, as these formats have them.
fn check_round(format: &'static str, lens: &Lens) -> Result<(), OpticsError> {
    match lens.apertures().first() {
        None => Ok(()),
        Some(aperture) => Err(cannot(format, aperture.surface, "has an aperture beside its round rim")),
    }
}

/// Returns the first surface that does not stand where its distances alone put it.
fn first_moved(lens: &Lens) -> Option<usize> {
    lens.placements()
        .iter()
        .zip(lens.vertices_z_mm())
        .position(|(placement, z_mm)| *placement != Placement::centered(z_mm))
}

fn omni_rows(lens: &Lens, wavelengths_nm: &[f64]) -> Result<Vec<Value>, OpticsError> {
    let (placements, vertices_z_mm) = (lens.placements(), lens.vertices_z_mm());
    let row = |i: usize| {
        let mut row = omni_row(lens, i, wavelengths_nm)?;
        let Placement { vertex_mm, rotation } = placements[i];
        if placements[i] != Placement::centered(vertices_z_mm[i]) {
            let shift_mm = vertex_mm - Placement::centered(vertices_z_mm[i]).vertex_mm;
            row["transform"] =
                json!([rotation.x_axis, rotation.y_axis, rotation.z_axis, shift_mm].map(|v| v.to_array()));
        }
        Ok(row)
    };
    (0..lens.interfaces().len()).map(row).collect()
}

/// Stands for infinity where a biconic is flat along one axis: 1 m off its axis it sags by 5e-13 mm.
const PLANE_RADIUS_MM: f64 = 1e18;

fn omni_row(lens: &Lens, i: usize, wavelengths_nm: &[f64]) -> Result<Value, OpticsError> {
    let (interface, is_stop) = (&lens.interfaces()[i], i == lens.stop());
    let surface = &interface.surface;
    let radius = match (is_plane(surface), is_stop) {
        (true, true) => json!(0.0),
        _ if surface.curvature_per_mm == 0.0 => Value::Null,
        _ => json!(reciprocal(surface.curvature_per_mm)),
    };
    let medium = &interface.medium_after;
    let ior = match medium {
        Glass::Air | Glass::Constant { .. } => json!(medium.index_at(D_LINE_NM)?),
        _ => {
            let indices =
                wavelengths_nm.iter().map(|&nm| lens.index_in(medium, nm)).collect::<Result<Vec<f64>, _>>()?;
            json!([wavelengths_nm, indices])
        }
    };
    let mut row = json!({
        "radius": radius,
        "thickness": interface.thickness_after_mm,
        "semi_aperture": surface.semi_aperture_mm,
        "ior": ior,
    });
    match &surface.shape {
        Shape::Sphere => {}
        Shape::Conic { conic } => row["conic_constant"] = json!(conic),
        Shape::EvenAsphere { conic, coefficients } => {
            row["conic_constant"] = json!(conic);
            row["aspheric_coefficients"] = json!(coefficients);
        }
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            // JSON has no infinity; ISET's readers take a huge radius for it.
            let radius = |c: f64| if c == 0.0 { PLANE_RADIUS_MM } else { reciprocal(c) };
            row["radius"] = json!([radius(*curvature_x_per_mm), radius(surface.curvature_per_mm)]);
            row["conic_constant"] = json!([conic_x, conic]);
        }
        _ => {
            let what = "is neither a sphere nor a conic, a biconic or an asphere from r⁴ on";
            return Err(cannot(OMNI, i, what));
        }
    }
    if is_stop && !is_plane(surface) {
        row["stop"] = json!(true);
    }
    Ok(row)
}

/// Returns a text without line ends, which would end it in a format of lines.
pub(super) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
