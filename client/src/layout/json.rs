//! The contract as JSON, for programs that write their own bindings.

use serde_json::{Map, Value, json};

use super::{CODES, LAYOUTS, Names};

const NAMES: Names = Names {
    u8: "u8",
    u32: "u32",
    u64: "u64",
    f64: "f64",
    prefix: "",
};

/// An object with `messages` (name, type name, size, alignment, fields with offset, type and counts) and `codes`.
///
/// ```
/// use inekf_client::layout;
///
/// let contract: serde_json::Value = serde_json::from_str(&layout::json())?;
/// let imu = &contract["messages"][1];
/// assert_eq!((imu["name"].as_str(), imu["size"].as_u64()), (Some("ImuSample"), Some(80)));
/// # Ok::<(), serde_json::Error>(())
/// ```
#[must_use]
pub fn json() -> String {
    let messages: Vec<Value> = LAYOUTS
        .iter()
        .map(|layout| {
            let fields: Vec<Value> = layout
                .fields
                .iter()
                .map(|field| {
                    let (of, counts) = NAMES.of(field.holds);
                    json!({
                        "name": field.name,
                        "offset": field.offset,
                        "type": of,
                        "counts": counts,
                    })
                })
                .collect();
            json!({
                "name": layout.name,
                "type_name": layout.type_name,
                "size": layout.size,
                "align": layout.align,
                "fields": fields,
            })
        })
        .collect();
    let codes: Map<String, Value> = CODES
        .iter()
        .map(|(name, code)| ((*name).to_owned(), json!(code)))
        .collect();
    format!("{:#}\n", json!({ "messages": messages, "codes": codes }))
}
