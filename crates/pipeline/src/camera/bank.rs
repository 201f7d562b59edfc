//! A key that camera files had and have no more.

use serde::{Deserialize, Deserializer, de::IgnoredAny};

/// The key `bank` of older camera files: how point spreads were sampled over field, depth and wavelength, which they no longer are. It is
/// read, whatever it says, and ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RetiredBank {
    is_stated: bool,
}

impl RetiredBank {
    /// Says that the key does nothing, where it is stated.
    pub fn note(self) -> Option<String> {
        let words =
            "bank: the key is ignored; point spreads are traced where they are used, and nothing is sampled between";
        self.is_stated.then(|| words.to_owned())
    }

    /// The key as stated, as by an option of older command lines.
    pub const STATED: Self = Self { is_stated: true };
}

impl<'de> Deserialize<'de> for RetiredBank {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        IgnoredAny::deserialize(deserializer).map(|_| Self::STATED)
    }
}
