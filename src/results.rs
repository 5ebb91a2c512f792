//! What the stages find, in SI units: the results of a [`Pipeline`](crate::Pipeline).

pub use crate::grasp::candidates::Candidate;
pub use crate::grasp::{GraspReport, Limit, Reason};
pub use crate::parts::{Object, Part, Parts};
pub use crate::query::{Answer, Answers, Failure, Outcome, SubjectAnswer};
pub use crate::segment::{LabelMap, Level, Segment, Segmentation, ViewSegments};
pub use crate::simulate::SimulationReport;
pub use crate::units::{Estimate, MetricScale, Range, ShoreHardness};
pub use crate::vote::{FieldLabel, MaterialField};
