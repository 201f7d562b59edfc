//! Shadows of mirrors that stand in the light before it comes to them.

use crate::{Aperture, DiffractiveSurface, Interface, Lens, OpticsError, Outline, Surface};

/// A mirror that stands in the light on its way to an earlier surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MirrorShadow {
    /// The mirror, counted from 0.
    pub mirror: usize,
    /// The surface that the light comes to.
    pub before: usize,
}

impl Lens {
    /// Returns which mirrors stand with their backs in the light before it comes to them, as the secondary mirror of a
    /// telescope does: a sequential trace does not stop that light by itself. Of a lens with moved surfaces none are found.
    pub fn mirror_shadows(&self) -> Vec<MirrorShadow> {
        if !self.moves().is_empty() {
            return Vec::new();
        }
        let z_mm = self.vertices_z_mm();
        let stands_before = |mirror: usize, before: usize| {
            let way = if self.is_backward_before(before) { -1.0 } else { 1.0 };
            let from_mm = before.checked_sub(1).map_or(f64::NEG_INFINITY, |i| way * z_mm[i]);
            from_mm < way * z_mm[mirror] && way * z_mm[mirror] < way * z_mm[before]
        };
        let of_mirror = |&mirror: &usize| {
            let before = (0..mirror).filter(move |&before| stands_before(mirror, before));
            before.map(move |before| MirrorShadow { mirror, before }).collect::<Vec<_>>()
        };
        self.mirrors().iter().flat_map(of_mirror).collect()
    }

    /// Returns the lens with a plane in each of the [shadows of its mirrors](Self::mirror_shadows), which stops the light
    /// that falls within the mirror's rim. A plane before the first surface becomes the first, at the origin of the lens frame.
    ///
    /// # Errors
    /// When the lens is tilted or decentered: then shadows are not found.
    pub fn with_mirror_shadows(&self) -> Result<Self, OpticsError> {
        if !self.moves().is_empty() {
            return Err(OpticsError::NotRotational {
                lens: self.name().to_owned(),
                task: "finding shadows of mirrors",
            });
        }
        let (z_mm, interfaces) = (self.vertices_z_mm(), self.interfaces());
        let widest_mm = interfaces.iter().map(|interface| interface.surface.semi_aperture_mm).fold(0.0, f64::max);
        let mut places: Vec<Place> = (0..interfaces.len()).map(Place::Surface).collect();
        for shadow in self.mirror_shadows() {
            // In the order that light passes them.
            let way = if self.is_backward_before(shadow.before) { -1.0 } else { 1.0 };
            let is_passed_later = |place: &Place| match *place {
                Place::Surface(surface) => surface >= shadow.before,
                Place::Shadow(other) => {
                    other.before == shadow.before && way * z_mm[other.mirror] > way * z_mm[shadow.mirror]
                }
            };
            let at = places.iter().position(is_passed_later).unwrap_or(places.len());
            places.insert(at, Place::Shadow(shadow));
        }
        let z_of = |place: &Place| match *place {
            Place::Surface(surface) => z_mm[surface],
            Place::Shadow(shadow) => z_mm[shadow.mirror],
        };
        let row = |(i, place): (usize, &Place)| {
            let thickness_after_mm = places.get(i + 1).map_or(0.0, |next| z_of(next) - z_of(place));
            match *place {
                Place::Surface(surface) => Interface { thickness_after_mm, ..interfaces[surface].clone() },
                Place::Shadow(MirrorShadow { before, .. }) => {
                    let medium = before.checked_sub(1).map_or(self.object_medium(), |i| &interfaces[i].medium_after);
                    let surface = Surface::plane(2.0 * widest_mm);
                    Interface { surface, medium_after: medium.clone(), thickness_after_mm }
                }
            }
        };
        let now = |surface: usize| places.iter().position(|place| *place == Place::Surface(surface)).unwrap_or(surface);
        let mut apertures: Vec<Aperture> = self
            .apertures()
            .iter()
            .map(|aperture| Aperture { surface: now(aperture.surface), ..aperture.clone() })
            .collect();
        apertures.extend(places.iter().enumerate().filter_map(|(surface, place)| {
            let Place::Shadow(MirrorShadow { mirror, .. }) = *place else { return None };
            let outline = Outline::Circle { radius_mm: interfaces[mirror].surface.semi_aperture_mm };
            Some(Aperture { surface, outline, center_mm: [0.0; 2], is_obscuration: true })
        }));
        let rows = places.iter().enumerate().map(row).collect();
        let lens =
            Self::new_with_apertures(self.name(), self.source(), rows, now(self.stop()), apertures)?.with_stop_of(self);
        let phase = |phase: &DiffractiveSurface| DiffractiveSurface { surface: now(phase.surface), ..phase.clone() };
        let coatings = self.coatings().iter().map(|(surface, coating)| (now(*surface), coating.clone())).collect();
        let lens = lens.with_coatings(coatings)?.with_light_loss(self.other_coating().cloned())?;
        let lens = lens.with_object_medium(self.object_medium().clone())?;
        let lens = lens.with_diffractive(self.diffractive().iter().map(phase).collect())?;
        lens.with_mirrors(self.mirrors().iter().map(|&mirror| now(mirror)))?
            .with_glass_range(self.glass_range())
            .with_image_surface(self.image_surface())
    }
}

/// What light passes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Surface(usize),
    Shadow(MirrorShadow),
}
