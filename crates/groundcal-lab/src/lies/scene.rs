//! A scene: cameras, surfaces, and how matches between the pictures come about.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::lies::{
    optics::Optics,
    pose::{Pose, by},
    random::Random,
    surface::{Hit, Surface},
};

/// How a camera moves while one picture is read out, row by row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sweep {
    /// Axis times angle of the turn in the world from the first row to the last.
    pub(crate) turn_rad: Vector3<f64>,
    /// Way from the first row to the last, metres.
    pub(crate) way_m: Vector3<f64>,
}

/// What happened to a picture after it was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flip {
    Not,
    /// Left and right exchanged.
    Mirrored,
    /// Turned by 180 degrees.
    UpsideDown,
}

/// A picture.
#[derive(Debug, Clone)]
pub(crate) struct View {
    pub(crate) optics: Optics,
    pub(crate) pose: Pose,
    pub(crate) sweep: Option<Sweep>,
    pub(crate) flip: Flip,
    /// The same file as an earlier view's under another name.
    pub(crate) copy_of: Option<usize>,
}

impl View {
    pub(crate) fn new(optics: Optics, pose: Pose) -> Self {
        Self { optics, pose, sweep: None, flip: Flip::Not, copy_of: None }
    }

    /// Pose while a row is read, as a fraction -0.5..0.5 of the picture.
    fn pose_at(&self, row: f64) -> Pose {
        match &self.sweep {
            None => self.pose,
            Some(s) => Pose::new(by(&(s.turn_rad * row)) * self.pose.rotation, self.pose.centre + s.way_m * row),
        }
    }

    fn flipped(&self, pixel: &Vector2<f64>, [width, height]: [usize; 2]) -> Vector2<f64> {
        let (w, h) = (width as f64 - 1.0, height as f64 - 1.0);
        match self.flip {
            Flip::Not => *pixel,
            Flip::Mirrored => Vector2::new(w - pixel.x, pixel.y),
            Flip::UpsideDown => Vector2::new(w - pixel.x, h - pixel.y),
        }
    }

    /// Origin and unit direction in the world of the ray seen at a pixel.
    pub(crate) fn ray(&self, pixel: &Vector2<f64>, size: [usize; 2]) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let sensor = self.flipped(pixel, size);
        let pose = self.pose_at(sensor.y / size[1] as f64 - 0.5);
        Some((pose.centre, pose.rotation * self.optics.ray_of(&sensor)?))
    }

    /// Where a point of the world is seen, in the picture or not.
    pub(crate) fn pixel(&self, point: &Vector3<f64>, size: [usize; 2]) -> Option<Vector2<f64>> {
        let mut seen = self.optics.pixel_of(&self.pose.inward(point))?;
        if self.sweep.is_some() {
            for _ in 0..5 {
                let row = (seen.y / size[1] as f64).clamp(-0.5, 1.5) - 0.5;
                seen = self.optics.pixel_of(&self.pose_at(row).inward(point))?;
            }
        }
        Some(self.flipped(&seen, size))
    }
}

/// How the noise of points is distributed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NoiseKind {
    Normal,
    /// Student's t with three degrees of freedom.
    HeavyTailed,
    /// Half of it smooth over the picture, another in each (features pulled by perspective, blur or the lens).
    Correlated,
    /// Rounded to multiples of this many pixels.
    Quantised(f64),
}

/// How matches come about.
#[derive(Debug, Clone)]
pub(crate) struct Matching {
    /// Standard deviation of each coordinate in pixels.
    pub(crate) sigma_px: f64,
    pub(crate) kind: NoiseKind,
    /// About so many points are found in a picture.
    pub(crate) points: usize,
    /// Probability that a point is found again in another picture.
    pub(crate) repeatability: f64,
    /// Fraction of the matches that are wrong.
    pub(crate) outliers: f64,
    /// Of the wrong ones, the fraction that agree with each other (a shadow, a thing that was carried on).
    pub(crate) conspiracy: f64,
    /// Only this part of the picture has points: left, top, right, bottom as fractions.
    pub(crate) window: [f64; 4],
    /// Pairs whose noise is so many times that of the others.
    pub(crate) blurred: Vec<(usize, usize, f64)>,
    /// At most so many matches are kept of a pair.
    pub(crate) most: usize,
    /// Whether each match comes with a deviation that is wrong by a factor of up to this.
    pub(crate) wrong_sigmas: Option<f64>,
}

/// A pair of pictures of a periodic floor whose matches are one or more periods beside the truth.
#[derive(Debug, Clone)]
pub(crate) struct Alias {
    pub(crate) pair: (usize, usize),
    /// On the floor, metres.
    pub(crate) shift: Vector2<f64>,
    /// Quarter turns about the point below the shift (square patterns allow them).
    pub(crate) quarter_turns: usize,
}

impl Alias {
    /// The floor's point that a point of the first picture is taken for in the second.
    pub(crate) fn mistaken(&self, point: &Vector3<f64>, pitch_m: f64) -> Vector3<f64> {
        // About a lattice point, so that the pattern falls on itself.
        let about = self.shift.map(|s| (s / pitch_m).round() * pitch_m);
        let mut d = point.xy() - about;
        for _ in 0..self.quarter_turns {
            d = Vector2::new(-d.y, d.x);
        }
        let moved = if self.quarter_turns == 0 { point.xy() + self.shift } else { about + d };
        Vector3::new(moved.x, moved.y, point.z)
    }
}

/// Everything about a set of pictures.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) size: [usize; 2],
    pub(crate) views: Vec<View>,
    pub(crate) surfaces: Vec<Surface>,
    /// Below this row (fraction of the height) the carrier is seen, the same in all pictures.
    pub(crate) bumper: Option<f64>,
    pub(crate) matching: Matching,
    pub(crate) aliases: Vec<Alias>,
    /// Pairs that the user names.
    pub(crate) named: Option<Vec<(usize, usize)>>,
    /// Cameras any of which is a right answer.
    pub(crate) truths: Vec<[f64; 4]>,
    /// Seed of textures' and matches' streams.
    pub(crate) seed: u64,
}

/// A point found by a ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayHit {
    pub(crate) surface: usize,
    pub(crate) hit: Hit,
}

impl Scene {
    /// The first surface on a ray of a view.
    pub(crate) fn cast(&self, view: usize, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<RayHit> {
        let hits = self.surfaces.iter().enumerate();
        hits.filter_map(|(surface, s)| Some(RayHit { surface, hit: s.hit(view, origin, direction)? }))
            .min_by(|a, b| a.hit.distance.total_cmp(&b.hit.distance))
    }

    /// Whether a pixel lies in the picture.
    pub(crate) fn inside(&self, p: &Vector2<f64>) -> bool {
        p.x > -0.5 && p.y > -0.5 && p.x < self.size[0] as f64 - 0.5 && p.y < self.size[1] as f64 - 0.5
    }

    /// Whether a pixel shows the carrier.
    pub(crate) fn on_bumper(&self, p: &Vector2<f64>) -> bool {
        self.bumper.is_some_and(|row| p.y > row * self.size[1] as f64)
    }

    /// Names of the pictures.
    pub(crate) fn names(&self) -> Vec<String> {
        (0..self.views.len()).map(|i| format!("{i:02}")).collect()
    }

    /// Turns a view about a level axis through its centre: the camera tilted a little.
    pub(crate) fn tilt(&mut self, view: usize, degrees: f64, random: &mut Random) {
        let axis = random.level_direction();
        let v = &mut self.views[view];
        v.pose = v.pose.turned(&axis, degrees.to_radians());
    }

    /// Every camera of the scene under a common rotation of the world about the origin (the floor stays).
    pub(crate) fn rotate_cameras(&mut self, rotation: &Matrix3<f64>) {
        for v in &mut self.views {
            v.pose.rotation = rotation * v.pose.rotation;
        }
    }

    /// The same camera for all views, and the truth with it.
    pub(crate) fn set_optics(&mut self, optics: Optics) {
        self.views.iter_mut().for_each(|v| v.optics = optics);
        self.truths = vec![optics.numbers()];
    }

    /// All cameras that occur, as they are after what was done to the pictures, become right answers.
    pub(crate) fn any_camera_is_right(&mut self) {
        let (w, h) = (self.size[0] as f64 - 1.0, self.size[1] as f64 - 1.0);
        self.truths.clear();
        for v in &self.views {
            let [fx, fy, cx, cy] = v.optics.numbers();
            let numbers = match v.flip {
                Flip::Not => [fx, fy, cx, cy],
                Flip::Mirrored => [fx, fy, w - cx, cy],
                Flip::UpsideDown => [fx, fy, w - cx, h - cy],
            };
            if !self.truths.contains(&numbers) {
                self.truths.push(numbers);
            }
        }
    }

    /// Views in another order. Call before anything refers to views by number.
    pub(crate) fn reorder(&mut self, order: &[usize]) {
        self.views = order.iter().map(|&i| self.views[i].clone()).collect();
        for s in self.surfaces.iter_mut().filter(|s| s.placements.len() > 1) {
            s.placements = order.iter().map(|&i| *s.placement(i)).collect();
        }
        let place = |i: usize| order.iter().position(|&o| o == i).unwrap_or(i);
        for v in &mut self.views {
            v.copy_of = v.copy_of.map(place);
        }
        self.aliases.iter_mut().for_each(|a| a.pair = (place(a.pair.0), place(a.pair.1)));
        if let Some(named) = &mut self.named {
            named.iter_mut().for_each(|p| *p = (place(p.0), place(p.1)));
        }
    }
}
