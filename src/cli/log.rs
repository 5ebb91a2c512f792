//! The log on stderr.

use std::fmt;

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::format::{Format, Full, Writer};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;

use crate::words::progress;

use super::Global;

/// Shows warnings and notices, and more if the user wants it.
pub fn start(global: &Global) {
    let filter = match (global.quiet, global.verbose) {
        (true, _) | (false, 0) => Targets::new().with_default(Level::WARN),
        (false, 1) => Targets::new().with_target("gprop", Level::INFO),
        (false, _) => Targets::new().with_target("gprop", Level::DEBUG),
    };
    let log = tracing_subscriber::fmt().with_max_level(Level::DEBUG).with_writer(|| progress::Log);
    let lines = Format::default().without_time().with_target(global.verbose > 0);
    log.event_format(LogLines(lines)).finish().with(filter).init();
}

/// Events as lines: a [notice](progress::notice) as it is, any other with its level.
struct LogLines(Format<Full, ()>);

impl<S, N> FormatEvent<S, N> for LogLines
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut line: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        if event.metadata().target() != progress::NOTICE {
            return self.0.format_event(context, line, event);
        }
        context.format_fields(line.by_ref(), event)?;
        writeln!(line)
    }
}
