//! The surfaces of a lens as rows that can be changed, and a lens made of such rows.

use dioptric_optics::{GlassCatalogue, LensFile};
use dioptric_pipeline::LensReadOptions;
use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{PyBool, PyDict, PyList, PyString, PyTuple},
};

use crate::{
    errors::{exception, wrong, wrong_type},
    input::{number, numbers, type_name},
    serial::{from_python, to_python},
};

/// The entries of a row, as `Lens.surfaces` gives them.
const ENTRIES: &[&str] = &[
    "radius_mm",
    "thickness_mm",
    "semi_aperture_mm",
    "medium",
    "stop",
    "conic",
    "coefficients",
    "shape",
    "mirror",
    "coating",
    "comment",
];

/// Returns the surfaces as a list of dictionaries with all of [`ENTRIES`].
pub(crate) fn rows_of<'py>(py: Python<'py>, file: &LensFile) -> PyResult<Bound<'py, PyList>> {
    let data = to_python(py, &in_use(file))?;
    let of_file = data.get_item("surfaces")?.cast_into::<PyList>()?;
    let rows = PyList::empty(py);
    for (row, interface) in of_file.iter().zip(file.lens.interfaces()) {
        let row = row.cast_into::<PyDict>()?;
        for (entry, usual) in [("stop", false), ("mirror", false)] {
            if !row.contains(entry)? {
                row.set_item(entry, usual)?;
            }
        }
        if !row.contains("comment")? {
            row.set_item("comment", "")?;
        }
        if interface.surface.curvature_per_mm == 0.0 {
            row.set_item("radius_mm", f64::INFINITY)?;
        }
        row.set_item("medium", medium_shown(row.get_item("medium")?)?)?;
        show_shape(&row)?;
        let ordered = PyDict::new(py);
        for entry in ENTRIES {
            ordered.set_item(entry, row.get_item(entry)?)?;
        }
        rows.append(ordered)?;
    }
    Ok(rows)
}

/// Returns the lens in use without the other configurations of its file, whose surfaces the changes of one row would not reach.
fn in_use(file: &LensFile) -> LensFile {
    LensFile { configurations: Vec::new(), configuration: 1, ..file.clone() }
}

/// Returns the medium behind a surface as `Lens.from_surfaces` takes it: nothing for air, a name, an index, else the file's own.
fn medium_shown(medium: Option<Bound<'_, PyAny>>) -> PyResult<Option<Bound<'_, PyAny>>> {
    let Some(medium) = medium else { return Ok(None) };
    let Ok(dict) = medium.cast::<PyDict>() else { return Ok(None) };
    if let Some(name) = dict.get_item("Named")? {
        return Ok(Some(name));
    }
    match dict.get_item("Constant")? {
        Some(constant) => constant.get_item("index").map(Some),
        None => Ok(Some(medium)),
    }
}

/// Puts conic and coefficients of surfaces of revolution in place of the file's shape.
fn show_shape(row: &Bound<'_, PyDict>) -> PyResult<()> {
    let py = row.py();
    let shape = row.get_item("shape")?;
    let (mut conic, mut coefficients, mut other) =
        (0.0_f64.into_pyobject(py)?.into_any(), PyList::empty(py).into_any(), None);
    if let Some(shape) = shape {
        let of = |name: &str| shape.cast::<PyDict>().ok().and_then(|dict| dict.get_item(name).ok().flatten());
        if let Some(own) = of("Conic") {
            conic = own.get_item("conic")?;
        } else if let Some(own) = of("EvenAsphere") {
            (conic, coefficients) = (own.get_item("conic")?, own.get_item("coefficients")?);
        } else {
            other = Some(shape);
        }
    }
    row.set_item("conic", conic)?;
    row.set_item("coefficients", coefficients)?;
    row.set_item("shape", other)
}

/// Returns the lens of rows or of columns; `stop` is the place of the stop where no row says it.
pub(crate) fn lens_of(
    surfaces: &Bound<'_, PyAny>,
    (name, stop, film_mm): (&str, Option<usize>, Option<f64>),
) -> PyResult<LensFile> {
    let py = surfaces.py();
    let rows = match surfaces.cast::<PyDict>() {
        Ok(columns) => rows_of_columns(columns)?,
        Err(_) => surfaces.try_iter().map_err(|_| not_surfaces(surfaces))?.collect::<PyResult<Vec<_>>>()?,
    };
    if let Some(stop) = stop.filter(|stop| *stop >= rows.len()) {
        return Err(wrong("stop", stop, &format!("the number of a surface, 0 to {}", rows.len().saturating_sub(1))));
    }
    let list = PyList::empty(py);
    for (surface, row) in rows.iter().enumerate() {
        let row = row_of_file(surface, row)?;
        if let Some(stop) = stop {
            row.set_item("stop", surface == stop)?;
        }
        list.append(row)?;
    }
    let data = PyDict::new(py);
    data.set_item("name", name)?;
    data.set_item("source", "made in Python")?;
    data.set_item("surfaces", list)?;
    if let Some(film_mm) = film_mm {
        data.set_item("film_distance_mm", film_mm)?;
    }
    let file = from_python("the lens", data.as_any())?;
    LensReadOptions::default().coated(file).map_err(exception)
}

/// Returns the lens with some entries of a surface changed.
pub(crate) fn with_surface(file: &LensFile, surface: usize, changes: &Bound<'_, PyDict>) -> PyResult<LensFile> {
    let py = changes.py();
    // A lens that is stopped down can be opened again afterwards.
    let lens = &file.lens;
    let open = lens.with_stop_diameter_mm(2.0 * lens.full_stop_semi_aperture_mm()).map_err(exception)?;
    let file = &LensFile { lens: open, ..file.clone() };
    let rows = rows_of(py, file)?;
    let Some(row) = rows.iter().nth(surface) else {
        return Err(wrong("surface", surface, &format!("0 to {}", rows.len().saturating_sub(1))));
    };
    check_entries("with_surface()", changes)?;
    let row = row.cast_into::<PyDict>()?;
    row.update(changes.as_mapping())?;
    if changes.get_item("stop")?.is_some_and(|stop| stop.is_truthy().unwrap_or(false)) {
        for (_, other) in rows.iter().enumerate().filter(|(place, _)| *place != surface) {
            other.set_item("stop", false)?;
        }
    }
    let data = to_python(py, &in_use(file))?.cast_into::<PyDict>()?;
    let list = PyList::empty(py);
    for (place, row) in rows.iter().enumerate() {
        list.append(row_of_file(place, &row)?)?;
    }
    data.set_item("surfaces", list)?;
    let name = format!("{}, changed", file.lens.name().trim_end_matches(", changed"));
    data.set_item("name", name)?;
    let mut changed: LensFile = from_python("the lens", data.as_any())?;
    changed.lens = changed.lens.with_light_loss(lens.other_coating().cloned()).map_err(exception)?;
    let is_of_stop = changes.contains("stop")? || (surface == lens.stop() && changes.contains("semi_aperture_mm")?);
    let changed = match is_of_stop {
        true => changed,
        false => {
            let stopped = changed.lens.with_stop_diameter_mm(2.0 * lens.stop_semi_aperture_mm()).map_err(exception)?;
            LensFile { lens: stopped.with_glass_range(lens.glass_range()), ..changed }
        }
    };
    Ok(LensFile { notes: file.notes.clone(), microlens: file.microlens.clone(), ..changed })
}

/// Returns rows of a dictionary of columns, each of one number a surface.
fn rows_of_columns<'py>(columns: &Bound<'py, PyDict>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let py = columns.py();
    let mut rows: Option<Vec<Bound<'py, PyDict>>> = None;
    for (entry, column) in columns.iter() {
        let name: String = entry.extract()?;
        let cells =
            column.try_iter().map_err(|_| wrong_type(&name, type_name(&column), "a list, one entry a surface"))?;
        let cells = cells.collect::<PyResult<Vec<_>>>()?;
        let rows = rows.get_or_insert_with(|| cells.iter().map(|_| PyDict::new(py)).collect());
        if rows.len() != cells.len() {
            return Err(wrong(&name, format!("of {} entries", cells.len()), &format!("{}, one a surface", rows.len())));
        }
        for (row, cell) in rows.iter().zip(cells) {
            row.set_item(&entry, cell)?;
        }
    }
    Ok(rows.unwrap_or_default().into_iter().map(Bound::into_any).collect())
}

fn not_surfaces(found: &Bound<'_, PyAny>) -> PyErr {
    wrong_type("surfaces", type_name(found), "a list of dictionaries, one a surface, or a dictionary of columns")
}

fn check_entries(of: &str, row: &Bound<'_, PyDict>) -> PyResult<()> {
    for entry in row.keys() {
        let entry: String = entry.extract()?;
        if !ENTRIES.contains(&entry.as_str()) {
            let known = ENTRIES.join(", ");
            return Err(PyTypeError::new_err(format!("{of} has no entry '{entry}'; it has {known}")));
        }
    }
    Ok(())
}

/// Returns a row as it stands in our own lens file.
fn row_of_file<'py>(surface: usize, row: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let py = row.py();
    let row =
        row.cast::<PyDict>().map_err(|_| wrong_type(&format!("surface {surface}"), type_name(row), "a dictionary"))?;
    let of = format!("surface {surface}");
    check_entries(&of, row)?;
    let given = |entry: &str| -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(row.get_item(entry)?.filter(|value| !value.is_none()))
    };
    let key = |entry: &str| format!("{of}: {entry}");
    let out = PyDict::new(py);
    for entry in ["thickness_mm", "semi_aperture_mm"] {
        match given(entry)? {
            Some(value) => out.set_item(entry, number(&key(entry), &value)?)?,
            None => return Err(wrong(&key(entry), "missing", "a length in mm")),
        }
    }
    if let Some(radius) = given("radius_mm")? {
        let radius_mm = number(&key("radius_mm"), &radius)?;
        if !radius_mm.is_infinite() {
            out.set_item("radius_mm", radius_mm)?;
        }
    }
    for entry in ["stop", "mirror"] {
        if let Some(flag) = given(entry)? {
            out.set_item(entry, PyBool::new(py, flag.is_truthy()?))?;
        }
    }
    for entry in ["coating", "comment"] {
        if let Some(value) = given(entry)? {
            out.set_item(entry, value)?;
        }
    }
    if let Some(medium) = given("medium")? {
        out.set_item("medium", medium_of_file(&key("medium"), &medium)?)?;
    }
    let conic = given("conic")?.map_or(Ok(0.0), |value| number(&key("conic"), &value))?;
    let coefficients = match given("coefficients")? {
        Some(list) if list.len().is_ok_and(|n| n == 0) => Vec::new(),
        Some(list) => numbers(&key("coefficients"), &list)?,
        None => Vec::new(),
    };
    match given("shape")? {
        Some(shape) if conic == 0.0 && coefficients.is_empty() => out.set_item("shape", shape)?,
        Some(_) => return Err(wrong(&key("shape"), "given beside conic or coefficients", "either of them")),
        None if !coefficients.is_empty() => {
            let own = PyDict::new(py);
            own.set_item("conic", conic)?;
            own.set_item("coefficients", coefficients)?;
            out.set_item("shape", variant(py, "EvenAsphere", &own)?)?;
        }
        None if conic != 0.0 => {
            let own = PyDict::new(py);
            own.set_item("conic", conic)?;
            out.set_item("shape", variant(py, "Conic", &own)?)?;
        }
        None => {}
    }
    Ok(out)
}

fn variant<'py>(py: Python<'py>, name: &str, contents: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item(name, contents)?;
    Ok(dict)
}

/// Returns a medium as it stands in our own lens file: a name, an index, a pair of index and Abbe number, or the file's own words.
fn medium_of_file<'py>(key: &str, medium: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = medium.py();
    if medium.is_instance_of::<PyDict>() {
        return Ok(medium.clone());
    }
    if medium.is_instance_of::<PyString>() {
        let name: String = medium.extract()?;
        if name.is_empty() || name.eq_ignore_ascii_case("air") {
            return Ok(PyString::new(py, "Air").into_any());
        }
        let glass = GlassCatalogue::built_in().find(&name).map_err(exception)?;
        return Ok(variant(py, "Named", PyString::new(py, &glass.full_name()).as_any())?.into_any());
    }
    if let Ok(pair) = medium.cast::<PyTuple>() {
        let numbers: [f64; 2] =
            pair.extract().map_err(|_| wrong(key, pair, "index and Abbe number, as (1.5168, 64.17)"))?;
        let own = PyDict::new(py);
        own.set_item("nd", numbers[0])?;
        own.set_item("vd", numbers[1])?;
        return Ok(variant(py, "NdVd", &own)?.into_any());
    }
    match medium.extract::<f64>() {
        Ok(index) => {
            let own = PyDict::new(py);
            own.set_item("index", index)?;
            Ok(variant(py, "Constant", &own)?.into_any())
        }
        Err(_) => {
            let expected = "the name of a glass, an index, a pair of index and Abbe number, or None for air";
            Err(wrong_type(key, type_name(medium), expected))
        }
    }
}
