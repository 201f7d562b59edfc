//! What a file can show in place of what it shows.

/// Animations and variants of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// Its animations, in the order in which they are counted from 1.
    pub animations: Vec<Animation>,
    /// Its variants of materials.
    pub variants: Vec<String>,
}

/// How things of a file move.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Its name, or its number where the file gives none.
    pub name: String,
    /// When it ends, s.
    pub end_s: f64,
}

impl Choices {
    /// Returns the place of an animation in the list, by its name or its number from 1.
    pub(crate) fn animation(&self, name: &str) -> Option<usize> {
        let number = || name.parse::<usize>().ok()?.checked_sub(1).filter(|n| *n < self.animations.len());
        self.animations.iter().position(|animation| animation.name == name).or_else(number)
    }
}
