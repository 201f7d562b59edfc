//! A uniform wall alone, and in a scene of several depths.

use dioptric_forward::{Film, PsfDomain, Settings, Source, render};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, FieldSampling, LensImageModel};
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

use crate::plane::WAVELENGTH_NM;

/// Farthest and nearest depth, dioptres.
const DEPTHS: (f64, f64) = (0.25, 1.35);

/// A wall before a lens.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    pub(crate) lens: &'static str,
    pub(crate) f_number: f64,
    /// From the first vertex.
    pub(crate) focus_mm: f64,
    pub(crate) dioptres: f64,
    /// Of the film.
    pub(crate) pitch_um: f64,
    pub(crate) center_mm: DVec2,
}

impl Wall {
    /// Returns by how much brighter the wall is, at the place of a strip of film where the difference is largest, once the scene's outermost rows lie at other depths.
    pub(crate) fn error_among_layers(&self) -> f32 {
        const N: usize = 400;
        let Self { lens, f_number, focus_mm, dioptres, pitch_um, center_mm } = *self;
        let lens = Lens::built_in(lens).unwrap().with_f_number(f_number, WAVELENGTH_NM).unwrap();
        let film = Film { center_mm, ..Film::centered(24, 362, pitch_um) };
        let grid = WavelengthGrid::new(vec![WAVELENGTH_NM]).unwrap();
        let domain = PsfDomain {
            lens: &lens,
            film: &film,
            film_distance_mm: lens.at(WAVELENGTH_NM).unwrap().film_distance_mm_for(focus_mm).unwrap(),
            depth_range_m: (1.0 / DEPTHS.1, 1.0 / DEPTHS.0),
            grid: &grid,
            diffraction: Diffraction::None,
        };
        let settings = domain.settings().unwrap();
        let bank = LensImageModel::build(&lens, &settings).unwrap();
        let FieldSampling::Radial(tans) = &settings.fields else {
            panic!("a lens with an axis has fields along a radius")
        };
        let middle = 0.5 * (N as f64 - 1.0);
        let view = View { focal_px: middle / tans[tans.len() - 1], center_x_px: middle, center_y_px: middle };
        let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), vec![Array2::ones((N, N))]).unwrap();
        let picture = |dioptres_of_row: &dyn Fn(usize) -> f64| {
            let depth = Array2::from_shape_fn((N, N), |(row, _)| (1.0 / dioptres_of_row(row)) as f32);
            let depth = DepthMap::new(depth).unwrap();
            let source = Source { radiance: &radiance, depth: &depth, view, occluded: None };
            let mut pictures = vec![];
            render(&source, &bank, &film, &Settings::default(), &|_| {}, &mut |_, picture| {
                pictures.push(picture);
                Ok(())
            })
            .unwrap();
            pictures.remove(0)
        };
        let alone = picture(&|_| dioptres);
        let among = picture(&|row| match row {
            0..3 => DEPTHS.1,
            row if row >= N - 3 => DEPTHS.0,
            _ => dioptres,
        });
        let errors = among.iter().zip(&alone).map(|(among, alone)| among / alone - 1.0);
        errors.fold(0.0, |worst: f32, error| if error.abs() > worst.abs() { error } else { worst })
    }
}
