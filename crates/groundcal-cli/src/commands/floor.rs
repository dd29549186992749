//! `groundcal floor`: points of the floor from pixels of a view, and back, with error bars.

use std::path::PathBuf;

use clap::Args;
use groundcal::{
    floor::{FloorPoint, ImagePoint, Length, MeasuringView},
    result::Calibration,
};
use groundcal_io::import::groundcal_json;
use groundcal_report::{
    number::{decimals_of_sigma, fixed},
    terminal::{Table, wrapped},
};
use serde::Serialize;

use crate::{
    args::{parse_height, parse_point, parse_sigma},
    error::CliError,
    output, terminal,
};

/// `groundcal floor`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal floor result/ 00a.jpg 412,380 655,410             two points, and how far they are apart
  groundcal floor result/ 00a.jpg 412,380 --camera-height 1.45
  groundcal floor result/ 00a.jpg 1.2,0.3 --to-pixels         where a point of the floor is seen

The floor is Z = 0 with its origin below the camera of the view named as origin, +X along that view's heading, +Y to its left. Lengths are \
metres where the calibration has them (--camera-height or --floor-distance of `calibrate`), else heights of that camera. Pixel (0,0) is the centre of \
the top-left pixel, as the lens gave it. Exit codes: 0 points, 2 wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct FloorArgs {
    /// calibration.json, or the folder it is in
    #[arg(value_name = "CALIBRATION")]
    pub(crate) calibration: PathBuf,

    /// Image of the calibration in which the points are seen
    #[arg(value_name = "VIEW")]
    pub(crate) view: String,

    /// Pixels; points of the floor with --to-pixels
    #[arg(required = true, value_name = "X,Y", value_parser = parse_point)]
    pub(crate) points: Vec<[f64; 2]>,

    /// From points of the floor to pixels
    #[arg(long)]
    pub(crate) to_pixels: bool,

    /// How well the pixels are pointed at: standard deviation of each coordinate
    #[arg(long, value_name = "PX", default_value_t = 0.5, value_parser = parse_sigma)]
    pub(crate) pixel_sigma: f64,

    /// Height of the origin's camera over the floor in metres [default: as the calibration says]
    #[arg(long, value_name = "METRES", value_parser = parse_height, allow_negative_numbers = true)]
    pub(crate) camera_height: Option<f64>,

    /// Print JSON on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// What is printed with `--json`.
#[derive(Debug, Serialize)]
struct Report {
    view: String,
    /// The image below whose camera the floor's origin lies.
    origin: String,
    /// `m`, or `camera heights`.
    unit: &'static str,
    pixel_sigma_px: f64,
    points: Vec<Point>,
    /// From each point to the next.
    distances: Vec<Distance>,
}

#[derive(Debug, Serialize)]
struct Point {
    pixel: [f64; 2],
    /// Of a pixel that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pixel_covariance: Option<[[f64; 2]; 2]>,
    /// null: no floor is seen at the pixel.
    floor: Option<[f64; 2]>,
    /// Of a point that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    floor_covariance: Option<[[f64; 2]; 2]>,
}

#[derive(Debug, Serialize)]
struct Distance {
    between: [usize; 2],
    distance: f64,
    sigma: f64,
}

/// Prints the points.
pub(crate) fn run(args: &FloorArgs) -> Result<(), CliError> {
    let mut calibration = groundcal_json::read(&args.calibration)?;
    if let Some(height_m) = args.camera_height {
        calibration = calibration.with_camera_height(height_m)?;
    }
    let report = report(args, &calibration).map_err(|e| CliError::of_file(&args.calibration, e))?;
    if args.json {
        let json = serde_json::to_string_pretty(&report)
            .map_err(|e| CliError::Other(format!("cannot write the points as JSON: {e}")))?;
        return output::print_json(&(json + "\n"));
    }
    output::print(&text(&report, args.to_pixels, terminal::width()))
}

fn report(args: &FloorArgs, c: &Calibration) -> Result<Report, groundcal::Error> {
    let view = MeasuringView::of(c, &args.view)?;
    let points: Vec<Point> = args
        .points
        .iter()
        .map(|p| if args.to_pixels { seen(&view, *p) } else { stood_on(&view, *p, args.pixel_sigma) })
        .collect();
    let distances = match args.to_pixels {
        true => Vec::new(),
        false => args
            .points
            .windows(2)
            .enumerate()
            .filter_map(|(i, p)| distance(&view, i, [p[0], p[1]], args.pixel_sigma))
            .collect(),
    };
    Ok(Report {
        view: view.image,
        origin: view.origin,
        unit: if c.camera_height_m.is_some() { "m" } else { "camera heights" },
        pixel_sigma_px: args.pixel_sigma,
        points,
        distances,
    })
}

fn stood_on(view: &MeasuringView, pixel: [f64; 2], sigma_px: f64) -> Point {
    let found = view.floor_point(pixel, sigma_px);
    Point {
        pixel,
        pixel_covariance: None,
        floor: found.map(|p| p.position),
        floor_covariance: found.map(|p| p.covariance),
    }
}

fn seen(view: &MeasuringView, floor: [f64; 2]) -> Point {
    let found: Option<ImagePoint> = view.image_point(&FloorPoint { position: floor, covariance: [[0.0; 2]; 2] });
    Point {
        pixel: found.map_or([f64::NAN; 2], |p| p.pixel),
        pixel_covariance: found.map(|p| p.covariance_px2),
        floor: Some(floor),
        floor_covariance: None,
    }
}

fn distance(view: &MeasuringView, from: usize, pixels: [[f64; 2]; 2], sigma_px: f64) -> Option<Distance> {
    let Length { value, sigma } = view.distance(pixels, sigma_px)?;
    Some(Distance { between: [from, from + 1], distance: value, sigma })
}

/// Two numbers with their error bars, and how the errors go together.
fn with_errors(value: [f64; 2], covariance: [[f64; 2]; 2]) -> [String; 3] {
    let sigma = [covariance[0][0], covariance[1][1]].map(|v| v.max(0.0).sqrt());
    let number = |i: usize| {
        let decimals = decimals_of_sigma(sigma[i]);
        format!("{} +-{}", fixed(value[i], decimals), fixed(sigma[i], decimals))
    };
    let correlation = covariance[0][1] / (sigma[0] * sigma[1]);
    [number(0), number(1), if correlation.is_finite() { fixed(correlation, 2) } else { "-".into() }]
}

fn text(r: &Report, to_pixels: bool, width: usize) -> String {
    let unit = if r.unit == "m" { "m" } else { "heights" };
    let mut table = Table::new().name("");
    table = if to_pixels {
        table
            .number(&format!("X\n{unit}"))
            .number(&format!("Y\n{unit}"))
            .number("x\npx")
            .number("y\npx")
            .number("corre-\nlation")
    } else {
        table
            .number("x\npx")
            .number("y\npx")
            .number(&format!("X\n{unit}"))
            .number(&format!("Y\n{unit}"))
            .number("corre-\nlation")
    };
    for (i, p) in r.points.iter().enumerate() {
        let plain = |v: f64| groundcal_report::number::short_decimals(v);
        let row = match (to_pixels, p.floor, p.floor_covariance, p.pixel_covariance) {
            (false, Some(floor), Some(covariance), _) => {
                let [x, y, correlation] = with_errors(floor, covariance);
                vec![plain(p.pixel[0]), plain(p.pixel[1]), x, y, correlation]
            }
            (false, ..) => vec![plain(p.pixel[0]), plain(p.pixel[1]), "no floor".into(), "-".into(), "-".into()],
            (true, Some(floor), _, Some(covariance)) => {
                let [x, y, correlation] = with_errors(p.pixel, covariance);
                vec![plain(floor[0]), plain(floor[1]), x, y, correlation]
            }
            (true, floor, ..) => {
                let [x, y] = floor.unwrap_or_default();
                vec![plain(x), plain(y), "not seen".into(), "-".into(), "-".into()]
            }
        };
        table.row([(i + 1).to_string()].into_iter().chain(row));
    }
    let mut out = table.text(width);
    for d in &r.distances {
        let decimals = decimals_of_sigma(d.sigma);
        let [a, b] = d.between.map(|i| i + 1);
        out += &format!("\n{a} to {b}: {} +-{} {unit}", fixed(d.distance, decimals), fixed(d.sigma, decimals));
    }
    if !r.distances.is_empty() {
        out.push('\n');
    }
    let lengths = if r.unit == "m" { "metres".to_string() } else { format!("heights of the camera of {}", r.origin) };
    let pointing = if to_pixels {
        String::new()
    } else {
        format!(", with {} px of pointing", groundcal_report::number::short(r.pixel_sigma_px))
    };
    let note = format!(
        "View {}. Origin below the camera of {}, +X along its heading, +Y to its left; {lengths}. Error bars: one standard deviation{pointing}.",
        r.view, r.origin
    );
    out + "\n" + &wrapped(&note, 0, width) + "\n"
}
