//! What gprop's pages share: colours in light and dark, type, tables, the button that turns the theme.

use minijinja::{AutoEscape, Environment};

use super::numbers::thousands;

/// Colours, type, tiles, tables.
const STYLE: &str = include_str!("look/base.css");
/// What the button `#theme` does.
const THEME: &str = include_str!("look/theme.js");

/// An engine for a page's template. It escapes all that comes from outside, and knows `base_style`, `theme_script` and the
/// filters `thousands` and `seconds`.
pub fn engine() -> Environment<'static> {
    let mut engine = Environment::new();
    engine.set_auto_escape_callback(|_| AutoEscape::Html);
    engine.add_global("base_style", minijinja::Value::from_safe_string(STYLE.to_owned()));
    engine.add_global("theme_script", minijinja::Value::from_safe_string(THEME.to_owned()));
    engine.add_filter("thousands", thousands);
    engine.add_filter("seconds", |seconds: f64| format!("{seconds:.1}"));
    engine
}
