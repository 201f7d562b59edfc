//! The words of a CODE V file that are not worked out, and the notes on them.

/// Commands that change no ray: frames of a file, types that their own coefficients state, control codes of variables.
pub(super) const WITHOUT_EFFECT: [&str; 36] = [
    "LEN", "GO", "INI", "DDM", "END", "SPH", "CON", "ASP", "CCY", "CCX", "THC", "KC", "KCX", "GLC", "AC", "BC", "CC",
    "DC", "EC", "FC", "GC", "HC", "JC", "ADC", "BDC", "CDC", "XDC", "YDC", "ZDC", "CA", "GRC", "HCC", "XOC", "YOC",
    "ZOC", "PSC",
];

/// Solves and pickups.
const SOLVES: [&str; 6] = ["PIM", "PIK", "UMY", "UMX", "HMY", "HMX"];

/// How many words one note names.
const MOST_NAMED: usize = 10;

/// Words that a file holds and that are passed over, each with the line where it stands first.
#[derive(Clone, Default)]
pub(super) struct PassedOver {
    solves: Vec<(String, usize)>,
    unknown: Vec<(String, usize)>,
}

impl PassedOver {
    /// Whether a command changes no ray, or is noted here instead of worked out.
    pub(super) fn takes(&mut self, keyword: &str, line: usize) -> bool {
        if SOLVES.contains(&keyword) {
            note(&mut self.solves, keyword, line);
            return true;
        }
        WITHOUT_EFFECT.contains(&keyword)
    }

    /// The first solve, and its line.
    pub(super) fn first_solve(&self) -> Option<(&str, usize)> {
        self.solves.first().map(|(word, line)| (word.as_str(), *line))
    }

    pub(super) fn n_unknown(&self) -> usize {
        self.unknown.len()
    }

    /// Keeps a word that no command has, or whose surface has not begun.
    pub(super) fn unknown(&mut self, keyword: &str, line: usize) {
        note(&mut self.unknown, keyword, line);
    }

    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.solves.is_empty() {
            let named = named(&self.solves);
            notes.push(format!("solves and pickups are not worked out anew, the stored values stand: {named}"));
        }
        if !self.unknown.is_empty() {
            notes.push(format!(
                "not understood, or before the first surface, and passed over: {}",
                named(&self.unknown)
            ));
        }
        notes
    }
}

fn note(words: &mut Vec<(String, usize)>, keyword: &str, line: usize) {
    if words.iter().all(|(word, _)| word != keyword) {
        words.push((keyword.to_owned(), line));
    }
}

fn named(words: &[(String, usize)]) -> String {
    let first = words.iter().take(MOST_NAMED).map(|(word, line)| {
        let short: String = word.chars().take(20).collect();
        format!("{short} (line {line})")
    });
    let first = first.collect::<Vec<_>>().join(", ");
    match words.len().saturating_sub(MOST_NAMED) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}
