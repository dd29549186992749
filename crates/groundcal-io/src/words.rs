//! What is wrong with a value of a file, in words of the file: no types of the language the program is written in.

use crate::text::sentence;

/// Serde's sentence without names of types.
///
/// ```
/// let theirs = "invalid type: string \"wide\", expected f64";
/// assert_eq!(groundcal_io::words::words(theirs), r#"found the text "wide", expected a number"#);
/// ```
pub fn words(theirs: &str) -> String {
    let theirs = theirs.split(" at line ").next().unwrap_or_default();
    // What the file holds stands in quotation marks, and stays as it is.
    let parts = theirs.split('"').enumerate().map(|(i, part)| if i % 2 == 0 { own(part) } else { part.to_string() });
    sentence(&parts.collect::<Vec<_>>().join("\""))
}

/// A part of the sentence that is not quoted.
fn own(theirs: &str) -> String {
    let mut out = theirs.to_string();
    for (theirs, ours) in [
        ("floating point ", "the number "),
        ("boolean ", "the word "),
        ("integer ", "the number "),
        ("string ", "the text "),
        ("invalid type: ", "found "),
        ("invalid value: ", "found "),
        ("invalid length ", "found a list of "),
        ("unknown variant ", "found "),
        ("fewer elements in array", "a shorter list"),
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
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stay_as_they_are() {
        assert_eq!(
            words("invalid type: string \"null map f64\", expected u32"),
            "found the text \"null map f64\", expected a whole number"
        );
        assert_eq!(words("invalid length 3, expected an array of length 2"), "found a list of 3, expected a list of 2");
    }
}
