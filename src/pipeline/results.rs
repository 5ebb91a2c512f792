//! The results of the stages, for callers that use gprop as a library.
//!
//! Asking for a result runs the stages that it needs, unless this pipeline or an earlier run did them with the same
//! options, and reads their results from the work folder.

use anyhow::Result;

use super::{Pipeline, Stage};
use crate::error::Error;
use crate::grasp::GraspReport;
use crate::parts::{Parts, PartsError};
use crate::query::Answers;
use crate::segment::Segmentation;
use crate::simulate::SimulationReport;
use crate::vote::MaterialField;

impl Pipeline {
    /// The segments that SAM cuts out of each chosen photo, nested: a label map in pixels of the photo, and for each
    /// segment its area, box, quality and the segment in which it lies.
    ///
    /// # Errors
    /// If SAM or ONNX Runtime is missing, a photo cannot be read, or the work folder cannot be written.
    pub fn segments(&mut self) -> Result<&Segmentation, Error> {
        self.up_to(Stage::Segment)?;
        self.segmentation().map_err(Error)
    }

    /// The answer to each question about a part (or a segment, with `--ask segments`), in SI units, or why there is none.
    ///
    /// # Errors
    /// As for [`segments`](Self::segments); also if an answer is not recorded and no server can give it.
    pub fn answers(&mut self) -> Result<&Answers, Error> {
        self.up_to(Stage::Query)?;
        self.stored_answers().map_err(Error)
    }

    /// The label, votes and confidence of each Gaussian, in the order of the splat, and what each label stands for, in
    /// SI units.
    ///
    /// # Errors
    /// As for [`answers`](Self::answers); also if no view has a segment with an answer.
    pub fn field(&mut self) -> Result<&MaterialField, Error> {
        self.up_to(Stage::Vote)?;
        self.stored_field().map_err(Error)
    }

    /// The object and its parts in metres and kilograms, positions in the world frame.
    ///
    /// # Errors
    /// As for [`field`](Self::field); also if the metric scale is unknown, or nothing is inside the object.
    pub fn parts(&mut self) -> Result<Parts, Error> {
        self.up_to(Stage::Parts)?;
        metric(self.stored_parts())
    }

    /// The simulation frame by frame, in SI units; the frames themselves are in the work folder. Simulates even if runs
    /// and reports leave the simulation out ([`Builder::without_simulation`](super::Builder::without_simulation)).
    ///
    /// # Errors
    /// As for [`parts`](Self::parts), but an unknown metric scale is assumed; also if the simulation fails.
    pub fn simulation(&mut self) -> Result<SimulationReport, Error> {
        let in_runs = std::mem::replace(&mut self.simulates, true);
        let done = self.up_to(Stage::Simulate);
        self.simulates = in_runs;
        done.and_then(|()| self.stored_simulation().map_err(Error))
    }

    /// The forces with which a gripper may hold the object, in newtons, and the places to grasp at, in metres in the
    /// world frame.
    ///
    /// # Errors
    /// As for [`parts`](Self::parts); also if the object cannot be grasped, or a part or point that the options name does
    /// not exist.
    pub fn grasp(&mut self) -> Result<GraspReport, Error> {
        // If only a report needed it, a grasp that cannot be computed was a warning. Here it is an error, which says why.
        if self.done.contains(&Stage::Grasp) && self.found_no_place() {
            self.done.retain(|stage| *stage != Stage::Grasp);
        }
        self.up_to(Stage::Grasp)?;
        metric(self.stored_grasp())
    }

    /// Does the stages that `to` needs and that this pipeline has not done yet. The plan of [`run`](Self::run) stays.
    fn up_to(&mut self, to: Stage) -> Result<(), Error> {
        let last = std::mem::replace(&mut self.plan.to, to);
        let done = self.carry_out();
        self.plan.to = last;
        done.map_err(Error)
    }
}

/// A result that exists only if the metric scale is known.
fn metric<T>(found: Result<Option<T>>) -> Result<T, Error> {
    found.and_then(|found| Ok(found.ok_or(PartsError::ScaleUnknown)?)).map_err(Error)
}
