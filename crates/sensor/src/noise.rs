//! Which noises there are, and where their random numbers come from.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::SensorError;

/// A source of noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum NoiseSource {
    /// Photon (shot) noise.
    #[serde(alias = "Shot")]
    Photon,
    /// The shot noise of the dark current; its mean is always there.
    DarkCurrent,
    /// Read noise.
    Read,
    /// Reset noise, where the sensor has no correlated double sampling.
    Reset,
    /// Row noise.
    Row,
    /// Photo-response non-uniformity.
    Prnu,
    /// Dark-signal non-uniformity.
    Dsnu,
    /// The columns' offsets and gains.
    Column,
    /// Hot and dead pixels.
    Defects,
    /// Random telegraph noise.
    Telegraph,
}

impl NoiseSource {
    /// Every source with its name on the command line.
    pub const NAMES: [(&'static str, Self); 10] = [
        ("photon", Self::Photon),
        ("dark-current", Self::DarkCurrent),
        ("read", Self::Read),
        ("reset", Self::Reset),
        ("row", Self::Row),
        ("prnu", Self::Prnu),
        ("dsnu", Self::Dsnu),
        ("column", Self::Column),
        ("defects", Self::Defects),
        ("telegraph", Self::Telegraph),
    ];

    const fn bit(self) -> u32 {
        1 << self as u32
    }
}

/// Which sources of noise are on.
///
/// In a camera file `All`, `None`, `Only([Photon, Read])` or `Except([Defects])`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "Words", into = "Words")]
pub struct NoiseSources(u32);

/// The words of [`NoiseSources`] in a file.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename = "NoiseSources")]
enum Words {
    All,
    None,
    Only(Vec<NoiseSource>),
    Except(Vec<NoiseSource>),
}

impl NoiseSources {
    /// No noise.
    pub const NONE: Self = Self(0);
    /// All noise.
    pub const ALL: Self = {
        let (mut bits, mut i) = (0, 0);
        while i < NoiseSource::NAMES.len() {
            bits |= NoiseSource::NAMES[i].1.bit();
            i += 1;
        }
        Self(bits)
    };

    /// Returns these sources alone.
    pub fn only(sources: &[NoiseSource]) -> Self {
        Self(sources.iter().fold(0, |bits, source| bits | source.bit()))
    }

    /// Returns all sources but these.
    pub fn except(sources: &[NoiseSource]) -> Self {
        Self(Self::ALL.0 & !Self::only(sources).0)
    }

    /// Whether a source is on.
    #[inline]
    pub fn has(self, source: NoiseSource) -> bool {
        self.0 & source.bit() != 0
    }

    /// Returns the sources of a command line: `all`, `none`, or a list of names such as `photon,read`; in a list that
    /// begins with `all`, names with a minus are taken away: `all,-defects`. `shot` is another name of `photon`.
    ///
    /// # Errors
    /// Names the word that is no source, and those that are.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let source = |word: &str| {
            let word = if word == "shot" { "photon" } else { word };
            NoiseSource::NAMES.iter().find(|(name, _)| *name == word).map(|(_, source)| *source).ok_or_else(|| {
                let known = NoiseSource::NAMES.map(|(name, _)| name).join(", ");
                SensorError::Word {
                    what: "a source of noise",
                    found: word.to_owned(),
                    expected: format!("all, none, {known}"),
                }
            })
        };
        let words: Vec<String> = text.split(',').map(|word| word.trim().to_ascii_lowercase()).collect();
        match words.as_slice() {
            [word] if word == "none" => Ok(Self::NONE),
            [first, rest @ ..] if first == "all" => {
                let away = rest.iter().map(|word| source(word.strip_prefix('-').unwrap_or(word)));
                Ok(Self::except(&away.collect::<Result<Vec<_>, _>>()?))
            }
            words => Ok(Self::only(&words.iter().map(|word| source(word)).collect::<Result<Vec<_>, _>>()?)),
        }
    }

    fn list(self) -> Vec<NoiseSource> {
        NoiseSource::NAMES.iter().map(|(_, source)| *source).filter(|source| self.has(*source)).collect()
    }
}

impl Default for NoiseSources {
    /// All.
    fn default() -> Self {
        Self::ALL
    }
}

impl From<Words> for NoiseSources {
    fn from(words: Words) -> Self {
        match words {
            Words::All => Self::ALL,
            Words::None => Self::NONE,
            Words::Only(sources) => Self::only(&sources),
            Words::Except(sources) => Self::except(&sources),
        }
    }
}

impl From<NoiseSources> for Words {
    fn from(sources: NoiseSources) -> Self {
        let off = NoiseSources(NoiseSources::ALL.0 & !sources.0);
        match (sources.list(), off.list()) {
            (_, off) if off.is_empty() => Self::All,
            (on, _) if on.is_empty() => Self::None,
            (on, off) if off.len() < on.len() => Self::Except(off),
            (on, _) => Self::Only(on),
        }
    }
}

/// Which noises are on, and the two seeds.
///
/// A pixel's numbers depend on the seed, the source and the row alone, so that a frame is the same for any number of
/// threads, and switching one noise off leaves the others as they were.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// The seed of what changes from frame to frame.
    pub seed: u64,
    /// The seed of what stays with the chip: PRNU, DSNU, columns, defects, pixels with telegraph noise.
    #[serde(default)]
    pub fixed_pattern_seed: u64,
    /// What is on.
    #[serde(default)]
    pub sources: NoiseSources,
}

impl Noise {
    /// Returns all noises on; the chip's own pattern is that of seed 0.
    pub fn all(seed: u64) -> Self {
        Self { seed, fixed_pattern_seed: 0, sources: NoiseSources::ALL }
    }

    /// Returns all noises off.
    pub fn none() -> Self {
        Self { sources: NoiseSources::NONE, ..Self::all(0) }
    }

    /// Returns these noises on, and all others off.
    pub fn only(seed: u64, sources: &[NoiseSource]) -> Self {
        Self { sources: NoiseSources::only(sources), ..Self::all(seed) }
    }

    /// Whether a source is on.
    #[inline]
    pub fn has(&self, source: NoiseSource) -> bool {
        self.sources.has(source)
    }

    /// Returns the same noises for frame `number` of a burst: other temporal noise, the same fixed pattern.
    #[must_use]
    pub fn frame(self, number: u64) -> Self {
        // An odd constant spreads neighboring frames of neighboring seeds over the seeds.
        Self { seed: self.seed.wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15)), ..self }
    }

    /// Returns the generator of one kind of noise for one row of one plane.
    pub(crate) fn rng(&self, kind: Kind, plane: usize, row: usize) -> ChaCha8Rng {
        let seed = if kind.is_fixed() { !self.fixed_pattern_seed } else { self.seed };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream((kind as u64) << 48 | (plane as u64) << 32 | row as u64);
        rng
    }
}

/// The kinds of random numbers; each has streams of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Photon = 1,
    Read = 2,
    Reset = 3,
    Row = 4,
    Telegraph = 5,
    Prnu = 17,
    Dsnu = 18,
    ColumnOffset = 19,
    ColumnGain = 20,
    Defects = 21,
    TelegraphSites = 22,
}

impl Kind {
    fn is_fixed(self) -> bool {
        self as u64 >= Self::Prnu as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_file(text: &str) -> NoiseSources {
        ron::from_str(text).unwrap()
    }

    #[test]
    fn words_switch_the_sources_they_name() {
        use NoiseSource::{Defects, Photon, Prnu, Read};
        for (typed, written, on, off) in [
            ("all", "All", &[Photon, Read, Defects][..], &[][..]),
            ("none", "None", &[], &[Photon, Read, Defects]),
            ("shot, READ", "Only([Shot, Read])", &[Photon, Read], &[Prnu, Defects]),
            ("all,-defects,prnu", "Except([Defects, Prnu])", &[Photon, Read], &[Prnu, Defects]),
        ] {
            let sources = NoiseSources::parse(typed).unwrap();
            assert_eq!(sources, in_file(written), "{typed}");
            assert!(on.iter().all(|s| sources.has(*s)) && !off.iter().any(|s| sources.has(*s)), "{typed}");
            assert_eq!(in_file(&ron::to_string(&sources).unwrap()), sources, "{typed}");
        }
        for wrong in ["some", "none,read", "read,", ""] {
            assert!(NoiseSources::parse(wrong).unwrap_err().to_string().contains("dark-current"), "{wrong}");
        }
    }

    #[test]
    fn the_table_of_names_has_every_source_once() {
        let bits: u32 = NoiseSource::NAMES.iter().map(|(_, source)| source.bit()).sum();
        assert_eq!((NoiseSources::ALL.0, bits), (0x3ff, 0x3ff));
    }
}
