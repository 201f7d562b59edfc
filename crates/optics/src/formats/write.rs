//! Lens files written: what each format can hold of a lens, and a refusal where it cannot.

use std::{fmt::Write as _, fs, path::Path};

use serde_json::{Value, json};

use crate::{Glass, GlassCatalogue, Interface, Lens, OpticsError, Shape, Surface, glass::D_LINE_NM};

use super::lens_file::{Field, LensFile};

impl From<Lens> for LensFile {
    fn from(lens: Lens) -> Self {
        Self::of_lens(lens)
    }
}

/// Returns the refusal of a format.
fn cannot(format: &'static str, surface: usize, what: &str) -> OpticsError {
    OpticsError::CannotWrite { format, reason: format!("surface {surface} {what}") }
}

/// Whether a surface is a plane with nothing added.
fn is_plane(surface: &Surface) -> bool {
    surface.shape == Shape::Sphere && surface.curvature_per_mm == 0.0
}

impl LensFile {
    /// Writes the lens to a file, in the format of its extension: `.ron`, `.dat`, `.json` (ISET) or `.zmx`.
    ///
    /// # Errors
    /// When the format cannot hold the lens, the extension is none of these, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), OpticsError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
        let text = match extension.as_str() {
            "ron" => self.lens.to_ron(),
            "dat" => self.to_dat()?,
            "json" => self.to_omni_json()?,
            "zmx" => self.to_zmx()?,
            _ => {
                let expected = "expected .ron, .dat, .json or .zmx";
                return Err(failed(format!("the extension '.{extension}' is no format to write; {expected}")));
            }
        };
        fs::write(path, text).map_err(|error| failed(error.to_string()))
    }

    /// Returns the lens as a `.dat` file, which holds spheres around a plane stop in air, and of each medium one index:
    /// that at the reference wavelength, or at the d line where the file states none.
    ///
    /// # Errors
    /// When a surface is a plane that is not the stop, an asphere or an ideal lens, or the stop is curved.
    pub fn to_dat(&self) -> Result<String, OpticsError> {
        const FORMAT: &str = "a .dat file";
        let wavelength_nm = self.reference_wavelength_nm.unwrap_or(D_LINE_NM);
        let lens = &self.lens;
        let efl_mm = lens.at(wavelength_nm)?.first_order().efl_mm;
        let mut text = format!(
            "# Name: {}\n# Indices at {wavelength_nm} nm. Focal length (mm):\n{efl_mm}\n",
            one_line(lens.name())
        );
        text.push_str("# radius\taxpos\tN\taperture\n");
        for (i, interface) in lens.interfaces().iter().enumerate() {
            let surface = &interface.surface;
            let radius_mm = match (i == lens.stop(), is_plane(surface)) {
                (true, true) => 0.0,
                (true, false) => return Err(cannot(FORMAT, i, "is the stop but not a plane")),
                (false, true) => return Err(cannot(FORMAT, i, "is a plane, which only the stop may be")),
                (false, false) if surface.shape == Shape::Sphere => 1.0 / surface.curvature_per_mm,
                (false, false) => return Err(cannot(FORMAT, i, "is not a sphere")),
            };
            let index = interface.medium_after.index_at(wavelength_nm)?;
            let (thickness_mm, diameter_mm) = (interface.thickness_after_mm, 2.0 * surface.semi_aperture_mm);
            let _ = writeln!(text, "{radius_mm}\t{thickness_mm}\t{index}\t{diameter_mm}");
        }
        Ok(text)
    }

    /// Returns the lens as a `.json` file of ISET, with each index as a table at the file's wavelengths, or from 400 to
    /// 700 nm in steps of 10 where it states none.
    ///
    /// ISET reads no planes but the stop, and no stop but a plane: such surfaces are written with the keys that only
    /// this crate reads (`"radius": null`, `"stop": true`), so that ISET refuses the file instead of misreading it.
    ///
    /// # Errors
    /// When a surface is an odd asphere or an ideal lens, or a glass is not known at one of the wavelengths.
    pub fn to_omni_json(&self) -> Result<String, OpticsError> {
        let mut wavelengths_nm = self.wavelengths_nm.clone();
        if wavelengths_nm.is_empty() {
            wavelengths_nm = (0..=30).map(|step| 400.0 + 10.0 * f64::from(step)).collect();
        }
        wavelengths_nm.sort_by(f64::total_cmp);
        wavelengths_nm.dedup();
        let lens = &self.lens;
        let row = |(i, interface): (usize, &Interface)| omni_row(i, i == lens.stop(), interface, &wavelengths_nm);
        let surfaces: Vec<Value> = lens.interfaces().iter().enumerate().map(row).collect::<Result<_, _>>()?;
        let file = json!({
            "name": lens.name(),
            "description": lens.source(),
            "type": "multi element lens",
            "surfaces": surfaces,
        });
        Ok(format!("{file:#}\n"))
    }

    /// Returns the lens as a Zemax file, with its film, fields and wavelengths.
    ///
    /// # Errors
    /// When a glass is neither of the catalogue nor given by index and Abbe number: the format has no place for others.
    pub fn to_zmx(&self) -> Result<String, OpticsError> {
        let lens = &self.lens;
        let glasses: Vec<String> = lens
            .interfaces()
            .iter()
            .enumerate()
            .map(|(i, interface)| zmx_glass(i, &interface.medium_after))
            .collect::<Result<_, _>>()?;
        let mut text = format!("MODE SEQ\r\nNAME {}\r\nNOTE 0 {}\r\n", one_line(lens.name()), one_line(lens.source()));
        text.push_str("UNIT MM X W X CM MR CPMM\r\nFLOA\r\n");
        let makers = self.zmx_makers()?;
        if !makers.is_empty() {
            let _ = write!(text, "GCAT {}\r\n", makers.join(" "));
        }
        self.write_zmx_fields(&mut text);
        let distance_mm = self.object_distance_mm.map_or("INFINITY".to_owned(), |distance| format!("{distance:e}"));
        let _ = write!(text, "SURF 0\r\n  TYPE STANDARD\r\n  CURV 0\r\n  DISZ {distance_mm}\r\n");
        let last = lens.interfaces().len() - 1;
        for (i, interface) in lens.interfaces().iter().enumerate() {
            let _ = write!(text, "SURF {}\r\n", i + 1);
            if i == lens.stop() {
                text.push_str("  STOP\r\n");
            }
            write_zmx_shape(&mut text, i, &interface.surface)?;
            let thickness_mm = if i == last { self.film_mm.unwrap_or(0.0) } else { interface.thickness_after_mm };
            let radius_mm = interface.surface.semi_aperture_mm;
            let _ = write!(
                text,
                "  DISZ {thickness_mm:e}\r\n{}  DIAM {radius_mm:e} 1\r\n  CLAP 0 {radius_mm:e} 0\r\n",
                glasses[i]
            );
        }
        let _ = write!(text, "SURF {}\r\n  TYPE STANDARD\r\n  CURV 0\r\n  DISZ 0\r\n", last + 2);
        Ok(text)
    }

    /// Returns the makers of the glasses, after a check that each glass's name means it in their company.
    fn zmx_makers(&self) -> Result<Vec<String>, OpticsError> {
        let mut makers: Vec<String> = Vec::new();
        let named = self.lens.interfaces().iter().filter_map(|interface| match &interface.medium_after {
            Glass::Named(name) => Some(GlassCatalogue::built_in().find(name)),
            _ => None,
        });
        let named = named.collect::<Result<Vec<_>, _>>()?;
        for glass in &named {
            if !makers.contains(&glass.maker) {
                makers.push(glass.maker.clone());
            }
        }
        for glass in named {
            if GlassCatalogue::built_in().find_among(&glass.name, &makers)? != glass {
                let reason = format!("{} and a glass of another maker have one name", glass.full_name());
                return Err(OpticsError::CannotWrite { format: "a .zmx file", reason });
            }
        }
        Ok(makers)
    }

    fn write_zmx_fields(&self, text: &mut String) {
        let (mut kind, mut rows) = (0, [String::new(), String::new()]);
        for field in &self.fields {
            let (this_kind, x, y) = match *field {
                Field::Angle { x_deg, y_deg } => (0, x_deg, y_deg),
                Field::ObjectHeight { x_mm, y_mm } => (1, x_mm, y_mm),
                Field::ImageHeight { x_mm, y_mm } => (3, x_mm, y_mm),
            };
            kind = this_kind;
            let _ = write!(rows[0], " {x:e}");
            let _ = write!(rows[1], " {y:e}");
        }
        let (n_fields, n_wavelengths) = (self.fields.len(), self.wavelengths_nm.len());
        let _ = write!(text, "FTYP {kind} 0 {n_fields} {n_wavelengths} 0 0 0\r\n");
        if n_fields > 0 {
            let _ = write!(text, "XFLN{}\r\nYFLN{}\r\n", rows[0], rows[1]);
        }
        for (i, nm) in self.wavelengths_nm.iter().enumerate() {
            let _ = write!(text, "WAVM {} {:e} 1\r\n", i + 1, nm / 1e3);
        }
        let is_reference = |nm: &f64| Some(*nm) == self.reference_wavelength_nm;
        if let Some(reference) = self.wavelengths_nm.iter().position(is_reference) {
            let _ = write!(text, "PWAV {}\r\n", reference + 1);
        }
    }
}

fn omni_row(i: usize, is_stop: bool, interface: &Interface, wavelengths_nm: &[f64]) -> Result<Value, OpticsError> {
    let surface = &interface.surface;
    let radius = match (is_plane(surface), is_stop) {
        (true, true) => json!(0.0),
        _ if surface.curvature_per_mm == 0.0 => Value::Null,
        _ => json!(1.0 / surface.curvature_per_mm),
    };
    let medium = &interface.medium_after;
    let ior = match medium {
        Glass::Air | Glass::Constant { .. } => json!(medium.index_at(D_LINE_NM)?),
        _ => {
            let indices = wavelengths_nm.iter().map(|&nm| medium.index_at(nm)).collect::<Result<Vec<f64>, _>>()?;
            json!([wavelengths_nm, indices])
        }
    };
    let mut row = json!({
        "radius": radius,
        "thickness": interface.thickness_after_mm,
        "semi_aperture": surface.semi_aperture_mm,
        "ior": ior,
    });
    match &surface.shape {
        Shape::Sphere => {}
        Shape::Conic { conic } => row["conic_constant"] = json!(conic),
        Shape::EvenAsphere { conic, coefficients } => {
            row["conic_constant"] = json!(conic);
            row["aspheric_coefficients"] = json!(coefficients);
        }
        _ => {
            return Err(cannot("a .json file of ISET", i, "is neither a sphere nor a conic nor an asphere from r⁴ on"));
        }
    }
    if is_stop && !is_plane(surface) {
        row["stop"] = json!(true);
    }
    Ok(row)
}

/// Returns the line of a medium, or nothing for air.
fn zmx_glass(i: usize, medium: &Glass) -> Result<String, OpticsError> {
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
            let what =
                format!("has behind it {}, which is neither of the catalogue nor of n_d and V_d", other.describe());
            Err(cannot("a .zmx file", i, &what))
        }
    }
}

fn write_zmx_shape(text: &mut String, i: usize, surface: &Surface) -> Result<(), OpticsError> {
    let (kind, conic, parameters): (&str, f64, Vec<f64>) = match &surface.shape {
        Shape::Sphere => ("STANDARD", 0.0, Vec::new()),
        Shape::Conic { conic } => ("STANDARD", *conic, Vec::new()),
        Shape::EvenAsphere { conic, coefficients } => {
            ("EVENASPH", *conic, [0.0].into_iter().chain(coefficients.iter().copied()).collect())
        }
        Shape::OddAsphere { conic, coefficients } if coefficients.iter().step_by(2).all(|&a| a == 0.0) => {
            ("EVENASPH", *conic, coefficients.iter().skip(1).step_by(2).copied().collect())
        }
        Shape::OddAsphere { conic, coefficients } => ("ODDASPHE", *conic, coefficients.clone()),
        Shape::ThinLens { power_per_mm } => ("PARAXIAL", 0.0, vec![1.0 / power_per_mm]),
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            ("BICONICX", *conic, vec![zmx_radius(*curvature_x_per_mm), *conic_x])
        }
        Shape::Toroid { curvature_x_per_mm, conic, coefficients } => {
            let radius = [zmx_radius(*curvature_x_per_mm)];
            ("TOROIDAL", *conic, radius.into_iter().chain(coefficients.iter().copied()).collect())
        }
    };
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
    Ok(())
}

/// Returns the radius of a curvature, of which Zemax writes 0 for that of a plane.
fn zmx_radius(curvature_per_mm: f64) -> f64 {
    if curvature_per_mm == 0.0 { 0.0 } else { 1.0 / curvature_per_mm }
}

/// Returns a text without line ends, which would end it in a format of lines.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
