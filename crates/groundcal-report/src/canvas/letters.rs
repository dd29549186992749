//! The letters of the PNG figures: single lines, drawn with a round pen. A figure needs no font of the machine, so it is the
//! same everywhere. Widths are near those of the usual sans-serif faces, so that texts fit as SVG, where the viewer chooses
//! the face, as they do here.

use tiny_skia::{Path, PathBuilder};

/// Units of the table in one font size.
pub(crate) const EM: f64 = 31.0;
/// Width of the pen.
pub(crate) const PEN: f64 = 2.7;

/// Letter, advance, and the way of the pen: `M` to a point, pen lifted; `L` straight to a point; `H` and `V` a quarter of an
/// ellipse to a point, leaving horizontally or vertically; `C` a cubic curve by two control points to the third. The y axis
/// points up; capitals are 20 high, small letters 15, heights without the pen's width.
#[rustfmt::skip]
const LETTERS: &[(char, f32, &str)] = &[
    (' ', 8.0, ""),
    ('0', 17.5, "M2.6,12 V8.75,20 H14.9,12 L14.9,8 V8.75,0 H2.6,8 L2.6,12"),
    ('1', 17.5, "M4.5,16.4 L9.6,20 L9.6,0"),
    ('2', 17.5, "M2.8,17.2 C4.2,19 6,20 8.3,20 H14,14.8 C14,10.8 9.5,6.8 2.6,0 L15,0"),
    ('3', 17.5, "M3,18.1 C4.5,19.3 6.1,20 8.1,20 H13.9,15.4 V8.1,10.7 L6,10.7 M8.1,10.7 H14.8,5.4 V8,0 C5.7,0 4,0.5 2.4,1.4"),
    ('4', 17.5, "M12.2,0 L12.2,20 L1.8,5.8 L15.9,5.8"),
    ('5', 17.5, "M13.9,20 L4.5,20 L3.8,11.6 C5.1,12.2 6.5,12.5 8.2,12.5 H14.9,6.4 V8,0 C5.8,0 4,0.5 2.5,1.4"),
    ('6', 17.5, "M13.9,19.7 C13,19.9 12.1,20 11.2,20 C5.6,20 2.7,15.6 2.7,8 V8.9,0 H14.9,6.2 V8.9,12.4 C6,12.4 3.6,10.8 2.7,8"),
    ('7', 17.5, "M2.5,20 L15,20 L6.4,0"),
    ('8', 17.5, "M8.75,10.6 H3.4,15.4 V8.75,20 H14.1,15.4 V8.75,10.6 H2.6,5.2 V8.75,0 H14.9,5.2 V8.75,10.6"),
    ('9', 17.5, "M3.6,0.3 C4.5,0.1 5.4,0 6.3,0 C11.9,0 14.8,4.4 14.8,12 V8.6,20 H2.6,13.8 V8.6,7.6 C11.5,7.6 13.9,9.2 14.8,12"),
    ('A', 19.8, "M1.5,0 L9.9,20 L18.3,0 M4.5,7 L15.3,7"),
    ('B', 20.0, "M3.2,0 L3.2,20 L9.5,20 H15.8,15.4 V9.5,10.7 L3.2,10.7 M9.5,10.7 L10,10.7 H17,5.4 V10,0 L3.2,0"),
    ('C', 19.4, "M17.5,18.6 C16,19.5 14.2,20 12,20 C6,20 2.3,16 2.3,10 C2.3,4 6,0 12,0 C14.1,0 15.8,0.3 17.3,1.1"),
    ('D', 22.3, "M3.2,0 L3.2,20 L9,20 C16,20 19.9,16.5 19.9,10 C19.9,3.5 16,0 9,0 L3.2,0"),
    ('E', 17.0, "M14.5,20 L3.2,20 L3.2,0 L14.5,0 M3.2,10.6 L13.7,10.6"),
    ('F', 16.0, "M14,20 L3.2,20 L3.2,0 M3.2,10 L13.2,10"),
    ('G', 22.2, "M18.4,18.5 C16.6,19.5 14.6,20 12.3,20 C6,20 2.3,16 2.3,10 C2.3,4 6,0 12.3,0 C15,0 17.3,0.5 19,1.2 L19,9.6 L13,9.6"),
    ('H', 22.6, "M3.2,0 L3.2,20 M19.4,0 L19.4,20 M3.2,10.6 L19.4,10.6"),
    ('I', 8.2, "M4.1,0 L4.1,20"),
    ('J', 11.7, "M8.5,20 L8.5,5 V3.6,0 C2.7,0 1.9,0.1 1.1,0.4"),
    ('K', 19.0, "M3.2,0 L3.2,20 M16.5,20 L3.2,7.5 M7.5,11.5 L17.3,0"),
    ('L', 15.8, "M3.2,20 L3.2,0 L14.2,0"),
    ('M', 27.4, "M3.2,0 L3.2,20 L13.7,1.5 L24.2,20 L24.2,0"),
    ('N', 23.2, "M3.2,0 L3.2,20 L20,0 L20,20"),
    ('O', 24.0, "M2.3,10 C2.3,16 6,20 12,20 C18,20 21.7,16 21.7,10 C21.7,4 18,0 12,0 C6,0 2.3,4 2.3,10"),
    ('P', 18.6, "M3.2,0 L3.2,20 L9.4,20 H16.2,14.4 V9.4,8.7 L3.2,8.7"),
    ('Q', 24.0, "M2.3,10 C2.3,16 6,20 12,20 C18,20 21.7,16 21.7,10 C21.7,4 18,0 12,0 C6,0 2.3,4 2.3,10 M13,0 L17.8,-4.6"),
    ('R', 19.3, "M3.2,0 L3.2,20 L9.4,20 H16,14.6 V9.4,9.2 L3.2,9.2 M10,9.2 L17.2,0"),
    ('S', 17.0, "M14.1,18.7 C12.6,19.5 10.8,20 9,20 H3,15.4 C3,12.6 5,11.4 8.6,10.2 C12.6,8.9 14.9,7.8 14.9,5 V8,0 C5.8,0 4,0.4 2.3,1.2"),
    ('T', 17.2, "M1.3,20 L15.9,20 M8.6,20 L8.6,0"),
    ('U', 22.4, "M3.1,20 L3.1,7.6 V11.2,0 H19.3,7.6 L19.3,20"),
    ('V', 18.6, "M1.5,20 L9.3,0 L17.1,20"),
    ('W', 28.6, "M1.5,20 L7.5,0 L14.3,19 L21.1,0 L27.1,20"),
    ('X', 18.2, "M2,20 L16.2,0 M16.2,20 L2,0"),
    ('Y', 17.4, "M1.5,20 L8.7,9.5 L15.9,20 M8.7,9.5 L8.7,0"),
    ('Z', 17.6, "M2.5,20 L15,20 L2.5,0 L15.2,0"),
    ('a', 17.2, "M3.4,13.8 C5.1,14.6 6.8,15 8.5,15 H13.8,9.8 L13.8,0 M13.8,8.7 L9.5,8.5 C5,8.3 2.5,6.8 2.5,4 V6.9,0 C10.6,0 13.8,2.4 13.8,6"),
    ('b', 19.0, "M3.2,0 L3.2,21 M3.2,7.5 V9.8,15 H16.4,7.5 V9.8,0 H3.2,7.5"),
    ('c', 15.0, "M13.3,14.1 C12.2,14.7 10.8,15 9.3,15 H2.3,7.5 V9.3,0 C10.8,0 12.2,0.2 13.3,0.8"),
    ('d', 19.0, "M15.8,0 L15.8,21 M15.8,7.5 V9.2,15 H2.6,7.5 V9.2,0 H15.8,7.5"),
    ('e', 17.4, "M2.4,7.8 L15.1,7.8 C15.1,12.3 12.7,15 9,15 H2.3,7.5 C2.3,2.7 5,0 9.7,0 C11.6,0 13.1,0.3 14.4,0.9"),
    ('f', 10.6, "M11,20.7 C10.4,20.9 9.8,21 9.1,21 H5.2,16.6 L5.2,0 M1.4,15 L9.8,15"),
    ('g', 19.0, "M15.8,15 L15.8,-0.6 V9,-6.3 C6.9,-6.3 5.1,-6 3.5,-5.2 M15.8,7.5 V9.2,15 H2.6,7.5 V9.2,0 H15.8,7.5"),
    ('h', 19.0, "M3.2,0 L3.2,21 M3.2,9 V9.8,15 H15.8,9.3 L15.8,0"),
    ('i', 7.8, "M3.9,0 L3.9,15 M3.9,20.1 L3.9,20.6"),
    ('j', 7.8, "M3.9,15 L3.9,-2.3 V0.1,-6.3 M3.9,20.1 L3.9,20.6"),
    ('k', 16.5, "M3.2,0 L3.2,21 M13.8,15 L3.2,5 M6.9,8.5 L14.7,0"),
    ('l', 7.8, "M3.9,0 L3.9,21"),
    ('m', 28.6, "M3.2,0 L3.2,15 M3.2,9.5 V9.2,15 H14.3,9.8 L14.3,0 M14.3,9.5 V20.3,15 H25.4,9.8 L25.4,0"),
    ('n', 19.0, "M3.2,0 L3.2,15 M3.2,9 V9.8,15 H15.8,9.3 L15.8,0"),
    ('o', 18.6, "M2.3,7.5 V9.3,15 H16.3,7.5 V9.3,0 H2.3,7.5"),
    ('p', 19.0, "M3.2,-6.3 L3.2,15 M3.2,7.5 V9.8,15 H16.4,7.5 V9.8,0 H3.2,7.5"),
    ('q', 19.0, "M15.8,-6.3 L15.8,15 M15.8,7.5 V9.2,15 H2.6,7.5 V9.2,0 H15.8,7.5"),
    ('r', 12.4, "M3.2,0 L3.2,15 M3.2,8.4 C3.2,12.6 5.9,15 9.6,15 L11.3,14.9"),
    ('s', 14.8, "M12.3,14 C10.9,14.7 9.4,15 7.8,15 H2.9,11.4 C2.9,9.3 4.6,8.5 7.5,7.7 C10.8,6.8 12.7,5.9 12.7,3.7 V7,0 C5.2,0 3.6,0.3 2.2,0.9"),
    ('t', 11.6, "M5,19 L5,4.2 V8.9,0 C9.6,0 10.1,0.1 10.5,0.2 M1.3,15 L10.1,15"),
    ('u', 19.0, "M3.2,15 L3.2,5.7 V9.2,0 H15.8,6 M15.8,15 L15.8,0"),
    ('v', 15.6, "M1.4,15 L7.8,0 L14.2,15"),
    ('w', 24.0, "M1.5,15 L6.6,0 L12,14.5 L17.4,0 L22.5,15"),
    ('x', 16.2, "M2,15 L14.2,0 M14.2,15 L2,0"),
    ('y', 15.6, "M1.4,15 L7.8,0 M14.2,15 L6.3,-3.5 C5.5,-5.5 4.6,-6.3 2.9,-6.3 L1.5,-6.1"),
    ('z', 14.6, "M2.3,15 L12.2,15 L2.3,0 L12.5,0"),
    ('é', 17.4, "M2.4,7.8 L15.1,7.8 C15.1,12.3 12.7,15 9,15 H2.3,7.5 C2.3,2.7 5,0 9.7,0 C11.6,0 13.1,0.3 14.4,0.9 M8,18.8 L11,22.2"),
    ('.', 8.2, "M4.1,0 L4.1,0.5"),
    (',', 8.2, "M4.5,0.5 L3,-3.6"),
    (':', 8.2, "M4.1,0 L4.1,0.5 M4.1,12.6 L4.1,13.1"),
    (';', 8.2, "M4.5,0.5 L3,-3.6 M4.5,12.6 L4.5,13.1"),
    ('\'', 7.0, "M3.5,20.5 L3.5,15"),
    ('-', 10.0, "M2.2,7.3 L7.8,7.3"),
    ('_', 15.5, "M1.2,-3 L14.3,-3"),
    ('#', 20.0, "M8,20 L5,0 M15,20 L12,0 M3,13.6 L18,13.6 M2,6.4 L17,6.4"),
    ('~', 17.5, "M2.5,9 C5,13.5 7,12 8.75,10 C10.5,8 12.5,6.5 15,11"),
    ('+', 17.5, "M8.75,3.8 L8.75,16.2 M2.5,10 L15,10"),
    ('=', 17.5, "M2.5,7.2 L15,7.2 M2.5,12.8 L15,12.8"),
    ('<', 17.5, "M15,16 L2.5,10 L15,4"),
    ('>', 17.5, "M2.5,16 L15,10 L2.5,4"),
    ('±', 17.5, "M8.75,6 L8.75,18 M2.5,12 L15,12 M2.5,0.5 L15,0.5"),
    ('/', 11.6, "M1.5,-1 L10.1,21"),
    ('|', 12.0, "M6,23 L6,-5"),
    ('(', 9.4, "M7.4,22 C4,18.5 2.7,13.5 2.7,9 C2.7,4.5 4,-0.5 7.4,-4"),
    (')', 9.4, "M2,22 C5.4,18.5 6.7,13.5 6.7,9 C6.7,4.5 5.4,-0.5 2,-4"),
    ('%', 25.6, "M2.3,15 V6.4,20 H10.5,15 V6.4,10 H2.3,15 M15.1,5 V19.2,10 H23.3,5 V19.2,0 H15.1,5 M19,20 L6.6,0"),
    ('°', 13.0, "M2.6,16.4 V6.5,20.2 H10.4,16.4 V6.5,12.6 H2.6,16.4"),
];

/// In place of a letter that the table has not.
const BOX: (f32, &str) = (17.5, "M2.5,0 L2.5,20 L15,20 L15,0 L2.5,0");

/// Advance and way of the pen.
pub(crate) fn letter(c: char) -> Option<(f32, &'static str)> {
    LETTERS.iter().find(|l| l.0 == c).map(|l| (l.1, l.2))
}

/// Lines to draw with the pen, beginning at the origin of the base line (units of the table, y down), and the text's length.
pub(crate) fn write(text: &str) -> (Option<Path>, f64) {
    let mut builder = PathBuilder::new();
    let mut x = 0.0;
    for c in text.chars() {
        let (advance, way) = letter(c).unwrap_or(BOX);
        // What cannot be read is left out; a test reads the whole table.
        let _ = follow(&mut builder, way, x);
        x += advance;
    }
    (builder.finish(), f64::from(x))
}

/// The way of the pen, beginning at `left`; `None`: not a way.
fn follow(builder: &mut PathBuilder, way: &str, left: f32) -> Option<()> {
    // The ends of the lines stand on the base line with the pen's width.
    let map = |[x, y]: [f32; 2]| (left + x, -y - 0.5 * PEN as f32);
    let point = |text: &str| {
        let (x, y) = text.split_once(',')?;
        Some([x.parse::<f32>().ok()?, y.parse::<f32>().ok()?])
    };
    let mut at = [0.0, 0.0];
    let mut steps = way.split(' ').filter(|s| !s.is_empty());
    while let Some(step) = steps.next() {
        let (kind, first) = step.split_at_checked(1)?;
        let first = point(first)?;
        let (one, two, end) = match kind {
            "M" => {
                let (x, y) = map(first);
                builder.move_to(x, y);
                at = first;
                continue;
            }
            "L" => (at, first, first),
            "H" => (quarter(at, [first[0], at[1]]), quarter(first, [first[0], at[1]]), first),
            "V" => (quarter(at, [at[0], first[1]]), quarter(first, [at[0], first[1]]), first),
            "C" => (first, point(steps.next()?)?, point(steps.next()?)?),
            _ => return None,
        };
        let ((x1, y1), (x2, y2), (x, y)) = (map(one), map(two), map(end));
        if kind == "L" {
            builder.line_to(x, y)
        } else {
            builder.cubic_to(x1, y1, x2, y2, x, y)
        }
        at = end;
    }
    Some(())
}

/// Control point of a quarter of an ellipse: from its end towards the corner of its box.
fn quarter(end: [f32; 2], corner: [f32; 2]) -> [f32; 2] {
    // An ellipse has 0.552; a little more fills the corners as letters do.
    let share = 0.57;
    [end[0] + share * (corner[0] - end[0]), end[1] + share * (corner[1] - end[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_can_be_drawn_and_stays_in_its_place() {
        for &(c, advance, way) in LETTERS {
            let mut builder = PathBuilder::new();
            assert!(follow(&mut builder, way, 0.0).is_some(), "{c}");
            assert_eq!(LETTERS.iter().filter(|l| l.0 == c).count(), 1, "{c}");
            let Some(path) = builder.finish() else {
                assert_eq!(c, ' ');
                continue;
            };
            let bounds = path.bounds();
            assert!(bounds.left() >= 0.0 && bounds.right() <= advance + 0.5, "{c}: {bounds:?}");
            assert!(bounds.top() >= -25.0 && bounds.bottom() <= 5.5, "{c}: {bounds:?}");
        }
        assert!(follow(&mut PathBuilder::new(), "M1,2 X3,4", 0.0).is_none());
    }

    #[test]
    fn letters_follow_one_another() {
        let (path, length) = write("nn");
        assert_eq!(length, 38.0);
        assert_eq!(path.unwrap().bounds().right(), 19.0 + 15.8);
        assert_eq!(write("\u{2603}").1, f64::from(BOX.0));
        assert!(write("").0.is_none());
    }

    #[test]
    fn there_are_letters_for_every_word_and_number() {
        let wanted = ('a'..='z').chain('A'..='Z').chain('0'..='9').chain(" .,:;'-_#~+=<>/|()%°±é".chars());
        assert_eq!(wanted.filter(|c| letter(*c).is_none()).collect::<String>(), "");
    }
}
