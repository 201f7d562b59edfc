//! What the attributes of an array of HDF5 say of its numbers, by the conventions of netCDF ("Climate and Forecast", 8.1 and 2.5.1).

use super::super::{
    depth_names::words_of,
    stated::short,
    wavelength_unit::{listed_nm, unit_in},
};

/// Names of the list of wavelengths beside a cube, the likelier first.
const WAVES: [&str; 9] =
    ["wave", "wavelength", "wavelengths", "wavelengths_nm", "waves", "lambda", "bands", "wl", "wlens"];
/// Words in the names of lists of other numbers of wavelengths.
const NO_WAVES: [&str; 15] = [
    "bnds", "bounds", "width", "fwhm", "error", "uncert", "offset", "shift", "delta", "good", "bad", "mask", "flag",
    "valid", "unit",
];

/// Returns how likely a name is that of a list of wavelengths, 0 the most; none of other names.
pub(in super::super) fn rank_of_waves(name: &str) -> Option<usize> {
    let lower = name.to_lowercase();
    let is_like = lower.contains("wavelength") && !NO_WAVES.iter().any(|word| lower.contains(word));
    WAVES.iter().position(|own| *own == lower).or_else(|| is_like.then_some(WAVES.len()))
}

/// How near a list of wavelengths is to a cube, the lesser the nearer: how it belongs to one of the cube's axes; whether it is in the cube's group or structure, or how far above; then whether what
/// its name has beside words of wavelengths is in the cube's name, as of `swir_wavelengths` and `swir`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in super::super) struct Nearness {
    axis: usize,
    group: usize,
    words: usize,
}

impl Nearness {
    pub(in super::super) fn of(cube: &str, list: &str) -> Self {
        const ELSEWHERE: usize = 100;
        const PLAIN: [&str; 8] = ["lambda", "wl", "wlens", "band", "bands", "center", "centers", "list"];
        let parts = |name: &str| name.split(['/', '.']).filter(|part| !part.is_empty()).map(str::to_owned).collect();
        let (mut of_cube, mut of_list): (Vec<String>, Vec<String>) = (parts(cube), parts(list));
        let (cube, list) = (of_cube.pop().unwrap_or_default(), of_list.pop().unwrap_or_default());
        let group = if of_cube.starts_with(&of_list) { of_cube.len() - of_list.len() } else { ELSEWHERE };
        let own = words_of(&cube);
        let is_plain =
            |word: &String| word.contains("wave") || PLAIN.contains(&word.as_str()) || unit_in(word).is_some();
        let rest: Vec<String> = words_of(&list).into_iter().filter(|word| !is_plain(word)).collect();
        let words = match rest.iter().all(|word| own.contains(word)) {
            true if !rest.is_empty() => 0,
            true => 1,
            false => 2,
        };
        Self { axis: 0, group, words }
    }

    /// Returns it for a list that belongs to an axis so closely.
    pub(super) fn with_axis(self, axis: usize) -> Self {
        Self { axis, ..self }
    }
}

/// Returns the first of lists of wavelengths, the nearest first, or what is wrong where another that is as near says something else.
pub(in super::super) fn nearest_list(
    lists: Vec<(String, Nearness, Vec<f64>)>,
) -> Result<Option<(String, Vec<f64>)>, String> {
    let Some((name, nearness, nm)) = lists.first() else { return Ok(None) };
    let are_alike = |own: &[f64]| own.len() == nm.len() && own.iter().zip(nm).all(|(a, b)| (a - b).abs() <= 1e-3 * b);
    match lists.iter().skip(1).find(|(_, own, list)| own == nearness && !are_alike(list)) {
        Some((other, ..)) => Err(format!(
            "its lists of wavelengths '{}' and '{}' differ, and which is whose is not known: expected --scene-wavelengths-nm",
            short(name),
            short(other)
        )),
        None => Ok(Some((name.clone(), nm.clone()))),
    }
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
    pub(super) scale: f64,
    offset: f64,
    missing: Vec<f64>,
    /// The number of a perfect white (`Scale_Factor` of NEON, by which numbers are divided).
    pub(super) white: Option<f64>,
    pub(super) unit: Option<String>,
}

/// Attributes that say which numbers stand for none.
const MISSING: [&str; 3] = ["_FillValue", "missing_value", "Data_Ignore_Value"];
/// Names of a factor and of what is added then, those of netCDF and of HDF4.
const SCALES: [&str; 2] = ["scale_factor", "slope"];
const OFFSETS: [&str; 2] = ["add_offset", "intercept"];
const WHITE: &str = "Scale_Factor";
const UNITS: [&str; 2] = ["units", "unit"];

/// Whether an attribute is called the unit of wavelengths.
pub(super) fn is_wave_unit(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower.contains("wave") && lower.contains("unit")
}

impl<'a> Packing<'a> {
    pub(super) fn of(attributes: &'a [Attribute]) -> Self {
        let value = |name: &str| attributes.iter().find(|own| own.name == name).map(|own| &own.value);
        let numbers = |name: &str| match value(name) {
            Some(Value::Numbers(numbers)) => numbers.clone(),
            _ => vec![],
        };
        let number = |name: &str| Some(numbers(name)).filter(|list| list.len() == 1).map(|list| list[0]);
        let text = |name: &&str| {
            attributes.iter().find_map(|own| match &own.value {
                Value::Text(text) if own.name.eq_ignore_ascii_case(name) => Some(text.trim().to_owned()),
                _ => None,
            })
        };
        Self {
            attributes,
            scale: SCALES.into_iter().find_map(number).unwrap_or(1.0),
            offset: OFFSETS.into_iter().find_map(number).unwrap_or(0.0),
            white: None,
            missing: MISSING.iter().flat_map(|name| numbers(name)).collect(),
            unit: UNITS.iter().find_map(text).filter(|text| !text.is_empty()),
        }
    }

    /// Takes a number of a perfect white that is stated, where nothing else packs the numbers.
    pub(super) fn of_reflectances(mut self) -> Self {
        let stated = self.attributes.iter().find(|own| own.name == WHITE).map(|own| &own.value);
        if let (Some(Value::Numbers(list)), false) = (stated, self.is_packed())
            && let [white] = list[..]
            && white > 1.0
        {
            (self.white, self.scale) = (Some(white), 1.0 / white);
        }
        self
    }

    /// Whether whole numbers are no codes, but packed.
    pub(super) fn is_packed(&self) -> bool {
        (self.scale, self.offset) != (1.0, 0.0)
    }

    /// Returns a number unpacked; none where it stands for none.
    pub(super) fn unpacked(&self, number: f64) -> f64 {
        if self.missing.contains(&number) { f64::NAN } else { number * self.scale + self.offset }
    }

    /// Returns the attribute that lists wavelengths, its name first.
    fn waves(&self) -> Option<(&'a str, &'a [f64])> {
        let lists = self.attributes.iter().filter_map(|own| match &own.value {
            Value::Numbers(list) if list.len() > 1 => Some((rank_of_waves(&own.name)?, own.name.as_str(), &list[..])),
            _ => None,
        });
        lists.min_by_key(|(rank, ..)| *rank).map(|(_, name, list)| (name, list))
    }

    /// Returns the list of wavelengths of so many bands, nm.
    ///
    /// # Errors
    /// As [`listed_nm`].
    pub(super) fn wavelengths_nm(&self, n_bands: &[usize]) -> Result<Option<Vec<f64>>, String> {
        let Some((name, list)) = self.waves().filter(|(_, list)| n_bands.contains(&list.len())) else {
            return Ok(None);
        };
        listed_nm(name, self.wave_unit().or_else(|| unit_in(name)), list)
    }

    /// Returns the unit that an attribute states of a list of wavelengths.
    pub(super) fn wave_unit(&self) -> Option<&'a str> {
        self.attributes.iter().find_map(|own| match &own.value {
            Value::Text(text) if is_wave_unit(&own.name) => Some(text.trim()),
            _ => None,
        })
    }

    /// Whether an attribute is the first of these names that has a number.
    fn is_taken(&self, names: &[&str], name: &str) -> bool {
        let is_number = |own: &&Attribute| matches!(&own.value, Value::Numbers(list) if list.len() == 1);
        let find = |wanted: &&str| self.attributes.iter().filter(is_number).find(|own| own.name == *wanted);
        names.iter().find_map(find).is_some_and(|own| own.name == name)
    }

    /// Returns the names of attributes that are not used, where the unit is, and the wavelengths with theirs are, or not.
    pub(super) fn left(&self, is_unit_used: bool, are_waves_used: bool) -> Vec<String> {
        let is_used = |own: &Attribute| match own.name.as_str() {
            WHITE => self.white.is_some(),
            name if self.is_taken(&SCALES, name) || self.is_taken(&OFFSETS, name) => true,
            name if MISSING.contains(&name) => matches!(own.value, Value::Numbers(_)),
            // Of two that differ one is used.
            name if UNITS.iter().any(|unit| name.eq_ignore_ascii_case(unit)) => {
                is_unit_used && matches!(&own.value, Value::Text(text) if Some(text.trim()) == self.unit.as_deref())
            }
            name => are_waves_used && (is_wave_unit(name) || self.waves().is_some_and(|(waves, _)| waves == name)),
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
        // A list of its own names its unit; what says which bands are good is no list.
        let attributes = [
            of("good_wavelengths", Value::Numbers(vec![1.0, 1.0])),
            of("wavelengths", Value::Numbers(vec![4500.0, 5500.0])),
            of("wavelength_units", Value::Text("Angstroms".to_owned())),
            of("Units", Value::Text("1".to_owned())),
        ];
        let packing = Packing::of(&attributes);
        assert_eq!(packing.wavelengths_nm(&[2]), Ok(Some(vec![450.0, 550.0])));
        assert_eq!(
            (packing.left(true, true), packing.unit.as_deref()),
            (vec!["good_wavelengths".to_owned()], Some("1"))
        );
        let attributes = ["Scale_Factor", "slope"].map(|name| [of(name, Value::Numbers(vec![10_000.0]))]);
        let [white, slope] = attributes.each_ref().map(|own| Packing::of(own).of_reflectances());
        assert_eq!((white.unpacked(5000.0), white.white, white.left(true, true).len()), (0.5, Some(10_000.0), 0));
        assert_eq!((slope.unpacked(2.0), slope.white), (20_000.0, None));
        assert_eq!(Packing::of(&attributes[0]).left(true, true), ["Scale_Factor"]);
        assert!(!Packing::of(&[]).is_packed() && Packing::of(&[]).unpacked(3.0) == 3.0);
    }
}
