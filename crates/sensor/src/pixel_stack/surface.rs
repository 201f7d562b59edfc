//! What the top of a pixel does to the direction of light.

/// A part of the top of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Surface {
    /// A plane, so far below the top.
    Flat { sag_um: f64 },
    /// A thin lens that keeps the sine condition.
    Thin { power_per_um: f64 },
    /// A sphere whose vertex is the top, of a body of this index.
    Sphere { radius_um: f64, index: f64 },
}

/// Light behind a surface, and how it changes along each axis by the place and the direction along that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bent {
    /// Index times direction.
    pub(super) cosines: [f64; 2],
    pub(super) by_place_per_um: [f64; 2],
    pub(super) by_cosine: [f64; 2],
    /// How far below the top the surface is, and its slope.
    pub(super) sag_um: f64,
    pub(super) sag_slope: [f64; 2],
    /// The light on the surface over that on an even opening.
    pub(super) caught: f64,
}

impl Surface {
    /// Returns the same where the lens is left out: flat as its rim.
    pub(super) fn flat_at(self, half_um: f64) -> Self {
        match self {
            Self::Sphere { radius_um, .. } => Self::Flat { sag_um: sag_um(radius_um, half_um) },
            Self::Thin { .. } | Self::Flat { .. } => Self::Flat { sag_um: 0.0 },
        }
    }

    /// Returns the light of these direction cosines in air behind a place of the surface; `None` where that faces away from it.
    pub(super) fn bend(self, place_um: [f64; 2], cosines: [f64; 2]) -> Option<Bent> {
        let plane = Bent {
            cosines,
            by_place_per_um: [0.0; 2],
            by_cosine: [1.0; 2],
            sag_um: 0.0,
            sag_slope: [0.0; 2],
            caught: 1.0,
        };
        match self {
            Self::Flat { sag_um } => Some(Bent { sag_um, ..plane }),
            Self::Thin { power_per_um } => Some(Bent {
                cosines: [0, 1].map(|i| cosines[i] - power_per_um * place_um[i]),
                by_place_per_um: [-power_per_um; 2],
                ..plane
            }),
            Self::Sphere { radius_um, index } => sphere(radius_um, index, place_um, cosines),
        }
    }
}

/// Returns how far a sphere falls off at a distance from its vertex.
pub(super) fn sag_um(radius_um: f64, from_vertex_um: f64) -> f64 {
    radius_um - (radius_um * radius_um - from_vertex_um * from_vertex_um).max(0.0).sqrt()
}

/// Snell's law in the form n s′ = s + Γ N with Γ = n cos θ′ − cos θ, and its derivatives (eq. 2).
fn sphere(radius_um: f64, index: f64, place_um: [f64; 2], cosines: [f64; 2]) -> Option<Bent> {
    let root_um = (radius_um * radius_um - place_um[0] * place_um[0] - place_um[1] * place_um[1]).sqrt();
    let down = (1.0 - cosines[0] * cosines[0] - cosines[1] * cosines[1]).sqrt();
    let incident = (root_um * down - place_um[0] * cosines[0] - place_um[1] * cosines[1]) / radius_um;
    if incident.is_nan() || incident <= 0.0 {
        return None;
    }
    let refracted = (index * index - 1.0 + incident * incident).sqrt();
    let (along_normal, per_incident) = (refracted - incident, incident / refracted - 1.0);
    let by = |i: usize, incident_by: f64| per_incident * incident_by * place_um[i] / radius_um;
    Some(Bent {
        cosines: [0, 1].map(|i| cosines[i] - along_normal * place_um[i] / radius_um),
        by_place_per_um: [0, 1].map(|i| {
            let incident_by = -(cosines[i] + place_um[i] * down / root_um) / radius_um;
            -along_normal / radius_um - by(i, incident_by)
        }),
        by_cosine: [0, 1].map(|i| 1.0 - by(i, -(place_um[i] + root_um * cosines[i] / down) / radius_um)),
        sag_um: radius_um - root_um,
        sag_slope: place_um.map(|um| um / root_um),
        caught: incident * radius_um / (root_um * down),
    })
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn derivatives_are_those_of_differences() {
        let lens = Surface::Sphere { radius_um: 2.0, index: 1.6 };
        let (place_um, cosines, step) = ([0.7, -0.4], [0.3, 0.2], 1e-6);
        let at = lens.bend(place_um, cosines).unwrap();
        for i in 0..2 {
            let (mut beside_um, mut turned) = (place_um, cosines);
            beside_um[i] += step;
            turned[i] += step;
            let (beside, turned) = (lens.bend(beside_um, cosines).unwrap(), lens.bend(place_um, turned).unwrap());
            let by = |moved: f64, at: f64| (moved - at) / step;
            assert_relative_eq!(by(beside.cosines[i], at.cosines[i]), at.by_place_per_um[i], max_relative = 1e-4);
            assert_relative_eq!(by(turned.cosines[i], at.cosines[i]), at.by_cosine[i], max_relative = 1e-4);
            assert_relative_eq!(by(beside.sag_um, at.sag_um), at.sag_slope[i], max_relative = 1e-4);
        }
        // Behind a sphere a direction is one still, index times longer.
        assert!(at.cosines[0].hypot(at.cosines[1]) < 1.6);
    }

    #[test]
    fn a_sphere_is_a_lens_of_its_power_near_the_axis() {
        let bent = Surface::Sphere { radius_um: 2.0, index: 1.6 }.bend([1e-4, 0.0], [0.0; 2]).unwrap();
        assert_relative_eq!(bent.cosines[0], -0.3e-4, max_relative = 1e-6);
        // Axial light at the edge is refracted towards the axis by Snell's law.
        let bent = Surface::Sphere { radius_um: 2.0, index: 1.6 }.bend([1.2, 0.0], [0.0; 2]).unwrap();
        let (incident, refracted) = (0.6_f64.asin(), (0.6_f64 / 1.6).asin());
        assert_relative_eq!(bent.cosines[0], -1.6 * (incident - refracted).sin(), max_relative = 1e-12);
        assert_relative_eq!(bent.sag_um, 0.4, max_relative = 1e-12);
    }
}
