//! What every message is, and the macro that pins its layout.
//!
//! `layout!` takes the layout as literal numbers and proves it at compile time: size, alignment, the offset of every
//! field, and that the fields fill the struct without a hole. It lists every field (a struct literal refuses to
//! leave one out) and accepts only field types that implement [`Zero`], which `bool` and enums do not.

use core::fmt::Debug;

use iceoryx2::prelude::ZeroCopySend;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A value whose bytes are all zero. Implemented for the numbers a message may hold, arrays of them, and messages.
///
/// ```
/// use inekf_shared::message::{FieldType, Health, Message, Zero};
///
/// assert_eq!(<[u32; 3]>::ZERO, [0, 0, 0]);
/// assert_eq!(<[u32; 3]>::TYPE, FieldType::Array(&FieldType::U32, 3));
/// assert!(Health::ZERO.as_bytes().iter().all(|byte| *byte == 0));
/// ```
pub trait Zero: Copy {
    /// The value whose bytes are all zero.
    const ZERO: Self;

    /// What a field of this type holds.
    const TYPE: FieldType;
}

impl Zero for u8 {
    const ZERO: Self = 0;
    const TYPE: FieldType = FieldType::U8;
}
impl Zero for u32 {
    const ZERO: Self = 0;
    const TYPE: FieldType = FieldType::U32;
}
impl Zero for u64 {
    const ZERO: Self = 0;
    const TYPE: FieldType = FieldType::U64;
}
impl Zero for f64 {
    const ZERO: Self = 0.0;
    const TYPE: FieldType = FieldType::F64;
}
impl<T: Zero, const N: usize> Zero for [T; N] {
    const ZERO: Self = [T::ZERO; N];
    const TYPE: FieldType = FieldType::Array(&T::TYPE, N);
}

/// What a field of a message holds.
///
/// ```
/// use inekf_shared::message::{FieldType, ImuSample, Message};
///
/// let gyro = ImuSample::WIRE.fields[1];
/// assert_eq!((gyro.name, gyro.holds), ("gyro_rps", FieldType::Array(&FieldType::F64, 3)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldType {
    /// An octet.
    U8,
    /// An unsigned integer of 32 bits.
    U32,
    /// An unsigned integer of 64 bits.
    U64,
    /// A double.
    F64,
    /// So many of one type, one after the other.
    Array(&'static FieldType, usize),
    /// A struct of the contract.
    Struct(&'static Layout),
}

/// One field of a message.
///
/// ```
/// use inekf_shared::message::{HeadingFix, Message};
///
/// let heading = HeadingFix::WIRE.fields.iter().find(|field| field.name == "heading_rad");
/// assert_eq!(heading.map(|field| field.offset), Some(40));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Bytes before it.
    pub offset: usize,
    /// What it holds.
    pub holds: FieldType,
}

/// The layout of a message, for writing it down in other languages.
///
/// ```
/// use inekf_shared::message::LAYOUTS;
///
/// for layout in LAYOUTS {
///     // A name with its version; fields in order, the first at the beginning.
///     assert!(layout.type_name.starts_with(&format!("inekf.{}.v", layout.name)));
///     assert!(layout.fields[0].offset == 0 && layout.fields.is_sorted_by_key(|field| field.offset));
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Name of the struct.
    pub name: &'static str,
    /// The name under which iceoryx2 knows it.
    pub type_name: &'static str,
    /// Its size, bytes.
    pub size: usize,
    /// Its alignment, bytes.
    pub align: usize,
    /// Every field, in order, without a hole.
    pub fields: &'static [Field],
}

/// A message of the wire contract: fixed layout, any bytes valid, free of padding.
///
/// ```
/// use inekf_shared::message::{ImuSample, Message, Zero};
///
/// let sample = ImuSample { gyro_rps: [0.1, 0.2, 0.3], ..ImuSample::ZERO };
/// // The bytes as they lie in shared memory, and back.
/// let bytes = sample.as_bytes();
/// assert_eq!(bytes[32..40], 0.1_f64.to_ne_bytes());
/// assert_eq!(ImuSample::from_bytes(bytes), Some(sample));
/// // Too few of them are no message.
/// assert_eq!(ImuSample::from_bytes(&bytes[1..]), None);
/// ```
pub trait Message:
    Zero + ZeroCopySend + Debug + PartialEq + Serialize + DeserializeOwned + 'static
{
    /// The name under which iceoryx2 knows the type, version included. C, C++ and Python attach by it.
    const TYPE_NAME: &'static str;

    /// Name and byte offset of every field, in order: for layout tests in other languages.
    const FIELDS: &'static [(&'static str, usize)];

    /// The whole layout.
    const WIRE: Layout;

    /// The bytes of the message, as they lie in shared memory.
    fn as_bytes(&self) -> &[u8];

    /// The message that has these bytes; `None` if they are too many or too few.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

/// What the field that `_project` borrows holds.
pub(crate) const fn type_of_field<T, F: Zero>(_project: fn(&T) -> &F) -> FieldType {
    F::TYPE
}

/// Size of the field that `_project` borrows.
pub(crate) const fn size_of_field<T, F>(_project: fn(&T) -> &F) -> usize {
    size_of::<F>()
}

/// Implements [`Zero`], [`Default`] (zero) and [`Message`] for a struct and asserts its layout.
macro_rules! layout {
    ($name:ident as $type_name:literal, size $size:literal, align $align:literal {
        $($field:ident: $offset:literal),+ $(,)?
    }) => {
        impl $crate::message::Zero for $name {
            const ZERO: Self = Self { $($field: $crate::message::Zero::ZERO),+ };
            const TYPE: $crate::message::FieldType =
                $crate::message::FieldType::Struct(&<Self as $crate::message::Message>::WIRE);
        }

        impl Default for $name {
            /// All bytes zero.
            fn default() -> Self {
                <Self as $crate::message::Zero>::ZERO
            }
        }

        impl $crate::message::Message for $name {
            const TYPE_NAME: &'static str = $type_name;
            const FIELDS: &'static [(&'static str, usize)] = &[$((stringify!($field), $offset)),+];

            fn as_bytes(&self) -> &[u8] {
                // SAFETY: below it is asserted that the fields, which are numbers or made of such (`Zero`), fill the
                // struct without a hole, so that every byte is initialised.
                unsafe { core::slice::from_raw_parts((&raw const *self).cast(), size_of::<Self>()) }
            }

            fn from_bytes(bytes: &[u8]) -> Option<Self> {
                if bytes.len() != size_of::<Self>() {
                    return None;
                }
                // SAFETY: the bytes are as many as the struct has, and any bytes are a value of numbers (`Zero`).
                Some(unsafe { bytes.as_ptr().cast::<Self>().read_unaligned() })
            }
            const WIRE: $crate::message::Layout = $crate::message::Layout {
                name: stringify!($name),
                type_name: $type_name,
                size: $size,
                align: $align,
                fields: &[$($crate::message::Field {
                    name: stringify!($field),
                    offset: $offset,
                    holds: $crate::message::layout::type_of_field::<$name, _>(|message| &message.$field),
                }),+],
            };
        }

        const _: () = {
            assert!(size_of::<$name>() == $size);
            assert!(align_of::<$name>() == $align);
            $(assert!(core::mem::offset_of!($name, $field) == $offset);)+
            let filled = 0 $(
                + $crate::message::layout::size_of_field::<$name, _>(|message| &message.$field)
            )+;
            assert!(filled == $size, "the struct has implicit padding");
        };
    };
}
pub(crate) use layout;
