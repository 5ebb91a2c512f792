//! Conversions between camera conventions: they bring the cameras of one program into the frame of another program's
//! splat.
//!
//! The steps in order: the pose is taken as read, with its rotation transposed, or inverted as a whole; the camera's
//! own axes are flipped; the world's axes are exchanged and negated; the camera centres are scaled; all cameras are moved
//! together by a similarity. Written `transposed+camera-yz+world=x,-z,y+scale=10+sim=S,QW,QX,QY,QZ,TX,TY,TZ`.
//!
//! What the user types is an [`Align`]: such a conversion, or the name of a trainer whose [similarity](super::gsplat)
//! follows from the cameras and points of the capture.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::gsplat::HalfTurn;
use crate::config::as_typed::as_typed;

/// `--align`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Align {
    By(Conversion),
    /// The similarity with which gsplat's trainer moves COLMAP's cameras, and a half turn about an axis of its result.
    Gsplat(HalfTurn),
}

impl Default for Align {
    fn default() -> Self {
        Self::By(Conversion::default())
    }
}

impl From<Conversion> for Align {
    fn from(conversion: Conversion) -> Self {
        Self::By(conversion)
    }
}

impl fmt::Display for Align {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::By(conversion) => conversion.fmt(f),
            Self::Gsplat(turn) => turn.fmt(f),
        }
    }
}

impl FromStr for Align {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let alone = HalfTurn::ALL.into_iter().find(|turn| turn.to_string() == text.trim());
        match alone {
            Some(turn) => Ok(Self::Gsplat(turn)),
            None if text.contains("gsplat") => {
                Err("gsplat, gsplat-x, gsplat-y and gsplat-z stand alone: they compute the whole conversion".to_owned())
            }
            None => text.parse().map(Self::By),
        }
    }
}

/// A change of camera convention. For its result to be a valid camera, it must mirror the camera's axes if and only if it
/// mirrors the world's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    pub reading: Reading,
    /// The camera axes (x, y, z) that are negated. OpenGL and OpenCV differ in y and z.
    pub camera_flip: [bool; 3],
    pub world: SignedPermutation,
    /// Factor applied to the camera centres.
    pub scale: f64,
    /// Maps the world that the cameras are in by then to the splat's.
    pub similarity: Similarity3<f64>,
}

/// How to read the pose in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    AsIs,
    /// The centre is right, but the rotation is transposed; the camera uses OpenCV's axes.
    Transposed,
    /// The same for a camera in OpenGL's axes.
    TransposedOpenGl,
    /// World-to-camera instead of the expected camera-to-world, or the other way round.
    Inverted,
}

/// New axes from old ones: axis `i` of the new world is axis `from[i]` of the old one, negated if `negative[i]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SignedPermutation {
    from: [usize; 3],
    negative: [bool; 3],
}

const AXES: [char; 3] = ['x', 'y', 'z'];

impl SignedPermutation {
    pub const IDENTITY: Self = Self { from: [0, 1, 2], negative: [false; 3] };

    /// All 48, the identity first.
    pub fn all() -> Vec<Self> {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [2, 1, 0], [1, 0, 2], [1, 2, 0], [2, 0, 1]];
        let signs = |n: u8| [0, 1, 2].map(|axis| n >> axis & 1 == 1);
        ORDERS.iter().flat_map(|from| (0..8).map(move |n| Self { from: *from, negative: signs(n) })).collect()
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| match (self.from[row] == column, self.negative[row]) {
            (true, true) => -1.0,
            (true, false) => 1.0,
            (false, _) => 0.0,
        })
    }

    /// True if it turns a right-handed frame into a left-handed one.
    pub fn mirrors(&self) -> bool {
        self.matrix().determinant() < 0.0
    }
}

impl Default for Conversion {
    fn default() -> Self {
        let world = SignedPermutation::IDENTITY;
        let similarity = Similarity3::identity();
        Self { reading: Reading::AsIs, camera_flip: [false; 3], world, scale: 1.0, similarity }
    }
}

impl Conversion {
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// True if the result is a valid camera: its axes are mirrored if and only if the world's are.
    pub fn is_proper(&self) -> bool {
        let flips = self.camera_flip.iter().filter(|flip| **flip).count();
        self.world.mirrors() == (flips % 2 == 1)
    }

    /// The camera after the conversion.
    pub fn apply(&self, camera_from_world: &Isometry3<f64>) -> Isometry3<f64> {
        let (rotation, center) = self.reading.apply(camera_from_world);
        let world = self.world.matrix();
        let camera = camera(self.flip() * rotation * world.transpose(), world * center * self.scale);
        moved(&camera, &self.similarity)
    }

    /// The length that a unit of the cameras' world has after the conversion.
    pub fn scaling(&self) -> f64 {
        self.scale * self.similarity.scaling()
    }

    /// The camera before the conversion, from the one after it.
    pub fn undo(&self, camera_from_world: &Isometry3<f64>) -> Isometry3<f64> {
        let camera_from_world = moved(camera_from_world, &self.similarity.inverse());
        let (rotation, center) = Reading::AsIs.apply(&camera_from_world);
        let world = self.world.matrix();
        let read = camera(self.flip() * rotation * world, world.transpose() * center / self.scale);
        // Every reading is its own inverse.
        let (rotation, center) = self.reading.apply(&read);
        camera(rotation, center)
    }

    fn flip(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::from(self.camera_flip.map(|flip| if flip { -1.0 } else { 1.0 })))
    }
}

impl Reading {
    /// The rotation from the world to the camera, and the camera's centre in the world.
    fn apply(self, camera_from_world: &Isometry3<f64>) -> (Matrix3<f64>, Point3<f64>) {
        let center = camera_from_world.inverse_transform_point(&Point3::origin());
        let rotation = camera_from_world.rotation.to_rotation_matrix().into_inner();
        let opengl = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        match self {
            Self::AsIs => (rotation, center),
            Self::Transposed => (rotation.transpose(), center),
            Self::TransposedOpenGl => (opengl * rotation.transpose() * opengl, center),
            Self::Inverted => (rotation.transpose(), camera_from_world.translation.vector.into()),
        }
    }
}

/// The same camera in the new world that `new_from_old` maps the old one to.
pub(crate) fn moved(camera_from_world: &Isometry3<f64>, new_from_old: &Similarity3<f64>) -> Isometry3<f64> {
    let world_from_camera = camera_from_world.inverse();
    let center = new_from_old * Point3::from(world_from_camera.translation.vector);
    let rotation = new_from_old.isometry.rotation * world_from_camera.rotation;
    Isometry3::from_parts(center.coords.into(), rotation).inverse()
}

/// The pose of a camera with this rotation from the world and this centre.
fn camera(rotation: Matrix3<f64>, center: Point3<f64>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let rotation = UnitQuaternion::new_normalize(rotation.into_inner());
    Isometry3::from_parts((rotation * -center.coords).into(), rotation)
}

impl fmt::Display for Conversion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        match self.reading {
            Reading::AsIs => {}
            Reading::Transposed => parts.push("transposed".to_owned()),
            Reading::TransposedOpenGl => parts.push("transposed-opengl".to_owned()),
            Reading::Inverted => parts.push("inverted".to_owned()),
        }
        let flipped: String =
            AXES.iter().zip(self.camera_flip).filter(|(_, flip)| *flip).map(|(axis, _)| *axis).collect();
        if !flipped.is_empty() {
            parts.push(format!("camera-{flipped}"));
        }
        if self.world != SignedPermutation::IDENTITY {
            let axis =
                |i: usize| format!("{}{}", if self.world.negative[i] { "-" } else { "" }, AXES[self.world.from[i]]);
            parts.push(format!("world={},{},{}", axis(0), axis(1), axis(2)));
        }
        if self.scale != 1.0 {
            parts.push(format!("scale={}", self.scale));
        }
        if self.similarity != Similarity3::identity() {
            let numbers: Vec<String> = numbers_of(&self.similarity).iter().map(f64::to_string).collect();
            parts.push(format!("sim={}", numbers.join(",")));
        }
        f.write_str(if parts.is_empty() { "none" } else { "" })?;
        f.write_str(&parts.join("+"))
    }
}

impl FromStr for Conversion {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut conversion = Self::default();
        let mut given: Vec<&str> = Vec::new();
        for part in text.split('+').map(str::trim).filter(|part| *part != "none") {
            let unknown = || {
                format!(
                    "`{part}` is not one of transposed, transposed-opengl, inverted, camera-AXES, world=A,B,C, scale=F, \
                     sim=S,QW,QX,QY,QZ,TX,TY,TZ (finite numbers, S above zero, a quaternion), or alone gsplat, gsplat-x, \
                     gsplat-y, gsplat-z"
                )
            };
            let changed = match part.split_once(['=', '-']) {
                Some(("camera", axes)) => {
                    conversion.camera_flip = AXES.map(|axis| axes.contains(axis));
                    if axes.is_empty() || !axes.chars().all(|axis| AXES.contains(&axis)) {
                        return Err(unknown());
                    }
                    "the camera's axes"
                }
                Some(("world", axes)) => {
                    conversion.world = permutation(axes).ok_or_else(unknown)?;
                    "the world's axes"
                }
                Some(("scale", factor)) => {
                    let factor = factor.parse().ok().filter(|factor| f64::is_normal(*factor) && *factor > 0.0);
                    conversion.scale = factor.ok_or_else(unknown)?;
                    "the scale"
                }
                Some(("sim", numbers)) => {
                    conversion.similarity = similarity(numbers).ok_or_else(unknown)?;
                    "the similarity"
                }
                _ => {
                    conversion.reading = reading(part).ok_or_else(unknown)?;
                    "how the poses are read"
                }
            };
            if given.contains(&changed) {
                return Err(format!("`{part}` is the second part that changes {changed}; give only one"));
            }
            given.push(changed);
        }
        if conversion.is_proper() {
            Ok(conversion)
        } else {
            Err("it mirrors the pictures: flip one more or one fewer of the camera's axes".to_owned())
        }
    }
}

fn reading(name: &str) -> Option<Reading> {
    match name {
        "transposed" => Some(Reading::Transposed),
        "transposed-opengl" => Some(Reading::TransposedOpenGl),
        "inverted" => Some(Reading::Inverted),
        _ => None,
    }
}

/// Scale, rotation as w x y z, translation.
fn numbers_of(similarity: &Similarity3<f64>) -> [f64; 8] {
    let rotation = similarity.isometry.rotation;
    let [x, y, z] = similarity.isometry.translation.vector.into();
    [similarity.scaling(), rotation.w, rotation.i, rotation.j, rotation.k, x, y, z]
}

/// The same similarity, rounded to few enough digits to be typed: it moves nothing by more than a millionth of its size.
pub(crate) fn rounded(similarity: &Similarity3<f64>) -> Similarity3<f64> {
    const DIGITS: usize = 7;
    let short = numbers_of(similarity).map(|value| format!("{value:.DIGITS$e}").parse().unwrap_or(value));
    from_numbers(short).unwrap_or(*similarity)
}

fn similarity(text: &str) -> Option<Similarity3<f64>> {
    let numbers: Vec<f64> = text.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?;
    from_numbers(numbers.try_into().ok()?)
}

fn from_numbers([scale, w, i, j, k, x, y, z]: [f64; 8]) -> Option<Similarity3<f64>> {
    let quaternion = Quaternion::new(w, i, j, k);
    // A quaternion of length one stays as it is: what is printed is what is read.
    let is_unit = (quaternion.norm() - 1.0).abs() < 1e-6;
    let rotation = if is_unit {
        Some(UnitQuaternion::new_unchecked(quaternion))
    } else {
        UnitQuaternion::try_new(quaternion, 1e-6)
    };
    let finite = [w, i, j, k, x, y, z].iter().all(|value| value.is_finite());
    (finite && scale.is_normal() && scale > 0.0)
        .then(|| Some(Similarity3::from_parts(Translation3::new(x, y, z), rotation?, scale)))
        .flatten()
}

fn permutation(text: &str) -> Option<SignedPermutation> {
    let axes: Vec<(usize, bool)> = text
        .split(',')
        .map(|axis| {
            let (name, negative) = axis.strip_prefix('-').map_or((axis, false), |name| (name, true));
            AXES.iter().position(|known| name == known.to_string()).map(|index| (index, negative))
        })
        .collect::<Option<_>>()?;
    let axes: [(usize, bool); 3] = axes.try_into().ok()?;
    let from = axes.map(|(index, _)| index);
    let all_there = (0..3).all(|axis| from.contains(&axis));
    all_there.then_some(SignedPermutation { from, negative: axes.map(|(_, negative)| negative) })
}

/// Serialized in the form that users type.
impl Serialize for Align {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Align {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}
