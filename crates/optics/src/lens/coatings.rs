//! What covers the surfaces of a lens.

use super::Lens;
use crate::{Coating, OpticsError};

impl Lens {
    /// Returns the lens with these coatings of surfaces, counted from 0, and no others stated.
    ///
    /// Light is lost at them only where [`with_light_loss`](Self::with_light_loss) says that it is lost.
    ///
    /// # Errors
    /// When a surface is not there, is named twice or is an ideal lens, a coating makes no sense, or it is that of a mirror and the surface is
    /// none.
    pub fn with_coatings(mut self, mut coatings: Vec<(usize, Coating)>) -> Result<Self, OpticsError> {
        coatings.sort_by_key(|(surface, _)| *surface);
        let n_surfaces = self.interfaces.len();
        for (i, (surface, coating)) in coatings.iter().enumerate() {
            let wrong = |reason: String| Err(OpticsError::Coating { reason });
            if *surface >= n_surfaces {
                return wrong(format!("a coating is of surface {surface}, expected 0 to {}", n_surfaces - 1));
            }
            if i > 0 && coatings[i - 1].0 == *surface {
                return wrong(format!("surface {surface} has two coatings"));
            }
            let of_surface =
                |error: OpticsError| OpticsError::Coating { reason: format!("surface {surface}: {error}") };
            coating.check().map_err(of_surface)?;
        }
        self.coatings = coatings;
        Ok(self)
    }

    /// Returns the lens as light passes it that is lost at its surfaces and in its glass: `other` covers those surfaces between air and
    /// another medium of which no coating is stated; those between two glasses reflect by Fresnel's equations, mirrors everything. With
    /// `None` no light is lost at all, whatever is stated: as lenses are made.
    ///
    /// # Errors
    /// When the coating makes no sense.
    pub fn with_light_loss(mut self, other: Option<Coating>) -> Result<Self, OpticsError> {
        if let Some(coating) = &other {
            coating.check()?;
        }
        self.other_coating = other;
        Ok(self)
    }

    /// The coatings that are stated, by surfaces.
    pub fn coatings(&self) -> &[(usize, Coating)] {
        &self.coatings
    }

    /// What covers the other surfaces between air and a denser medium; `None` where no light is lost.
    pub fn other_coating(&self) -> Option<&Coating> {
        self.other_coating.as_ref()
    }

    /// Whether no light is lost, at surfaces or in glass.
    pub fn is_lossless(&self) -> bool {
        self.other_coating.is_none()
    }

    /// Returns what covers a surface between media of these indices.
    pub(crate) fn coating_of(&self, surface: usize, indices: [f64; 2]) -> &Coating {
        let Some(other) = &self.other_coating else { return &Coating::Ideal };
        if let Some((_, coating)) = self.coatings.iter().find(|(stated, _)| *stated == surface) {
            return coating;
        }
        let [is_air_before, is_air_after] = indices.map(|index| index < DENSEST_AIR);
        match (self.is_mirror(surface), is_air_before != is_air_after) {
            (true, _) => &Coating::Ideal,
            (false, true) => other,
            (false, false) if *other == Coating::Ideal => other,
            (false, false) => &Coating::Bare,
        }
    }
}

/// The index below which a medium counts as air, or as nothing.
const DENSEST_AIR: f64 = 1.05;
