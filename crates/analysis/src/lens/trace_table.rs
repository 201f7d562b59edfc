//! Rays from a table, traced into a table.

use std::{
    collections::BTreeMap,
    io::{Read, Write},
    path::{Path, PathBuf},
};

use dioptric_optics::{Lens, MonoLens, RayBatch, RayFate, Vignetting, glam::DVec3};

use dioptric_pipeline::PipelineError;

/// The columns of a table of rays, in this order.
const COLUMNS: [&str; 7] = ["x_mm", "y_mm", "z_mm", "l", "m", "n", "wavelength_nm"];

/// Rays to trace, each with its wavelength, in the order of their table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RayTable {
    rays: Vec<(DVec3, DVec3, f64)>,
}

/// How the rays of a table are traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceSettings {
    /// Whether rims end rays.
    pub rims_clip: bool,
    /// Takes the rays on to a film this far behind the last vertex, mm, of the shape that the lens states.
    pub film_distance_mm: Option<f64>,
}

impl RayTable {
    /// The wavelengths of the rays, nm, each once, shortest first.
    pub fn wavelengths_nm(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.rays.iter().map(|(_, _, wavelength_nm)| *wavelength_nm).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// Reads CSV text with the columns `x_mm,y_mm,z_mm,l,m,n,wavelength_nm`: start point and direction cosines in the
    /// lens frame.
    ///
    /// # Errors
    /// When a column is missing, a cell is no number, or a direction is not of unit length and forward; the message
    /// names `path`, the line and the column.
    pub fn read(source: impl Read, path: &Path) -> Result<Self, PipelineError> {
        let wrong = |line: u64, reason: String| PipelineError::Table { path: path.to_owned(), line, reason };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(source);
        let headers = reader.headers().map_err(|e| wrong(1, e.to_string()))?.clone();
        let mut places = [0; 7];
        for (place, column) in places.iter_mut().zip(COLUMNS) {
            *place = headers
                .iter()
                .position(|h| h == column)
                .ok_or_else(|| wrong(1, format!("the column {column} is missing; expected {}", COLUMNS.join(","))))?;
        }
        let mut rays = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|e| {
                let line = e.position().map_or(0, csv::Position::line);
                wrong(line, e.to_string().replace('\n', " "))
            })?;
            let line = record.position().map_or(0, csv::Position::line);
            let mut cells = [0.0; 7];
            for ((cell, place), column) in cells.iter_mut().zip(places).zip(COLUMNS) {
                let text = record.get(place).unwrap_or_default();
                *cell = text
                    .parse()
                    .ok()
                    .filter(|v: &f64| v.is_finite())
                    .ok_or_else(|| wrong(line, format!("{column} is '{text}', expected a finite number")))?;
            }
            let [x, y, z, l, m, n, wavelength_nm] = cells;
            let direction = DVec3::new(l, m, n);
            // Six digits are enough to have been meant as direction cosines; they are then made exact.
            if (direction.length() - 1.0).abs() > 1e-6 || n <= 0.0 {
                let expected = "direction cosines with l² + m² + n² = 1 and n above 0";
                return Err(wrong(line, format!("l, m, n are {l}, {m}, {n}, expected {expected}")));
            }
            if wavelength_nm <= 0.0 {
                return Err(wrong(line, format!("wavelength_nm is {wavelength_nm}, expected a number above 0")));
            }
            rays.push((DVec3::new(x, y, z), direction.normalize(), wavelength_nm));
        }
        Ok(Self { rays })
    }

    /// Reads a CSV file; see [`read`](Self::read).
    ///
    /// # Errors
    /// As [`read`](Self::read), and when the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, PipelineError> {
        let file = std::fs::File::open(path)
            .map_err(|e| PipelineError::Read { path: PathBuf::from(path), reason: e.to_string() })?;
        Self::read(std::io::BufReader::new(file), path)
    }

    /// The number of rays.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// Traces the rays and writes a row a surface reached, as CSV with the columns
    /// `ray,surface,x_mm,y_mm,z_mm,l,m,n,opl_mm,fate`.
    ///
    /// `fate` is `passed` for every surface that a ray goes on from; a ray that ends has its last row at the surface
    /// that ended it. A missed surface leaves the ray where it was.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength, or the rows cannot be written.
    pub fn trace(&self, lens: &Lens, settings: &TraceSettings, sink: impl Write) -> Result<(), TraceError> {
        let mut groups: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (ray, (_, _, wavelength_nm)) in self.rays.iter().enumerate() {
            groups.entry(wavelength_nm.to_bits()).or_default().push(ray);
        }
        let mut place_of = vec![(0, 0); self.rays.len()];
        let mut traced = Vec::with_capacity(groups.len());
        for (group, (bits, members)) in groups.iter().enumerate() {
            let mono = lens.at(f64::from_bits(*bits)).map_err(PipelineError::from)?;
            let mut rays = RayBatch::with_capacity(members.len());
            for (place, &ray) in members.iter().enumerate() {
                let (point, direction, _) = self.rays[ray];
                rays.push(point, direction, 0.0);
                place_of[ray] = (group, place);
            }
            traced.push(trace_all(&mono, rays, settings));
        }
        let mut writer = csv::Writer::from_writer(sink);
        writer.write_record(["ray", "surface", "x_mm", "y_mm", "z_mm", "l", "m", "n", "opl_mm", "fate"])?;
        for (ray, (group, place)) in place_of.into_iter().enumerate() {
            write_ray(&mut writer, ray, &traced[group], place)?;
        }
        Ok(writer.flush()?)
    }
}

/// A trace that could not be made or written down.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The trace.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The writing.
    #[error("cannot write the traced rays: {0}")]
    Write(#[from] std::io::Error),
}

impl From<csv::Error> for TraceError {
    fn from(error: csv::Error) -> Self {
        match error.into_kind() {
            csv::ErrorKind::Io(io) => Self::Write(io),
            other => Self::Write(std::io::Error::other(format!("{other:?}"))),
        }
    }
}

/// Rays after each surface, and at the image where there is one.
struct Traced {
    after_surface: Vec<RayBatch>,
    at_image: Option<RayBatch>,
}

fn trace_all(lens: &MonoLens, mut rays: RayBatch, settings: &TraceSettings) -> Traced {
    let rims = if settings.rims_clip { Vignetting::On } else { Vignetting::Off };
    let mut after_surface = Vec::with_capacity(lens.n_surfaces());
    for surface in 0..lens.n_surfaces() {
        lens.trace_surfaces(surface..surface + 1, &mut rays, rims);
        after_surface.push(rays.clone());
    }
    let at_image = settings.film_distance_mm.map(|film_distance_mm| {
        lens.to_film(&mut rays, film_distance_mm);
        rays
    });
    Traced { after_surface, at_image }
}

fn write_ray(
    writer: &mut csv::Writer<impl Write>,
    ray: usize,
    traced: &Traced,
    place: usize,
) -> Result<(), csv::Error> {
    let mut row = |surface: &str, rays: &RayBatch| {
        let (p, d) = (rays.point_mm(place), rays.direction(place));
        let numbers = [p.x, p.y, p.z, d.x, d.y, d.z, rays.opl_mm[place]];
        let fate = match rays.fate[place] {
            RayFate::InFlight => "passed",
            RayFate::Vignetted { .. } => "vignetted",
            RayFate::Missed { .. } => "missed",
            RayFate::TotalReflection { .. } => "total_reflection",
        };
        writer.write_field(ray.to_string())?;
        writer.write_field(surface)?;
        for number in numbers {
            writer.write_field(format!("{number:.16e}"))?;
        }
        writer.write_field(fate)?;
        writer.write_record(None::<&[u8]>)
    };
    for (surface, rays) in traced.after_surface.iter().enumerate() {
        row(&surface.to_string(), rays)?;
        if !rays.fate[place].is_in_flight() {
            return Ok(());
        }
    }
    match &traced.at_image {
        Some(rays) => row("image", rays),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n";

    fn read(text: &str) -> Result<RayTable, PipelineError> {
        RayTable::read(text.as_bytes(), Path::new("rays.csv"))
    }

    fn traced(text: &str, settings: &TraceSettings) -> Vec<Vec<String>> {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let mut out = Vec::new();
        read(text).unwrap().trace(&lens, settings, &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    }

    #[test]
    fn a_ray_has_a_row_a_surface_and_one_at_the_film() {
        let settings = TraceSettings { rims_clip: true, film_distance_mm: Some(36.1) };
        let rows = traced(&format!("{HEADER}0,1,-10,0,0,1,550\n0,0,-10,0,0,1,650\n"), &settings);
        let n_surfaces = Lens::built_in("dgauss-50mm").unwrap().interfaces().len();
        assert_eq!(rows.len(), 1 + 2 * (n_surfaces + 1));
        assert_eq!(rows[0].join(","), "ray,surface,x_mm,y_mm,z_mm,l,m,n,opl_mm,fate");
        assert_eq!([&rows[1][0], &rows[1][1], &rows[1][9]], ["0", "0", "passed"]);
        assert_eq!(rows[n_surfaces + 1][1], "image");
        // A ray along the axis stays on it, and its row is that of the second ray.
        let last = &rows[2 * (n_surfaces + 1)];
        assert_eq!([&last[0], &last[1]], ["1", "image"]);
        assert_eq!(last[3].parse::<f64>().unwrap(), 0.0);
        // A ray near the axis reaches the focus within its spherical aberration.
        assert!(rows[n_surfaces + 1][3].parse::<f64>().unwrap().abs() < 0.01);
    }

    #[test]
    fn a_lost_ray_ends_at_its_surface_unless_rims_are_ignored() {
        let text = format!("{HEADER}0,12.7,-10,0,0,1,550\n");
        let clipped = traced(&text, &TraceSettings { rims_clip: true, film_distance_mm: Some(36.1) });
        assert_eq!((clipped.len(), clipped[1][9].as_str()), (2, "vignetted"));
        let free = traced(&text, &TraceSettings { rims_clip: false, film_distance_mm: None });
        assert!(free.len() > 2 && free[1][9] == "passed");
    }

    #[track_caller]
    fn check_error(text: &str, words: &[&str]) {
        let message = read(text).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "'{word}' in: {message}");
        }
    }

    #[test]
    fn wrong_tables_are_named_with_their_line() {
        check_error("x_mm,y_mm\n", &["rays.csv:1", "z_mm"]);
        check_error(&format!("{HEADER}0,0,0,0,0,1,550\n0,0,0,0,zero,1,550\n"), &["rays.csv:3", "m is 'zero'"]);
        check_error(&format!("{HEADER}0,0,0,0,0,2,550\n"), &["rays.csv:2", "l² + m² + n² = 1"]);
        check_error(&format!("{HEADER}0,0,0,0,0,-1,550\n"), &["rays.csv:2"]);
        check_error(&format!("{HEADER}0,0,0,0,0,1\n"), &["rays.csv:2"]);
        check_error(&format!("{HEADER}0,0,0,0,0,1,0\n"), &["wavelength_nm"]);
        check_error(&format!("{HEADER}0,0,NaN,0,0,1,550\n"), &["z_mm"]);
    }

    #[test]
    fn columns_may_stand_in_any_order() {
        let table = read("wavelength_nm,n,m,l,z_mm,y_mm,x_mm\n550,1,0,0,-3,2,1\n").unwrap();
        assert_eq!(table.rays, [(DVec3::new(1.0, 2.0, -3.0), DVec3::Z, 550.0)]);
    }
}
