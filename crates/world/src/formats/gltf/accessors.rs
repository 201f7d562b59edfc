//! Numbers of glTF's buffers.

use std::collections::HashMap;

use serde_json::Value;

use super::json::{index, list};

/// The numbers of an accessor, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rows {
    pub(super) width: usize,
    pub(super) values: Vec<f64>,
}

impl Rows {
    pub(super) fn len(&self) -> usize {
        self.values.len().checked_div(self.width).unwrap_or(0)
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.width.max(1))
    }

    /// Returns the first numbers of each row; the rest of a narrower one is 0.
    pub(super) fn first<const N: usize>(&self) -> impl Iterator<Item = [f32; N]> + '_ {
        self.rows().map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0.0) as f32))
    }
}

/// How numbers are written.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u64) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The integer that stands for 1.
    fn one(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 | Self::F32 => 1.0,
        }
    }

    fn read(self, bytes: &[u8], is_normalized: bool) -> f64 {
        let share = |value: f64| if is_normalized { (value / self.one()).max(-1.0) } else { value };
        match (self, bytes) {
            (Self::I8, &[a]) => share(f64::from(a as i8)),
            (Self::U8, &[a]) => share(f64::from(a)),
            (Self::I16, &[a, b]) => share(f64::from(i16::from_le_bytes([a, b]))),
            (Self::U16, &[a, b]) => share(f64::from(u16::from_le_bytes([a, b]))),
            (Self::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
            (Self::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => 0.0,
        }
    }
}

/// Returns what stands for 1 in an accessor: an integer where those are shares.
pub(super) fn one_of(accessor: Option<&Value>) -> f64 {
    let word = |key: &str| accessor.and_then(|accessor| accessor.get(key));
    let is_normalized = word("normalized").and_then(Value::as_bool).unwrap_or(false);
    let component = word("componentType").and_then(Value::as_u64).and_then(Component::of);
    component.filter(|_| is_normalized).map_or(1.0, Component::one)
}

/// What accessors are read from.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) root: &'a Value,
    pub(super) buffers: &'a [Vec<u8>],
    /// Buffer views that were packed, with the strides of their rows.
    pub(super) unpacked: &'a HashMap<usize, (Vec<u8>, Option<usize>)>,
    /// The most numbers that an accessor without bytes may have.
    pub(super) most_zeros: usize,
}

impl<'a> Source<'a> {
    /// Returns the bytes of a buffer view, and its stride.
    pub(super) fn view(&self, view: usize) -> Result<(&'a [u8], Option<usize>), String> {
        if let Some((bytes, stride)) = self.unpacked.get(&view) {
            return Ok((bytes, *stride));
        }
        let wrong = |what: String| format!("buffer view {view} {what}");
        let of = list(self.root, "bufferViews").get(view).ok_or_else(|| wrong("is named and not there".to_owned()))?;
        let buffer = index(of, "buffer").unwrap_or(usize::MAX);
        let bytes = self.buffers.get(buffer).ok_or_else(|| wrong(format!("names buffer {buffer}")))?;
        let first = index(of, "byteOffset").unwrap_or(0);
        let length = index(of, "byteLength").ok_or_else(|| wrong("has no byteLength".to_owned()))?;
        let end = first.checked_add(length).filter(|end| *end <= bytes.len());
        let end = end.ok_or_else(|| wrong(format!("reaches beyond its buffer of {} bytes", bytes.len())))?;
        Ok((&bytes[first..end], index(of, "byteStride").filter(|stride| *stride > 0)))
    }

    /// Returns the numbers of an accessor; integers that are normalized as shares.
    pub(super) fn rows(&self, accessor: usize) -> Result<Rows, String> {
        let wrong = |what: String| format!("accessor {accessor} {what}");
        let accessors = list(self.root, "accessors");
        let of = accessors
            .get(accessor)
            .ok_or_else(|| wrong(format!("is named, of which there are {}", accessors.len())))?;
        let component = of.get("componentType").and_then(Value::as_u64).and_then(Component::of);
        let component = component.ok_or_else(|| wrong("has no componentType that is known".to_owned()))?;
        let width = match of.get("type").and_then(Value::as_str) {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4" | "MAT2") => 4,
            Some("MAT3") => 9,
            Some("MAT4") => 16,
            _ => return Err(wrong("has no type that is known".to_owned())),
        };
        let count = index(of, "count").ok_or_else(|| wrong("has no count".to_owned()))?;
        let is_normalized = of.get("normalized").and_then(Value::as_bool).unwrap_or(false);
        let mut values = match index(of, "bufferView") {
            Some(view) => {
                let (bytes, stride) = self.view(view)?;
                let first = index(of, "byteOffset").unwrap_or(0);
                let bytes = bytes.get(first..).ok_or_else(|| wrong("reaches beyond its buffer".to_owned()))?;
                table(bytes, stride, (component, is_normalized), (count, width))
                    .ok_or_else(|| wrong("reaches beyond its buffer".to_owned()))?
            }
            None => match count.checked_mul(width).filter(|n| *n <= self.most_zeros) {
                Some(n) => vec![0.0; n],
                None => return Err(wrong(format!("has {count} rows and no bufferView"))),
            },
        };
        if let Some(sparse) = of.get("sparse") {
            let n = index(sparse, "count").unwrap_or(0);
            let part = |key: &str, kind: Option<Component>, width: usize| {
                let of = sparse.get(key)?;
                let kind = kind.or_else(|| of.get("componentType").and_then(Value::as_u64).and_then(Component::of))?;
                let (bytes, stride) = self.view(index(of, "bufferView")?).ok()?;
                let bytes = bytes.get(index(of, "byteOffset").unwrap_or(0)..)?;
                table(bytes, stride, (kind, is_normalized && key == "values"), (n, width))
            };
            let (Some(places), Some(changed)) = (part("indices", None, 1), part("values", Some(component), width))
            else {
                return Err(wrong("has sparse values that can't be read".to_owned()));
            };
            for (place, row) in places.iter().zip(changed.chunks_exact(width)) {
                let first = (*place as usize).saturating_mul(width);
                let into = values.get_mut(first..first.saturating_add(width));
                into.ok_or_else(|| wrong(format!("has a sparse value {place} of {count}")))?.copy_from_slice(row);
            }
        }
        Ok(Rows { width, values })
    }
}

/// Reads rows of numbers; `None` where they reach beyond the bytes.
fn table(
    bytes: &[u8],
    stride: Option<usize>,
    (component, is_normalized): (Component, bool),
    (count, width): (usize, usize),
) -> Option<Vec<f64>> {
    let (size, row) = (component.size(), component.size() * width);
    let stride = stride.unwrap_or(row);
    if count == 0 {
        return Some(Vec::new());
    }
    let end = (count - 1).checked_mul(stride)?.checked_add(row)?;
    if stride < row || end > bytes.len() {
        return None;
    }
    let mut values = Vec::with_capacity(count * width);
    for place in 0..count {
        let row = &bytes[place * stride..place * stride + row];
        values.extend(row.chunks_exact(size).map(|bytes| component.read(bytes, is_normalized)));
    }
    Some(values)
}
