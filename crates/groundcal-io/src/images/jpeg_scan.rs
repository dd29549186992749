//! The Huffman codes of a sequential scan, or of one that is the first to bring some coefficients of a progressive picture (ITU-T T.81, annexes F
//! and G), counted and not turned into pixels.

use std::ops::RangeInclusive;

/// Bits that the first look at a code takes.
const FAST_BITS: u32 = 9;

/// A component of the picture: its name and how many blocks it has of each unit, across and down.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Component {
    pub(crate) id: u8,
    pub(crate) h: usize,
    pub(crate) v: usize,
}

/// Codes of a table.
pub(crate) struct HuffmanTable {
    /// Length and symbol of what begins with these bits; length 0: longer than the first look.
    fast: Vec<(u8, u8)>,
    /// By length: first code, code after the last one, place of its symbol.
    ranges: [(u32, u32, usize); 17],
    symbols: Vec<u8>,
}

impl HuffmanTable {
    /// From the number of codes of each length; nothing where they are no code.
    pub(crate) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut fast = vec![(0, 0); 1 << FAST_BITS];
        let mut ranges = [(0, 0, 0); 17];
        let (mut code, mut place) = (0u32, 0usize);
        for (length, count) in (1u32..).zip(counts.iter().map(|c| u32::from(*c))) {
            if code + count > 1 << length {
                return None;
            }
            ranges[length as usize] = (code, code + count, place);
            if length <= FAST_BITS {
                let spread = FAST_BITS - length;
                for i in 0..count {
                    let symbol = *symbols.get(place + i as usize)?;
                    let first = ((code + i) << spread) as usize;
                    fast[first..first + (1 << spread)].fill((length as u8, symbol));
                }
            }
            place += count as usize;
            code = (code + count) << 1;
        }
        (place <= symbols.len()).then(|| Self { fast, ranges, symbols: symbols.to_vec() })
    }

    /// Length and symbol of the code that 16 bits begin with.
    fn find(&self, bits: u32) -> Option<(u32, u8)> {
        let (length, symbol) = self.fast[(bits >> (16 - FAST_BITS)) as usize];
        if length > 0 {
            return Some((u32::from(length), symbol));
        }
        (FAST_BITS + 1..=16).find_map(|length| {
            let code = bits >> (16 - length);
            let (first, end, place) = self.ranges[length as usize];
            (first..end).contains(&code).then(|| (length, self.symbols[place + (code - first) as usize]))
        })
    }
}

/// A scan: which components, under which tables.
pub(crate) struct Scan<'a> {
    pub(crate) size: [usize; 2],
    /// Greatest `h` and `v` of the picture.
    pub(crate) largest: [usize; 2],
    pub(crate) restart_interval: usize,
    /// Which coefficients of a block it has.
    pub(crate) coefficients: Coefficients,
    /// Each with its tables of the first and of the other coefficients.
    pub(crate) components: Vec<(Component, &'a HuffmanTable, &'a HuffmanTable)>,
}

/// Which coefficients of a block a scan has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Coefficients {
    /// All of them, as in a sequential picture.
    All,
    /// Its mean.
    Mean,
    /// From one to another, both included; not the mean.
    Band(usize, usize),
}

/// How the data of a scan end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ScanEnd {
    /// With the last block.
    Whole,
    /// After this part of the blocks.
    Early(f64),
    /// They stop making sense at this part of the blocks.
    Damaged(f64),
}

/// Bits of entropy-coded data: without stuffed zeros, up to the next marker.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    held: u64,
    count: u32,
    /// Bits beyond the end that were asked for; zeros stand in.
    missing: u32,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, count: 0, missing: 0 }
    }

    /// At least 32 bits.
    fn fill(&mut self) {
        while self.count <= 32 {
            let byte = match (self.bytes.get(self.at), self.bytes.get(self.at + 1)) {
                (Some(0xff), Some(0x00)) => {
                    self.at += 2;
                    0xff
                }
                (Some(0xff), _) | (None, _) => {
                    self.missing += 8;
                    0
                }
                (Some(byte), _) => {
                    self.at += 1;
                    *byte
                }
            };
            self.held = (self.held << 8) | u64::from(byte);
            self.count += 8;
        }
    }

    fn peek16(&self) -> u32 {
        ((self.held >> (self.count - 16)) & 0xffff) as u32
    }

    fn skip(&mut self, count: u32) {
        self.count -= count;
    }

    /// Whether more was taken than is there.
    fn is_over(&self) -> bool {
        self.missing > self.count
    }

    /// Bits that are there and not taken.
    fn left(&self) -> u32 {
        self.count.saturating_sub(self.missing)
    }

    /// The marker at which the bits end, then the bits behind it.
    fn next_interval(&mut self) -> Option<u8> {
        while self.bytes.get(self.at + 1) == Some(&0xff) {
            self.at += 1;
        }
        let marker = *self.bytes.get(self.at + 1)?;
        self.at += 2;
        (self.held, self.count, self.missing) = (0, 0, 0);
        Some(marker)
    }
}

impl Scan<'_> {
    /// Units of the scan, and blocks of each component in a unit.
    fn units(&self) -> (usize, Vec<usize>) {
        let [width, height] = self.size;
        let [h_max, v_max] = self.largest;
        if let [(c, ..)] = self.components[..] {
            let side = |length: usize, own: usize, most: usize| (length * own).div_ceil(most).div_ceil(8);
            return (side(width, c.h, h_max) * side(height, c.v, v_max), vec![1]);
        }
        let blocks = self.components.iter().map(|(c, ..)| c.h * c.v).collect();
        (width.div_ceil(8 * h_max) * height.div_ceil(8 * v_max), blocks)
    }

    /// Rows of the picture that are surely sound where data end, or cease to make sense, after this part of the units. The row of units before
    /// that place is left out too: bits at a cut, and those behind a damage, may go on making sense for a while.
    pub(crate) fn sound_rows(&self, part: f64) -> usize {
        let (units, _) = self.units();
        let [width, height] = self.size;
        let [h_max, v_max] = self.largest;
        // Pixels of a unit: of a scan of one component a block, which stands for several of the picture where the component is coarser.
        let [across, down] = match self.components[..] {
            [(c, ..)] => [8 * h_max / c.h, 8 * v_max / c.v],
            _ => [8 * h_max, 8 * v_max],
        };
        let whole = (part * units as f64).round() as usize / width.div_ceil(across).max(1);
        (whole.saturating_sub(1) * down).min(height)
    }

    /// Reads the data.
    pub(crate) fn read(&self, bytes: &[u8]) -> ScanEnd {
        let (units, blocks) = self.units();
        let mut bits = Bits::new(bytes);
        let (mut restarts, mut empty) = (0u8, 0);
        for unit in 0..units {
            let part = unit as f64 / units as f64;
            if self.restart_interval > 0 && unit > 0 && unit % self.restart_interval == 0 {
                if bits.left() >= 8 {
                    return ScanEnd::Damaged(part);
                }
                empty = 0;
                match bits.next_interval() {
                    Some(marker) if marker == 0xd0 + restarts => restarts = (restarts + 1) % 8,
                    Some(0xd0..=0xd7) => return ScanEnd::Damaged(part),
                    _ => return ScanEnd::Early(part),
                }
            }
            for ((_, first, others), count) in self.components.iter().zip(&blocks) {
                for _ in 0..*count {
                    let sound = match self.coefficients {
                        Coefficients::All => mean(&mut bits, first) && coefficients(&mut bits, others),
                        Coefficients::Mean => mean(&mut bits, first),
                        Coefficients::Band(from, to) => band(&mut bits, others, from..=to, &mut empty),
                    };
                    if bits.is_over() {
                        return ScanEnd::Early(part);
                    }
                    if !sound {
                        return ScanEnd::Damaged(part);
                    }
                }
            }
        }
        bits.fill();
        // Padding is less than a byte; some encoders add a few zero bytes.
        if bits.left() >= 32 { ScanEnd::Damaged(1.0) } else { ScanEnd::Whole }
    }
}

/// Reads the mean of a block; whether its code makes sense.
fn mean(bits: &mut Bits, table: &HuffmanTable) -> bool {
    bits.fill();
    let Some((length, size)) = table.find(bits.peek16()) else { return false };
    if size > 16 {
        return false;
    }
    bits.skip(length + u32::from(size));
    true
}

/// Reads the other coefficients of a block; whether their codes make sense.
fn coefficients(bits: &mut Bits, table: &HuffmanTable) -> bool {
    let mut k = 1;
    while k < 64 {
        bits.fill();
        let Some((length, symbol)) = table.find(bits.peek16()) else { return false };
        let (run, size) = (usize::from(symbol >> 4), u32::from(symbol & 15));
        bits.skip(length + size);
        k += match (run, size) {
            (15, 0) => 16,
            (_, 0) => return true,
            _ => run + 1,
        };
        if k > 64 {
            return false;
        }
    }
    true
}

/// Reads the coefficients of a band, or counts a block among the `empty` ones that the codes said before; whether the codes make sense.
fn band(bits: &mut Bits, table: &HuffmanTable, band: RangeInclusive<usize>, empty: &mut u32) -> bool {
    if *empty > 0 {
        *empty -= 1;
        return true;
    }
    let mut k = *band.start();
    while k <= *band.end() {
        bits.fill();
        let Some((length, symbol)) = table.find(bits.peek16()) else { return false };
        let (run, size) = (u32::from(symbol >> 4), u32::from(symbol & 15));
        bits.skip(length);
        if size == 0 && run < 15 {
            // The rest of this block, and so many blocks after it.
            *empty = (1 << run) - 1 + if run > 0 { bits.peek16() >> (16 - run) } else { 0 };
            bits.skip(run);
            return true;
        }
        bits.skip(size);
        k += run as usize + 1;
    }
    // A run of sixteen zeros may end a band.
    k <= *band.end() + 1
}
