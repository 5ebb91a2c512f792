//! The animation as MP4, if ffmpeg is installed.

use std::io::{self, Read, Write};
use std::process::{Command, Stdio};

use image::RgbImage;

use super::FRAME_MS;

/// Encodes H.264 in a fragmented MP4, which needs no second pass over the file; `None` if ffmpeg is not installed. The
/// pictures must have even width and height.
///
/// # Errors
/// If ffmpeg fails, most likely because it was built without H.264.
pub fn mp4(pictures: &[RgbImage]) -> io::Result<Option<Vec<u8>>> {
    let Some(first) = pictures.first() else { return Ok(None) };
    let (size, rate) = (format!("{}x{}", first.width(), first.height()), format!("1000/{FRAME_MS}"));
    let input = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size, "-r", &rate, "-i", "-"];
    let output = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "frag_keyframe+empty_moov", "-f", "mp4", "-"];
    let mut command = Command::new("ffmpeg");
    command.args(["-loglevel", "error"]).args(input).args(output);
    let started = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
    let mut ffmpeg = match started {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        started => started?,
    };
    let (mut stdin, mut stdout) = (ffmpeg.stdin.take().expect("piped"), ffmpeg.stdout.take().expect("piped"));
    let mut bytes = Vec::new();
    let (fed, read) = std::thread::scope(|scope| {
        let feeding = scope.spawn(move || pictures.iter().try_for_each(|picture| stdin.write_all(picture.as_raw())));
        let read = stdout.read_to_end(&mut bytes);
        (feeding.join().expect("writing does not panic"), read)
    });
    read?;
    let status = ffmpeg.wait()?;
    if !status.success() {
        return Err(io::Error::other(format!("ffmpeg ended with {status}")));
    }
    fed.map(|()| Some(bytes))
}
