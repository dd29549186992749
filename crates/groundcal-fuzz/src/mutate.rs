//! Mutations: of bytes, of numbers, of words, of lines and of parts of two inputs.

use rand::{Rng, RngExt};

/// Values that tend to be forgotten.
const NUMBERS: [&str; 34] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "0.5",
    "-0.5",
    "1e-300",
    "1e300",
    "-1e300",
    "1e999",
    "1e-7",
    "1e7",
    "1e15",
    "nan",
    "NaN",
    ".nan",
    "inf",
    "-inf",
    ".inf",
    "255",
    "256",
    "32767",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "9223372036854775807",
    "99999999999999999999999",
    "0x10",
    "1,5",
    "1_000",
    "3.14159265",
];
/// Pieces of the formats.
const PIECES: [&str; 52] = [
    "{",
    "}",
    "[",
    "]",
    ":",
    ",",
    ";",
    "\t",
    "\n",
    "\r\n",
    "\"",
    "'",
    "#",
    " # ",
    "<",
    "</a>",
    "<a>",
    "&amp;",
    "&a ",
    "*a",
    "!!opencv-matrix",
    "---",
    "- ",
    "null",
    "true",
    "false",
    "%YAML:1.0\n",
    "\u{feff}",
    "\u{1b}[2J",
    "\u{202e}",
    "\0",
    "sep=;\n",
    "image_a",
    "sigma_px",
    "track",
    "\"format_version\": 1,",
    "\"schema_version\": 2,",
    "\"views\": [],",
    "\"motions\": [],",
    "\"fl_x\": 1,",
    "\"frames\": [{}],",
    "cam0: {}\n",
    "camera_model: pinhole\n",
    "distortion_model: equidistant\n",
    "is_fisheye: 1\n",
    "xi: 1\n",
    "[[group]]\n",
    "[camera]\n",
    "1 PINHOLE 64 48 60 60 32 24\n",
    "k1: 0.1\n",
    "data: [1, 2]\n",
    "dist_coeffs: [0, 0, 0, 0]\n",
];
/// Longest input that a mutation makes.
const LONGEST: usize = 64 << 10;

fn below(rng: &mut impl Rng, n: usize) -> usize {
    rng.random_range(0..n.max(1))
}

fn choice<'a, T: ?Sized>(rng: &mut impl Rng, of: &[&'a T]) -> &'a T {
    of[below(rng, of.len())]
}

/// A mutation of an input; `other` is another of the pool.
pub(crate) fn mutated(rng: &mut impl Rng, input: &[u8], other: &[u8], text: bool) -> Vec<u8> {
    let mut bytes = input.to_vec();
    // Mostly one, sometimes many.
    let count = 1 + if below(rng, 4) == 0 { below(rng, 8) } else { 0 };
    for _ in 0..count {
        let kind = if text { below(rng, 12) } else { below(rng, 7) };
        match kind {
            0 => flip(rng, &mut bytes),
            1 => cut(rng, &mut bytes),
            2 => repeat(rng, &mut bytes),
            3 => splice(rng, &mut bytes, other),
            4 => overwrite(rng, &mut bytes),
            5 | 6 if !text => word_of_bytes(rng, &mut bytes),
            5 => insert(rng, &mut bytes),
            6..=8 => number(rng, &mut bytes),
            9 => lines(rng, &mut bytes),
            10 => swap_words(rng, &mut bytes),
            _ => column(rng, &mut bytes),
        }
        bytes.truncate(LONGEST);
    }
    bytes
}

fn flip(rng: &mut impl Rng, bytes: &mut [u8]) {
    let at = below(rng, bytes.len());
    if let Some(b) = bytes.get_mut(at) {
        *b ^= 1 << below(rng, 8);
    }
}

/// A stretch of the input.
fn stretch(rng: &mut impl Rng, length: usize) -> std::ops::Range<usize> {
    let start = below(rng, length);
    let most = if below(rng, 2) == 0 { 8 } else { length - start };
    start..(start + 1 + below(rng, most)).min(length)
}

fn cut(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    if !bytes.is_empty() {
        bytes.drain(stretch(rng, bytes.len()));
    }
}

fn repeat(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    if !bytes.is_empty() {
        let range = stretch(rng, bytes.len());
        let times = 1 + below(rng, 3) * below(rng, 20);
        let again = bytes[range.clone()].repeat(times);
        bytes.splice(range.end..range.end, again);
    }
}

fn splice(rng: &mut impl Rng, bytes: &mut Vec<u8>, other: &[u8]) {
    if !bytes.is_empty() && !other.is_empty() {
        let (to, from) = (stretch(rng, bytes.len()), stretch(rng, other.len()));
        bytes.splice(to, other[from].iter().copied());
    }
}

fn overwrite(rng: &mut impl Rng, bytes: &mut [u8]) {
    if !bytes.is_empty() {
        let range = stretch(rng, bytes.len());
        let start = range.start;
        for b in &mut bytes[range.start..range.end.min(start + 8)] {
            *b = rng.random();
        }
    }
}

/// Two or four bytes that may be a size, an offset or a count.
fn word_of_bytes(rng: &mut impl Rng, bytes: &mut [u8]) {
    const VALUES: [u32; 10] = [0, 1, 2, 255, 256, 65_535, 65_536, 0x7fff_ffff, 0xffff_fffe, 0xffff_ffff];
    let value = VALUES[below(rng, VALUES.len())];
    let at = below(rng, bytes.len());
    let (little, big) = (value.to_le_bytes(), value.to_be_bytes());
    let word: &[u8] = match below(rng, 4) {
        0 => &little,
        1 => &big,
        2 => &little[..2],
        _ => &big[2..],
    };
    for (b, w) in bytes.iter_mut().skip(at).zip(word) {
        *b = *w;
    }
}

fn insert(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    let at = below(rng, bytes.len() + 1);
    bytes.splice(at..at, choice(rng, &PIECES).bytes());
}

/// Places of runs of bytes of a kind.
fn runs(bytes: &[u8], of: impl Fn(u8) -> bool) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let mut start = None;
    for (i, b) in bytes.iter().copied().chain([0]).enumerate() {
        match (start, of(b) && i < bytes.len()) {
            (None, true) => start = Some(i),
            (Some(s), false) => {
                found.push(s..i);
                start = None;
            }
            _ => {}
        }
    }
    found
}

/// A number becomes another: a forgotten one, one a little off, or one of the same input.
fn number(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    let places = runs(bytes, |b| b.is_ascii_digit() || b == b'.' || b == b'-');
    if places.is_empty() {
        return insert(rng, bytes);
    }
    let place = places[below(rng, places.len())].clone();
    let old = String::from_utf8_lossy(&bytes[place.clone()]).into_owned();
    let new = match below(rng, 4) {
        0 => choice(rng, &NUMBERS).to_string(),
        1 => {
            let other = places[below(rng, places.len())].clone();
            String::from_utf8_lossy(&bytes[other]).into_owned()
        }
        2 => format!("-{old}"),
        _ => {
            let factor = [0.0, 0.1, 0.5, 0.99, 1.01, 2.0, 10.0, 1e3, 1e6][below(rng, 9)];
            old.parse::<f64>().map_or(old, |v| (v * factor).to_string())
        }
    };
    bytes.splice(place, new.bytes());
}

/// Lines in another order, left out, or twice.
fn lines(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    let mut all: Vec<Vec<u8>> = bytes.split_inclusive(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    if all.is_empty() {
        return;
    }
    let (i, j) = (below(rng, all.len()), below(rng, all.len()));
    match below(rng, 4) {
        0 => all.swap(i, j),
        1 => drop(all.remove(i)),
        2 => all.insert(j, all[i].clone()),
        _ => all.truncate(i + 1),
    }
    *bytes = all.concat();
}

fn swap_words(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    let words = runs(bytes, |b| b.is_ascii_alphanumeric() || b == b'_');
    if words.len() < 2 {
        return;
    }
    let from = bytes[words[below(rng, words.len())].clone()].to_vec();
    bytes.splice(words[below(rng, words.len())].clone(), from);
}

/// A column of a table becomes a constant, or another column: points on a line, at one place, on a conic.
fn column(rng: &mut impl Rng, bytes: &mut Vec<u8>) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let mut rows: Vec<Vec<String>> = text.lines().map(|l| l.split(',').map(String::from).collect()).collect();
    let width = rows.first().map_or(0, Vec::len);
    if width < 2 {
        return;
    }
    let (to, from, first) = (below(rng, width), below(rng, width), 1 + below(rng, rows.len()));
    let constant = choice(rng, &NUMBERS);
    let copies = below(rng, 2) == 0;
    for row in rows.iter_mut().skip(first).filter(|r| r.len() == width) {
        row[to] = if copies { row[from].clone() } else { constant.into() };
    }
    *bytes = rows.iter().map(|r| r.join(",") + "\n").collect::<String>().into_bytes();
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn mutations_differ_and_repeat_with_the_seed() {
        let make = |seed: u64| {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
            (0..2000).map(|i| mutated(&mut rng, b"a,b\n1.5,2\n3,4\n", b"x;y\n", i % 2 == 0)).collect::<Vec<_>>()
        };
        assert_eq!(make(1), make(1));
        let mut different = make(2);
        different.sort();
        different.dedup();
        assert!(different.len() > 800, "{}", different.len());
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        for _ in 0..200 {
            mutated(&mut rng, b"", b"", true);
        }
    }
}
