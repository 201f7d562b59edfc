//! Two tables of photographic patents: the text of the Optical Bench, and the `.lens` files that others make of it.
//!
//! Optical Bench text has sections in brackets whose cells are separated by tabs: `[variable distances]`, a column each focal length or
//! focus, whose names stand for distances in the rows of `[lens data]` (number, radius, distance, `n_d`, diameter, `V_d` and the name of the
//! glass); and `[aspherical data]` (number, radius, conic constant, coefficients of r⁴, r⁶, …).
//! `.lens` files have a line a surface: radius, distance, `n_d`, `V_d`, diameter (though they call it a semi-aperture) and whether it is coated.

use crate::{D_LINE_NM, Glass, ImageSurface, Lens, Shape};

use super::{
    glasses::{Glasses, constant, model},
    lens_file::{Field, LensFile},
    shapes::even_asphere,
    system::{Beam, FieldVignetting, System, SystemSurface},
    system_states::{self, SystemState},
    text_error::TextError,
};

/// Whether a text is one of the Optical Bench.
pub(super) fn is_bench(text: &str) -> bool {
    text.lines().any(|line| line.trim().eq_ignore_ascii_case("[lens data]"))
}

/// By how much the index and the Abbe number of a glass may differ from those stated beside its name, for it to be that one.
const SAME_INDEX: f64 = 1e-4;
const SAME_ABBE: f64 = 0.3;
/// By what share a focal length may differ from that which the file states: patents round theirs.
const SAME_FOCAL_LENGTH: f64 = 2e-3;
/// The difference of an index from a stated one that is rounding alone.
const ROUNDING: f64 = 1e-8;
/// Shares of half the angle of view at which fields stand.
const FIELDS: [f64; 3] = [0.0, 0.7, 1.0];

/// A line with cells, and its number.
struct Row<'a> {
    line: usize,
    cells: Vec<&'a str>,
}

impl Row<'_> {
    fn wrong(&self, reason: String) -> TextError {
        TextError { line: Some(self.line), reason }
    }

    fn cell(&self, place: usize) -> &str {
        self.cells.get(place).copied().unwrap_or_default()
    }

    /// Returns the number in a cell; `None` of an empty one or of one that says that it is not known.
    fn number(&self, place: usize, what: &str) -> Result<Option<f64>, TextError> {
        let word = self.cell(place);
        if word.is_empty() || word.eq_ignore_ascii_case("undefined") {
            return Ok(None);
        }
        if word.eq_ignore_ascii_case("infinity") {
            return Ok(Some(f64::INFINITY));
        }
        match word.parse::<f64>() {
            Ok(number) if !number.is_nan() => Ok(Some(number)),
            _ => Err(self.wrong(format!("{what} is '{word}', expected a number"))),
        }
    }
}

/// What a file of the Optical Bench says, in its sections.
#[derive(Default)]
struct Bench<'a> {
    title: String,
    variables: Vec<Row<'a>>,
    surfaces: Vec<Row<'a>>,
    aspheres: Vec<Row<'a>>,
    /// Names of sections with rows that are not read.
    other_sections: Vec<String>,
}

/// The sections that say nothing of how a lens images: what it is, and constants of the program's drawing.
const HARMLESS_SECTIONS: [&str; 4] = ["descriptive data", "constants", "notes", "figure"];

/// Reads the text of the Optical Bench; `name` serves where it has no title.
pub(super) fn lens_from_bench(text: &str, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
    let mut bench = Bench::default();
    let mut section = String::new();
    for (i, line) in text.lines().enumerate() {
        let cells: Vec<&str> = line.split('\t').map(str::trim).collect();
        let first = cells[0];
        if first.starts_with('[') {
            section = first.trim_matches(['[', ']']).to_lowercase();
            continue;
        }
        if cells.iter().all(|cell| cell.is_empty()) {
            continue;
        }
        let row = Row { line: i + 1, cells };
        match section.as_str() {
            "descriptive data" if row.cell(0).eq_ignore_ascii_case("title") => bench.title = row.cell(1).to_owned(),
            "variable distances" => bench.variables.push(row),
            "lens data" => bench.surfaces.push(row),
            "aspherical data" => bench.aspheres.push(row),
            section if HARMLESS_SECTIONS.contains(&section) => {}
            section => {
                if !bench.other_sections.iter().any(|known| known == section) {
                    bench.other_sections.push(section.to_owned());
                }
            }
        }
    }
    bench.read(name, glasses)
}

impl Bench<'_> {
    fn read(&self, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
        let n_states =
            self.variables.iter().map(|row| row.cells.iter().rposition(|cell| !cell.is_empty()).unwrap_or(0));
        let n_states = n_states.max().unwrap_or(1).max(1);
        let state = |column: usize| -> Result<SystemState, TextError> {
            Ok(SystemState { name: self.state_name(column)?, system: self.system(column, name, glasses) })
        };
        let mut states =
            (1..=n_states).map(|column| Ok((column, state(column)?))).collect::<Result<Vec<_>, TextError>>()?;
        // A column of distances that are not known is no configuration, unless there is no other.
        let is_known = |(_, state): &(usize, SystemState)| state.system.is_ok();
        let mut left_out = Vec::new();
        if states.iter().any(is_known) {
            for (column, state) in states.extract_if(.., |state| !is_known(state)) {
                let reason = state.system.err().map_or_else(String::new, |error| error.reason);
                left_out.push(format!("column {column} of [variable distances] is no configuration: {reason}"));
            }
        }
        let (columns, mut states): (Vec<usize>, Vec<SystemState>) = states.into_iter().unzip();
        let mut file = match states.len() {
            1 => states.swap_remove(0).system?.build()?,
            _ => system_states::build(states, 1, glasses)?,
        };
        let column = columns.get(file.configuration - 1).copied().unwrap_or(1);
        file.notes.extend(left_out);
        file.notes.extend(self.note_on_sections());
        file.notes.extend(note_on_focal_length(&file.lens, self.variable("Focal Length", column)?));
        Ok(file)
    }

    /// Returns a sentence on sections that are not known, if there are any.
    fn note_on_sections(&self) -> Option<String> {
        let names = self.other_sections.iter().map(|name| format!("[{name}]")).collect::<Vec<_>>().join(", ");
        (!names.is_empty()).then(|| format!("sections that are not known are left out: {names}"))
    }

    /// Returns notes on the distances `d…` that stand behind no surface.
    fn notes_on_unused(&self, column: usize) -> Result<Vec<String>, TextError> {
        let is_distance =
            |name: &str| name.strip_prefix('d').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
        let is_used = |name: &str| {
            name.eq_ignore_ascii_case("d0") || self.surfaces.iter().any(|row| row.cell(2).eq_ignore_ascii_case(name))
        };
        let mut notes = Vec::new();
        for row in self.variables.iter().filter(|row| is_distance(row.cell(0)) && !is_used(row.cell(0))) {
            if let Some(distance) = row.number(column, row.cell(0))? {
                notes.push(format!("{} ({distance} mm) is the distance behind no row of [lens data]", row.cell(0)));
            }
        }
        Ok(notes)
    }

    /// Returns a note on the largest difference of indices where glasses of a catalogue are taken for those that rows name.
    fn note_on_indices(&self, surfaces: &[SystemSurface]) -> Result<Option<String>, TextError> {
        let mut largest = (0.0, 0, "");
        for (row, surface) in self.surfaces.iter().zip(surfaces) {
            let stated = row.number(3, "the index")?;
            if let (Some(stated), Some((its_nd, _))) = (stated, surface.medium_after.nd_vd())
                && (its_nd - stated).abs() > largest.0
            {
                largest = ((its_nd - stated).abs(), row.line, row.cell(6));
            }
        }
        let (apart, line, glass) = largest;
        Ok((apart > ROUNDING).then(|| {
            format!(
                "glasses that are named have the n_d of their catalogue, up to {apart:.1e} from those stated (line {line}, \
                 '{glass}')"
            )
        }))
    }

    /// Returns the value of a variable in a column; `None` where it is not known or not stated.
    fn variable(&self, name: &str, column: usize) -> Result<Option<f64>, TextError> {
        let row = self.variables.iter().find(|row| row.cell(0).eq_ignore_ascii_case(name));
        row.map_or(Ok(None), |row| row.number(column, name))
    }

    fn state_name(&self, column: usize) -> Result<String, TextError> {
        let mut words = Vec::new();
        if let Some(focal_length) = self.variable("Focal Length", column)? {
            words.push(format!("{focal_length} mm"));
        }
        if let Some(distance) = self.variable("d0", column)? {
            words.push(if distance.is_infinite() { "far".to_owned() } else { format!("object at {distance} mm") });
        }
        Ok(words.join(", "))
    }

    fn system(&self, column: usize, name: &str, glasses: &Glasses) -> Result<System, TextError> {
        let (mut surfaces, mut stop, mut notes) = (Vec::new(), None, Vec::new());
        for (i, row) in self.surfaces.iter().enumerate() {
            let is_last = i + 1 == self.surfaces.len();
            let is_stop = row.cell(1).eq_ignore_ascii_case("AS");
            if is_stop {
                stop = Some(surfaces.len());
            }
            surfaces.push(self.surface(row, (column, is_last), glasses, &mut notes)?);
        }
        for asphere in &self.aspheres {
            let of = |row: &&Row<'_>| !row.cell(0).is_empty() && row.cell(0) == asphere.cell(0);
            if !self.surfaces.iter().any(|row| of(&row)) {
                return Err(asphere.wrong(format!("there is no surface '{}' in [lens data]", asphere.cell(0))));
            }
        }
        if stop.is_none() {
            notes.push("no surface is the aperture stop (AS): the first is it".to_owned());
            stop = Some(0);
        }
        notes.extend(self.note_on_indices(&surfaces)?);
        notes.extend(self.notes_on_unused(column)?);
        let stated_mm = self.variable("d0", column)?;
        let object_distance_mm = stated_mm.unwrap_or(f64::INFINITY);
        if let (None, Some(magnification)) = (stated_mm, self.variable("Magnification", column)?.filter(|m| *m != 0.0))
        {
            notes.push(format!("a magnification of {magnification} is stated without the distance of the object (d0), which counts as far"));
        }
        let half_deg = self.variable("Angle of View", column)?.map(|angle_deg| 0.5 * angle_deg);
        let fields = half_deg.filter(|half_deg| (0.0..90.0).contains(half_deg) && object_distance_mm.is_infinite());
        let field = |share: f64, half_deg: f64| {
            (Field::Angle { x_deg: 0.0, y_deg: share * half_deg }, FieldVignetting::default())
        };
        Ok(System {
            name: if self.title.is_empty() { name.to_owned() } else { self.title.clone() },
            source: "an Optical Bench file".to_owned(),
            object_distance_mm,
            object_medium: Glass::Air,
            first_vertex_z_mm: 0.0,
            surfaces,
            moves: Vec::new(),
            image_surface: ImageSurface::default(),
            stop,
            beam: Some(Beam::Stop),
            wavelengths_nm: Vec::new(),
            wavelength_weights: Vec::new(),
            reference: 0,
            fields: fields.map_or(Vec::new(), |half_deg| FIELDS.map(|share| field(share, half_deg)).to_vec()),
            field_weights: Vec::new(),
            comments: Vec::new(),
            notes,
            is_reduced: true,
        })
    }

    /// Returns a surface as it stands in a column of the variable distances.
    fn surface(
        &self,
        row: &Row<'_>,
        (column, is_last): (usize, bool),
        glasses: &Glasses,
        notes: &mut Vec<String>,
    ) -> Result<SystemSurface, TextError> {
        // The stop, a cover glass and a field stop are planes.
        let radius = match row.cell(1).to_uppercase().as_str() {
            "AS" | "CG" | "FS" => f64::INFINITY,
            _ => row.number(1, "the radius")?.ok_or_else(|| row.wrong("a surface has no radius".to_owned()))?,
        };
        let distance = row.cell(2);
        let thickness = match distance.parse::<f64>() {
            Ok(number) => Some(number),
            Err(_) => {
                let is_variable = self.variables.iter().any(|row| row.cell(0).eq_ignore_ascii_case(distance));
                if !(is_variable || distance.is_empty() && is_last) {
                    let expected = "expected a number or a name of [variable distances]";
                    return Err(row.wrong(format!("the distance behind a surface is '{distance}', {expected}")));
                }
                self.variable(distance, column)?
            }
        };
        let thickness_mm = match (thickness, is_last) {
            (Some(thickness_mm), _) => thickness_mm,
            // Where the film lies is then not known.
            (None, true) => f64::INFINITY,
            (None, false) => {
                return Err(row.wrong(format!("the distance {distance} is not known in this configuration")));
            }
        };
        let aspheres: Vec<&Row<'_>> = self.aspheres.iter().filter(|asphere| asphere.cell(0) == row.cell(0)).collect();
        let (mut curvature, mut shape) = (if radius == 0.0 { 0.0 } else { 1.0 / radius }, Shape::Sphere);
        if let Some(asphere) = aspheres.first() {
            if let Some(own_radius) = asphere.number(1, "the radius of an asphere")? {
                if (own_radius - radius).abs() > 1e-4 * radius.abs() {
                    let place = row.cell(0);
                    notes.push(format!(
                        "surface {place} has the radius {radius} in [lens data] and {own_radius} in [aspherical data], which is taken"
                    ));
                }
                curvature = if own_radius == 0.0 { 0.0 } else { 1.0 / own_radius };
            }
            let conic = asphere.number(2, "a conic constant")?.unwrap_or(0.0);
            let mut coefficients = vec![0.0];
            for place in 3..asphere.cells.len() {
                coefficients.push(asphere.number(place, "a coefficient of an asphere")?.unwrap_or(0.0));
            }
            shape = even_asphere(conic, &coefficients);
        }
        let diameter = row.number(4, "the diameter")?.filter(|diameter| *diameter != 0.0);
        if let Some(diameter) = diameter.filter(|diameter| *diameter < 0.0) {
            return Err(row.wrong(format!("the diameter is {diameter}, expected 0 or more")));
        }
        let surface = SystemSurface {
            line: row.line,
            comment: String::new(),
            curvature_per_mm: curvature,
            shape,
            medium_after: medium(row, glasses, notes)?,
            thickness_after_mm: thickness_mm,
            semi_aperture_mm: diameter.map(|diameter| 0.5 * diameter),
            is_mirror: false,
            phase: None,
            is_rim_fixed: true,
            apertures: Vec::new(),
        };
        Ok(surface.with_rim_that_fits(notes))
    }
}

/// Returns a note where the focal length that a file states is not that of its surfaces.
fn note_on_focal_length(lens: &Lens, stated_mm: Option<f64>) -> Option<String> {
    let (stated_mm, found_mm) = (stated_mm?, lens.at(D_LINE_NM).ok()?.first_order().efl_mm);
    let is_other = (found_mm / stated_mm - 1.0).abs() > SAME_FOCAL_LENGTH;
    is_other.then(|| format!("the file states a focal length of {stated_mm} mm, its surfaces have {found_mm:.3} mm"))
}

/// Returns the medium of a row: the glass that it names, where that has the stated index, or a model of the stated numbers.
fn medium(row: &Row<'_>, glasses: &Glasses, notes: &mut Vec<String>) -> Result<Glass, TextError> {
    let Some(nd) = row.number(3, "the index")?.filter(|nd| *nd != 0.0 && *nd != 1.0) else { return Ok(Glass::Air) };
    let vd = row.number(5, "the Abbe number")?.unwrap_or(0.0);
    let name = row.cell(6);
    if !name.is_empty()
        && let Ok(found) = glasses.find(name, None)
        && let Some((its_nd, its_vd)) = found.glass.nd_vd()
    {
        if (its_nd - nd).abs() < SAME_INDEX && (its_vd - vd).abs() < SAME_ABBE {
            return Ok(found.glass);
        }
        notes.push(format!(
            "glass '{name}' has n_d {its_nd:.5} and V_d {its_vd:.2}, the file states {nd} and {vd}, which are taken"
        ));
    }
    let glass = if vd == 0.0 { constant(nd) } else { model(nd, vd) };
    glass.check().map_err(|error| row.wrong(error.to_string()))?;
    Ok(glass)
}

/// Reads a `.lens` file; `name` serves where it has none.
pub(super) fn lens_from_lens_text(text: &str, name: &str) -> Result<LensFile, TextError> {
    let (mut title, mut focal_length_mm, mut is_table, mut stop) = (name.to_owned(), None, false, None);
    let (mut surfaces, mut notes, mut comments, mut n_coated) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for (i, line) in text.lines().enumerate() {
        let (words, comment) = line.split_once('#').map_or((line, ""), |(words, comment)| (words, comment.trim()));
        if !comment.is_empty() && !is_table {
            comments.push(comment.to_owned());
        }
        let words = words.trim();
        if words.is_empty() {
            continue;
        }
        if !is_table {
            let wrong = || TextError {
                line: Some(i + 1),
                reason: format!("'{words}' is not known; expected name:, focal_length: or surfaces:"),
            };
            let (key, value) = words.split_once(':').ok_or_else(wrong)?;
            match key.trim() {
                "name" => title = value.trim().to_owned(),
                "focal_length" => focal_length_mm = value.trim().parse().ok(),
                "surfaces" => is_table = true,
                _ => return Err(wrong()),
            }
            continue;
        }
        let row = Row { line: i + 1, cells: words.split_whitespace().collect() };
        let needed = |place: usize, what: &str| {
            row.number(place, what)?.ok_or_else(|| row.wrong(format!("a surface has no {what}")))
        };
        let is_stop = row.cell(0).eq_ignore_ascii_case("stop");
        let radius = if is_stop { 0.0 } else { needed(0, "radius")? };
        if is_stop && stop.replace(surfaces.len()).is_some() {
            return Err(row.wrong("a second stop; expected one".to_owned()));
        }
        let (thickness_after_mm, index, abbe) =
            (needed(1, "thickness")?, needed(2, "index")?, needed(3, "Abbe number")?);
        n_coated += usize::from(row.number(5, "coating")?.is_some_and(|layers| layers != 0.0));
        let medium_after = if index == 1.0 { Glass::Air } else { model(index, abbe) };
        medium_after.check().map_err(|error| row.wrong(error.to_string()))?;
        let surface = SystemSurface {
            line: i + 1,
            comment: String::new(),
            curvature_per_mm: if radius == 0.0 { 0.0 } else { 1.0 / radius },
            shape: Shape::Sphere,
            medium_after,
            thickness_after_mm,
            semi_aperture_mm: Some(0.5 * needed(4, "diameter")?),
            is_mirror: false,
            phase: None,
            is_rim_fixed: true,
            apertures: Vec::new(),
        };
        surfaces.push(surface.with_rim_that_fits(&mut notes));
    }
    if n_coated > 0 {
        notes.push(format!("{n_coated} surfaces state that they are coated, not with what: the usual coating is taken, or that of --coating"));
    }
    if stop.is_none() {
        notes.push("no surface is the stop: the first is it".to_owned());
    }
    let system = System {
        name: title,
        source: if comments.is_empty() { "a .lens file".to_owned() } else { comments.remove(0) },
        object_distance_mm: f64::INFINITY,
        object_medium: Glass::Air,
        first_vertex_z_mm: 0.0,
        surfaces,
        moves: Vec::new(),
        image_surface: ImageSurface::default(),
        stop: stop.or(Some(0)),
        beam: Some(Beam::Stop),
        wavelengths_nm: Vec::new(),
        wavelength_weights: Vec::new(),
        reference: 0,
        fields: Vec::new(),
        field_weights: Vec::new(),
        comments,
        notes,
        is_reduced: true,
    };
    let mut file = system.build()?;
    file.notes.extend(note_on_focal_length(&file.lens, focal_length_mm));
    Ok(file)
}
