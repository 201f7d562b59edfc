//! The scales and the names of the axes of arrays of HDF5: labels, or the dimensions of netCDF ("NetCDF-4 File Format", dimensions with HDF5
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
    pub(super) is_scale: bool,
    /// Whether an array has it as a scale.
    is_attached: bool,
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
        let kinds = dataset.attr_datatypes().unwrap_or_default();
        Self {
            labels,
            numbers: numbers("_Netcdf4Coordinates"),
            has_scales: kinds.contains_key("DIMENSION_LIST"),
            is_scale: text("CLASS").trim_end_matches('\0') == "DIMENSION_SCALE",
            is_attached: kinds.contains_key("REFERENCE_LIST"),
            own_number: numbers("_Netcdf4Dimid").first().copied(),
            is_bare: text("NAME").starts_with(BARE),
        }
    }

    /// Returns the scales of each axis of an array of these sides, of those of its file: each with its path and its length. Of scales as long as each
    /// other all are an axis's where nothing says which is whose.
    pub(super) fn scales(&self, sides: &[usize], scales: &[(&str, usize, &Self)]) -> Vec<Vec<String>> {
        if self.is_scale || !self.has_scales && self.numbers.len() != sides.len() {
            return vec![];
        }
        let of_axis = |(index, side): (usize, &usize)| {
            let number = self.numbers.get(index).filter(|_| self.numbers.len() == sides.len());
            let mut alike: Vec<_> = scales.iter().filter(|(_, length, own)| own.is_scale && length == side).collect();
            let is_own = |own: &Self| own.own_number.is_some() && own.own_number.as_ref() == number;
            if let Some(own) = alike.iter().position(|(.., own)| is_own(own)) {
                alike = vec![alike[own]];
            } else if alike.iter().any(|(.., own)| own.is_attached) {
                alike.retain(|(.., own)| own.is_attached);
            }
            alike.into_iter().map(|(path, ..)| (*path).to_owned()).collect()
        };
        sides.iter().enumerate().map(of_axis).collect()
    }

    /// Returns the names of the axes of an array that has these scales, as far as they are stated; "x or y" of an axis of several.
    pub(super) fn axes(&self, n_axes: usize, scales: &[Vec<String>]) -> Vec<String> {
        if self.labels.len() == n_axes && self.labels.iter().any(|label| !label.is_empty()) {
            return self.labels.clone();
        }
        let last = |path: &String| path.rsplit('/').next().unwrap_or(path).to_owned();
        scales.iter().map(|own| own.iter().map(last).collect::<Vec<_>>().join(" or ")).collect()
    }
}
