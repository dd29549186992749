//! The published schemas hold for what is written, and name every field of it.
//!
//! A validator here for the keywords that the schemas use: whole ones bring forty crates. Stricter than theirs in one thing, fields that
//! a schema does not name. Where Python has `jsonschema`, it has the last word.

use std::{collections::BTreeSet, process::Command};

use serde_json::Value;
use tempfile::tempdir;

use crate::{
    common::{at, calibrate, groundcal, matches_csv, read_json, root, write},
    readers::python,
};
use groundcal::{
    LensModel,
    geometry::{Constraint, Division, Fisheye, Lens, Radtan},
    result::{DistortionReport, LensSource},
    synthetic::PointScene,
};

/// Keywords that are understood here.
const KEYWORDS: [&str; 20] = [
    "$schema",
    "title",
    "description",
    "$defs",
    "$ref",
    "type",
    "properties",
    "required",
    "items",
    "minItems",
    "maxItems",
    "enum",
    "const",
    "anyOf",
    "minimum",
    "maximum",
    "exclusiveMinimum",
    "minLength",
    "examples",
    "default",
];

fn schema(name: &str) -> Value {
    read_json(&root().join("docs/schema").join(name))
}

fn is_of(kind: &str, value: &Value) -> bool {
    match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|v| v.fract() == 0.0),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        other => panic!("a type {other}"),
    }
}

/// What of a value is not as the schema says.
fn faults(whole: &Value, schema: &Value, value: &Value, path: &str) -> Vec<String> {
    let keywords = schema.as_object().unwrap();
    for keyword in keywords.keys() {
        assert!(KEYWORDS.contains(&keyword.as_str()), "the keyword {keyword} is not checked here");
    }
    if let Some(name) = schema["$ref"].as_str() {
        let target = whole.pointer(name.strip_prefix('#').unwrap()).unwrap_or_else(|| panic!("{name}"));
        return faults(whole, target, value, path);
    }
    let mut found = Vec::new();
    let mut say = |holds: bool, what: String| {
        if !holds {
            found.push(format!("{path}: {what}, found {value}"));
        }
    };
    match &schema["type"] {
        Value::String(kind) => say(is_of(kind, value), format!("expected {kind}")),
        Value::Array(kinds) => {
            say(kinds.iter().any(|k| is_of(k.as_str().unwrap(), value)), format!("expected {kinds:?}"));
        }
        _ => {}
    }
    if let Some(of) = schema["enum"].as_array() {
        say(of.contains(value), format!("expected one of {of:?}"));
    }
    if let Some(constant) = keywords.get("const") {
        say(constant == value, format!("expected {constant}"));
    }
    if let Some(number) = value.as_f64() {
        let bound = |name: &str| schema[name].as_f64();
        say(bound("minimum").is_none_or(|b| number >= b), "too small".into());
        say(bound("maximum").is_none_or(|b| number <= b), "too large".into());
        say(bound("exclusiveMinimum").is_none_or(|b| number > b), "too small".into());
    }
    if let (Some(text), Some(least)) = (value.as_str(), schema["minLength"].as_u64()) {
        say(text.chars().count() as u64 >= least, "too short".into());
    }
    if let Some(items) = value.as_array() {
        let count = items.len() as u64;
        say(schema["minItems"].as_u64().is_none_or(|n| count >= n), "too few items".into());
        say(schema["maxItems"].as_u64().is_none_or(|n| count <= n), "too many items".into());
        if let Some(of) = keywords.get("items") {
            found.extend(items.iter().enumerate().flat_map(|(i, v)| faults(whole, of, v, &format!("{path}[{i}]"))));
        }
    }
    if let (Some(fields), Some(named)) = (value.as_object(), schema["properties"].as_object()) {
        for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if !fields.contains_key(name) {
                found.push(format!("{path}: there is no {name}"));
            }
        }
        for (name, field) in fields {
            match named.get(name) {
                Some(schema) => found.extend(faults(whole, schema, field, &format!("{path}.{name}"))),
                None => found.push(format!("{path}: {name} is not in the schema")),
            }
        }
    }
    if let Some(any) = schema["anyOf"].as_array() {
        let each: Vec<Vec<String>> = any.iter().map(|s| faults(whole, s, value, path)).collect();
        if each.iter().all(|f| !f.is_empty()) {
            found.extend(each.into_iter().min_by_key(Vec::len).unwrap_or_default());
        }
    }
    found
}

fn assert_valid(schema: &Value, value: &Value, of: &str) {
    let found = faults(schema, schema, value, "");
    assert!(found.is_empty(), "{of}:\n{}", found.join("\n"));
}

/// Calibrations of every method and scene, with warnings of several kinds.
fn calibrations() -> Vec<(String, Value)> {
    let folder = tempdir().unwrap();
    let (tripod, head) = (at("examples/tripod"), at("examples/head"));
    let csv = write(folder.path(), "matches.csv", matches_csv(&PointScene::nominal(3)));
    let runs: Vec<Vec<&str>> = vec![
        vec![&tripod, "--max-features", "1500"],
        vec![&tripod, "--max-features", "1500", "--method", "linear", "--constraint", "square", "--distortion", "none"],
        vec![&head, "--max-features", "800", "--camera-height", "1.3"],
        vec![&head, "--max-features", "800", "--method", "rotating"],
        vec![&tripod, "--max-features", "1500", "--method", "kzr", "--homographies", "linear"],
        vec![&tripod, "--max-features", "1500", "--method", "kzr", "--radial", "per-pair"],
        vec![&tripod, "--max-features", "1500", "--method", "transferred"],
        vec![&csv, "--image-size", "1280x960", "--constraint", "full", "--k1", "0.0001"],
    ];
    runs.into_iter().map(|args| (args.join(" "), calibrate(&args).json())).collect()
}

#[test]
fn calibrations_are_as_their_schema_says() {
    let schema = schema("calibration.schema.json");
    let all = calibrations();
    for (of, value) in &all {
        assert_valid(&schema, value, of);
    }
    // A lens of every model, as a camera has it.
    for lens in [
        Lens::None,
        Lens::Radtan(Radtan::new([-0.1, 0.02, 1e-3, -1e-3, 0.01])),
        Lens::Division(Division::new(-0.1)),
        Lens::Fisheye(Fisheye::new([0.02, -0.01, 0.003, -0.0005])),
    ] {
        let mut json = all[0].1.clone();
        let distortion = DistortionReport { lens, source: LensSource::Given };
        json["camera"]["distortion"] = serde_json::to_value(&distortion).unwrap();
        assert_valid(&schema, &json, lens.name());
    }
    // What is wrong is seen.
    let broken = |pointer: &str, value: Value| {
        let mut json = all[0].1.clone();
        *json.pointer_mut(pointer).unwrap() = value;
        faults(&schema, &schema, &json, "")
    };
    for (pointer, value) in [
        ("/camera/fx", Value::from(-1.0)),
        ("/camera/image_size", Value::from(vec![800])),
        ("/views/0/attitude", Value::from(0.5)),
        ("/motions/0/used", Value::from("yes")),
        ("/method", Value::from("magic")),
        ("/fit/refinement", Value::from(3)),
        ("/schema_version", Value::from(1)),
        ("/camera/distortion/model", Value::from("fish")),
    ] {
        assert_eq!(broken(pointer, value).len(), 1, "{pointer}");
    }
    with_python(&schema, &all.into_iter().map(|(_, value)| value).collect::<Vec<_>>());
}

#[test]
fn errors_are_as_their_schema_says() {
    let schema = schema("error.schema.json");
    let mut codes = BTreeSet::new();
    let mut all = Vec::new();
    let folder = tempdir().unwrap();
    let three = "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\na,b,400,30,410,35\na,b,90,300,99,310\n";
    let three = write(folder.path(), "three.csv", three);
    let one = write(folder.path(), "one.csv", "image,track,x,y\na,1,2,3\nb,2,4,5\n");
    let file = write(folder.path(), "file", "");
    for args in [
        &["calibrate", "nowhere", "--json"][..],
        &["calibrate", &at("examples/tripod/00a.jpg"), "--json"],
        &["calibrate", &at("examples/tripod/00a.jpg"), &at("examples/tripod/01a.jpg"), "--json"],
        &["calibrate", &three, "--image-size", "640x480", "--json"],
        &["calibrate", &one, "--image-size", "640x480", "--json"],
        &["calibrate", &three, "--json"],
        &["calibrate", &three, "--image-size", "640x480", "--aspect", "99", "--json"],
        &["compare", "nowhere", "nothing", "--json"],
        &["compare", &three, &three, "--json", "--out", &format!("{file}/a")],
        &["plan", "--after", "nowhere", "--json"],
        &["plan", "--tilts-deg", "90", "--json"],
    ] {
        let run = groundcal(args);
        let value: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|e| panic!("{args:?}: {e}"));
        assert_valid(&schema, &value, &args.join(" "));
        codes.insert(value["error"]["code"].as_str().unwrap().to_string());
        all.push(value);
    }
    for code in ["failed", "wrong_usage", "unusable_option", "unusable_input", "too_few_images", "too_few_matches"] {
        assert!(codes.contains(code), "{code} of {codes:?}");
    }
    // The documentation has the same codes.
    let formats = std::fs::read_to_string(root().join("docs/formats.md")).unwrap();
    for code in schema["properties"]["error"]["properties"]["code"]["enum"].as_array().unwrap() {
        assert!(formats.contains(&format!("`{}`", code.as_str().unwrap())), "{code} is not in docs/formats.md");
    }
    with_python(&schema, &all);
}

/// The same by another program, where it is there.
fn with_python(schema: &Value, values: &[Value]) {
    let Some(python) = python(&["jsonschema"]) else { return };
    let folder = tempdir().unwrap();
    let schema = write(folder.path(), "schema.json", schema.to_string());
    let values = write(folder.path(), "values.json", Value::from(values.to_vec()).to_string());
    let script = "import json, sys, jsonschema\nschema, values = (json.load(open(f)) for f in sys.argv[1:])\n\
                  jsonschema.Draft202012Validator.check_schema(schema)\n[jsonschema.validate(v, schema) for v in values]";
    let run = Command::new(python).args(["-c", script, &schema, &values]).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
}

/// One that is added to the library must be asked for, written and read by the same name.
#[test]
fn constraints_have_one_name_everywhere() {
    let names: BTreeSet<String> = Constraint::ALL.iter().map(ToString::to_string).collect();
    let of_schema = schema("calibration.schema.json")["properties"]["constraint"]["enum"].clone();
    let of_schema: BTreeSet<String> = serde_json::from_value(of_schema).expect("names");
    assert_eq!(of_schema, names, "the schema");
    let formats = std::fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let row = formats.lines().find(|line| line.starts_with("| `constraint` |")).expect("a row");
    let of_row: BTreeSet<String> = row.split('`').skip(3).step_by(2).map(str::to_string).collect();
    assert_eq!(of_row, names, "docs/formats.md");
    assert_eq!(of_python("Constraint"), names, "Python");
    for command in ["calibrate", "plan"] {
        let of_help = of_help(command, "constraint");
        assert_eq!(of_help, names, "{command} --help");
    }
}

/// The same of what is estimated of a lens; the command line has `auto` beside it.
#[test]
fn lens_models_have_one_name_everywhere() {
    let names: BTreeSet<String> = LensModel::ALL.iter().map(ToString::to_string).collect();
    assert_eq!(of_python("Lens"), names, "Python");
    let python = std::fs::read_to_string(root().join("docs/python.md")).unwrap();
    let row = python.lines().find(|line| line.starts_with("| `--lens")).expect("a row");
    for name in &names {
        assert!(row.contains(&format!("\"{name}\"")), "docs/python.md has no {name}");
    }
    for command in ["calibrate", "plan"] {
        let mut of_help = of_help(command, "lens");
        assert!(of_help.remove("auto"));
        assert_eq!(of_help, names, "{command} --help");
    }
}

/// The values of an option, as its help lists them.
fn of_help(command: &str, option: &str) -> BTreeSet<String> {
    let help = groundcal(&[command, "--help"]).stdout;
    let values = help.split(&format!("--{option} <")).nth(1).expect("the option");
    let values = values.split("\n      --").next().unwrap_or_default();
    let listed = values.lines().filter_map(|line| line.trim().strip_prefix("- ")?.split_once(':'));
    listed.map(|(name, _)| name.to_string()).collect()
}

/// The values of one of the package's literals.
fn of_python(literal: &str) -> BTreeSet<String> {
    let source = std::fs::read_to_string(root().join("crates/groundcal-py/python/groundcal/_keywords.py")).unwrap();
    let line = source.lines().find(|line| line.starts_with(&format!("{literal} = Literal["))).expect("the literal");
    line.split('"').skip(1).step_by(2).map(str::to_string).collect()
}
