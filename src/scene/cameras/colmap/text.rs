//! `cameras.txt` (one line per camera), `images.txt` (two lines per image, the second of which lists its points and may be
//! empty; some programs leave it out) and `points3D.txt` (one line per point). Lines that start with `#` are comments.

use std::str::FromStr;

use nalgebra::Point3;

use super::{Cameras, Image, Problem, models};

pub(super) fn cameras(text: &str) -> Result<Cameras, Problem> {
    let mut cameras = Cameras::new();
    for (line, text) in numbered(text).filter(|(_, text)| !is_remark(text) && !text.is_empty()) {
        let mut words = Words { words: text.split_ascii_whitespace(), line };
        let id = words.number("CAMERA_ID")?;
        let model = words.word("MODEL")?;
        let size = (words.number("WIDTH")?, words.number("HEIGHT")?);
        let mut parameters = Vec::new();
        for word in words.words {
            parameters.push(parsed(word, "PARAMS", line)?);
        }
        cameras.insert(id, models::declared(id, model, size, &parameters)?);
    }
    Ok(cameras)
}

/// The images of an `images.txt`.
pub(super) struct Listed {
    pub images: Vec<Image>,
    /// The number of images that another image follows directly, without a line of points between them.
    pub without_points: usize,
}

pub(super) fn images(text: &str) -> Result<Listed, Problem> {
    let mut listed = Listed { images: Vec::new(), without_points: 0 };
    let mut lines = numbered(text).peekable();
    while let Some((line, text)) = lines.next() {
        if is_remark(text) || text.is_empty() {
            continue;
        }
        let mut words = Words { words: text.split_ascii_whitespace(), line };
        let id = words.number("IMAGE_ID")?;
        let quaternion = [words.number("QW")?, words.number("QX")?, words.number("QY")?, words.number("QZ")?];
        let translation = [words.number("TX")?, words.number("TY")?, words.number("TZ")?];
        let camera = words.number("CAMERA_ID")?;
        // A name may contain spaces.
        let first = words.word("NAME")?;
        let name = text[offset(text, first)..].to_owned();
        listed.images.push(Image::new(id, camera, name, quaternion, translation)?);
        match lines.peek() {
            Some((_, next)) if is_image(next) => listed.without_points += 1,
            _ => drop(lines.next()),
        }
    }
    Ok(listed)
}

/// True if a line after that of an image is that of another one. A line of points consists of numbers in threes: x, y and
/// the number of the 3D point. The tenth word of an image's line is its name.
fn is_image(text: &str) -> bool {
    let words: Vec<&str> = text.split_ascii_whitespace().take(10).collect();
    let [id, pose @ .., camera, name] = &words[..] else { return false };
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let begins_like_one = words.len() == 10
        && id.parse::<u32>().is_ok()
        && pose.iter().all(|word| is_number(word))
        && camera.parse::<u32>().is_ok();
    // A name such as `000` is a number too, but then there is nothing after it.
    begins_like_one && (!is_number(name) || text.split_ascii_whitespace().nth(10).is_none())
}

pub(super) fn points(text: &str) -> Result<Vec<Point3<f64>>, Problem> {
    let mut points = Vec::new();
    for (line, text) in numbered(text).filter(|(_, text)| !is_remark(text) && !text.is_empty()) {
        let mut words = Words { words: text.split_ascii_whitespace(), line };
        words.word("POINT3D_ID")?;
        points.push(Point3::new(words.number("X")?, words.number("Y")?, words.number("Z")?));
    }
    Ok(points)
}

fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()))
}

fn is_remark(text: &str) -> bool {
    text.starts_with('#')
}

/// The offset at which `part`, a slice of `text`, begins in it.
fn offset(text: &str, part: &str) -> usize {
    part.as_ptr() as usize - text.as_ptr() as usize
}

struct Words<'a> {
    words: std::str::SplitAsciiWhitespace<'a>,
    line: usize,
}

impl<'a> Words<'a> {
    fn word(&mut self, what: &str) -> Result<&'a str, Problem> {
        self.words.next().ok_or_else(|| Problem::Line { line: self.line, reason: format!("{what} is missing") })
    }

    fn number<T: FromStr>(&mut self, what: &str) -> Result<T, Problem> {
        let word = self.word(what)?;
        parsed(word, what, self.line)
    }
}

fn parsed<T: FromStr>(word: &str, what: &str, line: usize) -> Result<T, Problem> {
    let shortened = || word.chars().take(40).collect::<String>();
    word.parse().map_err(|_| Problem::Line { line, reason: format!("{what} is `{}`, not a number", shortened()) })
}
