//! `groundcal rectify`: metric bird's-eye pictures of the floor, of each view or of all together.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use crate::args::PictureFormatArg;
use clap::{Args, ValueEnum};
use groundcal::{
    floor::{
        placed::{Placed, placed},
        rectify::{Mosaic, rectify, source_resolution},
        view::{FloorGrid, FloorView},
    },
    geometry::size::ImageSize,
    result::{Calibration, Method},
    vision::resample::{Pyramid, Resampled},
};
use nalgebra::{Matrix3, Vector2};
use serde::Serialize;

use crate::{args::parse_height, error::CliError};
use groundcal_io::{
    export::write_whole,
    import::groundcal_json,
    load,
    pictures::{self, PictureFormat},
};

/// `groundcal rectify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal calibrate photos/ --out result/
  groundcal rectify result/ photos/ --out floor/                    each view from above
  groundcal rectify result/ photos/ --out floor/ --mosaic --camera-height 1.45 --resolution 500

Beside each picture: a world file (.pgw, .jgw) and a JSON file with the homography from the image to the floor. Lengths \
are in heights of the camera at the first view, in metres with --camera-height (here or in calibrate). Exit codes: 0 \
pictures, 2 wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub struct RectifyArgs {
    /// calibration.json of `groundcal calibrate --out`, or the folder it is in
    pub calibration: PathBuf,

    /// The images of the calibration: folders, files, glob patterns [default: looked for beside calibration.json and in the current
    /// folder]
    #[arg(value_name = "IMAGES")]
    pub inputs: Vec<String>,

    /// Folder for the pictures (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,

    /// One picture of all views of a set (common points connect them) instead of one for each
    #[arg(long)]
    pub mosaic: bool,

    /// Pixels for a camera height, or for a metre where lengths are in metres [default: that of the images' middling pixel, as 1, 2 or
    /// 5 times a power of ten]
    #[arg(long, value_name = "PX", value_parser = parse_positive, allow_negative_numbers = true)]
    pub resolution: Option<f64>,

    /// How far from the point below the camera the floor is shown, in camera heights, or in metres where lengths are [default: 5 camera
    /// heights]
    #[arg(long, value_name = "DISTANCE", value_parser = parse_positive, allow_negative_numbers = true)]
    pub extent: Option<f64>,

    /// Height of the camera over the floor in metres at the first view of each set [default: that of the calibration, else lengths are
    /// in camera heights]
    #[arg(long, value_name = "METRES", value_parser = parse_height, allow_negative_numbers = true)]
    pub camera_height: Option<f64>,

    /// Which way is up in the picture
    #[arg(long, value_enum)]
    pub up: Option<Up>,

    /// Kind of picture
    #[arg(long, value_enum, default_value_t = PictureFormatArg::Png)]
    pub format: PictureFormatArg,

    /// Threads [default: all processors]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Which way is up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Up {
    /// The way the camera looks (of a mosaic: that of its first view); default for single views
    Heading,
    /// +Y of the world, +X to the right; default for mosaics
    Y,
}

/// Camera heights shown by default.
const EXTENT: f64 = 5.0;
/// Pixels of one picture.
const MAX_PIXELS: u64 = 100_000_000;

fn parse_positive(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && (1e-6..=1e9).contains(v));
    value.ok_or_else(|| "expected a positive number".into())
}

/// The file beside a picture.
#[derive(Debug, Serialize)]
struct Sidecar<'a> {
    picture: String,
    picture_size: [usize; 2],
    pixel_centre: &'static str,
    unit: &'static str,
    camera_height_m: Option<f64>,
    units_per_pixel: f64,
    max_distance: f64,
    /// The image at whose foot the world begins; null: below the optical centre.
    origin: Option<&'a str>,
    floor_from_picture: [[f64; 3]; 3],
    views: Vec<SidecarView<'a>>,
    camera: SidecarCamera,
}

#[derive(Debug, Serialize)]
struct SidecarView<'a> {
    image: &'a str,
    floor_from_image: [[f64; 3]; 3],
    picture_from_image: [[f64; 3]; 3],
    position: [f64; 3],
}

#[derive(Debug, Serialize)]
struct SidecarCamera {
    image_size: [usize; 2],
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    skew: f64,
    k1: f64,
    k2: f64,
    p1: f64,
    p2: f64,
}

/// A view with its image file.
struct Found {
    placed: Placed,
    file: PathBuf,
}

/// What is written.
struct Work<'a> {
    calibration: &'a Calibration,
    args: &'a RectifyArgs,
    size: ImageSize,
    /// Lengths in metres.
    camera_height_m: Option<f64>,
    max_distance: f64,
}

/// Runs the command; returns what is printed, with notes for standard error.
pub fn run(args: &RectifyArgs) -> Result<(String, Vec<String>), CliError> {
    let calibration = groundcal_json::read(&args.calibration)?;
    let camera_height_m = args.camera_height.or(calibration.camera_height_m);
    let scale = args.camera_height.map_or(1.0, |h| h / calibration.camera_height_m.unwrap_or(1.0));
    let placed = placed(&calibration, scale)?;
    if args.mosaic && placed.iter().all(|p| p.origin.is_none()) {
        return Err(CliError::Input(format!(
            "{}: the views have attitudes but no positions ({}), so there is no common floor to lay them on. Calibrate without \
             --method linear, or leave --mosaic out to rectify each view by itself",
            args.calibration.display(),
            match calibration.method {
                Method::Linear => "--method linear",
                Method::Rotating => "--method rotating",
                Method::Joint => "the joint refinement failed",
            }
        )));
    }
    let (found, mut notes) = matched(args, placed)?;
    let unit_height = camera_height_m.unwrap_or(1.0);
    let work = Work {
        calibration: &calibration,
        args,
        size: calibration.camera.size(),
        camera_height_m,
        max_distance: args.extent.unwrap_or(EXTENT * unit_height),
    };
    // Images that cannot be used are refused before anything is written.
    let resolution = work.resolution(&found, &mut notes)?;
    let text = if args.mosaic {
        work.mosaics(&found, resolution)?
    } else {
        work.single_views(&found, resolution, &mut notes)?
    };
    Ok((text, notes))
}

/// Which file is which view's.
fn matched(args: &RectifyArgs, placed: Vec<Placed>) -> Result<(Vec<Found>, Vec<String>), CliError> {
    let mut notes = Vec::new();
    if args.inputs.is_empty() {
        let beside =
            if args.calibration.is_dir() { Some(args.calibration.as_path()) } else { args.calibration.parent() };
        let mut found = Vec::new();
        let mut missing = Vec::new();
        for p in placed {
            let places = beside.iter().map(|b| b.join(&p.image)).chain([PathBuf::from(&p.image)]);
            match places.into_iter().find(|f| f.is_file()) {
                Some(file) => found.push(Found { placed: p, file }),
                None => missing.push(p.image),
            }
        }
        if found.is_empty() {
            return Err(CliError::Input(format!(
                "no image of the calibration ({}) is beside it or in the current folder. Name their folder: groundcal rectify {} \
                 FOLDER --out {}",
                listed(&missing),
                args.calibration.display(),
                args.out.display()
            )));
        }
        if !missing.is_empty() {
            notes.push(format!("of the calibration's images not found: {}", listed(&missing)));
        }
        return Ok((found, notes));
    }
    let files = pictures::files(&args.inputs)?;
    let mut taken = vec![false; files.len()];
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for p in placed {
        // A path that ends in the view's name, or else a file of that name.
        let name = Path::new(&p.image);
        let mut of_view: Vec<usize> = (0..files.len()).filter(|&i| files[i].ends_with(name)).collect();
        if of_view.is_empty() {
            of_view = (0..files.len()).filter(|&i| files[i].file_name() == name.file_name()).collect();
        }
        match of_view[..] {
            [] => missing.push(p.image),
            [only] => {
                taken[only] = true;
                found.push(Found { placed: p, file: files[only].clone() });
            }
            [first, second, ..] => {
                return Err(CliError::Input(format!(
                    "{} may be {} or {}. Name one of them",
                    p.image,
                    files[first].display(),
                    files[second].display()
                )));
            }
        }
    }
    let others: Vec<String> = files
        .iter()
        .zip(&taken)
        .filter(|(_, t)| !**t)
        .map(|(f, _)| load::names_of(std::slice::from_ref(f)).concat())
        .collect();
    if found.is_empty() {
        return Err(CliError::Input(format!(
            "no image given ({}) is a view of the calibration, which has {}. Give the images that were calibrated, under the names \
             they had",
            listed(&others),
            listed(&missing)
        )));
    }
    if !others.is_empty() {
        notes.push(format!("left out, as the calibration has no position for them: {}", listed(&others)));
    }
    if !missing.is_empty() {
        notes.push(format!("of the calibration's images not found: {}", listed(&missing)));
    }
    Ok((found, notes))
}

/// The first few of a list.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

impl Work<'_> {
    fn unit(&self) -> &'static str {
        if self.camera_height_m.is_some() { "metre" } else { "camera height" }
    }

    /// Unit vector of a picture's columns on the floor.
    fn right(&self, view: &FloorView) -> Vector2<f64> {
        let default = if self.args.mosaic { Up::Y } else { Up::Heading };
        match self.args.up.unwrap_or(default) {
            Up::Y => Vector2::x(),
            Up::Heading => {
                let heading = view.heading();
                Vector2::new(heading.y, -heading.x)
            }
        }
    }

    /// The sets of views that make one picture each, in the order of their first ones.
    fn sets<'a>(&self, found: &'a [Found]) -> Vec<Vec<&'a Found>> {
        let mut sets: Vec<Vec<&Found>> = Vec::new();
        for f in found {
            match sets.iter_mut().find(|s| self.args.mosaic && s[0].placed.origin == f.placed.origin) {
                Some(set) => set.push(f),
                None => sets.push(vec![f]),
            }
        }
        sets
    }

    /// Outlines of the floor that a set sees, one after the other.
    fn seen(&self, set: &[&Found]) -> Vec<Vector2<f64>> {
        set.iter().flat_map(|f| f.placed.view.seen_floor(self.size, self.max_distance)).collect()
    }

    /// The grid of a set; nothing where it sees no floor.
    fn grid(&self, set: &[&Found], resolution: f64) -> Option<FloorGrid> {
        FloorGrid::covering(&self.seen(set), &self.right(&set[0].placed.view), 1.0 / resolution)
    }

    /// Pixels for a unit of length: what was asked for, or that of the images; pictures must not become too large.
    fn resolution(&self, found: &[Found], notes: &mut Vec<String>) -> Result<f64, CliError> {
        let views = found.iter().map(|f| &f.placed.view);
        let of_images = source_resolution(views, self.size, self.max_distance).ok_or_else(|| {
            CliError::Input(format!(
                "no view sees floor within {} of the point below it. Take a larger --extent; if there is no floor in the images, \
                 there is nothing to rectify",
                self.length(self.max_distance)
            ))
        })?;
        let sets = self.sets(found);
        let seen: Vec<(Vector2<f64>, Vec<Vector2<f64>>)> =
            sets.iter().map(|s| (self.right(&s[0].placed.view), self.seen(s))).filter(|s| !s.1.is_empty()).collect();
        let largest = |resolution: f64| {
            // A grid beyond counting is too large.
            let pixels = |(right, points): &(Vector2<f64>, Vec<Vector2<f64>>)| {
                FloorGrid::covering(points, right, 1.0 / resolution).map_or(u64::MAX, |g| g.pixels())
            };
            seen.iter().map(pixels).max().unwrap_or(0)
        };
        match self.args.resolution {
            Some(resolution) => {
                let pixels = largest(resolution);
                if pixels > MAX_PIXELS {
                    // A margin for the rounding up of sides.
                    let fits = resolution * (MAX_PIXELS as f64 / pixels.max(1) as f64).sqrt() * 0.999;
                    return Err(CliError::Usage(format!(
                        "--resolution {resolution}: a picture would have {:.0} megapixels, {} at most. Take {} px per {} or less, or a \
                         smaller --extent than {}",
                        pixels as f64 / 1e6,
                        MAX_PIXELS / 1_000_000,
                        rounded_down(fits),
                        self.unit(),
                        self.length(self.max_distance)
                    )));
                }
                Ok(resolution)
            }
            None => {
                let mut resolution = one_two_five(of_images);
                let wanted = resolution;
                while largest(resolution) > MAX_PIXELS && resolution > 1e-6 * wanted {
                    resolution = one_two_five(resolution * 0.6);
                }
                if resolution < wanted {
                    notes.push(format!(
                        "resolution lowered from {wanted} to {resolution} px per {}, for pictures of at most {} megapixels",
                        self.unit(),
                        MAX_PIXELS / 1_000_000
                    ));
                }
                Ok(resolution)
            }
        }
    }

    fn length(&self, value: f64) -> String {
        match self.camera_height_m {
            Some(_) => format!("{value} m"),
            None => format!("{value} camera heights"),
        }
    }

    fn heading_line(&self, resolution: f64) -> String {
        format!(
            "{resolution} px per {}, floor shown to {} from below each camera\n",
            self.unit(),
            self.length(self.max_distance)
        )
    }

    fn single_views(&self, found: &[Found], resolution: f64, notes: &mut Vec<String>) -> Result<String, CliError> {
        let names = pictures::stems(&found.iter().map(|f| f.file.clone()).collect::<Vec<_>>());
        self.check_all(found)?;
        make_folder(&self.args.out)?;
        let mut text = self.heading_line(resolution);
        for (f, name) in found.iter().zip(&names) {
            let Some(grid) = self.grid(&[f], resolution) else {
                notes.push(format!(
                    "{}: no floor in it within {}: left out",
                    f.placed.image,
                    self.length(self.max_distance)
                ));
                continue;
            };
            let picture = Pyramid::new(pictures::read(&f.file, self.size)?);
            let out = rectify(&picture, &f.placed.view, &grid, self.max_distance);
            self.write(&format!("{name}_floor"), &grid, &[f], &out, &mut text)?;
        }
        Ok(text)
    }

    fn mosaics(&self, found: &[Found], resolution: f64) -> Result<String, CliError> {
        let colour = self.check_all(found)?;
        let channels = if colour { 3 } else { 1 };
        make_folder(&self.args.out)?;
        let mut text = self.heading_line(resolution);
        let sets = self.sets(found);
        for (i, set) in sets.iter().enumerate() {
            let Some(grid) = self.grid(set, resolution) else { continue };
            let mut mosaic = Mosaic::new(grid, channels, self.max_distance);
            for f in set {
                let mut picture = pictures::read(&f.file, self.size)?;
                if colour {
                    picture = pictures::to_colour(picture);
                }
                mosaic.add(&Pyramid::new(picture), &f.placed.view);
            }
            let name = if sets.len() == 1 { "mosaic".to_string() } else { format!("mosaic_{}", i + 1) };
            self.write(&name, &grid, set, &mosaic.finish(), &mut text)?;
        }
        Ok(text)
    }

    /// Reads all images once before anything is written; whether any has colour.
    fn check_all(&self, found: &[Found]) -> Result<bool, CliError> {
        let mut colour = false;
        for f in found {
            colour |= pictures::read(&f.file, self.size)?.channels() > 1;
        }
        Ok(colour)
    }

    /// The picture last: when it is there, the files beside it are.
    fn write(
        &self,
        name: &str,
        grid: &FloorGrid,
        set: &[&Found],
        resampled: &Resampled,
        text: &mut String,
    ) -> Result<(), CliError> {
        let format = PictureFormat::from(self.args.format);
        let path = self.args.out.join(format!("{name}.{}", format.extension()));
        let bytes = pictures::encode(resampled, format, &path)?;
        let sidecar = self.sidecar(&path, grid, set);
        let json = serde_json::to_string_pretty(&sidecar)
            .map_err(|e| CliError::Other(format!("cannot write the homography as JSON: {e}")))?;
        write_whole(&self.args.out.join(format!("{name}.json")), format!("{json}\n").as_bytes())?;
        write_whole(&self.args.out.join(format!("{name}.{}", format.world_extension())), world_file(grid).as_bytes())?;
        write_whole(&path, &bytes)?;
        let sides = [grid.size.width, grid.size.height].map(|n| n as f64 * grid.unit_per_px);
        let of = if self.args.mosaic { format!(", {} views", set.len()) } else { String::new() };
        let _ = writeln!(
            text,
            "{}: {} x {} px, {:.3} x {:.3} {}s{of}",
            path.display(),
            grid.size.width,
            grid.size.height,
            sides[0],
            sides[1],
            self.unit()
        );
        Ok(())
    }

    fn sidecar<'a>(&self, path: &Path, grid: &FloorGrid, set: &[&'a Found]) -> Sidecar<'a> {
        let c = &self.calibration.camera;
        let d = c.lens();
        let floor_from_picture = grid.floor_from_pixel_matrix();
        let picture_from_floor = floor_from_picture.try_inverse().unwrap_or(Matrix3::identity());
        Sidecar {
            picture: path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            picture_size: [grid.size.width, grid.size.height],
            pixel_centre: "(0,0) is the centre of the top-left pixel",
            unit: self.unit(),
            camera_height_m: self.camera_height_m,
            units_per_pixel: grid.unit_per_px,
            max_distance: self.max_distance,
            origin: set[0].placed.origin.as_deref(),
            floor_from_picture: rows(&floor_from_picture),
            views: set
                .iter()
                .map(|f| {
                    let h = f.placed.view.floor_from_image();
                    SidecarView {
                        image: &f.placed.image,
                        floor_from_image: rows(&h),
                        picture_from_image: rows(&(picture_from_floor * h)),
                        position: (*f.placed.view.centre()).into(),
                    }
                })
                .collect(),
            camera: SidecarCamera {
                image_size: [self.size.width, self.size.height],
                fx: c.fx,
                fy: c.fy,
                cx: c.cx,
                cy: c.cy,
                skew: c.skew,
                k1: d.k1,
                k2: d.k2,
                p1: d.p1,
                p2: d.p2,
            },
        }
    }
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}

/// Six lines: X and Y by the column, X and Y by the row, X and Y of the centre of the top-left pixel, in the order of the format.
fn world_file(grid: &FloorGrid) -> String {
    let (right, down, origin) = (grid.right * grid.unit_per_px, grid.down() * grid.unit_per_px, grid.top_left);
    // Adding zero turns -0 into 0.
    [right.x, right.y, down.x, down.y, origin.x, origin.y].map(|v| format!("{:?}\n", v + 0.0)).concat()
}

/// The nearest of 1, 2 and 5 times a power of ten to a positive value, by their ratio.
fn one_two_five(value: f64) -> f64 {
    let power = 10f64.powi(value.log10().floor() as i32);
    let apart = |s: &f64| (s / value).ln().abs();
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * power);
    steps.into_iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(power)
}

/// Three digits, not above the value.
fn rounded_down(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32 - 2);
    if unit >= 1.0 { (value / unit).floor() * unit } else { (value / unit).floor() / (1.0 / unit).round() }
}

fn make_folder(out: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(out).map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", out.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_resolutions() {
        for (value, expected) in
            [(487.0, 500.0), (500.0, 500.0), (800.0, 1000.0), (1000.0, 1000.0), (0.03, 0.02), (3.3, 5.0)]
        {
            assert!((one_two_five(value) - expected).abs() < 1e-9 * expected, "{value}: {}", one_two_five(value));
        }
        assert_eq!((rounded_down(12345.6), rounded_down(0.123_456)), (12300.0, 0.123));
    }

    #[test]
    fn world_files_have_six_lines() {
        let grid = FloorGrid {
            top_left: Vector2::new(-1.5, 2.25),
            right: Vector2::x(),
            unit_per_px: 0.01,
            size: ImageSize::new(10, 10),
        };
        assert_eq!(world_file(&grid), "0.01\n0.0\n0.0\n-0.01\n-1.5\n2.25\n");
    }
}
