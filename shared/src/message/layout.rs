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
pub trait Zero: Copy {
    /// The value whose bytes are all zero.
    const ZERO: Self;
}

impl Zero for u8 {
    const ZERO: Self = 0;
}
impl Zero for u32 {
    const ZERO: Self = 0;
}
impl Zero for u64 {
    const ZERO: Self = 0;
}
impl Zero for f64 {
    const ZERO: Self = 0.0;
}
impl<T: Zero, const N: usize> Zero for [T; N] {
    const ZERO: Self = [T::ZERO; N];
}

/// A message of the wire contract: fixed layout, any bytes valid, free of padding.
pub trait Message:
    Zero + ZeroCopySend + Debug + PartialEq + Serialize + DeserializeOwned + 'static
{
    /// The name under which iceoryx2 knows the type, version included. C, C++ and Python attach by it.
    const TYPE_NAME: &'static str;

    /// Name and byte offset of every field, in order: for layout tests in other languages.
    const FIELDS: &'static [(&'static str, usize)];

    /// The bytes of the message, as they lie in shared memory.
    fn as_bytes(&self) -> &[u8];

    /// The message that has these bytes; `None` if they are too many or too few.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
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
