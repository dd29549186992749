use std::path::PathBuf;

use crate::matches::*;

const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

struct File {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

fn file(text: &str) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.csv");
    std::fs::write(&path, text).unwrap();
    File { _folder: folder, path }
}

fn read(text: &str) -> Result<PointPairs, IoError> {
    read_matches(&file(text).path, SIZE, PairChoice::Near { all_pairs_limit: 40 })
}

#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let message = read(text).unwrap_err().to_string();
    for word in words {
        assert!(message.contains(word), "\"{word}\" is missing in: {message}");
    }
    assert!(!message.contains(char::is_control), "{message:?}");
}

#[test]
fn separators_and_decimal_marks() {
    for text in [
        "image_a,image_b,xa,ya,xb,yb\na,b,1.5,2,3,4.25\n",
        "image_a;image_b;xa;ya;xb;yb\r\na;b;1.5;2;3;4.25\r\n",
        "image_a;image_b;xa;ya;xb;yb\na;b;1,5;2;3;4,25\n",
        "sep=;\nimage_a;image_b;xa;ya;xb;yb\na;b;1,5;2;3;4,25\n",
        "image_a\timage_b\txa\tya\txb\tyb\na\tb\t1,5\t2\t3\t4,25\n",
        "Image_A, Image_B, XA, YA, XB, YB\n a, b, 1.5, 2, 3, 4.25\n",
        "image_a,image_b,xa,ya,xb,yb\na,b,\"1,5\",2,3,\"4,25\"\n",
        "image_a,image_b,xa,ya,xb,yb\ra,b,1.5,2,3,4.25\r",
        "\u{feff}# comment\n\nimage_a,image_b,xa,ya,xb,yb # header\na,b,1.5,2,3,4.25 # seen, twice\n",
        "image_a,image_b,xa,ya,xb,yb\na,b,1.5,2,3,4.25 #seen\n",
    ] {
        let found = read(text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(found.names, ["a", "b"]);
        let m = &found.pairs[0].matches[0];
        assert_eq!((m.a, m.b), ([1.5, 2.0].into(), [3.0, 4.25].into()), "{text}");
    }
    // A name may hold a hash.
    assert_eq!(read("image_a,image_b,xa,ya,xb,yb\nIMG #1.jpg,b#2,1,2,3,4\n").unwrap().names, ["IMG #1.jpg", "b#2"]);
}

#[test]
fn faults_are_named_with_their_line() {
    refused("image_a,image_b,xa,ya,xb,yb\n# no\n\na,b,1,2,3\n", &["table.csv line 4: 5 fields where the header has 6"]);
    refused("image_a,image_b,xa,ya,xb,yb\na,b,1,5,2,3,4,2\n", &["line 2", "8 fields", "semicolons"]);
    refused("image_a;image_b;xa;ya;xb;yb\na;b;1,5;2;3;4\na;b;1.5;2;3;4\n", &["points (line 3) and commas (line 2)"]);
    refused("image_a,image_b,xa,ya,xb,yb,XA\na,b,1,2,3,4,5\n", &["the column XA is there twice"]);
    refused("image_a,image_b,xa,ya,xb\na,b,1,2,3\n", &["the column yb is missing"]);
    refused("image_a,image_b,xa,ya,xb,yb\na,,1,2,3,4\n", &["line 2: image_b is empty"]);
    refused("image_a,image_b,xa,ya,xb,yb\na,b,1,2,3,4x\n", &["line 2: yb is \"4x\""]);
    refused("image_a,image_b,xa,ya,xb,yb\na,b,1,2,3,nan\n", &["line 2: yb is \"nan\""]);
    refused("image_a,image_b,xa,ya,xb,yb\na,b,1,2,3,1e300\n", &["line 2", "far outside"]);
    refused("image_a,image_b,xa,ya,xb,yb\n", &["no rows"]);
    refused("", &["no rows"]);
    refused("x,y\n1,2\n", &["neither that of matches", "it has x, y"]);
    let long = format!("image_a,image_b,xa,ya,xb,yb\na,b,1,2,3,{}\n", "7".repeat(100_000));
    let message = read(&long).unwrap_err().to_string();
    assert!(message.len() < 400, "{}", message.len());
    refused(&long.replace('b', "\u{1b}[2J"), &["table.csv"]);
    refused("image_a,image_b,xa,ya,xb,yb\na\u{1b}[31m,a\u{1b}[31m,1,2,3,4\n", &[r"a\u{1b}[31m with itself"]);
    refused(&format!("image_a,image_b,xa,ya,xb,yb\n{},b,1,2,3,4\n", "n".repeat(5000)), &["name of 5000 bytes"]);
}

#[test]
fn tracks_that_share_nothing_say_so() {
    refused("image,track,x,y\na,1,2,3\nb,2,2,3\n", &["no two images at all share a track (2 images, 2 tracks)"]);
    refused("image,track,x,y\na,1,2,3\na,1,2,3\n", &["line 3: track 1 appears twice in image a"]);
    let found = read("image,track,x,y\nb,7,2,3\na,7,1,3\na,10,5,6\nb,10,7,8\nc,10,9,9\n").unwrap();
    assert_eq!(found.names, ["a", "b", "c"]);
    let pairs: Vec<(usize, usize, usize)> = found.pairs.iter().map(|p| (p.from, p.to, p.matches.len())).collect();
    assert_eq!(pairs, [(0, 1, 2), (0, 2, 1), (1, 2, 1)]);
    assert_eq!(found.pairs[0].matches[1].a.x, 5.0);
}

#[test]
fn listed_pairs_and_those_beside_them() {
    let tracks = file("image,track,x,y\na,7,2,3\nb,8,1,3\nc,7,5,6\nc,8,5,7\n");
    let list = file("image_a;image_b\nc;a # the turn\n");
    let found = read_matches(&tracks.path, SIZE, PairChoice::Listed { list: &list.path, all_pairs_limit: 40 }).unwrap();
    assert_eq!(found.listed, Some(vec![(2, 0)]));
    let pairs: Vec<(usize, usize)> = found.pairs.iter().map(|p| (p.from, p.to)).collect();
    assert_eq!(pairs, [(0, 2), (1, 2)]);
}

/// The work grows with the tracks, not with their square, and with the pairs that are made.
#[test]
fn many_views_are_neighbours() {
    let mut text = String::from("image,track,x,y\n");
    for image in 0..800 {
        for track in 0..20 {
            text += &format!("{image},{},{},{}\n", image / 2 + track, track * 7, track * 5);
        }
    }
    let found = read(&text).unwrap();
    assert!(found.neighbours_only && found.pairs.len() == 3 * 800 - 6, "{}", found.pairs.len());
}
