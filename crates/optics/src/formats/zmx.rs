//! Zemax lens files (`.zmx`): a keyword a line, surfaces in blocks that begin with `SURF`.
//!
//! Read are sequential systems of the surfaces STANDARD, EVENASPH, ODDASPHE and PARAXIAL, with the entrance pupil,
//! fields and wavelengths of the first configuration. Keywords that change no ray (colours, tolerances, merit functions) are
//! passed over; whatever changes rays and cannot be traced is refused by name.

use crate::{Glass, Shape, prescription::TextError};

use super::{
    glasses::{Glasses, model},
    lens_file::{Field, LensFile},
    shapes::{conic_of, even_asphere},
    system::{Beam, System, SystemSurface, Vignetting},
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
    file.into_system(name, glasses)?.build()
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

/// What a file says, in its own units.
#[derive(Default)]
struct Zmx {
    name: String,
    note: String,
    mm_per_unit: Option<f64>,
    beam: Option<Beam>,
    makers: Vec<String>,
    field_type: usize,
    n_fields: Option<usize>,
    n_wavelengths: Option<usize>,
    fields: [Vec<f64>; 2],
    vignetting: [Vec<f64>; 4],
    wavelengths_um: Vec<(usize, f64)>,
    primary: usize,
    n_configurations: usize,
    surfaces: Vec<ZmxSurface>,
}

/// A surface as the file states it, in the file's units.
#[derive(Default)]
struct ZmxSurface {
    line: usize,
    is_stop: bool,
    kind: String,
    curvature: f64,
    conic: f64,
    thickness: f64,
    /// Numbered from 1.
    parameters: Vec<f64>,
    semi_diameter: Option<f64>,
    is_semi_diameter_fixed: bool,
    clear_radius: Option<f64>,
    glass: Option<ZmxGlass>,
}

struct ZmxGlass {
    line: usize,
    name: String,
    nd_vd: Option<(f64, f64)>,
}

/// Keywords of apertures that are no circles around the axis.
const OTHER_APERTURES: [(&str, &str); 9] = [
    ("OBSC", "a central obscuration"),
    ("SPID", "a spider"),
    ("SQAP", "a rectangular aperture"),
    ("SQOB", "a rectangular obscuration"),
    ("ELAP", "an elliptical aperture"),
    ("ELOB", "an elliptical obscuration"),
    ("USAP", "a user-defined aperture"),
    ("USOB", "a user-defined obscuration"),
    ("UDAP", "a user-defined aperture"),
];

impl Zmx {
    fn take(&mut self, line: &Line) -> Result<(), TextError> {
        match line.keyword {
            "SURF" => {
                let number = line.count(0)?;
                if number != self.surfaces.len() {
                    return Err(line.wrong(format!("surface {number} where {} was expected", self.surfaces.len())));
                }
                self.surfaces.push(ZmxSurface { line: line.number, kind: "STANDARD".to_owned(), ..Default::default() });
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
            "NOTE" if self.note.is_empty() => self.note = line.words.get(1..).unwrap_or_default().join(" "),
            "UNIT" => self.mm_per_unit = Some(mm_per_unit(line)?),
            "ENPD" => self.beam = Some(Beam::EntrancePupil(line.number(0)?)),
            "FNUM" if line.number_or(1, 0.0)? == 0.0 => self.beam = Some(Beam::FNumber(line.number(0)?)),
            "OBNA" if line.number_or(1, 0.0)? == 0.0 => self.beam = Some(Beam::ObjectAperture(line.number(0)?)),
            "FNUM" => return Err(line.wrong("the working f-number is not supported; state the entrance pupil")),
            "OBNA" => return Err(line.wrong("the object cone angle is not supported; state the aperture or pupil")),
            "FLOA" => self.beam = Some(Beam::Stop),
            "GCAT" => self.makers = line.words.iter().map(|&maker| maker.to_owned()).collect(),
            "FTYP" => {
                self.field_type = line.count(0)?;
                self.n_fields = (line.words.len() > 2).then(|| line.count(2)).transpose()?;
                self.n_wavelengths = (line.words.len() > 3).then(|| line.count(3)).transpose()?;
            }
            "XFLN" | "XFLD" => self.fields[0] = line.numbers()?,
            "YFLN" | "YFLD" => self.fields[1] = line.numbers()?,
            "VDXN" | "ZVDX" => self.vignetting[0] = line.numbers()?,
            "VDYN" | "ZVDY" => self.vignetting[1] = line.numbers()?,
            "VCXN" | "ZVCX" => self.vignetting[2] = line.numbers()?,
            "VCYN" | "ZVCY" => self.vignetting[3] = line.numbers()?,
            "WAVM" => self.wavelengths_um.push((line.count(0)?, line.number(1)?)),
            "WAVL" => self.wavelengths_um = (1..).zip(line.numbers()?).collect(),
            "PWAV" => self.primary = line.count(0)?,
            "MNUM" => self.n_configurations = line.count(0)?,
            _ => {}
        }
        Ok(())
    }

    fn into_system(mut self, name: &str, mut glasses: Glasses) -> Result<System, TextError> {
        glasses.makers = std::mem::take(&mut self.makers);
        let mm = self.mm_per_unit.unwrap_or(1.0);
        let mut notes = Vec::new();
        if self.n_configurations > 1 {
            notes.push(format!("of {} configurations the one that is stored is read", self.n_configurations));
        }
        let [object, .., image] = self.surfaces.as_slice() else {
            let reason = format!("the file has {} surfaces; expected an object and an image", self.surfaces.len());
            return Err(TextError { line: None, reason });
        };
        if object.glass.is_some() {
            let reason = "surface 0: an object space other than air is not supported".to_owned();
            return Err(TextError { line: Some(object.line), reason });
        }
        if image.curvature != 0.0 {
            notes.push(format!("the image surface of radius {} mm is read as a plane", mm / image.curvature));
        }
        let last = self.surfaces.len() - 1;
        let mut surfaces: Vec<SystemSurface> = Vec::with_capacity(last);
        let mut stop = self.surfaces[0].is_stop.then_some(0);
        for (number, surface) in self.surfaces[..last].iter().enumerate().skip(1) {
            if surface.is_stop {
                stop = Some(surfaces.len());
            }
            surfaces.push(surface.in_mm(number, mm, &glasses, &mut notes)?);
        }
        let mut wavelengths_um = self.wavelengths_um;
        wavelengths_um.sort_by_key(|(number, _)| *number);
        wavelengths_um.truncate(self.n_wavelengths.filter(|&n| n > 0).unwrap_or(usize::MAX));
        let wavelengths_nm = wavelengths_um.iter().map(|(_, um)| nm_of_um(*um)).collect();
        Ok(System {
            name: if self.name.is_empty() { name.to_owned() } else { self.name },
            source: if self.note.is_empty() { "a Zemax file".to_owned() } else { self.note },
            object_distance_mm: self.surfaces[0].thickness * mm,
            surfaces,
            stop,
            beam: self.beam.map(|beam| match beam {
                Beam::EntrancePupil(diameter) => Beam::EntrancePupil(diameter * mm),
                other => other,
            }),
            wavelengths_nm,
            reference: self.primary.saturating_sub(1),
            fields: fields(self.field_type, self.n_fields, mm, &self.fields, &self.vignetting)?,
            notes,
        })
    }
}

/// Returns the wavelength in nm whose micrometres a file states: the nearest number of ten digits, so that 0.486 is 486.
pub(super) fn nm_of_um(um: f64) -> f64 {
    (um * 1e13).round() / 1e10
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
) -> Result<Vec<(Field, Vignetting)>, TextError> {
    let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
    let n_stated = x.len().max(y.len());
    let n_fields = n_fields.filter(|&n| n > 0).unwrap_or(n_stated).min(n_stated);
    let field = |i: usize| {
        let (x, y) = (at(x, i), at(y, i));
        let (x_mm, y_mm) = (mm * x, mm * y);
        let field = match kind {
            0 => Field::Angle { x_deg: x, y_deg: y },
            1 => Field::ObjectHeight { x_mm, y_mm },
            2 | 3 => Field::ImageHeight { x_mm, y_mm },
            _ => {
                let reason = format!("FTYP: field type {kind} is not supported; expected 0 to 3");
                return Err(TextError { line: None, reason });
            }
        };
        let [dx, dy, cx, cy] = vignetting.each_ref().map(|list| at(list, i));
        Ok((field, Vignetting { center: (dx, dy).into(), compression: (cx, cy).into() }))
    };
    (0..n_fields).map(field).collect()
}

impl ZmxSurface {
    /// Takes what belongs to a surface; gives false where the line does not.
    fn take(&mut self, line: &Line) -> Result<bool, TextError> {
        match line.keyword {
            "STOP" => self.is_stop = true,
            "TYPE" => self.kind = line.words.first().copied().unwrap_or_default().to_uppercase(),
            "CURV" => self.curvature = line.number(0)?,
            "CONI" => self.conic = line.number(0)?,
            "DISZ" => self.thickness = line.number(0)?,
            "PARM" => {
                let place = line.count(0)?;
                if !(1..=200).contains(&place) {
                    return Err(line.wrong(format!("parameter {place}; expected 1 to 200")));
                }
                self.parameters.resize(self.parameters.len().max(place), 0.0);
                self.parameters[place - 1] = line.number(1)?;
            }
            "DIAM" => {
                let semi_diameter = line.number(0)?;
                self.semi_diameter = (semi_diameter > 0.0).then_some(semi_diameter);
                self.is_semi_diameter_fixed = line.number_or(1, 0.0)? == 1.0;
            }
            "CLAP" => {
                if line.number(0)? > 0.0 {
                    return Err(line.wrong("an aperture with a hole is not supported"));
                }
                self.clear_radius = Some(line.number(1)?);
            }
            "FLAP" => self.is_semi_diameter_fixed = true,
            "OBDC" if line.number_or(0, 0.0)? != 0.0 || line.number_or(1, 0.0)? != 0.0 => {
                return Err(line.wrong("a decentred aperture is not supported"));
            }
            "GLAS" => {
                let name = line.words.first().copied().unwrap_or_default().to_owned();
                let (nd, vd) = (line.number_or(3, 0.0)?, line.number_or(4, 0.0)?);
                self.glass = Some(ZmxGlass { line: line.number, name, nd_vd: (nd > 0.0).then_some((nd, vd)) });
            }
            keyword => {
                if let Some((_, what)) = OTHER_APERTURES.iter().find(|(other, _)| *other == keyword) {
                    return Err(line.wrong(format!("{what} is not supported")));
                }
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn in_mm(
        &self,
        number: usize,
        mm: f64,
        glasses: &Glasses,
        notes: &mut Vec<String>,
    ) -> Result<SystemSurface, TextError> {
        let wrong = |reason: String| TextError { line: Some(self.line), reason: format!("surface {number}: {reason}") };
        let parameter = |place: usize| self.parameters.get(place - 1).copied().unwrap_or(0.0);
        let mut curvature_per_mm = self.curvature / mm;
        let shape = match self.kind.as_str() {
            "STANDARD" => conic_of(self.conic),
            "EVENASPH" => {
                let powers = (1..).map(|half| 1 - 2 * half);
                let from_r2: Vec<f64> =
                    self.parameters.iter().take(8).zip(powers).map(|(a, p)| a * mm.powi(p)).collect();
                even_asphere(self.conic, &from_r2)
            }
            "ODDASPHE" => {
                let powers = (1..).map(|power| 1 - power);
                let from_r1 = self.parameters.iter().take(8).zip(powers).map(|(a, p)| a * mm.powi(p)).collect();
                Shape::OddAsphere { conic: self.conic, coefficients: from_r1 }
            }
            "PARAXIAL" => {
                curvature_per_mm = 0.0;
                Shape::ThinLens { power_per_mm: 1.0 / (parameter(1) * mm) }
            }
            "COORDBRK" if self.parameters.iter().take(5).all(|&p| p == 0.0) => Shape::Sphere,
            "COORDBRK" => {
                return Err(wrong("a coordinate break (COORDBRK: tilt or decentre) is not supported".to_owned()));
            }
            other => {
                let known = "expected STANDARD, EVENASPH, ODDASPHE, PARAXIAL or a COORDBRK of zeros";
                return Err(wrong(format!("surfaces of type {other} are not supported; {known}")));
            }
        };
        let medium_after = self.medium(number, glasses, notes)?;
        let semi_aperture = self.clear_radius.or(self.semi_diameter).filter(|_| self.kind != "COORDBRK");
        Ok(SystemSurface {
            line: self.line,
            curvature_per_mm,
            shape,
            medium_after,
            thickness_after_mm: self.thickness * mm,
            semi_aperture_mm: semi_aperture.map(|semi_aperture| semi_aperture * mm),
            is_rim_fixed: semi_aperture.is_some() && (self.clear_radius.is_some() || self.is_semi_diameter_fixed),
        })
    }

    fn medium(&self, number: usize, glasses: &Glasses, notes: &mut Vec<String>) -> Result<Glass, TextError> {
        let Some(stated) = &self.glass else { return Ok(Glass::Air) };
        let wrong =
            |reason: String| TextError { line: Some(stated.line), reason: format!("surface {number}: {reason}") };
        match (stated.name.to_uppercase().as_str(), stated.nd_vd) {
            ("MIRROR", _) => Err(wrong("mirrors are not supported".to_owned())),
            ("AIR" | "VACUUM" | "", _) => Ok(Glass::Air),
            ("___BLANK", Some((nd, vd))) => Ok(model(nd, vd)),
            ("___BLANK", None) => Err(wrong("a model glass without its index".to_owned())),
            (_, nd_vd) => {
                let found = glasses
                    .find(&stated.name, nd_vd)
                    .map_err(|reason| wrong(format!("{reason}{}", searched(glasses))))?;
                notes.extend(found.note);
                Ok(found.glass)
            }
        }
    }
}

/// Says in which catalogues the file itself would look.
fn searched(glasses: &Glasses) -> String {
    match glasses.makers.as_slice() {
        [] => String::new(),
        makers => format!("; the file's catalogues (GCAT) are {}", makers.join(", ")),
    }
}
