//! The simulation as a film: each picture is drawn by the project's rasteriser over a chequered ground with the
//! object's shadow, from a camera that sees the whole motion.
//!
//! A film has more pictures than the simulation has frames: [`between`] interpolates. [`camera`] places the cameras,
//! [`ground`] draws the ground, [`recorder`] makes a file of the pictures.

mod between;
mod camera;
mod ground;
mod recorder;

use image::{RgbImage, imageops};
use serde::Serialize;

use super::SimulationReport;
use crate::camera::{Camera, Distortion};
use crate::config::option_values::{Domain, OptionError, from_to};
use crate::film::gif::Gif;
use crate::film::{self, FilmError, GIF_SAMPLES, Size};
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::render::{self, RenderOptions};
use crate::words::progress::Progress;
use between::Motion;
use camera::cameras_around;
use ground::{Ground, Shadow};
pub use recorder::Film;
use recorder::{Recorded, Recorder};

/// How many times slower than real the film runs: a fall of half a second is too short to follow.
const SLOWED: f64 = 2.0;
/// Films of at least this simulated time run in real time.
const LONG_S: f64 = 4.0;
/// The longest film: if the simulated time is longer, the film runs faster.
const LONGEST_S: f64 = 20.0;

/// How many times slower than real a film of `simulated_s` runs.
fn slowed(simulated_s: f64) -> f64 {
    let wanted = if simulated_s < LONG_S { SLOWED } else { 1.0 };
    wanted.min(LONGEST_S / simulated_s)
}

/// How fast a film of `simulated_s` runs, for its caption.
pub fn pace(simulated_s: f64) -> &'static str {
    match slowed(simulated_s) {
        slowed if slowed > 1.0 => "at half the real speed",
        slowed if slowed < 1.0 => "faster than real time",
        _ => "in real time",
    }
}

/// Pictures that are drawn at once. Some steps of each run on one thread, while the others draw the next.
const AT_ONCE: usize = 2;

/// Longest side of the animation for pages, px.
const SMALL_PX: u32 = 640;
/// The animation for pages has at least this many pictures per second, or all pictures of a film that has fewer.
const SMALL_FPS: u32 = 12;

/// Pictures per second of the animation for pages of a film with `fps`.
fn small_fps(fps: u32) -> u32 {
    fps.div_ceil((fps / SMALL_FPS).max(1))
}

/// The picture of a film with `fps` that is nearest in time to the picture `index` of its animation for pages.
fn nearest_in_film(index: usize, fps: u32) -> usize {
    let (fps, small_fps) = (fps as usize, small_fps(fps) as usize);
    (index * fps + small_fps / 2) / small_fps
}

const AZIMUTH_DEG: Domain<f64> = from_to(-360.0, 360.0);
const ELEVATION_DEG: Domain<f64> = from_to(-90.0, 90.0);

/// The viewpoint of the animation.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
pub struct Viewpoint {
    /// Film with the camera of this photo, given by its name; if --azimuth-deg or --turntable is given too, the last one
    /// counts [default: a camera that sees the whole motion]
    #[arg(long, value_name = "VIEW", overrides_with_all = ["azimuth_deg", "turntable"])]
    pub film_from: Option<String>,

    /// Film from this direction, in degrees from +x towards +y [default: the side that shows most of the object's
    /// length]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = AZIMUTH_DEG)]
    #[arg(overrides_with = "film_from")]
    pub azimuth_deg: Option<f64>,

    /// Angle by which the camera looks down, in degrees; not used with --film-from
    #[arg(long, value_name = "DEGREES", default_value_t = 22.0, allow_negative_numbers = true)]
    #[arg(value_parser = ELEVATION_DEG)]
    pub elevation_deg: f64,

    /// Film the object with a camera that circles it once
    #[arg(long, overrides_with = "film_from")]
    pub turntable: bool,

    #[command(flatten)]
    pub film: film::Options,
}

impl Viewpoint {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        AZIMUTH_DEG.check("--azimuth-deg", self.azimuth_deg)?;
        ELEVATION_DEG.check("--elevation-deg", self.elevation_deg)?;
        self.film.check()
    }
}

/// The pictures of a simulation: where they are taken from, and when.
pub struct Shooting<'a> {
    report: &'a SimulationReport,
    film: film::Options,
    /// One camera, or one per picture.
    cameras: Vec<Camera>,
    /// Number of pictures.
    count: usize,
    /// See [`simulated`](super::simulated).
    simulated: &'a [bool],
}

/// The film of a simulation.
pub struct Films {
    /// The film as MP4, or as GIF if ffmpeg is not installed or fails.
    pub film: Film,
    /// A small GIF for pages.
    pub animation: Vec<u8>,
    /// Why there is no MP4 although ffmpeg is installed.
    pub failure: Option<std::io::Error>,
}

impl<'a> Shooting<'a> {
    /// The film of `report`. `photo` is the camera that [`Viewpoint::film_from`] names; `simulated` says which Gaussians
    /// are [`simulated`](super::simulated).
    pub fn new(
        report: &'a SimulationReport,
        viewpoint: &Viewpoint,
        photo: Option<&Camera>,
        simulated: &'a [bool],
    ) -> Self {
        let simulated_s = report.frames.last().map_or(0.0, |frame| frame.t_s);
        let film_s = simulated_s * slowed(simulated_s);
        let count = (film_s * f64::from(viewpoint.film.fps)).round() as usize + 1;
        let size = viewpoint.film.size;
        let cameras = match photo {
            None => cameras_around(report, viewpoint, count, size),
            Some(photo) => vec![fitted(photo, size)],
        };
        Self { report, film: viewpoint.film, cameras, count, simulated }
    }

    /// Number of pictures.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Draws the pictures and passes them to `take` in order, while the next ones are drawn. `load` returns the Gaussians of
    /// a frame by its index.
    ///
    /// # Errors
    /// The errors of `load` and of `take`.
    pub fn draw<E: Send>(
        &self,
        load: &mut dyn FnMut(usize) -> Result<Gaussians, E>,
        take: &mut (dyn FnMut(RgbImage) -> Result<(), E> + Send),
        progress: Progress,
    ) -> Result<(), E> {
        let bar = progress.bar("film", self.count as u64);
        let mut motion = Motion::new(self.report.frames.len(), self.simulated, load);
        // A camera that moves sees another ground in each picture.
        let ground = (self.cameras.len() == 1).then(|| self.ground(0));
        let mut drawn: Vec<RgbImage> = Vec::new();
        for first in (0..self.count).step_by(AT_ONCE) {
            let shown = first..self.count.min(first + AT_ONCE);
            let moments = shown.map(|index| motion.at(self.frame_at(index))).collect::<Result<Vec<_>, E>>()?;
            let draw = |n: usize| self.picture(first + n, &moments[n], ground.as_ref());
            let (taken, next) = parallel::join(
                || drawn.drain(..).try_for_each(&mut *take),
                || parallel::map_range(moments.len(), draw),
            );
            taken?;
            drawn = next;
            bar.inc(drawn.len() as u64);
        }
        drawn.into_iter().try_for_each(take)?;
        bar.finish_and_clear();
        Ok(())
    }

    /// The film and the animation for pages.
    ///
    /// # Errors
    /// The errors of `load`, and [`FilmError`].
    pub fn films<E: From<FilmError> + Send>(
        &self,
        load: &mut dyn FnMut(usize) -> Result<Gaussians, E>,
        progress: Progress,
    ) -> Result<Films, E> {
        let samples = self.samples(load)?;
        let small_samples: Vec<RgbImage> = samples.iter().map(small).collect();
        let mut animation = Gif::new(small_fps(self.film.fps), &small_samples).map_err(FilmError::from)?;
        let mut recorder = Recorder::start(self.film.fps, &samples)?;
        let (mut index, mut small_index) = (0, 0);
        let mut take = |picture: RgbImage| -> Result<(), E> {
            if index == nearest_in_film(small_index, self.film.fps) {
                animation.add(&small(&picture)).map_err(FilmError::from)?;
                small_index += 1;
            }
            index += 1;
            Ok(recorder.add(&picture)?)
        };
        self.draw(load, &mut take, progress)?;
        let animation = animation.finish().map_err(FilmError::from)?;
        let Recorded { film, failure } = recorder.finish()?;
        // ffmpeg failed after the pictures had been passed to it alone: they are drawn again.
        let film = match film {
            Some(film) => film,
            None => {
                let mut gif = Gif::new(self.film.fps, &samples).map_err(FilmError::from)?;
                let mut take = |picture: RgbImage| -> Result<(), E> { Ok(gif.add(&picture).map_err(FilmError::from)?) };
                self.draw(load, &mut take, progress)?;
                Film::Gif(gif.finish().map_err(FilmError::from)?)
            }
        };
        Ok(Films { film, animation, failure })
    }

    /// A few pictures of the film, spread evenly.
    fn samples<E>(&self, load: &mut dyn FnMut(usize) -> Result<Gaussians, E>) -> Result<Vec<RgbImage>, E> {
        let frames = self.report.frames.len();
        let index_of = |n: usize| n * (self.count - 1) / (GIF_SAMPLES - 1);
        (0..GIF_SAMPLES)
            .map(|n| {
                let frame = (self.frame_at(index_of(n)).round() as usize).min(frames - 1);
                Ok(self.picture(index_of(n), &load(frame)?, None))
            })
            .collect()
    }

    /// The frame, with its fraction, that a picture shows.
    fn frame_at(&self, index: usize) -> f64 {
        let frames = self.report.frames.len();
        (frames - 1) as f64 * index as f64 / (self.count - 1).max(1) as f64
    }

    /// A picture, over the `ground` that its camera sees.
    fn picture(&self, index: usize, gaussians: &Gaussians, ground: Option<&Ground>) -> RgbImage {
        let render = render::render(gaussians, self.camera(index), &RenderOptions::default());
        match ground {
            Some(ground) => over(&render, ground, &ground.shadow(gaussians)),
            None => {
                let ground = self.ground(index);
                over(&render, &ground, &ground.shadow(gaussians))
            }
        }
    }

    /// The ground in a picture.
    fn ground(&self, index: usize) -> Ground {
        Ground::new(self.report.ground_z_m / self.report.meters_per_unit, self.report, self.camera(index))
    }

    fn camera(&self, index: usize) -> &Camera {
        &self.cameras[index % self.cameras.len()]
    }
}

/// The photo's camera with a picture that fits into `size`.
fn fitted(photo: &Camera, size: Size) -> Camera {
    let i = photo.intrinsics;
    let factor = (f64::from(size.width) / f64::from(i.width)).min(f64::from(size.height) / f64::from(i.height));
    // Even, as video encoders require.
    let side = |pixels: u32| ((f64::from(pixels) * factor / 2.0).round() as u32).max(1) * 2;
    let mut intrinsics = i.resized(side(i.width), side(i.height));
    intrinsics.distortion = Distortion::default();
    Camera { intrinsics, ..*photo }
}

/// The picture in the size for pages.
fn small(picture: &RgbImage) -> RgbImage {
    let longest = picture.width().max(picture.height());
    if longest <= SMALL_PX {
        return picture.clone();
    }
    let side = |length: u32| (length * SMALL_PX / longest).max(1);
    imageops::thumbnail(picture, side(picture.width()), side(picture.height()))
}

/// Composites the object over the ground.
fn over(render: &render::Render, ground: &Ground, shadow: &Shadow) -> RgbImage {
    let mut picture = RgbImage::new(render.width, render.height);
    parallel::for_each_mut(picture.as_chunks_mut::<3>().0, |i, pixel| {
        let under = ground.color(i, shadow);
        for c in 0..3 {
            let light = render.rgb[i][c] + (1.0 - render.alpha[i]) * under[c];
            // `round` would be a call per pixel.
            pixel[c] = (light.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        }
    });
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every picture is shown within half a picture of the film of the time at which the film shows it.
    #[test]
    fn the_animation_for_pages_plays_as_fast_as_the_film() {
        for fps in 1..=60 {
            let rate = small_fps(fps);
            assert!(rate <= fps && rate >= fps.min(SMALL_FPS), "{rate} of {fps} pictures per second");
            for index in 0..300 {
                let in_film_s = nearest_in_film(index, fps) as f64 / f64::from(fps);
                let late_s = (in_film_s - index as f64 / f64::from(rate)).abs();
                // Apart from rounding.
                assert!(late_s <= 0.5 / f64::from(fps) + 1e-9, "picture {index} at {fps}: off by {late_s} s");
            }
        }
    }
}
