//! The common style of gprop's pages: colours of the light and the dark theme, fonts, tables, the button that switches
//! the theme.

use minijinja::Environment;

use crate::words::html;
use crate::words::output::thousands;

/// Colours, fonts, tiles, tables.
const STYLE: &str = include_str!("base.css");
/// The script of the button `#theme`.
const THEME: &str = include_str!("theme.js");

/// The [template engine](html::engine) with `base_style`, `theme_script` and the filters `thousands` and `seconds`.
pub fn engine() -> Environment<'static> {
    let mut engine = html::engine();
    engine.add_global("base_style", minijinja::Value::from_safe_string(STYLE.to_owned()));
    engine.add_global("theme_script", minijinja::Value::from_safe_string(THEME.to_owned()));
    engine.add_filter("thousands", thousands);
    engine.add_filter("seconds", |seconds: f64| format!("{seconds:.1}"));
    engine
}
