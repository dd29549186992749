//! The nearest of known names to one that is not known.

/// Changes of letters (put in, left out, replaced) between two words.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut before = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = before + usize::from(x != *y);
            before = row[j + 1];
            row[j + 1] = replaced.min(before + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

/// "there is no NAME; did you mean ...? One of ...": a sentence about a name that is not known.
pub(crate) fn no_such(name: &str, known: &[&str]) -> String {
    // A part of a name is near it, whatever is missing.
    let part = |k: &str| name.len() > 2 && (k.starts_with(name) || name.starts_with(k));
    let far = |k: &&&str| if part(k) { 0 } else { distance(name, k) };
    let nearest = known.iter().min_by_key(far).filter(|k| far(k) <= 1 + name.len() / 2);
    let meant = nearest.map_or_else(String::new, |k| format!(" Did you mean {k:?}?"));
    const SHOWN: usize = 12;
    let listed: Vec<String> = known.iter().take(SHOWN).map(|k| format!("{k:?}")).collect();
    let more = if known.len() > SHOWN { format!(" and {} more", known.len() - SHOWN) } else { String::new() };
    format!("there is no {name:?}.{meant} Known are {}{more}", listed.join(", "))
}
