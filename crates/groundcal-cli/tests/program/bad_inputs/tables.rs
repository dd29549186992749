//! Tables: matches, tracks and lists of pairs.

use std::fmt::Write;

use groundcal::synthetic::{MotionSpec, PointScene};

use crate::common::{matches_csv, tracks_csv};

const MATCHES: &str = "image_a,image_b,xa,ya,xb,yb\n";
const TRACKS: &str = "image,track,x,y\n";

/// Three motions that make a camera.
pub(super) fn good() -> PointScene {
    let mut scene = PointScene::nominal(6);
    scene.matches = 60;
    scene
}

/// A motion that is none.
fn translation() -> PointScene {
    let mut scene = good();
    scene.motions.truncate(1);
    scene.motions[0].turn_rad = 0.0;
    scene.motions[0].shift = [0.6, 0.3];
    scene
}

/// A camera that looks straight down.
fn downwards() -> PointScene {
    let mut scene = good();
    scene.motions = vec![MotionSpec::about_axis(90f64.to_radians(), 0.0, 25f64.to_radians(), 0.2, 3.0)];
    scene
}

/// Points on a line.
fn line() -> String {
    let rows = (0..40).map(|i| format!("a,b,{},{},{},{}\n", 10 * i, 100 + 2 * i, 9 * i + 3, 90 + 3 * i));
    MATCHES.to_string() + &rows.collect::<String>()
}

pub(super) fn files() -> Vec<(String, Vec<u8>)> {
    let m = |rows: &str| format!("{MATCHES}{rows}").into_bytes();
    let t = |rows: &str| format!("{TRACKS}{rows}").into_bytes();
    let good_csv = matches_csv(&good());
    let semicolons = good_csv.replace(',', ";").replace('.', ",");
    let text: Vec<(&str, Vec<u8>)> = vec![
        ("good.csv", good_csv.clone().into()),
        ("good_tracks.csv", tracks_csv(&good()).into()),
        ("semicolon_decimalcomma.csv", semicolons.into()),
        ("semicolon.csv", good_csv.replace(',', ";").into()),
        ("utf16.csv", [vec![0xff, 0xfe], good_csv.encode_utf16().flat_map(u16::to_le_bytes).collect()].concat()),
        ("empty.csv", Vec::new()),
        ("comments.csv", "# nothing\n\n# else\n".into()),
        ("header.csv", m("")),
        ("wrong_header.csv", "left,right,x0,y0,x1,y1\na,b,10,10,12,11\n".into()),
        ("missing_column.csv", "image_a,image_b,xa,ya,xb\na,b,1,2,3\n".into()),
        ("column_twice.csv", "image_a,image_b,xa,ya,xb,yb,XA\na,b,1,2,3,4,5\n".into()),
        ("nan.csv", m("a,b,10,10,12,11\na,b,90,NaN,99,310\n")),
        ("infinite.csv", m("a,b,10,10,12,inf\n")),
        ("huge_number.csv", m("a,b,10,10,12,1e999\n")),
        ("word.csv", m("a,b,10,ten,12,11\n")),
        ("escape.csv", m("a,b,10,\u{1b}[2J\u{202e},12,11\n")),
        ("digits.csv", m(&format!("a,b,10,{}x,12,11\n", "7".repeat(100_000)))),
        ("short.csv", m("a,b,10,10,12,11\na,b,400,30\n")),
        ("long.csv", m("a,b,10,5,10,12,11,3\n")),
        ("far.csv", m("a,b,10,10,12,11\na,b,4000,30,410,35\n")),
        ("itself.csv", m("a,a,10,10,12,11\n")),
        ("no_name.csv", m(",b,10,10,12,11\n")),
        ("long_name.csv", m(&format!("{},b,10,10,12,11\n", "n".repeat(2000)))),
        ("sigma_zero.csv", "image_a,image_b,xa,ya,xb,yb,sigma_px\na,b,1,2,3,4,0\n".into()),
        ("sigma_negative.csv", "image_a,image_b,xa,ya,xb,yb,sigma_px\na,b,1,2,3,4,-1\n".into()),
        ("both_marks.csv", "image_a;image_b;xa;ya;xb;yb\na;b;1,5;2;3;4\na;b;1.5;2;3;4\n".into()),
        ("latin1.csv", [MATCHES.as_bytes(), b"Fl\xe4che,b,1,2,3,4\n"].concat()),
        ("utf16_damaged.csv", b"\xff\xfe\0\xd8,\0".to_vec()),
        ("binary.csv", (0..=255u8).cycle().take(4096).collect()),
        ("three.csv", m("a,b,10,10,12,11\na,b,400,30,410,35\na,b,90,300,99,310\n")),
        ("once.csv", m(&"a,b,10,10,12,11\n".repeat(1000))),
        ("names_with_escapes.csv", m("a\u{1b}[2J\u{202e},b\u{7},10,10,12,11\n")),
        ("line.csv", line().into()),
        ("translation.csv", matches_csv(&translation()).into()),
        ("downwards.csv", matches_csv(&downwards()).into()),
        ("still.csv", still().into()),
        ("track_twice.csv", t("a,1,10,10\na,1,12,11\n")),
        ("tracks_of_one.csv", t("a,1,10,10\na,2,12,11\n")),
        ("tracks_apart.csv", t("a,1,10,10\nb,2,12,11\nc,3,12,11\n")),
        ("no_track.csv", t("a,,10,10\n")),
        ("pairs.csv", "image_a,image_b\nm0a,m0b\n".into()),
        ("pairs_unknown.csv", "image_a,image_b\nm0a,m0b\nm0a,77z\n".into()),
        ("pairs_itself.csv", "image_a,image_b\nm0a,m0a\n".into()),
        ("pairs_twice.csv", "image_a,image_b\nm0a,m0b\nm0b,m0a\n".into()),
        ("pairs_header.csv", "from,to\nm0a,m0b\n".into()),
        ("pairs_none.csv", "image_a,image_b\n".into()),
        ("pairs_apart.csv", "image_a,image_b\nm0a,m1b\n".into()),
    ];
    text.into_iter().map(|(name, content)| (name.to_string(), content)).collect()
}

/// Matches that stand still.
fn still() -> String {
    let mut csv = MATCHES.to_string();
    for i in 0..80 {
        let (x, y) = (37 * i % 1200, 101 * i % 900);
        let _ = writeln!(csv, "a,b,{x},{y},{x},{y}");
    }
    csv
}
