//! The families of square markers that gprop knows, and the code of each marker.
//!
//! `codes/` has one file per code book, with one hexadecimal number per marker, in the order of their ids: the cells inside
//! the black border row by row from the upper left one, the first in the highest bit, 1 for white. The numbers were read
//! from OpenCV 5.0 (`cv2.aruco.getPredefinedDictionary`), which has those of AprilTag 3 (University of Michigan, BSD
//! licence) and of ArUco (Garrido-Jurado et al., *Pattern Recognition* 51, 2016; Apache licence).

use std::fmt;
use std::str::FromStr;

/// A set of markers that can be told apart.
pub(super) struct Family {
    /// The word before the colon of `--scale`.
    kind: &'static str,
    name: &'static str,
    /// Cells per side inside the border, which is one cell wide.
    pub inner: usize,
    /// Number of markers: that many from the beginning of the code book.
    pub count: usize,
    /// Cells that may be misread: fewer than half of those in which any two markers of the family differ, whichever way
    /// up.
    pub correctable: u32,
    codes: &'static str,
}

const APRILTAG: &str = "apriltag";
const ARUCO: &str = "aruco";

macro_rules! book {
    ($name:literal) => {
        include_str!(concat!("codes/", $name, ".txt"))
    };
}

const fn family(
    kind: &'static str,
    name: &'static str,
    inner: usize,
    count: usize,
    correctable: u32,
    codes: &'static str,
) -> Family {
    Family { kind, name, inner, count, correctable, codes }
}

static FAMILIES: [Family; 21] = [
    family(APRILTAG, "36h11", 6, 587, 5, book!("36h11")),
    family(APRILTAG, "25h9", 5, 35, 4, book!("25h9")),
    family(APRILTAG, "16h5", 4, 30, 2, book!("16h5")),
    family(ARUCO, "4x4_50", 4, 50, 1, book!("4x4")),
    family(ARUCO, "4x4_100", 4, 100, 1, book!("4x4")),
    family(ARUCO, "4x4_250", 4, 250, 1, book!("4x4")),
    family(ARUCO, "4x4_1000", 4, 1000, 0, book!("4x4")),
    family(ARUCO, "5x5_50", 5, 50, 3, book!("5x5")),
    family(ARUCO, "5x5_100", 5, 100, 3, book!("5x5")),
    family(ARUCO, "5x5_250", 5, 250, 2, book!("5x5")),
    family(ARUCO, "5x5_1000", 5, 1000, 2, book!("5x5")),
    family(ARUCO, "6x6_50", 6, 50, 6, book!("6x6")),
    family(ARUCO, "6x6_100", 6, 100, 5, book!("6x6")),
    family(ARUCO, "6x6_250", 6, 250, 5, book!("6x6")),
    family(ARUCO, "6x6_1000", 6, 1000, 4, book!("6x6")),
    family(ARUCO, "7x7_50", 7, 50, 9, book!("7x7")),
    family(ARUCO, "7x7_100", 7, 100, 8, book!("7x7")),
    family(ARUCO, "7x7_250", 7, 250, 8, book!("7x7")),
    family(ARUCO, "7x7_1000", 7, 1000, 6, book!("7x7")),
    family(ARUCO, "original", 5, 1024, 0, book!("original")),
    family(ARUCO, "mip_36h12", 6, 250, 5, book!("mip_36h12")),
];

/// Prefixes of the families' names elsewhere: AprilTag's `tag36h11`, OpenCV's `DICT_4X4_50`.
const PREFIXES: [&str; 4] = ["dict_apriltag_", "dict_aruco_", "dict_", "tag"];

impl Family {
    fn find(kind: &str, name: &str) -> Option<&'static Self> {
        let lower = name.trim().to_ascii_lowercase();
        let bare = PREFIXES.iter().find_map(|prefix| lower.strip_prefix(prefix)).unwrap_or(&lower);
        FAMILIES.iter().find(|family| family.kind == kind && family.name == bare)
    }

    /// Cells per side with the border.
    pub fn cells(&self) -> usize {
        self.inner + 2
    }

    /// The codes of all markers, by id.
    pub fn codes(&self) -> Vec<u64> {
        let lines = self.codes.lines().take(self.count);
        lines.map(|line| u64::from_str_radix(line, 16).expect("a code book holds hexadecimal numbers")).collect()
    }
}

/// A printed square by which the scale is found, as in `apriltag:36h11,0`.
#[derive(Clone, Copy)]
pub struct Marker {
    pub(super) family: &'static Family,
    pub(super) id: usize,
}

impl fmt::Debug for Marker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl PartialEq for Marker {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl Marker {
    /// Whether a word before a colon stands for a kind of marker.
    pub(in crate::scene) fn is_kind(kind: &str) -> bool {
        FAMILIES.iter().any(|family| family.kind == kind)
    }

    /// For each cell from the upper left one, row by row, whether it is white.
    pub(super) fn whites(&self) -> Vec<bool> {
        let (code, bits) = (self.family.codes()[self.id], self.family.inner.pow(2));
        (0..bits).map(|bit| code >> (bits - 1 - bit) & 1 == 1).collect()
    }

    /// Another marker of the same family.
    pub(super) fn sibling(&self, id: usize) -> Self {
        Self { id, ..*self }
    }
}

impl FromStr for Marker {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parsed = text.split_once(':').and_then(|(kind, rest)| {
            let (name, id) = rest.split_once(',')?;
            Some((kind.trim(), name, id.trim().parse::<usize>().ok()?))
        });
        let Some((kind, name, id)) = parsed.filter(|(kind, ..)| Self::is_kind(kind)) else {
            return Err(format!(
                "{text:?} is not a marker: apriltag:FAMILY,ID or aruco:DICT,ID, such as apriltag:36h11,0"
            ));
        };
        let Some(family) = Family::find(kind, name) else {
            let known: Vec<&str> =
                FAMILIES.iter().filter(|family| family.kind == kind).map(|family| family.name).collect();
            return Err(format!("gprop knows no {kind} family {name:?}; it knows {}", known.join(", ")));
        };
        if id >= family.count {
            return Err(format!("{kind}:{} has the ids 0 to {}, not {id}", family.name, family.count - 1));
        }
        let code = family.codes()[id];
        if (1..4).any(|quarters| (0..quarters).fold(code, |code, _| turned(code, family.inner)) == code) {
            return Err(format!("{kind}:{},{id} looks the same when it is turned; choose another", family.name));
        }
        Ok(Self { family, id })
    }
}

/// The cells of a code turned by a quarter.
fn turned(code: u64, inner: usize) -> u64 {
    let bit = |row: usize, column: usize| code >> (inner * inner - 1 - row * inner - column) & 1;
    (0..inner * inner).fold(0, |turned, at| turned << 1 | bit(at % inner, inner - 1 - at / inner))
}

impl fmt::Display for Marker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{},{}", self.family.kind, self.family.name, self.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of correctable bits follows from the codes themselves.
    #[test]
    fn any_two_markers_differ_in_more_than_twice_what_is_correctable() {
        for family in &FAMILIES {
            let codes = family.codes();
            assert_eq!(codes.len(), family.count, "{}", family.name);
            let mut least = u32::MAX;
            for (id, code) in codes.iter().enumerate() {
                let mut other_way_up = *code;
                for quarter in 0..4 {
                    let others = codes
                        .iter()
                        .enumerate()
                        .filter(|(other, code)| *other > id || (quarter > 0 && *other == id && **code != other_way_up));
                    least =
                        others.map(|(_, other)| (other ^ other_way_up).count_ones()).min().unwrap_or(least).min(least);
                    other_way_up = turned(other_way_up, family.inner);
                }
            }
            assert!(least > 2 * family.correctable, "{}: two markers differ in {least} cells", family.name);
        }
    }

    #[test]
    fn names_are_read_as_other_programs_write_them() {
        for text in ["apriltag:36h11,7", "apriltag:tag36h11, 7", "apriltag:DICT_APRILTAG_36h11,7"] {
            assert_eq!(text.parse::<Marker>().unwrap().to_string(), "apriltag:36h11,7");
        }
        assert_eq!("aruco:DICT_4X4_50,49".parse::<Marker>().unwrap().to_string(), "aruco:4x4_50,49");
        for (text, problem) in [
            ("apriltag:36h11,587", "ids 0 to 586"),
            ("apriltag:41h12,0", "it knows 36h11, 25h9, 16h5"),
            ("aruco:36h11,0", "it knows 4x4_50"),
            ("aruco:original,1023", "looks the same when it is turned"),
            ("qr:1,0", "is not a marker"),
            ("apriltag:36h11", "is not a marker"),
            ("apriltag:36h11,-1", "is not a marker"),
        ] {
            let told = text.parse::<Marker>().unwrap_err();
            assert!(told.contains(problem), "{text}: {told}");
        }
    }
}
