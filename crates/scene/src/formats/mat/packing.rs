//! What the attributes of an array of HDF5 say of its numbers, by the conventions of netCDF ("Climate and Forecast", 8.1 and 2.5.1).

use super::super::wavelength_unit::without_unit;

/// Names of the list of wavelengths beside a cube, the likelier first.
const WAVES: [&str; 9] =
    ["wave", "wavelength", "wavelengths", "wavelengths_nm", "waves", "lambda", "bands", "wl", "wlens"];
/// Words in the names of lists of other numbers of wavelengths.
const NO_WAVES: [&str; 7] = ["width", "fwhm", "error", "uncert", "offset", "shift", "delta"];

/// Returns how likely a name is that of a list of wavelengths, 0 the most; none of other names.
pub(in super::super) fn rank_of_waves(name: &str) -> Option<usize> {
    let lower = name.to_lowercase();
    let is_like = lower.contains("wavelength") && !NO_WAVES.iter().any(|word| lower.contains(word));
    WAVES.iter().position(|own| *own == lower).or_else(|| is_like.then_some(WAVES.len()))
}

/// An attribute of an array.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) value: Value,
}

/// What an attribute holds.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Numbers(Vec<f64>),
    Text(String),
    Other,
}

/// How numbers are packed, and of what unit they are.
pub(super) struct Packing<'a> {
    attributes: &'a [Attribute],
    scale: f64,
    offset: f64,
    missing: Vec<f64>,
    pub(super) unit: Option<String>,
}

/// Attributes that say which numbers stand for none.
const MISSING: [&str; 2] = ["_FillValue", "missing_value"];
const UNITS: [&str; 2] = ["units", "unit"];

impl<'a> Packing<'a> {
    pub(super) fn of(attributes: &'a [Attribute]) -> Self {
        let value = |name: &str| attributes.iter().find(|own| own.name == name).map(|own| &own.value);
        let numbers = |name: &str| match value(name) {
            Some(Value::Numbers(numbers)) => numbers.clone(),
            _ => vec![],
        };
        let number = |name: &str| Some(numbers(name)).filter(|list| list.len() == 1).map(|list| list[0]);
        let text = |name: &&str| match value(name) {
            Some(Value::Text(text)) => Some(text.trim().to_owned()),
            _ => None,
        };
        Self {
            attributes,
            scale: number("scale_factor").unwrap_or(1.0),
            offset: number("add_offset").unwrap_or(0.0),
            missing: MISSING.iter().flat_map(|name| numbers(name)).collect(),
            unit: UNITS.iter().find_map(text).filter(|text| !text.is_empty()),
        }
    }

    /// Whether whole numbers are no codes, but packed.
    pub(super) fn is_packed(&self) -> bool {
        (self.scale, self.offset) != (1.0, 0.0)
    }

    /// Returns a number unpacked; none where it stands for none.
    pub(super) fn unpacked(&self, number: f64) -> f64 {
        if self.missing.contains(&number) { f64::NAN } else { number * self.scale + self.offset }
    }

    /// Returns the list of wavelengths of so many bands.
    pub(super) fn wavelengths_nm(&self, n_bands: &[usize]) -> Option<Vec<f64>> {
        self.attributes.iter().find_map(|own| match &own.value {
            Value::Numbers(list) if rank_of_waves(&own.name).is_some() && n_bands.contains(&list.len()) => {
                without_unit(list)
            }
            _ => None,
        })
    }

    /// Returns the names of attributes that are not used, where the unit and the wavelengths are, or not.
    pub(super) fn left(&self, is_unit_used: bool, are_waves_used: bool) -> Vec<String> {
        let is_used = |own: &Attribute| match own.name.as_str() {
            "scale_factor" | "add_offset" => matches!(&own.value, Value::Numbers(list) if list.len() == 1),
            name if MISSING.contains(&name) => matches!(own.value, Value::Numbers(_)),
            name if UNITS.contains(&name) => is_unit_used,
            name => are_waves_used && rank_of_waves(name).is_some(),
        };
        self.attributes.iter().filter(|own| !is_used(own)).map(|own| own.name.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{super::super::length_unit::length_m, *};

    #[test]
    fn lists_of_wavelengths_are_known_by_their_names() {
        let ranks = ["wave", "Wavelengths", "WL", "band_wavelengths", "bandwidth_wavelengths", "waveform"];
        assert_eq!(ranks.map(rank_of_waves), [Some(0), Some(2), Some(7), Some(9), None, None]);
    }

    #[test]
    fn packed_numbers_are_unpacked() {
        let of = |name: &str, value| Attribute { name: name.to_owned(), value };
        let attributes = [
            of("scale_factor", Value::Numbers(vec![0.001])),
            of("add_offset", Value::Numbers(vec![2.0])),
            of("_FillValue", Value::Numbers(vec![-1.0])),
            of("units", Value::Text("mm".to_owned())),
            of("valid_min", Value::Numbers(vec![0.0])),
        ];
        let packing = Packing::of(&attributes);
        assert!((packing.unpacked(500.0) - 2.5).abs() < 1e-12 && packing.unpacked(-1.0).is_nan());
        assert_eq!((packing.left(true, false), packing.is_packed()), (vec!["valid_min".to_owned()], true));
        assert_eq!(packing.unit.as_deref().and_then(length_m), Some(1e-3));
        assert!(!Packing::of(&[]).is_packed() && Packing::of(&[]).unpacked(3.0) == 3.0);
    }
}
