//! Maps the properties of the file to their places in memory.

use std::collections::BTreeMap;

use ply_rs_bw::ply::{ElementDef, Encoding, PropertyType, ScalarType};

use super::Problem;
use super::header::Header;
use crate::gaussians::{ExtraProperty, Gaussians};
use crate::words::output::agreeing;

/// Indices of the arrays of [`Gaussians`] that a file fills; those for properties that gprop does not know start at
/// [`FIRST_EXTRA`].
const POSITIONS: usize = 0;
const LOG_SCALES: usize = 1;
const ROTATIONS: usize = 2;
const OPACITY_LOGITS: usize = 3;
const SH_DC: usize = 4;
const SH_REST: usize = 5;
const FIRST_EXTRA: usize = 6;

/// Every property a 3DGS PLY must have, with the array and the lane it belongs to.
const REQUIRED: [(&str, usize, usize); 14] = [
    ("x", POSITIONS, 0),
    ("y", POSITIONS, 1),
    ("z", POSITIONS, 2),
    ("f_dc_0", SH_DC, 0),
    ("f_dc_1", SH_DC, 1),
    ("f_dc_2", SH_DC, 2),
    ("opacity", OPACITY_LOGITS, 0),
    ("scale_0", LOG_SCALES, 0),
    ("scale_1", LOG_SCALES, 1),
    ("scale_2", LOG_SCALES, 2),
    ("rot_0", ROTATIONS, 0),
    ("rot_1", ROTATIONS, 1),
    ("rot_2", ROTATIONS, 2),
    ("rot_3", ROTATIONS, 3),
];

/// The one property of [`REQUIRED`] that 2D Gaussian Splatting leaves out: its Gaussians are flat.
const THIRD_SCALE: &str = "scale_2";

/// The elements that Apple's SHARP writes beside the Gaussians, which describe its one photo (`save_ply` in its source).
const OF_SHARP: [&str; 7] = ["extrinsic", "intrinsic", "image_size", "frame", "disparity", "color_space", "version"];
/// The one of them that no other program is known to write.
const SHARP_MARK: &str = "disparity";

/// The layout of a row in the file and the places its values go to.
pub(super) struct Layout {
    /// Rows that the header claims.
    pub count: u64,
    /// Bytes of a row in a binary file.
    pub stride: usize,
    /// Bytes (binary) or lines (ascii) of the elements before `vertex`.
    pub before: u128,
    /// Values of a row, in file order.
    pub columns: Vec<Column>,
    pub sh_degree: u8,
    /// Whether the Gaussians have no third scale.
    pub flat: bool,
    /// Names of the properties that gprop does not know, in file order.
    pub extra: Vec<String>,
    /// The element as ply-rs-bw declares it.
    pub vertex: ElementDef,
    /// Whether other elements follow, which gprop does not read.
    pub followed: bool,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

/// Adjacent properties of one type that are also adjacent in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Column {
    /// Bytes from the start of the row in a binary file.
    pub offset: usize,
    pub scalar: Scalar,
    /// Index of the array.
    pub array: usize,
    /// Index of the first value among the array's values for one Gaussian.
    pub lane: usize,
    /// Number of values.
    pub length: usize,
}

/// The same as ply-rs-bw's scalar type, but `Copy` and comparable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of(scalar: &ScalarType) -> Self {
        match scalar {
            ScalarType::Char => Self::I8,
            ScalarType::UChar => Self::U8,
            ScalarType::Short => Self::I16,
            ScalarType::UShort => Self::U16,
            ScalarType::Int => Self::I32,
            ScalarType::UInt => Self::U32,
            ScalarType::Float => Self::F32,
            ScalarType::Double => Self::F64,
        }
    }

    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// True if a float32 holds every value of this type.
    fn fits_f32(self) -> bool {
        !matches!(self, Self::I32 | Self::U32 | Self::F64)
    }
}

impl Layout {
    pub fn of(header: &Header) -> Result<Self, Problem> {
        let at = header.elements.iter().position(|e| e.name == "vertex").ok_or(Problem::NoVertex)?;
        let (before, vertex_and_after) = header.elements.split_at(at);
        let vertex = &vertex_and_after[0];
        let properties = scalar_properties(vertex)?;
        let sh_degree = check_is_splat(&properties)?;
        if vertex.count == 0 {
            return Err(Problem::Empty);
        }
        let mut layout = Self {
            count: vertex.count as u64,
            stride: properties.iter().map(|(_, scalar)| scalar.bytes()).sum(),
            before: size_before(before, &header.encoding)?,
            columns: Vec::new(),
            sh_degree,
            flat: !properties.iter().any(|(name, _)| *name == THIRD_SCALE),
            extra: Vec::new(),
            vertex: vertex.clone(),
            followed: vertex_and_after.len() > 1,
            notes: Vec::new(),
            warnings: Vec::new(),
        };
        layout.place(&properties);
        layout.tell_of_other_elements(&header.elements);
        Ok(layout)
    }

    /// Fills `columns` and `extra`.
    fn place(&mut self, properties: &[(&str, Scalar)]) {
        let mut offset = 0;
        let mut rounded = Vec::new();
        for &(name, scalar) in properties {
            let (array, lane) = place_of(name).unwrap_or_else(|| {
                if !scalar.fits_f32() {
                    rounded.push(name);
                }
                self.extra.push(name.to_owned());
                (FIRST_EXTRA + self.extra.len() - 1, 0)
            });
            match self.columns.last_mut() {
                Some(c) if c.scalar == scalar && c.array == array && c.lane + c.length == lane => c.length += 1,
                _ => self.columns.push(Column { offset, scalar, array, lane, length: 1 }),
            }
            offset += scalar.bytes();
        }
        if !rounded.is_empty() {
            self.warnings.push(format!(
                "{} {} {} rounded to 32 bits, which no result depends on",
                agreeing(rounded.len(), "property", "properties"),
                quoted(&rounded),
                agreeing(rounded.len(), "is", "are"),
            ));
        }
    }

    /// Says in one sentence which elements beside the Gaussians are left out. Those that a known program always writes are
    /// no cause for a warning.
    fn tell_of_other_elements(&mut self, elements: &[ElementDef]) {
        let others: Vec<&str> =
            elements.iter().filter(|e| e.name != "vertex" && e.count > 0).map(|e| e.name.as_str()).collect();
        if others.is_empty() {
            return;
        }
        let left_out = format!(
            "the file's {} {} {} not used, and field.ply does not have {}",
            agreeing(others.len(), "element", "elements"),
            quoted(&others),
            agreeing(others.len(), "is", "are"),
            agreeing(others.len(), "it", "them"),
        );
        if others.contains(&SHARP_MARK) && others.iter().all(|name| OF_SHARP.contains(name)) {
            self.notes.push(format!("Apple's SHARP: {left_out}; they describe the photo that the splat was made from"));
        } else {
            self.warnings.push(left_out);
        }
    }

    /// A cloud of `count` Gaussians with every array allocated and zero.
    pub fn allocate(&self, count: usize) -> Gaussians {
        let mut gaussians = Gaussians {
            positions: vec![[0.0; 3]; count],
            log_scales: vec![[0.0; 3]; count],
            rotations: vec![[0.0; 4]; count],
            opacity_logits: vec![0.0; count],
            sh_dc: vec![[0.0; 3]; count],
            sh_degree: self.sh_degree,
            ..Gaussians::default()
        };
        gaussians.sh_rest = vec![0.0; count * 3 * gaussians.sh_rest_per_channel()];
        gaussians.extra =
            self.extra.iter().map(|name| ExtraProperty { name: name.clone(), values: vec![0.0; count] }).collect();
        gaussians
    }
}

/// One array of a cloud, flattened, with the number of values per Gaussian.
pub(super) struct Array<'a> {
    pub values: &'a mut [f32],
    pub width: usize,
}

/// The arrays of a cloud in the order of the indices in [`Column::array`].
pub(super) fn arrays(gaussians: &mut Gaussians) -> Vec<Array<'_>> {
    let rest = 3 * gaussians.sh_rest_per_channel();
    let mut arrays = vec![
        Array { values: gaussians.positions.as_flattened_mut(), width: 3 },
        Array { values: gaussians.log_scales.as_flattened_mut(), width: 3 },
        Array { values: gaussians.rotations.as_flattened_mut(), width: 4 },
        Array { values: &mut gaussians.opacity_logits, width: 1 },
        Array { values: gaussians.sh_dc.as_flattened_mut(), width: 3 },
        Array { values: &mut gaussians.sh_rest, width: rest },
    ];
    arrays.extend(gaussians.extra.iter_mut().map(|extra| Array { values: &mut extra.values, width: 1 }));
    arrays
}

/// True if the largest magnitudes alone show that every Gaussian is [usable](Gaussians::is_usable).
pub(super) fn surely_usable(arrays: &[Array<'_>]) -> bool {
    arrays.iter().take(FIRST_EXTRA).enumerate().all(|(index, array)| {
        let limit = if index == LOG_SCALES { Gaussians::LOG_SCALE_LIMIT } else { f32::INFINITY };
        // No branch per value, so that the compiler can vectorize the loop.
        let largest = array.values.iter().fold(0, |largest: u32, value| largest.max(value.abs().to_bits()));
        f32::from_bits(largest) < limit
    })
}

/// The array and lane of a property that gprop knows.
fn place_of(name: &str) -> Option<(usize, usize)> {
    if let Some(index) = sh_rest_index(name) {
        return Some((SH_REST, index));
    }
    REQUIRED.iter().find(|(known, ..)| *known == name).map(|&(_, array, lane)| (array, lane))
}

fn sh_rest_index(name: &str) -> Option<usize> {
    let digits = name.strip_prefix("f_rest_")?;
    let index = digits.parse().ok()?;
    // `f_rest_07` would be a second name for `f_rest_7`.
    (digits == format!("{index}")).then_some(index)
}

/// Names from a file, of which a hostile one may have many.
fn quoted(names: &[&str]) -> String {
    const MOST_NAMED: usize = 8;
    let mut text: Vec<String> = names.iter().take(MOST_NAMED).map(|name| format!("`{name}`")).collect();
    if names.len() > MOST_NAMED {
        text.push(format!("{} more", names.len() - MOST_NAMED));
    }
    text.join(", ")
}

/// Name and type of each property; [`Problem::List`] if one is a list.
pub(super) fn scalar_properties(element: &ElementDef) -> Result<Vec<(&str, Scalar)>, Problem> {
    let scalar_of = |(name, property): (_, &ply_rs_bw::ply::PropertyDef)| match &property.data_type {
        PropertyType::Scalar(scalar) => Ok((name, Scalar::of(scalar))),
        PropertyType::List(..) => Err(Problem::List { name: property.name.clone() }),
    };
    element.properties.iter().map(|(name, property)| scalar_of((name.as_str(), property))).collect()
}

/// Returns the SH degree, or an error if these are not the properties of a splat.
fn check_is_splat(properties: &[(&str, Scalar)]) -> Result<u8, Problem> {
    let has: BTreeMap<&str, Scalar> = properties.iter().copied().collect();
    let optional = |name: &str| name == THIRD_SCALE;
    let missing: Vec<_> =
        REQUIRED.iter().map(|r| r.0).filter(|name| !has.contains_key(name) && !optional(name)).collect();
    if !missing.is_empty() {
        let shape = ["opacity", "scale_0", "rot_0"];
        return Err(if has.contains_key("x") && !shape.iter().any(|name| has.contains_key(name)) {
            Problem::PointCloud
        } else {
            Problem::NotASplat { missing: missing.into_iter().map(str::to_owned).collect() }
        });
    }
    sh_degree_of(has.keys().copied())
}

/// The SH degree implied by the number of properties `f_rest_*` among `names`.
pub(super) fn sh_degree_of<'a>(names: impl Iterator<Item = &'a str>) -> Result<u8, Problem> {
    let mut indices: Vec<usize> = names.filter_map(sh_rest_index).collect();
    indices.sort_unstable();
    let contiguous = indices.iter().enumerate().take_while(|(i, index)| i == *index).count();
    match (indices.len() == contiguous, contiguous) {
        (true, 0) => Ok(0),
        (true, 9) => Ok(1),
        (true, 24) => Ok(2),
        (true, 45) => Ok(3),
        _ => Err(Problem::ShCount { found: indices.len(), contiguous }),
    }
}

/// The size of what lies between the header and the vertices: bytes in a binary file, lines in an ascii file.
fn size_before(elements: &[ElementDef], encoding: &Encoding) -> Result<u128, Problem> {
    let mut size = 0;
    for element in elements {
        size += match encoding {
            Encoding::Ascii => element.count as u128,
            _ => {
                let properties = scalar_properties(element);
                let properties = properties.map_err(|_| Problem::ListBeforeVertex { name: element.name.clone() })?;
                let stride: usize = properties.iter().map(|(_, scalar)| scalar.bytes()).sum();
                element.count as u128 * stride as u128
            }
        };
    }
    Ok(size)
}
