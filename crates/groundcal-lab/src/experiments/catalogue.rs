//! All experiments by their names.

use crate::{
    error::LabError,
    experiments::{
        film, lens, mobile, pan_head,
        setup::{Description, ExperimentOptions, ExperimentOutput, Setup},
        subsets, tripod,
    },
    progress::{Progress, Silent},
};

/// One of the paper's experiments on a scene of ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    /// A tripod moved over the floor: 14 motions of varied roll.
    Tripod,
    /// A pan head that does not move: 13 pans, the elevation alone varied.
    PanHead,
    /// A pan head on a robot: three pictures, forward, three more.
    MobileHead,
    /// Two frames of a film from a crane that rises.
    Film,
    /// The tripod through a lens that bends, corrected first.
    Lens,
}

impl Experiment {
    /// All of them.
    pub const ALL: [Experiment; 5] =
        [Experiment::Tripod, Experiment::PanHead, Experiment::MobileHead, Experiment::Film, Experiment::Lens];

    fn description(self) -> Description {
        match self {
            Experiment::Tripod => tripod::DESCRIPTION,
            Experiment::PanHead => pan_head::DESCRIPTION,
            Experiment::MobileHead => mobile::DESCRIPTION,
            Experiment::Film => film::DESCRIPTION,
            Experiment::Lens => lens::DESCRIPTION,
        }
    }

    /// Its name in tables, messages and file names.
    pub fn name(self) -> &'static str {
        self.description().name
    }

    /// Names of the files that [`Experiment::run`] gives at most.
    ///
    /// # Errors
    /// [`LabError::Other`] where the scene is none.
    pub fn file_names(self, options: &ExperimentOptions) -> Result<Vec<String>, LabError> {
        let endings = match self {
            Experiment::Tripod | Experiment::PanHead => subsets::ENDINGS.as_slice(),
            Experiment::MobileHead => mobile::ENDINGS.as_slice(),
            Experiment::Film => film::ENDINGS.as_slice(),
            Experiment::Lens => &[],
        };
        Ok(Setup::new(&self.description(), options, &Silent)?.file_names(endings))
    }

    /// Renders the scene, calibrates from the pictures, and sums up.
    ///
    /// # Errors
    /// Whatever is not a method's refusal, which is a result: pictures that cannot be made, unusable input.
    pub fn run(self, options: &ExperimentOptions, progress: &dyn Progress) -> Result<ExperimentOutput, LabError> {
        let mut setup = Setup::new(&self.description(), options, progress)?;
        match self {
            Experiment::Tripod => tripod::run(&setup),
            Experiment::PanHead => pan_head::run(&setup),
            Experiment::MobileHead => mobile::run(&setup),
            Experiment::Film => film::run(&setup),
            Experiment::Lens => lens::run(&mut setup),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{experiments::setup::reduce, renderer::scene::Scene};

    #[test]
    fn the_scenes_are_valid_and_halves_of_them_too() {
        for experiment in Experiment::ALL.map(|e| e.description()) {
            let mut scene: Scene = toml::from_str(experiment.scene).unwrap();
            scene.validate().unwrap();
            let full = scene.clone();
            reduce(&mut scene);
            scene.validate().unwrap();
            // The same point of the floor is seen at the same place of the picture.
            let (_, view) = scene.views().next().unwrap();
            let yaw = view.yaw_deg.to_radians();
            let point = nalgebra::Vector3::new(view.centre_m[0] + yaw.cos(), view.centre_m[1] + yaw.sin(), 0.0);
            let at = |s: &Scene| s.pixel_from_world(0, &point).unwrap().unwrap().add_scalar(0.5);
            assert!((at(&full) - at(&scene) * 2.0).norm() < 1e-9);
        }
    }

    #[test]
    fn motions_keep_their_attitude_and_the_head_its_axis() {
        for (experiment, motions) in [(tripod::DESCRIPTION, 14), (pan_head::DESCRIPTION, 13)] {
            let scene: Scene = toml::from_str(experiment.scene).unwrap();
            assert_eq!((scene.groups.len(), scene.view_count()), (motions, 2 * motions));
            for group in &scene.groups {
                let [a, b] = [&group.views[0], &group.views[1]];
                assert!(a.centre_m[2] == b.centre_m[2] && (a.yaw_deg - b.yaw_deg).abs() > 10.0);
            }
        }
        let head: Scene = toml::from_str(pan_head::DESCRIPTION.scene).unwrap();
        for (_, view) in head.views() {
            let yaw = view.yaw_deg.to_radians();
            let [x, y, _] = view.centre_m;
            assert!((x - 0.2 * yaw.cos()).hypot(y - 0.2 * yaw.sin()) < 1e-4);
        }
    }
}
