//! CODE V sequence files (`.seq`): commands, of which `S` adds a surface and `;` or a line's end ends each.
//!
//! Read are radii or curvatures, thicknesses, glasses of the catalogue or of a private one (`PRV` … `END`), conics, even
//! aspheres, cylinders (`CYL`), toroids (`YTO`, `XTO`) and anamorphic conics (`AAS`), decenters and tilts (basic, `DAR` or
//! `REV`), apertures, the pupil, fields and wavelengths. Commands that change no ray (variables, labels) are passed over;
//! solves and words that are not understood are noted with their line; what changes rays and cannot
//! be traced is refused. Zoom positions (`ZOO`) are the configurations of the file.

mod command;
mod surface;
mod words;
mod zoom;

use crate::{CatalogueGlass, Glass, ImageSurface};

use self::{
    command::{Command, commands_of},
    surface::SeqSurface,
    words::PassedOver,
    zoom::Zoom,
};
use super::{
    glasses::{Glasses, constant, glass_of_digits, model},
    lens_file::{Field, LensFile, SeqNumbers},
    system::{Beam, FieldVignetting, System, SystemSurface, note_on_film, note_on_object},
    text_error::TextError,
};

/// Reads a CODE V file; `name` serves where the file states none.
pub(super) fn lens_from_seq(text: &str, name: &str, glasses: Glasses) -> Result<LensFile, TextError> {
    let mut file = Seq::new(name, glasses);
    file.remarks = remarks_of(text);
    for command in commands_of(text) {
        file.take(&command)?;
    }
    let unstated = file.decide_mode();
    let built = file.build();
    built.map_err(|TextError { line, reason }| match unstated {
        None => TextError { line, reason },
        Some(note) => TextError { line, reason: format!("{reason}; {note}") },
    })
}

/// What is done where the file leaves it to the program's settings.
const RADII_TAKEN: &str =
    "neither radii (RDM) nor curvatures (CUM) are announced: the numbers of S are taken for radii";
const CURVATURES_TAKEN: &str = "neither radii (RDM) nor curvatures (CUM) are announced: the numbers of S, all below 1 and \
     smaller than the beam or the glass, are taken for curvatures";

/// What a file says, in its own units.
#[derive(Clone)]
struct Seq<'a> {
    glasses: Glasses<'a>,
    name: String,
    mm_per_unit: f64,
    is_radius_mode: bool,
    is_mode_stated: bool,
    beam: Option<Beam>,
    wavelengths_nm: Vec<f64>,
    wavelength_weights: Vec<f64>,
    field_weights: Vec<f64>,
    /// Counted from 1.
    reference: usize,
    field_kind: Option<FieldKind>,
    fields: [Vec<f64>; 2],
    /// Upper and lower vignetting along x, then along y.
    vignetting: [Vec<f64>; 4],
    /// Wavelengths of a private catalogue that is being read.
    private_wavelengths_nm: Option<Vec<f64>>,
    surfaces: Vec<SeqSurface>,
    /// The comments before the first command: where the lens is from, and what else there is to say.
    remarks: Vec<String>,
    has_image: bool,
    zoom: Zoom,
    passed_over: PassedOver,
    notes: Vec<String>,
}

#[derive(Clone, Copy, PartialEq)]
enum FieldKind {
    Angle,
    ObjectHeight,
    ImageHeight,
    RealImageHeight,
}

impl<'a> Seq<'a> {
    fn new(name: &str, glasses: Glasses<'a>) -> Self {
        Self {
            glasses,
            name: name.to_owned(),
            mm_per_unit: 1.0,
            is_radius_mode: true,
            is_mode_stated: false,
            beam: None,
            wavelengths_nm: Vec::new(),
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            reference: 1,
            field_kind: None,
            fields: Default::default(),
            vignetting: Default::default(),
            private_wavelengths_nm: None,
            surfaces: Vec::new(),
            remarks: Vec::new(),
            has_image: false,
            zoom: Zoom::default(),
            passed_over: PassedOver::default(),
            notes: Vec::new(),
        }
    }

    fn take(&mut self, command: &Command) -> Result<(), TextError> {
        let keyword = command.words[0].to_uppercase();
        if self.private_wavelengths_nm.is_some() {
            return self.take_private(&keyword, command);
        }
        if self.zoom.takes(&keyword, command, self.surfaces.len().saturating_sub(1))? {
            return Ok(());
        }
        self.take_value(&keyword, command)
    }

    /// Takes a command that does not speak of zoom positions.
    fn take_value(&mut self, keyword: &str, command: &Command) -> Result<(), TextError> {
        if self.takes_element(keyword, command)? {
            return Ok(());
        }
        match keyword {
            "TIT" | "TITLE" => {
                if let Some(title) = command.words.get(1).filter(|title| !title.trim().is_empty()) {
                    self.name = title.trim().to_owned();
                }
            }
            "RDM" | "CUM" => {
                self.is_radius_mode = (keyword == "RDM") != is_no(command);
                self.is_mode_stated = true;
            }
            "DIM" => self.mm_per_unit = mm_per_unit(command)?,
            "EPD" => self.beam = Some(Beam::EntrancePupil(command.number(1)?)),
            "FNO" => self.beam = Some(Beam::FNumber(command.number(1)?)),
            "NAO" => self.beam = Some(Beam::ObjectAperture(command.number(1)?)),
            "NA" => return Err(command.wrong("the image-side aperture is not supported; state EPD, FNO or NAO")),
            "WL" => self.wavelengths_nm = command.numbers()?,
            "WTW" => self.wavelength_weights = command.numbers()?,
            "WTF" => self.field_weights = command.numbers()?,
            "REF" => self.reference = command.number(1)? as usize,
            "XAN" | "YAN" => self.take_fields(FieldKind::Angle, command)?,
            "XOB" | "YOB" => self.take_fields(FieldKind::ObjectHeight, command)?,
            "XIM" | "YIM" => self.take_fields(FieldKind::ImageHeight, command)?,
            "XRI" | "YRI" => self.take_fields(FieldKind::RealImageHeight, command)?,
            "VUX" => self.vignetting[0] = command.numbers()?,
            "VLX" => self.vignetting[1] = command.numbers()?,
            "VUY" => self.vignetting[2] = command.numbers()?,
            "VLY" => self.vignetting[3] = command.numbers()?,
            "PRV" => self.private_wavelengths_nm = Some(Vec::new()),
            "SO" | "S" | "SI" => self.add_surface(keyword, command)?,
            "S0" => self.add_surface("SO", command)?,
            _ => self.take_of_surface(keyword, command)?,
        }
        Ok(())
    }

    fn take_fields(&mut self, kind: FieldKind, command: &Command) -> Result<(), TextError> {
        self.put_kind(kind, command)?;
        let axis = usize::from(command.words[0].to_uppercase().starts_with('Y'));
        self.fields[axis] = command.numbers()?;
        Ok(())
    }

    /// Takes the kind of fields that a command of them means.
    fn put_field_kind(&mut self, keyword: &str, command: &Command) -> Result<(), TextError> {
        let kind = match &keyword[1..] {
            "OB" => FieldKind::ObjectHeight,
            "IM" => FieldKind::ImageHeight,
            "RI" => FieldKind::RealImageHeight,
            _ => FieldKind::Angle,
        };
        self.put_kind(kind, command)
    }

    fn put_kind(&mut self, kind: FieldKind, command: &Command) -> Result<(), TextError> {
        if self.field_kind.is_some_and(|before| before != kind) {
            return Err(command.wrong("fields of two kinds; expected angles, object heights or image heights alone"));
        }
        self.field_kind = Some(kind);
        Ok(())
    }

    /// Takes a line of a private catalogue: `PWL` and the wavelengths, or a glass and its indices there.
    fn take_private(&mut self, keyword: &str, command: &Command) -> Result<(), TextError> {
        let Some(wavelengths_nm) = &mut self.private_wavelengths_nm else { return Ok(()) };
        match keyword {
            "END" => self.private_wavelengths_nm = None,
            "PWL" => *wavelengths_nm = command.numbers()?,
            // n² = a + b λ² + c/λ² + d/λ⁴ + e/λ⁶ + f/λ⁸, as that of an adhesive of Edmund's shows, whose law is known.
            _ if command.words.get(1).is_some_and(|word| word.eq_ignore_ascii_case("LAU")) => {
                let terms =
                    (2..command.words.len()).map(|place| command.number(place)).collect::<Result<Vec<f64>, _>>()?;
                let [constant, powers @ ..] = terms.as_slice() else {
                    return Err(command.wrong("a glass of Laurent's formula (LAU) without coefficients".to_owned()));
                };
                if powers.len() > 5 {
                    let found = terms.len();
                    return Err(
                        command.wrong(format!("{found} coefficients of Laurent's formula (LAU), expected up to 6"))
                    );
                }
                let pairs = powers.iter().zip([2.0, -2.0, -4.0, -6.0, -8.0]).flat_map(|(c, power)| [*c, power]);
                let coefficients = [*constant].into_iter().chain(pairs).collect();
                let glass = Glass::Formula { formula: 3, coefficients, range_nm: None };
                glass.check().map_err(|error| command.wrong(error))?;
                self.glasses.private.push(CatalogueGlass {
                    maker: String::new(),
                    name: command.words[0].clone(),
                    glass,
                });
            }
            // Only a surface that has it is refused.
            _ if command.words.get(1).is_some_and(|word| word.parse::<f64>().is_err()) => self.notes.push(format!(
                "private glass {} is by the formula {}, which is not known (expected indices, or LAU), and left out",
                command.words[0], command.words[1]
            )),
            _ => {
                let indices = command.numbers()?;
                if indices.len() != wavelengths_nm.len() || indices.is_empty() {
                    let (found, wanted) = (indices.len(), wavelengths_nm.len());
                    return Err(command.wrong(format!("{found} indices for {wanted} wavelengths (PWL)")));
                }
                let mut rows: Vec<(f64, f64)> = wavelengths_nm.iter().copied().zip(indices).collect();
                rows.sort_by(|a, b| a.0.total_cmp(&b.0));
                let glass = match rows.as_slice() {
                    [(_, index)] => constant(*index),
                    _ => {
                        let (wavelengths_nm, indices) = rows.into_iter().unzip();
                        Glass::Tabulated { wavelengths_nm, indices }
                    }
                };
                glass.check().map_err(|error| command.wrong(error))?;
                let (maker, name) = (String::new(), command.words[0].clone());
                self.glasses.private.push(CatalogueGlass { maker, name, glass });
            }
        }
        Ok(())
    }

    /// Adds the surface of `S radius thickness glass`.
    fn add_surface(&mut self, keyword: &str, command: &Command) -> Result<(), TextError> {
        if (keyword == "SO") != self.surfaces.is_empty() || self.has_image {
            let expected =
                if self.surfaces.is_empty() { "SO, the object, first" } else { "S … and one SI at the end" };
            return Err(command.wrong(format!("out of order; expected {expected}")));
        }
        self.has_image = keyword == "SI";
        let value = if command.words.len() > 1 { command.number(1)? } else { 0.0 };
        let curvature = match (self.is_radius_mode, value == 0.0) {
            (true, false) => 1.0 / value,
            _ => value,
        };
        let states_thickness = command.words.len() > 2;
        let thickness = if states_thickness { command.distance(2)? } else { 0.0 };
        let is_mirror = command.words.get(3).is_some_and(|word| is_mirror(word));
        let medium = match command.words.get(3) {
            Some(word) if !is_mirror => self.medium(word, command)?,
            _ => None,
        };
        let line = command.line;
        let number_of_s = (self.is_radius_mode && value != 0.0).then_some(value);
        self.surfaces.push(SeqSurface {
            line,
            curvature,
            thickness,
            states_thickness,
            medium,
            is_mirror,
            number_of_s,
            ..Default::default()
        });
        Ok(())
    }

    /// Takes a command that belongs to a surface: the last, or the one that the first word after it names (`S3`).
    fn take_of_surface(&mut self, keyword: &str, command: &Command) -> Result<(), TextError> {
        if self.passed_over.takes(keyword, command.line) {
            return Ok(());
        }
        let command = &command.without_labels();
        let named = command.words.get(1).and_then(|word| self.surface_named(word));
        let place = if named.is_some() { 2 } else { 1 };
        if let Some(word) =
            command.words.get(1).filter(|word| named.is_none() && keyword != "SLB" && is_number_of_surface(word))
        {
            return Err(command.wrong(format!("there is no surface {word} before this line")));
        }
        let Some(surface) = named.or(self.surfaces.len().checked_sub(1)) else {
            self.passed_over.unknown(keyword, command.line);
            return Ok(());
        };
        match keyword {
            "SLB" => {
                self.surfaces[surface].label = command.words.get(place).cloned().unwrap_or_default();
                Ok(())
            }
            "STO" => {
                self.put_stop(surface, command.line);
                Ok(())
            }
            "GLA" | "GL1" => {
                if let Some(word) = command.words.get(place) {
                    let is_mirror = is_mirror(word);
                    self.surfaces[surface].medium = if is_mirror { None } else { self.medium(word, command)? };
                    self.surfaces[surface].is_mirror = is_mirror;
                }
                Ok(())
            }
            "RMD" => {
                let mode = command.words.get(place).map(|word| word.to_uppercase()).unwrap_or_default();
                match mode.as_str() {
                    "REFL" => self.surfaces[surface].is_mirror = true,
                    "REFR" => self.surfaces[surface].is_mirror = false,
                    _ => return Err(command.wrong(format!("'{mode}' is not supported; expected REFL or REFR"))),
                }
                Ok(())
            }
            _ => {
                if !self.surfaces[surface].take(keyword, command, place)? {
                    self.passed_over.unknown(keyword, command.line);
                }
                Ok(())
            }
        }
    }

    /// Puts the stop at a surface; a later STO takes the place of an earlier one.
    fn put_stop(&mut self, surface: usize, line: usize) {
        let before = self.surfaces.iter().position(|surface| surface.is_stop);
        if let Some(before) = before.filter(|&before| before != surface) {
            self.surfaces[before].is_stop = false;
            self.notes.push(format!("two stops (STO): that of line {line}, S{surface}, takes the place of S{before}"));
        }
        self.surfaces[surface].is_stop = true;
    }

    /// Notes the surfaces whose distance to the next the file does not state; the object's must be.
    fn check_thicknesses(&mut self) -> Result<(), TextError> {
        let last = self.surfaces.len().saturating_sub(1);
        for (number, surface) in
            self.surfaces[..last].iter().enumerate().filter(|(_, surface)| !surface.states_thickness)
        {
            let line = surface.line;
            if number == 0 {
                let reason = "SO: the distance to the object is missing; expected its radius and its distance (1e10 and more \
                     is infinitely far)";
                return Err(TextError { line: Some(line), reason: reason.to_owned() });
            }
            self.notes.push(format!("surface S{number} (line {line}) states no thickness: 0 is taken"));
        }
        Ok(())
    }

    /// Returns the surface that a word as `S3`, `SO` or `SI` names.
    fn surface_named(&self, word: &str) -> Option<usize> {
        let rest = word.strip_prefix(['S', 's'])?;
        let number = match rest.to_uppercase().as_str() {
            "O" => 0,
            "I" => self.surfaces.len().checked_sub(1)?,
            digits => digits.parse().ok()?,
        };
        (number < self.surfaces.len()).then_some(number)
    }

    /// Returns the medium of a word as `N-SK16_SCHOTT`, `1.5168:64.17`, `517642` or `AIR`; nothing for air.
    fn medium(&mut self, word: &str, command: &Command) -> Result<Option<Glass>, TextError> {
        if matches!(word.to_uppercase().as_str(), "AIR" | "VACUUM" | "") {
            return Ok(None);
        }
        if matches!(word.to_uppercase().as_str(), "REFR" | "REFO") {
            return Err(command.wrong(format!("'{word}' is no glass; expected a glass, AIR or REFL for a mirror")));
        }
        let glass = match code_of(word) {
            Some(glass) => glass,
            None => {
                let name = match word.rsplit_once('_') {
                    // The program's own catalogue of crystals and other media that are of no one maker.
                    Some((name, maker)) if maker.eq_ignore_ascii_case("SPECIAL") => format!("MISC:{name}"),
                    Some((name, maker)) if !maker.is_empty() => format!("{maker}:{name}"),
                    _ => word.to_owned(),
                };
                let is_private = self.glasses.private.iter().any(|glass| glass.name.eq_ignore_ascii_case(word));
                let found = self.glasses.find(if is_private { word } else { &name }, None);
                let is_number = word.starts_with(|first: char| first.is_ascii_digit());
                let expected = "an index is written as 1.5168, 1.5168:64.17, 517642 or 1.0001e4";
                let unread = self.notes.iter().find(|note| note.starts_with(&format!("private glass {word} ")));
                let hint = match unread {
                    Some(note) => format!("; {note}"),
                    None if is_number => format!("; {expected}"),
                    None => String::new(),
                };
                found.map_err(|reason| command.wrong(format!("{reason}{hint}")))?.glass
            }
        };
        glass.check().map_err(|error| command.wrong(error))?;
        Ok(Some(glass))
    }

    /// Decides whether the numbers of `S` are radii or curvatures where the file says neither, and returns what was taken.
    ///
    /// Curvature is the program's default, but files that other programs write mean radii. Radii are longer than the beam is
    /// wide by half, and than half the glass is thick; curvatures are below 1 in any unit that lenses are drawn in.
    fn decide_mode(&mut self) -> Option<&'static str> {
        use SeqNumbers::{Curvatures, Radii};
        let mode = match (self.is_mode_stated, self.glasses.seq_numbers()) {
            (true, _) => return None,
            (false, Some(asked)) => asked,
            (false, None) => {
                let numbers = || self.surfaces.iter().filter_map(|surface| surface.number_of_s).map(f64::abs);
                let (least, largest) = (numbers().fold(f64::INFINITY, f64::min), numbers().fold(0.0, f64::max));
                let of_beam = match self.beam {
                    Some(Beam::EntrancePupil(diameter)) => 0.5 * diameter,
                    _ => 0.0,
                };
                let glass = self.surfaces.iter().filter(|surface| surface.medium.is_some());
                let of_glass = glass.map(|surface| 0.5 * surface.thickness.abs()).fold(0.0, f64::max);
                let are_short = largest > 0.0 && largest < 1.0 && least < of_beam.max(of_glass);
                if are_short { Curvatures } else { Radii }
            }
        };
        if mode == Curvatures {
            for surface in &mut self.surfaces {
                // Other commands may have curved the surface since.
                if let Some(number) = surface.number_of_s.filter(|number| surface.curvature == 1.0 / number) {
                    surface.curvature = number;
                }
            }
        }
        let note = if mode == Curvatures { CURVATURES_TAKEN } else { RADII_TAKEN };
        self.notes.push(note.to_owned());
        Some(note)
    }

    fn into_system(mut self) -> Result<System, TextError> {
        if !self.has_image {
            let reason = "the file has no image surface (SI); expected SO, surfaces S and SI".to_owned();
            return Err(TextError { line: None, reason });
        }
        self.check_thicknesses()?;
        self.notes.extend(self.passed_over.notes());
        let mm = self.mm_per_unit;
        let n_surfaces = self.surfaces.len();
        let stop = self.surfaces.iter().position(|surface| surface.is_stop);
        let (object, image) = (&self.surfaces[0], &self.surfaces[n_surfaces - 1]);
        let object_medium = object.medium.clone().unwrap_or(Glass::Air);
        let image_surface = ImageSurface { curvature_per_mm: image.curvature / mm, conic: image.conic };
        // The defocus on the image surface is part of the distance to the film; 1e10 and more is infinitely far.
        let defocus_mm = image.thickness * mm;
        let is_far = object.thickness.abs() >= 1e10;
        let object_distance_mm = if is_far { f64::INFINITY } else { object.thickness * mm };
        self.notes.extend(note_on_film(image.shape(mm)));
        self.notes.extend(note_on_object(object_distance_mm, object.curvature / mm));
        let mut surfaces: Vec<SystemSurface> = Vec::with_capacity(n_surfaces);
        let (mut moves, mut z_mm) = (Vec::new(), 0.0);
        for (i, surface) in self.surfaces[1..].iter().enumerate() {
            moves.extend(surface.moves(i, mm, z_mm));
            z_mm += surface.thickness * mm;
            if i + 2 < n_surfaces {
                let before = surfaces.last().map_or(&object_medium, |before| &before.medium_after);
                surfaces.push(surface.in_mm(mm, before)?);
            }
        }
        if let Some(last) = surfaces.last_mut() {
            last.thickness_after_mm += defocus_mm;
        }
        // What a reversed image would move stands behind it.
        moves.retain(|step| step.step.surfaces.0 <= surfaces.len());
        // Without a stop the first surface is it, as in the program.
        let stop = match stop {
            Some(stop) => stop.checked_sub(1),
            None => {
                self.notes.push("no surface is marked as the stop (STO): the first is it".to_owned());
                Some(0)
            }
        };
        Ok(System {
            name: self.name.clone(),
            source: if self.remarks.is_empty() { "a CODE V file".to_owned() } else { self.remarks.remove(0) },
            object_distance_mm,
            object_medium,
            first_vertex_z_mm: 0.0,
            surfaces,
            moves,
            image_surface,
            stop,
            beam: self.beam.map(|beam| match beam {
                Beam::EntrancePupil(diameter) => Beam::EntrancePupil(diameter * mm),
                other => other,
            }),
            fields: self.fields_in_mm(),
            field_weights: self.field_weights,
            wavelengths_nm: self.wavelengths_nm,
            wavelength_weights: self.wavelength_weights,
            comments: self.remarks,
            reference: self.reference.saturating_sub(1),
            notes: self.notes,
            is_reduced: false,
        })
    }

    fn fields_in_mm(&self) -> Vec<(Field, FieldVignetting)> {
        let [x, y] = &self.fields;
        let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
        let mm = self.mm_per_unit;
        let field = |i: usize| {
            let (x, y) = (at(x, i), at(y, i));
            let field = match self.field_kind {
                Some(FieldKind::ObjectHeight) => Field::ObjectHeight { x_mm: mm * x, y_mm: mm * y },
                Some(FieldKind::ImageHeight) => Field::ImageHeight { x_mm: mm * x, y_mm: mm * y },
                Some(FieldKind::RealImageHeight) => Field::RealImageHeight { x_mm: mm * x, y_mm: mm * y },
                _ => Field::Angle { x_deg: x, y_deg: y },
            };
            // The program cuts a share of the pupil radius off each side.
            let [upper_x, lower_x, upper_y, lower_y] = self.vignetting.each_ref().map(|list| at(list, i));
            let center = (0.5 * (lower_x - upper_x), 0.5 * (lower_y - upper_y)).into();
            let compression = (0.5 * (upper_x + lower_x), 0.5 * (upper_y + lower_y)).into();
            (field, FieldVignetting { center, compression })
        };
        (0..x.len().max(y.len())).map(field).collect()
    }
}

/// Returns the lines of comment that a file begins with, those that say something.
fn remarks_of(text: &str) -> Vec<String> {
    let lines = text.lines().map(str::trim).take_while(|line| line.is_empty() || line.starts_with('!'));
    let remarks = lines.map(|line| line.trim_start_matches('!').trim().to_owned());
    remarks.filter(|remark| remark.contains(char::is_alphanumeric)).collect()
}

/// Whether the word in a glass's place makes the surface a mirror.
fn is_mirror(word: &str) -> bool {
    word.eq_ignore_ascii_case("REFL")
}

/// Whether a word is `S` and a number, as surfaces are named.
fn is_number_of_surface(word: &str) -> bool {
    let digits = word.strip_prefix(['S', 's']).unwrap_or_default();
    !digits.is_empty() && digits.bytes().all(|sign| sign.is_ascii_digit())
}

fn is_no(command: &Command) -> bool {
    command.words.get(1).is_some_and(|word| word.to_uppercase().starts_with('N'))
}

fn mm_per_unit(command: &Command) -> Result<f64, TextError> {
    match command.words.get(1).map(|word| word.to_uppercase()).as_deref() {
        Some("M" | "MM") => Ok(1.0),
        Some("C" | "CM") => Ok(10.0),
        Some("I" | "IN" | "INCH" | "INCHES") => Ok(25.4),
        other => Err(command.wrong(format!("'{}' is no unit of length; expected M, C or I", other.unwrap_or("")))),
    }
}

/// Returns the glass of a fictitious code: `1.5168:64.17`, `1.5168`, `517642`, `517.642` or `516800.641700`.
fn code_of(word: &str) -> Option<Glass> {
    // An index of a hundred or more, as that of a thin lens in place of a grating, is written with its exponent: digits alone are a code.
    let index = |word: &str| word.parse().ok().filter(|index| *index < 100.0 || word.contains(['e', 'E']));
    match word.split_once(':') {
        Some((nd, vd)) => Some(model(index(nd)?, vd.parse().ok()?)),
        None => glass_of_digits(word).or_else(|| index(word).map(constant)),
    }
}
