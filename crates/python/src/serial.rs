//! Data of our crates as Python's dictionaries, lists and numbers, and back.
//!
//! The form is that of JSON, but that infinity and NaN stay what they are: a struct is a dictionary, a unit variant its name, any
//! other variant a dictionary of its name and its contents. (The crate `pythonize` does this too, but not for this PyO3.)

use std::fmt::Display;

use pyo3::{
    IntoPyObjectExt,
    exceptions::PyValueError,
    prelude::*,
    types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple},
};
use serde::{
    Serialize,
    de::{self, DeserializeOwned, DeserializeSeed, IntoDeserializer, Visitor},
    ser::{self, SerializeMap, SerializeSeq},
};

use crate::input::type_name;

/// Returns a value as Python's own.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &(impl Serialize + ?Sized)) -> PyResult<Bound<'py, PyAny>> {
    value.serialize(Writer(py)).map_err(|e| e.0)
}

/// Returns the value of a dictionary, list or number; `what` names it in errors.
pub(crate) fn from_python<T: DeserializeOwned>(what: &str, value: &Bound<'_, PyAny>) -> PyResult<T> {
    T::deserialize(Reader(value.clone()))
        .map_err(|e| PyValueError::new_err(format!("{what}: {}", e.0.value(value.py()))))
}

/// What went wrong on the way.
#[derive(Debug)]
struct SerialError(PyErr);

impl Display for SerialError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for SerialError {}

impl From<PyErr> for SerialError {
    fn from(error: PyErr) -> Self {
        Self(error)
    }
}

impl ser::Error for SerialError {
    fn custom<T: Display>(message: T) -> Self {
        Self(PyValueError::new_err(message.to_string()))
    }
}

impl de::Error for SerialError {
    fn custom<T: Display>(message: T) -> Self {
        Self(PyValueError::new_err(message.to_string()))
    }
}

type Written<'py> = Result<Bound<'py, PyAny>, SerialError>;

/// Makes Python's objects.
#[derive(Clone, Copy)]
struct Writer<'py>(Python<'py>);

impl<'py> Writer<'py> {
    fn object(self, value: impl IntoPyObjectExt<'py>) -> Written<'py> {
        Ok(value.into_bound_py_any(self.0)?)
    }

    fn items(self, variant: Option<&'static str>) -> Items<'py> {
        Items { writer: self, list: PyList::empty(self.0), variant }
    }

    fn entries(self, variant: Option<&'static str>) -> Entries<'py> {
        Entries { writer: self, dict: PyDict::new(self.0), key: None, variant }
    }

    /// Returns the contents under the name of their variant, where they have one.
    fn named(self, variant: Option<&'static str>, contents: Bound<'py, PyAny>) -> Written<'py> {
        let Some(variant) = variant else { return Ok(contents) };
        let dict = PyDict::new(self.0);
        dict.set_item(variant, contents)?;
        Ok(dict.into_any())
    }
}

/// Writes numbers and words, which Python has of its own.
macro_rules! plain {
    ($($name:ident: $kind:ty),*) => {
        $(fn $name(self, value: $kind) -> Written<'py> {
            self.object(value)
        })*
    };
}

impl<'py> ser::Serializer for Writer<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = SerialError;
    type SerializeSeq = Items<'py>;
    type SerializeTuple = Items<'py>;
    type SerializeTupleStruct = Items<'py>;
    type SerializeTupleVariant = Items<'py>;
    type SerializeMap = Entries<'py>;
    type SerializeStruct = Entries<'py>;
    type SerializeStructVariant = Entries<'py>;

    plain! {
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_f32: f32,
        serialize_f64: f64, serialize_char: char, serialize_str: &str, serialize_bytes: &[u8]
    }

    fn serialize_none(self) -> Written<'py> {
        Ok(self.0.None().into_bound(self.0))
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Written<'py> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Written<'py> {
        self.serialize_none()
    }

    fn serialize_unit_struct(self, _: &'static str) -> Written<'py> {
        self.serialize_none()
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, variant: &'static str) -> Written<'py> {
        self.object(variant)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> Written<'py> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Written<'py> {
        self.named(Some(variant), value.serialize(self)?)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Items<'py>, SerialError> {
        Ok(self.items(None))
    }

    fn serialize_tuple(self, _: usize) -> Result<Items<'py>, SerialError> {
        Ok(self.items(None))
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Items<'py>, SerialError> {
        Ok(self.items(None))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Items<'py>, SerialError> {
        Ok(self.items(Some(variant)))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Entries<'py>, SerialError> {
        Ok(self.entries(None))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Entries<'py>, SerialError> {
        Ok(self.entries(None))
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Entries<'py>, SerialError> {
        Ok(self.entries(Some(variant)))
    }
}

/// A list that is being made.
struct Items<'py> {
    writer: Writer<'py>,
    list: Bound<'py, PyList>,
    variant: Option<&'static str>,
}

impl<'py> SerializeSeq for Items<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = SerialError;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), SerialError> {
        Ok(self.list.append(value.serialize(self.writer)?)?)
    }

    fn end(self) -> Written<'py> {
        self.writer.named(self.variant, self.list.into_any())
    }
}

/// A dictionary that is being made.
struct Entries<'py> {
    writer: Writer<'py>,
    dict: Bound<'py, PyDict>,
    key: Option<Bound<'py, PyAny>>,
    variant: Option<&'static str>,
}

impl<'py> SerializeMap for Entries<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = SerialError;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), SerialError> {
        self.key = Some(key.serialize(self.writer)?);
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), SerialError> {
        let key = self.key.take().ok_or_else(|| <SerialError as ser::Error>::custom("a value without a key"))?;
        Ok(self.dict.set_item(key, value.serialize(self.writer)?)?)
    }

    fn end(self) -> Written<'py> {
        self.writer.named(self.variant, self.dict.into_any())
    }
}

/// Lists and dictionaries of other kinds, which are made alike.
macro_rules! alike {
    ($($kind:ident: $how:ident, $method:ident($($argument:ident: $type:ty)?);)*) => {
        $(impl<'py> ser::$kind for $how<'py> {
            type Ok = Bound<'py, PyAny>;
            type Error = SerialError;

            fn $method<T: Serialize + ?Sized>(&mut self, $($argument: $type,)? value: &T) -> Result<(), SerialError> {
                self.add($($argument,)? value)
            }

            fn end(self) -> Written<'py> {
                self.close()
            }
        })*
    };
}

impl<'py> Items<'py> {
    fn add<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), SerialError> {
        SerializeSeq::serialize_element(self, value)
    }

    fn close(self) -> Written<'py> {
        SerializeSeq::end(self)
    }
}

impl<'py> Entries<'py> {
    fn add<T: Serialize + ?Sized>(&mut self, key: &'static str, value: &T) -> Result<(), SerialError> {
        SerializeMap::serialize_entry(self, key, value)
    }

    fn close(self) -> Written<'py> {
        SerializeMap::end(self)
    }
}

alike! {
    SerializeTuple: Items, serialize_element();
    SerializeTupleStruct: Items, serialize_field();
    SerializeTupleVariant: Items, serialize_field();
    SerializeStruct: Entries, serialize_field(key: &'static str);
    SerializeStructVariant: Entries, serialize_field(key: &'static str);
}

/// Reads Python's objects.
struct Reader<'py>(Bound<'py, PyAny>);

impl<'py> Reader<'py> {
    fn items(&self) -> Result<Vec<Bound<'py, PyAny>>, SerialError> {
        Ok(self.0.try_iter()?.collect::<PyResult<_>>()?)
    }

    fn visit_items<'de, V: Visitor<'de>>(&self, visitor: V) -> Result<V::Value, SerialError> {
        let items = self.items()?.into_iter().map(Reader);
        let mut access = de::value::SeqDeserializer::new(items);
        let value = visitor.visit_seq(&mut access)?;
        access.end()?;
        Ok(value)
    }

    fn is_list(&self) -> bool {
        self.0.is_instance_of::<PyList>() || self.0.is_instance_of::<PyTuple>()
    }
}

impl<'de> IntoDeserializer<'de, SerialError> for Reader<'_> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> de::Deserializer<'de> for Reader<'_> {
    type Error = SerialError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, SerialError> {
        let value = &self.0;
        if value.is_none() {
            visitor.visit_unit()
        } else if value.is_instance_of::<PyBool>() {
            visitor.visit_bool(value.extract()?)
        } else if value.is_instance_of::<PyInt>() {
            match value.extract::<u64>() {
                Ok(number) => visitor.visit_u64(number),
                Err(_) => visitor.visit_i64(value.extract()?),
            }
        } else if value.is_instance_of::<PyFloat>() {
            visitor.visit_f64(value.extract()?)
        } else if value.is_instance_of::<PyString>() {
            visitor.visit_string(value.extract()?)
        } else if let Ok(dict) = value.cast::<PyDict>() {
            let entries = dict.iter().map(|(key, value)| (Reader(key), Reader(value)));
            let mut access = de::value::MapDeserializer::new(entries);
            let value = visitor.visit_map(&mut access)?;
            access.end()?;
            Ok(value)
        } else if self.is_list() || value.hasattr("__array__")? && value.len().is_ok() {
            self.visit_items(visitor)
        } else if let Ok(number) = value.extract::<f64>() {
            // A scalar of NumPy's.
            visitor.visit_f64(number)
        } else {
            // A path, for one.
            let path: std::path::PathBuf = value
                .extract()
                .map_err(|_| <SerialError as de::Error>::custom(format!("a value is {}", type_name(value))))?;
            visitor.visit_string(path.to_string_lossy().into_owned())
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, SerialError> {
        if self.0.is_none() { visitor.visit_none() } else { visitor.visit_some(self) }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, SerialError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, SerialError> {
        if let Ok(name) = self.0.extract::<String>() {
            return visitor.visit_enum(name.into_deserializer());
        }
        let single = self.0.cast::<PyDict>().ok().filter(|dict| dict.len() == 1).and_then(|dict| dict.iter().next());
        match single {
            Some((name, contents)) => visitor.visit_enum(Variant { name: Reader(name), contents: Reader(contents) }),
            None => Err(de::Error::custom(format!(
                "found {}, expected one of {} or a dictionary of one of them",
                type_name(&self.0),
                variants.join(", ")
            ))),
        }
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

/// A variant with contents.
struct Variant<'py> {
    name: Reader<'py>,
    contents: Reader<'py>,
}

impl<'de, 'py> de::EnumAccess<'de> for Variant<'py> {
    type Error = SerialError;
    type Variant = Reader<'py>;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Reader<'py>), SerialError> {
        Ok((seed.deserialize(self.name)?, self.contents))
    }
}

impl<'de> de::VariantAccess<'de> for Reader<'_> {
    type Error = SerialError;

    fn unit_variant(self) -> Result<(), SerialError> {
        match self.0.is_none() {
            true => Ok(()),
            false => Err(de::Error::custom("a name alone was expected, without contents")),
        }
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, SerialError> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, SerialError> {
        self.visit_items(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(self, _: &'static [&'static str], visitor: V) -> Result<V::Value, SerialError> {
        de::Deserializer::deserialize_any(self, visitor)
    }
}
