//! The options of each stage: the types of the fields of [`Options`](crate::Options).
//!
//! Begin with [`Options::of_scene`](crate::Options::of_scene), [`Preset::options`](crate::Preset::options) or the
//! default, and set fields.

pub use crate::consensus::Options as ConsensusOptions;
pub use crate::grasp::Options as GraspOptions;
pub use crate::materials::Options as MaterialsOptions;
pub use crate::parts::Options as PartsOptions;
pub use crate::query::{AnswerSource, Options as QueryOptions};
pub use crate::scene::{Options as SceneOptions, ScaleChoice};
pub use crate::segment::Options as SegmentOptions;
pub use crate::setup::Options as SetupOptions;
pub use crate::simulate::Options as SimulateOptions;
pub use crate::vote::Options as VoteOptions;
