//! NumPy arrays as pictures, and back. Python has looked at their dtype and shape (`groundcal/_arrays.py`); they are C-contiguous.

use groundcal::{
    geometry::ImageSize,
    vision::{Depth, Raster, Resampled},
};
use groundcal_io::{
    images::{ArrayImage, Pixels},
    pictures::Picture,
};
use numpy::{Element, IntoPyArray, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::{exceptions::PyTypeError, prelude::*};

fn size_and_channels(shape: &[usize]) -> PyResult<(ImageSize, usize)> {
    match *shape {
        [height, width] => Ok((ImageSize::new(width, height), 1)),
        [height, width, channels @ 1..=4] => Ok((ImageSize::new(width, height), channels)),
        _ => Err(PyTypeError::new_err("an array of pixels must have the shape (H, W) or (H, W, 3)")),
    }
}

fn not_contiguous<E>(_: E) -> PyErr {
    PyTypeError::new_err("an array of pixels must be C-contiguous")
}

/// What is done with the pixels of an array, which stays where it is.
pub(crate) fn with_pixels<R>(
    array: &Bound<'_, PyAny>,
    name: &str,
    blue_first: bool,
    action: impl FnOnce(ArrayImage) -> PyResult<R>,
) -> PyResult<R> {
    let with = |shape: &[usize], pixels: Pixels| {
        let (size, channels) = size_and_channels(shape)?;
        action(ArrayImage { name, size, channels, blue_first, pixels })
    };
    if let Ok(bytes) = array.extract::<PyReadonlyArrayDyn<u8>>() {
        with(bytes.as_array().shape(), Pixels::U8(bytes.as_slice().map_err(not_contiguous)?))
    } else if let Ok(words) = array.extract::<PyReadonlyArrayDyn<u16>>() {
        with(words.as_array().shape(), Pixels::U16(words.as_slice().map_err(not_contiguous)?))
    } else if let Ok(floats) = array.extract::<PyReadonlyArrayDyn<f32>>() {
        with(floats.as_array().shape(), Pixels::F32(floats.as_slice().map_err(not_contiguous)?))
    } else {
        Err(PyTypeError::new_err("an array of pixels must be of uint8, uint16 or float32"))
    }
}

/// A copy of an array as a picture of its depth, colours in their order.
pub(crate) fn picture(array: &Bound<'_, PyAny>) -> PyResult<Picture> {
    fn raster<T: Depth>(image: &ArrayImage, data: &[T]) -> PyResult<Raster<T>> {
        Raster::from_rows(image.size, image.channels, data.to_vec())
            .ok_or_else(|| PyTypeError::new_err("an array of pixels must not be empty"))
    }
    with_pixels(array, "image", false, |image| {
        Ok(match image.pixels {
            Pixels::U8(data) => Picture::U8(raster(&image, data)?),
            Pixels::U16(data) => Picture::U16(raster(&image, data)?),
            Pixels::F32(data) => Picture::F32(raster(&image, data)?),
        })
    })
}

/// A picture that was made, with how much of each pixel was seen (0 to 255).
pub(crate) enum Made {
    U8(Resampled<u8>),
    U16(Resampled<u16>),
    F32(Resampled<f32>),
}

impl Made {
    /// (H, W) or (H, W, 3), and (H, W).
    pub(crate) fn arrays(self, py: Python<'_>) -> PyResult<(Bound<'_, PyAny>, Bound<'_, PyAny>)> {
        fn both<T: Element + Depth>(
            py: Python<'_>,
            made: Resampled<T>,
        ) -> PyResult<(Bound<'_, PyAny>, Bound<'_, PyAny>)> {
            let (size, channels) = (made.picture.size(), made.picture.channels());
            let data = Vec::from(made.picture).into_pyarray(py);
            let picture = match channels {
                1 => data.reshape([size.height, size.width])?.into_any(),
                _ => data.reshape([size.height, size.width, channels])?.into_any(),
            };
            let coverage = made.coverage.into_pyarray(py).reshape([size.height, size.width])?;
            Ok((picture, coverage.into_any()))
        }
        match self {
            Made::U8(made) => both(py, made),
            Made::U16(made) => both(py, made),
            Made::F32(made) => both(py, made),
        }
    }
}

/// A picture's depth by depth work.
pub(crate) trait PerDepth {
    /// The work.
    fn on<T: Depth>(&self, picture: Raster<T>) -> Resampled<T>;
}

/// Does it in the picture's depth.
pub(crate) fn per_depth(picture: Picture, work: &impl PerDepth) -> Made {
    match picture {
        Picture::U8(picture) => Made::U8(work.on(picture)),
        Picture::U16(picture) => Made::U16(work.on(picture)),
        Picture::F32(picture) => Made::F32(work.on(picture)),
    }
}
