//! Ordinary sets of pictures, from which the families depart: cameras people have, floors, and ways of taking pictures.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::lies::{
    kind::Medium,
    optics::{Bending, Optics},
    pose::{Pose, looking, looking_at},
    random::Random,
    scene::{Matching, NoiseKind, Scene, View},
    surface::{Region, Shape, Surface},
    texture::Texture,
};

/// Draws ordinary things.
pub(crate) struct Studio {
    pub(crate) random: Random,
    pub(crate) medium: Medium,
}

/// Pitch below the horizontal and roll, radians.
pub(crate) type Tilt = (f64, f64);

/// Distance between floors that no picture sees both of, metres.
const ELSEWHERE_M: f64 = 60.0;

impl Studio {
    /// Width and height: small where pictures have to be made.
    pub(crate) fn size(&mut self) -> [usize; 2] {
        match self.medium {
            Medium::Points => self.random.one_of(&[[640, 480], [640, 480], [1280, 720], [1280, 960], [1920, 1080]]),
            Medium::Pictures => self.random.one_of(&[[400, 300], [480, 360], [512, 384], [640, 480]]),
        }
    }

    /// Angle of view of an ordinary lens, square pixels but for a thousandth, axis near the middle, a little barrel distortion.
    pub(crate) fn optics(&mut self, size: [usize; 2]) -> Optics {
        let r = &mut self.random;
        let width = size[0] as f64;
        let fx = width * r.log_uniform(0.7, 1.4);
        let aspect = 1.0 + r.normal(0.001);
        let (cx, cy) =
            ((width - 1.0) / 2.0 + r.normal(0.02 * width), (size[1] as f64 - 1.0) / 2.0 + r.normal(0.02 * width));
        let k1 = r.uniform(-0.12, 0.03);
        Optics { fx, fy: fx * aspect, cx, cy, skew: 0.0, bending: Bending::radial(k1, -0.1 * k1 * r.uniform(0.0, 2.0)) }
    }

    /// A texture that does not repeat itself.
    pub(crate) fn texture(&mut self) -> Texture {
        let seed = self.random.seed();
        if self.random.chance(0.25) {
            let pitch_m = self.random.uniform(0.15, 0.5);
            return Texture::Tiles { seed, pitch_m, individual: self.random.uniform(0.5, 1.0) };
        }
        let coarsest_m = self.random.uniform(0.15, 0.5);
        Texture::Speckled { seed, coarsest_m, contrast: self.random.uniform(0.3, 0.6) }
    }

    fn matching(&mut self) -> Matching {
        let r = &mut self.random;
        Matching {
            sigma_px: r.log_uniform(0.12, 0.5),
            kind: NoiseKind::Normal,
            points: r.between(60, 220),
            repeatability: r.uniform(0.6, 0.9),
            outliers: r.uniform(0.0, 0.15),
            conspiracy: 0.0,
            window: [0.0, 0.0, 1.0, 1.0],
            blurred: Vec::new(),
            most: 400,
            wrong_sigmas: None,
        }
    }

    /// A scene of these views by one camera.
    pub(crate) fn scene(&mut self, size: [usize; 2], optics: Optics, poses: &[Pose]) -> Scene {
        Scene {
            size,
            views: poses.iter().map(|p| View::new(optics, *p)).collect(),
            surfaces: vec![Surface::floor(self.texture())],
            bumper: None,
            matching: self.matching(),
            aliases: Vec::new(),
            named: None,
            truths: vec![optics.numbers()],
            seed: self.random.seed(),
        }
    }

    /// Attitudes that differ by 12 degrees or more, well below the horizontal.
    pub(crate) fn tilts(&mut self, count: usize) -> Vec<Tilt> {
        let mut all: Vec<Tilt> = Vec::new();
        let mut tries = 0;
        while all.len() < count {
            let next = (self.random.uniform(32.0, 68.0), self.random.either_sign(0.0, 32.0));
            let apart = |t: &Tilt| (t.0 - next.0).hypot(t.1 - next.1);
            tries += 1;
            if all.iter().all(|t| apart(t) > 12.0) || tries > 200 {
                all.push(next);
            }
        }
        all.into_iter().map(|(p, r)| (p.to_radians(), r.to_radians())).collect()
    }

    /// A turn between pictures that keeps most of the floor in view, radians.
    pub(crate) fn turn(&mut self) -> f64 {
        self.random.either_sign(14.0, 34.0).to_radians()
    }

    /// A tripod or a trolley: for each attitude, pictures turned and moved over the floor at constant height. On one piece of floor
    /// or each attitude elsewhere.
    pub(crate) fn tripod_poses(&mut self, tilts: &[Tilt], each: usize, together: bool) -> Vec<Pose> {
        let common_heading = self.random.uniform(0.0, std::f64::consts::TAU);
        let height = self.random.uniform(0.9, 1.6);
        let mut poses = Vec::new();
        for (group, &(pitch, roll)) in tilts.iter().enumerate() {
            let start = if together {
                Vector3::new(self.random.normal(0.1), self.random.normal(0.1), height)
            } else {
                Vector3::new(ELSEWHERE_M * (group + 1) as f64, self.random.normal(5.0), height)
            };
            let heading = if together {
                common_heading + self.random.normal(0.15)
            } else {
                self.random.uniform(0.0, std::f64::consts::TAU)
            };
            let turn = self.turn();
            for k in 0..each {
                let way = self.random.level_direction() * self.random.uniform(0.0, 0.22) * height;
                let centre = start + if k == 0 { Vector3::zeros() } else { way };
                poses.push(Pose::new(looking(heading + turn * k as f64, pitch, roll), centre));
            }
        }
        poses
    }

    /// A good set: so many attitudes, two or more pictures of each.
    pub(crate) fn tripod(&mut self, attitudes: usize, each: usize) -> Scene {
        let together = self.random.chance(0.5);
        self.tripod_on(attitudes, each, together)
    }

    /// The same with the attitudes on one piece of floor, or each elsewhere.
    pub(crate) fn tripod_on(&mut self, attitudes: usize, each: usize, together: bool) -> Scene {
        let size = self.size();
        let optics = self.optics(size);
        let tilts = self.tilts(attitudes);
        let poses = self.tripod_poses(&tilts, each, together);
        self.scene(size, optics, &poses)
    }

    /// Four to six attitudes from points, three or four in pictures (each costs seconds).
    pub(crate) fn good_set(&mut self) -> Scene {
        let attitudes = match self.medium {
            Medium::Points => self.random.between(4, 6),
            Medium::Pictures => self.random.between(3, 4),
        };
        self.tripod(attitudes, 2)
    }

    /// One attitude: a robot that drives and turns, so many pictures.
    pub(crate) fn one_attitude(&mut self, views: usize) -> Scene {
        let size = self.size();
        let optics = self.optics(size);
        let tilts = self.tilts(1);
        let poses = self.robot_poses(tilts[0], views);
        self.scene(size, optics, &poses)
    }

    /// A robot's way: each picture a little turned and further on.
    pub(crate) fn robot_poses(&mut self, (pitch, roll): Tilt, views: usize) -> Vec<Pose> {
        let height = self.random.uniform(0.6, 1.4);
        let mut heading = self.random.uniform(0.0, std::f64::consts::TAU);
        let mut centre = Vector3::new(0.0, 0.0, height);
        let mut poses = Vec::new();
        for _ in 0..views {
            poses.push(Pose::new(looking(heading, pitch, roll), centre));
            heading += self.random.uniform(-0.1, 0.45);
            centre += Vector3::new(heading.cos(), heading.sin(), 0.0) * self.random.uniform(0.05, 0.25) * height;
        }
        poses
    }

    /// Pictures from the hand: around a point of the floor, tilted by so many degrees from straight down.
    pub(crate) fn hand_held_poses(&mut self, views: usize, tilts_deg: [f64; 2]) -> Vec<Pose> {
        let distance = self.random.uniform(0.7, 1.8);
        let from = self.random.uniform(0.0, std::f64::consts::TAU);
        let sector = self.random.uniform(0.6, 2.2);
        (0..views)
            .map(|_| {
                let r = &mut self.random;
                let (azimuth, tilt) =
                    (from + sector * r.uniform(-0.5, 0.5), r.uniform(tilts_deg[0], tilts_deg[1]).to_radians());
                let away = distance * r.uniform(0.8, 1.25);
                let at = Vector3::new(r.normal(0.08), r.normal(0.08), 0.0) * distance;
                let side = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt.sin();
                let centre = at + (side + Vector3::z() * tilt.cos()) * away;
                let roll = r.normal(0.15);
                Pose::new(looking_at(&centre, &at, roll), centre)
            })
            .collect()
    }

    /// Pictures from the hand by an ordinary camera.
    pub(crate) fn hand_held(&mut self, views: usize, tilts_deg: [f64; 2]) -> Scene {
        let size = self.size();
        let optics = self.optics(size);
        let poses = self.hand_held_poses(views, tilts_deg);
        self.scene(size, optics, &poses)
    }

    /// On the spot, one picture for each heading and pitch (degrees), levelled; the lens `ahead_m` before the axes.
    pub(crate) fn head_poses(
        &mut self,
        headings_deg: &[f64],
        pitches_deg: &[f64],
        height: f64,
        ahead_m: f64,
    ) -> Vec<Pose> {
        let start = self.random.uniform(0.0, 360.0);
        let mut poses = Vec::new();
        for &pitch in pitches_deg {
            for &heading in headings_deg {
                let rotation = looking((start + heading).to_radians(), pitch.to_radians(), 0.0);
                let centre = Vector3::new(0.0, 0.0, height) + rotation.column(2) * ahead_m;
                poses.push(Pose::new(rotation, centre));
            }
        }
        poses
    }

    /// Things far away, all around, nearer on one side than on the other (a sphere about a lens's axis of rotation would look the same
    /// to a lens off that axis, but for f).
    pub(crate) fn far_away(&mut self, radius_m: f64) -> Surface {
        let texture = Texture::far(self.random.seed(), radius_m * 0.15);
        let aside = self.random.level_direction() * self.random.uniform(0.2, 0.45) * radius_m;
        Surface::fixed(Shape::Sphere { radius_m }, texture, Pose::new(Matrix3::identity(), aside))
    }

    /// A board that lies or stands in the scene.
    pub(crate) fn board(&mut self, half_m: [f64; 2], pose: Pose) -> Surface {
        let texture = self.texture();
        Surface::fixed(Shape::Plane { region: Region::Rectangle(half_m) }, texture, pose)
    }

    /// About where the floor is that a camera looks at.
    pub(crate) fn looked_at(pose: &Pose) -> Vector3<f64> {
        let forward: Vector3<f64> = pose.rotation.column(2).into_owned();
        let down = (-forward.z).max(0.2);
        let p = pose.centre + forward * (pose.centre.z / down);
        Vector3::new(p.x, p.y, 0.0)
    }

    /// Lattice shifts for pairs of a periodic floor: about this fraction of all pairs, each its own shift.
    pub(crate) fn confuse(&mut self, scene: &mut Scene, pitch_m: f64, fraction: f64) {
        for from in 0..scene.views.len() {
            for to in from + 1..scene.views.len() {
                if self.random.chance(fraction) {
                    let step = |r: &mut Random| (r.between(0, 2) as f64 - 1.0) * pitch_m;
                    let mut shift = Vector2::new(step(&mut self.random), step(&mut self.random));
                    if shift.norm() == 0.0 {
                        shift.x = pitch_m;
                    }
                    // The shift is beside what the picture looks at, so that a quarter turn keeps the floor in view.
                    let quarter_turns = if self.random.chance(0.15) { 1 } else { 0 };
                    if quarter_turns > 0 {
                        shift += Self::looked_at(&scene.views[to].pose).xy();
                    }
                    scene.aliases.push(crate::lies::scene::Alias { pair: (from, to), shift, quarter_turns });
                }
            }
        }
    }

    /// A frame whose z axis is a given direction.
    pub(crate) fn facing(normal: &Vector3<f64>) -> Matrix3<f64> {
        let helper = if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
        let z = normal.normalize();
        let x = helper.cross(&z).normalize();
        Matrix3::from_columns(&[x, z.cross(&x), z])
    }
}
