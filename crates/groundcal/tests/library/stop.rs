//! An observer can stop the work, wherever it is, and is asked often enough for that to be at once.
//!
//! Counted, not timed: a poll is a question whether to stop.

use std::{
    collections::HashMap,
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering::SeqCst},
    },
    time::{Duration, Instant},
};

use groundcal::{
    Error, Observer, Options, Stage, calibrate_images, calibrate_matches, geometry::ImageSize, pairs::ImagePair,
    synthetic::PointScene, vision::GrayImage,
};

/// Says stop at a poll and ever after, and counts what happens.
struct StopAt {
    poll: usize,
    polls: AtomicUsize,
    /// Items done and stages begun after the stop.
    done_after: AtomicUsize,
    begun_after: AtomicUsize,
    stages: Mutex<(Option<Stage>, HashMap<&'static str, usize>)>,
    /// The last poll, and the longest time between two: printed, since it hangs on the machine.
    pause: Mutex<(Instant, Duration)>,
}

fn name(stage: Option<Stage>) -> &'static str {
    match stage {
        None => "before",
        Some(Stage::Features) => "features",
        Some(Stage::Candidates) => "candidates",
        Some(Stage::Matching) => "matching",
        Some(Stage::Homographies) => "homographies",
        Some(Stage::Patches) => "patches",
        Some(Stage::Selection) => "selection",
        Some(Stage::Camera) => "camera",
    }
}

impl StopAt {
    fn new(poll: usize) -> Self {
        let zero = || AtomicUsize::new(0);
        let (stages, pause) = (Mutex::default(), Mutex::new((Instant::now(), Duration::ZERO)));
        Self { poll, polls: zero(), done_after: zero(), begun_after: zero(), stages, pause }
    }

    fn is_over(&self) -> bool {
        self.polls.load(SeqCst) >= self.poll
    }

    fn polls_in(&self, stage: Stage) -> usize {
        self.stages.lock().expect("no panic").1.get(name(Some(stage))).copied().unwrap_or(0)
    }
}

impl Observer for StopAt {
    fn begin(&self, stage: Stage, _: usize) {
        self.begun_after.fetch_add(usize::from(self.is_over()), SeqCst);
        self.stages.lock().expect("no panic").0 = Some(stage);
    }

    fn advance(&self, _: Stage) {
        self.done_after.fetch_add(usize::from(self.is_over()), SeqCst);
    }

    fn stopped(&self) -> bool {
        let mut stages = self.stages.lock().expect("no panic");
        let now = name(stages.0);
        *stages.1.entry(now).or_default() += 1;
        drop(stages);
        let mut pause = self.pause.lock().expect("no panic");
        *pause = (Instant::now(), pause.1.max(pause.0.elapsed()));
        drop(pause);
        self.polls.fetch_add(1, SeqCst) + 1 >= self.poll
    }
}

/// Stops `work` at eight places from its beginning to its end.
fn stops_everywhere(polls: usize, work: impl Fn(&dyn Observer) -> Result<(), Error>) {
    let threads = rayon::current_num_threads();
    for eighth in 0..8 {
        let observer = StopAt::new(1 + polls * eighth / 8);
        assert_eq!(work(&observer), Err(Error::Stopped), "at {eighth} eighths");
        // What was in hand ends at its own next poll: nothing new is begun, and hardly anything done.
        let [done, begun] = [&observer.done_after, &observer.begun_after].map(|count| count.load(SeqCst));
        assert!(done <= threads && begun == 0, "at {eighth} eighths {done} items were done and {begun} stages begun");
    }
}

fn picture(name: &str) -> GrayImage {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/tripod").join(name);
    let grey = image::open(path).expect("readable").into_luma8();
    let size = ImageSize::new(grey.width() as usize, grey.height() as usize);
    let values = grey.into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect();
    GrayImage::from_rows(size, values).expect("right size")
}

#[test]
fn work_on_images_stops_in_every_stage() {
    let names: Vec<String> = ["00a.jpg", "00b.jpg", "01a.jpg", "01b.jpg"].map(String::from).into();
    let images: Vec<GrayImage> = names.iter().map(|n| picture(n)).collect();
    let options = Options::default();
    let work = |observer: &dyn Observer| calibrate_images(&names, &images, &options, observer).map(|_| ());
    let never = StopAt::new(usize::MAX);
    work(&never).expect("a camera");
    println!("longest time between two questions: {:.1?}", never.pause.lock().expect("no panic").1);
    // Every row of an image, every block of descriptors, several times a homography, every patch, every step of the refinement.
    let (height, pairs) = (images[0].size().height, 6);
    assert!(never.polls_in(Stage::Features) > images.len() * height);
    assert!(never.polls_in(Stage::Matching) > pairs * 5);
    assert!(never.polls_in(Stage::Homographies) > pairs * 10);
    assert!(never.polls_in(Stage::Patches) > 500);
    assert!(never.polls_in(Stage::Camera) > 10);
    stops_everywhere(never.polls.load(SeqCst), work);
}

#[test]
fn work_on_matches_stops_too() {
    let scene = PointScene::nominal(1);
    let pairs: Vec<ImagePair> = scene.pairs();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| format!("image {i}")).collect();
    let work = |observer: &dyn Observer| {
        calibrate_matches(&names, scene.size, &pairs, &Options::default(), observer).map(|_| ())
    };
    let never = StopAt::new(usize::MAX);
    work(&never).expect("a camera");
    stops_everywhere(never.polls.load(SeqCst), work);
}
