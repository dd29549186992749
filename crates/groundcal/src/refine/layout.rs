//! Where each unknown of the joint refinement stands in its equations, and which tracks depend on the same ones.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    numerics::graph::{breadth_first, components},
    refine::{
        blocks::{
            CameraUnknowns, DepartureKind, FRAME, FRAME_HEIGHT, FRAME_POSE, GROUP, GROUP_HEIGHT, RIG_POSE, State,
        },
        residual::SceneModel,
        tracks::Track,
    },
};

/// Where the numbers of a block stand: those that are estimated have columns one after the other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Block {
    /// How many they are.
    pub size: usize,
    columns: Vec<Option<usize>>,
}

impl Block {
    /// A block of which nothing is estimated.
    fn held(numbers: usize) -> Self {
        Self { size: 0, columns: vec![None; numbers] }
    }

    /// A block from a column on, which it moves on.
    fn at(next: &mut usize, free: impl IntoIterator<Item = bool>) -> Self {
        let first = *next;
        let columns = free
            .into_iter()
            .map(|free| {
                *next += usize::from(free);
                free.then(|| *next - 1)
            })
            .collect();
        Self { size: *next - first, columns }
    }

    /// The column of a number; `None`: held, or without effect.
    pub(crate) fn column(&self, number: usize) -> Option<usize> {
        self.columns.get(number).copied().flatten()
    }

    /// The columns of all numbers in their order.
    pub(crate) fn columns(&self) -> &[Option<usize>] {
        &self.columns
    }

    /// (number, column) of those that are estimated.
    pub(crate) fn free(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.columns.iter().enumerate().filter_map(|(number, column)| Some((number, (*column)?)))
    }
}

/// The blocks of the reduced equations.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// Cameras.
    pub cameras: Vec<Block>,
    /// Their poses in the rig.
    pub rig: Vec<Block>,
    /// Attitude groups.
    pub groups: Vec<Block>,
    /// Frames.
    pub frames: Vec<Block>,
    /// Number of columns.
    pub size: usize,
    /// The component (set of frames that tracks connect) of each frame, named by its first.
    pub component_of_frame: Vec<usize>,
    /// First frames of the components: there the world's axes begin.
    pub origins: Vec<usize>,
    /// Those of them whose height is the unit of length. A rig with a baseline carries its unit from one component to the next.
    pub units: Vec<usize>,
}

impl Layout {
    /// The first column of what all components have in common; the number of columns where that is nothing.
    pub(crate) fn first_of_cameras(&self) -> usize {
        self.rig.iter().chain(&self.cameras).flat_map(Block::free).map(|(_, column)| column).min().unwrap_or(self.size)
    }
}

/// What a problem is made of.
pub(crate) struct ProblemInputs<'a> {
    /// Floor or directions.
    pub scene: SceneModel,
    /// Points.
    pub tracks: &'a [Track],
    /// A state: what cameras, groups and frames there are.
    pub state: &'a State,
    /// What of the cameras is estimated.
    pub cameras: &'a [CameraUnknowns],
    /// Frames whose attitude errors are outliers.
    pub outlier_frames: &'a [usize],
    /// What of the frames' departures is estimated.
    pub departures: &'a [DepartureKind],
    /// Standard deviation of residuals beyond which they count less.
    pub huber: f64,
}

/// The component (set of frames that tracks connect) of each frame, named by its first.
pub(crate) fn components_of(frames: usize, tracks: &[Track]) -> Vec<usize> {
    components(frames, tracks.iter().flat_map(|t| t.observations.windows(2).map(|w| (w[0].frame, w[1].frame))))
}

/// Frames of each component in breadth-first order, their groups after them, rig and cameras last: neighbours stay near the diagonal.
pub(crate) fn build_layout(i: &ProblemInputs<'_>) -> Layout {
    let group_of: Vec<usize> = i.state.frames.iter().map(|f| f.group).collect();
    let count = group_of.len();
    let component_of_frame = components_of(count, i.tracks);
    let mut neighbours: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); count];
    let mut seen_by: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); count];
    for t in i.tracks {
        for pair in t.observations.windows(2) {
            neighbours[pair[0].frame].insert(pair[1].frame);
            neighbours[pair[1].frame].insert(pair[0].frame);
        }
        for o in &t.observations {
            seen_by[component_of_frame[o.frame]].insert(o.camera);
        }
    }
    let floor = i.scene == SceneModel::Floor;
    let mut members = vec![0usize; i.state.groups.len()];
    group_of.iter().for_each(|&g| members[g] += 1);
    let shared = |frame: usize| members[group_of[frame]] > 1;
    let has_baseline = i.cameras.iter().skip(1).any(|c| c.rig_free[3..].contains(&true));
    let mut layout = Layout {
        cameras: Vec::new(),
        rig: Vec::new(),
        groups: vec![Block::held(GROUP); members.len()],
        frames: vec![Block::held(FRAME); count],
        size: 0,
        component_of_frame,
        origins: Vec::new(),
        units: Vec::new(),
    };
    let mut placed = vec![false; members.len()];
    let mut unit_carried = false;
    for (root, cameras) in seen_by.iter().enumerate() {
        if layout.component_of_frame[root] != root || cameras.is_empty() {
            continue;
        }
        layout.origins.push(root);
        let by_rig = has_baseline && cameras.len() > 1;
        let is_unit = !(by_rig && std::mem::replace(&mut unit_carried, true));
        if is_unit {
            layout.units.push(root);
        }
        let order = breadth_first(&neighbours, root);
        // Directions have no up of their own: unless two frames share an attitude, any rotation of the world will do.
        let has_axis = floor || order.iter().any(|&v| shared(v));
        for &v in &order {
            let (has_error, moves) = (shared(v), v != root);
            // What has a group of its own has no height over that of the group.
            let height = floor && has_error && (moves || !is_unit);
            let mut free = [false; FRAME];
            free[..FRAME_POSE].copy_from_slice(&[has_error, has_error, moves, floor && moves, floor && moves, height]);
            i.departures.iter().for_each(|d| free[d.numbers()].fill(true));
            layout.frames[v] = Block::at(&mut layout.size, free);
        }
        for &v in &order {
            if std::mem::replace(&mut placed[group_of[v]], true) {
                continue;
            }
            let turns = v != root || has_axis;
            let height = floor && (shared(v) || v != root || !is_unit);
            layout.groups[group_of[v]] = Block::at(&mut layout.size, [turns, turns, height]);
        }
    }
    for (k, (camera, unknowns)) in i.state.cameras.iter().zip(i.cameras).enumerate() {
        let rig_free: [bool; RIG_POSE] = std::array::from_fn(|n| k > 0 && unknowns.rig_free[n] && (n < 3 || floor));
        layout.rig.push(Block::at(&mut layout.size, rig_free));
        layout.cameras.push(Block::at(&mut layout.size, (0..camera.count()).map(|n| unknowns.is_free(n))));
    }
    layout
}

/// (number in its block, place among a cluster's columns) of what is estimated.
pub(crate) type Places = Vec<(usize, usize)>;

/// Where the derivatives of an observation go.
#[derive(Debug, Clone)]
pub(crate) struct ObservationPlaces {
    pub(crate) camera: Places,
    pub(crate) rig: Places,
    pub(crate) group: Places,
    pub(crate) frame: Places,
    /// Of the frame's numbers those from [`FRAME_POSE`] on, counted from there.
    pub(crate) departures: Places,
    /// All places, ascending.
    pub(crate) occupied: Vec<usize>,
}

/// Tracks that are seen in the same images.
#[derive(Debug, Clone)]
pub(crate) struct Cluster {
    /// (frame, camera), ascending; the observations of its tracks have the same order.
    pub(crate) images: Vec<(usize, usize)>,
    pub(crate) tracks: Vec<usize>,
    /// Columns of the reduced system that any of the observations depends on, ascending.
    pub(crate) columns: Vec<usize>,
    /// One an observation.
    pub(crate) places: Vec<ObservationPlaces>,
}

pub(crate) fn cluster_tracks(i: &ProblemInputs<'_>, layout: &Layout) -> Vec<Cluster> {
    let mut by_images: BTreeMap<Vec<(usize, usize)>, Vec<usize>> = BTreeMap::new();
    for (t, track) in i.tracks.iter().enumerate() {
        by_images.entry(track.observations.iter().map(|o| (o.frame, o.camera)).collect()).or_default().push(t);
    }
    // (number, column) by block of an image.
    let free_of = |&(frame, camera): &(usize, usize)| -> [Places; 5] {
        let group = &layout.groups[i.state.frames[frame].group];
        // The unit of length is 1 whatever the height of its group.
        let is_unit = layout.units.contains(&frame);
        let of_group = group.free().filter(|(number, _)| !(is_unit && *number == GROUP_HEIGHT));
        [
            layout.cameras[camera].free().collect(),
            layout.rig[camera].free().collect(),
            of_group.collect(),
            layout.frames[frame].free().filter(|(number, _)| *number < FRAME_POSE).collect(),
            layout.frames[frame].free().filter_map(|(number, c)| Some((number.checked_sub(FRAME_POSE)?, c))).collect(),
        ]
    };
    by_images
        .into_iter()
        .map(|(images, tracks)| {
            let free: Vec<[Places; 5]> = images.iter().map(free_of).collect();
            let all: BTreeSet<usize> = free.iter().flatten().flatten().map(|(_, column)| *column).collect();
            let columns: Vec<usize> = all.into_iter().collect();
            let place = |column: usize| columns.partition_point(|c| *c < column);
            let places = free
                .into_iter()
                .map(|blocks| {
                    let [camera, rig, group, frame, departures] =
                        blocks.map(|b| b.into_iter().map(|(number, c)| (number, place(c))).collect::<Places>());
                    let mut occupied: Vec<usize> = [&camera, &rig, &group, &frame, &departures]
                        .into_iter()
                        .flatten()
                        .map(|(_, place)| *place)
                        .collect();
                    occupied.sort_unstable();
                    ObservationPlaces { camera, rig, group, frame, departures, occupied }
                })
                .collect();
            Cluster { images, tracks, columns, places }
        })
        .collect()
}

impl Layout {
    /// The column of the height error of a frame.
    pub(crate) fn height_column(&self, frame: usize) -> Option<usize> {
        self.frames[frame].column(FRAME_HEIGHT)
    }
}
