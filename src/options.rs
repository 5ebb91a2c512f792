//! The options of each stage: the types of the fields of [`Options`](crate::Options), and of their fields.
//!
//! Begin with [`Options::of_scene`](crate::Options::of_scene), [`Preset::options`](crate::Preset::options) or the
//! default, and set fields.

pub use crate::consensus::{AskAbout, Options as ConsensusOptions};
pub use crate::grasp::{ForceRule, Options as GraspOptions, Policy};
pub use crate::materials::Options as MaterialsOptions;
pub use crate::parts::{BodiesAs, MassReading, Options as PartsOptions, VolumeMethod};
pub use crate::query::ask::cost::UsdPerMtok;
pub use crate::query::{AnswerSource, Context, Guidance, Hints, LabelSet, Options as QueryOptions};
pub use crate::scene::cameras::align::Align;
pub use crate::scene::{
    MaskChoice, ObjectBox, ObjectChoice, Options as SceneOptions, PhotoPoint, QuaternionOrder, ScaleChoice, UpChoice,
};
pub use crate::segment::{DecoderRuntime, GeneratorOptions, Options as SegmentOptions, PointPrompts, SelectionOptions};
pub use crate::setup::Options as SetupOptions;
pub use crate::simulate::animation::Viewpoint;
pub use crate::simulate::material::Soften;
pub use crate::simulate::{Fillings, Ground, Options as SimulateOptions};
pub use crate::vote::{Agreement, Options as VoteOptions, Rule, Setting};
