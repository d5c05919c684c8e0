//! Enums whose values have names in files, messages and on the command line.

/// Declares an enum with `ALL`, `name` and `by_name`, each value beside its name.
///
/// ```
/// hexad_core::named! {
///     /// Direction of a leg.
///     #[derive(Clone, Copy, Debug, PartialEq)]
///     pub enum Direction {
///         /// It becomes longer.
///         Out => "out",
///         /// It becomes shorter.
///         In => "in",
///     }
/// }
/// assert_eq!(Direction::ALL.map(Direction::name), ["out", "in"]);
/// assert_eq!(Direction::by_name("in"), Some(Direction::In));
/// ```
#[macro_export]
macro_rules! named {
    (
        $(#[$meta:meta])*
        pub enum $type:ident { $($(#[$value_meta:meta])* $value:ident $(= $number:literal)? => $name:literal,)* }
    ) => {
        $(#[$meta])*
        pub enum $type { $($(#[$value_meta])* $value $(= $number)?,)* }

        impl $type {
            /// Every value, in the order of its declaration.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$value),*];

            /// Name in files, messages and on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$value => $name,)* }
            }

            /// The value with a name.
            pub fn by_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }
    };
}
