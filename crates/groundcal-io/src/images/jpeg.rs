//! What a JPEG decoder does not say: data that end early or are damaged inside, and tables that are missing.
//!
//! Decoders fill what they cannot read with grey and call it a picture. Here the Huffman codes of a sequential JPEG (ITU-T T.81,
//! annex F) are read again without making pixels: a whole file has exactly the blocks that its size asks for, and nothing after
//! them but padding. Of a progressive file (annex G) the scans that are the first to bring the coefficients of the first component (brightness) are
//! read, as a decoder makes a pattern of what is missing there, and its markers say whether every coefficient came to its last bit; a cut within
//! the last scans takes away the last bits of some, which nobody sees.
//!
//! Frames of MJPEG films leave out the Huffman tables of annex K; they are put in.

use std::borrow::Cow;

use crate::images::jpeg_scan::{Coefficients, Component, HuffmanTable, Scan, ScanEnd};

/// How a file's picture stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Health {
    /// Nothing wrong is known.
    Whole,
    /// The data end after this part of the picture.
    EndsEarly(f64),
    /// The data make no sense from this part of the picture on.
    DamagedFrom(f64),
    /// The picture is there, its details are not: a progressive file that ends early.
    Coarse,
}

/// What the markers and the data say.
#[derive(Debug)]
pub(crate) struct Report {
    pub(crate) health: Health,
    /// Whether the end marker is there.
    pub(crate) ended: bool,
    /// Rows of the stored picture that are surely sound; `None`: all.
    pub(crate) sound_rows: Option<usize>,
    /// Where the first scan begins (its marker), if there is one.
    first_scan: Option<usize>,
    /// Whether the codes were read.
    pub(crate) sequential: bool,
    /// Whether there are Huffman tables before it.
    has_tables: bool,
}

/// Standard Huffman tables (T.81, K.3 to K.6): class and number, codes of each length, symbols.
const STANDARD_TABLES: [(u8, [u8; 16], &[u8]); 4] = [
    (0x00, [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0], &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
    (0x01, [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0], &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
    (0x10, [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7d], &AC_LUMINANCE),
    (0x11, [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77], &AC_CHROMINANCE),
];
#[rustfmt::skip]
const AC_LUMINANCE: [u8; 162] = [
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71, 0x14, 0x32, 0x81, 0x91, 0xa1,
    0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25, 0x26,
    0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56,
    0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85,
    0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa,
    0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6,
    0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9,
    0xfa,
];
#[rustfmt::skip]
const AC_CHROMINANCE: [u8; 162] = [
    0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13, 0x22, 0x32, 0x81, 0x08, 0x14, 0x42,
    0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0, 0x15, 0x62, 0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25, 0xf1, 0x17, 0x18, 0x19,
    0x1a, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55,
    0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83,
    0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8,
    0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4,
    0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9,
    0xfa,
];

/// A segment for all four tables.
fn standard_segment() -> Vec<u8> {
    let length = 2 + STANDARD_TABLES.iter().map(|(_, _, symbols)| 17 + symbols.len()).sum::<usize>();
    let mut segment = vec![0xff, 0xc4, (length >> 8) as u8, length as u8];
    for (id, counts, symbols) in STANDARD_TABLES {
        segment.push(id);
        segment.extend(counts);
        segment.extend(symbols);
    }
    segment
}

/// The file with the standard tables before its first scan where it has none.
pub(crate) fn with_tables<'a>(bytes: &'a [u8], report: &Report) -> Cow<'a, [u8]> {
    match report.first_scan {
        Some(at) if !report.has_tables => Cow::Owned([&bytes[..at], &standard_segment(), &bytes[at..]].concat()),
        _ => Cow::Borrowed(bytes),
    }
}

/// What segments have said so far.
#[derive(Default)]
struct State {
    size: [usize; 2],
    components: Vec<Component>,
    /// Whether the codes are those of annex F.
    sequential: bool,
    /// Whether they are the Huffman codes of annex G.
    progressive: bool,
    /// By component, in the order of the frame: a bit for each coefficient whose last bit has not come yet.
    unfinished: Vec<u64>,
    restart_interval: usize,
    /// By class and number.
    tables: [Option<HuffmanTable>; 8],
}

/// Reads the markers, and the codes of sequential scans. Segments are skipped by their length (thumbnails have markers of their
/// own), and what follows the end (a motion photo's film) is not looked at.
pub(crate) fn inspect(bytes: &[u8]) -> Report {
    let mut report = Report {
        health: Health::Whole,
        ended: false,
        sound_rows: None,
        first_scan: None,
        sequential: false,
        has_tables: false,
    };
    let mut state = State::default();
    for (id, counts, symbols) in STANDARD_TABLES {
        state.tables[table_place(id)] = HuffmanTable::new(&counts, symbols);
    }
    let mut at = 2;
    let mut covered = 0;
    while let Some(&[lead, marker]) = bytes.get(at..).and_then(<[u8]>::first_chunk::<2>) {
        if lead != 0xff {
            // Padding between segments.
            at += 1;
            continue;
        }
        match marker {
            0xd9 => {
                report.ended = true;
                break;
            }
            // A stuffed zero, a restart marker, a fill byte.
            0x00 | 0x01 | 0xd0..=0xd8 => at += 2,
            0xff => at += 1,
            _ => {
                let Some(body) = segment(bytes, at + 2) else { break };
                let next = at + 4 + body.len();
                match marker {
                    0xc4 => {
                        report.has_tables = true;
                        read_tables(body, &mut state);
                    }
                    0xc0..=0xc3 | 0xc5..=0xcb | 0xcd..=0xcf => read_frame(marker, body, &mut state),
                    0xdd if body.len() >= 2 => {
                        state.restart_interval = usize::from(u16::from_be_bytes([body[0], body[1]]));
                    }
                    0xda => {
                        report.first_scan.get_or_insert(at);
                        mark_finished(body, &mut state);
                        if let (Health::Whole, Some(scan)) = (report.health, scan_of(body, &state)) {
                            covered += scan.components.len();
                            let end = scan.read(&bytes[next..]);
                            report.health = match end {
                                ScanEnd::Whole => Health::Whole,
                                ScanEnd::Early(part) => Health::EndsEarly(part),
                                ScanEnd::Damaged(part) => Health::DamagedFrom(part),
                            };
                            if let ScanEnd::Early(part) | ScanEnd::Damaged(part) = end {
                                report.sound_rows = Some(scan.sound_rows(part));
                            }
                        }
                    }
                    _ => {}
                }
                at = next;
            }
        }
    }
    let all_covered = covered > 0 && covered >= state.components.len();
    report.sequential = state.sequential && all_covered;
    if report.health == Health::Whole {
        if covered > 0 && !all_covered {
            report.health = Health::EndsEarly(covered as f64 / state.components.len() as f64);
        } else if state.progressive && state.unfinished.iter().any(|bits| *bits != 0) {
            report.health = Health::Coarse;
        }
    }
    report
}

/// The components, coefficients and bits of a progressive scan: those whose last bit it has.
fn mark_finished(body: &[u8], state: &mut State) {
    let Some((&count, parts)) = body.split_first() else { return };
    let (Some(components), Some(&[first, last, bits])) =
        (parts.get(..2 * usize::from(count)), parts.get(2 * usize::from(count)..).and_then(<[u8]>::first_chunk::<3>))
    else {
        return;
    };
    if bits & 15 != 0 || last > 63 || first > last {
        return;
    }
    let band = (u64::MAX >> (63 - last)) & (u64::MAX << first);
    for part in components.chunks_exact(2) {
        let place = state.components.iter().position(|c| c.id == part[0]);
        if let Some(unfinished) = place.and_then(|place| state.unfinished.get_mut(place)) {
            *unfinished &= !band;
        }
    }
}

/// The bytes of a segment whose length stands at `at`.
fn segment(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let length = usize::from(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
    bytes.get(at + 2..at + length)
}

fn table_place(id: u8) -> usize {
    usize::from((id >> 4) & 1) * 4 + usize::from(id & 3)
}

fn read_tables(mut body: &[u8], state: &mut State) {
    while let Some((id, rest)) = body.split_first() {
        let Some(counts) = rest.first_chunk::<16>() else { return };
        let symbols = counts.iter().map(|c| usize::from(*c)).sum::<usize>();
        let Some(values) = rest.get(16..16 + symbols) else { return };
        state.tables[table_place(*id)] = HuffmanTable::new(counts, values);
        body = &rest[16 + symbols..];
    }
}

fn read_frame(marker: u8, body: &[u8], state: &mut State) {
    let Some(&[_, y0, y1, x0, x1, count]) = body.first_chunk::<6>() else { return };
    state.size = [usize::from(u16::from_be_bytes([x0, x1])), usize::from(u16::from_be_bytes([y0, y1]))];
    let components = body[6..].chunks_exact(3).take(usize::from(count));
    state.components =
        components.map(|c| Component { id: c[0], h: usize::from(c[1] >> 4), v: usize::from(c[1] & 15) }).collect();
    let usable = |c: &Component| (1..=4).contains(&c.h) && (1..=4).contains(&c.v);
    let usable = state.components.iter().all(usable);
    state.sequential = matches!(marker, 0xc0 | 0xc1) && usable;
    state.progressive = marker == 0xc2 && usable;
    state.unfinished = vec![u64::MAX; state.components.len()];
}

/// A scan that can be read: its components, with the tables of each.
fn scan_of<'a>(body: &[u8], state: &'a State) -> Option<Scan<'a>> {
    // A height of zero is given after the scan; such files are rare and left alone.
    if !(state.sequential || state.progressive) || state.size.contains(&0) {
        return None;
    }
    let count = usize::from(*body.first()?);
    let coefficients = match body.get(1 + 2 * count..) {
        _ if state.sequential => Coefficients::All,
        Some(&[0, 0, bits, ..]) if bits >> 4 == 0 => Coefficients::Mean,
        // Of the first component.
        Some(&[from @ 1..=63, to @ 1..=63, bits, ..])
            if bits >> 4 == 0 && state.components.first().map(|c| c.id) == body.get(1).copied() =>
        {
            Coefficients::Band(usize::from(from), usize::from(to))
        }
        _ => return None,
    };
    let mut components = Vec::with_capacity(count);
    for part in body.get(1..1 + 2 * count)?.chunks_exact(2) {
        let component = state.components.iter().find(|c| c.id == part[0])?;
        let table = |class: usize, number: u8| state.tables[class * 4 + usize::from(number & 3)].as_ref();
        components.push((*component, table(0, part[1] >> 4)?, table(1, part[1])?));
    }
    Some(Scan {
        size: state.size,
        largest: [state.components.iter().map(|c| c.h).max()?, state.components.iter().map(|c| c.v).max()?],
        restart_interval: state.restart_interval,
        coefficients,
        components,
    })
}
