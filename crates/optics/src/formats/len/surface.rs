//! A surface of an OSLO file.

use crate::{Aperture, CoordinateBreak, Glass, Outline, PhaseProfile, Shape};

use super::{
    super::{
        shapes::{even_asphere, up_to_last},
        system::{SystemMove, SystemSurface},
        text_error::TextError,
    },
    statement::Statement,
};

/// A surface as the file states it, in the file's units; the first is the object, the last the image.
#[derive(Clone, Default)]
pub(super) struct LenSurface {
    pub(super) line: usize,
    comment: String,
    pub(super) is_stop: bool,
    pub(super) curvature: f64,
    pub(super) thickness: f64,
    pub(super) states_thickness: bool,
    pub(super) medium: Option<Glass>,
    pub(super) is_mirror: bool,
    pub(super) conic: f64,
    /// From r² on.
    pub(super) coefficients: Vec<f64>,
    is_general_asphere: bool,
    pub(super) curvature_x: Option<f64>,
    pub(super) aperture: Option<f64>,
    is_checked: bool,
    focal_length: Option<f64>,
    grating_spacing: Option<f64>,
    order: f64,
    decenter: [f64; 3],
    tilt_deg: [f64; 3],
    tilt_first: bool,
    bends: bool,
    pub(super) pickups: Vec<Pickup>,
    /// A solve of the thickness: the height at which the axial ray meets the next surface.
    pub(super) axial_height: Option<f64>,
}

/// A number that is taken from another surface.
#[derive(Clone)]
pub(super) struct Pickup {
    pub(super) line: usize,
    /// What is picked up, as `CV` or `TH`; with an M behind it, with its sign reversed.
    pub(super) what: String,
    pub(super) surface: usize,
    pub(super) plus: f64,
}

/// What became of a statement.
pub(super) enum Taken {
    Yes,
    Solve,
    No,
}

/// The largest number of an aspheric coefficient.
const MOST_COEFFICIENTS: usize = 50;
/// Apertures from here on mean that there is none.
const NO_APERTURE: f64 = 1e6;

impl LenSurface {
    /// Returns a plane that begins at this line.
    pub(super) fn begin(line: usize) -> Self {
        Self { line, order: 1.0, ..Self::default() }
    }

    /// Takes over which kind of asphere it is.
    pub(super) fn copy_kind(&mut self, source: &Self) {
        self.is_general_asphere = source.is_general_asphere;
    }

    /// Whether it has an aperture that the program does not check.
    pub(super) fn is_open_aperture(&self) -> bool {
        self.aperture.is_some() && !self.is_checked && !self.is_stop
    }

    /// Puts a medium behind the surface, none for air.
    pub(super) fn put_medium(&mut self, medium: Option<Glass>) {
        self.pickups.retain(|pickup| pickup.what != "GLA");
        (self.medium, self.is_mirror) = (medium, false);
    }

    /// Puts a number in its place; the last statement of a number counts. Gives false where there is no such number.
    pub(super) fn put(&mut self, keyword: &str, value: f64) -> bool {
        let curvature = |radius: f64| if radius == 0.0 { 0.0 } else { 1.0 / radius };
        match keyword {
            "RD" | "RDF" | "CV" | "CVF" => {
                self.pickups.retain(|pickup| !pickup.what.starts_with("CV"));
                self.curvature = if keyword.starts_with("RD") { curvature(value) } else { value };
            }
            "TH" | "THF" => {
                self.pickups.retain(|pickup| !pickup.what.starts_with("TH"));
                (self.thickness, self.states_thickness, self.axial_height) = (value, true, None);
            }
            "CC" => self.conic = value,
            "CVX" => self.curvature_x = Some(value),
            "RDX" => self.curvature_x = Some(curvature(value)),
            "AD" | "AE" | "AF" | "AG" => {
                let place = usize::from(keyword.as_bytes()[1] - b'C');
                self.put_coefficient(place, value);
            }
            "DCX" | "DCY" | "DCZ" => self.decenter[usize::from(keyword.as_bytes()[2] - b'X')] = value,
            "TLA" | "TLB" | "TLC" => self.tilt_deg[usize::from(keyword.as_bytes()[2] - b'A')] = value,
            "PFL" => self.focal_length = Some(value),
            "GSP" => self.grating_spacing = Some(value).filter(|spacing| *spacing != 0.0),
            "GOR" => self.order = value,
            "AP" | "APF" => {
                self.pickups.retain(|pickup| pickup.what != "AP");
                self.aperture = Some(value).filter(|radius| *radius > 0.0 && *radius < NO_APERTURE);
            }
            _ => return false,
        }
        true
    }

    fn put_coefficient(&mut self, place: usize, value: f64) {
        self.coefficients.resize(self.coefficients.len().max(place + 1), 0.0);
        self.coefficients[place] = value;
    }

    pub(super) fn take(&mut self, statement: &Statement) -> Result<Taken, TextError> {
        let keyword = statement.keyword.as_str();
        match keyword {
            "AIR" | "AIF" => self.put_medium(None),
            "RFL" | "RFH" => {
                self.put_medium(None);
                self.is_mirror = true;
            }
            "AST" => self.is_stop = true,
            "NOT" => self.comment = statement.words.join(" "),
            "AP" | "APF" => {
                self.is_checked = statement.word(0).eq_ignore_ascii_case("CHK");
                let radius = statement.number(usize::from(self.is_checked))?;
                if radius < 0.0 {
                    return Err(statement.wrong(format!("an aperture of {radius}, expected 0 or more")));
                }
                let _ = self.put(keyword, radius);
            }
            "DT" => self.tilt_first = statement.number(0)? < 0.0,
            "BEN" => self.bends = true,
            "ASP" => match statement.word(0).to_uppercase().as_str() {
                "0" | "ADO" => {}
                "1" | "ASR" => self.is_general_asphere = true,
                other => {
                    return Err(
                        statement.wrong(format!("aspheres of the kind '{other}' are not supported; expected ASR"))
                    );
                }
            },
            "PK" => self.pickups.push(Pickup {
                line: statement.line,
                what: statement.word(0).to_uppercase(),
                surface: statement.count(1)?,
                plus: statement.number_or(2, 0.0)?,
            }),
            "PY" => {
                // Of a distance that is stated the solve is that of the file's program.
                if self.states_thickness {
                    return Ok(Taken::Solve);
                }
                self.axial_height = Some(statement.number(0)?);
            }
            "PYC" | "PU" | "PUC" | "PI" | "PIC" | "EC" | "PFM" => return Ok(Taken::Solve),
            _ => return self.take_number(statement),
        }
        Ok(Taken::Yes)
    }

    fn take_number(&mut self, statement: &Statement) -> Result<Taken, TextError> {
        let keyword = statement.keyword.as_str();
        let general = keyword.strip_prefix("AS").and_then(|digits| digits.parse::<usize>().ok());
        if let Some(number) = general {
            let value = statement.number(0)?;
            if number > MOST_COEFFICIENTS || (number == 0 && value != 0.0) {
                return Err(statement.wrong(format!("coefficient {number}, expected 1 to {MOST_COEFFICIENTS}")));
            }
            if number > 0 {
                self.put_coefficient(number - 1, value);
            }
            return Ok(Taken::Yes);
        }
        let is_known = Self::default().put(keyword, 0.0);
        if is_known {
            let _ = self.put(keyword, statement.number(0)?);
        }
        Ok(if is_known { Taken::Yes } else { Taken::No })
    }

    /// Returns the tilts and decenters at this surface, whose number and z along the axis are these. About x and y the program turns by the
    /// left-hand rule, about z by the right-hand rule, as CODE V does: Lambda Research's translation of these angles into
    /// those of its `TracePro` (lambdares.com/kb/comparing-tilt-values-in-oslo-vs-tracepro-after-importing-oslo-lens-file). The
    /// program's user guide (5.4, "Tilted and/or decentered surfaces", sinopt.com/software1/usrguide54/enterdat/tiltdec.htm) has the same
    /// senses: the origin of the surface lies by DCX, DCY and DCZ beside the vertex of its base system, which is right-handed with z along the
    /// axis and its origin one thickness behind the surface before, and DT states which of shift and turn comes first (which of its values
    /// is which is assumed).
    pub(super) fn moves(&self, surface: usize, mm: f64, z_mm: f64) -> Result<Vec<SystemMove>, TextError> {
        let [a, b, c] = self.tilt_deg;
        let is_moved = self.decenter.iter().chain(&self.tilt_deg).any(|&v| v != 0.0);
        let n_turns = self.tilt_deg.iter().filter(|angle| **angle != 0.0).count();
        if self.bends && (!self.is_mirror || n_turns > 1 || c != 0.0 || self.decenter != [0.0; 3]) {
            let reason = "BEN is supported of a mirror that has one tilt alone, TLA or TLB".to_owned();
            return Err(TextError { line: Some(self.line), reason });
        }
        if !is_moved {
            return Ok(Vec::new());
        }
        let step = CoordinateBreak {
            surfaces: (surface, usize::MAX),
            pivot_mm: 0.0,
            decenter_mm: self.decenter.map(|shift| shift * mm),
            tilt_deg: [-a, -b, c],
            tilt_first: self.tilt_first,
        };
        let mut moves = vec![SystemMove { z_mm, step }];
        if self.bends {
            let fold = CoordinateBreak { surfaces: (surface + 1, usize::MAX), ..step };
            moves.push(SystemMove { z_mm, step: fold });
        }
        Ok(moves)
    }

    pub(super) fn shape(&self, mm: f64) -> Result<Shape, String> {
        let powers = (1..).map(|half| 1 - 2 * half);
        let from_r2: Vec<f64> = self.coefficients.iter().zip(powers).map(|(a, power)| a * mm.powi(power)).collect();
        if self.coefficients.first().is_some_and(|&a| a != 0.0) && !self.is_general_asphere {
            return Err("AS1 needs ASP ASR".to_owned());
        }
        if let Some(focal_length) = self.focal_length {
            if self.curvature != 0.0 || self.is_mirror || focal_length == 0.0 {
                return Err(
                    "PFL: a perfect lens that is curved, reflects or has no focal length is not supported".to_owned()
                );
            }
            return Ok(Shape::ThinLens { power_per_mm: 1.0 / (focal_length * mm) });
        }
        Ok(match self.curvature_x {
            Some(curvature_x) => Shape::Toroid {
                curvature_x_per_mm: curvature_x / mm,
                conic: self.conic,
                coefficients: up_to_last(from_r2),
            },
            None => even_asphere(self.conic, &from_r2),
        })
    }

    /// Returns the surface in mm; `before` is the medium before it.
    pub(super) fn in_mm(&self, mm: f64, before: &Glass) -> Result<SystemSurface, TextError> {
        let wrong = |reason: String| TextError { line: Some(self.line), reason };
        let phase = match self.grating_spacing {
            None => None,
            Some(_) if self.order.fract() != 0.0 || self.order.abs() > 1e6 => {
                return Err(wrong(format!("a diffraction order of {}; expected a whole number (GOR)", self.order)));
            }
            Some(spacing) => {
                let profile = PhaseProfile::Grating { lines_per_mm: [0.0, 1.0 / (spacing * mm)] };
                Some((self.order as i32, profile))
            }
        };
        if self.axial_height.is_some() {
            let reason = "PY: the distance of a solve is not stored (TH); it is worked out of the image alone, for a height of 0";
            return Err(wrong(reason.to_owned()));
        }
        // A stop that stands alone is bounded by its checked rim, as other surfaces are.
        let is_bounded = self.is_checked && self.curvature == 0.0;
        let opening = self.aperture.filter(|_| is_bounded).map(|radius| Aperture {
            surface: 0,
            outline: Outline::Circle { radius_mm: radius * mm },
            center_mm: [0.0; 2],
            is_obscuration: false,
        });
        Ok(SystemSurface {
            line: self.line,
            comment: self.comment.clone(),
            curvature_per_mm: self.curvature / mm,
            shape: self.shape(mm).map_err(wrong)?,
            medium_after: if self.is_mirror { before.clone() } else { self.medium.clone().unwrap_or_default() },
            thickness_after_mm: self.thickness * mm,
            semi_aperture_mm: self.aperture.map(|radius| radius * mm),
            is_mirror: self.is_mirror,
            phase,
            is_rim_fixed: self.aperture.is_some() && self.is_checked,
            apertures: opening.into_iter().collect(),
        })
    }
}
