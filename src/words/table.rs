//! Tables of comma-separated values for spreadsheets, which take text that looks like a formula for one.

use super::output::one_line;

/// A cell with a text from outside: in quotation marks whatever it holds, on one line, without characters that are not shown,
/// and never a formula.
///
/// A spreadsheet takes text for a formula if it begins with one of [`BEGINS_A_FORMULA`], also behind spaces, and in many
/// countries it separates cells at semicolons, whatever stands around them. An apostrophe marks what follows as text.
pub fn text_cell(text: &str) -> String {
    let mut cell = String::with_capacity(text.len() + 2);
    let mut is_at_start = true;
    for c in one_line(text).chars() {
        if is_at_start && BEGINS_A_FORMULA.contains(&c) {
            cell.push('\'');
        }
        is_at_start = c == ';' || is_at_start && (c.is_whitespace() || c == '"');
        cell.push(c);
        if c == '"' {
            cell.push(c);
        }
    }
    format!("\"{cell}\"")
}

/// Signs that begin a formula, in ASCII and in the full-width, small and mathematical forms that spreadsheets take for the same.
const BEGINS_A_FORMULA: [char; 13] = ['=', '+', '-', '@', '＝', '＋', '－', '＠', '﹦', '﹢', '﹣', '﹫', '−'];

/// A row of finished cells: numbers as they are, texts as [`text_cell`] writes them.
pub fn row(cells: impl IntoIterator<Item = String>) -> String {
    cells.into_iter().collect::<Vec<_>>().join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_no_formula_whatever_a_spreadsheet_separates_at() {
        let cases = [
            ("oak, white", r#""oak, white""#),
            ("a \"lid\"", r#""a ""lid""""#),
            ("-5 C", r#""'-5 C""#),
            ("=1+1", r#""'=1+1""#),
            (" \u{3000}+1", "\" \u{3000}'+1\""),
            ("\"=1+1", r#""""'=1+1""#),
            ("＝1+1", r#""'＝1+1""#),
            ("steel;=1+1; -1", r#""steel;'=1+1; '-1""#),
            ("\t=1+1", r#""\t=1+1""#),
            ("\r\n=1+1", r#""\r\n=1+1""#),
            ("\u{feff}=1+1", r#""\ufeff=1+1""#),
            ("well-known", r#""well-known""#),
        ];
        for (text, cell) in cases {
            assert_eq!(text_cell(text), cell);
        }
    }
}
