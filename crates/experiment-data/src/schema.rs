//! The description as a JSON Schema.

use crate::toml_file::DescriptionFile;
use schemars::generate::SchemaSettings;

/// A JSON Schema (draft 2020-12) of `experiment.toml`, for editors that complete and check TOML files by one. It comes
/// from the structures that the reader fills, so it has the same keys; clauses between keys, such as one unit a column,
/// only the reader knows.
pub fn schema() -> String {
    let settings = SchemaSettings::draft2020_12().with(|s| s.meta_schema = None);
    let schema = settings
        .into_generator()
        .into_root_schema_for::<DescriptionFile>();
    format!("{:#}\n", schema.to_value())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toml_file::KEYS;
    use serde_json::Value;

    /// The table behind a pattern of keys, such as `records[*].injection`.
    fn table<'a>(root: &'a Value, pattern: &str) -> &'a Value {
        let mut here = root;
        for key in pattern.split('.').filter(|k| !k.is_empty()) {
            here = &here["properties"][key.trim_end_matches("[*]")];
            if key.ends_with("[*]") {
                here = &here["items"];
            }
            // An optional table is this or nothing.
            let inner = here["anyOf"].get(0).unwrap_or(here);
            if let Some(name) = inner["$ref"].as_str() {
                here = root.pointer(&name[1..]).unwrap();
            }
        }
        here
    }

    #[test]
    fn it_has_the_keys_of_the_reader() {
        let root: Value = serde_json::from_str(&schema()).unwrap();
        for (pattern, known) in KEYS {
            let table = table(&root, pattern);
            let mut keys: Vec<&String> = table["properties"].as_object().unwrap().keys().collect();
            let mut known = known.to_vec();
            keys.sort();
            known.sort_unstable();
            assert_eq!(keys, known, "{pattern}");
            assert_eq!(table["additionalProperties"], false, "{pattern}");
        }
    }
}
