//! H.264 in MP4, if ffmpeg is installed.

use std::io::{self, Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use image::RgbImage;

/// A film that ffmpeg encodes while its pictures are drawn.
pub struct Mp4 {
    ffmpeg: Child,
    pictures: ChildStdin,
    film: JoinHandle<io::Result<Vec<u8>>>,
}

impl Mp4 {
    /// Starts a film of pictures of `width` x `height` pixels, both even; `None` if ffmpeg is not installed. The file
    /// is a fragmented MP4, which needs no second pass, and depends neither on the number of threads nor on ffmpeg's
    /// version text.
    ///
    /// # Errors
    /// If ffmpeg cannot be started.
    pub fn start((width, height): (u32, u32), fps: u32) -> io::Result<Option<Self>> {
        let (size, rate) = (format!("{width}x{height}"), fps.to_string());
        let input = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size, "-r", &rate, "-i", "-"];
        let codec = ["-c:v", "libx264", "-preset", "fast", "-crf", "20", "-threads", "2", "-pix_fmt", "yuv420p"];
        let colors = ["-vf", "scale=out_color_matrix=bt709", "-colorspace", "bt709", "-color_primaries", "bt709"];
        let output = ["-color_trc", "iec61966-2-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"];
        let format = ["-movflags", "frag_keyframe+empty_moov", "-f", "mp4", "-"];
        let mut command = Command::new("ffmpeg");
        command.args(["-loglevel", "error"]).args(input).args(codec).args(colors).args(output).args(format);
        let started = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut ffmpeg = match started {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            started => started?,
        };
        let (pictures, mut file) = (ffmpeg.stdin.take().expect("piped"), ffmpeg.stdout.take().expect("piped"));
        let film = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes)?;
            Ok(bytes)
        });
        Ok(Some(Self { ffmpeg, pictures, film }))
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// If ffmpeg has ended.
    pub fn add(&mut self, picture: &RgbImage) -> io::Result<()> {
        self.pictures.write_all(picture.as_raw())
    }

    /// The file.
    ///
    /// # Errors
    /// If ffmpeg fails, most likely because it was built without H.264.
    pub fn finish(mut self) -> io::Result<Vec<u8>> {
        drop(self.pictures);
        let bytes = self.film.join().expect("reading does not panic")?;
        let status = self.ffmpeg.wait()?;
        if !status.success() {
            return Err(io::Error::other(format!("ffmpeg ended with {status}")));
        }
        Ok(bytes)
    }
}
