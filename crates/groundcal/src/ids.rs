//! Indices that cannot be mixed up: an image is no view, and neither is a pair.

use std::fmt;

macro_rules! index {
    ($(#[$documentation:meta])* $name:ident) => {
        $(#[$documentation])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub(crate) struct $name(usize);

        impl $name {
            /// The index of a slice's element.
            pub(crate) const fn new(index: usize) -> Self {
                Self(index)
            }

            /// Its place in the slice.
            pub(crate) const fn index(self) -> usize {
                self.0
            }
        }

        impl From<usize> for $name {
            fn from(index: usize) -> Self {
                Self(index)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

index! {
    /// An image as it was given: its place among the names.
    ImageId
}
index! {
    /// A view of the joint refinement: an image that takes part in it.
    ViewId
}
index! {
    /// A pair of images: its place in the list of pair observations.
    PairId
}
index! {
    /// A group of views of the joint refinement that share an attitude.
    GroupId
}
