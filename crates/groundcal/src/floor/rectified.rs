//! One image of a calibration as a picture of the floor, in one call.

use crate::{
    error::Error,
    floor::{
        layout::{DEFAULT_EXTENT_HEIGHTS, FloorLayout, ResolutionError, Up},
        placed::placed,
        rectify::rectify,
        view::FloorGrid,
    },
    result::Calibration,
    vision::resample::{Depth, Pyramid, Raster, Resampled},
};

/// The floor as one image of a calibration shows it, seen from above: the picture, and where its pixels lie on the floor.
///
/// The way the camera looks is up; floor further away than five heights of the camera is left out. Without `px_per_unit` the
/// resolution is that of the image (the unit: metres where the calibration has a camera height, else that height). Of several images
/// laid over each other [`Mosaic`](crate::floor::rectify::Mosaic) makes a picture.
///
/// # Errors
/// [`Error::InvalidInput`] where the calibration has no such view, or the view sees no floor; [`Error::InvalidOption`] where the picture
/// would be too large.
///
/// # Examples
/// ```
/// use groundcal::{synthetic::PointScene, vision::Raster, ImagePair, ImageSize, Options, Silent, calibrate_matches, rectify_image};
///
/// let scene = PointScene::nominal(0);
/// let pairs: Vec<ImagePair> = scene.pairs();
/// let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
///
/// // A grey picture of 8 bits, from a decoder in earnest.
/// let pixels = vec![128u8; scene.size.width * scene.size.height];
/// let picture = Raster::from_rows(scene.size, 1, pixels).expect("as many as pixels");
/// let (floor, grid) = rectify_image(&calibration, "view 0", picture, Some(50.0))?;
/// assert_eq!(grid.unit_per_px, 0.02);
/// assert_eq!(floor.picture.size(), grid.size);
/// # Ok::<(), groundcal::Error>(())
/// ```
pub fn rectify_image<T: Depth>(
    calibration: &Calibration,
    image: &str,
    picture: Raster<T>,
    px_per_unit: Option<f64>,
) -> Result<(Resampled<T>, FloorGrid), Error> {
    // Views of the joint refinement are in the calibration's unit already.
    let scale = if calibration.views.is_empty() { calibration.camera_height_m.unwrap_or(1.0) } else { 1.0 };
    let all = placed(calibration, scale)?;
    let view = all
        .iter()
        .find(|p| p.image == image)
        .map(|p| &p.view)
        .ok_or_else(|| Error::InvalidInput(format!("the calibration has no view of the floor named {image}")))?;
    if picture.size() != calibration.camera.size() {
        return Err(Error::InvalidInput(format!(
            "a picture of {} pixels, the calibration is of {}",
            picture.size(),
            calibration.camera.size()
        )));
    }
    let max_distance = DEFAULT_EXTENT_HEIGHTS * view.centre().z;
    let layout = FloorLayout { size: picture.size(), max_distance, up: Up::Heading };
    let no_floor = || Error::InvalidInput(format!("{image} sees no floor within {max_distance} of its foot"));
    let resolution = layout.resolution(&[vec![view]], px_per_unit).map_err(|error| match error {
        ResolutionError::NoFloor => no_floor(),
        ResolutionError::TooLarge { pixels, fits_px_per_unit, .. } => Error::InvalidOption(format!(
            "a picture of {pixels} pixels: {fits_px_per_unit} pixels a unit of length would fit"
        )),
    })?;
    let grid = layout.grid(&[view], resolution.px_per_unit).ok_or_else(no_floor)?;
    Ok((rectify(&Pyramid::new(picture), view, &grid, max_distance), grid))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        calibrate::{Options, Silent, calibrate_matches},
        geometry::size::ImageSize,
        pairs::correspondence::ImagePair,
        synthetic::PointScene,
    };

    #[test]
    fn the_floor_of_an_image_is_shown_and_what_does_not_fit_is_refused() {
        let scene = PointScene::nominal(0);
        let pairs: Vec<ImagePair> = scene.pairs();
        let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
        let c = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).unwrap();
        let of = |size: ImageSize| Raster::from_rows(size, 1, vec![200u8; size.width * size.height]).unwrap();
        let (floor, grid) = rectify_image(&c, "view 0", of(scene.size), Some(40.0)).unwrap();
        let view = placed(&c, 1.0).unwrap().remove(0).view;
        let [x, y] = [grid.size.width / 2, grid.size.height / 2];
        let point = grid.floor_from_pixel(&nalgebra::Vector2::new(x as f64, y as f64));
        let inside = view.pixel_from_floor(&point).is_some_and(|p| {
            (0.0..scene.size.width as f64 - 1.0).contains(&p.x) && (0.0..scene.size.height as f64 - 1.0).contains(&p.y)
        });
        assert!(inside, "{point}");
        assert_eq!(floor.picture.pixel(x, y), [200]);
        assert!(matches!(rectify_image(&c, "view 9", of(scene.size), None), Err(Error::InvalidInput(_))));
        assert!(matches!(rectify_image(&c, "view 0", of(ImageSize::new(9, 9)), None), Err(Error::InvalidInput(_))));
        assert!(matches!(rectify_image(&c, "view 0", of(scene.size), Some(1e9)), Err(Error::InvalidOption(_))));
    }
}
