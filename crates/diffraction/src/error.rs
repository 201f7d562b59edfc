//! What can keep a point spread function from being computed.

/// A wave-optical point spread function or wavefront that cannot be had.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DiffractionError {
    /// No light of the point reaches the film.
    #[error("no light of the object point gets through the lens at {wavelength_nm} nm")]
    NoLight {
        /// Wavelength, nm.
        wavelength_nm: f64,
    },
    /// Rays within the pupil that do not come through.
    #[error("{n_lost} of {n_rays} rays within the pupil at {wavelength_nm} nm are lost on the way to the film")]
    LostRays {
        /// Wavelength, nm.
        wavelength_nm: f64,
        /// How many were lost.
        n_lost: usize,
        /// How many were sent.
        n_rays: usize,
    },
    /// A pupil whose rays do not fill the directions one to one, so that it has no angular spectrum.
    #[error("the rays at {wavelength_nm} nm share their directions behind the lens: a plane-wave sum has no weights")]
    Folded {
        /// Wavelength, nm.
        wavelength_nm: f64,
    },
    /// Fewer nodes than the pupil needs.
    #[error(
        "{n_radii} x {n_azimuths} nodes are too few for a phase range of B = {bandwidth:.1}: needs at least \
         {needed_radii} x {needed_azimuths}"
    )]
    TooFewNodes {
        /// Nodes along a radius, as given.
        n_radii: usize,
        /// Azimuths, as given.
        n_azimuths: usize,
        /// Radians of phase over the pupil's radius.
        bandwidth: f64,
        /// Nodes along a radius that are needed.
        needed_radii: usize,
        /// Azimuths that are needed.
        needed_azimuths: usize,
    },
    /// A blur or window so large that a wave sum is out of reach.
    #[error("a phase range of B = {bandwidth:.0} is beyond the wave sum, which goes to {limit}")]
    TooBlurred {
        /// Radians of phase over the pupil's radius.
        bandwidth: f64,
        /// The largest that is accepted.
        limit: f64,
    },
    /// A window or a setting that makes no sense.
    #[error("{what} is {found}, expected {expected}")]
    Setting {
        /// Which setting.
        what: &'static str,
        /// What was given.
        found: f64,
        /// What is expected.
        expected: &'static str,
    },
    /// Spectral weights that do not add up to anything.
    #[error("a polychromatic sum needs at least one weight above 0 and none below")]
    Weights,
    /// A lens that cannot be used at a wavelength.
    #[error(transparent)]
    Optics(#[from] dioptric_optics::OpticsError),
}
