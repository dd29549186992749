//! What a scene file makes: one picture a view, and `truth.json` beside them.

use std::path::Path;

use crate::renderer::{
    render::{Renderer, RgbImage8},
    scene::Scene,
};
use image::{
    ExtendedColorType, ImageEncoder, ImageError,
    codecs::{jpeg::JpegEncoder, png::PngEncoder},
};

use groundcal_io::error::IoError;

/// A scene and the name it has in messages.
#[derive(Debug, Clone)]
pub struct SceneFile {
    scene: Scene,
    name: String,
}

/// A file's name and content.
type NamedFile = (String, Vec<u8>);

impl SceneFile {
    /// Reads a scene file.
    ///
    /// # Errors
    /// [`IoError::Input`] when it cannot be read or is no scene.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        let name = path.display().to_string();
        let wrong = |e: &dyn std::fmt::Display| IoError::Input(format!("{name}: {e}"));
        let text = std::fs::read_to_string(path).map_err(|e| wrong(&format!("cannot be read: {e}")))?;
        let scene: Scene = toml::from_str(&text).map_err(|e| wrong(&format!("not a scene file: {e}")))?;
        scene.validate().map_err(|e| wrong(&e))?;
        Ok(Self { scene, name })
    }

    /// Names of the files it makes: its pictures, and `truth.json`.
    pub fn file_names(&self) -> Vec<String> {
        file_names(&self.scene)
    }

    /// Renders one picture after the other; `truth.json` comes last.
    ///
    /// # Errors
    /// [`IoError::Input`] when the scene cannot be rendered, also later on.
    pub fn files(&self) -> Result<impl Iterator<Item = Result<NamedFile, IoError>>, IoError> {
        let renderer = Renderer::new(&self.scene).map_err(|e| IoError::Input(format!("{}: {e}", self.name)))?;
        let picture = move |index| {
            let rendered = render_one(&self.scene, &renderer, index, &self.name)?;
            Ok((rendered.file, rendered.bytes))
        };
        let truth = std::iter::once_with(|| Ok((TRUTH.to_string(), truth_json(&self.scene)?.into_bytes())));
        Ok((0..self.scene.view_count()).map(picture).chain(truth))
    }
}

/// The file of a scene's truth.
pub(crate) const TRUTH: &str = "truth.json";

/// Names of a scene's files.
pub(crate) fn file_names(scene: &Scene) -> Vec<String> {
    scene.views().map(|(_, view)| view.file.clone()).chain([TRUTH.to_string()]).collect()
}

/// A picture of a scene.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// Name of its file.
    pub file: String,
    /// Its pixels, as they were before JPEG.
    pub picture: RgbImage8,
    /// The file's content.
    pub bytes: Vec<u8>,
}

/// Renders every view of a scene. `name` stands for the scene in messages; `done` hears of each picture.
///
/// # Errors
/// [`IoError::Input`] when the scene is none.
pub fn render_pictures(scene: &Scene, name: &str, done: impl Fn(usize)) -> Result<Vec<Rendered>, IoError> {
    let wrong = |e: &dyn std::fmt::Display| IoError::Input(format!("{name}: {e}"));
    let renderer = Renderer::new(scene).map_err(|e| wrong(&e))?;
    scene
        .views()
        .enumerate()
        .map(|(index, _)| render_one(scene, &renderer, index, name).inspect(|_| done(index)))
        .collect()
}

fn render_one(scene: &Scene, renderer: &Renderer, index: usize, name: &str) -> Result<Rendered, IoError> {
    let wrong = |e: &dyn std::fmt::Display| IoError::Input(format!("{name}: {e}"));
    let (_, view) = scene.views().nth(index).ok_or_else(|| wrong(&format!("there is no view {index}")))?;
    let picture = renderer.render(index).map_err(|e| wrong(&e))?;
    let bytes = encode(&picture, &view.file, scene.sensor.jpeg_quality)
        .map_err(|e| IoError::Other(format!("cannot encode {}: {e}", view.file)))?;
    Ok(Rendered { file: view.file.clone(), picture, bytes })
}

/// `truth.json` of a scene.
///
/// # Errors
/// [`IoError::Other`] when it cannot be written as JSON.
pub fn truth_json(scene: &Scene) -> Result<String, IoError> {
    serde_json::to_string_pretty(&scene.truth())
        .map(|json| json + "\n")
        .map_err(|e| IoError::Other(format!("cannot write the truth as JSON: {e}")))
}

/// PNG or JPEG, as the file's name says.
pub fn encode(picture: &RgbImage8, file: &str, jpeg_quality: u8) -> Result<Vec<u8>, ImageError> {
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
        let scene = SceneFile::read(&scene).unwrap();
        let files: Vec<NamedFile> = scene.files().unwrap().collect::<Result<_, _>>().unwrap();
        assert_eq!(files.iter().map(|f| f.0.clone()).collect::<Vec<_>>(), scene.file_names());
        assert_eq!(scene.file_names(), ["a.png", "b.jpg", "truth.json"]);
        for (_, bytes) in &files[..2] {
            let picture = image::load_from_memory(bytes).unwrap();
            assert_eq!((picture.width(), picture.height()), (64, 48));
        }
        let truth: serde_json::Value = serde_json::from_slice(&files[2].1).unwrap();
        assert_eq!(truth["fy"], 50.0);
        assert_eq!(truth["views"][1]["file"], "b.jpg");
        assert_eq!(truth["distortion"]["model"], "none");
    }

    #[test]
    fn errors_say_what_is_wrong_where() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        let message = |text: &str| {
            std::fs::write(&scene, text).unwrap();
            SceneFile::read(&scene).unwrap_err().to_string()
        };
        assert!(message(&SCENE.replace("fx = 50", "fx = -1")).contains("camera.fx = -1.0: must be positive"));
        let text = message(&SCENE.replace("fx = 50", "focal = 50"));
        assert!(text.contains("focal") && text.contains("line 4"), "{text}");
        assert!(SceneFile::read(&folder.path().join("none.toml")).unwrap_err().to_string().contains("none.toml"));
    }
}
