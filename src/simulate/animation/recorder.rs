//! A film while its pictures are drawn: an MP4 if ffmpeg is installed, else a GIF.

use std::io;

use image::RgbImage;

use crate::film::FilmError;
use crate::film::gif::Gif;
use crate::film::mp4::Mp4;

/// A film as a file.
pub enum Film {
    Mp4(Vec<u8>),
    Gif(Vec<u8>),
}

/// What takes the pictures.
pub struct Recorder {
    mp4: Option<Mp4>,
    gif: Option<Gif>,
    failure: Option<io::Error>,
}

/// What was recorded.
pub struct Recorded {
    /// `None` if ffmpeg failed after the pictures had been passed to it alone.
    pub film: Option<Film>,
    /// Why there is no MP4 although ffmpeg is installed.
    pub failure: Option<io::Error>,
}

impl Recorder {
    /// Starts a film of pictures like the `samples`.
    ///
    /// # Errors
    /// If the GIF cannot be encoded.
    pub fn start(fps: u32, samples: &[RgbImage]) -> Result<Self, FilmError> {
        let (mp4, failure) = match Mp4::start(samples[0].dimensions(), fps) {
            Ok(started) => (started, None),
            Err(error) => (None, Some(error)),
        };
        let gif = if mp4.is_none() { Some(Gif::new(fps, samples)?) } else { None };
        Ok(Self { mp4, gif, failure })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// If the GIF cannot be encoded.
    pub fn add(&mut self, picture: &RgbImage) -> Result<(), FilmError> {
        if let Some(gif) = &mut self.gif {
            gif.add(picture)?;
        }
        if let Some(Err(error)) = self.mp4.as_mut().map(|film| film.add(picture)) {
            (self.mp4, self.failure) = (None, Some(error));
        }
        Ok(())
    }

    /// The film.
    ///
    /// # Errors
    /// If the GIF cannot be encoded.
    pub fn finish(self) -> Result<Recorded, FilmError> {
        let Self { mp4, gif, mut failure } = self;
        let film = match mp4.map(Mp4::finish) {
            Some(Ok(bytes)) => Some(Film::Mp4(bytes)),
            ended => {
                failure = failure.or(ended.and_then(Result::err));
                gif.map(Gif::finish).transpose()?.map(Film::Gif)
            }
        };
        Ok(Recorded { film, failure })
    }
}
