//! JSON and what is wrong with it, in words of the file: no types of the language the program is written in.

use serde_json::error::Category;

use crate::{limits::MAX_JSON_VALUES, text::sentence, words::words};

/// The value of a text.
pub(crate) fn value(text: &str) -> Result<serde_json::Value, String> {
    if has_more_values(text, MAX_JSON_VALUES) {
        return Err(format!("more than {} million values", MAX_JSON_VALUES / 1_000_000));
    }
    serde_json::from_str(text).map_err(|e| fault(&e))
}

/// Whether a text has more values than that: commas and opening brackets outside strings come before one each.
fn has_more_values(text: &str, most: usize) -> bool {
    if text.len() <= most {
        return false;
    }
    let (mut inside, mut escaped, mut count) = (false, false, 0usize);
    for b in text.bytes() {
        match b {
            _ if escaped => escaped = false,
            b'\\' if inside => escaped = true,
            b'"' => inside = !inside,
            b',' | b'[' | b'{' if !inside => count += 1,
            _ => {}
        }
    }
    count > most
}

/// What a value stands for; the error names the field.
pub(crate) fn typed<T: serde::de::DeserializeOwned>(value: serde_json::Value) -> Result<T, String> {
    serde_path_to_error::deserialize(value).map_err(|e| {
        let path = e.path().to_string();
        let what = fault(e.inner());
        if path == "." { what } else { format!("{}: {what}", sentence(&path)) }
    })
}

/// What is wrong with a text, or with what it holds.
pub(crate) fn fault(error: &serde_json::Error) -> String {
    let place = format!("line {}, column {}", error.line(), error.column());
    match error.classify() {
        Category::Eof => format!("damaged JSON: it ends too early ({place})"),
        Category::Syntax if error.to_string().starts_with("number out of range") => {
            format!("a number out of range ({place})")
        }
        Category::Data => words(&error.to_string()),
        _ => format!("damaged JSON ({place})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[allow(dead_code)]
    struct Inner {
        x: f64,
        n: [u32; 2],
    }

    #[derive(Debug, serde::Deserialize)]
    #[allow(dead_code)]
    struct Outer {
        inner: Inner,
    }

    #[test]
    fn values_are_counted_outside_strings() {
        let text = r#"{"a,[\",{": [1, 2, {}]}"#;
        assert!(has_more_values(text, 4) && !has_more_values(text, 5));
    }

    #[test]
    fn no_type_of_the_language_is_named() {
        let fault = |text: &str| fault(&serde_json::from_str::<Outer>(text).unwrap_err());
        assert_eq!(fault(r#"{"inner": {"x": "a", "n": [1, 2]}}"#), r#"found the text "a", expected a number"#);
        assert_eq!(fault(r#"{"inner": {"x": 1, "n": [1.5, 2]}}"#), "found the number `1.5`, expected a whole number");
        assert_eq!(fault(r#"{"inner": 7}"#), "found the number `7`, expected an object");
        assert_eq!(fault(r#"{"inner": {"x": 1}}"#), "there is no `n`");
        assert_eq!(fault(r#"{"inner": "#), "damaged JSON: it ends too early (line 1, column 10)");
    }
}
