//! First-order optics of a lens at one wavelength: pupils, f-numbers, images.

use glam::{DVec2, DVec3};

use crate::{
    AxialBeam, Conjugate, FirstOrder, MonoLens, OpticsError, RayBatch, Vignetting,
    paraxial::{self, MarginalRay, Matrix},
    trace::{Kind, Step},
};

/// How far an entrance pupil may be for counting from its center, over the first rim's radius: then counts are good to
/// 1e-12 of the rim.
const FARTHEST_PUPIL: f64 = 1e4;

/// By which share of its length the way along a bent axis may differ from the distances between vertices, as it does by small tilts.
const SAME_WAY: f64 = 0.01;

impl MonoLens {
    /// Focal lengths, principal planes and pupils.
    ///
    /// Of a lens that is not rotationally symmetric they are those of its axis with all surfaces put back on it (a bent
    /// axis made straight), in the y–z plane; [`first_order_x`](Self::first_order_x) gives those of the x–z plane. A
    /// tilted or decentered lens forms its image by them only as far as its tilts are small.
    ///
    /// Where a rim ends the light of a far point on the axis before the stop does ([`limiting_beam`](Self::limiting_beam)),
    /// the diameters of the pupils and the f-number are those of the real beam that gets through; the pupils stay where the
    /// images of the stop are.
    pub fn first_order(&self) -> FirstOrder {
        match self.limiting_beam() {
            Some(beam) => self.first_order.with_entrance_pupil_diameter_mm(2.0 * beam.height_mm),
            None => self.first_order_of_light(),
        }
    }

    /// That of the stop; of a pupil infinitely far, of which no width says how much light of a far point gets through, with the f-number
    /// of its rays.
    fn first_order_of_light(&self) -> FirstOrder {
        match self.first_order.f_number == 0.0 {
            true => FirstOrder { f_number: self.real_f_number().unwrap_or(f64::NAN), ..self.first_order },
            false => self.first_order,
        }
    }

    /// The same, with the diameters of the pupils and the f-number of a beam from the point on the axis at this distance before the first
    /// vertex, mm (infinite for a far one): where a rim limits its light and not the stop, it is wider or narrower than that of a
    /// far point.
    pub fn first_order_for(&self, object_distance_mm: f64) -> FirstOrder {
        if object_distance_mm.is_infinite() {
            return self.first_order();
        }
        let Some(beam) = self.limiting_beam_for(object_distance_mm) else { return self.first_order_of_light() };
        let way_mm = object_distance_mm + self.first_order.entrance_pupil_z_mm;
        let diameter_mm = 2.0 * (beam.slope_before * way_mm).abs();
        if diameter_mm.is_finite() {
            self.first_order.with_entrance_pupil_diameter_mm(diameter_mm)
        } else {
            self.first_order_of_light()
        }
    }

    /// The same for a beam that fills the stop, whether it gets through or not.
    pub fn first_order_of_stop(&self) -> FirstOrder {
        self.first_order
    }

    /// The real beam of a far point on the axis, if a rim limits it and not the stop; `None` as a rule.
    ///
    /// Some lens files state a stop that is wider than what their rims let through.
    pub fn limiting_beam(&self) -> Option<AxialBeam> {
        if !self.has_far_pupil() {
            return None;
        }
        let beam = self.far_beam.get_or_init(|| self.axial_beam(f64::INFINITY));
        beam.filter(|beam| !beam.is_limited_by_stop)
    }

    /// The same of the point at this distance before the first vertex, mm; infinite for a far one.
    pub fn limiting_beam_for(&self, object_distance_mm: f64) -> Option<AxialBeam> {
        match object_distance_mm.is_infinite() {
            true => self.limiting_beam(),
            false => self.axial_beam(object_distance_mm).filter(|beam| !beam.is_limited_by_stop),
        }
    }

    /// Whether the light of a far point on the axis that fills the stop has a width before the lens.
    fn has_far_pupil(&self) -> bool {
        self.first_order.entrance_pupil_diameter_mm.is_finite()
    }

    /// Returns a sentence on what limits the light of the point on the axis at this distance before the first vertex, mm (infinite
    /// for a far one), if it is not the stop.
    pub fn note_on_limit(&self, object_distance_mm: f64) -> Option<String> {
        let is_far = object_distance_mm.is_infinite();
        let beam = self.limiting_beam_for(object_distance_mm)?;
        let (surface, rim_mm) = (beam.limiting_surface, 2.0 * self.semi_aperture_mm(beam.limiting_surface));
        let limit = match beam.is_limited_by_opening {
            true => format!("an opening of surface {surface}"),
            false => format!("the rim of surface {surface}, {rim_mm:.4} mm across"),
        };
        let stop = if surface == self.stop { "not by the round rim of the stop" } else { "not by the stop" };
        let (filled_mm, stop_mm) = (2.0 * beam.stop_radius_mm, 2.0 * self.stop_semi_aperture_mm());
        let (point, f_numbers) = match is_far {
            true => {
                let (real, of_stop) = (self.first_order(), self.first_order);
                let limits = match real.power_per_mm == 0.0 {
                    true => format!(
                        ": a beam of {:.4} mm, where the stop alone has {:.4} mm",
                        real.entrance_pupil_diameter_mm, of_stop.entrance_pupil_diameter_mm
                    ),
                    false => format!(": f/{:.3}, where the stop alone has f/{:.3}", real.f_number, of_stop.f_number),
                };
                ("far away".to_owned(), limits)
            }
            false => (format!("{object_distance_mm} mm before the lens"), String::new()),
        };
        Some(format!(
            "light from the axis {point} is limited by {limit}, {stop}, of which it fills {filled_mm:.4} of \
             {stop_mm:.4} mm{f_numbers}"
        ))
    }

    /// Returns a sentence on a lens whose bent axis is longer or shorter than its surfaces stand apart, so that its first-order data, which
    /// are those of the distances between vertices, are not those along the axis; `None` as a rule.
    pub fn note_on_bent_axis(&self) -> Option<String> {
        if self.is_centered() {
            return None;
        }
        let mut axis = RayBatch::with_capacity(1);
        axis.push(-DVec3::Z, DVec3::Z, 0.0);
        let (mut points_mm, mut along_mm) = (Vec::new(), 0.0);
        for surface in 0..self.n_surfaces() {
            self.trace_surfaces(surface..surface + 1, &mut axis, Vignetting::Off);
            if !axis.fate[0].is_in_flight() {
                return None;
            }
            points_mm.push(axis.point_mm(0));
        }
        let mut off_mm = 0.0;
        for (points_mm, steps) in points_mm.windows(2).zip(self.steps.windows(2)) {
            let way_mm = points_mm[0].distance(points_mm[1]);
            off_mm += (way_mm - (steps[1].vertex_z - steps[0].vertex_z).abs()).abs();
            along_mm += way_mm;
        }
        (off_mm > SAME_WAY * along_mm).then(|| {
            format!(
                "first-order data (focal lengths, f-numbers, paraxial foci) are those of the distances between vertices, which differ by \
                 {off_mm:.3} mm from the {along_mm:.3} mm along the bent axis"
            )
        })
    }

    /// The f-number for a far object by the real rays that get through: effective focal length over the diameter of the
    /// beam before the lens; `None` where no light does, or the lens has no power.
    ///
    /// It differs from the paraxial f-number by the aberration of the entrance pupil.
    pub fn real_f_number(&self) -> Option<f64> {
        let beam = (*self.far_beam.get_or_init(|| self.axial_beam(f64::INFINITY)))?;
        let f_number = (self.first_order.efl_mm / (2.0 * beam.height_mm)).abs();
        f_number.is_finite().then_some(f_number)
    }

    /// Focal lengths, principal planes and pupils in the x–z plane; those of [`first_order`](Self::first_order) unless
    /// a surface is curved differently along x and y.
    pub fn first_order_x(&self) -> FirstOrder {
        let is_toric = self.steps.iter().any(|step| matches!(step.kind, Kind::Toric(_)));
        if is_toric {
            let round = self.with_round_iris();
            let steps = round.as_ref().unwrap_or(self).steps_along_x();
            return paraxial::first_order(&steps, self.stop, self.wavelength_nm);
        }
        // Of surfaces of revolution only openings may differ.
        let are_apertures_round = self
            .steps
            .iter()
            .flat_map(|step| &step.apertures)
            .all(|aperture| aperture.is_rotational() || aperture.is_iris());
        if are_apertures_round || !self.has_far_pupil() {
            return self.first_order();
        }
        let beam = self.axial_beam_along(f64::INFINITY, DVec2::X).filter(|beam| !beam.is_limited_by_stop);
        beam.map_or(self.first_order, |beam| self.first_order.with_entrance_pupil_diameter_mm(2.0 * beam.height_mm))
    }

    /// Returns the steps as the x–z plane cuts them.
    fn steps_along_x(&self) -> Vec<Step> {
        let along_x = |step: &Step| match &step.kind {
            Kind::Toric(toric) => Step { kind: Kind::Sphere, curvature: toric.vertex_curvatures()[0], ..step.clone() },
            _ => step.clone(),
        };
        self.steps.iter().map(along_x).collect()
    }

    /// Returns the image of the axial point at `object_distance_mm` before the first vertex (infinite for far ones).
    pub fn conjugate(&self, object_distance_mm: f64) -> Conjugate {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        Matrix::of(&self.steps).image_of(-object_distance_mm, before, after)
    }

    /// Returns the working f-number for an object at this distance before the first vertex (infinite for a far one):
    /// one over twice the sine of the image-side cone times the index there, by first order.
    ///
    /// It is `N (1 + |m| / m_p)` with `m_p` the magnification of the pupils, and holds where those are infinite too.
    /// With it an unvignetted axial image of a Lambertian plane has `E = π L / (4 N_w²)` to 0.1 % at f/8, at any
    /// magnification; the textbook's `N (1 + |m|)` has not, unless the pupils are equal. Where a rim limits the light and not
    /// the stop, the cone is that of the real marginal ray.
    pub fn working_f_number(&self, object_distance_mm: f64) -> f64 {
        0.5 / self.marginal_ray(object_distance_mm).reduced_slope_after.abs()
    }

    /// Returns the paraxial ray from the axial point at this distance before the first vertex to the edge of the stop; where
    /// a rim limits the light and not the stop, the one that starts as the real marginal ray does.
    pub(crate) fn marginal_ray(&self, object_distance_mm: f64) -> MarginalRay {
        let to_stop = self.marginal_ray_of_stop(object_distance_mm);
        match self.limiting_beam_for(object_distance_mm) {
            Some(beam) if object_distance_mm.is_infinite() => to_stop.scaled(beam.height_mm / to_stop.height_mm),
            Some(beam) => to_stop.scaled((beam.slope_before * self.object_index() / to_stop.reduced_slope).abs()),
            None => to_stop,
        }
    }

    /// The same to the edge of the stop, whether the light gets through or not.
    pub(crate) fn marginal_ray_of_stop(&self, object_distance_mm: f64) -> MarginalRay {
        MarginalRay::of(&self.steps, self.stop, self.stop_semi_aperture_mm, object_distance_mm)
    }

    /// z from the first vertex of the point that fields and depths are counted from, mm: the center of the paraxial
    /// entrance pupil, or the first vertex where that is infinitely far or so far (10⁴ times the first rim) that a
    /// count from it would lose digits.
    pub fn projection_center_z_mm(&self) -> f64 {
        let z_mm = self.first_order.entrance_pupil_z_mm;
        if z_mm.abs() <= FARTHEST_PUPIL * self.front.semi_aperture_mm { z_mm } else { 0.0 }
    }

    /// Returns the image in the x–z plane, which differs from that of [`conjugate`](Self::conjugate) where a surface is
    /// curved differently along x and y.
    pub fn conjugate_x(&self, object_distance_mm: f64) -> Conjugate {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        Matrix::of(&self.steps_along_x()).image_of(-object_distance_mm, before, after)
    }

    /// Returns how far behind the last vertex the film is in focus for an object at this distance before the first.
    ///
    /// # Errors
    /// When there is no real image behind the lens.
    pub fn film_distance_mm_for(&self, object_distance_mm: f64) -> Result<f64, OpticsError> {
        let film_distance_mm = self.conjugate(object_distance_mm).image_z_mm;
        if film_distance_mm > 0.0 && film_distance_mm.is_finite() && object_distance_mm > 0.0 {
            return Ok(film_distance_mm);
        }
        Err(OpticsError::NoFocus { lens: self.name.clone(), side: "behind it", distance_mm: object_distance_mm })
    }

    /// Returns how far before the first vertex an object is in focus on a film at this distance behind the last;
    /// infinite where the film lies in the rear focal plane.
    ///
    /// # Errors
    /// When there is no real object in front of the lens.
    pub fn object_distance_mm_for(&self, film_distance_mm: f64) -> Result<f64, OpticsError> {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        let distance_mm = -Matrix::of(&self.steps).object_of(film_distance_mm, before, after);
        if distance_mm > 0.0 {
            return Ok(distance_mm);
        }
        Err(OpticsError::NoFocus { lens: self.name.clone(), side: "before it", distance_mm: film_distance_mm })
    }
}
