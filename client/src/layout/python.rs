//! The contract as a Python module: one `ctypes.Structure` a message, with the static `type_name()` that the package
//! `iceoryx2` looks for.

use inekf_shared::message::Layout;
use inekf_shared::transport::{IPC_PREFIX_VARIABLE, IPC_ROOT_VARIABLE};

use super::{CODES, LAYOUTS, Names, push};

const NAMES: Names = Names {
    u8: "ctypes.c_uint8",
    u32: "ctypes.c_uint32",
    u64: "ctypes.c_uint64",
    f64: "ctypes.c_double",
    prefix: "",
};

const HEAD: &str = r#""""The messages of the estimation daemon. Written by `inekf-client layout --python`: do not edit.

SI units and radians; world east-north-up, body forward-left-up; quaternions x, y, z, w, body to world.
Meaning, unit and frame of every field: the documentation of the Rust module inekf_shared::message.
"""

import ctypes
import os
"#;

const TAIL: &str = r#"

def service_name(instance, topic):
    """Name of a service: topics are imu, odometry2d, odometry3d, position, velocity, heading,
    estimate, latest, smoothed, health, control and wake."""
    return f"inekf/{instance}/{topic}"


def open_node():
    """A node of the package iceoryx2 where the daemon looks: as ROOT and PREFIX say."""
    import iceoryx2

    config = iceoryx2.config.default()
    if "ROOT" in os.environ:
        config.global_cfg.root_path = iceoryx2.Path.new(os.environ["ROOT"])
    if "PREFIX" in os.environ:
        config.global_cfg.prefix = iceoryx2.FileName.new(os.environ["PREFIX"])
    return iceoryx2.NodeBuilder.new().config(config).create(iceoryx2.ServiceType.Ipc)


for _message in MESSAGES:
    _fields = [(name, getattr(_message, name).offset) for name, _ in _message._fields_]
    assert ctypes.sizeof(_message) == _message.SIZE, _message
    assert ctypes.alignment(_message) == _message.ALIGN, _message
    assert _fields == _message.OFFSETS, _message
    # Without a hole: a field of another size would leave one.
    _sizes = [ctypes.sizeof(held) for _, held in _message._fields_]
    assert sum(_sizes) == _message.SIZE, _message
"#;

/// The text of the module.
///
/// ```
/// use inekf_client::layout;
///
/// let module = layout::python();
/// assert!(module.contains("(\"gyro_rps\", ctypes.c_double * 3)"));
/// assert!(module.contains("\"inekf.ImuSample.v1\""));
/// ```
#[must_use]
pub fn python() -> String {
    let mut text = HEAD.to_owned();
    text.push('\n');
    for (name, code) in CODES {
        push(&mut text, format_args!("{name} = {code}\n"));
    }
    for layout in LAYOUTS {
        push_class(&mut text, layout);
    }
    text.push_str("\n\nMESSAGES = [\n");
    for layout in LAYOUTS {
        push(&mut text, format_args!("    {},\n", layout.name));
    }
    text.push_str("]\n");
    text.push_str(
        &TAIL
            .replace("ROOT", IPC_ROOT_VARIABLE)
            .replace("PREFIX", IPC_PREFIX_VARIABLE),
    );
    text
}

fn push_class(text: &mut String, layout: &Layout) {
    let Layout {
        name,
        type_name,
        size,
        align,
        fields,
    } = layout;
    push(
        text,
        format_args!("\n\nclass {name}(ctypes.Structure):\n    _fields_ = [\n"),
    );
    for field in *fields {
        let (of, counts) = NAMES.of(field.holds);
        // ctypes reads from the inside out: the innermost count comes first.
        let counts: String = counts
            .iter()
            .rev()
            .map(|count| format!(" * {count}"))
            .collect();
        push(
            text,
            format_args!("        (\"{}\", {of}{counts}),\n", field.name),
        );
    }
    push(
        text,
        format_args!("    ]\n    SIZE, ALIGN = {size}, {align}\n    OFFSETS = [\n"),
    );
    for field in *fields {
        push(
            text,
            format_args!("        (\"{}\", {}),\n", field.name, field.offset),
        );
    }
    push(
        text,
        format_args!(
            "    ]\n\n    @staticmethod\n    def type_name():\n        return \"{type_name}\"\n"
        ),
    );
}
