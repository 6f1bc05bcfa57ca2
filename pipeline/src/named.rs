//! Values that users write by name.

/// Gives the variants of an enumeration their names: a table of them, and both ways through it.
macro_rules! named {
    ($kind:ty, $($name:literal => $value:ident),+) => {
        impl $kind {
            /// Each with the name that users write.
            pub const NAMED: &'static [(&'static str, Self)] = &[$(($name, Self::$value)),+];

            /// Its name, as users write it.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name),+
                }
            }

            /// The one of this name.
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
            }
        }
    };
}
