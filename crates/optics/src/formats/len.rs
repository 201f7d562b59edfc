//! OSLO lens files (`.len`): a word and its numbers a statement, surfaces one after the other with `NXT` between them.
//!
//! Read are radii or curvatures, thicknesses, glasses, conics, even aspheres (`AD` to `AG`, `ASP ASR`), toroids (`CVX`), mirrors, perfect
//! lenses (`PFL`), gratings (`GSP`), local tilts and decenters, mirrors that bend the axis (`BEN`), the beam, fields (`ANG`, `OBH`, `GIH` and the
//! table `RST NEW`), wavelengths, pickups, and the thicknesses and shapes of a table of configurations (`CFG NEW`). What draws or optimizes is passed over,
//! other words are noted with their line, and what changes rays and cannot be traced is refused. The words are those of files that the
//! program saved and of Optiland's reader (`fileio/oslo`), by which the facts were held: 1 of `UNI` is a millimetre, the first wavelength is the main
//! one, `AP` without `CHK` does not stop rays in that program.

mod configurations;
mod pickups;
mod statement;
mod surface;

use std::collections::BTreeMap;

use crate::{Glass, ImageSurface};

use self::{
    configurations::Override,
    statement::{Statement, statements_of},
    surface::LenSurface,
};
use super::{
    glasses::{Glasses, constant, model},
    lens_file::{Field, LensFile},
    system::{Beam, FieldVignetting, System, SystemSurface, note_on_film, note_on_object},
    text_error::TextError,
};

/// Words that change no ray: drawing, names of elements, expansion, bounds of optimization.
const WITHOUT_EFFECT: [&str; 14] =
    ["DRW", "LDP", "CBK", "ELMDF1", "ELMDF2", "BDI", "BDD", "VX", "PF", "LMN", "LME", "TCE", "APCK", "DLAP"];

/// Words that change rays and are not supported.
const REFUSED: [&str; 24] = [
    "NAP", "PUK", "RCO", "GC", "TOX", "TOY", "TOZ", "APN", "ATP", "GRIN", "GDT", "DOE", "DFR", "DFX", "DOR", "DWV",
    "HOE", "HOR", "SPL", "ZRX", "ARA", "TIR", "FRN", "EIK",
];

/// From this distance on an object is infinitely far.
const FAR: f64 = 9.9e9;

/// Reads an OSLO file; `name` serves where the file states none.
pub(super) fn lens_from_len(text: &str, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
    let mut file = Len::new(name, glasses.clone());
    for statement in statements_of(text)? {
        file.take(&statement)?;
    }
    file.build()
}

/// What a file says, in its own units.
#[derive(Clone)]
struct Len<'a> {
    glasses: Glasses<'a>,
    name: String,
    comments: Vec<String>,
    mm_per_unit: f64,
    n_surfaces: Option<usize>,
    beam: Option<(LenBeam, f64)>,
    field: Option<(LenField, f64)>,
    /// The table of fields, by number: y, x, the bounds of the pupil along y and x, and the weight.
    points: BTreeMap<usize, [f64; 7]>,
    wavelengths_um: Vec<f64>,
    weights: Vec<f64>,
    surfaces: Vec<LenSurface>,
    part: Part,
    overrides: Vec<Override>,
    unknown: Vec<(String, usize)>,
    solves: Vec<(String, usize)>,
    notes: Vec<String>,
}

/// Which part of the file is being read.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Lens,
    /// Behind the END of the lens.
    Footer,
    Configurations,
    Fields,
}

#[derive(Clone, Copy)]
enum LenBeam {
    Radius,
    FNumber,
    ObjectAperture,
}

#[derive(Clone, Copy, PartialEq)]
enum LenField {
    Angle,
    ObjectHeight,
    ImageHeight,
}

impl<'a> Len<'a> {
    fn new(name: &str, glasses: Glasses<'a>) -> Self {
        Self {
            glasses,
            name: name.to_owned(),
            comments: Vec::new(),
            mm_per_unit: 1.0,
            n_surfaces: None,
            beam: None,
            field: None,
            points: BTreeMap::new(),
            // What the program takes where a file states none.
            wavelengths_um: vec![0.58756, 0.48613, 0.65627],
            weights: Vec::new(),
            surfaces: Vec::new(),
            part: Part::Lens,
            overrides: Vec::new(),
            unknown: Vec::new(),
            solves: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn take(&mut self, statement: &Statement) -> Result<(), TextError> {
        match self.part {
            Part::Lens if statement.keyword == "LEN" => self.begin(statement),
            Part::Lens if self.surfaces.is_empty() => {
                Err(statement.wrong("expected LEN NEW, a name and numbers, first"))
            }
            Part::Lens => self.take_of_lens(statement),
            _ => self.take_of_footer(statement),
        }
    }

    fn begin(&mut self, statement: &Statement) -> Result<(), TextError> {
        if !self.surfaces.is_empty() || !statement.word(0).eq_ignore_ascii_case("NEW") {
            return Err(statement.wrong("expected one LEN NEW, a name, a focal length and the number of surfaces"));
        }
        if !statement.word(1).trim().is_empty() {
            self.name = statement.word(1).trim().to_owned();
        }
        self.n_surfaces = Some(statement.count(3)?);
        self.surfaces.push(LenSurface::begin(statement.line));
        Ok(())
    }

    fn take_of_lens(&mut self, statement: &Statement) -> Result<(), TextError> {
        let keyword = statement.keyword.as_str();
        match keyword {
            "UNI" => {
                self.mm_per_unit = statement.number(0)?;
                if self.mm_per_unit <= 0.0 {
                    return Err(statement.wrong("expected the millimetres of a unit, more than 0"));
                }
            }
            "EBR" => self.beam = Some((LenBeam::Radius, statement.number(0)?)),
            "FNO" => self.beam = Some((LenBeam::FNumber, statement.number(0)?)),
            "NAO" => self.beam = Some((LenBeam::ObjectAperture, statement.number(0)?)),
            "ANG" => self.field = Some((LenField::Angle, statement.number(0)?)),
            "OBH" => self.field = Some((LenField::ObjectHeight, statement.number(0)?)),
            "GIH" => self.field = Some((LenField::ImageHeight, statement.number(0)?)),
            "TELE" if matches!(statement.word(0).to_uppercase().as_str(), "ON" | "1") => {
                return Err(statement.wrong("a telecentric entrance pupil is not supported"));
            }
            "TELE" => {}
            "WV" => self.wavelengths_um = statement.numbers()?,
            "WW" => self.weights = statement.numbers()?,
            "DES" => self.comments.extend(Some(statement.words.join(" ")).filter(|text| !text.trim().is_empty())),
            "NXT" => self.surfaces.push(LenSurface::begin(statement.line)),
            "END" => self.part = Part::Footer,
            _ if keyword.starts_with("SNO") => self.comments.push(statement.words.join(" ")),
            _ if WITHOUT_EFFECT.contains(&keyword) => {}
            "LMO" if matches!(statement.word(0).to_uppercase().as_str(), "EGR" | "ELE") => {}
            "LMO" => return Err(statement.wrong("groups whose surfaces are not met in order are not supported")),
            // Of the origin of a turn a 0 is that which is taken.
            _ if REFUSED.contains(&keyword) && statement.number(0).ok() != Some(0.0) => {
                return Err(statement.wrong("changes rays and is not supported"));
            }
            _ if REFUSED.contains(&keyword) => {}
            _ => return self.take_of_surface(statement),
        }
        Ok(())
    }

    /// Takes a statement of the surface that was begun last, or of one wavelength.
    fn take_of_surface(&mut self, statement: &Statement) -> Result<(), TextError> {
        if let Some((list, number)) = statement.of_wavelength() {
            let list = if list == "WV" { &mut self.wavelengths_um } else { &mut self.weights };
            let value = statement.number(0)?;
            list.resize(list.len().max(number), 1.0);
            list[number - 1] = value;
            return Ok(());
        }
        if let "GLA" | "GLF" = statement.keyword.as_str() {
            let (medium, note) = self.medium(statement)?;
            self.notes.extend(note);
            if let Some(surface) = self.surfaces.last_mut() {
                surface.put_medium(Some(medium));
            }
            return Ok(());
        }
        let Some(surface) = self.surfaces.last_mut() else { return Ok(()) };
        match surface.take(statement)? {
            surface::Taken::Yes => {}
            surface::Taken::Solve => self.solves.push((statement.keyword.clone(), statement.line)),
            surface::Taken::No => {
                if self.unknown.iter().all(|(word, _)| *word != statement.keyword) {
                    self.unknown.push((statement.keyword.clone(), statement.line));
                }
            }
        }
        Ok(())
    }

    /// Takes what stands behind the lens: tables of configurations and of fields; what else the program keeps there changes no ray.
    fn take_of_footer(&mut self, statement: &Statement) -> Result<(), TextError> {
        let is_new = statement.word(0).eq_ignore_ascii_case("NEW");
        match (self.part, statement.keyword.as_str()) {
            (_, "CFG") if is_new => self.part = Part::Configurations,
            (_, "RST") if is_new => self.part = Part::Fields,
            (_, "END") => self.part = Part::Footer,
            (Part::Configurations, _) => self.overrides.push(Override::of(statement)?),
            (Part::Fields, "F") => {
                let numbers = statement.numbers()?;
                let [number, y, x, _, _, _, y_min, y_max, x_min, x_max, weight, ..] = numbers[..] else {
                    return Err(statement.wrong("expected a number and ten more"));
                };
                if !(1.0..=1000.0).contains(&number) {
                    return Err(statement.wrong(format!("field {number}, expected 1 to 1000")));
                }
                self.points.insert(number as usize, [y, x, y_min, y_max, x_min, x_max, weight]);
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the glass of a statement: a name, or indices at the wavelengths that were stated last, or at the d line with an Abbe number.
    fn medium(&self, statement: &Statement) -> Result<(Glass, Option<String>), TextError> {
        let words: &[String] = match statement.word(0).to_uppercase().as_str() {
            "MOD" => &statement.words[1..],
            _ => &statement.words,
        };
        // A name may stand before the numbers.
        let is_number = |word: &String| word.parse::<f64>().is_ok();
        let first = words.iter().position(is_number).unwrap_or(words.len());
        if let Some(word) = words[first..].iter().find(|word| !is_number(word)) {
            return Err(statement.wrong(format!("'{word}' is not a number")));
        }
        let numbers: Vec<f64> = words[first..].iter().filter_map(|word| word.parse().ok()).collect();
        let wavelengths_nm: Vec<f64> = self.wavelengths_um.iter().map(|um| super::zmx::nm_of_um(*um)).collect();
        let checked = |glass: Glass| match glass.check() {
            Ok(()) => Ok((glass, None)),
            Err(error) => Err(statement.wrong(error)),
        };
        match numbers[..] {
            [] => {
                let name = statement.word(0);
                let found = self.glasses.find(name, None).map_err(|reason| statement.wrong(reason))?;
                Ok((found.glass, found.note))
            }
            [index] => checked(constant(index)),
            [nd, vd] if vd > 5.0 => checked(model(nd, vd)),
            _ if numbers.len() == wavelengths_nm.len() => {
                let mut rows: Vec<(f64, f64)> = wavelengths_nm.into_iter().zip(numbers).collect();
                rows.sort_by(|a, b| a.0.total_cmp(&b.0));
                if rows.iter().all(|row| row.1 == rows[0].1) {
                    return checked(constant(rows[0].1));
                }
                let (wavelengths_nm, indices) = rows.into_iter().unzip();
                checked(Glass::Tabulated { wavelengths_nm, indices })
            }
            _ => {
                let (found, expected) = (numbers.len(), wavelengths_nm.len());
                Err(statement.wrong(format!("{found} indices for {expected} wavelengths (WV)")))
            }
        }
    }

    fn note_on_words(&mut self) {
        let named = |words: &[(String, usize)]| {
            let first = words.iter().take(10).map(|(word, line)| format!("{word} (line {line})"));
            first.collect::<Vec<_>>().join(", ")
        };
        if !self.solves.is_empty() {
            let which = named(&self.solves);
            self.notes.push(format!("solves are not worked out anew, the stored values stand: {which}"));
        }
        if !self.unknown.is_empty() {
            let which = named(&self.unknown);
            self.notes.push(format!("not understood and passed over: {which}"));
        }
        if self.surfaces.iter().any(|surface| surface.is_open_aperture()) {
            self.notes
                .push("apertures that the file's program does not check (AP without CHK) bound light here".to_owned());
        }
    }

    fn into_system(mut self) -> Result<System, TextError> {
        let n_surfaces = self.surfaces.len();
        if self.n_surfaces != Some(n_surfaces.saturating_sub(1)) || n_surfaces < 3 {
            let stated = self.n_surfaces.unwrap_or(0);
            let reason = format!(
                "LEN states {stated} surfaces behind the object and {} follow it; expected as many, and at least 2",
                n_surfaces.saturating_sub(1)
            );
            return Err(TextError { line: None, reason });
        }
        pickups::resolve(&mut self.surfaces)?;
        self.note_on_words();
        let mm = self.mm_per_unit;
        let object_distance_mm = match self.surfaces[0].thickness {
            far if far >= FAR => f64::INFINITY,
            thickness => thickness * mm,
        };
        let object_medium = self.surfaces[0].medium.clone().unwrap_or(Glass::Air);
        let image = &self.surfaces[n_surfaces - 1];
        let image_surface = ImageSurface { curvature_per_mm: image.curvature / mm, conic: image.conic };
        let object = &self.surfaces[0];
        self.notes.extend(note_on_film(image.shape(mm).map_err(|reason| TextError { line: Some(image.line), reason })));
        self.notes.extend(note_on_object(object_distance_mm, object.curvature / mm));
        let mut surfaces: Vec<SystemSurface> = Vec::with_capacity(n_surfaces);
        let (mut moves, mut z_mm) = (Vec::new(), 0.0);
        for (i, surface) in self.surfaces[1..].iter().enumerate() {
            moves.extend(surface.moves(i, mm, z_mm)?);
            z_mm += surface.thickness * mm;
            if i + 2 < n_surfaces {
                let before = surfaces.last().map_or(&object_medium, |before| &before.medium_after);
                surfaces.push(surface.in_mm(mm, before)?);
            }
        }
        if let Some(last) = surfaces.last_mut() {
            last.thickness_after_mm += image.thickness * mm;
        }
        let stops: Vec<usize> = (0..n_surfaces).filter(|&i| self.surfaces[i].is_stop).collect();
        for pair in stops.windows(2) {
            let [before, after] = [pair[0], pair[1]];
            self.notes
                .push(format!("two stops (AST): that of surface {after} takes the place of that of surface {before}"));
        }
        let stop = stops.last().copied();
        if stop.is_none() {
            self.notes.push("no surface is marked as the stop (AST): the first is it".to_owned());
        }
        let (fields, field_weights) = self.fields(object_distance_mm);
        Ok(System {
            beam: self.beam_in_mm(object_distance_mm)?,
            name: self.name,
            source: if self.comments.is_empty() { "an OSLO file".to_owned() } else { self.comments.remove(0) },
            comments: self.comments,
            object_distance_mm,
            object_medium,
            first_vertex_z_mm: 0.0,
            surfaces,
            moves,
            image_surface,
            stop: stop.unwrap_or(1).checked_sub(1),
            wavelengths_nm: self.wavelengths_um.iter().map(|um| super::zmx::nm_of_um(*um)).collect(),
            wavelength_weights: self.weights,
            reference: 0,
            fields,
            field_weights,
            notes: self.notes,
            is_reduced: false,
        })
    }

    /// Returns the beam: a radius on the first surface, which of a far object is that of the entrance pupil.
    fn beam_in_mm(&self, object_distance_mm: f64) -> Result<Option<Beam>, TextError> {
        let is_far = object_distance_mm.is_infinite();
        Ok(match self.beam {
            None => None,
            Some((LenBeam::Radius, radius)) if is_far => Some(Beam::EntrancePupil(2.0 * radius * self.mm_per_unit)),
            Some((LenBeam::Radius, radius)) => {
                Some(Beam::ObjectCone((radius * self.mm_per_unit / object_distance_mm).atan()))
            }
            Some((LenBeam::FNumber, f_number)) if is_far => Some(Beam::FNumber(f_number)),
            Some((LenBeam::FNumber, _)) => {
                let reason = "FNO of an object that is near is not supported; expected EBR or NAO".to_owned();
                return Err(TextError { line: None, reason });
            }
            Some((LenBeam::ObjectAperture, aperture)) => Some(Beam::ObjectAperture(aperture)),
        })
    }

    /// Returns the fields of the table, or else the axis, .7 of the largest field and that one, and their weights.
    fn fields(&mut self, object_distance_mm: f64) -> (Vec<(Field, FieldVignetting)>, Vec<f64>) {
        let Some((kind, largest)) = self.field else { return (Vec::new(), Vec::new()) };
        let mm = self.mm_per_unit;
        // An object that is far has an angle where its height is stated; light of a point above falls.
        let is_far = object_distance_mm.is_infinite();
        let far_deg = |height: f64| -(height / self.surfaces[0].thickness).atan().to_degrees();
        let field = |x: f64, y: f64| match kind {
            LenField::Angle => {
                let angle = |share: f64| (share * largest.to_radians().tan()).atan().to_degrees();
                Field::Angle { x_deg: angle(x), y_deg: angle(y) }
            }
            LenField::ObjectHeight if is_far => {
                Field::Angle { x_deg: far_deg(x * largest), y_deg: far_deg(y * largest) }
            }
            LenField::ObjectHeight => Field::ObjectHeight { x_mm: x * largest * mm, y_mm: y * largest * mm },
            LenField::ImageHeight => Field::ImageHeight { x_mm: x * largest * mm, y_mm: y * largest * mm },
        };
        if self.points.is_empty() {
            let shares: &[f64] = if largest == 0.0 { &[0.0] } else { &[0.0, 0.7, 1.0] };
            let fields = shares.iter().map(|share| (field(0.0, *share), FieldVignetting::default())).collect();
            if largest != 0.0 {
                self.notes.push(
                    "the file states its largest field alone: the axis, .7 of it and it are the fields".to_owned(),
                );
            }
            return (fields, Vec::new());
        }
        let of_point = |&[y, x, y_min, y_max, x_min, x_max, _]: &[f64; 7]| {
            let center = (0.5 * (x_min + x_max), 0.5 * (y_min + y_max)).into();
            let compression = (1.0 - 0.5 * (x_max - x_min), 1.0 - 0.5 * (y_max - y_min)).into();
            (field(x, y), FieldVignetting { center, compression })
        };
        (self.points.values().map(of_point).collect(), self.points.values().map(|point| point[6]).collect())
    }
}
