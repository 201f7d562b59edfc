//! Tables of points that shine (`.csv`): stars, LEDs, lamps.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use dioptric_files::text;
use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid};

use super::{
    light_file::{is_light_file, read_light},
    stated::short,
};
use crate::{PointBrightness, PointLight, PointPlace, SceneError};

/// Points as a table states them, on no bands yet.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTable {
    points: Vec<Line>,
}

#[derive(Clone, Debug, PartialEq)]
struct Line {
    place: PointPlace,
    depth_m: f64,
    amount: Amount,
    color: Color,
}

/// How bright a point is said to be.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Amount {
    /// Apparent magnitude in V (Johnson).
    Magnitude(f64),
    /// Illuminance at the projection center, lux.
    Lux(f64),
    /// Luminous intensity, cd.
    Candela(f64),
    /// Radiant intensity, W sr⁻¹, all wavelengths of the light together.
    WattsPerSteradian(f64),
}

/// The spectrum of a point.
#[derive(Clone, Debug, PartialEq)]
enum Color {
    Of(Illuminant),
    /// A line, nm.
    Line(f64),
}

/// Irradiance of a star of magnitude 0 in V at 550 nm, W m⁻² nm⁻¹: 363.1e-11 erg s⁻¹ cm⁻² Å⁻¹ (Bessell, Castelli and Plez 1998, table A2).
const MAGNITUDE_0: f64 = 3.631e-11;
const V_NM: f64 = 550.0;

/// The columns of a table.
const PLACES: [[&str; 2]; 2] = [["x_deg", "y_deg"], ["x_mm", "y_mm"]];
const AMOUNTS: [&str; 4] = ["magnitude", "lux", "candela", "w_per_sr"];
const OTHERS: [&str; 3] = ["depth_m", "light", "name"];

impl PointTable {
    /// Reads a table with a line of names: `x_deg` and `y_deg` (angles to the right and upwards) or `x_mm` and `y_mm` (on the film); `magnitude`, `lux`,
    /// `candela` or `w_per_sr`; and, if there are, `depth_m` (left out or `inf` for stars), `light` (as [`Illuminant::parse`] has it, a line as `589nm`, or the file of a
    /// light beside the table; D65 if left out) and `name`. Lines that begin with # are comments.
    ///
    /// # Errors
    /// Names the line and the column that cannot be read.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let unreadable = |reason: String| SceneError::Unreadable { file: path.to_owned(), reason };
        let text = text::read(path).map_err(|error| unreadable(error.to_string()))?;
        Self::parse(&text::with_commas(&text), path.parent().unwrap_or(Path::new("")))
            .map_err(|reason| SceneError::Unreadable { file: path.to_owned(), reason })
    }

    /// Returns the files of lights that a table names, as far as it can be read.
    pub fn light_files(path: &Path) -> Vec<PathBuf> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let text = text::read(path).unwrap_or_default();
        let text = text::with_commas(&text);
        let cells =
            text.lines().flat_map(|line| line.split(',')).map(|cell| folder.join(cell.trim().trim_matches('"')));
        cells.filter(|path| path.is_file()).collect()
    }

    /// Parses a table that lies in this folder.
    fn parse(text: &str, folder: &Path) -> Result<Self, String> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let mut columns = BTreeMap::new();
        for (number, name) in reader.headers().map_err(|error| error.to_string())?.iter().enumerate() {
            let name = name.trim_matches(['"', ' ']).to_ascii_lowercase();
            let is_known = PLACES.as_flattened().iter().chain(&AMOUNTS).chain(&OTHERS).any(|known| *known == name);
            if !is_known {
                let known = [PLACES.as_flattened(), &AMOUNTS, &OTHERS].concat().join(", ");
                let name = short(&name);
                return Err(format!("line 1: the column '{name}' is not known, expected some of {known}"));
            }
            if columns.insert(name.clone(), number).is_some() {
                return Err(format!("line 1: the column '{name}' stands there twice"));
            }
        }
        let has = |name: &str| columns.contains_key(name);
        let places: Vec<[&str; 2]> = PLACES.into_iter().filter(|pair| pair.iter().any(|name| has(name))).collect();
        let amounts: Vec<&str> = AMOUNTS.into_iter().filter(|name| has(name)).collect();
        let (&[place], &[amount]) = (places.as_slice(), amounts.as_slice()) else {
            let expected = "expected x_deg and y_deg, or x_mm and y_mm, and one of magnitude, lux, candela, w_per_sr";
            return Err(format!("line 1: {expected}"));
        };
        if let Some(missing) = place.into_iter().find(|name| !has(name)) {
            return Err(format!("line 1: expected a column '{missing}'"));
        }

        let mut points = vec![];
        for record in reader.records() {
            let record = record.map_err(|error| error.to_string())?;
            let line = record.position().map_or(0, csv::Position::line);
            if record.len() != columns.len() {
                return Err(format!("line {line}: {} columns, expected {}", record.len(), columns.len()));
            }
            let cell =
                |name: &str| columns.get(name).and_then(|&number| record.get(number)).filter(|text| !text.is_empty());
            let number = |name: &str| {
                let text = cell(name).ok_or_else(|| format!("line {line}: expected a number for {name}"))?;
                let number = text.parse::<f64>().ok().filter(|number| !number.is_nan());
                number.ok_or_else(|| format!("line {line}: {name} is '{}', expected a number", short(text)))
            };
            let [x, y] = [number(place[0])?, number(place[1])?];
            let place = match place[0] {
                "x_deg" if x.abs() < 90.0 && y.abs() < 90.0 => {
                    PointPlace::Field { tan_x: x.to_radians().tan(), tan_y: y.to_radians().tan() }
                }
                "x_deg" => return Err(format!("line {line}: {x}°, {y}° is beside the camera, expected less than 90°")),
                _ => PointPlace::Film { x_mm: x, y_mm: y },
            };
            let depth_m = if cell("depth_m").is_some() { number("depth_m")? } else { f64::INFINITY };
            let value = number(amount)?;
            if amount != "magnitude" && !(value.is_finite() && value >= 0.0) {
                return Err(format!("line {line}: {amount} is {value}, expected a finite number of 0 or more"));
            }
            let amount = match amount {
                "magnitude" => Amount::Magnitude(value),
                "lux" => Amount::Lux(value),
                "candela" => Amount::Candela(value),
                _ => Amount::WattsPerSteradian(value),
            };
            let color = match cell("light") {
                Some(text) => Color::parse(text, folder).map_err(|reason| format!("line {line}: {reason}"))?,
                None => Color::Of(Illuminant::D65),
            };
            let point = Line { place, depth_m, amount, color };
            point.check().map_err(|reason| format!("line {line}: {reason}"))?;
            points.push(point);
        }
        match points.is_empty() {
            true => Err("it has no point".to_owned()),
            false => Ok(Self { points }),
        }
    }

    /// The number of points.
    #[expect(clippy::len_without_is_empty, reason = "a table has a point at least")]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Returns the points on bands.
    ///
    /// # Errors
    /// When the brightness of a point cannot be.
    pub fn on(&self, grid: &WavelengthGrid) -> Result<Vec<PointLight>, SceneError> {
        self.points.iter().map(|line| line.on(grid)).collect()
    }
}

impl Color {
    fn parse(text: &str, folder: &Path) -> Result<Self, String> {
        if let Some(nm) = text.strip_suffix("nm").and_then(|number| number.trim().parse::<f64>().ok()) {
            return match (100.0..1e5).contains(&nm) {
                true => Ok(Self::Line(nm)),
                false => Err(format!("light is '{}', expected a wavelength of 100 nm to 100000 nm", short(text))),
            };
        }
        let path = folder.join(text);
        if is_light_file(&path) {
            return read_light(&path).map(Self::Of).map_err(|error| error.to_string());
        }
        Illuminant::parse(text).map(Self::Of).map_err(|_| {
            let names = Illuminant::NAMES.join(", ");
            let text = short(text);
            format!("light is '{text}', expected {names}, a temperature (3000K), a chromaticity (\"0.46,0.414\"), a line (589nm) or the file of a light")
        })
    }

    /// Returns the spectrum, per nm, of which 1 nm by 1 nm from 360 nm to 830 nm the luminous part is 1 lm, on bands.
    fn per_lumen(&self, grid: &WavelengthGrid) -> Result<Vec<f64>, String> {
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).map_err(|error| error.to_string())?;
        let lumens = Observer::Cie1931.xyz(&fine, &self.on(&fine)).luminance_cd_m2();
        if lumens > 0.0 {
            return Ok(self.on(grid).into_iter().map(|value| value / lumens).collect());
        }
        Err("lux or candela of a light that no eye sees".to_owned())
    }

    /// Returns the spectrum, relative, as means over bands: of a line its whole power, 1 W, in the band that it falls into.
    fn on(&self, grid: &WavelengthGrid) -> Vec<f64> {
        match self {
            Self::Of(illuminant) => illuminant.on_bands(grid),
            Self::Line(nm) => {
                let bands = grid.middles_nm().into_iter().zip(grid.widths_nm());
                let is_within = |middle: f64, width: f64| (-0.5..0.5).contains(&((nm - middle) / width));
                bands.map(|(middle, width)| if is_within(middle, *width) { 1.0 / width } else { 0.0 }).collect()
            }
        }
    }

    /// The power of what [`on`](Self::on) has, all wavelengths from 360 nm to 830 nm together, or of a line.
    fn watts(&self) -> Result<f64, String> {
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).map_err(|error| error.to_string())?;
        Ok(match self {
            Self::Of(_) => self.on(&fine).iter().sum(),
            Self::Line(_) => 1.0,
        })
    }
}

impl Line {
    /// Checks what can be told without bands.
    fn check(&self) -> Result<(), String> {
        if let (Amount::Magnitude(_), Color::Line(_)) = (self.amount, &self.color) {
            return Err(
                "a magnitude is that of a star, which shines in more than a line: expected lux or w_per_sr".to_owned()
            );
        }
        let grid = WavelengthGrid::uniform(500.0, 600.0, 50.0).map_err(|error| error.to_string())?;
        self.on(&grid).map(|_| ()).map_err(|error| error.to_string())
    }

    fn on(&self, grid: &WavelengthGrid) -> Result<PointLight, SceneError> {
        let wrong = |value: String| SceneError::Setting {
            what: "the brightness of a point",
            value,
            expected: "w_per_sr".to_owned(),
        };
        let relative = || self.color.on(grid).into_iter();
        let scaled = |values: Vec<f64>, by: f64| values.into_iter().map(|value| (by * value) as f32).collect();
        let light = match self.amount {
            Amount::Magnitude(magnitude) => {
                let Color::Of(illuminant) = &self.color else { return Err(wrong("a magnitude of a line".to_owned())) };
                let at_v = illuminant.spectrum().at_held(V_NM);
                let by = MAGNITUDE_0 * 10.0_f64.powf(-0.4 * magnitude) / at_v;
                PointBrightness::Irradiance(scaled(relative().collect(), by))
            }
            Amount::Lux(lux) => PointBrightness::Irradiance(scaled(self.color.per_lumen(grid).map_err(wrong)?, lux)),
            Amount::Candela(candela) => {
                PointBrightness::Intensity(scaled(self.color.per_lumen(grid).map_err(wrong)?, candela))
            }
            Amount::WattsPerSteradian(watts) => {
                let by = watts / self.color.watts().map_err(wrong)?;
                PointBrightness::Intensity(scaled(relative().collect(), by))
            }
        };
        let point = PointLight { place: self.place, depth_m: self.depth_m, light };
        point.check(grid.len())?;
        Ok(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> WavelengthGrid {
        WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap()
    }

    #[test]
    fn lights_may_be_files_beside_the_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("lamp.txt"), "nm power\n400 1\n700 2\n").unwrap();
        let read = |light: &str| {
            std::fs::write(path("p.csv"), format!("x_deg,y_deg,lux,light\n0,0,1,{light}\n")).unwrap();
            PointTable::read(&path("p.csv")).map_err(|error| error.to_string())
        };
        let spectrum = dioptric_spectrum::Spectrum::new(vec![400.0, 700.0], vec![1.0, 2.0]).unwrap();
        assert_eq!(read("lamp.txt").unwrap().points[0].color, Color::Of(Illuminant::Spectrum(spectrum)));
        assert_eq!(PointTable::light_files(&path("p.csv")), [path("lamp.txt")]);
        assert!(
            read("lamp2.csv").unwrap_err().contains("line 2")
                && read("lamp2").unwrap_err().contains("the file of a light")
        );
    }

    fn lumens(by_band: &[f32]) -> f64 {
        let values: Vec<f64> = by_band.iter().map(|value| f64::from(*value)).collect();
        Observer::Cie1931.xyz(&grid(), &values).luminance_cd_m2()
    }

    #[test]
    fn a_table_says_where_points_are_and_how_bright() {
        let text = "# an LED, and a lamp\nName, x_deg, y_deg, depth_m, candela, light\nLED, 1.5, -0.5, 3, 2, 589nm\nlamp, 0, 0, 10, 40, 2856K\n";
        let points = PointTable::parse(text, Path::new("")).unwrap().on(&grid()).unwrap();
        assert_eq!(points.len(), 2);
        let PointPlace::Field { tan_x, tan_y } = points[0].place else { panic!("{:?}", points[0].place) };
        assert!((tan_x - 1.5_f64.to_radians().tan()).abs() < 1e-12 && tan_y < 0.0);
        assert_eq!(points[0].depth_m, 3.0);
        let PointBrightness::Intensity(lamp) = &points[1].light else { panic!() };
        assert!((lumens(lamp) / 40.0 - 1.0).abs() < 0.01, "{}", lumens(lamp));
        let PointBrightness::Intensity(led) = &points[0].light else { panic!() };
        // 683 V(589 nm) = 525.6 lm/W (CIE 1931 at 589 nm: 0.769).
        let watts: f64 = led.iter().map(|value| f64::from(*value) * 10.0).sum();
        assert!((watts * 525.4 / 2.0 - 1.0).abs() < 2e-3, "{watts}");
    }

    /// A star of magnitude 0 brings 2.54 µlx to 2.65 µlx (Allen, Astrophysical Quantities, section 3.5: 2.54e-6 outside of the atmosphere).
    #[test]
    fn magnitudes_are_those_of_v() {
        let points = PointTable::parse("x_mm,y_mm,magnitude,light\n1,2,0,5800K\n1,2,5,5800K\n", Path::new(""))
            .unwrap()
            .on(&grid())
            .unwrap();
        let lux: Vec<f64> = points.iter().map(|point| lumens(point.light.by_band())).collect();
        assert!((2.4e-6..2.75e-6).contains(&lux[0]), "{lux:?}");
        assert!((lux[0] / lux[1] - 100.0).abs() < 1e-3);
        assert!(points[0].depth_m.is_infinite());
        assert_eq!(points[0].place, PointPlace::Film { x_mm: 1.0, y_mm: 2.0 });
    }

    #[test]
    fn what_cannot_be_is_refused_by_line_and_column() {
        for (text, words) in [
            ("x_deg,y_deg\n0,0\n", "magnitude, lux, candela, w_per_sr"),
            ("x_deg,y_deg,lux,candela\n0,0,1,1\n", "one of"),
            ("x_deg,lux\n0,1\n", "y_deg"),
            ("x_deg,y_deg,lux,color\n0,0,1,red\n", "'color' is not known"),
            ("x_deg,y_deg,lux\n0,0,1\n0,up,1\n", "line 3: y_deg is 'up'"),
            ("x_deg,y_deg,lux\n0,0,-1\n", "line 2: lux is -1"),
            ("x_deg,y_deg,lux\n95,0,1\n", "beside the camera"),
            ("x_deg,y_deg,candela\n0,0,1\n", "line 2: the depth"),
            ("x_deg,y_deg,candela,depth_m\n0,0,1,-2\n", "line 2: the depth"),
            ("x_deg,y_deg,magnitude,light\n0,0,1,589nm\n", "line 2: a magnitude"),
            ("x_deg,y_deg,lux,light\n0,0,1,950nm\n", "no eye sees"),
            ("x_deg,y_deg,lux,light\n0,0,1,D99\n", "line 2: light is 'D99'"),
            ("x_deg,y_deg,lux\n", "no point"),
            ("x_deg,y_deg,lux\n0,0,inf\n", "line 2: lux is inf"),
            ("x_deg,y_deg,lux\n1,2\n", "line 2: 2 columns, expected 3"),
            ("x_deg,y_deg,lux\n1,2,3,4\n", "line 2: 4 columns, expected 3"),
        ] {
            let found = PointTable::parse(text, Path::new("")).unwrap_err();
            assert!(found.contains(words), "{text}: {found}");
        }
    }
}
