//! The images that take part in the joint refinement, as its views.

use crate::{
    ids::{ImageId, PairId, ViewId},
    pairs::observation::{PairObservation, images_of},
};

/// Images and views, either from the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Views {
    /// Image of each view, ascending.
    images: Vec<ImageId>,
}

impl Views {
    /// The images of some pairs.
    pub(super) fn of_pairs(some: &[PairId], pairs: &[PairObservation]) -> Self {
        Self { images: images_of(some, pairs).into_iter().collect() }
    }

    /// The same with more images.
    pub(super) fn and(&self, more: impl Iterator<Item = ImageId>) -> Self {
        let mut images: Vec<ImageId> = self.images.iter().copied().chain(more).collect();
        images.sort_unstable();
        images.dedup();
        Self { images }
    }

    /// The view of an image; `None` for one that takes no part.
    pub(super) fn of(&self, image: ImageId) -> Option<ViewId> {
        self.images.binary_search(&image).ok().map(ViewId::new)
    }

    /// The views of a pair; `None` where one of its images takes no part.
    pub(super) fn of_pair(&self, pair: &PairObservation) -> Option<[ViewId; 2]> {
        Some([self.of(pair.from)?, self.of(pair.to)?])
    }

    /// The image of a view.
    pub(super) fn image(&self, view: ViewId) -> ImageId {
        self.images[view.index()]
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.images.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_takes_no_part_is_no_view() {
        let views = Views { images: [2, 5, 9].map(ImageId::new).into() };
        assert_eq!(views.of(ImageId::new(5)), Some(ViewId::new(1)));
        assert_eq!([0, 3, 10].map(|image| views.of(ImageId::new(image))), [None; 3]);
        assert_eq!((views.image(ViewId::new(2)), views.len()), (ImageId::new(9), 3));
    }
}
