//! Enumerations whose values users write by name.

/// Generates the table of names of an enumeration's variants, and look-ups in both directions.
macro_rules! named {
    ($kind:ty, $($name:literal => $value:ident),+) => {
        impl $kind {
            /// The variants with the names that users write.
            pub const NAMED: &'static [(&'static str, Self)] = &[$(($name, Self::$value)),+];

            /// The name of the variant, as users write it.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name),+
                }
            }

            /// The variant with this name; `None` for an unknown name.
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
            }
        }
    };
}
