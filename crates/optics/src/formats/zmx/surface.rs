//! A surface of a Zemax file.

use crate::{Aperture, CoordinateBreak, Glass, Outline, PhaseProfile, Shape};

use super::super::{
    glasses::{Glasses, model},
    shapes::{conic_of, even_asphere, up_to_last},
    system::{SystemMove, SystemSurface},
    text_error::TextError,
};
use super::Line;

/// A surface as the file states it, in the file's units.
#[derive(Clone, Default)]
pub(super) struct ZmxSurface {
    pub(super) line: usize,
    pub(super) is_stop: bool,
    pub(super) comment: String,
    pub(super) kind: String,
    pub(super) curvature: f64,
    pub(super) conic: f64,
    pub(super) thickness: f64,
    /// Numbered from 1.
    parameters: Vec<f64>,
    semi_diameter: Option<f64>,
    is_semi_diameter_fixed: bool,
    /// The parameter 0: the order of a diffractive surface.
    parameter_zero: f64,
    /// Numbered from 1: how many terms there are, the radius that they count from, and the terms.
    extra_data: Vec<f64>,
    /// Keyword and the two numbers behind it.
    aperture: Option<(String, [f64; 2])>,
    aperture_center: [f64; 2],
    pub(super) glass: Option<ZmxGlass>,
    /// What of it is left out, without its number.
    pub(super) notes: Vec<String>,
    /// The solves and pickups by which the program would find some of the numbers anew.
    pub(super) solves: Vec<ZmxSolve>,
}

/// A solve or pickup.
#[derive(Clone)]
pub(super) struct ZmxSolve {
    line: usize,
    pub(super) keyword: String,
    /// The surface that it refers to, if it does.
    pub(super) surface: Option<usize>,
    /// The sum of thicknesses, of one that makes them one.
    pub(super) sum: f64,
}

impl ZmxSolve {
    /// Returns what is wrong with the solve at this surface.
    pub(super) fn wrong(&self, number: usize, reason: &str) -> TextError {
        TextError { line: Some(self.line), reason: format!("{}: the solve of surface {number} {reason}", self.keyword) }
    }
}

#[derive(Clone)]
pub(super) struct ZmxGlass {
    line: usize,
    name: String,
    nd_vd: Option<(f64, f64)>,
}

/// Keywords of apertures that are not read.
const OTHER_APERTURES: [(&str, &str); 3] =
    [("USAP", "a user-defined aperture"), ("USOB", "a user-defined obscuration"), ("UDAP", "a user-defined aperture")];

/// How far arms of a spider reach on a surface without a rim, mm.
const FAR_MM: f64 = 1e4;

/// The most arms of a spider.
const MOST_ARMS: usize = 64;

/// The largest number of a parameter.
const MOST_PARAMETERS: usize = 200;

/// The most numbers of extra data of a surface.
const MOST_EXTRA_DATA: usize = 500;

/// Solves and pickups: a curvature, thickness or parameter picked up from another surface, and a thickness that brings
/// the marginal or the chief ray to a height, an edge to a width, or several distances to a sum.
const SOLVES: [&str; 8] = ["PKUP", "PZUP", "PPAR", "MAZH", "CHZH", "EDGE", "TCOM", "TOLE"];

impl ZmxSurface {
    /// Returns a plane that begins at this line.
    pub(super) fn begin(line: usize) -> Self {
        Self { line, kind: "STANDARD".to_owned(), ..Default::default() }
    }

    /// Takes what belongs to a surface; gives false where the line does not.
    pub(super) fn take(&mut self, line: &Line) -> Result<bool, TextError> {
        match line.keyword {
            "STOP" => self.is_stop = true,
            "COMM" => self.comment = line.text(),
            "TYPE" => self.kind = line.words.first().copied().unwrap_or_default().to_uppercase(),
            "CURV" => self.curvature = line.number(0)?,
            "CONI" => self.conic = line.number(0)?,
            "DISZ" => self.thickness = line.number(0)?,
            "PARM" => {
                let place = line.count(0)?;
                // Newer files state a parameter 0 of every surface; it means something to diffractive ones alone.
                self.put_parameter(place, line.number(1)?).map_err(|what| line.wrong(what))?;
            }
            "DIAM" => {
                let semi_diameter = line.number(0)?;
                self.semi_diameter = (semi_diameter > 0.0).then_some(semi_diameter);
                self.is_semi_diameter_fixed = line.number_or(1, 0.0)? == 1.0;
            }
            "CLAP" | "OBSC" | "ELAP" | "ELOB" | "SQAP" | "SQOB" => {
                let numbers = [line.number(0)?, line.number(1)?];
                if line.keyword == "OBSC" && numbers[0] > 0.0 {
                    return Err(line.wrong("an obscuration with a hole is not supported"));
                }
                self.put_aperture(line.keyword, numbers);
            }
            "SPID" => {
                let (width, n_arms) = (line.number(0)?, line.count(1)?);
                if width.is_nan() || width <= 0.0 || !(1..=MOST_ARMS).contains(&n_arms) {
                    let expected = format!("a width above 0 and 1 to {MOST_ARMS} arms");
                    return Err(line.wrong(format!("a spider of {n_arms} arms {width} wide; expected {expected}")));
                }
                self.put_aperture(line.keyword, [width, n_arms as f64]);
            }
            "XDAT" => {
                let place = line.count(0)?;
                if !(1..=MOST_EXTRA_DATA).contains(&place) {
                    return Err(
                        line.wrong(format!("number {place} of the extra data; expected 1 to {MOST_EXTRA_DATA}"))
                    );
                }
                self.extra_data.resize(self.extra_data.len().max(place), 0.0);
                self.extra_data[place - 1] = line.number_or(1, 0.0)?;
            }
            "FLAP" => self.is_semi_diameter_fixed = true,
            "OBDC" => self.aperture_center = [line.number_or(0, 0.0)?, line.number_or(1, 0.0)?],
            "GLAS" => {
                let name = line.words.first().copied().unwrap_or_default().to_owned();
                let (nd, vd) = (line.number_or(3, 0.0)?, line.number_or(4, 0.0)?);
                let deviation = line.number_or(5, 0.0)?;
                if name == "___BLANK" && deviation != 0.0 {
                    self.notes.push(format!(
                        "the deviation of its partial dispersion P_g,F from that of usual glasses, {deviation}, is left out"
                    ));
                }
                self.glass = Some(ZmxGlass { line: line.number, name, nd_vd: (nd > 0.0).then_some((nd, vd)) });
            }
            solve if SOLVES.contains(&solve) => self.solves.push(ZmxSolve {
                line: line.number,
                keyword: solve.to_owned(),
                surface: line.count(0).ok(),
                sum: line.number_or(1, 0.0)?,
            }),
            keyword => {
                if let Some((_, what)) = OTHER_APERTURES.iter().find(|(other, _)| *other == keyword) {
                    return Err(line.wrong(format!("{what} is not supported")));
                }
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn put_aperture(&mut self, keyword: &str, numbers: [f64; 2]) {
        if let Some((before, _)) = self.aperture.replace((keyword.to_owned(), numbers)) {
            self.notes.push(format!("two apertures: {keyword} takes the place of {before}"));
        }
    }

    /// Forgets a rim that the program found for another configuration than this.
    pub(super) fn forget_automatic_rim(&mut self) {
        if !self.is_semi_diameter_fixed && !self.is_stop {
            self.semi_diameter = None;
        }
    }

    /// Puts the glass of this name behind the surface, or air.
    pub(super) fn put_glass(&mut self, line: usize, name: &str) {
        if self.glass.as_ref().is_some_and(|glass| glass.name.eq_ignore_ascii_case(name)) {
            return;
        }
        self.glass = (!name.is_empty()).then(|| ZmxGlass { line, name: name.to_owned(), nd_vd: None });
    }

    /// Gives a model glass another index, or another Abbe number; gives false where there is none.
    pub(super) fn put_model_glass(&mut self, is_index: bool, value: f64) -> bool {
        match self.glass.as_mut().filter(|glass| glass.name == "___BLANK").and_then(|glass| glass.nd_vd.as_mut()) {
            Some((nd, vd)) => {
                *(if is_index { nd } else { vd }) = value;
                true
            }
            None => false,
        }
    }

    /// Gives a parameter another value.
    pub(super) fn put_parameter(&mut self, place: usize, value: f64) -> Result<(), String> {
        match place {
            0 => self.parameter_zero = value,
            1..=MOST_PARAMETERS => {
                self.parameters.resize(self.parameters.len().max(place), 0.0);
                self.parameters[place - 1] = value;
            }
            _ => return Err(format!("parameter {place}; expected 0 to {MOST_PARAMETERS}")),
        }
        Ok(())
    }

    /// Gives a number of the rim or the aperture (`SDIA`, `APMN`, `APMX`, `APDX`, `APDY`) another value.
    pub(super) fn put_rim(&mut self, keyword: &str, value: f64) -> Result<(), String> {
        match keyword {
            "SDIA" => (self.semi_diameter, self.is_semi_diameter_fixed) = ((value > 0.0).then_some(value), true),
            "APDX" => self.aperture_center[0] = value,
            "APDY" => self.aperture_center[1] = value,
            _ => {
                let Some((_, numbers)) = &mut self.aperture else {
                    return Err("the surface has no aperture".to_owned());
                };
                numbers[usize::from(keyword == "APMX")] = value;
            }
        }
        Ok(())
    }

    /// Whether it reflects.
    pub(super) fn is_mirror(&self) -> bool {
        self.glass.as_ref().is_some_and(|glass| glass.name.eq_ignore_ascii_case("MIRROR"))
    }

    /// Returns the surface in mm, with this medium behind it.
    pub(super) fn in_mm(&self, number: usize, mm: f64, medium_after: Glass) -> Result<SystemSurface, TextError> {
        let wrong = |reason: String| TextError { line: Some(self.line), reason: format!("surface {number}: {reason}") };
        let parameter = |place: usize| self.parameters.get(place - 1).copied().unwrap_or(0.0);
        let mut curvature_per_mm = self.curvature / mm;
        let shape = match self.kind.as_str() {
            "STANDARD" | "DGRATING" => conic_of(self.conic),
            "EVENASPH" | "BINARY_2" => {
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
            "BICONICX" => Shape::Biconic {
                conic: self.conic,
                curvature_x_per_mm: curvature_of(parameter(1) * mm),
                conic_x: parameter(2),
            },
            "TOROIDAL" if self.extra_data.first().is_some_and(|&n_terms| n_terms != 0.0) => {
                return Err(wrong("Zernike terms (XDAT) of a toroid are not supported".to_owned()));
            }
            "TOROIDAL" => {
                let powers = (1..).map(|half| 1 - 2 * half);
                let from_y2 = self.parameters.iter().skip(1).take(7).zip(powers).map(|(a, p)| a * mm.powi(p));
                Shape::Toroid {
                    curvature_x_per_mm: curvature_of(parameter(1) * mm),
                    conic: self.conic,
                    coefficients: up_to_last(from_y2.collect()),
                }
            }
            other => {
                let known = "expected STANDARD, EVENASPH, ODDASPHE, BICONICX, TOROIDAL, PARAXIAL, DGRATING, BINARY_2 or \
                             COORDBRK";
                return Err(wrong(format!("surfaces of type {other} are not supported; {known}")));
            }
        };
        let surface = SystemSurface {
            line: self.line,
            comment: self.comment.clone(),
            curvature_per_mm,
            shape,
            medium_after,
            thickness_after_mm: self.thickness * mm,
            semi_aperture_mm: self.semi_diameter.map(|semi_diameter| semi_diameter * mm),
            is_mirror: self.is_mirror(),
            phase: self.phase(mm).map_err(wrong)?,
            is_rim_fixed: self.semi_diameter.is_some() && self.is_semi_diameter_fixed,
            apertures: Vec::new(),
        };
        Ok(self.with_apertures(mm, surface))
    }

    /// Returns the order and the phase of a grating or diffractive surface.
    ///
    /// A grating's parameters are its lines per µm along y and the order, whatever the file's unit of length; the extra data of
    /// the other are the number of terms, the radius and the coefficients of even powers from the second on, in radians. So
    /// has Zemax's manual; the sign is that of the semi-diameters that the program stores with a grating in order −1.
    fn phase(&self, mm: f64) -> Result<Option<(i32, PhaseProfile)>, String> {
        let parameter = |place: usize| self.parameters.get(place - 1).copied().unwrap_or(0.0);
        let order = |found: f64| match found.fract() == 0.0 && found.abs() <= 1e6 {
            true => Ok(found as i32),
            false => Err(format!("a diffraction order of {found}; expected a whole number")),
        };
        match (self.kind.as_str(), self.extra_data.as_slice()) {
            ("DGRATING", _) => {
                let profile = PhaseProfile::Grating { lines_per_mm: [0.0, 1e3 * parameter(1)] };
                Ok(Some((order(parameter(2))?, profile)))
            }
            ("BINARY_2", [n_terms, radius, coefficients @ ..]) if *n_terms > 0.0 => {
                let coefficients_rad = coefficients.iter().copied().take(*n_terms as usize).collect();
                let profile = PhaseProfile::Rings { radius_mm: radius * mm, coefficients_rad };
                Ok(Some((order(self.parameter_zero)?, profile)))
            }
            _ => Ok(None),
        }
    }

    /// Returns the surface with the aperture that the file states for it.
    fn with_apertures(&self, mm: f64, surface: SystemSurface) -> SystemSurface {
        let Some((keyword, [first, second])) = &self.aperture else { return surface };
        let center_mm = self.aperture_center.map(|place| place * mm);
        let of = |outline, is_obscuration| Aperture { surface: 0, outline, center_mm, is_obscuration };
        let circle = |radius: f64| Outline::Circle { radius_mm: radius * mm };
        let (half_x_mm, half_y_mm) = (first * mm, second * mm);
        match keyword.as_str() {
            "CLAP" if *first == 0.0 => surface.with_aperture(of(circle(*second), false)),
            "CLAP" => surface.with_aperture(of(circle(*second), false)).with_aperture(of(circle(*first), true)),
            "OBSC" => surface.with_aperture(of(circle(*second), true)),
            "SPID" => arms(half_x_mm, *second as usize, 2.0 * self.semi_diameter.map_or(FAR_MM, |radius| radius * mm))
                .fold(surface, |surface, arm| surface.with_aperture(of(arm, true))),
            "ELAP" | "ELOB" => surface.with_aperture(of(Outline::Ellipse { half_x_mm, half_y_mm }, keyword == "ELOB")),
            _ => surface.with_aperture(of(Outline::Rectangle { half_x_mm, half_y_mm }, keyword == "SQOB")),
        }
    }

    /// Returns the move of everything from this coordinate break to the film, whose next surface is `first`.
    pub(super) fn coordinate_break(
        &self,
        number: usize,
        mm: f64,
        (first, z_mm): (usize, f64),
    ) -> Result<SystemMove, TextError> {
        if self.is_stop {
            let reason = format!("surface {number}: a coordinate break cannot be the stop");
            return Err(TextError { line: Some(self.line), reason });
        }
        let parameter = |place: usize| self.parameters.get(place - 1).copied().unwrap_or(0.0);
        let step = CoordinateBreak {
            surfaces: (first, usize::MAX),
            pivot_mm: 0.0,
            decenter_mm: [parameter(1) * mm, parameter(2) * mm, 0.0],
            tilt_deg: [parameter(3), parameter(4), parameter(5)],
            tilt_first: parameter(6) != 0.0,
        };
        Ok(SystemMove { z_mm, step })
    }

    pub(super) fn medium(&self, number: usize, glasses: &Glasses, notes: &mut Vec<String>) -> Result<Glass, TextError> {
        let Some(stated) = &self.glass else { return Ok(Glass::Air) };
        let wrong =
            |reason: String| TextError { line: Some(stated.line), reason: format!("surface {number}: {reason}") };
        match (stated.name.to_uppercase().as_str(), stated.nd_vd) {
            ("MIRROR", _) => Err(wrong("the object cannot be a mirror".to_owned())),
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

/// Returns the arms of a spider from the middle outwards, so wide: the first along x, the others at equal angles from there. Those that
/// face each other are one.
fn arms(width_mm: f64, n_arms: usize, reach_mm: f64) -> impl Iterator<Item = Outline> {
    let half_mm = 0.5 * width_mm;
    let (inner_mm, n_shapes) = if n_arms.is_multiple_of(2) { (-reach_mm, n_arms / 2) } else { (0.0, n_arms) };
    (0..n_shapes).map(move |arm| Outline::Turned {
        by_deg: 360.0 * arm as f64 / n_arms as f64,
        outline: Box::new(Outline::Polygon {
            corners_mm: vec![[inner_mm, -half_mm], [reach_mm, -half_mm], [reach_mm, half_mm], [inner_mm, half_mm]],
        }),
    })
}

/// Returns the curvature of a radius, of which 0 or infinity means a plane.
fn curvature_of(radius_mm: f64) -> f64 {
    if radius_mm == 0.0 { 0.0 } else { 1.0 / radius_mm }
}
