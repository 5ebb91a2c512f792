//! All cameras that a calibration found, whether or not their photos are there, and the points that it found.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3};

use super::align::{Align, Conversion};
use super::gsplat::{self, HalfTurn};
use super::{CameraSource, Capture, Kind, colmap};
use crate::files::read_scope::ReadScope;
use crate::scene::SceneError;

/// The registered cameras and points, in one frame: that of the camera file.
#[derive(Debug, Clone, Default)]
pub struct Registered {
    /// Before `--align`.
    camera_from_world: Vec<Isometry3<f64>>,
    /// COLMAP's 3D points.
    points: Option<PathBuf>,
}

impl Registered {
    /// The cameras of `capture`; the points of its model too, unless they lie outside of `scope`.
    pub(in crate::scene) fn of(capture: &Capture, choice: &CameraSource, scope: &ReadScope) -> Self {
        let points = Some(choice).filter(|choice| choice.kind == Kind::Colmap);
        let points = points.and_then(|choice| colmap::points_file(&choice.path));
        Self {
            camera_from_world: capture.frames.iter().map(|frame| frame.camera_from_world).collect(),
            points: points.filter(|path| scope.leads_out(path).is_none()),
        }
    }

    /// Forgets the points, whose frame the cameras have left.
    pub(in crate::scene) fn without_points(self) -> Self {
        Self { points: None, ..self }
    }

    /// The file with the points.
    pub(in crate::scene) fn points(&self) -> Option<&Path> {
        self.points.as_deref()
    }

    /// The conversion that `align` stands for.
    pub(in crate::scene) fn conversion(&self, align: &Align) -> Result<Conversion, SceneError> {
        let turn = match align {
            Align::By(conversion) => return Ok(*conversion),
            Align::Gsplat(turn) => *turn,
        };
        let refused = |problem| SceneError::Align { given: align.to_string(), problem };
        if self.points.is_none() {
            return Err(refused(
                "it is computed from COLMAP's 3D points, and there is no points3D.bin or points3D.txt beside these cameras (or \
                 a dataparser_transforms.json moves them)",
            ));
        }
        let found = self.of_gsplat()?.into_iter().find(|(other, _)| *other == turn);
        found.map(|(_, conversion)| conversion).ok_or_else(|| refused("the cameras or the points are all in one place"))
    }

    /// The conversions that gsplat may have applied; none without points.
    ///
    /// # Errors
    /// If the file of the points is broken.
    pub fn of_gsplat(&self) -> Result<Vec<(HalfTurn, Conversion)>, SceneError> {
        let Some(path) = &self.points else { return Ok(Vec::new()) };
        let points = colmap::read_points(path)?;
        let conversion = |turn| {
            let similarity = gsplat::similarity(&self.camera_from_world, &points, turn)?;
            Some((turn, Conversion { similarity, ..Conversion::default() }))
        };
        Ok(HalfTurn::ALL.into_iter().filter_map(conversion).collect())
    }

    /// The registered points; none if they are not known.
    ///
    /// # Errors
    /// If their file is broken.
    pub fn read_points(&self) -> Result<Vec<Point3<f64>>, SceneError> {
        self.points.as_deref().map_or_else(|| Ok(Vec::new()), colmap::read_points)
    }
}
