//! `hexad messages`: declarations of all messages in another language, generated from the one list of their
//! fields.

use core::fmt::{self, Write as _};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::failure::Failure;
use hexad_client::messages::MESSAGES;
use hexad_client::messages::layout::{Field, Kind, Layout, Topic};
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::inputs::SetpointKind;
use hexad_core::control::signals::limits::Limit;
use hexad_core::control::signals::state::{Request, State};
use hexad_machine::text::files::print;

#[derive(Debug, Args)]
pub struct MessagesArguments {
    /// The language of the declarations
    #[arg(long, value_enum)]
    language: Language,
}

impl MessagesArguments {
    pub fn execute(self) -> Result<(), Failure> {
        Ok(print(Declarations(self.language))?)
    }
}

/// Language of the declarations.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Language {
    /// A header for C11 and C++
    C,
    /// A Python module with ctypes structures
    Python,
    /// JSON: name, type, offset, unit and meaning of each field
    Json,
}

/// Declarations of all messages. Displays as the text of a file.
pub struct Declarations(pub Language);

impl fmt::Display for Declarations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Language::C => c_header(f),
            Language::Python => python_module(f),
            Language::Json => writeln!(f, "{:#}", json_document()),
        }
    }
}

/// All structs, each after the structs that it contains.
fn structs() -> Vec<&'static Layout> {
    fn add(found: &mut Vec<&'static Layout>, layout: &'static Layout) {
        for field in layout.fields {
            if let Kind::Struct(nested) = field.kind {
                add(found, nested);
            }
        }
        if found.iter().all(|other| other.type_name != layout.type_name) {
            found.push(layout);
        }
    }
    let mut found = Vec::new();
    MESSAGES.into_iter().for_each(|layout| add(&mut found, layout));
    found
}

/// Prefix, names and numbers of the constants that fields may have.
fn constants() -> Vec<(&'static str, String, u32)> {
    let states = State::ALL.into_iter().map(|state| ("STATE", format!("{state:?}"), state as u32));
    let requests = Request::ALL.into_iter().map(|it| ("REQUEST", format!("{it:?}"), it as u32));
    let codes = DiagnosticCode::ALL.iter().map(|code| ("DIAGNOSTIC", format!("{code:?}"), *code as u32));
    let limits = Limit::ALL.into_iter().map(|limit| ("LIMIT_BIT", format!("{limit:?}"), limit as u32));
    let kinds = SetpointKind::ALL.into_iter().map(|kind| ("SETPOINT_KIND", format!("{kind:?}"), kind as u32));
    let all = states.chain(requests).chain(kinds).chain(codes).chain(limits);
    all.map(|(prefix, name, number)| (prefix, screaming(&name), number)).collect()
}

/// `ReadyToEngage` as `READY_TO_ENGAGE`.
fn screaming(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.extend(letter.to_uppercase());
    }
    text
}

/// Meaning and unit, on one line.
fn comment(field: &Field) -> String {
    let mut text = field.doc.split_whitespace().collect::<Vec<_>>().join(" ");
    if !field.unit.is_empty() {
        let _ = write!(text, " [{}]", field.unit);
    }
    text.trim().into()
}

fn summary(layout: &Layout) -> String {
    layout.doc.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn c_header(f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "/* Messages of hexad, by `hexad messages --language c`. */")?;
    writeln!(f, "#ifndef HEXAD_MESSAGES_H\n#define HEXAD_MESSAGES_H\n")?;
    writeln!(f, "#include <assert.h>\n#include <stdalign.h>\n#include <stddef.h>\n#include <stdint.h>\n")?;
    for (prefix, name, number) in constants() {
        writeln!(f, "#define HEXAD_{prefix}_{name} {number}u")?;
    }
    for layout in structs() {
        let Layout { type_name, topic, size, align, .. } = layout;
        writeln!(f)?;
        if let Some(Topic { name, schema }) = topic {
            let prefix = type_name.to_uppercase();
            writeln!(f, "#define {prefix}_TOPIC \"{name}\"\n#define {prefix}_SCHEMA {schema}u")?;
        }
        writeln!(f, "/* {} */\nstruct {type_name} {{", summary(layout))?;
        for field in layout.fields {
            let kind = match field.kind {
                Kind::U32 => "uint32_t".into(),
                Kind::U64 => "uint64_t".into(),
                Kind::F64 => "double".into(),
                Kind::Struct(nested) => format!("struct {}", nested.type_name),
            };
            let count = field.count.map_or(String::new(), |count| format!("[{count}]"));
            let comment = Some(comment(field)).filter(|it| !it.is_empty());
            let comment = comment.map_or(String::new(), |comment| format!(" /* {comment} */"));
            writeln!(f, "    {kind} {}{count};{comment}", field.name)?;
        }
        writeln!(f, "}};\nstatic_assert(sizeof(struct {type_name}) == {size}, \"size\");")?;
        writeln!(f, "static_assert(alignof(struct {type_name}) == {align}, \"alignment\");")?;
        for Field { name, offset, .. } in layout.fields {
            writeln!(f, "static_assert(offsetof(struct {type_name}, {name}) == {offset}, \"{name}\");")?;
        }
    }
    writeln!(f, "\n#endif")
}

/// Base of the Python classes of messages.
const PYTHON_BASE: &str = r#"

class Message(ctypes.Structure):
    """Base of all messages; `topic` is the last part of the topic's name, `schema` the version."""

    topic = ""
    schema = 0

    def is_intact(self):
        """Whether the checksum, if there is one, is the CRC-32 of the bytes before it."""
        field = getattr(type(self), "checksum", None)
        return field is None or self.checksum == zlib.crc32(bytes(self)[: field.offset])
"#;

fn python_module(f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "\"\"\"Messages of hexad, by `hexad messages --language python`.\"\"\"\n")?;
    writeln!(f, "import ctypes\nimport zlib\nfrom ctypes import c_double, c_uint32, c_uint64\n")?;
    for (prefix, name, number) in constants() {
        writeln!(f, "{prefix}_{name} = {number}")?;
    }
    write!(f, "{PYTHON_BASE}")?;
    for layout in structs() {
        let base = if layout.topic.is_some() { "Message" } else { "ctypes.Structure" };
        writeln!(f, "\n\nclass {}({base}):\n    \"\"\"{}\"\"\"\n", layout.class(), summary(layout))?;
        if let Some(Topic { name, schema }) = layout.topic {
            writeln!(f, "    topic = \"{name}\"\n    schema = {schema}")?;
        }
        writeln!(f, "    _fields_ = [")?;
        for field in layout.fields {
            let kind = match field.kind {
                Kind::U32 => "c_uint32".into(),
                Kind::U64 => "c_uint64".into(),
                Kind::F64 => "c_double".into(),
                Kind::Struct(nested) => nested.class(),
            };
            let count = field.count.map_or(String::new(), |count| format!(" * {count}"));
            let comment = Some(comment(field)).filter(|it| !it.is_empty());
            let comment = comment.map_or(String::new(), |comment| format!("  # {comment}"));
            writeln!(f, "        (\"{}\", {kind}{count}),{comment}", field.name)?;
        }
        writeln!(
            f,
            "    ]\n\n    @staticmethod\n    def type_name():\n        return \"{}\"",
            layout.type_name
        )?;
    }
    Ok(())
}

fn json_document() -> Value {
    let field = |field: &Field| {
        let kind = match field.kind {
            Kind::U32 => "u32",
            Kind::U64 => "u64",
            Kind::F64 => "f64",
            Kind::Struct(nested) => nested.type_name,
        };
        let Field { name, count, offset, unit, .. } = field;
        json!({"name": name, "type": kind, "count": count, "offset": offset, "unit": unit, "meaning": comment(field)})
    };
    let structs = structs().into_iter().map(|layout| {
        let Layout { type_name, topic, size, align, fields, .. } = layout;
        let fields: Vec<_> = fields.iter().map(field).collect();
        let (topic, schema) = topic.map(|Topic { name, schema }| (name, schema)).unzip();
        json!({"name": type_name, "topic": topic, "schema": schema, "size": size, "alignment": align, "meaning": summary(layout), "fields": fields})
    });
    let constants = constants().into_iter();
    let constants = constants.map(|(prefix, name, number)| (format!("{prefix}_{name}"), json!(number)));
    json!({"constants": Value::Object(constants.collect()), "structs": structs.collect::<Vec<_>>()})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_language_declares_the_kind_of_a_setpoint() {
        let text = |language| Declarations(language).to_string();
        let [c, python, json] = [Language::C, Language::Python, Language::Json].map(text);
        for (number, name) in ["MOTION", "POSE", "TARGET"].into_iter().enumerate() {
            assert!(c.contains(&format!("#define HEXAD_SETPOINT_KIND_{name} {number}u\n")), "{c}");
            assert!(python.contains(&format!("\nSETPOINT_KIND_{name} = {number}\n")), "{python}");
            assert!(json.contains(&format!("\"SETPOINT_KIND_{name}\": {number}")), "{json}");
        }
        assert!(!c.contains("SETPOINT_KIND_UNKNOWN"));
        assert!(
            c.contains("#define HEXAD_SETPOINT_SCHEMA 7u\n") && c.contains("  uint64_t kind; /* 0: X, X'")
        );
        assert!(c.contains("static_assert(offsetof(struct hexad_setpoint, kind) == 32, \"kind\");"));
        assert!(python.contains("    topic = \"setpoint\"\n    schema = 7\n"));
        assert!(python.contains("(\"header\", Header),\n") || python.contains("(\"header\", Header),  #"));
        assert!(python.contains("        (\"kind\", c_uint64),  # 0: X, X'"));
        let json: Value = serde_json::from_str(&json).unwrap();
        let structs = json["structs"].as_array().unwrap();
        let setpoint = structs.iter().find(|it| it["name"] == "hexad_setpoint").unwrap();
        assert_eq!((&setpoint["schema"], &setpoint["size"]), (&json!(7), &json!(192)));
        let fields = setpoint["fields"].as_array().unwrap();
        let fields: Vec<_> = fields.iter().map(|field| json!([field["name"], field["offset"]])).collect();
        let behind =
            [("header", 0), ("kind", 32), ("x", 40), ("x_rate", 88), ("x_accel", 136), ("target_speed", 184)];
        assert_eq!(
            (fields, &setpoint["fields"][1]["type"]),
            (behind.map(|field| json!(field)).to_vec(), &json!("u64"))
        );
    }
}
