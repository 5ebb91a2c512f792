//! The common style of gprop's pages: colours of the light and the dark theme, fonts, tables, the button that switches
//! the theme.

use minijinja::{AutoEscape, Environment, Value, escape_formatter};

use crate::words::output::harmless;
use crate::words::output::thousands;

/// Colours, fonts, tiles, tables.
const STYLE: &str = include_str!("base.css");
/// The script of the button `#theme`.
const THEME: &str = include_str!("theme.js");

/// A template engine for pages. It escapes all text from outside, makes control characters visible, and provides
/// `base_style`, `theme_script` and the filters `thousands` and `seconds`.
pub fn engine() -> Environment<'static> {
    let mut engine = Environment::new();
    engine.set_auto_escape_callback(|_| AutoEscape::Html);
    engine.set_formatter(|out, state, value| match value.as_str() {
        Some(text) if !value.is_safe() => escape_formatter(out, state, &Value::from(harmless(text))),
        _ => escape_formatter(out, state, value),
    });
    engine.add_global("base_style", minijinja::Value::from_safe_string(STYLE.to_owned()));
    engine.add_global("theme_script", minijinja::Value::from_safe_string(THEME.to_owned()));
    engine.add_filter("thousands", thousands);
    engine.add_filter("seconds", |seconds: f64| format!("{seconds:.1}"));
    engine
}
