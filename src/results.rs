//! What the stages find, in SI units: the results of a [`Pipeline`](crate::Pipeline), and the types of their fields.

pub use crate::grasp::candidates::Candidate;
pub use crate::grasp::{ForceRule, GraspReport, Infeasible, Inputs, Intervals, Limit, PartChoice, Policy, Reason};
pub use crate::materials::Law;
pub use crate::materials::fillings::FillingKind;
pub use crate::parts::{
    AskedPart, BelievedChoice, BelievedHypothesis, BelievedPart, BelievedThing, Filling, KnownMass, NoVolume, Object,
    ObjectBelief, Part, PartBody, Parts, Width,
};
pub use crate::query::{Answer, Answers, Failure, Form, Inside, Match, Outcome, SubjectAnswer, SubjectId, Why};
pub use crate::segment::{LabelMap, Level, Segment, Segmentation, ViewSegments};
pub use crate::simulate::material::{PoissonCapped, Softened};
pub use crate::simulate::{FilledReport, FrameSummary, RigidReport, SimulationReport, StepReport};
pub use crate::units::{Estimate, MetricScale, Range, ScaleSource, ShoreHardness, ShoreScale};
pub use crate::vote::{Contents, Corrected, Correction, FieldPart, Filled, MaterialField};
