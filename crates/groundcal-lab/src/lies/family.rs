//! A family: scenes that depart from what the program assumes in one way.

use crate::lies::{
    kind::{Kind, Medium},
    random::{Random, scene_seed},
    scene::Scene,
    studio::Studio,
};

/// A family of scenes.
#[derive(Clone, Copy)]
pub struct Family {
    /// Short name; those of pictures end in `_pictures`.
    pub name: &'static str,
    /// How it stands to what is assumed.
    pub kind: Kind,
    /// What the program is given.
    pub medium: Medium,
    /// What is the matter, in a sentence.
    pub what: &'static str,
    pub(crate) make: fn(&mut Studio) -> Scene,
}

impl Family {
    /// A family of point scenes.
    pub(crate) const fn points(
        name: &'static str,
        kind: Kind,
        what: &'static str,
        make: fn(&mut Studio) -> Scene,
    ) -> Self {
        Self { name, kind, medium: Medium::Points, what, make }
    }

    /// A family of rendered scenes.
    pub(crate) const fn pictures(
        name: &'static str,
        kind: Kind,
        what: &'static str,
        make: fn(&mut Studio) -> Scene,
    ) -> Self {
        Self { name, kind, medium: Medium::Pictures, what, make }
    }

    /// Scene number `index` of a run.
    pub(crate) fn scene(&self, seed: u64, index: usize) -> Scene {
        let random = Random::new(scene_seed(seed, self.name, index));
        (self.make)(&mut Studio { random, medium: self.medium })
    }
}
