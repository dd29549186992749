//! The fourth experiment: two frames of a film from a crane; focal length alone, and the floor rectified with it, on which
//! parallel paths have to be parallel.

use std::fmt::Write;

use groundcal::{
    Error,
    floor::{FloorGrid, FloorView},
    geometry::{ImageSize, View},
    result::Calibration,
    start::Constraint,
    vision::{GrayImage, Pyramid, Raster, resample},
};
use nalgebra::{Vector2, Vector3};

use crate::{
    error::LabError,
    experiments::{
        arch::{self, axis_ratio},
        methods,
        paths::{EdgeLine, edge_line, furthest_from_square_deg, largest_angle_deg},
        setup::{Description, ExperimentOutput, OutputFile, Setup, accept, motions},
    },
    render_scene::{Rendered, encode},
    renderer::{render::RgbImage8, scene::FloorBox},
};

/// The experiment.
pub(crate) const DESCRIPTION: Description =
    Description { name: "film", scene: include_str!("../../scenes/film.toml"), paper: "focal length 4.5 % off" };
const PAIRS: [(usize, usize); 1] = [(0, 1)];
/// Ending of the picture of the floor.
pub(crate) const ENDINGS: [&str; 1] = ["_floor.png"];
/// How far the floor is rectified, in heights of the camera, and the side of its pixels at full size.
const RANGE_HEIGHTS: f64 = 4.5;
const UNIT_PER_PX: f64 = 0.006;
/// Boxes up to this height lie on the floor: paths, from this length on those that are parallel; down to that one the one across them;
/// shorter ones are pieces of the arch.
const PATH_HEIGHT_M: f64 = 0.01;
const PARALLEL_FROM_M: f64 = 10.0;
const ACROSS_FROM_M: f64 = 1.0;
/// Spacing of the places along an edge that are looked at.
const EDGE_STEP_M: f64 = 0.05;
/// Border of the picture in which no edge is measured.
const BORDER_PX: f64 = 8.0;

/// Renders, calibrates, rectifies and sums up.
pub(crate) fn run(setup: &Setup) -> Result<ExperimentOutput, LabError> {
    let pictures = setup.pictures(&PAIRS, 2)?;
    let options = setup.options(Constraint::Focal, false);
    let measured = methods::measure(&pictures.matched, setup.frame(false), &options)?;
    let lines = setup.lines(&pictures, &[Constraint::Focal])?;
    let (csv, table) = setup.table(&lines)?;
    let mut page = format!("{}{table}", motions(&measured));
    let mut floor = None;
    if let Ok((_, calibration)) = accept(pictures.groundcal(&options, &setup.truth))?
        && let (Some(frame), Some(rendered)) = (pictures.images.first(), pictures.rendered.first())
    {
        let (file, text) = floor_of(setup, frame, rendered, &calibration)?;
        page += &text;
        floor = Some(file);
    }
    Ok(setup.output(&page, pictures.files.into_iter().chain([csv]).chain(floor).collect()))
}

/// Rectifies the first frame and measures its paths; beside it what the true camera gives.
fn floor_of(
    setup: &Setup,
    frame: &GrayImage,
    rendered: &Rendered,
    calibration: &Calibration,
) -> Result<(OutputFile, String), LabError> {
    let report = calibration
        .views
        .iter()
        .find(|v| v.image == rendered.file)
        .ok_or_else(|| Error::InvalidInput(format!("{} has no place on the floor", rendered.file)))?;
    let found = FloorView::of_report(&calibration.camera, report)?;
    let (group, first) = setup.scene.views().next().ok_or_else(|| LabError::Other("a scene without views".into()))?;
    let group = &setup.scene.groups[group];
    let pose = View {
        pitch_down_rad: group.pitch_down_deg.to_radians(),
        roll_rad: group.roll_deg.to_radians(),
        yaw_rad: 0.0,
        centre: Vector3::new(0.0, 0.0, 1.0),
    };
    let exact = FloorView::new(&setup.truth, setup.scene.camera.lens(), &pose)?;

    let source = Pyramid::new(colour_picture(rendered)?);
    let flat = rectify(setup, &source, &found)?;
    let png = encode(&flat.on_white(), "floor.png", 0)
        .map_err(|e| LabError::Other(format!("cannot encode the picture of the floor: {e}")))?;
    let by_truth = rectify(setup, &source, &exact)?;

    let expected = Expected::of(setup);
    let measured = [
        ("in the frame", expected.measured(frame, &|p| Some(*p))),
        ("on the floor rectified", expected.measured(&flat.grey, &|p| flat.place(&found, p))),
        (
            "on the floor rectified with the true camera",
            expected.measured(&by_truth.grey, &|p| by_truth.place(&exact, p)),
        ),
    ];
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(page, "\nEdges of the parallel paths, largest angle between two of them, degrees:");
    for (place, shape) in &measured {
        let _ = writeln!(page, "{:>9.3}  {place} ({} edges)", largest_angle_deg(&shape.along), shape.along.len());
    }
    let _ = writeln!(page, "The path across them, furthest from a right angle, degrees:");
    for (place, shape) in &measured {
        let off = furthest_from_square_deg(&shape.along, &shape.across);
        let _ = writeln!(page, "{off:>9.3}  {place} ({} edges)", shape.across.len());
    }
    let _ = writeln!(page, "The semicircular arch, longer over shorter axis of the ellipses through its edges:");
    for (place, shape) in &measured {
        let ratios: Vec<String> = shape.arch.iter().map(|ratio| format!("{ratio:>9.4}")).collect();
        let _ = writeln!(page, "{}  {place} (outer, inner)", ratios.join(""));
    }
    let _ = writeln!(
        page,
        "film_floor.png: {} x {} px, a pixel is {:.1} mm of floor for the true height",
        flat.grid.size.width,
        flat.grid.size.height,
        1000.0 * flat.grid.unit_per_px * first.centre_m[2],
    );
    Ok((setup.file(ENDINGS[0], png), page))
}

/// A picture of the floor from above, its upper side the view's heading.
struct Flat {
    grid: FloorGrid,
    picture: RgbImage8,
    /// How much of each pixel was seen, 0 to 255.
    coverage: Vec<u8>,
    /// Its luma; 0 where nothing was seen.
    grey: GrayImage,
}

fn rectify(setup: &Setup, source: &Pyramid, view: &FloorView) -> Result<Flat, LabError> {
    let heading = view.heading();
    let right = Vector2::new(heading.y, -heading.x);
    let side = UNIT_PER_PX * if setup.quick { 2.0 } else { 1.0 };
    let grid = FloorGrid::covering(&view.seen_floor(setup.scene.camera.size(), RANGE_HEIGHTS), &right, side)
        .ok_or_else(|| LabError::Other("the floor seen has no extent".into()))?;
    let flat = resample(source, grid.size, |p| view.pixel_from_floor(&grid.floor_from_pixel(p)));
    let picture = RgbImage8 { size: grid.size, data: flat.picture.into() };
    Ok(Flat { grid, grey: picture.to_gray(), picture, coverage: flat.coverage })
}

impl Flat {
    /// Where a pixel of the frame is on the rectified picture.
    fn place(&self, view: &FloorView, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let floor = view.floor_from_pixel(pixel)?;
        ((floor - view.centre().xy()).norm() < RANGE_HEIGHTS).then(|| self.grid.pixel_from_floor(&floor))
    }

    fn on_white(&self) -> RgbImage8 {
        let mut data = self.picture.data.clone();
        for (pixel, coverage) in data.chunks_exact_mut(3).zip(&self.coverage) {
            if *coverage < 128 {
                pixel.fill(255);
            }
        }
        RgbImage8 { size: self.picture.size, data }
    }
}

/// Where an edge is expected in the first frame. The place is looked up with the truth; the edge itself is measured.
fn seen(setup: &Setup, edge: &[Vector3<f64>]) -> Vec<Vector2<f64>> {
    let size = setup.scene.camera.size();
    let pixels = edge.iter().filter_map(|x| setup.scene.pixel_from_world(0, x).ok().flatten());
    pixels.filter(|p| inside(p, size)).collect()
}

fn inside(p: &Vector2<f64>, size: ImageSize) -> bool {
    let within = |v: f64, n: usize| (BORDER_PX..n as f64 - 1.0 - BORDER_PX).contains(&v);
    within(p.x, size.width) && within(p.y, size.height)
}

/// What is on the floor, and where each edge is expected in the first frame.
struct Expected {
    /// Long edges of the parallel paths.
    along: Vec<Vec<Vector2<f64>>>,
    /// Those of the path across them.
    across: Vec<Vec<Vector2<f64>>>,
    /// Outer and inner edge of the arch.
    arch: Vec<Vec<Vector2<f64>>>,
}

/// The edges as measured in one picture.
struct Shape {
    along: Vec<EdgeLine>,
    across: Vec<EdgeLine>,
    /// Longer over shorter axis of the ellipses through the edges of the arch.
    arch: Vec<f64>,
}

impl Expected {
    fn of(setup: &Setup) -> Self {
        let flat = || setup.scene.boxes.list.iter().filter(|b| b.size_m[2] <= PATH_HEIGHT_M);
        let long = |from: f64, to: f64| -> Vec<Vec<Vector2<f64>>> {
            let paths = flat().filter(|b| (from..to).contains(&b.size_m[0]));
            paths.flat_map(|b| [1.0, -1.0].map(|side| seen(setup, &edge_points(b, side)))).collect()
        };
        let pieces: Vec<&FloorBox> = flat().filter(|b| b.size_m[0] < ACROSS_FROM_M).collect();
        Self {
            along: long(PARALLEL_FROM_M, f64::INFINITY),
            across: long(ACROSS_FROM_M, PARALLEL_FROM_M),
            arch: [-1.0, 1.0].map(|side| seen(setup, &arch_edge(&pieces, side))).to_vec(),
        }
    }

    /// What is measured in a picture in which a place of the frame is at `place`.
    fn measured(&self, picture: &GrayImage, place: &dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>>) -> Shape {
        let chain = |edge: &Vec<Vector2<f64>>| edge.iter().filter_map(place).collect::<Vec<_>>();
        let lines = |edges: &[Vec<Vector2<f64>>]| edges.iter().filter_map(|e| edge_line(picture, &chain(e))).collect();
        Shape {
            along: lines(&self.along),
            across: lines(&self.across),
            arch: self.arch.iter().filter_map(|e| axis_ratio(arch::edge_points(picture, &chain(e)))).collect(),
        }
    }
}

/// Places along the outer (or, for the other sign, inner) sides of the pieces of the arch, metres: a millimetre from its circle at most.
fn arch_edge(pieces: &[&FloorBox], side: f64) -> Vec<Vector3<f64>> {
    let places = |piece: &&FloorBox| {
        let (sin, cos) = piece.yaw_deg.to_radians().sin_cos();
        let (centre, [length, width, height]) = (Vector2::from(piece.centre_m), piece.size_m);
        let middle = centre + Vector2::new(-sin, cos) * (0.5 * side * width);
        [-0.4, -0.2, 0.0, 0.2, 0.4].map(|share| {
            let p = middle + Vector2::new(cos, sin) * (share * length);
            Vector3::new(p.x, p.y, height)
        })
    };
    pieces.iter().flat_map(places).collect()
}

fn edge_points(path: &FloorBox, side: f64) -> Vec<Vector3<f64>> {
    let (sin, cos) = path.yaw_deg.to_radians().sin_cos();
    let (along, across) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
    let [length, width, height] = path.size_m;
    let steps = (length / EDGE_STEP_M) as usize;
    (0..=steps)
        .map(|i| {
            let p = Vector2::from(path.centre_m)
                + along * (i as f64 * EDGE_STEP_M - 0.5 * length)
                + across * (0.5 * side * width);
            Vector3::new(p.x, p.y, height)
        })
        .collect()
}

/// A picture of the experiment as its file has it.
fn colour_picture(rendered: &Rendered) -> Result<Raster, LabError> {
    let fail = |what: String| LabError::Other(format!("{}: {what}", rendered.file));
    let picture = image::load_from_memory(&rendered.bytes).map_err(|e| fail(e.to_string()))?.into_rgb8();
    let size = ImageSize::new(picture.width() as usize, picture.height() as usize);
    Raster::from_rows(size, 3, picture.into_raw()).ok_or_else(|| fail("an empty picture".into()))
}
