//! Numbers by which the parts of a world are named.

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident),*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
        pub struct $name(pub u32);
    )*};
}

ids! {
    /// A shape of a world, by number.
    ShapeId,
    /// A material of a world, by number.
    MaterialId,
    /// A texture of a world, by number.
    TextureId,
    /// A light of a world, by number; glowing shapes come after the others.
    LightId,
    /// A group of shapes that can be placed more than once, by number.
    GroupId,
    /// One placing of a group, by number.
    InstanceId,
    /// A medium of a world, by number.
    MediumId
}

impl GroupId {
    /// The group that stands in the world itself.
    pub const ROOT: Self = Self(0);
}
