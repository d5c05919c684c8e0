//! The one list of the fields of each message: `message!` declares a struct and describes it.
//!
//! From the description follow the declarations in other languages (`hexad messages`), the columns of CSV files, the
//! checksum, the schemas of recordings and the tests of the layout. A field is declared in no other place.
#![allow(unsafe_code, reason = "a struct as its bytes; each block carries its argument")]

/// Memory layout of a struct in the shared memory.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Name under which iceoryx2 identifies the type: `hexad_` and the rest in snake case.
    pub type_name: &'static str,
    /// `None` for a struct that is part of a message.
    pub topic: Option<Topic>,
    /// Size of the struct \[bytes\].
    pub size: usize,
    /// Alignment of the struct \[bytes\].
    pub align: usize,
    /// The fields in the order of their offsets, without gaps.
    pub fields: &'static [Field],
    /// Meaning of the struct, from its doc comment.
    pub doc: &'static str,
}

/// Topic of a message.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// Last part of the topic's name.
    pub name: &'static str,
    /// Version of the message.
    pub schema: u32,
}

/// One field of a [`Layout`].
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Name of the field, the same in every language.
    pub name: &'static str,
    /// Type of the value, or of each element of an array.
    pub kind: Kind,
    /// Number of elements of an array; `None` for a single value.
    pub count: Option<usize>,
    /// Bytes before it in the struct.
    pub offset: usize,
    /// Empty for a number without unit.
    pub unit: &'static str,
    /// Meaning of the field, from its doc comment.
    pub doc: &'static str,
}

/// Type of a field or of the elements of an array.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// Unsigned integer of 32 bits.
    U32,
    /// Unsigned integer of 64 bits.
    U64,
    /// IEEE 754 number of 64 bits.
    F64,
    /// Another struct declared by `message!`, with its layout.
    Struct(&'static Layout),
}

/// A type that a message may contain: a number, an array, a struct declared by `message!`.
pub trait FieldType {
    /// Type of the value, or of each element of an array.
    const KIND: Kind;
    /// Number of elements of an array; `None` for a single value.
    const COUNT: Option<usize> = None;

    /// Calls `visit` with each number in order, as a float and as the bytes in memory.
    fn visit(&self, visit: &mut dyn FnMut(f64, &[u8]));
}

/// A struct declared by `message!`.
pub trait Declared: FieldType + Copy {
    /// Description of the struct in memory; declarations in other languages follow from it.
    const LAYOUT: Layout;

    /// All numbers of the struct, in the order of [`Layout::columns`].
    fn numbers(&self) -> Vec<f64> {
        let mut numbers = Vec::new();
        self.visit(&mut |number, _| numbers.push(number));
        numbers
    }

    /// The struct as it is in memory, which for numbers without gaps is also its CDR encoding.
    fn bytes(&self) -> &[u8] {
        // SAFETY: `message!` accepts only structs of plain numbers without gaps, so every byte is initialized; the slice
        // has the size of the struct and borrows it.
        unsafe { core::slice::from_raw_parts(core::ptr::from_ref(self).cast(), size_of::<Self>()) }
    }

    /// Reads what [`Self::bytes`] returned; `None` if the size differs.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let is_whole = bytes.len() == size_of::<Self>();
        // SAFETY: there are as many bytes as the struct has, at any alignment, and each pattern of bits is a number.
        is_whole.then(|| unsafe { bytes.as_ptr().cast::<Self>().read_unaligned() })
    }

    /// CRC-32 (of zlib, PNG, Ethernet) of the bytes before an offset.
    fn checksum_before(&self, offset: usize) -> u32 {
        let mut crc = crc32fast::Hasher::new();
        let mut at = 0;
        self.visit(&mut |_, bytes| {
            if at < offset {
                crc.update(bytes);
            }
            at += bytes.len();
        });
        crc.finalize()
    }
}

impl Layout {
    /// `LoopTimes` for `hexad_loop_times`.
    pub fn class(&self) -> String {
        let words = self.type_name.split('_').skip(1);
        words
            .flat_map(|word| word.chars().take(1).flat_map(char::to_uppercase).chain(word.chars().skip(1)))
            .collect()
    }

    /// Names of all numbers, nested names joined by `_`, elements of arrays counted from 1.
    pub fn columns(&self, prefix: &str) -> Vec<String> {
        let mut columns = Vec::new();
        for field in self.fields {
            let name = format!("{prefix}{}", field.name);
            let names = match field.count {
                None => vec![name],
                Some(count) => (1..=count).map(|k| format!("{name}_{k}")).collect(),
            };
            for name in names {
                match field.kind {
                    Kind::Struct(nested) => columns.extend(nested.columns(&format!("{name}_"))),
                    Kind::U32 | Kind::U64 | Kind::F64 => columns.push(name),
                }
            }
        }
        columns
    }
}

macro_rules! number {
    ($type:ty, $kind:ident) => {
        impl FieldType for $type {
            const KIND: Kind = Kind::$kind;

            fn visit(&self, visit: &mut dyn FnMut(f64, &[u8])) {
                visit(*self as f64, &self.to_ne_bytes());
            }
        }
    };
}

number!(u32, U32);
number!(u64, U64);
number!(f64, F64);

impl<T: FieldType, const N: usize> FieldType for [T; N] {
    const KIND: Kind = T::KIND;
    const COUNT: Option<usize> = Some(N);

    fn visit(&self, visit: &mut dyn FnMut(f64, &[u8])) {
        self.iter().for_each(|element| element.visit(visit));
    }
}

/// Declares a `#[repr(C)]` struct: its fields with type, unit and meaning.
///
/// `on "topic" schema 1` makes it a [`Message`](super::Message), whose first field is the header. `sealed by` names
/// the field with the checksum of the fields before it. A struct with gaps between its fields does not compile.
macro_rules! message {
    (
        $(#[doc = $doc:literal])*
        $name:ident = $type_name:tt $(on $topic:literal schema $schema:literal $(sealed by $checksum:ident)?)? {
            $($(#[doc = $field_doc:literal])* $field:ident: $type:ty $([$unit:literal])?,)*
        }
    ) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, serde::Serialize, serde::Deserialize)]
        #[type_name($type_name)]
        #[repr(C)]
        pub struct $name {
            $($(#[doc = $field_doc])* $(#[doc = concat!(" \\[", $unit, "\\]")])? pub $field: $type,)*
        }

        const _: () = assert!(size_of::<$name>() == 0 $(+ size_of::<$type>())*, "a gap between fields");

        impl $crate::messages::layout::FieldType for $name {
            const KIND: $crate::messages::layout::Kind = $crate::messages::layout::Kind::Struct(
                &<Self as $crate::messages::layout::Declared>::LAYOUT,
            );

            fn visit(&self, visit: &mut dyn FnMut(f64, &[u8])) {
                $($crate::messages::layout::FieldType::visit(&self.$field, visit);)*
            }
        }

        impl $crate::messages::layout::Declared for $name {
            const LAYOUT: $crate::messages::layout::Layout = $crate::messages::layout::Layout {
                type_name: $type_name,
                topic: {
                    let topic: &[$crate::messages::layout::Topic] =
                        &[$($crate::messages::layout::Topic { name: $topic, schema: $schema })?];
                    topic.first().copied()
                },
                size: size_of::<Self>(),
                align: align_of::<Self>(),
                fields: &[$($crate::messages::layout::Field {
                    name: stringify!($field),
                    kind: <$type as $crate::messages::layout::FieldType>::KIND,
                    count: <$type as $crate::messages::layout::FieldType>::COUNT,
                    offset: core::mem::offset_of!($name, $field),
                    unit: concat!($($unit)?),
                    doc: concat!($($field_doc),*),
                },)*],
                doc: concat!($($doc),*),
            };
        }

        $(impl $crate::messages::Message for $name {
            const TOPIC: &'static str = $topic;
            const SCHEMA: u32 = $schema;

            fn header(&self) -> &$crate::messages::Header {
                &self.header
            }

            fn header_mut(&mut self) -> &mut $crate::messages::Header {
                &mut self.header
            }

            $crate::messages::layout::seal!($name $($checksum)?);
        })?
    };
}

/// The part of a [`Message`](super::Message) that concerns its checksum.
macro_rules! seal {
    ($name:ident) => {};
    ($name:ident $checksum:ident) => {
        fn seal(&mut self) {
            self.$checksum = self.computed_checksum();
        }

        fn is_intact(&self) -> bool {
            self.$checksum == self.computed_checksum()
        }
    };
}

pub(super) use {message, seal};
