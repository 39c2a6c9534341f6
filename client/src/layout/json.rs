//! The contract as JSON, for programs that write their own bindings.

use inekf_shared::message::FieldType;
use serde_json::{Map, Value, json};

use super::{CODES, LAYOUTS, element};

/// An object with `messages` (name, type name, size, alignment, fields with offset, type and counts) and `codes`.
#[must_use]
pub fn json() -> String {
    let messages: Vec<Value> = LAYOUTS
        .iter()
        .map(|layout| {
            let fields: Vec<Value> = layout
                .fields
                .iter()
                .map(|field| {
                    let (inner, counts) = element(field.holds);
                    json!({
                        "name": field.name,
                        "offset": field.offset,
                        "type": type_name(inner),
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

fn type_name(holds: FieldType) -> &'static str {
    match holds {
        FieldType::U8 => "u8",
        FieldType::U32 => "u32",
        FieldType::U64 => "u64",
        FieldType::F64 => "f64",
        FieldType::Struct(layout) => layout.name,
        // `element` has taken the arrays off.
        FieldType::Array(of, _) => type_name(*of),
    }
}
