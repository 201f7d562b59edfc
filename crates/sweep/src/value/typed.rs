//! Values with types again: a serde reader of [`Value`].

use serde::{
    Deserializer,
    de::{
        self, Error as _, IntoDeserializer, Visitor,
        value::{Error, MapAccessDeserializer, MapDeserializer, SeqDeserializer},
    },
    forward_to_deserialize_any,
};

use super::Value;

/// Reads a value.
pub(super) struct Reader(pub(super) Value);

impl IntoDeserializer<'_, Error> for Reader {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Reader {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self.0 {
            Value::Bool(value) => visitor.visit_bool(value),
            Value::Whole(value) => visitor.visit_u64(value),
            Value::Below(value) => visitor.visit_i64(value),
            Value::Number(value) => visitor.visit_f64(value),
            Value::Text(value) => visitor.visit_string(value),
            Value::Nothing => visitor.visit_unit(),
            Value::List(list) => visitor.visit_seq(SeqDeserializer::new(list.into_iter().map(Self))),
            Value::Map(map) => visitor.visit_map(entries(map)),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self.0 {
            Value::Nothing => visitor.visit_none(),
            value => visitor.visit_some(Self(value)),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self.0 {
            Value::Text(choice) => visitor.visit_enum(choice.into_deserializer()),
            // A choice may itself be called None.
            Value::Nothing if variants.contains(&"None") => visitor.visit_enum("None".into_deserializer()),
            Value::Map(map) => visitor.visit_enum(MapAccessDeserializer::new(entries(map))),
            other => Err(Error::custom(format!("{other} is none of {}", variants.join(", ")))),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

/// Returns the entries of a map, each value's error with its key before it.
fn entries<'de>(map: std::collections::BTreeMap<String, Value>) -> impl de::MapAccess<'de, Error = Error> {
    MapDeserializer::new(map.into_iter().map(|(key, value)| (key, Reader(value))))
}
