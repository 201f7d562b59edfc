//! How far to the sides light comes from that reaches the film, and how finely the film sees it.

use std::f64::consts::TAU;

use dioptric_forward::Film;
use dioptric_optics::{MonoLens, ObjectPoint, Vignetting, glam::DVec2, rays_towards};

/// How far things are, dioptres from the entrance pupil: nearer than anything of the still life in its usual picture (.74 m), and infinitely far. The table at the lower
/// border of wider frames is nearer; the pupil of a lens that sees it is small beside its distance.
const DIOPTRES: [f64; 2] = [2.0, 0.0];

/// Points of the border of a view between its middle and a corner.
const ALONG: i32 = 4;

/// Radii of the rings of the pupil that rays go through, as parts of its own: the outermost gets through where nothing but the stop limits the light.
const RINGS: [f64; 3] = [0.98, 0.8, 0.5];

/// Rays through each ring.
const N_RING: usize = 8;

/// By how much farther than the edge of the film light of the border must land, as a share of the film: for other wavelengths and for diffraction.
const MARGIN: f64 = 0.01;

/// By how much finer than the view the film may see: focused near, it sees less of the view on as many samples.
const FINER: f64 = 0.95;

/// A film behind a lens.
#[derive(Clone, Copy)]
pub(super) struct FilmReach<'a> {
    pub(super) lens: &'a MonoLens,
    pub(super) film_distance_mm: f64,
    pub(super) film: &'a Film,
}

impl FilmReach<'_> {
    /// Returns the tangents that half the film, to the right and up, subtends by first order where it is focused at infinity: it sees no more focused
    /// nearer.
    pub(super) fn half_size_tan(&self) -> [f64; 2] {
        let focal_length_mm = self.lens.first_order().efl_mm.abs();
        let scale_mm = match focal_length_mm.is_finite() {
            true => focal_length_mm,
            false => self.lens.film_scale_mm(self.film_distance_mm).abs(),
        };
        [self.film.columns, self.film.rows].map(|n| 0.5e-3 * self.film.pitch_um * n as f64 / scale_mm)
    }

    /// Whether all that reaches the film comes from within a view of this half size (tangents to the right and up), however far it is, and a sample of the
    /// film sees no less than this pitch (a tangent).
    ///
    /// Rays from all around the border of the view, near and far, through the middle and rings of the entrance pupil must land beyond the edges
    /// of the film. Of a lens without an axis, whose pupil lies elsewhere, nothing is known.
    pub(super) fn is_within(&self, half_size: [f64; 2], pitch_tan: f64) -> bool {
        let Self { lens, film_distance_mm, film } = *self;
        let film_pitch_tan = 1e-3 * film.pitch_um / lens.film_scale_mm(film_distance_mm).abs();
        let is_coarse = film_pitch_tan >= FINER * pitch_tan;
        let edge_mm = 0.5e-3 * film.pitch_um * DVec2::new(film.columns as f64, film.rows as f64) * (1.0 + MARGIN);
        let is_beyond = |field_tan: DVec2| {
            DIOPTRES
                .iter()
                .all(|&dioptres| self.lands_beyond(&ObjectPoint::from_field(lens, field_tan, dioptres), edge_mm))
        };
        lens.is_rotational() && is_coarse && border(DVec2::from_array(half_size)).all(is_beyond)
    }

    /// Whether the light of a point that gets through the lens lands to one side of a film; `false` where the middle of it does not get through at all.
    fn lands_beyond(&self, point: &ObjectPoint, edge_mm: DVec2) -> bool {
        let Self { lens, film_distance_mm, .. } = *self;
        let radius_mm = 0.5 * lens.first_order().entrance_pupil_diameter_mm;
        let ring = |part: f64| (0..N_RING).map(move |i| part * DVec2::from_angle(TAU * i as f64 / N_RING as f64));
        let rings = RINGS.into_iter().flat_map(ring).map(|place| radius_mm * place);
        let targets_mm: Vec<DVec2> = std::iter::once(DVec2::ZERO).chain(rings).collect();
        let landed = |targets_mm: &[DVec2], rims| -> Vec<DVec2> {
            let mut rays = rays_towards(point, targets_mm, lens.projection_center_z_mm(), 0.0);
            lens.trace(&mut rays, rims);
            lens.to_film(&mut rays, film_distance_mm);
            let in_flight = (0..targets_mm.len()).filter(|&i| rays.fate[i].is_in_flight());
            in_flight.map(|i| lens.film_point(rays.point_mm(i), film_distance_mm).mm).collect()
        };
        // The middle counts where it is vignetted too, as what other light lands around.
        let middle = landed(&targets_mm[..1], Vignetting::Off);
        if middle.is_empty() {
            return false;
        }
        let landed = [middle, landed(&targets_mm[1..], Vignetting::On)].concat();
        let all = |is_beyond: &dyn Fn(DVec2) -> bool| landed.iter().all(|&at_mm| is_beyond(at_mm));
        // On one side of it: light on either side of a film may lie on it as well.
        all(&|at_mm| at_mm.x > edge_mm.x)
            || all(&|at_mm| at_mm.x < -edge_mm.x)
            || all(&|at_mm| at_mm.y > edge_mm.y)
            || all(&|at_mm| at_mm.y < -edge_mm.y)
    }
}

/// Returns points all around the border of a rectangle.
fn border(half_size: DVec2) -> impl Iterator<Item = DVec2> {
    let parts = (-ALONG..=ALONG).map(|i| f64::from(i) / f64::from(ALONG));
    parts.flat_map(move |part| {
        [DVec2::new(part, 1.0), DVec2::new(part, -1.0), DVec2::new(1.0, part), DVec2::new(-1.0, part)]
            .map(|place| place * half_size)
    })
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{CoordinateBreak, Lens};

    use super::*;

    fn lens(name: &str, f_number: f64) -> MonoLens {
        Lens::built_in(name).unwrap().with_f_number(f_number, 550.0).unwrap().at(550.0).unwrap()
    }

    /// The narrowest view of a film's shape that holds all that it sees, as a tangent.
    fn narrowest(lens: &MonoLens, film_distance_mm: f64, film: &Film) -> f64 {
        let shape = film.rows as f64 / film.columns as f64;
        let reach = FilmReach { lens, film_distance_mm, film };
        let holds = |tan: f64| reach.is_within([tan, shape * tan], 0.0);
        let (mut narrow, mut wide) = (0.0, 0.45);
        assert!(holds(wide));
        while wide - narrow > 1e-6 {
            let tan = 0.5 * (narrow + wide);
            *(if holds(tan) { &mut wide } else { &mut narrow }) = tan;
        }
        wide
    }

    #[test]
    fn a_pinhole_sees_what_its_film_subtends() {
        let hole = Lens::pinhole(1e-6).unwrap().at(550.0).unwrap();
        let film = Film::centered(200, 300, 100.0);
        let tan = narrowest(&hole, 50.0, &film);
        assert!((tan / (0.3 * (1.0 + MARGIN)) - 1.0).abs() < 1e-5, "{tan}");
        let reach = FilmReach { lens: &hole, film_distance_mm: 50.0, film: &film };
        assert_eq!(reach.half_size_tan(), [0.3, 0.2]);
        let is_fine = |pitch_tan| reach.is_within([0.4, 0.3], pitch_tan);
        assert!(is_fine(0.0021) && !is_fine(0.0022));
    }

    #[test]
    fn blur_of_what_is_near_or_far_reaches_the_film_from_farther_out() {
        let film = Film::centered(640, 960, 33.0);
        for f_number in [16.0, 8.0, 4.0, 2.0] {
            let lens = lens("dgauss-50mm", f_number);
            let film_distance_mm = lens.film_distance_mm_for(960.0).unwrap();
            let tan = narrowest(&lens, film_distance_mm, &film);
            let first = lens.first_order();
            let in_focus_dioptres = 1e3 / 960.0;
            // By first order: that of the film's edge, and of the blur at it. Distortion and the pupil's aberrations are a few hundredths of them.
            let blur = 0.5e-3 * first.entrance_pupil_diameter_mm * in_focus_dioptres;
            let paraxial = 15.84 * (1.0 + MARGIN) / lens.film_scale_mm(film_distance_mm).abs() + blur;
            println!("f/{f_number}: {tan:.4}, {paraxial:.4} by first order");
            assert!((tan / paraxial - 1.0).abs() < 0.02, "f/{f_number}: {tan}, {paraxial}");
        }
    }

    #[test]
    fn nothing_is_known_of_a_lens_without_an_axis() {
        let film = Film::centered(64, 96, 33.0);
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let aside = CoordinateBreak {
            surfaces: (0, lens.interfaces().len() - 1),
            pivot_mm: 0.0,
            decenter_mm: [1.0, 0.0, 0.0],
            tilt_deg: [0.0; 3],
            tilt_first: false,
        };
        let moved = lens.clone().with_moves(vec![aside]).unwrap();
        let is_within = |lens: &Lens| {
            let reach = FilmReach { lens: &lens.at(550.0).unwrap(), film_distance_mm: 40.0, film: &film };
            reach.is_within([0.4, 0.3], 0.0)
        };
        assert!(is_within(&lens) && !is_within(&moved));
    }
}
