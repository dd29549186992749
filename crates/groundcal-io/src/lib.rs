//! Files for groundcal: images and matches in, cameras of other programs in and out.

pub mod error;
pub mod export;
pub mod import;
pub mod load;
pub mod pictures;
pub mod view_files;
