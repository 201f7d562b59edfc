//! A surface of a CODE V file.

use std::f64::consts::TAU;

use crate::{Aperture, CoordinateBreak, Glass, Outline, PhaseProfile, Shape};

use super::{
    super::{
        shapes::{even_asphere, up_to_last},
        system::{SystemMove, SystemSurface},
        text_error::TextError,
    },
    command::Command,
};

/// A surface as the file states it, in the file's units; the first is the object, the last the image.
#[derive(Clone, Default)]
pub(super) struct SeqSurface {
    pub(super) line: usize,
    /// What SLB calls it.
    pub(super) label: String,
    pub(super) is_stop: bool,
    pub(super) curvature: f64,
    /// What stands for it in `S`, where that was taken for a radius.
    pub(super) number_of_s: Option<f64>,
    pub(super) thickness: f64,
    pub(super) states_thickness: bool,
    pub(super) medium: Option<Glass>,
    /// Whether it reflects; the medium behind it is then that before it.
    pub(super) is_mirror: bool,
    pub(super) conic: f64,
    /// From r⁴ on.
    pub(super) coefficients: [f64; 9],
    pub(super) clear_radius: Option<f64>,
    pub(super) opening: SeqOpening,
    pub(super) obscuration: SeqOpening,
    /// The radius of a hole through the surface.
    pub(super) hole_radius: Option<f64>,
    /// What a grating or diffractive surface adds.
    pub(super) phase: SeqPhase,
    /// What differs along x, where something does.
    pub(super) kind: SeqKind,
    pub(super) curvature_x: f64,
    pub(super) conic_x: f64,
    /// XDE, YDE, ZDE.
    pub(super) decenter: [f64; 3],
    /// ADE, BDE, CDE.
    pub(super) tilt_deg: [f64; 3],
    pub(super) axis: SeqAxis,
}

/// What decenters and tilts of a surface do to the axis behind it.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) enum SeqAxis {
    /// It goes on as the surface has bent it.
    #[default]
    Bent,
    /// It is back in its place behind the surface (DAR).
    Returned,
    /// The surface stands on the axis, which is bent behind it by what undoes the numbers (REV).
    Reversed,
    /// It is turned by the surface's angles once more, as the light that a mirror reflects (BEN).
    Folded,
}

/// An opening or obscuration that is no round rim, in the file's units.
#[derive(Clone, Copy, Default)]
pub(super) struct SeqOpening {
    /// CIR, where it obscures.
    pub(super) radius: Option<f64>,
    /// REX, REY.
    pub(super) rectangle: [Option<f64>; 2],
    /// ELX, ELY.
    pub(super) ellipse: [Option<f64>; 2],
    /// ADX, ADY.
    pub(super) center: [f64; 2],
}

/// The phase of a grating (GRT) or of a diffractive surface of revolution (DIF DOE, HCT R), in the file's units.
#[derive(Clone)]
pub(super) struct SeqPhase {
    kind: SeqPhaseKind,
    /// GRO, HOR.
    order: f64,
    /// GRS.
    spacing: f64,
    /// GRX, GRY: the direction in which grooves follow one another.
    across: [f64; 2],
    /// HWL, nm.
    construction_nm: f64,
    /// HCO C1 and on: the path of the first order at that wavelength is their sum times r², r⁴ and on.
    coefficients: Vec<f64>,
}

#[derive(Clone, Copy, PartialEq)]
enum SeqPhaseKind {
    None,
    Grating,
    Rings,
}

impl Default for SeqPhase {
    fn default() -> Self {
        Self {
            kind: SeqPhaseKind::None,
            order: 1.0,
            spacing: 0.0,
            across: [0.0, 1.0],
            construction_nm: 0.0,
            coefficients: Vec::new(),
        }
    }
}

/// The most coefficients of a diffractive surface.
const MOST_COEFFICIENTS: usize = 20;

impl SeqPhase {
    /// Takes a command of a grating or diffractive surface.
    fn take(&mut self, keyword: &str, command: &Command, place: usize) -> Result<(), TextError> {
        let word = || command.words.get(place).map(|word| word.to_uppercase()).unwrap_or_default();
        let fixed = |expected: &str| match word() == expected {
            true => Ok(()),
            false => Err(command.wrong(format!("'{}' is not supported; expected {expected}", word()))),
        };
        match keyword {
            "GRT" => self.kind = SeqPhaseKind::Grating,
            "DIF" => {
                fixed("DOE")?;
                self.kind = SeqPhaseKind::Rings;
            }
            "HCT" => fixed("R")?,
            "GRO" | "HOR" => self.order = command.number(place)?,
            "GRS" => self.spacing = command.number(place)?,
            "GRX" | "GRY" => self.across[usize::from(keyword == "GRY")] = command.number(place)?,
            "GRZ" if command.number(place)? != 0.0 => {
                return Err(command.wrong("grooves that are not equidistant on the vertex plane are not supported"));
            }
            "HWL" => self.construction_nm = command.number(place)?,
            "HCO" => {
                let number = word().strip_prefix('C').and_then(|digits| digits.parse::<usize>().ok());
                let number = number.filter(|number| (1..=MOST_COEFFICIENTS).contains(number));
                let Some(number) = number else {
                    return Err(
                        command.wrong(format!("'{}' is not supported; expected C1 to C{MOST_COEFFICIENTS}", word()))
                    );
                };
                self.coefficients.resize(self.coefficients.len().max(number), 0.0);
                self.coefficients[number - 1] = command.number(place + 1)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the order and the phase.
    fn in_mm(&self, mm: f64) -> Result<Option<(i32, PhaseProfile)>, String> {
        let profile = match self.kind {
            SeqPhaseKind::None => return Ok(None),
            SeqPhaseKind::Grating => {
                let [x, y] = self.across;
                let length = x.hypot(y);
                if !(self.spacing > 0.0 && length > 0.0) {
                    return Err("GRT: a grating needs the distance of its grooves (GRS, above 0) and their direction"
                        .to_owned());
                }
                let lines_per_mm = 1.0 / (self.spacing * mm);
                PhaseProfile::Grating { lines_per_mm: [x / length * lines_per_mm, y / length * lines_per_mm] }
            }
            SeqPhaseKind::Rings => {
                if self.construction_nm <= 0.0 {
                    return Err("DIF DOE: the wavelength of construction (HWL) is missing or not above 0".to_owned());
                }
                let per_mm = TAU / (1e-6 * self.construction_nm);
                let powers = (1..).map(|power| mm.powi(1 - 2 * power));
                let coefficients_rad = self.coefficients.iter().zip(powers).map(|(a, scale)| a * scale * per_mm);
                PhaseProfile::Rings { radius_mm: 1.0, coefficients_rad: coefficients_rad.collect() }
            }
        };
        match self.order.fract() == 0.0 && self.order.abs() <= 1e6 {
            true => Ok(Some((self.order as i32, profile))),
            false => Err(format!("a diffraction order of {}; expected a whole number", self.order)),
        }
    }
}

impl SeqOpening {
    /// Returns the opening in a frame that is turned by a right angle about z.
    fn turned(mut self) -> Self {
        self.rectangle.swap(0, 1);
        self.ellipse.swap(0, 1);
        self.center = [self.center[1], -self.center[0]];
        self
    }

    /// Returns its shapes.
    fn outlines(&self, mm: f64) -> impl Iterator<Item = Outline> {
        let pair = |[x, y]: [Option<f64>; 2]| Some((x.or(y)? * mm, y.or(x)? * mm));
        let circle = self.radius.map(|radius| Outline::Circle { radius_mm: radius * mm });
        let rectangle = pair(self.rectangle).map(|(half_x_mm, half_y_mm)| Outline::Rectangle { half_x_mm, half_y_mm });
        let ellipse = pair(self.ellipse).map(|(half_x_mm, half_y_mm)| Outline::Ellipse { half_x_mm, half_y_mm });
        [circle, rectangle, ellipse].into_iter().flatten()
    }
}

/// The kinds of surface that CODE V tells apart by a command of their own.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) enum SeqKind {
    #[default]
    Rotational,
    /// YTO: the curve in the y–z plane turned about an axis parallel to y.
    Toroid,
    /// XTO: the curve in the x–z plane turned about an axis parallel to x.
    ToroidX,
    /// CYL: straight along x or along y.
    Cylinder,
    /// AAS: a conic each along x and y.
    Biconic,
}

impl SeqSurface {
    /// Takes a command of this surface, whose first number is at a place among the command's words; false where no
    /// surface has such a command.
    pub(super) fn take(&mut self, keyword: &str, command: &Command, place: usize) -> Result<bool, TextError> {
        match keyword {
            "THI" => {
                self.thickness = command.distance(place)?;
                self.states_thickness = true;
            }
            "CIR" => match command.words.get(place).map(|word| word.to_uppercase()).as_deref() {
                Some("EDG") => {}
                Some("HOL") => self.hole_radius = Some(command.number(place + 1)?),
                Some("OBS") => self.obscuration.radius = Some(command.number(place + 1)?),
                _ => self.clear_radius = Some(command.number(place)?),
            },
            "REX" | "REY" | "ELX" | "ELY" | "ADX" | "ADY" => self.take_aperture(keyword, command, place)?,
            "ARO" if command.number(place)? != 0.0 => {
                return Err(command.wrong("turned apertures are not supported"));
            }
            "XDE" | "YDE" | "ZDE" => {
                self.decenter[usize::from(keyword.as_bytes()[0] - b'X')] = command.number(place)?
            }
            "ADE" | "BDE" | "CDE" => {
                self.tilt_deg[usize::from(keyword.as_bytes()[0] - b'A')] = command.number(place)?
            }
            "DAR" => self.axis = SeqAxis::Returned,
            "REV" => self.axis = SeqAxis::Reversed,
            "BEN" => self.axis = SeqAxis::Folded,
            "RET" | "GLB" => {
                return Err(command
                    .wrong("this kind of tilt is not supported; expected XDE to CDE, alone, with DAR, REV or BEN"));
            }
            "XOD" | "YOD" | "ZOD" if command.number(place)? != 0.0 => {
                return Err(command.wrong("tilts about another point than the vertex are not supported"));
            }
            // With 0 they change nothing.
            "ARO" | "XOD" | "YOD" | "ZOD" => {}
            _ => return self.take_shape(keyword, command, place),
        }
        Ok(true)
    }

    /// Takes what a command says of the surface's shape; false where none has such a command.
    fn take_shape(&mut self, keyword: &str, command: &Command, place: usize) -> Result<bool, TextError> {
        let curvature = || command.number(place).map(|radius| if radius == 0.0 { 0.0 } else { 1.0 / radius });
        match keyword {
            "RDY" => self.curvature = curvature()?,
            "RDX" => self.curvature_x = curvature()?,
            "CUY" => self.curvature = command.number(place)?,
            "CUX" => self.curvature_x = command.number(place)?,
            "K" | "KY" => self.conic = command.number(place)?,
            "KX" => self.conic_x = command.number(place)?,
            "YTO" => self.kind = SeqKind::Toroid,
            "XTO" => self.kind = SeqKind::ToroidX,
            "CYL" => self.kind = SeqKind::Cylinder,
            "AAS" => self.kind = SeqKind::Biconic,
            "AR" | "BR" | "CR" | "DR" | "AP" | "BP" | "CP" | "DP" if command.number(place)? != 0.0 => {
                return Err(command.wrong("higher terms of an anamorphic asphere are not supported"));
            }
            "AR" | "BR" | "CR" | "DR" | "AP" | "BP" | "CP" | "DP" => {}
            "GRT" | "GRO" | "GRS" | "GRX" | "GRY" | "GRZ" | "DIF" | "HOR" | "HWL" | "HCT" | "HCO" => {
                self.phase.take(keyword, command, place)?;
            }
            // The base curve of a Fresnel surface: with 0 there is none.
            "CUF" => return Ok(command.number(place)? == 0.0),
            "SPS" | "SPL" | "HOE" => {
                let what = command.words.join(" ");
                return Err(command.wrong(format!(
                    "surfaces of the kind '{what}' are not supported; expected spheres, K, ASP, CYL, YTO, XTO and AAS"
                )));
            }
            _ => match "ABCDEFGHJ".find(keyword).filter(|_| keyword.len() == 1) {
                Some(power) => self.coefficients[power] = command.number(place)?,
                None => return Ok(false),
            },
        }
        Ok(true)
    }

    /// Takes half a width of an aperture along x or y, or the place of its middle there; `OBS` before the number makes
    /// it an obscuration, `EDG` the outer edge, which bounds no light.
    fn take_aperture(&mut self, keyword: &str, command: &Command, place: usize) -> Result<(), TextError> {
        let axis = usize::from(keyword.ends_with('Y'));
        let (aperture, place) = match command.words.get(place).map(|word| word.to_uppercase()).as_deref() {
            Some("EDG") => return Ok(()),
            Some("HOL") => return Err(command.wrong("only round holes (CIR HOL) are supported")),
            Some("OBS") => (&mut self.obscuration, place + 1),
            _ => (&mut self.opening, place),
        };
        let number = command.number(place)?;
        match &keyword[..2] {
            "RE" => aperture.rectangle[axis] = Some(number),
            "EL" => aperture.ellipse[axis] = Some(number),
            _ => aperture.center[axis] = number,
        }
        Ok(())
    }

    /// Returns the tilts and decenters at this surface, whose number and z along the axis are these.
    ///
    /// Of the program's angles those about x and y turn by the left-hand rule, that about z by the right-hand rule; each
    /// is about the axis that those before it have made. `REV` undoes the same numbers behind the surface. So read them
    /// ray-optics, whose author came from the program (`euler2opt` in `util/misc_math.py`, `DecenterData` in
    /// `elem/surface.py`), and Geopter; one turn alone is the same in all readers.
    pub(super) fn moves(&self, surface: usize, mm: f64, z_mm: f64) -> Vec<SystemMove> {
        let [a, b, c] = self.tilt_deg;
        let is_moved = self.decenter.iter().chain(&self.tilt_deg).any(|&v| v != 0.0);
        let decenter_mm = self.decenter.map(|shift| shift * mm);
        let last = if self.axis == SeqAxis::Returned { surface } else { usize::MAX };
        let there = CoordinateBreak {
            surfaces: (surface, last),
            pivot_mm: 0.0,
            decenter_mm,
            tilt_deg: [-a, -b, c],
            tilt_first: false,
        };
        let own = match self.axis {
            SeqAxis::Bent | SeqAxis::Returned | SeqAxis::Folded => there,
            SeqAxis::Reversed => CoordinateBreak {
                surfaces: (surface + 1, last),
                decenter_mm: decenter_mm.map(|shift| -shift),
                tilt_deg: [a, b, -c],
                tilt_first: true,
                ..there
            },
        };
        let turn = CoordinateBreak {
            surfaces: (surface, surface),
            decenter_mm: [0.0; 3],
            tilt_deg: [0.0, 0.0, 90.0],
            ..there
        };
        let turn = self.is_turned().then_some(SystemMove { z_mm, step: turn });
        let own = is_moved.then_some(SystemMove { z_mm, step: own });
        // Behind a mirror the axis turns by the same angles again, so that it follows the ray along it.
        let fold = CoordinateBreak { surfaces: (surface + 1, last), decenter_mm: [0.0; 3], ..there };
        let fold = (is_moved && self.axis == SeqAxis::Folded).then_some(SystemMove { z_mm, step: fold });
        own.into_iter().chain(turn).chain(fold).collect()
    }

    /// Whether the surface is one whose curve is along x: a toroid about an axis parallel to y that is turned by a right
    /// angle about z. Its y is then the file's −x, its x the file's y.
    fn is_turned(&self) -> bool {
        let is_plain = self.conic == 0.0 && self.coefficients.iter().all(|&a| a == 0.0);
        match self.kind {
            // A cylinder of circles about an axis along y is one without a turn.
            SeqKind::ToroidX => self.curvature != 0.0 || !is_plain,
            SeqKind::Cylinder => self.curvature_x != 0.0 && !is_plain,
            _ => false,
        }
    }

    pub(super) fn shape(&self, mm: f64) -> Result<Shape, TextError> {
        let mut from_r2 = vec![0.0];
        from_r2.extend(self.coefficients.iter().zip(1..).map(|(a, i)| a * mm.powi(-1 - 2 * i)));
        let curvature_x = if self.is_turned() { self.curvature } else { self.curvature_x };
        let (conic, curvature_x_per_mm) = (self.conic, curvature_x / mm);
        let wrong = |reason: &str| TextError { line: Some(self.line), reason: reason.to_owned() };
        match self.kind {
            SeqKind::Rotational => Ok(even_asphere(conic, &from_r2)),
            SeqKind::Cylinder if self.curvature != 0.0 && self.curvature_x != 0.0 => {
                Err(wrong("CYL: a cylinder is curved along x and along y; expected one of them"))
            }
            SeqKind::Toroid | SeqKind::ToroidX | SeqKind::Cylinder => {
                Ok(Shape::Toroid { curvature_x_per_mm, conic, coefficients: up_to_last(from_r2) })
            }
            SeqKind::Biconic if self.coefficients.iter().all(|&a| a == 0.0) => {
                Ok(Shape::Biconic { conic, curvature_x_per_mm, conic_x: self.conic_x })
            }
            SeqKind::Biconic => Err(wrong("AAS: higher terms of an anamorphic asphere are not supported")),
        }
    }

    /// Returns the surface in mm; `before` is the medium before it.
    pub(super) fn in_mm(&self, mm: f64, before: &Glass) -> Result<SystemSurface, TextError> {
        let wrong = |reason: &str| Err(TextError { line: Some(self.line), reason: reason.to_owned() });
        if self.axis == SeqAxis::Folded && !self.is_mirror {
            return wrong("BEN: a surface that bends the axis, but is no mirror, is not supported");
        }
        // Of two turns the second is about a turned axis, and the same turns again do not lead along the reflected light.
        let n_turns = self.tilt_deg.iter().filter(|angle| **angle != 0.0).count();
        if self.axis == SeqAxis::Folded && (self.decenter != [0.0; 3] || self.tilt_deg[2] != 0.0 || n_turns > 1) {
            return wrong("BEN: a mirror that bends the axis is supported where it has one tilt alone, ADE or BDE");
        }
        if self.hole_radius.is_some() && !self.is_mirror {
            return wrong("CIR HOL: a hole in a surface that is no mirror is not supported");
        }
        let curvature = if self.is_turned() { self.curvature_x } else { self.curvature };
        let surface = SystemSurface {
            line: self.line,
            comment: self.label.clone(),
            curvature_per_mm: curvature / mm,
            shape: self.shape(mm)?,
            medium_after: if self.is_mirror { before.clone() } else { self.medium.clone().unwrap_or_default() },
            thickness_after_mm: self.thickness * mm,
            semi_aperture_mm: self.clear_radius.map(|radius| radius * mm),
            is_mirror: self.is_mirror,
            phase: self.phase.in_mm(mm).map_err(|reason| TextError { line: Some(self.line), reason })?,
            is_rim_fixed: self.clear_radius.is_some(),
            apertures: Vec::new(),
        };
        Ok(self.with_apertures(mm, surface))
    }

    /// Returns the surface with the openings and obscurations that the file states for it.
    fn with_apertures(&self, mm: f64, mut surface: SystemSurface) -> SystemSurface {
        let mut opening = self.opening;
        opening.radius = self.clear_radius;
        for (stated, is_obscuration) in [(opening, false), (self.obscuration, true)] {
            let stated = if self.is_turned() { stated.turned() } else { stated };
            let center_mm = stated.center.map(|place| place * mm);
            for outline in stated.outlines(mm) {
                surface = surface.with_aperture(Aperture { surface: 0, outline, center_mm, is_obscuration });
            }
        }
        if let Some(radius) = self.hole_radius {
            let outline = Outline::Circle { radius_mm: radius * mm };
            let hole = Aperture { surface: 0, outline, center_mm: [0.0; 2], is_obscuration: true };
            surface = surface.with_aperture(hole);
        }
        surface
    }
}
