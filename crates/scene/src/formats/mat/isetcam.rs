//! Scenes as `ISETCam` saves them: a structure `scene`, or the variables of a multispectral file.
//!
//! Photons are s⁻¹ m⁻² sr⁻¹ nm⁻¹. What the fields hold was taken from `sceneFromFile.m`, `vcReadImage.m` and `illuminantGet.m`
//! of `ISETCam`.

use std::path::Path;

use dioptric_spectrum::{Illuminant, Observer, Quantity, SpectralImage, Spectrum, WavelengthGrid};
use ndarray::Array2;

use super::{
    super::{
        axes,
        contents::Cube as NumberCube,
        light_unit::LightUnit,
        photons::joules_per_photon,
        reading::{FileQuantity, FileReading},
        stated::{name_of, note_of, shown},
        unusable::unreadable,
        wavelength_unit::{self, listed_nm, unit_in},
    },
    container::{Content, MatArray, MatFile, WHOLE},
    elements::Listed,
    hdf5::RADIATION,
    iset_kinds,
    packing::{Nearness, Packing, Value, is_wave_unit, nearest_list, rank_of_waves},
};
use crate::{SceneError, SceneLight};

/// The variables of a scene that are read.
const WANTED: [&str; 10] =
    ["scene", "mcCOEF", "basis", "imgMean", "photons", "wave", "wavelength", "illuminant", "fov", "depthMap"];
/// The most that reflectances are, and the least that photons of any lit scene are.
const MOST_REFLECTANCE: f64 = 10.0;
const LEAST_PHOTONS: f64 = 1e9;
/// Fields of a scene that are read, or change nothing of what it is, beside those of all objects.
const HARMLESS: [&str; 12] = [
    "depthMap",
    "distance",
    "wave",
    "data.dmin",
    "data.dmax",
    "chartP",
    "chartparameters",
    "cornerpoints",
    "rect",
    "color",
    "vAngular",
    "lightFieldType",
];
/// The published cubes that do not list their wavelengths, by variable and bands: first and last, nm.
const KNOWN: [(&str, usize, [f64; 2]); 4] = [
    // Chakrabarti & Zickler 2011 (Harvard).
    ("ref", 31, [420.0, 720.0]),
    // Foster et al. 2004 and 2006 (Manchester).
    ("reflectances", 33, [400.0, 720.0]),
    ("reflectances", 31, [410.0, 710.0]),
    // Choi et al. 2017 (KAIST) and Arad & Ben-Shahar 2016 (ICVL) on its usual 31 bands.
    ("rad", 31, [400.0, 700.0]),
];

/// What a MATLAB file holds.
pub(in super::super) enum MatScene {
    /// A scene of `ISETCam`.
    Iset(IsetScene),
    /// A cube of plain numbers.
    Cube(NumberCube),
    /// Linear red, green and blue, and what of the file is not used.
    Linear([Array2<f32>; 3], Vec<String>),
}

/// Names of arrays of three colors, as Hypersim and others write them.
const COLORS: [&str; 4] = ["dataset", "color", "colors", "rgb"];

/// Bands that a linear model may have: what it takes of memory is at most a thousand times its coefficients.
const LIMIT_BANDS: usize = 1000;

/// A scene from a MATLAB file.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct IsetScene {
    /// Spectral radiance, W m⁻² sr⁻¹ nm⁻¹.
    pub(in super::super) image: SpectralImage,
    /// How far each sample is, m: along the axis where all are as far, or else from the camera; 0 or NaN where nothing was
    /// measured.
    pub(in super::super) depth_m: Option<Array2<f32>>,
    /// One distance for the whole scene, m, where the file states it and no depth of samples.
    pub(in super::super) distance_m: Option<f64>,
    /// The horizontal field of view.
    pub(in super::super) horizontal_fov_deg: Option<f64>,
    /// The light on it, where it is the same everywhere.
    pub(in super::super) light: Option<SceneLight>,
    /// What of the file is not used.
    pub(in super::super) notes: Vec<String>,
}

/// Reads a MATLAB or HDF5 file: an `ISETCam` scene, or a cube of numbers.
///
/// A scene is a structure `scene` (`data.photons`, `spectrum.wave`, and as far as they are there `wAngular`, `depthMap`, `distance`,
/// `illuminant`), or variables: `mcCOEF` and `basis` (the product of coefficients and basis functions, to which `imgMean` is
/// added where it is there), or `photons`, with `wave` or `wavelength`; besides `illuminant`, `fov` and `dist`. Photons
/// coded as whole numbers between `dmin` and `dmax` are decoded. Any other array of three axes is a cube whose quantity is not known:
/// that of the name told, `data`, or the only one.
///
/// # Errors
/// One sentence with the file's name when it is truncated, of another version, or lacks what makes a scene.
pub(in super::super) fn read_mat(path: &Path, reading: &FileReading) -> Result<MatScene, SceneError> {
    let told = reading.variable.as_deref();
    let is_cube = |own: &Listed| own.is_numeric && own.sides.len() == 3;
    let is_list = |own: &Listed| (own.is_list || rank_of_waves(last_part(&own.name)).is_some()) && own.is_numeric;
    let wanted = |own: &Listed| {
        let name = own.name.as_str();
        match told {
            // Others may be of a kind that cannot be read.
            Some(told) => {
                told == name || told.strip_prefix(name).is_some_and(|rest| rest.starts_with('.')) || is_list(own)
            }
            None => WANTED.contains(&name) || name == "dist" || is_cube(own) || is_list(own),
        }
    };
    let file = MatFile::read(path, &wanted)?;
    let wrong = |reason: String| unreadable(path, reason);
    let names: Vec<&str> = file.listed.iter().map(|own| own.name.as_str()).collect();
    let has = |name: &str| names.contains(&name);
    if told.is_none() && (has("scene") || has("mcCOEF") || has("photons")) {
        return of_iset(path, &file, "scene").map(MatScene::Iset);
    }
    if let Some(told) = told
        && file.array(told).map_err(wrong)?.is_some_and(|own| is_scene(&own))
    {
        return of_iset(path, &file, told).map(MatScene::Iset);
    }
    if told.is_none()
        && !file.listed.iter().any(is_cube)
        && let Some(what) = iset_kinds::other_than_scene(&file)
    {
        return Err(wrong(what));
    }
    // What is called data is photons where it is as much as only photons are.
    let is_open = reading.quantity.is_none() && reading.unit.is_none();
    if is_open
        && told.is_none()
        && let Some(data) = file.array("data").map_err(wrong)?
    {
        let most = data.list().unwrap_or_default().into_iter().fold(0.0, f64::max);
        if most > LEAST_PHOTONS {
            let mut scene = of_iset(path, &file, "scene")?;
            let note = format!("its 'data' are taken for photons, since they are up to {most:.1e} (--quantity)");
            scene.notes.push(note);
            return Ok(MatScene::Iset(scene));
        }
    }
    let mut cubes: Vec<&str> = file.listed.iter().filter(|own| is_cube(own)).map(|own| own.name.as_str()).collect();
    if cubes.len() > 1 {
        // A picture of the cube, for people to look at.
        cubes.retain(|own| !last_part(own).eq_ignore_ascii_case("rgb"));
    }
    let name = match told {
        Some(told) if has(told) || file.array(told).map_err(wrong)?.is_some() => told,
        Some(told) => {
            let known = in_structures(path)?.into_iter().map(|(own, _)| own);
            let known: Vec<_> = names.iter().map(|own| (*own).to_owned()).chain(known).collect();
            return Err(wrong(format!("it has no variable '{told}', expected one of {}", known.join(", "))));
        }
        None if file.array("data").map_err(wrong)?.is_some_and(|data| data.numbers().is_ok()) => "data",
        None => match cubes[..] {
            [one] => one,
            [] if file.listed.iter().any(|own| own.is_complex) => {
                let names = file.listed.iter().filter(|own| own.is_complex).map(|own| own.name.as_str());
                return Err(wrong(complex(&names.collect::<Vec<_>>().join(", "))));
            }
            [] => {
                let is_table = |own: &&Listed| own.is_numeric && own.sides.len() == 2 && !own.sides.contains(&1);
                if file.listed.iter().any(is_list) && file.listed.iter().filter(is_table).count() == 1 {
                    let way = "it holds spectra, a table with wavelengths, and no scene: expected a chart of them as .csv, wavelengths in nm and a reflectance a column";
                    return Err(wrong(way.to_owned()));
                }
                let others = file.listed.iter().filter(|own| matches!(own.sides.len(), 0 | 3) && !own.is_numeric);
                let names = others.map(|own| format!(", and its '{}' has no numbers that are read", own.name));
                let expected =
                    "expected a variable 'scene', 'mcCOEF' or 'photons', or an array of three axes outside structures";
                let names = names.collect::<String>();
                let inner = in_structures(path)?.into_iter().filter(|(_, sides)| sides.len() == 3);
                let inner: Vec<_> = inner.map(|(own, _)| own).collect();
                let way =
                    if inner.is_empty() { String::new() } else { format!(", or --variable {}", inner.join(" or ")) };
                return Err(wrong(format!("it holds no scene: {expected}{names}{way}")));
            }
            _ => return Err(wrong(format!("it has several cubes, {}: expected --variable", cubes.join(", ")))),
        },
    };
    let mut cube = cube_of(path, &file, name, reading).map_err(wrong)?;
    let is_unsaid = cube.wavelengths_nm.is_none() && reading.wavelengths_nm.is_none() && cube.quantity.is_none();
    let is_color = file.is_row_major && cube.top.is_none() && COLORS.contains(&last_part(name).to_lowercase().as_str());
    if is_unsaid && is_open && is_color && cube.planes.len() == 3 {
        let mut plane = || cube.planes.remove(0);
        return Ok(MatScene::Linear([plane(), plane(), plane()], cube.notes));
    }
    Ok(MatScene::Cube(cube))
}

/// Returns the arrays of numbers in the structures of a file, as `data.cube`, and the lengths of their sides; a scene of `ISETCam` as one.
fn in_structures(path: &Path) -> Result<Vec<(String, Vec<usize>)>, SceneError> {
    let file = MatFile::read(path, &|own| !own.is_numeric)?;
    let arrays = file.listed.iter().filter(|own| !own.is_numeric).map(|own| (own, file.array(&own.name)));
    let of = |(own, array): (&Listed, Result<Option<MatArray<'_>>, String>)| {
        let array = array.ok()??;
        let sides = || array.field("data").and_then(|data| data.field("photons")).map(|own| own.sides.clone());
        Some(match is_scene(&array) {
            true => vec![(own.name.clone(), sides().unwrap_or_default())],
            false => array.numeric_fields(&own.name),
        })
    };
    Ok(arrays.filter_map(of).flatten().collect())
}

/// Returns the name of an array without the groups that it is in.
fn last_part(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

fn complex(names: &str) -> String {
    format!("its '{names}' has complex numbers, expected real ones: save their magnitudes (abs)")
}

/// Returns a variable as a cube of plain numbers.
fn cube_of(path: &Path, file: &MatFile, name: &str, reading: &FileReading) -> Result<NumberCube, String> {
    let array = file.array(name)?.ok_or_else(|| format!("it has no variable '{name}'"))?;
    if file.listed.iter().any(|own| own.name == name && own.is_complex) {
        return Err(complex(name));
    }
    let numbers = array.numbers().map_err(|what| {
        let inner = array.numeric_fields(name).into_iter().map(|(own, _)| own).collect::<Vec<_>>();
        let way = if inner.is_empty() { String::new() } else { format!(": --variable {}", inner.join(" or ")) };
        format!("its '{name}' is {what}, expected numbers{way}")
    })?;
    let packing = Packing::of(file.attributes_of(name));
    let (order, named) = axes::order(file.words_of(name).1, reading.axes.as_deref());
    let waves = waves_of(file, name, &array.sides, order.as_deref(), reading.wavelengths_nm.is_some())?;
    // What is known by name gives way to what is told.
    let known = KNOWN
        .iter()
        .filter(|_| reading.wavelengths_nm.is_none())
        .find(|(own, n, _)| *own == name && array.sides.last() == Some(n))
        .map(|(_, n, [first, last])| {
            (0..*n).map(|i| first + (last - first) * i as f64 / (*n as f64 - 1.0)).collect::<Vec<f64>>()
        });
    let stated = match packing.wavelengths_nm(&array.sides) {
        Ok(stated) => stated.filter(|_| waves.is_none()),
        Err(_) if reading.wavelengths_nm.is_some() || waves.is_some() => None,
        Err(reason) => return Err(reason),
    };
    let own = waves.as_ref().map(|waves| waves.nm.clone()).or(stated.clone()).or(known);
    let n_bands = reading.wavelengths_nm.as_ref().or(own.as_ref()).map(Vec::len);
    let unit = UnitOf::read(packing.unit.as_deref());
    let packing = if matches!(unit, UnitOf::Light(..)) { packing } else { packing.of_reflectances() };
    let percent = if matches!(unit, UnitOf::Percent) && packing.white.is_none() { 0.01 } else { 1.0 };
    let planes = axes::planes(&array.sides, order.as_deref(), n_bands, file.is_row_major, |index| {
        (percent * packing.unpacked(numbers.at(index))) as f32
    })?;
    let is_depth = |own: &str| reading.depth.is_none() && reading.depth_variable.as_deref() == Some(own);
    let holds = |own: &str| name.strip_prefix(own).is_some_and(|rest| rest.starts_with('.'));
    let used =
        |own: &str| own == name || holds(own) || is_depth(own) || waves.as_ref().is_some_and(|waves| waves.name == own);
    let mut unused: Vec<String> = file.listed.iter().map(|own| own.name.clone()).filter(|own| !used(own)).collect();
    for outer in file.listed.iter().filter(|own| holds(&own.name)) {
        let fields = file.array(&outer.name)?.map(|array| array.leaves(&outer.name)).unwrap_or_default();
        unused.extend(fields.into_iter().filter(|own| !used(own)));
    }
    let mut notes: Vec<String> = note_of(path, "variable", &unused).into_iter().collect();
    notes.extend(note_of_elements(path, file, name));
    let file_name = name_of(path);
    let ambiguous = axes::note(&array.sides, order.as_deref(), n_bands, file.is_row_major);
    notes.extend(named.into_iter().chain(ambiguous).map(|note| format!("{file_name}: '{name}': {note}")));
    let of_file = file.attributes_of(WHOLE).iter().map(|own| own.name.clone());
    let mut left = packing.left(!matches!(unit, UnitOf::Unknown), stated.is_some());
    left.extend(waves.iter().flat_map(|waves| waves.left.iter().map(|name| format!("{name} of {}", waves.name))));
    notes.extend(note_of(path, "attribute", &of_file.chain(left).collect::<Vec<_>>()));
    let is_reflectance = matches!(unit, UnitOf::Percent | UnitOf::Reflectance) || packing.white.is_some();
    let mut quantity = is_reflectance.then_some(FileQuantity::Reflectance);
    let is_integer = numbers.is_integer && !packing.is_packed();
    let told = reading.quantity.is_some() || reading.unit.is_some();
    if !told && !is_integer && quantity.is_none() && !matches!(unit, UnitOf::Light(..)) {
        let most = planes.iter().flatten().copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
        let most = f64::from(most);
        if most > LEAST_PHOTONS {
            quantity = Some(FileQuantity::Photons);
            notes.push(format!("its '{name}' are taken for photons, since they are up to {most:.1e} (--quantity)"));
        } else if most <= MOST_REFLECTANCE && (name == "reflectances" || name == "reflectance") {
            quantity = Some(FileQuantity::Reflectance);
        }
    }
    let top = (is_integer && percent == 1.0).then(|| numbers.top());
    let unit = if let UnitOf::Light(unit, text) = unit { Some((unit, text)) } else { None };
    let packed = Some(percent * packing.scale).filter(|_| packing.is_packed() || percent != 1.0);
    let called = Some(last_part(name).to_owned());
    Ok(NumberCube { planes, top, wavelengths_nm: own, quantity, unit, called, packed, notes })
}

/// What the unit of numbers says that they are.
pub(in super::super) enum UnitOf {
    Light(LightUnit, String),
    Reflectance,
    Percent,
    /// Nothing that is known.
    Unknown,
}

impl UnitOf {
    pub(in super::super) fn read(text: Option<&str>) -> Self {
        let Some(text) = text else { return Self::Unknown };
        match text.to_lowercase().as_str() {
            "%" | "percent" => Self::Percent,
            "reflectance" | "transmittance" => Self::Reflectance,
            _ => match LightUnit::parse(text).filter(|unit| unit.quantity == Quantity::Radiance) {
                Some(unit) => Self::Light(unit, text.to_owned()),
                None => Self::Unknown,
            },
        }
    }
}

/// A list of wavelengths beside a cube.
struct Waves {
    name: String,
    nm: Vec<f64>,
    /// The names of what is stated of it and not used.
    left: Vec<String>,
}

/// Returns the list of wavelengths beside a cube of these sides, whose axes are in this order where it is known; none where wavelengths are told
/// and the list is no likely one.
fn waves_of(
    file: &MatFile,
    cube: &str,
    sides: &[usize],
    order: Option<&str>,
    is_told: bool,
) -> Result<Option<Waves>, String> {
    // Those of the structure that the cube is in before all others.
    let inner = match cube.rsplit_once('.') {
        Some((outer, _)) => file.array(outer)?.map(|array| array.numeric_fields(outer)).unwrap_or_default(),
        None => vec![],
    };
    let names = inner.iter().map(|(name, _)| name).chain(file.listed.iter().map(|own| &own.name));
    let rank = |own: &&String| rank_of_waves(last_part(own).rsplit('.').next().unwrap_or_default());
    let names: Vec<&String> = names.filter(|own| *own != cube).collect();
    // What standard names call it, whatever its own.
    let is_said = |own: &String| file.words_of(own).0.contains(RADIATION);
    // The only scale of the axis of bands is one whatever it is called: of the axis that is named so, or that alone is as long as a list.
    let n_of =
        |own: &str| file.listed.iter().find(|listed| listed.name == own).map(|listed| listed.sides.iter().product());
    let as_long = |own: &&String| {
        let mut alike = (0..sides.len()).filter(|axis| Some(sides[*axis]) == n_of(own));
        alike.next().filter(|_| alike.next().is_none())
    };
    let bands = order
        .and_then(|order| order.find('b'))
        .or_else(|| names.iter().filter(|own| rank(own).is_some() || is_said(own)).find_map(as_long));
    let is_scale = |own: &String| {
        let mut scales = file.scales_of(cube).iter().enumerate();
        scales.any(|(axis, all)| all[..] == [own.as_str()] && bands == Some(axis))
    };
    let is_list = |own: &&String| rank(own).is_some() || is_scale(own) || is_said(own);
    let mut lists: Vec<&String> = names.iter().copied().filter(is_list).collect();
    // Those along a dimension of the cube before others.
    let axes = file.words_of(cube).1;
    // As netCDF has them ("Climate and Forecast", 5).
    let coordinates = file.attributes_of(cube).iter().find_map(|own| match &own.value {
        Value::Text(text) if own.name == "coordinates" => Some(text.as_str()),
        _ => None,
    });
    let nearness = |own: &String| {
        let is_own = || match file.scales_of(cube) {
            [] => axes.iter().any(|axis| axis == last_part(own)),
            scales => scales.iter().flatten().any(|scale| scale == own),
        };
        let is_coordinate = || coordinates.is_some_and(|all| all.split_whitespace().any(|word| word == last_part(own)));
        let is_along = || file.words_of(own).1.iter().any(|axis| axes.contains(axis));
        Nearness::of(cube, own).with_axis(match () {
            () if is_own() => 0,
            () if is_coordinate() => 1,
            () if is_along() => 2,
            () => 3,
        })
    };
    lists.sort_by_key(|own| (nearness(own), rank(own)));
    let (mut found, mut lefts) = (vec![], vec![]);
    for own in lists {
        let Some(array) = file.array(own)?.filter(|array| array.sides.iter().filter(|side| **side != 1).count() <= 1)
        else {
            continue;
        };
        let Some(numbers) = array.list().filter(|list| sides.contains(&list.len())) else { continue };
        let packing = Packing::of(file.attributes_of(own));
        let numbers: Vec<f64> = numbers.into_iter().map(|number| packing.unpacked(number)).collect();
        let stated = packing.unit.as_deref().or(packing.wave_unit());
        let unit = stated.or_else(|| unit_in(last_part(own)));
        match listed_nm(own, unit, &numbers) {
            Ok(Some(nm)) => {
                let mut left = packing.left(true, false);
                left.retain(|name| packing.unit.is_some() || !is_wave_unit(name));
                lefts.push(left);
                found.push((own.clone(), nearness(own), nm));
            }
            // A list that counts bands is none, nor is a scale of other numbers.
            Err(_) if is_told && found.is_empty() => return Ok(None),
            Err(reason) if found.is_empty() && rank(&own).is_some() => return Err(reason),
            Ok(None) | Err(_) => {}
        }
    }
    let nearest = match nearest_list(found) {
        Err(_) if is_told => None,
        own => own?,
    };
    let left = lefts.into_iter().next().unwrap_or_default();
    Ok(nearest.map(|(name, nm)| Waves { name, nm, left }))
}

/// Whether a structure is a scene of `ISETCam`.
fn is_scene(array: &MatArray<'_>) -> bool {
    let has = |outer: &str, inner: &str| array.field(outer).is_some_and(|own| own.field(inner).is_some());
    has("data", "photons") && (has("spectrum", "wave") || array.field("wave").is_some())
}

/// Reads a scene of `ISETCam`, a structure of this name or variables.
fn of_iset(path: &Path, file: &MatFile, name: &str) -> Result<IsetScene, SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let Raw { planes, wave_nm, light, depth_m, distance_m, horizontal_fov_deg } = Raw::of(file, name).map_err(wrong)?;
    let values = |reason| SceneError::Values { file: path.to_owned(), reason };
    let order = wavelength_unit::ascending(path, &wave_nm, 0..wave_nm.len())?;
    let grid = WavelengthGrid::new(order.iter().map(|&band| wave_nm[band]).collect()).map_err(values)?;
    let mut planes: Vec<Option<Array2<f32>>> = planes.into_iter().map(Some).collect();
    let planes = order.iter().filter_map(|&band| planes[band].take()).collect();
    let image = SpectralImage::new(Quantity::Radiance, grid, planes).map_err(values)?;
    let light = light.map(|spectrum| light_of(&spectrum)).transpose().map_err(wrong)?;
    let mut notes = unused_of(path, file, name, light.is_some()).map_err(wrong)?;
    if let (Some(map), Some(distance_m)) = (&depth_m, distance_m) {
        let measured = map.iter().map(|z| f64::from(*z)).filter(|z| z.is_finite() && *z > 0.0);
        let [near_m, far_m] = measured.fold([f64::INFINITY, 0.0], |[near, far], z| [near.min(z), far.max(z)]);
        if near_m <= far_m && !(0.99 * near_m..=1.01 * far_m).contains(&distance_m) {
            let of_map = if near_m == far_m { shown(near_m) } else { format!("{} to {}", shown(near_m), shown(far_m)) };
            notes.push(format!(
                "{}: its distance, {} m, is not in its depth map, {of_map} m, which counts",
                name_of(path),
                shown(distance_m)
            ));
        }
    }
    Ok(IsetScene { image, depth_m, distance_m, horizontal_fov_deg, light, notes })
}

/// Returns what is said of arrays of structures, of which the first element is taken.
fn note_of_elements(path: &Path, file: &MatFile, name: &str) -> Option<String> {
    let outer = name.match_indices('.').map(|(at, _)| &name[..at]).chain([name]);
    let has_more = |own: &&str| {
        let array = file.array(own).ok().flatten();
        array.is_some_and(|array| matches!(array.content, Content::Fields(_)) && array.len() > 1)
    };
    let own = outer.into_iter().find(has_more)?;
    Some(format!("{}: of the structures in its '{own}' the first is taken, and the others are not used", name_of(path)))
}

/// Returns notes of the variables and the fields of a scene that are not used.
fn unused_of(path: &Path, file: &MatFile, own: &str, is_lit: bool) -> Result<Vec<String>, String> {
    let names = file.listed.iter().map(|own| own.name.clone());
    let ours = |name: &str| WANTED.contains(&name) || ["dist", "data", "comment", "name"].contains(&name);
    let scene = file.array(own)?;
    let is_used = |name: &str| if scene.is_some() { name == own } else { ours(name) };
    let variables: Vec<String> = names.filter(|name| !is_used(name)).collect();
    let mut notes: Vec<String> = note_of(path, "variable", &variables).into_iter().collect();
    notes.extend(scene.as_ref().and_then(|_| note_of_elements(path, file, own)));
    if let Some(scene) = &scene {
        notes.extend(note_of(path, "field", &iset_kinds::left_of(scene, own, &HARMLESS)));
    }
    let light = match &scene {
        Some(scene) => scene.field("illuminant").cloned(),
        None => file.array("illuminant")?,
    };
    let has_light = light.is_some_and(|own| own.field("data").is_some());
    notes.extend((has_light && !is_lit).then(|| {
        format!("{}: its illuminant is not one spectrum of light for all samples, and is not used", name_of(path))
    }));
    Ok(notes)
}

/// Returns the places of numbers in ascending order.
pub(super) fn ascending(numbers: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..numbers.len()).collect();
    order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
    order
}

/// Returns the light whose perfect white has this radiance.
pub(super) fn light_of(white: &Spectrum) -> Result<SceneLight, String> {
    let illuminant = Illuminant::Spectrum(white.clone());
    illuminant.check().map_err(|error| format!("its illuminant cannot be: {error}"))?;
    let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
    let luminance = Observer::Cie1931.xyz(&fine, &white.sample_held(&fine)).luminance_cd_m2();
    Ok(SceneLight::new(illuminant, std::f64::consts::PI * luminance))
}

/// What the file says, in the order of its bands.
struct Raw {
    planes: Vec<Array2<f32>>,
    wave_nm: Vec<f64>,
    /// The radiance of a perfect white, W m⁻² sr⁻¹ nm⁻¹.
    light: Option<Spectrum>,
    depth_m: Option<Array2<f32>>,
    distance_m: Option<f64>,
    horizontal_fov_deg: Option<f64>,
}

impl Raw {
    fn of(file: &MatFile, name: &str) -> Result<Self, String> {
        if let Some(scene) = file.array(name)? {
            return Self::of_scene(&scene);
        }
        let list_of = |names: [&str; 2]| -> Result<Option<Vec<f64>>, String> {
            for name in names {
                if let Some(array) = file.array(name)? {
                    return Ok(array.list().filter(|list| !list.is_empty()));
                }
            }
            Ok(None)
        };
        let number = |name: &str| Ok::<_, String>(file.array(name)?.and_then(|array| array.number()));
        let (coefficients, basis) = (file.array("mcCOEF")?, file.array("basis")?);
        let (cube, wave_nm) = if let Some(coefficients) = coefficients {
            let basis = basis.ok_or("it has coefficients 'mcCOEF' but no 'basis'")?;
            let wave_nm = basis.field("wave").and_then(MatArray::list).ok_or("its 'basis' has no list 'wave'")?;
            let functions = basis.field("basis").ok_or("its 'basis' has no field 'basis'")?;
            let mean = file.array("imgMean")?.and_then(|array| array.list()).filter(|list| !list.is_empty());
            (of_basis(&coefficients, functions, mean.as_deref(), wave_nm.len())?, wave_nm)
        } else {
            let photons = match file.array("photons")? {
                Some(photons) => Some(photons),
                None => file.array("data")?,
            };
            let photons = photons.ok_or("it has no variable 'photons'")?;
            let wave_nm = list_of(["wave", "wavelength"])?.ok_or("it has no list 'wave' of its bands, nm")?;
            (Cube::of(&photons, "photons", None, wave_nm.len())?, wave_nm)
        };
        let light = file.array("illuminant")?.and_then(|array| white_of(&array, &wave_nm));
        Ok(Self {
            light,
            depth_m: file.array("depthMap")?.map(|map| plane_of(&map, cube.size())).transpose()?,
            distance_m: number("dist")?,
            horizontal_fov_deg: number("fov")?,
            planes: cube.into_watts(&wave_nm)?,
            wave_nm,
        })
    }

    fn of_scene(scene: &MatArray<'_>) -> Result<Self, String> {
        let data = scene.field("data").ok_or("its 'scene' has no field 'data'")?;
        let photons = data.field("photons").ok_or("its 'scene' has no field 'data.photons'")?;
        let wave = scene.field("spectrum").and_then(|spectrum| spectrum.field("wave"));
        let wave_nm = wave.or_else(|| scene.field("wave")).and_then(MatArray::list);
        let wave_nm = wave_nm.ok_or("its 'scene' has no list 'spectrum.wave' of bands, nm")?;
        let number = |name: &str| scene.field(name).and_then(MatArray::number);
        let range = |low: &str, high: &str| Some([data.field(low)?.number()?, data.field(high)?.number()?]);
        let cube = Cube::of(photons, "scene.data.photons", range("dmin", "dmax"), wave_nm.len())?;
        Ok(Self {
            light: scene.field("illuminant").and_then(|array| white_of(array, &wave_nm)),
            depth_m: scene.field("depthMap").map(|map| plane_of(map, cube.size())).transpose()?,
            distance_m: number("distance"),
            horizontal_fov_deg: number("wAngular"),
            planes: cube.into_watts(&wave_nm)?,
            wave_nm,
        })
    }
}

/// Photons of each band.
pub(super) struct Cube(Vec<Array2<f32>>);

impl Cube {
    /// Reads rows × columns × bands, of whole numbers between the ends of `range` where they are coded so.
    pub(super) fn of(
        array: &MatArray<'_>,
        name: &str,
        range: Option<[f64; 2]>,
        n_bands: usize,
    ) -> Result<Self, String> {
        let numbers = array.numbers().map_err(|what| format!("its '{name}' is {what}, expected numbers"))?;
        let (rows, columns) = match array.sides[..] {
            [rows, columns] if n_bands == 1 => (rows, columns),
            [rows, columns, bands] if bands == n_bands => (rows, columns),
            _ => {
                let sides = array.sides.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
                return Err(format!("its '{name}' is {sides}, expected rows × columns × {n_bands}, as many as bands"));
            }
        };
        let [scale, offset] = match (numbers.is_integer, range) {
            (false, _) => [1.0, 0.0],
            (true, Some([low, high])) => [(high - low) / numbers.top(), low],
            (true, None) => {
                return Err(format!("its '{name}' are whole numbers, expected 'dmin' and 'dmax' beside them"));
            }
        };
        let plane = |band: usize| {
            Array2::from_shape_fn((rows, columns), |(row, column)| {
                (scale * numbers.at(row + rows * (column + columns * band)) + offset) as f32
            })
        };
        Ok(Self((0..n_bands).map(plane).collect()))
    }

    fn size(&self) -> (usize, usize) {
        self.0[0].dim()
    }

    /// Returns the energy of the photons.
    pub(super) fn into_watts(mut self, wave_nm: &[f64]) -> Result<Vec<Array2<f32>>, String> {
        for (plane, &nm) in self.0.iter_mut().zip(wave_nm) {
            let joules = joules_per_photon(nm);
            if !(joules.is_finite() && joules > 0.0) {
                return Err(format!("a band lies at {nm} nm, expected a length above 0"));
            }
            plane.mapv_inplace(|photons| (f64::from(photons) * joules) as f32);
        }
        Ok(self.0)
    }
}

/// Returns Σ coefficient × basis function, and the mean, of each sample.
fn of_basis(
    coefficients: &MatArray<'_>,
    functions: &MatArray<'_>,
    mean: Option<&[f64]>,
    n_bands: usize,
) -> Result<Cube, String> {
    let weights = functions.numbers().map_err(|what| format!("its 'basis.basis' is {what}, expected numbers"))?;
    let &[n_rows, n_functions] = &functions.sides[..] else {
        return Err("its 'basis.basis' is no table".to_owned());
    };
    // Each sample is but one of the product's bands: a few numbers must not ask for a million times as many.
    if n_bands > LIMIT_BANDS {
        return Err(format!("its 'basis.wave' has {n_bands} bands, expected at most {LIMIT_BANDS}"));
    }
    if n_rows != n_bands || n_functions == 0 {
        return Err(format!("its 'basis.basis' has {n_rows} rows, expected {n_bands}, as many as 'basis.wave'"));
    }
    if mean.is_some_and(|mean| mean.len() != n_bands) {
        return Err(format!("its 'imgMean' has not {n_bands} numbers, as many as 'basis.wave'"));
    }
    let parts = Cube::of(coefficients, "mcCOEF", None, n_functions)?.0;
    let plane = |band: usize| {
        let offset = mean.map_or(0.0, |mean| mean[band]);
        let mut sum = Array2::from_elem(parts[0].dim(), offset);
        for (k, part) in parts.iter().enumerate() {
            let weight = weights.at(band + n_bands * k);
            ndarray::Zip::from(&mut sum).and(part).for_each(|sum, &v| *sum += weight * f64::from(v));
        }
        sum.mapv(|v| v as f32)
    };
    Ok(Cube((0..n_bands).map(plane).collect()))
}

/// Returns a plane of the scene's size.
fn plane_of(array: &MatArray<'_>, (rows, columns): (usize, usize)) -> Result<Array2<f32>, String> {
    let numbers = array.numbers().map_err(|what| format!("its 'depthMap' is {what}, expected numbers"))?;
    if array.sides != [rows, columns] {
        let sides = array.sides.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
        return Err(format!("its 'depthMap' is {sides}, expected {rows} × {columns}, as the photons are"));
    }
    Ok(Array2::from_shape_fn((rows, columns), |(row, column)| numbers.at(row + rows * column) as f32))
}

/// Returns the radiance of a perfect white, W m⁻² sr⁻¹ nm⁻¹: of a modern illuminant from its photons, of an old one from its
/// energy; `None` where it is not the same everywhere, or of another length than its bands.
pub(super) fn white_of(illuminant: &MatArray<'_>, scene_wave_nm: &[f64]) -> Option<Spectrum> {
    let wave = illuminant.field("spectrum").and_then(|spectrum| spectrum.field("wave"));
    let wave = wave.or_else(|| illuminant.field("wave")).or_else(|| illuminant.field("wavelength"));
    let wave_nm = wave.and_then(MatArray::list).unwrap_or_else(|| scene_wave_nm.to_vec());
    let data = illuminant.field("data")?;
    let watts = match data.field("photons") {
        Some(photons) => {
            let numbers = photons.numbers().ok()?;
            let of = |name: &str| data.field(name).and_then(MatArray::number);
            let [scale, offset] = match (numbers.is_integer, of("min"), of("max")) {
                (false, ..) => [1.0, 0.0],
                (true, Some(low), Some(high)) => [(high - low) / numbers.top(), low],
                _ => return None,
            };
            let list = photons.list()?;
            list.iter().zip(&wave_nm).map(|(n, &nm)| (scale * n + offset) * joules_per_photon(nm)).collect()
        }
        None => data.list()?,
    };
    let n_numbers = data.field("photons").map_or(data.len(), MatArray::len);
    if n_numbers != wave_nm.len() {
        return None;
    }
    let order = ascending(&wave_nm);
    Spectrum::new(order.iter().map(|&i| wave_nm[i]).collect(), order.iter().map(|&i| watts[i]).collect()).ok()
}
