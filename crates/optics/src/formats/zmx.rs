//! Zemax lens files (`.zmx`): a keyword a line, surfaces in blocks that begin with `SURF`.
//!
//! Read are sequential systems of the surfaces STANDARD, EVENASPH, ODDASPHE, BICONICX, TOROIDAL, PARAXIAL, DGRATING, `BINARY_2`
//! and COORDBRK, mirrors among them,
//! with the entrance pupil, fields, wavelengths and configurations. Solves and pickups keep the values that
//! the file stores. Keywords that change no ray (colors, tolerances, merit functions) are
//! passed over; whatever changes rays and cannot be traced is refused by name.

mod configurations;
mod surface;

use crate::{Glass, ImageSurface};

use self::{configurations::ZmxOperand, surface::ZmxSurface};
use super::{
    glasses::Glasses,
    lens_file::{Field, LensFile},
    system::{Beam, FieldVignetting, System, SystemMove, SystemSurface, note_on_film, note_on_object},
    text_error::TextError,
};

/// Reads a Zemax file; `name` serves where the file states none.
pub(super) fn lens_from_zmx(text: &str, name: &str, glasses: Glasses) -> Result<LensFile, TextError> {
    let mut file = Zmx::default();
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        if let Some(keyword) = words.next() {
            let words: Vec<&str> = words.collect();
            file.take(&Line { number: number + 1, keyword, words })?;
        }
    }
    file.build(name, &glasses)
}

/// A line of the file: a keyword and what follows it.
struct Line<'a> {
    number: usize,
    keyword: &'a str,
    words: Vec<&'a str>,
}

impl Line<'_> {
    fn wrong(&self, reason: impl std::fmt::Display) -> TextError {
        TextError { line: Some(self.number), reason: format!("{}: {reason}", self.keyword) }
    }

    /// Returns the number at a place after the keyword.
    fn number(&self, place: usize) -> Result<f64, TextError> {
        let Some(&word) = self.words.get(place) else {
            return Err(self.wrong(format!("expected {} numbers, found {}", place + 1, self.words.len())));
        };
        if word.eq_ignore_ascii_case("INFINITY") {
            return Ok(f64::INFINITY);
        }
        match word.parse::<f64>() {
            Ok(number) if !number.is_nan() => Ok(number),
            _ => Err(self.wrong(format!("'{word}' is not a number"))),
        }
    }

    fn number_or(&self, place: usize, default: f64) -> Result<f64, TextError> {
        if place < self.words.len() { self.number(place) } else { Ok(default) }
    }

    fn count(&self, place: usize) -> Result<usize, TextError> {
        let found = self.number(place)?;
        if (0.0..=1e6).contains(&found) && found.fract() == 0.0 {
            return Ok(found as usize);
        }
        Err(self.wrong(format!("{found} is not a whole number")))
    }

    /// Returns all numbers after the keyword.
    fn numbers(&self) -> Result<Vec<f64>, TextError> {
        (0..self.words.len()).map(|place| self.number(place)).collect()
    }

    fn text(&self) -> String {
        self.words.join(" ").trim_matches('"').to_owned()
    }
}

/// Keywords without a part in how a lens images: of windows, drawings, tolerances, polarization, ray aiming and physical optics.
const HARMLESS: &[&str] = &[
    "AUTH", "BLNK", "COFN", "COTF", "EERA", "FIMP", "FLAP", "GLRS", "GSTD", "HIDE", "HYPR", "IWDP", "LANG", "LUID",
    "MEMA", "MIRR", "MODE", "MOFF", "NSCD", "OMMA", "PFIL", "PICB", "POLS", "POPS", "PUSH", "RAIM", "RAED", "RAGL",
    "ROPD", "RSCE", "RSCH", "RWRE", "RFLS", "SDMA", "SLAB", "SSID", "STUD", "TOL", "TOLR", "TOLS", "VANN", "VDSZ",
    "VERS",
];
/// What the second and the seventh number of `FTYP` say where they are not 0.
const FLAGS: [(usize, &str); 2] = [
    (
        1,
        "the file means its object space to be telecentric (FTYP): chief rays go through the middle of the stop instead",
    ),
    (
        6,
        "the file means its image space to be afocal (FTYP): where its light leaves in parallel, --afocal looks at angles",
    ),
];
/// The unknown keywords that are named.
const MOST_NAMED: usize = 6;

/// What a file says, in its own units.
#[derive(Clone, Default)]
struct Zmx {
    name: String,
    remarks: Vec<String>,
    mm_per_unit: Option<f64>,
    beam: Option<Beam>,
    makers: Vec<String>,
    field_type: usize,
    n_fields: Option<usize>,
    n_wavelengths: Option<usize>,
    fields: [Vec<f64>; 2],
    vignetting: [Vec<f64>; 4],
    /// Each with its number and its weight.
    wavelengths_um: Vec<(usize, f64, f64)>,
    field_weights: Vec<f64>,
    primary: usize,
    n_configurations: usize,
    /// The configuration for which values are stored, counted from 1.
    stored: usize,
    operands: Vec<ZmxOperand>,
    surfaces: Vec<ZmxSurface>,
    /// The number that the file gives each of them.
    surface_numbers: Vec<usize>,
    notes: Vec<String>,
    /// The coatings that it names, each once.
    coatings: Vec<String>,
    /// Keywords that are not known, each once.
    unknown: Vec<String>,
}

impl Zmx {
    fn take(&mut self, line: &Line) -> Result<(), TextError> {
        match line.keyword {
            "SURF" => {
                let number = line.count(0)?;
                // Files that were edited by hand leave numbers out; other lines name surfaces by the numbers that are there.
                match self.surface_numbers.last() {
                    Some(&last) if number <= last => {
                        return Err(
                            line.wrong(format!("surface {number} after surface {last}; expected ascending numbers"))
                        );
                    }
                    _ => self.surface_numbers.push(number),
                }
                self.surfaces.push(ZmxSurface::begin(line.number));
                Ok(())
            }
            _ => {
                let is_taken = self.surfaces.last_mut().map_or(Ok(false), |surface| surface.take(line))?;
                if is_taken { Ok(()) } else { self.take_general(line) }
            }
        }
    }

    /// Takes what belongs to the whole system.
    fn take_general(&mut self, line: &Line) -> Result<(), TextError> {
        match line.keyword {
            "MODE" if line.words.first().is_some_and(|mode| *mode != "SEQ") => {
                return Err(line.wrong(format!("{} is not supported; expected SEQ", line.text())));
            }
            "NAME" => self.name = line.text(),
            "NOTE" => self.remarks.push(line.words.get(1..).unwrap_or_default().join(" ")),
            "UNIT" => self.mm_per_unit = Some(mm_per_unit(line)?),
            "ENPD" => self.beam = Some(Beam::EntrancePupil(line.number(0)?)),
            "FNUM" if line.number_or(1, 0.0)? == 0.0 => self.beam = Some(Beam::FNumber(line.number(0)?)),
            "OBNA" if line.number_or(1, 0.0)? == 0.0 => self.beam = Some(Beam::ObjectAperture(line.number(0)?)),
            "FNUM" => self.beam = Some(Beam::WorkingFNumber(line.number(0)?)),
            "OBNA" => self.beam = Some(Beam::ObjectCone(line.number(0)?.to_radians())),
            "ENVD" => self.take_environment(line)?,
            "FLOA" => self.beam = Some(Beam::Stop),
            "GCAT" => self.makers = makers(&line.words),
            "FTYP" => {
                self.field_type = line.count(0)?;
                for (place, note) in FLAGS {
                    if line.words.len() > place && line.count(place)? != 0 {
                        self.notes.push(note.to_owned());
                    }
                }
                self.n_fields = (line.words.len() > 2).then(|| line.count(2)).transpose()?;
                self.n_wavelengths = (line.words.len() > 3).then(|| line.count(3)).transpose()?;
            }
            "XFLN" | "XFLD" => self.fields[0] = line.numbers()?,
            "YFLN" | "YFLD" => self.fields[1] = line.numbers()?,
            "VDXN" | "ZVDX" => self.vignetting[0] = line.numbers()?,
            "VDYN" | "ZVDY" => self.vignetting[1] = line.numbers()?,
            "VCXN" | "ZVCX" => self.vignetting[2] = line.numbers()?,
            "VCYN" | "ZVCY" => self.vignetting[3] = line.numbers()?,
            "WAVM" => {
                let stated = (line.count(0)?, line.number(1)?, line.number_or(2, 1.0)?);
                let is_used = self.n_wavelengths.is_none_or(|n| n == 0 || stated.0 <= n);
                match self.wavelengths_um.iter_mut().find(|known| known.0 == stated.0) {
                    Some(known) => {
                        if is_used && known.1 != stated.1 {
                            let (number, um) = (stated.0, stated.1);
                            self.notes.push(format!(
                                "wavelength {number} is stated twice: {um} µm takes the place of {} µm",
                                known.1
                            ));
                        }
                        *known = stated;
                    }
                    None => self.wavelengths_um.push(stated),
                }
            }
            // Older files name the lists of 24 wavelengths so, as `XFLN` those of fields.
            "WAVL" | "WAVN" => {
                self.wavelengths_um = (1..).zip(line.numbers()?).map(|(number, um)| (number, um, 1.0)).collect()
            }
            "WWGT" | "WWGN" => {
                for (stated, weight) in self.wavelengths_um.iter_mut().zip(line.numbers()?) {
                    stated.2 = weight;
                }
            }
            "FWGN" | "FWGT" => self.field_weights = line.numbers()?,
            "PWAV" => self.primary = line.count(0)?,
            "MNUM" => {
                self.n_configurations = line.count(0)?;
                self.stored = if line.words.len() > 1 { line.count(1)? } else { 1 };
            }
            _ if self.n_configurations > 1 => self.operands.extend(ZmxOperand::of(line)?),
            "COAT" => {
                let name = line.text();
                if !name.is_empty() && !self.coatings.contains(&name) {
                    self.coatings.push(name);
                }
            }
            // A kind of apodization and its factor; without numbers, or of 0, the pupil is even.
            "GFAC" if line.numbers()?.iter().all(|number| *number == 0.0) => {}
            "GFAC" => {
                self.notes.push("its apodization of the pupil (GFAC) is left out: the pupil is evenly lit".to_owned());
            }
            keyword if HARMLESS.contains(&keyword) => {}
            keyword => {
                if !self.unknown.iter().any(|known| known == keyword) {
                    self.unknown.push(keyword.to_owned());
                }
            }
        }
        Ok(())
    }

    /// Returns a sentence on the coatings that the file names, if there are any: what they are stands in another file.
    fn note_on_coatings(&self) -> Option<String> {
        let named = self.coatings.iter().take(MOST_NAMED).cloned().collect::<Vec<_>>().join(", ");
        let more = if self.coatings.len() > MOST_NAMED { " and more" } else { "" };
        (!self.coatings.is_empty()).then(|| {
            format!(
                "its coatings are named but not stated ({named}{more}): the usual ones are taken, or those of --coating"
            )
        })
    }

    /// Returns a sentence on the keywords that are not known, if there are any.
    fn note_on_unknown(&self) -> Option<String> {
        let named = self.unknown.iter().take(MOST_NAMED).cloned().collect::<Vec<_>>().join(", ");
        let more = self.unknown.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        (!self.unknown.is_empty()).then(|| format!("not known and left out: {named}{more}"))
    }

    /// Takes the temperature, the pressure and whether indices are to follow them.
    fn take_environment(&mut self, line: &Line) -> Result<(), TextError> {
        let (celsius, atmospheres) = (line.number_or(0, 20.0)?, line.number_or(1, 1.0)?);
        if line.number_or(2, 0.0)? != 0.0 && (celsius != 20.0 || atmospheres != 1.0) {
            self.notes.push(format!(
                "the file's lens works at {celsius} °C and {atmospheres} atm (ENVD): indices are those of the catalogues, \
                 and lengths as stated"
            ));
        }
        Ok(())
    }

    /// Returns a sentence on the solves and pickups, if there are any.
    fn note_on_solves(&self) -> Option<String> {
        let of_surface = |(number, surface): (usize, &ZmxSurface)| {
            (!surface.solves.is_empty()).then(|| {
                format!(
                    "{number} ({})",
                    surface.solves.iter().map(|solve| solve.keyword.as_str()).collect::<Vec<_>>().join(", ")
                )
            })
        };
        let solves: Vec<String> = self.surfaces.iter().enumerate().filter_map(of_surface).collect();
        let which = solves.join(", ");
        (!solves.is_empty())
            .then(|| format!("solves and pickups are not worked out anew: the stored values stand at surface {which}"))
    }

    /// Returns a sentence on numbers of surfaces that the file leaves out, if it does.
    fn note_on_gaps(&self) -> Option<String> {
        let last = self.surface_numbers.last().copied().unwrap_or(0);
        let missing: Vec<String> = (0..last)
            .filter(|number| !self.surface_numbers.contains(number))
            .map(|number| number.to_string())
            .collect();
        (!missing.is_empty()).then(|| {
            format!(
                "the file has no surface {}: the next stands in its place, and nothing between them",
                missing.join(", ")
            )
        })
    }

    /// Returns sentences on what stands twice, of which the last counts.
    fn notes_on_replaced(&self) -> Vec<String> {
        let stops: Vec<usize> = (0..self.surfaces.len()).filter(|&i| self.surfaces[i].is_stop).collect();
        let of_stops = stops.windows(2).map(|pair| {
            format!("two stops (STOP): that of surface {} takes the place of that of surface {}", pair[1], pair[0])
        });
        let of_surfaces =
            self.surfaces.iter().enumerate().flat_map(|(number, surface)| {
                surface.notes.iter().map(move |note| format!("surface {number}: {note}"))
            });
        of_stops.chain(of_surfaces).collect()
    }

    fn into_system(mut self, name: &str, mut glasses: Glasses) -> Result<System, TextError> {
        glasses.makers = std::mem::take(&mut self.makers);
        let mm = self.mm_per_unit.unwrap_or(1.0);
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.note_on_solves());
        notes.extend(self.note_on_gaps());
        notes.extend(self.note_on_coatings());
        notes.extend(self.note_on_unknown());
        let [object, .., image] = self.surfaces.as_slice() else {
            let reason = format!("the file has {} surfaces; expected an object and an image", self.surfaces.len());
            return Err(TextError { line: None, reason });
        };
        let object_medium = object.medium(0, &glasses, &mut notes)?;
        let image_surface = ImageSurface { curvature_per_mm: image.curvature / mm, conic: image.conic };
        let last = self.surfaces.len() - 1;
        notes.extend(note_on_film(image.in_mm(last, mm, Glass::Air).map(|surface| surface.shape)));
        notes.extend(note_on_object(object.thickness * mm, object.curvature / mm));
        if !matches!(object.kind.as_str(), "STANDARD" | "COORDBRK") {
            notes.push(format!("an object of type {} is taken for a plane", object.kind));
        }
        notes.extend(self.notes_on_replaced());
        let mut surfaces: Vec<SystemSurface> = Vec::with_capacity(last);
        let mut stop = self.surfaces[0].is_stop.then_some(0);
        let mut moves: Vec<SystemMove> = Vec::new();
        let mut object_distance_mm = self.surfaces[0].thickness * mm;
        // z along the axis from the first surface of the file, and of its first surface that is no coordinate break.
        let (mut z_mm, mut first_vertex_z_mm) = (0.0, 0.0);
        for (number, surface) in self.surfaces[..last].iter().enumerate().skip(1) {
            let thickness_mm = surface.thickness * mm;
            if surface.kind == "COORDBRK" {
                moves.push(surface.coordinate_break(number, mm, (surfaces.len(), z_mm))?);
                match surfaces.last_mut() {
                    Some(before) => before.thickness_after_mm += thickness_mm,
                    None => {
                        object_distance_mm += thickness_mm;
                        first_vertex_z_mm += thickness_mm;
                    }
                }
            } else {
                if surface.is_stop {
                    stop = Some(surfaces.len());
                }
                let before = surfaces.last().map_or(&object_medium, |before| &before.medium_after);
                let medium_after = match surface.is_mirror() {
                    true => before.clone(),
                    false => surface.medium(number, &glasses, &mut notes)?,
                };
                surfaces.push(surface.in_mm(number, mm, medium_after)?);
            }
            z_mm += thickness_mm;
        }
        let mut wavelengths_um = self.wavelengths_um;
        wavelengths_um.sort_by_key(|(number, ..)| *number);
        wavelengths_um.truncate(self.n_wavelengths.filter(|&n| n > 0).unwrap_or(usize::MAX));
        let wavelengths_nm = wavelengths_um.iter().map(|(_, um, _)| nm_of_um(*um)).collect();
        let last = wavelengths_um.last().map_or(0, |(number, ..)| *number);
        let is_there = |number: &usize| wavelengths_um.iter().any(|(own, ..)| own == number);
        let missing: Vec<String> =
            (1..last).filter(|number| !is_there(number)).take(MOST_NAMED).map(|number| number.to_string()).collect();
        if !missing.is_empty() {
            notes.push(format!("the file states no wavelength {}", missing.join(", ")));
        }
        // The first where none is named.
        let reference = match self.primary {
            0 | 1 => 0,
            primary => {
                let of = |(number, ..): &(usize, f64, f64)| *number == primary;
                let numbers: Vec<String> = wavelengths_um.iter().map(|(number, ..)| number.to_string()).collect();
                let reason =
                    format!("PWAV: the file states no wavelength {primary}; it has the numbers {}", numbers.join(", "));
                wavelengths_um.iter().position(of).ok_or(TextError { line: None, reason })?
            }
        };
        let mut remarks = self.remarks.into_iter().filter(|remark| !remark.is_empty());
        Ok(System {
            name: if self.name.is_empty() { name.to_owned() } else { self.name },
            source: remarks.next().unwrap_or("a Zemax file".to_owned()),
            comments: remarks.collect(),
            object_distance_mm,
            object_medium,
            first_vertex_z_mm,
            surfaces,
            moves,
            image_surface,
            stop,
            beam: self.beam.map(|beam| match beam {
                Beam::EntrancePupil(diameter) => Beam::EntrancePupil(diameter * mm),
                other => other,
            }),
            wavelengths_nm,
            wavelength_weights: wavelengths_um.iter().map(|(.., weight)| *weight).collect(),
            field_weights: self.field_weights,
            reference,
            fields: fields(self.field_type, self.n_fields, mm, &self.fields, &self.vignetting)?,
            notes,
            is_reduced: false,
        })
    }
}

/// Returns the makers whose glasses a file's catalogues hold. Zemax keeps crystals and infrared glasses in catalogues of
/// their own, which are of no one maker.
fn makers(catalogues: &[&str]) -> Vec<String> {
    let are_crystals = |name: &&str| ["INFRARED", "BIREFRINGENT"].contains(&name.to_uppercase().as_str());
    let crystals: &[&str] = if catalogues.iter().any(are_crystals) { &["MISC", "AMI", "VITRON"] } else { &[] };
    catalogues.iter().chain(crystals).map(|&name| name.to_owned()).collect()
}

/// Returns the wavelength in nm whose micrometres a file states: the nearest number of ten digits, so that 0.486 is 486.
pub(super) fn nm_of_um(um: f64) -> f64 {
    let nm = (um * 1e13).round() / 1e10;
    if nm.is_finite() { nm } else { um * 1e3 }
}

fn mm_per_unit(line: &Line) -> Result<f64, TextError> {
    match line.words.first().copied().unwrap_or_default().to_uppercase().as_str() {
        "MM" => Ok(1.0),
        "CM" => Ok(10.0),
        "IN" | "INCH" | "INCHES" => Ok(25.4),
        "M" | "ME" | "METER" | "METERS" => Ok(1e3),
        other => Err(line.wrong(format!("'{other}' is no unit of length; expected MM, CM, IN or METER"))),
    }
}

fn fields(
    kind: usize,
    n_fields: Option<usize>,
    mm: f64,
    [x, y]: &[Vec<f64>; 2],
    vignetting: &[Vec<f64>; 4],
) -> Result<Vec<(Field, FieldVignetting)>, TextError> {
    let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
    let n_stated = x.len().max(y.len());
    let n_fields = n_fields.filter(|&n| n > 0).unwrap_or(n_stated).min(n_stated);
    let field = |i: usize| {
        let (x, y) = (at(x, i), at(y, i));
        let (x_mm, y_mm) = (mm * x, mm * y);
        let field = match kind {
            0 => Field::Angle { x_deg: x, y_deg: y },
            1 => Field::ObjectHeight { x_mm, y_mm },
            2 => Field::ImageHeight { x_mm, y_mm },
            3 => Field::RealImageHeight { x_mm, y_mm },
            _ => {
                let reason = format!("FTYP: field type {kind} is not supported; expected 0 to 3");
                return Err(TextError { line: None, reason });
            }
        };
        let [dx, dy, cx, cy] = vignetting.each_ref().map(|list| at(list, i));
        Ok((field, FieldVignetting { center: (dx, dy).into(), compression: (cx, cy).into() }))
    };
    (0..n_fields).map(field).collect()
}
