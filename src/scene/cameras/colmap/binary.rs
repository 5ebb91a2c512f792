//! `cameras.bin`, `images.bin` and `points3D.bin`: little endian, a 64-bit count, then the entries without padding.

use nalgebra::Point3;

use super::{Cameras, Image, Problem, models};

/// Bytes of one observed point of an image: x, y, and the number of the 3D point.
const OBSERVATION: u64 = 24;
/// Bytes of one picture that shows a point: the image, and the number of the observation in it.
const TRACK: u64 = 8;
/// Bytes of an image without a name and without observations: its number, pose and camera, the end of its name, and the count
/// of its observations.
pub(super) const LEAST_BYTES_OF_IMAGE: u64 = 4 + 7 * 8 + 4 + 1 + 8;

pub(super) fn cameras(bytes: &[u8]) -> Result<Cameras, Problem> {
    let mut reader = Reader::new(bytes, "camera")?;
    let mut cameras = Cameras::new();
    while reader.index < reader.count {
        let id = u32::from_le_bytes(reader.take()?);
        let (model, count) = models::of_number(id, i32::from_le_bytes(reader.take()?))?;
        let size = (u64::from_le_bytes(reader.take()?), u64::from_le_bytes(reader.take()?));
        let parameters: Vec<f64> = (0..count).map(|_| reader.float()).collect::<Result<_, _>>()?;
        cameras.insert(id, models::declared(id, model, size, &parameters)?);
        reader.index += 1;
    }
    Ok(cameras)
}

pub(super) fn images(bytes: &[u8]) -> Result<Vec<Image>, Problem> {
    let mut reader = Reader::new(bytes, "image")?;
    let mut images = Vec::new();
    while reader.index < reader.count {
        let id = u32::from_le_bytes(reader.take()?);
        let mut quaternion = [0.0; 4];
        for component in &mut quaternion {
            *component = reader.float()?;
        }
        let translation = [reader.float()?, reader.float()?, reader.float()?];
        let camera = u32::from_le_bytes(reader.take()?);
        let name = reader.name()?;
        let observations = u64::from_le_bytes(reader.take()?);
        reader.skip(observations.checked_mul(OBSERVATION))?;
        images.push(Image::new(id, camera, name, quaternion, translation)?);
        reader.index += 1;
    }
    Ok(images)
}

pub(super) fn points(bytes: &[u8]) -> Result<Vec<Point3<f64>>, Problem> {
    let mut reader = Reader::new(bytes, "point")?;
    let mut points = Vec::new();
    while reader.index < reader.count {
        reader.take::<8>()?;
        points.push(Point3::new(reader.float()?, reader.float()?, reader.float()?));
        // Colour and error.
        reader.take::<3>()?;
        reader.float()?;
        let track = u64::from_le_bytes(reader.take()?);
        reader.skip(track.checked_mul(TRACK))?;
        reader.index += 1;
    }
    Ok(points)
}

/// Reads values one after the other and keeps track of the entry it is in.
struct Reader<'a> {
    rest: &'a [u8],
    what: &'static str,
    index: u64,
    count: u64,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8], what: &'static str) -> Result<Self, Problem> {
        let mut reader = Self { rest: bytes, what, index: 0, count: 0 };
        reader.count = u64::from_le_bytes(reader.take()?);
        Ok(reader)
    }

    fn truncated(&self) -> Problem {
        Problem::Truncated { what: self.what, index: self.index, count: self.count }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        let (value, rest) = self.rest.split_first_chunk().ok_or_else(|| self.truncated())?;
        self.rest = rest;
        Ok(*value)
    }

    fn float(&mut self) -> Result<f64, Problem> {
        self.take().map(f64::from_le_bytes)
    }

    /// Reads text up to a zero byte.
    fn name(&mut self) -> Result<String, Problem> {
        let end = self.rest.iter().position(|byte| *byte == 0).ok_or_else(|| self.truncated())?;
        let name = String::from_utf8_lossy(&self.rest[..end]).into_owned();
        self.rest = &self.rest[end + 1..];
        Ok(name)
    }

    fn skip(&mut self, bytes: Option<u64>) -> Result<(), Problem> {
        let bytes = bytes.and_then(|bytes| usize::try_from(bytes).ok());
        self.rest = bytes.and_then(|bytes| self.rest.get(bytes..)).ok_or_else(|| self.truncated())?;
        Ok(())
    }
}
