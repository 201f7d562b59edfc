//! The choices on the way from the raw frame to the picture, each in one place: its name, its help, how it is read and how it is written.
//!
//! The command line, the keywords of Python and what the window copies as words are made from this table, its numbers are held to
//! [`range_of`](crate::range_of). A new choice is a field of `Processing` and a line here.

use std::fmt;

use dioptric_sensor::{
    Brightness, ColorCorrection, ColorSpace, Demosaic, Highlights, LensCorrections, LocalTone, Perspective, Processing,
    ToneCurve, WhiteBalance,
};
use dioptric_spectrum::Illuminant;

use crate::{PipelineError, parse_illuminant, parse_white, ranges::range_of};

/// A choice of the picture.
pub struct Key {
    /// Its name in Python, and in the camera file within `processing`.
    pub name: &'static str,
    /// Its name on the command line, without the hyphens before it.
    pub option: &'static str,
    /// What stands for a value in a help.
    pub value: &'static str,
    /// What it is, in a sentence.
    pub help: &'static str,
    kind: Kind,
}

/// What a value is.
enum Kind {
    Number { get: fn(&Processing) -> Option<f64>, set: fn(&mut Processing, f64) },
    Word { get: fn(&Processing) -> Option<String>, set: fn(&mut Processing, &str) -> Result<(), PipelineError> },
}

use Kind::{Number, Word};

/// The choices, in the order in which they are made.
pub const PICTURE: [Key; 13] = [
    Key {
        name: "white",
        option: "white",
        value: "WHITE",
        help: "What the picture makes white: scene (its light, or its mean where that is unknown), none, gray-world, white-patch, \
               shades-of-gray, gray-edge, patch:X,Y,W,H, or a light as --illuminant has it [default: scene]",
        kind: Word {
            get: |processing| white_word(&processing.white),
            set: |processing, word| {
                processing.white = parse_white(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "demosaic",
        option: "demosaic",
        value: "METHOD",
        help: "How missing colors are found: nearest, bilinear, malvar, directional, directional-ratio",
        kind: Word {
            get: |processing| {
                let found = Demosaic::NAMES.iter().find(|(_, method)| *method == processing.demosaic);
                found.map(|(name, _)| (*name).to_owned())
            },
            set: |processing, word| {
                processing.demosaic = Demosaic::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "denoise",
        option: "denoise",
        value: "S",
        help: "How much noise is taken out: 0 none, 0.5 what noise may be, more what texture may be too [default: what the frame's own \
               noise asks for]",
        kind: Number { get: |processing| processing.denoise, set: |processing, s| processing.denoise = Some(s) },
    },
    Key {
        name: "highlights",
        option: "highlights",
        value: "KIND",
        help: "What becomes of light beyond saturation: clip (channel by channel), reconstruct [default: reconstruct]",
        kind: Word {
            get: |processing| word_of(&["clip", "reconstruct"], Highlights::parse, &processing.highlights),
            set: |processing, word| {
                processing.highlights = Highlights::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "lens_corrections",
        option: "lens-corrections",
        value: "LIST",
        help: "Aberrations of the simulated lens that are undone: all, none, or of distortion, lateral-color, vignetting [default: none]",
        kind: Word {
            get: |processing| {
                let LensCorrections { distortion, lateral_color, vignetting } = processing.lens_corrections;
                let chosen = [("distortion", distortion), ("lateral-color", lateral_color), ("vignetting", vignetting)];
                let names: Vec<&str> = chosen.into_iter().filter(|(_, is)| *is).map(|(name, _)| name).collect();
                Some(if names.is_empty() { "none".to_owned() } else { names.join(",") })
            },
            set: |processing, word| {
                processing.lens_corrections = LensCorrections::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "color",
        option: "color",
        value: "KIND",
        help: "How channels become colors: auto (a matrix fitted for sensor and light, with roots of their products where no matrix comes \
               near), roots, none [default: auto]",
        kind: Word {
            get: |processing| word_of(&["auto", "roots", "none"], ColorCorrection::parse, &processing.color),
            set: |processing, word| {
                processing.color = ColorCorrection::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "sharpen_px",
        option: "sharpen-px",
        value: "S",
        help: "Undoes a blur of this standard deviation, pixels, as far as noise allows; 0.5 to 0.8 for sharp lenses [default: 0]",
        kind: Number {
            get: |processing| Some(processing.sharpen_px),
            set: |processing, px| processing.sharpen_px = px,
        },
    },
    Key {
        name: "local_tone",
        option: "local-tone",
        value: "TONE",
        help: "Factors on the contrast between parts of the picture and within them, RANGE or RANGE,DETAIL, as 0.6,1.2 [default: 1,1]",
        kind: Word {
            get: |Processing { local_tone: LocalTone { range, detail }, .. }| Some(format!("{range},{detail}")),
            set: |processing, word| {
                processing.local_tone = LocalTone::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "perspective",
        option: "perspective",
        value: "LIST",
        help: "Stretches a part of the picture to the whole of it: its corners clockwise from the upper left one, fractions of width and \
               height, as 0.1,0,0.9,0,1,1,0,1 for verticals that lean inwards [default: none]",
        kind: Word {
            get: |processing| {
                let corners = processing.perspective?.corners;
                Some(corners.map(|(x, y)| format!("{x},{y}")).join(","))
            },
            set: |processing, word| {
                processing.perspective = Some(Perspective::parse(word)?);
                Ok(())
            },
        },
    },
    Key {
        name: "brightness",
        option: "brightness",
        value: "B",
        help: "How bright the picture is made: as-exposed, a factor, or a percentile of its luminance and where it is put, as 99%:0.9 \
               [default: as-exposed]",
        kind: Word {
            get: |processing| {
                Some(match processing.brightness {
                    Brightness::AsExposed => "as-exposed".to_owned(),
                    Brightness::Factor(factor) => factor.to_string(),
                    Brightness::Percentile { percent, to } => format!("{percent}%:{to}"),
                })
            },
            set: |processing, word| {
                processing.brightness = Brightness::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "curve",
        option: "curve",
        value: "CURVE",
        help: "The curve from light to codes: linear, srgb, gamma:EXPONENT, filmic:CONTRAST [default: srgb]",
        kind: Word {
            get: |processing| {
                Some(match processing.curve {
                    ToneCurve::Linear => "linear".to_owned(),
                    ToneCurve::Srgb => "srgb".to_owned(),
                    ToneCurve::Gamma(exponent) => format!("gamma:{exponent}"),
                    ToneCurve::Filmic { contrast } => format!("filmic:{contrast}"),
                })
            },
            set: |processing, word| {
                processing.curve = ToneCurve::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "space",
        option: "space",
        value: "NAME",
        help: "The primaries of the picture: srgb, display-p3 [default: srgb]",
        kind: Word {
            get: |processing| word_of(&["srgb", "display-p3"], ColorSpace::parse, &processing.space),
            set: |processing, word| {
                processing.space = ColorSpace::parse(word)?;
                Ok(())
            },
        },
    },
    Key {
        name: "defect_threshold",
        option: "defect-threshold",
        value: "F",
        help: "Replaces pixels further than this above or below all their neighbors of the same filter, a fraction of saturation \
               [default: none]",
        kind: Number {
            get: |processing| processing.defect_threshold,
            set: |processing, fraction| processing.defect_threshold = Some(fraction),
        },
    },
];

impl Key {
    /// Whether its values are numbers.
    pub fn is_number(&self) -> bool {
        matches!(self.kind, Number { .. })
    }

    /// Sets it to a value as the command line has it.
    ///
    /// # Errors
    /// Names the word that is not known, or the range that a number is beyond.
    pub fn set(&self, processing: &mut Processing, word: &str) -> Result<(), PipelineError> {
        match &self.kind {
            Word { set, .. } => set(processing, word),
            Number { set, .. } => {
                let range = range_of(self.name).expect("a number of the table has a range");
                let number = word.parse().ok().filter(|number| range.holds(*number)).ok_or_else(|| {
                    let (found, expected) = (word.to_owned(), range.to_string());
                    PipelineError::Value { origin: "the processing".to_owned(), key: self.name, found, expected }
                })?;
                set(processing, number);
                Ok(())
            }
        }
    }

    /// Returns what [`set`](Self::set) makes of it, or `None` where no word does.
    pub fn word(&self, processing: &Processing) -> Option<String> {
        match &self.kind {
            Word { get, .. } => get(processing),
            Number { get, .. } => get(processing).map(|number| number.to_string()),
        }
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name)
    }
}

/// Choices with their words.
#[derive(Clone, Debug, Default)]
pub struct PictureOptions(Vec<(&'static Key, String)>);

impl PictureOptions {
    /// Adds a choice.
    pub fn choose(&mut self, key: &'static Key, word: String) {
        self.0.push((key, word));
    }

    /// Makes the choices.
    ///
    /// # Errors
    /// As [`Key::set`], of the first that is wrong.
    pub fn apply(&self, processing: &mut Processing) -> Result<(), PipelineError> {
        self.0.iter().try_for_each(|(key, word)| key.set(processing, word))
    }
}

/// Returns the word that is read as a value.
fn word_of<T: PartialEq, E>(words: &[&str], parse: fn(&str) -> Result<T, E>, value: &T) -> Option<String> {
    let is_it = |word: &&&str| parse(word).is_ok_and(|read| read == *value);
    words.iter().find(is_it).map(|word| (*word).to_owned())
}

/// Returns the word of a light, where it has one.
pub fn light_word(light: &Illuminant) -> Option<String> {
    let names = Illuminant::NAMES.iter().map(|name| (*name).to_owned());
    let numbers = match light {
        Illuminant::Blackbody(kelvin) | Illuminant::Daylight(kelvin) => Some(format!("{kelvin}K")),
        Illuminant::Chromaticity { x, y } => Some(format!("{x},{y}")),
        _ => None,
    };
    names.chain(numbers).find(|word| parse_illuminant(word).is_ok_and(|parsed| parsed == *light))
}

/// Returns the word of a white, where it has one.
pub fn white_word(white: &WhiteBalance) -> Option<String> {
    let words = ["scene", "none", "gray-world", "white-patch", "shades-of-gray", "gray-edge"].map(str::to_owned);
    let more = match white {
        WhiteBalance::Light(light) => light_word(light),
        WhiteBalance::Patch { left, top, width, height } => Some(format!("patch:{left},{top},{width},{height}")),
        _ => None,
    };
    words.into_iter().chain(more).find(|word| parse_white(word).is_ok_and(|parsed| parsed == *white))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What each choice may be set to.
    const WORDS: [(&str, &[&str]); 13] = [
        ("white", &["scene", "none", "gray-edge", "D50", "3200K", "patch:1,2,3,4"]),
        ("demosaic", &["nearest", "directional-ratio"]),
        ("denoise", &["0", "0.5"]),
        ("highlights", &["clip", "reconstruct"]),
        ("lens_corrections", &["none", "distortion,vignetting"]),
        ("color", &["auto", "roots", "none"]),
        ("sharpen_px", &["0", "0.7"]),
        ("local_tone", &["0.6,1.2"]),
        ("perspective", &["0.1,0,0.9,0,1,1,0,1"]),
        ("brightness", &["as-exposed", "1.5", "99%:0.9"]),
        ("curve", &["linear", "srgb", "gamma:0.45", "filmic:0.5"]),
        ("space", &["srgb", "display-p3"]),
        ("defect_threshold", &["0.05"]),
    ];

    #[test]
    fn what_is_set_is_said_in_the_same_words() {
        for (key, (name, words)) in PICTURE.iter().zip(WORDS) {
            assert_eq!((key.name, key.option), (name, &*name.replace('_', "-")));
            for word in words {
                let mut processing = Processing::default();
                key.set(&mut processing, word).unwrap();
                assert_eq!(key.word(&processing).as_deref(), Some(*word), "{name}");
                processing.check().unwrap();
            }
        }
    }

    #[test]
    fn a_choice_changes_nothing_else() {
        for key in &PICTURE {
            let word =
                WORDS.iter().find(|(name, _)| *name == key.name).map(|(_, words)| words[words.len() - 1]).unwrap();
            let (usual, mut changed) = (Processing::default(), Processing::default());
            key.set(&mut changed, word).unwrap();
            for other in PICTURE.iter().filter(|other| other.name != key.name) {
                assert_eq!(other.word(&changed), other.word(&usual), "{} by {}", other.name, key.name);
            }
        }
    }

    #[test]
    fn numbers_are_held_to_their_range() {
        let key = PICTURE.iter().find(|key| key.name == "sharpen_px").unwrap();
        for word in ["-1", "3", "much"] {
            let message = key.set(&mut Processing::default(), word).unwrap_err().to_string();
            assert!(message.contains(&format!("sharpen_px is {word}, expected 0 to 2 pixels")), "{message}");
        }
    }
}
