//! The names of the axes of arrays of HDF5: labels, or the dimensions of netCDF ("NetCDF-4 File Format", dimensions with HDF5
//! dimension scales).

use hdf5_pure::{AttrValue, Dataset};

/// What an array states of its axes, and of itself where it stands for one of others.
#[derive(Default)]
pub(super) struct Dimensions {
    labels: Vec<String>,
    /// The numbers of the dimensions that it lies along.
    numbers: Vec<i64>,
    /// Whether its axes have scales, whichever these are.
    has_scales: bool,
    /// Whether it is the scale of an axis.
    is_scale: bool,
    /// Its own number as a dimension.
    own_number: Option<i64>,
    /// Whether it has no numbers of its own, but stands for a length alone.
    pub(super) is_bare: bool,
}

impl Dimensions {
    pub(super) fn of(dataset: &Dataset) -> Self {
        const BARE: &str = "This is a netCDF dimension but not a netCDF variable";
        let Ok(attributes) = dataset.attrs() else { return Self::default() };
        let text = |name: &str| attributes.get(name).and_then(AttrValue::as_str).unwrap_or_default();
        let numbers = |name: &str| attributes.get(name).and_then(AttrValue::to_i64s).unwrap_or_default();
        let labels = match attributes.get("DIMENSION_LABELS") {
            Some(
                AttrValue::StringArray(list)
                | AttrValue::AsciiStringArray(list)
                | AttrValue::VarLenStringArray(list)
                | AttrValue::VarLenAsciiStringArray(list),
            ) => list.clone(),
            _ => vec![],
        };
        Self {
            labels,
            numbers: numbers("_Netcdf4Coordinates"),
            has_scales: dataset.attr_datatypes().is_ok_and(|kinds| kinds.contains_key("DIMENSION_LIST")),
            is_scale: text("CLASS").trim_end_matches('\0') == "DIMENSION_SCALE",
            own_number: numbers("_Netcdf4Dimid").first().copied(),
            is_bare: text("NAME").starts_with(BARE),
        }
    }

    /// Returns the names of the axes of an array of these sides, as far as they are stated, of the scales of its file: each with its name
    /// and its length. Where scales are as long as each other and nothing says which is whose, "x or y".
    pub(super) fn axes(&self, sides: &[usize], scales: &[(&str, usize, &Self)]) -> Vec<String> {
        if self.labels.len() == sides.len() && self.labels.iter().any(|label| !label.is_empty()) {
            return self.labels.clone();
        }
        if self.is_scale || !self.has_scales && self.numbers.len() != sides.len() {
            return vec![];
        }
        let last = |path: &str| path.rsplit('/').next().unwrap_or(path).to_owned();
        let name = |(index, side): (usize, &usize)| {
            let number = self.numbers.get(index).filter(|_| self.numbers.len() == sides.len());
            let alike = scales.iter().filter(|(_, length, own)| own.is_scale && length == side);
            let (names, numbered): (Vec<_>, Vec<_>) = alike
                .map(|(path, _, own)| (last(path), own.own_number.is_some() && own.own_number.as_ref() == number))
                .unzip();
            match numbered.iter().position(|is_own| *is_own) {
                Some(own) => names[own].clone(),
                None => names.join(" or "),
            }
        };
        sides.iter().enumerate().map(name).collect()
    }
}
