//! The zoom positions of a CODE V file: `ZOO 3`, then `ZOO THI S4 5 6 7` with a value for each position, or `THI S4 Z2 6`.

use super::{
    super::{
        configuration::MOST_CONFIGURATIONS,
        lens_file::LensFile,
        system_states::{self, SystemState},
        text_error::TextError,
    },
    Seq,
    command::Command,
    is_number_of_surface,
    words::WITHOUT_EFFECT,
};

/// What is known of the zoom positions of a file.
#[derive(Clone, Default)]
pub(super) struct Zoom {
    /// How many positions there are, where that is stated.
    n_positions: usize,
    /// What is stated of one position, counted from 1: a command without the word that names the position.
    values: Vec<(usize, Command)>,
    names: Vec<(usize, String)>,
}

/// Commands of lists with an element for each field or wavelength.
const OF_FIELDS: [&str; 13] =
    ["XAN", "YAN", "XOB", "YOB", "XIM", "YIM", "XRI", "YRI", "VUX", "VLX", "VUY", "VLY", "WTF"];
const OF_WAVELENGTHS: [&str; 2] = ["WL", "WTW"];
/// Commands of the whole system.
const OF_SYSTEM: [&str; 4] = ["EPD", "FNO", "NAO", "REF"];

impl Zoom {
    /// Takes a command that speaks of zoom positions; false where it does not.
    pub(super) fn takes(&mut self, keyword: &str, command: &Command, last_surface: usize) -> Result<bool, TextError> {
        if keyword == "ZOO" {
            self.take_zoo(command, last_surface)?;
            return Ok(true);
        }
        let is_position = |word: &String| position_of(word).is_some();
        let Some(place) = (1..command.words.len().min(3)).find(|&place| is_position(&command.words[place])) else {
            return Ok(false);
        };
        let position = position_of(&command.words[place]).unwrap_or_default();
        let is_title = matches!(keyword, "TIT" | "TITLE");
        if keyword == "SLB" || command.words.len() < place + 2 {
            return Ok(false);
        }
        self.check_position(position, command)?;
        if is_title {
            self.names.push((position, command.words[place + 1].trim().to_owned()));
        } else if !WITHOUT_EFFECT.contains(&keyword) {
            let mut words = command.words.clone();
            words.remove(place);
            self.values.push((position, with_surface(Command { line: command.line, words }, last_surface)));
        }
        Ok(true)
    }

    /// Takes `ZOO 3`, or `ZOO` before a command with a value for each position.
    fn take_zoo(&mut self, command: &Command, last_surface: usize) -> Result<(), TextError> {
        let Some(keyword) = command.words.get(1).map(|word| word.to_uppercase()) else { return Ok(()) };
        if let Ok(n_positions) = keyword.parse() {
            self.check_position(n_positions, command)?;
            self.n_positions = n_positions;
            return Ok(());
        }
        if WITHOUT_EFFECT.contains(&keyword.as_str()) || matches!(keyword.as_str(), "TIT" | "TITLE") {
            return Ok(());
        }
        let is_list = OF_FIELDS.contains(&keyword.as_str()) || OF_WAVELENGTHS.contains(&keyword.as_str());
        if is_list && !command.words.get(2).is_some_and(|word| is_selector(word)) {
            return Err(
                command.wrong(format!("{keyword} is of which field or wavelength? Expected F or W and a number"))
            );
        }
        let n_selectors = command.words[2..].iter().take_while(|word| is_selector(word)).count();
        let (head, values) = command.words[1..].split_at(1 + n_selectors);
        self.check_position(values.len().max(1), command)?;
        for (position, value) in (1..).zip(values) {
            let words = head.iter().chain([value]).cloned().collect();
            self.values.push((position, with_surface(Command { line: command.line, words }, last_surface)));
        }
        if !values.is_empty() && self.n_positions > 0 && values.len() != self.n_positions {
            let (found, n) = (values.len(), self.n_positions);
            return Err(command.wrong(format!("{found} values of {keyword} for {n} zoom positions")));
        }
        Ok(())
    }

    fn check_position(&self, position: usize, command: &Command) -> Result<(), TextError> {
        let most = if self.n_positions > 0 { self.n_positions.max(1) } else { MOST_CONFIGURATIONS };
        let most = if command.words[0].eq_ignore_ascii_case("ZOO") { MOST_CONFIGURATIONS } else { most };
        match (1..=most).contains(&position) {
            true => Ok(()),
            false => Err(command.wrong(format!("zoom position {position}, expected 1 to {most}"))),
        }
    }

    /// How many positions there are; 1 where the file speaks of none.
    fn n_positions(&self) -> usize {
        let stated = self.values.iter().map(|(position, _)| *position).max().unwrap_or(1);
        self.n_positions.max(stated)
    }
}

impl Seq<'_> {
    /// Returns the file with all of its zoom positions.
    pub(super) fn build(self) -> Result<LensFile, TextError> {
        let n_positions = self.zoom.n_positions();
        if n_positions < 2 {
            return self.into_system()?.build();
        }
        let glasses = self.glasses.clone();
        let name_of = |position: usize| {
            let found = self.zoom.names.iter().find(|(named, _)| *named == position);
            found.map(|(_, name)| name.clone()).unwrap_or_default()
        };
        let state = |position: usize| SystemState {
            name: name_of(position),
            system: self.at_position(position).and_then(Self::into_system),
        };
        system_states::build((1..=n_positions).map(state).collect(), 1, &glasses)
    }

    /// Returns the file as it is in this zoom position; what is stated without a position is that of the first.
    fn at_position(&self, position: usize) -> Result<Self, TextError> {
        let mut state = self.clone();
        state.private_wavelengths_nm = None;
        for (_, command) in self.zoom.values.iter().filter(|(of, _)| *of == position) {
            let keyword = command.words[0].to_uppercase();
            if matches!(keyword.as_str(), "S" | "SO" | "S0" | "SI" | "PRV" | "STO" | "DIM" | "RDM" | "CUM") {
                return Err(command.wrong("is not supported for a zoom position"));
            }
            let n_unknown = state.passed_over.n_unknown();
            state.take_value(&keyword, command)?;
            if state.passed_over.n_unknown() > n_unknown && position > 1 {
                return Err(command.wrong("is not understood for a zoom position"));
            }
        }
        match state.passed_over.first_solve().filter(|_| position > 1) {
            None => Ok(state),
            Some((solve, line)) => {
                let reason = format!("{solve}: the value of the solve is stored for zoom position 1 alone");
                Err(TextError { line: Some(line), reason })
            }
        }
    }

    /// Takes one element of a list, as `YAN F2 14`; false where the command is none.
    pub(super) fn takes_element(&mut self, keyword: &str, command: &Command) -> Result<bool, TextError> {
        let kind = match keyword {
            _ if OF_FIELDS.contains(&keyword) => 'F',
            _ if OF_WAVELENGTHS.contains(&keyword) => 'W',
            _ => return Ok(false),
        };
        let Some(place) = command.words.get(1).and_then(|word| number_behind(kind, word)) else { return Ok(false) };
        let value = command.number(2)?;
        if !(1..=MOST_CONFIGURATIONS).contains(&place) {
            return Err(command.wrong(format!("{kind}{place}, expected 1 to {MOST_CONFIGURATIONS}")));
        }
        let axis = usize::from(keyword.starts_with('Y'));
        let (list, other) = match keyword {
            "WL" => (&mut self.wavelengths_nm, f64::NAN),
            "WTW" => (&mut self.wavelength_weights, 1.0),
            "WTF" => (&mut self.field_weights, 1.0),
            "VUX" => (&mut self.vignetting[0], 0.0),
            "VLX" => (&mut self.vignetting[1], 0.0),
            "VUY" => (&mut self.vignetting[2], 0.0),
            "VLY" => (&mut self.vignetting[3], 0.0),
            _ => (&mut self.fields[axis], 0.0),
        };
        if other.is_nan() && place > list.len() {
            return Err(command.wrong(format!("the file has no wavelength {place}")));
        }
        list.resize(list.len().max(place), other);
        list[place - 1] = value;
        if OF_FIELDS.contains(&keyword) && !keyword.starts_with(['V', 'W']) {
            self.put_field_kind(keyword, command)?;
        }
        Ok(true)
    }
}

/// Returns the command with the surface that it is of: the last, where it names none.
fn with_surface(mut command: Command, last_surface: usize) -> Command {
    let keyword = command.words[0].to_uppercase();
    let is_of_surface =
        ![&OF_FIELDS[..], &OF_WAVELENGTHS, &OF_SYSTEM].iter().any(|list| list.contains(&keyword.as_str()));
    if is_of_surface && !command.words.get(1).is_some_and(|word| is_selector(word)) {
        command.words.insert(1, format!("S{last_surface}"));
    }
    command
}

/// Whether a word names a surface, a field, a wavelength or a coefficient.
fn is_selector(word: &str) -> bool {
    is_number_of_surface(word)
        || matches!(word.to_uppercase().as_str(), "SO" | "SI")
        || ['F', 'W', 'C'].into_iter().any(|kind| number_behind(kind, word).is_some())
}

fn position_of(word: &str) -> Option<usize> {
    number_behind('Z', word)
}

/// Returns the number behind a letter, as 2 of `F2`.
fn number_behind(letter: char, word: &str) -> Option<usize> {
    let digits = word.strip_prefix([letter, letter.to_ascii_lowercase()])?;
    (!digits.is_empty() && digits.bytes().all(|sign| sign.is_ascii_digit())).then(|| digits.parse().ok()).flatten()
}
