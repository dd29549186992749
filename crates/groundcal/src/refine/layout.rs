//! Where each unknown of the joint refinement stands in its equations, and which tracks depend on the same ones.

use std::collections::BTreeMap;

use crate::geometry::frame::Frame;
use crate::refine::{
    model::{CAMERA, GROUP, SLOTS, SceneModel, VIEW},
    problem::Prior,
    tracks::Track,
};

/// Marks what has no column: held, or without effect.
pub(super) const HELD: usize = usize::MAX;

/// Where each unknown stands in the reduced equations.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Columns of the camera's numbers.
    pub camera: [usize; CAMERA],
    /// Columns of each group's.
    pub groups: Vec<[usize; GROUP]>,
    /// Columns of each view's.
    pub views: Vec<[usize; VIEW]>,
    /// Number of columns.
    pub size: usize,
}

impl Layout {
    /// Whether a column stands for something estimated.
    pub fn is_free(column: usize) -> bool {
        column != HELD
    }
}

/// Tracks that are seen in the same views.
#[derive(Debug, Clone)]
pub(super) struct Cluster {
    /// Views, ascending; the observations of its tracks have the same order.
    pub(super) views: Vec<usize>,
    pub(super) tracks: Vec<usize>,
    /// Columns of the reduced system that any of the observations depends on.
    pub(super) columns: Vec<usize>,
    /// For each observation and slot its place in `columns`.
    pub(super) place: Vec<[usize; SLOTS]>,
    /// The places of each observation, ascending.
    pub(super) occupied: Vec<Vec<usize>>,
}

/// What a [`super::problem::Problem`] is made of.
pub struct Ingredients<'a> {
    /// Floor or directions.
    pub scene: SceneModel,
    /// Frame of all coordinates.
    pub frame: &'a Frame,
    /// Points.
    pub tracks: &'a [Track],
    /// Group of each view.
    pub group_of_view: &'a [usize],
    /// Which of the camera's numbers are estimated; aspect held means that fy follows fx.
    pub free: [bool; CAMERA],
    /// Their priors.
    pub camera_priors: [Option<Prior>; CAMERA],
    /// p1 and p2, held.
    pub tangential: [f64; 2],
    /// Deviation of residuals beyond which they count less.
    pub huber: f64,
}

/// The component (set of views that tracks connect) of each view, numbered by first view.
pub fn components_of(views: usize, tracks: &[Track]) -> Vec<usize> {
    let mut label: Vec<usize> = (0..views).collect();
    fn find(label: &mut [usize], mut v: usize) -> usize {
        while label[v] != v {
            label[v] = label[label[v]];
            v = label[v];
        }
        v
    }
    for t in tracks {
        let root = find(&mut label, t.observations[0].view);
        for o in &t.observations[1..] {
            let other = find(&mut label, o.view);
            let (low, high) = (find(&mut label, root).min(other), find(&mut label, root).max(other));
            label[high] = low;
        }
    }
    (0..views).map(|v| find(&mut label, v)).collect()
}

/// Views of each component in breadth-first order, its groups after it, the camera last: neighbours stay near the diagonal.
pub(super) fn lay_out(i: &Ingredients<'_>, components: &[usize]) -> (Layout, Vec<usize>) {
    let count = i.group_of_view.len();
    let mut neighbours: Vec<std::collections::BTreeSet<usize>> = vec![Default::default(); count];
    for t in i.tracks {
        for pair in t.observations.windows(2) {
            neighbours[pair[0].view].insert(pair[1].view);
            neighbours[pair[1].view].insert(pair[0].view);
        }
    }
    let groups = i.group_of_view.iter().max().map_or(0, |g| g + 1);
    let mut layout = Layout {
        camera: [HELD; CAMERA],
        groups: vec![[HELD; GROUP]; groups],
        views: vec![[HELD; VIEW]; count],
        size: 0,
    };
    let mut next = 0;
    let mut take = |slot: &mut usize| {
        *slot = next;
        next += 1;
    };
    let floor = i.scene == SceneModel::Floor;
    let members = |g: usize| i.group_of_view.iter().filter(|&&h| h == g).count();
    let mut origins = Vec::new();
    let mut placed_views = vec![false; count];
    let mut placed_groups = vec![false; groups];
    for root in 0..count {
        if components[root] != root || neighbours[root].is_empty() {
            continue;
        }
        origins.push(root);
        let mut queue = std::collections::VecDeque::from([root]);
        placed_views[root] = true;
        let mut order = Vec::new();
        while let Some(v) = queue.pop_front() {
            order.push(v);
            for &n in &neighbours[v] {
                if !placed_views[n] {
                    placed_views[n] = true;
                    queue.push_back(n);
                }
            }
        }
        // Directions have no up of their own: unless two views share an attitude, any rotation of the world will do.
        let has_axis = floor || order.iter().any(|&v| members(i.group_of_view[v]) > 1);
        for &v in &order {
            let columns = &mut layout.views[v];
            if members(i.group_of_view[v]) > 1 || floor {
                take(&mut columns[0]);
                take(&mut columns[1]);
            }
            if v != root {
                take(&mut columns[2]);
                if floor {
                    take(&mut columns[3]);
                    take(&mut columns[4]);
                    take(&mut columns[5]);
                }
            }
        }
        for &v in &order {
            let g = i.group_of_view[v];
            if std::mem::replace(&mut placed_groups[g], true) {
                continue;
            }
            let held = v == root && !has_axis;
            if !held {
                take(&mut layout.groups[g][0]);
                take(&mut layout.groups[g][1]);
            }
            if floor {
                take(&mut layout.groups[g][2]);
            }
        }
    }
    for (k, free) in i.free.iter().enumerate() {
        if *free {
            take(&mut layout.camera[k]);
        }
    }
    layout.size = next;
    (layout, origins)
}

pub(super) fn cluster(i: &Ingredients<'_>, layout: &Layout, origins: &[usize]) -> Vec<Cluster> {
    let mut by_views: BTreeMap<Vec<usize>, Vec<usize>> = BTreeMap::new();
    for (t, track) in i.tracks.iter().enumerate() {
        by_views.entry(track.observations.iter().map(|o| o.view).collect()).or_default().push(t);
    }
    by_views
        .into_iter()
        .map(|(views, tracks)| {
            let slots: Vec<[usize; SLOTS]> = views
                .iter()
                .map(|&v| {
                    let mut slots = [HELD; SLOTS];
                    slots[..CAMERA].copy_from_slice(&layout.camera);
                    slots[CAMERA..CAMERA + GROUP].copy_from_slice(&layout.groups[i.group_of_view[v]]);
                    slots[CAMERA + GROUP..].copy_from_slice(&layout.views[v]);
                    if origins.contains(&v) {
                        // Its height is 1 whatever that of its group.
                        slots[CAMERA + 2] = HELD;
                    }
                    slots
                })
                .collect();
            let columns: Vec<usize> = slots
                .iter()
                .flatten()
                .copied()
                .filter(|c| *c != HELD)
                .collect::<std::collections::BTreeSet<_>>()
                .into_iter()
                .collect();
            let place: Vec<[usize; SLOTS]> = slots
                .iter()
                .map(|s| s.map(|c| if c == HELD { HELD } else { columns.partition_point(|d| *d < c) }))
                .collect();
            let sorted = |s: &[usize; SLOTS]| {
                let mut places: Vec<usize> = s.iter().copied().filter(|p| *p != HELD).collect();
                places.sort_unstable();
                places
            };
            let occupied = place.iter().map(sorted).collect();
            Cluster { views, tracks, columns, place, occupied }
        })
        .collect()
}
