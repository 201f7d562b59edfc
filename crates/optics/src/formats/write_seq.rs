//! CODE V files written.

mod zoom;

use std::{f64::consts::TAU, fmt::Write as _};

use crate::{
    Aperture, CoordinateBreak, DiffractiveSurface, Glass, GlassCatalogue, Lens, OpticsError, Outline, PhaseProfile,
    Placement, Shape, Surface, glass::D_LINE_NM,
};

use super::{
    lens_file::LensFile,
    number::{has_reciprocal, reciprocal, written},
    write::{cannot, one_line},
};

const FORMAT: &str = "a .seq file";

/// Stands for an object that is infinitely far.
const FAR: &str = "0.1e14";

/// What the letters of an asphere's coefficients are, from r⁴ on.
const LETTERS: &str = "ABCDEFGHJ";

/// A surface's tilt and decenter: what the commands of the program say of it.
#[derive(Clone, Copy)]
struct SeqTilt {
    decenter_mm: [f64; 3],
    /// By the right-hand rule, as the lens has them.
    tilt_deg: [f64; 3],
    /// Whether the axis is back in its place behind the surface (DAR).
    is_returned: bool,
}

impl LensFile {
    /// Returns the lens as a CODE V sequence file in mm, with its film, object distance, fields, wavelengths, weights, comments
    /// and names of surfaces. Glasses that are tables become private ones; a tilt or decenter stands at its surface, alone or with
    /// `DAR`, and where the lens's own list of moves is more than that, as the places of all surfaces say.
    ///
    /// # Errors
    /// When the format has no word for a glass, shape, aperture or phase of the lens, or its fields are of several kinds; the
    /// message names which.
    pub fn to_seq(&self) -> Result<String, OpticsError> {
        let texts = self.listed_states().iter().map(Self::seq_text).collect::<Result<Vec<_>, _>>()?;
        zoom::with_zoom(&texts, &self.configuration_names())
    }

    /// Returns the text of the configuration in use.
    fn seq_text(&self) -> Result<String, OpticsError> {
        let lens = &self.lens;
        self.check_places(FORMAT)?;
        let mut text = self.seq_header()?;
        let glasses = self.seq_glasses(&mut text)?;
        let (tilts, thicknesses_mm) = self.seq_tilts();
        let object = self.object_distance_mm.map_or(FAR.to_owned(), written);
        let _ = writeln!(text, "SO 0 {object} {}", glasses[0]);
        for i in 0..lens.interfaces().len() {
            let behind = format!("{} {}", written(thicknesses_mm[i]), glasses[i + 1]);
            write_curvature(&mut text, "S", lens.interfaces()[i].surface.curvature_per_mm, &behind);
            if i == lens.stop() {
                text.push_str("  STO\n");
            }
            if let Some(comment) = self.surface_comments.get(i).filter(|comment| !comment.is_empty()) {
                let _ = writeln!(text, "  SLB S{} {}", i + 1, quoted(comment));
            }
            write_shape(&mut text, i, &lens.interfaces()[i].surface)?;
            write_phase(&mut text, lens, i, self.reference_wavelength_nm.unwrap_or(D_LINE_NM))?;
            write_apertures(&mut text, lens, i)?;
            write_tilt(&mut text, tilts[i]);
        }
        let image = lens.image_surface();
        let is_backward = lens.is_backward_before(lens.interfaces().len());
        let curvature = if is_backward { -image.curvature_per_mm } else { image.curvature_per_mm };
        write_curvature(&mut text, "SI", curvature, "0");
        if image.conic != 0.0 {
            let _ = writeln!(text, "  CON\n  K {}", written(image.conic));
        }
        write_tilt(&mut text, tilts[lens.interfaces().len()]);
        text.push_str("GO\n");
        Ok(text)
    }

    /// Returns what stands before the surfaces, but for the glasses.
    fn seq_header(&self) -> Result<String, OpticsError> {
        let lens = &self.lens;
        let mut text = String::new();
        for line in [lens.source()].into_iter().chain(self.comments.iter().map(String::as_str)) {
            let _ = writeln!(text, "! {}", one_line(line));
        }
        let _ = writeln!(text, "RDM;LEN\nTIT {}\nDIM M", quoted(lens.name()));
        self.write_seq_wavelengths(&mut text);
        let first = lens.at(self.reference_wavelength_nm.unwrap_or(D_LINE_NM))?.first_order_of_stop();
        if first.entrance_pupil_diameter_mm.is_finite() {
            let _ = writeln!(text, "EPD {}", written(first.entrance_pupil_diameter_mm));
        }
        self.write_seq_fields(&mut text)?;
        Ok(text)
    }

    fn write_seq_wavelengths(&self, text: &mut String) {
        if self.wavelengths_nm.is_empty() {
            return;
        }
        let _ = writeln!(text, "WL{}", row(&self.wavelengths_nm));
        let is_reference = |nm: &f64| Some(*nm) == self.reference_wavelength_nm;
        if let Some(reference) = self.wavelengths_nm.iter().position(is_reference) {
            let _ = writeln!(text, "REF {}", reference + 1);
        }
        if !self.wavelength_weights.is_empty() {
            let _ = writeln!(text, "WTW{}", row(&self.wavelength_weights));
        }
    }

    fn write_seq_fields(&self, text: &mut String) -> Result<(), OpticsError> {
        let (kind, [x, y]) = self.fields_of_one_kind(FORMAT)?;
        if x.is_empty() {
            return Ok(());
        }
        let kind = ["AN", "OB", "IM", "RI"][kind];
        let _ = writeln!(text, "X{kind}{}\nY{kind}{}", row(&x), row(&y));
        if !self.field_weights.is_empty() {
            let _ = writeln!(text, "WTF{}", row(&self.field_weights));
        }
        Ok(())
    }

    /// Returns the words of the medium around the object and of those behind the surfaces, and writes what they need to be known.
    fn seq_glasses(&self, text: &mut String) -> Result<Vec<String>, OpticsError> {
        let lens = &self.lens;
        let behind = lens.interfaces().iter().enumerate().map(|(i, interface)| (Some(i), &interface.medium_after));
        let mut tables: Vec<(&[f64], &[f64])> = Vec::new();
        let mut words = Vec::new();
        for (place, medium) in [(None, lens.object_medium())].into_iter().chain(behind) {
            words.push(match medium {
                _ if place.is_some_and(|surface| lens.is_mirror(surface)) => "REFL".to_owned(),
                Glass::Air => String::new(),
                Glass::Constant { index } => {
                    if *index < 100.0 {
                        format!("{index}")
                    } else {
                        format!("{index:e}")
                    }
                }
                Glass::NdVd { nd, vd } => format!("{}:{vd}", index_word(*nd)),
                Glass::Named(name) => catalogue_word(name)?,
                Glass::Tabulated { wavelengths_nm, indices } => {
                    let table = (wavelengths_nm.as_slice(), indices.as_slice());
                    let number = tables.iter().position(|known| *known == table).unwrap_or(tables.len());
                    if number == tables.len() {
                        tables.push(table);
                    }
                    private_name(number)
                }
                other => {
                    let what =
                        format!("{}, which is no glass of the catalogue, of n_d and V_d, or a table", other.describe());
                    return Err(match place {
                        Some(i) => cannot(FORMAT, i, &format!("has behind it {what}")),
                        None => OpticsError::CannotWrite { format: FORMAT, reason: format!("the object is in {what}") },
                    });
                }
            });
        }
        if !tables.is_empty() {
            text.push_str("PRV\n");
            for (number, (wavelengths_nm, indices)) in tables.into_iter().enumerate() {
                let _ = writeln!(text, "PWL{}\n'{}'{}", row(wavelengths_nm), private_name(number), row(indices));
            }
            text.push_str("END\n");
        }
        Ok(words)
    }

    /// Returns the tilts of the surfaces and of the film, and the thicknesses behind the surfaces.
    fn seq_tilts(&self) -> (Vec<Option<SeqTilt>>, Vec<f64>) {
        let lens = &self.lens;
        let n_surfaces = lens.interfaces().len();
        let film_mm = self.film_or_focus_mm();
        let mut thicknesses_mm: Vec<f64> =
            lens.interfaces().iter().map(|interface| interface.thickness_after_mm).collect();
        let is_backward = lens.is_backward_before(n_surfaces);
        thicknesses_mm[n_surfaces - 1] = if is_backward { -film_mm } else { film_mm };
        let tilts = own_tilts(lens.moves(), n_surfaces, thicknesses_mm[n_surfaces - 1]).unwrap_or_else(|| {
            let film = lens.film_motion().after(&Placement::centered(lens.film_z_mm(film_mm)));
            let mut before = Placement::centered(0.0);
            let straight_mm = [0.0].into_iter().chain(thicknesses_mm.iter().copied());
            let places = lens.placements().into_iter().chain([film]);
            places.zip(straight_mm).map(|(place, straight_mm)| turn_to(&mut before, place, straight_mm)).collect()
        });
        (tilts, thicknesses_mm)
    }
}

/// Returns the tilt of each surface and of the film as a lens's own moves have it; `None` where they are more than the
/// format's tilts, each about the vertex of its surface. The film, which stands this far behind the last vertex, turns about its own
/// middle.
fn own_tilts(moves: &[CoordinateBreak], n_surfaces: usize, film_mm: f64) -> Option<Vec<Option<SeqTilt>>> {
    let mut tilts = vec![None; n_surfaces + 1];
    let mut next = 0;
    for step in moves {
        let (first, last) = step.surfaces;
        let is_returned = last == first && first < n_surfaces;
        let vertex_mm = if first == n_surfaces { film_mm } else { 0.0 };
        if first < next || step.pivot_mm != vertex_mm || step.tilt_first || !(is_returned || last == n_surfaces) {
            return None;
        }
        next = first + 1;
        tilts[first] = Some(SeqTilt { decenter_mm: step.decenter_mm, tilt_deg: step.tilt_deg, is_returned });
    }
    Some(tilts)
}

/// Returns the tilt from where the last surface stands to where the next does, this far along the axis.
fn turn_to(before: &mut Placement, place: Placement, straight_mm: f64) -> Option<SeqTilt> {
    let way = std::mem::replace(before, place).inverse().after(&place);
    if way.inverse().after(&Placement::centered(straight_mm)).is_rest() {
        return None;
    }
    let mut decenter_mm = way.vertex_mm.to_array();
    decenter_mm[2] -= straight_mm;
    Some(SeqTilt { decenter_mm, tilt_deg: way.tilt_deg(), is_returned: false })
}

/// Writes a surface with its radius, and its curvature where no radius is exactly that.
fn write_curvature(text: &mut String, keyword: &str, curvature_per_mm: f64, behind: &str) {
    let _ = writeln!(text, "{keyword} {} {behind}", written(reciprocal(curvature_per_mm)));
    if !has_reciprocal(curvature_per_mm) {
        let _ = writeln!(text, "  CUY {}", written(curvature_per_mm));
    }
}

fn write_tilt(text: &mut String, tilt: Option<SeqTilt>) {
    let Some(SeqTilt { decenter_mm, tilt_deg: [a, b, c], is_returned }) = tilt else { return };
    // About x and y the program turns by the left-hand rule.
    for (keyword, number) in
        ["XDE", "YDE", "ZDE", "ADE", "BDE", "CDE"].into_iter().zip(decenter_mm.into_iter().chain([-a, -b, c]))
    {
        if number != 0.0 {
            let _ = writeln!(text, "  {keyword} {}", written(number));
        }
    }
    if is_returned {
        text.push_str("  DAR\n");
    }
}

fn write_shape(text: &mut String, i: usize, surface: &Surface) -> Result<(), OpticsError> {
    let mut put = |keyword: &str, number: f64| {
        if number != 0.0 {
            let _ = writeln!(text, "  {keyword} {}", written(number));
        }
    };
    let coefficients: Vec<f64> = match &surface.shape {
        Shape::Sphere => return Ok(()),
        Shape::Conic { conic } => {
            put("K", *conic);
            Vec::new()
        }
        Shape::EvenAsphere { conic, coefficients } => {
            put("K", *conic);
            coefficients.clone()
        }
        Shape::OddAsphere { conic, coefficients } if is_even_from_r4(coefficients) => {
            put("K", *conic);
            coefficients.iter().skip(3).step_by(2).copied().collect()
        }
        Shape::Toroid { curvature_x_per_mm, conic, coefficients } if coefficients.first().is_none_or(|&a| a == 0.0) => {
            put("CUX", *curvature_x_per_mm);
            put("K", *conic);
            coefficients.iter().skip(1).copied().collect()
        }
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            put("CUX", *curvature_x_per_mm);
            put("K", *conic);
            put("KX", *conic_x);
            Vec::new()
        }
        Shape::ThinLens { .. } => return Err(cannot(FORMAT, i, "is an ideal lens")),
        Shape::OddAsphere { .. } | Shape::Toroid { .. } => {
            return Err(cannot(FORMAT, i, "has an aspheric term of r², or of an odd power of r"));
        }
    };
    if coefficients.len() > LETTERS.len() {
        return Err(cannot(FORMAT, i, "has more than nine aspheric coefficients"));
    }
    for (letter, a) in LETTERS.chars().zip(coefficients) {
        put(&letter.to_string(), a);
    }
    text.push_str(match &surface.shape {
        Shape::Toroid { .. } => "  YTO\n",
        Shape::Biconic { .. } => "  AAS\n",
        Shape::Conic { .. } => "  CON\n",
        _ => "  ASP\n",
    });
    Ok(())
}

/// Whether coefficients from r on are of r⁴, r⁶ and on alone.
fn is_even_from_r4(coefficients: &[f64]) -> bool {
    coefficients.iter().enumerate().all(|(i, &a)| a == 0.0 || (i >= 3 && i % 2 == 1))
}

fn write_phase(text: &mut String, lens: &Lens, i: usize, construction_nm: f64) -> Result<(), OpticsError> {
    let Some(DiffractiveSurface { order, profile, .. }) = lens.diffractive().iter().find(|phase| phase.surface == i)
    else {
        return Ok(());
    };
    if !lens.interfaces()[i].surface.shape.is_rotational() {
        return Err(cannot(FORMAT, i, "is diffractive on a shape that is not of revolution"));
    }
    match profile {
        PhaseProfile::Grating { lines_per_mm: [along_x, along_y] } => {
            let lines_per_mm = along_x.hypot(*along_y);
            if !(1.0 / lines_per_mm).is_finite() {
                return Err(cannot(FORMAT, i, "is a grating without grooves"));
            }
            let _ = writeln!(text, "  GRT\n  GRO {order}\n  GRS {}", written(reciprocal(lines_per_mm)));
            let (x, y) = (along_x / lines_per_mm, along_y / lines_per_mm);
            let _ = writeln!(text, "  GRX {}\n  GRY {}", written(x), written(y));
        }
        PhaseProfile::Wavefront(_) => return Err(cannot(FORMAT, i, "has a wavefront error")),
        PhaseProfile::Rings { radius_mm, coefficients_rad } => {
            // The program's coefficients are paths at the wavelength of construction, over powers of r.
            let _ = writeln!(text, "  DIF DOE\n  HOR {order}\n  HWL {}\n  HCT R", written(construction_nm));
            let path_mm = 1e-6 * construction_nm / TAU;
            for (power, a) in (1..).zip(coefficients_rad) {
                let _ = writeln!(text, "  HCO C{power} {}", written(a * path_mm / radius_mm.powi(2 * power)));
            }
        }
    }
    Ok(())
}

fn write_apertures(text: &mut String, lens: &Lens, i: usize) -> Result<(), OpticsError> {
    let rim_mm = lens.interfaces()[i].surface.semi_aperture_mm;
    let (obscurations, openings): (Vec<&Aperture>, Vec<&Aperture>) =
        lens.apertures_of(i).partition(|aperture| aperture.is_obscuration);
    if openings.len() > 1 || obscurations.len() > 1 {
        return Err(cannot(FORMAT, i, "has several openings or several obscurations"));
    }
    match openings.first() {
        Some(opening) if opening.center_mm != [0.0; 2] => {
            let reach_mm = opening.extent_mm();
            if rim_mm < reach_mm * (1.0 - 1e-9) && i != lens.stop() {
                return Err(cannot(FORMAT, i, "has an opening off its axis that its rim cuts"));
            }
            write_aperture(text, opening, "")?;
        }
        Some(opening) => {
            let _ = writeln!(text, "  CIR {}", written(rim_mm));
            write_aperture(text, opening, "")?;
        }
        None => {
            let _ = writeln!(text, "  CIR {}", written(rim_mm));
        }
    }
    if let Some(obscuration) = obscurations.first() {
        write_aperture(text, obscuration, "OBS ")?;
    }
    Ok(())
}

fn write_aperture(text: &mut String, aperture: &Aperture, kind: &str) -> Result<(), OpticsError> {
    let numbers = match aperture.outline {
        Outline::Circle { radius_mm } => vec![("CIR", radius_mm)],
        Outline::Rectangle { half_x_mm, half_y_mm } => vec![("REX", half_x_mm), ("REY", half_y_mm)],
        Outline::Ellipse { half_x_mm, half_y_mm } => vec![("ELX", half_x_mm), ("ELY", half_y_mm)],
        Outline::Polygon { .. } | Outline::Turned { .. } | Outline::Iris(_) => {
            return Err(cannot(
                FORMAT,
                aperture.surface,
                "has an aperture that is no circle, ellipse or rectangle along x and y",
            ));
        }
    };
    let center = ["ADX", "ADY"].into_iter().zip(aperture.center_mm).filter(|(_, mm)| *mm != 0.0);
    for (keyword, mm) in numbers.into_iter().chain(center) {
        let _ = writeln!(text, "  {keyword} {kind}{}", written(mm));
    }
    Ok(())
}

/// Returns the word of a glass of the catalogue: its name and its maker.
fn catalogue_word(name: &str) -> Result<String, OpticsError> {
    let glass = GlassCatalogue::built_in().find(name)?;
    let maker = if glass.maker == "MISC" { "SPECIAL" } else { &glass.maker };
    let word = format!("{}_{maker}", glass.name);
    Ok(if word.contains(char::is_whitespace) { quoted(&word) } else { word })
}

/// Returns an index: of a hundred or more with its exponent, since digits alone are a code.
fn index_word(index: f64) -> String {
    if index < 100.0 { index.to_string() } else { format!("{index:e}") }
}

fn private_name(number: usize) -> String {
    format!("PRIVATE{}", number + 1)
}

/// Returns numbers behind a command, continued on new lines where they are many.
fn row(numbers: &[f64]) -> String {
    let lines: Vec<String> =
        numbers.chunks(8).map(|chunk| chunk.iter().map(|number| format!(" {}", written(*number))).collect()).collect();
    lines.join(" &\n   ")
}

/// Returns a text in quotes; of both kinds of quotes in a text the single ones become apostrophes.
fn quoted(text: &str) -> String {
    let text = one_line(text);
    match (text.contains('\''), text.contains('"')) {
        (false, _) => format!("'{text}'"),
        (true, false) => format!("\"{text}\""),
        (true, true) => format!("'{}'", text.replace('\'', "’")),
    }
}
