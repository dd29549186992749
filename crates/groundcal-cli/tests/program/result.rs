//! `calibration.json` of the examples, read back.

use crate::common::{at, calibrate};
use groundcal_io::{export, import::groundcal_json};
use serde_json::Value;

/// All but the words of the warnings, which the program has its own for.
fn without_words(mut json: Value) -> Value {
    for warning in json["warnings"].as_array_mut().unwrap() {
        warning["message"] = Value::Null;
    }
    json
}

#[test]
fn calibrations_of_the_examples_are_read_back_as_they_were_written() {
    let (tripod, head) = (at("examples/tripod"), at("examples/head"));
    for args in [
        &[tripod.as_str()][..],
        &[&head, "--max-features", "800"],
        &[&head, "--method", "rotating", "--max-features", "800"],
        &[&head, "--method", "linear", "--constraint", "square", "--distortion", "none", "--max-features", "800"],
    ] {
        let written = calibrate(args).json();
        let c = groundcal_json::parse(&written.to_string()).unwrap_or_else(|e| panic!("{args:?}: {e}"));
        let again: Value = serde_json::from_str(&export::json(&c, &groundcal::Plain).unwrap()).unwrap();
        assert_eq!(without_words(again), without_words(written), "{args:?}");
        // The judgement of each motion used is there for everybody.
        let judged = c.motions.iter().all(|m| m.diagnosis.is_some() == m.used);
        assert!(judged, "{args:?}");
    }
}
