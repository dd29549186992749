//! Names of the images.

use crate::ids::ImageId;

/// A name for each image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Names<'a>(pub(super) &'a [String]);

impl Names<'_> {
    /// The name of an image.
    pub(super) fn of(self, image: ImageId) -> String {
        self.0[image.index()].clone()
    }
}
