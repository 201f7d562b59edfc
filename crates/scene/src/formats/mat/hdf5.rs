//! The variables of a MATLAB file of version 7.3, which is HDF5, and the arrays of any HDF5 file.
//!
//! Each becomes the element that a file of version 5 has for it, so that one reader knows them all. MATLAB writes its axes turned
//! round, the first being the fastest; arrays of other programs have the last as the fastest. How MATLAB marks its variables was
//! taken from files that it wrote: attributes `MATLAB_class` and `MATLAB_empty`, structures as groups, cells as references.

use std::collections::{BTreeMap, HashMap};

use exr::prelude::f16;
use hdf5_pure::{AttrValue, DType, Dataset, Datatype, DatatypeByteOrder, File, FloatingPointLayout, Group};

use super::{
    super::unusable::fault,
    dimensions::Dimensions,
    elements::{self, LIMIT_ARRAYS, LIMIT_DEPTH, Listed},
    links::take_links,
    packing::{Attribute, Value},
};

/// Arrays of a file.
pub(super) struct Hdf5 {
    file: File,
    /// Whether MATLAB wrote it, or one of its kind.
    pub(super) is_matlab: bool,
    /// Links by name, each with where it leads.
    links: BTreeMap<String, String>,
}

/// An array or a group, and what is known of it without its content.
pub(super) struct Entry {
    pub(super) listed: Listed,
    path: String,
    is_group: bool,
    /// Bytes of its numbers.
    pub(super) n_bytes: u64,
    /// What else is stated of it.
    pub(super) attributes: Vec<Attribute>,
    /// What it is, in words.
    pub(super) words: String,
    /// The names of its axes, in the order of its sides; none where nothing is stated of them.
    pub(super) axes: Vec<String>,
    /// The paths of the scales of each; several where nothing says which is its own.
    pub(super) scales: Vec<Vec<String>>,
    dimensions: Dimensions,
}

impl Entry {
    fn without_content(listed: Listed, path: String, is_group: bool) -> Self {
        let (attributes, words, axes, scales) = (vec![], String::new(), vec![], vec![]);
        Self { listed, path, is_group, n_bytes: 0, attributes, words, axes, scales, dimensions: Dimensions::default() }
    }
}

impl Hdf5 {
    /// Opens a file that is in memory.
    pub(super) fn open(mut bytes: Vec<u8>) -> Result<Self, String> {
        let is_matlab = bytes.starts_with(b"MATLAB 7.3");
        let links = take_links(&mut bytes);
        Ok(Self { file: File::from_bytes(bytes).map_err(broken)?, is_matlab, links })
    }

    /// Returns what the file states of itself.
    pub(super) fn attributes(&self) -> Vec<Attribute> {
        let mut all = vec![];
        self.list_attributes(&self.file.root(), "", LIMIT_DEPTH, &mut all);
        all
    }

    /// Lists the attributes of a group and of those in it, by their paths; MATLAB's are those of its variables.
    fn list_attributes(&self, group: &Group, before: &str, depth: usize, all: &mut Vec<Attribute>) {
        let own = telling(group.attrs(), group.attr_datatypes()).into_iter();
        all.extend(own.map(|own| Attribute { name: format!("{before}{}", own.name), value: own.value }));
        if depth == 0 || self.is_matlab || all.len() > LIMIT_ARRAYS {
            return;
        }
        for name in group.groups().unwrap_or_default() {
            if let Ok(inner) = group.group(&name) {
                self.list_attributes(&inner, &format!("{before}{name}/"), depth - 1, all);
            }
        }
    }

    /// Lists the variables of MATLAB, or the arrays of all groups, by their paths.
    pub(super) fn entries(&self) -> Result<Vec<Entry>, String> {
        let mut entries = vec![];
        self.list(&self.file.root(), "", LIMIT_DEPTH, &mut entries)?;
        let one = |entry: &Entry| Some(*entry.listed.sides.first()?).filter(|_| entry.listed.sides.len() == 1);
        let scales: Vec<(&str, usize, &Dimensions)> = entries
            .iter()
            .filter_map(|entry| Some((entry.listed.name.as_str(), one(entry)?, &entry.dimensions)))
            .collect();
        let own: Vec<_> = entries.iter().map(|entry| entry.dimensions.scales(&entry.listed.sides, &scales)).collect();
        for (entry, scales) in entries.iter_mut().zip(own) {
            entry.axes = entry.dimensions.axes(entry.listed.sides.len(), &scales);
            entry.scales = scales;
        }
        // What is but the name and the length of an axis.
        entries.retain(|entry| !entry.dimensions.is_bare);
        for (name, target) in &self.links {
            let name = format!("{name} (a link to {target})");
            let listed = Listed { name, sides: vec![], is_numeric: false, is_complex: false, is_list: false };
            entries.push(Entry::without_content(listed, String::new(), false));
        }
        Ok(entries)
    }

    fn list(&self, group: &Group, before: &str, depth: usize, entries: &mut Vec<Entry>) -> Result<(), String> {
        if depth == 0 || entries.len() > LIMIT_ARRAYS {
            return Err(too_many());
        }
        for name in group.datasets().map_err(broken)? {
            let path = format!("{before}{name}");
            // A link to what is not there, or not here, is known by its name alone.
            let Ok(dataset) = group.dataset(&name) else {
                let listed =
                    Listed { name: path.clone(), sides: vec![], is_numeric: false, is_complex: false, is_list: false };
                entries.push(Entry::without_content(listed, path, false));
                continue;
            };
            let sides = self.sides_of(&dataset)?;
            let is_numeric = class_of(&dataset).is_ok_and(|class| class.is_some());
            let n_bytes = sides.iter().map(|side| *side as u64).fold(8, u64::saturating_mul);
            let is_complex = dataset.dtype().is_ok_and(|kind| is_complex(&kind));
            let (words, dimensions) = (words_of(&dataset), Dimensions::of(&dataset));
            let is_list = dimensions.is_scale || words.contains(RADIATION);
            let listed = Listed { name: path.clone(), sides, is_numeric, is_complex, is_list };
            let attributes = telling(dataset.attrs(), dataset.attr_datatypes());
            entries.push(Entry {
                n_bytes,
                attributes,
                words,
                dimensions,
                ..Entry::without_content(listed, path, false)
            });
        }
        for name in group.groups().map_err(broken)? {
            // What references lead to.
            if name.starts_with('#') {
                continue;
            }
            let path = format!("{before}{name}");
            if self.is_matlab {
                let listed = Listed {
                    name: path.clone(),
                    sides: vec![1, 1],
                    is_numeric: false,
                    is_complex: false,
                    is_list: false,
                };
                entries.push(Entry::without_content(listed, path, true));
            } else {
                let group = group.group(&name).map_err(broken)?;
                self.list(&group, &format!("{path}/"), depth - 1, entries)?;
            }
        }
        Ok(())
    }

    /// Returns the sides of an array, the fastest first where MATLAB wrote it.
    fn sides_of(&self, dataset: &Dataset) -> Result<Vec<usize>, String> {
        let shape = dataset.shape().map_err(broken)?;
        let product = shape.iter().try_fold(1_u64, |product, side| product.checked_mul(*side));
        if product.is_none_or(|product| product > u64::from(u32::MAX)) || shape.len() > LIMIT_DEPTH {
            return Err(format!("an array has the sides {:?}", &shape[..shape.len().min(4)]));
        }
        let mut sides: Vec<usize> = shape.into_iter().map(|side| side as usize).collect();
        if self.is_matlab {
            sides.reverse();
        }
        // A number without sides is an array of one.
        Ok(if sides.is_empty() { vec![1] } else { sides })
    }

    /// Returns an entry as an element of version 5.
    pub(super) fn element(&self, entry: &Entry) -> Result<Vec<u8>, String> {
        if entry.is_group {
            let mut n_left = LIMIT_ARRAYS;
            let group = self.file.group(&entry.path).map_err(broken)?;
            self.structure(&entry.listed.name, &group, LIMIT_DEPTH, &mut n_left)
        } else {
            let dataset = self.file.dataset(&entry.path).map_err(broken)?;
            self.array(&entry.listed.name, &dataset)
        }
    }

    fn structure(&self, name: &str, group: &Group, depth: usize, n_left: &mut usize) -> Result<Vec<u8>, String> {
        if depth == 0 || *n_left == 0 {
            return Err(too_many());
        }
        *n_left -= 1;
        let mut fields = vec![];
        for own in group.datasets().map_err(broken)? {
            let dataset = group.dataset(&own).map_err(broken)?;
            fields.push((own, self.array("", &dataset)?));
        }
        for own in group.groups().map_err(broken)? {
            let inner = group.group(&own).map_err(broken)?;
            fields.push((own, self.structure("", &inner, depth - 1, n_left)?));
        }
        elements::structure(name, &fields).ok_or_else(too_large)
    }

    fn array(&self, name: &str, dataset: &Dataset) -> Result<Vec<u8>, String> {
        let attributes = dataset.attrs().map_err(broken)?;
        let is_empty = attributes.get("MATLAB_empty").and_then(AttrValue::to_i64s).is_some_and(|v| v != [0]);
        let is_text = attributes.get("MATLAB_class").and_then(AttrValue::as_str) == Some("char");
        if is_empty {
            return elements::doubles(name, &[0, 0], &[]).ok_or_else(too_large);
        }
        let sides = self.sides_of(dataset)?;
        let class = class_of(dataset)?.filter(|_| !is_text);
        let Some(class) = class else {
            let class = if is_text { 4 } else { elements::CELLS };
            return elements::other(name, class, &sides).ok_or_else(too_large);
        };
        let is_logical = attributes.get("MATLAB_class").and_then(AttrValue::as_str) == Some("logical");
        let class = if is_logical { (class.0 | elements::LOGICAL, class.1) } else { class };
        let numbers = numbers_of(dataset)?;
        elements::stored(name, &sides, class, &numbers).ok_or_else(too_large)
    }
}

/// What standard names call wavelengths (Climate and Forecast, `standard_name` table).
pub(super) const RADIATION: &str = "radiation_wavelength";

/// Attributes that call an array something.
pub(super) const NAMING: [&str; 2] = ["long_name", "standard_name"];

/// Returns what the attributes of an array call it.
fn words_of(dataset: &Dataset) -> String {
    let Ok(attributes) = dataset.attrs() else { return String::new() };
    let text = |name: &str| attributes.get(name).and_then(AttrValue::as_str);
    NAMING.into_iter().filter_map(text).collect::<Vec<_>>().join("; ")
}

/// Returns the attributes that may change what numbers mean, in the order of their names, those of words that tell it among them; those of types that are not read, as half
/// floats, by their names alone.
fn telling(
    values: Result<HashMap<String, AttrValue>, hdf5_pure::Error>,
    types: Result<HashMap<String, Datatype>, hdf5_pure::Error>,
) -> Vec<Attribute> {
    const HARMLESS: [&str; 17] = [
        "CLASS",
        "NAME",
        "REFERENCE_LIST",
        "DIMENSION_LIST",
        "DIMENSION_LABELS",
        "TITLE",
        "VERSION",
        "FLAVOR",
        "comment",
        "long_name",
        "standard_name",
        "Conventions",
        // Of whole files (CF conventions, 2.6.2).
        "title",
        "history",
        "institution",
        "references",
        "_NCProperties",
    ];
    let is_telling = |name: &str, value: &Value| {
        let is_harmless = HARMLESS.contains(&name) || name.starts_with("MATLAB_") || name.starts_with("_Net");
        !is_harmless || matches!(value, Value::Text(text) if super::super::stated::tells(text))
    };
    let value_of = |value: AttrValue| match (value.to_f64s(), value.to_i64s(), value.as_str()) {
        (Some(numbers), ..) => Value::Numbers(numbers),
        (None, Some(numbers), _) => Value::Numbers(numbers.into_iter().map(|v| v as f64).collect()),
        (None, None, Some(text)) => Value::Text(text.to_owned()),
        _ => Value::Other,
    };
    let (values, types) = (values.unwrap_or_default(), types.unwrap_or_default());
    let unread = types.into_keys().filter(|name| !values.contains_key(name)).map(|name| (name, Value::Other));
    let unread: Vec<_> = unread.collect();
    let all = values.into_iter().map(|(name, value)| (name, value_of(value))).chain(unread);
    let own = all.filter(|(name, value)| is_telling(name, value));
    let mut own: Vec<Attribute> = own.map(|(name, value)| Attribute { name, value }).collect();
    own.sort_by(|a, b| a.name.cmp(&b.name));
    own
}

/// Returns the class of numbers and the type that they are stored as; `None` where they are none.
fn class_of(dataset: &Dataset) -> Result<Option<(u32, u32)>, String> {
    Ok(Some(match dataset.dtype().map_err(broken)? {
        DType::F64 => (elements::DOUBLES, 9),
        DType::F32 => (elements::SINGLES, 7),
        DType::I8 => (8, 1),
        DType::U8 => (9, 2),
        DType::I16 => (10, 3),
        DType::U16 => (11, 4),
        DType::I32 => (12, 5),
        DType::U32 => (13, 6),
        DType::I64 => (14, 12),
        DType::U64 => (15, 13),
        // Halves become singles, which hold them all.
        DType::Other(kind) if half_order(&kind).is_some() => (elements::SINGLES, 7),
        _ => return Ok(None),
    }))
}

/// Whether numbers are pairs as `h5py` (`r`, `i`) and MATLAB (`real`, `imag`) write complex ones.
fn is_complex(kind: &DType) -> bool {
    const NAMES: [[&str; 2]; 2] = [["r", "i"], ["real", "imag"]];
    let DType::Compound(fields) = kind else { return false };
    NAMES.iter().any(|names| fields.iter().map(|(name, _)| name.as_str()).eq(*names))
}

/// Returns the byte order of the half floats of IEEE 754; `None` of all else.
fn half_order(kind: &Datatype) -> Option<DatatypeByteOrder> {
    const HALF: FloatingPointLayout = FloatingPointLayout {
        bit_offset: 0,
        bit_precision: 16,
        exponent_location: 10,
        exponent_size: 5,
        mantissa_location: 0,
        mantissa_size: 10,
        exponent_bias: 15,
    };
    match kind {
        Datatype::FloatingPoint { size: 2, byte_order, layout } if *layout == HALF => {
            Some(*byte_order).filter(|order| !matches!(order, DatatypeByteOrder::Vax))
        }
        _ => None,
    }
}

/// Returns the numbers of an array, little-endian.
fn numbers_of(dataset: &Dataset) -> Result<Vec<u8>, String> {
    fn bytes<T, const N: usize>(
        values: Result<Vec<T>, hdf5_pure::Error>,
        of: fn(T) -> [u8; N],
    ) -> Result<Vec<u8>, String> {
        Ok(values.map_err(broken)?.into_iter().flat_map(of).collect())
    }
    match dataset.dtype().map_err(broken)? {
        DType::F64 => bytes(dataset.read_f64(), f64::to_le_bytes),
        DType::F32 => bytes(dataset.read_f32(), f32::to_le_bytes),
        DType::I8 => bytes(dataset.read_i8(), i8::to_le_bytes),
        DType::U8 => dataset.read_u8().map_err(broken),
        DType::I16 => bytes(dataset.read_i16(), i16::to_le_bytes),
        DType::U16 => bytes(dataset.read_u16(), u16::to_le_bytes),
        DType::I32 => bytes(dataset.read_i32(), i32::to_le_bytes),
        DType::U32 => bytes(dataset.read_u32(), u32::to_le_bytes),
        DType::I64 => bytes(dataset.read_i64(), i64::to_le_bytes),
        DType::U64 => bytes(dataset.read_u64(), u64::to_le_bytes),
        DType::Other(kind) => {
            let Some(order) = half_order(&kind) else { return Ok(vec![]) };
            let raw = dataset.read_raw().map_err(broken)?;
            let of = |pair: &[u8]| match order {
                DatatypeByteOrder::BigEndian => f16::from_be_bytes([pair[0], pair[1]]),
                _ => f16::from_le_bytes([pair[0], pair[1]]),
            };
            Ok(raw.chunks_exact(2).flat_map(|pair| of(pair).to_f32().to_le_bytes()).collect())
        }
        _ => Ok(vec![]),
    }
}

/// Filters of HDF5 that are not read, by their numbers.
const FILTERS: [(u32, &str); 6] =
    [(4, "SZIP"), (307, "bzip2"), (32_001, "Blosc"), (32_004, "LZ4"), (32_008, "bitshuffle"), (32_015, "Zstandard")];

fn broken(error: hdf5_pure::Error) -> String {
    let said = error.to_string();
    let expected = if said.contains("virtual") || said.contains("external files") {
        Some("its numbers in the file itself (h5repack --layout=CONTI)")
    } else if said.contains("unsupported filter") {
        Some("none of its filters, or gzip (h5repack -f GZIP=4)")
    } else if said.contains("continuation depth") {
        Some("its attributes in fewer pieces (h5repack)")
    } else if said.contains("unsupported") {
        Some("one that older programs read as well (h5repack --high=V18)")
    } else {
        None
    };
    let known = FILTERS.iter().find(|(number, _)| said.ends_with(&format!("unsupported filter: {number}")));
    fault("HDF5", known.map_or(said.clone(), |(_, name)| format!("its numbers are packed by {name}")), expected)
}

fn too_many() -> String {
    format!("its groups hold more than {LIMIT_ARRAYS} arrays or {LIMIT_DEPTH} levels")
}

fn too_large() -> String {
    "an array of it takes 4 GiB or more, expected smaller ones".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_of_types_that_are_not_read_are_named() {
        let values =
            HashMap::from([("units".to_owned(), AttrValue::F64(1.0)), ("CLASS".to_owned(), AttrValue::F64(1.0))]);
        let types = ["units", "CLASS", "scale_factor", "DIMENSION_LIST"]
            .map(|name| (name.to_owned(), hdf5_pure::make_f64_type()));
        let names = telling(Ok(values), Ok(HashMap::from(types))).into_iter().map(|own| (own.name, own.value));
        let expected = [("scale_factor", Value::Other), ("units", Value::Numbers(vec![1.0]))];
        assert!(names.eq(expected.map(|(name, value)| (name.to_owned(), value))));
    }
}
