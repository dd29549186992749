//! Every image of a calibration over its floor.

use nalgebra::Vector3;

use crate::{
    error::Error,
    floor::view::FloorView,
    geometry::plane_view::View,
    result::{Calibration, Scene},
};

/// Where an image was taken from, over the floor.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// let all = groundcal::placed(&calibration, 1.0)?;
/// assert_eq!(all[0].image, "view 0");
/// // Cameras stand over the floor.
/// assert!(all[0].view.centre().z > 0.0);
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Name of the image.
    pub image: String,
    /// Image whose foot is the origin of its world; `None`: a world of its own (heading +X, height 1).
    pub origin: Option<String>,
    /// The view.
    pub view: FloorView,
}

/// Every image over the floor, in the order of the calibration: those of the joint refinement, each in the world of its origin; of the
/// linear method those of the motions used, each in a world of its own. Positions are multiplied by `scale`.
///
/// # Errors
/// [`Error::InvalidInput`] where no view has a floor below it.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// // In units of the first camera's height.
/// let all = groundcal::placed(&calibration, 1.0)?;
/// assert_eq!(all.len(), calibration.views.len());
/// # Ok::<(), groundcal::Error>(())
/// ```
pub fn placed(c: &Calibration, scale: f64) -> Result<Vec<Placed>, Error> {
    let (intrinsics, lens) = (c.camera.intrinsics(), c.camera.lens());
    let at = |pitch_deg: f64, roll_deg: f64, yaw_deg: f64, position: [f64; 3]| {
        let view = View {
            pitch_down_rad: pitch_deg.to_radians(),
            roll_rad: roll_deg.to_radians(),
            yaw_rad: yaw_deg.to_radians(),
            centre: Vector3::from(position) * scale,
        };
        FloorView::new(&intrinsics, lens, &view)
    };
    let placed: Vec<Placed> = if c.views.is_empty() {
        attitude_of_images(c)
            .into_iter()
            .map(|(image, a)| {
                let a = &c.attitudes[a];
                let view = at(a.pitch_down_deg, a.roll_deg, 0.0, [0.0, 0.0, 1.0])?;
                Ok(Placed { image: image.into(), origin: None, view })
            })
            .collect::<Result<_, Error>>()?
    } else {
        c.views
            .iter()
            .filter_map(|v| Some((v, v.position?)))
            .map(|(v, position)| {
                let view = at(v.pitch_down_deg, v.roll_deg, v.yaw_deg, position)?;
                Ok(Placed { image: v.image.clone(), origin: Some(v.origin.clone()), view })
            })
            .collect::<Result<_, Error>>()?
    };
    if placed.is_empty() {
        return Err(Error::InvalidInput(match c.scene {
            Some(Scene::Directions) => "the calibration has no floor: its camera turned on the spot before a distant scene \
                                        (\"scene\": \"directions\"), so no view has a position over a plane. Only a calibration \
                                        from a floor can be rectified"
                .into(),
            Some(Scene::Floor) | None => "the calibration has neither views nor attitudes to a floor. Calibrate from images or \
                                          matches of a floor"
                .into(),
        }));
    }
    Ok(placed)
}

/// Images of the motions used, in order of appearance, with their attitudes.
fn attitude_of_images(c: &Calibration) -> Vec<(&str, usize)> {
    let mut found: Vec<(&str, usize)> = Vec::new();
    for m in c.motions.iter().filter(|m| m.used) {
        let Some(a) = m.attitude.filter(|a| *a < c.attitudes.len()) else { continue };
        for image in [m.from.as_str(), m.to.as_str()] {
            if !found.iter().any(|(known, _)| *known == image) {
                found.push((image, a));
            }
        }
    }
    found
}
