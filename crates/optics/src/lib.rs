//! Glass, lenses and lens files, first-order theory, and exact rays traced through them.
//!
//! Lengths are millimetres, wavelengths nanometres, angles radians. In the lens frame +z is the way light travels
//! and the origin is the vertex of the first surface; a radius is positive when the center of curvature lies at +z,
//! and the index after a surface is that of the medium behind it. A film lies `film_distance_mm` behind the last vertex.
//!
//! This crate knows nothing of diffraction, images or files of pixels. It offers one hook, at the stop: trace to it,
//! bend the rays, and trace on ([`MonoLens::trace_surfaces`]).
#![doc = include_str!("../README.md")]

mod air;
pub mod analysis;
mod aperture;
mod beam;
mod bundle;
mod coating;
mod diffractive;
mod error;
mod exit_pupil;
mod extinction;
mod eye;
mod f_number;
mod film_cone;
mod film_site;
mod formats;
mod frame;
mod ghosts;
mod glass;
mod layout;
mod lens;
mod library;
mod mirror_shadows;
mod mono;
mod paraxial;
mod placement;
mod pupil;
pub mod quadrature;
mod rays;
mod rays_f32;
mod reversed;
mod seidel;
mod shares;
mod stop_edges;
mod surface;
mod toric;
mod trace;
mod transmission;
mod wavefront_error;
pub mod zernike;

pub use air::Air;
pub use aperture::{Aperture, Iris, IrisOpening, Outline};
pub use beam::{Beam, rays_over_front};
pub use bundle::{ObjectPoint, rays_towards};
pub use coating::{Amplitudes, COATING_CENTER_NM, Coating, CoatingLayer, Film, MGF2_INDEX, ReflectanceTable, Shares};
pub use diffractive::{Blaze, DiffractiveSurface, PhaseProfile};
pub use error::OpticsError;
pub use exit_pupil::{ExitPupilBounds, PupilReach, PupilSample};
pub use extinction::Absorption;
pub use eye::{EyeModel, SchematicEye};
pub use film_cone::FilmCone;
pub use film_site::FilmSite;
pub use formats::{
    Configuration, Field, LensFile, Microlens, MissingGlass, REFERENCE_WAVELENGTH_NM, ReadOptions, SeqNumbers,
    nearest_to_reference_nm,
};
pub use frame::{FilmPoint, StopPoint};
pub use ghosts::{
    FilmGhosts, Ghost, GhostBeam, GhostBeams, GhostLight, GhostRay, GhostRequest, Ghosts, LightAccount, MOST_BOUNCES,
    MirrorFilm,
};
pub use glam;
pub use glass::{C_LINE_NM, CatalogueGlass, D_LINE_NM, ExtendedIndex, F_LINE_NM, Glass, GlassCatalogue, GlassRange};
pub use layout::{Layout, wavelength_color};
pub use lens::{ImageSurface, Lens, SurfaceChange};
pub use library::IdealLens;
pub use mirror_shadows::MirrorShadow;
pub use mono::{AxialBeam, MonoLens};
pub use paraxial::{Conjugate, FirstOrder};
pub use placement::{CoordinateBreak, Placement};
pub use pupil::{PupilBoundary, PupilPlane, PupilRegion};
pub use rays::{Losses, RayBatch, RayFate, SurfaceLosses};
pub use rays_f32::RayBatchF32;
pub use reversed::ReversedLens;
pub use seidel::{Seidel, SeidelSettings, SeidelSums};
pub use stop_edges::{EdgeNearby, EdgePiece, StopEdges};
pub use surface::{Interface, Shape, Surface};
pub use trace::Vignetting;
pub use transmission::{RayLight, RayLightF32};
pub use wavefront_error::{WavefrontBand, WavefrontError, ZernikeTerms};
