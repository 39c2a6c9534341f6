//! The contract as a header for C (C11) and C++ (C++17): one struct a message, every offset asserted at compile time.
//! For C++ each struct names itself in `IOX2_TYPE_NAME`, which iceoryx2's C++ bindings look for.

use inekf_shared::message::Layout;

use super::{CODES, LAYOUTS, Names, push};

const NAMES: Names = Names {
    u8: "uint8_t",
    u32: "uint32_t",
    u64: "uint64_t",
    f64: "double",
    prefix: "Inekf",
};

const HEAD: &str = "\
/* The messages of the estimation daemon. Written by `inekf-client layout --c`: do not edit.
 *
 * SI units and radians; world east-north-up, body forward-left-up; quaternions x, y, z, w, body to world.
 * Meaning, unit and frame of every field: the documentation of the Rust module inekf_shared::message. */
#ifndef INEKF_MESSAGES_H
#define INEKF_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define INEKF_CHECK(what) static_assert(what, \"the layout is not the daemon's: \" #what)
#define INEKF_TYPE_NAME(name) static constexpr const char* IOX2_TYPE_NAME = name;
#define INEKF_ALIGN(type) alignof(type)
#else
#define INEKF_CHECK(what) _Static_assert(what, \"the layout is not the daemon's: \" #what)
#define INEKF_TYPE_NAME(name)
#define INEKF_ALIGN(type) _Alignof(type)
#endif
";

/// The text of the header.
///
/// ```
/// use inekf_client::layout;
///
/// // The header checks itself: a compiler that lays the structs out otherwise says so.
/// let header = layout::c();
/// assert!(header.contains("double gyro_rps[3];"));
/// assert!(header.contains("the layout is not the daemon's"));
/// ```
#[must_use]
pub fn c() -> String {
    let mut text = HEAD.to_owned();
    text.push('\n');
    for (name, code) in CODES {
        push(&mut text, format_args!("#define INEKF_{name} {code}u\n"));
    }
    for layout in LAYOUTS {
        push_struct(&mut text, layout);
    }
    text.push_str("\n#endif\n");
    text
}

fn push_struct(text: &mut String, layout: &Layout) {
    let Layout {
        name,
        type_name,
        size,
        align,
        fields,
    } = layout;
    // The macro stands alone and the others name the type: C has no name of a struct inside it.
    push(
        text,
        format_args!(
            "\n#define INEKF_{}_TYPE \"{type_name}\"\ntypedef struct Inekf{name} {{\n    \
             INEKF_TYPE_NAME(INEKF_{}_TYPE)\n",
            upper(name),
            upper(name)
        ),
    );
    for field in *fields {
        let (of, counts) = NAMES.of(field.holds);
        let counts: String = counts.iter().map(|count| format!("[{count}]")).collect();
        push(text, format_args!("    {of} {}{counts};\n", field.name));
    }
    push(text, format_args!("}} Inekf{name};\n"));
    push(
        text,
        format_args!(
            "INEKF_CHECK(sizeof(Inekf{name}) == {size});\n\
             INEKF_CHECK(INEKF_ALIGN(Inekf{name}) == {align});\n"
        ),
    );
    for field in *fields {
        push(
            text,
            format_args!(
                "INEKF_CHECK(offsetof(Inekf{name}, {}) == {});\n",
                field.name, field.offset
            ),
        );
    }
}

/// `EstimateSe23` as `ESTIMATE_SE23`.
fn upper(name: &str) -> String {
    let mut upper = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !upper.is_empty() {
            upper.push('_');
        }
        upper.push(letter.to_ascii_uppercase());
    }
    upper
}
