//! The configurations of a Zemax file: operands, each a value for one of them.
//!
//! A line is `THIC surface configuration value …`, with the number of a parameter two places behind the value where it is one's
//! (`PRAM`) and a text in quotes in place of the value where it is a name (`GLSS`, `LTTL`).

use crate::OpticsError;

use super::{
    super::{
        configuration::MOST_CONFIGURATIONS,
        glasses::Glasses,
        lens_file::LensFile,
        system::Beam,
        system_states::{self, SystemState},
        text_error::TextError,
    },
    Line, Zmx,
};

/// An operand's value in one configuration.
#[derive(Clone)]
pub(super) struct ZmxOperand {
    line: usize,
    keyword: String,
    /// The surface, field or wavelength.
    place: usize,
    /// Counted from 1.
    configuration: usize,
    value: Option<f64>,
    /// The number of a surface's parameter.
    parameter: Option<usize>,
    text: Option<String>,
}

/// Operands that are worked out.
const OPERANDS: [&str; 24] = [
    "THIC", "CRVT", "CONN", "GLSS", "MIND", "MABB", "SDIA", "PRAM", "STPS", "APMN", "APMX", "APDX", "APDY", "APER",
    "XFIE", "YFIE", "FVDX", "FVDY", "FVCX", "FVCY", "FLWT", "WAVE", "WLWT", "PRWV",
];

/// Operands that name a configuration.
const NAMES: [&str; 2] = ["LTTL", "MCOM"];

/// Operands that change rays and are not worked out.
const OTHERS: [&str; 50] = [
    "AFOC", "APTP", "CADX", "CADY", "CADZ", "CATX", "CATY", "CATZ", "CAOR", "CBDX", "CBDY", "CBDZ", "CBTX", "CBTY",
    "CBTZ", "CBOR", "CROR", "CRSR", "CSP1", "CSP2", "EDVA", "FLTP", "FVAN", "IGNM", "IGNR", "MDPG", "NPAR", "NPOS",
    "NPRO", "PAR1", "PAR2", "PAR3", "PAR4", "PAR5", "PAR6", "PAR7", "PAR8", "PRES", "PSP1", "PSP2", "PSP3", "SATP",
    "TELE", "TEMP", "TSP1", "TSP2", "TSP3", "UDAF", "APDF", "APDT",
];

/// From this distance on an operand's object is infinitely far, mm or whatever the unit of the file is.
const FAR: f64 = 1e10;

impl ZmxOperand {
    /// Returns the operand of a line, if it is one.
    pub(super) fn of(line: &Line) -> Result<Option<Self>, TextError> {
        let is_any = |list: &[&str]| list.contains(&line.keyword);
        if !(is_any(&OPERANDS) || is_any(&NAMES) || is_any(&OTHERS)) {
            return Ok(None);
        }
        let configuration = line.count(1)?;
        let is_text = is_any(&NAMES) || line.keyword == "GLSS";
        let parameter = (line.keyword == "PRAM").then(|| line.count(4)).transpose()?;
        Ok(Some(Self {
            line: line.number,
            keyword: line.keyword.to_owned(),
            place: line.count(0)?,
            configuration,
            value: if is_text { None } else { Some(line.number(2)?) },
            parameter,
            text: is_text.then(|| quoted(&line.words[2..].join(" "))),
        }))
    }

    fn wrong(&self, reason: impl std::fmt::Display) -> TextError {
        TextError { line: Some(self.line), reason: format!("{}: {reason}", self.keyword) }
    }
}

/// Returns the first text in quotes that is not empty, or else the first word that is no number.
fn quoted(words: &str) -> String {
    let in_quotes = words.split('"').skip(1).step_by(2).find(|text| !text.trim().is_empty());
    let is_name = |word: &&str| !word.contains('"') && word.parse::<f64>().is_err();
    in_quotes.or_else(|| words.split_whitespace().next().filter(is_name)).unwrap_or_default().trim().to_owned()
}

impl Zmx {
    /// Returns the file with all of its configurations.
    pub(super) fn build(self, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
        let n = self.n_configurations;
        if n < 2 {
            return self.into_system(name, glasses.clone())?.build();
        }
        if self.surface_numbers.iter().enumerate().any(|(i, number)| i != *number) {
            let reason = "MNUM: several configurations of a file that leaves out numbers of surfaces are not supported";
            return Err(TextError { line: None, reason: reason.to_owned() });
        }
        if n > MOST_CONFIGURATIONS {
            let reason = format!("MNUM: {n} configurations, expected at most {MOST_CONFIGURATIONS}");
            return Err(TextError { line: None, reason });
        }
        if let Some(operand) = self.operands.iter().find(|operand| !(1..=n).contains(&operand.configuration)) {
            return Err(
                operand.wrong(OpticsError::Configuration { number: operand.configuration, n_configurations: n })
            );
        }
        let stored = if (1..=n).contains(&self.stored) { self.stored } else { 1 };
        let state = |number: usize| SystemState {
            name: self.name_of(number),
            system: self.state(number, stored).and_then(|state| state.into_system(name, glasses.clone())),
        };
        system_states::build((1..=n).map(state).collect(), stored, glasses)
    }

    fn name_of(&self, number: usize) -> String {
        let is_its =
            |operand: &&ZmxOperand| operand.configuration == number && NAMES.contains(&operand.keyword.as_str());
        self.operands.iter().find(is_its).and_then(|operand| operand.text.clone()).unwrap_or_default()
    }

    /// Returns the file as it is in this configuration, where its values are stored for another.
    fn state(&self, number: usize, stored: usize) -> Result<Self, TextError> {
        let mut state = self.clone();
        if number != stored {
            self.check_operands()?;
            state.surfaces.iter_mut().for_each(super::ZmxSurface::forget_automatic_rim);
        }
        for operand in self.operands.iter().filter(|operand| operand.configuration == number) {
            state.apply(operand)?;
        }
        if number != stored {
            state.solve(&self.operands, stored)?;
        }
        Ok(state)
    }

    /// Checks that no operand which is not worked out has another value in another configuration.
    fn check_operands(&self) -> Result<(), TextError> {
        for operand in self.operands.iter().filter(|operand| OTHERS.contains(&operand.keyword.as_str())) {
            let is_like = |other: &&ZmxOperand| (&other.keyword, other.place) == (&operand.keyword, operand.place);
            if self.operands.iter().filter(is_like).any(|other| other.value != operand.value) {
                return Err(operand.wrong("values of this operand that differ among configurations are not supported"));
            }
        }
        Ok(())
    }

    /// Puts the value of an operand in its place.
    fn apply(&mut self, operand: &ZmxOperand) -> Result<(), TextError> {
        let value = operand.value.unwrap_or(0.0);
        match operand.keyword.as_str() {
            "APER" => self.beam = self.beam.map(|beam| beam.with_value(value)),
            "XFIE" => put_at(&mut self.fields[0], operand, value)?,
            "YFIE" => put_at(&mut self.fields[1], operand, value)?,
            "FVDX" => put_at(&mut self.vignetting[0], operand, value)?,
            "FVDY" => put_at(&mut self.vignetting[1], operand, value)?,
            "FVCX" => put_at(&mut self.vignetting[2], operand, value)?,
            "FVCY" => put_at(&mut self.vignetting[3], operand, value)?,
            "FLWT" => {
                let n_fields = self.fields[0].len().max(self.fields[1].len());
                self.field_weights.resize(n_fields.max(self.field_weights.len()), 1.0);
                put_at(&mut self.field_weights, operand, value)?;
            }
            "WAVE" | "WLWT" => {
                let wavelength = self.wavelengths_um.iter_mut().find(|(number, ..)| *number == operand.place);
                let Some((_, um, weight)) = wavelength else {
                    return Err(operand.wrong(format!("the file has no wavelength {}", operand.place)));
                };
                *(if operand.keyword == "WAVE" { um } else { weight }) = value;
            }
            "PRWV" => self.primary = value as usize,
            "STPS" => {
                let stop = value as usize;
                if value.fract() != 0.0 || stop >= self.surfaces.len() {
                    return Err(operand.wrong(format!("the file has no surface {value}")));
                }
                self.surfaces.iter_mut().enumerate().for_each(|(i, surface)| surface.is_stop = i == stop);
            }
            keyword if OPERANDS.contains(&keyword) => self.apply_to_surface(operand, value)?,
            _ => {}
        }
        Ok(())
    }

    /// Puts the value of an operand of a surface in its place.
    fn apply_to_surface(&mut self, operand: &ZmxOperand, value: f64) -> Result<(), TextError> {
        let n_surfaces = self.surfaces.len();
        let Some(surface) = self.surfaces.get_mut(operand.place) else {
            let last = n_surfaces.saturating_sub(1);
            return Err(operand.wrong(format!("surface {}, expected one from 0 to {last}", operand.place)));
        };
        match operand.keyword.as_str() {
            "THIC" if operand.place == 0 && value >= FAR => surface.thickness = f64::INFINITY,
            "THIC" => surface.thickness = value,
            "CRVT" => surface.curvature = value,
            "CONN" => surface.conic = value,
            "GLSS" => surface.put_glass(operand.line, operand.text.as_deref().unwrap_or_default()),
            "MIND" | "MABB" if !surface.put_model_glass(operand.keyword == "MIND", value) => {
                return Err(operand.wrong("the surface has no model glass behind it"));
            }
            "MIND" | "MABB" => {}
            "PRAM" => {
                surface.put_parameter(operand.parameter.unwrap_or(0), value).map_err(|what| operand.wrong(what))?
            }
            keyword => surface.put_rim(keyword, value).map_err(|what| operand.wrong(what))?,
        }
        Ok(())
    }

    /// Works out the thicknesses that make a sum (`TCOM`, `TOLE`) in a configuration for which no others are stored, and refuses solves
    /// that might have another value there.
    fn solve(&mut self, operands: &[ZmxOperand], stored: usize) -> Result<(), TextError> {
        for number in 0..self.surfaces.len() {
            for solve in self.surfaces[number].solves.clone() {
                let varies = |keyword: &str| {
                    operands.iter().any(|operand| operand.keyword == keyword && Some(operand.place) == solve.surface)
                };
                let is_held = match solve.keyword.as_str() {
                    "PKUP" => !varies("CRVT"),
                    "PZUP" => !varies("THIC"),
                    "PPAR" => !varies("PRAM"),
                    "TCOM" | "TOLE" => {
                        let Some(from) = solve.surface.filter(|&from| from < number) else {
                            return Err(solve.wrong(number, "is of a surface behind its own"));
                        };
                        let others = if solve.keyword == "TCOM" { from..from + 1 } else { from..number };
                        let sum: f64 = self.surfaces[others].iter().map(|surface| surface.thickness).sum();
                        self.surfaces[number].thickness = solve.sum - sum;
                        true
                    }
                    _ => false,
                };
                if !is_held {
                    return Err(solve.wrong(number, &format!("is stored for configuration {stored} alone")));
                }
            }
        }
        Ok(())
    }
}

impl Beam {
    /// Returns the same measure of the beam with another value.
    fn with_value(self, value: f64) -> Self {
        match self {
            Self::Stop => Self::Stop,
            Self::EntrancePupil(_) => Self::EntrancePupil(value),
            Self::FNumber(_) => Self::FNumber(value),
            Self::WorkingFNumber(_) => Self::WorkingFNumber(value),
            Self::ObjectCone(_) => Self::ObjectCone(value.to_radians()),
            Self::ObjectAperture(_) => Self::ObjectAperture(value),
        }
    }
}

/// Puts a value at the place of an operand in a list that counts from 1.
fn put_at(list: &mut Vec<f64>, operand: &ZmxOperand, value: f64) -> Result<(), TextError> {
    if !(1..=MOST_CONFIGURATIONS).contains(&operand.place) {
        return Err(operand.wrong(format!("number {}, expected 1 to {MOST_CONFIGURATIONS}", operand.place)));
    }
    list.resize(list.len().max(operand.place), 0.0);
    list[operand.place - 1] = value;
    Ok(())
}
