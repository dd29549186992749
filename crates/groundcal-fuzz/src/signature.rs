//! What an answer looks like without its numbers and names: two inputs of one signature went the same way.

/// The answer with runs of digits as `0`, what is quoted or in parentheses as `"`, cut.
pub(crate) fn signature(answer: &str) -> String {
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
}
