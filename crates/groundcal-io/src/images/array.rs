//! Pictures that are in memory already, another program's arrays: below what makes grey values of them.

use groundcal::geometry::ImageSize;

/// Samples of a picture, row by row, the channels of a pixel together.
#[derive(Debug, Clone, Copy)]
pub enum Pixels<'a> {
    /// 8 bits, 0 to 255.
    U8(&'a [u8]),
    /// 16 bits, 0 to 65535 at most.
    U16(&'a [u16]),
    /// Floating point, in a range of its own.
    F32(&'a [f32]),
}

/// A picture in memory.
#[derive(Debug, Clone, Copy)]
pub struct ArrayImage<'a> {
    /// What it is called in messages.
    pub name: &'a str,
    /// Width and height.
    pub size: ImageSize,
    /// 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha.
    pub channels: usize,
    /// Whether blue comes first and red third, as OpenCV has it.
    pub blue_first: bool,
    /// The samples.
    pub pixels: Pixels<'a>,
}
