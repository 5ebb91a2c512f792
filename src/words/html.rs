//! The template engine of all pages: text from outside can neither end an element or a script nor hide how it reads.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::value::{Kwargs, Serde};
use minijinja::{AutoEscape, Environment, Error, ErrorKind, Value, escape_formatter, filters};

use super::output::harmless;

/// An engine that escapes all text in HTML, and shows the characters that are [never shown](super::output::is_not_shown) as
/// they are as escapes, also in the data that a page's script reads (`tojson`).
pub fn engine() -> Environment<'static> {
    let mut engine = Environment::new();
    engine.set_auto_escape_callback(|_| AutoEscape::Html);
    engine.set_formatter(|out, state, value| match value.as_str() {
        Some(text) if !value.is_safe() => escape_formatter(out, state, &Value::from(harmless(text))),
        _ => escape_formatter(out, state, value),
    });
    engine.add_filter("tojson", data);
    engine
}

/// The address of a picture that is within the page.
pub fn jpeg_url(jpeg: &[u8]) -> String {
    format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg))
}

/// JSON for a page's script, which shows the strings in it.
fn data(value: &Value) -> Result<Value, Error> {
    let json = serde_json::to_value(value)
        .map_err(|error| Error::new(ErrorKind::InvalidOperation, "this is not JSON").with_source(error))?;
    filters::tojson(&Value::from(Serde(shown(json))), None, Kwargs::from_iter::<[(&str, Value); 0]>([]))
}

fn shown(json: serde_json::Value) -> serde_json::Value {
    match json {
        serde_json::Value::String(text) => harmless(&text).into(),
        serde_json::Value::Array(all) => all.into_iter().map(shown).collect(),
        serde_json::Value::Object(all) => {
            all.into_iter().map(|(key, value)| (harmless(&key).into_owned(), shown(value))).collect()
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use minijinja::context;

    use super::*;

    #[test]
    fn what_a_page_shows_is_harmless_in_its_text_and_in_its_data() {
        let evil = "</script>\u{200f}\u{feff}\u{e0041}\u{1b}";
        let page =
            engine().render_str("<p>{{ evil }}</p><script>{{ all|tojson }}</script>", context! { evil, all => [evil] });
        let escapes = r"\u200f\ufeff\udb40\udc41\u001b";
        let in_json = escapes.replace('\\', r"\\");
        let slash = "&lt;&#x2f;script&gt;";
        assert_eq!(
            page.unwrap(),
            format!(r#"<p>{slash}{escapes}</p><script>["\u003c/script\u003e{in_json}"]</script>"#)
        );
    }
}
