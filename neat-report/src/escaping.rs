//! Text that must stay text inside of HTML.

use serde::Serialize;

/// JSON that can stand in a `<script>` element: no character of it can end the
/// element, begin a comment, or end a line of JavaScript. The escapes are part of
/// JSON, so that it parses to the same value.
pub(crate) fn json_for_script(value: &impl Serialize) -> Result<String, serde_json::Error> {
    let json = serde_json::to_string(value)?;
    let mut escaped = String::with_capacity(json.len() + json.len() / 64);
    for character in json.chars() {
        match character {
            // All of these occur in strings only: JSON has no such punctuation.
            '<' => escaped.push_str("\\u003c"),
            '>' => escaped.push_str("\\u003e"),
            '&' => escaped.push_str("\\u0026"),
            '\u{2028}' => escaped.push_str("\\u2028"),
            '\u{2029}' => escaped.push_str("\\u2029"),
            other => escaped.push(other),
        }
    }
    Ok(escaped)
}

/// Text as the content of an HTML element or a quoted attribute. Control characters,
/// of which HTML allows white space only, are replaced.
pub(crate) fn html_text(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            control if control.is_control() && !control.is_ascii_whitespace() => {
                escaped.push(char::REPLACEMENT_CHARACTER);
            }
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nothing_ends_the_script() {
        let hostile = "</script><!-- <script> --> & \u{2028}\u{2029} \"\\ \0 ]]>";
        let json = json_for_script(&hostile).unwrap();
        for forbidden in ['<', '>', '&', '\u{2028}', '\u{2029}', '\0'] {
            assert!(!json.contains(forbidden), "{json}");
        }
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), hostile);
        assert_eq!(
            html_text("<b title=\"x\">'&'</b>"),
            "&lt;b title=&quot;x&quot;&gt;&#39;&amp;&#39;&lt;/b&gt;"
        );
        assert_eq!(
            html_text("a\0\u{1b}[31m\u{85}\tb"),
            "a\u{fffd}\u{fffd}[31m\u{fffd}\tb"
        );
    }

    proptest! {
        #[test]
        fn any_text_survives(text in any::<String>()) {
            let json = json_for_script(&text).unwrap();
            let harmless = !json.contains(['<', '>', '&', '\u{2028}', '\u{2029}']);
            prop_assert!(harmless);
            prop_assert_eq!(serde_json::from_str::<String>(&json).unwrap(), text.clone());
            let harmless = !html_text(&text).contains(['<', '>', '"', '\'']);
            prop_assert!(harmless);
        }
    }
}
