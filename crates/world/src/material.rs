//! What surfaces are made of.

use crate::TextureId;

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// The ideal diffuse reflector (Lambert), from both sides.
    Matte {
        /// Reflectance, 0–1.
        reflectance: TextureId,
    },
}
