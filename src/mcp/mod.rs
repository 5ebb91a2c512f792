//! A server of the Model Context Protocol on stdio: a program lists tools, calls them, and gets text and pictures back.
//!
//! 1. [`protocol`]: messages, one in each line.
//! 2. [`roots`]: the folders that may be touched.
//! 3. [`server`]: the handshake, calls beside each other, progress and cancellation.
//! 4. [`program`]: a tool's work, done by the program itself as a process of its own, which tells its [`events`].
//!
//! The tools come from the command line ([`Tools`]), so they are the program's commands with their options. The official SDK
//! is not used: `rmcp` 3.11 with its server on stdio alone, without macros, takes about 50 seconds of processor time to compile
//! beyond what gprop has anyway, mostly for its types of messages that gprop neither sends nor takes; what is needed is this room.

mod events;
mod program;
mod protocol;
mod roots;
mod server;

pub use events::tell_the_server;
pub use program::Finished;
pub use protocol::Refused;
pub use roots::Roots;
pub use server::{About, Call, Content, Outcome, Tools, serve};
