//! Zemax files written.

mod operands;

use std::fmt::Write as _;

use glam::DVec2;

use crate::{
    Aperture, CatalogueGlass, Glass, GlassCatalogue, Lens, OpticsError, Outline, PhaseProfile, Placement, Shape,
    glass::D_LINE_NM,
};

use super::{
    agf::agf_lines,
    lens_file::LensFile,
    number::reciprocal,
    write::{cannot, one_line},
};

/// The way from one surface to the next: a distance along the axis, and a coordinate break where the next stands off it.
struct Gap {
    thickness_mm: f64,
    turn: Option<Turn>,
}

/// A coordinate break: a shift along x and y, the turn of a placement, and a way along the turned axis.
struct Turn {
    shift_mm: DVec2,
    tilt_deg: [f64; 3],
    thickness_mm: f64,
}

/// The line of a mirror's glass; the numbers mean nothing.
const MIRROR: &str = "  GLAS MIRROR 0 0 1.5 40 0 0 0 0 0 0\r\n";

/// The least 1 − cos of a tilt that is taken to turn about a point of the axis; below, the point is lost in rounding.
const LEAST_TILT: f64 = 1e-10;

impl Gap {
    /// Returns the gap of this way, which is `straight_mm` long where it follows the axis.
    ///
    /// Before and behind a tilt the pieces of the axis together are as long as it is straight: that is so where they
    /// meet at the tilt's pivot, and lengths along the axis come back as they were.
    fn new(way: &Placement, straight_mm: f64) -> Self {
        let straight = Placement::centered(straight_mm);
        // What rounding leaves of a motion and its return.
        if way.inverse().after(&straight).is_rest() {
            return Self { thickness_mm: straight_mm, turn: None };
        }
        let axis = way.rotation.z_axis;
        let is_tilted = 1.0 - axis.z > LEAST_TILT;
        let behind_mm = if is_tilted { (straight_mm - way.vertex_mm.z) / (1.0 - axis.z) } else { 0.0 };
        Self::turned(way, behind_mm)
    }

    /// Returns the gap of this way with this much of it behind the break.
    fn turned(way: &Placement, behind_mm: f64) -> Self {
        let pivot_mm = way.vertex_mm - way.rotation.z_axis * behind_mm;
        let turn = Turn { shift_mm: pivot_mm.truncate(), tilt_deg: way.tilt_deg(), thickness_mm: behind_mm };
        Self { thickness_mm: pivot_mm.z, turn: Some(turn) }
    }

    fn write_break(&self, text: &mut String, n_written: &mut usize) {
        let Some(Turn { shift_mm, tilt_deg: [x, y, z], thickness_mm }) = &self.turn else { return };
        *n_written += 1;
        let _ = write!(text, "SURF {n_written}\r\n  TYPE COORDBRK\r\n  CURV 0\r\n");
        for (place, parameter) in (1..).zip([shift_mm.x, shift_mm.y, *x, *y, *z, 0.0]) {
            let _ = write!(text, "  PARM {place} {parameter:e}\r\n");
        }
        let _ = write!(text, "  DISZ {thickness_mm:e}\r\n");
    }
}

impl LensFile {
    /// Returns the lens as a Zemax file, with its film, fields and wavelengths. What is tilted or decentered stands behind
    /// coordinate breaks, one from each surface to the next. A first surface that is shifted along z comes back at z = 0,
    /// which moves the lens frame.
    ///
    /// # Errors
    /// When a glass is neither of the catalogue nor given by index and Abbe number: the format has no place for others.
    /// [`to_zmx_and_agf`](Self::to_zmx_and_agf) gives them a catalogue of their own.
    pub fn to_zmx(&self) -> Result<String, OpticsError> {
        self.zmx_of_states(None, None)
    }

    /// Returns the lens as a Zemax file, and as an `.agf` catalogue of this name its glasses that Zemax does not know, if
    /// there are any. Beside the former and with its name, the latter is found when this crate reads it again.
    ///
    /// # Errors
    /// When a glass has a law that the catalogue's formulas cannot say.
    pub fn to_zmx_and_agf(&self, catalogue: &str) -> Result<(String, Option<String>), OpticsError> {
        let mut private: Vec<Glass> = Vec::new();
        let name = one_line(catalogue).replace(' ', "_").to_uppercase();
        let text = self.zmx_of_states(Some(&mut private), Some(&name))?;
        let entry = |(i, glass): (usize, &Glass)| agf_lines(&private_name(i), glass);
        let entries: String = private.iter().enumerate().filter_map(entry).collect();
        let agf = (!private.is_empty()).then(|| format!("CC glasses of {}\r\n{entries}", one_line(self.lens.name())));
        Ok((text, agf))
    }

    /// Returns the text of all configurations, and adds to the private glasses, where there may be such.
    fn zmx_of_states(
        &self,
        mut private: Option<&mut Vec<Glass>>,
        catalogue: Option<&str>,
    ) -> Result<String, OpticsError> {
        let states = self.listed_states();
        let lines = states.iter().map(|state| zmx_glasses(&state.lens, private.as_deref_mut()));
        let lines = lines.collect::<Result<Vec<Vec<String>>, _>>()?;
        let mut makers = zmx_makers(&states)?;
        if private.is_some_and(|private| !private.is_empty()) {
            makers.extend(catalogue.map(str::to_owned));
        }
        let texts = states.iter().zip(&lines).map(|(state, lines)| state.zmx_text(lines, &makers));
        let texts = texts.collect::<Result<Vec<String>, _>>()?;
        operands::with_operands(&texts, &self.configuration_names(), self.configuration)
    }

    /// Returns the text with these lines of glass, one for the object and one a surface, of these makers.
    fn zmx_text(&self, glasses: &[String], makers: &[String]) -> Result<String, OpticsError> {
        let lens = &self.lens;
        self.check_places("a .zmx file")?;
        let mut text = format!("MODE SEQ\r\nNAME {}\r\nNOTE 0 {}\r\n", one_line(lens.name()), one_line(lens.source()));
        for comment in &self.comments {
            let _ = write!(text, "NOTE 0 {}\r\n", one_line(comment));
        }
        text.push_str("UNIT MM X W X CM MR CPMM\r\n");
        // The format has no rim beside an opening: where the opening is larger than the rim, the file states the entrance pupil.
        match opening_beyond_rim(lens, lens.stop()) {
            false => text.push_str("FLOA\r\n"),
            true => {
                let first = lens.at(self.reference_wavelength_nm.unwrap_or(D_LINE_NM))?.first_order_of_stop();
                let _ = write!(text, "ENPD {:e}\r\n", first.entrance_pupil_diameter_mm);
            }
        }
        if !makers.is_empty() {
            let _ = write!(text, "GCAT {}\r\n", makers.join(" "));
        }
        self.write_zmx_fields(&mut text)?;
        let gaps = self.zmx_gaps();
        let mut n_written = 0;
        let distance_mm = match self.object_distance_mm {
            Some(distance_mm) => format!("{:e}", distance_mm + gaps[0].thickness_mm),
            None => "INFINITY".to_owned(),
        };
        let _ = write!(text, "SURF 0\r\n  TYPE STANDARD\r\n  CURV 0\r\n  DISZ {distance_mm}\r\n{}", glasses[0]);
        gaps[0].write_break(&mut text, &mut n_written);
        for (i, interface) in lens.interfaces().iter().enumerate() {
            n_written += 1;
            let _ = write!(text, "SURF {n_written}\r\n");
            if i == lens.stop() {
                text.push_str("  STOP\r\n");
            }
            if let Some(comment) = self.surface_comments.get(i).filter(|comment| !comment.is_empty()) {
                let _ = write!(text, "  COMM {}\r\n", one_line(comment));
            }
            write_zmx_shape(&mut text, lens, i)?;
            let thickness_mm = gaps[i + 1].thickness_mm;
            let radius_mm = interface.surface.semi_aperture_mm;
            let _ = write!(
                text,
                "  DISZ {thickness_mm:e}\r\n{}  DIAM {radius_mm:e} 1\r\n{}",
                glasses[i + 1],
                zmx_aperture(lens, i)?
            );
            gaps[i + 1].write_break(&mut text, &mut n_written);
        }
        let image = lens.image_surface();
        let is_backward = lens.is_backward_before(lens.interfaces().len());
        let curvature = if is_backward { -image.curvature_per_mm } else { image.curvature_per_mm };
        let _ = write!(text, "SURF {}\r\n  TYPE STANDARD\r\n  CURV {curvature:e}\r\n", n_written + 1);
        if image.conic != 0.0 {
            let _ = write!(text, "  CONI {:e}\r\n", image.conic);
        }
        text.push_str("  DISZ 0\r\n");
        Ok(text)
    }

    /// Returns the ways from the lens frame to the first surface, between surfaces, and to the film.
    fn zmx_gaps(&self) -> Vec<Gap> {
        let lens = &self.lens;
        let film_mm = self.film_or_focus_mm();
        let film_z_mm = lens.film_z_mm(film_mm);
        let film = lens.film_motion().after(&Placement::centered(film_z_mm));
        let mut before = Placement::centered(0.0);
        let gap = |(i, placement): (usize, Placement)| {
            let way = std::mem::replace(&mut before, placement).inverse().after(&placement);
            let straight_mm = match i.checked_sub(1) {
                // Behind a far object the axis has no length to keep.
                None if way.is_rest() => 0.0,
                None => return Gap::turned(&way, 0.0),
                Some(i) if i + 1 == lens.interfaces().len() => {
                    if lens.is_backward_before(i + 1) {
                        -film_mm
                    } else {
                        film_mm
                    }
                }
                Some(i) => lens.interfaces()[i].thickness_after_mm,
            };
            match lens.moves() {
                // Far from the first surface rounding alone would be a turn.
                [] => Gap { thickness_mm: straight_mm, turn: None },
                _ => Gap::new(&way, straight_mm),
            }
        };
        lens.placements().into_iter().chain([film]).enumerate().map(gap).collect()
    }

    fn write_zmx_fields(&self, text: &mut String) -> Result<(), OpticsError> {
        let (kind, rows) = self.fields_of_one_kind("a .zmx file")?;
        let rows = rows.map(|row| row.iter().map(|number| format!(" {number:e}")).collect::<String>());
        let (n_fields, n_wavelengths) = (self.fields.len(), self.wavelengths_nm.len());
        let _ = write!(text, "FTYP {kind} 0 {n_fields} {n_wavelengths} 0 0 0\r\n");
        if n_fields > 0 {
            let _ = write!(text, "XFLN{}\r\nYFLN{}\r\n", rows[0], rows[1]);
        }
        if !self.field_weights.is_empty() {
            let weights: String = self.field_weights.iter().map(|weight| format!(" {weight:e}")).collect();
            let _ = write!(text, "FWGN{weights}\r\n");
        }
        for (i, nm) in self.wavelengths_nm.iter().enumerate() {
            let weight = self.wavelength_weights.get(i).copied().unwrap_or(1.0);
            let _ = write!(text, "WAVM {} {:e} {weight}\r\n", i + 1, nm / 1e3);
        }
        let is_reference = |nm: &f64| Some(*nm) == self.reference_wavelength_nm;
        if let Some(reference) = self.wavelengths_nm.iter().position(is_reference) {
            let _ = write!(text, "PWAV {}\r\n", reference + 1);
        }
        Ok(())
    }
}

/// Returns the makers of the glasses, in an order in which each glass's name means it.
fn zmx_makers(states: &[LensFile]) -> Result<Vec<String>, OpticsError> {
    let named = states.iter().flat_map(|state| media(&state.lens)).filter_map(|(_, medium)| match medium {
        Glass::Named(name) => Some(GlassCatalogue::built_in().find(name)),
        _ => None,
    });
    let mut left: Vec<&CatalogueGlass> = named.collect::<Result<_, _>>()?;
    let mut makers: Vec<String> = Vec::new();
    while let Some(first) = left.first() {
        // Next comes a maker of whom no name left means another glass.
        let means_its_own = |maker: &&String| {
            let listed = std::slice::from_ref(*maker);
            left.iter().all(|glass| match GlassCatalogue::built_in().find_among(&glass.name, listed) {
                Ok(meant) if meant.maker == **maker => meant == *glass,
                _ => glass.maker != **maker,
            })
        };
        let Some(maker) = left.iter().map(|glass| &glass.maker).find(means_its_own).cloned() else {
            let reason = format!("{} and a glass of another maker have one name", first.full_name());
            return Err(OpticsError::CannotWrite { format: "a .zmx file", reason });
        };
        left.retain(|glass| glass.maker != maker);
        makers.push(maker);
    }
    Ok(makers)
}

/// Returns the lines of the media around the object and behind the surfaces. What the format has no word for is added to the private glasses,
/// where there may be such, and named there.
fn zmx_glasses(lens: &Lens, mut private: Option<&mut Vec<Glass>>) -> Result<Vec<String>, OpticsError> {
    let mut lines = Vec::new();
    for (place, medium) in media(lens) {
        lines.push(match zmx_glass(place, medium) {
            _ if place.is_some_and(|surface| lens.is_mirror(surface)) => MIRROR.to_owned(),
            Ok(line) => line,
            Err(refusal) => {
                let Some(private) = private.as_deref_mut() else { return Err(refusal) };
                if agf_lines("", medium).is_none() {
                    return Err(refusal);
                }
                let number = private.iter().position(|glass| glass == medium).unwrap_or_else(|| {
                    private.push(medium.clone());
                    private.len() - 1
                });
                let (nd, vd) = medium.nd_vd().unwrap_or((0.0, 0.0));
                format!("  GLAS {} 0 0 {nd:.6} {vd:.3}\r\n", private_name(number))
            }
        });
    }
    Ok(lines)
}

/// Whether the one opening of a surface reaches beyond its rim.
fn opening_beyond_rim(lens: &Lens, surface: usize) -> bool {
    let rim_mm = lens.interfaces()[surface].surface.semi_aperture_mm;
    let mut openings = lens.apertures_of(surface).filter(|aperture| !aperture.is_obscuration);
    openings.any(|aperture| aperture.extent_mm() > rim_mm * (1.0 + 1e-12))
}

/// Returns the lines of what bounds light at a surface, of which the format has one aperture a surface.
fn zmx_aperture(lens: &Lens, surface: usize) -> Result<String, OpticsError> {
    let rim_mm = lens.interfaces()[surface].surface.semi_aperture_mm;
    let apertures: Vec<&Aperture> = lens.apertures_of(surface).collect();
    let &[aperture] = apertures.as_slice() else {
        if apertures.is_empty() {
            return Ok(format!("  CLAP 0 {rim_mm:e} 0\r\n"));
        }
        return Err(cannot(
            "a .zmx file",
            surface,
            "has several apertures (as the arms of a spider), of which the format has one a surface",
        ));
    };
    let [x_mm, y_mm] = aperture.center_mm;
    let lines = match (&aperture.outline, aperture.is_obscuration) {
        (Outline::Circle { radius_mm }, true) if aperture.center_mm == [0.0; 2] => {
            return Ok(format!("  CLAP {radius_mm:e} {rim_mm:e} 0\r\n"));
        }
        (_, true) => return Err(cannot("a .zmx file", surface, "has an obscuration that is no circle about the axis")),
        _ if surface != lens.stop() && opening_beyond_rim(lens, surface) => {
            return Err(cannot("a .zmx file", surface, "has an opening that reaches beyond its rim"));
        }
        (Outline::Circle { radius_mm }, false) => format!("  CLAP 0 {radius_mm:e} 0\r\n"),
        (Outline::Ellipse { half_x_mm, half_y_mm }, false) => format!("  ELAP {half_x_mm:e} {half_y_mm:e} 0\r\n"),
        (Outline::Rectangle { half_x_mm, half_y_mm }, false) => format!("  SQAP {half_x_mm:e} {half_y_mm:e} 0\r\n"),
        (Outline::Polygon { .. } | Outline::Turned { .. } | Outline::Iris(_), false) => {
            return Err(cannot(
                "a .zmx file",
                surface,
                "has an aperture that is no circle, ellipse or rectangle along x and y",
            ));
        }
    };
    Ok(format!("{lines}  OBDC {x_mm:e} {y_mm:e}\r\n"))
}

/// Returns the name of a glass of the lens's own.
fn private_name(number: usize) -> String {
    format!("PRIVATE{}", number + 1)
}

/// Returns the media of a lens: that of the object, and that behind each surface.
fn media(lens: &Lens) -> impl Iterator<Item = (Option<usize>, &Glass)> {
    let behind = lens.interfaces().iter().enumerate().map(|(i, interface)| (Some(i), &interface.medium_after));
    std::iter::once((None, lens.object_medium())).chain(behind)
}

/// Returns the line of the medium behind a surface or around the object, or nothing for air.
fn zmx_glass(surface: Option<usize>, medium: &Glass) -> Result<String, OpticsError> {
    let model = |nd: f64, vd: f64| format!("  GLAS ___BLANK 1 0 {nd:e} {vd:e}\r\n");
    match medium {
        Glass::Air => Ok(String::new()),
        Glass::Constant { index } => Ok(model(*index, 0.0)),
        Glass::NdVd { nd, vd } => Ok(model(*nd, *vd)),
        Glass::Named(name) => {
            let glass = GlassCatalogue::built_in().find(name)?;
            let (nd, vd) = glass.glass.nd_vd().unwrap_or((0.0, 0.0));
            Ok(format!("  GLAS {} 0 0 {nd:.6} {vd:.3}\r\n", glass.name))
        }
        other => {
            let what = format!("{}, which is neither of the catalogue nor of n_d and V_d", other.describe());
            Err(match surface {
                Some(i) => cannot("a .zmx file", i, &format!("has behind it {what}")),
                None => OpticsError::CannotWrite { format: "a .zmx file", reason: format!("the object is in {what}") },
            })
        }
    }
}

fn write_zmx_shape(text: &mut String, lens: &Lens, i: usize) -> Result<(), OpticsError> {
    let surface = &lens.interfaces()[i].surface;
    let (mut kind, conic, mut parameters): (&str, f64, Vec<f64>) = match &surface.shape {
        Shape::Sphere => ("STANDARD", 0.0, Vec::new()),
        Shape::Conic { conic } => ("STANDARD", *conic, Vec::new()),
        Shape::EvenAsphere { conic, coefficients } => {
            ("EVENASPH", *conic, [0.0].into_iter().chain(coefficients.iter().copied()).collect())
        }
        Shape::OddAsphere { conic, coefficients } if coefficients.iter().step_by(2).all(|&a| a == 0.0) => {
            ("EVENASPH", *conic, coefficients.iter().skip(1).step_by(2).copied().collect())
        }
        Shape::OddAsphere { conic, coefficients } => ("ODDASPHE", *conic, coefficients.clone()),
        // No focal length states that a lens has no power.
        Shape::ThinLens { power_per_mm: 0.0 } => ("STANDARD", 0.0, Vec::new()),
        Shape::ThinLens { power_per_mm } => ("PARAXIAL", 0.0, vec![reciprocal(*power_per_mm)]),
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            ("BICONICX", *conic, vec![zmx_radius(*curvature_x_per_mm), *conic_x])
        }
        Shape::Toroid { curvature_x_per_mm, conic, coefficients } => {
            let radius = [zmx_radius(*curvature_x_per_mm)];
            ("TOROIDAL", *conic, radius.into_iter().chain(coefficients.iter().copied()).collect())
        }
    };
    let phase = lens.diffractive().iter().find(|phase| phase.surface == i);
    let mut behind = String::new();
    match phase.map(|phase| (&phase.profile, phase.order, kind)) {
        None => {}
        Some((PhaseProfile::Grating { lines_per_mm: [0.0, along_y] }, order, "STANDARD")) => {
            (kind, parameters) = ("DGRATING", vec![1e-3 * along_y, f64::from(order)]);
        }
        Some((PhaseProfile::Rings { radius_mm, coefficients_rad }, order, "STANDARD" | "EVENASPH")) => {
            kind = "BINARY_2";
            let _ = write!(behind, "  PARM 0 {order}\r\n");
            let numbers =
                [coefficients_rad.len() as f64, *radius_mm].into_iter().chain(coefficients_rad.iter().copied());
            for (place, number) in (1..).zip(numbers) {
                let _ = write!(behind, "  XDAT {place} {number:e} 0 0\r\n");
            }
        }
        Some((PhaseProfile::Wavefront(_), ..)) => return Err(cannot("a .zmx file", i, "has a wavefront error")),
        Some(_) => {
            return Err(cannot(
                "a .zmx file",
                i,
                "is a grating along x, or diffractive on a shape that the format has not",
            ));
        }
    }
    if parameters.len() > 8 {
        return Err(cannot("a .zmx file", i, "has more than eight aspheric coefficients"));
    }
    let _ = write!(text, "  TYPE {kind}\r\n  CURV {:e}\r\n", surface.curvature_per_mm);
    if conic != 0.0 {
        let _ = write!(text, "  CONI {conic:e}\r\n");
    }
    for (place, parameter) in (1..).zip(parameters) {
        let _ = write!(text, "  PARM {place} {parameter:e}\r\n");
    }
    text.push_str(&behind);
    Ok(())
}

/// Returns the radius of a curvature, of which Zemax writes 0 for that of a plane.
fn zmx_radius(curvature_per_mm: f64) -> f64 {
    reciprocal(curvature_per_mm)
}
