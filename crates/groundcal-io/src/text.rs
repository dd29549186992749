//! Words from outside (names of files, contents of files) as they may be shown: no control characters, no endless values.
//!
//! A name may hold an escape sequence that clears the terminal, or the mark that turns the direction of writing; a file may hold
//! a "number" of a million digits. [`message`] is for whole messages, [`printable_lines`] for pages, [`quoted`] for values, [`shown`] for
//! paths.

use std::{borrow::Cow, ffi::OsStr, path::Path};

/// Characters of a value that a message shows.
const MAX_VALUE: usize = 60;
/// Characters of a path that a message shows.
const MAX_PATH: usize = 240;

/// Whether a character steers the terminal or the direction of writing instead of being seen.
fn is_unseen(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// The text with control characters written out (`\u{1b}`, `\n`).
///
/// ```
/// assert_eq!(groundcal_io::text::printable("a\u{1b}[2Jb"), r"a\u{1b}[2Jb");
/// ```
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unseen) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_unseen(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// The text with control characters but line ends written out: for pages of several lines.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    if !text.contains(|c| is_unseen(c) && c != '\n') {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.split('\n').map(printable).collect::<Vec<_>>().join("\n"))
}

/// JSON with what is not seen in its strings written out: the same values.
///
/// ```
/// assert_eq!(groundcal_io::text::printable_json("[\"\u{9b}2J\"]\n"), "[\"\\u009b2J\"]\n");
/// ```
pub fn printable_json(text: &str) -> Cow<'_, str> {
    if !text.contains(|c| is_unseen(c) && c != '\n') {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        // All of them have four digits, and stand in strings: elsewhere JSON has none but blanks.
        if is_unseen(c) && c != '\n' { out += &format!("\\u{:04x}", u32::from(c)) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// A message: printable, and no word of it (a path, a name, a number) endless.
pub fn message(text: &str) -> String {
    let text = printable(text);
    let words: Vec<Cow<'_, str>> = text.split(' ').map(|word| shortened(word, MAX_PATH)).collect();
    words.join(" ")
}

/// At most `count` characters: the beginning and the end, with dots between.
fn shortened(text: &str, count: usize) -> Cow<'_, str> {
    // A character has a byte at least: most texts need not be counted.
    if text.len() <= count || text.chars().count() <= count {
        return Cow::Borrowed(text);
    }
    let at = |from_start: usize| text.char_indices().nth(from_start).map_or(text.len(), |(i, _)| i);
    let tail = text.char_indices().rev().nth(count / 3).map_or(0, |(i, _)| i);
    Cow::Owned(format!("{}...{}", &text[..at(count - count / 3 - 3)], &text[tail..]))
}

/// A value of a file in quotation marks, printable and short.
pub fn quoted(value: &str) -> String {
    format!("\"{}\"", plain(value))
}

/// A sentence of another library, printable and not endless.
pub(crate) fn sentence(text: &str) -> String {
    shortened(&printable(text), MAX_PATH).into_owned()
}

/// A value of a file, printable and short.
pub fn plain(value: &str) -> String {
    shortened(&printable(value), MAX_VALUE).into_owned()
}

/// Some of a list of words, for a message.
pub(crate) fn some_of<'a>(words: impl IntoIterator<Item = &'a str>, most: usize) -> String {
    let mut words = words.into_iter();
    let first: Vec<String> = words.by_ref().take(most).map(plain).collect();
    let more = if words.next().is_some() { ", ..." } else { "" };
    format!("{}{more}", first.join(", "))
}

/// A name of the file system, whole: bytes that are no UTF-8 are written out (`\xff`), as control characters are. Different names
/// stay different.
pub fn name_text(name: &OsStr) -> String {
    let mut out = String::with_capacity(name.len());
    for chunk in name.as_encoded_bytes().utf8_chunks() {
        out += &printable(chunk.valid());
        for byte in chunk.invalid() {
            out += &format!("\\x{byte:02x}");
        }
    }
    out
}

/// A path for a message.
pub fn shown(path: &Path) -> String {
    shortened(&name_text(path.as_os_str()), MAX_PATH).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_steers_the_terminal() {
        assert_eq!(printable("a\u{1b}]0;x\u{7}\u{9b}31m\u{202e}b\n"), r"a\u{1b}]0;x\u{7}\u{9b}31m\u{202e}b\n");
        assert_eq!(printable("Fläche 1.jpg"), "Fläche 1.jpg");
        let long = quoted(&"7".repeat(1_000_000));
        assert!(long.len() < 70 && long.contains("..."), "{long}");
        assert_eq!(plain(&"ä".repeat(60)), "ä".repeat(60));
    }

    #[test]
    fn pages_keep_their_lines_and_messages_stay_short() {
        assert_eq!(printable_lines("a\u{1b}b\r\nc\n"), "a\\u{1b}b\\r\nc\n");
        let long = message(&format!("{} pixels of {}", "9".repeat(5000), "ä".repeat(5000)));
        assert!(long.chars().count() < 520 && long.contains(" pixels of "), "{long}");
        let json = printable_json("{\"a\u{202e}\": \"\u{feff}\"}");
        assert_eq!(json, r#"{"a\u202e": "\ufeff"}"#);
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_no_utf8_stay_apart() {
        use std::os::unix::ffi::OsStrExt;
        let text = |bytes: &[u8]| name_text(OsStr::from_bytes(bytes));
        assert_eq!(text(b"a\xff\xfe\x07.jpg"), r"a\xff\xfe\u{7}.jpg");
        assert_ne!(text(b"a\xff"), text(b"a\xfe"));
    }
}
