//! Tables of matches, tracks and pairs: CSV.
//!
//! `table` is the CSV itself; `matches_csv`, `tracks_csv` and `pairs_csv` are what it may hold.

mod matches_csv;
mod odometry_csv;
mod pairs_csv;
mod point_pairs;
mod table;
mod tracks_csv;

use std::path::Path;

use groundcal::geometry::ImageSize;

use crate::{error::IoError, text::some_of};

pub use odometry_csv::read_odometry;
pub use pairs_csv::read_pairs;
pub use point_pairs::PointPairs;
pub use tracks_csv::{TracksOfImage, pairs_of_tracks};

/// Which pairs of images are made of tracks.
#[derive(Debug, Clone, Copy)]
pub enum PairChoice<'a> {
    /// All of them up to so many images; beyond, each with the three that follow it, and the first with the last.
    Near {
        /// Images of which all pairs are made.
        all_pairs_limit: usize,
    },
    /// Those that a CSV lists (`image_a,image_b`), and the same beside them: views of one plane are linked by more than its motions.
    Listed {
        /// The CSV.
        list: &'a Path,
        /// Images of which all pairs are made.
        all_pairs_limit: usize,
    },
}

/// Reads `matches.csv` (`image_a,image_b,xa,ya,xb,yb[,sigma_px]`) or `tracks.csv` (`image,track,x,y[,sigma_px]`), told apart by
/// the header.
///
/// # Errors
/// [`IoError::File`] with the line at fault.
///
/// ```
/// use groundcal::geometry::ImageSize;
/// use groundcal_io::matches::{PairChoice, read_matches};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("matches.csv");
/// std::fs::write(&path, "image_a;image_b;xa;ya;xb;yb\n1.jpg;2.jpg;10,5;20;30;40,25\n")?;
/// let found = read_matches(&path, ImageSize::new(640, 480), PairChoice::Near { all_pairs_limit: 40 })?;
/// assert_eq!(found.names, ["1.jpg", "2.jpg"]);
/// assert_eq!(found.pairs[0].matches[0].b.y, 40.25);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_matches(path: &Path, size: ImageSize, choice: PairChoice) -> Result<PointPairs, IoError> {
    let table = table::Table::read(path)?;
    if table.has("image_a") && table.has("xa") {
        let mut found = matches_csv::point_pairs(&table, size)?;
        if let PairChoice::Listed { list, .. } = choice {
            found.listed = Some(read_pairs(list, &found.names)?);
        }
        Ok(found.judged(path, size))
    } else if table.has("track") && table.has("image") {
        let tracks = tracks_csv::Tracks::read(&table, size)?;
        match choice {
            PairChoice::Near { all_pairs_limit } => tracks.near(all_pairs_limit),
            PairChoice::Listed { list, all_pairs_limit } => {
                let list = read_pairs(list, &tracks.names)?;
                tracks.listed(list, all_pairs_limit)
            }
        }
        .map(|found| found.judged(path, size))
        .map_err(|what| IoError::file(path, what))
    } else {
        Err(IoError::file(
            path,
            format!(
                "the header is neither that of matches (image_a,image_b,xa,ya,xb,yb[,sigma_px]) nor of tracks \
                 (image,track,x,y[,sigma_px]): it has {}",
                some_of(table.header.iter().map(String::as_str), 8)
            ),
        ))
    }
}

#[cfg(test)]
mod tests;
