//! JSON and what is wrong with it, in words of the file: no types of the language the program is written in.

use serde_json::error::Category;

use crate::text::sentence;

/// The value of a text.
pub(crate) fn value(text: &str) -> Result<serde_json::Value, String> {
    serde_json::from_str(text).map_err(|e| fault(&e))
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

/// Serde's sentence without names of types.
fn words(theirs: &str) -> String {
    let mut out = theirs.split(" at line ").next().unwrap_or_default().to_string();
    for (theirs, ours) in [
        ("floating point ", "the number "),
        ("boolean ", "the word "),
        ("integer ", "the number "),
        ("string ", "the text "),
        ("invalid type: ", "found "),
        ("invalid value: ", "found "),
        ("invalid length ", "found a list of "),
        ("unknown variant ", "found "),
        ("a sequence", "a list"),
        ("sequence", "a list"),
        ("an array of length ", "a list of "),
        ("a map", "an object"),
        ("map", "an object"),
        ("null", "nothing"),
        ("missing field", "there is no"),
    ] {
        out = out.replace(theirs, ours);
    }
    let typed = |word: &str| {
        let bare = word.trim_matches(|c: char| !c.is_ascii_alphanumeric());
        match bare {
            "f64" | "f32" => Some("a number"),
            "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" | "isize" => Some("a whole number"),
            _ => None,
        }
        .map(|ours| word.replace(bare, ours))
    };
    let mut words: Vec<String> = out.split(' ').map(|w| typed(w).unwrap_or_else(|| w.to_string())).collect();
    if let Some(at) = words.iter().position(|w| w == "struct" || w == "enum") {
        words.truncate(at);
        words.push("an object".into());
    }
    sentence(&words.join(" "))
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
    fn no_type_of_the_language_is_named() {
        let fault = |text: &str| fault(&serde_json::from_str::<Outer>(text).unwrap_err());
        assert_eq!(fault(r#"{"inner": {"x": "a", "n": [1, 2]}}"#), r#"found the text "a", expected a number"#);
        assert_eq!(fault(r#"{"inner": {"x": 1, "n": [1.5, 2]}}"#), "found the number `1.5`, expected a whole number");
        assert_eq!(fault(r#"{"inner": 7}"#), "found the number `7`, expected an object");
        assert_eq!(fault(r#"{"inner": {"x": 1}}"#), "there is no `n`");
        assert_eq!(fault(r#"{"inner": "#), "damaged JSON: it ends too early (line 1, column 10)");
    }
}
