//! Renders a scene file: one picture a view, and `truth.json` beside them.

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use groundcal::synthetic::render::{Renderer, RgbImage8};
use groundcal::synthetic::scene::{Scene, SceneError};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

/// Why a scene file could not be rendered.
#[derive(Debug)]
pub(crate) enum RenderSceneError {
    /// The scene file cannot be read.
    Read(PathBuf, io::Error),
    /// The scene file is not a scene.
    Parse(PathBuf, Box<toml::de::Error>),
    /// The scene file asks for something impossible.
    Scene(PathBuf, SceneError),
    /// A picture cannot be encoded.
    Encode(PathBuf, ImageError),
    /// A file or folder cannot be written.
    Write(PathBuf, io::Error),
}

impl fmt::Display for RenderSceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(path, e) => write!(f, "cannot read the scene file {}: {e}", path.display()),
            Self::Parse(path, e) => write!(f, "{} is not a scene file: {e}", path.display()),
            Self::Scene(path, e) => write!(f, "{}: {e}", path.display()),
            Self::Encode(path, e) => write!(f, "cannot encode {}: {e}", path.display()),
            Self::Write(path, e) => write!(f, "cannot write {}: {e}", path.display()),
        }
    }
}

impl std::error::Error for RenderSceneError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Read(_, e) | Self::Write(_, e) => Some(e),
            Self::Parse(_, e) => Some(e),
            Self::Scene(_, e) => Some(e),
            Self::Encode(_, e) => Some(e),
        }
    }
}

/// Renders every view of the scene file into `out_dir` (made if missing), then writes `truth.json` there. Each file appears
/// whole or not at all; `truth.json` comes last, so that its presence says that the pictures are complete.
pub(crate) fn run(scene_path: &Path, out_dir: &Path) -> Result<(), RenderSceneError> {
    let scene = read_scene(scene_path)?;
    let wrong = |e| RenderSceneError::Scene(scene_path.to_owned(), e);
    let renderer = Renderer::new(&scene).map_err(wrong)?;
    std::fs::create_dir_all(out_dir).map_err(|e| RenderSceneError::Write(out_dir.to_owned(), e))?;
    for (index, (_, view)) in scene.views().enumerate() {
        let picture = renderer.render(index).map_err(wrong)?;
        let path = out_dir.join(&view.file);
        let bytes = encode(&picture, &view.file, scene.sensor.jpeg_quality)
            .map_err(|e| RenderSceneError::Encode(path.clone(), e))?;
        write_whole(&path, &bytes).map_err(|e| RenderSceneError::Write(path.clone(), e))?;
    }
    let path = out_dir.join("truth.json");
    let json = serde_json::to_string_pretty(&scene.truth())
        .map_err(|e| RenderSceneError::Write(path.clone(), io::Error::other(e)))?;
    write_whole(&path, format!("{json}\n").as_bytes()).map_err(|e| RenderSceneError::Write(path.clone(), e))
}

fn read_scene(path: &Path) -> Result<Scene, RenderSceneError> {
    let text = std::fs::read_to_string(path).map_err(|e| RenderSceneError::Read(path.to_owned(), e))?;
    toml::from_str(&text).map_err(|e| RenderSceneError::Parse(path.to_owned(), Box::new(e)))
}

/// PNG or JPEG, as the file's name says.
fn encode(picture: &RgbImage8, file: &str, jpeg_quality: u8) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    let (width, height) = (picture.size.width as u32, picture.size.height as u32);
    if file.to_ascii_lowercase().ends_with(".png") {
        PngEncoder::new(&mut bytes).write_image(&picture.data, width, height, ExtendedColorType::Rgb8)?;
    } else {
        let encoder = JpegEncoder::new_with_quality(&mut bytes, jpeg_quality);
        encoder.write_image(&picture.data, width, height, ExtendedColorType::Rgb8)?;
    }
    Ok(bytes)
}

/// Writes to a temporary file in the same folder, then renames it into place.
fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // A temporary file is private by default; the finished one should have ordinary rights (less the umask).
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path).map(drop).map_err(|e| e.error)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r#"
        [camera]
        image_size = [64, 48]
        fx = 50
        [[group]]
        pitch_down_deg = 50
        [[group.view]]
        file = "a.png"
        yaw_deg = 0
        centre_m = [0, 0, 1.5]
        [[group.view]]
        file = "b.jpg"
        yaw_deg = 20
        centre_m = [0.1, 0, 1.5]
    "#;

    #[test]
    fn a_scene_file_becomes_pictures_and_truth() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        std::fs::write(&scene, SCENE).unwrap();
        let out = folder.path().join("new/out");
        run(&scene, &out).unwrap();
        for file in ["a.png", "b.jpg"] {
            let picture = image::open(out.join(file)).unwrap();
            assert_eq!((picture.width(), picture.height()), (64, 48));
        }
        let truth: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("truth.json")).unwrap()).unwrap();
        assert_eq!(truth["fy"], 50.0);
        assert_eq!(truth["views"][1]["file"], "b.jpg");
        assert_eq!(truth["distortion"]["model"], "none");
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 3, "no temporary file is left");
    }

    #[test]
    fn errors_say_what_is_wrong_where() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        let message = |text: &str| {
            std::fs::write(&scene, text).unwrap();
            run(&scene, folder.path()).unwrap_err().to_string()
        };
        assert!(message(&SCENE.replace("fx = 50", "fx = -1")).contains("camera.fx = -1.0: must be positive"));
        let text = message(&SCENE.replace("fx = 50", "focal = 50"));
        assert!(text.contains("focal") && text.contains("line 4"), "{text}");
        assert!(run(&folder.path().join("none.toml"), folder.path()).unwrap_err().to_string().contains("none.toml"));
    }
}
