//! `_s.npy`: segment ids as int32 (as float32 in the files that LangSplat itself writes), -1 where there is no segment.

use std::io::{self, Write};

use super::super::{LabelMap, LabelMapError, Level};
use crate::files::npy::{NpyArray, NpyError, write_npy};

impl LabelMap {
    /// Writes the map as `[height, width]`, or as `planes` identical copies of it.
    pub fn write_npy(&self, planes: Option<u64>, out: &mut dyn Write) -> io::Result<()> {
        let mut shape: Vec<u64> = planes.into_iter().collect();
        shape.extend([u64::from(self.height), u64::from(self.width)]);
        let planes = 0..planes.unwrap_or(1);
        write_npy(out, &shape, planes.flat_map(|_| self.labels.iter().map(|&label| i32::from(label) - 1)))
    }

    /// Reads the map from an array of int32, int64, or whole numbers as float32: `[height, width]`, or planes of that;
    /// LangSplat's four planes are default, small, middle and large. Ids are renumbered from 1.
    pub fn from_npy(bytes: &[u8], level: Level) -> Result<Self, LabelMapError> {
        let array = NpyArray::open(bytes).map_err(|error| LabelMapError::Npy(error.to_string()))?;
        let shape = array.shape.clone();
        let (planes, height, width) = match *shape.as_slice() {
            [height, width] => (1, height, width),
            [planes @ (1 | 4), height, width] => (planes, height, width),
            _ => return Err(LabelMapError::NpyShape(shape)),
        };
        let count = planes.checked_mul(height).and_then(|count| count.checked_mul(width));
        // Also prevents a wrong header from requesting memory that the file cannot fill.
        let fits = count.is_some_and(|count| count > 0 && count <= bytes.len() as u64);
        let (Ok(height), Ok(width), true) = (u32::try_from(height), u32::try_from(width), fits) else {
            return Err(LabelMapError::NpyShape(shape));
        };
        if array.fortran_order {
            return Err(LabelMapError::Npy(NpyError::Fortran.to_string()));
        }
        let of_int32 = || Some(array.numbers::<i32>()?.into_iter().map(i64::from).collect());
        // LangSplat collects its maps in a tensor of PyTorch's default type.
        let of_float32 = || -> Option<Vec<i64>> { array.numbers::<f32>()?.into_iter().map(whole).collect() };
        let ids: Option<Vec<i64>> = array.numbers().or_else(of_int32).or_else(of_float32);
        let ids = ids.ok_or_else(|| LabelMapError::NpyType(array.kind()))?;
        let plane = match (planes, level) {
            (1, _) => 0,
            (_, Level::Small) => 1,
            (_, Level::Middle) => 2,
            (_, Level::Large) => 3,
        };
        let area = width as usize * height as usize;
        Self::of_ids(width, height, &ids[plane * area..(plane + 1) * area])
    }
}

/// The id that a float stands for; `None` if it is not a whole number, or is so large that it could be rounded.
fn whole(id: f32) -> Option<i64> {
    /// Up to this, every whole number is a float32.
    const MOST: f32 = 16_777_216.0;
    (id.fract() == 0.0 && id.abs() <= MOST).then_some(id as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> LabelMap {
        LabelMap { width: 3, height: 2, labels: vec![0, 1, 2, 0, 0, 2] }
    }

    fn written(planes: Option<u64>) -> Vec<u8> {
        let mut bytes = Vec::new();
        map().write_npy(planes, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn a_map_survives_both_shapes() {
        for planes in [None, Some(4)] {
            assert_eq!(LabelMap::from_npy(&written(planes), Level::Middle).unwrap(), map());
        }
    }

    #[test]
    fn the_bytes_are_numpys_with_minus_one_for_background() {
        let bytes = written(None);
        assert!(bytes.starts_with(b"\x93NUMPY"));
        let array = NpyArray::open(&bytes).unwrap();
        assert_eq!((array.kind().as_str(), &array.shape[..], array.fortran_order), ("'<i4'", &[2, 3][..], false));
        let values: Vec<i32> =
            bytes[bytes.len() - 24..].chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(values, [-1, 0, 1, -1, -1, 1]);
    }

    #[test]
    fn ids_are_renumbered_and_the_levels_plane_is_taken() {
        let mut bytes = Vec::new();
        let values = [-1_i64, -1, 9, 9, -1, 40, 30, 30];
        write_npy(&mut bytes, &[4, 1, 2], values).unwrap();
        assert_eq!(LabelMap::from_npy(&bytes, Level::Small).unwrap().labels, [1, 1]);
        assert_eq!(LabelMap::from_npy(&bytes, Level::Middle).unwrap().labels, [0, 1]);
        assert_eq!(LabelMap::from_npy(&bytes, Level::Large).unwrap().labels, [1, 1]);
    }

    /// LangSplat's `preprocess.py` stacks its maps into `torch.zeros(...)`, which is float32, and saves that.
    #[test]
    fn the_floats_that_langsplat_writes_are_ids() {
        let mut bytes = Vec::new();
        write_npy(&mut bytes, &[4, 1, 2], [-1.0_f32, 0.0, 1.0, -1.0, 3.0, 2.0, 4.0, 4.0]).unwrap();
        assert_eq!(LabelMap::from_npy(&bytes, Level::Small).unwrap().labels, [1, 0]);
        assert_eq!(LabelMap::from_npy(&bytes, Level::Middle).unwrap().labels, [2, 1]);
        assert_eq!(LabelMap::from_npy(&bytes, Level::Large).unwrap().labels, [1, 1]);
    }

    /// Version 1 of the format with this header and content.
    fn npy(header: &str, content: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes(), content].concat()
    }

    #[test]
    fn what_is_wrong_with_an_array_is_said() {
        let message = |bytes: &[u8]| LabelMap::from_npy(bytes, Level::Small).unwrap_err().to_string();
        let header = |kind: &str| format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (20, 30), }}\n");
        let objects = message(&npy(&header("|O"), &[0x80; 700]));
        assert!(objects.contains("Python objects, not numbers"), "{objects}");
        // Truncated slightly, heavily, within the header, and before the header.
        let whole = npy(&header("<i4"), &[0; 2400]);
        assert!(LabelMap::from_npy(&whole, Level::Small).is_ok());
        for left in [2399, 100, 0] {
            let cut = message(&whole[..whole.len() - 2400 + left]);
            assert!(
                cut.contains("cut off") && cut.contains("2400 bytes") && cut.contains(&format!("{left} follow")),
                "{cut}"
            );
        }
        assert!(message(&whole[..30]).contains("within its header"));
        assert!(message(&whole[..8]).contains("within its header"));
        assert!(message(b"PK\x03\x04 a zip file").contains("does not begin like a NumPy file"));
    }

    #[test]
    fn what_is_no_such_array_is_refused() {
        let whole = written(None);
        for bytes in [&b"no array"[..], &whole[..whole.len() - 3]] {
            assert!(matches!(LabelMap::from_npy(bytes, Level::Small), Err(LabelMapError::Npy(_))));
        }
        let refused = |bytes: &[u8]| matches!(LabelMap::from_npy(bytes, Level::Small), Err(LabelMapError::NpyType(_)));
        for id in [0.5, f32::NAN, f32::INFINITY, 1e9] {
            let mut floats = Vec::new();
            write_npy(&mut floats, &[1, 2], [1.0, id]).unwrap();
            assert!(refused(&floats), "{id}");
        }
        let mut doubles = Vec::new();
        write_npy(&mut doubles, &[1, 1], [1.0_f64]).unwrap();
        assert!(refused(&doubles));
    }
}
