//! What an answer looks like without its numbers and names: two inputs of one signature went the same way.

use std::{
    collections::HashSet,
    hash::{DefaultHasher, Hash, Hasher},
};

/// Signatures that are remembered of answers with their names; then all are forgotten.
const MAX_REMEMBERED: usize = 1 << 20;

/// The signatures seen so far.
#[derive(Default)]
pub(crate) struct Signatures {
    /// Of answers with names in them: most inputs end here, and need not be looked through.
    with_names: HashSet<u64>,
    known: HashSet<u64>,
}

impl Signatures {
    /// Whether the answer to an input has a signature that was not seen before.
    pub(crate) fn is_new(&mut self, answer: &str, input: &[u8]) -> bool {
        if self.with_names.len() >= MAX_REMEMBERED {
            self.with_names.clear();
        }
        self.with_names.insert(hash(&signature(answer)))
            && self.known.insert(hash(&signature(&without_words_of(answer, input))))
    }

    pub(crate) fn count(&self) -> usize {
        self.known.len()
    }
}

fn hash(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish()
}

/// The words alone, those that the input has too as one `*`: what is repeated of it is as good as endless.
fn without_words_of(text: &str, input: &[u8]) -> String {
    let input = String::from_utf8_lossy(input);
    let of_input: HashSet<&str> = words(&input).collect();
    let mut out = String::new();
    for word in words(text) {
        let word = if of_input.contains(word) { "*" } else { word };
        if !(word == "*" && out.ends_with("* ")) {
            out.extend([word, " "]);
        }
    }
    out
}

/// Runs of letters.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty())
}

/// The answer with runs of digits as `0`, what is quoted or in parentheses as `"`, cut.
fn signature(answer: &str) -> String {
    let mut out = String::new();
    let mut quoted = false;
    for c in answer.chars().take(600) {
        match c {
            '"' | '`' => {
                quoted = !quoted;
                if quoted {
                    out.push('"');
                }
            }
            _ if quoted => {}
            _ if c.is_ascii_digit() || c == '.' => {
                if !out.ends_with('0') {
                    out.push('0');
                }
            }
            '-' | '+' => {}
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_values_do_not_count() {
        assert_eq!(signature("line 12: ya is \"x\""), signature("line 7: ya is \"very long\""));
        assert_ne!(signature("line 12: ya is \"x\""), signature("line 12: xa is \"x\""));
        assert_eq!(signature("fx -1.25e-7"), signature("fx 300e2"));
    }

    #[test]
    fn what_is_repeated_of_the_input_does_not_count() {
        let mut all = Signatures::default();
        assert!(all.is_new("the column axb is there twice", b"axb,axb"));
        assert!(!all.is_new("the column axb is there twice", b"axb,axb"));
        assert!(!all.is_new("the column qqq qq is there twice", b"qqq qq"));
        assert!(all.is_new("the column axb is not there", b"axb,axb"));
        assert_eq!(all.count(), 2);
    }
}
